"""`tankcal gauge`: closed forms, a second implementation, simulations, inputs and documents."""

import csv
import json
import shutil
import subprocess
import sys

import numpy as np
import openpyxl
import pytest
from page_figures import agree, figures_of, value_of
from scipy import stats

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.products.exports.exporting import POISSON, shortening_m
from tankcal.products.gauge.commissioning import commission
from tankcal.products.gauge.deviation import (
    SCATTER_DOF,
    Dips,
    KnownSlope,
    expand,
    fit_line,
    slope_of_tilt,
    tilt_of_slope,
)
from tankcal.products.gauge.paper import DOCUMENT, GaugePaper
from tankcal.products.gauge.reading import EMPTY_FILES, UNCERTAINTIES, read_comparison, shell_of
from tankcal.record.schema import to_plain
from tankcal.report.verification import verify
from tankcal.text.shipped import LANGUAGES, shipped_folder
from tankcal.text.words import load_words

GAUGE_EXAMPLE = shipped_folder("examples") / "gauge"
SETTINGS = {
    "certificate": {"number": "7", "date": "2026-11-20", "by": "A. Silva", "place": "Terminal"},
    "gauge": {
        "tank": "TK-14",
        "maker": "Example",
        "resolution_mm": 1,
        "supported_by": "bottom",
        "lowest_m": 0.5,
        "highest_m": 11,
    },
}
ROWS = [
    ("low", 1.812, 1.814),
    ("low", 1.813, 1.815),
    ("middle", 5.904, 5.907),
    ("high", 9.731, 9.735),
    ("high", 9.730, 9.735),
]


def toml(settings):
    lines = []
    for section, values in settings.items():
        lines.append(f"[{section}]")
        for key, value in values.items():
            is_bare = isinstance(value, bool | int | float) or key == "date"
            text = str(value).lower() if is_bare else json.dumps(value)
            lines.append(f"{key} = {text}")
    return "\n".join(lines) + "\n"


@pytest.fixture
def folder(tmp_path):
    return write(tmp_path / "gauge")


def write(folder, rows=ROWS, heading="level,dip_m,gauge_m", **changes):
    """A folder with gauge.toml and readings.csv; changes are {section: {key: value}}."""
    folder.mkdir(exist_ok=True)
    settings = {name: dict(values) for name, values in SETTINGS.items()}
    for section, values in changes.items():
        settings.setdefault(section, {}).update(values)
    (folder / "gauge.toml").write_text(toml(settings), encoding="utf-8")
    lines = [",".join(map(str, row)) for row in rows]
    (folder / "readings.csv").write_text("\n".join([heading, *lines]) + "\n", encoding="utf-8")
    return folder


def computed(folder):
    return to_plain(commission(read_comparison(folder)))


def dips_of(level, deviation=None, scatter=0.001, **shared):
    level = np.asarray(level, float)
    deviation = np.zeros_like(level) if deviation is None else np.asarray(deviation)
    return Dips(level, level + deviation, 0 * level, np.full(len(level), scatter), shared)


# ---- the line


@pytest.mark.parametrize("n", [3, 4, 7, 12])
def test_u_of_offset_and_slope_for_equal_variances(n):
    """Closed form of the straight line, with a common zero z and a common scale s of the tape.

    u(a)^2 = g^2 u^2/n + z^2 + (s L_m)^2 and u(b)^2 = g^2 u^2/sum (L - L_m)^2 + s^2, with the pooled
    factor g of the scatter.
    """
    level, u, z, s = np.linspace(1.0, 11.0, n), 0.0012, 0.0005, 1e-4
    line = fit_line(dips_of(level, 0.003 + 2e-4 * level, u, zero=np.full(n, z), scale=s * level))
    assert line.sigma0 == pytest.approx(0, abs=1e-6)
    g2 = SCATTER_DOF / (SCATTER_DOF + n - 2)  # no residuals: the scatter is smaller than declared
    found, _, dof, _ = expand(line.sources, 0.95)
    lever = level - level.mean()
    expected = [
        g2 * u**2 / n + z**2 + (s * level.mean()) ** 2,
        g2 * u**2 / (lever @ lever) + s**2,
    ]
    assert found**2 == pytest.approx(expected, rel=1e-9)
    assert line.unknowns == pytest.approx([0.003 + 2e-4 * level.mean(), 2e-4])
    # Welch and Satterthwaite: only the scatter has finite degrees of freedom.
    fourths = [(g2 * u**2 / n) ** 2, (g2 * u**2 / (lever @ lever)) ** 2]
    nu = SCATTER_DOF + n - 2
    assert dof == pytest.approx(np.square(expected) * nu / fourths, rel=1e-9)


@pytest.mark.parametrize(
    ("levels", "dips_mm", "expected"),
    [
        ([2, 6, 11], 1.0, [1.378, 0.826, 0.176, 1.308]),
        ([2, 6, 11], 2.0, [2.420, 1.297, 0.324, 2.254]),
        ([1, 3.5, 6, 8.5, 11], 1.0, [1.105, 0.717, 0.143, 1.130]),
    ],
)
def test_u_to_the_printed_digit(levels, dips_mm, expected):
    """Offset at 0 and at the mean level, scale, and deviation at 12 m: another author's numbers.

    Gauge 0.5 mm, zero of the tape 0.5 mm, tape 20 ppm; the scatter is declared, without pooling.
    """
    levels = np.array(levels, float)
    shared = {"zero": np.full(len(levels), 5e-4), "scale": 2e-5 * levels}
    line = fit_line(dips_of(levels, scatter=np.hypot(dips_mm, 0.5) / 1000, **shared))
    mean, total = line.mean_level_m, np.zeros(4)
    rows = np.array([[1, -mean], [1, 0], [0, 1], [1, 12 - mean]])
    for source in line.sources:
        factor = line.scatter_factor if source.kind == "scatter" else 1.0
        columns = np.reshape(source.columns_m3, (2, -1)) / factor
        total += np.sum((rows @ columns) ** 2, axis=1)
    assert (1000 * np.sqrt(total)).round(3).tolist() == expected


