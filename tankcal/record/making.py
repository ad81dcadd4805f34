"""The whole record: its keys, and their values from a result."""

import platform

import numpy as np
import scipy

from tankcal.job.model import InputFile
from tankcal.job.model.parts import Course, Deadwood
from tankcal.job.model.settings import (
    Datum,
    Equipment,
    Inspection,
    Levels,
    Material,
    Survey,
    Switches,
    TableSpec,
    Tank,
)
from tankcal.methods.base import find_method, methods
from tankcal.pipeline.tanks.corrections import Correction
from tankcal.record import survey, table, tank_parts, texts
from tankcal.record.adjustment import AdjustmentRecord, adjustment_of
from tankcal.record.choices import Choice, adjustment_choices, choices_of
from tankcal.record.long_tables import LongTables
from tankcal.record.schema import Saved, fill_from, key, to_plain
from tankcal.record.ship import ShipRecord, ship_of
from tankcal.record.versions import FORMAT
from tankcal.record.wall_shape import WallShapeRecord, shape_record
from tankcal.tank.deliveries import WorstDeliveries
from tankcal.version import find_version


class Versions(Saved):
    """Versions of the programs that computed the record."""

    python: str = key("such as 3.11.7")
    numpy: str = key("such as 2.4.6")
    scipy: str = key("such as 1.17.1")


class JobAsRead(Saved):
    """The job as read, in SI; null for data of a tank that an adjusted survey does not need."""

    tank: Tank | None = key("kind, nominal sizes, details")
    survey: Survey | None = key("when and from where it was measured")
    datum: Datum | None = key("heights in the survey's frame")
    table: TableSpec | None = key("specification of the table")
    material: Material | None = key("of the shell")
    corrections: Switches | None = key("which are on", of="switches")
    courses: list[Course] = key("from the bottom up")
    certificate: dict = key("texts; only given keys")
    source: str = key("name of the folder or workbook")
    inspection: Inspection | None = key(
        "data of an inspection; left out if none are given",
        default=None,
        optional=True,
    )
    levels: Levels | None = key(
        "operating levels; left out if none are given", default=None, optional=True
    )
    equipment: list[Equipment] | None = key(
        "used in the survey; left out without a register", default=None, optional=True
    )


def saved_parts_of_methods():
    """Keys of the methods in a record: {name: (dataclass, description)}."""
    parts = {method.name: (method.saved_type(), method.saved_note) for method in methods()}
    return {name: part for name, part in parts.items() if part[0] is not None}


class Record(Saved, kw_only=True):
    """All data of workbook and report."""

    format: str = key("see Versions", default=FORMAT)
    tankcal: str = key("version of tankcal", default_factory=find_version)
    versions: Versions = key("of python, numpy, scipy")
    files: list[InputFile] = key("all input files of the job")
    job: JobAsRead = key("the job as read, in SI")
    shell: survey.Wall | None = key("the wall as one body", default=None)
    points: list[survey.SurveyedPoint] | None = key(
        "of an adjusted survey every adjusted point first; null: in the file of `long_tables`"
    )
    rejected: list[survey.RejectedPoint] = key("points that are not on the wall", default=())
    overrulings: survey.OverrulingsRecord | None = key(
        "decisions against the search for blunders; left out if there are none",
        default=None,
        optional=True,
    )
    sections: list[survey.SectionCircle] = key("from the bottom up", default=())
    homogeneity: survey.HomogeneityRecord | None = key(
        "of the noise of the sections; left out if no section has independent noise",
        default=None,
        optional=True,
    )
    surveys: dict = key(
        "saved part of each method", default_factory=dict, parts=saved_parts_of_methods
    )
    ship: ShipRecord | None = key(
        "corrections for trim and list; left out if there are none", default=None, optional=True
    )
    courses: list[survey.CourseOfShell] = key("from the bottom up", default=())
    wall_shape: WallShapeRecord | None = key(
        "for inspections; left out if no upright wall was surveyed by points",
        default=None,
        optional=True,
    )
    capacity: table.CapacityTable | None = key("the table", default=None)
    interpolation: table.InterpolationError | None = key("between rows", default=None)
    proportional_parts: table.PartsOfRows | None = key("of millimetres", default=None)
    densities: list[table.VolumesOfDensity] = key("further densities of the liquid", default=())
    gross: table.GrossShell | None = key("null for a tank without courses", default=None)
    corrections: list[Correction] = key("that apply to the job, in their order", default=())
    solid: list[tank_parts.Detail] | None = key("sizes of a tank without courses", default=None)
    bottom: list[tank_parts.Detail] | None = key(
        "of the calculation; null: it is flat", default=None
    )
    top: list[tank_parts.Detail] | None = key(
        "the head on top; left out if there is none", default=None, optional=True
    )
    deadwood: list[Deadwood] = key("as declared, also if switched off", default=())
    roof: list[tank_parts.Detail] | None = key("the floating roof", default=None)
    budget: list[table.BudgetLine] = key("of the top row, of the table alone", default=())
    choices: list[Choice] = key("all assumptions")
    warnings: list[texts.WarningRecord] = key("problems that did not stop the job")
    adjustment: AdjustmentRecord | None = key("null: points were supplied", default=None)
    budgets: list[table.StatedBudget] = key("stated volumes, then deliveries", default=())
    limits: list[table.LimitOfTank] | None = key(
        "volumes of the operating levels; left out if there are none", default=None, optional=True
    )
    deliveries: list[WorstDeliveries] = key("the worst of each minimum height", default=())
    rule: table.TableJudged | None = key("null: the job has no decision rule", default=None)
    monte_carlo: table.MonteCarlo | None = key("null: it is off", default=None)
    long_tables: LongTables | None = key(
        "the file of tables with more than 10 000 rows; left out if there are none",
        default=None,
        optional=True,
    )

    def __getattr__(self, name):
        # The saved part of a method is an attribute, as every other key of the record is.
        if name not in saved_parts_of_methods():
            raise AttributeError(f"'Record' object has no attribute {name!r}")
        return self.surveys.get(name)


