"""Ellipses, cylinders and spheres: exact shapes, the criterion, its derivatives, and coverage."""

import time

import numpy as np
import pytest
import scipy.optimize
import scipy.stats
from draws import draws
from jacobians import assert_derivative

from tankcal.errors import SolutionError
from tankcal.geometry.circles import own_columns
from tankcal.geometry.primitives import (
    conditions_of,
    cylinder_distances,
    ellipse_distances,
    fit_cylinder,
    fit_ellipse,
    fit_sphere,
    lying_cylinder,
    sphere_distances,
)
from tankcal.tank.solids import LyingTank

UTM = np.array([500_000.0, 7_500_000.0, 120.0])


def on_ellipse(a, b, azimuth, t, centre=(0.0, 0.0)):
    """Points at the eccentric angles t, counted from the major axis."""
    major = np.array([np.sin(azimuth), np.cos(azimuth)])
    minor = np.array([-major[1], major[0]])
    return centre + a * np.cos(t)[:, None] * major + b * np.sin(t)[:, None] * minor


def on_cylinder(radius, direction, t, z, centre=(0.0, 0.0, 0.0)):
    """Points at the angles t about the axis and distances z along it."""
    axis = np.array(direction) / np.linalg.norm(direction)
    first, second = np.linalg.svd(axis[None])[2][1:]
    round_it = np.cos(t)[:, None] * first + np.sin(t)[:, None] * second
    return centre + radius * round_it + z[:, None] * axis


def on_sphere(radius, count, rng, lowest=-1.0):
    z, t = rng.uniform(lowest, 1, count), rng.uniform(0, 2 * np.pi, count)
    across = np.sqrt(1 - z**2)
    return radius * np.column_stack([across * np.cos(t), across * np.sin(t), z])


def variances(points, sd=1e-3):
    return np.full(points.size, sd**2)


# exact shapes, closed forms


@pytest.mark.parametrize("span_deg", [360, 120, 60])
@pytest.mark.parametrize(
    ("a", "b", "azimuth"), [(6.5, 6.4, 0.3), (3.0, 1.0, 2.9), (5.0, 4.99, 1.7)]
)
def test_points_of_an_exact_ellipse(a, b, azimuth, span_deg):
    t = 0.4 + np.radians(span_deg) * np.arange(24) / 24
    found = fit_ellipse(on_ellipse(a, b, azimuth, t, (15.0, 14.0)), np.full(48, 1e-6))
    assert (found.x_m, found.y_m) == pytest.approx((15.0, 14.0), abs=1e-7)
    assert (found.semi_major_m, found.semi_minor_m) == pytest.approx((a, b), abs=1e-7)
    assert found.azimuth_rad == pytest.approx(azimuth, abs=1e-6)
    assert np.abs(found.residuals_m).max() < 1e-9


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("span_deg", [360, 90, 30])
@pytest.mark.parametrize("direction", [(0, 0, 1), (1, 0, 0), (0.3, -0.8, 0.02), (-2, 1, 1)])
@pytest.mark.parametrize("length", [0.3, 3.0, 30.0])
def test_points_of_an_exact_cylinder(direction, span_deg, length):
    rng = np.random.default_rng(span_deg)
    t, z = np.radians(span_deg) * rng.uniform(0, 1, 60), length * rng.uniform(0, 1, 60)
    found = fit_cylinder(on_cylinder(1.3, direction, t, z, (4, 5, 6)), np.full(180, 1e-6))
    axis = np.array(direction) / np.linalg.norm(direction)
    off = found.point_m - (4, 5, 6)
    assert found.radius_m == pytest.approx(1.3, abs=1e-8)
    assert np.linalg.norm(np.cross(found.direction, axis)) < 1e-7
    assert np.linalg.norm(off - (off @ axis) * axis) < 1e-6
    assert np.linalg.norm(np.vstack([found.tangents, found.direction])) == pytest.approx(3**0.5)


