"""From the measurements to the survey of a tank: points, then the wall.

The readings may be those of a survey or the predicted readings of a plan.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.job.model import Job
from tankcal.job.tables import in_book
from tankcal.messages import message
from tankcal.methods.base import completing_method, given_methods
from tankcal.pipeline.checks import refuse_undetermined
from tankcal.pipeline.checks.size import is_within_wall, refuse_other_side, refuse_other_size
from tankcal.pipeline.overruling import refuse_kept_readings, with_decided_readings
from tankcal.pipeline.wall.surveyed import s_transform

if TYPE_CHECKING:
    from tankcal.survey import Adjustment

# Each kind of survey is imported when needed: most jobs have one kind, and all are slow to load.

TOLD = 10  # warnings of the adjustment repeated when no wall is found


@dataclass(frozen=True)
class Surveyed:
    """Survey of a tank.

    Attributes
    ----------
    job : Job
        Job with the points from its adjustment, hits, tangents or clouds.
    survey : Wall, StrappedWall, Scan, mesh or None
        None if the tank is described by declared sizes alone.
    adjustment : Adjustment or None
    sights : dict
        {method: its sights as points of the wall}: "hits" (`survey.sighting.Sighting`), "tangents"
        (`survey.tangents.Touching`) or "clouds" (`methods.clouds.wall.Clouded`).
    """

    job: Job
    survey: object
    adjustment: "Adjustment | None" = None
    sights: dict = field(default_factory=dict)

    @property
    def sighting(self):
        """Sights of the only method that has them; None without sights."""
        return next(iter(self.sights.values()), None)


@dataclass(frozen=True)
class Network:
    """Adjusted network from which a wall is found.

    Attributes
    ----------
    adjustment : Adjustment or None
        None if the job has no measurements to be adjusted.
    amplitudes : Amplitudes or None
        Known amplitudes of the components of an upright wall; None: estimated from the readings.
    cluster, part_progress : optional
        Workers that read large files, and callback for their progress; as in `chain.run`.
    """

    adjustment: "Adjustment | None"
    amplitudes: object
    cluster: int | str | None = None
    part_progress: Callable | None = None

    @property
    def dof(self):
        """Degrees of freedom of the adjustment; infinite without an adjustment."""
        return np.inf if self.adjustment is None else self.adjustment.dof


def is_surveyed_as(survey, kind):
    """Whether a survey, or None, is of a kind named as in a Result."""
    return survey is not None and survey.surveyed_as == kind


def find_survey(job, progress, amplitudes=None, *, cluster=None, part_progress=None):
    """`Surveyed` of a job: adjust its survey and find its wall.

    Parameters
    ----------
    job : Job
    progress : callable
        Called with a line of text as each step begins.
    amplitudes : Amplitudes, optional
        Known amplitudes of the components of an upright wall; None: estimated from the readings.
    cluster, part_progress : optional
        Workers that read large files, and callback for their progress; as in `chain.run`.

    Raises
    ------
    InputError, SolutionError
        As `chain.run`.
    """
    adjustment, sights = _adjust_survey(job, progress) if job.has_network else None, {}
    sighted = [method for method in given_methods(job) if method.is_sighted]
    if not sighted and adjustment is not None:
        from tankcal.survey import wall_points

        points = wall_points(adjustment, job.measurements, job.survey.side)
        job = replace(job, points=s_transform(points))
    network = Network(adjustment, amplitudes, cluster, part_progress)
    try:
        if sighted:
            found = sighted[0].find(job, progress, network)
            job, survey, sights = found.job, found.survey, found.sights
        else:
            survey = _survey(job, progress, network)
    except SolutionError as error:
        if adjustment is None or not adjustment.warnings:
            raise
        texts = (warning.text for warning in locate_in_book(job, adjustment.warnings[:TOLD]))
        raise SolutionError(*error.args, *texts) from error
    if adjustment is not None and not sighted and is_surveyed_as(survey, "wall"):
        refuse_other_side(job, partial(is_within_wall, survey), adjustment)
    elif adjustment is not None and not sighted and is_surveyed_as(survey, "scan"):
        refuse_other_side(job, survey.is_within, adjustment)
    refuse_other_size(job, survey)
    completing = completing_method(job)
    if completing is not None and not is_surveyed_as(survey, completing.name):
        survey = completing.complete(job, survey, progress)
    return Surveyed(job, survey, adjustment, sights)


def locate_in_book(job, problems):
    """Problems located by workbook and sheet if the job is in a workbook."""
    if not job.source.endswith(".xlsx"):
        return tuple(problems)
    return tuple(in_book(problem, job.source) for problem in problems)


def _adjust_survey(job, progress):
    """Adjusted survey of a job; SolutionError if the vertical or the scale is undetermined."""
    if job.points is not None and not job.points.from_adjustment:
        expected = message(
            "points_beside_survey",
            "given together with a survey; expected only one of them: the points come from "
            "its adjustment",
        )
        raise InputError(Problem("points.csv", expected))
    adjustment = adjust_decided(job, progress)
    refuse_undetermined(adjustment.datum)
    return adjustment


def adjust_decided(job, progress):
    """Adjusted survey of a job with its manual decisions about readings.

    Raises
    ------
    InputError
        For impossible input, and for a kept reading that is not in the adjustment.
    SolutionError
        As `adjust_survey`.
    """
    from tankcal.survey import adjust_survey

    measurements = with_decided_readings(job.measurements, job.overrulings)
    adjustment = adjust_survey(measurements, progress)
    refuse_kept_readings(job, adjustment)
    return adjustment


def _survey(job, progress, network):
    """Survey of the tank: wall of courses, mesh or scan; None for declared sizes alone."""
    for method in given_methods(job):
        if method.finds(job):
            return method.find(job, progress, network).survey
    return None
