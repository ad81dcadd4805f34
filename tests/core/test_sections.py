"""Sections: exact shapes, groups of points, and their derivatives."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from shapes import azimuths, modes, ring, section_of

from tankcal.sections import (
    fit_section,
    group_by_height,
    group_by_name,
    slide,
)


def ellipse(azimuth):
    a, b = 6.55, 6.45
    return a * b / np.hypot(b * np.sin(azimuth), a * np.cos(azimuth))


@pytest.mark.parametrize(
    ("radius", "centre", "area"),
    [
        (6.5, (0, 0), np.pi * 6.5**2),
        (6.5, (123.4, -56.7), np.pi * 6.5**2),
        (ellipse, (1.0, 2.0), np.pi * 6.55 * 6.45),
    ],
    ids=["circle", "shifted circle", "ellipse"],
)
def test_area_of_exact_shapes_closed_form(radius, centre, area):
    section = section_of(ring(radius, azimuths(24), centre))
    assert section.outline.area_m2() == pytest.approx(area, rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize(("jitter", "limit_ppm"), [(0.0, 1.0), (0.2, 5.0)])
def test_area_of_300_random_shapes_closed_form(jitter, limit_ppm, figure):
    """R 6.5 m, modes 2 to 5 with coefficients of sd 5 mm, 24 points."""
    rng = np.random.default_rng(11)
    errors = []
    for _ in range(300):
        outline, area = modes(6.5, 2, rng.normal(0, 0.005, 4), rng.normal(0, 0.005, 4))
        section = section_of(ring(outline, azimuths(24, jitter, rng)))
        errors.append(section.outline.area_m2() / area - 1)
    ppm = 1e6 * np.array(errors)
    rms = np.sqrt(np.mean(ppm**2))
    figure(
        f"area of 300 shapes, jitter {jitter:.0%}, rms and worst in ppm",
        f"{rms:.3f}, {np.abs(ppm).max():.3f}",
    )
    assert rms < limit_ppm


@pytest.mark.slow
@pytest.mark.parametrize(("turn", "limit"), [(0.0, 2e-5), (np.pi / 2, 1e-3)])
def test_area_of_a_spoilt_point_moves_by_the_gradient(turn, limit):
    """The gradient by every point against differences of the whole fit, outwards and along.

    The weights move with the azimuths of the points, the gradient holds them: a part in 1000 of
    the largest derivative.
    """
    rng = np.random.default_rng(3)
    outline, _ = modes(6.5, 2, rng.normal(0, 0.01, 4), rng.normal(0, 0.01, 4))
    xyz = ring(outline, azimuths(24, 0.2, rng), (3.0, 4.0))
    section = section_of(xyz)
    outline = section.outline
    azimuth, weight = outline.nodes()
    by_parameters = (outline.radius_m(azimuth) * weight) @ outline.basis(azimuth)
    gradient = (by_parameters @ outline.from_radii) @ section.radii_by_points
    bearing = outline.azimuth_rad + turn
    moves = 1e-4 * np.column_stack([np.sin(bearing), np.cos(bearing), 0 * bearing])
    differences = np.zeros(24)
    for i in range(24):
        up, down = (section_of(xyz + sign * moves * np.eye(24)[i][:, None]) for sign in (1, -1))
        differences[i] = (up.outline.area_m2() - down.outline.area_m2()) / 2e-4
    expected = 1e4 * np.sum(gradient.reshape(24, 3) * moves, axis=1)
    assert np.abs(differences - expected).max() < limit * np.abs(gradient).max()


def test_sliding_along_axis_keeps_leaning_cylinder():
    slope, azimuth = (0.03, -0.01), azimuths(12)
    z = np.linspace(0, 1.5, 12)
    xyz = ring(6.5, azimuth) + np.column_stack([z * slope[0], z * slope[1], z])
    xy, by_xyz = slide(xyz, slope, 0.0)
    assert np.hypot(*xy.T) == pytest.approx(6.5, abs=1e-12)
    assert by_xyz @ [0.0, 0.0, 1.0] == pytest.approx(-np.array(slope))


@pytest.mark.parametrize("heights", [None, lambda rng, azimuth: 0 * azimuth])
def test_points_with_covariances_of_their_own_make_the_same_section(heights):
    """Second method: the same blocks in the covariance of all."""
    slope = (0.003, -0.001)
    xyz = scan(lambda azimuth, zeta: 6.5 + 0.01 * np.cos(2 * azimuth), slope=slope, heights=heights)
    roots = np.random.default_rng(9).normal(0, 0.002, (len(xyz), 3, 3))
    each = roots @ roots.transpose(0, 2, 1) + 1e-6 * np.eye(3)
    whole = scipy.linalg.block_diag(*each)
    group = course_group(xyz)
    of_each, of_all = (
        fit_section(group, xyz, one, slope, group.height_m, 1e-8) for one in (each, whole)
    )
    assert of_each.circle.radius_m == pytest.approx(of_all.circle.radius_m, rel=1e-13)
    assert of_each.circle.cofactor_m2 == pytest.approx(of_all.circle.cofactor_m2, rel=1e-9)
    assert of_each.outline.parameters == pytest.approx(of_all.outline.parameters, abs=1e-12)
    apart = of_each.radii_by_points - of_all.radii_by_points
    assert np.abs(apart.toarray()).max() < 1e-12


def test_points_without_section_numbers_are_grouped_by_height():
    joints = np.array([0.0, 2.0, 4.0])
    azimuth = np.tile(azimuths(12), 3)
    height = np.repeat([0.4, 1.6, 3.0], 12) + 0.01
    height[24:] += np.random.default_rng(1).uniform(-0.9, 0.9, 12)  # course 2: not level
    course = np.searchsorted(joints[1:-1], height)
    groups = group_by_height(height, azimuth, course, joints)
    assert [(g.name, g.course, len(g.members)) for g in groups] == [
        ("1.1", 0, 12),
        ("1.2", 0, 12),
        ("2", 1, 12),
    ]
    assert groups[0].height_m == pytest.approx(0.41)


def test_named_sections_come_from_the_bottom_up():
    names = ["b"] * 5 + ["a"] * 5
    height = np.array([3.0] * 5 + [1.0] * 5)
    groups = group_by_name(names, height, lambda z: int(z > 2))
    assert [(g.name, g.course) for g in groups] == [("a", 0), ("b", 1)]


JOINTS = np.array([0.0, 1.5])


def scan(radius, n=60, seed=1, slope=(0.0, 0.0), heights=None):
    """(n, 3) points of one course at random azimuths and heights; radius(azimuth, zeta)."""
    rng = np.random.default_rng(seed)
    azimuth = rng.uniform(0, 2 * np.pi, n)
    zeta = rng.uniform(-1, 1, n) if heights is None else heights(rng, azimuth)
    z = 0.75 * (1 + zeta)
    xyz = ring(radius(azimuth, zeta), azimuth)
    return xyz + np.column_stack([z * slope[0], z * slope[1], z])


def course_group(xyz, joints=JOINTS):
    azimuth = np.arctan2(xyz[:, 0], xyz[:, 1])
    course = np.zeros(len(xyz), dtype=int)
    return group_by_height(xyz[:, 2], azimuth, course, joints)[0]


@pytest.mark.parametrize(
    ("heights", "degree"),
    [
        (lambda rng, a: rng.uniform(-1, 1, len(a)), 2),
        (lambda rng, a: rng.uniform(-0.6, 0.6, len(a)), 1),
        (lambda rng, a: rng.uniform(-1, -0.3, len(a)), 0),
        (lambda rng, a: a / np.pi - 1, 0),  # a spiral: its height is a function of the azimuth
        (lambda rng, a: 0.1 * np.cos(3 * a), 0),  # level
    ],
    ids=["all heights", "the middle", "the lower third", "a spiral", "level"],
)
def test_no_slope_is_made_from_heights_that_tell_none(heights, degree):
    xyz = scan(lambda a, zeta: np.full_like(a, 6.5), n=120, heights=heights)
    group = course_group(xyz)
    assert group.degree == degree


def test_few_points_make_no_more_than_they_carry():
    xyz = scan(lambda a, zeta: np.full_like(a, 6.5), n=7)
    assert course_group(xyz).degree == 0


def test_a_course_of_several_sections_takes_them_as_level():
    xyz = scan(lambda a, zeta: np.full_like(a, 6.5), n=120)
    azimuth = np.arctan2(xyz[:, 0], xyz[:, 1])
    names = ["low" if z < 0.8 else "high" for z in xyz[:, 2]]
    groups = group_by_name(names, xyz[:, 2], lambda z: 0, azimuth, JOINTS)
    assert [group.degree for group in groups] == [0, 0]
    one = group_by_name(["a"] * 120, xyz[:, 2], lambda z: 0, azimuth, JOINTS)
    assert one[0].degree == 2
    assert one[0].span_m == (0.0, 1.5)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_scanned_course_gives_the_outline_at_its_mean_height(degree):
    """Closed form: a wall that tapers, leans and, at degree 2, bulges."""

    def wall(azimuth, zeta):
        bulge = 0.004 * (1 - zeta**2) * (degree == 2)
        return 6.5 + zeta * (0.003 + 0.002 * np.cos(azimuth)) + bulge

    xyz = scan(wall)
    group = replace(course_group(xyz), degree=degree)
    covariance = np.full(3 * len(xyz), 4e-6)
    section = fit_section(group, xyz, covariance, (0.0, 0.0), group.height_m, 1e-8)
    grid, (x, y) = azimuths(36), (section.outline.x_m, section.outline.y_m)
    expected = wall(grid, group.zeta(group.height_m)) - x * np.sin(grid) - y * np.cos(grid)
    assert section.outline.radius_m(grid) == pytest.approx(expected, abs=2e-6)