@pytest.mark.parametrize("lowest", [-1.0, 0.5, 0.95])
def test_points_of_an_exact_sphere(lowest):
    points = on_sphere(10.0, 30, np.random.default_rng(2), lowest) + (1, 2, 3)
    found = fit_sphere(points, variances(points))
    assert found.centre_m == pytest.approx([1, 2, 3], abs=1e-8)
    assert found.radius_m == pytest.approx(10.0, abs=1e-8)


def test_sds_of_nearly_round_ellipse():
    """s_centre = s sqrt(2/n), s_axis = s sqrt(3/n), s_azimuth = s sqrt(2/n) / (a - b)."""
    t = 2 * np.pi * np.arange(48) / 48
    points = on_ellipse(5.001, 4.999, 1.0, t)
    sd = np.sqrt(np.diag(fit_ellipse(points, variances(points)).cofactor))
    expected = 1e-3 * np.sqrt(np.array([2, 2, 3, 3, 2 / 0.002**2]) / 48)
    assert sd == pytest.approx(expected, rel=1e-3)


def test_an_exact_circle_is_an_ellipse_without_azimuth():
    points = on_ellipse(5.0, 5.0, 0.0, 2 * np.pi * np.arange(4096) / 4096)
    found = fit_ellipse(points, variances(points))
    assert (found.semi_major_m, found.semi_minor_m) == pytest.approx((5.0, 5.0), abs=1e-11)
    assert np.all(np.diag(found.cofactor)[:4] > 0)


def test_sds_of_even_points_on_a_cylinder_closed_form():
    """s_axis = s sqrt(2/n), s_direction = s sqrt(2 / sum z^2), s_R = s / sqrt(n)."""
    t, z = np.tile(2 * np.pi * np.arange(24) / 24, 5), np.repeat([-4.0, -2, 0, 2, 4], 24)
    points = on_cylinder(1.2, (1, 2, 0.1), t, z)
    sd = np.sqrt(np.diag(fit_cylinder(points, variances(points)).cofactor))
    tilt = np.sqrt(2 / np.sum(z**2))
    expected = 1e-3 * np.array([np.sqrt(2 / 120), np.sqrt(2 / 120), tilt, tilt, np.sqrt(1 / 120)])
    assert sd == pytest.approx(expected, rel=1e-9)


def test_sds_of_even_points_on_a_sphere_closed_form():
    """The corners of a cube: s_centre = s sqrt(3/n), s_R = s / sqrt(n)."""
    points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    sd = np.sqrt(np.diag(fit_sphere(points, variances(points)).cofactor_m2))
    assert sd == pytest.approx(1e-3 * np.sqrt(np.array([3, 3, 3, 1]) / 8), rel=1e-9)


# the criterion, by a second method


def precise(function, start):
    return scipy.optimize.least_squares(
        function, start, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac"
    )


def correlated(size, sd, rng):
    """A full covariance, and a function that whitens with it."""
    factor = sd * (np.eye(size) + 0.3 * rng.normal(size=(size, size)) / np.sqrt(size))
    return factor @ factor.T, lambda v: np.linalg.solve(factor, v)


@pytest.mark.parametrize("full", [False, True], ids=["equal variances", "full covariance"])
@pytest.mark.parametrize("span_deg", [360, 150])
def test_the_ellipse_is_the_geometric_one_second_method(span_deg, full):
    """v' Q^-1 v is at its minimum, with the places of the adjusted points as explicit unknowns."""
    rng = np.random.default_rng(span_deg)
    t = np.radians(rng.uniform(0, span_deg, 20))
    points = on_ellipse(3.0, 1.8, 0.9, t) + rng.normal(0, 0.01, (20, 2))
    covariance, whiten = correlated(40, 0.01, rng)
    if not full:
        covariance, whiten = 0.01**2 * np.eye(40), lambda v: v / 0.01
    found = fit_ellipse(points, covariance)

    def corrections(x):
        return whiten((on_ellipse(*x[2:5], x[5:], x[:2]) - points).ravel())

    other = precise(corrections, [0.0, 0.0, 3.0, 1.8, 0.9, *t])
    mine = [getattr(found, n) for n in ("x_m", "y_m", "semi_major_m", "semi_minor_m")]
    assert [*mine, found.azimuth_rad] == pytest.approx(list(other.x[:5]), abs=2e-6)
    assert found.variance_factor * found.dof == pytest.approx(2 * other.cost, rel=1e-9)
    if not full:
        assert np.sum(found.residuals_m**2) == pytest.approx(2e-4 * other.cost, rel=1e-6)


