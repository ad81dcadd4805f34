"""Restricted likelihood of the readings of a wall as a function of the component variances.

The readings form parts (courses) y = E c + own components + noise, in coordinates from which the
parameters without prior are eliminated. Each part has a covariance B of its own. The values c are
common to all parts and have the covariance C.

Source: Patterson & Thompson 1971 (restricted maximum likelihood).
"""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import scipy.linalg

from tankcal.geometry.field.misfit import Misfit, rounded
from tankcal.geometry.field.search import descend, improved

NOISE_MEDIAN_M, NOISE_LOG_SD = 2e-3, 3.0  # prior of the noise without a given standard deviation
LEAST_M, MOST_M = 1e-5, 0.3  # bounds of the amplitudes
MOST_OF_NOISE = 30.0  # bounds of the log noise factor about its prior median
LEAST_NOISE_M = 1e-6  # lower bound of the noise: keeps the covariance of perfect readings regular
ROUGH = 3e-6  # relative change of the misfit that ends the first search
FAR = 150.0  # four times the predicted descent above which a start is too far from the maximum
MOST_STEPS, LOG_STEP = 60, 0.7  # of the refinement: most steps, and longest step of a logarithm
SMALL_STEP, ROUGH_STEP = 1e-7, 0.03  # step of a logarithm that ends a fine or a rough search
MIRRORED = 64  # rows in a block of the mirroring
NEAR_TOP = 1e-4  # step of a logarithm below which a change of the misfit is rounding
AT_TOP = 1e-6  # step of a logarithm below which the curvature remains that of the maximum


@dataclass(frozen=True)
class Part:
    """Part of the readings, in coordinates without the parameters that have no prior.

    Attributes
    ----------
    reading : ndarray, shape (m,)
    own : ndarray, shape (q, m, m)
        Covariances of the own components at unit variance.
    fixed : ndarray, shape (m, m)
        Covariance that no estimated variance scales.
    values : ndarray, shape (m, k)
        Derivative of the readings by the common values.
    """

    reading: np.ndarray
    own: np.ndarray
    fixed: np.ndarray
    values: np.ndarray

    def inverted(self, variances):
        """Return the log determinant of the covariance B, and the upper half of its inverse."""
        if not len(self.fixed):  # radius and centres of the course use up all its readings
            return 0.0, self.fixed
        place, own, fixed, _ = self._halves
        covariance = np.zeros(self.fixed.shape)
        covariance.ravel()[place] = fixed + variances @ own
        # The transposed lower half is the upper half in the column order of LAPACK.
        root, info = scipy.linalg.lapack.dpotrf(
            rounded(covariance).T, clean=False, overwrite_a=True
        )
        if info:
            raise np.linalg.LinAlgError("Matrix is not positive definite")
        logarithm = 2 * np.sum(np.log(np.diag(root)))
        return logarithm, scipy.linalg.lapack.dpotri(root, overwrite_c=True)[0]

    def traces(self, precision):
        """Return traces (q,) of the covariances times a symmetric matrix (m, m), upper half."""
        if not len(precision):
            return np.zeros(len(self.own))
        place, own, _, multiplicity = self._halves
        return own @ (multiplicity * precision.T.ravel()[place])

    @cached_property
    def both(self):
        """Values and reading as columns, shape (m, k + 1)."""
        return np.column_stack([self.values, self.reading])

    @cached_property
    def _halves(self):
        """Indices of the lower half of a matrix; `own` (q, h), `fixed` (h,), multiplicities.

        Half the memory halves the time of a search. Off-diagonal elements count twice.
        """
        place = np.flatnonzero(np.tril(np.ones(self.fixed.shape)))
        multiplicity = np.where(place % (len(self.fixed) + 1) == 0, 1.0, 2.0)
        own = self.own.reshape(len(self.own), -1).take(place, axis=1)
        return place, own, self.fixed.ravel()[place], multiplicity


