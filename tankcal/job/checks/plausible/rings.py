"""Level rings of points against the joints of the courses."""

import numpy as np

from tankcal.job.checks.common import course_heights
from tankcal.job.checks.geometry import MIN_POINTS_PER_COURSE, places_of
from tankcal.job.plausibility import LEVEL_M, MOST_RINGS, NEAR_JOINT_M, RING_GAP_M
from tankcal.messages import message


def check_rings(values, points, courses, log):
    """Rings are surveyed on plates: one at a joint speaks of wrong heights, or of their order."""
    bottom = values["datum"]["bottom_z_m"]
    heights = course_heights(courses)
    if points is None or bottom is None or heights is None or len(heights) < 2:
        return
    rings = _rings(places_of(points)[:, 2]) - bottom
    if not len(rings):
        return
    joints = np.cumsum(heights)[:-1]
    near, at = _nearest(rings, joints)
    if near > NEAR_JOINT_M:
        return
    hint = message("heights_right", "are the heights of the courses and datum.bottom_z_m right?")
    if _nearest(rings, np.cumsum(heights[::-1])[:-1])[0] > 2 * NEAR_JOINT_M:
        hint = message("from_top_down", "do the courses stand from the top down?")
    text = message(
        "ring_on_joint",
        "a ring of points lies {near_mm:.0f} mm from the joint above course {course}, which is"
        " {joint_m:.4g} m above datum.bottom_z_m; expected rings on plates: {hint}",
        near_mm=1000 * near,
        course=courses.of("course")[at],
        joint_m=joints[at],
        hint=hint,
    )
    log.warning(courses.file, text, courses.rows[at], "height_m")


def _nearest(rings, joints):
    """Smallest distance of a ring from a joint, and the place of that joint."""
    away = np.abs(rings[:, None] - joints).min(axis=0)
    return float(away.min()), int(away.argmin())


def _rings(z):
    """Heights of level rings; none where the points do not lie in rings."""
    z = np.sort(z)
    parts = np.split(z, np.flatnonzero(np.diff(z) > RING_GAP_M) + 1)
    level = [part for part in parts if len(part) >= MIN_POINTS_PER_COURSE]
    if len(level) > MOST_RINGS or any(np.ptp(part) > LEVEL_M for part in level):
        return np.zeros(0)
    return np.array([np.median(part) for part in level])
