"""Gap between a board laid over a weld and the wall, from a profile, with its uncertainty.

e(s) is the deviation of the wall from a circle along the arc, or from a straight line up the wall.
It is positive outwards; s is the distance from the weld. A board of length b touches the wall with
both ends, and the gap is

    g(s) = e(s) - [e(-b/2) + e(b/2)] / 2 - s [e(b/2) - e(-b/2)] / b

A shift or a tilt of the profile cancels. The errors that all points of a scan share (offset, scale
and registration) therefore cancel to first order. Source: docs/inspection.md.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

BOARD_M = 0.914  # length of the board, 36 in
REACH_M = 0.150  # distance from the weld within which the largest gap is searched for
UNCERTAIN = 0.25  # largest u of a determined gap, as a share of its limit
END_M = 0.04  # half width of the zone at an end of the board that is fitted by a straight line
HOLE_M = 0.06  # largest distance between cells near the weld; a wider hole may hide the peak
STEP_M, STEEP = 0.010, 0.4  # largest step between cells and largest slope of a wall
BEAD_M = 0.02  # half the width of a bead
BESIDE_M = 0.0375  # width of the wall on either side of a bead that is extrapolated under it
MISSED = 2.0  # second difference over the largest error of a cell mean or of a bridge


def board_gap(s_m, e_m, board_m=BOARD_M):
    """Gaps between a profile and a board whose ends lie on it.

    Parameters
    ----------
    s_m, e_m : ndarray, shape (n,)
        Distances from the weld, ascending, and deviations of the wall there, m. Between two
        places the wall is taken as straight.
    board_m : float, optional
        Length of the board, m.

    Returns
    -------
    ndarray, shape (n,)
        Gaps, positive outwards, m; nan beyond the ends of the board.

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
    """Gaps at the cells of a profile; nan where a gap is not determined.

    Attributes
    ----------
    gap_m : ndarray, shape (n,)
        Gaps, positive outwards, m.
    noise_m2 : ndarray, shape (n,)
        Variance of the gaps from the noise of the cells, m2.
    missed_m2 : ndarray, shape (n,)
        Variance of the gaps from the unresolved form of the wall in and between cells, m2.
    """

    gap_m: np.ndarray
    noise_m2: np.ndarray
    missed_m2: np.ndarray


