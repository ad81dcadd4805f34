"""The whole record: its keys, and their values from a result.

The part of the record for inspections: the shape of an upright wall.

It contains radii and deviations from the vertical with u and degrees of freedom, but no verdict, so
that any rule can be applied later. u includes the common errors of the values.
"""

import platform
from math import degrees
from typing import Any

import numpy as np
import scipy

from tankcal.job.model import (
    Course,
    Datum,
    Deadwood,
    Equipment,
    InputFile,
    Inspection,
    Levels,
    Material,
    NextVerification,
    Seal,
    Survey,
    Switches,
    TableSpec,
    Tank,
)
from tankcal.methods.base import find_method, given_methods, methods
from tankcal.pipeline.tanks import Correction
from tankcal.pipeline.tanks.vertical import nominal_inside_m
from tankcal.pipeline.wall.shape import wall_shape_of
from tankcal.record import schema, survey, table
from tankcal.record.long_tables import LongTables
from tankcal.record.schema import Finite, Saved, fill_from, key, to_plain
from tankcal.record.table import Choice, adjustment_choices, choices_of
from tankcal.record.versions import FORMAT
from tankcal.tank.deliveries import WorstDeliveries
from tankcal.tank.heads import torispherical_radii
from tankcal.version import find_version


class ShapeLevel(Saved):
    """Inside radii of a level about its own centre, at the temperature of the survey."""

    height_m: Finite = key("above the bottom of the shell")
    course: int = key("from the bottom, 1 first")
    is_low: bool = key("whether it is the level 0.3 m above the bottom weld")
    centre_x_m: float | None = key("in the survey's frame; null: not known")
    centre_y_m: float | None = key("in the survey's frame; null: not known")
    azimuth_deg: list[Finite] = key("of each place, clockwise from +y")
    radius_m: list[Finite] = key("plate and paint taken off")
    u_mm: list[Finite] = key("standard uncertainty")
    dof: list[float] = key("degrees of freedom; null: infinite")


class ShapePlumb(Saved):
    """Deviations of an upper level from the vertical of a lower level, along the generatrices."""

    course: int | None = key("from the bottom, 1 first; null: several courses")
    low_m: Finite = key("height of the lower level above the bottom of the shell")
    high_m: Finite = key("height of the upper level")
    azimuth_deg: list[Finite] = key("of each generatrix, clockwise from +y")
    is_read: list[bool] = key("whether both ends have a reading; otherwise one is estimated")
    departure_mm: list[Finite] = key("outwards positive")
    u_mm: list[Finite] = key("standard uncertainty")
    dof: list[float] = key("degrees of freedom; null: infinite")


class ShapeAxis(Saved):
    """The centre of the highest level relative to that of the lowest."""

    low_m: Finite = key("height of the lowest level above the bottom of the shell")
    high_m: Finite = key("height of the highest level")
    x_mm: Finite = key("from the lower centre to the upper")
    y_mm: Finite = key("from the lower centre to the upper")
    u_mm: Finite = key("standard uncertainty along their direction")
    dof: float = key("degrees of freedom; null: infinite")


class ShapeSetAside(Saved):
    """A rejected point near the wall: of a fitting, a blunder, or a dent."""

    point: str = key("name")
    height_m: Finite = key("above the bottom of the shell")
    azimuth_deg: Finite = key("about the axis, clockwise from +y")
    residual_mm: Finite = key("outwards from the wall by the other points")


class WallShapeRecord(Saved):
    """The shape of an upright wall, for inspections."""

    state: str = key('"as_found": loaded as it was surveyed; "unloaded": head taken off')
    set_aside: list[ShapeSetAside] = key("rejected points near the wall")
    nominal_radius_m: Finite = key("inside, by the drawing")
    levels: list[ShapeLevel] = key("from the bottom up")
    plumbs: list[ShapePlumb] = key("each level with a known centre against the lowest of these")
    axis: ShapeAxis | None = key("null: fewer than two centres are known")
    courses: list[ShapePlumb] = key("those with two levels far enough apart")


def shape_record(job, wall):
    """Return the `WallShapeRecord` of a wall.

    Parameters
    ----------
    job : Job
        The computed job.
    wall : pipeline.wall.surveyed.Wall or None

    Returns
    -------
    WallShapeRecord or None
        None if no upright wall was surveyed by points.
    """
    shape = wall_shape_of(job, wall)
    if shape is None:
        return None
    heights = [level.height_m for level in shape.levels]
    axis = None
    if shape.axis is not None:
        low, high = shape.plumbs[-1].low, shape.plumbs[-1].high
        x, y, _ = 1000 * shape.axis.value_m
        axis = ShapeAxis(heights[low], heights[high], x, y,
                         1000 * shape.axis.u_m[2], shape.axis.dof[2])  # fmt: skip
    return WallShapeRecord(
        shape.state,
        [
            ShapeSetAside(
                point.point, point.height_m, np.degrees(point.azimuth_rad), 1000 * point.residual_m
            )
            for point in shape.set_aside
        ],
        nominal_inside_m(job, job.courses[0]),
        [_level(*level) for level in zip(shape.levels, shape.radii, shape.centres_m, strict=True)],
        [_plumb(plumb, heights, None) for plumb in shape.plumbs],
        axis,
        [_plumb(plumb, heights, shape.levels[plumb.low].course + 1) for plumb in shape.courses],
    )