def test_three_levels_do_not_determine_a_scale():
    """Differences 2.3, 2.6, 3.4 mm: offset 1.9828, slope 0.1238 mm/m with w 0.70, chi2 0.019.

    With the scale as a known cause, the offset is 2.7566 mm. A pipe that leans by 0.5, 1 or 2
    degrees has a slope of 38, 152, 610 ppm.
    """
    levels = np.array([2.0, 6.0, 11.0])
    shared = {"zero": np.full(3, 5e-4), "scale": 2e-5 * levels}
    dips = dips_of(levels, [0.0023, 0.0026, 0.0034], np.hypot(1.0, 0.5) / 1000, **shared)
    line = fit_line(dips)
    offset, slope = line.unknowns
    assert round(1000 * (offset - line.mean_level_m * slope), 4) == 1.9828
    assert round(1000 * slope, 4) == 0.1238
    assert round(slope / 0.176e-3, 2) == 0.70
    assert round(line.sigma0**2, 3) == 0.019
    assert round(1000 * fit_line(dips, KnownSlope(0.0, 0.0)).unknowns[0], 4) == 2.7566
    slopes = [slope_of_tilt(np.radians(tilt), 0.0)[0] for tilt in (0.5, 1.0, 2.0)]
    assert np.round(1e6 * np.array(slopes)).tolist() == [38, 152, 610]


def plain_line(level, deviation, scatter, shared, at, probability):
    """(a, b, [(D, U)], whether residuals count alone): sums by hand, one for each source."""
    # Only independent errors weight the readings: a constant and a scale are part of the line.
    weight = [1 / s**2 for s in scatter]
    mean = sum(w * x for w, x in zip(weight, level, strict=True)) / sum(weight)
    sxx = sum(w * (x - mean) ** 2 for w, x in zip(weight, level, strict=True))

    def value(errors):
        a = sum(w * e for w, e in zip(weight, errors, strict=True)) / sum(weight)
        b = sum(w * (x - mean) * e for w, x, e in zip(weight, level, errors, strict=True)) / sxx
        return a, b

    a, b = value(deviation)
    chi2 = sum(
        w * (d - a - b * (x - mean)) ** 2 for w, x, d in zip(weight, level, deviation, strict=True)
    )
    dof = len(level) - 2
    is_contradicted = stats.chi2.sf(chi2, dof) < 0.05
    if is_contradicted:
        factor2, nu = chi2 / dof, dof
    else:
        factor2, nu = (8 + chi2) / (8 + dof), 8 + dof
    found = []
    for x in at:
        scatter2 = 0.0
        for place in range(len(level)):
            unit = [scatter[place] if row == place else 0.0 for row in range(len(level))]
            part = value(unit)
            scatter2 += factor2 * (part[0] + part[1] * (x - mean)) ** 2
        total = scatter2
        for column in shared:
            part = value(column)
            total += (part[0] + part[1] * (x - mean)) ** 2
        effective = nu * (total / scatter2) ** 2
        k = stats.t.ppf((1 + probability) / 2, effective)
        found.append((a + b * (x - mean), k * total**0.5))
    return a, b, found, is_contradicted


@pytest.mark.parametrize("seed", range(6))
def test_line_of_a_second_implementation(seed):
    rng = np.random.default_rng(seed)
    n = 3 + seed
    level = np.sort(rng.uniform(0.5, 14, n))
    scatter = rng.uniform(0.0005, 0.002, n)
    excess = 4 if seed == 5 else 1  # a scatter that the residuals contradict
    deviation = 0.004 - 3e-4 * level + excess * scatter * rng.normal(size=n)
    shared = {"tape zero": np.full(n, -5e-4), "tape scale": -1.15e-4 * level}
    line = fit_line(Dips(level, level + deviation, 0 * level, scatter, shared))
    at = np.array([0.0, 3.0, 20.0])
    a, b, expected, is_contradicted = plain_line(
        level, deviation, scatter, shared.values(), at, 0.95
    )
    assert line.unknowns == pytest.approx([a, b], rel=1e-9)
    deviation, sources = line.at(at, 0 * at)
    assert deviation == pytest.approx([value for value, _ in expected], rel=1e-9)
    assert expand(sources, 0.95)[1] == pytest.approx([U for _, U in expected], rel=1e-8)
    assert line.is_scatter_estimated == is_contradicted
    assert is_contradicted or excess == 1


