"""Influence of a calibration: adjustments of one block with each of several calibrations.

Each calibration replaces the camera of the job in three ways: fixed; weighted by its standard
deviations (correlations are not known); and free, as initial values only. Outliers are searched
once, in the reference run with the settings of the job, and excluded from all runs. All volumes use
the points of the wall that the reference accepted. Differences therefore result from the
calibration and not from the observations.

Source: Pessoa 2017.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from tankcal.calibration.influence.blocks import (
    Block,
    PhotoChanges,
    PositionChanges,
    TopOfTank,
    TopVolume,
    compare_blocks,
    make_block,
)
from tankcal.calibration.product import ALPHA
from tankcal.camera.model import PARAMETERS
from tankcal.errors import InputError, Problem, TankcalError
from tankcal.messages import message
from tankcal.pipeline.chain import adjust_job
from tankcal.survey.network_of_survey import ELEMENTS, TURNS

STATES = ("fixed", "weighted", "free")
SAME = 1e-5  # largest relative rounding difference of formats or pixels: 0.05 px of 4608
FILE = "cameras.toml"
REFERENCE = "reference"
REASON_LINES = 3  # number of lines kept of the reason why there is no volume
EXPECTED_ERRORS = (TankcalError, np.linalg.LinAlgError)


def select_camera(job, camera=None):
    """Return the job.CameraSetup to replace: the only camera, or the named camera.

    Raises InputError if the job has no photographs or no such camera, or if several cameras have
    photos and no name is given.
    """
    network = job.network
    photographed = {item.camera for item in network.photos}
    known = {item.camera.name: item for item in network.cameras if item.camera.name in photographed}
    if network.image_points is None or not known:
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
            "several cameras; expected one of {names}",
            names=[*known],
        )
    else:
        expected = message(
            "camera_without_photos",
            "no photos of a camera {camera}; expected one of {names}",
            camera=camera,
            names=[*known],
        )
    raise InputError(Problem(FILE, expected))


def refuse_unsuitable(setup, calibrations, file=FILE):
    """Raise InputError, with all problems, for calibrations that cannot replace a camera.

    Parameters
    ----------
    setup : job.CameraSetup
        Camera of the job.
    calibrations : sequence of job.CameraSetup
        Calibrations to check.
    file : str, optional
        Name of the file of the calibrations in messages.
    """
    problems, seen = [], set()
    if not calibrations:
        problems.append(
            Problem(
                file, message("camera_no_calibrations", "no calibrations; expected one or more")
            )
        )
    for calibration in calibrations:
        name = calibration.camera.name
        if name in seen:
            text = message("camera_name_twice", "this name is given twice; expected once")
            problems.append(Problem(file, text, None, name))
        seen.add(name)
        for quantity, unit, theirs, ours in (
            (
                message("camera_the_format", "the format"),
                "mm",
                calibration.format_mm,
                setup.format_mm,
            ),
            (message("camera_the_pixel", "the pixel"), "mm", calibration.pixel_mm, setup.pixel_mm),
        ):
            if _is_different(theirs, ours):
                text = message(
                    "camera_differs",
                    "{what} is {theirs} {unit}; expected that of the job's camera "
                    "{name}, {ours} {unit}",
                    what=quantity,
                    theirs=_format_pair(theirs),
                    unit=unit,
                    name=setup.camera.name,
                    ours=_format_pair(ours),
                )
                problems.append(Problem(file, text, None, name))
        if not (np.isfinite(calibration.camera.values).all() and calibration.camera.values[0] > 0):
            text = message(
                "camera_not_finite", "expected finite parameters and a principal distance above 0"
            )
            problems.append(Problem(file, text, None, name))
    if problems:
        raise InputError(problems)


def add_pixel_size(setup, calibrations):
    """Return the setup with a pixel size for the residuals.

    A setup without a pixel size takes the common pixel size of the calibrations, if there is one.
    """
    known = [item.pixel_mm for item in calibrations if item.pixel_mm is not None]
    if (
        setup.pixel_mm is not None
        or not known
        or any(_is_different(item, known[0]) for item in known)
    ):
        return setup
    return replace(setup, pixel_mm=known[0])


def _is_different(theirs, ours):
    if theirs is None or ours is None:
        return False
    return not np.allclose(theirs, ours, rtol=SAME, atol=0.0)


def _format_pair(values):
    return " x ".join(f"{value:.6g}" for value in values)


def select_free_parameters(setup, calibrations):
    """Names of the parameters adjusted in all runs "free".

    These are the parameters in the model of the job and those with a value in a calibration.
    """
    is_given = np.array([calibration.camera.values != 0 for calibration in calibrations]).any(
        axis=0
    )
    return tuple(
        name
        for name, scope, has_value in zip(PARAMETERS, setup.camera.scope, is_given, strict=True)
        if name == "c" or scope != "off" or has_value
    )


def exchange_calibration(measurements, setup, calibration, state, free):
    """Replace the calibration of a camera.

    Parameters
    ----------
    measurements : job.Measurements
        Measurements of the job.
    setup : job.CameraSetup
        Camera to replace.
    calibration : job.CameraSetup
        Calibration with the new values, form and standard deviations.
    state : str
        "fixed", "weighted" or "free".
    free : sequence of str
        Names of the parameters adjusted in runs "free".

    Returns
    -------
    measurements : job.Measurements
        Measurements with the new calibration.
    setup : job.CameraSetup
        New camera.
    held : tuple of str
        Parameters that are fixed because they have no standard deviation.
    """
    camera, roles, held = calibration.camera, [], []
    for name, value, sd, scope in zip(
        PARAMETERS, camera.values, camera.sd, setup.camera.scope, strict=True
    ):
        role = _state_of_parameter(name, value, sd, state, free)
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
    new_setup = replace(setup, camera=changed, pixel_mm=pixel)
    cameras = tuple(new_setup if item is setup else item for item in measurements.cameras)
    return replace(measurements, cameras=cameras), new_setup, tuple(held)


def _state_of_parameter(name, value, sd, state, free):
    """State of a parameter in a run; "" if the parameter is not in the model."""
    if state == "free":
        return "free" if name in free else ""
    if state == "weighted" and sd > 0:
        return "weighted"
    return "fixed" if name == "c" or value != 0 else ""


def can_be_weighted(calibration):
    """Whether a calibration has a standard deviation above 0 of any parameter."""
    return bool((np.nan_to_num(calibration.camera.sd) > 0).any())


def leave_out_readings(measurements, removed):
    """Exclude rejected readings from job.Measurements, and switch off the search for outliers.

    Image points and readings between points become check readings. Known coordinates and
    orientations become approximate values. All readings of a rejected mean are excluded.
    """
    settings = replace(measurements.settings, snooping=False, explain=False)
    remaining = replace(measurements, settings=settings)
    images = measurements.image_points
    for reading in removed:
        if images is not None and reading.file == images.file:
            remaining = _exclude_image(remaining, reading)
        elif measurements.control is not None and reading.file == measurements.control.file:
            remaining = replace(remaining, control=_release_coordinate(remaining.control, reading))
        elif reading.file == "photos.csv":
            remaining = replace(
                remaining, photos=tuple(_release_element(p, reading) for p in remaining.photos)
            )
        else:
            remaining = replace(
                remaining,
                readings=tuple(
                    _exclude_reading(table, reading) if table.file == reading.file else table
                    for table in remaining.readings
                ),
            )
    return remaining


def _exclude_image(measurements, reading):
    images = measurements.image_points
    pairs = zip(images.photo, images.point, strict=True)
    is_rejected = np.array([pair == tuple(reading.ids) for pair in pairs])
    images = replace(images, check=np.asarray(images.check, dtype=bool) | is_rejected)
    return replace(measurements, image_points=images)


def _release_coordinate(control, reading):
    """Make one coordinate of a control point, in its system, an approximate value."""
    systems = control.system or (None,) * len(control.point)
    rows = [i for i, name in enumerate(control.point) if name == reading.ids[0]]
    if reading.row is not None:
        system = systems[control.rows.index(reading.row)]
        rows = [i for i in rows if systems[i] == system]
    sd = np.array(control.sd_m, dtype=float)
    sd[rows, "xyz".index(reading.element)] = np.nan
    return replace(control, sd_m=sd)


def _release_element(photo, reading):
    if photo.name != reading.ids[0]:
        return photo
    sd = np.array(photo.sd, dtype=float)
    if reading.element in TURNS:
        sd[3:] = np.nan
    else:
        sd[ELEMENTS.index(reading.element)] = np.nan
    return replace(photo, sd=sd)


def _exclude_reading(table, reading):
    """Make a rejected reading, and all readings averaged in it, check readings."""
    keys = _reading_keys(table)
    rows = [i for i, key in enumerate(keys) if key[0] == tuple(reading.ids)]
    if reading.row is not None:
        rows = [table.rows.index(reading.row)]
    if reading.repeats > 1:  # several readings of the same value
        same_keys = {_key_without_order(table, keys[i]) for i in rows}
        rows = [i for i, key in enumerate(keys) if _key_without_order(table, key) in same_keys]
    check = np.array(table.check, dtype=bool)
    check[rows] = True
    return replace(table, check=check)


def _reading_keys(table):
    """Keys that identify the readings of a table: names, set-up, set, instrument and kind."""
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


def _key_without_order(table, key):
    return (frozenset(key[0]), *key[1:]) if table.table == "distances" else key


@dataclass(frozen=True)
class Run:
    """One adjustment of the block.

    Attributes
    ----------
    label : str
        Name of the run.
    calibration, state : str or None
        Calibration and its state; None for the reference, with the calibration of the job.
    outcome : str
        "adjusted", "failed" or "skipped".
    message : str or None
        Reason of a failure.
    skipped : str
        Code of the reason for skipping the run, or "".
    held : tuple of str
        Parameters fixed for lack of a standard deviation in a run "weighted".
    block : Block or None
        Results; None unless adjusted.
    volume : TopVolume or None
        Volume; None without a tank or after a failure.
    volume_failed : str or None
        Reason why the volume cannot be computed.
    """

    label: str
    calibration: str | None
    state: str | None
    outcome: str
    message: str | None = None
    skipped: str = ""
    held: tuple = ()
    block: Block | None = None
    volume: TopVolume | None = None
    volume_failed: str | None = None


@dataclass(frozen=True)
class Pair:
    """Differences between two runs, other minus one.

    Attributes
    ----------
    one, other : int
        Indices of the runs.
    points, photos : PositionChanges, PhotoChanges
        Differences of points and photos.
    aligned : int
        Number of motions that the observations do not determine, removed from the differences.
    volume_m3, volume_percent : float or None
        Difference of the capacities at the top, m3, and in % of the capacity of `one`.
    """

    one: int
    other: int
    points: PositionChanges
    photos: PhotoChanges
    aligned: int
    volume_m3: float | None
    volume_percent: float | None


@dataclass(frozen=True)
class Influence:
    """Adjustments of a block with all calibrations.

    Attributes
    ----------
    camera : str
        Name of the camera that was replaced.
    states, calibrations : tuple of str
        States and names of the calibrations.
    searched : bool
        Whether outliers were searched in the reference.
    removed : tuple of surveys.Reading
        Readings rejected in the reference and excluded from all runs.
    free : tuple of str
        Names of the parameters adjusted in runs "free".
    runs : tuple of Run
        Runs, the reference first.
    pairs : tuple of Pair
        Differences between the adjusted runs.
    """

    camera: str
    states: tuple[str, ...]
    calibrations: tuple[str, ...]
    searched: bool
    removed: tuple
    free: tuple[str, ...]
    runs: tuple[Run, ...]
    pairs: tuple[Pair, ...]


def influence(
    job,
    calibrations,
    states=STATES,
    camera=None,
    progress=None,
    *,
    alpha=ALPHA,
    volume=True,
    file=FILE,
):
    """Compute the influence of calibrations on the block of a job, and on its tank, if any.

    A failed run is part of the result, with its message.

    Parameters
    ----------
    job : tankcal.job.Job
        Loaded job.
    calibrations : sequence of job.CameraSetup
        Calibrations from tankcal.job.calibrations.read_cameras.
    states : sequence of str, optional
        Some of "fixed", "weighted", "free".
    camera : str, optional
        Name of the camera of the job to replace; by default its only camera.
    progress : callable, optional
        Called as progress(text, done, total) before each run and at the end.
    alpha : float, optional
        Significance level of the tests at check points.
    volume : bool, optional
        Whether volumes are computed. Use False for a job that was loaded only for its adjustment,
        without bottom, deadwood and uncertainties.
    file : str, optional
        Name of the file of the calibrations in messages.

    Returns
    -------
    Influence

    Raises
    ------
    InputError
        If the job has no photographs, if the camera is not uniquely named, or if a calibration has
        another format or pixel size.
    ValueError
        If a state is unknown.
    """
    states = tuple(dict.fromkeys(states))
    if not states or set(states) - set(STATES):
        raise ValueError(f"found states {states!r}; expected some of {', '.join(STATES)}")
    calibrations = tuple(calibrations)
    setup = select_camera(job, camera)
    refuse_unsuitable(setup, calibrations, file)
    calibrations = tuple(add_pixel_size(item, calibrations) for item in calibrations)
    free = select_free_parameters(setup, calibrations)
    progress = progress or (lambda text, done, total: None)
    total = 1 + len(calibrations) * len(states)
    progress(message("camera_reference_run", "reference"), 0, total)
    top = TopOfTank(job) if volume and _has_tank(job) else None
    reference, removed = _run_reference(job, add_pixel_size(setup, calibrations), alpha, top)
    common = leave_out_readings(job.measurements, removed)
    runs = [reference]
    for item in calibrations:
        for state in states:
            progress(
                message("camera_run", "{name}, {state}", name=item.camera.name, state=state),
                len(runs),
                total,
            )
            runs.append(_run_calibration(job, common, setup, item, state, free, alpha, top))
    progress(message("camera_runs_done", "done"), total, total)
    adjusted = [number for number, run in enumerate(runs) if run.block is not None]
    return Influence(
        camera=setup.camera.name,
        states=states,
        calibrations=tuple(item.camera.name for item in calibrations),
        searched=job.measurements.settings.snooping,
        removed=removed,
        free=free,
        runs=tuple(runs),
        pairs=tuple(_make_pair(i, j, runs[i], runs[j]) for i, j in combinations(adjusted, 2)),
    )


def _run_reference(job, setup, alpha, top):
    """Adjust with the settings of the job; return the Run and the rejected readings.

    If readings are rejected, the run is repeated without them, as all other runs.
    """
    initial = Run(REFERENCE, None, None, "failed")
    result, adjustment = _adjust_and_record(job, setup, alpha, initial, top)
    if adjustment is None or not adjustment.removed:
        return result, ()
    repeated = replace(job, measurements=leave_out_readings(job.measurements, adjustment.removed))
    result, _ = _adjust_and_record(repeated, setup, alpha, initial, top)
    return result, adjustment.removed


def _run_calibration(job, common, setup, calibration, state, free, alpha, top):
    """Adjust with another calibration of the camera; return the Run."""
    name = calibration.camera.name
    label = f"{name}, {state}"
    if state == "weighted" and not can_be_weighted(calibration):
        return Run(label, name, state, "skipped", skipped="no_sds")
    changed, new_setup, held = exchange_calibration(common, setup, calibration, state, free)
    initial = Run(label, name, state, "failed", held=held)
    return _adjust_and_record(replace(job, measurements=changed), new_setup, alpha, initial, top)[0]


def _adjust_and_record(job, setup, alpha, initial, top):
    """Adjust a job and add the results to a Run; return the Run and the Adjustment or None.

    `top` is a TopOfTank, or None if no volumes are computed.
    """
    try:
        adjustment = adjust_job(job)
    except EXPECTED_ERRORS as error:
        return replace(initial, message=str(error)), None
    volume = failed = None
    if top is not None:
        try:
            volume = top.compute_volume(adjustment)
        except EXPECTED_ERRORS as error:
            failed = "; ".join(str(error).splitlines()[:REASON_LINES])
    result = replace(
        initial,
        outcome="adjusted",
        block=make_block(adjustment, setup, alpha),
        volume=volume,
        volume_failed=failed,
    )
    return result, adjustment


def _has_tank(job):
    """Whether a job contains a complete tank, not only its survey."""
    parts = (job.tank, job.survey, job.datum, job.table)
    shell = job.courses or job.horizontal or job.sphere or job.mesh
    return None not in parts and bool(shell)


def _make_pair(i, j, first, second):
    """Create the Pair of two adjusted runs with the numbers i and j."""
    points, photos, aligned = compare_blocks(first.block, second.block)
    volume = percent = None
    if first.volume is not None and second.volume is not None:
        volume = second.volume.value_m3 - first.volume.value_m3
        percent = 100 * volume / first.volume.value_m3
    return Pair(i, j, points, photos, aligned, volume, percent)
