"""Trial adjustments of a survey that does not fit, as if a whole file had been misread.

Each trial changes the measurements as one common mistake would, and adjusts without data snooping.
The mistake that reduces sigma0 most is reported; no result is changed.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np

from tankcal.camera.model import correct_image_points
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message
from tankcal.survey.diagnosis.diagnoses import GON, MIRROR, mirrored_fits, mirrored_photo
from tankcal.survey.diagnosis.fixed_datum_check import ALIKE
from tankcal.survey.observations import KINDS
from tankcal.units import FOOT_M

BETTER = 0.2  # largest remaining share of sigma0 under a valid explanation
SOUND = 5.0  # sigma0 of a survey that fits moderately; a single blunder causes more
CERTAIN = 2.0  # sigma0 below which no other mistake is tried
OTHER_UNITS = (
    (FOOT_M, message("feet", "feet")),
    (0.001, message("millimetres", "millimetres")),
)
HORIZONTAL = ("directions", "horizontal_angles", "azimuths")
EXCHANGED = 7  # control points up to which all pairs are exchanged
CONTROL = "control.csv"
MOST_SETUPS = 30  # set-ups whose circles are tried in another unit
MOST = 12  # photos left out one at a time
MOST_FAILURES = 20  # trials without a solution; more would only add to the waiting time
ALIKE_FAILURES = 6  # trials that fail like the survey itself: readings are then missing


def likely_mistake(measurements, sigma0, run, failure=None):
    """Problem rows: the common mistakes that explain a misfit best, or none.

    Parameters
    ----------
    measurements : Measurements
    sigma0 : float
        Without data snooping; inf if the survey could not be adjusted.
    run : callable
        run(measurements) returns (network.Adjusted, GatheredSurvey), without data snooping.
    failure : str, optional
        Error message of the failed adjustment.

    Returns
    -------
    list of Problem
    """
    limit = min(BETTER * sigma0, SOUND)
    explained, failures, alike = [], 0, 0
    mistakes = (_mirror_mistakes, _files_in_other_unit, _name_exchanges, _setup_in_other_unit)
    for suppositions in mistakes:
        for problem, changed in suppositions(measurements):
            try:
                trial_sigma0 = run(changed)[0].sigma0
            except (SolutionError, InputError) as error:
                failures, alike = failures + 1, alike + (str(error) == failure)
                if not explained and (alike == ALIKE_FAILURES or failures == MOST_FAILURES):
                    return []
                continue
            if trial_sigma0 < limit:
                explained.append((trial_sigma0, problem))
        if any(trial_sigma0 < CERTAIN for trial_sigma0, _ in explained):
            break
    best = min((trial_sigma0 for trial_sigma0, _ in explained), default=np.inf)
    likely = [problem for trial_sigma0, problem in explained if trial_sigma0 < ALIKE * best]
    if measurements.settings.datum == "control":
        return likely
    # Coordinates that hold no datum serve as start values: swapped axes alone do no harm, a circle
    # does.
    return sorted(likely, key=lambda problem: problem.file == CONTROL)


def _mirror_mistakes(measurements):
    """Yield (Problem, corrected measurements) for mistakes that mirror the survey.

    The mistakes are not always distinguishable.
    """
    yield from _control_swapped(measurements)
    yield from _images_mirrored(measurements)
    for table_of_readings in measurements.readings:
        if table_of_readings.table in HORIZONTAL:
            text = message(
                "angles_anticlockwise",
                "the angles fit if the circle was read anticlockwise",
            )
            yield (
                Problem(table_of_readings.file, text),
                _times(measurements, [table_of_readings.table], -1.0),
            )


def _name_exchanges(measurements):
    """Yield (Problem, corrected measurements) for two control points with exchanged names."""
    control = measurements.control
    names = [] if control is None else list(control.point)
    if not 2 < len(names) <= EXCHANGED or measurements.image_points is not None:
        return  # photographs start too slowly for that many trials
    for i, j in combinations(range(len(names)), 2):
        if control.system[i] == control.system[j]:
            order = np.arange(len(names))
            order[[i, j]] = j, i
            text = message(
                "names_exchanged",
                "everything fits if {point} and {other} are exchanged",
                point=names[i],
                other=names[j],
            )
            changed = replace(control, xyz_m=control.xyz_m[order], sd_m=control.sd_m[order])
            row = control.rows[j] if control.rows else None
            yield Problem("control.csv", text, row, "point"), replace(measurements, control=changed)


def _files_in_other_unit(measurements):
    """Yield (Problem, corrected measurements) for files in another unit."""
    tables = measurements.readings
    angles = [
        readings_of_table.table
        for readings_of_table in tables
        if KINDS[readings_of_table.table].is_angle
    ]
    for factor, what in GON:
        if len(angles) > 1:
            template = "all angles together fit if they are {what}"
            text = message("all_angles_misread", template, what=what)
            yield Problem("job.toml", text), _times(measurements, angles, factor)
        text = message("angles_misread", "the angles fit if they are {what}", what=what)
        for table in angles:
            yield Problem(f"{table}.csv", text), _times(measurements, [table], factor)
    for table in ("distances", "slope_distances"):
        # A change of unit shows only if control or other distances fix the scale.
        if any(
            readings_of_table.table == table for readings_of_table in tables
        ) and _scale_is_known(measurements, table):
            for factor, what in OTHER_UNITS:
                template = "the distances fit if they are in {what}"
                text = message("distances_misread", template, what=what)
                yield Problem(f"{table}.csv", text), _times(measurements, [table], factor)


def _setup_in_other_unit(measurements):
    """Yield (Problem, corrected measurements) for the circles of one set-up in another unit."""
    tables = [item for item in measurements.readings if item.setup and KINDS[item.table].is_angle]
    names = list(dict.fromkeys(name for item in tables for name in item.setup))
    if not 1 < len(names) <= MOST_SETUPS or measurements.image_points is not None:
        return
    for name in names:
        tables_of_setup = [item for item in tables if name in item.setup]
        for factor, what in GON:
            text = message(
                "setup_misread",
                "the angles of set-up {setup} fit if they are {what}",
                setup=name,
                what=what,
            )
            for group in ([tables_of_setup] if len(tables_of_setup) > 1 else []) + [
                [item] for item in tables_of_setup
            ]:
                first = group[0]
                row = first.rows[first.setup.index(name)] if first.rows else None
                table_names = tuple(item.table for item in group)
                yield (
                    Problem(first.file, text, row),
                    _times(measurements, table_names, factor, name),
                )


def _control_swapped(measurements):
    """Yield trials with x and y of control exchanged, in all systems, then in each of several."""
    control = measurements.control
    if control is None:
        return
    system_of_row = np.array([name or "" for name in control.system], dtype=object)
    for system in (None, *sorted(set(system_of_row.tolist()))):
        is_in_system = (
            np.ones(len(system_of_row), dtype=bool) if system is None else system_of_row == system
        )
        if system is None or not is_in_system.all():
            xyz, sd = control.xyz_m.copy(), control.sd_m.copy()
            xyz[is_in_system], sd[is_in_system] = (
                xyz[is_in_system][:, [1, 0, 2]],
                sd[is_in_system][:, [1, 0, 2]],
            )
            text = message("all_coordinates_swapped", "all coordinates fit if x and y are swapped")
            if system:
                text = message(
                    "system_swapped",
                    "all coordinates of system {system} fit if x and y are swapped",
                    system=system,
                )
            changed = replace(control, xyz_m=xyz, sd_m=sd)
            yield Problem("control.csv", text), replace(measurements, control=changed)


def _images_mirrored(measurements):
    """Yield trials with mirrored images, of all cameras, then of each of several."""
    images = measurements.image_points
    if images is None:
        return
    camera_of = {item.name: item.camera for item in measurements.photos}
    camera_of_row = np.array([camera_of.get(name, "") for name in images.photo], dtype=object)
    for camera in (None, *sorted(set(camera_of_row.tolist()))):
        is_of_camera = (
            np.ones(len(camera_of_row), dtype=bool) if camera is None else camera_of_row == camera
        )
        if camera is None or not is_of_camera.all():
            xy = np.where(is_of_camera[:, None], images.xy_mm * [-1.0, 1.0], images.xy_mm)
            text = MIRROR
            if camera is not None:
                text = message(
                    "camera_mirrored", "camera {camera}: {why}", camera=camera, why=MIRROR
                )
            changed = replace(images, xy_mm=xy)
            yield Problem("image_points.csv", text), replace(measurements, image_points=changed)


def _scale_is_known(measurements, table):
    """Whether the scale of distances is controlled, so that a wrong unit causes a misfit."""
    free = {item.name for item in measurements.instruments if np.isnan(item.u_scale)}
    setups = {item.name: item.instrument for item in measurements.setups}
    readings_of_table = [item for item in measurements.readings if item.table == table]
    has_others = any(
        "distances" in item.table for item in measurements.readings if item.table != table
    )
    acting = measurements.control is not None and measurements.settings.datum == "control"
    return (acting or has_others) and not any(
        free & ({setups[name] for name in item.setup} | set(item.instrument))
        for item in readings_of_table
    )


def _times(measurements, tables, factor, setup=None):
    """Multiply the values of tables by a factor, or only those of one set-up."""

    def factor_of(item):
        if setup is None:
            return factor
        return np.where([name == setup for name in item.setup], factor, 1.0)

    readings = tuple(
        replace(item, value=item.value * factor_of(item)) if item.table in tables else item
        for item in measurements.readings
    )
    return replace(measurements, readings=readings)


def photos_that_do_not_fit(measurements, message, run):
    """Problem rows for photos without a pose that fit after mirroring.

    Parameters
    ----------
    measurements : Measurements
    message : str
        Error message, which names these photos.
    run : callable
        See `likely_mistake`.

    Returns
    -------
    list of Problem
    """
    images = measurements.image_points
    failed = [item.name for item in measurements.photos if f"photo {item.name} " in message][:MOST]
    if images is None or not failed or len(failed) == len(measurements.photos):
        return []
    is_kept = np.array([name not in failed for name in images.photo])
    try:
        adjusted, _ = run(replace(measurements, image_points=_some(images, is_kept)))
    except (SolutionError, InputError):
        return []
    return [mirrored_photo(name) for name in failed if _is_mirrored(measurements, name, adjusted)]


def _is_mirrored(measurements, name, adjusted):
    """Whether a photo left out of the adjustment fits the adjusted points after mirroring."""
    images = measurements.image_points
    number = {name: i for i, name in enumerate(adjusted.survey.points)}
    rows = [
        i
        for i, (photo, point) in enumerate(zip(images.photo, images.point, strict=True))
        if photo == name and point in number
    ]
    camera_name = next(item.camera for item in measurements.photos if item.name == name)
    camera = next(item.camera for item in measurements.cameras if item.camera.name == camera_name)
    xyz = adjusted.xyz_m[[number[images.point[i]] for i in rows]]
    is_adjusted = np.isfinite(xyz).all(axis=1)
    ideal = correct_image_points(images.xy_mm[rows], camera.values, camera.form) / camera.values[0]
    return mirrored_fits(xyz[is_adjusted], ideal[is_adjusted])


def _some(images, mask):
    """ImageReadings of the rows where a mask (n,) is True."""
    rows = np.flatnonzero(mask)
    return replace(
        images,
        photo=tuple(images.photo[i] for i in rows),
        point=tuple(images.point[i] for i in rows),
        xy_mm=images.xy_mm[rows],
        sd_mm=images.sd_mm[rows],
        check=np.asarray(images.check)[rows],
        rows=tuple(images.rows[i] for i in rows) if images.rows else (),
    )