def test_a_declared_slope_replaces_the_estimate():
    """u of D at a distance from the mean level is the root of u(a)^2 + (u_b dL)^2."""
    line = fit_line(dips_of([4.0, 8.0], [0.002, 0.004]), KnownSlope(5e-4, 1e-4))
    assert line.unknowns == pytest.approx([0.003, 5e-4])
    deviation, sources = line.at(np.array([6.0, 10.0]), np.zeros(2))
    assert deviation == pytest.approx([0.003, 0.005])
    u = expand(sources, 0.95)[0]
    g2 = 8 / 9  # pooled with one residual without error
    assert u**2 == pytest.approx([g2 * 1e-6 / 2, g2 * 1e-6 / 2 + (1e-4 * 4) ** 2])


def test_slope_of_a_leaning_pipe():
    """Published rounding: 10 m of level, 0.4, 1.5 and 6.1 mm at 0.5, 1 and 2 degrees."""
    for degrees, mm in ((0.5, 0.4), (1, 1.5), (2, 6.1)):
        slope, u = slope_of_tilt(np.radians(degrees), 0)
        assert round(1e4 * slope, 1) == mm
        assert u == 0
        assert np.degrees(tilt_of_slope(slope)) == pytest.approx(degrees)
    # Simulation: mean and standard deviation, also at 0 where only the second order acts.
    rng = np.random.default_rng(5)
    for degrees, u_degrees in ((0, 0.5), (1, 0.3)):
        drawn = 1 / np.cos(np.radians(degrees + u_degrees * rng.normal(size=200_000))) - 1
        slope, u = slope_of_tilt(*np.radians([degrees, u_degrees]))
        assert slope == pytest.approx(drawn.mean(), rel=0.01)
        assert u == pytest.approx(drawn.std(), rel=0.02)


# ---- coverage, with errors that are not of the model


def simulated(rng, levels, repeats, *, stick_mm, step_mm):
    """A gauge with friction and rounding, dipped by a tape: (readings, its true deviation).

    The float sticks: it follows the liquid only when the distance exceeds the friction, so it lags
    in the direction of the last movement. Dips have uniform errors and are rounded to 1 mm. The
    pipe leans, so that distances from the top are longer by 1/cos t.
    """
    tilt, scale = np.radians(rng.uniform(0, 1)), rng.normal(0, 1e-4)
    zero, top = rng.normal(0, 0.004), 14.0
    tape_zero, tape_scale = rng.normal(0, 5e-4), rng.normal(0, 115e-6)
    tape_k = rng.normal(0, 2)

    def ideal(level):
        return top + zero - (1 + scale) * (top - level) / np.cos(tilt)

    rows, stick = [], stick_mm / 1000
    for name, nominal in enumerate(levels):
        level = nominal + rng.uniform(-0.2, 0.2)
        shown = ideal(level) + stick * rng.uniform(-1, 1)
        for _ in range(repeats):
            drift = rng.normal(0, 2e-4)  # waves between the readings
            if abs(ideal(level + drift) - shown) > stick:
                side = np.sign(shown - ideal(level + drift))
                shown = ideal(level + drift) + side * stick
            length = (level + drift - tape_zero) / ((1 + tape_scale) * (1 + 1.15e-5 * tape_k))
            dip = np.round(length + 1e-3 * 3**0.5 * rng.uniform(-1, 1), 3)
            step = step_mm / 1000
            rows.append((name, dip, np.round(shown / step) * step))
    return rows, lambda level: ideal(level) - level


@pytest.mark.study
@pytest.mark.parametrize(("levels", "repeats"), [(3, 1), (3, 3), (6, 2), (12, 1)])
def test_coverage_of_a_sticking_gauge(levels, repeats, tmp_path, figure):
    rng = np.random.default_rng(1000 + levels)
    heights, at = np.linspace(1.0, 12.0, levels), np.array([1.0, 6.0, 12.0])
    inside = np.zeros(3)
    draws = 2000
    for _ in range(draws):
        rows, truth = simulated(rng, heights, repeats, stick_mm=0.5 * 3**0.5, step_mm=1)
        table = np.array(rows, float)
        groups = [table[table[:, 0] == name] for name in range(levels)]
        level = np.array([group[:, 1].mean() for group in groups])
        gauge = np.array([group[:, 2].mean() for group in groups])
        scatter = np.full(levels, np.sqrt(1e-6 / repeats + 0.25e-6 + 1e-6 / 12))
        shared = {
            "tape zero": np.full(levels, -5e-4),
            "tape scale": -level * 115e-6,
            "tape temperature": -level * 1.15e-5 * 2,
        }
        line = fit_line(Dips(level, gauge, 0 * level, scatter, shared))
        deviation, sources = line.at(at, 0 * at)
        inside += np.abs(deviation - truth(at)) <= expand(sources, 0.95)[1]
    share = inside / draws
    figure(f"coverage of a sticking gauge, {levels} levels of {repeats}", share.round(3).tolist())
    stated = {
        (3, 1): figures_of("docs/studies/gauge.md", "| 3 × 1 | () | () | () |"),
        (3, 3): figures_of("docs/studies/gauge.md", "| 3 × 3 | () | () | () |"),
        (6, 2): figures_of("docs/studies/gauge.md", "| 6 × 2 | () | () | () |"),
        (12, 1): figures_of("docs/studies/gauge.md", "| 12 × 1 | () | () | () |"),
    }
    (full,) = figures_of("docs/studies/gauge.md", "() comparisons were simulated")
    assert value_of(full) == draws
    assert agree(share, stated[levels, repeats])
    assert share.min() >= 0.94
    assert share.max() <= 0.985


