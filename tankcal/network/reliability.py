"""What the residuals say about each observation, and what they would not say.

    w = v / (s sqrt(r))              Baarda's test quantity, sd s known; standard normal
    tau = w / sigma0                 Pope's, variance factor estimated
    MDB = delta0 s / sqrt(r)         smallest blunder found with the power asked for
    delta0 sqrt((1 - r) / r)         its effect on any adjusted quantity, at most, in sds of that

with the redundancy number r. Source: Baarda 1968, A testing procedure for use in geodetic networks;
Pope 1976, The statistics of residuals; Foerstner 1987.
"""

from dataclasses import dataclass

import numpy as np
import scipy.stats

UNCONTROLLED = 1e-6  # a redundancy number below it is zero: the observation cannot be checked


@dataclass(frozen=True)
class Residuals:
    """Residuals of one group of observations: n observations with m values each.

    kind        in words                  unit        of value, residual, sd, mdb
    source      "image points", the number in Survey.observations, or "known beforehand"
    rows        (n,) row numbers there    used        (n,) False where set aside
    residual    (n, m) computed minus observed
    sd          (n, m) of the observation, a priori
    redundancy  (n, m) 0 to 1; 1 for those set aside
    w           (n, m) test quantity; of those set aside: of the difference to what the others say
    whole       (n,) test quantity of the observation with all its values: |w|, or the root of what
                v'Pv would lose without it, brought to the critical value of w (0.1 %)
    mdb         (n, m) minimal detectable bias; inf where nothing controls the observation
    external    (n, m) effect of a blunder of that size on the adjusted quantities, in their sds
    """

    kind: str
    unit: str
    source: object
    rows: np.ndarray
    used: np.ndarray
    residual: np.ndarray
    sd: np.ndarray
    redundancy: np.ndarray
    w: np.ndarray
    whole: np.ndarray
    mdb: np.ndarray
    external: np.ndarray


def noncentrality(alpha=0.001, power=0.80):
    """delta0 of a two-sided test of the normal distribution; 4.13 for 0.001 and 0.80."""
    return float(scipy.stats.norm.isf(alpha / 2) - scipy.stats.norm.isf(power))


def tau_limit(alpha, dof):
    """Two-sided critical value of Pope's tau distribution."""
    t = scipy.stats.t.isf(alpha / 2, dof - 1)
    return float(t * np.sqrt(dof) / np.sqrt(dof - 1 + t * t))


def residuals_of(problem, solution, alpha=0.001, power=0.80):
    """A tuple of Residuals, one for each group of a solved Problem."""
    delta0 = noncentrality(alpha, power)
    tables = []
    groups = zip(problem.observations, problem.sources, problem.rows_of, strict=True)
    for number, (one, source, rows) in enumerate(groups):
        use = np.ones(len(one)) if one.use is None else np.asarray(one.use, dtype=float)
        whole = one if one.use is None else one.using(np.ones(len(one)))
        columns = problem.model.groups[number].columns
        v = np.empty((len(one), one.rows))
        jac = np.empty((*v.shape, columns.shape[1]))
        whole.fill(solution.state, v, jac)
        leverage = solution.leverage(number, jac)
        share = use[:, None]
        r = 1.0 - share * leverage
        variance = np.where(share > 0, r, 1.0 + leverage)
        controlled = variance > UNCONTROLLED
        with np.errstate(divide="ignore", invalid="ignore"):
            w = np.where(controlled, v / np.sqrt(variance), 0.0)
            mdb = np.where(controlled, delta0 / np.sqrt(variance), np.inf)
            hidden = np.where(controlled, delta0 * np.sqrt(np.maximum(1 - r, 0) / r), np.inf)
        sd, test = 1.0 / whole.weight, np.abs(w).max(axis=1)
        if one.rows == 2:
            test = _both(solution, number, v, jac, share, leverage, variance, test)
        tables.append(
            Residuals(
                one.kind, one.unit, source, rows, use > 0, v * sd, sd, r, w, test, mdb * sd, hidden
            )
        )  # fmt: skip
    return tuple(tables)


def _both(solution, group, v, jac, share, leverage, variance, single):
    """Test quantity (n,) of two values together, from their residuals' covariance.

    single  (n,) the quantity where only one direction is controlled
    """
    sum_of_both = solution.leverage(group, jac.sum(axis=1, keepdims=True))[:, 0]
    between = 0.5 * (sum_of_both - leverage.sum(axis=1))
    between = np.where(share[:, 0] > 0, -share[:, 0] * between, between)
    a, d = variance.T
    determinant = a * d - between**2
    square = d * v[:, 0] ** 2 + a * v[:, 1] ** 2 - 2 * between * v[:, 0] * v[:, 1]
    sound = determinant > UNCONTROLLED * np.maximum(a * d, UNCONTROLLED)
    square = np.maximum(square, 0.0) / np.where(sound, determinant, 1.0)
    one, two = scipy.stats.norm.isf(0.0005), np.sqrt(scipy.stats.chi2.isf(0.001, 2))
    return np.where(sound, np.sqrt(square) * one / two, single)
