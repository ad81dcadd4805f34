"""Predict a plan of a bare wall: compute its job with nominal readings."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.errors import InputError
from tankcal.geometry.field.components import COMPONENTS
from tankcal.geometry.field.estimate import LEVELS
from tankcal.geometry.field.information import expect_amplitudes
from tankcal.job.model import Job
from tankcal.pipeline.cause_correlations import noise_of_wall
from tankcal.pipeline.liquid import LiquidResult, Measured, measure_by_liquid
from tankcal.pipeline.liquid_checks import check_liquid_result
from tankcal.pipeline.nominal_wall import NominalWall
from tankcal.pipeline.read_wall import ReadWall
from tankcal.pipeline.section_homogeneity import OF_SCATTER
from tankcal.pipeline.statements import statements
from tankcal.pipeline.strapped_wall import StrappedWall
from tankcal.pipeline.surveying import find_survey
from tankcal.pipeline.table import ComputedTable, check_table, compute_table
from tankcal.pipeline.tangent_checks import judge_tangents
from tankcal.planning.limits import OfTable, refuse_without_delivery
from tankcal.planning.wall.filling_outlook import (
    FillingOutlook,
    outlook_of_filling,
    refuse_other_dips,
)
from tankcal.planning.wall.model import WallPlan
from tankcal.planning.wall.telling import told_of_plan
from tankcal.quadrature import panels

OF_READINGS = (  # warnings that need real readings or a drawing; not predicted
    *("size_told_by_distances", "size_told_by_one_course"),
    *("reading_copied", "line_copied", "no_control_readings"),
    *("repeats_apart", "strap_apart", "strapped_course_apart", "courses_exchanged"),
    *("repeats_far", "strap_far", "strapped_course_far"),
    *("lines_of_inside", "many_offsets_set_aside", "setup_set_aside"),
    *OF_SCATTER,
)


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
    made : ComputedTable
    sighting : Sighting or Touching or None
        As `check_table` expects it.
    measured : Measured or None
        Result of the runs of liquid.
    """

    job: Job
    wall: object
    made: ComputedTable
    sighting: object = None
    measured: Measured | None = None

    @cached_property
    def liquid(self) -> LiquidResult | None:
        """Predicted results of the runs of liquid other than table rows."""
        return self.measured and self.measured.result(self.made.levels_m)

    @cached_property
    def stated(self):
        """Budgets and worst deliveries (`statements.Statements`)."""
        return statements(self.job, self.made.table, self.made.straightness.largest_m3)


@dataclass(frozen=True)
class WallPrediction(OfTable):
    """Predicted results of a planned survey of a bare wall.

    Attributes
    ----------
    plan : WallPlan
    tabled : WallTable
    """

    plan: WallPlan
    tabled: WallTable

    @cached_property
    def courses(self):
        """A tuple of CourseOutlook, from the bottom up."""
        return courses_of(self.tabled)

    @cached_property
    def reliability(self):
        """A tuple of ReadingsOutlook of straps, offsets and tangents."""
        return readings_of(self.tabled)

    @cached_property
    def filling(self) -> FillingOutlook | None:
        """Predicted effect of the runs of liquid; None without runs."""
        tabled = self.tabled
        if tabled.measured is None:
            return None
        return outlook_of_filling(self.plan, tabled.measured, tabled.liquid, tabled.made)

    @cached_property
    def warnings(self):
        """Warnings of the planned survey, a tuple of Problem."""
        tabled = self.tabled
        of_run = (
            *check_table(tabled.job, tabled.wall, tabled.made, tabled.sighting),
            *check_liquid_result(tabled.job, tabled.liquid),
        )
        problems = (
            *self.plan.warnings,
            *self.plan.job.warnings,
            *told_of_plan(of_run, self.plan.design),
        )
        return tuple(
            problem for problem in dict.fromkeys(problems) if _code(problem) not in OF_READINGS
        )


