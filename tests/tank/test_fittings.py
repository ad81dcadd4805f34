"""Deadwood and floating roof: totals, linearity, Archimedes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jacobians import assert_derivative

from tankcal.errors import SolutionError
from tankcal.tank.fittings import deadwood, floating_roof

ITEMS = [  # name, bottom, top, volume, u
    ("column", 0.0, 9.5, -1.9, 0.02),
    ("manhole", 0.5, 1.1, 0.35, 0.01),
    ("sump", -0.6, 0.0, 0.8, 0.0),
    ("coil", 0.2, 0.2, -0.4, 0.03),
]
LEVELS = np.array([-0.7, -0.3, 0.0, 0.1, 0.2, 0.8, 1.1, 5.0, 9.5, 11.0])


def part_of(items):
    return deadwood(*(list(column) for column in zip(*items, strict=True)))


def test_every_item_is_linear_between_its_ends_closed_form():
    volume = part_of(ITEMS).volume_m3(LEVELS)
    column = -1.9 * np.clip(LEVELS / 9.5, 0, 1)
    manhole = 0.35 * np.array([0, 0, 0, 0, 0, 0.5, 1, 1, 1, 1])
    sump = 0.8 * np.array([0, 0.5, 1, 1, 1, 1, 1, 1, 1, 1])
    coil = -0.4 * np.array([0, 0, 0, 0, 1, 1, 1, 1, 1, 1])  # without height: from its level on
    assert volume == pytest.approx(column + manhole + sump + coil, abs=1e-14)
    assert volume[-1] == pytest.approx(-1.9 + 0.35 + 0.8 - 0.4, abs=1e-14)  # the total


@pytest.mark.slow
@given(st.permutations(ITEMS))
def test_the_order_of_the_items_does_not_matter(items):
    assert part_of(items).volume_m3(LEVELS) == pytest.approx(
        part_of(ITEMS).volume_m3(LEVELS), abs=1e-14
    )


@pytest.mark.slow
@given(st.lists(st.sampled_from(ITEMS), min_size=1), st.lists(st.sampled_from(ITEMS), min_size=1))
def test_items_add_however_they_overlap(some, others):
    """Property: the part of all items is the sum of the parts of some and others."""
    together = part_of(some + others).volume_m3(LEVELS)
    apart = part_of(some).volume_m3(LEVELS) + part_of(others).volume_m3(LEVELS)
    assert together == pytest.approx(apart, abs=1e-12)


def test_the_area_is_the_derivative_by_the_level():
    part = part_of(ITEMS)
    between = np.array([-0.7, -0.3, 0.1, 0.8, 5.0, 11.0])
    area = part.area_m2(between)
    assert_derivative(lambda x: part.volume_m3(between + x[0]), [0.0], area[:, None])
    assert part.derivatives(between) == {}  # its heights are dips: they move with the zero
    assert part_of([ITEMS[3]]).area_m2([0.2])[0] == 0  # a step has no area


def test_each_item_is_a_source_of_its_own():
    """Columns are the derivative by the item's volume times its u; exact items have none."""
    part = part_of(ITEMS)
    sources = part.sources(LEVELS)
    assert [(source.note, source.u) for source in sources] == [
        ("column", 0.02),
        ("manhole", 0.01),
        ("coil", 0.03),
    ]
    for source, index in zip(sources, (0, 1, 3), strict=True):

        def volume(x, index=index):
            moved = [list(item) for item in ITEMS]
            moved[index][3] += x[0]
            return part_of(moved).volume_m3(LEVELS)

        assert_derivative(volume, [0.0], source.columns_m3 / source.u)


def test_lowest_level_is_that_of_the_parts():
    assert part_of(ITEMS).lowest_m == -0.6
    assert part_of(ITEMS[:1]).lowest_m == np.inf


def test_no_items_no_volume():
    part = deadwood([], [], [], [])
    assert not np.any(part.volume_m3(LEVELS))
    assert not np.any(part.area_m2(LEVELS))
    assert part.sources(LEVELS) == ()


