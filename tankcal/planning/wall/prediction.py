"""A plan of a wall answered: its job computed with the readings foreseen, and what U will be."""

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

OF_READINGS = (  # warnings that only true readings can give, or a drawing, which no plan knows
    *("size_told_by_distances", "size_told_by_one_course"),
    *("reading_copied", "line_copied", "no_control_readings"),
    *("repeats_apart", "strap_apart", "strapped_course_apart", "courses_exchanged"),
    *("repeats_far", "strap_far", "strapped_course_far"),
    *("lines_of_inside", "many_offsets_set_aside", "setup_set_aside"),
    *OF_SCATTER,
)


@dataclass(frozen=True)
class CourseOutlook:
    """What is foreseen of one course.

    Attributes
    ----------
    name : str
        The course.
    straps, offsets, hits, tangents : int
        Readings of it.
    radius_sd_m : float
        Standard deviation of its mean radius by the readings and by what they do not see, m.
    """

    name: str
    straps: int
    offsets: int
    hits: int
    tangents: int
    radius_sd_m: float


@dataclass(frozen=True)
class ReadingsOutlook:
    """How well readings of one kind control one another.

    Attributes
    ----------
    kind : str
        "straps", "offsets" or "tangents".
    count : int
        Readings.
    uncontrolled : int
        Of these, those that no other reading controls.
    mdb_m : float
        Largest of the smallest blunders of a radius that the tests of the others find, m.
    """

    kind: str
    count: int
    uncontrolled: int
    mdb_m: float


@dataclass(frozen=True)
class WallTable:
    """The job with its points, its wall, and the table.

    Attributes
    ----------
    job : Job
    wall : Wall, StrappedWall, NominalWall or None
        None: declared sizes alone describe the tank.
    made : ComputedTable
    sighting : Sighting or Touching or None
        As `check_table` takes it.
    measured : Measured or None
        What runs of liquid would make of the tank.
    """

    job: Job
    wall: object
    made: ComputedTable
    sighting: object = None
    measured: Measured | None = None

    @cached_property
    def liquid(self) -> LiquidResult | None:
        """What runs of liquid would say, beside the rows of the table."""
        return self.measured and self.measured.result(self.made.levels_m)

    @cached_property
    def stated(self):
        """Budgets and worst deliveries (`statements.Statements`)."""
        return statements(self.job, self.made.table, self.made.straightness.largest_m3)


@dataclass(frozen=True)
class WallPrediction(OfTable):
    """What a survey of a wall by tape, lines, hits or tangents would give, before it is made.

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
        """A tuple of ReadingsOutlook, of straps, offsets and tangents."""
        return readings_of(self.tabled)

    @cached_property
    def filling(self) -> FillingOutlook | None:
        """What runs of liquid would add to the geometry; None: there are none."""
        tabled = self.tabled
        if tabled.measured is None:
            return None
        return outlook_of_filling(self.plan, tabled.measured, tabled.liquid, tabled.made)

    @cached_property
    def warnings(self):
        """A tuple of Problem: what the run of such a survey will warn of."""
        tabled = self.tabled
        of_run = (
            *check_table(tabled.job, tabled.wall, tabled.made, tabled.sighting),
            *check_liquid_result(tabled.job, tabled.liquid),
        )
        found = (
            *self.plan.warnings,
            *self.plan.job.warnings,
            *told_of_plan(of_run, self.plan.design),
        )
        return tuple(one for one in dict.fromkeys(found) if _code(one) not in OF_READINGS)


def _code(problem):
    return getattr(problem.expected, "code", None)


def predict_wall(plan):
    """`WallPrediction` of a WallPlan.

    Its job is computed with amplitudes of the wall as they are assumed, as well known as its
    readings would tell those of a wall of just these sizes.

    Raises
    ------
    InputError
        For readings that tell too little of a course.
    SolutionError
        When they do not determine the wall.
    """
    try:
        tabled = foresee_table(plan.job, plan.amplitudes)
    except InputError as error:
        raise InputError(told_of_plan(error.problems, plan.design)) from error
    tall = sum(one.height_m for one in plan.job.courses) or tabled.made.top_m
    refuse_without_delivery(plan, tabled, tall)
    refuse_other_dips(plan.dips_m, tabled.made)
    return WallPrediction(plan, tabled)


def foresee_table(job, amplitudes):
    """`WallTable` of a job with the readings that its nominal sizes give.

    amplitudes  of the wall, as they are assumed
    """
    found = find_survey(job, lambda text: None, amplitudes)
    if found.survey is None or isinstance(found.survey, NominalWall):
        return _tabled(found, found.survey)  # nothing is read that could tell amplitudes
    field = found.survey.field
    expected = expect_amplitudes(field)
    if found.touching is not None:  # but how far a hull stands out
        found = find_survey(job, lambda text: None, expected)
        field = found.survey.field
    return _tabled(found, replace(found.survey, field=replace(field, amplitudes=expected)))


def _tabled(found, wall):
    """`WallTable` of a `Surveyed` whose wall is known as well as it will be."""
    measured = measure_by_liquid(found.job, wall)
    made = compute_table(found.job, wall, body=measured and measured.body)
    return WallTable(found.job, wall, made, found.sighting or found.touching, measured)


def courses_of(tabled):
    """A CourseOutlook of each course; () where nothing but liquid measures them."""
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
    names = [one.name for one in job.courses]
    counts = {kind: dict.fromkeys(names, 0) for kind in ("straps", "offsets", "hits", "tangents")}
    for one in () if job.strapping is None else job.strapping.straps:
        counts["straps"][one.course] += 1
    for one in () if job.lines is None else job.lines.offsets:
        counts["offsets"][one.course] += 1
    for course in () if job.hits is None else job.hits.course:
        counts["hits"][course] += 1
    for course in () if job.tangents is None else job.tangents.course:
        counts["tangents"][course] += 1
    return tuple(
        CourseOutlook(name, *(counts[kind][name] for kind in counts), float(sd))
        for name, sd in zip(names, sds, strict=True)
    )


def readings_of(tabled):
    """A ReadingsOutlook of the straps, of the offsets and of the tangents that a wall has."""
    wall = tabled.wall
    if not isinstance(wall, ReadWall):
        wall = wall and wall.read
    kinds = () if wall is None or isinstance(wall, NominalWall) else ("straps", "offsets")
    found = [(kind, wall.tests_of(kind)[1]) for kind in kinds]
    if tabled.job.tangents is not None:
        tests = judge_tangents(tabled.job, tabled.wall, tabled.sighting)
        found.append(("tangents", tests.mdb_m[~tabled.job.tangents.check]))
    return tuple(_outlook(kind, mdb) for kind, mdb in found if len(mdb))


def _outlook(kind, mdb_m):
    known = mdb_m[np.isfinite(mdb_m)]
    largest = float(known.max()) if len(known) else float("nan")
    return ReadingsOutlook(kind, len(mdb_m), len(mdb_m) - len(known), largest)
