"""Of every volume that is stated: low <= V <= high, and low < high where anything is uncertain."""

import json
from dataclasses import replace

import numpy as np
import openpyxl
import pandas as pd
import pytest
from draws import draws
from job_builder import write_job

import tankcal
from tankcal.errors import ProgramError
from tankcal.gum.monte_carlo import Verdict
from tankcal.job import StatedVolume
from tankcal.pipeline.simulation.curvature import gum_intervals, judged_intervals
from tankcal.record import record_of, save
from tankcal.record.schema import to_plain
from tankcal.record.table import budgets_of
from tankcal.report import workbook
from tankcal.report.outputs import write_tables
from tankcal.text.display import volume_text

LYING = {
    "horizontal.tilt_mm_per_m": 6.0,
    "horizontal.dip_from_a_m": 2.0,
    "table.step_m": 0.04,
}
OF_LYING = [("tilt", 1.0, "mm/m"), ("diameter", 3.0, "mm"), ("length", 5.0, "mm")]
CONE = {"bottom.form": "cone", "table.step_m": 0.05}
KINDS = {
    "lying": {"kind": "horizontal", "settings": LYING, "uncertainty": OF_LYING},
    "sphere": {"kind": "sphere", "settings": {"sphere.diameter_m": 4.0, "table.step_m": 0.04}},
    "cone up": {"settings": CONE | {"bottom.centre_z_m": 0.15}},
    "cone down": {"settings": CONE | {"bottom.centre_z_m": -0.15}},
    "roof": {
        "roof": {},
        "settings": {"table.liquid_density_kg_m3": 850.0, "table.step_m": 0.05},
    },
    "deadwood": {
        "deadwood": [("coil", 0.5, 1.0, -0.2), ("box", 0.0, 0.3, -0.5)],
        "settings": {"table.step_m": 0.05},
    },
}
DATUM = [("datum", 1.0, "mm"), ("scale", 20, "ppm")]


def holds(low, volume, high, u):
    """Which intervals hold their volume and, where it varies, more than it."""
    varies = np.asarray(u) > 0
    return (low <= volume) & (volume <= high) & (~varies | (low < high))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_interval_holds_its_volume(kind, tmp_path):
    parts = dict(KINDS[kind])
    parts["uncertainty"] = DATUM + parts.get("uncertainty", [])
    result = tankcal.run(tankcal.load(write_job(tmp_path / "job", **parts)), simulated=True)
    table, found = result.table, result.intervals
    assert np.all(found.by_gum) == (kind == "cone down")  # there dip 0 is far above the empty tank
    assert np.all(holds(found.low_m3, table.volume_m3, found.high_m3, table.u_m3))
    one, delivered = result.simulation.delivered, result.simulation.of_delivered
    assert np.all(holds(delivered.low_m3, one.volume_m3, delivered.high_m3, one.u_m3))
    for stated in to_plain(budgets_of(result)):
        assert holds(*(stated[key] for key in ("low_m3", "volume_m3", "high_m3", "u_m3")))


def random_job(rng):
    """Parts of a job of any kind, with inputs of any size, distribution and dof."""
    kind = rng.choice([*KINDS])
    parts = dict(KINDS[kind])
    settings = dict(parts["settings"])
    settings["table.step_m"] = float(rng.choice([0.05, 0.1]))
    declared = [("datum", rng.choice([0.5, 2.0, 5.0]), "mm"), ("scale", rng.choice([5, 50]), "ppm")]
    if kind == "lying":
        length = float(rng.uniform(4, 20))
        settings |= {
            "horizontal.length_m": length,
            "horizontal.diameter_m": float(rng.uniform(1.5, 3)),
            "horizontal.tilt_mm_per_m": float(rng.uniform(-8, 8)),
            "horizontal.dip_from_a_m": float(rng.uniform(0.1, 0.9)) * length,
        }
        declared += [("tilt", rng.choice([0.2, 1, 4]), "mm/m"), ("diameter", 3.0, "mm")]
    elif kind.startswith("cone"):
        settings["bottom.centre_z_m"] = float(rng.choice([-1, 1]) * rng.uniform(0.02, 0.4))
    some = [one for one in declared if rng.random() < 0.8] or declared[:1]
    laws = ("normal", "rectangular", "triangular")
    parts["settings"] = settings
    parts["uncertainty"] = [(name, float(u), unit, rng.choice(laws)) for name, u, unit in some]
    return parts


