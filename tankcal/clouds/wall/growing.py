"""Detection of the wall as the largest connected surface in a block of cells.

The block has the axes row, column and distance. Occupied bins of neighbouring cells at neighbouring
distances belong to one surface. A buckle or a seam continues from cell to cell; a pipe or an
insulation begins with a step. The distance of each cell is then compared with the trend of its
neighbours.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tankcal.adjust import SD_OVER_MEDIAN

WALL, EMPTY, FEW, OBSTRUCTED, STEEP, OFF_TREND = range(6)
FEWEST = 6  # least number of points of a cell that is evaluated
OCCUPIED = 0.15  # least count of an occupied bin, as a share of the fullest bin of its cell
SURE = 8  # points of the fullest bin from which the counts are not smoothed over neighbouring bins
LEAST_SHARE = 0.1  # least share of a mode in the points of its cell
STEEPEST = 0.35  # largest slope of a wall over a cell, which limits the width of a mode
NOISE_BINS = 5  # largest width of a mode due to noise, bins
# Patches that masked cells separate from the wall: least number of cells; largest step from the
# wall, m; additional step per metre of gap
LEAST_PATCH, PATCH_STEP_M, PATCH_SLOPE = 20, 0.012, 0.01
TOUCHING = 1.2  # largest gap between a patch and the wall that it touches, in sizes of a cell
# Largest deviation from the trend of the neighbours, in standard deviations; least limit, m
TREND, LEAST_TREND_M = 3.0, 0.002
REFINE_BINS = 2  # least number of bins beside a mode that its mean includes


@dataclass(frozen=True)
class SideWall:
    """Wall in the cells of one side.

    Attributes
    ----------
    why : ndarray of uint8, shape (rows, columns)
        Class of each cell: WALL, EMPTY, FEW, OBSTRUCTED, STEEP or OFF_TREND.
    low, high : ndarray of int, shape (rows, columns)
        First and last bin of the mean distance.
    other : ndarray of int, shape (rows, columns)
        Bin of the largest mode that is not wall, or -1.
    surfaces : tuple
        Surfaces that are not wall, the largest first: (share of the cells, median distance in bins,
        indices of the modes).
    two_modes : ndarray of bool, shape (rows, columns)
        Cells of the wall with a second mode.
    """

    why: np.ndarray
    low: np.ndarray
    high: np.ndarray
    other: np.ndarray
    surfaces: tuple
    two_modes: np.ndarray

    def wall_bins(self, bins):
        """Whether each bin (rows, columns, bins) belongs to the mean distance of the wall."""
        number = np.arange(bins)
        within = (number >= self.low[..., None]) & (number <= self.high[..., None])
        return within & (self.why == WALL)[..., None]


def grow_wall(counts, *, column_m, row_m, bin_m, joined_rows=()):
    """Find the wall in the histograms of cells.

    Parameters
    ----------
    counts : ndarray of int, shape (rows, columns, bins)
        Number of points in each bin.
    column_m : ndarray, shape (rows,)
        Width of the cells of each row, m.
    row_m, bin_m : float
        Height of a cell and width of a bin, m.
    joined_rows : sequence of int, optional
        Rows that begin at a joint, where the wall may have a step.

    Returns
    -------
    SideWall
    """
    occupied = _occupied_bins(counts)
    runs = _Runs(counts, occupied)
    # A mode wider than noise and slope permit is not a wall.
    widest = NOISE_BINS + STEEPEST * np.maximum(column_m, row_m) / bin_m
    total = counts.sum(axis=2)
    steep = runs.high - runs.low + 1 > widest.ravel()[runs.cell // counts.shape[1]]
    is_valid = (runs.count >= LEAST_SHARE * total.ravel()[runs.cell]) & (runs.count >= 3) & ~steep
    label = _label_surfaces(occupied, runs, is_valid, joined_rows)
    shape = total.shape
    wall = _join_patches(runs, label, shape, np.broadcast_to(column_m, shape[0]), row_m, bin_m)
    chosen = _choose_wall_modes(runs, wall, shape)
    # Later classes overwrite earlier ones.
    why = np.full(total.size, OBSTRUCTED, dtype=np.uint8)
    why[(total < FEWEST).ravel()] = FEW
    why[(total == 0).ravel()] = EMPTY
    cells_steep = np.zeros(total.size, dtype=bool)
    cells_steep[runs.cell[steep]] = True
    why[cells_steep & (why == OBSTRUCTED)] = STEEP
    has_wall = chosen >= 0
    why[has_wall & (total >= FEWEST).ravel()] = WALL
    low, high = np.zeros((2, total.size), dtype=np.int64)
    run = chosen[has_wall]
    reach = np.maximum((runs.high[run] - runs.low[run] + 1) // 2, REFINE_BINS)
    low[has_wall] = np.maximum(runs.low[run] - reach, 0)
    high[has_wall] = np.minimum(runs.high[run] + reach, counts.shape[2] - 1)
    other, has_two = _find_second_modes(runs, is_valid, chosen, has_wall, total.size)
    return SideWall(
        why.reshape(shape),
        low.reshape(shape),
        high.reshape(shape),
        other.reshape(shape),
        _describe_surfaces(runs, is_valid, label, wall, np.count_nonzero(total >= FEWEST)),
        has_two.reshape(shape),
    )


def find_off_trend(values, sds, wall):
    """Cells of a wall that deviate from the trend of their neighbours.

    A trend is the mean of two opposite neighbours, or the straight line through two neighbours on
    one side, along a row or a column. The deviation from the nearest trend counts, because the form
    of a wall is smooth in at least one direction.

    Parameters
    ----------
    values, sds : ndarray, shape (rows, columns)
        Distances and their standard deviations, m.
    wall : ndarray of bool, shape (rows, columns)
        Cells of the wall.

    Returns
    -------
    ndarray of bool, shape (rows, columns)
    """
    known = np.where(wall, values, np.nan)
    deviation = np.full(values.shape, np.inf)
    second_difference = np.full(values.shape, np.nan)
    for axis in (0, 1):
        shifted = {step: _shift(known, step, axis) for step in (-4, -3, -2, -1, 1, 2, 3, 4)}
        trends = [(shifted[-k] + shifted[k]) / 2 for k in (1, 2, 3)]
        trends += [s * shifted[k] - (s - 1) * shifted[n] for k, n, s in _LINES]
        for trend in trends:
            deviation = np.fmin(deviation, np.abs(values - trend))
        if axis == 0:
            second_difference = values - trends[0]
    scatter = estimate_spread(second_difference)
    limit = np.maximum(TREND * np.hypot(scatter, np.nan_to_num(sds)), LEAST_TREND_M)
    return wall & ~(deviation <= limit)


_LINES = tuple((sign * k, sign * 2 * k, 2) for sign in (-1, 1) for k in (1, 2))


def estimate_spread(second_differences):
    """Standard deviation of a value, from the median of absolute second differences.

    A second difference is the deviation from the mean of two neighbours; its variance is 1.5 s2.
    """
    known = np.abs(second_differences[np.isfinite(second_differences)])
    return SD_OVER_MEDIAN * float(np.median(known)) / np.sqrt(1.5) if len(known) else 0.0


def _shift(values, step, axis):
    """Values of the neighbour at `step` cells; the columns are closed, the rows are not."""
    moved = np.roll(values, -step, axis=axis)
    if axis == 0:
        moved[-step:] = np.nan if step > 0 else moved[-step:]
        if step < 0:
            moved[:-step] = np.nan
    return moved


def _occupied_bins(counts):
    """Bins whose count is a sufficient share of the fullest bin of their cell."""
    peak = counts.max(axis=2, keepdims=True)
    wide = counts.copy()
    wide[..., 1:] += counts[..., :-1]
    wide[..., :-1] += counts[..., 1:]
    sparse = peak < SURE
    used = np.where(sparse, wide, counts)
    peak = np.where(sparse, wide.max(axis=2, keepdims=True), peak)
    return (used >= np.maximum(OCCUPIED * peak, 1)) & (counts.sum(axis=2, keepdims=True) >= FEWEST)


class _Runs:
    """Modes of the cells, as runs of neighbouring occupied bins.

    Each mode has its cell, first and last bin (`low`, `high`), `count` and `middle`, shape (n,).
    """

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


def _label_surfaces(occupied, runs, is_valid, joined_rows):
    """Number of the surface that each mode (runs,) belongs to, or 0."""
    rows, columns, bins = occupied.shape
    keep = np.zeros((rows * columns, bins + 1), dtype=np.int8)
    np.add.at(keep, (runs.cell[is_valid], runs.low[is_valid]), 1)
    np.add.at(keep, (runs.cell[is_valid], runs.high[is_valid] + 1), -1)
    block = np.cumsum(keep, axis=1)[:, :-1].reshape(occupied.shape) > 0
    structure = np.zeros((3, 3, 3), dtype=bool)
    structure[:, 1, :] = structure[1, :, :] = True
    labels, count = scipy.ndimage.label(block, structure=structure)
    # Unite surfaces across the first column, and across joints, where a step of 4 bins is allowed.
    pairs = [_touching_labels(labels[:, -1], labels[:, 0], 1)]
    pairs += [
        _touching_labels(labels[row - 1], labels[row], 4) for row in joined_rows if 0 < row < rows
    ]
    labels = _unite_labels(labels, count, np.vstack(pairs))
    surface_of_run = np.zeros(len(runs.cell), dtype=np.int64)
    surface_of_run[is_valid] = labels.reshape(-1, bins)[runs.cell[is_valid], runs.low[is_valid]]
    return surface_of_run


def _touching_labels(first, second, reach):
    """Pairs of labels in two lines of cells (n, bins) that are at most `reach` bins apart."""
    pairs = []
    bins = first.shape[1]
    for step in range(-reach, reach + 1):
        a = first[:, max(0, -step) : bins - max(0, step)]
        b = second[:, max(0, step) : bins - max(0, -step)]
        both = (a > 0) & (b > 0)
        pairs.append(np.column_stack([a[both], b[both]]))
    return np.unique(np.vstack(pairs), axis=0)


def _unite_labels(labels, count, pairs):
    """Give connected pairs of labels a common label; 0 remains 0."""
    links = coo_array((np.ones(len(pairs)), pairs.T), shape=(count + 1, count + 1))
    number = connected_components(links, directed=False)[1]
    number = np.where(np.arange(count + 1) == 0, 0, number + 1)
    return number[labels]


def _join_patches(runs, label, shape, column_m, row_m, bin_m):
    """Whether each mode (runs,) is wall: the largest surface, and patches that continue it."""
    size = np.bincount(label, minlength=1)
    size[0] = 0
    wall = (label == np.argmax(size)) & (label > 0)
    # A joined patch extends the wall, so that further patches can join in the next iteration.
    candidates = np.argsort(-size, kind="stable")[1:]
    candidates = [patch for patch in candidates if size[patch] >= LEAST_PATCH]
    row, column = np.divmod(runs.cell, shape[1])
    for _ in range(10):
        step, gap = _distance_from_wall(runs, wall, row, column, shape, column_m, row_m)
        joined = []
        for patch in candidates:
            members = label == patch
            is_known = members & np.isfinite(step)
            if np.count_nonzero(is_known) < LEAST_PATCH / 2:
                continue
            allowed = PATCH_STEP_M + PATCH_SLOPE * np.median(gap[is_known])
            is_adjacent = is_known & (gap <= TOUCHING * max(row_m, float(column_m.max())))
            if np.count_nonzero(is_adjacent) >= LEAST_PATCH / 2 and (
                np.median(np.abs(step[is_adjacent])) * bin_m > PATCH_STEP_M
            ):
                continue  # the patch touches the wall with a step
            if np.median(np.abs(step[is_known])) * bin_m <= allowed:
                joined.append(patch)
        if not joined:
            break
        wall |= np.isin(label, joined)
        candidates = [patch for patch in candidates if patch not in joined]
    return wall


def _distance_from_wall(runs, wall, row, column, shape, column_m, row_m):
    """Distance of each mode (runs,) from the nearest wall in its row or column.

    Returns
    -------
    step : ndarray, shape (runs,)
        Deviation of the mode from the interpolated wall, bins.
    gap : ndarray, shape (runs,)
        Distance along the surface to the nearest wall, m.
    """
    known = np.full(shape, np.nan)
    known[row[wall], column[wall]] = runs.middle[wall]
    around, gap = _interpolate(np.concatenate([known, known, known], axis=1))
    around, gap = (array[:, shape[1] : 2 * shape[1]] for array in (around, gap))
    gap = gap * column_m[:, None]
    up, high = (array.T for array in _interpolate(known.T.copy()))
    nearer = ~(gap <= high * row_m)
    values, distance = np.where(nearer, up, around), np.where(nearer, high * row_m, gap)
    return runs.middle - values[row, column], distance[row, column]


def _interpolate(values):
    """Interpolate lines (n, k) linearly; return values and distance to the nearest known cell."""
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


def _choose_wall_modes(runs, wall, shape):
    """Mode of the wall in each cell (cells,), or -1; of several modes, the nearest to the trend."""
    cells = shape[0] * shape[1]
    chosen = np.full(cells, -1)
    index = np.flatnonzero(wall)
    order = index[np.argsort(runs.count[index], kind="stable")]
    chosen[runs.cell[order]] = order
    # The fullest mode is the default. Cells with several modes take the mode nearest to the trend
    # of the cells with a single mode.
    several = np.bincount(runs.cell[index], minlength=cells) > 1
    if not several.any():
        return chosen
    middle = np.full(cells, np.nan)
    middle[(chosen >= 0) & ~several] = runs.middle[chosen[(chosen >= 0) & ~several]]
    around = _interpolate(np.tile(middle.reshape(shape), (1, 3)))[0][:, shape[1] : 2 * shape[1]]
    up = _interpolate(middle.reshape(shape).T.copy())[0].T
    trend = np.nanmean(np.stack([np.nan_to_num(around), np.nan_to_num(up)]), axis=0).ravel()
    candidates = index[several[runs.cell[index]]]
    order = candidates[
        np.argsort(-np.abs(runs.middle[candidates] - trend[runs.cell[candidates]]), kind="stable")
    ]
    chosen[runs.cell[order]] = order
    return chosen


def _find_second_modes(runs, is_valid, chosen, has, cells):
    """Bin of the largest mode (cells,) that is not the wall, and whether the cell has both."""
    other, has_two = np.full(cells, -1), np.zeros(cells, dtype=bool)
    rest = np.flatnonzero(is_valid & (chosen[runs.cell] != np.arange(len(runs.cell))))
    order = rest[np.argsort(runs.count[rest], kind="stable")]
    other[runs.cell[order]] = runs.middle[order].astype(np.int64)
    has_two[runs.cell[rest]] = True
    return other, has_two & has


def _describe_surfaces(runs, is_valid, label, wall, seen):
    """Share of the cells, median distance (bins) and modes of surfaces that are not wall."""
    index = np.flatnonzero(is_valid & ~wall & (label > 0))
    size = np.bincount(label[index], minlength=1)
    surfaces = []
    for number in np.argsort(-size, kind="stable")[:20]:
        if size[number]:
            members = index[label[index] == number]
            surfaces.append(
                (size[number] / max(seen, 1), float(np.median(runs.middle[members])), members)
            )
    return tuple(surfaces)
