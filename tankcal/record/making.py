"""The whole record: its keys, and how it is made of a result."""

import platform
from dataclasses import dataclass

import numpy as np
import scipy

import tankcal
from tankcal.job.model import InputFile
from tankcal.job.model.parts import Course, Deadwood
from tankcal.job.model.settings import Datum, Material, Survey, Switches, TableSpec, Tank
from tankcal.pipeline.corrections import Correction
from tankcal.record.adjustment import AdjustmentRecord, adjustment_of
from tankcal.record.parts import Detail, bottom_of, roof_of, solid_of
from tankcal.record.plain_data import to_plain
from tankcal.record.rules import TableJudged, rule_of
from tankcal.record.schema import filled_from, key
from tankcal.record.statements import (
    BudgetLine,
    MonteCarlo,
    StatedBudget,
    budget_of,
    budgets_of,
    monte_carlo_of,
)
from tankcal.record.survey import (
    CourseOfShell,
    RejectedPoint,
    SectionCircle,
    SurveyedPoint,
    Wall,
    courses_of,
    points_of,
    points_of_adjustment,
    rejected_of,
    sections_of,
    shell_of,
)
from tankcal.record.table import (
    CapacityTable,
    Choice,
    GrossShell,
    InterpolationError,
    PartsOfRows,
    VolumesOfDensity,
    adjustment_choices,
    capacity_of,
    choices_of,
    densities_of,
    gross_of,
    proportional_parts_of,
)
from tankcal.record.texts import WarningRecord, warnings_of
from tankcal.record.versions import FORMAT
from tankcal.tank.deliveries import WorstDeliveries


@dataclass(frozen=True)
class Versions:
    """Of the programs that computed."""

    python: str = key("such as 3.11.7")
    numpy: str = key("such as 2.4.6")
    scipy: str = key("such as 1.17.1")


@dataclass(frozen=True)
class JobAsRead:
    """The job as read, in SI; null is what a job that was only adjusted did not give of a tank."""

    tank: Tank | None = key("kind, nominal sizes, details")
    survey: Survey | None = key("when and from where it was measured")
    datum: Datum | None = key("heights in the survey's frame")
    table: TableSpec | None = key("what the table is to be")
    material: Material | None = key("of the shell")
    corrections: Switches | None = key("which are on", of="switches")
    courses: list[Course] = key("from the bottom up")
    certificate: dict = key("texts; only what was given")
    source: str = key("name of the folder or workbook")


@dataclass(frozen=True, kw_only=True)
class Record:
    """All that workbook and report need."""

    format: str = key("see Versions", default=FORMAT)
    tankcal: str = key("version of tankcal", default=tankcal.__version__)
    versions: Versions = key("of python, numpy, scipy")
    files: list[InputFile] = key("everything that the job was read from")
    job: JobAsRead = key("the job as read, in SI")
    shell: Wall | None = key("the wall as one body", default=None)
    points: list[SurveyedPoint] = key("of an adjusted survey every adjusted point first")
    rejected: list[RejectedPoint] = key("points that are not on the wall", default=())
    sections: list[SectionCircle] = key("from the bottom up", default=())
    courses: list[CourseOfShell] = key("from the bottom up", default=())
    capacity: CapacityTable | None = key("the table", default=None)
    interpolation: InterpolationError | None = key(
        "error of interpolating between rows", default=None
    )
    proportional_parts: PartsOfRows | None = key("millimetres of a centimetre table", default=None)
    densities: list[VolumesOfDensity] = key("further densities of the liquid", default=())
    gross: GrossShell | None = key("null for a tank without courses", default=None)
    corrections: list[Correction] = key("that bear on the job, in their order", default=())
    solid: list[Detail] | None = key("sizes of a tank without courses", default=None)
    bottom: list[Detail] | None = key("how it was taken; null: it is flat", default=None)
    deadwood: list[Deadwood] = key("as declared, whether or not it is on", default=())
    roof: list[Detail] | None = key("the floating roof", default=None)
    budget: list[BudgetLine] = key("of the top row, by the table alone", default=())
    choices: list[Choice] = key("everything that was assumed")
    warnings: list[WarningRecord] = key("what should be read")
    adjustment: AdjustmentRecord | None = key("null: the points were handed in", default=None)
    budgets: list[StatedBudget] = key("stated volumes, then deliveries", default=())
    deliveries: list[WorstDeliveries] = key("the worst of each minimum height", default=())
    rule: TableJudged | None = key("null: the job has no decision rule", default=None)
    monte_carlo: MonteCarlo | None = key("null: it is off", default=None)


_HEAD = ("format", "tankcal", "versions", "files", "job")
_OF_A_SURVEY = ("points", "choices", "warnings", "adjustment")


def record_of(result):
    """The record of a `chain.Result`: a dict of plain numbers, texts and lists."""
    job, adjustment = result.job, result.adjustment
    return to_plain(
        Record(
            **_beginning(job),
            shell=shell_of(result),
            points=points_of(result),
            rejected=rejected_of(result),
            sections=sections_of(result),
            courses=courses_of(result),
            capacity=capacity_of(result),
            interpolation=filled_from(InterpolationError, result.straightness),
            proportional_parts=proportional_parts_of(result),
            densities=densities_of(result),
            gross=gross_of(result),
            corrections=result.corrections,
            solid=solid_of(result),
            bottom=bottom_of(result),
            deadwood=job.deadwood,
            roof=roof_of(result),
            budget=budget_of(result),
            choices=choices_of(result),
            warnings=warnings_of(result.warnings),
            adjustment=adjustment and adjustment_of(adjustment, job.measurements),
            budgets=budgets_of(result),
            deliveries=result.stated.worst,
            rule=rule_of(result.rule),
            monte_carlo=monte_carlo_of(result),
        )
    )


def record_of_adjustment(job, adjustment):
    """The record of a survey that was only adjusted: what a tank has is null or empty."""
    measurements = getattr(job, "measurements", None)
    found = to_plain(
        Record(
            **_beginning(job),
            points=points_of_adjustment(adjustment),
            choices=adjustment_choices(adjustment, measurements),
            warnings=warnings_of(dict.fromkeys((*job.warnings, *adjustment.warnings))),
            adjustment=adjustment_of(adjustment, measurements),
        )
    )
    of_a_tank = [one for one in found if one not in _HEAD + _OF_A_SURVEY]
    of_a_tank.sort(key=lambda one: found[one] is not None)  # null first: as it was always written
    return {one: found[one] for one in (*_HEAD, *of_a_tank, *_OF_A_SURVEY)}


def _beginning(job):
    versions = Versions(platform.python_version(), np.__version__, scipy.__version__)
    return {"versions": versions, "files": job.files, "job": filled_from(JobAsRead, job)}
