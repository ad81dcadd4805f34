"""Warnings of bare wall hits: what a sound crew with a sound instrument hardly brings home."""

import numpy as np

from tankcal.errors import Problem
from tankcal.geometry.outlines import FULL_TURN
from tankcal.geometry.shell import course_of
from tankcal.messages import list_some, message
from tankcal.pipeline.cause_correlations import noise_of_wall
from tankcal.pipeline.level_checks import (
    check_nominal,
    check_size_told,
    courses_with_few,
    girth_m,
    levels_with_few,
)
from tankcal.pipeline.lost_setups import check_lost_setups
from tankcal.pipeline.moved_setups import (
    critical_of_ranging,
    moved_or_ranged,
    worst_setup,
)
from tankcal.pipeline.survey_limits import limit_at, limits_of, repeat_factor
from tankcal.pipeline.wall import joints_of
from tankcal.survey.control_drift import repeats_of
from tankcal.survey.sighting import NETWORK, WALL

RULES, CONTROL = "wall_hits", "control_readings.csv"
UNLIKE_SDS = 3.0  # of an offset or a scale from its certificate
OVER_JOINT_M = 0.02  # a hit of a course may lie so far beyond it
SUSPECT = 3.0  # test quantity of the worst set-up, from which it is tested by all others
WAVE_M = 3e-3  # sd of each long wave of a wall, when a set-up is tested
MOSTLY = 0.9  # of the test quantity of a move: distances explain the set-up as well
MOVED_M = 4e-3  # of its hits or its station: less looks like the form of the wall
SHOWN = 5
GON = FULL_TURN / 400


def least_hits(job):
    """How many hits a section of a tank of that circumference should have."""
    return limit_at(RULES, "hits", "least", girth_m(job))


def check_hits(job, wall, sighting):
    """`Problem`s of the hits of a wall."""
    return (
        *_of_control(job),
        *_of_assumed_places(job, wall, sighting.poses),
        *_of_levels(job, wall),
        *_of_courses(job, sighting),
        *_of_incidence(sighting),
        *check_lost_setups(job, wall, sighting),
        *_of_setups(job, wall, sighting),
        *check_nominal(job, wall, job.hits.file),
        *(() if wall.by_inputs else check_size_told(job, [*job.hits.instruments])),
        *causes_unlike_certificates(wall, sighting.told, taken_off_m=sighting.told_m),
    )


def _of_control(job):
    limits = limits_of(RULES)
    if not job.hits.control:
        text = message(
            "no_control_readings",
            "no control target was read again: a tripod or an instrument that moved would not show",
        )
        yield Problem(CONTROL, text)
        return
    again = repeats_of(job.hits.control)
    factor = repeat_factor(sum(3 * len(one.rows) for one in again))
    for one in again:
        of_distances, of_angles = (factor * sd for sd in _sds_of(job.hits, one.setup))
        angle = max(limits["control_angle_gon"] * GON, of_angles)
        distance = max(limits["control_distance_mm"] / 1000, of_distances)
        for name, values, limit, per, unit in (
            ("direction", one.direction_rad, angle, GON / 1000, "mgon"),
            ("zenith", one.zenith_rad, angle, GON / 1000, "mgon"),
            ("distance_m", one.distance_m, distance, 1e-3, "mm"),
        ):
            size = np.nan_to_num(np.abs(values))
            worst = int(np.argmax(size))
            if size[worst] > limit * (1 + 1e-6):
                text = message(
                    "control_moved",
                    "set-up {setup!r} reads target {target!r} {apart:+.1f} {unit} from its first"
                    " reading, over the limit of {limit:.3g} {unit}: did the instrument move?",
                    setup=one.setup,
                    target=one.target,
                    apart=values[worst] / per,
                    limit=limit / per,
                    unit=unit,
                )
                yield Problem(CONTROL, text, one.rows[worst], name)


