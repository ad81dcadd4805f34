"""Volumes of exact shapes, a mesh as second method, and the published variances."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from jacobians import assert_derivative
from shapes import course_of, modes, ring

from tankcal.errors import HeightError
from tankcal.geometry.field.estimate import LEVELS
from tankcal.tank.volumes import ShellVolume, gauss_levels
from tankcal.uncertainty import factor_of

HEIGHTS = np.concatenate([[0.001, 0.002, 0.01], np.linspace(0.05, 9.5, 190)])


def shell(joints, radius_at, **options):
    """A shell whose sections have the radius radius_at(height)."""
    ends = pairwise(joints)
    return ShellVolume(tuple(course_of(*span, radius_at, **options) for span in ends))


def test_a_cylinder_is_exact_at_every_height():
    volume = shell([0, 9.5], lambda z: 6.5).volume_m3(HEIGHTS)
    assert volume == pytest.approx(np.pi * 6.5**2 * HEIGHTS, rel=1e-12)  # closed form


def test_a_frustum_is_exact_at_every_height():
    volume = shell([0, 9.5], lambda z: 6.5 + 0.004 * z).volume_m3(HEIGHTS)
    low, high = 6.5, 6.5 + 0.004 * HEIGHTS
    exact = np.pi * HEIGHTS * (low**2 + low * high + high**2) / 3  # closed form
    assert volume == pytest.approx(exact, rel=1e-12)


def test_courses_of_stepped_radii_are_exact_at_every_height():
    joints, radii = np.linspace(0, 9.5, 6), np.array([6.51, 6.5, 6.495, 6.49, 6.488])
    middles = (joints[1:] + joints[:-1]) / 2
    stack = shell(joints, lambda z: radii[int(z / 1.9)])
    below = np.clip(HEIGHTS[:, None] - joints[:-1], 0, 1.9)
    assert stack.volume_m3(HEIGHTS) == pytest.approx(below @ (np.pi * radii**2), rel=1e-12)
    assert stack.area_m2(middles) == pytest.approx(np.pi * radii**2, rel=1e-12)
    assert stack.area_m2([1.9, 9.5]) == pytest.approx(np.pi * radii[[1, 4]] ** 2, rel=1e-12)


def test_plate_and_temperature_are_exact_for_a_cylinder():
    options = {"inset_m": 0.008, "scale": 1.0001}
    stack = shell([0, 9.5], lambda z: 6.5, **options)
    inside = 1.0001 * (6.5 - 0.008)
    assert stack.volume_m3([9.5])[0] == pytest.approx(np.pi * inside**2 * 9.5, rel=1e-12)


def test_the_loss_by_plate_is_the_derivative_by_the_inset():
    def volume(inset):
        shape = shell([0, 9.5], lambda z: 6.5 + 0.01 * z, inset_m=inset[0], scale=1.01)
        return shape.volume_m3([1.0, 9.5])

    stack = shell([0, 9.5], lambda z: 6.5 + 0.01 * z, inset_m=0.008, scale=1.01)
    loss = stack.inset_m2([1.0, 9.5])
    assert_derivative(volume, [0.008], -loss[:, None], step=1e-5)


def test_features_follow_their_gradients():
    """Against differences, by radii of the outlines."""
    rng = np.random.default_rng(2)
    outline = modes(6.5, 2, rng.normal(0, 0.01, 4), rng.normal(0, 0.01, 4))[0]
    options = {"inset_m": 0.006, "scale": 1.001, "count": 24}
    course = course_of(0, 1.9, lambda z: lambda a: outline(a) + 0.003 * z, **options)

    def areas(moved):
        outlines = course.outlines_m.copy()
        outlines[2, :5] += 1.001 * moved
        return replace(course, outlines_m=outlines).areas_m2

    found = course.gradients_m * 2 * np.pi / 24
    expected = np.zeros((len(course.areas_m2), 5))
    expected[2] = found[2, :5]
    assert_derivative(areas, np.zeros(5), expected, step=1e-4)


def test_a_height_outside_the_shell_is_an_error():
    stack = shell([0, 9.5], lambda z: 6.5)
    for height in (-0.001, 9.501, np.nan, np.inf):
        with pytest.raises(HeightError):
            stack.volume_m3([1.0, height])


def test_a_mesh_lofted_from_the_outlines_second_method():
    """trimesh's volume of 2 x 7200 vertices; its chords leave out 0.13 ppm of the area."""
    trimesh = pytest.importorskip("trimesh")
    rng = np.random.default_rng(3)
    ends = [modes(0.0, 2, *rng.normal(0, 0.02, (2, 4)))[0] for _ in range(2)]

    def outline(z):
        return lambda a: 6.5 + (1 - z / 1.9) * ends[0](a) + z / 1.9 * ends[1](a)

    course = course_of(0.0, 1.9, outline)
    n = 7200
    azimuth = np.arange(n) * 2 * np.pi / n
    rings = [ring(outline(z), azimuth, z=z) for z in (0, 1.9)]
    i, j = np.arange(n), (np.arange(n) + 1) % n
    side = np.vstack([np.column_stack([i, i + n, j]), np.column_stack([j, i + n, j + n])])
    caps = np.vstack(
        [np.column_stack([i, j, 0 * i + 2 * n]), np.column_stack([j + n, i + n, 0 * i + 2 * n + 1])]
    )
    vertices = np.vstack([*rings, [[0, 0, 0], [0, 0, 1.9]]])
    mesh = trimesh.Trimesh(vertices, np.vstack([side, caps]), process=False)
    assert mesh.is_watertight
    volume = ShellVolume((course,)).volume_m3([1.9])[0]
    assert abs(mesh.volume) == pytest.approx(volume, rel=1e-6)


