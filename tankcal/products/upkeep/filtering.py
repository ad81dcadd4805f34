"""Sequential estimation: causes that drift are eliminated step by step, constant causes collected.

A step k between the marks k and k + 1 has the misclosure

    y = C x + A0 (e0 + w0) - A1 (e1 + w1) - D0 l0 + D1 l1 + sum v_j g_j + n

x       constant causes, N(0, I) in their standard deviations, with columns C
e       error of the level at a mark, independent; w: wander of the gauge, Ornstein-Uhlenbeck
l       difference of the mean temperature from the sensor after a delivery, which decays
g_j     drift of the factor of meter j, a random walk
n       error of the tickets and of the meters of this step alone

The Kalman filter runs over (e, w, l, g) only, with y and every column of C as separate
observations (the augmented filter). Its innovations, divided by their standard deviations, are
L^-1 y and L^-1 C, with L L' the covariance of the steps without x. A triangle collects them,

    qr [I 0; L^-1 C  L^-1 y] = [R z; 0 c],      R x = z,   cov x = (R' R)^-1,

exactly as generalised least squares with the full covariance. The memory does not depend on the
number of steps: (R, z), the state of the filter and its covariance continue with the next month.

The tests compare all of it with least squares and the covariance written out.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import scipy.linalg

MARK = 3  # states at a mark: error of the level, wander, difference of temperature


@dataclass(frozen=True)
class Drift:
    """Variances of the causes that drift, and their effects on n steps between m = n + 1 marks.

    Attributes
    ----------
    seconds : ndarray, shape (n,)
        Duration of each step.
    area_m2 : ndarray, shape (m,)
        Change of the stock per metre of level.
    by_degree_m3 : ndarray, shape (m,)
        Change of the stock per kelvin.
    metered_m3 : ndarray, shape (n, meters)
    level_sd_m : ndarray, shape (m,)
    layer_sd_k : ndarray, shape (n,)
        Difference of temperature that begins in a step, 0: no delivery.
    noise_m3 : ndarray, shape (n,)
    is_used : ndarray of bool, shape (n,)
        A step without use carries the drift only.
    wander_sd_m, wander_s : float
        Standard deviation and correlation time of the wander.
    layer_s : float
        Time in which a difference of temperature decays to 1/e.
    walk_per_s : ndarray, shape (meters,)
        Increase of the variance of a meter factor per second.
    """

    seconds: np.ndarray
    area_m2: np.ndarray
    by_degree_m3: np.ndarray
    metered_m3: np.ndarray
    level_sd_m: np.ndarray
    layer_sd_k: np.ndarray
    noise_m3: np.ndarray
    is_used: np.ndarray
    wander_sd_m: float
    wander_s: float
    layer_s: float
    walk_per_s: np.ndarray
    AT_STEPS: ClassVar = ("seconds", "metered_m3", "layer_sd_k", "noise_m3", "is_used")
    AT_MARKS: ClassVar = ("area_m2", "by_degree_m3", "level_sd_m")

    def __len__(self):
        """Number of steps."""
        return len(self.seconds)

    def part(self, first, last):
        """Drift of the steps first to last - 1."""
        return replace(
            self,
            **{name: getattr(self, name)[first:last] for name in self.AT_STEPS},
            **{name: getattr(self, name)[first : last + 1] for name in self.AT_MARKS},
        )


@dataclass(frozen=True)
class FilterState:
    """State of the filter at a mark.

    Attributes
    ----------
    mean : ndarray, shape (states, 1 + c)
        Mean of (e, w, l, g) by y, and by each column of C.
    covariance : ndarray, shape (states, states)
    """

    mean: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True)
class Whitened:
    """Innovations of a run of the filter.

    Attributes
    ----------
    rows : ndarray, shape (n, 1 + c)
        L^-1 (y, C); 0 for steps without use.
    end : FilterState
    gains : Gains
    """

    rows: np.ndarray
    end: FilterState
    gains: object


def start_state(drift, columns):
    """`FilterState` at the first mark, without earlier steps, for c columns."""
    meters = drift.metered_m3.shape[1]
    variances = [drift.level_sd_m[0] ** 2, drift.wander_sd_m**2, 0.0, *np.zeros(meters)]
    return FilterState(np.zeros((MARK + meters, 1 + columns)), np.diag(variances))


def whiten_steps(drift, data, state=None):
    """Run the filter over steps.

    Parameters
    ----------
    drift : Drift
    data : ndarray, shape (n, 1 + c)
        Misclosures y, then the columns C.
    state : FilterState, optional
        State at the first mark; None: no earlier steps.

    Returns
    -------
    Whitened
    """
    state = state or start_state(drift, data.shape[1] - 1)
    gains = _find_gains(drift, state.covariance)
    rows, mean, _ = _run_means(drift, gains, data, state.mean)
    return Whitened(rows, FilterState(mean, gains.end), gains)


def smooth_steps(drift, residuals, whitened, start=None):
    """Errors of the levels, wander and layers at every mark, by all steps.

    Parameters
    ----------
    drift : Drift
    residuals : ndarray, shape (n,)
        Misclosures less the effects of the constant causes.
    whitened : Whitened
        Run of the filter over these steps.
    start : ndarray, shape (states,), optional
        State at the first mark by the residuals of earlier steps; None: 0.

    Returns
    -------
    ndarray, shape (m, 3)
    """
    gains = whitened.gains
    mean = np.zeros(len(gains.end)) if start is None else start
    rows, _, predicted = _run_means(drift, gains, residuals[:, None], mean[:, None], is_kept=True)
    smoothed = np.zeros((len(drift) + 1, MARK))
    pull = np.zeros(MARK + len(gains.end))  # derivative of the log likelihood of the later steps
    # Backward recursion of Bryson and Frazier.
    for k in range(len(drift) - 1, -1, -1):
        if drift.is_used[k]:
            innovation = rows[k, 0] / gains.sd_m3[k]
            pull = pull + gains.effect[k] * (innovation - gains.gain[k] @ pull)
        state = predicted[k] + gains.covariance[k] @ pull
        smoothed[k] = state[:MARK]
        if k == len(drift) - 1:
            smoothed[k + 1] = state[MARK : 2 * MARK]
        pull = np.concatenate([np.zeros(MARK), gains.transition[k].T @ pull])
    return smoothed


@dataclass(frozen=True)
class Gains:
    """Covariances of the filter, which do not depend on the misclosures.

    The states of a step are those of its first mark, those of its second mark, and the factors.

    Attributes
    ----------
    effect : ndarray, shape (n, size)
        Effect of the states on the misclosure.
    transition : ndarray, shape (n, size, states)
        From the states at the first mark to those of the step.
    covariance : ndarray, shape (n, size, size)
        Before the misclosure of the step.
    gain : ndarray, shape (n, size)
        0: the step is not used.
    sd_m3 : ndarray, shape (n,)
        Standard deviation of the innovation.
    end : ndarray, shape (states, states)
        Covariance at the last mark.
    """

    effect: np.ndarray
    transition: np.ndarray
    covariance: np.ndarray
    gain: np.ndarray
    sd_m3: np.ndarray
    end: np.ndarray


def _find_gains(drift, end):
    """`Gains` of the filter from the covariance of the states at the first mark."""
    count, states = len(drift), len(end)
    size = MARK + states
    stay, decay = (np.exp(-drift.seconds / scale) for scale in (drift.wander_s, drift.layer_s))
    effect, transition = np.zeros((count, size)), np.zeros((count, size, states))
    area, warm = drift.area_m2, drift.by_degree_m3
    effect[:, 0] = effect[:, 1] = area[:-1]
    effect[:, 3] = effect[:, 4] = -area[1:]
    effect[:, 2], effect[:, 5] = -warm[:-1], warm[1:]
    effect[:, 6:] = drift.metered_m3
    transition[:, range(MARK), range(MARK)] = 1.0
    transition[:, range(2 * MARK, size), range(MARK, states)] = 1.0
    # The error of a level is new at each mark; wander and layers decay.
    transition[:, 4, 1], transition[:, 5, 2] = stay, decay
    added = np.zeros((count, size))
    added[:, 3] = drift.level_sd_m[1:] ** 2
    added[:, 4] = drift.wander_sd_m**2 * (1 - stay**2)
    added[:, 5] = drift.layer_sd_k**2
    added[:, 6:] = np.outer(drift.seconds, drift.walk_per_s)
    noise, is_used = drift.noise_m3**2, drift.is_used.tolist()
    covariance, gain = np.zeros((count, size, size)), np.zeros((count, size))
    variance, diagonal = np.ones(count), np.arange(size)
    for k in range(count):
        now = covariance[k]
        np.matmul(transition[k] @ end, transition[k].T, out=now)
        now[diagonal, diagonal] += added[k]
        if not is_used[k]:
            end = now[MARK:, MARK:]
            continue
        spread = now @ effect[k]
        variance[k] = effect[k] @ spread + noise[k]
        gain[k] = spread / variance[k]
        end = now[MARK:, MARK:] - gain[k, MARK:, None] * spread[MARK:]
    return Gains(effect, transition, covariance, gain, np.sqrt(variance), end)


def _run_means(drift, gains, data, mean, *, is_kept=False):
    """(innovations (n, 1 + c), means at the end, predicted means (n, size) of the first column)."""
    rows, predicted = np.zeros_like(data, dtype=float), np.zeros_like(gains.gain)
    is_used = drift.is_used.tolist()
    for k in range(len(drift)):
        mean = gains.transition[k] @ mean
        if is_kept:
            predicted[k] = mean[:, 0]
        if is_used[k]:
            rows[k] = data[k] - gains.effect[k] @ mean
            mean = mean[MARK:] + gains.gain[k, MARK:, None] * rows[k]
        else:
            mean = mean[MARK:]
    rows /= gains.sd_m3[:, None]  # in place: years of steps with many columns
    return rows, mean, predicted


@dataclass(frozen=True)
class Triangle:
    """Triangle of the constant causes: R x = z with the sum of squares of the residuals.

    Attributes
    ----------
    upper : ndarray, shape (c + 1, c + 1)
        [R z; 0 r], r**2 the sum of squares that no x explains.
    count : int
        Number of steps.
    """

    upper: np.ndarray
    count: int = 0

    @property
    def estimate(self):
        """Estimates x, shape (c,), in standard deviations of the causes."""
        return scipy.linalg.solve_triangular(self.upper[:-1, :-1], self.upper[:-1, -1])

    @property
    def root(self):
        """R^-1, shape (c, c): the covariance of the estimates is R^-1 R^-1'."""
        size = len(self.upper) - 1
        return scipy.linalg.solve_triangular(self.upper[:-1, :-1], np.eye(size))

    @property
    def chi2(self):
        """Sum of squares; its degrees of freedom are `count`, because all causes have a prior."""
        return float(self.upper[-1, -1] ** 2)


