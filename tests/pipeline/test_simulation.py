"""The simulated table, against closed forms, exact laws and the tank with its inputs moved."""

import shutil
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from job_builder import write_job
from scipy.special import ndtri
from scipy.stats import t as student

import tankcal
from tankcal.gum import Combination
from tankcal.gum.distributions import standard
from tankcal.gum.monte_carlo import Goal
from tankcal.job.model import DeclaredInput
from tankcal.pipeline.simulation import Model, simulate_table
from tankcal.pipeline.simulation.curvature import VARIED, curvature, vary_input
from tankcal.pipeline.tanks import body_of
from tankcal.tank.budgets import budget
from tankcal.uncertainty import declared_source

Z = ndtri(0.975)
SPHERE = {"sphere.diameter_m": 4.0, "table.step_m": 0.005}
OUTSIDE = {
    "survey.shell_temperature_c": 30.0,
    "survey.liquid_level_m": 3.0,
    "survey.liquid_density_kg_m3": 850.0,
    "table.liquid_density_kg_m3": 900.0,
    "table.step_m": 0.1,
}
LYING = {
    "horizontal.end_a": "ellipsoidal",
    "horizontal.end_a_depth_m": 0.5,
    "horizontal.end_b": "conical",
    "horizontal.end_b_depth_m": 0.3,
    "horizontal.tilt_mm_per_m": 5.0,
    "horizontal.dip_from_a_m": 5.0,
    "survey.side": "outside",
    "survey.shell_temperature_c": 30.0,
    "horizontal.thickness_mm": 6.0,
    "table.step_m": 0.05,
}

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(folder, simulated=False, **parts):
    return tankcal.run(tankcal.load(write_job(folder, **parts)), simulated=simulated)


def simulated(result, pairs=(), **goal):
    survey = result.wall or result.scan or result.surveys.get("great_circles")
    return simulate_table(
        result.job, survey, result.body, result.zero_m, result.table, pairs, goal=Goal(**goal)
    )


SLOW_FIXTURES = {"tank", "sphere"}  # seconds each


@pytest.fixture(scope="module")
def sphere(tmp_path_factory):
    """A sphere whose only uncertainty is the height of the dips: 4 mm, normal."""
    folder = tmp_path_factory.mktemp("sphere") / "job"
    inputs = [("datum", 4.0, "mm")]
    result = run(folder, kind="sphere", settings=SPHERE, uncertainty=inputs)
    return result, simulated(result, [(0.005, 1.0), (1.0, 3.0)])


def cap(h):
    """Volume of the cap of a sphere of 4 m."""
    h = np.clip(h, 0, 4)
    return np.pi * h**2 * (2 - h / 3)


def test_ends_of_a_monotone_volume_are_volumes_of_moved_dips(sphere, figure):
    result, found = sphere
    heights = result.table.height_m[:-1]
    for end, exact in ((found.found.low, -Z), (found.found.high, Z)):
        off = np.abs(end[:-1] - cap(heights + 0.004 * exact))
        errors = off / np.maximum(result.table.u_m3[:-1], 1e-4)  # 0 where it is empty
        figure(f"ends of a sphere's rows at {exact:+.2f} u, off by u of the row", errors.max())
        assert errors.max() < 0.01


def test_gum_fails_next_to_the_empty_sphere_and_holds_above(sphere):
    result, found = sphere
    judged = found.judged
    assert not np.any(judged.validated[:4])
    assert np.all(judged.validated[60:-60])
    assert not np.any(judged.validated[-4:-1])  # nor does it hold more than all
    assert np.all(found.bent[:3])
    assert not np.any(found.bent[20:-20])
    low = ~judged.validated
    assert np.all(judged.low[low] == found.found.low[low])
    assert judged.low[0] == 0.0  # no tank holds less than nothing
    gum = result.table.volume_m3 - result.table.U_m3
    assert np.all(judged.low[~low] == gum[~low])


def test_deliveries_are_simulated_from_the_same_dips(sphere):
    result, found = sphere
    u = 0.004
    for number, (low, high) in enumerate(
        zip(found.delivered.low_m, found.delivered.high_m, strict=True)
    ):
        dips = u * np.array([-Z, Z])
        exact = np.sort(cap(high + dips) - cap(low + dips))
        ends = [found.of_deliveries[0].low[number], found.of_deliveries[0].high[number]]
        if low == 1.0:  # symmetric about the middle: the difference is no monotone function
            exact = np.quantile(_differences(low, high, u), [0.025, 0.975])
        scale = result.table.delivery(low, high).u_m3 + 1e-6
        assert np.max(np.abs(ends - exact)) < 0.03 * max(scale, 1e-4)


