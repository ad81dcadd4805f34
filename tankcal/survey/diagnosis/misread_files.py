"""A survey that does not fit, tried again as if a whole file had been misread.

Each supposition changes the measurements as one common mistake would, and the survey is adjusted
again, without data snooping. The one that brings sigma0 down most is told; nothing is changed.
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

BETTER = 0.2  # share of sigma0 that may be left by what explains a survey
SOUND = 5.0  # sigma0 of a survey that fits, if not well: a single blunder makes more of it
CERTAIN = 2.0  # sigma0 after which nothing else is tried
OTHER_UNITS = (
    (0.3048, message("feet", "feet")),
    (0.001, message("millimetres", "millimetres")),
)
HORIZONTAL = ("directions", "horizontal_angles", "azimuths")
EXCHANGED = 7  # control points of which each two are exchanged
CONTROL = "control.csv"
MOST_SETUPS = 30  # whose circles are supposed, one after the other, to show another unit
MOST = 12  # photos that are left out one after the other
ALIKE_FAILURES = 6  # trials that end as the survey itself did: then readings are missing


def likely_mistake(measurements, sigma0, run, failure=None):
    """Problem rows: the common mistakes that explain best why a survey does not fit, or none.

    sigma0   without data snooping, inf when the survey could not be adjusted
    run      run(measurements) -> (network.Adjusted, Gathered), without data snooping
    failure  the text of the error by which the survey could not be adjusted
    """
    limit = min(BETTER * sigma0, SOUND)
    explained, alike = [], 0
    for suppositions in (_mirrored, _in_other_units, _exchanged, _of_a_setup):
        for problem, changed in suppositions(measurements):
            try:
                found = run(changed)[0].sigma0
            except (SolutionError, InputError) as error:
                alike += str(error) == failure
                if alike == ALIKE_FAILURES and not explained:
                    return []
                continue
            if found < limit:
                explained.append((found, problem))
        if any(found < CERTAIN for found, _ in explained):
            break
    best = min((found for found, _ in explained), default=np.inf)
    likely = [problem for found, problem in explained if found < ALIKE * best]
    if measurements.settings.datum == "control":
        return likely
    # coordinates that hold no datum are starts: swapped ones alone do no harm, but a circle does
    return sorted(likely, key=lambda problem: problem.file == CONTROL)


def _mirrored(measurements):
    """Pairs (Problem, measurements as they would be without that mistake): a world in a mirror.

    Which of these it is cannot always be told.
    """
    yield from _of_control(measurements)
    yield from _of_images(measurements)
    for one in measurements.readings:
        if one.table in HORIZONTAL:
            text = message(
                "angles_anticlockwise",
                "the angles fit if the circle was read anticlockwise",
            )
            yield Problem(one.file, text), _times(measurements, [one.table], -1.0)


def _exchanged(measurements):
    """The same of two control points that bear one another's names."""
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


def _in_other_units(measurements):
    """The same of a file in another unit."""
    tables = measurements.readings
    angles = [one.table for one in tables if KINDS[one.table].is_angle]
    for factor, what in GON:
        if len(angles) > 1:
            template = "all angles together fit if they are {what}"
            text = message("all_angles_misread", template, what=what)
            yield Problem("job.toml", text), _times(measurements, angles, factor)
        text = message("angles_misread", "the angles fit if they are {what}", what=what)
        for table in angles:
            yield Problem(f"{table}.csv", text), _times(measurements, [table], factor)
    for table in ("distances", "slope_distances"):
        if any(one.table == table for one in tables) and _scale_is_known(measurements, table):
            for factor, what in OTHER_UNITS:
                template = "the distances fit if they are in {what}"
                text = message("distances_misread", template, what=what)
                yield Problem(f"{table}.csv", text), _times(measurements, [table], factor)


def _of_a_setup(measurements):
    """The same of the circles of one set-up in another unit, of all its tables or of one."""
    tables = [one for one in measurements.readings if one.setup and KINDS[one.table].is_angle]
    names = list(dict.fromkeys(name for one in tables for name in one.setup))
    if not 1 < len(names) <= MOST_SETUPS or measurements.image_points is not None:
        return
    for name in names:
        mine = [one for one in tables if name in one.setup]
        for factor, what in GON:
            text = message(
                "setup_misread",
                "the angles of set-up {setup} fit if they are {what}",
                setup=name,
                what=what,
            )
            for chosen in ([mine] if len(mine) > 1 else []) + [[one] for one in mine]:
                first = chosen[0]
                row = first.rows[first.setup.index(name)] if first.rows else None
                of = tuple(one.table for one in chosen)
                yield Problem(first.file, text, row), _times(measurements, of, factor, name)