@pytest.mark.parametrize("span_deg", [360, 100])
def test_the_cylinder_is_the_geometric_one_second_method(span_deg):
    rng = np.random.default_rng(span_deg)
    t, z = np.radians(rng.uniform(0, span_deg, 50)), rng.uniform(0, 8, 50)
    points = on_cylinder(1.2, (1, 0.5, 0.05), t, z) + rng.normal(0, 0.003, (50, 3))
    found = fit_cylinder(points, variances(points, 0.003))

    def distances(x):  # point of the axis at x = 0, its direction by two slopes
        axis = np.array([1.0, x[2], x[3]])
        d = points - (0.0, x[0], x[1])
        return np.linalg.norm(np.cross(d, axis / np.linalg.norm(axis)), axis=1) - x[4]

    other = precise(distances, [0.0, 0.0, 0.5, 0.05, 1.2])
    axis = found.direction / found.direction[0]
    point = found.point_m - found.point_m[0] * axis
    mine = [*point[1:], *axis[1:], found.radius_m]
    assert mine == pytest.approx(list(other.x), abs=5e-7)
    assert np.sum(found.residuals_m**2) == pytest.approx(2 * other.cost, rel=1e-9)


def test_the_cylinder_with_a_full_covariance_second_method():
    """The adjusted points lie on a cylinder, and no cylinder has a smaller v' Q^-1 v."""
    rng = np.random.default_rng(8)
    t, z = rng.uniform(0, 2 * np.pi, 15), rng.uniform(0, 8, 15)
    points = on_cylinder(1.2, (1, 0.5, 0.05), t, z) + rng.normal(0, 0.003, (15, 3))
    covariance, whiten = correlated(45, 0.003, rng)
    found = fit_cylinder(points, covariance)

    def corrections(x):
        direction = np.array([1.0, x[2], x[3]])
        adjusted = on_cylinder(x[4], direction, x[5:20], x[20:], (0.0, x[0], x[1]))
        return whiten((adjusted - points).ravel())

    other = precise(corrections, [0.0, 0.0, 0.5, 0.05, 1.2, *t, *z])
    assert found.variance_factor * found.dof == pytest.approx(2 * other.cost, rel=1e-9)
    assert found.radius_m == pytest.approx(other.x[4], abs=1e-7)


def test_the_sphere_is_the_geometric_one_second_method():
    rng = np.random.default_rng(4)
    points = on_sphere(10.0, 40, rng, 0.6) + rng.normal(0, 0.01, (40, 3))
    found = fit_sphere(points, variances(points, 0.01))
    other = precise(lambda x: np.linalg.norm(points - x[:3], axis=1) - x[3], [0, 0, 0, 10.0])
    assert [*found.centre_m, found.radius_m] == pytest.approx(list(other.x), abs=1e-6)
    assert np.sum(found.residuals_m**2) == pytest.approx(2 * other.cost, rel=1e-9)


# Jacobians

FRAME = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]


@pytest.mark.parametrize(
    ("distances", "unknowns", "dimensions"),
    [
        (ellipse_distances, [0.2, -0.1, 3.0, 2.0, 0.4], 2),
        (ellipse_distances, [0.2, -0.1, 2.0, 2.0, 0.0], 2),
        (ellipse_distances, [0.2, -0.1, 1.0, 2.0, -2.5], 2),
        (cylinder_distances(FRAME), [0.2, -0.1, 0.0, 0.0, 2.0], 3),
        (cylinder_distances(FRAME), [0.2, -0.1, 0.3, -0.2, 2.0], 3),
        (sphere_distances, [0.2, -0.1, 0.3, 2.0], 3),
    ],
    ids=["ellipse", "circle", "turned inside out", "cylinder", "leaning cylinder", "sphere"],
)
def test_both_jacobians(distances, unknowns, dimensions):
    model = conditions_of(distances, dimensions)
    points = np.random.default_rng(6).normal(0, 2, 12 * dimensions)
    _, by_unknowns, by_points = model(np.array(unknowns), points)
    assert_derivative(lambda x: model(x, points)[0], unknowns, by_unknowns)
    of_all = own_columns(by_points).toarray()
    assert_derivative(lambda l: model(np.array(unknowns), l)[0], points, of_all)


