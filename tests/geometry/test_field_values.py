"""Radii at single places of a wall: a second method (one joint normal, conditioned), outlines."""

from dataclasses import replace

import numpy as np
import scipy.sparse
from generated_walls import FULL_TURN

from tankcal.geometry.field.amplitudes import assumed_amplitudes
from tankcal.geometry.field.estimate import FieldValues, Spots, WallField, gauss_heights
from tankcal.geometry.field.sites import Covariances, Sites, free_design

RADIUS_M = 6.5


def a_field(rng, leans=False):
    """Two courses, two rings of nine points in the first, one in the second, with welds."""
    rings = [(0, 0, -0.5), (0, 1, 0.6), (1, 2, 0.1)]
    rows = [(c, ring, z, a) for c, ring, z in rings for a in np.sort(rng.uniform(0, FULL_TURN, 9))]
    course, ring, zeta, azimuth = map(np.array, zip(*rows, strict=True))
    zeta = zeta + 0.1 * rng.normal(size=len(zeta)) * leans
    sites = Sites(course, ring, zeta, azimuth, (ring == 2) & leans,
                  (np.array([0.3, 2.0]), np.array([1.1])))  # fmt: skip
    radius = RADIUS_M + 0.004 * rng.normal(size=len(sites))
    return WallField(sites, radius, 1e-6 * np.eye(len(sites)), assumed_amplitudes(), RADIUS_M)


def test_radii_are_those_of_the_outlines():
    """Second method: the outlines that volumes are integrated through, about the mean centre."""
    field = a_field(np.random.default_rng(1))
    levels, grid = gauss_heights(), field.grid_rad[::40]
    course, level = np.repeat([0, 1], len(levels)), np.tile(levels, 2)
    spots = Spots(*(np.repeat(one, len(grid)) for one in (course, level)), np.tile(grid, 14))
    found = FieldValues(field, spots, [(0, 0.0), (1, 0.0), (2, 0.0)])
    x, y = found.value_m[len(spots) :].reshape(-1, 2).T
    middle = np.array([[x[:2].mean(), y[:2].mean()], [x[2], y[2]]])
    turn = np.stack([np.sin(grid), np.cos(grid)])
    whole = found.value_m[: len(spots)].reshape(2, 7, -1) + (middle @ turn)[:, None]
    assert np.abs(whole - field.outlines_m[:, :, ::40]).max() < 2e-7  # the grid's own modes 0 and 1


def test_values_and_their_doubt_by_conditioning():
    """Second method: sites and places as one normal vector, what no prior binds 30 m wide."""
    rng = np.random.default_rng(2)
    for leans in (False, True):
        field = a_field(rng, leans)
        count, n = 5, len(field.sites)
        spots = Spots(
            np.array([0, 0, 1, 1, 0]), rng.uniform(-1, 1, 5), rng.uniform(0, FULL_TURN, 5)
        )
        rings = [(0, 0.0), (2, 0.4)]
        found = FieldValues(field, spots, rings)
        both = Sites(
            np.append(field.sites.course, spots.course),
            np.append(field.sites.ring, np.full(count, -1)),
            np.append(field.sites.zeta, spots.zeta),
            np.append(field.sites.azimuth_rad, spots.azimuth_rad),
            np.append(field.sites.leans, np.zeros(count, dtype=bool)),
            field.sites.welds_rad,
            spans=field.sites.spans,
        )
        sizes = field.amplitudes.variances_m2
        prior = Covariances(both, RADIUS_M).total(sizes)
        design = free_design(both)[0]
        columns = design.shape[1]
        at = {0: 1, 2: 6}  # columns of course 0: radius, two rings; then radius and ring of 1
        of_centres = np.zeros((4, columns))
        for row, (ring, zeta) in enumerate(rings):
            of_centres[2 * row : 2 * row + 2, at[ring] : at[ring] + 2] = np.eye(2)
            if leans and ring == 2:
                of_centres[2 * row : 2 * row + 2, at[ring] + 2 : at[ring] + 4] = zeta * np.eye(2)
        design = np.vstack([design, of_centres])
        whole = 30.0**2 * design @ design.T
        whole[: n + count, : n + count] += prior
        noisy = whole[:n, :n] + field.noise_m2
        gain = np.linalg.solve(noisy, whole[:n, n:]).T
        left = field.radius_m - RADIUS_M
        expected = gain @ left + np.append(np.full(count, RADIUS_M), np.zeros(4))
        doubt = whole[n:, n:] - gain @ whole[:n, n:]
        np.testing.assert_allclose(found.value_m, expected, atol=2e-6)
        rows = sums_of(count, len(found.value_m), rng)
        own = np.einsum("rn,rn->r", *2 * [rows @ found.weights @ np.sqrt(field.noise_m2)])
        own += found.undetermined_variances(scipy.sparse.csr_array(rows)).sum(axis=0)
        expected = np.einsum("rf,rf->r", rows @ doubt, rows)
        np.testing.assert_allclose(np.sqrt(own), np.sqrt(expected), rtol=2e-3)


def sums_of(places, values, rng):
    """Rows of each value, of each two places, of three, of a place and a centre, and of none."""
    rows = [*np.eye(values), np.zeros(values)]
    rows += [rows[i] - 0.7 * rows[j] for i in range(places) for j in range(i)]
    rows += [rows[0] + rows[1] - 2 * rows[2], rows[3] + 0.4 * rows[places]]
    return np.array(rows) * rng.choice([-1.0, 1.0], size=(len(rows), 1))


def test_weights_are_the_derivative_by_the_readings():
    """Closed form: the estimate is linear in the readings."""
    field = a_field(np.random.default_rng(3))
    spots = Spots(np.array([0, 1]), np.array([0.2, -0.3]), np.array([1.0, 4.0]))
    moved = 1e-3 * np.random.default_rng(4).normal(size=len(field.sites))
    one = FieldValues(field, spots, [(1, 0.0)])
    other = FieldValues(replace(field, radius_m=field.radius_m + moved), spots, [(1, 0.0)])
    np.testing.assert_allclose(other.value_m - one.value_m, one.weights @ moved, atol=1e-12)
