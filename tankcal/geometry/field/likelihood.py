"""The restricted likelihood of a wall's readings, by the variances of its components.

Readings y = X beta + sum of components + noise; X the radius of each course, and the centre of each
ring of points. With N an orthonormal basis of what X leaves free in a course, N'y is normal with a
covariance B of its own (noise and the components of the course) and E C E' of what is common to
all courses: C is the covariance of the common components' values, at the azimuths that the survey
has and at the heights of the bulge.

Source: Patterson & Thompson 1971 (restricted maximum likelihood).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from tankcal.geometry.field.components import (
    COMPONENTS,
    azimuth_correlations,
    mode_shares,
    weld_columns,
)
from tankcal.geometry.outlines import FULL_TURN

NOISE_MEDIAN_M, NOISE_LOG_SD = 2e-3, 3.0  # of readings without a given standard deviation
LEAST_M, MOST_M = 1e-5, 0.3  # amplitudes that are tried
LEAST_NOISE_M = 1e-6  # what is given as perfect is not quite
SMALLEST = 1e-8  # of a variance: what is left of a covariance that is followed is not quite zero
NEAR_M = 0.02  # along the arc, between azimuths that count as one for the common form
MOST_FOLLOWED = 80  # values of the common form that are followed through all courses
ROUNDING = 1e-11  # of the largest variances, that keeps a covariance positive


@dataclass(frozen=True)
class CourseLikelihood:
    """What one course tells, in the coordinates that radius and centre leave free.

    radius (m,), own (q, m, m) covariances at unit variance: of its own components, of what is
    missed of common ones, and last of the noise where that is estimated; fixed (m, m) the noise
    that is not; values (m, k) derivative of the radii by the values of the common components
    """

    radius: np.ndarray
    own: np.ndarray
    fixed: np.ndarray
    values: np.ndarray


@dataclass(frozen=True)
class Likelihood:
    """What the readings of a wall say of the variances of its components.

    Attributes
    ----------
    courses : tuple of CourseLikelihood
    own, common : ndarray of int, shape (q,) and (p,)
        Component of each covariance of a course, and of each of `spread`.
    spread : ndarray, shape (p, k, k)
        Covariances of the common values at unit variance.
    middle, log_sd : ndarray
        Of the logarithms beforehand.
    """

    courses: tuple
    own: np.ndarray
    common: np.ndarray
    spread: np.ndarray
    middle: np.ndarray
    log_sd: np.ndarray

    @classmethod
    def of(cls, sites, radius_m, noise_m2, nominal_m, estimate_noise):
        common = _common_values(sites, nominal_m)
        courses = tuple(
            _course(sites, radius_m, noise_m2, nominal_m, members, common, estimate_noise)
            for members in sites.members
        )
        _, spread, missed = common
        shared, own = _shown(sites)
        own = own + missed
        middle = 2 * np.log([one.median_m for one in COMPONENTS])
        log_sd = np.array([one.log_sd for one in COMPONENTS])
        if estimate_noise:
            own.append(len(COMPONENTS))
            typical = np.median(np.diag(noise_m2) if np.ndim(noise_m2) == 2 else noise_m2)
            middle = np.append(middle, 2 * np.log(NOISE_MEDIAN_M) - np.log(typical))
            log_sd = np.append(log_sd, NOISE_LOG_SD)
        return cls(courses, np.array(own), np.array(shared), spread, middle, log_sd)

    @property
    def shown(self):
        """Indices of the logarithms that the readings bear on."""
        return np.unique(np.concatenate([self.own, self.common]))

    @property
    def bounds(self):
        """(parameters, 2) of the logarithms."""
        bounds = np.tile([-20.0, 20.0], (len(self.middle), 1))
        bounds[: len(COMPONENTS)] = 2 * np.log([LEAST_M, MOST_M])
        return bounds

    def misfit(self, logs):
        """Doubled negative logarithm of the density but for a constant, and its derivative.

        With B the covariance of a course's own, E its `values`, C that of the common values,
        N = sum E' B^-1 E and r = sum E' B^-1 y,

            S = (C^-1 + N)^-1,  y' V^-1 y = sum y' B^-1 y - r' S r,
            log |V| = sum log |B| + log |I + N C|.
        """
        variances = np.exp(logs)
        before = rounded(np.tensordot(variances[self.common], self.spread, 1))
        told, value, solved = 0.0, 0.0, []
        for course in self.courses:
            covariance = rounded(course.fixed + np.tensordot(variances[self.own], course.own, 1))
            root, inverse = invert(covariance)
            both = np.column_stack([course.values, course.radius])
            across = inverse @ both
            told = told + both.T @ across
            value += 2 * np.sum(np.log(np.diag(root)))
            solved.append((inverse, across))
        normal, right = told[:-1, :-1], told[:-1, -1]
        half = np.linalg.cholesky(before)
        root, inverse = invert(np.eye(len(half)) + half.T @ normal @ half)
        spread = half @ inverse @ half.T
        common = spread @ right
        value += told[-1, -1] - right @ common + 2 * np.sum(np.log(np.diag(root)))
        slopes = np.zeros(len(logs))
        for course, (inverse, across) in zip(self.courses, solved, strict=True):
            left = across[:, -1] - across[:, :-1] @ common
            outer = inverse - across[:, :-1] @ spread @ across[:, :-1].T
            outer -= np.outer(left, left)
            np.add.at(slopes, self.own, np.tensordot(course.own, outer, 2))
        left = right - normal @ common
        outer = normal - normal @ spread @ normal - np.outer(left, left)
        np.add.at(slopes, self.common, np.tensordot(self.spread, outer, 2))
        slopes *= variances
        away = (logs - self.middle) / self.log_sd
        return value + away @ away, slopes + 2 * away / self.log_sd


def rounded(covariance):
    """The covariance, positive in spite of rounding."""
    covariance.flat[:: len(covariance) + 1] *= 1 + ROUNDING
    return covariance


def invert(covariance):
    """Cholesky factor and inverse of a covariance."""
    root = np.linalg.cholesky(covariance)
    if not len(root):  # of a course whose radius and centres leave nothing free
        return root, root
    inverse = scipy.linalg.lapack.dpotri(root, lower=True)[0]
    whole = inverse + inverse.T  # the upper half of `root` is zero, and of its inverse
    whole.flat[:: len(whole) + 1] /= 2
    return root, whole


def _shown(sites):
    """Indices of the common components and of those of each course: of welds where any is known."""
    used = [i for i, one in enumerate(COMPONENTS) if sites.welds_rad or one.shape != "weld"]
    return [i for i in used if COMPONENTS[i].common], [i for i in used if not COMPONENTS[i].common]


def _common_values(sites, nominal_m):
    """(n, k) derivative of the radii by the values of the common components, (p, k, k) covariances
    of these, and a list of the components that they miss a part of.

    Values are those at the azimuths that the survey has, or, where these are many, the cosines and
    sines of the first modes: the rest of the seams is then taken as each course's own. Last come
    the values of the heights, and the peak of all welds.
    """
    common = [(i, COMPONENTS[i]) for i in _shown(sites)[0]]
    welds = np.zeros((len(sites), 1))
    for members, there in zip(sites.members, sites.welds_at(nominal_m), strict=True):
        welds[members, 0] = there.sum(axis=1)
    values = {
        row: welds if one.shape == "weld" else one.height_columns(sites.zeta)
        for row, (_, one) in enumerate(common)
        if one.shape in ("mean", "weld")
    }
    place, azimuths = _gathered(sites.azimuth_rad, NEAR_M / nominal_m)
    away = np.abs(np.angle(np.exp(1j * (sites.azimuth_rad - azimuths[place])))).max()
    missed = []
    if len(azimuths) <= MOST_FOLLOWED and away <= NEAR_M / nominal_m:
        around = np.eye(len(azimuths))[place]
        along = azimuth_correlations(azimuths, azimuths, nominal_m)
    else:
        modes = np.arange(2.0, MOST_FOLLOWED // 2 + 2)
        angles = np.outer(sites.azimuth_rad, modes)
        around = np.hstack([np.cos(angles), np.sin(angles)])
        along = {
            shape: np.diag(np.tile(share, 2))
            for shape, share in mode_shares(modes, nominal_m).items()
        }
        missed = [i for i, one in common if one.shape == "seam"]
    columns = np.hstack([around, *values.values()])
    spread, used = np.zeros((len(common), columns.shape[1], columns.shape[1])), around.shape[1]
    for row, (_, one) in enumerate(common):
        if row in values:
            width = values[row].shape[1]
            spread[row, used : used + width, used : used + width] = np.eye(width)
            used += width
        else:
            spread[row, : around.shape[1], : around.shape[1]] = along[one.shape]
    return columns, spread, missed


def _gathered(azimuth_rad, near_rad):
    """(n,) place of each azimuth among the means of those that follow each other that near."""
    order = np.argsort(azimuth_rad % FULL_TURN)
    around = (azimuth_rad % FULL_TURN)[order]
    gap = np.diff(around, prepend=around[-1] - FULL_TURN)
    start = int(np.argmax(gap))
    around = np.roll(around, -start)
    around[len(around) - start :] += FULL_TURN
    group = np.cumsum(np.roll(gap, -start) > near_rad) - 1
    means = np.bincount(group, around) / np.bincount(group)
    place = np.empty(len(order), dtype=int)
    place[np.roll(order, -start)] = group
    return place, means % FULL_TURN


def _course(sites, radius_m, noise_m2, nominal_m, members, common, estimate_noise):
    columns, spread, missed = common
    common_ones, own_ones = _shown(sites)
    azimuth, zeta = sites.azimuth_rad[members], sites.zeta[members]
    left = scipy.linalg.null_space(sites.free_columns(members).T)

    def seen(covariance):
        return left.T @ covariance @ left

    if np.ndim(noise_m2) == 2:
        noise = noise_m2[np.ix_(members, members)]
    else:
        noise = np.diag(noise_m2[members])
    least = LEAST_NOISE_M**2 * np.eye(left.shape[1])
    there = azimuth_correlations(azimuth, azimuth, nominal_m)
    welds = weld_columns(azimuth, sites.welds_of(sites.course[members[0]]), nominal_m)
    there["weld"] = welds @ welds.T
    own = [
        seen(there[one.shape] * one.height_covariance(zeta, zeta))
        for one in (COMPONENTS[i] for i in own_ones)
    ]
    for i in missed:
        followed = columns[members] @ spread[common_ones.index(i)] @ columns[members].T
        rest = there[COMPONENTS[i].shape] - followed
        own.append(seen(rest) + SMALLEST * np.eye(left.shape[1]))
    own += [seen(noise)] * estimate_noise
    return CourseLikelihood(
        left.T @ radius_m[members],
        np.array(own),
        least + seen(noise) * (not estimate_noise),
        left.T @ columns[members],
    )
