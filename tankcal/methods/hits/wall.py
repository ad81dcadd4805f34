"""Bare hits of a wall as its points, by the poses of the set-ups that observed them.

Wall hits that form a circle or a vertical line only if they are interpreted otherwise.

The checks try angles in another unit than the column states, and horizontal distances. The
horizontal distances of a vertical line hardly change with height, and the hits lie within their
stated courses. Zenith angles or distances in another unit break both properties.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.geometry.circles import taubin_circle
from tankcal.messages import list_some, message
from tankcal.methods.hits.readings import offset_unknown
from tankcal.pipeline.wall.finding import find_wall, joints_of, take_points, through_wall
from tankcal.pipeline.wall.shared_unknowns import estimate_causes
from tankcal.pipeline.wall.surveyed import s_transform
from tankcal.sections import coordinates_of
from tankcal.survey import wall_points
from tankcal.survey.diagnosis.misread_files import OTHER_UNITS
from tankcal.survey.poses import covariance_with_points, poses_of, sees_all_around, settle_poses
from tankcal.survey.wall_hits import Beside, rays, sight
from tankcal.units import DEG_IN_GON, FULL_TURN, GON_IN_DEG

FEWEST_AROUND = 3  # smallest number of stations that show their side of the wall
ROUNDS = 4  # largest number of iterations for offsets and places of set-ups
SETTLED_M = 1e-5  # largest movement of a hit in the last iteration
# Movement of a hit after the last iteration that refuses the table. Stations known to 0.1 m leave
# less than 0.1 mm, wrong ones 30 to 130 mm.
UNSETTLED_M = 0.01
CLOSER = 0.2  # largest ratio of the scatter in another unit to that as read, to report the unit
# Least scatter about the circle that needs an explanation, least number of hits of a set-up.
LEAST_M, FEWEST = 0.01, 12
LEAST_SINE = 1e-3  # lower bound of the sine of the zenith angle; avoids division by zero
# Limits of a line: largest range of directions, smallest number of hits, smallest height.
NARROW_RAD, FEWEST_ON_LINE, LEAST_RISE_M = 0.1, 5, 1.0
# Rms from a line that needs an explanation; largest part of it left in another interpretation.
OFF_M, CLOSER_LINE = 0.05, 0.2
# Tolerance of hits beyond the joints; share of hits in their courses as read, and in another unit.
IN_COURSE_M, FEW, MANY = 0.1, 0.5, 0.9
SHOWN = 4  # set-ups named in a message


def find_hit_wall(job, adjustment, progress, dof=np.inf, *, amplitudes=None):
    """Find the wall of a job by its hits.

    Quantities that only the wall determines are corrected, and the wall is computed again: offsets
    of instruments, and places of set-ups. Sections and points then refer to the wall of the table.

    Parameters
    ----------
    job : Job
    adjustment : Adjustment or None
        Adjustment of the network of the set-ups; None: no network.
    progress : callable
    dof, amplitudes
        As in `find_wall`.

    Returns
    -------
    job : Job
        The job with its hits as points.
    sighting : Sighting
    wall : Wall

    Raises
    ------
    SolutionError
        If the places of set-ups do not settle.
    """
    job, sighting = sight_wall(job, adjustment, progress)
    wall, sizes = find_wall(job, progress, dof, amplitudes), None
    for number in range(ROUNDS + 1):
        estimates = wall.estimated_unknowns
        is_last = number == ROUNDS
        if estimates is None or estimates.largest_m < (UNSETTLED_M if is_last else SETTLED_M):
            break
        if is_last:
            raise SolutionError(_not_settled(estimates.largest_m))
        if len(estimates.poses):
            # Poses absorb a part of the form, which later rounds no longer see: keep its size.
            sizes = wall.field.amplitudes
        poses = settle_poses(sighting.poses, estimates.poses)
        sighted = sight(job.hits, poses, estimates.offsets_m)
        offsets = {name: sighting.estimated_m.get(name, 0.0) + correction
                   for name, correction in estimates.offsets_m.items()}  # fmt: skip
        job, sighting = _as_points(
            job, replace(sighted, beside=sighting.beside, estimated_m=offsets)
        )
        wall = find_wall(job, progress, dof, amplitudes, sizes=sizes)
    return job, replace(sighting, estimates=estimate_causes(job, wall)), wall


def _not_settled(moved_m):
    """Message that the places of set-ups do not settle."""
    return message(
        "setups_not_settled",
        "no capacity: the places of the set-ups do not settle, the last pass still moved hits by"
        " {moved_mm:.0f} mm, so the hits do not determine where the set-ups stood; give x_m and"
        " y_m of their stations to 0.3 m in control.csv, tie the set-ups by common targets, or"
        " strap a course (circumferences.csv)",
        moved_mm=1000 * moved_m,
    )


def sight_wall(job, adjustment, progress):
    """Compute the hits of the wall as points.

    Parameters
    ----------
    job : Job
    adjustment : Adjustment or None
        Adjustment of the network of the set-ups; None: no network.
    progress : callable

    Returns
    -------
    job : Job
        The job with the hits used as its points.
    sighting : Sighting
        Of all hits.
    """
    progress(
        message(
            "sighting",
            "computing {count} hits of the wall from {setups} set-ups",
            count=len(job.hits),
            setups=len(set(job.hits.setup)),
        )
    )
    refuse_other_units(job.hits)
    refuse_misread_lines(job.hits)
    _refuse_stations_outside(job)
    poses = poses_of(
        job.hits,
        adjustment,
        nominal_m=job.tank.nominal_diameter_m / 2,
        is_inside=job.survey.side == "inside",
    )
    sighting = sight(job.hits, poses)
    refuse_misread_heights(job, sighting)
    sighting = replace(sighting, beside=_targets_beside(job, poses, adjustment))
    if not np.any(sighting.is_inside == (job.survey.side == "inside")):
        raise _wrong_side_error(job)
    _refuse_unknown_offset(job, sighting)
    return _as_points(job, sighting)


def _as_points(job, sighting):
    """Return the job with the hits used as its points, followed by its targets.

    All points are on one side of the wall. The sighting is returned without the covariance of its
    points, which may take half a gigabyte.
    """
    sighting = _move_to_one_side(job, sighting)
    used_hits = np.flatnonzero(~job.hits.check)
    points = take_points(sighting.points, used_hits)
    if sighting.beside is not None:
        points = sighting.beside.after(points, sighting.by_poses[coordinates_of(used_hits)])
    sighting = replace(sighting, points=replace(sighting.points, covariance_m2=None))
    return replace(job, points=s_transform(points)), sighting


def _targets_beside(job, poses, adjustment):
    """`Beside` of the targets in targets.csv; None if it names no target."""
    if adjustment is None or job.measurements.targets is None:
        return None
    points = wall_points(adjustment, job.measurements, job.survey.side)
    return Beside(points, covariance_with_points(job.hits, poses, adjustment, points.names))


def _refuse_stations_outside(job):
    """Raise InputError if the stations alone show that they lie outside the tank.

    Set-ups without ties that each see a line of the wall would not be placed. Stations inside the
    tank cannot all be further from their centre than the radius: the mean squared distance from
    their centre is at most the mean squared distance from the axis.
    """
    hits = job.hits
    stations = dict.fromkeys(hits.setups[name].station for name in hits.setup)
    places = np.array([hits.stations.get(station, np.full(3, np.nan))[:2] for station in stations])
    if job.survey.side != "inside" or len(places) < FEWEST_AROUND:
        return
    if np.all(np.hypot(*(places - places.mean(axis=0)).T) > job.tank.nominal_diameter_m / 2):
        raise _wrong_side_error(job)


def _wrong_side_error(job):
    """InputError for set-ups on the other side of the wall."""
    text = message(
        "hits_on_other_side",
        "found {side}, but all set-ups of the hits stand {other} the tank; expected {other}",
        side=job.survey.side,
        other="inside" if job.survey.side == "outside" else "outside",
    )
    return InputError(Problem("job.toml", text, column="survey.side"))


def _move_to_one_side(job, sighting):
    """Return the sighting with the hits of the other side moved through the wall.

    The outside is the inside plus plate and paint of the course, along the normal of the wall.
    """
    is_moved = sighting.is_inside != (job.survey.side == "inside")
    if not is_moved.any():
        return sighting
    points = through_wall(job, sighting.points, sighting.normal, is_moved)
    return replace(sighting, points=points)


def _refuse_unknown_offset(job, sighting):
    """Raise InputError for an undeclared offset without any control.

    A tape, or hits from both sides of the wall, determine an offset.
    """
    is_strapped = job.strapping is not None and any(
        not strap.check for strap in job.strapping.straps
    )
    if is_strapped or len(set(sighting.is_inside.tolist())) == 2:
        return
    names = [cause.name for cause in sighting.points.unbound if cause.what == "instrument_offset"]
    if names:
        raise InputError(
            [
                Problem("instruments.toml", offset_unknown(), None, f"{name}.u_offset_mm")
                for name in names
            ]
        )


# ---- wall hits that form a circle or a vertical line only if they are interpreted otherwise


def refuse_other_units(hits):
    """Raise InputError for hits that fit a circle only in another unit or as horizontal distances.

    Parameters
    ----------
    hits : WallHits
        Directions and zenith angles, rad, and distances, m.

    Raises
    ------
    InputError
        With a problem for each set-up and column concerned.
    """
    problems = []
    setup = np.array(hits.setup)
    for name in dict.fromkeys(hits.setup):
        is_of_setup = setup == name
        if is_of_setup.sum() < FEWEST:
            continue
        factors = product((1.0, GON_IN_DEG, DEG_IN_GON), repeat=2)
        scatter_m = {pair: _scatter(hits, is_of_setup, *pair) for pair in factors}
        scatter_as_read = scatter_m[1.0, 1.0] = _scatter(
            hits, is_of_setup, 1.0, 1.0, is_part_enough=True
        )
        best = min(scatter_m, key=scatter_m.get)
        if scatter_as_read < LEAST_M:
            continue
        row = hits.rows[int(np.argmax(is_of_setup))] if hits.rows else None
        if scatter_m[best] > CLOSER * scatter_as_read:
            if (
                _scatter(hits, is_of_setup, 1.0, 1.0, are_horizontal=True)
                <= CLOSER * scatter_as_read
            ):
                problems.append(Problem(hits.file, _HORIZONTAL, row, "distance_m"))
            continue
        problems += [
            Problem(hits.file, _text(factor), row, column)
            for factor, column in zip(best, ("direction", "zenith"), strict=True)
            if factor != 1.0
        ]
    if problems:
        raise InputError(problems)


def _scatter(
    hits,
    is_of_setup,
    direction_factor,
    zenith_factor,
    *,
    are_horizontal=False,
    is_part_enough=False,
):
    """Median distance of the hits of a set-up from the fitted circle, m.

    The result is infinite if the hits do not surround the set-up.

    Parameters
    ----------
    hits : WallHits
    is_of_setup : ndarray of bool, shape (n,)
        Hits of the set-up.
    direction_factor, zenith_factor : float
        Factors that convert the angles as read to the tried unit.
    are_horizontal : bool
        Treat the distances as horizontal instead of slope distances.
    is_part_enough : bool
        Accept hits that do not surround the set-up.
    """
    ray = rays(
        direction_factor * hits.direction_rad[is_of_setup],
        zenith_factor * hits.zenith_rad[is_of_setup],
    )[0]
    position_m = hits.distance_m[is_of_setup, None] * ray
    if are_horizontal:
        position_m /= np.maximum(np.sin(hits.zenith_rad[is_of_setup, None]), LEAST_SINE)
    if (
        not (is_part_enough or sees_all_around(position_m))
        or np.ptp(position_m[:, :2], axis=0).min() == 0
    ):
        return np.inf
    # Centred coordinates keep the algebraic circle fit well conditioned.
    local = position_m[:, :2] - position_m[:, :2].mean(axis=0)
    x, y, radius = taubin_circle(local)
    return float(np.median(np.abs(np.hypot(local[:, 0] - x, local[:, 1] - y) - radius)))


_HORIZONTAL = message(
    "hits_horizontal",
    "the hits of the set-up fit a circle if these are horizontal distances; expected slope"
    " distances, as the instrument measures them",
)


def _text(factor):
    """Message that proposes the unit of the given factor."""
    if factor == GON_IN_DEG:
        return message(
            "hits_in_gon", "the hits of the set-up fit a circle if these are gon: is it so?"
        )
    return message(
        "hits_in_degrees", "the hits of the set-up fit a circle if these are degrees: is it so?"
    )


def refuse_misread_lines(hits):
    """Raise InputError for set-ups whose hits form a straight line only in another interpretation.

    Parameters
    ----------
    hits : WallHits
    """
    setups_by_cause, setup = {}, np.array(hits.setup)
    for name in dict.fromkeys(hits.setup):
        rows_of_setup = np.flatnonzero(setup == name)
        if len(rows_of_setup) >= FEWEST_ON_LINE and _is_narrow(hits.direction_rad[rows_of_setup]):
            cause = _cause_of_line(hits.zenith_rad[rows_of_setup], hits.distance_m[rows_of_setup])
            if cause is not None:
                setups_by_cause.setdefault(cause, []).append(name)
    texts = {
        GON_IN_DEG: ("zenith", _zeniths_in_gon),
        DEG_IN_GON: ("zenith", _zeniths_in_degrees),
        "horizontal": ("distance_m", _horizontal),
    }
    _refuse(hits, [(*texts[cause], names) for cause, names in setups_by_cause.items()])


def refuse_misread_heights(job, sighting):
    """Raise InputError for hits that lie in their courses only with another unit of distance."""
    hits = job.hits
    names = {course.name: i for i, course in enumerate(job.courses)}
    course = np.array([names.get(course_name, -1) for course_name in hits.course])
    joints = job.datum.bottom_z_m + joints_of(job)
    z, station_z = sighting.points.xyz_m[:, 2], sighting.poses.xyz_m[sighting.pose, 2]
    setups_by_unit, setup = {}, np.array(hits.setup)
    for name in dict.fromkeys(hits.setup):
        rows_of_setup = np.flatnonzero((setup == name) & (course >= 0))
        if len(rows_of_setup) < FEWEST_ON_LINE or len(set(course[rows_of_setup].tolist())) < 2:
            continue

        def share(factor, rows_of_setup=rows_of_setup):
            height = station_z[rows_of_setup] + factor * (z - station_z)[rows_of_setup]
            low, high = joints[course[rows_of_setup]], joints[course[rows_of_setup] + 1]
            return np.mean((height > low - IN_COURSE_M) & (height < high + IN_COURSE_M))

        if share(1.0) < FEW:
            best = max(OTHER_UNITS, key=lambda unit: share(unit[0]))
            if share(best[0]) > MANY:
                setups_by_unit.setdefault(best[1], []).append(name)
    _refuse(
        hits,
        [
            ("distance_m", _other_length(unit), setup_names)
            for unit, setup_names in setups_by_unit.items()
        ],
    )


def _is_narrow(direction_rad):
    """Whether all directions lie within `NARROW_RAD`, across a full turn as well."""
    difference = direction_rad - direction_rad[0]
    return np.ptp(difference - FULL_TURN * np.round(difference / FULL_TURN)) < NARROW_RAD


def _cause_of_line(zenith, distance):
    """Interpretation in which the hits form a straight line, or None if none is needed or found."""
    rms_as_read_m = _rms_from_line(distance * np.sin(zenith), distance * np.cos(zenith))
    if rms_as_read_m < OFF_M or np.ptp(distance * np.cos(zenith)) < LEAST_RISE_M:
        return None
    rms_m = {
        factor: _rms_from_line(
            distance * np.sin(factor * zenith), distance * np.cos(factor * zenith)
        )
        for factor in (GON_IN_DEG, DEG_IN_GON)
    }
    rms_m["horizontal"] = _rms_from_line(distance, distance / np.tan(zenith))
    best = min(rms_m, key=rms_m.get)
    return best if rms_m[best] < CLOSER_LINE * rms_as_read_m else None


def _rms_from_line(distance, height):
    """Root mean square distance of hits from a straight line up the wall, m."""
    design = np.column_stack([np.ones(len(height)), height])
    residuals = distance - design @ np.linalg.lstsq(design, distance, rcond=None)[0]
    return float(np.sqrt(np.mean(residuals**2)))


def _refuse(hits, causes):
    """Raise InputError for causes given as (column, text function, set-up names), if any."""
    if causes:
        raise InputError(
            [
                Problem(
                    hits.file,
                    text(list_some(names, SHOWN)),
                    hits.rows[hits.setup.index(names[0])] if hits.rows else None,
                    column,
                )
                for column, text, names in causes
            ]
        )


def _zeniths_in_gon(setups):
    return message(
        "lines_of_hits_in_gon",
        "the hits of set-ups {setups} lie one above another if these are gon: is it so?",
        setups=setups,
    )


def _zeniths_in_degrees(setups):
    return message(
        "lines_of_hits_in_degrees",
        "the hits of set-ups {setups} lie one above another if these are degrees: is it so?",
        setups=setups,
    )


def _horizontal(setups):
    return message(
        "lines_of_hits_horizontal",
        "the hits of set-ups {setups} lie one above another if these are horizontal distances;"
        " expected slope distances, as the instrument measures them",
        setups=setups,
    )


def _other_length(unit):
    return lambda setups: message(
        "hits_of_other_length",
        "the hits of set-ups {setups} are at the heights of their courses if these are in {unit}:"
        " is it so?",
        setups=setups,
        unit=unit,
    )
