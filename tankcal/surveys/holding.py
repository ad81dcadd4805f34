"""Is what is held fixed wrong? A survey adjusted again with control or one scale released.

Nothing is changed: where the survey then fits, and what was released is sure of its difference,
that is told.
"""

from dataclasses import replace

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.job.measurements import Instrument
from tankcal.messages import message
from tankcal.observations import ControlCoordinates
from tankcal.surveys.diagnoses import swapped_points
from tankcal.surveys.victims import LISTED, set_aside

FEWER = 0.5  # share of the values set aside that may be left by what explains them
RELEASED_M = 0.001  # sd of fixed control while it is doubted
SCALED = 6.0  # sds that a scale must differ from one
SOUND = 2.0  # sigma0 of a survey that fits, where there is none to compare with
ALIKE = 1.5  # times the smallest sigma0, within which suppositions explain as much


def wrongly_held(measurements, sigma0, gone, run):
    """Problem rows on scales and fixed control without which the survey fits.

    sigma0  without data snooping, inf when the survey could not be adjusted
    gone    number of values that data snooping set aside, inf likewise
    run     run(measurements, snooping=False) -> (network.Adjusted, Gathered)
    """
    found = []
    if np.isfinite(gone):
        limit = FEWER * sigma0 if np.isfinite(sigma0) else SOUND
        found += _explaining(_with_free_scales(measurements), limit, run)
        found += _explaining(_with_free_cameras(measurements), limit, run)
    return [*found, *_wrong_control(measurements, gone, run)]


def _wrong_control(measurements, gone, run):
    """Problem rows when far less must be set aside once control is not held fixed."""
    control = measurements.control
    if control is None or not (control.sd_m == 0).any():
        return []
    released = replace(control, sd_m=np.where(control.sd_m == 0, RELEASED_M, control.sd_m))
    try:
        adjusted, gathered = run(replace(measurements, control=released), snooping=True)
    except (SolutionError, InputError):
        return []
    swapped = swapped_points(adjusted.survey.points, adjusted.xyz_m, gathered.known)
    if swapped or set_aside(adjusted.survey) > FEWER * gone:
        return swapped
    return _released(adjusted, gathered.known)


def _released(adjusted, known):
    """Problem rows of released coordinates that were set aside."""
    found = []
    for one in adjusted.survey.observations:
        if not isinstance(one, ControlCoordinates) or one.use is None:
            continue
        for i in np.flatnonzero((one.use == 0) & (one.sd == RELEASED_M)):
            name, axis = adjusted.survey.points[one.point[i]], "xyz"[one.axis[i]]
            here = adjusted.xyz_m[one.point[i], one.axis[i]]
            text = message(
                "wrongly_held",
                "{axis} of {point} is held fixed at {value_m:.4f}, and the readings put it at"
                " {here_m:.4f}; were it not held, far fewer readings would be set aside: it may be"
                " wrong, or another value that is held",
                axis=axis,
                point=name,
                value_m=one.value[i],
                here_m=here,
            )
            found.append(Problem("control.csv", text, known.row.get(name), f"{axis}_m"))
    return found[:LISTED]


def _explaining(trials, limit, run):
    """Problem rows of trials with which the survey fits, and that what was set free is sure of.

    trials  (changed measurements, difference), the latter a function of the network.Adjusted: what
            was set free less what it was held at, its sd, and the Problem that says so; or None
    """
    found = []
    for changed, difference in trials:
        try:
            adjusted, _ = run(changed)
        except (SolutionError, InputError):
            continue
        told = difference(adjusted) if adjusted.sigma0 < limit else None
        if told is not None:
            away, sd, problem = told
            if abs(away) > SCALED * max(adjusted.sigma0, 1.0) * sd:
                found.append((adjusted.sigma0, problem))
    best = min((sigma0 for sigma0, _ in found), default=np.inf)
    return [problem for sigma0, problem in found if sigma0 < ALIKE * best]


def _sd_of(adjusted, column):
    return (
        0.0 if column < 0 else float(adjusted.solution.cofactors(np.array([column]))[0, 0]) ** 0.5
    )


def _scale(name):
    """What an adjustment says of the free scale of an instrument."""

    def difference(adjusted):
        names = [one.name for one in adjusted.survey.instruments]
        if name not in names:
            return None  # it measured no distance
        i = names.index(name)
        scale = float(adjusted.solution.state.scale[i])
        sd = _sd_of(adjusted, adjusted.problem.layout.scale[i])
        text = message(
            "scale_explains",
            "the distances of {name} fit once they may all be {scale_ppm:+.0f} ppm off (standard"
            " uncertainty {u_ppm:.0f} ppm): look at its certificate, its unit and its u_scale_ppm",
            name=name,
            scale_ppm=1e6 * scale,
            u_ppm=1e6 * sd,
        )
        return scale, sd, Problem("instruments.toml", text, None, name)

    return difference


def _principal_distance(name, held_mm):
    """What an adjustment says of the free principal distance of a camera."""

    def difference(adjusted):
        names = [one.name for one in adjusted.survey.cameras]
        if name not in names:
            return None  # it took no photo
        photo = int(np.flatnonzero(adjusted.survey.photos.camera == names.index(name))[0])
        place = adjusted.problem.interior_of[photo, 0]
        c = float(adjusted.solution.state.interior[place])
        sd = _sd_of(adjusted, adjusted.problem.layout.interior[place])
        text = message(
            "principal_distance_explains",
            "the images fit once c may be {c_mm:.3f} mm (standard uncertainty {u_mm:.3f} mm) in"
            " place of {held_mm:.3f} mm",
            c_mm=c,
            u_mm=sd,
            held_mm=held_mm,
        )
        return c - held_mm, sd, Problem("cameras.toml", text, None, name)

    return difference


def _with_free_cameras(measurements):
    """Trials with the principal distance of one camera free."""
    for number, one in enumerate(measurements.cameras):
        camera = one.camera
        if camera.scope[0] not in ("off", "photo") and camera.state[0] == "free":
            continue
        free = replace(
            camera, scope=("camera", *camera.scope[1:]), state=("free", *camera.state[1:])
        )
        cameras = list(measurements.cameras)
        cameras[number] = replace(one, camera=free)
        changed = replace(measurements, cameras=tuple(cameras))
        yield changed, _principal_distance(camera.name, camera.values[0])


def _with_free_scales(measurements):
    """Trials with the scale of one instrument free.

    Readings without one are taken for those of one instrument that bears the name of their file.
    """
    for tool in measurements.instruments:
        if np.isfinite(tool.u_scale):
            others = tuple(one for one in measurements.instruments if one is not tool)
            freed = (*others, replace(tool, u_scale=np.nan))
            yield replace(measurements, instruments=freed), _scale(tool.name)
    for table in measurements.readings:
        if table.table == "distances" and None in (table.instrument or (None,)):
            names = tuple(one or table.file for one in table.instrument or (None,) * len(table.end))
            free = Instrument(table.file, "other", u_scale=np.nan)
            readings = tuple(
                replace(one, instrument=names) if one is table else one
                for one in measurements.readings
            )
            tools = (*measurements.instruments, free)
            yield replace(measurements, instruments=tools, readings=readings), _scale(table.file)
