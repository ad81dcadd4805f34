"""Warnings of bare wall hits: findings that are rare in a valid survey.

A set-up with mostly rejected hits is reported with the probable cause. Possible causes are an
anticlockwise circle, another zero of the circle, or hits under the name of
another set-up. Each cause is tried with the given poses. It is reported if it brings the hits to
the wall of all others.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import Problem
from tankcal.geometry.circles import taubin_circle
from tankcal.geometry.shell import course_of
from tankcal.messages import list_some, message
from tankcal.methods.base import is_size_measured
from tankcal.methods.moved_setups import (
    critical_of_ranging,
    moved_or_ranged,
    worst_setup,
)
from tankcal.pipeline.checks import (
    causes_unlike_certificates,
    limit_at,
    limits_of,
    repeat_factor,
)
from tankcal.pipeline.checks.wall import (
    check_nominal,
    check_size_measured,
    courses_with_few,
    girth_m,
    levels_with_few,
)
from tankcal.pipeline.wall.finding import joints_of
from tankcal.pipeline.wall.shared_unknowns import noise_of_wall
from tankcal.survey.wall_hits import NETWORK, WALL, certified_m, rays
from tankcal.units import FULL_TURN, GON, HOUR_S

RULES, CONTROL = "wall_hits", "control_readings.csv"
OVER_JOINT_M = 0.02  # largest distance of a hit beyond the joints of its course
SUSPECT = 3.0  # test quantity of the worst set-up from which it is tested against all others
WAVE_M = 3e-3  # standard deviation of each long wave of the wall in the test of a set-up
# Distances explain a set-up as well as a movement from this share of the test quantity of the
# movement.
MOSTLY = 0.9
MOVED_M = 4e-3  # smallest reported movement; less cannot be separated from the form of the wall
SHOWN = 5  # largest number of names in a message
# Smallest shares of rejected hits for a warning, with and without a known cause; smallest number.
MANY, MOST, FEWEST = 0.2, 0.5, 5
OFF_M = 0.01  # smallest median distance of the rejected hits from the wall
CLOSER = 0.2  # largest distance under an accepted cause, relative to the distance as read
TURNS = 720  # number of tried zeros of a circle


def least_hits(job):
    """Return the recommended number of hits in a section of the tank, by its circumference."""
    return limit_at(RULES, "hits", "least", girth_m(job))


def check_hits(job, wall, sighting):
    """Return the warnings of the hits of a wall.

    Parameters
    ----------
    job : Job
    wall : Wall
    sighting : Sighting

    Returns
    -------
    tuple of Problem
    """
    return (
        *check_control(job.hits),
        *_check_assumed_places(job, wall, sighting.poses),
        *_check_levels(job, wall),
        *_check_courses(job, sighting),
        *check_incidence(sighting),
        *check_lost_setups(job, wall, sighting),
        *_check_setups(job, wall, sighting),
        *check_nominal(job, wall, job.hits.file),
        *(() if wall.by_inputs else check_size_measured(job, [*job.hits.instruments])),
        *causes_unlike_certificates(wall, sighting.estimates, taken_off_m=sighting.estimated_m),
    )


def check_control(hits):
    """Return warnings of missing or deviating control readings of `WallHits`."""
    limits = limits_of(RULES)
    if not hits.control:
        text = message(
            "no_control_readings",
            "no control target was read again: a tripod or an instrument that moved would not show",
        )
        yield Problem(CONTROL, text)
        return
    targets = repeats_of(hits.control)
    factor = repeat_factor(sum(3 * len(target.rows) for target in targets))
    for target in targets:
        distance_spread, angle_spread = (
            factor * sd for sd in _standard_deviations(hits, target.setup)
        )
        # Below the spread due to the declared standard deviations, chance would exceed the limit.
        angle = max(limits["control_angle_gon"] * GON, angle_spread)
        distance = max(limits["control_distance_mm"] / 1000, distance_spread)
        for name, values, limit, scale, unit in (
            ("direction", target.direction_rad, angle, GON / 1000, "mgon"),
            ("zenith", target.zenith_rad, angle, GON / 1000, "mgon"),
            ("distance_m", target.distance_m, distance, 1e-3, "mm"),
        ):
            size = np.nan_to_num(np.abs(values))
            worst = int(np.argmax(size))
            if size[worst] > limit * (1 + 1e-6):
                text = message(
                    "control_moved",
                    "set-up {setup!r} reads target {target!r} {apart:+.1f} {unit} from its first"
                    " reading, over the limit of {limit:.3g} {unit}: did the instrument move?",
                    setup=target.setup,
                    target=target.target,
                    apart=values[worst] / scale,
                    limit=limit / scale,
                    unit=unit,
                )
                yield Problem(CONTROL, text, target.rows[worst], name)


def _check_assumed_places(job, wall, poses):
    """Warn of set-ups that were assumed to be evenly spaced and determine the radius of the tank.

    A radius from the curvature of arcs depends on the places of these arcs; a strap makes it
    independent of them.
    """
    stations, setups = job.hits.stations, job.hits.setups
    unknown = np.full(3, np.nan)
    names = [
        name
        for (name, _), tie in zip(poses.keys, poses.ties, strict=True)
        if tie == WALL and np.isnan(stations.get(setups[name].station, unknown)[:2]).any()
    ]
    if names and wall.estimated_unknowns is not None and not is_size_measured(job):
        text = message(
            "places_assumed",
            "the stations of set-ups {setups} are blank and were assumed to be evenly spaced; the"
            " radius depends on them: give x_m and y_m to 0.3 m in control.csv, or strap a course",
            setups=list_some(dict.fromkeys(names), SHOWN),
        )
        yield Problem("control.csv", text, column="x_m")


def _standard_deviations(hits, setup):
    """Standard deviations of a distance (m) and of an angle (rad) of a set-up; 0 without hits."""
    is_of_setup = np.array(hits.setup) == setup
    return [
        np.median(values[is_of_setup]) if is_of_setup.any() else 0.0
        for values in (hits.sd_m, hits.sd_rad)
    ]


def _check_levels(job, wall):
    """Warn of sections with few hits and of courses with few levels."""
    least = least_hits(job)
    sections = levels_with_few(wall, least)
    if sections:
        text = message(
            "few_hits",
            "sections {sections} have fewer than {least} hits, as many as a circumference of"
            " {girth_m:.0f} m asks for",
            sections=sections,
            least=least,
            girth_m=girth_m(job),
        )
        yield Problem(job.hits.file, text)
    least = limits_of(RULES)["sets_a_course"]
    courses = courses_with_few(job, wall, least, slopes_count=True)
    if courses:
        text = message(
            "few_levels_of_hits",
            "courses {courses} were hit at fewer than {least} levels: nothing shows a taper there",
            courses=courses,
            least=least,
        )
        yield Problem(job.hits.file, text)


def _check_courses(job, sighting):
    """Warn of hits whose declared course differs from the course at their height."""
    names = [course.name for course in job.courses]
    joints = job.datum.bottom_z_m + joints_of(job)
    z = sighting.points.xyz_m[:, 2]
    misplaced = {}
    for hit, name in enumerate(job.hits.course):
        if name is None:
            continue
        index = names.index(name)
        if not joints[index] - OVER_JOINT_M <= z[hit] <= joints[index + 1] + OVER_JOINT_M:
            course_there = names[int(course_of(z[hit], joints))]
            # No course lies beyond the bottom or the top.
            course_there = "" if course_there == name else course_there
            misplaced.setdefault((name, course_there), []).append(hit)
    for (name, course_there), places in misplaced.items():
        text = (
            message(
                "hits_beyond_ends",
                "hits that are said to be of course {course!r} ({count}) lie beyond the end of the"
                " shell: is bottom_z_m right, and the height of the instrument?",
                count=len(places),
                course=name,
            )
            if not course_there
            else message(
                "hits_of_other_course",
                "hits that are said to be of course {course!r} ({count}) lie at the height of"
                " course {there!r}: is the name wrong, or bottom_z_m, or the height of the"
                " instrument?",
                count=len(places),
                course=name,
                there=course_there,
            )
        )
        yield Problem(job.hits.file, text, job.hits.rows[places[0]], "course")


def check_incidence(sighting):
    """Return warnings of hits at large angles of incidence."""
    most = limits_of(RULES)["most_incidence_deg"]
    oblique = np.flatnonzero(np.degrees(sighting.incidence_rad) > most)
    if len(oblique):
        text = message(
            "hits_too_flat",
            "{count} hits meet the wall at more than {most:g} degrees from its normal: the"
            " uncertainty of a distance at such an angle is not known",
            count=len(oblique),
            most=most,
        )
        yield Problem(sighting.points.file, text, sighting.points.rows[oblique[0]])


def _check_setups(job, wall, sighting):
    """Warn of the set-up of a network whose hits or distances contradict all others most.

    If only the wall ties the set-ups, no test can detect a moved set-up.
    """
    names = np.array(job.hits.setup)[~job.hits.check]
    if len(set(names.tolist())) < 2 or any(tie != NETWORK for tie in sighting.poses.ties):
        return
    order = np.concatenate([section.group.members for section in wall.sections])
    point = wall.accepted[order]  # number of the point of each reading of the field
    if len(wall.field.radius_m) - len(wall.readings) != len(point):  # several points in a cell
        return
    hits = point < len(names)  # the points list targets after hits
    if not hits.all():
        return
    covariance_m2 = wall.field.covariance_m2 + noise_of_wall(wall) - wall.field.noise_m2
    used = np.flatnonzero(~job.hits.check)[point]
    sight = (sighting.points.xyz_m - sighting.poses.xyz_m[sighting.pose])[used]
    away, normal = sight[:, :2], sighting.normal[used]
    # Derivatives of the distance from the wall: by a rotation of the set-up about the vertical, by
    # its shift along the normal, and by a longer distance.
    turn = normal[:, 0] * away[:, 1] - normal[:, 1] * away[:, 0]
    along = np.sum(normal * sight, axis=1) / np.linalg.norm(sight, axis=1)
    columns = np.column_stack([turn, normal[:, :2]])
    moved, ranged = moved_or_ranged(
        wall.field, covariance_m2, names[point], columns, along, SUSPECT, wave_m=WAVE_M
    )
    setup = max(ranged, key=lambda name: ranged[name][0])
    (w, longer), most = ranged[setup], max(test[0] for test in moved.values())
    if w > max(critical_of_ranging(len(ranged)), MOSTLY * most) and abs(longer) > MOVED_M:
        text = message(
            "hits_ranged_otherwise",
            "the distances from set-up {setup!r} contradict all others (w = {w:.1f}), as if they"
            " were {too_long}: was the constant of a reflector set, or another instrument or mode"
            " used?",
            setup=setup,
            w=w,
            too_long=_length_in_words(1000 * longer),
        )
        yield Problem("setups.csv", text, job.hits.setups[setup].row, "instrument")
        return
    worst = worst_setup(moved)
    if worst is None:
        return
    _, turned, shift = moved[worst["setup"]]
    # The movement of the hits: by the shift of the station, or by the rotation at the median
    # distance.
    moved_m = max(float(np.hypot(*shift)), abs(turned) * float(np.median(np.hypot(*away.T))))
    if moved_m > MOVED_M:
        text = message(
            "hits_of_moved_setup",
            "the hits from set-up {setup!r} contradict all others (w = {w:.1f}), as if its circle"
            " were turned by {turn_arcsec:+.0f} seconds of arc, or its station moved by"
            " {shift_mm:.1f} mm: was it disturbed, has it another zero, or are its hits those of"
            " another set-up?",
            **worst,
        )
        yield Problem("setups.csv", text, job.hits.setups[worst["setup"]].row, "setup")


def _length_in_words(by_mm):
    """Difference of a distance in words."""
    if by_mm < 0:
        return message("mm_too_short", "{by_mm:.1f} mm too short", by_mm=-by_mm)
    return message("mm_too_long", "{by_mm:.1f} mm too long", by_mm=by_mm)


def check_lost_setups(job, wall, sighting):
    """Yield warnings of set-ups with mostly rejected hits.

    Parameters
    ----------
    job : Job
    wall : Wall
    sighting : Sighting

    Yields
    ------
    Problem
    """
    used = np.flatnonzero(~job.hits.check)
    kept = wall.accepted[wall.accepted < len(used)]  # the points list targets after hits
    is_rejected = np.ones(len(used), dtype=bool)
    is_rejected[kept] = False
    if is_rejected.all():
        return
    names = np.array(job.hits.setup)[used]
    for name in dict.fromkeys(names.tolist()):
        is_of_setup = names == name
        count, total = int((is_of_setup & is_rejected).sum()), int(is_of_setup.sum())
        if count < max(FEWEST, MANY * total):
            continue
        distance_off, pose_and_zero = _make_distance(
            job.hits, sighting, used[is_of_setup & is_rejected], used[~is_rejected]
        )
        cause = _find_cause(job.hits, sighting, distance_off, pose_and_zero, name)
        if distance_off(*pose_and_zero) < OFF_M or (cause is None and count < MOST * total):
            continue
        text = message(
            "setup_set_aside",
            "{count} of {all} hits of set-up {name!r} lie off the wall of all others and were set"
            " aside: {cause}",
            count=count,
            all=total,
            name=name,
            cause=cause
            or message(
                "setup_elsewhere",
                "is its station, its instrument or the zero of its circle another one?",
            ),
        )
        yield Problem(
            job.hits.file, text, job.hits.rows[used[is_of_setup & is_rejected][0]], "setup"
        )


def _make_distance(hits, sighting, rejected, accepted):
    """Function for the distance of the rejected hits of a set-up, and its present arguments.

    Parameters
    ----------
    hits : Hits
    sighting : Sighting
    rejected, accepted : ndarray of int
        Rejected hits of the set-up, and accepted hits of all set-ups.

    Returns
    -------
    callable
        off(pose, zero of the circle, sense of the circle): median distance (m) of the rejected hits
        from the circle through the accepted hits.
    (int, float)
        Pose and zero of the circle as adjusted.
    """
    xy = sighting.points.xyz_m[accepted, :2]
    middle = xy.mean(axis=0)
    x, y, radius = taubin_circle(xy - middle)
    poses, pose = sighting.poses, int(sighting.pose[rejected[0]])
    distance = certified_m(hits)[rejected, None]

    def off(place, zero, sense=1.0):
        ray = rays(zero + sense * hits.direction_rad[rejected], hits.zenith_rad[rejected])[0]
        away = poses.xyz_m[place, :2] + (distance * ray)[:, :2] - middle - (x, y)
        return float(np.median(np.abs(np.hypot(*away.T) - radius)))

    return off, (pose, poses.orientation_rad[pose])


def _find_cause(hits, sighting, distance_off, pose_and_zero, name):
    """Cause that brings the hits to the wall, in words, or None."""
    pose, zero = pose_and_zero
    largest_m = CLOSER * distance_off(pose, zero)
    if distance_off(pose, zero, -1.0) < largest_m:
        return message("setup_anticlockwise", "do its directions grow anticlockwise?")
    for key, other in dict.fromkeys(zip(hits.setup, sighting.pose.tolist(), strict=True)):
        if key != name and distance_off(other, sighting.poses.orientation_rad[other]) < largest_m:
            return message("setup_of_other", "are they those of set-up {other!r}?", other=key)
    turns = np.arange(TURNS) * FULL_TURN / TURNS
    turn = min(turns, key=lambda change: distance_off(pose, zero + change))
    if distance_off(pose, zero + turn) < largest_m:
        return message(
            "setup_turned",
            "turned by {degrees:+.0f} degrees they lie on it; has the circle another zero?",
            degrees=180 - (180 - np.degrees(turn)) % 360,
        )
    return None


# ---- motion of instrument and tripod


@dataclass(frozen=True)
class RepeatedTarget:
    """A control target with k readings from one set-up, in the order of time.

    Attributes
    ----------
    setup, target : str
    rows : tuple of int or None, length k
        Rows of the file.
    elapsed_s : ndarray, shape (k,)
        Time since the first reading of the set-up, s.
    direction_rad, zenith_rad, distance_m : ndarray, shape (k,)
        Differences from the first reading of the same quantity; nan where it was not read.
    """

    setup: str
    target: str
    rows: tuple
    elapsed_s: np.ndarray
    direction_rad: np.ndarray
    zenith_rad: np.ndarray
    distance_m: np.ndarray


@dataclass(frozen=True)
class Drift:
    """Linear drift of a set-up, estimated from all its control targets; nan: not determined.

    Attributes
    ----------
    setup : str
    direction_rad_s, zenith_rad_s : float
        Drift of the circle zero and of the zenith angle, rad/s.
    hours : float
        Time between the first and the last reading, h.
    """

    setup: str
    direction_rad_s: float
    zenith_rad_s: float
    hours: float


def repeats_of(control):
    """Return a `RepeatedTarget` for each target of each set-up, in the order of their first rows.

    Parameters
    ----------
    control : sequence of ControlReading
    """
    start, groups = {}, {}
    for reading in control:
        start[reading.setup] = min(reading.time_s, start.get(reading.setup, np.inf))
        groups.setdefault((reading.setup, reading.target), []).append(reading)
    repeated = []
    for (setup, target), sequence in groups.items():
        sequence = sorted(sequence, key=lambda reading: reading.time_s)
        values = np.array(
            [
                [reading.direction_rad, reading.zenith_rad, reading.distance_m]
                for reading in sequence
            ]
        )
        direction, zenith, distance = (_differences_from_first(column) for column in values.T)
        repeated.append(
            RepeatedTarget(
                setup,
                target,
                tuple(reading.row for reading in sequence),
                np.array([reading.time_s for reading in sequence]) - start[setup],
                # Reduce the difference to (-pi, pi]: a reading may cross the zero of the circle.
                direction - FULL_TURN * np.round(direction / FULL_TURN),
                zenith,
                distance,
            )
        )
    return tuple(repeated)


def _differences_from_first(values):
    """Differences (k,) from the first finite value."""
    finite = np.flatnonzero(np.isfinite(values))
    return values - (values[finite[0]] if len(finite) else 0.0)


def drifts_of(repeats):
    """Return the `Drift` of each set-up: one slope for all targets, one constant for each target.

    Examples
    --------
    >>> from tankcal.survey.wall_hits import ControlReading
    >>> control = [ControlReading("I", "A", 1e-5 * t, 1.5, 9.0, 3600.0 * t) for t in (0, 1, 2)]
    >>> drift, = drifts_of(repeats_of(control))
    >>> round(3600 * drift.direction_rad_s, 9), drift.hours
    (1e-05, 2.0)
    """
    drifts = []
    for setup in dict.fromkeys(target.setup for target in repeats):
        targets = [target for target in repeats if target.setup == setup]
        hours = max(float(target.elapsed_s.max()) for target in targets) / HOUR_S
        slopes = (
            _slope([(target.elapsed_s, getattr(target, name)) for target in targets])
            for name in ("direction_rad", "zenith_rad")
        )
        drifts.append(Drift(setup, *slopes, hours))
    return tuple(drifts)


def _slope(series):
    """Common slope of several series (times, values), each with its own constant; nan: not
    determined."""
    numerator = denominator = 0.0
    for times, values in series:
        finite = np.isfinite(values)
        if finite.sum() > 1:
            # Centring the times eliminates the constant of the series from the normal equation of
            # the slope.
            time = times[finite] - times[finite].mean()
            numerator, denominator = numerator + time @ values[finite], denominator + time @ time
    return float(numerator / denominator) if denominator > 0 else float("nan")
