"""Truth of walls for inspections: radii about the own centre, centres and the plumb of a wall.

The walls are those of `generated_walls` (and cylinders), whose forms the package does not know. The
own centre of a level is where its first harmonic is taken off, by dense sums.
"""

import numpy as np
from generated_walls import FULL_TURN, LEAN, GeneratedWall

from tankcal.geometry.shell import course_of

DENSE = 2880


def cylinder(radius_m=6.5, courses=5, course_m=1.9):
    """A wall without any departure."""
    return GeneratedWall(radius_m, courses, course_m)


def true_radii(wall, height_m, azimuth):
    """(n,) radii about the axis at a height."""
    course = int(course_of(height_m, wall.course_m * np.arange(wall.courses + 1)))
    zeta = 2 * (height_m / wall.course_m - course) - 1
    full = np.full(len(azimuth), zeta)
    return wall.radius_at(np.full(len(azimuth), course), full, np.asarray(azimuth))


def true_level(wall, height_m, azimuth, lean=LEAN):
    """(n,) radii about the own centre of a level, and (x, y) of it."""
    dense = FULL_TURN * np.arange(DENSE) / DENSE
    radius = true_radii(wall, height_m, dense)
    turn = np.stack([np.sin(dense), np.cos(dense)])
    off = 2 * turn @ radius / DENSE
    own = true_radii(wall, height_m, azimuth) - off @ np.stack([np.sin(azimuth), np.cos(azimuth)])
    return own, off + height_m * np.array(lean)


def true_plumb(wall, low_m, high_m, azimuth, lean=LEAN):
    """(n,) departures of the upper level from the plumb of the lower, outwards."""
    along = np.stack([np.sin(azimuth), np.cos(azimuth)])
    apart = true_radii(wall, high_m, azimuth) - true_radii(wall, low_m, azimuth)
    return apart + (high_m - low_m) * np.array(lean) @ along