@pytest.mark.parametrize(
    ("item", "words"),
    [
        (("coil", 1.0, 0.5, -0.1, 0.0), "coil: its top 0.5 m is below"),
        (("coil", 0.0, 0.5, -0.1, -0.1), "coil: its uncertainty"),
        (("coil", 0.0, np.nan, -0.1, 0.1), "coil: expected finite"),
    ],
)
def test_items_that_cannot_be_are_refused(item, words):
    with pytest.raises(SolutionError, match=words):
        part_of([ITEMS[0], item])


def roof(weighing="vacuum", mass=25_000.0):
    return floating_roof(mass, 1.2, 1.6, 850.0, weighing)


def test_a_roof_displaces_its_mass_over_the_density():
    volume = roof().volume_m3([0.0, 1.2, 1.4, 1.6, 9.0])
    full = 25_000 / 850  # closed form
    assert volume == pytest.approx([0, 0, -full / 2, -full, -full], rel=1e-12, abs=1e-12)
    assert roof().breakpoints_m == (1.2, 1.6)
    assert roof().sources([1.0]) == ()


@pytest.mark.parametrize("steel", [7850.0, 2700.0])
def test_a_roof_weighed_in_air_floats_by_archimedes(steel):
    """Forces, second method: true mass from the balance, then buoyancy of liquid and air.

    The balance: m - 1.2 m / steel = M (1 - 1.2 / 8000). Afloat: 850 D + 1.2 (m / steel - D) = m.
    """
    mass = 25_000 * (1 - 1.2 / 8000) / (1 - 1.2 / steel)
    displaced = (mass - 1.2 * mass / steel) / (850 - 1.2)
    assert roof("air").displacement_m3() == pytest.approx(displaced, rel=1e-12)


def test_weighing_in_air_moves_the_deduction_published(figure):
    """Methods, section 11: by 0.13 %."""
    ratio = roof("air").displacement_m3() / roof().displacement_m3() - 1
    figure("deduction of a roof weighed in air over that of its mass, %", f"{100 * ratio:.3f}")
    assert round(100 * ratio, 2) == 0.13


@pytest.mark.parametrize("weighing", ["air", "vacuum"])
def test_density_correction_gives_table_of_observed_density(weighing):
    """Property: table for 850 plus correction = table for the observed density, above the zone."""
    for observed in (780.0, 850.0, 900.0):
        own = floating_roof(25_000, 1.2, 1.6, observed, weighing)
        corrected = roof(weighing).volume_m3([9.0])[0]
        corrected += roof(weighing).density_correction_m3(observed)
        assert corrected == pytest.approx(own.volume_m3([9.0])[0], rel=1e-14)
    lighter = roof().density_correction_m3(780.0)
    assert lighter == pytest.approx(-25_000 * (1 / 780 - 1 / 850), rel=1e-12)  # closed form
    assert lighter < 0  # the roof sinks deeper, there is less liquid at the same dip


def test_derivatives_of_a_roof():
    levels = np.array([0.5, 1.3, 1.5, 4.0])
    for weighing in ("air", "vacuum"):
        found = roof(weighing).derivatives(levels)
        assert_derivative(
            lambda x, weighing=weighing: roof(weighing, x[0]).volume_m3(levels),
            [25_000.0],
            found["roof_mass"][:, None],
            step=1.0,
        )
        assert_derivative(
            lambda x, weighing=weighing: roof(weighing).volume_m3(levels + x[0]),
            [0.0],
            roof(weighing).area_m2(levels)[:, None],
        )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((0.0, 1.2, 1.6, 850.0, "air"), "mass above 0"),
        ((25_000.0, 1.6, 1.2, 850.0, "air"), "its top above its bottom"),
        ((25_000.0, 1.2, 1.6, 0.85, "air"), "denser than air"),
        ((25_000.0, 1.2, 1.6, np.nan, "vacuum"), "denser than air"),
        ((25_000.0, 1.2, 1.6, 850.0, "water"), 'expected "air" or "vacuum"'),
    ],
)
def test_a_roof_that_cannot_be_is_refused(arguments, words):
    with pytest.raises(SolutionError, match=words):
        floating_roof(*arguments)
