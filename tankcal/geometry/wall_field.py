"""The wall of a tank as one random field: its best estimate from what was measured, and its doubt.

With the components of `wall_prior` and their amplitudes the wall is a Gaussian field with free
radius and centre in each course. What was measured, y = X beta + f + noise, gives every linear
functional of the wall g = X_g beta + f_g by the best linear unbiased estimate

    g = A y,   A = (K_g - (K_g V^-1 X - X_g) (X' V^-1 X)^-1 X') V^-1,   V = K + C,

K the covariance of the field at the sites, K_g between functionals and sites, C that of the noise.
The error A y - g consists of A (noise), and of what each component has that the survey did not see,

    variance * (K_gg - A K_g' - K_g A' + A K A').
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from tankcal.geometry.wall_evidence import Amplitudes, Sites, distinct_azimuths, free_of_course
from tankcal.geometry.wall_prior import COMPONENTS, FULL_TURN, azimuth_correlations

GRID_M, FEWEST_OF_GRID = 0.1, 720  # along the arc, and azimuths, of outlines that are integrated


@dataclass(frozen=True)
class WallField:
    """A wall known from radii at sites.

    Attributes
    ----------
    sites : Sites
        Courses count from 0 to courses - 1, and each is measured.
    radius_m : ndarray, shape (n,)
        Distances from the axis of the course, m.
    noise_m2 : ndarray, shape (n, n)
        Covariance of the readings, m2.
    amplitudes : Amplitudes
    nominal_m : float
        Radius of the tank, m.
    levels : ndarray, shape (q,)
        Heights zeta in each course at which outlines are stated.
    """

    sites: Sites
    radius_m: np.ndarray
    noise_m2: np.ndarray
    amplitudes: Amplitudes
    nominal_m: float
    levels: np.ndarray

    @property
    def courses(self):
        """How many there are."""
        return int(self.sites.course.max()) + 1

    @cached_property
    def grid_rad(self):
        """(g,) azimuths of the outlines, even."""
        count = max(FEWEST_OF_GRID, int(np.ceil(FULL_TURN * self.nominal_m / GRID_M)))
        return np.arange(count) * FULL_TURN / count

    @cached_property
    def outlines_m(self):
        """(courses, q, g) the estimated radius at each level of each course."""
        solved = self._explained
        free = free_of_course(self.grid_rad) @ self._free.T  # (g, courses)
        found = np.broadcast_to(free.T[:, None], (self.courses, len(self.levels), len(free))).copy()
        found += self._level_m[:, None, None]
        for i, one in enumerate(COMPONENTS):
            size = self.amplitudes.variances_m2[i]
            along = self._to_grid[one.shape]
            for course, members in enumerate(self._members):
                if not one.is_level:
                    chosen = np.arange(len(solved)) if one.common else members
                    height = one.height_covariance(self.levels, self.sites.zeta[chosen])
                    part = height * solved[chosen]
                    if one.shape == "mean":
                        found[course] += size * part.sum(axis=1)[:, None]
                    else:
                        found[course] += size * part @ along[:, self._place[chosen]].T
                elif not one.common:
                    found[course] += size * along[:, self._place[members]] @ solved[members]
            if one.common and one.shape != "mean":
                sums = np.bincount(self._place, solved, minlength=len(self._azimuths))
                found += size * along @ sums
        return found

    # what follows is computed once

    @cached_property
    def _members(self):
        return [np.flatnonzero(self.sites.course == c) for c in range(self.courses)]

    @cached_property
    def _level_m(self):
        """(courses,) mean radius of the readings: what is taken off before anything."""
        return np.array([self.radius_m[members].mean() for members in self._members])

    @cached_property
    def _distinct(self):
        return distinct_azimuths(self.sites.azimuth_rad)

    @property
    def _place(self):
        return self._distinct[0]

    @property
    def _azimuths(self):
        return self._distinct[1]

    @cached_property
    def _correlations(self):
        return azimuth_correlations(self._azimuths, self._azimuths, self.nominal_m)

    @cached_property
    def _to_grid(self):
        return azimuth_correlations(self.grid_rad, self._azimuths, self.nominal_m)

    @cached_property
    def _columns(self):
        """(n, 3 courses) X."""
        columns = np.zeros((len(self.sites), 3 * self.courses))
        free = free_of_course(self.sites.azimuth_rad)
        for course, members in enumerate(self._members):
            columns[members, 3 * course : 3 * course + 3] = free[members]
        return columns

    def _covariance(self, index):
        """(n, n) of one component at the sites."""
        one, size = COMPONENTS[index], self.amplitudes.variances_m2[index]
        place, zeta = self._place, self.sites.zeta
        if one.common:
            along = self._correlations[one.shape][np.ix_(place, place)]
            return size * along * one.height_covariance(zeta, zeta)
        found = np.zeros((len(place), len(place)))
        for members in self._members:
            along = self._correlations[one.shape][np.ix_(place[members], place[members])]
            height = one.height_covariance(zeta[members], zeta[members])
            found[np.ix_(members, members)] = size * along * height
        return found

    @cached_property
    def _factored(self):
        """Cholesky factor of V, V^-1 X, and that of X' V^-1 X."""
        whole = self.noise_m2 + sum(self._covariance(i) for i in range(len(COMPONENTS)))
        factor = scipy.linalg.cho_factor(whole, lower=True, overwrite_a=True, check_finite=False)
        by_columns = scipy.linalg.cho_solve(factor, self._columns, check_finite=False)
        return factor, by_columns, scipy.linalg.cho_factor(self._columns.T @ by_columns)

    @cached_property
    def _free_and_explained(self):
        factor, by_columns, normal = self._factored
        left = self.radius_m - self._level_m[self.sites.course]
        free = scipy.linalg.cho_solve(normal, by_columns.T @ left)
        explained = scipy.linalg.cho_solve(factor, left - self._columns @ free)
        return free.reshape(-1, 3), explained

    @property
    def _free(self):
        """(courses, 3) radius less its level, and centre."""
        return self._free_and_explained[0]

    @property
    def _explained(self):
        """(n,) V^-1 (y - X beta)."""
        return self._free_and_explained[1]

    def moments(self):
        """`Moments`: the first-order change of the products of outlines with the wall."""
        return Moments(self)


