"""Are the readings that were set aside blunders, or victims of something wrong that was kept?

A search for blunders believes the majority and what is held fixed. Of single blunders it leaves
their traces everywhere; where it took far more readings of one thing (a point with known
coordinates, a photo, an instrument) than of all others, that thing is told:

    P(k or more of n | p) < 0.001 / number of things,   p = (K + 1) / (N + 2)

with k of its n values set aside and K of the N values of everything else.
"""

from collections import defaultdict
from dataclasses import replace

import numpy as np
from scipy.special import betainc

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.job.measurements import Instrument
from tankcal.network.separability import alternatives
from tankcal.observations import ControlCoordinates
from tankcal.surveys.diagnoses import swapped_points

LEVEL = 0.001
MANY = 0.12  # share of all values set aside, above which these are hardly single blunders
SOME = 0.02  # share above which what is held fixed is doubted for once
FEWER = 0.5  # share of the values set aside that may be left by what explains them
RELEASED_M = 0.001  # sd of fixed control while it is doubted
SCALED = 6.0  # sds that a scale must differ from one
SOUND = 2.0  # sigma0 of a survey that fits, where there is none to compare with
ALIKE = 1.5  # times the smallest sigma0, within which suppositions explain as much
LISTED = 4
TESTED = 60  # readings set aside of which it is asked whether others might have been


def one_sided(readings, known):
    """Problem rows on things that lost many more of their values than everything else.

    readings  Reading rows              known  Known control
    """
    used = [one for one in readings if not one.check and one.file != "cameras.toml"]
    things = defaultdict(list)
    for one in used:
        for thing in _things(one, known):
            things[thing].append(one)
    total, gone = len(used), sum(one.removed for one in used)
    if not gone:
        return []
    found = []
    for (file, name), mine in things.items():
        n, k = len(mine), sum(one.removed for one in mine)
        p = (gone - k + 1) / (total - n + 2)
        if k > 2 and n < total and betainc(k, n - k + 1, p) < LEVEL / len(things):
            found.append((k / n, Problem(file, _far_more(name, k, n, known), known.row.get(name))))
    found.sort(key=lambda pair: -pair[0])
    return [*_lost_control(used), *(one for _, one in found[:LISTED]), *_many(gone, total)]


def _things(one, known):
    """(file, name) of what a value hangs on."""
    if one.kind == "image coordinate":
        yield one.file, f"photo {one.ids[0]}"
    for name in dict.fromkeys(one.ids):
        if name in known.row and not one.kind.startswith("control coordinate"):
            yield "control.csv", name


def _far_more(name, k, n, known):
    if name in known.row:
        return (
            f"{k} of the {n} values measured to point {name} were set aside, far more than of "
            "other points: its coordinates may be wrong, not the readings"
        )
    return (
        f"{k} of the {n} values of {name} were set aside, far more than of others: look at the "
        "whole of it"
    )


def _lost_control(readings):
    """Known coordinates that were set aside."""
    gone = [
        one
        for one in readings
        if one.removed and one.kind.startswith("control coordinate") and np.isfinite(one.residual)
    ]
    return [
        Problem(
            one.file,
            f"{one.element} of {one.ids[0]} was set aside: given as {one.value:.4f} (sd "
            f"{one.sd:.4f}), and the readings put it at {one.value + one.residual:.4f}",
            one.row,
            f"{one.element}_m",
        )
        for one in gone[: 2 * LISTED]
    ]


def _many(gone, total):
    if gone < 3 or gone <= MANY * total:
        return []
    text = (
        f"{gone} of {total} values ({100 * gone / total:.0f} %) were set aside: more than single "
        "blunders explain; doubt what is held fixed, a scale, or the standard deviations first"
    )
    return [Problem("job.toml", text, None, "adjustment.snooping")]


def undecided(adjusted, removed, traces):
    """Problem rows of readings set aside in whose place others might have been.

    removed  tuple of network.cleaning.Removed, the worst first        traces  {source: Trace}
    """
    found = []
    for one in removed[:TESTED]:
        others = alternatives(adjusted, one.source, one.row)
        if others:
            names = [_named(adjusted, traces, *other) for other in others[:LISTED]]
            more = ", ..." if len(others) > LISTED else ""
            text = (
                f"{_named(adjusted, traces, one.source, one.row)} was set aside, but it may as "
                f"well be {' or '.join(names)}{more} that is wrong: the readings cannot tell"
            )
            trace = traces[one.source]
            found.append(Problem(trace.file, text, trace.rows[one.row]))
    if len(found) > LISTED:
        text = f"of {len(found) - LISTED} more readings set aside the same is true"
        found[LISTED:] = [Problem("job.toml", text, None, "adjustment.snooping")]
    return found


def _named(adjusted, traces, source, row):
    """A reading in words."""
    trace = traces[source]
    ids = trace.ids[row]
    if source == "image points":
        return f"point {ids[1]} in photo {ids[0]}"
    kind = adjusted.survey.observations[source].kind
    of = trace.table.replace("_", " ") or kind.removesuffix(" of a further system")
    where = "" if trace.rows[row] is None else f" (row {trace.rows[row]})"
    names = " ".join(filter(None, ["-".join(ids), trace.element[row][0]]))
    return f"{of.removesuffix('s')} {names}{where}"


def set_aside(survey):
    """Number of values that the survey of an adjustment leaves out."""
    images = survey.image_points
    count = 0 if images is None or images.use is None else 2 * int(np.sum(images.use == 0))
    return count + sum(
        one.rows * int(np.sum(one.use == 0)) for one in survey.observations if one.use is not None
    )


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
            text = (
                f"{axis} of {name} is held fixed at {one.value[i]:.4f}, and the readings put it at "
                f"{here:.4f}; were it not held, far fewer readings would be set aside: it may be "
                "wrong, or another value that is held"
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
        text = (
            f"the distances of {name} fit once they may all be {1e6 * scale:+.0f} ppm off "
            f"(standard uncertainty {1e6 * sd:.0f} ppm): look at its certificate, its unit and "
            "its u_scale_ppm"
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
        text = (
            f"the images fit once c may be {c:.3f} mm (standard uncertainty {sd:.3f} mm) in "
            f"place of {held_mm:.3f} mm"
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