@dataclass(frozen=True)
class Likelihood:
    """Likelihood of the logarithms of variances, with a normal prior.

    Attributes
    ----------
    parts : tuple of Part
    own, common : ndarray of int, shape (q,) and (p,)
        Index of the variance that scales each covariance of a part, and each of `spread`.
    spread : ndarray, shape (p, k, k)
        Covariances of the common values at unit variance.
    wide : ndarray, shape (k,)
        Fixed variances of the common values, for shared unknowns without prior.
    middle : ndarray, shape (variances,)
        Prior medians of the logarithms.
    before : ndarray, shape (variances, variances)
        Prior covariance of the logarithms.
    bounds : ndarray, shape (variances, 2)
        Bounds of the logarithms.
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
        """Prior standard deviations (variances,) of the logarithms."""
        return np.sqrt(np.diag(self.before))

    @cached_property
    def precision(self):
        """Inverse (variances, variances) of the prior covariance of the logarithms."""
        return np.linalg.inv(self.before)

    def misfit(self, logs):
        """Return minus twice the log density up to a constant, and its derivative."""
        misfit_at_logs = Misfit(self, logs)
        return misfit_at_logs.value, misfit_at_logs.slope

    def near_top(self, start=None):
        """Return logarithms (variances,) near the maximum of the density.

        start  (variances,) start values; None: the prior medians
        """
        if start is not None:
            return self.top(start, ROUGH_STEP)[0]
        return descend(partial(Misfit, self), self.middle, self.log_sd, self.bounds, ROUGH)[0]

    def top(self, start=None, least_step=SMALL_STEP):
        """Return the logarithms of the highest density, and their covariance.

        Parameters
        ----------
        start : ndarray, shape (variances,), optional
            Start values. Without them, or if they are far from the maximum, a first search finds
            them.
        least_step : float
            Step that ends the search. With the default, the result does not depend on the order of
            the readings.

        Returns
        -------
        best : ndarray, shape (variances,)
        covariance : ndarray, shape (variances, variances)
        """
        best = self.near_top() if start is None else start
        current = Misfit(self, best)
        inverse = self._inverse(current.average_curvature)
        if start is not None and 2 * current.slope @ inverse @ current.slope > FAR:
            return self.top(None, least_step)
        taken_at, reach, length = np.full(len(best), np.inf), LOG_STEP, np.inf
        for _ in range(MOST_STEPS):
            step = -inverse @ current.slope
            # Trust region: no logarithm changes by more than `reach`.
            step *= reach / max(np.abs(step).max(), reach)
            candidate_logs = np.clip(best + step, *self.bounds.T)
            previous_length, length = length, np.abs(candidate_logs - best).max()
            if length < least_step:
                break
            candidate = Misfit(self, candidate_logs)
            # The misfit increased: try again with a quarter of the step.
            if length > NEAR_TOP and candidate.value > current.value:
                reach = length / 4
                continue
            inverse = improved(inverse, candidate_logs - best, candidate.slope - current.slope)
            best, current, reach = candidate_logs, candidate, min(2 * reach, LOG_STEP)
            # At convergence or slow progress, replace the updated curvature by the exact one.
            refresh = length < AT_TOP or length > previous_length / 2
            if refresh and np.abs(best - taken_at).max() > AT_TOP:
                taken_at, inverse = best, self._inverse(current.curvature)
                covariance = 2 * inverse
        if np.abs(best - taken_at).max() > AT_TOP:
            covariance = 2 * self._inverse(current.curvature)
        return best, covariance

    def _inverse(self, curvature):
        """Return the inverse of a curvature of the misfit, bounded by that of the prior."""
        values, vectors = np.linalg.eigh(curvature)
        # The data never reduce the information: eigenvalues below the prior's are numerical or
        # indefinite.
        least_curvature = 2 / np.linalg.eigvalsh(self.before)[-1]
        return (vectors / np.maximum(values, least_curvature)) @ vectors.T


def prior_of(components, before=None, noise_m2=None):
    """Return prior medians, covariance and bounds of the logarithms of variances.

    Parameters
    ----------
    components : sequence
        Objects with `median_m` and `log_sd`.
    before : ndarray, shape (components, components), optional
        Covariance of the logarithms; None: independent logarithms.
    noise_m2 : ndarray, optional
        Variances of the readings, if a factor on them is estimated.

    Returns
    -------
    middle : ndarray, shape (variances,)
    before : ndarray, shape (variances, variances)
    bounds : ndarray, shape (variances, 2)
    """
    middle = 2 * np.log([component.median_m for component in components])
    if before is None:
        before = np.diag([component.log_sd**2 for component in components])
    bounds = np.tile(2 * np.log([LEAST_M, MOST_M]), (len(middle), 1))
    if noise_m2 is None:
        return middle, before, bounds
    # The factor refers to the median of the given variances.
    noise = 2 * np.log(NOISE_MEDIAN_M) - np.log(np.median(noise_m2))
    bounds = np.vstack([bounds, noise + MOST_OF_NOISE * np.array([-1.0, 1.0])])
    before = scipy.linalg.block_diag(before, NOISE_LOG_SD**2)
    return np.append(middle, noise), before, bounds


def invert(covariance):
    """Return the lower Cholesky factor and the inverse of a covariance (n, n)."""
    root = np.linalg.cholesky(covariance)
    if not len(root):  # radius and centres of the course use up all its readings
        return root, root
    inverse = scipy.linalg.lapack.dpotri(root.T, lower=False)[0].T  # lower half, in row order
    # Mirror the lower half block by block, without a second matrix.
    for start in range(0, len(inverse), MIRRORED):
        stop = start + MIRRORED
        corner = np.tril(inverse[start:stop, start:stop])
        inverse[start:stop, start:stop] = corner + np.tril(corner, -1).T
        inverse[:start, start:stop] = inverse[start:stop, :start].T
    return root, inverse