def _level(level, radii, centre):
    x, y = (None, None) if centre is None else centre
    return ShapeLevel(
        level.height_m, level.course + 1, level.is_low, x, y, np.degrees(level.azimuth_rad),
        radii.value_m, 1000 * radii.u_m, radii.dof,
    )  # fmt: skip


def _plumb(plumb, heights, course):
    figures, azimuth_deg = plumb.figures, np.degrees(plumb.azimuth_rad)
    return ShapePlumb(
        course, heights[plumb.low], heights[plumb.high], azimuth_deg, plumb.is_read,
        1000 * figures.value_m, 1000 * figures.u_m, figures.dof,
    )  # fmt: skip


# ---- the part of the record on a ship: its sounding pipe, and corrections for trim and list


class CorrectionsOfCell(Saved):
    """Corrections of all soundings at one trim and list."""

    trim_m: Finite = key("draught aft less draught forward")
    list_deg: Finite = key("to starboard positive")
    dry_m3: Finite = key("volume at which the pipe becomes dry")
    full_m: Finite = key("sounding at which the tank becomes full")
    state: list[str] = key('"", "full": tank full; "below": less than the lowest row of the table')
    correction_m: list[float] = key("to be added to the sounding; null: none")
    u_correction_m: list[float] = key("standard uncertainty")
    U_correction_m: list[float] = key("expanded uncertainty")
    volume_m3: list[Finite] = key("of the tank at this trim and list")
    u_m3: list[float] = key("its standard uncertainty; null: tank full")
    U_m3: list[float] = key("expanded uncertainty")


class ShipRecord(Saved):
    """Sounding pipe of a tank of a ship, and corrections of soundings."""

    length_between_marks_m: Finite = key("length to which trims refer")
    bow_azimuth_deg: Finite = key("in the frame of the mesh, clockwise from +y")
    pipe_bottom_m: list[Finite] = key("x, y, z of the lower end in the frame of the mesh")
    pipe_top_m: list[Finite] = key("x, y, z of the upper end")
    contraction_percent: float | None = key("of all lengths in service; null: not given")
    interpolated_m: Finite = key("largest error of a correction half way between two soundings")
    trim_m: list[Finite] = key("ascending")
    list_deg: list[Finite] = key("ascending")
    sounding_m: list[Finite] = key("along the pipe from its lower end")
    cells: list[CorrectionsOfCell] = key("of each trim with each list, the list changing first")


def ship_of(result):
    """Return the `ShipRecord` of a result; None for a tank that is not on a ship."""
    ship, tables = result.job.ship, result.ship
    if tables is None:
        return None
    return ShipRecord(
        ship.length_between_marks_m,
        degrees(ship.bow_azimuth_rad),
        list(ship.pipe_bottom_m),
        list(ship.pipe_top_m),
        None if ship.contraction is None else 100 * ship.contraction,
        tables.interpolated_m,
        tables.trim_m,
        np.degrees(tables.list_rad).round(9),
        tables.sounding_m,
        [_cell(tables, *place) for place in np.ndindex(tables.dry_m3.shape)],
    )


def _cell(tables, trim, list_):
    cell = trim, list_
    return CorrectionsOfCell(
        tables.trim_m[trim],
        float(np.degrees(tables.list_rad[list_]).round(9)),
        tables.dry_m3[cell],
        tables.full_m[cell],
        tables.state[cell].tolist(),
        tables.correction_m[cell],
        tables.u_correction_m[cell],
        tables.U_correction_m[cell],
        tables.volume_m3[cell],
        tables.u_m3[cell],
        tables.U_m3[cell],
    )


# ---- the parts of a tank in the record: solid, bottom, top and floating roof


class Detail(Saved):
    """A size or another property of a part."""

    code: str = key("of the property")
    value: str | float = key("a text if unit is null, else a number in SI")
    unit: str | None = key("in which it is shown")


def list_details(**values):
    """Return the `Detail` of each code=(value, unit) whose value is not None."""
    return [
        Detail(code, value, unit) for code, (value, unit) in values.items() if value is not None
    ]


