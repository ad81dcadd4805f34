"""Restricted likelihood of the readings of a wall as a function of the component variances.

The readings form parts (courses) y = E c + own components + noise, in coordinates from which the
parameters without prior are eliminated. Each part has a covariance B of its own. The values c are
common to all parts and have the covariance C. With E the `values` of a part, N = sum E' B^-1 E and
r = sum E' B^-1 y,

    S = (C^-1 + N)^-1,  y' V^-1 y = sum y' B^-1 y - r' S r,  log |V| = sum log |B| + log |I + N C|,

and P = V^-1 has the diagonal blocks B^-1 - U U' and the off-diagonal blocks - U U', with U = B^-1 E
S^(1/2). With K_i the derivative of V by a variance, the first and second derivatives of y' V^-1 y +
log |V| are

    tr(P K_i) - y' P K_i P y,  2 y' P K_i P K_j P y - tr(P K_i P K_j).

The first search for the maximum uses an approximate inverse curvature, improved after each step
(Broyden 1970, Fletcher 1970, Goldfarb 1970, Shanno 1970) and stored as a full matrix. Its start
value is proportional to the reach of each logarithm, not to the square of the reach. Otherwise a
component with a vague prior would take the whole first step, even if another component explains the
wall equally well.

Source: Patterson & Thompson 1971 (restricted maximum likelihood); Gilmour, Thompson & Cullis 1995
(second derivatives); Nocedal & Wright 2006, chapter 6 (search).
"""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import scipy.linalg

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
ROUNDING = 1e-11  # relative increase of the diagonal that keeps a covariance positive definite
MOST_DESCENTS, LONGEST = 200, 2.0  # number of steps; longest change of a logarithm in a step
SHORTEN, SHORTEST = 0.4, 1e-3  # factor on a step that increases the value; shortest fraction
ENOUGH = 1e-4  # least share of the descent predicted by the slope (Armijo condition)
BEGIN = 0.15  # start value of the inverse curvature, relative to the reach


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

    def invert_covariance(self, variances):
        """Return the log determinant of the covariance B, and the upper half of its inverse."""
        if not len(self.fixed):  # radius and centres of the course use up all its readings
            return 0.0, self.fixed
        place, own, fixed, _ = self._halves
        covariance = np.zeros(self.fixed.shape)
        covariance.ravel()[place] = fixed + variances @ own
        # The transposed lower half is the upper half in the column order of LAPACK.
        root, info = scipy.linalg.lapack.dpotrf(
            regularise(covariance).T, clean=False, overwrite_a=True
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
            slope_change = candidate.slope - current.slope
            inverse = update_inverse(inverse, candidate_logs - best, slope_change)
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


class Misfit:
    """Minus twice the log density of a `Likelihood` at given variances, up to a constant.

    Parameters
    ----------
    likelihood : Likelihood
    logs : ndarray, shape (variances,)
        Logarithms of the variances.

    Attributes
    ----------
    value : float
    """

    def __init__(self, likelihood, logs):
        self._likelihood, self._variances = likelihood, np.exp(logs)
        departure = logs - likelihood.middle
        self._by_prior = likelihood.precision @ departure  # half the derivative
        # Covariance C of the common values.
        common_covariance = np.diag(likelihood.wide)
        common_covariance += np.tensordot(self._variances[likelihood.common], likelihood.spread, 1)
        half = np.linalg.cholesky(regularise(common_covariance))
        products, value, self._solved = np.zeros((len(half) + 1,) * 2), 0.0, []
        for part in likelihood.parts:
            logarithm, inverse = part.invert_covariance(self._variances[likelihood.own])
            solved = _times(inverse, part.both)
            products += part.both.T @ solved
            value += logarithm
            self._solved.append((inverse, solved))
        self._normal, right_side = products[:-1, :-1], products[:-1, -1]
        # |I + N C| = |I + L' N L| with C = L L': symmetric, and regular also for singular C.
        root = np.linalg.cholesky(np.eye(len(half)) + half.T @ self._normal @ half)
        self._root = half  # S^(1/2)
        if len(half):
            self._root = scipy.linalg.solve_triangular(root, half.T, lower=True).T
        self._common = self._root @ (self._root.T @ right_side)  # the common values, estimated
        self._pull = right_side - self._normal @ self._common  # E' P y
        value += products[-1, -1] - right_side @ self._common + 2 * np.sum(np.log(np.diag(root)))
        self.value = value + departure @ self._by_prior

    @cached_property
    def slope(self):
        """Derivative (variances,) by the logarithms."""
        return self._variances * self._variance_slopes + 2 * self._by_prior

    @property
    def curvature(self):
        """Second derivative (variances, variances) by the logarithms."""
        return self._convert_to_logs(2 * self._squares() - self._traces())

    @property
    def average_curvature(self):
        """Mean of observed and expected second derivative, without traces: a tenth of the work."""
        return self._convert_to_logs(self._squares())

    def _convert_to_logs(self, by_variances):
        """Convert a second derivative by variances to the logarithms, and add the prior."""
        diagonal = np.diag(self._variances * self._variance_slopes) + 2 * self._likelihood.precision
        return self._variances[:, None] * by_variances * self._variances + diagonal

    @cached_property
    def _parts(self):
        """For each part: its block of P less P y y' P (m, m), upper half, U (m, k) and P y (m,)."""
        parts = []
        for inverse, solved in self._solved:
            factors = solved[:, :-1] @ np.column_stack([self._root, self._common])
            factors[:, -1] = solved[:, -1] - factors[:, -1]
            parts.append((_less(inverse, factors), factors[:, :-1], factors[:, -1]))
        return parts

    @cached_property
    def _variance_slopes(self):
        """Derivative (variances,) by the variances, without the prior."""
        likelihood = self._likelihood
        slopes, by_root = np.zeros(len(self._variances)), self._normal @ self._root
        outer = self._normal - by_root @ by_root.T - np.outer(self._pull, self._pull)
        np.add.at(slopes, likelihood.common, np.tensordot(likelihood.spread, outer, 2))
        for part, (precision, _, _) in zip(likelihood.parts, self._parts, strict=True):
            np.add.at(slopes, likelihood.own, part.traces(precision))
        return slopes

    def _squares(self):
        """Return y' P K_i P K_j P y, shape (variances, variances)."""
        likelihood = self._likelihood
        common = (likelihood.spread @ self._pull).T
        inner_terms, cross_terms = 0.0, 0.0
        for part, (precision, by_root, pull) in zip(likelihood.parts, self._parts, strict=True):
            # K_i P y within the part: own components, then the common values.
            changes = np.column_stack([(part.own @ pull).T, part.values @ common])
            shared, by_pull = by_root.T @ changes, pull @ changes
            inner_terms += changes.T @ _times(precision, changes) + np.outer(by_pull, by_pull)
            inner_terms += shared.T @ shared
            cross_terms += shared
        return self._scatter(inner_terms - cross_terms.T @ cross_terms)

    def _traces(self):
        """Return tr(P K_i P K_j), shape (variances, variances)."""
        likelihood, spread = self._likelihood, self._root @ self._root.T  # S
        projector = np.eye(len(spread)) - spread @ self._normal  # P E = B^-1 E times it
        own, by_common = 0.0, np.zeros((len(likelihood.own), *spread.shape))
        for part, (precision, _, pull), (_, solved) in zip(
            likelihood.parts, self._parts, self._solved, strict=True
        ):
            block = np.triu(precision) + np.triu(precision, 1).T + np.outer(pull, pull)
            by_values = np.tensordot(part.own, solved[:, :-1], 1)
            by_values = np.tensordot(by_values, solved[:, :-1], (1, 0))
            own += _products(part.own, block) - _products(by_values, spread)
            by_common += by_values
        own += _products(by_common, spread)
        mixed = np.tensordot(
            projector.T @ by_common @ projector, likelihood.spread, ((1, 2), (1, 2))
        )
        common = _products(likelihood.spread, self._normal @ projector)
        return self._scatter(np.block([[own, mixed], [mixed.T, common]]))

    def _scatter(self, elements):
        """Sum the elements of covariances of parts and of `spread` that belong to each variance."""
        index = np.concatenate([self._likelihood.own, self._likelihood.common])
        total = np.zeros((len(self._variances),) * 2)
        np.add.at(total, np.ix_(index, index), elements)
        return total


def _products(matrices, other):
    """Return the traces (q, q) of A_i O A_j O for symmetric matrices A (q, m, m) and O."""
    transformed = np.tensordot(matrices, other, 1)
    return np.tensordot(transformed, transformed, ((1, 2), (2, 1)))


def regularise(covariance):
    """Return the covariance, made positive definite in spite of rounding; changed in place."""
    covariance.flat[:: len(covariance) + 1] *= 1 + ROUNDING
    return covariance


def _times(half, columns):
    """Return the product of a symmetric matrix, of which the upper half is filled, and columns."""
    if not len(half):
        return np.zeros(columns.shape)
    return scipy.linalg.blas.dsymm(1.0, half, columns)


def _less(half, columns):
    """Return a symmetric matrix, upper half, less columns @ columns.T; overwrites the matrix."""
    if not len(half):
        return half
    return scipy.linalg.blas.dsyrk(-1.0, columns, beta=1.0, c=half, overwrite_c=True)


def descend(function, start, reach, bounds, tolerance):
    """Return a place near the minimum of a function, and the slope there.

    Parameters
    ----------
    function : callable
        function(x) -> object with `value` and `slope` (n,). The slope is evaluated only at the end
        of a step.
    start, reach : ndarray, shape (n,)
        Start values, and approximate distances of the minimum from them.
    bounds : ndarray, shape (n, 2)
    tolerance : float
        Relative change of the value that ends the search.

    Returns
    -------
    place, slope : ndarray, shape (n,)

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> def bowl(x):
    ...     value, slope = np.sum((x - 1) ** 2 * [1, 9]), 2 * (x - 1) * [1, 9]
    ...     return SimpleNamespace(value=value, slope=slope)
    >>> descend(bowl, np.zeros(2), np.ones(2), np.array([[-5, 5], [-5, 0.5]]), 1e-12)[0].round(6)
    array([1. , 0.5])
    """
    low, high = np.transpose(bounds)
    x, inverse = np.clip(start, low, high), np.diag(BEGIN * np.asarray(reach))
    start_state = function(x)
    value, slope = start_state.value, start_state.slope
    for _ in range(MOST_DESCENTS):
        # Coordinates at a bound stay there as long as the descent points outwards.
        free = ~((x <= low) & (slope > 0) | (x >= high) & (slope < 0))
        step = free * (inverse @ (free * -slope))
        step *= LONGEST / max(np.abs(step).max(initial=0.0), LONGEST)
        fraction = 1.0
        # Backtracking line search along the projected step.
        while True:
            place = np.clip(x + fraction * step, low, high)
            change = place - x
            candidate = function(place)
            new_value = candidate.value
            if new_value <= value + ENOUGH * slope @ change or fraction < SHORTEST:
                break
            fraction *= SHORTEN
        if not new_value < value:
            break
        inverse = update_inverse(inverse, change, candidate.slope - slope)
        gain, x, value, slope = value - new_value, place, new_value, candidate.slope
        if gain < tolerance * max(abs(value), 1.0):
            break
    return x, slope


def update_inverse(inverse, step, slope_change):
    """Return the inverse curvature after a step (BFGS update).

    Parameters
    ----------
    inverse : ndarray, shape (n, n)
        Inverse curvature before the step.
    step : ndarray, shape (n,)
    slope_change : ndarray, shape (n,)
        Change of the slope over the step.

    Returns
    -------
    ndarray, shape (n, n)
    """
    curvature = step @ slope_change
    # No update for negative curvature: the matrix remains positive definite.
    if curvature <= 0.0:
        return inverse
    projector = np.eye(len(step)) - np.outer(step, slope_change) / curvature
    return projector @ inverse @ projector.T + np.outer(step, step) / curvature
