"""The walls of lying cylinders and spheres as random fields: covariances, sizes, functionals."""

import numpy as np
import pytest

from tankcal.geometry.field.amplitudes import Amplitudes
from tankcal.geometry.field.places import (
    DEGREES,
    OF_CYLINDERS,
    OF_GREAT_CIRCLES,
    OF_SPHERES,
    CylinderFunctionals,
    OnCylinder,
    OnGreatCircles,
    OnSphere,
    SolidField,
    cap_integrals,
    cells_along,
    cells_around,
    degree_shares,
    estimate_sizes,
    means_of_neighbours,
    wet_cells,
)

RADIUS, LENGTH = 1.3, 6.0


def on_cylinder(rng, count=40):
    return OnCylinder(RADIUS, rng.uniform(-np.pi, np.pi, count), rng.uniform(0, LENGTH, count))


def on_sphere(rng, count=40):
    way = rng.normal(size=(count, 3))
    return OnSphere(3.0, way / np.linalg.norm(way, axis=1)[:, None])


def some_functionals(rng):
    around, along = cells_around(), cells_along(0.0, LENGTH)
    level = np.array([-0.9, 0.2])[:, None] + 0.02 * along
    weights = wet_cells(level, RADIUS).transpose(0, 2, 1) * 0.01
    return CylinderFunctionals(around, along, weights, 2.5, np.array([-3.0, 1.5]))


@pytest.mark.parametrize("one", OF_CYLINDERS)
def test_a_departure_of_a_cylinder_is_a_covariance_of_unit_variance(one):
    """That at the bottom alone has unit variance there and less elsewhere."""
    places = on_cylinder(np.random.default_rng(1))
    found = places.covariance(one)
    assert np.linalg.eigvalsh(found).min() > -1e-9
    assert np.all(found.diagonal() <= 1 + 1e-12)
    if one.shape != "bottom":
        assert found.diagonal() == pytest.approx(np.ones(len(found)))
    bottom = OnCylinder(RADIUS, np.zeros(1), np.zeros(1)).covariance(one)
    assert bottom[0, 0] == pytest.approx(1.0)


@pytest.mark.parametrize("one", OF_SPHERES)
def test_a_departure_of_a_sphere_is_a_covariance_of_unit_variance(one):
    """That of its own weight has unit variance over the sphere, not at each place."""
    found = on_sphere(np.random.default_rng(1)).covariance(one)
    assert np.linalg.eigvalsh(found).min() > -1e-6
    if one.shape == "zonal":
        up, weights = np.polynomial.legendre.leggauss(9)
        zone = np.column_stack([np.sqrt(1 - up**2), np.zeros(9), up])
        each = OnSphere(3.0, zone).covariance(one).diagonal()
        assert weights @ each / 2 == pytest.approx(1.0)
        return
    assert found.diagonal() == pytest.approx(np.ones(len(found)), abs=1e-9)


@pytest.mark.parametrize("one", OF_CYLINDERS)
def test_functionals_of_a_cylinder_are_those_of_its_cells(one):
    """Second method: the grid's cells and the point as places, summed one by one."""
    rng = np.random.default_rng(2)
    functionals, places = some_functionals(rng), on_cylinder(rng, 6)
    coarse = (slice(None), slice(None, None, 8), slice(None, None, 6))
    some = CylinderFunctionals(
        functionals.turn_rad[::8],
        functionals.along_m[::6],
        functionals.weights[coarse],
        functionals.point_m,
        functionals.at_point,
    )
    turn, along = (one.ravel() for one in np.meshgrid(some.turn_rad, some.along_m, indexing="ij"))
    every = OnCylinder(
        RADIUS,
        np.concatenate([turn, [0.0], places.turn_rad]),
        np.concatenate([along, [some.point_m], places.along_m]),
    ).covariance(one)
    weights = np.column_stack([some.weights.reshape(2, -1), some.at_point])
    count = weights.shape[1]
    assert places.across(one, some) == pytest.approx(weights @ every[:count, count:], abs=1e-10)
    expected = weights @ every[:count, :count] @ weights.T
    assert places.within(one, some) == pytest.approx(expected, rel=1e-9, abs=1e-10)


def test_wet_cells_make_the_wet_arc():
    """Closed form: the arc below a level is 2 R arccos(-level / R), from empty to full."""
    level = np.linspace(-RADIUS, RADIUS, 400)
    arc = wet_cells(level, RADIUS).sum(axis=-1) * 2 * np.pi / len(cells_around())
    assert arc == pytest.approx(2 * np.arccos(np.clip(-level / RADIUS, -1, 1)), abs=1e-9)


