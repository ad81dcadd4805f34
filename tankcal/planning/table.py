"""From a predicted survey to the table that it would give: wall, volumes, U of every row."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.errors import SolutionError
from tankcal.job.model import Job
from tankcal.messages import message
from tankcal.pipeline.statements import statements
from tankcal.pipeline.survey_warnings import refuse_undetermined
from tankcal.pipeline.surveyed_wall import Wall
from tankcal.pipeline.table import ComputedTable, compute_table
from tankcal.pipeline.tanks.vertical import volume_by_points
from tankcal.pipeline.wall import find_wall
from tankcal.planning.covariance import PredictedCovariance
from tankcal.survey.causes import causes_of
from tankcal.survey.points import Points
from tankcal.survey.wall import move_to_wall

MANY = 400  # points of a wall whose covariance is written out for its outlines


@dataclass(frozen=True)
class PredictedTable:
    """The wall as it would be surveyed, the capacity table, and what is stated of it.

    job         the plan's, with the points of the wall
    covariance  PredictedCovariance of the accepted points
    """

    job: Job
    wall: Wall
    made: ComputedTable
    covariance: PredictedCovariance

    @cached_property
    def stated(self):
        """Budgets and worst deliveries (`statements.Statements`)."""
        return statements(self.job, self.made.table, self.made.straightness.largest_m3)

    @property
    def by_points_m2(self):
        """(3n,) derivative of the full tank's volume by the coordinates of the accepted points."""
        return volume_by_points(self.job, self.wall, [self.made.body.highest_m])[0]


def predicted_table(plan, predicted):
    """The PredictedTable of a Plan and its surveys.Predicted.

    Raises SolutionError while the vertical or the scale is not determined, InputError when a
    section or course keeps too few targets.
    """
    there, covariance = _covered(plan, predicted)
    job = replace(plan.job, points=_points(plan, there, covariance), measurements=None)
    wall = find_wall(job, lambda text: None, amplitudes=plan.amplitudes)
    if len(wall.accepted) < len(there):
        covariance = PredictedCovariance(covariance.adjusted, covariance.points[wall.accepted])
    wall = replace(wall, covariance_m2=covariance)
    return PredictedTable(job, wall, compute_table(job, wall), covariance)


def recompute_table(plan, predicted, before):
    """The PredictedTable of a Plan whose wall is that of another one; None where it is not.

    before  PredictedTable of a plan with the same targets and the same tank

    Outlines keep the weights that they had; the propagation is that of the new covariance.
    """
    there, covariance = _covered(plan, predicted)
    known = before.job.points
    names = tuple(plan.targets.names[i] for i in there)
    if names != known.names or len(before.wall.accepted) < len(names):
        return None
    points = replace(known, causes=_causes(covariance))
    job = replace(before.job, points=points)
    wall = replace(before.wall, covariance_m2=covariance)
    return PredictedTable(job, wall, compute_table(job, wall), covariance)


def _covered(plan, predicted):
    """Numbers of the targets that are determined, and their PredictedCovariance."""
    refuse_undetermined(predicted.frame.report)
    adjusted = predicted.adjusted
    place = {name: i for i, name in enumerate(adjusted.survey.points)}
    there = [i for i, name in enumerate(plan.targets.names) if name in place]
    there = [i for i in there if not adjusted.problem.set_aside[place[plan.targets.names[i]]]]
    if not there:
        raise SolutionError(
            message("plan_no_target_determined", "no target of the wall would be determined")
        )
    points = np.array([place[plan.targets.names[i]] for i in there])
    return there, PredictedCovariance(adjusted, points)


def _causes(covariance):
    """Causes that the points of the wall share, without what moves all of them alike."""
    found = causes_of(covariance.adjusted, covariance.points, 1.0)
    return tuple(replace(one, column_m=covariance.among(one.column_m)) for one in found)


def _points(plan, there, covariance):
    """job.Points of the wall.

    A smoothed outline weighs its points against one another; on a wall of more than MANY points by
    their own covariances alone. That changes weights a little, and never what is propagated.
    """
    targets, adjusted = plan.targets, covariance.adjusted
    section = tuple(targets.section[i] for i in there)
    is_small = len(there) <= MANY
    written = covariance.written_out() if is_small else covariance.of_each_point()
    outwards = targets.offset_m * (1.0 if plan.shell.outside else -1.0)
    return Points(
        names=tuple(targets.names[i] for i in there),
        xyz_m=move_to_wall(adjusted.xyz_m[covariance.points], np.full(len(there), outwards)),
        sd_m=None,
        covariance_m2=written,
        section=section,
        generatrix=tuple(targets.generatrix[i] for i in there),
        rows=(None,) * len(there),
        causes=_causes(covariance),
        from_adjustment=True,
    )
