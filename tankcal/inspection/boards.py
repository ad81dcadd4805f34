"""The gap of a board laid over a weld, from the profile of the wall, and its uncertainty.

With e(s) the departure of the wall from a circle along the arc, or from a straight line up the
wall, outwards positive and 0 at the weld, and the ends of a board of length b on the wall,

    g(s) = e(s) - [e(-b/2) + e(b/2)] / 2 - s [e(b/2) - e(-b/2)] / b

so that shift and lean of the profile drop out, and with them to first order what all points of a
scan share: offset, scale and registration. Source: docs/inspection.md.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

BOARD_M = 0.914  # 36 in
REACH_M = 0.150  # of the weld, within which the largest gap counts
UNCERTAIN = 0.25  # of the limit: a gap whose u exceeds that is not determined
END_M = 0.04  # on both sides of an end of the board, where the wall is taken for straight
HOLE_M = 0.06  # between places of the wall near the weld; wider, and the peak may lie in it
STEP_M, STEEP = 0.010, 0.4  # no wall rises so much from cell to cell, or is so steep
BEAD_M = 0.02  # half the width of a bead
BESIDE_M = 0.0375  # of the wall beside a bead, that is led on under it
MISSED = 2.0  # over this: of a second difference, what the mean of a cell or a bridge may miss


def board_gap(s_m, e_m, board_m=BOARD_M):
    """Gaps between a profile and a board whose ends lie on it.

    Parameters
    ----------
    s_m, e_m : ndarray, shape (n,)
        Places from the weld, ascending, and departures of the wall there, straight between, m.
    board_m : float, optional
        Length of the board, m.

    Returns
    -------
    ndarray, shape (n,)
        Positive outwards, m; nan beyond the ends.

    Examples
    --------
    >>> s = np.linspace(-0.6, 0.6, 2401)
    >>> [round(float(np.nanmax(board_gap(s, 8 * np.exp(-abs(s) / w)))), 2) for w in (0.1, 0.3)]
    [7.92, 6.26]
    """
    low, high = np.interp([-board_m / 2, board_m / 2], s_m, e_m)
    gap = e_m - (low + high) / 2 - s_m * (high - low) / board_m
    return np.where(np.abs(s_m) <= board_m / 2, gap, np.nan)


@dataclass(frozen=True)
class BoardGaps:
    """Gaps at the places of a profile; nan where they are not determined.

    Attributes
    ----------
    gap_m : ndarray, shape (n,)
        Outwards positive, m.
    noise_m2 : ndarray, shape (n,)
        Variance by the noise of the places that make the gap, m2.
    missed_m2 : ndarray, shape (n,)
        Variance by the form of the wall within and between the cells, m2.
    """

    gap_m: np.ndarray
    noise_m2: np.ndarray
    missed_m2: np.ndarray


def gaps_of_profile(s_m, e_m, sd_m, *, board_m=BOARD_M, reach_m=REACH_M, has_bead=False):
    """`BoardGaps` of a profile of cells; None where it does not bear a board.

    It has no hole near the weld, the wall on both sides of each end, and no step that none but
    something on the wall makes.

    The wall at an end of the board is that of a straight line through the cells beside it. What
    the mean of a cell misses of a form that bends within it is told by the departure of the cell
    from its neighbours (less their noise): of a ridge in the middle of a cell a third of it, of one
    between two cells all, of a smooth one a twelfth. Up to a half counts, each part as likely.

    Parameters
    ----------
    s_m, e_m, sd_m : ndarray, shape (n,)
        Middles of cells, ascending and even, 0 at the weld; departures of the wall, nan: not
        known; their standard deviations, m.
    board_m, reach_m : float, optional
        Length of the board; how far from the weld no hole may be, m.
    has_bead : bool, optional
        Whether a bead hides the weld: the wall under it is led on from both sides.

    Examples
    --------
    >>> s = np.linspace(-0.55, 0.55, 89)
    >>> found = gaps_of_profile(s, 0.008 * np.exp(-abs(s) / 0.15), np.full(89, 2e-4))
    >>> round(float(np.nanmax(found.gap_m)), 5), round(float(found.noise_m2[44] ** 0.5), 6)
    (0.00762, 0.000208)
    """
    cell = float(s_m[1] - s_m[0])
    bead = has_bead & (np.abs(s_m) <= BEAD_M + 1e-9)
    known = np.isfinite(e_m) & ~bead
    if not _has_no_hole(s_m[known | bead], cell, reach_m):
        return None
    if _has_step(s_m[known], e_m[known], board_m):
        return None
    weights = _weights(s_m.tobytes(), known.tobytes(), bead.tobytes(), board_m)
    if weights is None:
        return None
    e = np.where(known, e_m, 0.0)
    variance = np.where(known, sd_m, 0.0) ** 2
    gap, missed = np.full((2, len(s_m)), np.nan)
    within = (known | bead) & (np.abs(s_m) <= board_m / 2 + 1e-9)
    gap[within] = (weights @ e)[within]
    missed[known] = _second_differences(s_m[known], e[known], variance[known]) / MISSED**2 / 3
    if bead.any():
        missed[bead] = _led_on(s_m, e, bead, known, gap) / MISSED**2 / 3
    ends = [float(np.nanmean(missed[np.abs(s_m - at) <= END_M])) for at in _ends(board_m)]
    missed = np.where(within, missed + sum(ends) / 4, np.nan)
    return BoardGaps(gap, np.where(within, weights**2 @ variance, np.nan), missed)


def bead_height(s_m, gap_m):
    """By how much the middle of a weld stands off the wall that is led on from both sides, m.

    Parameters
    ----------
    s_m, gap_m : ndarray, shape (n,)
        Middles of cells and gaps there, as the middle of many boards has them; nan: not known.
    """
    bead = np.abs(s_m) <= BEAD_M + 1e-9
    known = np.isfinite(gap_m)
    if not (known & bead).any() or (rows := _bridges(s_m, known & ~bead, bead)) is None:
        return 0.0
    off = gap_m[bead] - rows @ np.where(known, gap_m, 0.0)
    return float(off[np.nanargmax(np.abs(off))])


def _ends(board_m):
    return -board_m / 2, board_m / 2


def _has_no_hole(s_m, cell, reach_m):
    """Are there places all over the reach of the weld?"""
    near = s_m[np.abs(s_m) <= reach_m + cell]
    if len(near) < 3 or near[0] > cell - reach_m or near[-1] < reach_m - cell:
        return False
    return np.diff(near).max() <= max(HOLE_M, 1.5 * cell)


def _has_step(s_m, e_m, board_m):
    """Does the wall under a board rise faster, within two cells, than a plate does?"""
    inside = np.abs(s_m) <= board_m / 2 + END_M
    s, e = s_m[inside], e_m[inside]
    return any(
        np.any(np.abs(e[by:] - e[:-by]) > np.maximum(STEP_M, STEEP * (s[by:] - s[:-by])))
        for by in (1, 2)
    )


@lru_cache(maxsize=512)
def _weights(s_bytes, known_bytes, bead_bytes, board_m):
    """(n, n) of gaps over departures, None: the board has no ends; boards are alike, mostly."""
    s = np.frombuffer(s_bytes)
    known, bead = np.frombuffer(known_bytes, dtype=bool), np.frombuffer(bead_bytes, dtype=bool)
    cell = s[1] - s[0]
    lines = [_line_at(s, known, at, max(END_M, 1.5 * cell)) for at in _ends(board_m)]
    if any(one is None for one in lines):
        return None
    weights = np.diag(known.astype(float))
    if bead.any():
        rows = _bridges(s, known, bead)
        if rows is None:
            return None
        weights[bead] = rows
    low, high = lines
    return weights - (low + high) / 2 - s[:, None] * (high - low) / board_m


def _line_at(s, known, at, reach):
    """(n,) weights of a straight line's value at a place inside its points; None: it has none."""
    near = known & (np.abs(s - at) <= reach + 1e-9)
    x = s[near] - at
    if len(x) < 2 or x[0] > 1e-9 or x[-1] < -1e-9:
        return None
    found = np.zeros(len(s))
    found[near] = _straight(x, 0.0)
    return found


