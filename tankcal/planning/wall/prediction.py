"""Predict a plan of a bare wall: compute its job with nominal readings."""

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.errors import InputError
from tankcal.geometry.field.components import COMPONENTS
from tankcal.geometry.field.estimate import LEVELS
from tankcal.job.model import Job
from tankcal.methods.base import count_readings, given_methods, supplement_of
from tankcal.pipeline.checks.wall import OF_SCATTER
from tankcal.pipeline.liquid import NominalWall
from tankcal.pipeline.liquid.measuring import LiquidResult, Measured
from tankcal.pipeline.surveying import find_survey
from tankcal.pipeline.table import ComputedTable, check_table, compute_table, statements
from tankcal.pipeline.wall.shared_unknowns import noise_of_wall
from tankcal.pipeline.wall_straps import TapedWall
from tankcal.planning.model import WallPlan
from tankcal.planning.table import TableResults, refuse_without_delivery
from tankcal.planning.wall.filling import (
    FillingOutlook,
    outlook_of_filling,
    refuse_other_dips,
)
from tankcal.planning.wall.nominal_readings import expect_amplitudes
from tankcal.planning.wall.reading import locate_in_plan
from tankcal.quadrature import panels

OF_READINGS = (  # warnings that need real readings or a drawing; not predicted
    *("size_told_by_distances", "size_told_by_one_course"),
    *("reading_copied", "line_copied", "no_control_readings"),
    *("repeats_apart", "strap_apart", "strapped_course_apart", "courses_exchanged"),
    *("repeats_far", "strap_far", "strapped_course_far"),
    *("lines_of_inside", "many_offsets_set_aside", "setup_set_aside"),
    *OF_SCATTER,
)


# Kinds of readings in the order of CourseOutlook.
READ_BY_COURSE = ("straps", "offsets", "hits", "tangents")


@dataclass(frozen=True)
class CourseOutlook:
    """Prediction for one course.

    Attributes
    ----------
    name : str
        Name of the course.
    straps, offsets, hits, tangents : int
        Numbers of readings.
    radius_sd_m : float
        Standard deviation of the mean radius, m, including the part that the readings do not show.
    """

    name: str
    straps: int
    offsets: int
    hits: int
    tangents: int
    radius_sd_m: float


@dataclass(frozen=True)
class ReadingsOutlook:
    """Reliability of the readings of one kind.

    Attributes
    ----------
    kind : str
        "straps", "offsets" or "tangents".
    count : int
        Number of readings.
    uncontrolled : int
        Number of readings that no other reading controls.
    mdb_m : float
        Largest minimal detectable blunder of a radius, m.
    """

    kind: str
    count: int
    uncontrolled: int
    mdb_m: float


@dataclass(frozen=True)
class WallTable:
    """Predicted job with its points, wall and table.

    Attributes
    ----------
    job : Job
    wall : Wall, StrappedWall, NominalWall or None
        None: declared sizes only describe the tank.
    computed_table : ComputedTable
    sighting : Sighting or Touching or None
        As `check_table` expects it.
    metering : Measured or None
        Result of the runs of liquid.
    """

    job: Job
    wall: object
    computed_table: ComputedTable
    sighting: object = None
    metering: Measured | None = None

    @cached_property
    def liquid(self) -> LiquidResult | None:
        """Predicted results of the runs of liquid other than table rows."""
        return self.metering and self.metering.result(self.computed_table.levels_m)

    @cached_property
    def stated(self):
        """Budgets and worst deliveries (`statements.Statements`)."""
        return statements(
            self.job, self.computed_table.table, self.computed_table.straightness.largest_m3
        )


@dataclass(frozen=True)
class WallPrediction(TableResults):
    """Predicted results of a planned survey of a bare wall.

    Attributes
    ----------
    plan : WallPlan
    result : WallTable
    """

    plan: WallPlan
    result: WallTable

    @cached_property
    def courses(self):
        """A tuple of CourseOutlook, from the bottom up."""
        return courses_of(self.result)

    @cached_property
    def reliability(self):
        """A tuple of ReadingsOutlook of straps, offsets and tangents."""
        return readings_of(self.result)

    @cached_property
    def filling(self) -> FillingOutlook | None:
        """Predicted effect of the runs of liquid; None without runs."""
        result = self.result
        if result.metering is None:
            return None
        return outlook_of_filling(self.plan, result.metering, result.liquid, result.computed_table)

    @cached_property
    def warnings(self):
        """Warnings of the planned survey, a tuple of Problem."""
        result = self.result
        of_run = check_table(result.job, result.wall, result.computed_table, result.sighting)
        method = supplement_of(result.job)
        if method is not None:
            of_run = (*of_run, *method.warnings(result.job, result.liquid))
        problems = (
            *self.plan.warnings,
            *self.plan.job.warnings,
            *locate_in_plan(of_run, self.plan.design),
        )
        return tuple(
            problem
            for problem in dict.fromkeys(problems)
            if getattr(problem.expected, "code", None) not in OF_READINGS
        )


