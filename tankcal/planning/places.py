"""Geometry of a plan: positions relative to the wall, joints, rows of targets, plates, bases.

A base is a distance from angles to a stadia over one station, read from another.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tankcal.job.checking import has_rows
from tankcal.job.checks.survey.readings import bars_used
from tankcal.planning.model import Base
from tankcal.quadrature import panels
from tankcal.survey.measurements import Readings
from tankcal.survey.stadia import angle_of_distance_rad, distance_sd_m
from tankcal.units import ARCSEC

TOUCH_M = 0.02  # smallest distance between two target rows
ROUNDING_RAD = 1e-8  # rounding error of a full turn
STADIA_FILE = "stadia.csv"
NEW_SD_RAD = ARCSEC  # standard deviation of the angle of an added base if the plan has no base


@dataclass(frozen=True)
class Place:
    """A position relative to the tank.

    Attributes
    ----------
    arc_m : float
        Arc along the wall from the reference weld, clockwise seen from above.
    azimuth_rad : float
        Azimuth from the axis, clockwise from +y.
    off_m : float
        Distance from the wall, on the side of the survey.
    height_m : float
        Height above the bottom.
    """

    arc_m: float
    azimuth_rad: float
    off_m: float
    height_m: float


def place_of(plan, xyz_m):
    """Return the Place of a point.

    Parameters
    ----------
    plan : Plan
    xyz_m : array_like, shape (3,)
        Coordinates in the frame of the survey, m.
    """
    shell = plan.shell
    east, north = xyz_m[:2] - shell.axis_m
    azimuth = full_turn(np.arctan2(east, north))
    off = np.hypot(east, north) - wall_radius_m(plan, xyz_m[2] - shell.low_m)
    arc = full_turn(azimuth - reference_rad(plan)) * shell.radius_m
    height = float(xyz_m[2] - shell.low_m)
    return Place(float(arc), float(azimuth), float(off if shell.is_outside else -off), height)


def reference_rad(plan):
    """Azimuth of the reference weld: azimuth of a target minus its arc along the wall.

    Returns
    -------
    float
        rad, -pi to pi, clockwise from +y.
    """
    targets, shell = plan.targets, plan.shell
    east, north = targets.xyz_m[0, :2] - shell.axis_m
    azimuth = np.arctan2(east, north) - targets.arc_m[0] / shell.radius_m
    return float(np.angle(np.exp(1j * azimuth)))


def wall_radius_m(plan, height_m):
    """Radius of the wall on the side of the survey, m, at a height above the bottom."""
    courses, outside = plan.job.courses, plan.shell.is_outside
    course = courses[np.searchsorted(joints_m(plan)[1:-1], height_m, side="right")]
    return plan.shell.radius_m + plate_m(course, outside) - plate_m(courses[0], outside)


def joints_m(plan):
    """Heights of the joints of the courses above the bottom.

    Returns
    -------
    ndarray, shape (courses + 1,)
        m.
    """
    return joints_of(plan.job.courses)


def full_turn(angle_rad):
    """Reduce angles to 0 to 2 pi; a full turn within rounding becomes 0.

    Returns
    -------
    ndarray
        Angles, rad.

    Examples
    --------
    >>> full_turn(np.array([-1.0, 2 * np.pi])).round(6)
    array([5.283185, 0.      ])
    """
    turned = np.asarray(angle_rad) % (2 * np.pi)
    return np.where(2 * np.pi - turned < ROUNDING_RAD, 0.0, turned)


def places_around(axis_m, azimuth_rad, radius_m):
    """Positions at azimuths and distances from an axis.

    Parameters
    ----------
    axis_m : array_like, shape (2,)
        Position of the axis, m.
    azimuth_rad : array_like
        Azimuths, clockwise from +y, rad.
    radius_m : array_like
        Distances, m; broadcast against the azimuths.

    Returns
    -------
    ndarray, shape (..., 2)
        m.
    """
    azimuth, radius = np.broadcast_arrays(azimuth_rad, radius_m)
    return np.asarray(axis_m) + radius[..., None] * np.stack(
        [np.sin(azimuth), np.cos(azimuth)], axis=-1
    )


def joints_of(courses):
    """Heights (courses + 1,) of the joints above the bottom of the lowest course, m."""
    return np.cumsum([0.0] + [course.height_m for course in courses])


def row_heights_m(courses, levels, clearance_m):
    """Heights of target rows above the bottom, and the course of each row.

    Rows are at the Gauss levels of every course. Rows nearer to a weld than the clearance are moved
    to the clearance. A course too low for the clearance has one row in the middle.

    Parameters
    ----------
    courses : sequence of Course
    levels : int
        Number of Gauss levels per course.
    clearance_m : float
        Smallest distance from a weld.

    Returns
    -------
    heights : ndarray, shape (rows,)
        m.
    index : ndarray of int, shape (rows,)
        Index of the course.
    """
    joints = joints_of(courses)
    heights, index = [], []
    for number, (low, high) in enumerate(pairwise(joints)):
        room = high - low - 2 * clearance_m
        rows = panels([low, high], levels)[0] if room > 0 else np.array([(low + high) / 2])
        rows = np.clip(rows, low + min(clearance_m, (high - low) / 2), None)
        rows = np.unique(np.minimum(rows, max(high - clearance_m, (low + high) / 2)))
        rows = rows[np.append(True, np.diff(rows) >= TOUCH_M)]
        heights.append(rows)
        index.append(np.full(len(rows), number))
    return np.concatenate(heights), np.concatenate(index)


def plate_m(course, outside):
    """Thickness of plate and paint between the nominal inside radius and the observer; 0 inside."""
    return course.thickness_m + course.paint_m if outside else 0.0


def bases_of(table, bars):
    """Return the `Base`s of the rows of a plan's stadia.csv; () if it has no rows.

    Parameters
    ----------
    table : ColumnValues or None
    bars : dict
        {name: {key: value}} of the stadias in the instruments.
    """
    if not has_rows(table):
        return ()
    columns = (table.of("setup"), table.of("to"), bars_used(table, bars))
    columns += table.of("s_arcsec"), table.of("readings"), table.rows
    return tuple(
        Base(setup, to, bar, sd * ARCSEC, int(readings or 1), row)
        for setup, to, bar, sd, readings, row in zip(*columns, strict=True)
    )


def base_m(plan, base):
    """Nominal horizontal length of a Base of a Plan, m."""
    points = plan.points
    return float(np.hypot(*(points[base.to] - points[base.setup])[:2]))


def angle_of_base_rad(plan, base):
    """Angle between the ends of the bar of a Base at its nominal length, rad."""
    return float(angle_of_distance_rad(base_m(plan, base), plan.bars[base.bar]))


def base_sd_m(plan, base):
    """Standard deviation of the distance from one reading of a Base, m."""
    return float(
        distance_sd_m(angle_of_base_rad(plan, base), plan.bars[base.bar], base.angle_sd_rad)
    )


def readings_of_bases(plan, point_names):
    """Return the `Readings`, without values, of bases between the points `there`; () if no base.

    Repeated readings of a base are one value with the standard deviation of their mean.
    """
    bases = [base for base in plan.bases if {base.setup, base.to} <= point_names]
    if not bases:
        return ()
    n = len(bases)
    return (
        Readings(
            table="distances",
            value=np.zeros(n),
            sd=np.array([base_sd_m(plan, base) / np.sqrt(base.readings) for base in bases]),
            start=tuple(base.setup for base in bases),
            end=tuple(base.to for base in bases),
            check=np.zeros(n, dtype=bool),
            instrument=tuple(base.bar for base in bases),
            horizontal=np.ones(n, dtype=bool),
            temperature_c=np.full(n, np.nan),
            rows=tuple(base.row for base in bases),
            sheet=STADIA_FILE,
        ),
    )


def group_by_ends(bases):
    """Group `Base`s by their two ends, whichever end each is read from: {names of ends: bases}."""
    groups = {}
    for base in bases:
        ends = (base.setup, base.to)
        groups.setdefault(ends[::-1] if ends[::-1] in groups else ends, []).append(base)
    return groups


def new_bases(plan):
    """Return possible new pairs of `Base`s, read from both ends; () if the plan has no stadia.

    Each pair connects two set-ups that sight each other and have no base yet.
    """
    if not plan.bars:
        return ()
    template = plan.bases[0] if plan.bases else Base("", "", next(iter(plan.bars)), NEW_SD_RAD)
    connected = {frozenset((base.setup, base.to)) for base in plan.bases}
    pairs = {}
    for setup in plan.setups:
        for other in setup.sights:
            pairs.setdefault(frozenset((setup.name, other)), (setup.name, other))
    return tuple(
        tuple(replace(template, setup=a, to=b, row=None) for a, b in (ends, ends[::-1]))
        for key, ends in pairs.items()
        if key not in connected
    )