def _straight(x, at):
    """Weights of the value at a place, of a straight line through values at x."""
    off = x - x.mean()
    return 1 / len(x) + (at - x.mean()) * off / (off @ off)


def _bridges(s, known, bead):
    """(cells of the bead, n) weights of what is led on from both sides; None: a side is missing."""
    cell = s[1] - s[0]
    wide = max(BESIDE_M, 2 * cell) + 1e-9
    low, high = s[bead].min() - cell / 2, s[bead].max() + cell / 2
    sides = known & (s < low) & (s > low - wide), known & (s > high) & (s < high + wide)
    if any(np.count_nonzero(side) < 2 for side in sides):
        return None
    found = np.zeros((np.count_nonzero(bead), len(s)))
    for row, at in zip(found, s[bead], strict=True):
        for side in sides:
            row[side] = _straight(s[side], at) / 2
    return found


def _second_differences(s, e, variance):
    """(n,) squares of what values are off the straight line between neighbours, less noise."""
    found = np.zeros(len(s))
    if len(s) < 3:
        return found
    part = (s[1:-1] - s[:-2]) / (s[2:] - s[:-2])
    off = e[1:-1] - (1 - part) * e[:-2] - part * e[2:]
    noise = variance[1:-1] + (1 - part) ** 2 * variance[:-2] + part**2 * variance[2:]
    found[1:-1] = np.maximum(off**2 - noise, 0.0)
    found[[0, -1]] = found[[1, -2]]
    return found


def _led_on(s, e, bead, known, gap):
    """(cells of the bead,) squares of what leading on adds to the gaps on both sides of it."""
    at = s[bead]
    beside = np.array([gap[known & (s < at[0])][-1], gap[known & (s > at[-1])][0]])
    return (gap[bead] - beside.mean()) ** 2
