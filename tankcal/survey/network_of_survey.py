"""Conversion of measurements to a network survey: names become numbers, repeated readings means."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import list_some, message
from tankcal.survey.correlations import blocks_of, rows_of
from tankcal.survey.diagnosis.double_names import image_point_label
from tankcal.survey.diagnosis.undetermined import (
    find_left_out,
    find_untouched_coordinates,
    unmeasured_sentence,
)
from tankcal.survey.means import average_repeated, reject_scattered
from tankcal.survey.network import Instrument, Survey, System
from tankcal.survey.observations import (
    KINDS,
    ControlCoordinates,
    ImageCoordinates,
    Source,
    SystemCoordinates,
)
from tankcal.survey.photographs import gathered_photos, orientation_of
from tankcal.survey.readings import Numbers, bend_per_m, observations_of_readings

AXES = "xyz"
TOLD = 10  # warnings listed singly; further omitted points are only counted


@dataclass(frozen=True)
class GatheredSurvey:
    """A survey without start values, whose observations keep a Trace to their readings.

    Attributes
    ----------
    survey : network.Survey
        Unknown coordinates are nan. Control is observed or fixed with datum "control" only.
    checks : tuple of Observations
        Compared, not adjusted.
    known : KnownControl
        Control in the frame of the survey.
    idle : ndarray of bool, shape (points, 3)
        True: no observation determines this coordinate; it keeps its start value.
    lost : dict
        {name: file} of points that cannot be adjusted.
    aside : tuple
        Sentences about the lost points.
    warnings : tuple of Problem
    repeats : RepeatedReadings or None
        Repeated readings of image points.
    """

    survey: Survey
    checks: tuple
    known: object
    idle: np.ndarray
    lost: dict
    aside: tuple
    warnings: tuple
    repeats: object = None


@dataclass(frozen=True)
class KnownControl:
    """Control coordinates and their standard deviations in the frame of the survey; nan: none.

    Attributes
    ----------
    xyz_m, sd_m : ndarray, shape (points, 3)
    row : dict
        {point: row of control.csv}.
    """

    xyz_m: np.ndarray
    sd_m: np.ndarray
    row: dict


def gather(measurements):
    """Convert Measurements to a GatheredSurvey.

    Parameters
    ----------
    measurements : Measurements

    Returns
    -------
    GatheredSurvey

    Raises
    ------
    InputError
        If measurements contradict each other or lack standard deviations.
    """
    measurements, repeated, scattered = reject_scattered(measurements)
    excluded = {}
    # Omitting a point removes observations of its neighbours, so repeat until every point has
    # enough.
    while True:
        gathered = _gather(measurements, excluded)
        poor = find_left_out(gathered.survey)
        if not poor:
            break
        excluded |= poor
    excluded = _omitted_points(measurements, gathered.survey.points, excluded)
    where = {name: find_point_row(measurements, name) for name in excluded}
    idle, warnings = find_untouched_coordinates(gathered.survey)
    warnings += _omission_warnings(excluded, where)
    # A coordinate without observation would make the normal matrix singular.
    fixed = idle if gathered.survey.fixed is None else gathered.survey.fixed | idle
    return replace(
        gathered,
        survey=replace(gathered.survey, fixed=fixed),
        idle=idle,
        lost={name: file for name, (file, _) in where.items()},
        aside=tuple(excluded.values()),
        warnings=(*scattered, *gathered.warnings, *warnings),
        repeats=repeated,
    )


def _omission_warnings(excluded, where):
    """Problem rows of omitted points {name: reason}: the first ones, and the number of the
    others."""
    problems = [Problem(where[name][0], text, where[name][1]) for name, text in excluded.items()]
    if len(problems) <= TOLD:
        return problems
    text = message(
        "more_left_out",
        "further points are left out because they have too few observations: {points}",
        points=list_some(list(excluded)[TOLD - 1 :], TOLD),
    )
    return [*problems[: TOLD - 1], Problem("job.toml", text, None, "adjustment")]


def _omitted_points(measurements, points, excluded):
    """{name: reason} of omitted points, including unmeasured points of control.csv and
    check.csv."""
    reasons = dict(excluded)
    for table in (measurements.control, measurements.check):
        for name in () if table is None else table.point:
            if name not in points and name not in reasons:
                reasons[name] = unmeasured_sentence(name)
    return reasons


def find_point_row(measurements, name):
    """File and row of the first occurrence of a point."""
    tables = [(measurements.image_points, ("point",)), (measurements.control, ("point",))]
    tables += [
        (table_of_readings, ("end", "start", "origin"))
        for table_of_readings in measurements.readings
    ]
    for table, columns in [*tables, (measurements.check, ("point",))]:
        for column in columns if table is not None else ():
            names = getattr(table, column)
            if name in names:
                return table.file, table.rows[names.index(name)] if table.rows else None
    return "setups.csv", None


def _gather(measurements, excluded):
    """The GatheredSurvey of measurements without the excluded points."""
    warnings = []
    numbers = _numbers(measurements, excluded)
    known = _known_control(measurements.control, numbers.points)
    observations, checks = [], []
    fixed = None
    if measurements.settings.datum == "control":
        fixed = np.nan_to_num(known.sd_m, nan=1.0) == 0
        # With another datum, control serves for start values and comparison only.
        fixed &= np.isfinite(known.xyz_m)
        alone = rows_of(measurements.correlated, "control")
        observations += _control(measurements.control, numbers.points, warnings, alone)
    systems, of_systems = _systems(measurements.control, numbers.points)
    observations += of_systems
    bend = bend_per_m(measurements.settings.refraction)
    for readings in measurements.readings:
        alone = rows_of(measurements.correlated, readings.table)
        adjusted, compared = observations_of_readings(
            readings, numbers, bend=bend, warnings=warnings, correlated=alone
        )
        observations += adjusted
        checks += compared
    photos, cameras, order = gathered_photos(measurements)
    images = None
    if photos is not None:
        images, compared = _images(measurements, numbers.points, order, warnings)
        checks += compared
        observations += orientation_of(measurements, order)
    survey = Survey(
        points=tuple(numbers.points), xyz_m=np.full((len(numbers.points), 3), np.nan),
        fixed=fixed, image_points=images, photos=photos, cameras=cameras,
        observations=tuple(observations), sets=np.full(len(numbers.sets), np.nan),
        instruments=_instruments(measurements, numbers), systems=systems,
        correlated=blocks_of(measurements, observations), set_names=tuple(numbers.sets),
        kept=measurements.kept,
    )  # fmt: skip
    return GatheredSurvey(survey, tuple(checks), known, None, {}, (), tuple(warnings))


def _numbers(measurements, excluded):
    """Numbers of all measured items, in the order of their first occurrence."""
    setups = {item.name: item for item in measurements.setups}
    points, sets, tools = {}, {}, {}

    def count(names):
        for name in names:
            if name not in excluded:
                points.setdefault(name, len(points))

    if measurements.image_points is not None:
        images = measurements.image_points
        count(name for name, check in zip(images.point, images.check, strict=True) if not check)
    for table in measurements.readings:
        kind = KINDS[table.table]
        use = np.flatnonzero(~np.asarray(table.check, dtype=bool)).tolist()
        for i in use:
            start = setups[table.setup[i]].station if table.setup else table.start[i]
            ends = (start, table.end[i], table.origin[i]) if table.origin else (start, table.end[i])
            count(ends)
            if kind.has("set") and not excluded.keys() & set(ends):
                sets.setdefault((table.setup[i], table.set[i] if table.set else None), len(sets))
            if kind.has("instrument"):
                tool = setups[table.setup[i]].instrument if table.setup else None
                tool = table.instrument[i] if table.instrument else tool
                if tool is not None:
                    tools.setdefault(tool, len(tools))
    known = {item.name: item for item in measurements.instruments}
    return Numbers(points, setups, tools, known, sets)


def _instruments(measurements, numbers):
    """Instruments of the network that measured distances."""
    used_tools = [numbers.tools[name] for name in numbers.instruments]
    return tuple(
        Instrument(tool.name, scale_sd=tool.u_scale, offset_sd_m=tool.u_offset_m)
        for tool in used_tools
    )


def _rows_in_survey_frame(control):
    """Row numbers of control in the frame of the survey, without check rows."""
    if control is None:
        return []
    systems = control.system or (None,) * len(control.point)
    return [
        i
        for i, (system, check) in enumerate(zip(systems, control.check, strict=True))
        if system is None and not check
    ]


def _known_control(control, points):
    """The Known control of the points of the survey."""
    xyz, sd = np.full((2, len(points), 3), np.nan)
    row = {}
    for i in _rows_in_survey_frame(control):
        number = points.get(control.point[i])
        if number is not None:
            # A point may occur in several rows, each with some of its coordinates.
            new = np.isfinite(control.xyz_m[i])
            xyz[number, new], sd[number, new] = control.xyz_m[i, new], control.sd_m[i, new]
            row.setdefault(control.point[i], control.rows[i] if control.rows else None)
    return KnownControl(xyz, sd, row)


def _coordinates(control, rows, points):
    """Single weighted coordinates of some rows: row, point, axis, value, sd, each (n,)."""
    rows = np.array([i for i in rows if control.point[i] in points], dtype=int)
    value, sd = control.xyz_m[rows], control.sd_m[rows]
    where, axis = np.nonzero(np.isfinite(value) & np.isfinite(sd))
    point = np.array([points[control.point[i]] for i in rows], dtype=int)
    return rows[where], point[where], axis, value[where, axis], sd[where, axis]


def _control(control, points, warnings, alone=frozenset()):
    """Weighted control coordinates as a list of one table, or an empty list."""
    if control is None:
        return []
    row, point, axis, value, sd = _coordinates(control, _rows_in_survey_frame(control), points)
    trace = _control_source(control, row, axis).trace()
    table = ControlCoordinates(value, sd, point, axis, trace=trace).taken(sd > 0)
    label = 3 * table.point + table.axis
    # Correlated values are not averaged: a mean would lose their covariance with other values.
    if alone:
        is_correlated = np.isin(table.trace.rows, list(alone))
        label = np.where(is_correlated, 3 * len(points) + np.arange(len(label)), label)
    averaged = average_repeated(
        table, label, warnings, name_of=lambda ids, element: f"{ids[0]} {element[0]}"
    )
    return [averaged] if len(averaged) else []


def _control_source(control, rows, axis, group=()):
    """Source of single coordinates of control."""
    return Source(
        control.file,
        tuple(control.rows[i] for i in rows) if control.rows else (),
        tuple((control.point[i],) for i in rows),
        tuple((AXES[k],) for k in axis),
        group,
    )


def held_trace(known, points):
    """Trace of held coordinates, numbered 3 point + axis."""
    return Source(
        "control.csv",
        tuple(known.row.get(name) for name in points for _ in AXES),
        tuple((name,) for name in points for _ in AXES),
        tuple((axis,) for axis in AXES) * len(points),
    ).trace()


def _systems(control, points):
    """Return further coordinate systems and a list of their coordinates."""
    if control is None:
        return (), []
    names = {}
    for system in control.system:
        if system is not None:
            names.setdefault(system, len(names))
    rows = [
        i
        for i, (system, check) in enumerate(zip(control.system, control.check, strict=True))
        if system is not None and not check
    ]
    row, point, axis, value, sd = _coordinates(control, rows, points)
    if not len(row):
        return (), []
    system = np.array([names[control.system[i]] for i in row])
    group = tuple(control.system[i] for i in row)
    trace = _control_source(control, row, axis, group=group).trace()
    coordinates = SystemCoordinates(value, sd, point, axis, system, trace=trace)
    return tuple(System(name) for name in names), [coordinates]


def _images(measurements, points, order, warnings):
    """Return the adjusted ImageCoordinates, and a list of those compared."""
    images = measurements.image_points
    sd = np.array(images.sd_mm, dtype=float)
    if measurements.settings.image_sd_mm is not None:
        sd = np.where(np.isnan(sd), measurements.settings.image_sd_mm, sd)
    _refuse_missing_sd(images, sd)
    photo = np.array([order.get(name, -1) for name in images.photo], dtype=int)
    point = np.array([points.get(name, -1) for name in images.point], dtype=int)
    check = np.asarray(images.check, dtype=bool)
    is_usable = (photo >= 0) & (point >= 0)
    trace = _image_source(measurements).trace()
    all_images = ImageCoordinates(images.xy_mm, sd, point, photo, trace=trace)
    used = all_images.taken(is_usable & ~check)
    used = average_repeated(
        used, used.photo * len(points) + used.point, warnings,
        name_of=lambda ids, _: image_point_label(*ids),
    )  # fmt: skip
    compared = all_images.taken(is_usable & check)
    # The transformation error of a comparator is common to repeated readings, so it enters after
    # averaging.
    used, compared = (
        part if images.shared_sd_mm is None
        else replace(part, sd=np.hypot(part.sd, images.shared_sd_mm[part.trace.reading]))
        for part in (used, compared)
    )  # fmt: skip
    return used, [compared] if len(compared) else []


def _image_source(measurements):
    """Source of the image points, grouped by camera."""
    images = measurements.image_points
    cameras = {item.name: item.camera for item in measurements.photos}
    return Source(
        images.file,
        images.rows,
        tuple(zip(images.photo, images.point, strict=True)),
        (("x", "y"),) * len(images.photo),
        tuple(cameras.get(name, "") for name in images.photo),
    )


def _refuse_missing_sd(images, sd):
    """Raise InputError if an image point has no standard deviation."""
    missing = np.flatnonzero(np.isnan(sd).any(axis=1))
    if len(missing):
        row = images.rows[missing[0]] if images.rows else None
        raise InputError(
            Problem(
                images.file,
                message(
                    "sds_of_images_missing",
                    "{count} image points have no standard deviation; give sx_um and sy_um, or "
                    "adjustment.image_sd_um",
                    count=len(missing),
                ),
                row,
                "sx_um",
            )
        )
