"""Monte Carlo simulation of a capacity table, with a verdict for each row.

The simulation uses the same inputs as the propagation, and the volumes of the tank itself. Sources:
JCGM 101:2008, clause 8 for the verdict; JCGM 102:2011, 7.

Simulation of all rows of a table and of deliveries between its dips.

Simulation of volumes that no parabola approximates under the error of the datum.

Such volumes are near the empty tank and at edges. They are the sum V = g(t) + R. The volume of the
tank at a dip moved by t u is g(t). The remainder R does not depend on the dip. The distribution of
g(t) is known without draws as a piecewise linear function. With draws of R,

    P(V <= y) = mean of P(g(t) <= y - R).

Products of the datum and another input are neglected.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from tankcal.gum.distributions import standard
from tankcal.gum.monte_carlo import (
    ESTIMATES,
    Goal,
    QuadraticRows,
    Simulation,
    Verdict,
    numerical_tolerance,
    simulate_quadratic,
    verdict,
)
from tankcal.gum.monte_carlo.inputs import inputs_of, sobol_points
from tankcal.messages import message
from tankcal.pipeline.simulation.curvature import (
    Intervals,
    curvature,
    gum_intervals,
    judged_intervals,
)
from tankcal.tank.deliveries import Deliveries, deliveries

__all__ = ["Intervals", "TableSimulation", "gum_intervals", "simulate_table"]


SIMULATING = message("simulating", "simulating the table")
PROBES = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])  # tested errors of the datum, in u
TOLERATED = 0.005  # largest error of the parabola, relative to u of the volume
SCORES = np.linspace(-8.0, 8.0, 1601)  # normal scores between which g is linear
# Sets of draws of R, draws in a set, and draws of V that choose the values at which P is computed.
SETS, COUNT, PILOT = 10, 1024, 20_480
GOLDEN = 0.6180339887498949  # golden ratio step of an even sequence in 0 to 1
# Lower tails of an interval, relative to the probability outside it.
TAILS = np.concatenate([[1e-3], np.linspace(0.025, 1.0, 40)])


@dataclass(frozen=True)
class TableSimulation:
    """Monte Carlo simulation of a table and of deliveries.

    Attributes
    ----------
    found, judged : monte_carlo.Simulation, Verdict
        Results for the rows.
    delivered : deliveries.Deliveries
        Simulated deliveries.
    of_deliveries : (Simulation, Verdict)
        Results for the deliveries.
    smooth : ndarray of bool, shape (deliveries,)
        Whether a parabola in the datum approximates the volumes.
    curved : tuple of (str, str)
        Pairs of inputs with a significant second derivative.
    bent : ndarray of bool, shape (rows,)
        Whether the row was simulated with the volumes of the tank instead of a parabola.
    drawn : int
        Number of rows with draws; other rows of a long table are interpolated.
    seed, digits : int
        Seed of the draws, and significant digits of u for the verdict.
    """

    found: Simulation
    judged: Verdict
    delivered: Deliveries
    of_deliveries: tuple[Simulation, Verdict]
    smooth: np.ndarray
    curved: tuple[tuple[str, str], ...]
    bent: np.ndarray
    drawn: int
    seed: int
    digits: int

    def intervals(self, table):
        """`Intervals` of the rows of the simulated table."""
        return judged_intervals(self.judged, table.volume_m3, table.u_m3, table.U_m3, least_m3=0.0)

    @property
    def of_delivered(self):
        """`Intervals` of the simulated deliveries."""
        delivered = self.delivered
        return judged_intervals(
            self.of_deliveries[1], delivered.volume_m3, delivered.u_m3, delivered.U_m3
        )


def simulate_table(job, survey, body, zero_m, table, pairs=(), *, goal=None, progress=None):
    """`TableSimulation` of a `Capacity`.

    Parameters
    ----------
    job, survey, body, zero_m
        Origin of the table, as in `result.Result`.
    table : Capacity
    pairs : sequence of (float, float)
        Dips of deliveries to simulate, m.
    goal : monte_carlo.Goal, optional
        Its probability is replaced by that of the table.
    progress : callable, optional
        Called as progress(text, done, total).

    Raises
    ------
    HeightError
        For a dip outside the table.
    """
    goal = replace(goal or Goal(), probability=table.probability)
    report = progress and (lambda text, done, total: progress(SIMULATING, done, total))
    low, high = np.array(pairs, dtype=float).reshape(-1, 2).T
    model = Model(job, survey, body, zero_m, table, table.weights(high) - table.weights(low))
    simulation, drawn = model.simulated(goal, report)
    rows, of_deliveries = (
        replace(simulation, **{name: values[part] for name, values in simulation.by_volume.items()})
        for part in model.parts
    )
    delivered = deliveries(table, low, high)
    of_delivered = delivered.volume_m3, delivered.u_m3, delivered.dof
    return TableSimulation(
        found=rows,
        judged=verdict(rows, table.volume_m3, table.u_m3, table.dof, digits=goal.digits),
        delivered=delivered,
        of_deliveries=(of_deliveries, verdict(of_deliveries, *of_delivered, digits=goal.digits)),
        smooth=~model.bent[model.parts[1]],
        curved=model.curved.pairs,
        bent=model.bent[model.parts[0]],
        drawn=drawn,
        seed=goal.seed,
        digits=goal.digits,
    )


# ---- simulation of volumes that no parabola approximates under the error of the datum


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


# ---- volumes of a table and of its deliveries, as functions of few coordinates


# A table is simulated with independent coordinates, each in units of its u.
#
# A source of one column is a coordinate with the distribution of its input. Columns of a source
# that were estimated together (points) have a common scale. Their contribution to a volume is |c|
# T, with T
# of Student's t for their degrees of freedom. This equals one coordinate of size |c| (multivariate
# t, JCGM 101:2008 6.4.9). Computed normal sources are pooled in the same way.
#
# Correlated inputs are x = L e with R = L L', where each e has the distribution of its input.
# Normal inputs are then jointly normal (6.4.8). For other inputs the covariances hold, and the
# first input
# keeps its distribution.


@dataclass(frozen=True)
class Coordinates:
    """Independent coordinates of a simulation.

    Attributes
    ----------
    distributions : tuple, length n
        Distributions in units of the standard uncertainties.
    slopes : ndarray, shape (volumes, n)
        Derivatives of the volumes, m3.
    place : dict
        {name of a declared input: its index}.
    """

    distributions: tuple
    slopes: np.ndarray
    place: dict


def coordinates(sources):
    """`Coordinates` of sources whose columns have one row per volume."""
    distributions, slopes, place = [], [], {}
    normal_squares = 0.0
    for source in sources:
        columns = source.columns_m3.T
        if source.parts:
            distributions += [_distribution(part) for part in source.parts]
            slopes += list(columns)
            continue
        if not (source.u is not None or source.distribution not in ("normal", "t")):
            squares = np.sum(columns**2, axis=0)
            if np.isinf(source.dof):
                normal_squares = normal_squares + squares
                continue
            columns = [np.sqrt(squares)]
        elif len(columns) == 1:
            place[source.kind] = len(distributions)
        distributions += [_distribution(source)] * len(columns)
        slopes += list(columns)
    if np.any(normal_squares):
        distributions.append(standard(1.0))
        slopes.append(np.sqrt(normal_squares))
    rows = len(sources[0].columns_m3) if sources else 0
    stacked = np.stack(slopes, axis=1) if slopes else np.empty((rows, 0))
    return Coordinates(tuple(distributions), stacked, place)


def _distribution(source):
    """Distribution of a source: Student's t (JCGM 101:2008 6.4.9) for readings, or its own."""
    return standard(1.0, source.distribution, dof=source.dof, u_is=source.u_is)


