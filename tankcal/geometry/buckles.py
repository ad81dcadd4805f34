"""Buckles told from clutter: rejected points that agree with their neighbours along the wall.

A buckle is wall, however deep: where it is, nothing of the sound wall is seen. What stands before a
wall (steps of a stair, a pipe, the rim of a nozzle) is narrow, or leaves the wall to be seen
between its parts.
"""

import numpy as np
import scipy

from tankcal.geometry.patches import find_patches

LINK_M = 2.5  # along the wall, between points of one patch
NARROWEST_M, SHORTEST_M = 0.4, 0.8  # of a patch, across and along it: smaller ones are no buckle
FEWEST = 3


def find_buckles(place_m, departure_m, rejected):
    """Mark rejected points that are a buckle of the wall.

    Rejected points of one sign that hang together are a buckle when they cover 0.8 m by 0.4 m of
    the wall at least, in any direction, and no other point lies within their convex hull.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Along the arc and upwards, m.
    departure_m : ndarray, shape (n,)
        From the smooth form of the shell, fitted without the rejected points, m.
    rejected : ndarray of bool, shape (n,)

    Returns
    -------
    ndarray of bool, shape (n,)

    Examples
    --------
    Nine points 30 mm behind a wall that is seen all around them:

    >>> x, z = (one.ravel() for one in np.meshgrid(np.arange(8.0), np.arange(8.0)))
    >>> departure = -0.03 * (abs(x - 4) < 1.5) * (abs(z - 4) < 1.5)
    >>> found = find_buckles(np.column_stack([x, z]), departure, departure < 0)
    >>> int(found.sum())
    9
    """
    found = np.zeros(len(rejected), dtype=bool)
    for sign in (-1, 1):
        chosen = np.flatnonzero(rejected & (sign * departure_m > 0))
        for patch in find_patches(place_m, chosen, LINK_M, FEWEST):
            found[patch] = _is_buckle(place_m[patch], np.delete(place_m, patch, axis=0))
    return found


def _is_buckle(patch_m, others_m):
    axes = np.linalg.svd(patch_m - patch_m.mean(axis=0), full_matrices=False)[2]
    long, wide = np.ptp(patch_m @ axes.T, axis=0)
    if wide < NARROWEST_M or long < SHORTEST_M:
        return False
    return not np.any(scipy.spatial.Delaunay(patch_m).find_simplex(others_m) >= 0)
