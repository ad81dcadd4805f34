"""Positions relative to the tank: arc along the wall, distance off it, height above the bottom."""

from dataclasses import dataclass

import numpy as np

from tankcal.planning.patterns import full_turn, joints_of, plate_m


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
    return Place(float(arc), float(azimuth), float(off if shell.outside else -off), height)


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
    courses, outside = plan.job.courses, plan.shell.outside
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
