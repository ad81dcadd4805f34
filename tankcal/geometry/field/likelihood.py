"""The restricted likelihood of the readings of a wall, by the variances of its components.

Readings come in parts (courses) y = E c + own components + noise, in coordinates that leave out
what no prior binds: each part has a covariance B of its own, and c are values common to all parts,
of covariance C.

Source: Patterson & Thompson 1971 (restricted maximum likelihood).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from tankcal.geometry.field.search import descend

NOISE_MEDIAN_M, NOISE_LOG_SD = 2e-3, 3.0  # of readings without a given standard deviation
LEAST_M, MOST_M = 1e-5, 0.3  # amplitudes that are tried
MOST_OF_NOISE = 30.0  # logarithms from the middle
LEAST_NOISE_M = 1e-6  # what is given as perfect is not quite
ROUNDING = 1e-11  # of the largest variances, that keeps a covariance positive
MOST_STEPS, SMALL_STEP = 12, 1e-7  # of a logarithm, to the very top
LOG_STEP = 0.1  # of the differences that give the curvature
MIRRORED = 64  # rows at once
NEAR_TOP = 0.02  # of a logarithm: so near the top the curvature is that of the top


@dataclass(frozen=True)
class Part:
    """What one part of the readings tells, in the coordinates that are left.

    Attributes
    ----------
    reading : ndarray, shape (m,)
    own : ndarray, shape (q, m, m)
        Covariances at unit variance.
    fixed : ndarray, shape (m, m)
        What no variance scales.
    values : ndarray, shape (m, k)
        Derivative of the readings by the common values.
    """

    reading: np.ndarray
    own: np.ndarray
    fixed: np.ndarray
    values: np.ndarray

    def inverted(self, variances):
        """Log of the determinant of the part's own covariance, and its inverse, lower half."""
        if not len(self.fixed):  # of a course whose radius and centres leave nothing free
            return 0.0, self.fixed
        place, own, fixed, _ = self._halves
        covariance = np.zeros(self.fixed.shape)
        covariance.ravel()[place] = fixed + variances @ own
        # the transpose of the upper half: the lower one, in columns, as LAPACK has it
        root, wrong = scipy.linalg.lapack.dpotrf(
            rounded(covariance).T, lower=True, clean=False, overwrite_a=True
        )
        if wrong:
            raise np.linalg.LinAlgError("Matrix is not positive definite")
        logarithm = 2 * np.sum(np.log(np.diag(root)))
        return logarithm, scipy.linalg.lapack.dpotri(root, lower=True, overwrite_c=True)[0]

    def shares(self, inverse, less):
        """(q,) traces of the covariances times (inverse - less less'), of `inverted`, used up."""
        if not len(inverse):
            return np.zeros(len(self.own))
        outer = scipy.linalg.blas.dsyrk(
            -1.0, less, beta=1.0, c=inverse, lower=True, overwrite_c=True
        )
        place, own, _, twice = self._halves
        return own @ (twice * outer.T.ravel()[place])

    @cached_property
    def both(self):
        """(m, k + 1) values, and the reading."""
        return np.column_stack([self.values, self.reading])

    @cached_property
    def _halves(self):
        """Places of the upper half in a matrix, own (q, h) and fixed (h,) there, and how often each
        counts: in half the memory a search waits for them half as long.
        """
        place = np.flatnonzero(np.triu(np.ones(self.fixed.shape)))
        twice = np.where(place % (len(self.fixed) + 1) == 0, 1.0, 2.0)
        own = self.own.reshape(len(self.own), -1).take(place, axis=1)
        return place, own, self.fixed.ravel()[place], twice


