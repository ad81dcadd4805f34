"""Liquid head: closed forms, a fine numerical integration of a bulging shell, the way back."""

from itertools import pairwise

import numpy as np
import pytest
from jacobians import assert_derivative
from shapes import course_of, modes

from tankcal.errors import HeightError, SolutionError
from tankcal.tank.hydrostatics import liquid_head
from tankcal.tank.volumes import ShellVolume
from tankcal.units import STANDARD_GRAVITY

E_PA, JOINTS, PLATES = 206e9, np.array([0, 3.2, 6.4, 9.5]), np.array([0.010, 0.008, 0.006])
LEVELS = np.array([-0.1, 0.0, 0.4, 1.7, 3.2, 3.3, 4.99, 5.0, 5.01, 6.4, 7.7, 9.4, 9.5])


def shell(joints, radius_at, **options):
    """Courses of radii radius_at(z), a number or a function of the azimuth."""
    return ShellVolume(tuple(course_of(*span, radius_at, **options) for span in pairwise(joints)))


def compliance(z, radius=6.5):
    """K of three plates at the heights z, upper course at a joint."""
    plate = PLATES[np.searchsorted(JOINTS[1:-1], z, side="right")]
    return STANDARD_GRAVITY * radius**2 / (E_PA * plate)


def test_the_uniform_shell_closed_form():
    """pi r^3 rho g h^2 / (E t) to first order, and int 2 pi r d + pi d^2; methods, section 11."""
    part = liquid_head(shell([0, 9.5], lambda z: 6.5), [0.008], E_PA, 1000.0)
    at_base = 1000 * STANDARD_GRAVITY * 9.5 * 6.5**2 / (E_PA * 0.008)
    first_order = np.pi * 6.5 * at_base * 9.5
    exact = first_order + np.pi * at_base**2 * 9.5 / 3
    assert part.widening_m([0.0], 9.5)[0] == pytest.approx(at_base, rel=1e-12)
    assert part.volume_m3([9.5])[0] == pytest.approx(exact, rel=1e-12)
    assert [round(1000 * at_base, 3), round(first_order, 5), round(exact, 5)] == [
        2.388,
        0.46334,
        0.46340,
    ]


def test_courses_of_10_8_6_mm_closed_form(figure):
    part = liquid_head(shell(JOINTS, lambda z: 6.5), PLATES, E_PA, 1000.0)
    deep, shallow = 9.5 - JOINTS[:-1], 9.5 - JOINTS[1:]
    pull = 1000 * compliance(JOINTS[:-1])
    exact = np.sum(np.pi * 6.5 * pull * (deep**2 - shallow**2))
    exact += np.sum(np.pi * pull**2 * (deep**3 - shallow**3) / 3)
    figure("liquid head of courses of 10, 8, 6 mm, m3", f"{part.volume_m3([9.5])[0]:.5f}")
    assert part.volume_m3([9.5])[0] == pytest.approx(exact, rel=1e-12)


def bulging(survey_density, survey_level, *, scale=1.0):
    """An irregular shell of unloaded mean radius 6.5 m, surveyed full to a level: (r0, shell)."""
    outline, _ = modes(6.5, 2, np.array([0.02, -0.01, 0.004]), np.array([0.01, 0.015, 0.0]))

    def surveyed(z):
        bulge = compliance(z) * survey_density * max(survey_level - z, 0)
        return lambda azimuth: outline(azimuth) + bulge

    return outline, shell(JOINTS, surveyed, count=90, scale=scale)


def fine_volume(outline, density, level):
    """1/2 integral of (r0(a) + dr(z))^2 over 400 heights a course and 720 azimuths."""
    around = np.arange(720) * 2 * np.pi / 720
    total = 0.0
    for bottom, top in zip(JOINTS, np.minimum(JOINTS[1:], level), strict=False):
        if top > bottom:
            z = bottom + (np.arange(400) + 0.5) / 400 * (top - bottom)
            radius = outline(around)[None, :] + (compliance(z) * density * (level - z))[:, None]
            total += np.sum(radius**2) * np.pi / 720 * (top - bottom) / 400
    return total


