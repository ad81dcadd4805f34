"""Tables as they were made in the past: proportional parts, bulging walls, rows from 1 cm.

Truth: tanks that `former_tables` integrates numerically, without the formulas that read them.
"""

from dataclasses import replace

import numpy as np
import pytest
from former_tables import SimulatedTank, table_of, with_proportional_parts
from jacobians import assert_derivative

import tankcal
from tankcal.errors import InputError, SolutionError
from tankcal.products.recalibration.read_table import read_table
from tankcal.products.recalibration.seams import Fitting
from tankcal.products.recalibration.solid_geometry import fit_lying
from tankcal.products.recalibration.table_fit import State, find_computed_rows
from tankcal.products.recalibration.table_job import write_job

PLATES = np.array([0.009, 0.008, 0.007, 0.006])
RADII = np.array([6.0, 6.004, 5.997, 6.002])
HEIGHTS = np.full(4, 1.65)  # seams between rows of 1 dm


def tank(**more):
    return SimulatedTank(RADII, HEIGHTS, PLATES, **({"density_kg_m3": 0.0} | more))


def read(folder, table, heights=HEIGHTS, declared=None):
    """`read_table` of a FormerTable that is written to files first."""
    rows = zip(table.height_m, 1000 * table.volume_m3, strict=True)
    lines = [f"{dip:.2f},{volume:.0f}" for dip, volume in rows]
    (folder / "old.csv").write_text("\n".join(["dip_m,volume_L", *lines]))
    lines = [f"{k},{h},{1000 * t:g}" for k, (h, t) in enumerate(zip(heights, PLATES, strict=True))]
    (folder / "courses.csv").write_text("\n".join(["course,height_m,thickness_mm", *lines]))
    lines = ["[former]", "reference_temperature_c = 15", "date = 1999-05-12"]
    lines += [] if declared is None else [f"liquid_density_kg_m3 = {declared}"]
    (folder / "former.toml").write_text("\n".join(lines))
    return read_table(folder / "old.csv", folder / "courses.csv", folder / "former.toml")


def codes(found):
    return {one.code for one in found.warnings}


def assert_radii(found):
    off = np.abs(found.geometry.radii_m - RADII)
    assert np.all(off <= 3 * found.geometry.u_m + 1e-6)


def assert_job_gives_the_table(folder, found, table):
    """The job runs, and its rows are those of the table within U and rounding."""
    write_job(found.job, folder / "job", "en")
    capacity = tankcal.run(tankcal.load(folder / "job")).capacity
    heights = np.array(capacity.height_m)
    dips = table.height_m[table.height_m <= heights[-1] + 1e-9]
    left = np.interp(dips, heights, np.array(capacity.volume_m3)) - table.volume_m3[: len(dips)]
    assert np.all(np.abs(left) <= np.interp(dips, heights, capacity.U_m3) + 1e-3)


def uneven_bottom(table, height_m=0.1, share=0.12):
    """The table with a volume taken off, evenly, below a dip."""
    lowest = np.minimum(table.height_m, height_m) * share * np.pi * RADII[0] ** 2
    return replace(table, volume_m3=np.round(table.volume_m3 - lowest, 3))


@pytest.mark.slow
def test_rows_from_a_centimetre_on_an_uneven_bottom_make_a_job_that_runs(tmp_path):
    table = uneven_bottom(table_of(tank(), first_m=0.01))
    found = read(tmp_path, table)
    assert_radii(found)
    assert_job_gives_the_table(tmp_path, found, table)


@pytest.mark.slow
@pytest.mark.parametrize("first", [0.0, 0.01, 0.05, 0.3])
@pytest.mark.parametrize("made", [{"zero_m": -0.02, "cone_m": 0.05}, {"zero_m": 0.013}])
def test_a_job_of_any_bottom_runs(tmp_path, first, made):
    table = table_of(tank(**made), first_m=first)
    found = read(tmp_path, table)
    assert_radii(found)
    assert_job_gives_the_table(tmp_path, found, table)


def test_proportional_parts_are_found_and_left_out(tmp_path):
    table = with_proportional_parts(table_of(tank()), 10)
    found = read(tmp_path, table)
    assert "read_proportional_parts" in codes(found)
    assert found.geometry.fittings == ()
    assert len(found.geometry.used) == 67
    assert_radii(found)


@pytest.mark.slow
def test_a_thing_in_a_tank_with_proportional_parts(tmp_path):
    table = table_of(tank(deadwood=((2.31, 2.87, -0.16),), density_kg_m3=850.0))
    found = read(tmp_path, with_proportional_parts(table, 10))
    (thing,) = found.geometry.fittings
    assert abs(thing.volume_m3.value + 0.16) < max(3 * thing.volume_m3.u, 1e-3)
    assert_radii(found)
    computed = replace(table, height_m=table.height_m[::10], volume_m3=table.volume_m3[::10])
    assert_job_gives_the_table(tmp_path, found, computed)


