"""Narrow seams told from pipes: tall strips that depart from the smooth form of a shell.

A seam leads on from the wall: between the wall and its greatest depth there are points of every
depth, whether it is a cosine, a cusp, or flat with flanks. A pipe, a bar or a tray jumps: the side
of a pipe that is seen departs by half its crest at least, for the crest is a diameter off the wall
or more. For the same reason a pipe is never wider than its crest is far off.
"""

import numpy as np

from tankcal.geometry.patches import find_patches

LINK_M = 0.1, 4.0  # across and along a strip, between its points
FEWEST = 8  # points of a strip that say anything
TALLEST_M, SLENDER = 1.2, 2.0  # a strip is that tall at least, and that many times its width
WIDER = 1.5  # than its depth: no pipe is
DEPTH = 0.9  # quantile of the departures in a strip
FLANK = 0.15, 0.6  # of the depth, where a pipe has hardly a point
SIGMA = 3.0  # of the scatter of the wall, where its flank begins to be seen
LEAST_SHARE = 0.25  # points in a flank, over points of the strip and its share of the depth
DEEPER = 1.4  # times the depth: what departs by more is not of the seam


def find_seams(place_m, departure_m, rejected, noise_m):
    """Mark points that are of a narrow seam of the wall.

    Rejected points of one sign that hang together up the wall, 1.2 m at least, are a seam when they
    are wider than 1.5 times their depth, and the strip has points of every depth: in its flank,
    from 0.15 to 0.6 of the depth, a quarter at least of what depths evenly taken would put there.
    That part of the flank that the scatter of the wall hides is not asked for. All points of the
    strip are marked then, those of its flanks as well.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Along the arc and upwards, m.
    departure_m : ndarray, shape (n,)
        From the smooth form of the shell, fitted without the rejected points, m.
    rejected : ndarray of bool, shape (n,)
    noise_m : float
        Scatter of the wall about that form (standard deviation), m.

    Returns
    -------
    ndarray of bool, shape (n,)

    Examples
    --------
    A groove of 40 mm, 0.4 m wide, and a pipe that is 60 mm off:

    >>> x, z = (one.ravel() for one in np.meshgrid(np.linspace(0, 4, 201), np.linspace(0, 4, 21)))
    >>> groove = 0.04 * np.maximum(1 - abs(x - 1) / 0.2, 0)
    >>> pipe = 0.06 * (abs(x - 3) < 0.06)
    >>> found = find_seams(np.column_stack([x, z]), pipe - groove, groove + pipe > 0.013, 0.001)
    >>> int(found[groove > 0.013].sum()), int(found[pipe > 0].sum())
    (273, 0)
    """
    found = np.zeros(len(rejected), dtype=bool)
    order = np.argsort(place_m[:, 0], kind="stable")
    arc = place_m[order, 0]
    for sign in (-1, 1):
        depth = sign * departure_m
        for strip in _strips(place_m, np.flatnonzero(rejected & (depth > 0))):
            low, high = np.ptp(place_m[strip, 0]) * np.array([-1, 1]) + place_m[strip, 0].mean()
            beside = order[np.searchsorted(arc, low) : np.searchsorted(arc, high)]
            foot, top = place_m[strip, 1].min(), place_m[strip, 1].max()
            beside = beside[(place_m[beside, 1] >= foot) & (place_m[beside, 1] <= top)]
            deepest = np.quantile(depth[strip], DEPTH)
            if _is_seam(place_m[strip], depth[beside], deepest, noise_m):
                found[beside[np.abs(depth[beside]) < DEEPER * deepest]] = True
    return found


def _strips(place_m, members):
    """Arrays of members that hang together, tall and slender."""
    strips = find_patches(place_m, members, LINK_M, FEWEST)
    return [one for one in strips if _is_slender(*np.ptp(place_m[one], axis=0))]


def _is_slender(width_m, height_m):
    return height_m >= max(TALLEST_M, SLENDER * width_m)


def _is_seam(strip_m, depth, deepest, noise_m):
    """depth (k,) of all points about the strip"""
    arc, height = (strip_m - strip_m.mean(axis=0)).T
    leaning = arc - height * (arc @ height) / (height @ height)
    if np.ptp(leaning) < WIDER * deepest:
        return False
    low, high = max(FLANK[0] * deepest, SIGMA * noise_m), FLANK[1] * deepest
    if low >= high:
        return True
    flank = np.count_nonzero((depth > low) & (depth < high))
    return flank >= LEAST_SHARE * (high - low) / deepest * np.count_nonzero(depth > low)
