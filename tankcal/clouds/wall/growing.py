"""Which cells are wall: surfaces that hang together are grown, and the wall is the largest.

In the block of rows x columns x distances, what is occupied in neighbouring cells at neighbouring
distances is one surface: a buckle or a seam leads on from cell to cell, a pipe or an insulation
begins with a step. Each cell's distance is then held against the trend of its neighbours.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tankcal.adjust import SD_OVER_MEDIAN

WALL, EMPTY, FEW, OBSTRUCTED, STEEP, OFF_TREND = range(6)
FEWEST = 6  # points of a cell that says anything
OCCUPIED = 0.15  # of the fullest bin of a cell
SURE = 8  # points of the fullest bin, above which its neighbours are not smoothed over
LEAST_SHARE = 0.1  # of the points of a cell, of a mode that counts
STEEPEST = 0.35  # slope of a wall: a mode is no wider than this over its cell
NOISE_BINS = 5  # that a mode of a flat wall may hold
LEAST_PATCH, PATCH_STEP_M, PATCH_SLOPE = 20, 0.012, 0.01  # of parts that masked cells cut off
TOUCHING = 1.2  # cells between a patch and the wall that it meets
TREND, LEAST_TREND_M = 3.0, 0.002  # sds from the neighbours' trend, and never less than this
REFINE_BINS = 2  # beside a mode that its mean may reach, at least


@dataclass(frozen=True)
class Grown:
    """The wall in the cells of one side.

    Attributes
    ----------
    why : ndarray of uint8, shape (rows, columns)
        WALL, EMPTY, FEW, OBSTRUCTED, STEEP or OFF_TREND.
    low, high : ndarray of int, shape (rows, columns)
        First and last bin that is averaged over.
    other : ndarray of int, shape (rows, columns)
        Bin of the largest mode that is not taken for wall, -1: there is none.
    surfaces : tuple
        (share of the cells, mean distance in bins) of surfaces that are not wall, of two modes in
        one cell ("behind") or in cells of their own; largest first.
    two_modes : ndarray of bool, shape (rows, columns)
        Cells with a second mode, apart from the wall.
    """

    why: np.ndarray
    low: np.ndarray
    high: np.ndarray
    other: np.ndarray
    surfaces: tuple
    two_modes: np.ndarray


def grow_wall(counts, *, column_m, row_m, bin_m, joined_rows=()):
    """The wall in the histograms of cells.

    Parameters
    ----------
    counts : ndarray of int, shape (rows, columns, bins)
    column_m, row_m, bin_m : float
        Width and height of a cell, width of a bin, m.
    joined_rows : sequence of int, optional
        Rows that begin at a joint: the wall may step there.

    Returns
    -------
    Grown
    """
    occupied = _occupied(counts)
    runs = _Runs(counts, occupied)
    widest = NOISE_BINS + STEEPEST * np.maximum(column_m, row_m) / bin_m
    total = counts.sum(axis=2)
    steep = runs.high - runs.low + 1 > widest.ravel()[runs.cell // counts.shape[1]]
    sound = (runs.count >= LEAST_SHARE * total.ravel()[runs.cell]) & (runs.count >= 3) & ~steep
    label = _labels(occupied, runs, sound, joined_rows)
    shape = total.shape
    wall = _joined_patches(runs, label, shape, np.broadcast_to(column_m, shape[0]), row_m, bin_m)
    chosen = _one_of_each_cell(runs, wall, shape)
    why = np.full(total.size, OBSTRUCTED, dtype=np.uint8)
    why[(total < FEWEST).ravel()] = FEW
    why[(total == 0).ravel()] = EMPTY
    cells_steep = np.zeros(total.size, dtype=bool)
    cells_steep[runs.cell[steep]] = True
    why[cells_steep & (why == OBSTRUCTED)] = STEEP
    has = chosen >= 0
    why[has & (total >= FEWEST).ravel()] = WALL
    low, high = np.zeros((2, total.size), dtype=np.int64)
    run = chosen[has]
    reach = np.maximum((runs.high[run] - runs.low[run] + 1) // 2, REFINE_BINS)
    low[has] = np.maximum(runs.low[run] - reach, 0)
    high[has] = np.minimum(runs.high[run] + reach, counts.shape[2] - 1)
    other, two = _others(runs, sound, chosen, has, total.size)
    return Grown(
        why.reshape(shape),
        low.reshape(shape),
        high.reshape(shape),
        other.reshape(shape),
        _surfaces(runs, sound, label, wall, np.count_nonzero(total >= FEWEST)),
        two.reshape(shape),
    )


def off_trend(values, sds, wall):
    """(rows, columns) cells of a wall that depart from the trend of their neighbours.

    The trend is the middle of two neighbours, or the straight line through two on one side, along
    a row or along a column; the nearest of these counts: form is smooth in one direction at least.
    """
    seen = np.where(wall, values, np.nan)
    away = np.full(values.shape, np.inf)
    between = np.full(values.shape, np.nan)
    for axis in (0, 1):
        near = {step: _shifted(seen, step, axis) for step in (-4, -3, -2, -1, 1, 2, 3, 4)}
        trends = [(near[-k] + near[k]) / 2 for k in (1, 2, 3)]
        trends += [s * near[k] - (s - 1) * near[n] for k, n, s in _LINES]
        for trend in trends:
            away = np.fmin(away, np.abs(values - trend))
        if axis == 0:
            between = values - trends[0]
    scatter = spread_between(between)
    limit = np.maximum(TREND * np.hypot(scatter, np.nan_to_num(sds)), LEAST_TREND_M)
    return wall & ~(away <= limit)


_LINES = tuple((sign * k, sign * 2 * k, 2) for sign in (-1, 1) for k in (1, 2))


def spread_between(second_differences):
    """Sd of a value, from its departures from the middle of two neighbours, by their median."""
    known = np.abs(second_differences[np.isfinite(second_differences)])
    return SD_OVER_MEDIAN * float(np.median(known)) / np.sqrt(1.5) if len(known) else 0.0


def _shifted(values, step, axis):
    """Values of the neighbour `step` cells on; rows end, columns go round."""
    moved = np.roll(values, -step, axis=axis)
    if axis == 0:
        moved[-step:] = np.nan if step > 0 else moved[-step:]
        if step < 0:
            moved[:-step] = np.nan
    return moved


def _occupied(counts):
    """Bins whose count is a part of that of the fullest of their cell."""
    peak = counts.max(axis=2, keepdims=True)
    wide = counts.copy()
    wide[..., 1:] += counts[..., :-1]
    wide[..., :-1] += counts[..., 1:]
    sparse = peak < SURE
    used = np.where(sparse, wide, counts)
    peak = np.where(sparse, wide.max(axis=2, keepdims=True), peak)
    return (used >= np.maximum(OCCUPIED * peak, 1)) & (counts.sum(axis=2, keepdims=True) >= FEWEST)


class _Runs:
    """Neighbouring occupied bins of a cell: its modes. cell, low, high, count (n,) of each."""

    def __init__(self, counts, occupied):
        bins = counts.shape[2]
        flat = np.zeros((occupied.shape[0] * occupied.shape[1], bins + 2), dtype=np.int8)
        flat[:, 1:-1] = occupied.reshape(-1, bins)
        change = np.diff(flat, axis=1)
        self.cell, self.low = np.nonzero(change == 1)
        self.high = np.nonzero(change == -1)[1] - 1
        below = np.zeros((len(flat), bins + 1), dtype=np.int64)
        np.cumsum(counts.reshape(-1, bins), axis=1, out=below[:, 1:])
        self.count = below[self.cell, self.high + 1] - below[self.cell, self.low]
        self.middle = (self.low + self.high) / 2


def _labels(occupied, runs, sound, joined_rows):
    """(runs,) number of the surface that each mode belongs to, 0: none."""
    rows, columns, bins = occupied.shape
    keep = np.zeros((rows * columns, bins + 1), dtype=np.int8)
    np.add.at(keep, (runs.cell[sound], runs.low[sound]), 1)
    np.add.at(keep, (runs.cell[sound], runs.high[sound] + 1), -1)
    block = np.cumsum(keep, axis=1)[:, :-1].reshape(occupied.shape) > 0
    structure = np.zeros((3, 3, 3), dtype=bool)
    structure[:, 1, :] = structure[1, :, :] = True
    labels, count = scipy.ndimage.label(block, structure=structure)
    pairs = [_touching(labels[:, -1], labels[:, 0], 1)]
    pairs += [_touching(labels[row - 1], labels[row], 4) for row in joined_rows if 0 < row < rows]
    labels = _united(labels, count, np.vstack(pairs))
    found = np.zeros(len(runs.cell), dtype=np.int64)
    found[sound] = labels.reshape(-1, bins)[runs.cell[sound], runs.low[sound]]
    return found


def _touching(first, second, reach):
    """Pairs of labels of two lines of cells (n, bins) that are at most `reach` bins apart."""
    pairs = []
    bins = first.shape[1]
    for step in range(-reach, reach + 1):
        a = first[:, max(0, -step) : bins - max(0, step)]
        b = second[:, max(0, step) : bins - max(0, -step)]
        both = (a > 0) & (b > 0)
        pairs.append(np.column_stack([a[both], b[both]]))
    return np.unique(np.vstack(pairs), axis=0)


def _united(labels, count, pairs):
    links = coo_array((np.ones(len(pairs)), pairs.T), shape=(count + 1, count + 1))
    number = connected_components(links, directed=False)[1]
    number = np.where(np.arange(count + 1) == 0, 0, number + 1)
    return number[labels]


def _joined_patches(runs, label, shape, column_m, row_m, bin_m):
    """(runs,) those of the wall: the largest surface, and patches that lie in its trend."""
    size = np.bincount(label, minlength=1)
    size[0] = 0
    wall = (label == np.argmax(size)) & (label > 0)
    waiting = [one for one in np.argsort(-size, kind="stable") if size[one] >= LEAST_PATCH][1:]
    row, column = np.divmod(runs.cell, shape[1])
    for _ in range(10):
        step, gap = _from_nearest(runs, wall, row, column, shape, column_m, row_m)
        joined = []
        for one in waiting:
            members = label == one
            known = members & np.isfinite(step)
            if np.count_nonzero(known) < LEAST_PATCH / 2:
                continue
            allowed = PATCH_STEP_M + PATCH_SLOPE * np.median(gap[known])
            beside = known & (gap <= TOUCHING * max(row_m, float(column_m.max())))
            if np.count_nonzero(beside) >= LEAST_PATCH / 2 and (
                np.median(np.abs(step[beside])) * bin_m > PATCH_STEP_M
            ):
                continue  # it meets the wall, with a step
            if np.median(np.abs(step[known])) * bin_m <= allowed:
                joined.append(one)
        if not joined:
            break
        wall |= np.isin(label, joined)
        waiting = [one for one in waiting if one not in joined]
    return wall


def _from_nearest(runs, wall, row, column, shape, column_m, row_m):
    """(runs,) how many bins each mode lies off the wall beside it in its row, or its column where
    the row has none, and how far that wall is, m.
    """
    seen = np.full(shape, np.nan)
    seen[row[wall], column[wall]] = runs.middle[wall]
    around, gap = _filled(np.concatenate([seen, seen, seen], axis=1))
    around, gap = (one[:, shape[1] : 2 * shape[1]] for one in (around, gap))
    gap = gap * column_m[:, None]
    up, high = (one.T for one in _filled(seen.T.copy()))
    nearer = ~(gap <= high * row_m)
    values, distance = np.where(nearer, up, around), np.where(nearer, high * row_m, gap)
    return runs.middle - values[row, column], distance[row, column]


def _filled(values):
    """Values of lines (n, k) between the known ones, straight, and cells to the nearest known."""
    filled, gap = np.full(values.shape, np.nan), np.full(values.shape, np.inf)
    places = np.arange(values.shape[1])
    for i, line in enumerate(values):
        known = np.flatnonzero(np.isfinite(line))
        if len(known):
            filled[i] = np.interp(places, known, line[known])
            after = known[np.minimum(np.searchsorted(known, places), len(known) - 1)]
            before = known[np.maximum(np.searchsorted(known, places, side="right") - 1, 0)]
            gap[i] = np.minimum(np.abs(after - places), np.abs(places - before))
    return filled, gap


def _one_of_each_cell(runs, wall, shape):
    """(cells,) the mode of each cell that is wall, -1: none; of several that in the trend."""
    cells = shape[0] * shape[1]
    chosen = np.full(cells, -1)
    index = np.flatnonzero(wall)
    order = index[np.argsort(runs.count[index], kind="stable")]
    chosen[runs.cell[order]] = order
    several = np.bincount(runs.cell[index], minlength=cells) > 1
    if not several.any():
        return chosen
    middle = np.full(cells, np.nan)
    middle[(chosen >= 0) & ~several] = runs.middle[chosen[(chosen >= 0) & ~several]]
    around = _filled(np.tile(middle.reshape(shape), (1, 3)))[0][:, shape[1] : 2 * shape[1]]
    up = _filled(middle.reshape(shape).T.copy())[0].T
    trend = np.nanmean(np.stack([np.nan_to_num(around), np.nan_to_num(up)]), axis=0).ravel()
    mine = index[several[runs.cell[index]]]
    order = mine[np.argsort(-np.abs(runs.middle[mine] - trend[runs.cell[mine]]), kind="stable")]
    chosen[runs.cell[order]] = order
    return chosen


def _others(runs, sound, chosen, has, cells):
    """(cells,) bin of the largest mode beside that of the wall, and whether it has both."""
    other, two = np.full(cells, -1), np.zeros(cells, dtype=bool)
    rest = np.flatnonzero(sound & (chosen[runs.cell] != np.arange(len(runs.cell))))
    order = rest[np.argsort(runs.count[rest], kind="stable")]
    other[runs.cell[order]] = runs.middle[order].astype(np.int64)
    two[runs.cell[rest]] = True
    return other, two & has


def _surfaces(runs, sound, label, wall, seen):
    """(share of the seen cells, mean distance in bins, cells) of surfaces that are not wall."""
    index = np.flatnonzero(sound & ~wall & (label > 0))
    size = np.bincount(label[index], minlength=1)
    found = []
    for one in np.argsort(-size, kind="stable")[:20]:
        if size[one]:
            mine = index[label[index] == one]
            found.append((size[one] / max(seen, 1), float(np.median(runs.middle[mine])), mine))
    return tuple(found)
