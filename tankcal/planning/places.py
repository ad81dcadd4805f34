"""Geometry of a planned tank: positions relative to the wall, joints, rows of targets, plates."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.quadrature import panels

TOUCH_M = 0.02  # smallest distance between two target rows
ROUNDING_RAD = 1e-8  # rounding error of a full turn


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

    Returns
    -------
    Place
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

    Parameters
    ----------
    plan : Plan

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

    Parameters
    ----------
    plan : Plan

    Returns
    -------
    ndarray, shape (courses + 1,)
        m.
    """
    return joints_of(plan.job.courses)


def full_turn(angle_rad):
    """Reduce angles to 0 to 2 pi; a full turn within rounding becomes 0.

    Parameters
    ----------
    angle_rad : array_like
        Angles, rad.

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
