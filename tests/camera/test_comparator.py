"""Repeated readings, fiducial transformations and film: closed forms, geometry, simulation."""

import numpy as np
import pytest
from draws import draws

from tankcal.camera.comparator import (
    KINDS,
    Surface,
    find_mark_error,
    fit_transformation,
    flatten_film,
    group_readings,
    heights_at,
)
from tankcal.errors import SolutionError

CORNERS = np.array([[-83.0, -58.0], [83.1, -58.2], [82.9, 58.1], [-83.2, 58.0]])
EIGHT = np.vstack([CORNERS, [[-83.0, 0.1], [83.0, -0.1], [0.0, 58.3], [0.1, -58.1]]])
SHRUNK = np.array([[1.0004, 0.0003], [-0.0002, 0.9991]])  # film that shrank across
ORIGIN = np.array([312.4, 207.9])  # of the comparator


def readings_of(places, matrix=SHRUNK, angle=0.3, mirrored=False):
    """Where a comparator reads places of the photo: x' = matrix R (reading - ORIGIN)."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    if mirrored:
        turn = turn @ np.diag([-1.0, 1.0])
    return places @ np.linalg.inv(matrix @ turn).T + ORIGIN


def test_mean_and_sd_of_repeated_readings():
    """Closed form: 1, 2, 3 have mean 2 and sample sd 1; one reading has no sd."""
    found = group_readings(
        ["b", "a", "b", "b"], np.array([[1, 10], [7, 7], [2, 10], [3, 10.0]]) + 1e6
    )
    assert found.group.tolist() == [0, 1, 0, 0]
    assert found.count.tolist() == [3, 1]
    np.testing.assert_allclose(found.mean - 1e6, [[2, 10], [7, 7]], atol=1e-9)
    np.testing.assert_allclose(found.sd[0], [1, 0], atol=1e-9)
    assert np.isnan(found.sd[1]).all()
    assert found.exceeds(0.999).tolist() == [True, False]
    assert found.exceeds(1.001).tolist() == [False, False]
    assert found.exceeds(None).tolist() == [False, False]


def test_no_readings_at_all():
    found = group_readings([], np.zeros((0, 2)))
    assert (len(found.count), len(found.exceeds(1.0))) == (0, 0)


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 2, -3.0])
@pytest.mark.parametrize("kind", ["affine", "similarity"])
def test_a_transformation_comes_back(kind, angle):
    """Closed form: the inverse of what made the readings, to rounding."""
    matrix = SHRUNK if kind == "affine" else 0.9995 * np.eye(2)
    found = fit_transformation(readings_of(CORNERS, matrix, angle), CORNERS, 0.003, kind)
    np.testing.assert_allclose(found.residuals_mm, 0, atol=1e-11)
    points = np.random.default_rng(1).uniform(-60, 60, (20, 2))
    np.testing.assert_allclose(
        found.transform(readings_of(points, matrix, angle)), points, atol=1e-11
    )
    a = found.parameters
    x, y = readings_of(points, matrix, angle).T
    by_formula = np.column_stack([a["a1"] * x + a["a2"] * y + a["a3"],
                                  a["a4"] * x + a["a5"] * y + a["a6"]])  # fmt: skip
    np.testing.assert_allclose(by_formula, points, atol=1e-10)


def test_covariance_of_four_marks_at_the_corners_of_a_square():
    """Closed form: unit marks, four corners (+-d): the centre has sd s/2, a corner sqrt(3)/2 s."""
    d, s = 80.0, 0.004
    marks = d * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]])
    found = fit_transformation(marks, marks, s)
    at = np.array([[0, 0], [d, d], [d, 0]])
    added = found.parameter_covariance(at)
    np.testing.assert_allclose(np.einsum("nii->ni", added)[:, 0] / s**2, [1 / 4, 3 / 4, 1 / 2])
    np.testing.assert_allclose(added[:, 0, 1], 0, atol=1e-20)
    assert found.dof == 2
    of_similarity = fit_transformation(marks, marks, s, "similarity").parameter_covariance(at)
    expected = np.array([1 / 4, 1 / 4 + 2 / 8, 1 / 4 + 1 / 8])  # 1/n + r2 / sum of r2
    np.testing.assert_allclose(of_similarity[:, 0, 0] / s**2, expected)


@pytest.mark.parametrize("kind", ["affine", "similarity"])
def test_second_method_derivatives_by_moved_readings(kind):
    """Second method: the covariance from numerical derivatives of the whole computation."""
    rng = np.random.default_rng(5)
    readings = readings_of(EIGHT, 0.9995 * np.eye(2)) + rng.normal(0, 0.003, EIGHT.shape)
    sd = rng.uniform(0.002, 0.005, EIGHT.shape)
    place = np.array([[200.0, 190.0]])
    found = fit_transformation(readings, EIGHT, sd, kind)
    columns, step = [], 1e-4
    for i in range(readings.size):
        moved = [readings.copy(), readings.copy()]
        moved[0].flat[i] += step
        moved[1].flat[i] -= step
        up, down = (fit_transformation(one, EIGHT, sd, kind).transform(place)[0] for one in moved)
        columns.append((up - down) / (2 * step) * sd.flat[i])
    columns = np.array(columns)
    np.testing.assert_allclose(found.parameter_covariance(place)[0], columns.T @ columns, rtol=2e-3)


def test_shifts_have_the_sds_of_the_formula():
    """Second method: a3 and a6 are the image of the comparator's zero."""
    found = fit_transformation(readings_of(EIGHT), EIGHT, 0.003)
    at_zero = np.einsum("nii->ni", found.parameter_covariance(np.zeros((1, 2))))[0]
    sds = found.parameter_sds
    np.testing.assert_allclose([sds["a3"] ** 2, sds["a6"] ** 2], at_zero, rtol=1e-9)