def _of_control(measurements):
    """x and y of control exchanged, in all systems, then in one of several."""
    control = measurements.control
    if control is None:
        return
    of = np.array([name or "" for name in control.system], dtype=object)
    for system in (None, *sorted(set(of.tolist()))):
        mine = np.ones(len(of), dtype=bool) if system is None else of == system
        if system is None or not mine.all():
            xyz, sd = control.xyz_m.copy(), control.sd_m.copy()
            xyz[mine], sd[mine] = xyz[mine][:, [1, 0, 2]], sd[mine][:, [1, 0, 2]]
            text = message("all_coordinates_swapped", "all coordinates fit if x and y are swapped")
            if system:
                text = message(
                    "system_swapped",
                    "all coordinates of system {system} fit if x and y are swapped",
                    system=system,
                )
            changed = replace(control, xyz_m=xyz, sd_m=sd)
            yield Problem("control.csv", text), replace(measurements, control=changed)


def _of_images(measurements):
    """Images mirrored, of all cameras, then of one of several."""
    images = measurements.image_points
    if images is None:
        return
    camera_of = {one.name: one.camera for one in measurements.photos}
    of = np.array([camera_of.get(name, "") for name in images.photo], dtype=object)
    for camera in (None, *sorted(set(of.tolist()))):
        mine = np.ones(len(of), dtype=bool) if camera is None else of == camera
        if camera is None or not mine.all():
            xy = np.where(mine[:, None], images.xy_mm * [-1.0, 1.0], images.xy_mm)
            text = MIRROR
            if camera is not None:
                text = message(
                    "camera_mirrored", "camera {camera}: {why}", camera=camera, why=MIRROR
                )
            changed = replace(images, xy_mm=xy)
            yield Problem("image_points.csv", text), replace(measurements, image_points=changed)


def _scale_is_known(measurements, table):
    """Whether distances of a table cannot fit in any unit: their scale and that of control hold."""
    free = {one.name for one in measurements.instruments if np.isnan(one.u_scale)}
    setups = {one.name: one.instrument for one in measurements.setups}
    of = [one for one in measurements.readings if one.table == table]
    others = any("distances" in one.table for one in measurements.readings if one.table != table)
    acting = measurements.control is not None and measurements.settings.datum == "control"
    return (acting or others) and not any(
        free & ({setups[name] for name in one.setup} | set(one.instrument)) for one in of
    )


def _times(measurements, tables, factor, setup=None):
    """The values of tables times a factor; of one set-up alone where it is named."""

    def by(one):
        if setup is None:
            return factor
        return np.where([name == setup for name in one.setup], factor, 1.0)

    readings = tuple(
        replace(one, value=one.value * by(one)) if one.table in tables else one
        for one in measurements.readings
    )
    return replace(measurements, readings=readings)


def photos_that_do_not_fit(measurements, message, run):
    """Problem rows for photos that found no place and that fit when they are mirrored.

    message  of the error, which names these photos        run  see `likely_mistake`
    """
    images = measurements.image_points
    lost = [one.name for one in measurements.photos if f"photo {one.name} " in message][:MOST]
    if images is None or not lost or len(lost) == len(measurements.photos):
        return []
    kept = np.array([name not in lost for name in images.photo])
    try:
        adjusted, _ = run(replace(measurements, image_points=_some(images, kept)))
    except (SolutionError, InputError):
        return []
    return [mirrored_photo(name) for name in lost if _is_mirrored(measurements, name, adjusted)]


def _is_mirrored(measurements, name, adjusted):
    """Whether a photo that was left out fits the adjusted points when it is mirrored."""
    images = measurements.image_points
    number = {name: i for i, name in enumerate(adjusted.survey.points)}
    rows = [
        i
        for i, (photo, point) in enumerate(zip(images.photo, images.point, strict=True))
        if photo == name and point in number
    ]
    of = next(one.camera for one in measurements.photos if one.name == name)
    camera = next(one.camera for one in measurements.cameras if one.camera.name == of)
    xyz = adjusted.xyz_m[[number[images.point[i]] for i in rows]]
    there = np.isfinite(xyz).all(axis=1)
    ideal = correct_image_points(images.xy_mm[rows], camera.values, camera.form) / camera.values[0]
    return mirrored_fits(xyz[there], ideal[there])


def _some(images, kept):
    rows = np.flatnonzero(kept)
    return replace(
        images,
        photo=tuple(images.photo[i] for i in rows),
        point=tuple(images.point[i] for i in rows),
        xy_mm=images.xy_mm[rows],
        sd_mm=images.sd_mm[rows],
        check=np.asarray(images.check)[rows],
        rows=tuple(images.rows[i] for i in rows) if images.rows else (),
    )
