"""Reliability of a planned survey: effects of undetected blunders on the volume.

The smallest detectable blunder has the size delta0 s / sqrt(r). A smaller blunder of a reading
changes the volume of the full tank by at most

    dV = g Q j' delta0 / sqrt(r)        g = dV/dx, j the whitened row of the reading

All values refer to one reading; for repeated readings, see `SingleReadings`.

Source: Baarda 1968, as in tankcal.survey.network.reliability.
"""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from tankcal.adjust import UNCONTROLLED, noncentrality
from tankcal.planning.model import TAPED
from tankcal.planning.places import base_sd_m
from tankcal.solver.effects import covariances
from tankcal.survey.observations import ImageCoordinates

# Single readings of a repeated measurement. The network of a plan contains only their mean.
#
# A mean has the sum of the weights of its readings. A reading has the share p of this sum, which
# is 1/n for n readings of equal weight:
#
#     r_i = 1 - p (1 - r)         redundancy number of a reading; r redundancy number of the mean
#     s_i = s / sqrt(p)           standard deviation of a reading; s that of the mean
#
# An error e of a reading is an error p e of the mean. Directions are read in sets, and each set
# has its own orientation. Estimating the n orientations of a set-up reduces the redundancy:
#
#     r_i = 1 - (1 - r) / n - (1 - 1/n) q
#
# with q the share of the direction in the weight of its set. The mean of the orientations is the
# orientation in the plan. Means and differences of equally weighted sets are orthogonal, so their
# leverages add.

SIGHTED = ("directions", "zenith_angles", "slope_distances")  # tables of total station readings


@dataclass(frozen=True)
class SingleReadings:
    """The k single readings, or groups of equal readings, behind the n means in a table.

    Attributes
    ----------
    row : ndarray of int, shape (k,)
        Row (mean) of each reading.
    share : ndarray, shape (k,)
        Share of the weight of each reading in the weight of its row.
    count : ndarray of int, shape (k,)
        Number of equal readings.
    turn : ndarray, shape (k,)
        Leverage of the orientation of the set of each reading, beyond that of the mean.
    """

    row: np.ndarray
    share: np.ndarray
    count: np.ndarray
    turn: np.ndarray

    def redundancy(self, of_rows):
        """Redundancy numbers (k, m) of the readings, from those of their rows, shape (n, m)."""
        return 1.0 - self.share[:, None] * (1.0 - of_rows[self.row]) - self.turn[:, None]

    def root(self):
        """Factor (k, 1) from the whitened row of the mean to the whitened row of a reading."""
        return np.sqrt(self.share)[:, None]


def single_readings(plan, observations):
    """Return the SingleReadings of observations of a Plan."""
    trace, times = observations.trace, {}
    if trace.table in TAPED:
        return _single_ties(plan, observations)
    if trace.table in SIGHTED:
        times = {setup.name: setup.sets for setup in plan.setups}
    elif observations.kind == ImageCoordinates.kind:
        times = {photo.name: photo.readings for photo in plan.photos}
    count = np.array([times.get(ids[0], 1) for ids in trace.ids])
    turn = np.zeros(len(count))
    if trace.table == "directions":
        turn = (1.0 - 1.0 / count) * _share_of_set(observations)  # (1 - 1/n) q
    return SingleReadings(np.arange(len(count)), 1.0 / count, count, turn)


def _share_of_set(directions):
    """Share (n,) of each direction in the weight of its set."""
    weight = directions.using(np.ones(len(directions))).weight[:, 0] ** 2
    return weight / np.bincount(directions.set, weight)[directions.set]


def _single_ties(plan, observations):
    """Return SingleReadings of ties; ties of one line with different sds are separate groups."""
    trace, lots = observations.trace, defaultdict(list)
    for tie in plan.ties:
        if tie.table == trace.table and tie.sd_m > 0:
            line = _line(tie.table, (tie.start, tie.end), tie.instrument, tie.kind == "horizontal")
            lots[line].append((tie.sd_m**-2, tie.readings))
    for base in plan.bases if trace.table == "distances" else ():
        line = _line(trace.table, (base.setup, base.to), base.bar, True)
        lots[line].append((base_sd_m(plan, base) ** -2, base.readings))
    flat, of, share, count = getattr(observations, "horizontal", False), [], [], []
    for number, (ids, group) in enumerate(zip(trace.ids, trace.group, strict=True)):
        lot = lots[_line(trace.table, ids, group, flat)]
        weight, times = np.array(lot).T
        of += [number] * len(lot)
        share += (weight / (weight @ times)).tolist()
        count += times.astype(int).tolist()
    return SingleReadings(np.array(of), np.array(share), np.array(count), np.zeros(len(of)))


