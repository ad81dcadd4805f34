"""The volumes of a table and of deliveries from it, as functions of few coordinates."""

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

# The independent coordinates that a table is simulated with, each of them in units of its u.
#
# A source of one column is a coordinate with the distribution of its input. The columns of a source
# that were found together (points) have a common scale: whatever one volume says of them is |c| T
# with T of Student's t for their degrees of freedom, the same as one coordinate of size |c|
# (multivariate t, JCGM 101:2008 6.4.9). Normal sources that were computed are pooled in the same
# way.
#
# Correlated inputs are x = L e with R = L L': each e has the shape of its own input. Normal ones
# are jointly normal then (6.4.8); of others the covariances hold, and the shape of the first.


@dataclass(frozen=True)
class Coordinates:
    """distributions (n,); slopes (volumes, n) m3; place {name of a declared input: its number}."""

    distributions: tuple
    slopes: np.ndarray
    place: dict


def coordinates(sources):
    """`Coordinates` of sources whose columns have one row for each volume."""
    distributions, slopes, place = [], [], {}
    normal_squares = 0.0
    for source in sources:
        own = source.columns_m3.T
        if source.parts:
            distributions += [_distribution(part) for part in source.parts]
            slopes += list(own)
            continue
        if not _has_own(source):
            squares = np.sum(own**2, axis=0)
            if np.isinf(source.dof):
                normal_squares = normal_squares + squares
                continue
            own = [np.sqrt(squares)]
        elif len(own) == 1:
            place[source.kind] = len(distributions)
        distributions += [_distribution(source)] * len(own)
        slopes += list(own)
    if np.any(normal_squares):
        distributions.append(standard(1.0))
        slopes.append(np.sqrt(normal_squares))
    rows = len(sources[0].columns_m3) if sources else 0
    stacked = np.stack(slopes, axis=1) if slopes else np.empty((rows, 0))
    return Coordinates(tuple(distributions), stacked, place)


def _has_own(source):
    """Whether its columns stand for themselves: a declared input, or one that is not normal."""
    return source.u is not None or source.distribution not in ("normal", "t")


def _distribution(source):
    """Of readings Student's t (JCGM 101:2008 6.4.9), normal for infinitely many."""
    return standard(1.0, source.distribution, dof=source.dof, u_is=source.u_is)


UNFELT = 1e-4  # of u of a volume: an input that adds less is not drawn for it
COUNTED = ("reached", "controlled", "draws", "tolerance")  # of a row that was drawn for

# How many rows are simulated: in all, of bent ones, and of those that need plain draws. The other
# rows of a longer table are interpolated between them.
MOST_ROWS, MOST_BENT, MOST_PLAIN = 800, 60, 40