@pytest.mark.slow
def test_simulated_gauge_through_the_files(tmp_path):
    """Readings of the simulation as files: the corrections give the level within U."""
    rng, outside = np.random.default_rng(3), 0
    for number in range(40):
        rows, truth = simulated(rng, np.linspace(1, 10.5, 5), 2, stick_mm=0.8, step_mm=1)
        warm = [(*row, 20) for row in rows]
        folder = write(tmp_path / str(number), warm, "level,dip_m,gauge_m,tape_c")
        for row in computed(folder)["corrections"]:
            level = row["gauge_m"] + row["correction_mm"] / 1000
            # The gauge at this level indicates L + D(L).
            off_mm = 1000 * (level + truth(level) - row["gauge_m"])
            outside += row["gauge_m"] in (1.0, 10.0) and abs(off_mm) > row["U_mm"]
    assert outside <= 10  # of 80, 5 % expected


# ---- sources


def test_an_ullage_keeps_its_reference_height_out_of_the_table(tmp_path):
    """L above the table's zero is H_table - ullage: the height of today cancels."""
    heading = "level,ullage_m,gauge_m"
    rows = [(n, round(14 - x, 3), x + 0.002) for n, x in enumerate((2.0, 6.0, 10.0))]
    reference = {"height_m": 14.0, "table_height_m": 14.003}
    results = []
    for u in (0.0, 5.0):
        folder = write(tmp_path / str(u), rows, heading, reference=reference,
                       uncertainty={"u_reference_mm": u})  # fmt: skip
        results.append(computed(folder)["corrections"][4])
    assert results[0]["U_mm"] < results[1]["U_mm"]
    assert results[0]["U_table_mm"] == pytest.approx(results[1]["U_table_mm"], rel=1e-6)
    # z of the table = 14.000 - 14.003 = -3 mm, so levels above it are 3 mm larger.
    assert results[0]["table_correction_mm"] - results[0]["correction_mm"] == pytest.approx(3)


def test_zeros_of_table_and_gauge(tmp_path):
    rows = [(n, x, x + 0.005 + 3e-4 * x) for n, x in enumerate((2.0, 6.0, 10.0))]
    levelled = {"dip_plate_m": 102.400, "table_zero_m": 102.393}
    folder = write(tmp_path / "a", rows, zeros=levelled)
    plate, table, gauge = computed(folder)["zeros"]
    assert (plate["z_mm"], plate["U_mm"]) == (0, 0)
    assert table["z_mm"] == pytest.approx(-7)
    assert table["U_mm"] == pytest.approx(stats.norm.ppf(0.975) * 2**0.5)
    # The gauge indicates 0 where L + 0.005 + 3e-4 L = 0.
    assert gauge["z_mm"] == pytest.approx(-5 / 1.0003, abs=1e-3)


def test_corrections_of_the_tape(tmp_path):
    """10 m at 40 degC: 10 (1 + 1.15e-5 x 20 + 50e-6) + 0.4 mm = 10.0032 m."""
    rows = [(x, x, x, 40) for x in (2, 6, 10)]
    tape = {"zero_correction_mm": 0.4, "scale_correction_ppm": 50}
    folder = write(tmp_path / "a", rows, "level,dip_m,gauge_m,tape_c", tape=tape)
    assert computed(folder)["levels"][-1]["dip_m"] == pytest.approx(10.0032)


@pytest.fixture(scope="session")
def record_folder(made_once):
    from conftest import EXAMPLE

    return made_once(
        "gauge_record",
        lambda place: main(["run", str(EXAMPLE), "--out", str(place / "r"), "--no-papers"]),
    )


@pytest.mark.slow
def test_movement_of_a_gauge_on_the_shell(tmp_path, record_folder):
    """Readings with the movement of the record as their only error: nothing is left in the line."""
    record = str(record_folder / "r")
    on_shell = {"supported_by": "shell", "record": record, "highest_m": 9.0}
    on_shell["tank"] = json.loads((record_folder / "r/record.json").read_text())["job"]["tank"][
        "id"
    ]
    first = read_comparison(write(tmp_path / "a", gauge=on_shell, liquid={"density_kg_m3": 850}))
    levels = np.array([1.0, 3.0, 5.0, 8.0])
    moved = shortening_m(levels, *shell_of(first.tank, 850))
    rows = [(n, x, x + h) for n, (x, h) in enumerate(zip(levels, moved, strict=True))]
    folder = write(tmp_path / "b", rows, gauge=on_shell, liquid={"density_kg_m3": 850})
    gauge = computed(folder)
    assert abs(gauge["line"]["offset_mm"]) < 1e-6
    assert abs(gauge["line"]["slope_mm_per_m"]) < 1e-6
    assert gauge["levels"][-1]["deviation_mm"] == pytest.approx(1000 * moved[-1])
    assert gauge["head"]["is_modelled"]
    at_8 = next(row for row in gauge["corrections"] if row["gauge_m"] == 8.0)
    assert at_8["correction_mm"] == pytest.approx(-1000 * moved[-1], rel=1e-3)
    # One course of constant plate: nu rho g r h^2 / (2 E t).
    h, t, r = 8.0, 0.008, 7.2
    closed = POISSON * 850 * 9.80665 * r * h**2 / (2 * 206e9 * t)
    assert shortening_m([h], [(h, t, r)], 850, 206e9)[0] == pytest.approx(closed)
    # A gauge that applies HyTD has no such movement in its indications.
    itself = write(tmp_path / "c", rows, gauge=on_shell | {"corrects_head": True},
                   liquid={"density_kg_m3": 850})  # fmt: skip
    gauge = computed(itself)
    assert gauge["line"]["slope_mm_per_m"] > 0.01
    assert not gauge["head"]["is_modelled"]
    assert gauge["head"]["factor_mm_per_m"] > 0