@dataclass(frozen=True)
class Likelihood:
    """What readings say of variances, whose logarithms are normal beforehand.

    Attributes
    ----------
    parts : tuple of Part
    own, common : ndarray of int, shape (q,) and (p,)
        Variance that scales each covariance of a part, and each of `spread`.
    spread : ndarray, shape (p, k, k)
        Covariances of the common values at unit variance.
    wide : ndarray, shape (k,)
        Variances of the common values that no variance scales: of those that no prior binds.
    middle, log_sd : ndarray, shape (variances,)
        Of the logarithms beforehand.
    bounds : ndarray, shape (variances, 2)
        Of the logarithms.
    """

    parts: tuple
    own: np.ndarray
    common: np.ndarray
    spread: np.ndarray
    wide: np.ndarray
    middle: np.ndarray
    log_sd: np.ndarray
    bounds: np.ndarray

    def misfit(self, logs):
        """Doubled negative logarithm of the density but for a constant, and its derivative.

        With B the covariance of a part's own, E its `values`, C that of the common values,
        N = sum E' B^-1 E and r = sum E' B^-1 y,

            S = (C^-1 + N)^-1,  y' V^-1 y = sum y' B^-1 y - r' S r,
            log |V| = sum log |B| + log |I + N C|.
        """
        variances = np.exp(logs)
        before = np.diag(self.wide) + np.tensordot(variances[self.common], self.spread, 1)
        before = rounded(before)
        told, value, solved = 0.0, 0.0, []
        for part in self.parts:
            logarithm, inverse = part.inverted(variances[self.own])
            across = _times(inverse, part.both)
            told = told + part.both.T @ across
            value += logarithm
            solved.append((inverse, across[:, :-1], across[:, -1]))
        normal, right = told[:-1, :-1], told[:-1, -1]
        half = np.linalg.cholesky(before)
        root = np.linalg.cholesky(np.eye(len(half)) + half.T @ normal @ half)
        spread_root = half
        if len(half):
            spread_root = scipy.linalg.solve_triangular(root, half.T, lower=True).T
        common = spread_root @ (spread_root.T @ right)
        value += told[-1, -1] - right @ common + 2 * np.sum(np.log(np.diag(root)))

        slope, left = np.zeros(len(logs)), right - normal @ common
        by_root = normal @ spread_root
        outer = normal - by_root @ by_root.T - np.outer(left, left)
        np.add.at(slope, self.common, np.tensordot(self.spread, outer, 2))
        for part, (inverse, across, of_reading) in zip(self.parts, solved, strict=True):
            left = of_reading - across @ common
            shares = part.shares(inverse, np.column_stack([across @ spread_root, left]))
            np.add.at(slope, self.own, shares)
        away = (logs - self.middle) / self.log_sd
        return value + away @ away, variances * slope + 2 * away / self.log_sd

    def near_top(self, tolerance):
        """(variances,) logarithms near those of the highest density.

        tolerance  relative change of the misfit that ends the search
        """
        return self._descend(tolerance)[0]

    def top(self, tolerance):
        """Logarithms of the highest density, to their rounding, and their covariance by it."""
        best, slope = self._descend(tolerance)
        for _ in range(2):  # to the very top, so that the order of the readings changes nothing
            covariance = np.linalg.inv(self._curvature(best, slope))
            moved, slope = self._climb(best, slope, covariance)
            best, away = moved, np.abs(moved - best).max()
            if away < NEAR_TOP:
                break
        return best, covariance

    def _descend(self, tolerance):
        return descend(self.misfit, self.middle, self.log_sd, self.bounds, tolerance)

    def _climb(self, best, slope, covariance):
        """Newton's steps with one curvature: where they lead, and the slope there."""
        for _ in range(MOST_STEPS):
            step = np.clip(-covariance @ slope / 2, -LOG_STEP, LOG_STEP)
            best = np.clip(best + step, *self.bounds.T)
            if np.abs(step).max() < SMALL_STEP:
                break
            slope = self.misfit(best)[1]
        return best, slope

    def _curvature(self, best, slope):
        """Of the misfit's half, by differences of its derivative; never below the prior's."""
        curvature = np.diag(self.log_sd**-2.0)  # all there is of what no reading shows
        for one in np.unique(np.concatenate([self.own, self.common])):
            moved = best.copy()
            moved[one] += LOG_STEP
            curvature[one] = (self.misfit(moved)[1] - slope) / (2 * LOG_STEP)
        values, vectors = np.linalg.eigh((curvature + curvature.T) / 2)
        return (vectors * np.maximum(values, 1 / self.log_sd.max() ** 2)) @ vectors.T


def prior_of(components, noise_m2=None):
    """Middle, standard deviations and bounds of the logarithms of variances.

    Parameters
    ----------
    components : sequence
        With `median_m` and `log_sd`.
    noise_m2 : ndarray, optional
        Variances of the readings, where a factor of them is asked, too.
    """
    middle = 2 * np.log([one.median_m for one in components])
    log_sd = np.array([one.log_sd for one in components])
    bounds = np.tile(2 * np.log([LEAST_M, MOST_M]), (len(middle), 1))
    if noise_m2 is None:
        return middle, log_sd, bounds
    noise = 2 * np.log(NOISE_MEDIAN_M) - np.log(np.median(noise_m2))
    bounds = np.vstack([bounds, noise + MOST_OF_NOISE * np.array([-1.0, 1.0])])
    return np.append(middle, noise), np.append(log_sd, NOISE_LOG_SD), bounds


def rounded(covariance):
    """The covariance, positive in spite of rounding."""
    covariance.flat[:: len(covariance) + 1] *= 1 + ROUNDING
    return covariance


def _times(inverse, columns):
    """Product with a symmetric matrix of which the lower half is filled."""
    if not len(inverse):
        return np.zeros(columns.shape)
    return scipy.linalg.blas.dsymm(1.0, inverse, columns, lower=True)


def invert(covariance):
    """Cholesky factor and inverse of a covariance."""
    root = np.linalg.cholesky(covariance)
    if not len(root):  # of a course whose radius and centres leave nothing free
        return root, root
    whole = scipy.linalg.lapack.dpotri(root.T, lower=False)[0].T  # its lower half, by rows
    for start in range(0, len(whole), MIRRORED):
        stop = start + MIRRORED
        corner = np.tril(whole[start:stop, start:stop])
        whole[start:stop, start:stop] = corner + np.tril(corner, -1).T
        whole[:start, start:stop] = whole[start:stop, :start].T
    return root, whole