def test_distances_to_an_ellipse_by_points_at_known_distances():
    """Points on normals of the ellipse (closed form), from deep inside to far outside."""
    t = np.linspace(0, 2 * np.pi, 41)
    foot = on_ellipse(3.0, 1.0, np.pi / 2, t)
    normal = foot / np.array([9.0, 1.0])
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    for distance in (-0.3, -1e-6, 0.0, 0.5, 100.0):
        points = foot + distance * normal
        found, _, normals = ellipse_distances(np.array([0, 0, 3.0, 1.0, 0.0]), points)
        assert found == pytest.approx(distance, abs=1e-12 * (1 + distance))
        assert normals == pytest.approx(normal, abs=1e-11)


# invariance


def test_at_utm_coordinates_nothing_is_lost():
    rng = np.random.default_rng(5)
    flat = on_ellipse(3.0, 2.0, 0.5, rng.uniform(0, 6, 30)) + rng.normal(0, 0.01, (30, 2))
    here, there = (fit_ellipse(flat + move, variances(flat)) for move in (0.0, UTM[:2]))
    assert there.semi_major_m == pytest.approx(here.semi_major_m, abs=1e-8)
    assert there.x_m - UTM[0] == pytest.approx(here.x_m, abs=1e-8)
    t, z = rng.uniform(0, 6, 30), rng.uniform(0, 9, 30)
    tube = on_cylinder(1.2, (1, 2, 0.1), t, z) + rng.normal(0, 0.01, (30, 3))
    here, there = (fit_cylinder(tube + move, variances(tube)) for move in (0.0, UTM))
    assert there.radius_m == pytest.approx(here.radius_m, abs=1e-8)
    assert there.direction == pytest.approx(here.direction, abs=1e-8)
    assert there.point_m - UTM == pytest.approx(here.point_m, abs=1e-7)
    ball = on_sphere(9.0, 30, rng) + rng.normal(0, 0.01, (30, 3))
    here, there = (fit_sphere(ball + move, variances(ball)) for move in (0.0, UTM))
    assert there.radius_m == pytest.approx(here.radius_m, abs=1e-8)


def test_turned_points_give_the_turned_ellipse():
    rng = np.random.default_rng(7)
    points = on_ellipse(3.0, 2.0, 0.5, rng.uniform(0, 4, 30)) + rng.normal(0, 0.01, (30, 2))
    one = fit_ellipse(points, variances(points))
    angle = 1.1  # clockwise, as azimuths count
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    other = fit_ellipse(points @ turn.T, variances(points))
    assert other.azimuth_rad == pytest.approx(one.azimuth_rad + angle, abs=1e-8)
    assert other.semi_minor_m == pytest.approx(one.semi_minor_m, abs=1e-8)
    assert other.cofactor[2:, 2:] == pytest.approx(one.cofactor[2:, 2:], rel=1e-5)


def test_turned_points_give_the_turned_cylinder():
    rng = np.random.default_rng(9)
    t, z = rng.uniform(0, 2, 40), rng.uniform(0, 9, 40)
    points = on_cylinder(1.2, (1, 2, 0.1), t, z) + rng.normal(0, 0.01, (40, 3))
    one = fit_cylinder(points, variances(points))
    other = fit_cylinder(points @ FRAME.T, variances(points))
    assert other.radius_m == pytest.approx(one.radius_m, abs=1e-8)
    assert np.abs(FRAME @ one.direction @ other.direction) == pytest.approx(1.0, abs=1e-14)
    assert other.cofactor[4, 4] == pytest.approx(one.cofactor[4, 4], rel=1e-6)
    in_space = [fit.tangents.T @ fit.cofactor[2:4, 2:4] @ fit.tangents for fit in (one, other)]
    turned = FRAME @ in_space[0] @ FRAME.T
    assert in_space[1] == pytest.approx(turned, abs=1e-6 * np.abs(turned).max())