@pytest.mark.slow(after=2)
@pytest.mark.parametrize("seed", range(5))
def test_rows_that_were_all_computed_are_not_taken_for_interpolated(seed):
    """A seam or its absence: the rounding of exact rows leaves half a digit of their chords."""
    radii = RADII + np.random.default_rng(seed).normal(0, 0.004, 4)
    exact = table_of(SimulatedTank(radii, np.full(4, 1.8), PLATES, 800.0))
    computed = find_computed_rows(exact)
    assert computed is None or not computed.is_certain
    parts = find_computed_rows(with_proportional_parts(exact, 10))
    assert parts.is_certain
    assert parts.step_m == 0.1


@pytest.mark.slow
def test_rows_that_were_all_computed_are_all_read(tmp_path):
    """Seams near rows of 2 dm: these rows alone would place the zero 4 mm off."""
    heights, plates = np.array([1.9, 2.0, 1.8, 1.65]), np.array([0.010, 0.008, 0.006, 0.006])
    exact = SimulatedTank(6.0 - plates, heights, plates, 0.0, zero_m=-0.02, cone_m=0.05)
    found = read(tmp_path, table_of(exact), heights)
    assert "read_proportional_parts" not in codes(found)


@pytest.mark.slow
@pytest.mark.parametrize("density", [860.6, 0.0])
def test_a_declared_density_holds_where_courses_bulge(tmp_path, density):
    table = table_of(tank(density_kg_m3=density, bulge_m=0.004))
    found = read(tmp_path, table, declared=density)
    assert "read_bulges" in codes(found)
    assert abs(found.geometry.state.density_kg_m3 - density) < 30
    assert found.geometry.fittings == ()
    assert_radii(found)
    assert_job_gives_the_table(tmp_path, found, table)


@pytest.mark.slow
@pytest.mark.parametrize("bulge", [0.001, 0.003, 0.005])
def test_bulging_courses_without_a_declared_density(tmp_path, bulge):
    """The head is hidden: radii within u, and a density that a liquid may have, or none."""
    found = read(tmp_path, table_of(tank(density_kg_m3=860.6, bulge_m=bulge)))
    density = found.geometry.state.density_kg_m3
    assert density == 0 or 100 <= density <= 2000
    assert found.geometry.fittings == ()
    assert_radii(found)


@pytest.mark.slow
def test_a_course_of_several_plates_is_named(tmp_path):
    heights = np.array([4.95, 1.65, 1.65, 1.65])
    with pytest.raises(InputError) as refused:
        read(tmp_path, table_of(tank(density_kg_m3=850.0)), heights)
    (problem,) = refused.value.problems
    assert str(problem).startswith("courses.csv, row 2, height_m: course 0: found 4.95 m")


def test_derivatives_of_bulging_courses():
    """Second method: differences."""
    bulges = np.random.default_rng(1).normal(0, 0.004, (2, 10))
    state = State(
        1.0, np.array([6.0, 6.01]), 800.0, 0.02, np.array([1.8]), 3.6, np.array([0.01, 0.008]),
        206e9, 0.105, 3.5, (Fitting(0.513, 0.972, -0.2),), -3.0, (2.0, 2.4),
        frozenset({"base", "density", "zero", "seams", "kinks"}), False, bulges_m=bulges,
    )  # fmt: skip
    dips = np.linspace(0.105, 3.497, 41)
    assert_derivative(
        lambda x: state.replace_unknowns(x).volume_m3(dips), state.unknowns, state.design(dips)
    )


def lying_rows(last_cm):
    """Closed form: the segment of a circle of 2.5 m, 8 m long, rows of 1 cm to 1 L."""
    dips, r = np.arange(last_cm + 1) / 100, 1.25
    depth = r - dips
    area = r**2 * np.arccos(depth / r) - depth * np.sqrt(r**2 - depth**2)
    table = table_of(tank())
    return replace(table, height_m=dips, volume_m3=np.round(8 * area, 3))


@pytest.mark.slow
def test_the_lowest_rows_of_a_lying_tank():
    diameter, u = fit_lying(lying_rows(37)).best["diameter"]
    assert abs(diameter - 2.5) < 3 * u
    with pytest.raises(SolutionError, match="do not reach high enough"):
        fit_lying(lying_rows(11))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("radius", "length", "depth", "step", "rows", "digits"),
    [(1.3, 8, 1.3, 0.01, 32, 3), (1.0, 5, 0.5, 0.001, 241, 4)],
)
def test_a_diameter_that_low_rows_do_not_determine(radius, length, depth, step, rows, digits):
    """Closed form with ellipsoidal ends, the lowest 12 %: 15.0 m for 2.6 and 7.4 m for 2.0."""
    dips = np.arange(rows) * step
    below = radius - dips
    area = radius**2 * np.arccos(below / radius) - below * np.sqrt(radius**2 - below**2)
    ends = np.pi * depth * dips**2 * (1 - dips / (3 * radius))
    volumes = np.round(length * area + ends, digits)
    table = replace(
        table_of(tank()), height_m=dips, volume_m3=volumes, volume_quantum_m3=10.0**-digits
    )
    with pytest.raises(SolutionError, match="do not reach high enough"):
        fit_lying(table)