UNFELT = 1e-4  # contribution, relative to u of a volume, below which an input is not drawn
COUNTED = ("reached", "controlled", "draws", "tolerance")  # copied from a simulated row

# Largest number of simulated rows: in total, not quadratic, and with plain draws. The other rows of
# a longer table are interpolated.
MOST_ROWS, MOST_BENT, MOST_PLAIN = 800, 60, 40


class Model:
    """Volumes of a table and of its deliveries as functions of independent coordinates.

    The volumes of the rows come first, then those of the deliveries. A coordinate is in units of
    the u of its input, so that a slope is a contribution in m3.

    Parameters
    ----------
    job, survey, body, zero_m, table
        Origin of the table, as in `result.Result`.
    weights : ndarray, shape (deliveries, rows)
        Weights of the rows in the volumes of the deliveries.
    """

    def __init__(self, job, survey, body, zero_m, table, weights):
        self.body, self.table, self.weights = body, table, weights
        self.rows = len(table.height_m)
        self.parts = slice(0, self.rows), slice(self.rows, None)
        self.levels = np.minimum(table.height_m + zero_m, body.highest_m)
        self.inputs = coordinates([source.mapped(self._both) for source in table.sources])
        declared = body.declared if body.is_bent else ()
        u = {
            declared_input.name: declared_input.u
            for declared_input in declared
            if declared_input.name in self.inputs.place and declared_input.u
        }
        self.datum_m = u.get("datum", 0.0)
        self.curved = curvature(job, survey, body, self.levels, u, table.u_m3)
        self.quadratic = self._quadratic()
        self.bent = self._bent()
        self.some_even = self._thinned(np.flatnonzero(~self.bent), MOST_ROWS)
        self.some_bent = self._thinned(np.flatnonzero(self.bent), MOST_BENT)

    def simulated(self, goal, progress):
        """`monte_carlo.Simulation` of all volumes, and the number of rows with draws."""
        even, bent = self.some_even, self.some_bent
        simulation, kept = simulate_quadratic(
            self.quadratic.subset(even),
            self.inputs.distributions,
            goal=goal,
            progress=progress,
            choose=lambda hard: np.searchsorted(even, self._thinned(even[hard], MOST_PLAIN)),
        )
        even = even[kept]
        if len(bent):
            simulation = _merge(simulation, even, self._simulate_bent_rows(bent, goal), bent)
        places = np.sort(np.concatenate([even, bent]))
        u = np.linalg.norm(self.inputs.slopes, axis=1)
        all_volumes = spread_to_all(simulation, places, self.quadratic.value, u, goal.digits)
        endless = [not np.isfinite(distribution.sd) for distribution in self.inputs.distributions]
        # A volume that depends on an input without a finite variance has no standard uncertainty.
        without_u = np.any(self.inputs.slopes[:, endless] != 0, axis=1)
        all_volumes = replace(all_volumes, u=np.where(without_u, np.inf, all_volumes.u))
        return all_volumes, int(np.count_nonzero(places < self.rows))

    def _both(self, of_rows):
        """Values of the rows, followed by those of the deliveries."""
        return np.concatenate([of_rows, self.weights @ of_rows])

    def _thinned(self, volumes, most):
        """At most `most` evenly spaced rows among these volumes, and all deliveries."""
        rows = volumes[volumes < self.rows]
        chosen_rows = np.linspace(0, len(rows) - 1, min(most, len(rows))).round().astype(int)
        return np.concatenate([rows[chosen_rows], volumes[len(rows) :]])

    def _quadratic(self):
        """`QuadraticRows` of all volumes, from slopes and second derivatives."""
        count, pairs = len(self.inputs.distributions), self.curved.pairs
        hessians = np.zeros((max(len(pairs), 1), count, count))
        for hessian, (first_input, second_input) in zip(hessians, pairs, strict=False):
            i, j = self.inputs.place[first_input], self.inputs.place[second_input]
            # Taylor: f_aa d_a^2 / 2, but f_ab d_a d_b, since f_ab and f_ba both contribute
            half = 0.25 if first_input == second_input else 0.5
            hessian[i, j] += half
            hessian[j, i] += half
        second = self.curved.values if pairs else np.zeros((self.rows, 1))
        return QuadraticRows(
            self._both(self.table.volume_m3),
            self.inputs.slopes,
            hessians,
            self._both(second),
            np.zeros(count),
        )

    def _bent(self):
        """Mask (volumes,) of the volumes that are not quadratic.

        A delivery is not quadratic if one of its rows is not.
        """
        rows = np.zeros(self.rows, dtype=bool)
        if self.datum_m:
            pair = ("datum", "datum")
            is_kept = pair in self.curved.pairs
            second = self.curved.values[:, self.curved.pairs.index(pair)] if is_kept else 0.0 * rows
            slope = self.inputs.slopes[self.parts[0], self.inputs.place["datum"]]
            rows = bent_rows(self.body, self.levels, self.datum_m, slope, second, self.table.u_m3)
        return np.concatenate([rows, (self.weights != 0) @ rows > 0])

    def _simulate_bent_rows(self, bent, goal):
        """`Simulation` of the volumes that are not quadratic, by their significant inputs."""
        datum, slopes = self.inputs.place["datum"], np.abs(self.inputs.slopes[bent])
        is_active = np.any(slopes > UNFELT * np.linalg.norm(slopes, axis=1, keepdims=True), axis=0)
        is_active[datum] = False
        indices = np.flatnonzero(is_active)
        part = self.quadratic.subset(bent)
        rest = replace(
            part,
            jacobian=part.jacobian[:, indices],
            hessians=part.hessians[:, indices][:, :, indices],
            mean=np.zeros(len(indices)),
        )
        weights = self._weights_of(bent)
        needed = np.flatnonzero(np.any(weights != 0, axis=0))
        unit = self.inputs.distributions[datum]
        law = datum_law(self.body, self.levels[needed], self.datum_m, unit)
        distributions = [self.inputs.distributions[place] for place in indices]
        return simulate_bent(
            rest, distributions, weights[:, needed] @ law.added_m3, law.below, goal
        )

    def _weights_of(self, volumes):
        """Weights (volumes, rows) of the rows in these volumes."""
        rows_chosen = volumes[volumes < self.rows]
        weights = np.zeros((len(volumes), self.rows))
        weights[np.arange(len(rows_chosen)), rows_chosen] = 1.0
        weights[len(rows_chosen) :] = self.weights[volumes[len(rows_chosen) :] - self.rows]
        return weights