# the start, and what is refused


@pytest.mark.slow
@pytest.mark.parametrize("span_deg", [30, 45, 90, 180, 360])
def test_cylinders_of_any_direction_and_coverage_are_found(span_deg, figure):
    """A third to 16 radii long, 12 to 1500 points, noise to 0.3 % of the radius."""
    rng = np.random.default_rng(span_deg)
    refused, worst = 0, 0.0
    for _ in range(12):
        radius, count = rng.uniform(0.5, 5), int(rng.choice([12, 40, 300, 1500]))
        t = rng.uniform(0, np.radians(span_deg), count)
        z = radius * 10 ** rng.uniform(-0.5, 1.2) * rng.uniform(0, 1, count)
        noise = radius * 10 ** rng.uniform(-5, -2.5)
        axis = rng.normal(size=3)
        points = on_cylinder(radius, axis, t, z) + rng.normal(0, noise, (count, 3))
        try:
            found = fit_cylinder(points, variances(points, noise))
        except SolutionError as error:
            refused += "not determined" in str(error)
            continue
        sd = np.sqrt(np.diag(found.cofactor))
        across = found.tangents @ axis / np.linalg.norm(axis)
        errors = np.array([*across, found.radius_m - radius]) / sd[2:]
        worst = max(worst, np.abs(errors).max())
    shown = f"{refused}, {worst:.1f}"
    figure(f"cylinders over {span_deg} deg: refused of 12, worst error in sds", shown)
    assert refused <= 2
    assert worst < 5


@pytest.mark.slow
def test_cylinder_of_flat_patch_or_one_ring_is_refused():
    for seed in range(8):
        rng = np.random.default_rng(seed)
        flat = rng.uniform(0, 1, (200, 3)) * (1, 1, 0) + rng.normal(0, 1e-4, (200, 3))
        with pytest.raises(SolutionError, match=r"of .* m through points .* flat"):
            fit_cylinder(flat, variances(flat))
        ring = on_cylinder(2.0, (0, 0, 1), np.arange(24) / 4.0, np.zeros(24))
        ring = ring + rng.normal(0, 1e-3, ring.shape)
        with pytest.raises(
            SolutionError, match=r"(in a plane: .* m thick|flat|not determined: sd)"
        ):
            fit_cylinder(ring, variances(ring))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fit", "points", "message"),
    [
        (fit_ellipse, np.zeros((4, 2)), "needs 5 points, 4 were given"),
        (fit_ellipse, np.ones((6, 2)), "lie in a line: spreads 0, 0 m"),
        (fit_ellipse, np.arange(6.0)[:, None] * (1, 2), "lie in a line"),
        (
            fit_ellipse,
            np.column_stack([np.sinh(np.linspace(-2, 2, 9)), np.cosh(np.linspace(-2, 2, 9))]),
            "(half axis|rank|converge)",
        ),
        (fit_cylinder, np.zeros((4, 3)), "needs 5 points, 4 were given"),
        (fit_cylinder, np.ones((6, 3)), "lie in a plane"),
        (fit_cylinder, np.eye(3)[np.arange(9) % 2] * np.arange(9.0)[:, None], "lie in a plane"),
        (fit_sphere, np.zeros((3, 3)), "needs 4 points, 3 were given"),
        (fit_sphere, np.eye(3)[np.arange(9) % 2] * np.arange(9.0)[:, None], "lie in a plane"),
    ],
)
def test_points_that_make_no_shape_are_refused(fit, points, message):
    with pytest.raises(SolutionError, match=message):
        fit(points, np.full(points.size, 1e-6))


def test_a_sphere_through_a_nearly_flat_patch_is_refused():
    rng = np.random.default_rng(1)
    points = rng.uniform(0, 1, (200, 3)) * (1, 1, 0) + rng.normal(0, 1e-4, (200, 3))
    with pytest.raises(SolutionError, match="they are flat"):
        fit_sphere(points, variances(points))