_HEAD = ("format", "tankcal", "versions", "files", "job")
_OF_A_SURVEY = ("points", "choices", "warnings", "adjustment")


def record_of(result):
    """Return the record of a `result.Result`: a dict of plain numbers, texts and lists."""
    job, adjustment = result.job, result.adjustment
    return to_plain(
        Record(
            **_head_values(job),
            shell=survey.shell_of(result),
            points=survey.points_of(result),
            rejected=survey.rejections_of(result),
            overrulings=survey.overrulings_of(result),
            sections=survey.sections_of(result),
            homogeneity=survey.homogeneity_record(job, result.wall),
            ship=ship_of(result),
            surveys=surveys_of(result),
            courses=survey.courses_of(result),
            wall_shape=shape_record(job, result.wall),
            capacity=table.capacity_of(result),
            interpolation=fill_from(table.InterpolationError, result.straightness),
            proportional_parts=table.proportional_parts_of(result),
            densities=table.densities_of(result),
            gross=table.gross_of(result),
            corrections=result.corrections,
            solid=tank_parts.solid_of(result),
            bottom=tank_parts.bottom_of(result),
            top=tank_parts.top_of(result),
            deadwood=job.deadwood,
            roof=tank_parts.roof_of(result),
            budget=table.budget_of(result),
            choices=choices_of(result),
            warnings=texts.warnings_of(result.warnings),
            adjustment=adjustment and adjustment_of(adjustment, job.measurements),
            budgets=table.budgets_of(result),
            limits=result.stated.limits or None,
            deliveries=result.stated.worst,
            rule=table.rule_of(result.rule),
            monte_carlo=table.monte_carlo_of(result),
        )
    )


def surveys_of(result):
    """Saved part of each method, by its name."""
    named = ((name, find_method(name)) for name in saved_parts_of_methods())
    return {name: method.save(result) for name, method in named if method.is_saved(result)}


def record_of_adjustment(job, adjustment):
    """Return the record of a survey that was only adjusted; data of a tank are null or empty."""
    measurements = getattr(job, "measurements", None)
    record = to_plain(
        Record(
            **_head_values(job),
            points=survey.points_of_adjustment(adjustment),
            overrulings=survey.overrulings_of_adjustment(job),
            choices=adjustment_choices(adjustment, measurements),
            warnings=texts.warnings_of(dict.fromkeys((*job.warnings, *adjustment.warnings))),
            adjustment=adjustment_of(adjustment, measurements),
        )
    )
    tank_keys = [name for name in record if name not in _HEAD + _OF_A_SURVEY]
    tank_keys.sort(key=lambda name: record[name] is not None)  # null first, as in earlier versions
    return {name: record[name] for name in (*_HEAD, *tank_keys, *_OF_A_SURVEY)}


def _head_values(job):
    """Return the values of the first keys; those with a default are missing."""
    versions = Versions(platform.python_version(), np.__version__, scipy.__version__)
    return {
        "versions": versions,
        "files": job.files,
        "job": fill_from(
            JobAsRead,
            job,
            inspection=job.inspection,
            levels=job.levels,
            equipment=job.equipment or None,
        ),
    }