def test_sds_turn_with_the_comparator():
    """Closed form: a quarter turn exchanges the sds of x and y."""
    found = fit_transformation(readings_of(CORNERS, np.eye(2), np.pi / 2), CORNERS, 0.003)
    np.testing.assert_allclose(found.propagate_sds([[0.002, 0.005]]), [[0.005, 0.002]], rtol=1e-9)


def test_sds_through_a_sheared_comparator():
    """Closed form: x' = a1 x + a2 y has the variance a1^2 sx^2 + a2^2 sy^2, y' alike."""
    matrix = np.array([[1.0, 0.3], [-0.1, 0.9]])
    found = fit_transformation(CORNERS @ np.linalg.inv(matrix).T, CORNERS, 0.003)
    expected = np.sqrt([0.002**2 + 0.09 * 0.005**2, 0.01 * 0.002**2 + 0.81 * 0.005**2])
    np.testing.assert_allclose(found.propagate_sds([[0.002, 0.005]]), [expected], rtol=1e-9)


def covered(trials, kind, seed):
    """Errors of transformed points, marks and points read with noise, in their own sds (n, 2)."""
    rng = np.random.default_rng(seed)
    matrix = SHRUNK if kind == "affine" else 1.0007 * np.eye(2)
    points = np.array([[0, 0], [60, 40], [-88, 63.0]])
    marks, places = readings_of(CORNERS, matrix), readings_of(points, matrix)
    found, factors = [], []
    for _ in range(trials):
        fit = fit_transformation(marks + rng.normal(0, 0.004, marks.shape), CORNERS, 0.004, kind)
        read = places + rng.normal(0, 0.003, places.shape)
        variance = fit.propagate_sds(np.full(read.shape, 0.003)) ** 2
        variance += np.einsum("nii->ni", fit.parameter_covariance(read))
        found.append((fit.transform(read) - points) / np.sqrt(variance))
        factors.append(fit.chi2)
    return np.array(found).reshape(-1, 2), np.array(factors), fit.dof


@pytest.mark.slow
@pytest.mark.twentieth
@pytest.mark.parametrize("kind", ["affine", "similarity"])
def test_coverage_of_a_transformed_coordinate(kind, figure):
    """Simulation: 95 % of the errors lie within 1.96 sd, chi2 averages its degrees of freedom."""
    check_coverage(200, kind, figure)


@pytest.mark.study
@pytest.mark.parametrize("kind", ["affine", "similarity"])
def test_coverage_of_a_transformed_coordinate_in_full(kind, figure):
    """Standard error 0.25 % of 2500 trials, 0.2 % of 4000."""
    check_coverage(draws(2500, 4000), kind, figure)


def check_coverage(trials, kind, figure):
    errors, chi2, dof = covered(trials, kind, 11)
    share = np.mean(np.abs(errors) < 1.959964)
    figure(f"coverage at 95 % of a transformed coordinate, {kind}, {trials} trials", f"{share:.4f}")
    # the six errors of a trial share their marks: as if three of them were independent
    assert abs(share - 0.95) < 4 * np.sqrt(0.95 * 0.05 / (3 * trials))
    assert abs(chi2.mean() / dof - 1) < 4 * np.sqrt(2 / dof / trials)


