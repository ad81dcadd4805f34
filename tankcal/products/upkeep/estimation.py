"""Estimation of a tank in service from its steps, at adjusted levels, with rejected steps."""

from dataclasses import dataclass, replace

import numpy as np
import scipy.stats

from tankcal.products.upkeep.causes import Balance
from tankcal.products.upkeep.filtering import (
    Triangle,
    Whitened,
    add_rows,
    start_triangle,
    total_innovations,
    whiten_steps,
)

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
    whitened : Whitened
    triangle : Triangle
    innovations : ndarray, shape (n,)
        Of the complete model, in order of time; 0 for steps without use.
    rejected : ndarray of int
        Steps rejected as outliers.
    passes : int
    is_fitting : bool
        False: more steps than `MOST_REJECTED` are outliers; no step was rejected.
    """

    steps: object
    balance: Balance
    whitened: Whitened
    triangle: Triangle
    innovations: np.ndarray
    rejected: np.ndarray
    passes: int
    is_fitting: bool = True

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
        return float(scipy.stats.chi2.sf(self.triangle.chi2, max(self.triangle.count, 1)))

    def sizes(self):
        """Estimates and standard uncertainties of the causes in their units, each (c,)."""
        causes = self.balance.causes
        sd_left = np.sqrt(np.diag(self.covariance))
        return causes.mean + causes.sd * self.triangle.estimate, causes.sd * sd_left


def estimate(operation, steps, *, is_robust=True):
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

    Returns
    -------
    Estimation
    """
    rejected, balance, triangle, smoothed = [], None, None, None
    passes = 0
    while passes < PASSES:
        passes += 1
        before = None if balance is None else balance.level_m
        estimates = None if triangle is None else triangle.estimate
        balance = operation.linearize(steps, estimates, smoothed)
        balance = _exclude_steps(balance, rejected)
        whitened, triangle = _solve(balance)
        if is_robust:
            robust = _reject(balance, whitened, triangle, rejected)
            if robust[3] is None:
                # The model does not fit: all steps are used, so that a fault shows in the watching.
                return replace(estimate(operation, steps, is_robust=False), is_fitting=False)
            balance, whitened, triangle, rejected = robust
        residual = balance.misclosure_m3 - balance.columns_m3 @ triangle.estimate
        smoothed = whiten_steps(balance.drift, residual[:, None], is_smoothed=True).smoothed
        if before is not None:
            change = np.abs(balance.level_m - before) / balance.drift.level_sd_m
            if np.max(change, initial=0.0) < SETTLED:
                break
    innovations = total_innovations(whitened.rows, balance.drift.is_used)[:, 0]
    return Estimation(steps, balance, whitened, triangle, innovations,
                      np.array(sorted(rejected), dtype=int), passes)  # fmt: skip


def _solve(balance):
    """(`Whitened`, `Triangle`) of linearised steps."""
    data = np.column_stack([balance.misclosure_m3, balance.columns_m3])
    whitened = whiten_steps(balance.drift, data)
    start = start_triangle(balance.columns_m3.shape[1])
    return whitened, add_rows(start, whitened.rows, balance.drift.is_used)


def _exclude_steps(balance, rejected):
    """Balance in which the rejected steps have no use."""
    if not len(rejected):
        return balance
    is_used = balance.drift.is_used.copy()
    is_used[rejected] = False
    return replace(balance, drift=replace(balance.drift, is_used=is_used))


def _reject(balance, whitened, triangle, rejected):
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
        whitened, triangle = _solve(balance)
