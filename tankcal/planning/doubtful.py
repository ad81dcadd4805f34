"""What a blunder could do that the planned survey would not notice.

The smallest blunder that is found has the size delta0 s / sqrt(r); below it a reading shifts the
volume of the full tank by up to

    dV = g Q j' delta0 / sqrt(r)        g = dV/dx, j the whitened row of the reading

All numbers are of one reading: of those that are repeated see `repeated`.

Source: Baarda 1968, as in tankcal.survey.network.reliability.
"""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from tankcal.adjust import UNCONTROLLED, noncentrality
from tankcal.planning.bases import base_sd_m
from tankcal.planning.model import TAPED
from tankcal.solver.effects import covariances
from tankcal.survey.observations import ImageCoordinates

# Repeated readings one by one, of which the network of a plan has the mean alone.
#
# A mean has the weight of its readings together, each with its share p of it (1/n of n alike):
#
#     r_i = 1 - p (1 - r)         redundancy number of one of them, r that of the mean
#     s_i = s / sqrt(p)           its standard deviation, s that of the mean
#
# and an error e of one of them is an error p e of the mean. Readings of directions are in sets, and
# each set has an orientation of its own. What the n sets of a set-up differ by takes part of it,
#
#     r_i = 1 - (1 - r) / n - (1 - 1/n) q
#
# q the share of the direction in the weight of its set; the mean of the orientations is that of the
# plan. Derivation: means and differences of equally weighted sets are orthogonal, so leverages add.

SIGHTED = ("directions", "zenith_angles", "slope_distances")


@dataclass(frozen=True)
class SingleReadings:
    """k readings, or lots of readings that are alike, of the n rows of a table of observations.

    of     (k,) row that each belongs to      share  (k,) of its weight in that of the row
    count  (k,) readings that are alike
    turn   (k,) share of its weight in the row that the orientation of its own set takes away
    """

    of: np.ndarray
    share: np.ndarray
    count: np.ndarray
    turn: np.ndarray

    def redundancy(self, of_rows):
        """(k, m) redundancy numbers of the readings, from those of the rows (n, m)."""
        return 1.0 - self.share[:, None] * (1.0 - of_rows[self.of]) - self.turn[:, None]

    def root(self):
        """(k, 1) the factor on weights, and on what a whitened error of one does, of the rows."""
        return np.sqrt(self.share)[:, None]


def single_readings(plan, observations):
    """The SingleReadings of some observations of a Plan."""
    trace, times = observations.trace, {}
    if trace.table in TAPED:
        return _of_ties(plan, observations)
    if trace.table in SIGHTED:
        times = {one.name: one.sets for one in plan.setups}
    elif observations.kind == ImageCoordinates.kind:
        times = {one.name: one.readings for one in plan.photos}
    count = np.array([times.get(ids[0], 1) for ids in trace.ids])
    turn = np.zeros(len(count))
    if trace.table == "directions":
        turn = (1.0 - 1.0 / count) * _share_of_set(observations)
    return SingleReadings(np.arange(len(count)), 1.0 / count, count, turn)


def _share_of_set(directions):
    """(n,) share of each direction in the weight of its set."""
    weight = directions.using(np.ones(len(directions))).weight[:, 0] ** 2
    return weight / np.bincount(directions.set, weight)[directions.set]


def _of_ties(plan, observations):
    """Ties of one line may differ in their sds: each is a lot of readings that are alike."""
    trace, lots = observations.trace, defaultdict(list)
    for one in plan.ties:
        if one.table == trace.table and one.sd_m > 0:
            line = _line(one.table, (one.start, one.end), one.instrument, one.kind == "horizontal")
            lots[line].append((one.sd_m**-2, one.readings))
    for one in plan.bases if trace.table == "distances" else ():
        line = _line(trace.table, (one.setup, one.to), one.bar, True)
        lots[line].append((base_sd_m(plan, one) ** -2, one.readings))
    flat, of, share, count = getattr(observations, "horizontal", False), [], [], []
    for number, (ids, group) in enumerate(zip(trace.ids, trace.group, strict=True)):
        mine = lots[_line(trace.table, ids, group, flat)]
        weight, times = np.array(mine).T
        of += [number] * len(mine)
        share += (weight / (weight @ times)).tolist()
        count += times.astype(int).tolist()
    return SingleReadings(np.array(of), np.array(share), np.array(count), np.zeros(len(of)))


