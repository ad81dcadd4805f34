"""Adjustment of metered steps: estimates of all causes of their misclosures.

The misclosure y of a step (metered volume less the increment of the geometry) is a sum of causes.
Each cause has a column in m3 for one standard deviation:

    y = A z + F b + N e,      z, e ~ N(0, I),   b free

z are causes with a prior (geometry, meters, runs), b causes without a prior (the volume below the
first dip), e errors of single readings (batches, dips). With R = N N' whitened by W, W R W' = I,
least squares of

    [W A  W F] [z]   [W y]
    [ I    0 ] [b] = [ 0 ]

gives z and b = G y. The orthogonal complement gives the weights M of all tests: for any cause with
the column c (m3 per unit of the cause)

    size = c' M y / c' M c,   sd = 1 / sqrt(c' M c),   w = size / sd.

This is the best linear prediction: G y = A' S^-1 y with S = A A' + R, without inversion of S, so
that a prior may be arbitrarily wide. Source: Koch 1999, Parameter estimation and hypothesis
testing, 3.5; Baarda 1968.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from tankcal.errors import SolutionError
from tankcal.messages import message

UNTOLD = 1e-10  # relative to the largest pivot: a free cause with a smaller pivot is unobserved
UNSEEN = 1e-12  # relative to c' R^-1 c: a cause with a smaller c' M c cannot be tested


@dataclass(frozen=True)
class Effect:
    """Cause of misclosures, or several causes of one kind.

    Attributes
    ----------
    kind : str
    columns : ndarray, shape (n, c)
        Change of the misclosures for one standard deviation of each cause, m3; for a free cause:
        for one unit.
    is_free : bool
        True: no prior.
    """

    kind: str
    columns: np.ndarray
    is_free: bool = False


@dataclass(frozen=True)
class LiquidAdjustment:
    """Result of the adjustment of n steps.

    Attributes
    ----------
    misclosure_m3 : ndarray, shape (n,)
    noise : tuple of Effect
        Errors of the readings: batches, dips, temperatures.
    effects : tuple of Effect
        All other effects, with free effects last.
    gain : ndarray, shape (c, n)
        Estimates of all effects by the misclosures, 1/m3; rows in the order of the effects.
    sd : ndarray, shape (c,)
        Standard deviations of the estimates, in standard deviations of the effects (for a free
        effect: in its unit).
    weight : ndarray, shape (n, n)
        M, 1/m6.
    """

    misclosure_m3: np.ndarray
    noise: tuple[Effect, ...]
    effects: tuple[Effect, ...]
    gain: np.ndarray
    sd: np.ndarray
    weight: np.ndarray

    @cached_property
    def estimate(self):
        """Estimates (c,) of all effects, in the order of `gain`."""
        return self.gain @ self.misclosure_m3

    @cached_property
    def pulled(self):
        """M y, shape (n,)."""
        return self.weight @ self.misclosure_m3

    @property
    def chi2(self):
        """y' M y, chi-square with n less the number of free effects as degrees of freedom."""
        return float(self.misclosure_m3 @ self.pulled)

    @property
    def dof(self):
        """Degrees of freedom of `chi2`."""
        free = sum(effect.columns.shape[1] for effect in self.effects if effect.is_free)
        return len(self.misclosure_m3) - free

    def place(self, kind):
        """Return the slice of the rows of `gain` for the effects of a kind; empty if none."""
        start = 0
        for effect in self.effects:
            end = start + effect.columns.shape[1]
            if effect.kind == kind:
                return slice(start, end)
            start = end
        return slice(0, 0)

    def test(self, columns):
        """Test causes with columns (n, k), each separately, and return (size, sd, w), each (k,).

        size is in the unit of the cause. If the steps cannot determine it, sd is infinite and w is
        0.
        """
        columns = np.asarray(columns, dtype=float)
        information = np.einsum("nk,nm,mk->k", columns, self.weight, columns)
        largest = np.sum(columns**2, axis=0) * np.max(np.diag(self.weight), initial=0.0)
        # c' M c relative to its largest possible value: below, the remainder is rounding.
        is_determined = information > UNSEEN * largest
        divisor = np.where(is_determined, information, 1.0)
        size = np.where(is_determined, columns.T @ self.pulled / divisor, 0.0)
        sd = np.where(is_determined, 1 / np.sqrt(divisor), np.inf)
        return size, sd, np.where(is_determined, size / np.where(is_determined, sd, 1.0), 0.0)

    def residuals(self, effect):
        """Return (deviates, redundancy, w), each (c,), of an effect with a prior.

        The prior is an observation of 0 with one standard deviation. The deviate is its residual in
        standard deviations, the redundancy is the fraction of an error that appears in the
        residual, and w is the test statistic.
        """
        deviates = effect.columns.T @ self.pulled
        columns = effect.columns
        redundancy = np.einsum("nk,nm,mk->k", columns, self.weight, columns)
        divisor = np.sqrt(np.maximum(redundancy, 1e-30))
        return deviates, redundancy, np.where(redundancy > UNSEEN, deviates / divisor, 0.0)