def bottom_of(result):
    """Return the details of the bottom of an upright tank; None for a flat bottom."""
    job = result.job
    bottom = job.bottom
    if job.tank.kind != "vertical" or bottom.form == "flat" or not job.switches.bottom:
        return None
    depth = None if bottom.centre_z_m is None else job.datum.bottom_z_m - bottom.centre_z_m
    if bottom.form == "torispherical" and depth is None:
        depth = -result.body.lowest_m
    surveyed = None if bottom.xyz_m is None else len(bottom.xyz_m)
    levels = None if bottom.level_m is None else len(bottom.level_m)
    return list_details(
        bottom_form=(bottom.form, None),
        bottom_depth=(depth, "m"),
        bottom_dish_radius=(bottom.dish_radius_m, "m"),
        bottom_knuckle_radius=(bottom.knuckle_radius_m, "m"),
        bottom_standard=(bottom.standard, None),
        bottom_points=(surveyed, ""),
        bottom_levels=(levels, ""),
        bottom_lowest=(result.body.lowest_m - result.zero_m, "m"),
    )


def top_of(result):
    """Return the details of the head on an upright tank; None without head."""
    top = result.job.top
    if top is None or not result.job.switches.top:
        return None
    body = result.body
    return list_details(
        top_form=(top.form, None),
        top_depth=(body.highest_m - body.shell.volume.height_m, "m"),
        top_dish_radius=(top.dish_radius_m, "m"),
        top_knuckle_radius=(top.knuckle_radius_m, "m"),
        top_standard=(top.standard, None),
        top_capacity=(_correction_m3(result, "top"), "m3"),
    )


def roof_of(result):
    """Return the details of the floating roof; None without roof."""
    roof = result.job.roof
    if roof is None:
        return None
    high = {}
    if roof.high_critical_bottom_m is not None:
        high["roof_high_bottom"] = (roof.high_critical_bottom_m, "m")
        high["roof_high_top"] = (roof.high_critical_top_m, "m")
    return list_details(
        roof_mass=(roof.mass_kg, "kg"),
        roof_weighing=(roof.weighing, None),
        roof_reference_density=(roof.reference_density_kg_m3, "kg/m3"),
        roof_displacement=(-_correction_m3(result, "roof"), "m3"),
        roof_critical_bottom=(roof.critical_bottom_m, "m"),
        roof_critical_top=(roof.critical_top_m, "m"),
        **high,
    )


def _correction_m3(result, code):
    return next(item.size_m3 for item in result.corrections if item.code == code)


def solid_of(result):
    """Return the inside dimensions of a tank without courses; None for a shell of courses."""
    job = result.job
    if job.horizontal is not None:
        return _horizontal_details(result)
    sizes, part = _sizes_by_methods(result), result.body.parts[0]
    if job.sphere is not None:
        sizes = {"diameter": (part.solid.diameter_m, "m"), **_scan_details(result), **sizes}
    return list_details(**sizes, full_capacity=(part.capacity_m3, "m3")) if sizes else None


def _sizes_by_methods(result):
    """Sizes as surveyed by the methods of the job: {name: (value, unit)}."""
    sizes = {}
    for method in given_methods(result.job):
        sizes |= method.sizes(result)
    return sizes


def _horizontal_details(result):
    lying, tank = result.job.horizontal, result.body.parts[0].solid
    ends = {}
    for name, end in (("a", tank.end_a), ("b", tank.end_b)):
        ends[f"end_{name}"] = (end.kind, None)
        dish, knuckle = end.dish_radius_m, end.knuckle_radius_m
        if end.kind == "torispherical":
            dish, knuckle = torispherical_radii(tank.height_m / 2, end.depth_m, dish, knuckle)
        ends[f"end_{name}_depth"] = (end.depth_m or None, "m")
        ends[f"end_{name}_dish_radius"] = (dish, "m")
        ends[f"end_{name}_knuckle_radius"] = (knuckle, "m")
    return list_details(
        section_width=(tank.width_m, "m"),
        section_height=(tank.height_m, "m"),
        cylinder_length=(tank.length_m, "m"),
        **ends,
        axis_tilt=(tank.tilt, "mm/m"),
        roll=(degrees(lying.roll_rad), "deg"),
        dip_from_a=(tank.dip_from_a_m, "m"),
        dip_direction=(tank.dip_direction, None),
        tube_angle=(lying.tube_angle_rad and degrees(lying.tube_angle_rad), "deg"),
        tube_offset=(lying.tube_offset_m and tank.tube_offset_m, "m"),
        **_scan_details(result),
        full_capacity=(result.body.parts[0].capacity_m3, "m3"),
        **_sizes_by_methods(result),
    )