def _differences(low, high, u):
    points = u * ndtri((np.arange(200_000) + 0.5) / 200_000)
    return cap(high + points) - cap(low + points)


@pytest.mark.slow
def test_student_and_rectangular_inputs_have_their_exact_law(tmp_path, figure):
    rows = [
        ("scale", 300, "ppm", "A", "normal", 3),
        ("datum", 3.0, "mm", "B", "rectangular", None),
        ("offset", 0.5, "mm", "A", "normal", 5),
        ("plate_thickness", 0, "mm"),
    ]
    result = run(
        tmp_path / "job", uncertainty=rows, sd_mm=0.3, settings={"table.step_m": 0.5}, rings=2
    )
    known = [one for one in result.table.sources if one.u or np.isinf(one.dof)]
    table = replace(result.table, sources=tuple(known))  # the form has Cauchy tails here
    found = simulated(replace(result, table=table))
    worst = 0.0
    for row in (3, 9, 18):
        sizes = [np.sqrt(np.sum(one.columns_m3[row] ** 2)) for one in known]
        laws = [
            standard(1.0, "t", dof=one.dof)
            if np.isfinite(one.dof)
            else standard(1.0, one.distribution)
            for one in known
        ]
        half = Combination(laws, sizes).half_width(0.95)
        for end, sign in ((found.found.low, -1), (found.found.high, 1)):
            off = abs(end[row] - table.volume_m3[row] - sign * half)
            worst = max(worst, off / table.u_m3[row])
    figure("ends against the exact law, off by u of the row", worst)
    assert worst < 0.01


@pytest.mark.slow
def test_a_declared_sd_is_u_of_the_budget_and_sd_of_the_draws(tmp_path):
    """The u of the budget was sd sqrt((dof - 2)/dof), 17.3 for 30 with 3 degrees of freedom."""
    result = run(
        tmp_path / "job",
        uncertainty=[("plate_thickness", 0, "mm"), ("scale", 0, "ppm")],
        sd_mm=0.01,
        settings={"table.step_m": 1.0},
    )
    declared = DeclaredInput("scale", 3e-3, "ppm", 3000.0, distribution="t", dof=3.0, u_is="sd")
    slope = result.body.derivatives(result.table.height_m)["scale"]
    table = replace(result.table, sources=(declared_source(declared, slope),))
    found = simulated(replace(result, table=table))
    top = budget(table, table.height_m[-1])
    assert (top.lines[0].u, top.lines[0].distribution) == (3000.0, "t")
    assert top.u_m3 == pytest.approx(3e-3 * slope[-1])
    assert found.found.u[-1] == pytest.approx(top.u_m3, rel=1e-3)
    half = student.ppf(0.975, 3) * top.u_m3 / np.sqrt(3)
    assert (found.found.high - found.found.low)[-1] / 2 == pytest.approx(half, rel=2e-3)
    assert top.k == pytest.approx(Z)  # an sd is known: its degrees of freedom are a shape


@pytest.mark.slow
def test_input_of_three_dof_gives_student_interval(tmp_path):
    rows = [("scale", 10000, "ppm", "A", "normal", 3), ("plate_thickness", 0, "mm")]
    result = run(tmp_path / "job", uncertainty=rows, sd_mm=0.05, settings={"table.step_m": 1.0})
    found = simulated(result)
    half = (found.found.high - found.found.low)[-1] / 2
    assert half == pytest.approx(student.ppf(0.975, 3) * result.table.u_m3[-1], rel=2e-3)
    assert np.isfinite(found.found.low[-1])


@pytest.mark.slow
def test_a_seed_gives_the_same_numbers_and_another_seed_others(sphere):
    result, first = sphere
    pairs = [*zip(first.delivered.low_m, first.delivered.high_m, strict=True)]
    again, other = simulated(result, pairs), simulated(result, pairs, seed=7)
    assert np.array_equal(first.found.low, again.found.low)
    assert not np.array_equal(first.found.low[:40], other.found.low[:40])


