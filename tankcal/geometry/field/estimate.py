"""Wall of a tank as a random field: best estimate from measurements, and values at places.

With the components of `components` and their amplitudes, the wall is a Gaussian field with a free
radius in each course and a free centre of each ring. The measurements y = X beta + f + noise give
the best linear unbiased estimate of every linear functional of the wall, g = X_g beta + f_g,

    g = A y,   A = (K_g - (K_g V^-1 X - X_g) (X' V^-1 X)^-1 X') V^-1,   V = K + C,

with K the covariance of the field at the sites, K_g the covariance between functionals and sites,
and C the covariance of the noise. The error A y - g consists of A (noise) and, for each component,
of the part that the survey does not determine,

    variance * (K_gg - A K_g' - K_g A' + A K A').

Source: Robinson 1991 (best linear unbiased prediction).

Seams between the columns of points
-----------------------------------

The model contains two narrow seams along the whole shell, of depth d, width w and profile cos^2, at
random azimuths. Columns of points at the spacing s measure each seam with the area A = d w / 2
times 1 + q cos phi,

    q = 2 sinc(w / s) / (1 - (w / s)^2),

with phi the position between the columns, so two seams cause an error of standard deviation q A.
For s > w, a seam may be missed completely: q = 1. The readings determine seams that points do meet.

The columns of a course measure that course only. Errors of two courses are equal where their
columns are aligned; otherwise their correlation is that of the responses of both sets of columns to
a seam at a random azimuth.

Wall of known mean radii
------------------------

All other departures of a course (bulge, taper) have the mean 0 over its height, since the measured
radius includes their mean: f - M f, with M the mean over the course. They do not change the volume
at a joint. Between joints they contribute to the uncertainty, with the prior amplitudes of walls
(`components`).

Wall at single places: its radius about the centre of the level, and that centre.

The linear functionals of `estimate`, g = A y, are radii at a course, height and azimuth, and the
coordinates of the centre of a ring, which have no prior. They are estimated jointly, so that common
errors cancel in the difference of two places.

At a site, the best estimate is drawn towards the neighbouring readings. The estimate is correct on
average but biased at a dent: the larger a departure among small ones, the larger its loss. A place
may therefore request the reading itself, y_i less the centre of its ring. The reading is unbiased
whatever the form of the wall, and hardly less certain.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from math import factorial

import numpy as np
import scipy.linalg

from tankcal.geometry.field.amplitudes import Amplitudes, assumed_amplitudes
from tankcal.geometry.field.components import (
    COMPONENTS,
    ROUND_SHAPES,
    azimuth_correlations,
    seam_correlation,
    wave_columns,
    weld_columns,
)
from tankcal.geometry.field.likelihood import LEAST_NOISE_M
from tankcal.geometry.field.sites import Covariances, Sites, clip_to_semidefinite, free_design
from tankcal.quadrature import panels
from tankcal.units import FULL_TURN

LEVELS = 7  # number of Gauss levels of a course, at which its outlines are estimated
SHAPES = ("mean", *ROUND_SHAPES, "weld")
# Grid of the integrals along outlines: largest step along the arc, and least number of azimuths.
GRID_M, FEWEST_OF_GRID = 0.1, 720
DEPTH_M, PART, WIDTH_M = 0.035, 0.0046, 0.8  # seam: depth, at most PART of the radius; width
SAME_RAD = 1e-9  # azimuths with a smaller difference are equal up to rounding
SHORTEST = 12.0  # waves shorter than WIDTH_M / 12 have a response to cos^2 below 1e-7
PER_WAVE = 4  # least number of grid places for each shortest wave: k d <= pi / 4
TERMS = 14  # terms of the series of exp(-i k d): truncation error below 1e-12


@cache
def gauss_heights():
    """Return the heights (LEVELS,) of the outlines within a course, -1 to 1."""
    return 2 * panels([0.0, 1.0], LEVELS)[0] - 1


@dataclass(frozen=True)
class WallField:
    """Wall estimated from radii at sites.

    Attributes
    ----------
    sites : Sites
        n sites.
    radius_m : ndarray, shape (n,)
        Distances from the centre of the ring, m.
    noise_m2 : ndarray, shape (n, n)
        Covariance of the readings, m2.
    amplitudes : Amplitudes
    nominal_m : float
        Radius of the tank, m.
    stated : tuple of str
        Shapes of the components in the estimate; other components contribute only to the
        uncertainty. Without shapes, each course is a cylinder of its mean radius, as in strapping
        standards; with "mean" alone, the wall is a surface of revolution.
    plumbed : int, optional
        Rings from this number on do not refer to the axis but to a plumb line, or to set-ups that
        may move: their centres are not part of an outline.
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
        """Evenly spaced azimuths (g,) of the outlines."""
        count = max(FEWEST_OF_GRID, int(np.ceil(FULL_TURN * self.nominal_m / GRID_M)))
        return np.arange(count) * FULL_TURN / count

    @cached_property
    def outlines_m(self):
        """Estimated radius (courses, LEVELS, g) at each Gauss level of each course, m."""
        return self.outlines_at(gauss_heights())

    def outlines_at(self, zeta):
        """Return the estimated radius (courses, k, g) at heights (k,) of each course, m."""
        zeta = np.asarray(zeta, dtype=float)
        outlines = np.empty((len(self._members), len(zeta), len(self.grid_rad)))
        # Parameters without prior first, then the conditional mean K_g V^-1 (y - X beta) of each
        # shape.
        outlines[:] = self._mean_m[:, None, None] + self._circles[:, None]
        for shape in self._grid_covariances:
            if shape not in self.stated:
                continue
            for course, members in enumerate(self._covariances.runs):
                heights = self.sites.heights_at(course, zeta)
                if (
                    shape == "settled" or course == 0
                ):  # other common shapes are equal in all courses
                    common_part = self._drawn(shape, heights, slice(None), common=True)
                outlines[course] += common_part + self._drawn(shape, heights, members, common=False)
        if "weld" in self.stated:
            for i, at_grid in self.peaks_at_grid.items():
                peaks = self._weighted_residuals @ self._covariances.peaks[i]
                outlines += self.amplitudes.variances_m2[i] * (at_grid @ peaks)[:, None]
        return outlines

    def _drawn(self, shape, heights, members, *, common):
        """Return the conditional mean (k, g or 1) of the components of a shape at `Heights`."""
        site_heights = self.sites.heights[members]
        parts = [
            size * component.height_covariance(heights, site_heights)
            for component, size in zip(COMPONENTS, self.amplitudes.variances_m2, strict=True)
            if (component.shape, component.common) == (shape, common)
        ]
        if not parts:
            return 0.0
        pull = sum(parts) * self._weighted_residuals[members]
        if shape == "mean":
            return pull.sum(axis=1, keepdims=True)
        return pull @ self._covariances.columns_at_sites(self._grid_covariances[shape], members).T

    def functionals(self, gradients_m):
        """Return `Functionals` of the wall: integrals of gradients times the radius.

        Parameters
        ----------
        gradients_m : ndarray, shape (courses, LEVELS, g)
            One functional for each course and level, as a function of the outline there.

        Returns
        -------
        Functionals
        """
        return Functionals(self, FULL_TURN / gradients_m.shape[-1] * gradients_m)

    @cached_property
    def means(self):
        """`Functionals` for the mean radius of each course at each Gauss level."""
        return self.functionals(np.full(self.outlines_m.shape, 1 / FULL_TURN))

    def seen(self, departures_m):
        """Return mean radii (courses, LEVELS) estimated from departures (n,) of the readings, m."""
        return (self.means.weights @ departures_m).reshape(len(self._members), LEVELS)

    @property
    def centres_m(self):
        """{ring: (x, y) of its centre}, for level rings, m."""
        free, starts = self._solution[0], self._columns[1]
        centres = {}
        for start, members in zip(starts, self._members, strict=True):
            rings = np.unique(self.sites.ring[members])
            for place, ring in enumerate(rings[rings >= 0]):
                # The columns of a course are its radius, then x and y of the centre of each ring.
                column = start + 1 + 2 * place
                centres[int(ring)] = free[column : column + 2]
        return centres

    @property
    def shared(self):
        """Estimates (s,) of the unknowns shared by courses, and their covariance (s, s)."""
        free, normal = self._solution[0], self._factors[2]
        count = self.sites.shared.shape[1]
        covariance = scipy.linalg.cho_solve(normal, np.eye(len(free))[:, -count:])
        return free[-count:], covariance[-count:]

    @property
    def shared_by_readings(self):
        """Derivatives (s, n) of the unknowns shared by courses by the readings."""
        _, by_columns, normal = self._factors
        return scipy.linalg.cho_solve(normal, by_columns.T)[-self.sites.shared.shape[1] :]

    # The following quantities are computed once and cached.

    @cached_property
    def _members(self):
        return self._covariances.members

    @cached_property
    def _mean_m(self):
        """Mean radii (courses,) of the readings, which are subtracted to avoid cancellation."""
        return np.array([self.radius_m[members].mean() for members in self._members])

    @cached_property
    def _covariances(self):
        return Covariances(self.sites, self.nominal_m)

    @cached_property
    def _grid_covariances(self):
        """{shape: covariance c (g, azimuths) between the grid and the distinct azimuths}."""
        correlations = azimuth_correlations(
            self.grid_rad, self._covariances.azimuths_rad, self.nominal_m
        )
        for shape in ROUND_SHAPES:  # remove mode 0, and modes that the grid aliases to it
            correlations[shape] -= correlations[shape].mean(axis=0)
        return correlations

    @cached_property
    def peaks_at_grid(self):
        """{component: derivative (courses, g, k) of the outlines by the peaks of welds}."""
        welds = [self.sites.welds_of(course) for course in range(len(self._members))]
        ends = np.cumsum([0, *(len(item) for item in welds)])
        by_weld = np.zeros((len(welds), len(self.grid_rad), ends[-1]))
        for course, azimuths in enumerate(welds):
            columns = weld_columns(self.grid_rad, azimuths, self.nominal_m)
            by_weld[course, :, ends[course] : ends[course + 1]] = columns - columns.mean(axis=0)
        return {
            index: by_weld.sum(axis=2, keepdims=True) if item.common else by_weld
            for index, item in enumerate(COMPONENTS)
            if item.shape == "weld"
        }

    @cached_property
    def _columns(self):
        """Design X (n, p), and the columns (courses,) of the radii."""
        return free_design(self.sites)

    @property
    def covariance_m2(self):
        """Covariance V (n, n) of the readings due to the wall and the noise."""
        covariance = self._covariances.total(self.amplitudes.variances_m2)
        covariance += self.noise_m2
        covariance.flat[:: len(covariance) + 1] += LEAST_NOISE_M**2
        return covariance

    @cached_property
    def _factors(self):
        """Cholesky factor of V, V^-1 X, and Cholesky factor of X' V^-1 X."""
        covariance = (
            self.covariance_m2.T
        )  # symmetric: the transpose is in the column order of LAPACK
        factor = scipy.linalg.cho_factor(
            covariance, lower=True, overwrite_a=True, check_finite=False
        )
        columns = self._columns[0]
        by_columns = scipy.linalg.cho_solve(factor, columns, check_finite=False)
        return factor, by_columns, scipy.linalg.cho_factor(columns.T @ by_columns)

    @cached_property
    def _solution(self):
        """beta (p,) less the mean radii, and V^-1 (y - X beta) (n,)."""
        factor, by_columns, normal = self._factors
        residuals = self.radius_m - self._mean_m[self.sites.course]
        beta = scipy.linalg.cho_solve(normal, by_columns.T @ residuals)
        residuals = residuals - self._columns[0] @ beta
        return beta, scipy.linalg.cho_solve(factor, residuals, check_finite=False)

    @property
    def _weighted_residuals(self):
        """V^-1 (y - X beta), shape (n,)."""
        return self._solution[1]

    @cached_property
    def _circles(self):
        """Free radius less the mean (courses, g), about the mean centre of the rings."""
        free, radii = self._solution[0], self._columns[1]
        turn = np.stack([np.sin(self.grid_rad), np.cos(self.grid_rad)])
        circles, first_plumbed = [], np.inf if self.plumbed is None else self.plumbed
        for start, members in zip(radii, self._members, strict=True):
            ring = self.sites.ring[members]
            members = members[(ring >= 0) & (ring < first_plumbed)]
            if not len(members) or "oval" not in self.stated:
                circles.append(np.full(len(self.grid_rad), free[start]))
                continue
            # A leaning ring has four columns (centre and lean), a level ring two.
            _, leaning = np.unique(self.sites.ring[members], return_index=True)
            widths = np.where(self.sites.leans[members][leaning], 4, 2)
            columns = start + 1 + np.cumsum([0, *widths[:-1]])
            centre = np.mean([free[i : i + 2] for i in columns], axis=0)
            circles.append(free[start] + centre @ turn)
        return np.array(circles)


