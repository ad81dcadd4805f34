"""Volumes that no parabola follows: next to the empty tank, and at edges, under the datum's error.

Such a volume is V = g(t) + R: g(t) the tank's own volumes at dips moved by t u, R everything else,
which does not ask where the dip stands. The law of g(t) is known without draws, piece by piece; the
draws of R give

    P(V <= y) = mean of P(g(t) <= y - R).

Products of the datum and another input are left out here.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from tankcal.gum.monte_carlo import ESTIMATES, Simulation, numerical_tolerance
from tankcal.gum.monte_carlo.inputs import inputs_of
from tankcal.gum.monte_carlo.sobol import sobol_points

PROBES = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])  # in u, where the parabola is tried
TOLERATED = 0.005  # of u of the volume
SCORES = np.linspace(-8.0, 8.0, 1601)  # normal scores between which g is straight
SETS, COUNT, PILOT = 10, 1024, 20_480  # of draws of R; of V, to place where P is computed
GOLDEN = 0.6180339887498949  # steps by which numbers fill 0 to 1 evenly
TAILS = np.concatenate([[1e-3], np.linspace(0.025, 1.0, 40)])  # of all that lies beyond the ends


def bent_rows(body, levels_m, u_m, slope_m3, second_m3, u_m3):
    """(rows,) bool: whether a parabola by the datum leaves the volumes within three u of it.

    slope_m3, second_m3 (rows,) first and second derivative by the datum, times u and u squared
    """
    here = body.volume_m3(levels_m)
    exact = np.stack([body.moved_m3(levels_m, u_m * probe) - here for probe in PROBES], axis=1)
    parabola = slope_m3[:, None] * PROBES + second_m3[:, None] * PROBES**2 / 2
    return np.max(np.abs(exact - parabola), axis=1) > TOLERATED * u_m3


@dataclass(frozen=True)
class DatumLaw:
    """What the datum alone does to rows: edges of its distribution, what each adds.

    below  (edges,) probability below each edge
    added_m3 (rows, edges)
    """

    below: np.ndarray
    added_m3: np.ndarray


def datum_law(body, levels_m, u_m, distribution):
    """`DatumLaw` of rows for a datum of standard uncertainty u_m; distribution in units of it."""
    below = ndtr(SCORES)
    steps = u_m * distribution.quantile(below)
    every = np.repeat(levels_m, len(steps)), np.tile(steps, len(levels_m))
    moved = body.moved_m3(*every).reshape(len(levels_m), len(steps))
    return DatumLaw(below, moved - body.volume_m3(levels_m)[:, None])


def simulate_bent(rest, distributions, added_m3, below, goal):
    """`monte_carlo.Simulation` of volumes g(t) + R.

    rest           `monte_carlo.QuadraticRows` of R, by inputs with these distributions
    added_m3       (volumes, edges) g(t); below (edges,) probability below each edge
    """
    ready = inputs_of(distributions, None) if distributions else None
    seeds = np.random.SeedSequence(goal.seed).spawn(SETS)
    sets = [
        ready.draws(sobol_points(COUNT, len(distributions), seed))[0] if ready else np.zeros((1, 0))
        for seed in seeds
    ]
    drawn = np.stack([rest(one) - rest.value for one in sets])  # (sets, count, volumes)
    linear = np.stack([one @ rest.jacobian.T for one in sets])
    found = np.empty((SETS, len(ESTIMATES), len(rest.value)))
    for volume, added in enumerate(added_m3):
        law = _Law(added, below)
        of_rest = drawn[:, :, volume]
        found[:, :2, volume] = _moments(law, of_rest, linear[:, :, volume], rest, volume, ready)
        found[:, 2:, volume] = _ends(law, of_rest, goal.probability)
        found[:, [0, 2, 3, 4, 5], volume] += rest.value[volume]
    with np.errstate(invalid="ignore"):
        errors = np.std(found, axis=0, ddof=1) / np.sqrt(SETS)
    means = np.mean(found, axis=0)
    count = len(rest.value)
    return Simulation(
        **dict(zip(ESTIMATES, means, strict=True)),
        **{f"se_{name}": one for name, one in zip(ESTIMATES, errors, strict=True)},
        tolerance=numerical_tolerance(means[1], goal.digits),
        reached=np.full(count, True),
        draws=np.full(count, SETS * COUNT),
        controlled=np.full(count, True),
        probability=goal.probability,
    )


class _Law:
    """The distribution of g(t), straight between edges; where g stands still it has an atom."""

    def __init__(self, added, below):
        mass = np.diff(below)
        first, last = added[:-1], added[1:]
        self.mean = float(mass @ (first + last) / 2)
        square = mass @ (first**2 + first * last + last**2) / 3
        self.variance = max(float(square - self.mean**2), 0.0)
        low, high = np.minimum(first, last), np.maximum(first, last)
        still = high - low <= 1e-12 * max(np.abs(added).max(), 1e-300)
        density = mass[~still] / (high - low)[~still]
        nothing = np.zeros(np.count_nonzero(still))
        place = np.concatenate([low[~still], high[~still], low[still]])
        steeper = np.concatenate([density, -density, nothing])
        jumps = np.concatenate([0 * density, 0 * density, mass[still]])
        order = np.argsort(place, kind="stable")
        self.place = place[order]
        straight = np.cumsum(steeper[order])[:-1] * np.diff(self.place)
        self.below = np.concatenate([[0.0], np.cumsum(straight)]) + np.cumsum(jumps[order])
        self.below = np.maximum.accumulate(np.clip(self.below / self.below[-1], 0, 1))

    def cdf(self, y):
        """Probability of g(t) at y or below."""
        return np.interp(y, self.place, self.below, left=0.0, right=1.0)

    def quantile(self, p):
        """Value with probability p below it."""
        return np.interp(p, self.below, self.place)


def _moments(law, of_rest, linear, rest, volume, ready):
    """(sets, 2) mean and u: the linear part of R is known, what is added comes from the draws."""
    slopes = rest.jacobian[volume]
    felt, sds = (
        slopes != 0,
        np.array([distribution.sd for distribution in ready.distributions] if ready else []),
    )
    known = np.sum((slopes[felt] * sds[felt]) ** 2)
    curved = of_rest - linear
    spread = known + curved.var(axis=1) + law.variance
    return np.stack([law.mean + curved.mean(axis=1), np.sqrt(spread)], axis=1)


def _ends(law, of_rest, probability):
    """(sets, 4) ends of the symmetric and of the shortest interval."""
    tails = (1 - probability) * TAILS
    even = (np.arange(PILOT) * GOLDEN + 0.5) % 1.0
    pilot = np.sort(law.quantile(even) + np.resize(of_rest, PILOT))
    found = np.empty((len(of_rest), 4))
    y = [np.quantile(pilot, tails), np.quantile(pilot, 1 - tails[::-1])]
    for ends, rest in zip(found, of_rest, strict=True):
        below = [law.cdf(one[:, None] - rest).mean(axis=1) for one in y]
        low = np.interp(tails, np.maximum.accumulate(below[0]), y[0])
        high = np.interp(tails + probability, np.maximum.accumulate(below[1]), y[1])
        middle = np.searchsorted(tails, (1 - probability) / 2)
        shortest = np.argmin(high - low)
        ends[:] = low[middle], high[middle], low[shortest], high[shortest]
    return found