def predict_wall(plan):
    """Return the `WallPrediction` of a WallPlan.

    Its job is computed with assumed amplitudes of the wall, as precise as the readings would
    estimate them on a wall of just these amplitudes.

    Raises
    ------
    InputError
        If a course has too few readings.
    SolutionError
        If the readings do not determine the wall.
    """
    try:
        result = predict_wall_table(plan.job, plan.amplitudes)
    except InputError as error:
        raise InputError(locate_in_plan(error.problems, plan.design)) from error
    tall = sum(course.height_m for course in plan.job.courses) or result.computed_table.top_m
    refuse_without_delivery(plan, result, tall)
    refuse_other_dips(plan.dips_m, result.computed_table)
    return WallPrediction(plan, result)


def predict_wall_table(job, amplitudes):
    """Return the `WallTable` of a job with nominal readings.

    Amplitudes: assumed ones of the wall.
    """
    surveyed = find_survey(job, lambda text: None, amplitudes)
    if surveyed.survey is None or isinstance(surveyed.survey, NominalWall):
        # No readings could estimate the amplitudes.
        return _wall_table(surveyed, surveyed.survey)
    field = surveyed.survey.field
    expected = expect_amplitudes(field)
    # Smooth readings, such as tangents, estimate only the excess of the hull.
    if any(method.is_smooth for method in given_methods(job)):
        surveyed = find_survey(job, lambda text: None, expected)
        field = surveyed.survey.field
    wall = replace(surveyed.survey, field=replace(field, amplitudes=expected))
    return _wall_table(surveyed, wall)


def _wall_table(surveyed, wall):
    """Return the `WallTable` of a `Surveyed` with a wall of the predicted precision."""
    method, metering = supplement_of(surveyed.job), None
    if method is not None:
        metering = method.supplement(surveyed.job, wall, lambda text: None)
    table = compute_table(surveyed.job, wall, body=metering and metering.body)
    return WallTable(surveyed.job, wall, table, surveyed.sighting, metering)


def courses_of(result):
    """Return the CourseOutlook of each course; () if only liquid measures them."""
    if result.wall is None or isinstance(result.wall, NominalWall):
        return ()
    job, field = result.job, result.wall.field
    courses = len(job.courses)
    # Mean radius of a course: Gauss weights over its height. Its variance has two parts: the
    # part of each component of the wall that the readings do not show, and their noise.
    mean = np.kron(np.eye(courses), panels([0.0, 1.0], LEVELS)[1])
    weights = mean @ field.means.weights
    covariance = sum(mean @ field.means.unseen(i) @ mean.T for i in range(len(COMPONENTS)))
    wall = result.wall
    noise = field.noise_m2 if isinstance(wall, TapedWall) else noise_of_wall(wall)
    sds = np.sqrt(np.diag(covariance) + np.einsum("ij,jk,ik->i", weights, noise, weights))
    names = [course.name for course in job.courses]
    counts = {kind: Counter() for kind in READ_BY_COURSE} | count_readings(job)
    return tuple(
        CourseOutlook(name, *(counts[kind][name] for kind in READ_BY_COURSE), float(sd))
        for name, sd in zip(names, sds, strict=True)
    )


def readings_of(result):
    """Return the ReadingsOutlook of each kind of tested readings."""
    outlooks = []
    for method in given_methods(result.job):
        mdb_m = method.detectable_m(result.job, result.wall, result.sighting)
        if len(mdb_m):
            known = mdb_m[np.isfinite(mdb_m)]  # the others are uncontrolled
            largest = float(known.max()) if len(known) else float("nan")
            count = len(mdb_m)
            outlooks.append(
                ReadingsOutlook(method.kind_of_readings, count, count - len(known), largest)
            )
    return tuple(outlooks)
