"""A former table on the basis of a new one: worked example, closed forms, invariance."""

from dataclasses import replace

import numpy as np
import pytest
from tables_of_s1 import EDGES, HEIGHTS, PLATES, RADII, former_s1, new_s1, rings_m3

from tankcal.errors import InputError
from tankcal.products.recalibration.basis import (
    TankFacts,
    bring_to_one_basis,
    interpolation_error_m3,
)
from tankcal.products.recalibration.former import FormerRoof, FormerTable

S1 = TankFacts("vertical", HEIGHTS, PLATES)


def at(basis, dip, decimals=4):
    """Former volume, what each step adds, what is left, new volume at a dip."""
    row = int(np.argmin(np.abs(basis.height_m - dip)))
    steps = [one.added_m3[row] for one in basis.steps.values()]
    left = basis.new_m3[row] - basis.on_basis_m3[row]
    values = (basis.former_m3[row], *steps, left, basis.new_m3[row])
    return [round(float(one), decimals) for one in values]


def adds_up(basis):
    """Largest difference of the new table and of former, steps and what is left."""
    steps = sum(one.added_m3 for one in basis.steps.values())
    left = basis.new_m3 - basis.on_basis_m3
    return np.abs(basis.former_m3 + steps + left - basis.new_m3).max()


# ---- S-1: published numbers


@pytest.mark.parametrize(
    ("dip", "numbers"),
    [
        (4.20, [684.1273, 0.3259, 0.0753, 0.0972, 0.0, 0.0, 0.0951, 684.7209]),
        (8.39, [1366.9826, 0.3259, 0.1504, 0.4298, 0.0, 0.0, 0.1899, 1368.0786]),
    ],
)
def test_the_waterfall_of_the_worked_example(dip, numbers):
    """Published: the radii of S-1 are those of its readings; former: 0.5 mm, 15 C, 2 mm lower."""
    basis = bring_to_one_basis(former_s1(), new_s1(), S1)
    assert at(basis, dip) == numbers
    assert adds_up(basis) < 1e-9


@pytest.mark.parametrize("weighing", ["vacuum", "air"])
def test_a_roof_in_a_lighter_liquid(weighing):
    """Published: 42 000 kg, from 850 to 740 kg/m3, 7.345 m3 less; in air 0.14 % more, or so."""
    roofs = [FormerRoof(42_000.0, rho, weighing, (1.5, 1.8)) for rho in (850.0, 740.0)]
    basis = bring_to_one_basis(*(replace(new_s1(), roof=one) for one in roofs), S1)
    expected = 42_000 * (1 / 740 - 1 / 850)
    if weighing == "air":
        expected = 42_000 * (1 - 1.2 / 8000) * (1 / (740 - 1.2) - 1 / (850 - 1.2))
    else:
        assert at(basis, 8.39, 3)[4] == -7.345
    assert at(basis, 8.39, 6)[4] == pytest.approx(-expected, abs=1e-6)
    assert at(basis, 1.0)[4] == 0.0
    assert not basis.usable[np.argmin(np.abs(basis.height_m - 1.6))]
    assert basis.usable[[0, -1]].all()


# ---- invariance


def test_the_head_of_a_tank_with_a_roof():
    """Closed form: 850 to 740 kg/m3 in S-1; its first course is cut by the critical zone."""
    former = new_s1()
    light = rings_m3(former.height_m, RADII, 740.0)
    added = light - rings_m3(former.height_m, RADII, 850.0)
    roofs = [FormerRoof(42_000.0, rho, "air", (1.2, 1.5)) for rho in (850.0, 740.0)]
    afloat = np.clip((former.height_m - 1.2) / 0.3, 0, 1)
    taken = 42_000.0 * (1 - 1.2 / 8000) / (np.array([850.0, 740.0]) - 1.2)
    pair = (
        replace(former, volume_m3=former.volume_m3 - taken[0] * afloat, roof=roofs[0]),
        replace(
            former, volume_m3=former.volume_m3 + added - taken[1] * afloat, roof=roofs[1],
            liquid_density_kg_m3=740.0,
        ),
    )  # fmt: skip
    steps = bring_to_one_basis(*pair, S1).steps
    assert steps["head"].added_m3 == pytest.approx(added, rel=1e-3, abs=1e-6)


def test_a_table_with_itself_differs_nowhere():
    table = new_s1()
    basis = bring_to_one_basis(table, table, S1)
    assert all(not one.added_m3.any() for one in basis.steps.values())
    assert np.array_equal(basis.on_basis_m3, basis.new_m3)
    assert [one.state for one in basis.steps.values()] == ["same"] * 5