@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [1, *(pytest.param(n, marks=pytest.mark.study) for n in range(2, draws(8, 40)))]
)
def test_intervals_of_random_jobs_in_everything_that_is_written(seed, tmp_path):
    """Property: what is written of a volume holds it, and has a width where anything is unsure."""
    rng = np.random.default_rng(seed)
    parts = random_job(rng)
    parts["uncertainty"] = [(*one[:3], "B", one[3]) for one in parts["uncertainty"]]
    result = tankcal.run(tankcal.load(write_job(tmp_path / "job", **parts)), simulated=True)
    table = result.capacity
    heights = table.height_m.to_numpy()
    for dip in rng.uniform(heights[0], heights[-1], 20):
        found = result.at(dip)
        assert holds(found.low_m3, found.value_m3, found.high_m3, found.u_m3), dip
    for low, high in np.sort(rng.uniform(heights[0], heights[-1], (10, 2))):
        found = result.delivery(low, high)
        assert holds(found.low_m3, found.value_m3, found.high_m3, found.u_m3), (low, high)
    save(record_of(result), tmp_path / "record.json")
    record = json.loads((tmp_path / "record.json").read_text(encoding="utf-8"))
    write_tables(record, tmp_path)
    capacity, written = record["capacity"], pd.read_csv(tmp_path / "capacity.csv")
    workbook.write(record, tmp_path / "capacity.xlsx")
    book = openpyxl.load_workbook(tmp_path / "capacity.xlsx")
    keys = ("low_m3", "volume_m3", "high_m3", "u_m3")
    for ends in (capacity, written):
        assert np.all(holds(*(np.asarray(ends[key], dtype=float) for key in keys)))
    names = ("capacity_low", "capacity_volume", "capacity_high", "capacity_standard_u")
    assert np.all(holds(*(np.array(cells_of(book, name), dtype=float) for name in names)))
    for one in record["budgets"]:
        assert holds(*(one[key] for key in keys))


def cells_of(book, name):
    """The values of a named range, from the top down."""
    ((sheet, cells),) = book.defined_names[name].destinations
    return [cell.value for (cell,) in book[sheet][cells]]


@pytest.mark.slow
def test_nothing_below_a_raised_bottom_is_nothing(tmp_path):
    """A difference of volumes: -9e-16 m3 with u = 3e-20 m3, and Monte Carlo's interval beside it.

    Then the run ended with an error of the program, or wrote twenty decimals.
    """
    settings = CONE | {"bottom.centre_z_m": 0.1623087709233953, "table.step_m": 0.1}
    job = write_job(tmp_path / "job", settings=settings, uncertainty=[("scale", 5.0, "ppm")])
    result = tankcal.run(tankcal.load(job), simulated=True)
    write_tables(record_of(result), tmp_path)
    first = (tmp_path / "capacity.csv").read_text().splitlines()[1].split(",")
    assert [float(one) for one in first[:3]] == [0.0, 0.0, 0.0]
    assert first[1] == "0.000000"
    assert result.table.u_m3[0] == result.table.volume_m3[0] == 0.0


def test_a_power_of_ten_is_not_lost_in_words():
    """-8.9e-16 m3 was shown as -8.88178 m3."""
    assert "10⁻¹⁶" in volume_text(-8.88178e-16, 7.6e-20)


@pytest.fixture(scope="module")
def sphere(tmp_path_factory):
    """A sphere whose lowest rows have Monte Carlo's interval, its job asking for a delivery."""
    folder = tmp_path_factory.mktemp("sphere")
    parts = KINDS["sphere"] | {"uncertainty": [("datum", 4.0, "mm")]}
    job = tankcal.load(write_job(folder / "job", **parts))
    asked = (StatedVolume(1.0, 0.02), StatedVolume(3.0, 1.0))
    return tankcal.run(replace(job, stated=asked), simulated=True)


@pytest.mark.slow
def test_one_u_in_record_table_files_and_result(sphere, tmp_path):
    """`result.capacity` and `at` had the law's U where the papers have Monte Carlo's."""
    save(record_of(sphere), tmp_path / "record.json")
    record = json.loads((tmp_path / "record.json").read_text(encoding="utf-8"))
    write_tables(record, tmp_path)
    written, table = pd.read_csv(tmp_path / "capacity.csv"), sphere.capacity
    assert list(written.columns) == list(table.columns)
    for key in ("height_m", "volume_m3", "u_m3", "k", "U_m3", "low_m3", "high_m3"):
        ours, theirs = (one[key].to_numpy(float) for one in (table, written))
        assert theirs == pytest.approx(ours, abs=5.1e-7, nan_ok=True), key
    assert list(written.interval) == list(table.interval) == record["capacity"]["interval"]
    assert list(table.U_m3) == record["capacity"]["stated_U_m3"]
    simulated = table.interval == "monte_carlo"
    assert 0 < simulated.sum() < len(table)
    assert np.all(np.isnan(table.k) == simulated)
    off = np.abs(table.U_m3 - sphere.table.U_m3)
    assert np.all(off[~simulated] == 0)
    assert off[simulated].max() > 0
    workbook.write(record, tmp_path / "capacity.xlsx")
    book = openpyxl.load_workbook(tmp_path / "capacity.xlsx")
    ((sheet, cells),) = book.defined_names["capacity_U"].destinations
    shown = [cell.value for (cell,) in book[sheet][cells]]
    assert shown == pytest.approx(list(table.U_m3), abs=5.1e-4)