def test_cap_integrals_are_those_of_a_quadrature():
    node, weight = np.polynomial.legendre.leggauss(400)
    for cosine in (-0.7, 0.1, 0.95):
        t = cosine + (1 - cosine) * (node + 1) / 2
        values = np.polynomial.legendre.legvander(t, DEGREES[-1])[:, 2:]
        expected = 2 * np.pi * (1 - cosine) / 2 * weight @ values
        assert cap_integrals(np.array([cosine]))[0] == pytest.approx(expected, abs=1e-10)


@pytest.mark.slow
def test_functionals_of_a_sphere_are_those_of_points_on_it():
    """Second method: a cap as many points on it, with the covariance between places."""
    rng = np.random.default_rng(4)
    one, cosine = OF_SPHERES[2], 0.6
    up, turn = rng.uniform(cosine, 1, 40_000), rng.uniform(0, 2 * np.pi, 40_000)
    level = np.sqrt(1 - up**2)
    cap = np.column_stack([level * np.cos(turn), level * np.sin(turn), -up])
    places = on_sphere(rng, 5)
    angle = np.arccos(np.clip(cap @ places.direction.T, -1, 1))
    shares = np.concatenate([np.zeros(2), degree_shares(one, places.radius_m)])
    each = np.polynomial.legendre.legval(np.cos(angle), shares).mean(axis=0)
    expected = each * 2 * np.pi * (1 - cosine)
    found = places.across(one, cap_integrals(np.array([cosine])))[0]
    assert found == pytest.approx(expected, abs=0.02 * np.abs(expected).max() + 0.005)


NORMALS = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.6, 0.8, 0.0]])


def circle_of(normal, count=400):
    """(count, 3) directions on a great circle."""
    first = np.cross(normal, [0.3, 0.4, 0.85])
    first /= np.linalg.norm(first)
    turn = 2 * np.pi * np.arange(count) / count
    return np.outer(np.cos(turn), first) + np.outer(np.sin(turn), np.cross(normal, first))


@pytest.mark.slow
@pytest.mark.parametrize("one", OF_GREAT_CIRCLES[1:3])
def test_means_over_great_circles(one):
    """Second method: the covariance between places, less its degree 2, averaged over circles."""
    radius = 10.0
    shares = np.concatenate([np.zeros(2), degree_shares(one, radius)])
    shares[2] = 0.0
    places = OnGreatCircles(radius, NORMALS)
    found = places.covariance(one)
    circles = [circle_of(normal) for normal in NORMALS]
    for i, first in enumerate(circles):
        for j, second in enumerate(circles):
            cosine = np.clip(first @ second.T, -1, 1)
            expected = np.polynomial.legendre.legval(cosine, shares).mean()
            assert found[i, j] == pytest.approx(expected, abs=1e-6)
    cosine, node = 0.3, np.polynomial.legendre.legvander(-circles[1][:, 2], DEGREES[-1])[:, 2:]
    functional = cap_integrals(np.array([cosine]))
    expected = (functional * shares[2:]) @ node.T
    assert places.across(one, functional)[0, 1] == pytest.approx(expected.mean(), abs=1e-9)


def test_band_about_the_equator():
    """Second method: its profile on the equator and over a meridian, less degrees 0 and 2."""
    one = OF_GREAT_CIRCLES[3]
    up, weights = np.polynomial.legendre.leggauss(400)
    profile = np.exp(-((np.arcsin(up) / one.width_m) ** 2))
    second = 1.5 * up**2 - 0.5
    mean, flat = weights @ profile / 2, 5 / 2 * weights @ (profile * second)
    latitude = np.pi * (np.arange(4000) + 0.5) / 4000 - np.pi / 2
    over = np.exp(-((latitude / one.width_m) ** 2)).mean()
    expected = np.array([1 - mean + flat / 2, over - mean - flat / 4, over - mean - flat / 4])
    found = OnGreatCircles(10.0, NORMALS).covariance(one)
    assert found == pytest.approx(np.outer(expected, expected), abs=1e-5)
    cap = cap_integrals(np.array([0.2]))
    inside = OnGreatCircles(10.0, NORMALS).within(one, cap)[0, 0]
    fine = np.linspace(-1, -0.2, 20_001)
    fine = (fine[1:] + fine[:-1]) / 2
    rest = np.exp(-((np.arcsin(fine) / one.width_m) ** 2)) - mean - flat * (1.5 * fine**2 - 0.5)
    assert inside == pytest.approx((2 * np.pi * rest.sum() * 0.8 / 20_000) ** 2, rel=1e-4)


def drawn(rng, places, variances, noise_m):
    """Distances of a wall that is the model itself, with the noise, and their design."""
    whole = sum(
        v * places.covariance(one) for v, one in zip(variances, places.departures, strict=True)
    )
    count = len(whole)
    root = np.linalg.cholesky(whole + 1e-12 * np.eye(count))
    turn = places.turn_rad
    design = np.column_stack([np.sin(turn), np.cos(turn), np.ones(count)])
    return root @ rng.normal(size=count) + noise_m * rng.normal(size=count), design


