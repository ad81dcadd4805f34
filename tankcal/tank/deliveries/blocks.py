"""Blocks of rows, and upper bounds of the uncertainty of deliveries between two blocks.

In a block f = chord + e, with |e| at most s. Thus u between two blocks is at most |chord
difference| + s1 + s2. This bound is convex in the dips, hence largest at the corners of the two
blocks. With d any unit vector, u is at least <chord difference, d> - s1 - s2. Thus w/u, which gives
the effective degrees of freedom (u/w)^4, is below a quasi-convex function, which is also largest at
the corners. s decreases with the square of the length of the block.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.tank.capacity import SAME_M
from tankcal.tank.deliveries.pairs import Rows, ratio_of
from tankcal.uncertainty import coverage_factor

FAN = 4  # number of blocks that form a block of the next level


@dataclass(frozen=True)
class Level:
    """Blocks of rows with their sagittas; kids (b, 4) are blocks of the level below.

    first, last            (b,) first and last row of each block
    kids                   (b, 4) indices of blocks of the level below; -1: none
    u_m3, w_m3, volume_m3  (b,) largest departure of the rows of a block from its chord
    """

    first: np.ndarray
    last: np.ndarray
    kids: np.ndarray
    u_m3: np.ndarray
    w_m3: np.ndarray
    volume_m3: np.ndarray


def levels_of(rows, pieces):
    """Return levels of blocks, from single steps up to one block for each piece of the table."""
    ends = [*pieces, len(rows.height_m)]
    first, last, piece = [], [], []
    for count, (start, stop) in enumerate(pairwise(ends)):
        steps = np.arange(start, max(stop - 1, start + 1))
        first.append(steps)
        last.append(np.minimum(steps + 1, stop - 1))
        piece.append(np.full(len(steps), count))
    first, last, piece = (np.concatenate(parts) for parts in (first, last, piece))
    exact = np.zeros((3, len(first)))  # f and V are linear within a step
    levels = [Level(first, last, np.full((len(first), FAN), -1), *exact)]
    while len(first) > len(pieces):
        starts = np.flatnonzero(np.append(True, piece[1:] != piece[:-1]))
        place = np.arange(len(piece)) - starts[piece]
        first_kids = np.flatnonzero(place % FAN == 0)
        count = np.diff(np.append(first_kids, len(piece)))
        kids = np.where(np.arange(FAN) < count[:, None], first_kids[:, None] + np.arange(FAN), -1)
        first, last, piece = first[first_kids], last[first_kids + count - 1], piece[first_kids]
        levels.append(_build_level(rows, first, last, kids))
    return levels


def _build_level(rows, first, last, kids):
    """Return the `Level` of blocks given by first and last row, with their sagittas."""
    block = np.searchsorted(last, np.arange(len(rows.height_m)))
    begin, end = first[block], last[block]
    length = np.where(end > begin, rows.height_m[end] - rows.height_m[begin], 1.0)
    part = (rows.height_m - rows.height_m[begin]) / length
    chord = rows.volume_m3[begin] + part * (rows.volume_m3[end] - rows.volume_m3[begin])
    slope = rows.factor_m3[end] - rows.factor_m3[begin]
    # Departures of the rows from the chord between the ends of their block.
    u, w = rows.groups.norms(rows.factor_m3 - rows.factor_m3[begin] - part[:, None] * slope)
    largest = np.zeros((3, len(first)))
    for target, departure in zip(largest, (u, w, np.abs(rows.volume_m3 - chord)), strict=True):
        np.maximum.at(target, block, departure)
    return Level(first, last, kids, *largest)


@dataclass(frozen=True)
class Search:
    """Data of a search: rows, first row of each piece, blocks; for U/V or for U."""

    rows: Rows
    pieces: list
    levels: list
    probability: float
    minimum_m: float
    is_relative: bool

    def size(self, U, volume):
        """Return the maximised quantity: U over volume, or U."""
        return ratio_of(U, volume) if self.is_relative else U


def kids_of(level, low, high):
    """Return the pairs of blocks of the level below that make up given pairs.

    Parameters
    ----------
    level : Level
    low, high : ndarray of int, shape (m,)
        Indices of the lower and of the upper block of each pair.

    Returns
    -------
    low, high : ndarray of int
    """
    lower = np.repeat(level.kids[low], FAN, axis=1).ravel()
    upper = np.tile(level.kids[high], FAN).ravel()
    exist = (lower >= 0) & (upper >= 0)
    return lower[exist], upper[exist]


def bounds_of(search, level, low, high):
    """Return upper bounds of deliveries between pairs of blocks, and the best corner.

    Parameters
    ----------
    search : Search
    level : Level
    low, high : ndarray of int, shape (m,)
        Indices of the lower and of the upper block of each pair.

    Returns
    -------
    bounds : ndarray, shape (m,)
        Bound that no delivery between the two blocks exceeds; -1 if none has the minimum height.
    reached : float
        Largest exact size at the corners of the blocks; -1 if none.
    pair : tuple of two float or None
        Dips of that size.
    """
    rows, groups = search.rows, search.rows.groups
    a, b, c, d = level.first[low], level.last[low], level.first[high], level.last[high]
    s_u, s_w = level.u_m3[low] + level.u_m3[high], level.w_m3[low] + level.w_m3[high]
    s_volume = level.volume_m3[low] + level.volume_m3[high]
    f, h, v = rows.factor_m3, rows.height_m, rows.volume_m3
    # Unit vector d of the module docstring: direction between the middles of the two blocks.
    direction = f[c] + f[d] - f[a] - f[b]
    direction /= np.maximum(np.sqrt((direction**2).sum(axis=1)), 1e-300)[:, None]
    size, ratio = np.full(len(low), -1.0), np.zeros(len(low))
    reached, pair = -1.0, None
    for number, (s, t) in enumerate(_corners(h[a], h[b], h[c], h[d], search.minimum_m)):
        valid = _valid_corners(s, t, h, a, b, c, d, search.minimum_m)
        if not len(valid):
            continue
        s, t = s[valid], t[valid]
        row_a, row_b, row_c, row_d = (rows_of[valid] for rows_of in (a, b, c, d))
        difference = (f[row_c] - f[row_a]) + t[:, None] * (f[row_d] - f[row_c])
        difference -= s[:, None] * (f[row_b] - f[row_a])
        volume = (v[row_c] - v[row_a]) + t * (v[row_d] - v[row_c]) - s * (v[row_b] - v[row_a])
        u, w = groups.norms(difference)
        largest = search.size(u + s_u[valid], volume - s_volume[valid])
        size[valid] = np.maximum(size[valid], largest)
        if len(groups.dof):
            least = np.einsum("ij,ij->i", difference, direction[valid]) - s_u[valid]
            spread = w + s_w[valid]
            worst = np.divide(spread, least, out=np.full(len(w), np.inf), where=least > 0)
            ratio[valid] = np.maximum(ratio[valid], np.where(spread > 0, worst, 0.0))
        # The first four corners are pairs of rows: their exact sizes improve the best delivery so
        # far.
        if number < 4:
            k = coverage_factor(search.probability, groups.effective(u, w))
            sizes = search.size(k * u, volume)
            place = int(np.argmax(sizes))
            if sizes[place] > reached:
                dips = (row_b if s[place] else row_a)[place], (row_d if t[place] else row_c)[place]
                reached, pair = sizes[place], (h[dips[0]], h[dips[1]])
    k = coverage_factor(search.probability, groups.effective(np.ones(len(low)), ratio))
    return np.where(size < 0, -1.0, k * size), reached, pair


def _corners(a, b, c, d, minimum_m):
    """Yield corners of the dips [a, b] x [c, d], and cuts of h2 - h1 = minimum."""
    all_zeros, all_ones = np.zeros(len(a)), np.ones(len(a))
    yield from ((s, t) for s in (all_zeros, all_ones) for t in (all_zeros, all_ones))
    lower_length, upper_length = np.where(b > a, b - a, 1.0), np.where(d > c, d - c, 1.0)
    yield all_zeros, (a + minimum_m - c) / upper_length
    yield all_ones, (b + minimum_m - c) / upper_length
    yield (c - minimum_m - a) / lower_length, all_zeros
    yield (d - minimum_m - a) / lower_length, all_ones


def _valid_corners(s, t, h, a, b, c, d, minimum_m):
    """Return indices of the pairs whose corner lies in both blocks and has the minimum height."""
    height = h[c] + t * (h[d] - h[c]) - h[a] - s * (h[b] - h[a])
    inside = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    return np.flatnonzero(inside & (height >= minimum_m - SAME_M))
