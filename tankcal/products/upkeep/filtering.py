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

    def __len__(self):
        """Number of steps."""
        return len(self.seconds)

    def part(self, first, last):
        """Drift of the steps first to last - 1."""
        at_steps = ("seconds", "metered_m3", "layer_sd_k", "noise_m3", "is_used")
        at_marks = ("area_m2", "by_degree_m3", "level_sd_m")
        return replace(
            self,
            **{name: getattr(self, name)[first:last] for name in at_steps},
            **{name: getattr(self, name)[first : last + 1] for name in at_marks},
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
    smoothed : ndarray or None, shape (m, 3)
        (e, w, l) at the marks by all steps; for a run over y alone.
    """

    rows: np.ndarray
    end: FilterState
    smoothed: np.ndarray | None = None


def start_state(drift, columns):
    """`FilterState` at the first mark, without earlier steps, for c columns."""
    meters = drift.metered_m3.shape[1]
    variances = [drift.level_sd_m[0] ** 2, drift.wander_sd_m**2, 0.0, *np.zeros(meters)]
    return FilterState(np.zeros((MARK + meters, 1 + columns)), np.diag(variances))


def whiten_steps(drift, data, state=None, *, is_smoothed=False):
    """Run the filter over steps.

    Parameters
    ----------
    drift : Drift
    data : ndarray, shape (n, 1 + c)
        Misclosures y, then the columns C.
    state : FilterState, optional
        State at the first mark; None: no earlier steps.
    is_smoothed : bool, default False
        True: data are y alone, and the states at every mark are estimated from all steps.

    Returns
    -------
    Whitened
    """
    state = state or start_state(drift, data.shape[1] - 1)
    meters = drift.metered_m3.shape[1]
    size = 2 * MARK + meters
    stay, decay = (np.exp(-drift.seconds / scale) for scale in (drift.wander_s, drift.layer_s))
    walk = np.outer(drift.seconds, drift.walk_per_s)
    # States of a step: those of its first mark, those of its second mark, the factors.
    effect = np.zeros((len(drift), size))
    area, warm = drift.area_m2, drift.by_degree_m3
    effect[:, 0] = effect[:, 1] = area[:-1]
    effect[:, 3] = effect[:, 4] = -area[1:]
    effect[:, 2], effect[:, 5] = -warm[:-1], warm[1:]
    effect[:, 6:] = drift.metered_m3
    added = np.zeros((len(drift), size))
    added[:, 3] = drift.level_sd_m[1:] ** 2
    added[:, 4] = drift.wander_sd_m**2 * (1 - stay**2)
    added[:, 5] = drift.layer_sd_k**2
    added[:, 6:] = walk
    mean, covariance = state.mean, state.covariance
    rows, kept = np.zeros_like(data, dtype=float), []
    # Rows of the state that become those of the next step: at the first mark, at the second.
    source = np.array([0, 1, 2, 0, 1, 2, *range(MARK, MARK + meters)])
    factors = np.ones((len(drift), size))
    factors[:, 3], factors[:, 4], factors[:, 5] = 0.0, stay, decay
    end = np.array([3, 4, 5, *range(6, size)])
    diagonal = np.arange(size)
    for k in range(len(drift)):
        mean = factors[k][:, None] * mean[source]
        covariance = np.outer(factors[k], factors[k]) * covariance[np.ix_(source, source)]
        covariance[diagonal, diagonal] += added[k]
        gain = variance = None
        if is_smoothed:
            predicted = mean[:, 0].copy(), covariance.copy()
        if drift.is_used[k]:
            spread = covariance @ effect[k]
            variance = effect[k] @ spread + drift.noise_m3[k] ** 2
            gain = spread / variance
            innovation = data[k] - effect[k] @ mean
            mean = mean + np.outer(gain, innovation)
            covariance = covariance - np.outer(gain, spread)
            rows[k] = innovation / np.sqrt(variance)
        if is_smoothed:
            kept.append((*predicted, gain, variance))
        mean, covariance = mean[end], covariance[np.ix_(end, end)]
    result = Whitened(rows, FilterState(mean, covariance))
    if not is_smoothed:
        return result
    return replace(result, smoothed=_smooth(kept, effect, factors, rows[:, 0]))


def _smooth(kept, effect, factors, innovations):
    """States (m, 3) at the marks by all steps, by the backward recursion of Bryson and Frazier."""
    smoothed = np.zeros((len(kept) + 1, MARK))
    pull = np.zeros(effect.shape[1])  # derivative of the log likelihood of the later steps
    for k in range(len(kept) - 1, -1, -1):
        mean, covariance, gain, variance = kept[k]
        if gain is not None:
            pull = pull + effect[k] * (innovations[k] / np.sqrt(variance) - gain @ pull)
        state = mean + covariance @ pull
        smoothed[k] = state[:MARK]
        if k == len(kept) - 1:
            smoothed[k + 1] = state[MARK : 2 * MARK]
        # Back through the transition: each new state came from its source with its factor.
        by_factor = factors[k] * pull
        back = by_factor[:MARK] + by_factor[MARK : 2 * MARK]
        pull = np.concatenate([np.zeros(MARK), back, by_factor[2 * MARK :]])
    return smoothed


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


def total_innovations(rows, is_used, others=None, block=100):
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

    Returns
    -------
    ndarray, shape (n, 1 + q)
        The first column is independent N(0, 1) if the model is right. Steps without use are 0.
    """
    right = rows[:, :1] if others is None else np.hstack([rows[:, :1], others])
    innovations, places = np.zeros_like(right), np.flatnonzero(is_used)
    size = rows.shape[1] - 1
    upper, sums = np.eye(size), np.zeros((size, right.shape[1]))
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
