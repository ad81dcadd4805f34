"""Distinction of buckles from clutter: rejected points that agree with their neighbours.

A buckle is a part of the wall, however deep: within its outline, no point of the regular wall is
visible. An object in front of the wall (the treads of a stair, a pipe, the rim of a nozzle) is
narrow, or points of the wall are visible between its parts.
"""

import numpy as np
import scipy

from tankcal.geometry.patches import find_patches

LINK_M = 2.5  # largest distance between neighbouring points of a patch, along the wall
NARROWEST_M, SHORTEST_M = 0.4, 0.8  # smallest width and length of a buckle
FEWEST = 3  # smallest number of points in a patch: three points span an area


def find_buckles(place_m, departure_m, rejected):
    """Mark rejected points that belong to a buckle of the wall.

    A patch is a group of connected rejected points whose departures have the same sign. A patch is
    a buckle if it is at least 0.8 m long and 0.4 m wide, in any direction, and no other point lies
    within its convex hull.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Positions along the arc and upwards, m.
    departure_m : ndarray, shape (n,)
        Departures from the smooth form of the shell, fitted without the rejected points, m.
    rejected : ndarray of bool, shape (n,)
        Points that the test rejected.

    Returns
    -------
    ndarray of bool, shape (n,)
        True for points of a buckle.

    Examples
    --------
    Nine points 30 mm behind a wall that is seen all around them:

    >>> x, z = (axis.ravel() for axis in np.meshgrid(np.arange(8.0), np.arange(8.0)))
    >>> departure = -0.03 * (abs(x - 4) < 1.5) * (abs(z - 4) < 1.5)
    >>> buckle = find_buckles(np.column_stack([x, z]), departure, departure < 0)
    >>> int(buckle.sum())
    9
    """
    in_buckle = np.zeros(len(rejected), dtype=bool)
    # An inward and an outward buckle may touch: the signs are treated separately.
    for sign in (-1, 1):
        candidates = np.flatnonzero(rejected & (sign * departure_m > 0))
        for patch in find_patches(place_m, candidates, LINK_M, FEWEST):
            in_buckle[patch] = _is_buckle(place_m[patch], np.delete(place_m, patch, axis=0))
    return in_buckle


def _is_buckle(patch_m, others_m):
    """Whether a patch (k, 2) has the size of a buckle and encloses none of the other points."""
    # Principal axes of the patch: a buckle may run in any direction of the wall.
    axes = np.linalg.svd(patch_m - patch_m.mean(axis=0), full_matrices=False)[2]
    length, width = np.ptp(patch_m @ axes.T, axis=0)
    if width < NARROWEST_M or length < SHORTEST_M:
        return False
    # `find_simplex` returns -1 for points outside the convex hull of the patch.
    return not np.any(scipy.spatial.Delaunay(patch_m).find_simplex(others_m) >= 0)
