"""From what was measured to a network survey: names become numbers, repeated readings one."""

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
from tankcal.survey.means import average_repeated
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
from tankcal.survey.repeated_readings import reject_scattered

AXES = "xyz"
TOLD = 10  # points left out that are told one by one


@dataclass(frozen=True)
class Gathered:
    """A survey before it has start values; its observations know which readings they are of.

    survey   network.Survey: coordinates that are not known are nan; control acts as observations
             and fixed coordinates with datum "control" only
    checks   tuple of Observations that are compared, not adjusted
    known    Known: control in the frame of the survey
    idle     (points, 3) True: no observation touches this coordinate, it keeps its start
    lost     {name: file} of points that cannot be adjusted
    aside    sentences about them
    warnings tuple of Problem
    repeats  RepeatedReadings of image points, or None
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
class Known:
    """Control coordinates (points, 3) and their sds in the frame of the survey, nan: none.

    row  {point: row of control.csv}
    """

    xyz_m: np.ndarray
    sd_m: np.ndarray
    row: dict


def gather(measurements):
    """The Gathered of Measurements; raises InputError for what cannot be meant."""
    measurements, repeated, scattered = reject_scattered(measurements)
    excluded = {}
    while True:
        found = _gathered(measurements, excluded)
        poor = find_left_out(found.survey)
        if not poor:
            break
        excluded |= poor
    excluded = _unmeasured(measurements, found.survey.points, excluded)
    where = {name: named_in(measurements, name) for name in excluded}
    idle, warnings = find_untouched_coordinates(found.survey)
    warnings += _of_excluded(excluded, where)
    fixed = idle if found.survey.fixed is None else found.survey.fixed | idle
    return replace(
        found,
        survey=replace(found.survey, fixed=fixed),
        idle=idle,
        lost={name: file for name, (file, _) in where.items()},
        aside=tuple(excluded.values()),
        warnings=(*scattered, *found.warnings, *warnings),
        repeats=repeated,
    )


def _of_excluded(excluded, where):
    """Problem rows of points left out {name: why}; of many, the first ones and how many more."""
    found = [Problem(where[name][0], text, where[name][1]) for name, text in excluded.items()]
    if len(found) <= TOLD:
        return found
    text = message(
        "more_left_out",
        "further points are left out because they have too few observations: {points}",
        points=list_some(list(excluded)[TOLD - 1 :], TOLD),
    )
    return [*found[: TOLD - 1], Problem("job.toml", text, None, "adjustment")]


def _unmeasured(measurements, points, excluded):
    """{name: why} of points left out, with those of control.csv and check.csv never measured."""
    found = dict(excluded)
    for table in (measurements.control, measurements.check):
        for name in () if table is None else table.point:
            if name not in points and name not in found:
                found[name] = unmeasured_sentence(name)
    return found


def named_in(measurements, name):
    """File and row in which a point is named first."""
    tables = [(measurements.image_points, ("point",)), (measurements.control, ("point",))]
    tables += [(one, ("end", "start", "origin")) for one in measurements.readings]
    for table, columns in [*tables, (measurements.check, ("point",))]:
        for column in columns if table is not None else ():
            names = getattr(table, column)
            if name in names:
                return table.file, table.rows[names.index(name)] if table.rows else None
    return "setups.csv", None


def _gathered(measurements, excluded):
    warnings = []
    numbers = _numbers(measurements, excluded)
    known = _known(measurements.control, numbers.points)
    observations, checks = [], []
    fixed = None
    if measurements.settings.datum == "control":
        fixed = np.nan_to_num(known.sd_m, nan=1.0) == 0
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
    return Gathered(survey, tuple(checks), known, None, {}, (), tuple(warnings))


def _numbers(measurements, excluded):
    """Numbers of everything that is measured, in the order in which the files name it."""
    setups = {one.name: one for one in measurements.setups}
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
    known = {one.name: one for one in measurements.instruments}
    return Numbers(points, setups, tools, known, sets)


def _instruments(measurements, numbers):
    """Instruments of the network, those that measured distances."""
    found = [numbers.tools[name] for name in numbers.instruments]
    return tuple(
        Instrument(one.name, scale_sd=one.u_scale, offset_sd_m=one.u_offset_m) for one in found
    )


def _own(control):
    """Numbers of the rows of control in the frame of the survey that are not for checks."""
    if control is None:
        return []
    systems = control.system or (None,) * len(control.point)
    return [
        i
        for i, (system, check) in enumerate(zip(systems, control.check, strict=True))
        if system is None and not check
    ]


def _known(control, points):
    xyz, sd = np.full((2, len(points), 3), np.nan)
    row = {}
    for i in _own(control):
        number = points.get(control.point[i])
        if number is not None:
            new = np.isfinite(control.xyz_m[i])
            xyz[number, new], sd[number, new] = control.xyz_m[i, new], control.sd_m[i, new]
            row.setdefault(control.point[i], control.rows[i] if control.rows else None)
    return Known(xyz, sd, row)


def _coordinates(control, rows, points):
    """Single weighted coordinates of some rows: row, point, axis, value, sd, each (n,)."""
    rows = np.array([i for i in rows if control.point[i] in points], dtype=int)
    value, sd = control.xyz_m[rows], control.sd_m[rows]
    where, axis = np.nonzero(np.isfinite(value) & np.isfinite(sd))
    point = np.array([points[control.point[i]] for i in rows], dtype=int)
    return rows[where], point[where], axis, value[where, axis], sd[where, axis]


def _control(control, points, warnings, alone=frozenset()):
    """The weighted control coordinates, as a list of one table or none."""
    if control is None:
        return []
    row, point, axis, value, sd = _coordinates(control, _own(control), points)
    trace = _control_source(control, row, axis).trace()
    one = ControlCoordinates(value, sd, point, axis, trace=trace).taken(sd > 0)
    label = 3 * one.point + one.axis
    if alone:  # values that are correlated with others are not averaged
        mine = np.isin(one.trace.rows, list(alone))
        label = np.where(mine, 3 * len(points) + np.arange(len(label)), label)
    found = average_repeated(
        one, label, warnings, name_of=lambda ids, element: f"{ids[0]} {element[0]}"
    )
    return [found] if len(found) else []


def _control_source(control, rows, axis, group=()):
    return Source(
        control.file,
        tuple(control.rows[i] for i in rows) if control.rows else (),
        tuple((control.point[i],) for i in rows),
        tuple((AXES[k],) for k in axis),
        group,
    )


def held_trace(known, points):
    """The Trace of held coordinates, numbered 3 point + axis, of Known control."""
    return Source(
        "control.csv",
        tuple(known.row.get(name) for name in points for _ in AXES),
        tuple((name,) for name in points for _ in AXES),
        tuple((axis,) for axis in AXES) * len(points),
    ).trace()


def _systems(control, points):
    """Further systems, and a list of their coordinates."""
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
    one = SystemCoordinates(value, sd, point, axis, system, trace=trace)
    return tuple(System(name) for name in names), [one]


def _images(measurements, points, order, warnings):
    """The ImageCoordinates that are adjusted, and a list of those to compare."""
    images = measurements.image_points
    sd = np.array(images.sd_mm, dtype=float)
    if measurements.settings.image_sd_mm is not None:
        sd = np.where(np.isnan(sd), measurements.settings.image_sd_mm, sd)
    _refuse_missing_sd(images, sd)
    photo = np.array([order.get(name, -1) for name in images.photo], dtype=int)
    point = np.array([points.get(name, -1) for name in images.point], dtype=int)
    check = np.asarray(images.check, dtype=bool)
    there = (photo >= 0) & (point >= 0)
    trace = _image_source(measurements).trace()
    whole = ImageCoordinates(images.xy_mm, sd, point, photo, trace=trace)
    used = whole.taken(there & ~check)
    used = average_repeated(
        used, used.photo * len(points) + used.point, warnings,
        name_of=lambda ids, _: image_point_label(*ids),
    )  # fmt: skip
    left = whole.taken(there & check)
    used, left = (
        one if images.shared_sd_mm is None
        else replace(one, sd=np.hypot(one.sd, images.shared_sd_mm[one.trace.reading]))
        for one in (used, left)
    )  # fmt: skip
    return used, [left] if len(left) else []


def _image_source(measurements):
    images = measurements.image_points
    cameras = {one.name: one.camera for one in measurements.photos}
    return Source(
        images.file,
        images.rows,
        tuple(zip(images.photo, images.point, strict=True)),
        (("x", "y"),) * len(images.photo),
        tuple(cameras.get(name, "") for name in images.photo),
    )


def _refuse_missing_sd(images, sd):
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