class Model:
    """The rows first, then what weights (deliveries, rows) make of them.

    A coordinate is in units of its input's u, so a slope is a contribution in m3.
    """

    def __init__(self, job, survey, body, zero_m, table, weights):
        self.body, self.table, self.weights = body, table, weights
        self.rows = len(table.height_m)
        self.parts = slice(0, self.rows), slice(self.rows, None)
        self.levels = np.minimum(table.height_m + zero_m, body.highest_m)
        self.inputs = coordinates([one.mapped(self._both) for one in table.sources])
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
        """`monte_carlo.Simulation` of all volumes, and how many rows were drawn for."""
        even, bent = self.some_even, self.some_bent
        found, kept = simulate_quadratic(
            self.quadratic.subset(even),
            self.inputs.distributions,
            goal=goal,
            progress=progress,
            choose=lambda hard: np.searchsorted(even, self._thinned(even[hard], MOST_PLAIN)),
        )
        even = even[kept]
        if len(bent):
            found = _merged(found, even, self._of_bent(bent, goal), bent)
        places = np.sort(np.concatenate([even, bent]))
        u = np.linalg.norm(self.inputs.slopes, axis=1)
        full = spread_to_all(found, places, self.quadratic.value, u, goal.digits)
        endless = [not np.isfinite(distribution.sd) for distribution in self.inputs.distributions]
        without_u = np.any(self.inputs.slopes[:, endless] != 0, axis=1)
        full = replace(full, u=np.where(without_u, np.inf, full.u))
        return full, int(np.count_nonzero(places < self.rows))

    def _both(self, of_rows):
        """Values of the rows, then those of the deliveries."""
        return np.concatenate([of_rows, self.weights @ of_rows])

    def _thinned(self, volumes, most):
        """At most so many of the rows among these volumes, evenly, and all deliveries."""
        rows = volumes[volumes < self.rows]
        some = np.linspace(0, len(rows) - 1, min(most, len(rows))).round().astype(int)
        return np.concatenate([rows[some], volumes[len(rows) :]])

    def _quadratic(self):
        count, pairs = len(self.inputs.distributions), self.curved.pairs
        hessians = np.zeros((max(len(pairs), 1), count, count))
        for hessian, (one, other) in zip(hessians, pairs, strict=False):
            i, j = self.inputs.place[one], self.inputs.place[other]
            hessian[i, j] += 0.25
            hessian[j, i] += 0.25
        second = self.curved.values if pairs else np.zeros((self.rows, 1))
        return QuadraticRows(
            self._both(self.table.volume_m3),
            self.inputs.slopes,
            hessians,
            self._both(second),
            np.zeros(count),
        )

    def _bent(self):
        """(volumes,) which are not quadratic; a delivery is when a row that it reads is."""
        rows = np.zeros(self.rows, dtype=bool)
        if self.datum_m:
            pair = ("datum", "datum")
            kept = pair in self.curved.pairs
            second = self.curved.values[:, self.curved.pairs.index(pair)] if kept else 0.0 * rows
            slope = self.inputs.slopes[self.parts[0], self.inputs.place["datum"]]
            rows = bent_rows(self.body, self.levels, self.datum_m, slope, second, self.table.u_m3)
        return np.concatenate([rows, (self.weights != 0) @ rows > 0])

    def _of_bent(self, bent, goal):
        """`Simulation` of the volumes that are not quadratic, by the inputs that they feel."""
        datum, slopes = self.inputs.place["datum"], np.abs(self.inputs.slopes[bent])
        felt = np.any(slopes > UNFELT * np.linalg.norm(slopes, axis=1, keepdims=True), axis=0)
        felt[datum] = False
        others = np.flatnonzero(felt)
        part = self.quadratic.subset(bent)
        rest = replace(
            part,
            jacobian=part.jacobian[:, others],
            hessians=part.hessians[:, others][:, :, others],
            mean=np.zeros(len(others)),
        )
        weights = self._weights_of(bent)
        needed = np.flatnonzero(np.any(weights != 0, axis=0))
        unit = self.inputs.distributions[datum]
        law = datum_law(self.body, self.levels[needed], self.datum_m, unit)
        some = [self.inputs.distributions[place] for place in others]
        return simulate_bent(rest, some, weights[:, needed] @ law.added_m3, law.below, goal)

    def _weights_of(self, volumes):
        """(volumes, rows) by which the rows make these volumes."""
        own = volumes[volumes < self.rows]
        weights = np.zeros((len(volumes), self.rows))
        weights[np.arange(len(own)), own] = 1.0
        weights[len(own) :] = self.weights[volumes[len(own) :] - self.rows]
        return weights


def _merged(found, even, others, bent):
    """One Simulation from two, each of its own volumes."""
    order = np.argsort(np.concatenate([even, bent]))
    both = zip(found.by_volume.items(), others.by_volume.values(), strict=True)
    return replace(found, **{name: np.concatenate([a, b])[order] for (name, a), b in both})


def spread_to_all(found, places, value_m3, u_m3, digits):
    """A Simulation of all volumes from one of some, at `places` among them.

    In between, everything is linear in parts of the u of the law of propagation: the volumes of
    neighbouring rows have nearly the same distribution. digits  of u that its tolerance is for
    """
    every, near = np.arange(len(value_m3)), np.searchsorted(places, np.arange(len(value_m3)))
    size, full = np.where(u_m3 > 0, u_m3, 1.0), {}
    for name, known in found.by_volume.items():
        if name in COUNTED:
            full[name] = known[np.minimum(near, len(places) - 1)]
            continue
        own = value_m3 if name in ESTIMATES and name != "u" else np.zeros(len(value_m3))
        parts = (known - own[places]) / size[places]
        full[name] = own + size * np.interp(every, places, parts)
    tolerance = numerical_tolerance(np.where(np.isfinite(full["u"]), full["u"], u_m3), digits)
    return replace(found, **full | {"tolerance": tolerance})