# a lying tank


def lying(azimuth_deg, slope, rng, count=400, noise=0.002, span_deg=200):
    """Points of a tank of diameter 2.4 m and 10 m length, seen over a part of its circumference."""
    azimuth = np.radians(azimuth_deg)
    axis = np.array([np.sin(azimuth), np.cos(azimuth), slope])
    side = np.array([np.cos(azimuth), -np.sin(azimuth), 0.0])
    axis = axis / np.linalg.norm(axis)
    up = np.cross(side, axis)
    t, z = np.radians(span_deg) * rng.uniform(0, 1, count), rng.uniform(0, 10, count)
    section = np.cos(t)[:, None] * side + np.sin(t)[:, None] * up
    return 1.2 * section + z[:, None] * axis + rng.normal(0, noise, (count, 3)) + (30, 40, 5)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("azimuth_deg", [0, 37, 180, 301])
@pytest.mark.parametrize("slope", [0.0, 0.013, -0.17])
def test_diameter_and_tilt_of_a_lying_tank(azimuth_deg, slope):
    points = lying(azimuth_deg, slope, np.random.default_rng(2), noise=0.0)
    found = lying_cylinder(points, variances(points), np.radians(azimuth_deg) - 0.6)
    assert found.diameter_m == pytest.approx(2.4, abs=1e-8)
    assert found.tilt == pytest.approx(slope, abs=1e-9)
    assert np.cos(found.azimuth_rad - np.radians(azimuth_deg)) == pytest.approx(1.0)
    other_way = lying_cylinder(points, variances(points), np.radians(azimuth_deg) + np.pi + 0.6)
    assert other_way.tilt == pytest.approx(-slope, abs=1e-9)
    assert other_way.cofactor == pytest.approx(found.cofactor * [[1, -1], [-1, 1]], rel=1e-6)


def test_a_standing_cylinder_and_a_wrong_azimuth_are_refused():
    rng = np.random.default_rng(2)
    points = lying(40.0, 0.01, rng)
    with pytest.raises(SolutionError, match=r"runs towards (40|220)\.\d deg, not 120\.0"):
        lying_cylinder(points, variances(points), np.radians(120.0))
    with pytest.raises(SolutionError, match="the cylinder stands"):
        lying_cylinder(lying(0.0, 3.0, rng), variances(points), 0.0)


# coverage of the standard deviations, by simulation


def coverage(simulate, count):
    """Share of errors within 1.96 sd for each parameter, and the mean of e' C^-1 e."""
    normalised, forms = [], []
    for seed in range(count):
        error, covariance = simulate(np.random.default_rng(seed))
        normalised.append(error / np.sqrt(np.diag(covariance)))
        forms.append(error @ np.linalg.solve(covariance, error))
    return np.mean(np.abs(normalised) < 1.959964, axis=0), np.mean(forms), len(error)