@pytest.mark.parametrize("level", [1.7, 3.2, 5.0, 9.5])
def test_a_bulging_irregular_shell_fine_numerical_integration(level):
    """Surveyed full of water, tabulated for 850 kg/m3: second method, midpoint rule.

    The level of the survey is above the shell's sections, so that these show a straight bulge.
    """
    outline, surveyed = bulging(1000.0, 9.5)
    part = liquid_head(
        surveyed, PLATES, E_PA, 850.0, survey_density_kg_m3=1000.0, survey_level_m=9.5
    )
    volume = surveyed.volume_m3([level]) + part.volume_m3([level])
    assert volume[0] == pytest.approx(fine_volume(outline, 850.0, level), rel=2e-8)


def test_unloading_gives_the_empty_shell_back():
    _, surveyed = bulging(1000.0, 9.5)
    part = liquid_head(surveyed, PLATES, E_PA, 0.0, survey_density_kg_m3=1000.0, survey_level_m=9.5)
    _, empty = bulging(0.0, 0.0)
    wet = LEVELS[LEVELS >= 0]
    assert surveyed.volume_m3(wet) + part.volume_m3(wet) == pytest.approx(
        empty.volume_m3(wet), rel=1e-9
    )
    assert surveyed.volume_m3([9.5])[0] - empty.volume_m3([9.5])[0] > 0.4  # so it is not trivial


def test_the_same_liquid_at_the_same_level_changes_nothing():
    """Round trip: surveyed and tabulated at 5 m of 900 kg/m3; other levels do change."""
    _, surveyed = bulging(900.0, 5.0)
    part = liquid_head(
        surveyed, PLATES, E_PA, 900.0, survey_density_kg_m3=900.0, survey_level_m=5.0
    )
    change = part.volume_m3([4.0, 5.0, 6.0])
    assert change[1] == pytest.approx(0.0, abs=1e-12)
    assert change[0] < -1e-3 < 1e-3 < change[2]


def test_below_the_bottom_there_is_nothing():
    part = liquid_head(shell(JOINTS, lambda z: 6.5), PLATES, E_PA, 1000.0)
    assert not np.any(part.volume_m3([-0.2, 0.0]))
    assert not np.any(part.area_m2([-0.2]))
    assert part.sources(LEVELS) == ()


def test_the_order_of_the_levels_does_not_matter():
    """Property: rows are computed alike alone, sorted and shuffled."""
    part = example_part(1.0)
    shuffled = np.random.default_rng(1).permutation(LEVELS)
    alone = [part.volume_m3([level])[0] for level in shuffled]
    assert part.volume_m3(shuffled) == pytest.approx(alone, rel=1e-13, abs=1e-15)


def example_part(scale, inputs=(1.0, 0.0, 1.0, 1.0, 1.0)):
    """A part with all inputs moved: modulus and densities by factors, plates and level by m."""
    modulus, plate, density, survey, level = inputs
    surveyed = shell(JOINTS, lambda z: scale * (6.5 + 0.003 * z))
    return liquid_head(
        surveyed,
        PLATES + plate,
        E_PA * modulus,
        850 * density,
        survey_density_kg_m3=1000 * survey,
        survey_level_m=4.6 * level,  # no row lies there: the derivative has a kink at its own level
    )


def test_derivatives_by_the_inputs():
    part = example_part(1.0)
    found = part.derivatives(LEVELS)
    analytic = np.column_stack(
        [
            found["youngs_modulus"] * E_PA,
            found["plate_thickness"],
            found["liquid_density"] * 850,
            found["survey_density"] * 1000,
            found["survey_level"] * 4.6,
        ]
    )
    for column, step in zip(range(5), (1e-4, 1e-6, 1e-3, 1e-3, 1e-5), strict=True):

        def volume(x, column=column):
            inputs = [1.0, 0.0, 1.0, 1.0, 1.0]
            inputs[column] = x[0]
            return example_part(1.0, inputs).volume_m3(LEVELS)

        start = [0.0 if column == 1 else 1.0]
        assert_derivative(volume, start, analytic[:, [column]], step=step)
    assert_derivative(
        lambda x: example_part(x[0]).volume_m3(LEVELS),
        [1.0],
        found["scale"][:, None],
        step=1e-4,
    )


