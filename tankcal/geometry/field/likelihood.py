"""The restricted likelihood of the readings of a wall, by the variances of its components.

Readings come in parts (courses) y = E c + own components + noise, in coordinates that leave out
what no prior binds: each part has a covariance B of its own, and c are values common to all parts,
of covariance C.

Source: Patterson & Thompson 1971 (restricted maximum likelihood).
"""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import scipy.linalg

from tankcal.geometry.field.misfit import Misfit, rounded
from tankcal.geometry.field.search import descend, improved

NOISE_MEDIAN_M, NOISE_LOG_SD = 2e-3, 3.0  # of readings without a given standard deviation
LEAST_M, MOST_M = 1e-5, 0.3  # amplitudes that are tried
MOST_OF_NOISE = 30.0  # logarithms from the middle
LEAST_NOISE_M = 1e-6  # what is given as perfect is not quite
ROUGH = 3e-6  # relative change of the misfit that ends a search for what is near the top
FAR = 150.0  # descent that a place still promises, fourfold, that is not near the top
MOST_STEPS, LOG_STEP = 60, 0.7  # on to the very top; of a logarithm at once
SMALL_STEP, ROUGH_STEP = 1e-7, 0.03  # of a logarithm, that end a search
MIRRORED = 64  # rows at once
NEAR_TOP = 1e-4  # of a logarithm: so near the top a change of the value is rounding
AT_TOP = 1e-6  # of a logarithm: so near the top the curvature is that of the top


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
        """Log of the determinant of the part's own covariance, and its inverse, upper half."""
        if not len(self.fixed):  # of a course whose radius and centres leave nothing free
            return 0.0, self.fixed
        place, own, fixed, _ = self._halves
        covariance = np.zeros(self.fixed.shape)
        covariance.ravel()[place] = fixed + variances @ own
        # the transpose of the lower half: the upper one, in columns, as LAPACK has it
        root, wrong = scipy.linalg.lapack.dpotrf(
            rounded(covariance).T, clean=False, overwrite_a=True
        )
        if wrong:
            raise np.linalg.LinAlgError("Matrix is not positive definite")
        logarithm = 2 * np.sum(np.log(np.diag(root)))
        return logarithm, scipy.linalg.lapack.dpotri(root, overwrite_c=True)[0]

    def traces(self, precision):
        """(q,) traces of the covariances times a symmetric matrix (m, m), upper half."""
        if not len(precision):
            return np.zeros(len(self.own))
        place, own, _, twice = self._halves
        return own @ (twice * precision.T.ravel()[place])

    @cached_property
    def both(self):
        """(m, k + 1) values, and the reading."""
        return np.column_stack([self.values, self.reading])

    @cached_property
    def _halves(self):
        """Places of the lower half in a matrix, own (q, h) and fixed (h,) there, and how often each
        counts: in half the memory a search waits for them half as long.
        """
        place = np.flatnonzero(np.tril(np.ones(self.fixed.shape)))
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
    middle : ndarray, shape (variances,)
        Of the logarithms beforehand.
    before : ndarray, shape (variances, variances)
        Covariance of the logarithms beforehand.
    bounds : ndarray, shape (variances, 2)
        Of the logarithms.
    """

    parts: tuple
    own: np.ndarray
    common: np.ndarray
    spread: np.ndarray
    wide: np.ndarray
    middle: np.ndarray
    before: np.ndarray
    bounds: np.ndarray

    @cached_property
    def log_sd(self):
        """(variances,) standard deviations of the logarithms beforehand."""
        return np.sqrt(np.diag(self.before))

    @cached_property
    def precision(self):
        """(variances, variances) inverse of their covariance beforehand."""
        return np.linalg.inv(self.before)

    def misfit(self, logs):
        """Doubled negative logarithm of the density but for a constant, and its derivative."""
        there = Misfit(self, logs)
        return there.value, there.slope

    def near_top(self, start=None):
        """(variances,) logarithms near those of the highest density.

        start  (variances,) that may be near them, too
        """
        if start is not None:
            return self.top(start, ROUGH_STEP)[0]
        return descend(partial(Misfit, self), self.middle, self.log_sd, self.bounds, ROUGH)[0]

    def top(self, start=None, least_step=SMALL_STEP):
        """Logarithms of the highest density, and their covariance by the curvature there.

        start       (variances,) near them; None, or it is not near: they are looked for
        least_step  that ends the search; the least: the order of the readings changes nothing
        """
        best = self.near_top() if start is None else start
        there = Misfit(self, best)
        inverse = self._inverse(there.average_curvature)
        if start is not None and 2 * there.slope @ inverse @ there.slope > FAR:
            return self.top(None, least_step)
        taken_at, reach, longest = np.full(len(best), np.inf), LOG_STEP, np.inf
        for _ in range(MOST_STEPS):
            step = -inverse @ there.slope
            step *= reach / max(np.abs(step).max(), reach)
            moved = np.clip(best + step, *self.bounds.T)
            before, longest = longest, np.abs(moved - best).max()
            if longest < least_step:
                break
            further = Misfit(self, moved)
            if longest > NEAR_TOP and further.value > there.value:
                reach = longest / 4
                continue
            inverse = improved(inverse, moved - best, further.slope - there.slope)
            best, there, reach = moved, further, min(2 * reach, LOG_STEP)
            ends = longest < AT_TOP or longest > before / 2
            if ends and np.abs(best - taken_at).max() > AT_TOP:
                taken_at, inverse = best, self._inverse(there.curvature)
                covariance = 2 * inverse
        if np.abs(best - taken_at).max() > AT_TOP:
            covariance = 2 * self._inverse(there.curvature)
        return best, covariance

    def _inverse(self, curvature):
        """Of a curvature of the misfit, that is never below the prior's."""
        values, vectors = np.linalg.eigh(curvature)
        least = 2 / np.linalg.eigvalsh(self.before)[-1]
        return (vectors / np.maximum(values, least)) @ vectors.T


def prior_of(components, before=None, noise_m2=None):
    """Middle, covariance and bounds of the logarithms of variances.

    Parameters
    ----------
    components : sequence
        With `median_m` and `log_sd`.
    before : ndarray, shape (components, components), optional
        Covariance of the logarithms; without it each is independent of the others.
    noise_m2 : ndarray, optional
        Variances of the readings, where a factor of them is asked, too.
    """
    middle = 2 * np.log([one.median_m for one in components])
    if before is None:
        before = np.diag([one.log_sd**2 for one in components])
    bounds = np.tile(2 * np.log([LEAST_M, MOST_M]), (len(middle), 1))
    if noise_m2 is None:
        return middle, before, bounds
    noise = 2 * np.log(NOISE_MEDIAN_M) - np.log(np.median(noise_m2))
    bounds = np.vstack([bounds, noise + MOST_OF_NOISE * np.array([-1.0, 1.0])])
    before = scipy.linalg.block_diag(before, NOISE_LOG_SD**2)
    return np.append(middle, noise), before, bounds


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