# ---- decision


@pytest.mark.parametrize(
    ("limit", "rule", "verdict"),
    [
        ({"absolute_mm": 9}, "guarded", "passed"),
        ({"absolute_mm": 5.5}, "guarded", "guard_band"),
        ({"absolute_mm": 5.5}, "simple", "passed"),
        ({"absolute_mm": 3}, "guarded", "guard_band_beyond"),
        ({"absolute_mm": 3}, "simple", "failed"),
        ({"absolute_mm": 0.5}, "guarded", "failed"),
        ({"absolute_mm": 3, "relative_percent": 1}, "guarded", "passed"),
    ],
)
def test_decision_by_a_declared_limit(tmp_path, limit, rule, verdict):
    named = {"source": "contract 12", "rule": rule}
    gauge = computed(write(tmp_path / "g", limit=limit | named))
    levels = gauge["levels"]
    assert gauge["decision"]["verdict"] == verdict
    assert gauge["decision"]["source"] == "contract 12"
    for level in levels:
        relative = limit.get("relative_percent", 0) / 100 * 1000 * level["dip_m"]
        assert level["limit_mm"] == pytest.approx(max(limit["absolute_mm"], relative))


def test_no_limit_no_decision(folder):
    gauge = computed(folder)
    assert gauge["decision"] is None
    assert {level["verdict"] for level in gauge["levels"]} == {None}


# ---- refusals and warnings


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"rows": ROWS[:3]}, "2 levels; expected at least 3"),
        ({"rows": [("a", 1, 3.1), ("b", 5, 5), ("c", 9, 9)]}, "differs from the dip by 2.100 m"),
        ({"rows": [("a", "", 1), ("b", 5, 5), ("c", 9, 9)]}, "missing; expected the dip"),
        ({"rows": []}, "no rows"),
        ({"rows": [("a", 1, 1), ("b", 1.01, 1.01), ("c", 9, 9)]}, "closer than 0.05 m"),
        ({"limit": {"absolute_mm": 4}}, "limit.source"),
        ({"limit": {"source": "x", "rule": "simple"}}, "limit.absolute_mm"),
        ({"gauge": {"scale_ppm": 10}}, "gauge.u_scale_ppm"),
        ({"gauge": {"highest_m": 0.2}}, "not above lowest_m"),
        ({"gauge": {"supported_by": "roof"}}, "supported_by"),
        ({"gauge": {"record": "missing.json"}}, "where no record is"),
        ({"zeros": {"dip_plate_m": 1}}, "zeros.table_zero_m"),
        ({"colour": {"a": 1}}, "[colour]"),
        ({"heading": "level,ullage_m,gauge_m"}, "reference.height_m"),
        ({"rows": [("a", "1,5", 1)]}, "readings.csv"),
        ({"rows": [("a", 1, 1), ("a", 5, 5), ("b", 9, 9)]}, "a are up to 4.000 m apart"),
        (
            {"rows": [("a", 12, 1), ("b", 8, 5), ("c", 4, 9)], "reference": {"height_m": 13}},
            "it agrees as an ullage; move it to the column ullage_m",
        ),
        (
            {
                "rows": [("a", 1, 1.002), ("b", 5, 5), ("c", 9, 9)],
                "reference": {"height_m": 13},
                "heading": "level,ullage_m,gauge_m",
            },
            "it agrees as a dip",
        ),
        (
            {
                "rows": [("a", 1, 24, 1), ("b", 5, 24, 5), ("c", 9, 24, 9)],
                "heading": "level,dip_m,gauge_m,tape_c",
            },
            "are gauge_m and tape_c swapped?",
        ),
        (
            {
                "rows": [("a", 24, 1, 1), ("b", 24, 5, 5), ("c", 24, 9, 9)],
                "heading": "level,dip_m,gauge_m,tape_c",
            },
            "are the tape reading and tape_c swapped?",
        ),
        ({"rows": [("a", 1, 1814), ("b", 5, 5), ("c", 9, 9)]}, "another unit"),
        ({"gauge": {"record": "missing"}}, "gauge.record: found 'missing', where no record is"),
        ({"gauge": {"resolution_mm": ""}}, "resolution_mm: blank; expected a number above 0"),
    ],
)
def test_bad_input_is_one_line(tmp_path, capsys, changes, expected):
    folder = write(tmp_path / "g", **changes)
    out = tmp_path / "out"
    assert main(["gauge", str(folder), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert "Traceback" not in error
    assert not out.exists()


def test_semicolons_decimal_commas_and_byte_order_mark_are_read(tmp_path):
    """As Excel saves a sheet in Brazil; no dip is 1812 m, so that 1,812 has one meaning."""
    folder = write(tmp_path / "g")
    expected = computed(folder)["line"]
    path = folder / "readings.csv"
    text = path.read_text(encoding="utf-8").replace(",", ";").replace(".", ",")
    path.write_bytes(text.replace("\n", "\r\n").encode("utf-8-sig"))
    assert computed(folder)["line"] == expected


def test_a_missing_folder_names_the_command_that_creates_it(tmp_path, capsys):
    assert main(["gauge", str(tmp_path / "tk-1")]) == 2
    assert "tankcal gauge tk-1 --new" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"rows": [*ROWS, ("low", 1.812, 1.826)]}, "differs from the mean of its level"),
        ({"rows": [("a", 1, 1), ("b", 5, 5.012), ("c", 9, 9)]}, "scatter"),
        ({"rows": [("a", 1, 1), ("b", 2, 2), ("c", 3, 3)]}, "cover 2.00 m of 10.50 m"),
        ({"rows": ROWS[:3], "gauge": {"scale_ppm": 0, "u_scale_ppm": 50}}, "do not determine"),
        ({"reference": {"height_m": 13.4, "table_height_m": 13.42}}, "by -20.0 mm"),
        ({}, "not linked to the dip plate"),
        ({"gauge": {"supported_by": "shell"}}, "the movement of the shell is not modelled"),
    ],
)
def test_warnings(tmp_path, changes, expected):
    warnings = computed(write(tmp_path / "g", **changes))["warnings"]
    assert any(expected in warning["text"] for warning in warnings)