def noisy(points, rng):
    """Unequal, correlated noise: points 1 to 4 mm, and a shift common to neighbours."""
    size = points.size
    factor = np.diag(rng.uniform(0.001, 0.004, size))
    common = 0.001 * np.kron(np.eye(-(-size // 12)), np.ones((12, 1)))[:size]
    factor = np.hstack([factor, common])
    return points + (factor @ rng.normal(size=factor.shape[1])).reshape(points.shape), (
        factor @ factor.T
    )


def simulate_ellipse(rng):
    points, covariance = noisy(on_ellipse(3.0, 2.4, 0.7, 4 * np.arange(30) / 30), rng)
    found = fit_ellipse(points, covariance)
    error = [found.x_m, found.y_m, found.semi_major_m - 3.0, found.semi_minor_m - 2.4]
    return np.array([*error, found.azimuth_rad - 0.7]), found.cofactor


def simulate_cylinder(rng):
    t, z = 2.5 * (7 * np.arange(30) % 30) / 30, 6.0 * np.arange(30) / 30
    axis = np.array([2.0, 1.0, 0.2]) / np.linalg.norm([2.0, 1.0, 0.2])
    points, covariance = noisy(on_cylinder(1.2, axis, t, z), rng)
    found = fit_cylinder(points, covariance)
    toward = found.direction * np.sign(found.direction @ axis)
    shift = found.tangents @ (found.point_m - (found.point_m @ axis) * axis)
    turn = found.tangents @ (toward - axis) * np.sign(found.direction @ axis)
    return np.array([*shift, *turn, found.radius_m - 1.2]), found.cofactor


def simulate_sphere(rng):
    points, covariance = noisy(on_sphere(8.0, 30, np.random.default_rng(1), 0.3), rng)
    found = fit_sphere(points, covariance)
    return np.array([*found.centre_m, found.radius_m - 8.0]), found.cofactor_m2


def simulate_lying(rng):
    points = lying(40.0, 0.02, rng, 60, 0.003)
    found = lying_cylinder(points, variances(points, 0.003), np.radians(40))
    return np.array([found.diameter_m - 2.4, found.tilt - 0.02]), found.cofactor


SIMULATIONS = [simulate_ellipse, simulate_cylinder, simulate_sphere, simulate_lying]


def check_coverage(simulate, count, figure):
    shares, form, parameters = coverage(simulate, count)
    figure(
        f"{simulate.__name__[9:]}, {count} simulations: coverage of 95 % intervals in %",
        ", ".join(f"{100 * share:.1f}" for share in shares),
    )
    # the binomial's and the chi-square's own scatter, 1 in 10 000
    low, high = scipy.stats.binom.ppf([1e-4, 1 - 1e-4], count, 0.95) / count
    assert np.all((shares >= low) & (shares <= high))
    low, high = scipy.stats.chi2.ppf([1e-4, 1 - 1e-4], parameters * count) / count
    assert low < form < high


@pytest.mark.slow
@pytest.mark.twentieth
@pytest.mark.parametrize("simulate", SIMULATIONS[:3])
def test_coverage_of_the_sds_a_twentieth(simulate, figure):
    check_coverage(simulate, 100, figure)


@pytest.mark.study
@pytest.mark.parametrize("simulate", SIMULATIONS)
def test_coverage_of_the_sds(simulate, figure):
    """Standard errors of 700 and 2000: of a coverage 0.8 and 0.5 %, of the form 3.8 and 2.2 %."""
    check_coverage(simulate, draws(300, 2000), figure)


@pytest.mark.slow
def test_a_scan_drives_the_table_with_its_covariance(figure):
    """Rows from simulated scans scatter as the 2 x 2 covariance says."""
    dip = np.array([0.3, 1.2, 2.1])
    volumes, predicted = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        points = lying(40.0, 0.02, rng, 60, 0.003)
        scan = lying_cylinder(points, variances(points, 0.003), np.radians(40))
        tank = LyingTank(scan.diameter_m, scan.diameter_m, 10.0, tilt=scan.tilt, dip_from_a_m=2.0)
        volumes.append(tank.volume_m3(dip))
        by = tank.derivatives(dip)
        gradient = np.column_stack([by["diameter"], by["tilt"]])
        predicted.append(np.einsum("ri,ij,rj->r", gradient, scan.cofactor, gradient))
    ratio = np.std(volumes, axis=0, ddof=1) / np.sqrt(np.mean(predicted, axis=0))
    figure("lying scans: scatter of rows over predicted u", str(np.round(ratio, 2)))
    low, high = np.sqrt(scipy.stats.chi2.ppf([1e-4, 1 - 1e-4], 39) / 39)
    assert np.all((ratio > low) & (ratio < high))


@pytest.mark.slow
def test_a_dense_scan_is_fitted_in_seconds(figure):
    rng = np.random.default_rng(1)
    points = lying(40.0, 0.02, rng, 100_000, 0.003)
    start = time.perf_counter()
    found = lying_cylinder(points, variances(points, 0.003), np.radians(40))
    figure("cylinder through 100 000 points, s", f"{time.perf_counter() - start:.2f}")
    assert found.diameter_m == pytest.approx(2.4, abs=5 * np.sqrt(found.cofactor[0, 0]))
