"""A wall at single places: its radius about the own centre of a level, and where that centre is.

The linear functionals of `estimate`, g = A y, for a radius at a course, height and azimuth, and for
the coordinates of the centre of a ring, which no prior binds: all with one another, so that what
two places share drops out of their difference.

Where there is a reading, the best estimate draws it towards its neighbours, which is right on the
average and wrong at a dent: the larger a departure is among small ones, the more of it is lost. So
a place may be asked for as it was read, y_i less the centre of its ring: unbiased whatever the wall
does there, and hardly less certain.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from tankcal.geometry.field.components import (
    COMPONENTS,
    azimuth_correlations,
    seam_correlation,
    wave_columns,
    weld_columns,
)


@dataclass(frozen=True)
class Spots:
    """Places on a wall.

    Attributes
    ----------
    course : ndarray of int, shape (p,)
    zeta : ndarray, shape (p,)
        Height within the course, -1 at its bottom to +1 at its top.
    azimuth_rad : ndarray, shape (p,)
    site : ndarray of int, shape (p,), optional
        Reading of the field at that very place that is to count as it was read; -1: the estimate.
    """

    course: np.ndarray
    zeta: np.ndarray
    azimuth_rad: np.ndarray
    site: np.ndarray | None = None

    def __len__(self):
        return len(self.course)


class FieldValues:
    """Radii at p places, then x and y of the centres of c rings, estimated together; f = p + 2 c.

    Parameters
    ----------
    field : WallField
    spots : Spots
    centres : sequence of (int, float)
        Ring and height within its course, -1 to 1: the centre of a ring that leans moves with it.

    Attributes
    ----------
    value_m : ndarray, shape (f,)
        Radii about the own centre of their level, so without first harmonic; centres from the point
        that the radii of their ring were taken about.
    weights : ndarray, shape (f, n)
        Derivative by the readings of the field.
    """

    def __init__(self, field, spots, centres=()):
        self._field, self._spots = field, spots
        self._covariances = field._covariances
        factor, by_columns, normal = field._factored
        free, explained = field._solved
        design = self._design(centres)
        self._across = [self._with_sites(index) for index in range(len(COMPONENTS))]
        stated = [one.shape in field.stated for one in COMPONENTS]
        across = np.zeros((len(design), len(field.sites)))
        for part, counts in zip(self._across, stated, strict=True):
            if counts:
                across[: len(spots)] += part
        self.value_m = design @ free + across @ explained
        self.value_m[: len(spots)] += field._mean_m[spots.course]
        with_free = scipy.linalg.cho_solve(normal, (design - across @ by_columns).T).T
        across += with_free @ field._columns[0].T
        self.weights = scipy.linalg.cho_solve(factor, across.T, check_finite=False).T
        if spots.site is not None and np.any(spots.site >= 0):
            self._take_as_read(np.flatnonzero(spots.site >= 0))

    def _take_as_read(self, rows):
        """Put readings in place of estimates: each less all but the radius of what is free."""
        field, sites = self._field, self._spots.site[rows]
        factor, _, normal = field._factored
        design, radii = field._columns
        others = design[sites].copy()
        others[np.arange(len(rows)), radii[field.sites.course[sites]]] = 0.0
        free = scipy.linalg.cho_solve(normal, others.T).T @ design.T
        self.value_m[rows] = field.radius_m[sites] - others @ field._solved[0]
        self.weights[rows] = -scipy.linalg.cho_solve(factor, free.T, check_finite=False).T
        self.weights[rows, sites] += 1.0

    def unseen_of(self, rows):
        """What was not seen of each component, in sums of the values.

        Parameters
        ----------
        rows : scipy.sparse.csr_array, shape (r, f)
            Each of few places: only these are asked for with one another.

        Returns
        -------
        ndarray, shape (components, r)
            Variances of the errors, m2.
        """
        weights, of_places = rows @ self.weights, rows[:, : len(self._spots)]
        row, first, second, product = _pairs(of_places)
        around = self._around(first, second)
        found = np.empty((len(COMPONENTS), len(weights)))
        sizes = self._field.amplitudes.variances_m2
        for index, (size, across) in enumerate(zip(sizes, self._across, strict=True)):
            found[index] = size * self._covariances.spread_alone(weights, index)
            found[index] -= 2 * np.einsum("rn,rn->r", weights, of_places @ across)
            own = size * product * self._between(index, first, second, around)
            found[index] += np.bincount(row, own, len(weights))
        return found

    def _design(self, centres):
        """(f, p) derivative by what no prior binds."""
        sites = self._field.sites
        design, radii = self._field._columns
        found = np.zeros((len(self._spots) + 2 * len(centres), design.shape[1]))
        found[np.arange(len(self._spots)), radii[self._spots.course]] = 1.0
        for row, (ring, zeta) in enumerate(centres):
            course = sites.course[sites.ring == ring][0]
            own = sites.ring[sites.course == course]
            at = radii[course] + 1
            for one in np.unique(own[own >= 0]):
                leans = bool(np.any(sites.leans[sites.ring == one]))
                if one == ring:
                    rows = len(self._spots) + 2 * row + np.arange(2)
                    found[rows, at + np.arange(2)] = 1.0
                    if leans:
                        found[rows, at + 2 + np.arange(2)] = zeta
                at += 4 if leans else 2
        return found

    def _with_sites(self, index):
        """(p, n) covariance of the places with one component at the sites, m2."""
        one, spots, sites = COMPONENTS[index], self._spots, self._field.sites
        size = self._field.amplitudes.variances_m2[index]
        if one.shape == "weld":
            return size * self._peaks[index] @ self._covariances.peaks[index].T
        found = self._along[one.shape] * one.height_covariance(self._heights, sites.heights)
        if not one.common:
            found = found * (spots.course[:, None] == sites.course)
        return size * found

    def _around(self, first, second):
        """{shape: (k,) c between places (k,) and others}."""
        azimuth = self._spots.azimuth_rad
        found = {
            shape: np.sum(waves[first] * waves[second], axis=1)
            for shape, waves in wave_columns(azimuth).items()
        }
        apart = azimuth[first] - azimuth[second]
        return found | {"mean": 1.0, "seam": seam_correlation(apart, self._field.nominal_m)}

    def _between(self, index, first, second, around):
        """(k,) covariance between places (k,) and others by one component of unit variance."""
        one, spots = COMPONENTS[index], self._spots
        if one.shape == "weld":
            return np.sum(self._peaks[index][first] * self._peaks[index][second], axis=1)
        heights = self._heights
        found = around[one.shape] * one.height_between(heights[first], heights[second])
        if not one.common:
            found = found * (spots.course[first] == spots.course[second])
        return found

    @cached_property
    def _heights(self):
        return self._field.sites.heights_at(self._spots.course, self._spots.zeta)

    @cached_property
    def _along(self):
        """{shape: (p, n) c between the places and the sites}."""
        found = azimuth_correlations(
            self._spots.azimuth_rad, self._covariances.azimuths_rad, self._field.nominal_m
        )
        return {shape: self._covariances.at_sites(one) for shape, one in found.items()}

    @cached_property
    def _peaks(self):
        """{component: (p, k) derivative of the places by the peaks of welds}."""
        spots, sites, columns = self._spots, self._field.sites, []
        for course in range(len(self._field._members)):
            own = weld_columns(spots.azimuth_rad, sites.welds_of(course), self._field.nominal_m)
            columns.append(own * (spots.course == course)[:, None])
        alone = np.hstack(columns)
        return {
            index: alone.sum(axis=1, keepdims=True) if one.common else alone
            for index, one in enumerate(COMPONENTS)
            if one.shape == "weld"
        }


def _pairs(rows):
    """Each two places of a row of rows (r, p), in both orders and with itself: the row's number,
    both places, and the product of their coefficients.
    """
    rows = rows.tocsr()
    count = np.diff(rows.indptr)
    row = np.repeat(np.arange(len(count)), count**2)
    within = np.arange(len(row)) - np.repeat(np.cumsum(count**2) - count**2, count**2)
    first, second = (rows.indptr[row] + part for part in np.divmod(within, count[row]))
    return row, rows.indices[first], rows.indices[second], rows.data[first] * rows.data[second]
