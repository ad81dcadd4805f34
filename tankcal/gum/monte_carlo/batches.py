"""Any model, in batches of draws, with its linear part as control variate where that helps.

V_p = the sample's quantile at p + beta (F_L,sample(L_p) - p): the linear part L has a known
quantile L_p, and what the draws got wrong about it corrects what they say about V. So for u:
u^2 = s_V^2 - b (s_L^2 - u_L^2). beta and b by regression inside the batch: without a linear part,
or where it says nothing, they vanish and plain draws remain.
Sources: JCGM 101:2008 7.5 to 7.7, 7.9.4; control variates: Owen 2013 8.9.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from scipy.special import ndtr, ndtri

LEVELS = 501  # lower ends among which the shortest interval is sought
WINDOW = 51  # of them, over which its length is averaged: no lucky gap between draws wins
NODES = 33  # levels at which the law of the linear part is tabulated
FEWEST = 10  # batches, for a standard error
LEAST, MOST = 10, 16  # log2 of the draws of a batch


class Batches:
    """Mean and standard error of estimates over independent batches."""

    def __init__(self, rows):
        self.count = 0
        self.plain = np.zeros((3, rows))
        self.mean = np.zeros((6, rows))
        self.squares = np.zeros((6, rows))

    def add(self, estimates, plain):
        """Take in the (6, rows) estimates of one more batch, and what plain draws would err."""
        self.count += 1
        self.plain += (plain - self.plain) / self.count
        finite = np.isfinite(estimates)  # u is not, of Student's t with two degrees of freedom
        change = np.where(finite, estimates, 0.0) - np.where(finite, self.mean, 0.0)
        self.mean = np.where(finite, self.mean + change / self.count, estimates)
        self.squares += change**2 * (1 - 1 / self.count)

    @property
    def estimates(self):
        """(6, rows) means over the batches; u about the common mean, not about each batch's own.

        u^2 = mean of the batches' squares about their means + variance of these means.
        """
        found = self.mean.copy()
        found[1] = np.sqrt(found[1] ** 2 + self.squares[0] / max(self.count - 1, 1))
        return found

    @property
    def errors(self):
        """(6, rows) standard errors of the mean."""
        return np.sqrt(self.squares / (self.count * max(self.count - 1, 1)))


def batch_size(rows, inputs, goal):
    """Draws of a batch, a power of two, 1024 at least: within goal.memory, several batches."""
    fitting = min(goal.memory / (8 * (4 * rows + 6 * inputs)), goal.plain_draws / FEWEST)
    return 1 << int(np.clip(np.floor(np.log2(max(fitting, 1))), LEAST, MOST))


@dataclass(frozen=True)
class Control:
    """What is known of the linear parts without draws; they are symmetric about 0.

    coefficients  (rows, n) by the coordinates of the inputs
    quantile      (rows, NODES) at nodes_of(probability)
    u             (rows,) standard deviation
    known         (rows,) False where there is no linear part or its law was not found
    """

    coefficients: np.ndarray
    quantile: np.ndarray
    u: np.ndarray
    known: np.ndarray


def nodes_of(probability):
    """(NODES,) levels at which the law of the linear part is tabulated, evenly spread in score."""
    widest = 1 - probability
    return ndtr(np.linspace(ndtri(widest / 100), ndtri(widest), NODES))


def estimates_of(values, coordinates, control, probability):
    """(6, rows) estimates from one batch, and the (3, rows) standard errors of a plain draw.

    values  (draws, rows) of the model; coordinates  (draws, n) behind its inputs, or None
    control  Control, or None for plain draws
    """
    found, plain = np.empty((6, values.shape[1])), np.empty((3, values.shape[1]))
    for row in range(values.shape[1]):
        one, aid = values[:, row], None
        if control is not None and control.known[row]:
            linear = coordinates @ control.coefficients[row]
            aid = (linear, control.quantile[row], control.u[row])
        found[:, row], plain[:, row] = _row(one, aid, probability)
    return found, plain


def _row(values, aid, probability):
    mean, deviation = np.mean(values), np.std(values)
    lower = np.linspace(0, 1 - probability, LEVELS)
    levels = np.stack([lower, lower + probability])
    if aid is not None:
        linear, _, u = aid
        mean, deviation = _moments(values, linear, u, mean, deviation)
        levels = _levels(values, aid, levels, probability)
    ordered = np.sort(values)
    count = len(ordered)
    place = (np.arange(1, count + 1) - 1 / 3) / (count + 1 / 3)
    ends = np.interp(levels, place, ordered)
    middle = ends[:, (LEVELS - 1) // 2]
    length = scipy.ndimage.uniform_filter1d(ends[1] - ends[0], WINDOW, mode="nearest")
    shortest = ends[:, np.argmin(length)]
    return (mean, deviation, *middle, *shortest), _plain(values, place, ordered, probability)


def _plain(values, place, ordered, probability):
    """Standard errors of u and of both ends if all came from a single plain draw.

    sqrt((m4/m2^2 - 1)/4) u, and sqrt(p (1 - p)) dV_p/dp with the slope over +- p/5.
    """
    squares = (values - np.mean(values)) ** 2
    spread = np.mean(squares)
    tail = (1 - probability) / 2
    reach = tail / 5
    levels = np.array([tail - reach, tail + reach, 1 - tail - reach, 1 - tail + reach])
    ends = np.interp(levels, place, ordered)
    slopes = (ends[1::2] - ends[::2]) / (2 * reach)
    of_u = np.std(squares) / (2 * np.sqrt(spread)) if spread > 0 else 0.0
    return of_u, *(np.sqrt(tail * (1 - tail)) * slopes)


def _moments(values, linear, u, mean, deviation):
    centred, straight = values - mean, linear - np.mean(linear)
    spread = np.mean(straight**2)
    if not spread > 0:
        return mean, deviation
    mean = mean - np.mean(centred * straight) / spread * np.mean(linear)
    if not np.isfinite(u):
        return mean, np.inf
    first, second = centred**2, straight**2
    second_centred = second - spread
    factor = np.mean(first * second_centred) / np.mean(second_centred**2)
    variance = deviation**2 - factor * (np.var(linear) - u**2)
    return mean, np.sqrt(max(variance, 0.0))


def _levels(values, aid, levels, probability):
    """The levels, moved by what the draws got wrong about the linear part at its quantiles."""
    linear, quantiles, _ = aid
    nodes = nodes_of(probability)
    ordered = np.sort(linear)
    corrected = np.empty_like(levels)
    for side, sign in ((0, 1), (1, -1)):
        tails = levels[side] if side == 0 else 1 - levels[side]
        inside = tails >= nodes[0] * (1 - 1e-9)
        at = sign * np.interp(ndtri(tails[inside]), ndtri(nodes), quantiles)
        seen = (np.searchsorted(ordered, at, side="right") + 1 / 6) / (len(linear) + 1 / 3)
        middle = np.argmin(np.abs(tails[inside] - (1 - probability) / 2))
        below = values <= np.quantile(values, levels[side][(LEVELS - 1) // 2])
        straight = linear <= at[middle]
        spread = seen[middle] * (1 - seen[middle])
        joint = np.mean(below & straight) - np.mean(below) * seen[middle]
        factor = joint / spread if spread > 0 else 0.0
        corrected[side] = levels[side]
        corrected[side][inside] += factor * (seen - levels[side][inside])
    return np.clip(corrected, 0, 1)