def test_few_marks():
    for kind, fewest in KINDS.items():
        found = fit_transformation(CORNERS[:fewest], CORNERS[:fewest], 0.003, kind)
        assert found.dof == 0
        assert np.isnan(found.sigma0)
        with pytest.raises(SolutionError, match="marks"):
            fit_transformation(CORNERS[: fewest - 1], CORNERS[: fewest - 1], 0.003, kind)
    on_a_line = np.array([[0, 0], [1, 1], [2, 2], [5, 5.0]])
    with pytest.raises(SolutionError, match="on one line"):
        fit_transformation(on_a_line, on_a_line, 0.003)


def test_a_mirrored_plate():
    fit = fit_transformation(readings_of(CORNERS, mirrored=True), CORNERS, 0.003)
    assert fit.is_mirrored
    np.testing.assert_allclose(fit.residuals_mm, 0, atol=1e-11)
    found = find_mark_error(readings_of(CORNERS, np.eye(2), mirrored=True), CORNERS, "similarity")
    assert found.what == "mirrored"
    assert find_mark_error(readings_of(CORNERS, mirrored=True), CORNERS) is None


@pytest.mark.parametrize("marks", [CORNERS, EIGHT])
@pytest.mark.parametrize("kind", ["affine", "similarity"])
def test_exchanged_marks_are_named(marks, kind):
    order = np.arange(len(marks))
    order[[0, 1]] = 1, 0
    read = readings_of(marks, 1.0003 * np.eye(2))
    found = find_mark_error(read[order], marks, kind)
    assert (found.what, found.marks) == ("exchanged", ((0, 1),))
    order = np.arange(len(marks))
    order[[0, 2]] = 2, 0  # of four corners also the other diagonal, with a half turn
    found = find_mark_error(read[order], marks, kind)
    assert found.what == "exchanged"
    assert (0, 2) in found.marks
    assert len(found.marks) == (2 if len(marks) == 4 else 1)


def test_one_wrong_mark_is_named_where_the_others_tell():
    read = readings_of(EIGHT)
    read[5] += [2.0, -1.0]
    assert find_mark_error(read, EIGHT).marks == ((5,),)
    assert find_mark_error(read, EIGHT).what == "wrong"
    read = readings_of(CORNERS)
    read[2] += [2.0, -1.0]
    assert find_mark_error(read, CORNERS).what == "misfit"
    assert find_mark_error(readings_of(CORNERS), CORNERS) is None


def test_another_unit_and_three_confused_marks():
    found = find_mark_error(25.4 * readings_of(CORNERS), CORNERS)
    assert found.what == "unit"
    assert found.size == pytest.approx(1 / 25.4, rel=1e-3)
    assert find_mark_error(readings_of(CORNERS)[[1, 2, 0]], CORNERS[:3]).what == "sheared"
    assert find_mark_error(CORNERS[:2], CORNERS[:2]) is None  # too few to say anything


def test_flattened_film_meets_the_rays():
    """Geometry, exact: the ray through the displaced surface meets the plane where it says."""
    rng = np.random.default_rng(2)
    c, x0, y0 = 100.12, 0.3, -0.2
    plane = rng.uniform(-80, 80, (50, 2))  # where the rays meet the plane of the photo
    height = rng.uniform(-0.4, 0.4, 50)
    lens, foot = np.array([x0, y0, c]), np.column_stack([plane, np.zeros(50)])
    along = height / c  # part of the way from the plane to the projection centre
    on_film = (foot + along[:, None] * (lens - foot))[:, :2]
    np.testing.assert_allclose(flatten_film(on_film, height, (c, x0, y0)), plane, atol=1e-12)
    first_order = on_film + (on_film - [x0, y0]) / c * height[:, None]  # Silva 60
    np.testing.assert_allclose(first_order, plane, atol=80 * (0.4 / c) ** 2 * 1.01)


def test_heights_between_and_beyond_the_places():
    """Closed form: a plane is met exactly within; outside the nearest place counts."""
    xy = np.array([[-50, -50], [50, -50], [50, 50], [-50, 50], [3, 7.0]])
    surface = Surface(xy, 0.02 + xy @ [1e-4, -2e-4])
    places = np.array([[0, 0], [20, -30], [np.nan, 1.0], [70, 80]])
    found, outside = heights_at(surface, places)
    np.testing.assert_allclose(found[:2], [0.02, 0.028], atol=1e-15)
    assert outside.tolist() == [False, False, False, True]
    assert np.isnan(found[2])
    assert found[3] == surface.height_mm[2]