def start_triangle(causes):
    """`Triangle` of the priors of c causes."""
    return Triangle(np.eye(causes + 1) * np.append(np.ones(causes), 0.0))


def add_rows(triangle, rows, is_used):
    """Add whitened steps to a triangle; two months are added alike.

    Parameters
    ----------
    triangle : Triangle
    rows : ndarray, shape (n, 1 + c)
        L^-1 (y, C).
    is_used : ndarray of bool, shape (n,)

    Returns
    -------
    Triangle
    """
    ordered = np.hstack([rows[is_used, 1:], rows[is_used, :1]])
    upper = np.linalg.qr(np.vstack([triangle.upper, ordered]), mode="r")
    return Triangle(upper, triangle.count + int(is_used.sum()))


def total_innovations(rows, is_used, others=None, block=100, upper=None):
    """Innovations of the complete model, in order of time, from priors only.

    Parameters
    ----------
    rows : ndarray, shape (n, 1 + c)
        L^-1 (y, C).
    is_used : ndarray of bool, shape (n,)
    others : ndarray, shape (n, q), optional
        L^-1 of the columns of further causes, whose innovations are returned after those of y.
    block : int
        Steps taken together; the result does not depend on it.
    upper : ndarray, shape (c + 1, c + 1), optional
        `Triangle.upper` of earlier steps, in which the further causes had no effect.

    Returns
    -------
    ndarray, shape (n, 1 + q)
        The first column is independent N(0, 1) if the model is right. Steps without use are 0.
    """
    right = rows[:, :1] if others is None else np.hstack([rows[:, :1], others])
    innovations, places = np.zeros_like(right), np.flatnonzero(is_used)
    size = rows.shape[1] - 1
    sums = np.zeros((size, right.shape[1]))
    if upper is None:
        upper = np.eye(size)
    else:
        sums[:, 0], upper = upper[:-1, -1], upper[:-1, :-1]
    for start in range(0, len(places), block):
        steps = places[start : start + block]
        columns, now = rows[steps, 1:], right[steps]
        # Residuals by the earlier steps, and their covariance I + C (R'R)^-1 C'.
        by_prior = scipy.linalg.solve_triangular(upper, columns.T, trans="T")
        lower = np.linalg.cholesky(np.eye(len(steps)) + by_prior.T @ by_prior)
        expected = columns @ scipy.linalg.solve_triangular(upper, sums)
        innovations[steps] = scipy.linalg.solve_triangular(lower, now - expected, lower=True)
        basis, upper = np.linalg.qr(np.vstack([upper, columns]))
        sums = basis.T @ np.vstack([sums, now])
    return innovations