def test_there_and_back():
    """From the former basis to the new and back: what a zero is worth in head is left."""
    there = bring_to_one_basis(former_s1(), new_s1(), S1)
    moved = replace(new_s1(), height_m=there.height_m, volume_m3=there.on_basis_m3, U_m3=None)
    back = bring_to_one_basis(moved, former_s1(), S1)
    head = rings_m3(back.height_m, RADII, 850.0) - rings_m3(back.height_m, RADII)
    left = back.new_m3 - back.on_basis_m3 - 0.002 * np.gradient(head, back.height_m)
    assert np.abs(left)[5:-5].max() < 5e-5


def test_rows_of_other_dips():
    """A former table in steps of 13 mm: what is interpolated differs by what is said at most."""
    coarse = former_s1(np.arange(0.05, 8.4, 0.013))
    basis = bring_to_one_basis(coarse, new_s1(), S1)
    fine = bring_to_one_basis(former_s1(), new_s1(), S1)
    rows = np.searchsorted(fine.rows, basis.rows)
    off = np.abs(basis.former_m3 - fine.former_m3[rows]).max()
    assert 0 < off < 2 * basis.interpolation_m3 < 1e-3


# ---- each step


@pytest.mark.parametrize("zero", [-0.004, 0.0007, 0.006])
@pytest.mark.parametrize("digit", [0.0, 0.001])
def test_a_zero_is_found_by_the_volumes(zero, digit):
    """Closed form: all volumes of the former table are those of dips that much larger."""
    dips = np.round(np.arange(0.10, 8.395, 0.01), 3)
    volumes = rings_m3(dips - zero, RADII - 0.0005)
    if digit:
        volumes = np.round(volumes / digit) * digit
    former = former_s1(dips, volume_quantum_m3=digit, reference_height_m=None, U_m3=None)
    former = replace(former, volume_m3=volumes, reference_temperature_c=20.0)
    found = bring_to_one_basis(former, new_s1(reference_height_m=None), S1).zero
    assert found.source == "fitted"
    assert found.height_m == pytest.approx(zero, abs=max(5 * found.u_m, 1e-6))
    assert found.u_m < 2e-6


def test_a_declared_zero_counts_and_the_fitted_one_is_told():
    basis = bring_to_one_basis(former_s1(), new_s1(), S1)
    assert (basis.zero.source, basis.steps["zero"].source) == ("reference_heights", "declared")
    assert basis.zero.height_m == pytest.approx(0.002)
    assert basis.zero.fitted_m == pytest.approx(0.002, abs=1e-6)


def test_a_table_in_litres_is_rounded_last():
    new = new_s1(volume_quantum_m3=0.01)
    new = replace(new, volume_m3=np.round(new.volume_m3, 2))
    basis = bring_to_one_basis(former_s1(), new, S1)
    rest = basis.on_basis_m3 / 0.01
    assert np.abs(rest - np.round(rest)).max() < 1e-6
    assert 0 < np.abs(basis.steps["rounding"].added_m3).max() <= 0.005 + 1e-9
    assert adds_up(basis) < 1e-9


def sphere_m3(dips, radius):
    return np.pi * dips**2 * (radius - dips / 3)


def lying_m3(dips, diameter, length):
    r = diameter / 2
    angle = np.arccos(np.clip((r - dips) / r, -1, 1))
    return length * r**2 * (angle - np.sin(2 * angle) / 2)


@pytest.mark.parametrize("kind", ["sphere", "horizontal"])
def test_a_solid_that_grows_warm(kind):
    """Closed form: all lengths 1 + a dT longer."""
    dips = np.arange(0.0, 2.4, 0.001)
    scale = 1 + 1.1e-5 * 20
    if kind == "sphere":
        volumes = sphere_m3(dips, 1.25), sphere_m3(dips, 1.25 * scale)
    else:
        volumes = lying_m3(dips, 2.5, 8.0), lying_m3(dips, 2.5 * scale, 8.0 * scale)
    tables = [
        FormerTable(name, dips, one, reference_temperature_c=t, reference_height_m=3.0, kind=kind)
        for name, one, t in zip(("old", "new"), volumes, (0.0, 20.0), strict=True)
    ]
    basis = bring_to_one_basis(*tables, TankFacts(kind))
    assert np.abs(basis.new_m3 - basis.on_basis_m3).max() < 2e-5
    assert basis.steps["temperature"].added_m3[-1] > 0.001