def _of_assumed_places(job, wall, poses):
    """Set-ups that were placed evenly round the tank, and whose places determine its radius.

    A radius by the curvature of arcs depends on where these lie; a strap makes it independent.
    """
    stations, setups = job.hits.stations, job.hits.setups
    unknown = np.full(3, np.nan)
    names = [
        name
        for (name, _), tie in zip(poses.keys, poses.ties, strict=True)
        if tie == WALL and np.isnan(stations.get(setups[name].station, unknown)[:2]).any()
    ]
    if names and wall.told is not None and job.strapping is None:
        text = message(
            "places_assumed",
            "the stations of set-ups {setups} are blank and were assumed to be evenly spaced; the"
            " radius depends on them: give x_m and y_m to 0.3 m in control.csv, or strap a course",
            setups=list_some(dict.fromkeys(names), SHOWN),
        )
        yield Problem("control.csv", text, column="x_m")


def _sds_of(hits, setup):
    """Standard deviations of a distance (m) and of an angle (rad) of a set-up; 0 without hits."""
    own = np.array(hits.setup) == setup
    return [np.median(one[own]) if own.any() else 0.0 for one in (hits.sd_m, hits.sd_rad)]


def _of_levels(job, wall):
    least = least_hits(job)
    few = levels_with_few(wall, least)
    if few:
        text = message(
            "few_hits",
            "sections {sections} have fewer than {least} hits, as many as a circumference of"
            " {girth_m:.0f} m asks for",
            sections=few,
            least=least,
            girth_m=girth_m(job),
        )
        yield Problem(job.hits.file, text)
    least = limits_of(RULES)["sets_a_course"]
    short = courses_with_few(job, wall, least, slopes_count=True)
    if short:
        text = message(
            "few_levels_of_hits",
            "courses {courses} were hit at fewer than {least} levels: nothing shows a taper there",
            courses=short,
            least=least,
        )
        yield Problem(job.hits.file, text)


def _of_courses(job, sighting):
    """Hits that are said to be of another course than the one at their height."""
    names = [course.name for course in job.courses]
    joints = job.datum.bottom_z_m + joints_of(job)
    z = sighting.points.xyz_m[:, 2]
    wrong = {}
    for place, name in enumerate(job.hits.course):
        if name is None:
            continue
        index = names.index(name)
        if not joints[index] - OVER_JOINT_M <= z[place] <= joints[index + 1] + OVER_JOINT_M:
            there = names[int(course_of(z[place], joints))]
            there = "" if there == name else there  # beyond the bottom or the top
            wrong.setdefault((name, there), []).append(place)
    for (name, there), places in wrong.items():
        text = (
            message(
                "hits_beyond_ends",
                "hits that are said to be of course {course!r} ({count}) lie beyond the end of the"
                " shell: is bottom_z_m right, and the height of the instrument?",
                count=len(places),
                course=name,
            )
            if not there
            else message(
                "hits_of_other_course",
                "hits that are said to be of course {course!r} ({count}) lie at the height of"
                " course {there!r}: is the name wrong, or bottom_z_m, or the height of the"
                " instrument?",
                count=len(places),
                course=name,
                there=there,
            )
        )
        yield Problem(job.hits.file, text, job.hits.rows[places[0]], "course")


def _of_incidence(sighting):
    most = limits_of(RULES)["most_incidence_deg"]
    flat = np.flatnonzero(np.degrees(sighting.incidence_rad) > most)
    if len(flat):
        text = message(
            "hits_too_flat",
            "{count} hits meet the wall at more than {most:g} degrees from its normal: what such"
            " ranging is worth nobody knows",
            count=len(flat),
            most=most,
        )
        yield Problem(sighting.points.file, text, sighting.points.rows[flat[0]])


