"""The adjustment of metered steps: what they say of everything that moves their misclosures.

A step's misclosure y (metered less the increment of the geometry) is a sum of causes, each a column
of m3 by one standard deviation of it:

    y = A z + F b + N e,      z, e ~ N(0, I),   b free

z are causes with a prior (geometry, meters, runs), b such as nothing else knows (what lies below
the first dip), e the readings' own errors (batches, dips). With R = N N' whitened by W, W R W' = I,
least squares of

    [W A  W F] [z]   [W y]
    [ I    0 ] [b] = [ 0 ]

give z and b = G y, and with what the orthogonal complement leaves the weights M of all tests: for
any cause of column c (m3 by its unit)

    size = c' M y / c' M c,   sd = 1 / sqrt(c' M c),   w = size / sd.

It is the best linear prediction: G y = A' S^-1 y with S = A A' + R, without inverting S, so that a
prior may be as wide as one likes. Source: Koch 1999, Parameter estimation and hypothesis testing,
3.5; Baarda 1968.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from tankcal.errors import SolutionError
from tankcal.messages import message

UNTOLD = 1e-10  # of the largest pivot: a free cause below it is not observed
UNSEEN = 1e-12  # of c' R^-1 c: a cause of which less shows in the misclosures cannot be tested


@dataclass(frozen=True)
class Effect:
    """A cause, or several of one kind, that moves misclosures.

    Attributes
    ----------
    kind : str
    columns : ndarray, shape (n, c)
        What one standard deviation of each adds to the misclosures, m3; of a free one: one unit.
    is_free : bool
        True: without any prior.
    """

    kind: str
    columns: np.ndarray
    is_free: bool = False


@dataclass(frozen=True)
class LiquidAdjustment:
    """What n steps say.

    Attributes
    ----------
    misclosure_m3 : ndarray, shape (n,)
    noise : tuple of Effect
        Of the readings themselves: batches, dips, temperatures.
    effects : tuple of Effect
        All others, those that are free last.
    gain : ndarray, shape (c, n)
        Estimates of all effects by the misclosures, 1/m3; rows in the order of the effects.
    sd : ndarray, shape (c,)
        Of the estimates, in the deviates (a free one: the unit) of their effects.
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
        """(c,) estimates of all effects, in the order of `gain`."""
        return self.gain @ self.misclosure_m3

    @cached_property
    def pulled(self):
        """(n,) M y."""
        return self.weight @ self.misclosure_m3

    @property
    def chi2(self):
        """y' M y, chi-square of n less the number of free effects."""
        return float(self.misclosure_m3 @ self.pulled)

    @property
    def dof(self):
        """Degrees of freedom of `chi2`."""
        free = sum(one.columns.shape[1] for one in self.effects if one.is_free)
        return len(self.misclosure_m3) - free

    def place(self, kind):
        """Slice of the rows of `gain` that belong to the effects of a kind; empty: none."""
        start = 0
        for one in self.effects:
            end = start + one.columns.shape[1]
            if one.kind == kind:
                return slice(start, end)
            start = end
        return slice(0, 0)

    def test(self, columns):
        """(size, sd, w), each (k,), of causes of columns (n, k), each by itself.

        size in the unit of the cause; an infinite sd where the steps cannot show it, w is 0 then.
        """
        columns = np.asarray(columns, dtype=float)
        seen = np.einsum("nk,nm,mk->k", columns, self.weight, columns)
        largest = np.sum(columns**2, axis=0) * np.max(np.diag(self.weight), initial=0.0)
        shows = seen > UNSEEN * largest
        safe = np.where(shows, seen, 1.0)
        size = np.where(shows, columns.T @ self.pulled / safe, 0.0)
        sd = np.where(shows, 1 / np.sqrt(safe), np.inf)
        return size, sd, np.where(shows, size / np.where(shows, sd, 1.0), 0.0)

    def residuals(self, effect):
        """(deviates, redundancy, w), each (c,), of what an effect with a prior was observed as.

        A cause is observed as 0 with one standard deviation: what is left of it (in it), which part
        of an error of it shows, and the test of it.
        """
        deviates = effect.columns.T @ self.pulled
        columns = effect.columns
        redundancy = np.einsum("nk,nm,mk->k", columns, self.weight, columns)
        safe = np.sqrt(np.maximum(redundancy, 1e-30))
        return deviates, redundancy, np.where(redundancy > UNSEEN, deviates / safe, 0.0)


def adjust_steps(misclosure_m3, noise, effects):
    """Adjust metered steps together with all that moves them.

    Parameters
    ----------
    misclosure_m3 : array_like, shape (n,)
        Metered less what the geometry says, m3.
    noise : sequence of Effect
        Errors of the readings; together they leave no step without an error of its own.
    effects : sequence of Effect
        All other causes.

    Returns
    -------
    LiquidAdjustment

    Raises
    ------
    SolutionError
        When steps have no error of their own, or when a free effect is not observed.

    Examples
    --------
    A batch of 10 m3 +- 0.003 where the geometry has 9.99 +- 0.004: a misclosure of 0.01.

    >>> batch, wall = Effect("batch", np.array([[0.003]])), Effect("wall", np.array([[0.004]]))
    >>> found = adjust_steps([0.01], [batch], [wall])
    >>> round(float(9.99 + 0.004 * found.estimate[0]), 4), round(float(0.004 * found.sd[0]), 4)
    (9.9964, 0.0024)
    """
    y = np.asarray(misclosure_m3, dtype=float)
    effects = tuple(sorted(effects, key=lambda one: one.is_free))
    priors = _stacked([one for one in effects if not one.is_free], len(y))
    free = _stacked([one for one in effects if one.is_free], len(y))
    own = _stacked(noise, len(y))
    whiten = _whitening(own)
    kept = priors.shape[1]
    design = np.zeros((len(y) + kept, kept + free.shape[1]))
    design[: len(y)] = whiten @ np.hstack([priors, free])
    design[len(y) :, :kept] = np.eye(kept)
    turn, upper, order = scipy.linalg.qr(design, pivoting=True)
    count = design.shape[1]
    upper = upper[:count]
    _refuse_unobserved(upper, free.shape[1])
    inverse = np.empty_like(upper)
    inverse[order] = scipy.linalg.solve_triangular(upper, np.eye(count))
    left = whiten.T @ turn[: len(y), count:]
    return LiquidAdjustment(
        misclosure_m3=y,
        noise=tuple(noise),
        effects=effects,
        gain=inverse @ turn[: len(y), :count].T @ whiten,
        sd=np.linalg.norm(inverse, axis=1),
        weight=left @ left.T,
    )


def _stacked(effects, rows):
    return np.hstack([np.zeros((rows, 0)), *(one.columns for one in effects)])


def _whitening(columns):
    """(n, n) W with W (N N') W' = I."""
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
    pivots = np.abs(np.diag(upper))
    if free and np.min(pivots) < UNTOLD * min(1.0, np.max(pivots)):
        raise SolutionError(
            message(
                "liquid_unobserved",
                "the steps by liquid do not tell all that was left free: expected a run that "
                "begins in the empty tank, or dips that differ",
            )
        )
