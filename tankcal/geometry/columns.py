"""Columns of rejected points of which a survey cannot tell whether they are wall or a fitting.

A narrow seam that one column of points meets looks as a pipe does: points one above another, all as
far off the wall, and sound wall beside them. What tells them apart is what is seen around: plate is
never steeper than one in one, so that wall close beside a column says that it is none; wall that is
seen between its points says that too. A column far off is a fitting. Even one that is wall for sure
(it stands behind the rest) may be narrower than the wall that is seen beside it: how much it is
worth is no better known.
"""

import numpy as np
import scipy

from tankcal.geometry.patches import find_patches

LINK_M = 0.2, 4.0  # along the arc and upwards, between points of a column
FEWEST, SHORTEST_M = 2, 0.7  # points of a column, and its height
SLENDER = 2.0  # it is so many times as tall as wide
FARTHEST_M = 0.080  # from the wall: what is farther off is no form of a wall
STEEPEST = 1.0  # slope of a plate
SIGMA, LEAST = 3.0, 5.0  # of the scatter of the wall: a doubt of it; what chance does not set aside
DENIED = 0.1  # of the points of a column: so many on the wall beside or between them deny it
NONE = -1


def find_columns(place_m, departure_m, rejected, noise_m, turn_m):
    """Number the columns of rejected points that may be wall as well as a fitting.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Along the arc and upwards, m.
    departure_m : ndarray, shape (n,)
        From the wall without the rejected points, m.
    rejected : ndarray of bool, shape (n,)
    noise_m : float
        Scatter of the wall (standard deviation), m.
    turn_m : float
        Once around, along the arc, m.

    Returns
    -------
    ndarray of int, shape (n,)
        From 0; -1 of points in no column.

    Examples
    --------
    A column 40 mm off with the next points at 0.6 m, and one with the wall seen at 20 mm:

    >>> x, z = np.meshgrid([0.0, 0.6, 1.2, 1.8, 2.4, 2.42, 3.0], np.arange(5.0))
    >>> off = np.where((x == 0.6) | (x == 2.4), -0.04, 0.0).ravel()
    >>> place = np.column_stack([x.ravel(), z.ravel()])
    >>> found = find_columns(place, off, off < 0, 0.001, 40.0)
    >>> int(found.max()), [float(one) for one in np.unique(place[found == 0, 0])]
    (0, [0.6])
    """
    found, count = np.full(len(rejected), NONE), 0
    if np.count_nonzero(rejected) < FEWEST:
        return found
    place = _cut_where_nothing_is(place_m, rejected, turn_m)
    for sign in (-1, 1):
        depth = sign * departure_m
        for column in _columns(place, np.flatnonzero(rejected & (depth > 0))):
            if not LEAST * noise_m < np.median(depth[column]) <= FARTHEST_M:
                continue
            if _denials(place, depth, column, ~rejected, noise_m) > DENIED * len(column):
                continue
            found[column] = count
            count += 1
    return found


def _cut_where_nothing_is(place_m, rejected, turn_m):
    """Places whose arc begins in the widest gap between rejected points."""
    arc = np.sort(place_m[rejected, 0] % turn_m)
    gaps = np.diff(arc, append=arc[0] + turn_m)
    widest = int(np.argmax(gaps))
    place = place_m.copy()
    place[:, 0] = (place_m[:, 0] - arc[widest] - gaps[widest] / 2) % turn_m
    return place


def _columns(place_m, members):
    """Arrays of members that hang together, tall and slender."""
    patches = find_patches(place_m, members, LINK_M, FEWEST)
    return [one for one in patches if _is_tall(*np.ptp(place_m[one], axis=0))]


def _is_tall(width_m, height_m):
    return height_m >= max(SHORTEST_M, SLENDER * width_m)


def _denials(place_m, depth, column, accepted, noise_m):
    """Number of points nearer to the wall than a plate through the column could be."""
    arc, height = place_m.T
    reach = depth[column].max() / STEEPEST
    low, high = place_m[column].min(axis=0), place_m[column].max(axis=0)
    near = accepted & (arc > low[0] - reach) & (arc < high[0] + reach)
    near = np.flatnonzero(near & (height >= low[1]) & (height <= high[1]))
    if not len(near):
        return 0
    scale = np.array([1.0, reach / LINK_M[1]])  # the nearest across counts, and the height little
    nearest = scipy.spatial.cKDTree(place_m[column] * scale).query(place_m[near] * scale)[1]
    own = column[nearest]
    least = depth[own] - STEEPEST * np.abs(arc[near] - arc[own]) - SIGMA * noise_m
    return np.count_nonzero(depth[near] < least)