def adjust_steps(misclosure_m3, noise, effects):
    """Adjust metered steps together with all causes of their misclosures.

    Parameters
    ----------
    misclosure_m3 : array_like, shape (n,)
        Metered volume less the volume of the geometry, m3.
    noise : sequence of Effect
        Errors of the readings; each step must have an error of its own.
    effects : sequence of Effect
        All other causes.

    Returns
    -------
    LiquidAdjustment

    Raises
    ------
    SolutionError
        If steps have no error of their own, or if a free effect is not observed.

    Examples
    --------
    A batch of 10 m3 +- 0.003 where the geometry has 9.99 +- 0.004: a misclosure of 0.01.

    >>> batch, wall = Effect("batch", np.array([[0.003]])), Effect("wall", np.array([[0.004]]))
    >>> fit = adjust_steps([0.01], [batch], [wall])
    >>> round(float(9.99 + 0.004 * fit.estimate[0]), 4), round(float(0.004 * fit.sd[0]), 4)
    (9.9964, 0.0024)
    """
    y = np.asarray(misclosure_m3, dtype=float)
    effects = tuple(sorted(effects, key=lambda effect: effect.is_free))
    priors = _stack_columns([effect for effect in effects if not effect.is_free], len(y))
    free = _stack_columns([effect for effect in effects if effect.is_free], len(y))
    reading_columns = _stack_columns(noise, len(y))
    whiten = _whitening_matrix(reading_columns)
    prior_count = priors.shape[1]
    design = np.zeros((len(y) + prior_count, prior_count + free.shape[1]))
    design[: len(y)] = whiten @ np.hstack([priors, free])
    design[len(y) :, :prior_count] = np.eye(prior_count)
    # Full QR decomposition: the first columns give the estimates, the others the weights of tests.
    rotation, upper, order = scipy.linalg.qr(design, pivoting=True)
    count = design.shape[1]
    upper = upper[:count]
    _refuse_unobserved(upper, free.shape[1])
    inverse = np.empty_like(upper)
    inverse[order] = scipy.linalg.solve_triangular(upper, np.eye(count))
    # M = W' Q2 Q2' W, with Q2 the complement of the design in the rows of the misclosures.
    complement = whiten.T @ rotation[: len(y), count:]
    return LiquidAdjustment(
        misclosure_m3=y,
        noise=tuple(noise),
        effects=effects,
        gain=inverse @ rotation[: len(y), :count].T @ whiten,
        sd=np.linalg.norm(inverse, axis=1),
        weight=complement @ complement.T,
    )


def _stack_columns(effects, rows):
    """Return the columns of effects side by side, shape (rows, c)."""
    return np.hstack([np.zeros((rows, 0)), *(effect.columns for effect in effects)])


def _whitening_matrix(columns):
    """Return W (n, n) with W (N N') W' = I."""
    try:
        lower = np.linalg.cholesky(columns @ columns.T)
    except np.linalg.LinAlgError:
        lower = None
    if lower is None or np.min(np.diag(lower)) < 1e-9 * np.max(np.diag(lower), initial=0.0):
        raise SolutionError(
            message(
                "steps_without_error",
                "a step by liquid has no error of its own, neither of its batch nor of its dips: "
                "expected a repeatability of the meter, or a standard deviation of the dips, "
                "above 0",
            )
        )
    return scipy.linalg.solve_triangular(lower, np.eye(len(lower)), lower=True)


def _refuse_unobserved(upper, free):
    """Raise SolutionError if a free effect is not observed."""
    pivots = np.abs(np.diag(upper))
    if free and np.min(pivots) < UNTOLD * min(1.0, np.max(pivots)):
        raise SolutionError(
            message(
                "liquid_unobserved",
                "the steps by liquid do not tell all that was left free: expected a run that "
                "begins in the empty tank, or dips that differ",
            )
        )
