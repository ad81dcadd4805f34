"""Circles and sections: the published table, exact shapes, the criterion and its derivatives."""

import csv
import json

import numpy as np
import pytest
import scipy.optimize
from shapes import azimuths, modes, ring, section_of

from tankcal.errors import SolutionError
from tankcal.sections import fit_circle, group_by_height, group_by_name, slide

S_VARIANCE_M2 = 2.0e-4  # published: S table 11, coordinate variance


@pytest.fixture(scope="module")
def table_11(shared):
    facts = shared / "facts"
    circles = json.loads((facts / "silva_T11_circles.json").read_text())
    with open(facts / "silva_T11_residuals.csv", newline="") as file:
        residuals = list(csv.DictReader(file))
    return circles, residuals


def test_sds_of_centre_and_radius_published_s_table_11(table_11):
    """Generatrix 24 of section 3 is missing; at -22.5 deg it gives the printed sds."""
    circles, residuals = table_11
    for number in range(5):
        seen = [row for row in residuals if row[f"s{number + 1}_m"]]
        azimuth = np.radians([15 * (int(row["generatrix"]) - 1) - 7.5 for row in seen])
        circle = fit_circle(
            ring(circles["R_m"][number], azimuth)[:, :2], np.full(2 * len(azimuth), S_VARIANCE_M2)
        )
        sd = np.sqrt(np.diag(circle.cofactor_m2))
        published = [circles[key][number] for key in ("dp_XC", "dp_YC", "dp_R")]
        assert np.round(sd, 4) == pytest.approx(published, abs=1e-9)


def test_variance_factors_published_s_table_11(table_11):
    circles, residuals = table_11
    for number, published in enumerate(circles["sigma_post"], 1):
        size = np.array([float(row[f"s{number}_m"]) for row in residuals if row[f"s{number}_m"]])
        factor = np.sum(size**2) / S_VARIANCE_M2 / (len(size) - 3)
        assert factor == pytest.approx(published, abs=0.025)


def test_circle_sds_of_even_points_closed_form():
    """s_centre = s sqrt(2/n), s_radius = s / sqrt(n)."""
    circle = fit_circle(ring(6.5, azimuths(24))[:, :2], np.full(48, 0.01**2))
    expected = 0.01 * np.array([np.sqrt(2 / 24), np.sqrt(2 / 24), 1 / np.sqrt(24)])
    assert np.sqrt(np.diag(circle.cofactor_m2)) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("span_deg", [360, 90, 20])
def test_the_circle_is_the_geometric_one_second_method(span_deg):
    """The sum of squared distances is at its minimum, found again by a general minimiser."""
    rng = np.random.default_rng(span_deg)
    azimuth = np.radians(rng.uniform(0, span_deg, 40))
    points = ring(6.5, azimuth, (15.8, 14.1))[:, :2] + rng.normal(0, 0.002, (40, 2))
    circle = fit_circle(points, np.full(80, 0.002**2))

    def distances(p):
        return np.hypot(points[:, 0] - p[0], points[:, 1] - p[1]) - p[2]

    start = [15.8, 14.1, 6.5]
    other = scipy.optimize.least_squares(distances, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert (circle.x_m, circle.y_m, circle.radius_m) == pytest.approx(tuple(other.x), abs=2e-7)
    assert np.sum(circle.residuals_m**2) <= 2 * other.cost * (1 + 1e-9)


def test_a_circle_at_utm_coordinates_loses_nothing():
    here = ring(6.5, azimuths(24))[:, :2] + np.random.default_rng(5).normal(0, 0.01, (24, 2))
    near = fit_circle(here, np.full(48, 1e-4))
    far = fit_circle(here + (500_000.0, 7_500_000.0), np.full(48, 1e-4))
    assert far.x_m - 500_000.0 == pytest.approx(near.x_m, abs=1e-8)
    assert far.y_m - 7_500_000.0 == pytest.approx(near.y_m, abs=1e-8)
    assert far.radius_m == pytest.approx(near.radius_m, abs=1e-9)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((2, 2)), "needs 3 points"),
        (np.ones((6, 2)), "on one place"),
        (np.column_stack([np.arange(6.0), 2 * np.arange(6.0)]), "on a line"),
    ],
)
def test_points_that_make_no_circle_are_refused(points, message):
    with pytest.raises(SolutionError, match=message):
        fit_circle(points, np.full(2 * len(points), 1e-4))


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
    assert section.outline.kind == "interpolated"
    assert section.outline.area_m2() == pytest.approx(area, rel=1e-7)


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


def test_area_of_a_spoilt_point_moves_by_the_gradient():
    """The gradient by every coordinate against differences of the whole fit."""
    rng = np.random.default_rng(3)
    outline, _ = modes(6.5, 2, rng.normal(0, 0.01, 4), rng.normal(0, 0.01, 4))
    xyz = ring(outline, azimuths(24, 0.2, rng), (3.0, 4.0))
    section = section_of(xyz)
    azimuth, weight = section.outline.nodes()
    by_parameters = (section.outline.radius_m(azimuth) * weight) @ section.outline.basis(azimuth)
    gradient = by_parameters @ section.parameters_by_points
    differences = np.zeros_like(gradient)
    for i in range(len(gradient)):
        move = np.zeros(72)
        move[i] = 1e-4
        up, down = (section_of(xyz + sign * move.reshape(24, 3)) for sign in (1, -1))
        differences[i] = (up.outline.area_m2() - down.outline.area_m2()) / 2e-4
    # the origin and the knots move with the points, the gradient holds them: a part in 2000
    assert np.abs(differences - gradient).max() < 5e-4 * np.abs(gradient).max()


def test_sliding_along_the_axis_keeps_a_leaning_cylinder_together():
    slope, azimuth = (0.03, -0.01), azimuths(12)
    z = np.linspace(0, 1.5, 12)
    xyz = ring(6.5, azimuth) + np.column_stack([z * slope[0], z * slope[1], z])
    xy, by_xyz = slide(xyz, slope, 0.0)
    assert np.hypot(*xy.T) == pytest.approx(6.5, abs=1e-12)
    moved = (by_xyz @ np.tile([0.0, 0.0, 1.0], 12)).reshape(12, 2)
    assert moved == pytest.approx(-np.tile(slope, (12, 1)))


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