def test_few_levels_with_a_declared_scale(tmp_path):
    known = {"scale_ppm": 100, "u_scale_ppm": 50}
    line = computed(write(tmp_path / "g", ROWS[:3], gauge=known))["line"]
    assert not line["is_slope_estimated"]
    assert line["slope_mm_per_m"] == pytest.approx(0.1)
    assert line["U_slope_mm_per_m"] == pytest.approx(1.96 * 0.05, rel=1e-3)
    assert line["tilt_deg"] is None


def test_scale_and_tilt_are_separated_only_by_a_declaration(tmp_path):
    rows = [(n, x, x + 3.046e-4 * x) for n, x in enumerate((1.0, 5.0, 9.0))]
    line = computed(write(tmp_path / "a", rows))["line"]
    assert (line["tilt_is"], line["scale_mm_per_m"]) == ("equivalent", None)
    known = {"scale_ppm": 0, "u_scale_ppm": 1}
    line = computed(write(tmp_path / "b", rows, gauge=known))["line"]
    assert line["tilt_is"] == "estimated"
    assert line["tilt_deg"] == pytest.approx(np.degrees(np.arccos(1 / 1.0003046)), rel=1e-6)
    assert line["U_tilt_low_deg"] < line["tilt_deg"] < line["U_tilt_high_deg"]
    line = computed(write(tmp_path / "c", rows, pipe={"tilt_deg": 1, "u_tilt_deg": 0.05}))["line"]
    pipe = 1000 * (1 / np.cos(np.radians(1)) - 1)
    assert line["pipe_mm_per_m"] == pytest.approx(pipe, rel=0.01)
    assert line["scale_mm_per_m"] == pytest.approx(0.3046 - line["pipe_mm_per_m"])


def test_budget_adds_up(folder):
    gauge = computed(folder)
    line = gauge["line"]
    u = line["U_offset_mm"] / line["k_offset"]
    assert sum(row["middle_mm"] ** 2 for row in gauge["budget"]) == pytest.approx(u**2)


# ---- files and documents


@pytest.mark.parametrize("language", LANGUAGES)
def test_starter_is_complete_once_filled_in(tmp_path, language):
    place = tmp_path / "new"
    assert EMPTY_FILES.write(place, language) == ["gauge.toml", "readings.csv"]
    with pytest.raises(InputError) as refused:
        read_comparison(place)
    assert len(refused.value.problems) >= 4
    with pytest.raises(InputError):
        EMPTY_FILES.write(place, language)
    text = (place / "gauge.toml").read_text(encoding="utf-8")
    for key, value in (
        ("date", '"2026-11-20"'), ("resolution_mm", "1"), ("supported_by", '"bottom"'),
        ("lowest_m", "0.5"), ("highest_m", "11"), ("tank", '"TK-1"'),
    ):  # fmt: skip
        assert f'\n{key} = ""' in text
        text = text.replace(f'\n{key} = ""', f"\n{key} = {value}")
    (place / "gauge.toml").write_text(text, encoding="utf-8")
    with (place / "readings.csv").open("a", encoding="utf-8") as file:
        file.writelines(f"{n},{x},,{x},\n" for n, x in enumerate((1.0, 5.0, 9.0)))
    assert computed(place)["tank"] == "TK-1"


