"""Estimation of a tank in service from its steps, at adjusted levels, with rejected steps.

Steps are estimated in periods of half a period. A period starts with the triangle and the state of
the filter of the period before, and its levels are adjusted by its own steps. The result therefore
does not depend on when a period was computed, and a month costs at most the work of a period.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import gammaincc

from tankcal.products.upkeep.causes import Balance
from tankcal.products.upkeep.filtering import (
    FilterState,
    Triangle,
    add_rows,
    smooth_steps,
    start_triangle,
    total_innovations,
    whiten_steps,
)
from tankcal.products.upkeep.saved import NO_STATE

PERIOD_NS = 182 * 86400 * 10**9
PASSES = 8  # largest number of linearisations
SETTLED = 0.02  # largest change of a level in the last pass, in its standard deviations
OUTLIER = 4.0  # |w| of a rejected step
MOST_REJECTED = 0.02  # share of the steps
LEAST_STEPS = 200  # for an improved table
LEAST_RANGE = 1 / 3  # of the height of the table


@dataclass(frozen=True)
class Estimation:
    """Tank in service, estimated.

    Attributes
    ----------
    steps : steps.Steps
    balance : Balance
        Linearised at the adjusted levels.
    rows : ndarray, shape (n, 1 + c)
        L^-1 (y, C).
    innovations : ndarray, shape (n,)
        Of the complete model, in order of time; 0 for steps without use.
    triangle : Triangle
    end : FilterState
        At the last mark.
    rejected : ndarray of int
        Steps rejected as outliers.
    passes : int
    is_fitting : bool
        False: more steps of a period than `MOST_REJECTED` are outliers; none of them was rejected.
    periods : tuple of (int, int, str)
        First and last step of each period, and the key of its saved state.
    """

    steps: object
    balance: Balance
    rows: np.ndarray
    innovations: np.ndarray
    triangle: Triangle
    end: FilterState
    rejected: np.ndarray
    passes: int
    is_fitting: bool = True
    periods: tuple = ()

    @property
    def is_used(self):
        """Whether each step is used, shape (n,)."""
        return self.balance.drift.is_used

    @property
    def covariance(self):
        """Covariance (c, c) of the estimates, in standard deviations of the causes."""
        root = self.triangle.root
        return root @ root.T

    @property
    def probability(self):
        """Probability of a larger chi-square, if the model is right."""
        return float(gammaincc(max(self.triangle.count, 1) / 2, self.triangle.chi2 / 2))

    def sizes(self):
        """Estimates and standard uncertainties of the causes in their units, each (c,)."""
        causes = self.balance.causes
        sd_left = np.sqrt(np.diag(self.covariance))
        return causes.mean + causes.sd * self.triangle.estimate, causes.sd * sd_left


def estimate(operation, steps, *, is_robust=True, state=NO_STATE):
    """Estimate all causes from steps.

    Levels and temperatures of the marks are unknowns. Each pass evaluates the stock and all columns
    at the levels of the pass before (Gauss-Helmert): columns at the levels as read share their
    errors with the misclosures, which would make the scale of the tank too small by n u^2.

    Parameters
    ----------
    operation : causes.Operation
    steps : steps.Steps
    is_robust : bool, default True
        Reject outliers, the largest first.
    state : state.State, optional
        Results of earlier runs; they are used for periods with equal steps.

    Returns
    -------
    Estimation
    """
    age = steps.marks.time_ns[:-1] - steps.marks.time_ns[0]
    edges = np.searchsorted(age // PERIOD_NS, np.arange(age[-1] // PERIOD_NS + 2))
    periods, before, chain = [], None, repr(operation.fingerprint())
    for first, last in pairwise(np.unique(edges).tolist()):
        part = steps.part(first, last)
        chain = state.key(chain, part, is_robust)
        period = state.load(chain, Estimation, steps=part)
        if period is None:
            period = _estimate_period(operation, part, before, is_robust)
            state.save(chain, period)
        periods.append((first, last, chain, period))
        before = period
    return _join(steps, periods)


def _join(steps, periods):
    """`Estimation` of all periods."""
    whole = [period for *_, period in periods]
    balances, drifts = (
        [period.balance for period in whole],
        [period.balance.drift for period in whole],
    )

    def at_steps(parts, name):
        return np.concatenate([getattr(part, name) for part in parts])

    def at_marks(parts, name):
        """Values at marks: the last mark of a period is the first mark of the next period."""
        return np.concatenate([getattr(part, name)[:-1] for part in parts[:-1]]
                              + [getattr(parts[-1], name)])  # fmt: skip

    last = whole[-1]
    drift = replace(
        last.balance.drift,
        **{name: at_steps(drifts, name) for name in last.balance.drift.AT_STEPS},
        **{name: at_marks(drifts, name) for name in last.balance.drift.AT_MARKS},
    )
    balance = replace(
        last.balance, misclosure_m3=at_steps(balances, "misclosure_m3"),
        columns_m3=at_steps(balances, "columns_m3"), level_m=at_marks(balances, "level_m"),
        drift=drift,
    )  # fmt: skip
    return Estimation(
        steps, balance, at_steps(whole, "rows"), at_steps(whole, "innovations"), last.triangle,
        last.end, np.concatenate([first + period.rejected for first, _, _, period in periods]),
        max(period.passes for period in whole), all(period.is_fitting for period in whole),
        tuple(entry[:3] for entry in periods),
    )  # fmt: skip


def _estimate_period(operation, steps, before, is_robust):
    """`Estimation` of the steps of a period, after that of the period `before` or None."""
    rejected, balance, triangle, smoothed = [], None, None, None
    passes = 0
    while passes < PASSES:
        passes += 1
        earlier = None if balance is None else balance.level_m
        estimates = None if triangle is None else triangle.estimate
        if estimates is None and before is not None:
            estimates = before.triangle.estimate
        balance = operation.linearize(steps, estimates, smoothed)
        balance = _exclude_steps(balance, rejected)
        whitened, triangle = _solve(balance, before)
        if is_robust:
            robust = _reject(balance, whitened, triangle, rejected, before)
            if robust[3] is None:
                # The model does not fit: all steps are used, so that a fault shows in the watching.
                period = _estimate_period(operation, steps, before, is_robust=False)
                return replace(period, is_fitting=False)
            balance, whitened, triangle, rejected = robust
        effects = np.append(1.0, -triangle.estimate)
        residuals = balance.misclosure_m3 - balance.columns_m3 @ triangle.estimate
        start = None if before is None else before.end.mean @ effects
        smoothed = smooth_steps(balance.drift, residuals, whitened, start)
        if earlier is not None:
            change = np.abs(balance.level_m - earlier) / balance.drift.level_sd_m
            if np.max(change, initial=0.0) < SETTLED:
                break
    upper = None if before is None else before.triangle.upper
    innovations = total_innovations(whitened.rows, balance.drift.is_used, upper=upper)[:, 0]
    return Estimation(steps, balance, whitened.rows, innovations, triangle, whitened.end,
                      np.array(sorted(rejected), dtype=int), passes)  # fmt: skip


def _solve(balance, before):
    """(`Whitened`, `Triangle`) of linearised steps, after those of the period before."""
    data = np.column_stack([balance.misclosure_m3, balance.columns_m3])
    whitened = whiten_steps(balance.drift, data, before and before.end)
    start = before.triangle if before else start_triangle(balance.columns_m3.shape[1])
    return whitened, add_rows(start, whitened.rows, balance.drift.is_used)


def _exclude_steps(balance, rejected):
    """Balance in which the rejected steps have no use."""
    if not len(rejected):
        return balance
    is_used = balance.drift.is_used.copy()
    is_used[rejected] = False
    return replace(balance, drift=replace(balance.drift, is_used=is_used))


def _reject(balance, whitened, triangle, rejected, before):
    """Reject the steps with |w| above the limit, the largest first; None with too many of them."""
    most = int(MOST_REJECTED * balance.drift.is_used.sum()) + 1
    while True:
        residual = whitened.rows[:, 0] - whitened.rows[:, 1:] @ triangle.estimate
        by_root = whitened.rows[:, 1:] @ triangle.root
        spread = np.sqrt(np.maximum(1 - np.sum(by_root**2, axis=1), 1e-6))
        w = np.where(balance.drift.is_used, residual / spread, 0.0)
        worst = int(np.argmax(np.abs(w)))
        if abs(w[worst]) <= OUTLIER:
            return balance, whitened, triangle, rejected
        # Steps far from each other do not affect each other's residual: reject them together.
        order = np.argsort(-np.abs(w))
        group = []
        for step in order[np.abs(w[order]) > OUTLIER]:
            if all(abs(step - other) > 20 for other in group):
                group.append(int(step))
        rejected = [*rejected, *group]
        if len(rejected) > most:
            return balance, whitened, triangle, None
        balance = _exclude_steps(balance, rejected)
        whitened, triangle = _solve(balance, before)
