"""A job with another calibration of its camera, and without the readings that were rejected."""

from dataclasses import replace

import numpy as np

from tankcal.camera.model import PARAMETERS
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.survey.photographs import ELEMENTS, TURNS

STATES = ("fixed", "weighted", "free")
SAME = 1e-5  # relative difference of formats or pixels that is rounding: 0.05 px of 4608
FILE = "cameras.toml"


def select_camera(job, camera=None):
    """The job.CameraSetup that is to be replaced: the only one, or the one named.

    Raises InputError when the job has no photographs, no such camera, or several of them.
    """
    measurements = job.measurements
    setups = () if measurements is None else measurements.cameras
    photographed = set() if measurements is None else {one.camera for one in measurements.photos}
    known = {one.camera.name: one for one in setups if one.camera.name in photographed}
    if measurements is None or measurements.image_points is None or not known:
        raise InputError(
            Problem(
                "job.toml",
                message("camera_no_photographs", "no photographs: no camera can be replaced"),
            )
        )
    if camera is None and len(known) == 1:
        return next(iter(known.values()))
    if camera in known:
        return known[camera]
    if camera is None:
        expected = message(
            "camera_several",
            "several cameras; expected the name of one of them: {names}",
            names=[*known],
        )
    else:
        expected = message(
            "camera_without_photos",
            "no photos of a camera {camera}; expected the name of one of them: {names}",
            camera=camera,
            names=[*known],
        )
    raise InputError(Problem(FILE, expected))


def refuse_others(setup, calibrations, file=FILE):
    """Raise InputError, with all problems, for calibrations that cannot stand for a camera.

    setup  job.CameraSetup of the job       calibrations  tuple of job.CameraSetup
    file   what messages call the place where the calibrations stand
    """
    problems, seen = [], set()
    if not calibrations:
        problems.append(
            Problem(
                file, message("camera_no_calibrations", "no calibrations; expected one or more")
            )
        )
    for one in calibrations:
        name = one.camera.name
        if name in seen:
            text = message("camera_name_twice", "this name is given twice; expected once")
            problems.append(Problem(file, text, None, name))
        seen.add(name)
        for what, unit, theirs, ours in (
            (message("camera_the_format", "the format"), "mm", one.format_mm, setup.format_mm),
            (message("camera_the_pixel", "the pixel"), "mm", one.pixel_mm, setup.pixel_mm),
        ):
            if _differ(theirs, ours):
                text = message(
                    "camera_differs",
                    "{what} is {theirs} {unit}; expected that of the job's camera "
                    "{name}, {ours} {unit}",
                    what=what,
                    theirs=_pair(theirs),
                    unit=unit,
                    name=setup.camera.name,
                    ours=_pair(ours),
                )
                problems.append(Problem(file, text, None, name))
        if not (np.isfinite(one.camera.values).all() and one.camera.values[0] > 0):
            text = message(
                "camera_not_finite", "expected finite parameters and a principal distance above 0"
            )
            problems.append(Problem(file, text, None, name))
    if problems:
        raise InputError(problems)


def counted_in(setup, calibrations):
    """The job.CameraSetup with a pixel to count residuals in: where it has none, that of the
    calibrations if they have one in common.
    """
    known = [one.pixel_mm for one in calibrations if one.pixel_mm is not None]
    if setup.pixel_mm is not None or not known or any(_differ(one, known[0]) for one in known):
        return setup
    return replace(setup, pixel_mm=known[0])


def _differ(theirs, ours):
    if theirs is None or ours is None:
        return False
    return not np.allclose(theirs, ours, rtol=SAME, atol=0.0)


def _pair(values):
    return " x ".join(f"{value:.6g}" for value in values)


def free_parameters(setup, calibrations):
    """Names of the parameters that runs "free" adjust: the same for every start.

    Those that the job does not leave out, and those that a calibration gives.
    """
    given = np.array([one.camera.values != 0 for one in calibrations]).any(axis=0)
    return tuple(
        name
        for name, scope, has_value in zip(PARAMETERS, setup.camera.scope, given, strict=True)
        if name == "c" or scope != "off" or has_value
    )