def _line(table, ends, instrument, flat):
    """What readings of one line have in common; a tape is read either way."""
    if table != "distances":
        return tuple(ends)
    return frozenset(ends), instrument or "", bool(flat)


@dataclass(frozen=True)
class GroupReliability:
    """How far the readings of one kind control one another.

    Attributes
    ----------
    kind, name : str
        Such as "distance", "tape".
    unit : str
        Of the blunder.
    count, uncontrolled : int
        Values that are read, and how many of them nothing controls.
    redundancy : float
        Mean redundancy number.
    blunder : float
        Largest undetectable one of a controlled value; nan: none is controlled.
    of : tuple
        Names of the reading that it is of.
    volume_m3 : float
        Largest effect of an undetected blunder on the volume of the full tank, m3; nan alike.
    volume_of : tuple
        Names of the reading that has it.
    per_unit_m3 : float
        Largest effect on it of a blunder of one unit in an uncontrolled value, m3; nan: none.
    per_unit_of : tuple
        Names of the reading that has it.
    """

    kind: str
    name: str
    unit: str
    count: int
    uncontrolled: int
    redundancy: float
    blunder: float
    of: tuple
    volume_m3: float
    volume_of: tuple
    per_unit_m3: float
    per_unit_of: tuple


def reliability(plan, predicted, covariance, by_points_m2):
    """A GroupReliability for each kind and name of readings (alpha 0.001, power 0.80).

    plan         Plan                        predicted     surveys.Predicted of it
    covariance   PredictedCovariance         by_points_m2  (3n,) see PredictedTable
                 of these n points
    """
    adjusted = predicted.adjusted
    problem, solution = adjusted.problem, adjusted.solution
    pull = _pull(solution, problem.layout.points[covariance.points].ravel(), by_points_m2)
    found = []
    for number, one in enumerate(problem.observations):
        if one.trace is None:
            continue
        jac = solution.cofactor.jacobians[number]
        r = 1.0 - solution.cofactor.leverage(number, jac)
        columns = problem.model.groups[number].columns
        effect = np.abs(np.einsum("nmk,nk->nm", jac, pull[columns]))
        single = single_readings(plan, one)
        found += _by_name(one, single, single.redundancy(r), effect)
    return tuple(found)


def _pull(solution, columns, gradient):
    """(unknowns + 1,) Q g' of a gradient by some unknowns; the last is 0, for the fixed ones."""
    return np.append(covariances(solution.cofactor, columns, gradient[None])[:, 0], 0.0)


def _by_name(one, single, redundancy, effect):
    """The groups of one table of observations.

    single  SingleReadings (k)      redundancy  (k, m) of these     effect  (n, m) of the rows
    """
    trace = one.trace.taken(single.of)
    names = np.array(trace.group, dtype=object)
    controlled = redundancy > UNCONTROLLED
    size = np.where(controlled, noncentrality() / np.sqrt(np.where(controlled, redundancy, 1)), 0)
    weight = one.using(np.ones(len(one))).weight[single.of] * single.root()
    effect = effect[single.of] * single.root()
    blunder, volume = size / weight, size * effect
    per_unit = np.where(controlled, -1.0, effect * weight)
    for name in dict.fromkeys(names):
        mine = np.flatnonzero(names == name)
        worst, moves, alone = (
            mine[np.argmax(part[mine].max(axis=1))] for part in (blunder, volume, per_unit)
        )
        known, is_bare = controlled[mine].any(), bool((~controlled[mine]).any())
        count = single.count[mine]
        yield GroupReliability(
            kind=one.kind, name=str(name), unit=one.unit,
            count=int(count.sum() * redundancy.shape[1]),
            uncontrolled=int(count @ np.sum(~controlled[mine], axis=1)),
            redundancy=float(count @ redundancy[mine].mean(axis=1) / count.sum()),
            blunder=float(blunder[worst].max()) if known else float("nan"),
            of=trace.ids[worst],
            volume_m3=float(volume[moves].max()) if known else float("nan"),
            volume_of=trace.ids[moves],
            per_unit_m3=float(per_unit[alone].max()) if is_bare else float("nan"),
            per_unit_of=trace.ids[alone] if is_bare else (),
        )  # fmt: skip
