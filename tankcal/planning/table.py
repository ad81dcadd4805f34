"""Predict the table of a surveyed tank: wall, volumes and U of every row."""

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
from tankcal.survey.points import Points
from tankcal.survey.results import causes_of
from tankcal.survey.wall import move_to_wall

MANY = 400  # largest number of points whose dense covariance weights the outlines


@dataclass(frozen=True)
class PredictedTable:
    """Predicted wall, capacity table and statements.

    job is the plan's job with the points of the wall; covariance is the PredictedCovariance of the
    accepted points.
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
        """Derivative (3n,) of the full tank's volume by coordinates of the accepted points."""
        return volume_by_points(self.job, self.wall, [self.made.body.highest_m])[0]


def predicted_table(plan, predicted):
    """Return the PredictedTable of a Plan and its surveys.Predicted.

    Raises SolutionError if the vertical or the scale is not determined, and InputError if a section
    or course keeps too few targets.
    """
    targets, covariance = _covered(plan, predicted)
    job = replace(plan.job, points=_points(plan, targets, covariance), measurements=None)
    wall = find_wall(job, lambda text: None, amplitudes=plan.amplitudes)
    if len(wall.accepted) < len(targets):
        covariance = PredictedCovariance(covariance.adjusted, covariance.points[wall.accepted])
    wall = replace(wall, covariance_m2=covariance)
    return PredictedTable(job, wall, compute_table(job, wall), covariance)


def recompute_table(plan, predicted, before):
    """Return the PredictedTable of a Plan with the wall of another plan; None if the walls differ.

    `before` is the PredictedTable of a plan with the same targets and tank. Outlines keep their
    weights; uncertainties are propagated with the new covariance.
    """
    targets, covariance = _covered(plan, predicted)
    known = before.job.points
    names = tuple(plan.targets.names[i] for i in targets)
    if names != known.names or len(before.wall.accepted) < len(names):
        return None
    points = replace(known, causes=_causes(covariance))
    job = replace(before.job, points=points)
    wall = replace(before.wall, covariance_m2=covariance)
    return PredictedTable(job, wall, compute_table(job, wall), covariance)


def _covered(plan, predicted):
    """Return the indices of the determined targets, and their PredictedCovariance."""
    refuse_undetermined(predicted.frame.report)
    adjusted = predicted.adjusted
    place = {name: i for i, name in enumerate(adjusted.survey.points)}
    indices = [i for i, name in enumerate(plan.targets.names) if name in place]
    indices = [i for i in indices if not adjusted.problem.set_aside[place[plan.targets.names[i]]]]
    if not indices:
        raise SolutionError(
            message("plan_no_target_determined", "no target of the wall would be determined")
        )
    points = np.array([place[plan.targets.names[i]] for i in indices])
    return indices, PredictedCovariance(adjusted, points)


def _causes(covariance):
    """Return the common causes of error of the wall points, without their common motions."""
    causes = causes_of(covariance.adjusted, covariance.points, 1.0)
    return tuple(replace(cause, column_m=covariance.among(cause.column_m)) for cause in causes)


def _points(plan, indices, covariance):
    """Return job.Points of the wall.

    A smoothed outline weights its points with their covariance. With more than MANY points, it uses
    the covariance of single points. The weights change slightly; the propagation does not.
    """
    targets, adjusted = plan.targets, covariance.adjusted
    section = tuple(targets.section[i] for i in indices)
    is_small = len(indices) <= MANY
    written = covariance.written_out() if is_small else covariance.of_each_point()
    outwards = targets.offset_m * (1.0 if plan.shell.outside else -1.0)
    return Points(
        names=tuple(targets.names[i] for i in indices),
        xyz_m=move_to_wall(adjusted.xyz_m[covariance.points], np.full(len(indices), outwards)),
        sd_m=None,
        covariance_m2=written,
        section=section,
        generatrix=tuple(targets.generatrix[i] for i in indices),
        rows=(None,) * len(indices),
        causes=_causes(covariance),
        from_adjustment=True,
    )
