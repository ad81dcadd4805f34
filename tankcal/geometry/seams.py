"""Distinction of narrow seams from pipes: tall strips that depart from the smooth form of a shell.

A seam continues the wall: between the wall and its greatest depth there are points of every depth,
whatever its profile (a cosine, a cusp, or flat with flanks). A pipe, a bar or a tray has a jump.
The visible side of a pipe departs by at least half its crest, since the crest is a diameter or more
from the wall. For the same reason, a pipe is never wider than the distance of its crest.
"""

import numpy as np

from tankcal.geometry.patches import find_patches

LINK_M = 0.1, 4.0  # largest distances across and along a strip, between its points
FEWEST = 8  # least number of points of a strip
TALLEST_M, SLENDER = 1.2, 2.0  # least height of a strip, and least ratio of height to width
WIDER = 1.5  # least ratio of width to depth of a seam: no pipe reaches it
DEPTH = 0.9  # quantile of the departures in a strip that counts as its depth
FLANK = 0.15, 0.6  # range of relative depths of the flank, where a pipe has hardly any point
SIGMA = 3.0  # standard deviations of the wall within which its scatter hides the flank
LEAST_SHARE = 0.25  # points in the flank, relative to evenly distributed depths
DEEPER = 1.4  # departures above 1.4 times the depth do not belong to the seam


def find_seams(place_m, departure_m, rejected, noise_m):
    """Mark points that belong to a narrow seam of the wall.

    A strip is a group of connected rejected points whose departures have the same sign, at least
    1.2 m tall. A strip is a seam if its width exceeds 1.5 times its depth and it has points of
    every depth. Its flank, from 0.15 to 0.6 of the depth, must contain at least a quarter of the
    points expected for evenly distributed depths. The part of the flank within the scatter of the
    wall is excluded from this test. All points of a seam are marked, including those of its flanks.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Positions along the arc and upwards, m.
    departure_m : ndarray, shape (n,)
        Departures from the smooth form of the shell, fitted without the rejected points, m.
    rejected : ndarray of bool, shape (n,)
    noise_m : float
        Scatter of the wall about that form (standard deviation), m.

    Returns
    -------
    ndarray of bool, shape (n,)

    Examples
    --------
    A groove of 40 mm, 0.4 m wide, and a pipe that is 60 mm off:

    >>> x, z = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 4, 201), np.linspace(0, 4, 21)))
    >>> groove = 0.04 * np.maximum(1 - abs(x - 1) / 0.2, 0)
    >>> pipe = 0.06 * (abs(x - 3) < 0.06)
    >>> in_seam = find_seams(np.column_stack([x, z]), pipe - groove, groove + pipe > 0.013, 0.001)
    >>> int(in_seam[groove > 0.013].sum()), int(in_seam[pipe > 0].sum())
    (273, 0)
    """
    in_seam = np.zeros(len(rejected), dtype=bool)
    order = np.argsort(place_m[:, 0], kind="stable")
    arc = place_m[order, 0]
    for sign in (-1, 1):
        depth = sign * departure_m
        for strip in _find_strips(place_m, np.flatnonzero(rejected & (depth > 0))):
            # Neighbourhood of twice the width of the strip, over its height: it contains the
            # flanks.
            begin, end = np.ptp(place_m[strip, 0]) * np.array([-1, 1]) + place_m[strip, 0].mean()
            neighbours = order[np.searchsorted(arc, begin) : np.searchsorted(arc, end)]
            foot, top = place_m[strip, 1].min(), place_m[strip, 1].max()
            neighbours = neighbours[
                (place_m[neighbours, 1] >= foot) & (place_m[neighbours, 1] <= top)
            ]
            # A quantile is robust against single points in front of the seam.
            deepest = np.quantile(depth[strip], DEPTH)
            if _is_seam(place_m[strip], depth[neighbours], deepest, noise_m):
                in_seam[neighbours[np.abs(depth[neighbours]) < DEEPER * deepest]] = True
    return in_seam


def _find_strips(place_m, members):
    """Return index arrays of connected members that are tall and slender."""
    strips = find_patches(place_m, members, LINK_M, FEWEST)
    return [strip for strip in strips if _is_slender(*np.ptp(place_m[strip], axis=0))]


def _is_slender(width_m, height_m):
    """Whether a group of points has the proportions of a strip."""
    return height_m >= max(TALLEST_M, SLENDER * width_m)


def _is_seam(strip_m, depth, deepest, noise_m):
    """Whether a strip (k, 2) is a seam; depth (j,) of all points around it."""
    arc, height = (strip_m - strip_m.mean(axis=0)).T
    # Remove the regression line over the height: a leaning strip appears wider than it is.
    straightened = arc - height * (arc @ height) / (height @ height)
    if np.ptp(straightened) < WIDER * deepest:
        return False
    least, most = max(FLANK[0] * deepest, SIGMA * noise_m), FLANK[1] * deepest
    if least >= most:
        return True
    # Expected count for evenly distributed depths: proportional to the depth range of the flank.
    flank = np.count_nonzero((depth > least) & (depth < most))
    return flank >= LEAST_SHARE * (most - least) / deepest * np.count_nonzero(depth > least)
