"""The wall of a tank as one random field: its best estimate from what was measured, and its doubt.

With the components of `components` and their amplitudes the wall is a Gaussian field with a free
radius in each course and a free centre of each ring. What was measured, y = X beta + f + noise,
gives every linear functional of the wall g = X_g beta + f_g by the best linear unbiased estimate

    g = A y,   A = (K_g - (K_g V^-1 X - X_g) (X' V^-1 X)^-1 X') V^-1,   V = K + C,

K the covariance of the field at the sites, K_g between functionals and sites, C that of the noise.
The error A y - g consists of A (noise), and of what each component has that the survey did not see,

    variance * (K_gg - A K_g' - K_g A' + A K A').

Source: Robinson 1991 (best linear unbiased prediction).
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import scipy.linalg

from tankcal.geometry.field.amplitudes import Amplitudes
from tankcal.geometry.field.components import (
    COMPONENTS,
    ROUND_SHAPES,
    azimuth_correlations,
    weld_columns,
)
from tankcal.geometry.field.covariances import Covariances, without_rounding
from tankcal.geometry.field.hidden_seams import hidden_covariance_m2
from tankcal.geometry.field.likelihood import LEAST_NOISE_M
from tankcal.geometry.field.sites import Sites, free_design
from tankcal.geometry.outlines import FULL_TURN
from tankcal.quadrature import panels

LEVELS = 7  # of a course, at which its outlines are stated: Gauss levels
SHAPES = ("mean", *ROUND_SHAPES, "weld")
GRID_M, FEWEST_OF_GRID = 0.1, 720  # along the arc, and azimuths, of outlines that are integrated


@cache
def gauss_heights():
    """(LEVELS,) heights within a course, -1 to 1, at which outlines are stated."""
    return 2 * panels([0.0, 1.0], LEVELS)[0] - 1


@dataclass(frozen=True)
class WallField:
    """A wall known from radii at sites.

    Attributes
    ----------
    sites : Sites
    radius_m : ndarray, shape (n,)
        Distances from the centre of the ring, m.
    noise_m2 : ndarray, shape (n, n)
        Covariance of the readings, m2.
    amplitudes : Amplitudes
    nominal_m : float
        Radius of the tank, m.
    stated : tuple of str
        Shapes of components that the estimate states; the others are in the doubt alone. Without
        any each course is a cylinder of its mean radius, as standards of strapping have it; with
        "mean" alone a surface of revolution.
    plumbed : int, optional
        Rings from this number on do not stand off the axis, but off a plumb line, or off set-ups
        that may move: where they are is no part of an outline.
    """

    sites: Sites
    radius_m: np.ndarray
    noise_m2: np.ndarray
    amplitudes: Amplitudes
    nominal_m: float
    stated: tuple = SHAPES
    plumbed: int | None = None

    @property
    def grid_rad(self):
        """(g,) azimuths of the outlines, even."""
        count = max(FEWEST_OF_GRID, int(np.ceil(FULL_TURN * self.nominal_m / GRID_M)))
        return np.arange(count) * FULL_TURN / count

    @cached_property
    def outlines_m(self):
        """(courses, LEVELS, g) the estimated radius at each Gauss level of each course."""
        return self.outlines_at(gauss_heights())

    def outlines_at(self, zeta):
        """(courses, k, g) the estimated radius at heights (k,) of each course."""
        zeta = np.asarray(zeta, dtype=float)
        found = np.empty((len(self._members), len(zeta), len(self.grid_rad)))
        found[:] = self._mean_m[:, None, None] + self._circles[:, None]
        for shape in self._to_grid:
            if shape not in self.stated:
                continue
            for course, members in enumerate(self._covariances.runs):
                heights = self.sites.heights_at(course, zeta)
                if shape == "settled" or course == 0:  # the others are alike in all courses
                    alike = self._drawn(shape, heights, slice(None), common=True)
                found[course] += alike + self._drawn(shape, heights, members, common=False)
        if "weld" in self.stated:
            for i, at_grid in self.peaks_at_grid.items():
                peaks = self._explained @ self._covariances.peaks[i]
                found += self.amplitudes.variances_m2[i] * (at_grid @ peaks)[:, None]
        return found

    def _drawn(self, shape, heights, members, *, common):
        """(k, g or 1) what some sites show of the components of one shape at `Heights` (k,)."""
        of_sites = self.sites.heights[members]
        parts = [
            size * one.height_covariance(heights, of_sites)
            for one, size in zip(COMPONENTS, self.amplitudes.variances_m2, strict=True)
            if (one.shape, one.common) == (shape, common)
        ]
        if not parts:
            return 0.0
        pull = sum(parts) * self._explained[members]
        if shape == "mean":
            return pull.sum(axis=1, keepdims=True)
        return pull @ self._covariances.at_sites(self._to_grid[shape], members).T

    def functionals(self, gradients_m):
        """`Functionals` of the wall: each the integral of a gradient times its radius.

        Parameters
        ----------
        gradients_m : ndarray, shape (courses, LEVELS, g)
            One functional for each course and level, of the outline there.

        Returns
        -------
        Functionals
        """
        return Functionals(self, FULL_TURN / gradients_m.shape[-1] * gradients_m)

    @cached_property
    def means(self):
        """`Functionals`: the mean radius of each course at each Gauss level."""
        return self.functionals(np.full(self.outlines_m.shape, 1 / FULL_TURN))

    def seen(self, departures_m):
        """(courses, LEVELS) mean radii that the estimate makes of departures (n,) of the radii."""
        return (self.means.weights @ departures_m).reshape(len(self._members), LEVELS)

    @property
    def centres_m(self):
        """{ring: (x, y) of its centre}, of rings that are level."""
        free, starts = self._solved[0], self._columns[1]
        found = {}
        for start, members in zip(starts, self._members, strict=True):
            rings = np.unique(self.sites.ring[members])
            for place, ring in enumerate(rings[rings >= 0]):
                at = start + 1 + 2 * place
                found[int(ring)] = free[at : at + 2]
        return found

    @property
    def shared(self):
        """(s,) what courses share without a prior, and (s, s) its covariance."""
        free, normal = self._solved[0], self._factored[2]
        count = self.sites.shared.shape[1]
        covariance = scipy.linalg.cho_solve(normal, np.eye(len(free))[:, -count:])
        return free[-count:], covariance[-count:]

    @property
    def shared_by_readings(self):
        """(s, n) derivative of what courses share without a prior by the readings."""
        _, by_columns, normal = self._factored
        return scipy.linalg.cho_solve(normal, by_columns.T)[-self.sites.shared.shape[1] :]

    # what follows is computed once

    @cached_property
    def _members(self):
        return self._covariances.members

    @cached_property
    def _mean_m(self):
        """(courses,) mean radius of the readings: what is taken off before anything."""
        return np.array([self.radius_m[members].mean() for members in self._members])

    @cached_property
    def _covariances(self):
        return Covariances(self.sites, self.nominal_m)

    @cached_property
    def _to_grid(self):
        found = azimuth_correlations(self.grid_rad, self._covariances.azimuths_rad, self.nominal_m)
        for shape in ROUND_SHAPES:  # no mode 0, nor one that the grid takes for it
            found[shape] -= found[shape].mean(axis=0)
        return found

    @cached_property
    def peaks_at_grid(self):
        """{component: (courses, g, k) derivative of the outlines by the peaks of welds}."""
        welds = [self.sites.welds_of(course) for course in range(len(self._members))]
        ends = np.cumsum([0, *(len(one) for one in welds)])
        alone = np.zeros((len(welds), len(self.grid_rad), ends[-1]))
        for course, azimuths in enumerate(welds):
            columns = weld_columns(self.grid_rad, azimuths, self.nominal_m)
            alone[course, :, ends[course] : ends[course + 1]] = columns - columns.mean(axis=0)
        return {
            index: alone.sum(axis=2, keepdims=True) if one.common else alone
            for index, one in enumerate(COMPONENTS)
            if one.shape == "weld"
        }

    @cached_property
    def _columns(self):
        """(n, p) X, and (courses,) which of its columns are the radii."""
        return free_design(self.sites)

    @property
    def covariance_m2(self):
        """(n, n) V: of the readings, by the wall and by their noise."""
        whole = self._covariances.total(self.amplitudes.variances_m2)
        whole += self.noise_m2
        whole.flat[:: len(whole) + 1] += LEAST_NOISE_M**2
        return whole

    @cached_property
    def _factored(self):
        """Cholesky factor of V, V^-1 X, and that of X' V^-1 X."""
        whole = self.covariance_m2.T  # the same, in columns, as LAPACK has it
        factor = scipy.linalg.cho_factor(whole, lower=True, overwrite_a=True, check_finite=False)
        columns = self._columns[0]
        by_columns = scipy.linalg.cho_solve(factor, columns, check_finite=False)
        return factor, by_columns, scipy.linalg.cho_factor(columns.T @ by_columns)

    @cached_property
    def _solved(self):
        """(p,) beta less the mean radii, and (n,) V^-1 (y - X beta)."""
        factor, by_columns, normal = self._factored
        left = self.radius_m - self._mean_m[self.sites.course]
        free = scipy.linalg.cho_solve(normal, by_columns.T @ left)
        left = left - self._columns[0] @ free
        return free, scipy.linalg.cho_solve(factor, left, check_finite=False)

    @property
    def _explained(self):
        return self._solved[1]

    @cached_property
    def _circles(self):
        """(courses, g) the free radius less the mean, about the mean centre of its rings."""
        free, radii = self._solved[0], self._columns[1]
        turn = np.stack([np.sin(self.grid_rad), np.cos(self.grid_rad)])
        found, most = [], np.inf if self.plumbed is None else self.plumbed
        for start, members in zip(radii, self._members, strict=True):
            ring = self.sites.ring[members]
            members = members[(ring >= 0) & (ring < most)]
            if not len(members) or "oval" not in self.stated:
                found.append(np.full(len(self.grid_rad), free[start]))
                continue
            _, leaning = np.unique(self.sites.ring[members], return_index=True)
            widths = np.where(self.sites.leans[members][leaning], 4, 2)
            at = start + 1 + np.cumsum([0, *widths[:-1]])
            centre = np.mean([free[i : i + 2] for i in at], axis=0)
            found.append(free[start] + centre @ turn)
        return np.array(found)