class Moments:
    """Products G_ij = 1/2 integral r_i r_j da of the outlines at the levels of each course.

    Their first-order changes, 1/2 integral (r_i dr_j + r_j dr_i) da, are functionals of the wall:
    F = courses q (q + 1) / 2 of them, one course after another, each product once (i <= j).

    Attributes
    ----------
    products_m2 : ndarray, shape (F,)
    weights_m : ndarray, shape (F, n)
        A: derivative by the readings.
    """

    def __init__(self, field):
        self.field = field
        self.pairs = np.triu_indices(len(field.levels))
        step = FULL_TURN / len(field.grid_rad)
        outlines = field.outlines_m
        products = 0.5 * step * outlines @ outlines.transpose(0, 2, 1)
        self.products_m2 = products[:, self.pairs[0], self.pairs[1]].ravel()
        self._weighted = 0.5 * step * outlines  # 1/2 r_i da
        self.weights_m = self._weights()

    def _across(self, index):
        """(F, n) covariance of the functionals with one component at the sites."""
        field, one = self.field, COMPONENTS[index]
        size, first, second = field.amplitudes.variances_m2[index], *self.pairs
        found = np.zeros((field.courses, len(first), len(field.sites)))
        if one.shape == "mean":
            along = self._weighted.sum(axis=2)[:, :, None] * np.ones(len(field.sites))
        else:
            along = (self._weighted @ field._to_grid[one.shape])[:, :, field._place]
        for course, members in enumerate(field._members):
            chosen = np.arange(len(field.sites)) if one.common else members
            height = one.height_covariance(field.levels, field.sites.zeta[chosen])
            moved = along[course][:, chosen]
            found[course][:, chosen] = moved[first] * height[second] + moved[second] * height[first]
        return size * found.reshape(-1, len(field.sites))

    def _within(self, index):
        """(F, F) covariance of the functionals by one component itself."""
        field, one = self.field, COMPONENTS[index]
        size, first, second = field.amplitudes.variances_m2[index], *self.pairs
        outlines = self._weighted.reshape(-1, len(field.grid_rad))
        count, q = field.courses, len(field.levels)
        if one.shape == "mean":
            total = outlines.sum(axis=1)
            along = np.outer(total, total)
        else:
            kernel = azimuth_correlations(field.grid_rad, np.zeros(1), field.nominal_m)[one.shape]
            spectrum = np.fft.rfft(kernel[:, 0]).real
            smooth = np.fft.irfft(np.fft.rfft(outlines) * spectrum, len(field.grid_rad))
            along = smooth @ outlines.T
        along = along.reshape(count, q, count, q)
        height = one.height_covariance(field.levels, field.levels)
        found = np.zeros((count, len(first), count, len(first)))
        for a, b in ((first, second), (second, first)):
            for c, d in ((first, second), (second, first)):
                # r_a dr_b with r_c dr_d
                part = along[:, a][:, :, :, c] * height[np.ix_(b, d)][None, :, None, :]
                found += part
        if not one.common:
            found *= np.eye(count)[:, None, :, None]
        return size * found.reshape(count * len(first), -1)

    def _by_free(self):
        """(F, 3 courses) X_g."""
        field, (first, second) = self.field, self.pairs
        moments = self._weighted @ free_of_course(field.grid_rad)  # (courses, q, 3)
        found = np.zeros((field.courses, len(first), 3 * field.courses))
        for course in range(field.courses):
            own = moments[course][first] + moments[course][second]
            found[course, :, 3 * course : 3 * course + 3] = own
        return found.reshape(-1, 3 * field.courses)

    def _weights(self):
        field = self.field
        factor, by_columns, normal = field._factored
        across = sum(self._across(i) for i in range(len(COMPONENTS)))
        short = self._by_free() - across @ by_columns
        across = across + scipy.linalg.cho_solve(normal, short.T).T @ field._columns.T
        return scipy.linalg.cho_solve(factor, across.T, check_finite=False).T

    def unseen_m4(self, kind):
        """(F, F) covariance of the products by what the survey did not see of the components of a
        kind ("bulge", "ovality", "seams").
        """
        chosen = [i for i, one in enumerate(COMPONENTS) if one.kind == kind]
        return sum(self.unseen_of(i) for i in chosen)

    def unseen_of(self, index):
        """(F, F) covariance of the products by what was not seen of one component."""
        weights = self.weights_m
        seen = weights @ self._across(index).T
        spread = weights @ self.field._covariance(index) @ weights.T
        found = self._within(index) - seen - seen.T + spread
        return (found + found.T) / 2
