"""Vertical lines of wall hits that are straight only if their readings are interpreted otherwise.

The horizontal distances of such a line hardly change with height, and the hits lie within their
stated courses. Zenith angles or distances in another unit break both properties.
"""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import list_some, message
from tankcal.pipeline.wall.finding import joints_of
from tankcal.survey.diagnosis.misread_files import OTHER_UNITS
from tankcal.units import DEG_IN_GON, FULL_TURN, GON_IN_DEG

# Factors that convert an angle read as degrees but given in gon, and the reverse.
# Limits of a line: largest range of directions, smallest number of hits, smallest height.
NARROW_RAD, FEWEST, LEAST_RISE_M = 0.1, 5, 1.0
# Rms from a line that needs an explanation; largest part of it left in another interpretation.
OFF_M, CLOSER = 0.05, 0.2
# Tolerance of hits beyond the joints; share of hits in their courses as read, and in another unit.
IN_COURSE_M, FEW, MANY = 0.1, 0.5, 0.9
SHOWN = 4  # set-ups named in a message


def refuse_misread_lines(hits):
    """Raise InputError for set-ups whose hits form a straight line only in another interpretation.

    Parameters
    ----------
    hits : WallHits
    """
    setups_by_cause, setup = {}, np.array(hits.setup)
    for name in dict.fromkeys(hits.setup):
        rows_of_setup = np.flatnonzero(setup == name)
        if len(rows_of_setup) >= FEWEST and _is_narrow(hits.direction_rad[rows_of_setup]):
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
        if len(rows_of_setup) < FEWEST or len(set(course[rows_of_setup].tolist())) < 2:
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
    return best if rms_m[best] < CLOSER * rms_as_read_m else None


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