@pytest.mark.parametrize(
    ("correlated", "published"),
    [(True, 1.27), (False, 0.74)],
    ids=["sections fully correlated (S equation 64)", "five independent sections"],
)
def test_variance_of_the_volume_published_s_equation_64(correlated, published, figure):
    """R 6.479 m, H 9.5 m, sd of the radius 3 mm, of the height 4 mm."""
    joints = np.linspace(0, 9.5, 6)
    stack = shell(joints, lambda z: 6.479)
    by_radius = np.kron(np.eye(5), np.ones((LEVELS, 1))) * 2 * stack.features[0] / 6.479  # dA/dR
    radii = 0.003**2 * (np.ones((5, 5)) if correlated else np.eye(5))
    factor = stack.weights_m([9.5]) @ factor_of(by_radius @ radii @ by_radius.T)
    variance = np.sum(factor**2) + (stack.area_m2([9.5])[0] * 0.004) ** 2
    figure(f"sd of the volume, correlated={correlated}, m3", f"{np.sqrt(variance):.4f}")
    assert np.sqrt(variance) == pytest.approx(published, abs=0.005)
    if correlated:
        assert variance == pytest.approx(1.624, abs=0.005)
        assert stack.volume_m3([9.5])[0] == pytest.approx(1252.82, abs=0.005)


def test_a_wrong_scale_of_the_survey_leaves_the_plates_alone():
    """dV/ds = integral of 2 r (r - t), closed form for a cylinder."""
    stack = shell([0, 9.5], lambda z: 6.5, inset_m=0.008)
    expected = 2 * np.pi * 6.5 * (6.5 - 0.008) * 9.5
    assert stack.integrated([9.5], stack.scale_features)[0] == pytest.approx(expected, rel=1e-12)


def barrelled(bulge, courses=3, taper=0.0):
    """Courses of 1.5 m whose radius bulges in the middle, seen in the middle alone."""
    joints = 1.5 * np.arange(courses + 1)
    zeta = 2 * gauss_levels() - 1

    def radius(z):
        t = z / 1.5 - np.floor(z / 1.5)
        return 6.5 + taper * t + bulge * (1 - (2 * t - 1) ** 2)

    return shell(joints, radius, missed={"barrel": -(zeta**2)})


def full_barrel(t, bulge):
    """Volume of the lower part t of a course of 1.5 m with that barrel: closed form."""
    b = 4 * bulge
    powers = np.array([6.5**2, 2 * 6.5 * b, b**2 - 2 * 6.5 * b, -2 * b**2, b**2])
    return np.pi * 1.5 * sum(c * t ** (i + 1) / (i + 1) for i, c in enumerate(powers))


