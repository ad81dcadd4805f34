"""Simulation of volumes that no parabola approximates under the error of the datum.

Such volumes are near the empty tank and at edges. They are the sum V = g(t) + R. The volume of the
tank at a dip moved by t u is g(t). The remainder R does not depend on the dip. The distribution of
g(t) is known without draws as a piecewise linear function. With draws of R,

    P(V <= y) = mean of P(g(t) <= y - R).

Products of the datum and another input are neglected.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from tankcal.gum.monte_carlo import ESTIMATES, Simulation, numerical_tolerance
from tankcal.gum.monte_carlo.inputs import inputs_of, sobol_points

PROBES = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])  # tested errors of the datum, in u
TOLERATED = 0.005  # largest error of the parabola, relative to u of the volume
SCORES = np.linspace(-8.0, 8.0, 1601)  # normal scores between which g is linear
# Sets of draws of R, draws in a set, and draws of V that choose the values at which P is computed.
SETS, COUNT, PILOT = 10, 1024, 20_480
GOLDEN = 0.6180339887498949  # golden ratio step of an even sequence in 0 to 1
# Lower tails of an interval, relative to the probability outside it.
TAILS = np.concatenate([[1e-3], np.linspace(0.025, 1.0, 40)])


def bent_rows(body, levels_m, u_m, slope_m3, second_m3, u_m3):
    """Mask (rows,) of volumes that a parabola in the datum does not approximate within three u.

    Parameters
    ----------
    body : Body
    levels_m : ndarray, shape (rows,)
        Levels of the rows, m.
    u_m : float
        Standard uncertainty of the datum, m.
    slope_m3, second_m3 : ndarray, shape (rows,)
        First and second derivatives by the datum, times u and u squared, m3.
    u_m3 : ndarray, shape (rows,)
        Standard uncertainties of the volumes, m3.

    Returns
    -------
    ndarray of bool, shape (rows,)
    """
    volume_m3 = body.volume_m3(levels_m)
    change_m3 = np.stack(
        [body.moved_m3(levels_m, u_m * probe) - volume_m3 for probe in PROBES], axis=1
    )
    parabola = slope_m3[:, None] * PROBES + second_m3[:, None] * PROBES**2 / 2
    return np.max(np.abs(change_m3 - parabola), axis=1) > TOLERATED * u_m3


@dataclass(frozen=True)
class DatumLaw:
    """Effect of the datum alone on the volumes of rows.

    Attributes
    ----------
    below : ndarray, shape (edges,)
        Probability below each edge of the distribution of the datum.
    added_m3 : ndarray, shape (rows, edges)
        Change of the volumes at each edge, m3.
    """

    below: np.ndarray
    added_m3: np.ndarray


def datum_law(body, levels_m, u_m, distribution):
    """`DatumLaw` of rows.

    Parameters
    ----------
    body : Body
    levels_m : ndarray, shape (rows,)
        Levels of the rows, m.
    u_m : float
        Standard uncertainty of the datum, m.
    distribution
        Distribution of the datum, in units of u_m.

    Returns
    -------
    DatumLaw
    """
    below = ndtr(SCORES)
    steps = u_m * distribution.quantile(below)
    grid = np.repeat(levels_m, len(steps)), np.tile(steps, len(levels_m))
    moved = body.moved_m3(*grid).reshape(len(levels_m), len(steps))
    return DatumLaw(below, moved - body.volume_m3(levels_m)[:, None])


def simulate_bent(rest, distributions, added_m3, below, goal):
    """`monte_carlo.Simulation` of volumes g(t) + R.

    Parameters
    ----------
    rest : monte_carlo.QuadraticRows
        R as a function of the inputs.
    distributions : sequence
        Distributions of these inputs.
    added_m3 : ndarray, shape (volumes, edges)
        g(t), m3.
    below : ndarray, shape (edges,)
        Probability below each edge.
    goal : monte_carlo.Goal

    Returns
    -------
    Simulation
    """
    inputs = inputs_of(distributions, None) if distributions else None
    # Independent randomised sets give the standard error of each estimate from their scatter.
    seeds = np.random.SeedSequence(goal.seed).spawn(SETS)
    sets = [
        inputs.draws(sobol_points(COUNT, len(distributions), seed))[0]
        if inputs
        else np.zeros((1, 0))
        for seed in seeds
    ]
    drawn = np.stack([rest(draws) - rest.value for draws in sets])  # (sets, count, volumes)
    linear = np.stack([draws @ rest.jacobian.T for draws in sets])
    estimates = np.empty((SETS, len(ESTIMATES), len(rest.value)))
    for volume, added in enumerate(added_m3):
        law = _Law(added, below)
        of_rest = drawn[:, :, volume]
        estimates[:, :2, volume] = _moments(
            law, of_rest, linear[:, :, volume], rest, volume, inputs
        )
        estimates[:, 2:, volume] = _ends(law, of_rest, goal.probability)
        estimates[:, [0, 2, 3, 4, 5], volume] += rest.value[volume]
    with np.errstate(invalid="ignore"):
        errors = np.std(estimates, axis=0, ddof=1) / np.sqrt(SETS)
    means = np.mean(estimates, axis=0)
    count = len(rest.value)
    return Simulation(
        **dict(zip(ESTIMATES, means, strict=True)),
        **{f"se_{name}": error for name, error in zip(ESTIMATES, errors, strict=True)},
        tolerance=numerical_tolerance(means[1], goal.digits),
        reached=np.full(count, True),
        draws=np.full(count, SETS * COUNT),
        controlled=np.full(count, True),
        probability=goal.probability,
    )


class _Law:
    """Distribution of g(t), linear between edges, with an atom where g is constant."""

    def __init__(self, added, below):
        mass = np.diff(below)
        first, last = added[:-1], added[1:]
        self.mean = float(mass @ (first + last) / 2)
        # Second moment of a variable uniform between the ends of a piece.
        square = mass @ (first**2 + first * last + last**2) / 3
        self.variance = max(float(square - self.mean**2), 0.0)
        low, high = np.minimum(first, last), np.maximum(first, last)
        is_constant = high - low <= 1e-12 * max(np.abs(added).max(), 1e-300)
        # The density is a step function: it rises at the lower end of each piece, falls at its
        # upper end.
        density = mass[~is_constant] / (high - low)[~is_constant]
        zeros = np.zeros(np.count_nonzero(is_constant))
        place = np.concatenate([low[~is_constant], high[~is_constant], low[is_constant]])
        steeper = np.concatenate([density, -density, zeros])
        jumps = np.concatenate([0 * density, 0 * density, mass[is_constant]])
        order = np.argsort(place, kind="stable")
        self.place = place[order]
        # Integrating the steps gives the linear parts of the distribution function; atoms are
        # jumps.
        straight = np.cumsum(steeper[order])[:-1] * np.diff(self.place)
        self.below = np.concatenate([[0.0], np.cumsum(straight)]) + np.cumsum(jumps[order])
        # Rounding may not make the distribution function decrease or leave 0 to 1.
        self.below = np.maximum.accumulate(np.clip(self.below / self.below[-1], 0, 1))

    def cdf(self, y):
        """Probability that g(t) is at most y."""
        return np.interp(y, self.place, self.below, left=0.0, right=1.0)

    def quantile(self, p):
        """Value with probability p below it."""
        return np.interp(p, self.below, self.place)


def _moments(law, of_rest, linear, rest, volume, ready):
    """Mean and standard uncertainty (sets, 2) of the volumes.

    The linear part of R is known exactly; the draws contribute only its curvature.
    """
    slopes = rest.jacobian[volume]
    is_active, sds = (
        slopes != 0,
        np.array([distribution.sd for distribution in ready.distributions] if ready else []),
    )
    linear_variance = np.sum((slopes[is_active] * sds[is_active]) ** 2)
    nonlinear = of_rest - linear
    spread = linear_variance + nonlinear.var(axis=1) + law.variance
    return np.stack([law.mean + nonlinear.mean(axis=1), np.sqrt(spread)], axis=1)


def _ends(law, of_rest, probability):
    """Ends (sets, 4) of the symmetric and of the shortest coverage interval."""
    tails = (1 - probability) * TAILS
    uniform = (np.arange(PILOT) * GOLDEN + 0.5) % 1.0
    pilot = np.sort(law.quantile(uniform) + np.resize(of_rest, PILOT))
    ends_of_sets = np.empty((len(of_rest), 4))
    y = [np.quantile(pilot, tails), np.quantile(pilot, 1 - tails[::-1])]
    for ends, rest in zip(ends_of_sets, of_rest, strict=True):
        # Averaging the exact probabilities over the draws of R gives P(V <= y), smoother than
        # counting.
        below = [law.cdf(values[:, None] - rest).mean(axis=1) for values in y]
        low = np.interp(tails, np.maximum.accumulate(below[0]), y[0])
        high = np.interp(tails + probability, np.maximum.accumulate(below[1]), y[1])
        middle = np.searchsorted(tails, (1 - probability) / 2)
        # The shortest interval is the minimum over all divisions of the tails.
        shortest = np.argmin(high - low)
        ends[:] = low[middle], high[middle], low[shortest], high[shortest]
    return ends_of_sets