@pytest.mark.parametrize("language", LANGUAGES)
def test_empty_readings_are_named_beside_a_missing_record(tmp_path, language, capsys):
    folder = write(tmp_path / "gauge", gauge={"record": "record.json"})
    (folder / "readings.csv").write_text("")
    assert main(["gauge", str(folder), "--quiet", "--language", language]) == 2
    lines = capsys.readouterr().err.splitlines()
    empty = {"en": "empty", "es": "vacío", "pt-BR": "vazio"}[language]
    starts = [line.partition(f": {empty}")[0].partition("gauge.record")[0] for line in lines]
    assert starts[0] == "tankcal: readings.csv"
    assert starts[1].startswith("tankcal: gauge.toml")
    assert len(starts) == 2


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_certificate_and_files(folder, tmp_path, language, capsys):
    write(folder, limit={"absolute_mm": 4, "source": "contract 12", "rule": "guarded"},
          reference={"height_m": 13.412, "table_height_m": 13.41})  # fmt: skip
    out = tmp_path / "out"
    assert main(["gauge", str(folder), "--out", str(out), "--language", language]) == 0
    words = load_words(language)["gauge"]
    assert words["zeros"]["gauge"] in capsys.readouterr().out
    assert {path.name for path in out.iterdir()} == set(DOCUMENT.files)
    gauge = json.loads((out / "gauge.json").read_text(encoding="utf-8"))
    rows = list(csv.DictReader((out / "corrections.csv").read_text(encoding="utf-8").splitlines()))
    assert [float(row["correction_mm"]) for row in rows] == pytest.approx(
        [row["correction_mm"] for row in gauge["corrections"]]
    )
    assert verify(out).problems == []
    if shutil.which("pdftotext"):
        text = subprocess.run(["pdftotext", "-layout", str(out / "gauge.pdf"), "-"],
                              capture_output=True, text=True, check=True).stdout  # fmt: skip
        assert words["titles"]["gauge"] in text
        assert words["signatures"]["approved"] in text
        assert words["texts"]["end"] in text
        assert text.count("\f") == 2


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("language", LANGUAGES)
def test_workbook_has_the_main_result_and_the_remarks(tmp_path, language):
    out = tmp_path / "out"
    DOCUMENT.write(computed(GAUGE_EXAMPLE), out, language)
    sheet = openpyxl.load_workbook(out / "gauge.xlsx").worksheets[0]
    texts = [str(cell.value) for row in sheet for cell in row if cell.value is not None]
    words = load_words(language)["gauge"]
    assert {"EX-GAUGE-1", words["headings"]["remarks"]} <= set(texts)
    assert {*words["standing"].values()} <= set(texts)
    label = words["labels"]["offset_at"].split("{")[0]
    at = next(place for place, text in enumerate(texts) if text.startswith(label))
    assert texts[at + 1].replace(",", ".").startswith("1.48")


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdftotext") is None, reason="needs pdftotext")
def test_long_notes_keep_the_end_mark_with_the_signatures(tmp_path):
    """Notes of 9 to 13 lines: the end of page 2 falls between signatures and end mark."""
    words, gauge = load_words("en")["gauge"], computed(GAUGE_EXAMPLE)
    number = "LABORATORY-2026-000471-COMPARISON-OF-LEVEL-GAUGE-REV-02"
    counts = set()
    for lines in range(9, 14):
        gauge["certificate"] |= {"note": "words " * 11 * lines, "number": number}
        DOCUMENT.write(gauge, tmp_path / "out")
        text = subprocess.run(["pdftotext", "-layout", str(tmp_path / "out/gauge.pdf"), "-"],
                              capture_output=True, text=True, check=True).stdout  # fmt: skip
        pages = text.split("\f")
        (last,) = (page for page in pages if words["texts"]["end"] in page)
        assert words["signatures"]["approved"] in last
        assert number in pages[0]
        counts.add(len(pages) - 1)
    assert counts == {2, 3}


@pytest.mark.slow
def test_papers_are_written_again_in_another_language(folder, tmp_path):
    out, again = tmp_path / "out", tmp_path / "again"
    assert main(["gauge", str(folder), "--out", str(out), "--quiet"]) == 0
    assert main(["report", str(out), "--out", str(again), "--language", "pt-BR"]) == 0
    assert (again / "gauge.json").read_bytes() == (out / "gauge.json").read_bytes()
    (out / "gauge.json").write_text("{}", encoding="utf-8")
    assert main(["report", str(out), "--out", str(again)]) == 2


