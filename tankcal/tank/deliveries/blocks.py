"""Blocks of rows and what no delivery between two of them can exceed.

In a block f = chord + e with |e| at most s. So u between two blocks is at most |chord difference|
+ s1 + s2: convex in the dips, hence largest at the corners of the two blocks. With d any unit
vector u is at least <chord difference, d> - s1 - s2, so w/u, which gives the effective degrees of
freedom (u/w)^4, is below a quasi-convex function and largest at the corners too. s falls with the
square of the block's length.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.tank.capacity import SAME_M
from tankcal.tank.deliveries.pairs import Rows, ratio_of
from tankcal.uncertainty import coverage_factor

FAN = 4  # blocks that make up one of the next level


@dataclass(frozen=True)
class Level:
    """Blocks of rows: first and last row, kids (b, 4) in the level below (-1: none), sagittas.

    u_m3, w_m3, volume_m3  (b,) largest departure of the block's rows from its chord
    """

    first: np.ndarray
    last: np.ndarray
    kids: np.ndarray
    u_m3: np.ndarray
    w_m3: np.ndarray
    volume_m3: np.ndarray


def levels_of(rows, pieces):
    """Blocks from single steps up to one block for each piece of the table."""
    ends = [*pieces, len(rows.height_m)]
    first, last, piece = [], [], []
    for number, (start, stop) in enumerate(pairwise(ends)):
        steps = np.arange(start, max(stop - 1, start + 1))
        first.append(steps)
        last.append(np.minimum(steps + 1, stop - 1))
        piece.append(np.full(len(steps), number))
    first, last, piece = (np.concatenate(parts) for parts in (first, last, piece))
    exact = np.zeros((3, len(first)))  # f and V are linear within a step
    levels = [Level(first, last, np.full((len(first), FAN), -1), *exact)]
    while len(first) > len(pieces):
        starts = np.flatnonzero(np.append(True, piece[1:] != piece[:-1]))
        place = np.arange(len(piece)) - starts[piece]
        eldest = np.flatnonzero(place % FAN == 0)
        number = np.diff(np.append(eldest, len(piece)))
        kids = np.where(np.arange(FAN) < number[:, None], eldest[:, None] + np.arange(FAN), -1)
        first, last, piece = first[eldest], last[eldest + number - 1], piece[eldest]
        levels.append(_level(rows, first, last, kids))
    return levels


def _level(rows, first, last, kids):
    block = np.searchsorted(last, np.arange(len(rows.height_m)))
    one, two = first[block], last[block]
    length = np.where(two > one, rows.height_m[two] - rows.height_m[one], 1.0)
    part = (rows.height_m - rows.height_m[one]) / length
    chord = rows.volume_m3[one] + part * (rows.volume_m3[two] - rows.volume_m3[one])
    slope = rows.factor_m3[two] - rows.factor_m3[one]
    u, w = rows.groups.norms(rows.factor_m3 - rows.factor_m3[one] - part[:, None] * slope)
    largest = np.zeros((3, len(first)))
    for into, departure in zip(largest, (u, w, np.abs(rows.volume_m3 - chord)), strict=True):
        np.maximum.at(into, block, departure)
    return Level(first, last, kids, *largest)


@dataclass(frozen=True)
class Search:
    """What one search needs: rows, first row of each piece of them, blocks; for U/V or for U."""

    rows: Rows
    pieces: list
    levels: list
    probability: float
    minimum_m: float
    is_relative: bool

    def size(self, U, volume):
        return ratio_of(U, volume) if self.is_relative else U


def kids_of(level, low, high):
    """Pairs of blocks of the level below that make up these pairs."""
    one = np.repeat(level.kids[low], FAN, axis=1).ravel()
    two = np.tile(level.kids[high], FAN).ravel()
    there = (one >= 0) & (two >= 0)
    return one[there], two[there]


def bounds_of(search, level, low, high):
    """(bounds (m,), best size at the corners, its dips) of m pairs of blocks.

    bounds  no delivery between the two blocks is larger; -1 where none is of the minimum height
    """
    rows, groups = search.rows, search.rows.groups
    a, b, c, d = level.first[low], level.last[low], level.first[high], level.last[high]
    s_u, s_w = level.u_m3[low] + level.u_m3[high], level.w_m3[low] + level.w_m3[high]
    s_volume = level.volume_m3[low] + level.volume_m3[high]
    f, h, v = rows.factor_m3, rows.height_m, rows.volume_m3
    along = f[c] + f[d] - f[a] - f[b]
    along /= np.maximum(np.sqrt((along**2).sum(axis=1)), 1e-300)[:, None]
    size, ratio = np.full(len(low), -1.0), np.zeros(len(low))
    reached, pair = -1.0, None
    for number, (s, t) in enumerate(_corners(h[a], h[b], h[c], h[d], search.minimum_m)):
        there = _in_both(s, t, h, a, b, c, d, search.minimum_m)
        if not len(there):
            continue
        s, t = s[there], t[there]
        one, two, three, four = (rows_of[there] for rows_of in (a, b, c, d))
        difference = (f[three] - f[one]) + t[:, None] * (f[four] - f[three])
        difference -= s[:, None] * (f[two] - f[one])
        volume = (v[three] - v[one]) + t * (v[four] - v[three]) - s * (v[two] - v[one])
        u, w = groups.norms(difference)
        largest = search.size(u + s_u[there], volume - s_volume[there])
        size[there] = np.maximum(size[there], largest)
        if len(groups.dof):
            least = np.einsum("ij,ij->i", difference, along[there]) - s_u[there]
            spread = w + s_w[there]
            worst = np.divide(spread, least, out=np.full(len(w), np.inf), where=least > 0)
            ratio[there] = np.maximum(ratio[there], np.where(spread > 0, worst, 0.0))
        if number < 4:
            k = coverage_factor(search.probability, groups.effective(u, w))
            sizes = search.size(k * u, volume)
            place = int(np.argmax(sizes))
            if sizes[place] > reached:
                dips = (two if s[place] else one)[place], (four if t[place] else three)[place]
                reached, pair = sizes[place], (h[dips[0]], h[dips[1]])
    k = coverage_factor(search.probability, groups.effective(np.ones(len(low)), ratio))
    return np.where(size < 0, -1.0, k * size), reached, pair


def _corners(a, b, c, d, minimum_m):
    """Corners of the dips [a, b] x [c, d] and cuts of h2 - h1 = minimum, as parts of the sides."""
    zero, one = np.zeros(len(a)), np.ones(len(a))
    yield from ((s, t) for s in (zero, one) for t in (zero, one))
    low, high = np.where(b > a, b - a, 1.0), np.where(d > c, d - c, 1.0)
    yield zero, (a + minimum_m - c) / high
    yield one, (b + minimum_m - c) / high
    yield (c - minimum_m - a) / low, zero
    yield (d - minimum_m - a) / low, one


def _in_both(s, t, h, a, b, c, d, minimum_m):
    """Indices of the pairs whose corner lies in both blocks and is of the minimum height."""
    apart = h[c] + t * (h[d] - h[c]) - h[a] - s * (h[b] - h[a])
    inside = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    return np.flatnonzero(inside & (apart >= minimum_m - SAME_M))