class Functionals:
    """Estimated linear functionals of a wall, one for each course and Gauss level.

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
        factor, by_columns, normal = field._factors
        self._along = {
            shape: self._along_sites(to_grid)
            for shape, to_grid in field._grid_covariances.items()
            if shape != "mean"
        }
        self._along["mean"] = self._totals[:, :, None] * np.ones(len(field.sites))
        self._across = [self._site_covariance(index) for index in range(len(COMPONENTS))]
        # K_g: components outside the estimate do not enter the weights, only the uncertainty.
        covariance = np.zeros((len(field._members) * LEVELS, len(field.sites)))
        for component, part in zip(COMPONENTS, self._across, strict=True):
            if component.shape in field.stated:
                covariance += part
        columns, radii = field._columns
        free = np.zeros((len(covariance), columns.shape[1]))
        courses = np.repeat(np.arange(len(radii)), LEVELS)
        free[np.arange(len(free)), radii[courses]] = self._totals.ravel()
        remainder = free - covariance @ by_columns
        self.with_free = scipy.linalg.cho_solve(normal, remainder.T).T
        covariance = covariance + self.with_free @ columns.T
        # A = (K_g + (X_g - K_g V^-1 X) (X' V^-1 X)^-1 X') V^-1.
        self.weights = scipy.linalg.cho_solve(factor, covariance.T, check_finite=False).T

    def _along_sites(self, to_grid):
        """Return integrals (courses, LEVELS, n) of gradients times a covariance (g, azimuths)."""
        flat = self._gradients.reshape(-1, len(to_grid)) @ to_grid  # a single matrix product
        flat = self._field._covariances.columns_at_sites(flat)
        return flat.reshape(*self._totals.shape, -1)

    def unseen(self, index):
        """Return the covariance (f, f) due to the undetermined part of a component.

        variance * (K_gg - A K_g' - K_g A' + A K A') of the module docstring.
        """
        cross_term = self.weights @ self._across[index].T
        size = self._field.amplitudes.variances_m2[index]
        spread = size * self._field._covariances.spread(self.weights, index)
        prior = self._prior_covariance(index)
        return clip_to_semidefinite(prior - cross_term - cross_term.T + spread)

    def hidden_seams(self):
        """Return the covariance (f, f) due to seams between the columns of points."""
        sites = self._field.sites
        covariance = hidden_covariance_m2(*sites.seen, self._field.nominal_m)
        has_azimuth = np.isfinite(sites.azimuth_rad)
        # Sum of the weights of each course: a hidden seam changes all readings of a course alike.
        by_course = np.zeros((len(self.weights), len(covariance)))
        np.add.at(by_course, (slice(None), sites.course[has_azimuth]), self.weights[:, has_azimuth])
        return by_course @ covariance @ by_course.T

    def _site_covariance(self, index):
        """Return the covariance (f, n) of the functionals with a component at the sites."""
        field, component = self._field, COMPONENTS[index]
        count, sites = len(field._members), field.sites
        if component.shape == "weld":
            size = field.amplitudes.variances_m2[index]
            return size * self._peak_derivatives(index) @ field._covariances.peaks[index].T
        covariance = np.zeros((count, LEVELS, len(sites)))
        integrals = self._along[component.shape]
        for course, members in enumerate(field._members):
            chosen = slice(None) if component.common else members
            levels = sites.heights_at(course, gauss_heights())
            height = component.height_covariance(levels, sites.heights[chosen])
            covariance[course][:, chosen] = integrals[course][:, chosen] * height
        return field.amplitudes.variances_m2[index] * covariance.reshape(-1, len(sites))

    def _peak_derivatives(self, index):
        """Return the derivative (f, k) of the functionals by the peaks of welds of a component."""
        return (self._gradients @ self._field.peaks_at_grid[index]).reshape(self._totals.size, -1)

    def _prior_covariance(self, index):
        """Return the covariance (f, f) of the functionals due to a component, without readings."""
        field, component = self._field, COMPONENTS[index]
        if component.shape == "weld":
            peaks = self._peak_derivatives(index)
            return field.amplitudes.variances_m2[index] * peaks @ peaks.T
        count = len(field._members)
        integrals = self._along_each_other[component.shape]
        courses = np.repeat(np.arange(count), LEVELS)
        levels = field.sites.heights_at(courses, np.tile(gauss_heights(), count))
        height = component.height_covariance(levels, levels)
        if not component.common:
            height = height * np.equal.outer(courses, courses)
        return field.amplitudes.variances_m2[index] * integrals * height

    @cached_property
    def _along_each_other(self):
        """{shape: covariance (f, f) of the functionals for h = 1}."""
        field, gradients = self._field, self._gradients.reshape(self._totals.size, -1)
        kernels = azimuth_correlations(field.grid_rad, np.zeros(1), field.nominal_m)
        waves, covariances = np.fft.rfft(gradients), {"mean": np.outer(self._totals, self._totals)}
        for shape in ROUND_SHAPES:
            # The covariance is a circular convolution: a product of spectra, without a (g, g)
            # matrix.
            kernel = kernels[shape][:, 0] - kernels[shape][:, 0].mean()
            spectrum = np.fft.rfft(kernel).real
            covariances[shape] = np.fft.irfft(waves * spectrum, gradients.shape[1]) @ gradients.T
        return covariances


def hidden_covariance_m2(course, azimuth_rad, radius_m):
    """Return the covariance of mean radii of courses due to seams between their points.

    Parameters
    ----------
    course : ndarray of int, shape (n,)
        Course of each point: 0, 1, ...
    azimuth_rad : ndarray, shape (n,)
        Azimuths; nan for the mean of a full turn, which misses no seam.
    radius_m : float
        Radius of the tank, m.

    Returns
    -------
    ndarray, shape (courses, courses)
        m2.

    Examples
    --------
    >>> around = np.arange(24) * FULL_TURN / 24
    >>> course = np.repeat([0, 1, 2], 24)
    >>> turned = np.concatenate([around, around, around + FULL_TURN / 48])
    >>> covariance = hidden_covariance_m2(course, turned, 7.5)
    >>> np.round(covariance / covariance[0, 0], 3)
    array([[ 1.   ,  1.   , -0.373],
           [ 1.   ,  1.   , -0.373],
           [-0.373, -0.373,  1.   ]])
    """
    courses = range(int(course.max(initial=-1)) + 1)
    columns = [_find_columns(azimuth_rad[course == item]) for item in courses]
    size = np.array([_error_sd_m(gaps, radius_m) for _, gaps in columns])
    wave = np.arange(1, int(SHORTEST * FULL_TURN * radius_m / WIDTH_M) + 2)
    ratio = wave * WIDTH_M / (FULL_TURN * radius_m)
    responses = np.array([_spectrum(*item, wave) for item in columns]) * _seam_response(ratio)
    # Unit vectors of responses: their scalar products are the correlations of the errors.
    responses /= np.maximum(np.linalg.norm(responses, axis=1, keepdims=True), 1e-30)
    return np.outer(size, size) * (responses @ responses.conj().T).real


def hidden_seams_m(azimuth_rad, radius_m):
    """Return the standard uncertainty of a mean radius due to seams between the points, m.

    Each gap between columns has a weight equal to its share of the turn.

    Parameters
    ----------
    azimuth_rad : ndarray, shape (n,)
        Azimuths of the points of a course.
    radius_m : float
        Radius of the tank, m.

    Examples
    --------
    >>> round(1e3 * hidden_seams_m(np.arange(72) * FULL_TURN / 72, 7.5), 2)
    0.2
    """
    return _error_sd_m(_find_columns(azimuth_rad)[1], radius_m)


def _find_columns(azimuth_rad):
    """Return ascending azimuths of columns, and the gap after each column, rad."""
    turns = np.unique(azimuth_rad[np.isfinite(azimuth_rad)] % FULL_TURN)
    gaps = np.diff(turns, append=turns[:1] + FULL_TURN)
    distinct = gaps > SAME_RAD  # equal up to rounding, also across the end of the turn
    return turns[distinct], gaps[distinct]


def _error_sd_m(gaps, radius_m):
    """Return the standard deviation of the mean radius due to seams, m."""
    if not len(gaps):
        return 0.0
    parts = 2 * _seam_response(np.maximum(WIDTH_M / (radius_m * gaps), 1.0))
    # A seam of area A changes the mean radius by A / (2 pi R).
    area = min(DEPTH_M, PART * radius_m) * WIDTH_M / 2
    return area / (FULL_TURN * radius_m) * float(np.sqrt(parts**2 @ gaps / FULL_TURN))


def _seam_response(ratio):
    """Return the response of the profile cos^2 of width w to a wave of length w / ratio."""
    # The limit at ratio = 1 is finite, but numerator and denominator vanish.
    ratio = np.where(np.abs(ratio - 1) < 1e-9, 1 + 1e-9, ratio)
    return np.sinc(ratio) / (1 - ratio**2)


def _spectrum(turns, gaps, wave):
    """Return the sum (k,) of share exp(-i wave azimuth) over columns, for waves 1, 2, ... (k,).

    The share of a column is the part of the turn for which it is the nearest column. Its azimuth is
    a grid place plus a remainder d, which enters as the series of exp(-i k d). Without the
    remainder, the correlation of two courses would depend on a rotation of the whole survey.
    """
    count = 1 << int(np.ceil(np.log2(PER_WAVE * len(wave))))
    share = (gaps + np.roll(gaps, 1)) / (2 * FULL_TURN)
    place = np.rint(turns / FULL_TURN * count).astype(int)
    remainder = turns - place * FULL_TURN / count
    spectrum = np.zeros(len(wave), dtype=complex)
    for order in reversed(range(TERMS)):  # Horner: sum of (-i k)^m / m! times the m-th moments
        moments = np.bincount(place % count, share * remainder**order / factorial(order), count)
        spectrum = spectrum * (-1j * wave) + np.fft.rfft(moments)[1 : len(wave) + 1]
    return spectrum


@dataclass(frozen=True)
class MeanField:
    """Wall of courses with known mean radii, with the interface of `WallField`.

    Attributes
    ----------
    mean_radius_m : ndarray, shape (courses,)
        m.
    """

    mean_radius_m: np.ndarray
    stated = ()

    @cached_property
    def amplitudes(self):
        """Assumed `Amplitudes` of the wall between the joints."""
        return assumed_amplitudes()

    @cached_property
    def sites(self):
        """`Sites` of full turns at the Gauss levels of each course."""
        courses = len(self.mean_radius_m)
        n = courses * LEVELS
        return Sites(
            course=np.repeat(np.arange(courses), LEVELS),
            ring=np.full(n, -1),
            zeta=np.tile(gauss_heights(), courses),
            azimuth_rad=np.full(n, np.nan),
            leans=np.zeros(n, dtype=bool),
        )

    @cached_property
    def outlines_m(self):
        """Radius (courses, LEVELS, g) at each Gauss level of each course, m."""
        return self.outlines_at(gauss_heights())

    def outlines_at(self, zeta):
        """Return the radius (courses, k, g) at heights (k,) of each course, m."""
        shape = (len(self.mean_radius_m), len(np.atleast_1d(zeta)), FEWEST_OF_GRID)
        return np.broadcast_to(self.mean_radius_m[:, None, None], shape)

    def functionals(self, gradients_m):
        """Return `MeanFunctionals` of the wall: integrals of gradients times the radius.

        gradients_m  (courses, LEVELS, g), as for `WallField.functionals`
        """
        return MeanFunctionals(self, 2 * np.pi * np.mean(gradients_m, axis=2))

    def seen(self, departures_m):
        """Return the mean (courses, LEVELS) of departures (n,) at the sites over each course."""
        means = departures_m.reshape(-1, LEVELS) @ _level_weights()
        return np.repeat(means[:, None], LEVELS, axis=1)


class MeanFunctionals:
    """Linear functionals of a `MeanField`, one for each course and Gauss level.

    Attributes
    ----------
    weights : ndarray, shape (f, courses)
        Derivative by the mean radii.
    """

    def __init__(self, field, totals):
        self._field, self._totals = field, totals
        # A functional depends on the mean radius of its own course only.
        by_course = np.eye(len(totals))[:, None] * totals[:, :, None]
        self.weights = by_course.reshape(-1, len(totals))

    def unseen(self, index):
        """Return the covariance (f, f) due to the part of a component outside the mean."""
        component, size = COMPONENTS[index], self._field.amplitudes.variances_m2[index]
        if component.shape != "mean":  # waves along the perimeter do not change areas
            return np.zeros((self._totals.size, self._totals.size))
        # h of f - M f: (I - M) h (I - M)'.
        about_mean = np.eye(LEVELS) - _level_weights()
        levels = self._field.sites.heights_at(0, gauss_heights())
        height = about_mean @ component.height_covariance(levels, levels) @ about_mean.T
        count, flat = len(self._totals), self._totals.ravel()
        course_correlation = np.ones((count, count)) if component.common else np.eye(count)
        of_heights = np.kron(course_correlation, height)
        return clip_to_semidefinite(size * np.outer(flat, flat) * of_heights)


def _level_weights():
    """Return the Gauss weights (LEVELS,), fractions of the height of a course."""
    return panels([0.0, 1.0], LEVELS)[1]


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
        is_read = np.zeros(len(design), dtype=bool)
        if spots.site is not None:
            is_read[: len(spots)] = spots.site >= 0
        # Only values without a reading are estimated.
        estimated = np.flatnonzero(~is_read)
        places, design = estimated[estimated < len(spots)], design[estimated]
        covariance = np.zeros((len(design), len(field.sites)))
        for index, component in enumerate(COMPONENTS):
            if component.shape in field.stated:
                covariance[: len(places)] += self._site_covariances(index, places)
        # g = X_g beta + K_g V^-1 (y - X beta), plus the subtracted mean radius of the course.
        self.value_m = np.empty(len(is_read))
        self.value_m[estimated] = design @ free + covariance @ explained
        self.value_m[places] += field._mean_m[spots.course[places]]
        with_free = scipy.linalg.cho_solve(normal, (design - covariance @ by_columns).T).T
        covariance += with_free @ field._columns[0].T
        self.weights = np.empty((len(is_read), len(field.sites)))
        self.weights[estimated] = scipy.linalg.cho_solve(factor, covariance.T, check_finite=False).T
        if np.any(is_read):
            self._take_as_read(np.flatnonzero(is_read))

    def _take_as_read(self, rows):
        """Set values to readings, less all parameters without prior except the radius."""
        field, sites = self._field, self._spots.site[rows]
        _, by_columns, normal = field._factors
        design, radii = field._columns
        # Keep only centre and shared unknowns: the reading less these is the radius at the place.
        others = design[sites].copy()
        others[np.arange(len(rows)), radii[field.sites.course[sites]]] = 0.0
        self.value_m[rows] = field.radius_m[sites] - others @ field._solution[0]
        # The parameters are N^-1 (V^-1 X)' y.
        self.weights[rows] = -scipy.linalg.cho_solve(normal, others.T).T @ by_columns.T
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