def test_the_area_is_the_derivative_by_the_level():
    part = example_part(1.0)
    between = np.array([0.4, 1.7, 3.3, 4.9, 5.1, 7.7, 9.4])
    area = part.area_m2(between)
    assert_derivative(lambda x: part.volume_m3(between + x[0]), [0.0], area[:, None], step=1e-5)
    assert part.derivatives(between)["datum"] == pytest.approx(area, rel=1e-15)


def test_a_thermal_scale_of_the_shell_does_not_move_the_girths():
    """Two ways to the same inside radius: scaled at once, or as the course's scale (property)."""
    at_once = shell(JOINTS, lambda z: 6.5 * 1.01)
    by_shape = shell(JOINTS, lambda z: 6.5, scale=1.01)
    one = liquid_head(at_once, PLATES, E_PA, 1000.0)
    two = liquid_head(by_shape, PLATES, E_PA, 1000.0, scale=1.01)
    assert one.volume_m3(LEVELS) == pytest.approx(two.volume_m3(LEVELS), rel=1e-12)


def test_another_density_and_another_gravity():
    part = liquid_head(shell(JOINTS, lambda z: 6.5), PLATES, E_PA, 1000.0)
    light = liquid_head(shell(JOINTS, lambda z: 6.5), PLATES, E_PA, 700.0, gravity_m_s2=9.78)
    again = part.with_density(700.0 * 9.78 / STANDARD_GRAVITY)
    assert again.volume_m3(LEVELS) == pytest.approx(light.volume_m3(LEVELS), rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        (([0.01, 0.0, 0.006], E_PA, 850.0), {}, "course 2 from the bottom"),
        (([0.01, -0.01, 0.006], E_PA, 850.0), {}, "course 2 from the bottom"),
        (([0.01, np.nan, 0.006], E_PA, 850.0), {}, "course 2 from the bottom"),
        (
            ([0.0, 0.0, 0.0], E_PA, 0.0),
            {"survey_density_kg_m3": 1.0, "survey_level_m": 1},
            "1 from",
        ),
        ((PLATES, 0.0, 850.0), {}, "modulus"),
        ((PLATES, np.nan, 850.0), {}, "modulus"),
        ((PLATES, E_PA, 850.0), {"gravity_m_s2": -9.8}, "gravity"),
        ((PLATES, E_PA, -850.0), {}, "density"),
        ((PLATES, E_PA, 850.0), {"survey_level_m": -1.0}, "level"),
        ((PLATES, E_PA, 850.0), {"survey_level_m": 9.6}, "ends at 9.5 m"),
        ((PLATES[:2], E_PA, 850.0), {}, "2 plate thicknesses for 3 courses"),
    ],
)
def test_nonsense_is_refused(arguments, options, words):
    with pytest.raises(SolutionError, match=words):
        liquid_head(shell(JOINTS, lambda z: 6.5), *arguments, **options)


def test_plates_are_needed_only_where_liquid_stands():
    """Empty table, survey liquid in the first course alone: the plates above may be unknown."""
    part = liquid_head(
        shell(JOINTS, lambda z: 6.5),
        [0.01, 0.0, 0.0],
        E_PA,
        0.0,
        survey_density_kg_m3=1000.0,
        survey_level_m=3.0,
    )
    assert np.all(part.volume_m3([3.0, 9.5]) < 0)
    assert np.all(np.isfinite(list(part.derivatives(LEVELS).values())))


def test_a_level_above_the_shell_is_an_error():
    part = liquid_head(shell(JOINTS, lambda z: 6.5), PLATES, E_PA, 1000.0)
    for level in (9.51, np.nan):
        with pytest.raises(HeightError):
            part.volume_m3([1.0, level])