def _of_setups(job, wall, sighting):
    """The set-up of a network that ranged otherwise than all others, or whose hits contradict
    those of all others most, where one does.

    Where the wall alone ties set-ups nothing tells that one moved.
    """
    names = np.array(job.hits.setup)[~job.hits.check]
    if len(set(names.tolist())) < 2 or any(one != NETWORK for one in sighting.poses.ties):
        return
    order = np.concatenate([one.group.members for one in wall.sections])
    at = wall.accepted[order]  # of each reading of the field, among the points
    if len(wall.field.radius_m) - len(wall.readings) != len(at):  # several in a cell
        return
    hits = at < len(names)  # targets come after them
    if not hits.all():
        return
    whole = wall.field.covariance_m2 + noise_of_wall(wall) - wall.field.noise_m2
    counted = np.flatnonzero(~job.hits.check)[at]
    sight = (sighting.points.xyz_m - sighting.poses.xyz_m[sighting.pose])[counted]
    away, normal = sight[:, :2], sighting.normal[counted]
    turn = normal[:, 0] * away[:, 1] - normal[:, 1] * away[:, 0]
    along = np.sum(normal * sight, axis=1) / np.linalg.norm(sight, axis=1)
    columns = np.column_stack([turn, normal[:, :2]])
    moved, ranged = moved_or_ranged(
        wall.field, whole, names[at], columns, along, SUSPECT, wave_m=WAVE_M
    )
    setup = max(ranged, key=lambda one: ranged[one][0])
    (w, longer), most = ranged[setup], max(one[0] for one in moved.values())
    if w > max(critical_of_ranging(len(ranged)), MOSTLY * most) and abs(longer) > MOVED_M:
        text = message(
            "hits_ranged_otherwise",
            "the distances from set-up {setup!r} contradict all others (w = {w:.1f}), as if they"
            " were {too_long}: was the constant of a reflector set, or another instrument or mode"
            " used?",
            setup=setup,
            w=w,
            too_long=_too_long(1000 * longer),
        )
        yield Problem("setups.csv", text, job.hits.setups[setup].row, "instrument")
        return
    worst = worst_setup(moved)
    if worst is None:
        return
    _, turned, shift = moved[worst["setup"]]
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


def _too_long(by_mm):
    if by_mm < 0:
        return message("mm_too_short", "{by_mm:.1f} mm too short", by_mm=-by_mm)
    return message("mm_too_long", "{by_mm:.1f} mm too long", by_mm=by_mm)


def causes_unlike_certificates(wall, told, file="instruments.toml", *, taken_off_m):
    """Offsets and scales that straps, or hits from the other side, make out to be unlike their
    certificates, which stand in a file.

    taken_off_m  {instrument: offset that was taken off its readings before}, m
    """
    if not told or (wall.straps is None and not wall.by_inputs):
        return
    for one in told:
        if not np.isfinite(one.u_before) and one.what == "instrument_offset":
            yield from _strange_offset(one, taken_off_m.get(one.name, 0.0), file)
        if not np.isfinite(one.u_before) or abs(one.value) <= UNLIKE_SDS * one.u_before:
            continue
        ratio = abs(one.value) / one.u_before
        if one.what == "instrument_offset":
            key, text = (
                "u_offset_mm",
                message(
                    "offset_unlike_certificate",
                    "the wall makes the offset of {name} {value_mm:+.2f} mm, {ratio:.1f} times its"
                    " u_offset_mm: is that of another reflector, or a strap or a plate wrong?",
                    name=one.name,
                    value_mm=1000 * one.value,
                    ratio=ratio,
                ),
            )
        else:
            key, text = (
                "u_scale_ppm",
                message(
                    "scale_unlike_certificate",
                    "the wall makes the scale of {name} {value_ppm:+.0f} ppm, {ratio:.1f} times its"
                    " u_scale_ppm",
                    name=one.name,
                    value_ppm=1e6 * one.value,
                    ratio=ratio,
                ),
            )
        yield Problem(file, text, None, f"{one.name}.{key}")


def _strange_offset(one, taken_off_m, file):
    """An offset that nobody certified, and that is surely larger than instruments have."""
    most = limits_of(RULES)["most_offset_mm"] / 1000
    value = one.value + taken_off_m
    if abs(value) > most + UNLIKE_SDS * one.u_after:
        text = message(
            "offset_strange",
            "straps and wall make the offset of {name} {value_mm:+.2f} mm; on a bare wall it is"
            " seldom more than {most_mm:g} mm: was the constant of a reflector set, is a strap"
            " misread, or are circumferences those of the inside?",
            name=one.name,
            value_mm=1000 * value,
            most_mm=1000 * most,
        )
        yield Problem(file, text, None, f"{one.name}.u_offset_mm")