def exchange_calibration(measurements, setup, calibration, state, free):
    """job.Measurements with another calibration, its job.CameraSetup, names held for want of sds.

    setup        job.CameraSetup that is replaced
    calibration  job.CameraSetup whose values, form and sds are taken
    state        "fixed", "weighted" or "free"     free  names of the parameters of runs "free"
    """
    camera, roles, held = calibration.camera, [], []
    for name, value, sd, scope in zip(
        PARAMETERS, camera.values, camera.sd, setup.camera.scope, strict=True
    ):
        role = _role(name, value, sd, state, free)
        roles.append(("camera" if scope == "off" else scope, role) if role else ("off", "fixed"))
        if state == "weighted" and role == "fixed" and sd != 0:
            held.append(name)
    changed = replace(
        setup.camera,
        values=np.array(camera.values, dtype=float),
        form=camera.form,
        sd=np.array(camera.sd, dtype=float),
        scope=tuple(scope for scope, _ in roles),
        state=tuple(role for _, role in roles),
    )
    pixel = calibration.pixel_mm if setup.pixel_mm is None else setup.pixel_mm
    own = replace(setup, camera=changed, pixel_mm=pixel)
    cameras = tuple(own if one is setup else one for one in measurements.cameras)
    return replace(measurements, cameras=cameras), own, tuple(held)


def _role(name, value, sd, state, free):
    """State of a parameter in a run; "" leaves it out."""
    if state == "free":
        return "free" if name in free else ""
    if state == "weighted" and sd > 0:
        return "weighted"
    return "fixed" if name == "c" or value != 0 else ""


def can_be_weighted(calibration):
    """Whether a calibration has a standard deviation above 0 of any parameter."""
    return bool((np.nan_to_num(calibration.camera.sd) > 0).any())


def leave_out_readings(measurements, removed):
    """job.Measurements in which surveys.Reading rows that were rejected take no part, unsearched.

    Rows of image points and readings between points are only compared, known coordinates and
    orientations become approximations. Of averaged readings all go.
    """
    settings = replace(measurements.settings, snooping=False, explain=False)
    found = replace(measurements, settings=settings)
    images = measurements.image_points
    for one in removed:
        if images is not None and one.file == images.file:
            found = _without_image(found, one)
        elif measurements.control is not None and one.file == measurements.control.file:
            found = replace(found, control=_without_coordinate(found.control, one))
        elif one.file == "photos.csv":
            found = replace(found, photos=tuple(_without_element(p, one) for p in found.photos))
        else:
            found = replace(
                found,
                readings=tuple(
                    _without_reading(table, one) if table.file == one.file else table
                    for table in found.readings
                ),
            )
    return found


def _without_image(measurements, one):
    images = measurements.image_points
    pairs = zip(images.photo, images.point, strict=True)
    gone = np.array([pair == tuple(one.ids) for pair in pairs])
    images = replace(images, check=np.asarray(images.check, dtype=bool) | gone)
    return replace(measurements, image_points=images)


def _without_coordinate(control, one):
    """Control in which one coordinate of a point, in its system, is an approximation."""
    systems = control.system or (None,) * len(control.point)
    mine = [i for i, name in enumerate(control.point) if name == one.ids[0]]
    if one.row is not None:
        system = systems[control.rows.index(one.row)]
        mine = [i for i in mine if systems[i] == system]
    sd = np.array(control.sd_m, dtype=float)
    sd[mine, "xyz".index(one.element)] = np.nan
    return replace(control, sd_m=sd)


def _without_element(photo, one):
    if photo.name != one.ids[0]:
        return photo
    sd = np.array(photo.sd, dtype=float)
    if one.element in TURNS:
        sd[3:] = np.nan
    else:
        sd[ELEMENTS.index(one.element)] = np.nan
    return replace(photo, sd=sd)


def _without_reading(table, one):
    """Readings in which those that were averaged into one are only compared."""
    keys = _keys(table)
    own = [i for i, key in enumerate(keys) if key[0] == tuple(one.ids)]
    if one.row is not None:
        own = [table.rows.index(one.row)]
    if one.repeats > 1:  # several readings of the same value
        same = {_unordered(table, keys[i]) for i in own}
        own = [i for i, key in enumerate(keys) if _unordered(table, key) in same]
    check = np.array(table.check, dtype=bool)
    check[own] = True
    return replace(table, check=check)


def _keys(table):
    """What tells the readings of a table apart: names, then set-up, set, instrument and kind."""
    n = len(table.value)
    blank = (None,) * n
    names = zip(table.setup or table.start, table.end, strict=True)
    if table.origin:
        names = zip(table.setup or table.start, table.origin, table.end, strict=True)
    kind = blank if table.horizontal is None else np.asarray(table.horizontal).tolist()
    return list(
        zip(names, table.setup or blank, table.set or blank, table.instrument or blank, kind,
            strict=True)
    )  # fmt: skip


def _unordered(table, key):
    return (frozenset(key[0]), *key[1:]) if table.table == "distances" else key