@pytest.mark.slow
def test_json_and_equal_bytes(folder, tmp_path, capsys):
    assert main(["gauge", str(folder), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["exit_status"] == 0
    assert printed["tank"] == "TK-14"
    for name in ("a", "b"):
        assert main(["gauge", str(folder), "--out", str(tmp_path / name), "--quiet"]) == 0
    for file in DOCUMENT.files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


@pytest.mark.slow
def test_hostile_texts_are_only_texts(tmp_path):
    hostile = {"number": "=1+1", "by": "#let x = 1", "place": "<b>" + "x" * 200, "note": "*a_"}
    folder = write(tmp_path / "g", certificate=hostile)
    assert main(["gauge", str(folder), "--out", str(tmp_path / "out"), "--quiet"]) == 0


# ---- computed again by `tankcal verify`


def change_all(out, change):
    """Change gauge.json, and make every other file and SHA256SUMS fit."""
    gauge = json.loads((out / "gauge.json").read_text(encoding="utf-8"))
    change(gauge)
    shutil.rmtree(out)
    DOCUMENT.write(gauge, out)


def enlarge_limit(gauge):
    gauge["inputs"]["limit"]["absolute_mm"] = gauge["decision"]["absolute_mm"] = 9
    for level in gauge["levels"]:
        level["limit_mm"] = 9


CHANGES = {
    "deviation": lambda gauge: gauge["levels"][1].update(deviation_mm=0.1),
    "U": lambda gauge: [row.update(U_mm=row["U_mm"] / 2) for row in gauge["corrections"]],
    "verdict": lambda gauge: gauge["decision"].update(verdict="failed"),
    "dip": lambda gauge: gauge["readings"][0].update(dip_m=1.250),
    "indication": lambda gauge: gauge["readings"][0].update(gauge_m=1.2510),
    "u": lambda gauge: gauge["inputs"]["uncertainty"].update(u_tape_ppm=10),
    "limit": lambda gauge: gauge["inputs"]["limit"].update(absolute_mm=9),
    "all limits": enlarge_limit,
    "tank": lambda gauge: gauge.update(tank="S-2"),
    "assumption": lambda gauge: gauge["uncertainties"][0].update(is_assumed=False),
    "reading removed": lambda gauge: gauge["readings"].pop(),
    "warning": lambda gauge: gauge["warnings"].append(
        {"file": "x", "row": None, "column": None, "text": "x", "code": None, "values": {}}
    ),
    "notice": lambda gauge: gauge.update(notice=""),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", CHANGES)
def test_a_changed_value_is_detected_although_all_hashes_agree(tmp_path, what):
    out = tmp_path / "out"
    assert main(["gauge", str(GAUGE_EXAMPLE), "--out", str(out), "--quiet"]) == 0
    change_all(out, CHANGES[what])
    for inputs in (GAUGE_EXAMPLE, tmp_path):
        result = verify(out, inputs)
        assert {problem.expected.code for problem in result.problems} == {"verify_value_apart"}


@pytest.mark.slow
def test_readings_changed_with_all_their_results_are_detected_by_the_input_files(tmp_path):
    """A forged comparison agrees with itself; only readings.csv contradicts it."""
    out, forged = tmp_path / "out", tmp_path / "forged"
    shutil.copytree(GAUGE_EXAMPLE, forged)
    path = forged / "readings.csv"
    path.write_text(path.read_text().replace("A,1.249,", "A,1.248,", 1), encoding="utf-8")
    digest = computed(GAUGE_EXAMPLE)["files"]
    assert main(["gauge", str(forged), "--out", str(out), "--quiet"]) == 0
    change_all(out, lambda gauge: gauge.update(files=digest))
    alone, beside = verify(out), verify(out, GAUGE_EXAMPLE)
    assert alone.problems == []
    assert [note.code for note in alone.notes] == ["verify_gauge_inputs", "verify_values_again"]
    (problem,) = beside.problems
    assert problem.expected.values["place"] == "readings[0].dip_m"
    # Changed input files are reported by their hash.
    codes = {problem.expected.code for problem in verify(out, forged).problems}
    assert codes == {"verify_input_changed"}


@pytest.mark.slow
def test_values_of_the_record_are_detected_by_the_record(tmp_path, record_folder):
    """A forged radius or reference height agrees with gauge.json; the record contradicts it."""
    gauge = {"record": str(record_folder / "r"), "supported_by": "shell", "highest_m": 9}
    settings = {"gauge": gauge, "liquid": {"density_kg_m3": 850}, "reference": {"height_m": 9.81}}
    folder = write(tmp_path / "g", **settings)
    text = (folder / "gauge.toml").read_text().replace('tank = "TK-14"\n', "")
    (folder / "gauge.toml").write_text(text, encoding="utf-8")
    out = tmp_path / "out"
    assert main(["gauge", str(folder), "--out", str(out), "--quiet"]) == 0
    saved = json.loads((out / "gauge.json").read_text(encoding="utf-8"))
    assert saved["notice"] == "RECONSTRUCTION"
    assert saved["record"]["reference_height_m"] == saved["table_reference_height_m"]
    result = verify(out, folder)
    assert (result.problems, [note.code for note in result.notes]) == ([], ["verify_values_again"])
    change_all(out, lambda gauge: gauge["record"]["courses"][0].update(radius_m=6.6))
    places = [problem.expected.values["place"] for problem in verify(out, folder).problems]
    assert "record.courses[0].radius_m" in places
    text = text.replace(str(record_folder / "r"), "elsewhere")
    (folder / "gauge.toml").write_text(text, encoding="utf-8")
    codes = [note.code for note in verify(out, tmp_path).notes]
    assert codes[:1] == ["verify_gauge_inputs"]


# ---- the example


def test_example_gives_the_truth(tmp_path):
    """Each correction of examples/gauge leads to the true level within U."""
    truth = json.loads((GAUGE_EXAMPLE / "truth.json").read_text(encoding="utf-8"))
    gauge = computed(GAUGE_EXAMPLE)
    rows = {row["gauge_m"]: row for row in gauge["corrections"]}
    for level, deviation_mm in truth["deviation_mm"].items():
        row = rows[float(level)]
        assert abs(row["correction_mm"] + deviation_mm) <= row["U_mm"]
    line = gauge["line"]
    assert line["U_tilt_low_deg"] <= truth["tilt_deg"] <= line["U_tilt_high_deg"]
    assert gauge["decision"]["verdict"] == "passed"


@pytest.mark.slow
def test_example_is_written_again_by_its_simulation(tmp_path):
    shutil.copytree(GAUGE_EXAMPLE, tmp_path / "g")
    for name in ("readings.csv", "truth.json"):
        (tmp_path / "g" / name).unlink()
    subprocess.run([sys.executable, "simulate.py"], cwd=tmp_path / "g", check=True)
    for name in ("readings.csv", "truth.json"):
        assert (tmp_path / "g" / name).read_bytes() == (GAUGE_EXAMPLE / name).read_bytes()


@pytest.mark.parametrize("language", LANGUAGES)
def test_words_of_every_code(language, folder):
    paper = GaugePaper(computed(folder), language)
    assert set(paper.words["u_inputs"]) == set(UNCERTAINTIES)
    for verdict in ("passed", "guard_band", "guard_band_beyond", "failed"):
        assert paper.words["verdicts"][verdict]
