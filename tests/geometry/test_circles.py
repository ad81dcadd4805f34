"""The circle: the published table, closed forms, the criterion."""

import csv
import json

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
import scipy.sparse
from shapes import azimuths, ring

from tankcal.adjust import adjust
from tankcal.errors import SolutionError
from tankcal.geometry.circles import (
    circle_conditions,
    fit_circle,
    radial_covariance,
    taubin_circle,
)

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
        (np.ones((6, 2)), "in one place"),
        (np.column_stack([np.arange(6.0), 2 * np.arange(6.0)]), "on a line"),
    ],
)
def test_points_that_make_no_circle_are_refused(points, message):
    with pytest.raises(SolutionError, match=message):
        fit_circle(points, np.full(2 * len(points), 1e-4))


def test_independent_points_are_fitted_as_with_their_whole_covariance():
    """Second method: the same blocks in one matrix."""
    rng = np.random.default_rng(8)
    points = ring(6.5, azimuths(20))[:, :2] + rng.normal(0, 0.002, (20, 2))
    roots = rng.normal(0, 0.002, (20, 2, 2))
    each = roots @ roots.transpose(0, 2, 1) + 1e-6 * np.eye(2)
    whole = scipy.linalg.block_diag(*each)
    found = fit_circle(points, each)
    other = fit_circle(points, whole)
    assert (found.x_m, found.radius_m) == pytest.approx((other.x_m, other.radius_m), rel=1e-12)
    assert found.cofactor_m2 == pytest.approx(other.cofactor_m2, rel=1e-9)
    assert found.variance_factor == pytest.approx(other.variance_factor, rel=1e-9)
    radial, of_whole = (
        radial_covariance(points, (0.1, 0.2), given).dense() for given in (each, whole)
    )
    assert np.diag(radial) == pytest.approx(np.diag(of_whole), rel=1e-12)


def _seen_from_outside(form_m, set_ups=4, away_m=10.0, radius_m=5.0, count=80):
    """Points of a section with waves, and a covariance whose set-ups shift by 5 mm and turn."""
    azimuth = azimuths(count)
    waves = sum(form_m / k * np.cos(k * azimuth + k * k) for k in (2, 3, 4))
    xy = (radius_m + waves)[:, None] * np.column_stack([np.sin(azimuth), np.cos(azimuth)])
    columns = []
    for at in azimuths(set_ups):
        mine = np.abs((azimuth - at + np.pi) % (2 * np.pi) - np.pi) <= np.pi / set_ups
        away = xy - (radius_m + away_m) * np.array([np.sin(at), np.cos(at)])
        turned = np.column_stack([-away[:, 1], away[:, 0]])
        for by in (np.tile([5e-3, 0], (count, 1)), np.tile([0, 5e-3], (count, 1)), 1e-3 * turned):
            columns.append((by * mine[:, None]).ravel())
    columns = np.column_stack(columns)
    return xy, columns @ columns.T + 1e-8 * np.eye(2 * count)


@pytest.mark.slow
def test_waves_under_shared_errors_have_a_circle():
    """The iteration at adjusted points alternates; second method: a search without derivatives."""
    xy, covariance = _seen_from_outside(0.15)
    with pytest.raises(SolutionError, match="converge"):
        adjust(circle_conditions, taubin_circle(xy), xy.ravel(), covariance)
    circle = fit_circle(xy, covariance)
    weight = np.linalg.inv(radial_covariance(xy, (circle.x_m, circle.y_m), covariance).dense())

    def squares(given):
        off = np.hypot(*(xy - given[:2]).T) - given[2]
        return off @ weight @ off

    start, options = taubin_circle(xy), {"xatol": 1e-9, "fatol": 1e-9, "maxiter": 4000}
    found = scipy.optimize.minimize(squares, start, method="Nelder-Mead", options=options).x
    np.testing.assert_allclose([circle.x_m, circle.y_m, circle.radius_m], found, atol=1e-5)


def test_fit_of_distances_is_that_of_points_to_first_order(monkeypatch):
    """Property: small waves have the same circle and covariance by both iterations."""
    xy, covariance = _seen_from_outside(0.001)
    points = fit_circle(xy, covariance)

    def fail(*_):
        raise SolutionError("")

    monkeypatch.setattr("tankcal.geometry.circles.adjust", fail)
    distances = fit_circle(xy, covariance)
    np.testing.assert_allclose(distances.radius_m, points.radius_m, atol=1e-6)
    np.testing.assert_allclose(distances.cofactor_m2, points.cofactor_m2, rtol=0.01, atol=1e-9)
    assert distances.dof == points.dof