def _line(table, ends, instrument, flat):
    """Key of the readings of one line; a tape may be read in either direction."""
    if table != "distances":
        return tuple(ends)
    return frozenset(ends), instrument or "", bool(flat)


@dataclass(frozen=True)
class GroupReliability:
    """Reliability of the readings of one kind.

    Attributes
    ----------
    kind, name : str
        For example "distance" and "tape".
    unit : str
        Unit of the blunder.
    count, uncontrolled : int
        Number of values, and number of values that no other reading controls.
    redundancy : float
        Mean redundancy number.
    blunder : float
        Largest undetectable blunder of a controlled value; nan if no value is controlled.
    of : tuple
        Names of the reading with this blunder.
    volume_m3 : float
        Largest effect of an undetected blunder on the volume of the full tank, m3; nan if no value
        is controlled.
    volume_of : tuple
        Names of the reading with this effect.
    per_unit_m3 : float
        Largest effect on the volume of a blunder of one unit in an uncontrolled value, m3; nan if
        every value is controlled.
    per_unit_of : tuple
        Names of the reading with this effect.
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


def assess_reliability(plan, network, covariance, by_points_m2):
    """Return a GroupReliability of each kind and name of readings (alpha 0.001, power 0.80).

    Parameters
    ----------
    plan : Plan
    predicted : Predicted
        Predicted survey of the plan.
    covariance : PredictedCovariance
        Covariance of n points.
    by_points_m2 : ndarray, shape (3n,)
        Derivative of the volume of the full tank by the coordinates of these points.

    Returns
    -------
    tuple of GroupReliability
    """
    adjusted = network.adjusted
    problem, solution = adjusted.problem, adjusted.solution
    # Q g' is common to all readings; j Q g' is the effect of a whitened unit error.
    # The last element belongs to fixed unknowns.
    columns = problem.layout.points[covariance.points].ravel()
    pull = np.append(covariances(solution.cofactor, columns, by_points_m2[None])[:, 0], 0.0)
    groups = []
    for number, table in enumerate(problem.observations):
        if table.trace is None:
            continue
        jac = solution.cofactor.jacobians[number]
        r = 1.0 - solution.cofactor.leverage(number, jac)
        columns = problem.model.groups[number].columns
        effect = np.abs(np.einsum("nmk,nk->nm", jac, pull[columns]))
        single = single_readings(plan, table)
        groups += _group_by_name(table, single, single.redundancy(r), effect)
    return tuple(groups)


def _group_by_name(table, single, redundancy, effect):
    """Yield the GroupReliability of each name in one table of observations.

    single: SingleReadings of k readings; redundancy: (k, m) of the readings; effect: (n, m) of the
    rows.
    """
    trace = table.trace.taken(single.row)
    names = np.array(trace.group, dtype=object)
    controlled = redundancy > UNCONTROLLED
    # delta0 / sqrt(r): smallest detectable blunder in standard deviations
    size = np.where(controlled, noncentrality() / np.sqrt(np.where(controlled, redundancy, 1)), 0)
    weight = table.using(np.ones(len(table))).weight[single.row] * single.root()
    # The weight and the whitened effect of a single reading are sqrt(p) times those of the mean.
    effect = effect[single.row] * single.root()
    blunder, volume = size / weight, size * effect
    per_unit = np.where(controlled, -1.0, effect * weight)
    for name in dict.fromkeys(names):
        members = np.flatnonzero(names == name)
        worst, moves, alone = (
            members[np.argmax(part[members].max(axis=1))] for part in (blunder, volume, per_unit)
        )
        known, is_bare = controlled[members].any(), bool((~controlled[members]).any())
        count = single.count[members]
        yield GroupReliability(
            kind=table.kind, name=str(name), unit=table.unit,
            count=int(count.sum() * redundancy.shape[1]),
            uncontrolled=int(count @ np.sum(~controlled[members], axis=1)),
            redundancy=float(count @ redundancy[members].mean(axis=1) / count.sum()),
            blunder=float(blunder[worst].max()) if known else float("nan"),
            of=trace.ids[worst],
            volume_m3=float(volume[moves].max()) if known else float("nan"),
            volume_of=trace.ids[moves],
            per_unit_m3=float(per_unit[alone].max()) if is_bare else float("nan"),
            per_unit_of=trace.ids[alone] if is_bare else (),
        )  # fmt: skip
