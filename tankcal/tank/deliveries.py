"""Deliveries: the uncertainty of V(h2) - V(h1), and the worst delivery of at least a given height.

u(h1, h2) = |f(h2) - f(h1)|, with f(h) the row of the factor at a dip, linear between rows; common
errors of both dips cancel. U = k u, with k from Welch-Satterthwaite for each delivery. The search
for the worst case excludes whole blocks of rows at once; it never builds a matrix of rows by rows.

Sources: JCGM 100:2008 5.2, G.4; JCGM 102:2011 6.2.

Worst delivery of at least a given height
-----------------------------------------

Between four neighbouring rows, f and V are linear in the two dips, so u is convex and u/V
quasi-convex. Their maxima are at the corners of that cell or, where the line h2 - h1 = minimum cuts
the cell, at the ends of the cut. The worst delivery thus has both dips at rows, or exactly the
minimum height with one dip at a row. With finite degrees of freedom, k varies within a cell; the
bounds include this effect.

The search bounds whole blocks of rows. In a block f = chord + e, with |e| at most s. Thus u between
two blocks is at most |chord difference| + s1 + s2. This bound is convex in the dips, hence largest
at the corners of the two blocks. With d any unit vector, u is at least <chord difference, d> - s1 -
s2. Thus w/u, which gives the effective degrees of freedom (u/w)^4, is below a quasi-convex
function, which is also largest at the corners. s decreases with the square of the length of the
block.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tankcal.tank.capacity import SAME_M
from tankcal.text.display import volume_text
from tankcal.uncertainty import coverage_factor, dof_of, least_of, sum_of_fourths

__all__ = [
    "TOLERANCE",
    "Deliveries",
    "Delivery",
    "WorstDeliveries",
    "deliveries",
    "least_delivery_m",
    "ratio_of",
    "worst_deliveries",
]
CHUNK = 2048  # pairs in an array operation: limits the memory
TOLERANCE = 1e-6  # relative tolerance of the worst delivery
FAN = 4  # number of blocks that form a block of the next level


@dataclass(frozen=True)
class Deliveries:
    """Volumes between pairs of dips; each field has the shape (n,).

    Attributes
    ----------
    low_m, high_m : ndarray
        Dips before and after, as given, m.
    volume_m3 : ndarray
        V(high) - V(low), m3.
    u_m3, dof : ndarray
        Standard uncertainty, m3, and effective degrees of freedom.
    k, U_m3 : ndarray
        Coverage factor, and k u, m3.
    for_use : ndarray of bool
        False if a dip is in the critical zone of a floating roof.
    """

    low_m: np.ndarray
    high_m: np.ndarray
    volume_m3: np.ndarray
    u_m3: np.ndarray
    dof: np.ndarray
    k: np.ndarray
    U_m3: np.ndarray
    for_use: np.ndarray

    @property
    def relative(self):
        """U (n,) over the volume; inf for a volume of 0 with U above 0."""
        return ratio_of(self.U_m3, self.volume_m3)


def deliveries(table, low_m, high_m):
    """Return deliveries between pairs of dips, with k by Welch-Satterthwaite.

    u^2 = |f(high) - f(low)|^2, with f the rows of the factor.

    Parameters
    ----------
    table : tankcal.tank.capacity.Capacity
    low_m, high_m : (n,) arrays or floats
        Dips before and after, m.

    Returns
    -------
    Deliveries

    Raises
    ------
    HeightError
        For a dip outside the table (`Capacity.inside`).
    """
    low_m, high_m = np.broadcast_arrays(*np.atleast_1d(low_m, high_m))
    low_m, high_m = low_m.astype(float), high_m.astype(float)
    low, high = table.inside(low_m), table.inside(high_m)
    rows = Rows(table.height_m, table.volume_m3, table.factor_m3, Groups(table.sources))
    for_use = table.for_use(low) & table.for_use(high)
    result = deliveries_between(rows, table.probability, low, high, for_use)
    return replace(result, low_m=low_m, high_m=high_m)


def deliveries_between(rows, probability, low, high, for_use):
    """Return deliveries between dips inside the table, in chunks of pairs.

    Parameters
    ----------
    rows : Rows
    probability : float
        Coverage probability.
    low, high : ndarray, shape (n,)
        Dips, m.
    for_use : ndarray of bool, shape (n,)

    Returns
    -------
    Deliveries
    """
    volume, u, w = np.empty((3, len(low)))
    for start in range(0, len(low), CHUNK):
        chunk = slice(start, start + CHUNK)
        (volume_low, f_low), (volume_high, f_high) = rows.at(low[chunk]), rows.at(high[chunk])
        volume[chunk] = volume_high - volume_low
        u[chunk], w[chunk] = rows.groups.norms(f_high - f_low)
    dof = rows.groups.effective(u, w)
    k = coverage_factor(probability, dof)
    return Deliveries(low, high, volume, u, dof, k, k * u, for_use)


def ratio_of(U, volume):
    """Return U over volume; inf if U is above 0 and the volume is not."""
    # Replace zero volumes before the division, which numpy evaluates for all elements.
    safe = np.where(volume > 0, volume, 1.0)
    return np.where(volume > 0, U / safe, np.where(U > 0, np.inf, 0.0))


class Groups:
    """Columns of the factor by source, and two norms that determine the degrees of freedom.

    u and w, with w^4 = sum of u_s^4 / dof_s, are norms of a difference of columns. The triangle
    inequality thus bounds both in the search for the worst delivery. The effective degrees of
    freedom are (u/w)^4.
    """

    def __init__(self, sources):
        widths = [source.columns_m3.shape[1] for source in sources]
        owner = np.repeat(np.arange(len(sources)), widths)
        dof = np.array([source.u_dof for source in sources], dtype=float)
        finite = np.flatnonzero(np.isfinite(dof) & (np.array(widths, dtype=int) > 0))
        self.columns = np.flatnonzero(np.isin(owner, finite))
        self.members = (owner[self.columns, None] == finite).astype(float)
        self.dof = dof[finite]
        self.least_dof = least_of(self.dof)

    def norms(self, difference):
        """Return (u, w) of columns (..., c): u^2 = sum of squares, w^4 = sum of u_s^4 / dof_s."""
        squares = difference**2
        u = np.sqrt(squares.sum(axis=-1))
        if not len(self.dof):
            return u, np.zeros_like(u)
        # Only sources with finite degrees of freedom contribute to w.
        by_source = squares[..., self.columns] @ self.members
        return u, sum_of_fourths(by_source, self.dof) ** 0.25

    def effective(self, u, w):
        """Return effective degrees of freedom (u/w)^4 (`uncertainty.dof_of`)."""
        return dof_of(u**2, w**4, self.least_dof)


@dataclass(frozen=True)
class Rows:
    """Dips (n,), volumes (n,), factor (n, c) and its groups of sources."""

    height_m: np.ndarray
    volume_m3: np.ndarray
    factor_m3: np.ndarray
    groups: Groups

    def at(self, dip):
        """Return (volume, factor) at dips, linear between rows."""
        upper = np.clip(np.searchsorted(self.height_m, dip), 1, len(self.height_m) - 1)
        below = self.height_m[upper - 1]
        part = np.clip((dip - below) / (self.height_m[upper] - below), 0, 1)
        volume = (1 - part) * self.volume_m3[upper - 1] + part * self.volume_m3[upper]
        part = part[:, None]
        return volume, (1 - part) * self.factor_m3[upper - 1] + part * self.factor_m3[upper]


@dataclass(frozen=True)
class Delivery:
    """Delivery between two dips.

    Attributes
    ----------
    low_m, high_m : float
        Dips, m.
    volume_m3 : float
        Volume between the dips, m3.
    u_m3 : float
        Standard uncertainty, m3.
    dof : float
        Degrees of freedom of the standard uncertainty.
    k : float
        Coverage factor.
    U_m3 : float
        Expanded uncertainty, k u, m3.
    relative : float
        U over volume.
    """

    low_m: float
    high_m: float
    volume_m3: float
    u_m3: float
    dof: float
    k: float
    U_m3: float
    relative: float

    def __str__(self) -> str:
        return (
            f"{self.low_m:g} to {self.high_m:g} m: {volume_text(self.volume_m3, self.U_m3, self.k)}"
        )


@dataclass(frozen=True)
class WorstDeliveries:
    """Worst of all deliveries of at least `minimum_m` whose dips are for use.

    Attributes
    ----------
    absolute : Delivery
        Delivery with the largest U.
    relative : Delivery
        Delivery with the largest U/volume.
    at_minimum : Delivery or None
        Delivery of exactly minimum_m with the largest U/volume; None if only higher deliveries are
        for use.
    U_bound_m3 : float
        Upper bound of U over all deliveries.
    relative_bound : float
        Upper bound of U/volume over all deliveries.
    """

    minimum_m: float
    absolute: Delivery
    relative: Delivery
    at_minimum: Delivery | None
    U_bound_m3: float
    relative_bound: float


def worst_deliveries(table, minimum_m):
    """Return the `WorstDeliveries` of a table for a minimum delivery height, or None.

    The result contains the maxima of U and of U/V over all dips with h2 - h1 >= minimum_m.

    Parameters
    ----------
    table : Capacity
    minimum_m : float
        Least height of a delivery, m.

    Returns
    -------
    WorstDeliveries or None
        None if the table has no such delivery: it is lower than the minimum, or the critical zone
        of its roof divides it.

    Raises
    ------
    ValueError
        For a minimum that is not above 0.
    """
    if not minimum_m > 0:
        raise ValueError(f"minimum delivery height {minimum_m}: expected above 0")
    prepared, minimum_m = _prepare(table), float(minimum_m)
    lowest = _deliveries_of_minimum(prepared, minimum_m)
    results = [
        _find_worst(prepared, minimum_m, is_relative, lowest) for is_relative in (False, True)
    ]
    if results[0] is None:
        return None
    (absolute, U_bound), (relative, relative_bound) = results
    dips = _largest(prepared.searching(minimum_m, True), lowest)[1]
    return WorstDeliveries(
        minimum_m=minimum_m,
        absolute=absolute,
        relative=relative,
        at_minimum=None if dips is None else _build_delivery(prepared, dips),
        U_bound_m3=U_bound,
        relative_bound=relative_bound,
    )


def least_delivery_m(table, limit, is_relative=True):
    """Return the least height from which on all deliveries meet a limit, m, in whole millimetres.

    The worst of all deliveries of at least a height decreases with that height, so bisection finds
    it.

    Parameters
    ----------
    table : Capacity
    limit : float
        Limit of U/V, or of U in m3 if not is_relative.
    is_relative : bool, optional

    Returns
    -------
    float or None
        None if even the largest delivery exceeds the limit.
    """
    prepared = _prepare(table)
    heights = prepared.rows.height_m
    low, high = 0, int((np.ptp(heights) + SAME_M) * 1000) if len(heights) else 0
    while low < high:
        middle = (low + high) // 2
        worst = _find_worst_from(prepared, max(middle, 1) / 1000, is_relative)
        if worst is None or _size_of(worst[0], is_relative) <= limit:
            high = middle
        else:
            low = middle + 1
    height_m = max(high, 1) / 1000
    worst = _find_worst_from(prepared, height_m, is_relative)
    return height_m if worst and _size_of(worst[0], is_relative) <= limit else None


def _size_of(delivery, is_relative):
    """Return U/volume or U of a delivery."""
    return delivery.relative if is_relative else delivery.U_m3


@dataclass(frozen=True)
class _SearchRows:
    """Rows for use, the first row of each piece between critical zones, and their blocks."""

    rows: Rows
    pieces: list
    levels: list
    probability: float

    def searching(self, minimum_m, is_relative):
        """Return the `Search` for a minimum height."""
        return Search(self.rows, self.pieces, self.levels, self.probability, minimum_m, is_relative)


def _prepare(table):
    """Return the `_SearchRows` of a table, which it keeps for further minimum heights."""
    kept = vars(table)  # as functools.cached_property does, whose module could not import this one
    if "search_rows" not in kept:
        rows, pieces = _rows_for_use(table)
        levels = levels_of(rows, pieces) if len(rows.height_m) else []
        kept["search_rows"] = _SearchRows(rows, pieces, levels, table.probability)
    return kept["search_rows"]


def _find_worst_from(prepared, minimum_m, is_relative):
    """Return the result of `_find_worst` for a minimum height alone."""
    lowest = _deliveries_of_minimum(prepared, minimum_m)
    return _find_worst(prepared, minimum_m, is_relative, lowest)


def _find_worst(prepared, minimum_m, is_relative, lowest):
    """Return (Delivery, bound) with the largest U/V, or U; None if there is no delivery.

    The search starts from the deliveries of the minimum height, `lowest`.
    """
    rows = prepared.rows
    if not len(rows.height_m) or np.ptp(rows.height_m) < minimum_m - SAME_M:
        return None
    search = prepared.searching(minimum_m, is_relative)
    best, dips, bound = _branch_and_bound(search, *_largest(search, lowest))
    if dips is None:
        return None
    return _build_delivery(prepared, dips), float(max(bound, best * (1 + TOLERANCE)))


def _build_delivery(prepared, dips):
    """Return the `Delivery` between two dips."""
    pair = np.array(dips)[:, None]
    result = deliveries_between(prepared.rows, prepared.probability, *pair, np.array([True]))
    values = (result.low_m, result.high_m, result.volume_m3, result.u_m3, result.dof, result.k)
    return Delivery(*(float(value[0]) for value in (*values, result.U_m3, result.relative)))


def _branch_and_bound(search, best, dips):
    """Return the largest size, its dips or None, and a bound of larger sizes (branch and bound)."""
    bound = 0.0
    top = len(search.levels) - 1
    blocks = np.arange(len(search.levels[top].first))
    stack = [(top, *(side.ravel() for side in np.meshgrid(blocks, blocks, indexing="ij")))]
    while stack:
        level, low, high = stack.pop()
        # Long lists are processed in chunks, so that good values are found before memory grows.
        if len(low) > CHUNK:
            stack.append((level, low[CHUNK:], high[CHUNK:]))
            low, high = low[:CHUNK], high[:CHUNK]
        bounds, reached, pair = bounds_of(search, search.levels[level], low, high)
        if reached > best:
            best, dips = reached, pair
        # Only pairs of blocks whose bound exceeds the best size are divided further.
        is_open = (bounds >= 0) & (bounds > best * (1 + TOLERANCE))
        if level == 0:
            bound = max(bound, bounds[is_open].max(initial=0.0))
        elif np.any(is_open):
            stack.append((level - 1, *kids_of(search.levels[level], low[is_open], high[is_open])))
    return best, dips, bound


def _rows_for_use(table):
    """Return rows outside the critical zone, and the first row of each piece.

    The limits of the zone are rows.
    """
    rows = Rows(table.height_m, table.volume_m3, table.factor_m3, Groups(table.sources))
    critical = table.critical_m
    if critical is None or critical[1] - critical[0] <= SAME_M or len(table.height_m) < 2:
        return rows, [0]
    heights = table.height_m
    ends = np.array(critical, dtype=float)
    inside = (ends > heights[0]) & (ends < heights[-1])
    # The limits of the critical zone become rows, so that each piece ends exactly there.
    new = [end for end in ends[inside] if np.abs(heights - end).min() > SAME_M]
    heights = np.sort(np.append(heights, new))
    low, high = ends
    heights = heights[(heights <= low + SAME_M) | (heights >= high - SAME_M)]
    volume, factor = rows.at(heights)
    above = int(np.searchsorted(heights, (low + high) / 2))
    pieces = [0, above] if 0 < above < len(heights) else [0]
    return Rows(heights, volume, factor, rows.groups), pieces


def _deliveries_of_minimum(prepared, minimum_m):
    """Return the `Deliveries` of the minimum height with a dip at a row; None without any."""
    rows = prepared.rows
    if not len(rows.height_m):
        return None
    # Each row once as the lower dip, and once as the upper dip.
    low = np.concatenate([rows.height_m, rows.height_m - minimum_m])
    high = np.concatenate([rows.height_m + minimum_m, rows.height_m])
    keep = (low >= rows.height_m[0] - SAME_M) & (high <= rows.height_m[-1] + SAME_M)
    for start in prepared.pieces[1:]:
        gap = rows.height_m[start - 1] + SAME_M, rows.height_m[start] - SAME_M
        keep &= ~((low > gap[0]) & (low < gap[1])) & ~((high > gap[0]) & (high < gap[1]))
    if not np.any(keep):
        return None
    low, high = np.clip([low[keep], high[keep]], rows.height_m[0], rows.height_m[-1])
    return deliveries_between(rows, prepared.probability, low, high, np.full(len(low), True))


def _largest(search, lowest):
    """Return (size, dips) of the worst of the deliveries of the minimum height; (-1, None)."""
    if lowest is None:
        return -1.0, None
    sizes = search.size(lowest.U_m3, lowest.volume_m3)
    place = int(np.argmax(sizes))
    return sizes[place], (lowest.low_m[place], lowest.high_m[place])


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
