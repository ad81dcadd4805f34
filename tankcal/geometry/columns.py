"""Columns of rejected points that may belong to the wall or to a fitting.

A column of points on a narrow seam looks like a pipe: points one above another, at equal distances
from the wall, with regular wall on both sides. The surrounding points distinguish seam and pipe:
the slope of a plate never exceeds one in one, so wall close beside a column shows that the column
is a fitting. Wall between the points of a column shows this as well. A column far from the wall is
a fitting. Even a column that certainly belongs to the wall (because it lies behind the other
points) may be narrower than the wall visible beside it: its contribution is equally uncertain.
"""

import numpy as np
import scipy

from tankcal.geometry.patches import find_patches

LINK_M = 0.2, 4.0  # largest distances along the arc and upwards, between points of a column
FEWEST, SHORTEST_M = 2, 0.7  # least number of points of a column, and its least height
SLENDER = 2.0  # least ratio of height to width of a column
FARTHEST_M = 0.080  # distance from the wall beyond which a column is a fitting
STEEPEST = 1.0  # largest slope of a plate
# In standard deviations of the wall: tolerance of a contradiction; least departure of a column.
SIGMA, LEAST = 3.0, 5.0
DENIED = 0.1  # share of contradicting wall points, over the points of a column, that it tolerates
NONE = -1  # number of points outside all columns


def find_columns(place_m, departure_m, rejected, noise_m, turn_m):
    """Number the columns of rejected points that may belong to the wall or to a fitting.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Positions along the arc and upwards, m.
    departure_m : ndarray, shape (n,)
        Departures from the wall, fitted without the rejected points, m.
    rejected : ndarray of bool, shape (n,)
    noise_m : float
        Scatter of the wall (standard deviation), m.
    turn_m : float
        Circumference along the arc, m.

    Returns
    -------
    ndarray of int, shape (n,)
        Number of the column, from 0; -1 for points in no column.

    Examples
    --------
    A column 40 mm off with the next points at 0.6 m, and x with the wall seen at 20 mm:

    >>> x, z = np.meshgrid([0.0, 0.6, 1.2, 1.8, 2.4, 2.42, 3.0], np.arange(5.0))
    >>> off = np.where((x == 0.6) | (x == 2.4), -0.04, 0.0).ravel()
    >>> place = np.column_stack([x.ravel(), z.ravel()])
    >>> number = find_columns(place, off, off < 0, 0.001, 40.0)
    >>> int(number.max()), [float(x) for x in np.unique(place[number == 0, 0])]
    (0, [0.6])
    """
    numbers, count = np.full(len(rejected), NONE), 0
    if np.count_nonzero(rejected) < FEWEST:
        return numbers
    place = _cut_at_gap(place_m, rejected, turn_m)
    for sign in (-1, 1):
        depth = sign * departure_m
        # A shallow column may be chance, a deep column is certainly a fitting: neither is
        # ambiguous.
        for column in _find_candidates(place, np.flatnonzero(rejected & (depth > 0))):
            if not LEAST * noise_m < np.median(depth[column]) <= FARTHEST_M:
                continue
            if _count_contradictions(place, depth, column, ~rejected, noise_m) > DENIED * len(
                column
            ):
                continue
            numbers[column] = count
            count += 1
    return numbers


def _cut_at_gap(place_m, rejected, turn_m):
    """Return positions whose arc begins in the widest gap between rejected points.

    No column is then cut in two by the origin of the arc.
    """
    arc = np.sort(place_m[rejected, 0] % turn_m)
    gaps = np.diff(arc, append=arc[0] + turn_m)
    widest = int(np.argmax(gaps))
    place = place_m.copy()
    place[:, 0] = (place_m[:, 0] - arc[widest] - gaps[widest] / 2) % turn_m
    return place


def _find_candidates(place_m, members):
    """Return index arrays of connected members that are tall and slender."""
    patches = find_patches(place_m, members, LINK_M, FEWEST)
    return [patch for patch in patches if _is_tall(*np.ptp(place_m[patch], axis=0))]


def _is_tall(width_m, height_m):
    """Whether a group of points has the proportions of a column."""
    return height_m >= max(SHORTEST_M, SLENDER * width_m)


def _count_contradictions(place_m, depth, column, accepted, noise_m):
    """Return the number of accepted points closer to the wall than a plate allows."""
    arc, height = place_m.T
    # Beyond this distance along the arc, even the steepest plate has returned to the wall.
    reach = depth[column].max() / STEEPEST
    lowest, highest = place_m[column].min(axis=0), place_m[column].max(axis=0)
    neighbours = accepted & (arc > lowest[0] - reach) & (arc < highest[0] + reach)
    neighbours = np.flatnonzero(neighbours & (height >= lowest[1]) & (height <= highest[1]))
    if not len(neighbours):
        return 0
    # The slope of a plate concerns the distance along the arc: heights have little weight.
    scale = np.array([1.0, reach / LINK_M[1]])
    nearest = scipy.spatial.cKDTree(place_m[column] * scale).query(place_m[neighbours] * scale)[1]
    partner = column[nearest]
    # Least depth of the wall at a neighbour: the plate descends from the column at the steepest
    # slope.
    least_depth = (
        depth[partner] - STEEPEST * np.abs(arc[neighbours] - arc[partner]) - SIGMA * noise_m
    )
    return np.count_nonzero(depth[neighbours] < least_depth)