class Functionals:
    """Linear functionals of a wall, one for each course and Gauss level, estimated.

    Attributes
    ----------
    weights : ndarray, shape (f, n)
        A: derivative by the readings.
    with_free : ndarray, shape (f, p)
        Covariance of their errors with those of beta, (X_g - K_g V^-1 X) (X' V^-1 X)^-1.
    """

    def __init__(self, field, gradients):
        self._field, self._gradients = field, gradients
        self._totals = gradients.sum(axis=2)
        factor, by_columns, normal = field._factored
        self._along = {
            shape: self._along_sites(to_grid)
            for shape, to_grid in field._to_grid.items()
            if shape != "mean"
        }
        self._along["mean"] = self._totals[:, :, None] * np.ones(len(field.sites))
        self._across = [self._with_component(index) for index in range(len(COMPONENTS))]
        across = np.zeros((len(field._members) * LEVELS, len(field.sites)))
        for one, part in zip(COMPONENTS, self._across, strict=True):
            if one.shape in field.stated:
                across += part
        columns, radii = field._columns
        free = np.zeros((len(across), columns.shape[1]))
        courses = np.repeat(np.arange(len(radii)), LEVELS)
        free[np.arange(len(free)), radii[courses]] = self._totals.ravel()
        short = free - across @ by_columns
        self.with_free = scipy.linalg.cho_solve(normal, short.T).T
        across = across + self.with_free @ columns.T
        self.weights = scipy.linalg.cho_solve(factor, across.T, check_finite=False).T

    def _along_sites(self, to_grid):
        """(courses, LEVELS, n) integrals of the gradients times a covariance (g, azimuths)."""
        flat = self._gradients.reshape(-1, len(to_grid)) @ to_grid  # in one product
        flat = self._field._covariances.at_sites(flat)
        return flat.reshape(*self._totals.shape, -1)

    def unseen(self, index):
        """(f, f) covariance of the functionals by what was not seen of one component."""
        seen = self.weights @ self._across[index].T
        size = self._field.amplitudes.variances_m2[index]
        spread = size * self._field._covariances.spread(self.weights, index)
        return without_rounding(self._within(index) - seen - seen.T + spread)

    def hidden_seams(self):
        """(f, f) covariance by seams between the columns of points of each course."""
        sites = self._field.sites
        covariance = hidden_covariance_m2(*sites.seen, self._field.nominal_m)
        here = np.isfinite(sites.azimuth_rad)
        of_courses = np.zeros((len(self.weights), len(covariance)))
        np.add.at(of_courses, (slice(None), sites.course[here]), self.weights[:, here])
        return of_courses @ covariance @ of_courses.T

    def _with_component(self, index):
        """(f, n) covariance of the functionals with one component at the sites."""
        field, one = self._field, COMPONENTS[index]
        count, sites = len(field._members), field.sites
        if one.shape == "weld":
            size = field.amplitudes.variances_m2[index]
            return size * self._by_peaks(index) @ field._covariances.peaks[index].T
        found = np.zeros((count, LEVELS, len(sites)))
        along = self._along[one.shape]
        for course, members in enumerate(field._members):
            chosen = slice(None) if one.common else members
            levels = sites.heights_at(course, gauss_heights())
            height = one.height_covariance(levels, sites.heights[chosen])
            found[course][:, chosen] = along[course][:, chosen] * height
        return field.amplitudes.variances_m2[index] * found.reshape(-1, len(sites))

    def _by_peaks(self, index):
        """(f, k) derivative of the functionals by the peaks of welds of one component."""
        return (self._gradients @ self._field.peaks_at_grid[index]).reshape(self._totals.size, -1)

    def _within(self, index):
        """(f, f) covariance of the functionals by one component itself."""
        field, one = self._field, COMPONENTS[index]
        if one.shape == "weld":
            peaks = self._by_peaks(index)
            return field.amplitudes.variances_m2[index] * peaks @ peaks.T
        count = len(field._members)
        along = self._along_each_other[one.shape]
        courses = np.repeat(np.arange(count), LEVELS)
        levels = field.sites.heights_at(courses, np.tile(gauss_heights(), count))
        height = one.height_covariance(levels, levels)
        if not one.common:
            height = height * np.equal.outer(courses, courses)
        return field.amplitudes.variances_m2[index] * along * height

    @cached_property
    def _along_each_other(self):
        """{shape: (f, f) covariance of the functionals by the shape, of all heights the same}."""
        field, gradients = self._field, self._gradients.reshape(self._totals.size, -1)
        kernels = azimuth_correlations(field.grid_rad, np.zeros(1), field.nominal_m)
        waves, found = np.fft.rfft(gradients), {"mean": np.outer(self._totals, self._totals)}
        for shape in ROUND_SHAPES:
            kernel = kernels[shape][:, 0] - kernels[shape][:, 0].mean()
            spectrum = np.fft.rfft(kernel).real
            found[shape] = np.fft.irfft(waves * spectrum, gradients.shape[1]) @ gradients.T
        return found