def _merge(quadratic, even, bent_simulation, bent):
    """Combine two simulations of different volumes into one."""
    order = np.argsort(np.concatenate([even, bent]))
    pairs = zip(quadratic.by_volume.items(), bent_simulation.by_volume.values(), strict=True)
    return replace(quadratic, **{name: np.concatenate([a, b])[order] for (name, a), b in pairs})


def spread_to_all(found, places, value_m3, u_m3, digits):
    """Simulation of all volumes from that of the volumes at `places`.

    Between simulated volumes all estimates are interpolated linearly, relative to the u of the law
    of propagation. Volumes of neighbouring rows have nearly the same distribution.

    Parameters
    ----------
    found : Simulation
    places : ndarray of int, shape (k,)
        Indices of the simulated volumes.
    value_m3, u_m3 : ndarray, shape (volumes,)
        Volumes and their standard uncertainties by the law of propagation, m3.
    digits : int
        Significant digits of u for the numerical tolerance.

    Returns
    -------
    Simulation
    """
    indices, next_place = (
        np.arange(len(value_m3)),
        np.searchsorted(places, np.arange(len(value_m3))),
    )
    size, full = np.where(u_m3 > 0, u_m3, 1.0), {}
    for name, estimates in found.by_volume.items():
        if name in COUNTED:
            full[name] = estimates[np.minimum(next_place, len(places) - 1)]
            continue
        offset = value_m3 if name in ESTIMATES and name != "u" else np.zeros(len(value_m3))
        parts = (estimates - offset[places]) / size[places]
        full[name] = offset + size * np.interp(indices, places, parts)
    tolerance = numerical_tolerance(np.where(np.isfinite(full["u"]), full["u"], u_m3), digits)
    return replace(found, **full | {"tolerance": tolerance})
