"""Predict the table of a surveyed tank: wall, volumes and U of every row, and the limit of a plan.

Reliability of a planned survey: effects of undetected blunders on the volume.

The smallest detectable blunder has the size delta0 s / sqrt(r). A smaller blunder of a reading
changes the volume of the full tank by at most

    dV = g Q j' delta0 / sqrt(r)        g = dV/dx, j the whitened row of the reading

All values refer to one reading; for repeated readings, see `SingleReadings`.

Source: Baarda 1968, as in tankcal.survey.network.reliability.
"""

from collections import defaultdict
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.adjust import UNCONTROLLED, noncentrality
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.job.model import Job
from tankcal.messages import message
from tankcal.pipeline.checks import refuse_undetermined
from tankcal.pipeline.table import MINIMA_M, ComputedTable, compute_table, statements
from tankcal.pipeline.tanks.vertical import volume_by_points
from tankcal.pipeline.wall.finding import find_wall
from tankcal.pipeline.wall.surveyed import Wall, s_transform
from tankcal.planning.model import TAPED
from tankcal.planning.places import base_sd_m
from tankcal.solver.effects import covariances
from tankcal.survey.observations import ImageCoordinates
from tankcal.survey.points import Points, move_to_wall
from tankcal.survey.results import causes_of

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
class PredictedTable:
    """Predicted wall, capacity table and statements.

    job is the plan's job with the points of the wall; points (n,) are the numbers of the accepted
    points in the predicted network.
    """

    job: Job
    wall: Wall
    computed_table: ComputedTable
    points: np.ndarray

    @cached_property
    def stated(self):
        """Budgets and worst deliveries (`statements.Statements`)."""
        return statements(
            self.job, self.computed_table.table, self.computed_table.straightness.largest_m3
        )

    @property
    def by_points_m2(self):
        """Derivative (3n,) of the full tank's volume by coordinates of the accepted points."""
        return volume_by_points(self.job, self.wall, [self.computed_table.body.highest_m])[0]


def predict_table(plan, network):
    """Return the PredictedTable of a Plan and its surveys.Predicted.

    Raises SolutionError if the vertical or the scale is not determined, and InputError if a section
    or course keeps too few targets.
    """
    targets, numbers = _find_determined(plan, network)
    points = _points(plan, targets, network.adjusted, numbers)
    job = replace(plan.job, points=points, measurements=None)
    wall = find_wall(job, lambda text: None, amplitudes=plan.amplitudes)
    return PredictedTable(job, wall, compute_table(job, wall), numbers[wall.accepted])


def recompute_table(plan, network, before):
    """Return the PredictedTable of a Plan with the wall of another plan.

    Outlines keep their weights; uncertainties are propagated with the new covariance.

    Parameters
    ----------
    plan : Plan
    network : Predicted
        Predicted network of the plan.
    before : PredictedTable
        Prediction of a plan with the same targets and tank.

    Returns
    -------
    PredictedTable or None
        None if the walls differ.
    """
    targets, numbers = _find_determined(plan, network)
    known = before.job.points
    names = tuple(plan.targets.names[i] for i in targets)
    if names != known.names or len(before.wall.accepted) < len(names):
        return None
    points = _set_covariance(known, network.adjusted, numbers)
    job = replace(before.job, points=points)
    wall = replace(before.wall, covariance_m2=points.covariance_m2)
    return PredictedTable(job, wall, compute_table(job, wall), numbers)


def _find_determined(plan, network):
    """Return the indices of the determined targets, and their numbers in the network."""
    refuse_undetermined(network.frame.report)
    adjusted = network.adjusted
    place = {name: i for i, name in enumerate(adjusted.survey.points)}
    indices = [i for i, name in enumerate(plan.targets.names) if name in place]
    indices = [i for i in indices if not adjusted.problem.set_aside[place[plan.targets.names[i]]]]
    if not indices:
        raise SolutionError(
            message("plan_no_target_determined", "no target of the wall would be determined")
        )
    return indices, np.array([place[plan.targets.names[i]] for i in indices])


def _set_covariance(points, adjusted, numbers):
    """Return points of the wall with their covariance and causes in a predicted network."""
    covariance = adjusted.covariance_of_points(numbers)
    causes = causes_of(adjusted, numbers, 1.0)
    return s_transform(replace(points, covariance_m2=covariance, causes=causes))


def _points(plan, indices, adjusted, numbers):
    """Return job.Points of the wall."""
    targets = plan.targets
    outwards = targets.offset_m * (1.0 if plan.shell.is_outside else -1.0)
    points = Points(
        names=tuple(targets.names[i] for i in indices),
        xyz_m=move_to_wall(adjusted.xyz_m[numbers], np.full(len(indices), outwards)),
        sd_m=None,
        covariance_m2=None,
        section=tuple(targets.section[i] for i in indices),
        generatrix=tuple(targets.generatrix[i] for i in indices),
        rows=(None,) * len(indices),
        from_adjustment=True,
    )
    return _set_covariance(points, adjusted, numbers)


# ---- the limit of a plan


def relative_u_of(result, limits):
    """U over volume of the full tank, or of the worst delivery of the smallest minimum."""
    if limits.quantity == "delivery":
        return float(result.stated.worst[0].relative.relative)
    table = result.computed_table.table
    return float(table.U_m3[-1] / table.volume_m3[-1])


class TableResults:
    """Mixin: properties of a prediction from its table (`tabled`) and its plan (`plan`)."""

    @property
    def table(self):
        """Capacity table with U of every row (`capacity.Capacity`)."""
        return self.result.computed_table.table

    @property
    def relative_u(self):
        """U over volume of the limited quantity: the full tank or the worst delivery."""
        return relative_u_of(self.result, self.plan.limits)

    @property
    def meets(self):
        """Whether the limit is met; None if the plan has no limit."""
        limit = self.plan.limits.relative_u
        return None if limit is None else bool(self.relative_u <= limit)


def refuse_without_delivery(plan, result, tall):
    """Raise InputError if the limit is for deliveries and no delivery of the table is long enough.

    Parameters
    ----------
    plan : Plan or WallPlan
    result : PredictedTable or WallTable
    tall : float
        Height of the shell, m.
    """
    if plan.limits.quantity == "delivery" and not result.stated.worst:
        least = min(plan.job.table.minimum_delivery_m or MINIMA_M)
        file, row, name = plan.limits.place
        expected = message(
            "plan_no_delivery",
            "no delivery of {least:g} m or more in a shell of {tall:g} m; expected "
            "top, or a smaller table.minimum_delivery_m",
            least=least,
            tall=tall,
        )
        raise InputError(Problem(file, expected, row, name))


# ---- reliability of a planned survey: effects of undetected blunders on the volume


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
        weight = observations.using(np.ones(len(observations))).weight[:, 0] ** 2
        share_of_set = weight / np.bincount(observations.set, weight)[observations.set]
        turn = (1.0 - 1.0 / count) * share_of_set  # (1 - 1/n) q
    return SingleReadings(np.arange(len(count)), 1.0 / count, count, turn)


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


def assess_reliability(plan, network, points, by_points_m2):
    """Return a GroupReliability of each kind and name of readings (alpha 0.001, power 0.80).

    Parameters
    ----------
    plan : Plan
    predicted : Predicted
        Predicted survey of the plan.
    points : ndarray of int, shape (n,)
        Numbers of the points of the wall in the network.
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
    columns = problem.layout.points[points].ravel()
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