def test_one_u_at_a_dip_and_in_words(sphere):
    table = sphere.capacity
    for row in (1, 2, 100, len(table) - 1):
        found, own = sphere.at(table.height_m[row]), table.iloc[row]
        assert (found.U_m3, found.interval) == (own.U_m3, own.interval)
        assert found.low_m3 == pytest.approx(own.low_m3, abs=1e-12)
        assert found.high_m3 == pytest.approx(own.high_m3, abs=1e-12)
        assert (found.k is None) == np.isnan(own.k)
    between = sphere.at((table.height_m[1] + table.height_m[2]) / 2)
    assert between.U_m3 >= table.U_m3[1:3].max()  # of both, and of the law
    top = sphere.at(table.height_m.iloc[-1])
    assert str(top) in str(sphere)


def test_one_u_of_a_delivery(sphere):
    delivered = sphere.simulation.of_delivered
    to_empty, whole = sphere.delivery(0.02, 1.0), sphere.delivery(1.0, 3.0)
    for place, found in enumerate((to_empty, whole)):
        assert found.U_m3 == delivered.U_m3[place]
        assert (found.interval == "gum") == delivered.by_gum[place]
        assert found.low_m3 == pytest.approx(delivered.low_m3[place], abs=1e-12)
    other = sphere.delivery(1.1, 2.7)
    assert other.interval == "gum_not_simulated"
    assert other.U_m3 == sphere.table.delivery(1.1, 2.7).U_m3


def judged(low, high, validated=False):
    """A verdict on one volume."""
    one = (np.array([value]) for value in (0.1, 0.1, 0.005, validated, True, low, high))
    return Verdict(*one)


def test_zeros_for_an_interval_are_an_error_of_the_program():
    """The row of 41 litres whose interval was printed as [0.000, 0.000]."""
    volume, u = np.array([0.041]), np.array([0.002])
    with pytest.raises(ProgramError, match=r"from 0\.000000 to 0\.000000"):
        judged_intervals(judged(0.0, 0.0), volume, u, 2 * u)
    with pytest.raises(ProgramError):
        judged_intervals(judged(np.nan, 0.05), volume, u, 2 * u)
    with pytest.raises(ProgramError):
        gum_intervals(volume, u, 0 * u)


def test_interval_is_extended_to_its_volume():
    """A square of an input is never below its value at 0: 2.5 % of chi-square is above it."""
    volume, u = np.array([0.041]), np.array([0.002])
    found = judged_intervals(judged(0.0411, 0.046), volume, u, 2 * u)
    assert (found.low_m3[0], found.high_m3[0]) == (0.041, 0.046)
    assert found.U_m3[0] == pytest.approx(0.005)


def test_intervals_are_never_negative_nor_wide_when_exact():
    none = np.zeros(1)
    found = judged_intervals(judged(-0.001, 0.002), none, none, none, least_m3=0.0)
    assert found.low_m3[0] == 0.0
    exact = gum_intervals(np.array([3.0]), none, none)
    assert exact.low_m3 == exact.high_m3 == 3.0


def test_a_validated_interval_does_not_reach_below_an_empty_tank():
    """V +- U with U = 0.3 at V = 0.1: one-sided, without k; without a bound it stays V +- U."""
    volume, u = np.array([0.1]), np.array([0.15])
    valid = judged(-0.2, 0.4, validated=np.array([True]))
    found = judged_intervals(valid, volume, u, 2 * u, least_m3=0.0)
    assert (found.low_m3[0], found.high_m3[0], found.by_gum[0]) == (0.0, 0.4, False)
    assert found.U_m3[0] == pytest.approx(0.3)
    assert judged_intervals(valid, volume, u, 2 * u).by_gum[0]
    empty, none = np.zeros(1), np.zeros(1)
    exact = judged_intervals(judged(0.0, 0.0, np.array([True])), empty, none, none, least_m3=0.0)
    assert exact.by_gum[0]


@pytest.mark.slow
def test_a_row_that_is_not_in_its_interval_is_never_written(tmp_path):
    """What the simulation says of a row is refused as a whole, not printed."""
    parts = KINDS["sphere"] | {"uncertainty": DATUM}
    result = tankcal.run(tankcal.load(write_job(tmp_path / "job", **parts)), simulated=True)
    spoilt = replace(result.simulation.judged, low=0.0 * result.table.volume_m3)
    spoilt = replace(spoilt, high=spoilt.low, validated=spoilt.low > 0)
    with pytest.raises(ProgramError):
        replace(result.simulation, judged=spoilt).intervals(result.table)
