"""Upkeep of stations: bias, new tables, planted faults, clocks, and the command.

Kind of truth: simulation by stations and years that are not the model; closed forms.
"""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from conftest import EXAMPLE
from drawn_stations import (
    CONTEST,
    DRAWING,
    POSE,
    draw_tank,
    drawn_stock,
    posed_station,
    posed_volume,
)
from draws import draws
from example_logs import Station, TrueTank, make_station, make_upright, write_station
from numpy.testing import assert_allclose
from station_years import draw_from_model, draw_year, liquid_factor, make_table

from tankcal import cli
from tankcal.products.quantity.table import TankTable, read_table
from tankcal.products.upkeep.causes import PRIORS, Operation, TableStock
from tankcal.products.upkeep.estimation import _solve, estimate
from tankcal.products.upkeep.flows import MeterFlow
from tankcal.products.upkeep.logs import find_offset_s
from tankcal.products.upkeep.reading import read_upkeep
from tankcal.products.upkeep.steps import Marks, Steps
from tankcal.products.upkeep.upkeep import _error_ratio, keep_up, update_table
from tankcal.products.upkeep.watching import watch

START = np.datetime64("2025-01-06T00:00:00", "ns").astype(np.int64)


# ---- bias of the scale


def move_liquid(rng, *, steps=2000, area_m2=10.0):
    """Steps of 0.5 m3 in a straight tank; (operation, steps, true relative scale, dip errors)."""
    scale, factor = 0.005 * rng.normal(), 0.0015 * rng.normal()
    sold = np.where((np.arange(steps) // 500) % 2 == 0, 0.5, -0.5)
    inside = 280 * (1 + scale) - np.append(0, np.cumsum(sold * (1 + factor)))
    error = 2e-4 * rng.normal(size=steps + 1)
    read = inside / (area_m2 * (1 + scale)) + error
    height = np.array([0.0, 30.0])
    volume = area_m2 * height
    table = TankTable(
        "t", "vertical", height, volume, 0.005 * volume[:, None], np.full(2, np.inf), 0.0, 15.0, 0.0
    )
    marks = Marks(np.arange(steps + 1) * 3600 * 10**9, read, np.zeros(steps + 1),
                  np.full(steps + 1, 15.0))  # fmt: skip
    blank, none = np.full(steps, np.nan), np.zeros(steps, dtype=int)
    priors = dict.fromkeys(PRIORS["station"], 0.0) | {
        "gauge_wander_days": 5.0, "layer_h": 12.0, "meter_percent": 0.15, "level_mm": 0.2,
    }  # fmt: skip
    tank = Steps(marks, ("m",), sold[:, None], blank[:, None], np.zeros(steps), blank, none, none)
    return Operation(TableStock(table, 0.0, 15.0), {}, priors), tank, scale, error


@pytest.mark.slow
def test_scale_has_no_bias(monkeypatch):
    """2000 steps, levels 2 L, scale 0.5 %, meter 0.15 %: u 1437 ppm, mean error zero.

    Columns at the levels as read make it -n u^2, that is -2.9 u; adjusted levels are within 0.1 u
    of the true levels.
    """
    errors, u = [], 1437e-6
    for seed in range(20):
        operation, steps, scale, error = move_liquid(np.random.default_rng(seed))
        adjusted = estimate(operation, steps, is_robust=False)
        with monkeypatch.context() as patched:
            patched.setattr("tankcal.products.upkeep.estimation.PASSES", 1)
            read = estimate(operation, steps, is_robust=False)
        at_true = operation.linearize(steps, smoothed=np.stack([error, 0 * error, 0 * error], 1))
        true = _solve(at_true, None)[1].estimate[0]
        assert 0.005 * adjusted.sizes()[1][0] == pytest.approx(u, rel=0.02)
        errors.append([0.005 * size - scale for size in
                       (adjusted.sizes()[0][0], read.sizes()[0][0], true)])  # fmt: skip
    adjusted, read, true = np.mean(errors, axis=0) / u
    print("scale, mean error in u: adjusted, as read, true levels:", adjusted, read, true)
    assert abs(adjusted) < 3 / np.sqrt(len(errors))
    assert abs(adjusted - true) < 0.1
    assert (read - true) * u == pytest.approx(-2000 * u**2, rel=0.05)


def draw_layers(rng, table):
    """Half a year of a station whose only errors are layers of 0.4 K and dips."""
    year = draw_year(rng, table, days=180, tank=TrueTank())
    steps, warm, layer = year.steps, year.steps.marks.temperature_c, [0.0]
    gone = steps.sold_m3.sum(axis=1) * liquid_factor((warm[1:] + warm[:-1]) / 2)
    came = steps.delivered_m3 * liquid_factor(np.nan_to_num(steps.delivered_c, nan=15.0))
    for seconds, count in zip(steps.seconds, steps.tickets, strict=True):
        layer.append(layer[-1] * np.exp(-seconds / 43200) + (count > 0) * 0.4 * rng.normal())
    stock = 14 + np.append(0.0, np.cumsum(came - gone))
    level = year.tank.level(stock / liquid_factor(warm + np.array(layer)))
    level = level + 0.12e-3 * rng.normal(size=len(level))
    year.steps = replace(steps, marks=replace(steps.marks, level_m=level))
    means = ("loss_l_h", "vapour_percent", "hose_l", "meter_wear_ppm", "air_percent")
    year.operation.priors = PRIORS["station"] | dict.fromkeys(means, 0.0)
    return year


@pytest.mark.slow
def test_layers_do_not_bias_contents():
    """A layer raises the level of an equal stock: columns at this level would share its error.

    Such columns made contents of a drawing 30 L too large, 0.3 u.
    """
    table, heights, ratios = make_table(DRAWING), np.array([0.5, 1.1, 1.8]), []
    for seed in range(12):
        year = draw_layers(np.random.default_rng(300 + seed), table)
        estimation = estimate(year.operation, year.steps)
        x = estimation.triangle.estimate[: len(year.operation.stock.names)]
        columns = year.operation.stock.columns(heights, x)
        u = np.linalg.norm(columns @ estimation.triangle.root[: len(x)], axis=1)
        ratios.append((year.operation.stock.volume_m3(heights, x) - year.tank.below(heights)) / u)
    print("contents with layers, mean error over u:", np.mean(ratios),
          np.std(np.mean(ratios, axis=1)) / np.sqrt(len(ratios)))  # fmt: skip
    assert abs(np.mean(ratios)) < 0.15


# ---- new table


@pytest.fixture(scope="module")
def table():
    return make_table()


def test_change_is_judged_by_the_difference_of_squares():
    """U 0.60 before and 0.46 after: a change of 0.385 has E_n 1."""
    assert _error_ratio(0.385, 0.60, 0.46) == pytest.approx(1.0, abs=1e-3)
    assert _error_ratio(0.1, 0.60, 0.60) is None


def test_new_table_keeps_covariance_outside(table):
    """Increments above the levels keep the former covariance; inside it is C P C'."""
    year = draw_year(np.random.default_rng(2), table, days=25)
    estimation = estimate(year.operation, year.steps)
    low, high = 0.9, 1.3
    volume, factor = update_table(estimation, year.operation.stock, low, high)
    stock, new = year.operation.stock, replace(table, volume_m3=volume, factor_m3=factor)
    above = np.array([high, 2.2])
    former = np.linalg.norm(np.diff(table.factor(above), axis=0))
    # The increment has C x - C x' = (C - C') x, and x keeps its prior covariance.
    assert np.linalg.norm(np.diff(new.factor(above), axis=0)) == pytest.approx(former, rel=1e-9)
    assert_allclose(np.diff(new.volume(above)), np.diff(table.volume(above)), rtol=1e-12)
    inside = np.array([1.0, 1.2])
    count = len(stock.names)
    columns = stock.columns(inside, np.zeros(count))
    expected = columns @ estimation.covariance[:count, :count] @ columns.T
    assert_allclose(new.factor(inside) @ new.factor(inside).T, expected, rtol=1e-8)
    ratio = new.volume(np.array([0.0, 0.4, low])) / table.volume(np.array([0.0, 0.4, low]))
    assert_allclose(ratio, ratio[-1], rtol=1e-9)


@pytest.mark.study
def test_tables_deliveries_and_meters_hold(table):
    """40 stations of 200 days: share within 95 % intervals, at least 88 % of 40."""
    held = {"rows": [], "delivery": [], "meters": []}
    for seed in range(40):
        year = draw_year(np.random.default_rng(1000 + seed), table, days=200)
        estimation = estimate(year.operation, year.steps)
        levels = estimation.balance.level_m
        volume, factor = update_table(estimation, year.operation.stock, levels.min(), levels.max())
        new = replace(table, volume_m3=volume, factor_m3=factor)
        rows = np.array([0.8, 1.1, 1.4])
        error = new.volume(rows) - year.tank.below(rows)
        held["rows"].append(np.abs(error) < 1.96 * np.linalg.norm(new.factor(rows), axis=1))
        spread = np.linalg.norm(new.factor(rows[[-1]]) - new.factor(rows[[0]]))
        held["delivery"].append(abs(error[-1] - error[0]) < 1.96 * spread)
        causes, (size, u) = estimation.balance.causes, estimation.sizes()
        place = causes.place("meter")
        factors = np.array([year.factors[causes.names[i].removeprefix("meter ")] for i in place])
        held["meters"].append(np.abs(size[place] / 100 - factors) < 1.96 * u[place] / 100)
    share = {name: float(np.mean(values)) for name, values in held.items()}
    print(share)
    assert min(share.values()) > 0.88


@pytest.mark.study
def test_deliveries_of_stations_from_drawings_hold():
    """20 stations of a year with the table of a drawing: all deliveries within 95 % intervals.

    With the columns of the gauge at the levels as read, the mean error was 1.3 u, and 5 of 6 held.
    """
    drawing, ratios = make_table(DRAWING), []
    for seed in range(20):
        year = draw_year(np.random.default_rng(9000 + seed), drawing, days=365, sizes=DRAWING)
        estimation = estimate(year.operation, year.steps)
        levels = estimation.balance.level_m
        ends = np.array([levels.min(), levels.max()])
        volume, factor = update_table(estimation, year.operation.stock, *ends)
        new = replace(drawing, volume_m3=volume, factor_m3=factor)
        error = np.diff(new.volume(ends) - year.tank.below(ends))[0]
        ratios.append(error / np.linalg.norm(np.diff(new.factor(ends), axis=0)))
    print("deliveries by drawings, mean and rms of error over u:", np.mean(ratios),
          np.sqrt(np.mean(np.square(ratios))))  # fmt: skip
    assert np.mean(np.abs(ratios) < 1.96) >= 0.9
    assert abs(np.mean(ratios)) < 0.5


@pytest.mark.study
def test_contents_of_other_tanks_hold():
    """Stations from drawings with other ends, rings of 3 mm and a flatter section.

    With the table linear in the sizes, and with the sizes, section and ends as causes at their
    estimates. docs/studies/upkeep.md has 110 stations.
    """
    heights, stock = np.array([0.5, 0.8, 1.1, 1.4, 1.8]), drawn_stock()
    table, ratios = make_table(DRAWING), {"table": [], "sizes": []}
    for seed in range(draws(20, 110)):
        rng = np.random.default_rng(40000 + seed)
        year = draw_year(rng, table, days=180, sizes=DRAWING, tank=draw_tank(rng))
        for name, now in (("table", year.operation.stock), ("sizes", stock)):
            estimation = estimate(replace(year.operation, stock=now), year.steps)
            count = len(now.names)
            x = estimation.triangle.estimate[:count]
            columns = now.columns(heights, x)
            u = np.sqrt(np.einsum("ij,jk,ik->i", columns, estimation.covariance[:count, :count],
                                  columns))  # fmt: skip
            ratios[name].append((now.volume_m3(heights, x) - year.tank.below(heights)) / u)
        stock.known.clear()
    for name, values in ratios.items():
        print("contents of other tanks by", name, np.mean(np.abs(values) < 1.96), np.mean(values))
        assert np.mean(np.abs(values) < 1.96) >= 0.8  # levels of a station share their error
        assert abs(np.mean(values)) < 1.0


# ---- twin of a contest


def test_capacity_of_the_contest_tank():
    """Public solutions of CUMCM 2010 A state 64.664 m3."""
    assert posed_volume(CONTEST, np.array([3.0]))[0] == pytest.approx(64.664, abs=1e-3)


@pytest.mark.slow
def test_pose_and_refill_of_the_twin():
    """Sales of a tank with the published pose: pitch 2.12, roll 4.24 degrees, before a refill.

    The data of the contest are no text in public repositories, so a twin is simulated. The pose and
    the refill, which is predicted blindly, are within 3 u, and their errors over u near 1.
    """
    ratios, pitch, roll = [], np.radians(2.12), np.radians(4.24)
    for seed in range(20):
        operation, steps, tank, factor = posed_station(np.random.default_rng(seed), pitch, roll)
        estimation = estimate(operation, steps, is_robust=False)
        x, covariance = estimation.triangle.estimate, estimation.covariance
        true = [pitch / POSE["pitch"], (1 - np.cos(roll)) / POSE["lowering"], (factor - 1) / 1e-3]
        ends = np.array([steps.marks.level_m[-1], 2.5])
        refill = np.diff(operation.stock.columns(ends, x[:2]), axis=0)[0]
        error = np.diff(operation.stock.volume_m3(ends, x[:2]) - tank(ends))[0]
        u = np.append(np.sqrt(np.diag(covariance)), np.sqrt(refill @ covariance[:2, :2] @ refill))
        ratios.append(np.append(x - true, error) / u)
        assert u[-1] < 0.01  # m3, of 45 m3
    ratios = np.array(ratios)
    print("twin, rms error over u of pitch, roll, meter, refill:",
          np.sqrt(np.mean(ratios**2, axis=0)))  # fmt: skip
    assert np.all(np.abs(ratios) < 3)
    assert np.all(np.sqrt(np.mean(ratios**2, axis=0)) < 1.5)


# ---- planted faults


FAULTS = {"leak": (0.757, 1), "zero": (0.003, 1000), "meter": (0.01, 100), "ticket": (0.02, 100)}


def find_fault(table, kind, seed, days, begin):
    """Suspect of the planted kind, which is named alone or among the inseparable causes."""
    size, unit = FAULTS[kind]
    year = draw_year(np.random.default_rng(seed), table, days=days, faults={kind: (begin, size)})
    watched = watch(estimate(year.operation, year.steps))
    assert begin - 1 < watched.alarm_s / 86400 < days - 1
    suspect = next(cause for cause in watched.names if cause.kind == kind)
    assert suspect.member in (None, "1")
    assert abs(suspect.size - unit * size) < 3 * suspect.sd
    assert watched.is_named or len(watched.names) > 1
    return suspect


@pytest.mark.slow
def test_planted_leak_is_named(table):
    """A leak of day 38.3: its beginning within two days, its rate within 3 u."""
    suspect = find_fault(table, "leak", 1, 60, 38.3)
    assert suspect.start_s / 86400 == pytest.approx(38.3, abs=2.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("kind", FAULTS)
def test_planted_faults_are_named(table, kind, seed):
    """A fault of day 80 is found before day 120, and named, or named among the inseparable."""
    find_fault(table, kind, seed, 120, 80.0)


@pytest.mark.study
def test_rates_of_early_leaks_hold(table):
    """Leaks of 0.757 L/h after 20 days, with beginnings on all days of a week: rate within U.

    Weekly beginnings alone made such rates up to 2.7 u too small. docs/studies/upkeep.md has 168.
    """
    ratios = []
    for seed in range(35):
        rng = np.random.default_rng(20000 + seed)
        begin = 100 + seed % 7 + rng.random()
        year = draw_year(rng, table, days=int(begin) + 20, faults={"leak": (begin, 0.757)})
        watched = watch(estimate(year.operation, year.steps))
        leak = next(cause for cause in watched.names if cause.kind == "leak")
        ratios.append((leak.size - 0.757) / leak.sd)
    print("leaks, share within U, mean and rms of error over u:", np.mean(np.abs(ratios) < 1.96),
          np.mean(ratios), np.sqrt(np.mean(np.square(ratios))))  # fmt: skip
    assert np.mean(np.abs(ratios) < 1.96) >= 0.88  # 31 of 35: 2 % of valid runs are lower
    assert abs(np.mean(ratios)) < 0.55


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 5, 6])
def test_years_without_a_fault_have_no_alarm(table, seed):
    year = draw_year(np.random.default_rng(seed), table, days=120)
    assert watch(estimate(year.operation, year.steps)).alarm_s is None


@pytest.mark.study
@pytest.mark.parametrize("by", ["model", "generator"])
def test_false_alarms(table, by):
    """Years without a fault, promised 5 %: 3 to 7 % by the model, under 10 % by the generator.

    A limit by the model alone gave 9 alarms in 16 years of a generator that is not the model.
    """
    years, alarms = draws(50, 1000), 0
    base = draw_year(np.random.default_rng(5000), table, days=364)
    base = estimate(base.operation, base.steps, is_robust=False)
    for seed in range(years):
        if by == "model":
            estimation = draw_from_model(np.random.default_rng(70000 + seed), base)
        else:
            year = draw_year(np.random.default_rng(5000 + seed), table, days=364)
            estimation = estimate(year.operation, year.steps)
        alarms += watch(estimation).alarm_s is not None
    print("alarms in years without a fault, by", by, alarms, years)
    low, high = (0.03, 0.07) if by == "model" else (0.0, 0.10)
    # 50 years: beyond the 1 and 99 % quantiles of a rate within these bounds.
    margin = 0 if years >= 1000 else 4
    assert low * years - margin <= alarms <= high * years + margin


@pytest.mark.parametrize("late_s", [0, 600, -300, 3600])
def test_late_clock(late_s):
    """Levels of a clock that is late, against sales: the offset is found to its grid."""
    tank = TrueTank()
    data = Station(days=4, tank=tank, period_s=120.0).run(np.random.default_rng(1))
    begin, end, litres = (np.array([sale[i] for sale in data["sales"]]) for i in (0, 1, 3))
    order = np.argsort(end)
    flow = MeterFlow("all", *((1e9 * values[order]).astype(np.int64) for values in (end, begin)),
                     np.append(0.0, np.cumsum(litres[order] / 1000)), np.zeros(len(end) + 1),
                     np.zeros((0, 2), dtype=np.int64))  # fmt: skip
    time, level = data["levels"]
    found = find_offset_s((1e9 * (time + late_s)).astype(np.int64), tank.below(level), [flow])
    assert found == pytest.approx(late_s, abs=60)


# ---- the command


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """Record of the example of rings."""
    place = tmp_path_factory.mktemp("former") / "rings"
    shutil.copytree(EXAMPLE.parent / "rings", place)
    assert cli.main(["run", str(place), "--no-papers", "--quiet"]) == 0
    return place / "results" / "record.json"


def write_logs(folder, record, days, seed=7, **values):
    """Folder of a station with the tank of a record, its logs divided into months."""
    former = read_table(record)
    tank = TrueTank()
    tank.grid, tank.volume = former.height_m, former.volume_m3
    data = Station(days=days, tank=tank, period_s=300.0, **values).run(np.random.default_rng(seed))
    write_station(folder, data)
    shutil.copy(record, folder)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("kind", ["late", "jump", "drift"])
def test_wrong_clocks_are_named(record, tmp_path, kind, seed):
    """A clock 600 s late, set by an hour on day 30, or losing 20 s a day: warning and cause.

    Levels are then read during sales. The alarm names the clock beside the other causes.
    """
    former, folder = read_table(record), tmp_path / "station"
    tank = TrueTank()
    tank.grid, tank.volume = former.height_m, former.volume_m3
    data = Station(days=60, tank=tank).run(np.random.default_rng(seed))
    time, level = data["levels"]
    shift = {"late": 600.0, "jump": np.where(time > 30 * 86400, 3600.0, 0.0),
             "drift": 20 * time / 86400}[kind]  # fmt: skip
    data["levels"] = time + shift, level
    write_station(folder, data)
    shutil.copy(record, folder)
    inputs = read_upkeep(folder)
    offset = {"late": 600, "jump": 3600, "drift": 1200}[kind]
    # A week of drift is 140 s.
    assert inputs.clock[1] == pytest.approx(offset, abs=200 if kind == "drift" else 60)
    assert any("clock" in str(warning) for warning in inputs.warnings)
    watched = keep_up(inputs).watch
    assert watched.alarm is not None
    assert not watched.is_named
    clock = watched.suspects[0]
    assert clock.kind == "clock"
    assert clock.is_possible
    day = (np.datetime64(clock.day) - np.datetime64("2025-01-06")).astype(int)
    first, last = {"late": (0, 1), "jump": (29, 37), "drift": (2, 15)}[kind]
    assert first <= day <= last


def divide_by_month(folder):
    """Divide the logs of a folder into a file for each month; {month: names of its files}."""
    settings, months = (folder / "upkeep.toml").read_text(), {}
    for name in ("levels.csv", "meters.csv.log", "deliveries.csv"):
        stem = name.partition(".")[0]
        heading, *lines = (folder / name).read_text().splitlines()
        (folder / name).unlink()
        for line in lines:
            file = folder / f"{stem}-{line[:7]}.csv"
            if not file.exists():
                file.write_text(f"{heading}\n")
                months.setdefault(line[:7], []).append(file)
            with file.open("a") as stream:
                stream.write(f"{line}\n")
        settings = settings.replace(name, f"{stem}-2*.csv")
    (folder / "upkeep.toml").write_text(settings)
    return months


@pytest.mark.slow
def test_months_with_state_equal_a_single_run(record, tmp_path, capsys, monkeypatch):
    """A year by months, with kept state, a run that is stopped, and a damaged file."""
    folder, state = tmp_path / "station", tmp_path / "state"
    write_logs(folder, record, 210)
    months, later = divide_by_month(folder), tmp_path / "later"
    later.mkdir()
    for files in list(months.values())[-2:]:
        for file in files:
            file.rename(later / file.name)
    run = ["upkeep", str(folder), "--json"]
    with_state = [*run, "--state", str(state)]
    assert cli.main(with_state) == 0
    whole = sorted(state.iterdir())
    whole[0].write_bytes(whole[0].read_bytes()[:100])  # damaged
    first = capsys.readouterr().out
    for file in later.iterdir():
        file.rename(folder / file.name)
    with monkeypatch.context() as patched:  # stopped before the search for causes
        patched.setattr(
            "tankcal.products.upkeep.watching._watch_window",
            lambda *arguments: (_ for _ in ()).throw(KeyboardInterrupt),
        )
        assert cli.main(with_state) == 130
    capsys.readouterr()
    assert cli.main(with_state) == 0
    by_months = capsys.readouterr().out
    assert cli.main(run) == 0
    assert by_months == capsys.readouterr().out != first
    assert not [path for path in state.iterdir() if path.suffix != ".npz"]


def run_example(make, record, folder, days):
    """(truth, saved upkeeps of its folders) of an example."""
    truth = make(record, folder, days)
    return truth, *(
        run_twice(place)
        for place in (folder, folder / "first", folder / "second")
        if (place / "upkeep.toml").exists()
    )


def run_twice(folder):
    """Saved upkeep of a folder; the second run takes its results from the state."""
    out = folder.with_name(f"{folder.name}-results")
    run = ["upkeep", str(folder), "--state", str(folder / "state"), "--out", str(out), "--quiet"]
    assert cli.main(run) == 0
    saved = (out / "upkeep.json").read_bytes()
    if json.loads(saved)["mode"] == "improved":
        run += ["--record", str(folder.with_name("table"))]
    assert cli.main(run) == 0
    assert (out / "upkeep.json").read_bytes() == saved
    return json.loads(saved)


@pytest.mark.slow
def test_example_of_a_station(record, tmp_path, capsys):
    """The shipped example, 400 days: table and meters within U, the leak named, months fail."""
    truth, saved, second = run_example(make_station, record, tmp_path / "station", 400)
    assert saved["mode"] == "improved"
    assert saved["watch"]["alarm"] is None
    whole = saved["deliveries"][-1]
    former = read_table(record)
    ends = np.array([whole["low_m"], whole["high_m"]]) - truth["zero_m"]
    true = (1 + truth["scale"]) * np.diff(former.volume(ends))[0]
    assert abs(whole["volume_m3"] - true) < whole["U_m3"] < 0.5 * whole["former_U_m3"]
    for meter in saved["meters"]:
        error = meter["deviation_percent"] - 100 * truth["meters"][meter["name"]]
        assert abs(error) < 1.3 * meter["U_percent"]
    assert second["rows"][0]["former_m3"] == saved["rows"][0]["volume_m3"]
    assert "alarm" in second["reasons"]
    alarm = (np.datetime64(second["watch"]["alarm"]) - np.datetime64("2025-01-06")).astype(int)
    assert truth["leak_day"] < alarm < truth["leak_day"] + 10
    assert second["watch"]["is_named"]
    assert second["watch"]["suspects"][0]["kind"] == "leak"
    verdicts = {month["month"]: month for month in second["months"]}
    assert verdicts["2025-09"]["verdict"] == "pass"
    for month in ("2025-12", "2026-01"):  # the loss goes on, and stays a loss
        assert verdicts[month]["verdict"] == "fail"
        assert abs(verdicts[month]["leak_l_h"] - 0.65) < 1.5 * verdicts[month]["U_l_h"]
    assert "leak or another loss by time" in capsys.readouterr().out
    archive = [str(tmp_path / "station" / name) for name in ("first-results", "second-results")]
    assert cli.main(["history", str(record), *archive, "--out", str(tmp_path / "history")]) == 0
    shown = capsys.readouterr().out
    assert shown.count("; FAIL") == sum(row["verdict"] == "fail" for row in second["months"]) > 1
    rows = (tmp_path / "history" / "months.csv").read_text().splitlines()
    assert len(rows) == 1 + len(saved["months"]) + len(second["months"])
    assert sum(second["watch"]["alarm"] in row for row in rows) == 1


@pytest.mark.slow
def test_example_of_an_upright_tank(tmp_path, capsys):
    """The shipped example, 200 days: the loading rack is calibrated by the tank, within U."""
    job = tmp_path / "strapping"
    shutil.copytree(EXAMPLE.parent / "strapping", job)
    assert cli.main(["run", str(job), "--no-papers", "--quiet"]) == 0
    record = job / "results" / "record.json"
    truth, saved = run_example(make_upright, record, tmp_path / "upright", 200)
    meter = saved["meters"][0]
    assert abs(meter["deviation_percent"] - 100 * truth["meters"]["rack"]) < meter["U_percent"]
    assert meter["U_percent"] < 0.3 * meter["prior_percent"]
    whole = saved["deliveries"][-1]
    former = read_table(record)
    ends = np.array([whole["low_m"], whole["high_m"]]) - truth["zero_m"]
    true = (1 + truth["scale"]) * np.diff(former.volume(ends))[0]
    assert abs(whole["volume_m3"] - true) < whole["U_m3"] <= whole["former_U_m3"]
    assert saved["watch"]["alarm"] is None
    capsys.readouterr()


def exports_of(job):
    """Rows of the exported table of a job of a batch."""
    (file,) = (job / "export").glob("*.csv")
    return file.read_text().splitlines()


@pytest.mark.slow
@pytest.mark.parametrize("language", ["en", "es", "pt-BR"])
def test_batch_lists_alarms(record, tmp_path, capsys, language):
    """Two tanks, of which one loses 0.757 L/h from day 30 on: the summary names its alarm."""
    for name, fault in (("valid", ""), ("leaking", "leak")):
        write_logs(tmp_path / "site" / name, record, 60, fault=fault, fault_day=30.0,
                     fault_size=0.757 * 3)  # fmt: skip
    out = tmp_path / "out"
    batch = ["batch", str(tmp_path / "site"), "--do", "upkeep", "--no-papers", "--out", str(out),
             "--workers", "0", "--language", language, "--quiet"]  # fmt: skip
    assert cli.main(batch) == 0
    rows = {row["name"]: row for row in json.loads((out / "summary.json").read_text())["rows"]}
    assert rows["valid"]["alarm_verdict"] == "none"
    assert rows["leaking"]["alarm_verdict"] in ("named", "open")
    assert "leak" in rows["leaking"]["causes"]
    assert "2025-02" in rows["leaking"]["alarm"]
    expected = {"en": "ALARM", "es": "ALARMA", "pt-BR": "ALARME"}[language]
    assert expected in (out / "summary.html").read_text()
    outcome = (out / "jobs" / "valid" / "upkeep" / "upkeep.json").stat().st_mtime_ns
    assert cli.main(batch) == 0  # nothing changed
    assert (out / "jobs" / "valid" / "upkeep" / "upkeep.json").stat().st_mtime_ns == outcome
    (alarm,) = (out / "alarms.csv").read_text().splitlines()[1:]
    assert alarm.startswith("leaking,")
    assert rows["leaking"]["alarm"] in alarm
    assert cli.main([*batch[:3], "run,upkeep", *batch[4:]]) == 2
    assert "upkeep" in capsys.readouterr().err
    # Neither table is improved, so that both exports are those of the former table.
    assert cli.main([*batch[:3], "upkeep,export", "--profile", "csv", *batch[4:]]) == 0
    exports = [exports_of(out / "jobs" / name) for name in ("valid", "leaking")]
    assert exports[0] == exports[1]
    assert len(exports[0]) > 50
    assert not (out / "jobs" / "valid" / "table").exists()


@pytest.fixture(scope="module")
def improved(record, tmp_path_factory):
    """Folder of a station whose levels move over half of the tank, and its new record."""
    place = tmp_path_factory.mktemp("improved")
    write_logs(place / "station", record, 60, sales_a_day=120, low_m3=6.0, load_m3=24.0)
    (place / "station" / "meters.csv").write_text(
        "meter,factor,u_factor_ppm,certificate\n1,1,300,C-1\n2,1,300,C-2\n3,1,300,\n4,1,300,\n"
    )
    run = ["upkeep", str(place / "station"), "--record", str(place / "new"), "--quiet"]
    assert cli.main(run) == 0
    return place


@pytest.mark.slow
def test_new_record_is_a_record(record, improved, tmp_path, capsys):
    """The new record has the new table, is verified bit by bit, and its papers can be made."""
    new, former = read_table(improved / "new" / "record.json"), read_table(record)
    out = tmp_path / "out"
    assert cli.main(["upkeep", str(improved / "station"), "--out", str(out), "--quiet"]) == 0
    saved = json.loads((out / "upkeep.json").read_text())
    assert saved["mode"] == "improved"
    assert_allclose(new.volume_m3, [row["volume_m3"] for row in saved["rows"]], rtol=1e-12)
    u = np.linalg.norm(new.factor_m3, axis=1)
    assert_allclose(saved["k"] * u, [row["U_m3"] for row in saved["rows"]], rtol=1e-9)
    dips = np.array([0.5, 1.5])
    spread = np.linalg.norm(np.diff(new.factor(dips), axis=0))
    assert spread < 0.6 * np.linalg.norm(np.diff(former.factor(dips), axis=0))
    assert abs(np.diff(new.volume(dips) - former.volume(dips))[0]) < 2 * spread
    capsys.readouterr()
    assert cli.main(["verify", str(improved / "new"), "--job", str(improved / "station")]) == 0
    assert "identical bit for bit" in capsys.readouterr().out
    content = json.loads((improved / "new" / "record.json").read_text())
    assert [meter["certificate"] for meter in content["upkeep"]["meters"]] == ["C-1", "C-2", None,
                                                                               None]  # fmt: skip
    # Meter and table share the scale: the correlation is that of upkeep.json.
    meter, stated = content["upkeep"]["meters"][0], saved["meters"][0]
    ends = np.array([saved["period"]["lowest_m"], saved["period"]["highest_m"]])
    between = np.diff(new.factor(ends), axis=0)[0]
    correlation = between @ meter["covariance_with_inputs"] / np.linalg.norm(between) / meter["u"]
    assert correlation == pytest.approx(stated["correlation"], abs=2e-3)


@pytest.mark.slow
def test_batch_exports_the_improved_table(improved, tmp_path, capsys):
    """The exported table of a batch is that of `upkeep --record` and `export`."""
    batch = ["batch", str(improved / "station"), "--do", "upkeep,export", "--profile", "csv"]
    batch += ["--no-papers", "--out", str(tmp_path / "out"), "--workers", "0", "--quiet"]
    assert cli.main(batch) == 0
    single = tmp_path / "single" / "export" / "table.csv"
    single.parent.mkdir(parents=True)
    record = str(improved / "new" / "record.json")
    assert cli.main(["export", record, "--profile", "csv", "--out", str(single)]) == 0
    assert exports_of(tmp_path / "out" / "jobs" / "station") == exports_of(tmp_path / "single")
    capsys.readouterr()


@pytest.mark.slow
def test_data_do_not_count_twice(improved, tmp_path, capsys):
    """The logs of a table, or times within its data, are refused as data of its next upkeep."""
    folder = tmp_path / "again"
    shutil.copytree(improved / "station", folder)
    shutil.copy(improved / "new" / "record.json", folder)
    assert cli.main(["upkeep", str(folder), "--quiet"]) == 2
    assert "levels.csv: the table in force contains this log" in capsys.readouterr().err
    for name in ("levels.csv", "meters.csv.log", "deliveries.csv"):
        path = folder / name
        path.write_text(path.read_text() + "\n")
    assert cli.main(["upkeep", str(folder), "--quiet"]) == 2
    assert "2025-03-06; expected later data" in capsys.readouterr().err


@pytest.mark.slow
def test_no_certificate_without_a_traceable_meter(improved, tmp_path, capsys):
    folder, new = tmp_path / "station", tmp_path / "new"
    shutil.copytree(improved / "station", folder)
    (folder / "meters.csv").unlink()
    assert cli.main(["upkeep", str(folder), "--record", str(new), "--quiet"]) == 0
    assert cli.main(["report", str(new), "--quiet"]) == 0
    names = {path.name for path in new.iterdir()}
    assert "working-papers.pdf" in names
    assert not names & {"certificate.pdf", "certificate.xml"}
    capsys.readouterr()


@pytest.fixture(scope="module")
def station(record, tmp_path_factory):
    """Folder of a station with the tank of the example of rings, 40 days."""
    place = tmp_path_factory.mktemp("upkeep") / "station"
    write_logs(place, record, 40)
    return place


@pytest.mark.slow
def test_command_writes_and_reports(station, tmp_path, capsys):
    out = tmp_path / "out"
    assert cli.main(["upkeep", str(station), "--out", str(out), "--quiet"]) == 0
    saved = json.loads((out / "upkeep.json").read_text())
    assert saved["mode"] == "watched"
    assert saved["period"]["used"] > 100
    assert saved["watch"]["alarm"] is None
    assert {"upkeep.pdf", "upkeep.xlsx", "table.csv", "months.csv"} <= {
        p.name for p in out.iterdir()
    }
    for language in ("es", "pt-BR"):
        assert cli.main(["report", str(out), "--language", language, "--quiet"]) == 0
    verify = ["verify", str(out), "--job", str(station), "--quiet"]
    assert cli.main(verify) == 0
    assert "all equal" in capsys.readouterr().out
    saved["deliveries"][0]["U_m3"] *= 1.001
    (out / "upkeep.json").write_text(json.dumps(saved))
    assert cli.main(verify) == 2
    assert "U_m3" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after", "text"),
    [
        ('timezone = "UTC"\n', "", "timezone"),
        ('"UTC"', '"Mars/Olympus"', "Mars/Olympus"),
        ('files = ["levels.csv"]', 'files = ["levels.csv", "copy.csv"]', "levels.csv"),
        ('files = ["levels.csv"]', 'files = ["none-*.csv"]', "none-"),
        ('files = ["levels.csv"]', 'profile = "plane"\nfiles = ["levels.csv"]', "plain"),
        ('record = "record.json"', 'record = "elsewhere"', "elsewhere"),
    ],
)
def test_bad_input_is_one_line(station, tmp_path, capsys, before, after, text):
    folder = tmp_path / "bad"
    shutil.copytree(station, folder)
    shutil.copy(folder / "levels.csv", folder / "copy.csv")
    settings = folder / "upkeep.toml"
    assert before in settings.read_text()
    settings.write_text(settings.read_text().replace(before, after))
    assert cli.main(["upkeep", str(folder), "--quiet"]) == 2
    assert text in capsys.readouterr().err


def test_empty_input_files(tmp_path, capsys):
    for language in ("en", "es", "pt-BR"):
        folder = tmp_path / language
        assert cli.main(["upkeep", str(folder), "--new", "--language", language]) == 0
        assert cli.main(["upkeep", str(folder), "--quiet"]) == 2
    capsys.readouterr()