WALL = {"paint_mm": 0.3, "sd_mm": 1.0, "tilt": (0.004, 0.0)}
KINDS = {
    # what the liquid head gains with the radius itself, 4e-4 of the slope, is left out
    "loaded": {"settings": OUTSIDE, **WALL},
    "cone": {
        "settings": {
            "survey.shell_temperature_c": 30.0,
            "table.step_m": 0.1,
            "bottom.form": "cone",
            "bottom.centre_z_m": -0.3,
        },
        **WALL,
    },
    "vertical": {"settings": {"survey.shell_temperature_c": 30.0, "table.step_m": 0.1}, **WALL},
    "horizontal": {"kind": "horizontal", "settings": LYING},
    "sphere": {
        "kind": "sphere",
        "settings": {
            **SPHERE,
            "survey.side": "outside",
            "sphere.thickness_mm": 10.0,
            "survey.shell_temperature_c": 30.0,
            "table.step_m": 0.1,
        },
    },
}


@pytest.fixture(scope="module", params=KINDS)
def tank(request, tmp_path_factory):
    allowed = 5e-4 if request.param == "loaded" else 2e-5
    return run(tmp_path_factory.mktemp(request.param) / "job", **KINDS[request.param]), allowed


STEPS = {"shell_temperature": 0.5, "expansion": 1e-7, "youngs_modulus": 1e9}
STEPS |= {"liquid_density": 5.0, "survey_density": 5.0, "tilt": 1e-4}


@pytest.mark.slow
def test_slopes_are_those_of_the_tank_with_its_inputs_moved(tank, figure):
    """Every analytic derivative that has a moved tank, by differences of its volumes."""
    tank, allowed = tank
    survey = tank.wall or tank.scan
    levels = tank.table.height_m[2:-2] + tank.zero_m
    slopes, tried = tank.body.derivatives(levels), []
    for name in VARIED:
        step = STEPS.get(name, 1e-4)
        moved = [vary_input(tank.job, name, sign * step) for sign in (1, -1)]
        if name not in slopes or None in moved:
            continue
        volumes = [body_of(job, survey, uncertain=False).volume_m3(levels) for job in moved]
        by_differences = (volumes[0] - volumes[1]) / (2 * step)
        size = np.abs(slopes[name]).max()
        assert np.max(np.abs(slopes[name] - by_differences)) <= allowed * size, name
        tried.append(name)
    figure(f"slopes tried on a {tank.job.tank.kind} tank", len(tried))
    assert len(tried) >= 3


@pytest.mark.slow
def test_curvature_by_temperature_and_expansion(tmp_path):
    settings = {"survey.shell_temperature_c": 30.0, "table.step_m": 0.1}
    result = run(tmp_path / "job", settings=settings)
    levels = result.table.height_m[1:]
    u = {"shell_temperature": 2.0, "expansion": 1e-6}
    found = curvature(result.job, result.wall, result.body, levels, u, 1e-9 * result.table.u_m3[1:])
    scale, a, dt = 1 - 1.1e-4, 1.1e-5, -10.0  # table at 20, survey at 30 degrees
    cold = result.table.volume_m3[1:] / scale**2
    exact = {
        ("expansion", "expansion"): 2 * cold * dt**2 * 1e-12,
        ("shell_temperature", "shell_temperature"): 2 * cold * a**2 * 4,
        ("expansion", "shell_temperature"): -2 * cold * (scale + a * dt) * 2e-6,
    }
    assert set(found.pairs) == set(exact)
    for pair, column in zip(found.pairs, found.values.T, strict=True):
        assert column == pytest.approx(exact[pair], rel=2e-3), pair