def _code(problem):
    return getattr(problem.expected, "code", None)


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
        tabled = foresee_table(plan.job, plan.amplitudes)
    except InputError as error:
        raise InputError(told_of_plan(error.problems, plan.design)) from error
    tall = sum(course.height_m for course in plan.job.courses) or tabled.made.top_m
    refuse_without_delivery(plan, tabled, tall)
    refuse_other_dips(plan.dips_m, tabled.made)
    return WallPrediction(plan, tabled)


def foresee_table(job, amplitudes):
    """Return the `WallTable` of a job with nominal readings.

    Amplitudes: assumed ones of the wall.
    """
    surveyed = find_survey(job, lambda text: None, amplitudes)
    if surveyed.survey is None or isinstance(surveyed.survey, NominalWall):
        return _tabled(surveyed, surveyed.survey)  # no readings that could estimate amplitudes
    field = surveyed.survey.field
    expected = expect_amplitudes(field)
    if "tangents" in surveyed.sights:  # they estimate only the excess of the hull
        surveyed = find_survey(job, lambda text: None, expected)
        field = surveyed.survey.field
    return _tabled(surveyed, replace(surveyed.survey, field=replace(field, amplitudes=expected)))


def _tabled(surveyed, wall):
    """Return the `WallTable` of a `Surveyed` with a wall of the predicted precision."""
    measured = measure_by_liquid(surveyed.job, wall)
    table = compute_table(surveyed.job, wall, body=measured and measured.body)
    return WallTable(surveyed.job, wall, table, surveyed.sighting, measured)


def courses_of(tabled):
    """Return the CourseOutlook of each course; () if only liquid measures them."""
    if tabled.wall is None or isinstance(tabled.wall, NominalWall):
        return ()
    job, field = tabled.job, tabled.wall.field
    courses = len(job.courses)
    mean = np.kron(np.eye(courses), panels([0.0, 1.0], LEVELS)[1])
    weights = mean @ field.means.weights
    covariance = sum(mean @ field.means.unseen(i) @ mean.T for i in range(len(COMPONENTS)))
    wall = tabled.wall
    noise = field.noise_m2 if isinstance(wall, StrappedWall) else noise_of_wall(wall)
    sds = np.sqrt(np.diag(covariance) + np.einsum("ij,jk,ik->i", weights, noise, weights))
    names = [course.name for course in job.courses]
    counts = {kind: dict.fromkeys(names, 0) for kind in ("straps", "offsets", "hits", "tangents")}
    for reading in () if job.strapping is None else job.strapping.straps:
        counts["straps"][reading.course] += 1
    for reading in () if job.lines is None else job.lines.offsets:
        counts["offsets"][reading.course] += 1
    for course in () if job.hits is None else job.hits.course:
        counts["hits"][course] += 1
    for course in () if job.tangents is None else job.tangents.course:
        counts["tangents"][course] += 1
    return tuple(
        CourseOutlook(name, *(counts[kind][name] for kind in counts), float(sd))
        for name, sd in zip(names, sds, strict=True)
    )


def readings_of(tabled):
    """Return the ReadingsOutlook of straps, offsets and tangents, if any."""
    wall = tabled.wall
    if not isinstance(wall, ReadWall):
        wall = wall and wall.read
    kinds = () if wall is None or isinstance(wall, NominalWall) else ("straps", "offsets")
    tested = [(kind, wall.tests_of(kind)[1]) for kind in kinds]
    if tabled.job.tangents is not None:
        tests = judge_tangents(tabled.job, tabled.wall, tabled.sighting)
        tested.append(("tangents", tests.mdb_m[~tabled.job.tangents.check]))
    return tuple(_outlook(kind, mdb) for kind, mdb in tested if len(mdb))


def _outlook(kind, mdb_m):
    known = mdb_m[np.isfinite(mdb_m)]
    largest = float(known.max()) if len(known) else float("nan")
    return ReadingsOutlook(kind, len(mdb_m), len(mdb_m) - len(known), largest)
