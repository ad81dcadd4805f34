"""Worst delivery of at least a given height, over all dips and not only over rows.

Between four neighbouring rows, f and V are linear in the two dips, so u is convex and u/V
quasi-convex. Their maxima are at the corners of that cell or, where the line h2 - h1 = minimum cuts
the cell, at the ends of the cut. The worst delivery thus has both dips at rows, or exactly the
minimum height with one dip at a row. With finite degrees of freedom, k varies within a cell; the
bounds include this effect.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.tank.capacity import SAME_M
from tankcal.tank.deliveries.blocks import Search, bounds_of, kids_of, levels_of
from tankcal.tank.deliveries.pairs import CHUNK, Groups, Rows, deliveries_between
from tankcal.text.display import volume_text

TOLERANCE = 1e-6  # relative tolerance of the worst delivery


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
    prepared = _prepare(table)
    results = [
        _find_worst(prepared, float(minimum_m), is_relative) for is_relative in (False, True)
    ]
    if results[0] is None:
        return None
    (absolute, U_bound), (relative, relative_bound) = results
    dips = _best_at_minimum(prepared.searching(float(minimum_m), True))[1]
    return WorstDeliveries(
        minimum_m=float(minimum_m),
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
        worst = _find_worst(prepared, max(middle, 1) / 1000, is_relative)
        if worst is None or _size_of(worst[0], is_relative) <= limit:
            high = middle
        else:
            low = middle + 1
    height_m = max(high, 1) / 1000
    worst = _find_worst(prepared, height_m, is_relative) if len(heights) else None
    return height_m if worst and _size_of(worst[0], is_relative) <= limit else None


def _size_of(delivery, is_relative):
    """Return U/volume or U of a delivery."""
    return delivery.relative if is_relative else delivery.U_m3


@dataclass(frozen=True)
class _Prepared:
    """Rows for use, the first row of each piece between critical zones, and their blocks."""

    rows: Rows
    pieces: list
    levels: list
    probability: float

    def searching(self, minimum_m, is_relative):
        """Return the `Search` for a minimum height."""
        return Search(self.rows, self.pieces, self.levels, self.probability, minimum_m, is_relative)


def _prepare(table):
    """Return the `_Prepared` of a table, which does not depend on the minimum height."""
    rows, pieces = _rows_for_use(table)
    levels = levels_of(rows, pieces) if len(rows.height_m) else []
    return _Prepared(rows, pieces, levels, table.probability)


def _find_worst(prepared, minimum_m, is_relative):
    """Return (Delivery, bound) with the largest U/V, or U; None if there is no delivery."""
    rows = prepared.rows
    if not len(rows.height_m) or np.ptp(rows.height_m) < minimum_m - SAME_M:
        return None
    search = prepared.searching(minimum_m, is_relative)
    best, dips, bound = _branch_and_bound(search, *_best_at_minimum(search))
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


def _best_at_minimum(search):
    """Return (size, dips) of the worst delivery of the minimum height with a dip at a row."""
    rows, minimum_m = search.rows, search.minimum_m
    # Each row once as the lower dip, and once as the upper dip.
    low = np.concatenate([rows.height_m, rows.height_m - minimum_m])
    high = np.concatenate([rows.height_m + minimum_m, rows.height_m])
    keep = (low >= rows.height_m[0] - SAME_M) & (high <= rows.height_m[-1] + SAME_M)
    for start in search.pieces[1:]:
        gap = rows.height_m[start - 1] + SAME_M, rows.height_m[start] - SAME_M
        keep &= ~((low > gap[0]) & (low < gap[1])) & ~((high > gap[0]) & (high < gap[1]))
    if not np.any(keep):
        return -1.0, None
    low, high = np.clip([low[keep], high[keep]], rows.height_m[0], rows.height_m[-1])
    result = deliveries_between(rows, search.probability, low, high, np.full(len(low), True))
    sizes = search.size(result.U_m3, result.volume_m3)
    place = int(np.argmax(sizes))
    return sizes[place], (low[place], high[place])
