"""Volumes of a table and of its deliveries, as functions of few coordinates."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.gum.distributions import standard
from tankcal.gum.monte_carlo import (
    ESTIMATES,
    QuadraticRows,
    numerical_tolerance,
    simulate_quadratic,
)
from tankcal.pipeline.simulation.bent import bent_rows, datum_law, simulate_bent
from tankcal.pipeline.simulation.curvature import curvature

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
            simulation = _merged(simulation, even, self._simulate_bent_rows(bent, goal), bent)
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


def _merged(quadratic, even, bent_simulation, bent):
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
