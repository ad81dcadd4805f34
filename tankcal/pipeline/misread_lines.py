"""Hits of set-ups that see a line of the wall, one above another, and what would make them do so.

The horizontal distances of such a line hardly change with height, nor do its hits leave the courses
that they are said to be of: not so with zenith angles or distances in another unit.
"""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.outlines import FULL_TURN
from tankcal.messages import list_some, message
from tankcal.pipeline.wall import joints_of
from tankcal.survey.diagnosis.misread_files import OTHER_UNITS

GON_IN_DEG, DEG_IN_GON = 0.9, 1 / 0.9  # what turns an angle that is read so into what was meant
NARROW_RAD, FEWEST, LEAST_RISE_M = 0.1, 5, 1.0  # of a line: its directions, hits, and height
OFF_M, CLOSER = 0.05, 0.2  # rms from a straight line that needs a cause; part of it that tells one
IN_COURSE_M, FEW, MANY = 0.1, 0.5, 0.9  # of hits in their courses: as they are read, as meant
SHOWN = 4  # names of set-ups


def refuse_misread_lines(hits):
    """Raise InputError where the hits of set-ups lie one above another in another unit only.

    hits  WallHits
    """
    found, setup = {}, np.array(hits.setup)
    for name in dict.fromkeys(hits.setup):
        mine = np.flatnonzero(setup == name)
        if len(mine) >= FEWEST and _is_narrow(hits.direction_rad[mine]):
            cause = _cause_of_line(hits.zenith_rad[mine], hits.distance_m[mine])
            if cause is not None:
                found.setdefault(cause, []).append(name)
    texts = {
        GON_IN_DEG: ("zenith", _zeniths_in_gon),
        DEG_IN_GON: ("zenith", _zeniths_in_degrees),
        "horizontal": ("distance_m", _horizontal),
    }
    _refuse(hits, [(*texts[cause], names) for cause, names in found.items()])


def refuse_misread_heights(job, sighting):
    """Raise InputError where the hits of set-ups are in their courses with distances in another
    unit only.
    """
    hits = job.hits
    names = {course.name: i for i, course in enumerate(job.courses)}
    course = np.array([names.get(one, -1) for one in hits.course])
    joints = job.datum.bottom_z_m + joints_of(job)
    z, station_z = sighting.points.xyz_m[:, 2], sighting.poses.xyz_m[sighting.pose, 2]
    found, setup = {}, np.array(hits.setup)
    for name in dict.fromkeys(hits.setup):
        mine = np.flatnonzero((setup == name) & (course >= 0))
        if len(mine) < FEWEST or len(set(course[mine].tolist())) < 2:
            continue

        def share(factor, mine=mine):
            height = station_z[mine] + factor * (z - station_z)[mine]
            low, high = joints[course[mine]], joints[course[mine] + 1]
            return np.mean((height > low - IN_COURSE_M) & (height < high + IN_COURSE_M))

        if share(1.0) < FEW:
            best = max(OTHER_UNITS, key=lambda one: share(one[0]))
            if share(best[0]) > MANY:
                found.setdefault(best[1], []).append(name)
    _refuse(hits, [("distance_m", _other_length(unit), each) for unit, each in found.items()])


def _is_narrow(direction_rad):
    away = direction_rad - direction_rad[0]
    return np.ptp(away - FULL_TURN * np.round(away / FULL_TURN)) < NARROW_RAD


def _cause_of_line(zenith, distance):
    """What makes a straight line of hits, with which they are far from one; None: nothing."""
    usual = _off_line(distance * np.sin(zenith), distance * np.cos(zenith))
    if usual < OFF_M or np.ptp(distance * np.cos(zenith)) < LEAST_RISE_M:
        return None
    off = {
        factor: _off_line(distance * np.sin(factor * zenith), distance * np.cos(factor * zenith))
        for factor in (GON_IN_DEG, DEG_IN_GON)
    }
    off["horizontal"] = _off_line(distance, distance / np.tan(zenith))
    best = min(off, key=off.get)
    return best if off[best] < CLOSER * usual else None


def _off_line(away, height):
    """Rms of horizontal distances from a straight line up the wall."""
    design = np.column_stack([np.ones(len(height)), height])
    left = away - design @ np.linalg.lstsq(design, away, rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))


def _refuse(hits, found):
    """Raise InputError of (column, text of set-ups, their names), where there are any."""
    if found:
        raise InputError(
            [
                Problem(
                    hits.file,
                    text(list_some(names, SHOWN)),
                    hits.rows[hits.setup.index(names[0])] if hits.rows else None,
                    column,
                )
                for column, text, names in found
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