def _scan_details(result):
    """Return the number of points and their scatter; {} without points."""
    scan = result.scan
    if scan is None:
        return {}
    return {
        "points_surveyed": (len(scan.residuals_m), ""),
        "points_accepted": (len(scan.accepted), ""),
        "wall_noise": (scan.noise_m, "mm"),
    }


# ---- the whole record: its keys, and their values from a result


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
    seals: list[Seal] | None = key(
        "seal plan; left out without seals.toml", default=None, optional=True
    )
    next_verification: NextVerification | None = key(
        "by a rule or as wished by the customer; left out if none", default=None, optional=True
    )


class MeterByTank(Saved):
    """Factor of a meter, as determined together with a table kept up by everyday data."""

    name: str = key("of the meter")
    certificate: str | None = key("null: not traceable")
    factor: Finite = key("volume over indication, relative to its certificate")
    u: Finite = key("standard uncertainty")
    covariance_with_inputs: list[Finite] = key("of the factor with each input of the table")


class KeptUp(Saved):
    """Everyday data of a table (`tankcal upkeep`)."""

    former_sha256: str = key("of the record of the former table, which the table contains")
    first: str = key("day of the first step, UTC")
    last: str = key("day of the last step, UTC")
    steps: int = key("used")
    logs: list[str] = key("SHA-256 of all logs in the table, also of earlier upkeeps")
    meters: list[MeterByTank] = key("by the tank")


def saved_parts_of_methods():
    """Keys of the methods in a record: {name: (function that returns the type, description)}."""
    return {m.name: (m.saved_type, m.saved_note) for m in methods() if m.saved_type}


def _adjustment_type():
    from tankcal.record.adjustment import AdjustmentRecord

    return AdjustmentRecord | None


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
    on_high_legs: list[table.RowOnHighLegs] | None = key(
        "rows that differ with the roof on high legs; left out with a single position",
        default=None,
        optional=True,
    )
    roof_corrections: list[table.RoofCorrection] | None = key(
        "by density; left out without a floating roof", default=None, optional=True
    )
    gross: table.GrossShell | None = key("null for a tank without courses", default=None)
    corrections: list[Correction] = key("that apply to the job, in their order", default=())
    solid: list[Detail] | None = key("sizes of a tank without courses", default=None)
    bottom: list[Detail] | None = key("of the calculation; null: it is flat", default=None)
    top: list[Detail] | None = key(
        "the head on top; left out if there is none", default=None, optional=True
    )
    deadwood: list[Deadwood] = key("as declared, also if switched off", default=())
    roof: list[Detail] | None = key("the floating roof", default=None)
    budget: list[table.BudgetLine] = key("of the top row, of the table alone", default=())
    choices: list[Choice] = key("all assumptions")
    warnings: list[schema.WarningRecord] = key("problems that did not stop the job")
    adjustment: Any = key("null: points were supplied", kind=_adjustment_type, default=None)
    budgets: list[table.StatedBudget] = key("stated volumes, then deliveries", default=())
    limits: list[table.LimitOfTank] | None = key(
        "volumes of the operating levels; left out if there are none", default=None, optional=True
    )
    deliveries: list[WorstDeliveries] = key("the worst of each minimum height", default=())
    rule: table.TableJudged | None = key("null: the job has no decision rule", default=None)
    monte_carlo: table.MonteCarlo | None = key("null: it is off", default=None)
    upkeep: KeptUp | None = key(
        "everyday data of the table; left out without them", default=None, optional=True
    )
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
            on_high_legs=table.rows_on_high_legs(result),
            roof_corrections=table.roof_corrections_of(result),
            gross=table.gross_of(result),
            corrections=result.corrections,
            solid=solid_of(result),
            bottom=bottom_of(result),
            top=top_of(result),
            deadwood=job.deadwood,
            roof=roof_of(result),
            budget=table.budget_of(result),
            choices=choices_of(result),
            warnings=schema.warnings_of(result.warnings),
            adjustment=adjustment and _adjustment_of(adjustment, job.measurements),
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


def _adjustment_of(adjustment, measurements):
    from tankcal.record.adjustment import adjustment_of  # most jobs supply points

    return adjustment_of(adjustment, measurements)


def record_of_adjustment(job, adjustment):
    """Return the record of a survey that was only adjusted; data of a tank are null or empty."""
    measurements = getattr(job, "measurements", None)
    record = to_plain(
        Record(
            **_head_values(job),
            points=survey.points_of_adjustment(adjustment),
            overrulings=survey.overrulings_of_adjustment(job),
            choices=adjustment_choices(adjustment, measurements),
            warnings=schema.warnings_of(dict.fromkeys((*job.warnings, *adjustment.warnings))),
            adjustment=_adjustment_of(adjustment, measurements),
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
            seals=job.seals or None,
            next_verification=job.next_verification,
        ),
    }