@pytest.mark.slow
@pytest.mark.parametrize("estimated", [False, True])
def test_sizes_are_as_unsure_as_they_are_said(estimated, figure):
    """Simulation: sizes drawn from what is known before, walls of them; errors over their sds.

    Of ovality that runs along the whole tank one mode has most: its logarithm is skewed, and errs
    by up to twice its sd. Its points see it, so little of it goes into U.
    """
    rng = np.random.default_rng(6)
    middle = np.array([2 * np.log(one.median_m) for one in OF_CYLINDERS])
    sds = np.array([one.log_sd for one in OF_CYLINDERS])
    away = []
    for _ in range(50):
        places = on_cylinder(rng, 100)
        logs = middle + sds * rng.normal(size=len(sds))
        distance, design = drawn(rng, places, np.exp(logs), 1e-3)
        noise = np.eye(100) * (1.0 if estimated else 1e-6)
        sizes = estimate_sizes(places, design, distance, noise, estimate_noise=estimated)
        away.append((np.log(sizes.likely_m2) - logs) / np.sqrt(np.diag(sizes.log_covariance)))
        assert np.isfinite(sizes.noise_dof) == estimated
    away = np.array(away)
    rms = np.sqrt(np.mean(away**2, axis=0))
    figure(
        f"errors of logarithms of sizes over their sd, noise estimated {estimated}", rms.round(2)
    )
    whole = [one.shape == "oval" and np.isinf(one.length_m) for one in OF_CYLINDERS]
    assert np.all(rms < np.where(whole, 2.0, 1.5))
    assert np.all(rms > 0.7)


@pytest.mark.slow
def test_a_functional_is_as_unsure_as_it_is_said():
    """Simulation of the model itself: errors of functionals over their sd have rms 1."""
    rng = np.random.default_rng(7)
    functionals, away = some_functionals(rng), []
    variances = np.array([one.median_m for one in OF_CYLINDERS]) ** 2
    sizes = Amplitudes(variances, np.zeros((len(variances),) * 2), np.ones(len(variances)))
    grid = np.meshgrid(cells_around()[::8], cells_along(0.0, LENGTH)[::6], indexing="ij")
    turn, along = (one.ravel() for one in grid)
    cells = functionals.weights[:, ::8, ::6]
    some = CylinderFunctionals(
        cells_around()[::8], cells_along(0.0, LENGTH)[::6], cells, 2.5, functionals.at_point
    )
    weights = np.column_stack([cells.reshape(2, -1), some.at_point])
    for _ in range(60):
        seen = on_cylinder(rng, 60)
        every = OnCylinder(
            RADIUS,
            np.concatenate([turn, [0.0], seen.turn_rad]),
            np.concatenate([along, [2.5], seen.along_m]),
        )
        wall, design = drawn(rng, every, variances, 0.0)
        count = weights.shape[1]
        distance = wall[count:] + 1e-3 * rng.normal(size=60)
        field = SolidField(seen, design[count:], distance, 1e-6 * np.eye(60), sizes)
        by_shape = weights @ design[:count]
        found = field.estimated(some, by_shape)
        error = by_shape @ found.moved + found.departing - weights @ wall[:count]
        covariance = 1e-6 * found.weights @ found.weights.T + sum(found.unseen)
        assert found.weights @ distance == pytest.approx(error + weights @ wall[:count], abs=1e-9)
        away.append(error / np.sqrt(np.diag(covariance)))
    assert np.sqrt(np.mean(np.square(away), axis=0)) == pytest.approx([1.0, 1.0], abs=0.3)


def test_a_reading_far_off_is_found_and_a_dent_of_two_is_not():
    rng = np.random.default_rng(8)
    places = on_cylinder(rng, 120)
    variances = np.full(len(OF_CYLINDERS), 1e-8)
    distance, design = drawn(rng, places, variances, 5e-4)
    distance[17] += 0.04
    given = places, design, distance, 2.5e-7 * np.eye(120)
    assert SolidField(*given, estimate_sizes(*given)).far_off(5.0, 0.02).tolist() == [17]
    assert SolidField(*given, estimate_sizes(*given)).far_off(5.0, 0.05).tolist() == []


@pytest.mark.slow
def test_many_points_become_means_of_neighbours():
    rng = np.random.default_rng(9)
    xyz = rng.uniform(0, 1, (5000, 3))
    means = means_of_neighbours(xyz)
    assert 100 < means.shape[0] <= 600
    assert means.sum(axis=1) == pytest.approx(np.ones(means.shape[0]))
    few = means_of_neighbours(xyz[:50])
    assert (few != np.eye(50)).sum() == 0