@pytest.mark.slow
def test_mixed_curvature_is_that_of_the_tank_with_two_inputs_moved(tmp_path):
    """Second method: the mixed second difference of tanks with both inputs moved, in the middle."""
    rows = [("diameter", 20.0, "mm"), ("length", 50.0, "mm"), ("tilt", 2.0, "mm/m")]
    result = run(tmp_path / "job", kind="horizontal", settings=LYING, uncertainty=rows)
    none = np.zeros((0, len(result.table.height_m)))
    survey = result.wall or result.scan or result.surveys.get("great_circles")
    model = Model(result.job, survey, result.body, result.zero_m, result.table, none)
    u = {one.name: one.u for one in result.body.declared}
    middle = slice(len(model.levels) // 4, 3 * len(model.levels) // 4)
    levels = model.levels[middle]
    mixed = [pair for pair in model.curved.pairs if pair[0] != pair[1] and {*pair} <= {*VARIED}]
    assert len(mixed) >= 3
    for pair in mixed:
        by_model = by_tank = 0.0
        for signs in product((1, -1), repeat=2):
            draw, job = np.zeros((1, len(model.inputs.distributions))), result.job
            for name, sign in zip(pair, signs, strict=True):
                draw[0, model.inputs.place[name]] = sign
                job = vary_input(job, name, sign * u[name])
            weight = signs[0] * signs[1] / 4
            by_model = by_model + weight * model.quadratic(draw)[0, middle]
            by_tank = by_tank + weight * body_of(job, survey, uncertain=False).volume_m3(levels)
        size = np.abs(by_tank).max()
        assert by_model == pytest.approx(by_tank, abs=0.02 * size), pair


@pytest.mark.slow
def test_inputs_declared_by_dips_add_no_curvature(tmp_path):
    """Deadwood and roof go with the table's zero: moving it leaves them where the dips are."""
    parts = {
        "deadwood": [("coil", 2.0, 2.5, -2.0, 0.1)],
        "roof": {"critical_bottom_m": 4.0, "critical_top_m": 4.3},
        "uncertainty": [("datum", 5.0, "mm"), ("roof_mass", 50.0, "kg")],
        "settings": {"table.step_m": 0.1},
    }
    result = run(tmp_path / "job", sd_mm=1.0, **parts)
    found = simulated(result)
    assert np.flatnonzero(found.bent).tolist() == [0]
    step = 0.003
    rows = np.arange(15, 60)
    levels = result.table.height_m[rows]
    moved = result.body.moved_m3(levels, step) - result.table.volume_m3[rows]
    assert moved == pytest.approx(step * result.body.derivatives(levels)["datum"], rel=1e-4)
    assert np.all(found.judged.validated[1:])


@pytest.mark.slow
def test_a_bottom_measured_by_liquid_goes_with_the_dips(tmp_path):
    """Its volumes were measured by dips: above it the zero's error moves the increments alone."""
    volumes = [(0.0, 0.0, 0.0), (0.2, 26.0, 0.02), (0.5, 66.0, 0.02)]
    settings = {"table.step_m": 0.1, "survey.side": "inside"}
    rows = [("datum", 2.0, "mm")]
    parts = {"bottom_volumes": volumes, "settings": settings, "uncertainty": rows}
    result = run(tmp_path / "job", sd_mm=0.5, **parts)
    found = simulated(result)
    above = result.table.height_m > 0.6
    assert found.found.u[above] == pytest.approx(result.table.u_m3[above], rel=0.02)
    assert np.all(found.judged.validated[above])
    area = np.gradient(result.table.volume_m3, result.table.height_m)[above]
    assert result.table.area_m2[above][1:-1] == pytest.approx(area[1:-1], rel=1e-3)


@pytest.mark.slow
def test_an_error_that_no_tank_can_have_takes_a_smaller_step(tmp_path):
    """A conical end 50 mm deep with u 60 mm: moved by u it would bulge the other way."""
    settings = {"horizontal.end_a": "conical", "horizontal.end_a_depth_m": 0.05}
    rows = [("end_depth", 60.0, "mm")]
    result = run(tmp_path / "job", kind="horizontal", settings=settings, uncertainty=rows)
    found = simulated(result)
    assert np.all(np.isfinite(found.found.low))


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("r", [0.0, 1e-6, 1.0])
def test_correlation_leaves_other_inputs_unchanged(tmp_path, r):
    """Two rectangular sizes: with r = 0 a trapezoid, nearly the same with hardly any r."""
    rows = [
        ("diameter", 3.0, "mm", "B", "rectangular"),
        ("scale", 750.0, "ppm", "B", "rectangular"),
    ]
    settings = {"table.step_m": 0.5, "sphere.diameter_m": 4.0}
    job = tankcal.load(
        write_job(tmp_path / "job", kind="sphere", settings=settings, uncertainty=rows)
    )
    job = replace(job, correlations=(("diameter", "scale", r),) if r else ())
    result = tankcal.run(job, simulated=True)
    own = [line.contribution for line in result.stated.volumes[-1].lines[:2]]
    rectangle = np.sqrt(3) * np.array(own)
    if r == 1.0:
        half = 0.95 * rectangle.sum()
    else:
        half = Combination([standard(1.0, "rectangular")] * 2, own).half_width(0.95)
    assert (result.simulation.found.high - result.simulation.found.low)[-2] / 2 == pytest.approx(
        half * result.table.u_m3[-2] / result.table.u_m3[-1], rel=0.02
    )


@pytest.mark.slow
def test_u_of_a_cauchy_input_is_infinite_in_every_row(tmp_path):
    rows = [("scale", 100.0, "ppm", "A", "normal", 1)]
    settings = {"table.step_m": 0.5, "sphere.diameter_m": 4.0}
    result = run(tmp_path / "job", kind="sphere", settings=settings, uncertainty=rows)
    found = simulated(result).found
    assert np.all(np.isinf(found.u[1:]))
    half = (found.high - found.low)[4] / 2
    assert half == pytest.approx(student.ppf(0.975, 1) * result.table.u_m3[4], rel=0.02)


@pytest.mark.slow
def test_unobserved_tilt_adds_its_square(tmp_path):
    """An upright tank: the slope by the tilt is 0, yet m^2/2 of the volume is never lost."""
    rows = [("tilt", 20.0, "mm/m"), ("plate_thickness", 0, "mm")]
    result = run(tmp_path / "job", uncertainty=rows, sd_mm=0.2, settings={"table.step_m": 1.0})
    tilt = next(one for one in result.table.sources if one.kind == "tilt")
    assert abs(tilt.columns_m3[-1, 0]) < 0.05 * result.table.u_m3[-1]
    added = simulated(result).found.value[-1] - result.table.volume_m3[-1]
    assert added == pytest.approx(result.table.volume_m3[-1] * 0.02**2 / 2, rel=0.05)


@pytest.mark.slow
def test_rows_not_drawn_follow_their_neighbours(monkeypatch, tmp_path):
    """The same table with every row drawn for: ends within a thousandth of u."""
    rows = [("scale", 100, "ppm"), ("datum", 2.0, "mm"), ("offset", 0.5, "mm", "A", "normal", 4)]
    result = run(tmp_path / "job", uncertainty=rows, sd_mm=1.0, settings={"table.step_m": 0.005})
    some = simulated(result, [(1.0, 4.0)])
    monkeypatch.setattr("tankcal.pipeline.simulation.MOST_ROWS", 10**6)
    every = simulated(result, [(1.0, 4.0)])
    assert len(every.found.low) > 2 * 800
    for name in ("value", "low", "high", "shortest_low", "shortest_high"):
        off = getattr(some.found, name) - getattr(every.found, name)
        assert np.max(np.abs(off[1:]) / result.table.u_m3[1:]) < 2e-3, name
    assert np.array_equal(some.judged.validated, every.judged.validated)


@pytest.mark.slow
def test_rows_that_take_plain_draws_are_bounded_in_number(monkeypatch, tmp_path, figure):
    """A sphere with plates ten times too thin: elastic expansion bends every row.

    All rows are drawn for once, with a tenth of the draws; forty are as good.
    """
    folder = shutil.copytree(EXAMPLES / "sphere-straps", tmp_path / "job")
    text = (folder / "job.toml").read_text("utf-8")
    for old, new in (
        ("thickness_mm = 24", "thickness_mm = 2.4"),
        ("step_m = 0.01", "step_m = 0.2"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    (folder / "job.toml").write_text(text, "utf-8")
    result = tankcal.run(tankcal.load(folder), simulated=False)
    some = simulated(result, plain_draws=100_000)
    monkeypatch.setattr("tankcal.pipeline.simulation.MOST_PLAIN", 10**6)
    every = simulated(result, plain_draws=100_000)
    assert every.drawn > some.drawn + 5
    off = 0.0
    for name in ("low", "high"):
        parts = (getattr(some.found, name) - getattr(every.found, name))[1:]
        off = max(off, np.max(np.abs(parts) / result.table.u_m3[1:]))
    figure("ends of rows not drawn for, largest error in u", f"{off:.4f}")
    assert off < 0.02


@pytest.mark.slow
def test_result_has_what_the_job_requests(tmp_path):
    settings = {"table.step_m": 1.0, "table.monte_carlo": True}
    job = tankcal.load(write_job(tmp_path / "job", settings=settings))
    told = []
    result = tankcal.run(job, part_progress=lambda *one: told.append(one))
    assert len(result.simulation.found.u) == len(result.table.height_m)
    delivered = result.simulation.delivered
    assert tuple(zip(delivered.low_m, delivered.high_m, strict=True)) == result.stated.pairs
    assert {text for text, _, _ in told} == {"simulating the table"}
    assert all(0 < done <= total for _, done, total in told)
    without = replace(job, table=replace(job.table, monte_carlo=False))
    assert tankcal.run(without).simulation is None


def test_a_table_without_any_uncertainty_is_not_simulated(tmp_path):
    settings = {"table.step_m": 0.5, "sphere.diameter_m": 4.0}
    result = run(tmp_path / "job", simulated=True, kind="sphere", settings=settings)
    assert result.table.sources == ()
    assert result.simulation is None
    assert np.array_equal(result.intervals.low_m3, result.table.volume_m3)