@pytest.mark.parametrize("kind", ["sphere", "horizontal"])
def test_the_zero_of_a_solid_beside_its_sizes(kind):
    """Closed form: dips 3 mm smaller and, in the horizontal one, other sizes."""
    dips = np.arange(0.1, 2.3, 0.01)
    if kind == "sphere":
        volumes = sphere_m3(dips + 0.003, 1.25), sphere_m3(dips, 1.2502)
    else:
        volumes = lying_m3(dips + 0.003, 2.5, 8.0), lying_m3(dips, 2.5004, 8.001)
    old, new = (
        FormerTable(name, dips, one, kind=kind)
        for name, one in zip(("old", "new"), volumes, strict=True)
    )
    zero = bring_to_one_basis(old, new, TankFacts(kind)).zero
    assert zero.height_m == pytest.approx(-0.003, abs=2e-5)


# ---- what is not known


def test_what_is_not_declared_is_said_and_not_done():
    former = former_s1(
        reference_temperature_c=None, liquid_density_kg_m3=None, roof=None,
    )  # fmt: skip
    new = new_s1(roof=FormerRoof(42_000.0, 850.0, "air", (1.5, 1.8)))
    steps = bring_to_one_basis(former, new, TankFacts("vertical")).steps
    assert steps["temperature"].lacking == ("former.reference_temperature_c",)
    assert steps["head"].lacking == ("former.liquid_density_kg_m3",)
    assert steps["roof"].lacking == ("former.roof",)
    assert not any(steps[one].added_m3.any() for one in ("temperature", "head", "roof"))


def test_a_head_needs_the_courses():
    step = bring_to_one_basis(former_s1(), new_s1(), TankFacts("vertical")).steps["head"]
    assert (step.state, step.lacking) == ("not_possible", ("courses",))
    bare = TankFacts("vertical", HEIGHTS, np.where(np.arange(5) == 4, np.inf, PLATES))
    step = bring_to_one_basis(former_s1(), new_s1(), bare).steps["head"]
    assert (step.state, step.lacking) == ("not_possible", ("courses.thickness_mm",))


@pytest.mark.slow
@pytest.mark.parametrize(("density", "head"), [(850.0, "with"), (0.0, "without")])
def test_a_density_that_is_not_declared_is_read(density, head):
    """Closed form: a table of S-1 with that head, rounded to litres."""
    dips = np.round(np.arange(0.10, 8.395, 0.01), 3)
    volumes = np.round(rings_m3(dips, RADII, density), 3)
    former = new_s1(liquid_density_kg_m3=None, volume_quantum_m3=0.001, U_m3=None)
    basis = bring_to_one_basis(replace(former, volume_m3=volumes), new_s1(), S1)
    read = basis.densities[0]
    assert read.head == head
    assert read.read_kg_m3 == pytest.approx(density, abs=3.5 * read.u_kg_m3)
    step = basis.steps["head"]
    assert (step.state, step.source) == ("done", "read")
    truth = rings_m3(8.39, RADII, 850.0) - rings_m3(8.39, RADII, density)
    assert step.added_m3[-1] == pytest.approx(float(truth[0]), abs=0.02)


def test_tables_without_a_common_range():
    low = new_s1(np.arange(0.1, 1.0, 0.01))
    high = new_s1(np.arange(2.0, 8.0, 0.01))
    with pytest.raises(InputError, match=r"new.csv: dips from 2 to 7.99 m; expected some in"):
        bring_to_one_basis(low, high, S1)


@pytest.mark.parametrize("step", [0.01, 0.05, 0.1])
def test_a_bound_of_what_is_interpolated(step):
    """Closed form: a lying cylinder, and S-1 with a step of 8 mm of the radius at a seam."""
    dips = np.arange(0.05, 2.45, step)
    table = FormerTable("lying", dips, lying_m3(dips, 2.5, 8.0))
    asked = np.linspace(dips[0], dips[-1], 2001)
    off = np.interp(asked, dips, table.volume_m3) - lying_m3(asked, 2.5, 8.0)
    assert np.abs(off).max() < interpolation_error_m3(table, asked) < 2 * np.abs(off).max()
    radii = RADII + np.array([0.0, 0.008, 0.0, -0.008, 0.0])
    rows = np.arange(0.023, EDGES[-1], step)
    shell = FormerTable("shell", rows, rings_m3(rows, radii))
    between = np.linspace(rows[0], rows[-1], 5003)
    off = np.interp(between, rows, shell.volume_m3) - rings_m3(between, radii)
    assert np.abs(off).max() < interpolation_error_m3(shell, between) + 1e-9