def gaps_of_profile(s_m, e_m, sd_m, *, board_m=BOARD_M, reach_m=REACH_M, has_bead=False):
    """Compute the `BoardGaps` of a profile of cells, or None if no board can be laid over it.

    A board requires three things: no hole near the weld, cells on both sides of each end, and no
    step. A step shows an object on the wall.

    The wall at an end of the board is a straight line through the cells beside the end. The mean
    of a cell misses a part of a form that bends within the cell. The second difference of the cell
    and its neighbours, less their noise, bounds this part. The part is a third of the second
    difference for a ridge in the middle of a cell, all of it for a ridge between two cells, and a
    twelfth for a smooth form. A uniform distribution up to a half is assumed.

    Parameters
    ----------
    s_m, e_m, sd_m : ndarray, shape (n,)
        Middles of cells, ascending, equally spaced, 0 at the weld; deviations of the wall, nan if
        unknown; standard deviations of the deviations, m.
    board_m, reach_m : float, optional
        Length of the board; distance from the weld within which no hole is allowed, m.
    has_bead : bool, optional
        Whether a bead hides the weld. If so, the wall under the bead is extrapolated from both
        sides.

    Returns
    -------
    BoardGaps or None

    Examples
    --------
    >>> s = np.linspace(-0.55, 0.55, 89)
    >>> gaps = gaps_of_profile(s, 0.008 * np.exp(-abs(s) / 0.15), np.full(89, 2e-4))
    >>> round(float(np.nanmax(gaps.gap_m)), 5), round(float(gaps.noise_m2[44] ** 0.5), 6)
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
    # Unknown cells have weight 0; their nan must not enter the products.
    e = np.where(known, e_m, 0.0)
    variance = np.where(known, sd_m, 0.0) ** 2
    gap, missed = np.full((2, len(s_m)), np.nan)
    within = (known | bead) & (np.abs(s_m) <= board_m / 2 + 1e-9)
    gap[within] = (weights @ e)[within]
    # Variance a^2 / 3 of a uniform distribution of half width a, the second difference / MISSED.
    missed[known] = _second_differences(s_m[known], e[known], variance[known]) / MISSED**2 / 3
    if bead.any():
        missed[bead] = _extrapolation_squares(s_m, e, bead, known, gap) / MISSED**2 / 3
    # The gap contains half of each end, hence a quarter of the variance of each end.
    ends = [float(np.nanmean(missed[np.abs(s_m - at) <= END_M])) for at in _board_ends(board_m)]
    missed = np.where(within, missed + sum(ends) / 4, np.nan)
    return BoardGaps(gap, np.where(within, weights**2 @ variance, np.nan), missed)


def bead_height(s_m, gap_m):
    """Height of a bead above the wall, which is extrapolated from both sides of the bead, m.

    Parameters
    ----------
    s_m, gap_m : ndarray, shape (n,)
        Middles of cells, and medians of the gaps of many boards there; nan if unknown.

    Returns
    -------
    float
        Height with its sign; 0 if the cells do not determine it.
    """
    bead = np.abs(s_m) <= BEAD_M + 1e-9
    known = np.isfinite(gap_m)
    if not (known & bead).any() or (rows := _bridges(s_m, known & ~bead, bead)) is None:
        return 0.0
    off = gap_m[bead] - rows @ np.where(known, gap_m, 0.0)
    return float(off[np.nanargmax(np.abs(off))])


def _board_ends(board_m):
    """Places of the two ends of the board, m."""
    return -board_m / 2, board_m / 2


def _has_no_hole(s_m, cell, reach_m):
    """Whether cells cover the reach on both sides of the weld without a hole."""
    near = s_m[np.abs(s_m) <= reach_m + cell]
    if len(near) < 3 or near[0] > cell - reach_m or near[-1] < reach_m - cell:
        return False
    return np.diff(near).max() <= max(HOLE_M, 1.5 * cell)


def _has_step(s_m, e_m, board_m):
    """Whether the wall under a board rises within two cells by more than a plate can."""
    inside = np.abs(s_m) <= board_m / 2 + END_M
    s, e = s_m[inside], e_m[inside]
    return any(
        np.any(np.abs(e[by:] - e[:-by]) > np.maximum(STEP_M, STEEP * (s[by:] - s[:-by])))
        for by in (1, 2)
    )


@lru_cache(maxsize=512)
def _weights(s_bytes, known_bytes, bead_bytes, board_m):
    """Weights (n, n) of the deviations in the gaps, or None if an end of the board has no cells.

    The weights are cached because most boards have the same known cells.
    """
    s = np.frombuffer(s_bytes)
    known, bead = np.frombuffer(known_bytes, dtype=bool), np.frombuffer(bead_bytes, dtype=bool)
    cell = s[1] - s[0]
    lines = [_line_at(s, known, at, max(END_M, 1.5 * cell)) for at in _board_ends(board_m)]
    if any(line is None for line in lines):
        return None
    weights = np.diag(known.astype(float))
    if bead.any():
        rows = _bridges(s, known, bead)
        if rows is None:
            return None
        weights[bead] = rows
    low, high = lines
    # g(s) of the module's docstring, with the two ends as straight lines.
    return weights - (low + high) / 2 - s[:, None] * (high - low) / board_m


def _line_at(s, known, at, reach):
    """Weights (n,) of the value of a straight line at `at`, or None without points around it."""
    is_near = known & (np.abs(s - at) <= reach + 1e-9)
    x = s[is_near] - at
    if len(x) < 2 or x[0] > 1e-9 or x[-1] < -1e-9:
        return None
    weights = np.zeros(len(s))
    weights[is_near] = _line_weights(x, 0.0)
    return weights


def _line_weights(x, at):
    """Weights of the value at `at` of the least-squares line through values at x."""
    off = x - x.mean()
    return 1 / len(x) + (at - x.mean()) * off / (off @ off)


def _bridges(s, known, bead):
    """Weights (bead cells, n) of the wall under a bead, or None if a side has too few cells.

    The wall is the mean of the two straight lines extrapolated from both sides.
    """
    cell = s[1] - s[0]
    wide = max(BESIDE_M, 2 * cell) + 1e-9
    low, high = s[bead].min() - cell / 2, s[bead].max() + cell / 2
    sides = known & (s < low) & (s > low - wide), known & (s > high) & (s < high + wide)
    if any(np.count_nonzero(side) < 2 for side in sides):
        return None
    weights = np.zeros((np.count_nonzero(bead), len(s)))
    for row, at in zip(weights, s[bead], strict=True):
        for side in sides:
            row[side] = _line_weights(s[side], at) / 2
    return weights


def _second_differences(s, e, variance):
    """Squares (n,) of the deviations from the line between the two neighbours, less noise."""
    squares = np.zeros(len(s))
    if len(s) < 3:
        return squares
    part = (s[1:-1] - s[:-2]) / (s[2:] - s[:-2])
    deviation = e[1:-1] - (1 - part) * e[:-2] - part * e[2:]
    noise = variance[1:-1] + (1 - part) ** 2 * variance[:-2] + part**2 * variance[2:]
    squares[1:-1] = np.maximum(deviation**2 - noise, 0.0)
    squares[[0, -1]] = squares[[1, -2]]
    return squares


def _extrapolation_squares(s, e, bead, known, gap):
    """Squares (bead cells,) of the gaps under the bead less the mean gap beside it."""
    at = s[bead]
    beside = np.array([gap[known & (s < at[0])][-1], gap[known & (s > at[-1])][0]])
    return (gap[bead] - beside.mean()) ** 2