def test_a_barrel_is_exact_at_every_height():
    part = np.array([0.1, 0.4, 0.9, 1.0])
    found = barrelled(0.004, courses=1).volume_m3(1.5 * part)
    assert found == pytest.approx([full_barrel(t, 0.004) for t in part], rel=1e-13)


def test_the_barrel_that_a_ring_in_the_middle_does_not_see():
    """Closed form: -1/3 of it, times the girth and the height."""
    heights = np.array([0.4, 0.75, 1.5, 2.6, 4.5])
    derivative = barrelled(0.0).by_missed_m2(heights, "barrel", each=True)
    assert derivative[-1] == pytest.approx(-2 * np.pi * 6.5 * 1.5 / 3, rel=1e-12)
    assert derivative[1, 0] == pytest.approx(-2 * np.pi * 6.5 * 0.75 / 3, rel=1e-12)


def test_a_barrel_of_4_mm_seen_at_mid_height_costs_145_ppm(figure):
    """8 courses of radius 6.5 m, independent of each other: 2 u / (3 R sqrt(8)), closed form."""
    volume = barrelled(0.0, courses=8)
    derivative = volume.by_missed_m2([12.0], "barrel", each=True)[0]
    ppm = 1e6 * 0.004 * np.linalg.norm(derivative) / volume.volume_m3([12.0])[0]
    figure("barrel of 4 mm, 8 courses with a mid-height section each, ppm", f"{ppm:.1f}")
    assert ppm == pytest.approx(1e6 * 2 * 0.004 / (3 * 6.5 * np.sqrt(8)), rel=1e-9)


def test_a_barrel_of_all_courses_is_the_sum_of_theirs():
    stack, heights = barrelled(0.0), np.array([0.4, 1.5, 2.6, 4.5])
    one_by_one = stack.by_missed_m2(heights, "barrel", each=True).sum(axis=1)
    assert stack.by_missed_m2(heights, "barrel") == pytest.approx(one_by_one, rel=1e-12)


def test_a_higher_course_lifts_all_joints_above_it():
    """Stepped cylinders are linear in their joints: a second tank, one course 1 cm higher."""
    radii, heights = np.array([6.5, 6.49, 6.47]), np.array([0.4, 1.2, 1.6, 3.2, 4.4])
    stack = shell([0, 1.5, 3.0, 4.5], lambda z: radii[int(z / 1.5)])

    def volume(joints):
        below = np.clip(heights[:, None] - joints, 0, np.diff(joints, append=np.inf))
        return below @ (np.pi * radii**2)

    joints = np.array([0.0, 1.5, 3.0])
    lifted = [joints + 0.01 * (np.arange(3) > course) for course in range(3)]
    expected = np.column_stack([(volume(moved) - volume(joints)) / 0.01 for moved in lifted])
    assert stack.by_course_heights_m2(heights) == pytest.approx(expected, abs=1e-9)


def test_the_barrel_of_each_course_is_told():
    assert barrelled(0.004).barrels_m == pytest.approx([0.004] * 3, rel=1e-6)


def test_sums_over_features_are_the_weights_times_them():
    """Second method; the order of the rows changes nothing but how BLAS rounds some of them."""
    stack = barrelled(0.004)
    heights = np.linspace(0, 4.5, 91)
    columns = np.random.default_rng(1).normal(size=(len(stack.features), 4))
    found = stack.integrated(heights, columns)
    assert found == pytest.approx(stack.weights_m(heights) @ columns, abs=1e-12)
    order = np.random.default_rng(2).permutation(len(heights))
    assert stack.integrated(heights[order], columns) == pytest.approx(found[order], abs=1e-12)
    assert np.array_equal(stack.area_m2(heights[order]), stack.area_m2(heights)[order])


def test_area_is_the_derivative_of_volume():
    stack = barrelled(0.004, taper=0.01)
    heights = np.array([0.3, 1.2, 1.8, 4.4])
    assert_derivative(stack.volume_m3, heights, np.diag(stack.area_m2(heights)), tolerance=1e-8)
