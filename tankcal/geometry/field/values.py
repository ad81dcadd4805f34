"""Wall at single places: its radius about the centre of the level, and that centre.

The linear functionals of `estimate`, g = A y, are radii at a course, height and azimuth, and the
coordinates of the centre of a ring, which have no prior. They are estimated jointly, so that common
errors cancel in the difference of two places.

At a site, the best estimate is drawn towards the neighbouring readings. The estimate is correct on
average but biased at a dent: the larger a departure among small ones, the larger its loss. A place
may therefore request the reading itself, y_i less the centre of its ring. The reading is unbiased
whatever the form of the wall, and hardly less certain.
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
        Reading of the field at the place that replaces the estimate; -1: the estimate.
    """

    course: np.ndarray
    zeta: np.ndarray
    azimuth_rad: np.ndarray
    site: np.ndarray | None = None

    def __len__(self):
        return len(self.course)


class FieldValues:
    """Radii at p places, then x and y of the centres of c rings, estimated jointly; f = p + 2 c.

    Parameters
    ----------
    field : WallField
    spots : Spots
    centres : sequence of (int, float)
        Ring and height within its course, -1 to 1; the centre of a leaning ring depends on the
        height.

    Attributes
    ----------
    value_m : ndarray, shape (f,)
        Radii about the centre of their level, thus without first harmonic; centres relative to the
        origin of the radii of their ring, m.
    weights : ndarray, shape (f, n)
        Derivative by the readings of the field.
    """

    def __init__(self, field, spots, centres=()):
        self._field, self._spots = field, spots
        self._covariances = field._covariances
        factor, by_columns, normal = field._factors
        free, explained = field._solution
        design = self._design(centres)
        covariance = np.zeros((len(design), len(field.sites)))
        for index, component in enumerate(COMPONENTS):
            if component.shape in field.stated:
                covariance[: len(spots)] += self._site_covariances(index)
        # g = X_g beta + K_g V^-1 (y - X beta), plus the subtracted mean radius of the course.
        self.value_m = design @ free + covariance @ explained
        self.value_m[: len(spots)] += field._mean_m[spots.course]
        with_free = scipy.linalg.cho_solve(normal, (design - covariance @ by_columns).T).T
        covariance += with_free @ field._columns[0].T
        self.weights = scipy.linalg.cho_solve(factor, covariance.T, check_finite=False).T
        if spots.site is not None and np.any(spots.site >= 0):
            self._take_as_read(np.flatnonzero(spots.site >= 0))

    def _take_as_read(self, rows):
        """Replace estimates by readings, less all parameters without prior except the radius."""
        field, sites = self._field, self._spots.site[rows]
        factor, _, normal = field._factors
        design, radii = field._columns
        # Keep only centre and shared unknowns: the reading less these is the radius at the place.
        others = design[sites].copy()
        others[np.arange(len(rows)), radii[field.sites.course[sites]]] = 0.0
        by_parameters = scipy.linalg.cho_solve(normal, others.T).T @ design.T
        self.value_m[rows] = field.radius_m[sites] - others @ field._solution[0]
        self.weights[rows] = -scipy.linalg.cho_solve(factor, by_parameters.T, check_finite=False).T
        self.weights[rows, sites] += 1.0

    def undetermined_variances(self, rows):
        """Return variances of sums of the values due to the undetermined part of each component.

        Parameters
        ----------
        rows : scipy.sparse.csr_array, shape (r, f)
            Coefficients of the sums, each with few places: only covariances between these are
            computed.

        Returns
        -------
        ndarray, shape (components, r)
            Variances of the errors, m2.
        """
        weights, of_places = rows @ self.weights, rows[:, : len(self._spots)]
        places = np.unique(of_places.indices)
        row, first, second, product = _enumerate_pairs(of_places)
        correlations = self._correlate_places(first, second)
        variances = np.empty((len(COMPONENTS), len(weights)))
        sizes = self._field.amplitudes.variances_m2
        for index, size in enumerate(sizes):
            covariance = of_places[:, places] @ self._site_covariances(index, places)
            # Diagonal of A K A' - 2 K_g A' + K_gg, term by term.
            variances[index] = size * self._covariances.spread_alone(weights, index)
            variances[index] -= 2 * np.einsum("rn,rn->r", weights, covariance)
            prior_variance = (
                size * product * self._pair_covariances(index, first, second, correlations)
            )
            variances[index] += np.bincount(row, prior_variance, len(weights))
        return variances

    def _design(self, centres):
        """Return the derivative (f, p) by the parameters without prior."""
        sites = self._field.sites
        design, radii = self._field._columns
        derivative = np.zeros((len(self._spots) + 2 * len(centres), design.shape[1]))
        derivative[np.arange(len(self._spots)), radii[self._spots.course]] = 1.0
        for row, (ring, zeta) in enumerate(centres):
            course = sites.course[sites.ring == ring][0]
            rings_of_course = sites.ring[sites.course == course]
            column = radii[course] + 1
            for number in np.unique(rings_of_course[rings_of_course >= 0]):
                leans = bool(np.any(sites.leans[sites.ring == number]))
                if number == ring:
                    rows = len(self._spots) + 2 * row + np.arange(2)
                    derivative[rows, column + np.arange(2)] = 1.0
                    if leans:
                        derivative[rows, column + 2 + np.arange(2)] = zeta
                # Columns of a ring: x and y of the centre, and of its lean if the ring is not
                # level.
                column += 4 if leans else 2
        return derivative

    def _site_covariances(self, index, places=slice(None)):
        """Return the covariance (p, n) of places with a component at the sites, m2."""
        component, spots, sites = COMPONENTS[index], self._spots, self._field.sites
        size = self._field.amplitudes.variances_m2[index]
        if component.shape == "weld":
            return size * self._peaks[index][places] @ self._covariances.peaks[index].T
        covariance = self._along[component.shape][places] * component.height_covariance(
            self._heights[places], sites.heights
        )
        if not component.common:
            covariance = covariance * (spots.course[places, None] == sites.course)
        return size * covariance

    def _correlate_places(self, first, second):
        """Return {shape: c (k,) between places (k,) and others}."""
        azimuth = self._spots.azimuth_rad
        correlations = {
            shape: np.sum(waves[first] * waves[second], axis=1)
            for shape, waves in wave_columns(azimuth).items()
        }
        difference = azimuth[first] - azimuth[second]
        return correlations | {
            "mean": 1.0,
            "seam": seam_correlation(difference, self._field.nominal_m),
        }

    def _pair_covariances(self, index, first, second, around):
        """Return the covariance (k,) between pairs of places due to a unit component."""
        component, spots = COMPONENTS[index], self._spots
        if component.shape == "weld":
            return np.sum(self._peaks[index][first] * self._peaks[index][second], axis=1)
        heights = self._heights
        covariance = around[component.shape] * component.height_between(
            heights[first], heights[second]
        )
        if not component.common:
            covariance = covariance * (spots.course[first] == spots.course[second])
        return covariance

    @cached_property
    def _heights(self):
        return self._field.sites.heights_at(self._spots.course, self._spots.zeta)

    @cached_property
    def _along(self):
        """{shape: c (p, n) between the places and the sites}."""
        correlations = azimuth_correlations(
            self._spots.azimuth_rad, self._covariances.azimuths_rad, self._field.nominal_m
        )
        expand = self._covariances.columns_at_sites
        return {shape: expand(columns) for shape, columns in correlations.items()}

    @cached_property
    def _peaks(self):
        """{component: derivative (p, k) of the places by the peaks of welds}."""
        spots, sites, columns = self._spots, self._field.sites, []
        for course in range(len(self._field._members)):
            by_peaks = weld_columns(
                spots.azimuth_rad, sites.welds_of(course), self._field.nominal_m
            )
            columns.append(by_peaks * (spots.course == course)[:, None])
        by_weld = np.hstack(columns)
        return {
            index: by_weld.sum(axis=1, keepdims=True) if component.common else by_weld
            for index, component in enumerate(COMPONENTS)
            if component.shape == "weld"
        }


def _enumerate_pairs(rows):
    """Return all pairs of places in each row of a sparse array (r, p).

    The pairs include both orders, and each place with itself. Returned are the number of the row,
    both places, and the product of their coefficients.
    """
    rows = rows.tocsr()
    count = np.diff(rows.indptr)
    row = np.repeat(np.arange(len(count)), count**2)
    # Number of the pair within its row; its quotient and remainder are the two places.
    pair_number = np.arange(len(row)) - np.repeat(np.cumsum(count**2) - count**2, count**2)
    first, second = (rows.indptr[row] + part for part in np.divmod(pair_number, count[row]))
    return row, rows.indices[first], rows.indices[second], rows.data[first] * rows.data[second]
