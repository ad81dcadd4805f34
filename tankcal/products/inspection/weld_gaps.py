"""Gaps between the wall and boards laid over welds.

e(s) is the deviation of the wall from a circle along the arc, or from a straight line up the wall.
It is positive outwards; s is the distance from the weld. A board of length b touches the wall with
both ends, and the gap is

    g(s) = e(s) - [e(-b/2) + e(b/2)] / 2 - s [e(b/2) - e(-b/2)] / b

A shift or a tilt of the profile cancels. The gaps are computed for each scan, then averaged over
the scans. The errors that all points of a scan share (offset, scale and registration) therefore
cancel to first order. The noise of a gap follows from the noise of its cells. Neighbouring cells
may have common noise. The scatter of the gaps of boards side by side along the welds determines
the additional noise. Source: docs/inspection.md.

Peaking and banding: the largest gap of each weld and of all welds, from the points of scans.

The expanded uncertainty of the largest gap accounts for all gaps that may be the largest.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.messages import message
from tankcal.methods.clouds.passes import Placing, Reading, Telling, open_passes
from tankcal.products.inspection.welds import (
    ALONG_M,
    BANDING,
    BINS,
    COUNT_BYTES,
    PEAKING,
    build_round_grid,
    build_upright_grid,
    choose_cell_width,
    fill_weld_cells,
    list_welds,
    locate_wall,
)
from tankcal.record.inspection import WeldGap
from tankcal.uncertainty import coverage_factor
from tankcal.units import FULL_TURN, MM_PER_M

BOARD_M = 0.914  # length of the board, 36 in
ENDS_M = (-BOARD_M / 2, BOARD_M / 2)  # ends of the board from the weld
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


def profile_gaps(s_m, e_m, sd_m, *, has_bead=False):
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
    has_bead : bool, optional
        Whether a bead hides the weld. If so, the wall under the bead is extrapolated from both
        sides.

    Examples
    --------
    >>> s = np.linspace(-0.55, 0.55, 89)
    >>> gaps = profile_gaps(s, 0.008 * np.exp(-abs(s) / 0.15), np.full(89, 2e-4))
    >>> round(float(np.nanmax(gaps.gap_m)), 5), round(float(gaps.noise_m2[44] ** 0.5), 6)
    (0.00762, 0.000208)
    """
    cell = float(s_m[1] - s_m[0])
    bead = has_bead & (np.abs(s_m) <= BEAD_M + 1e-9)
    known = np.isfinite(e_m) & ~bead
    if not _has_no_hole(s_m[known | bead], cell):
        return None
    if _has_step(s_m[known], e_m[known]):
        return None
    weights = _weights(s_m.tobytes(), known.tobytes(), bead.tobytes())
    if weights is None:
        return None
    # Unknown cells have weight 0; their nan must not enter the products.
    e = np.where(known, e_m, 0.0)
    variance = np.where(known, sd_m, 0.0) ** 2
    gap, missed = np.full((2, len(s_m)), np.nan)
    within = (known | bead) & (np.abs(s_m) <= BOARD_M / 2 + 1e-9)
    gap[within] = (weights @ e)[within]
    # Variance a^2 / 3 of a uniform distribution of half width a, the second difference / MISSED.
    missed[known] = _second_differences(s_m[known], e[known], variance[known]) / MISSED**2 / 3
    if bead.any():
        missed[bead] = _extrapolation_squares(s_m, e, bead, known, gap) / MISSED**2 / 3
    # The gap contains half of each end, hence a quarter of the variance of each end.
    ends = [float(np.nanmean(missed[np.abs(s_m - at) <= END_M])) for at in ENDS_M]
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


def _has_no_hole(s_m, cell):
    """Whether cells cover the reach on both sides of the weld without a hole."""
    near = s_m[np.abs(s_m) <= REACH_M + cell]
    if len(near) < 3 or near[0] > cell - REACH_M or near[-1] < REACH_M - cell:
        return False
    return np.diff(near).max() <= max(HOLE_M, 1.5 * cell)


def _has_step(s_m, e_m):
    """Whether the wall under a board rises within two cells by more than a plate can."""
    inside = np.abs(s_m) <= BOARD_M / 2 + END_M
    s, e = s_m[inside], e_m[inside]
    return any(
        np.any(np.abs(e[by:] - e[:-by]) > np.maximum(STEP_M, STEEP * (s[by:] - s[:-by])))
        for by in (1, 2)
    )


@lru_cache(maxsize=512)
def _weights(s_bytes, known_bytes, bead_bytes):
    """Weights (n, n) of the deviations in the gaps, or None if an end of the board has no cells.

    The weights are cached because most boards have the same known cells.
    """
    s = np.frombuffer(s_bytes)
    known, bead = np.frombuffer(known_bytes, dtype=bool), np.frombuffer(bead_bytes, dtype=bool)
    cell = s[1] - s[0]
    lines = [_line_at(s, known, at, max(END_M, 1.5 * cell)) for at in ENDS_M]
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
    return weights - (low + high) / 2 - s[:, None] * (high - low) / BOARD_M


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


TOGETHER = 2  # number of boards averaged along the weld, 0.3 m
LAGS = 2, 4, 6  # distances of compared boards, in boards; at these distances no point is shared
FEWEST = 20  # least number of gaps for an estimate of the scatter
LEAST_BEAD_M, SURE_BEAD = 0.001, 3.0  # least height of a bead: absolute, and in its sd
LEAST_PEAK_M = 0.002  # least height of a peak to which a loose weld is moved


@dataclass(frozen=True)
class Boards:
    """Gaps of the boards along a weld.

    Attributes
    ----------
    weld : KnownWeld
    s_m : ndarray, shape (cells,)
        Distances across the weld, m.
    along : ndarray, shape (boards,)
        Middle of each board: its height on a vertical weld, m; its azimuth on a horizontal weld,
        rad.
    gap_m, noise_m2, missed_m2 : ndarray, shape (boards, cells)
        Gaps and variances as in `BoardGaps`; nan if not determined.
    """

    weld: object
    s_m: np.ndarray
    along: np.ndarray
    gap_m: np.ndarray
    noise_m2: np.ndarray
    missed_m2: np.ndarray


def board_reach(weld, across_m):
    """Distance from a weld within which cells are required, m."""
    return BOARD_M / 2 + weld.loose_m + max(END_M, 1.5 * across_m) + 2 * across_m


def lay_boards(wall, weld, across_m, grid, distance, sd):
    """Compute the `Boards` of a weld.

    A loose weld is moved to its peak. If the weld has a bead, the wall under the bead is
    extrapolated from both sides.

    Parameters
    ----------
    wall : CloudWall
        Coarse cells of the wall.
    weld : KnownWeld
        The weld.
    across_m : float
        Approximate width of a fine cell, m.
    grid : FineGrid
        Fine cells beside the welds of this kind.
    distance, sd : ndarray, shape (scans, slots + 1)
        Distances of the wall in the fine cells and their standard deviations, m, of `locate_wall`.
    """
    profiles = _profiles(wall, weld, across_m, grid, distance, sd)
    boards = _average_boards(weld, *profiles)
    if weld.loose_m and (offset := _peak_offset(boards)):
        azimuth = (weld.azimuth_rad + offset / wall.surface.radius_m) % FULL_TURN
        weld = replace(weld, azimuth_rad=azimuth)
        profiles = _profiles(wall, weld, across_m, grid, distance, sd)
        boards = _average_boards(weld, *profiles)
    if _has_bead(boards):
        boards = _average_boards(weld, *profiles, has_bead=True)
    return boards


def _profiles(wall, weld, across_m, grid, distance, sd):
    """Distances (cells,) across and (bands,) along; deviations and sds (scans, bands, cells)."""
    reach = board_reach(replace(weld, loose_m=0.0), across_m)
    if weld.kind == PEAKING:
        step = FULL_TURN * wall.surface.radius_m / grid.columns
        centre_column = round(weld.azimuth_rad / FULL_TURN * grid.columns - 0.5)
        column = centre_column + np.arange(-int(reach / step), int(reach / step) + 1)
        turn = (column + 0.5) * FULL_TURN / grid.columns
        s = (turn - weld.azimuth_rad) * wall.surface.radius_m
        height = grid.middles_m - wall.joints_m[0]
        rows = np.flatnonzero((height > weld.low_m) & (height < weld.high_m))
        slot, along = grid.slot[rows][:, column % grid.columns], height[rows]
    else:
        s = grid.middles_m - wall.joints_m[0] - weld.low_m
        rows = np.flatnonzero(np.abs(s) <= reach)
        slot, s = grid.slot[rows].T, s[rows]
        along = (np.arange(grid.columns) + 0.5) * FULL_TURN / grid.columns
    return s, along, distance[:, slot], sd[:, slot]


def _average_boards(weld, s, along, e, sd, has_bead=False):
    """`Boards` of two bands each, as means over the scans with weights 1 / noise variance."""
    gap, noise, missed = np.full((3, *e.shape), np.nan)
    for scan, band in np.ndindex(e.shape[:2]):
        board = profile_gaps(s, e[scan, band], sd[scan, band], has_bead=has_bead)
        if board is not None:
            gap[scan, band], noise[scan, band] = board.gap_m, board.noise_m2
            missed[scan, band] = board.missed_m2
    weight = np.where(np.isfinite(gap), 1 / noise, 0.0)
    sums = [weight.sum(axis=0), np.nansum(weight * gap, axis=0), np.nansum(weight * missed, axis=0)]
    if weld.kind == BANDING:
        sums = [part + np.roll(part, -1, axis=0) for part in sums]
        along = along + (along[1] - along[0]) / 2
    elif len(along) >= TOGETHER:
        sums = [part[1:] + part[:-1] for part in sums]
        along = (along[1:] + along[:-1]) / 2
    # Mean of the sums; the noise variance of the mean is 1 / sum of weights.
    total = np.where(sums[0] > 0, sums[0], np.nan)
    return Boards(weld, s, along, sums[1] / total, 1 / total, sums[2] / total)


def _median_gaps(boards):
    """Medians (cells,) of the known gaps of all boards, m; nan without a known gap."""
    known = np.isfinite(boards.gap_m)
    determined = known.any(axis=0)
    medians = np.full(len(boards.s_m), np.nan)
    medians[determined] = np.nanmedian(boards.gap_m[:, determined], axis=0)
    return medians


def _peak_offset(boards):
    """Offset of the middle of a peak from a loose weld, m; 0 without a peak."""
    near = np.where(np.abs(boards.s_m) <= boards.weld.loose_m, np.abs(_median_gaps(boards)), np.nan)
    if not np.nanmax(np.nan_to_num(near)) > LEAST_PEAK_M:
        return 0.0
    return float(boards.s_m[np.nanargmax(near)])


def _has_bead(boards):
    """Whether the weld has a significant bead."""
    height = abs(bead_height(boards.s_m, _median_gaps(boards)))
    known = boards.noise_m2[np.isfinite(boards.noise_m2)]
    if not len(known):
        return False
    return height > max(LEAST_BEAD_M, SURE_BEAD * np.sqrt(np.median(known) / len(boards.along)))


def noise_factor(boards):
    """Ratio (>= 1) of the scatter of the gaps between boards to the noise of their cells.

    The gap of a board is compared with the mean of two boards at equal distances on both sides. If
    the wall changes linearly along the weld, the difference contains only noise. Boards at three
    distances are used, which share no point, and the largest scatter is returned. The scatter is
    estimated by medians: a single bend of the wall has no effect, but many bends increase U.

    Parameters
    ----------
    boards : sequence of Boards
        Boards of all welds of a kind.

    Returns
    -------
    float
    """
    ratios = {lag: [] for lag in LAGS}
    for item in boards:
        near = np.abs(item.s_m) <= REACH_M + 1e-9
        gap, noise = item.gap_m[:, near], item.noise_m2[:, near]
        for lag in LAGS:
            if len(gap) > 2 * lag:
                differences = gap[lag:-lag] - (gap[: -2 * lag] + gap[2 * lag :]) / 2
                sd = np.sqrt(noise[lag:-lag] + (noise[: -2 * lag] + noise[2 * lag :]) / 4)
                known = np.isfinite(differences)
                ratios[lag].append(np.abs(differences[known] / sd[known]))
    pooled = [np.concatenate(item) for item in ratios.values() if item]
    medians = [float(np.median(item)) for item in pooled if len(item) >= FEWEST]
    return max(1.0, SD_OVER_MEDIAN * max(medians, default=0.0))


MEMORY_BYTES = 512 << 20  # memory of the histograms; more welds require several passes


def find_gaps(result, limits_mm, reading=None, progress=None):
    """Determine the gaps at the welds of a computed job from its clouds.

    Without clouds, no gap is determined, with the remark "gap_no_cloud".

    Parameters
    ----------
    result : tankcal.pipeline.chain.Result
        Result for an upright tank. The files of its clouds are read again.
    limits_mm : dict
        Limits of the rule, {"peaking": mm, "banding": mm}. A missing key is an unknown limit.
    reading : tankcal.methods.clouds.passes.Reading, optional
        Number of workers; by default the files are read in this process.
    progress : callable, optional
        Function that receives a message for each step.

    Returns
    -------
    WeldGaps

    Raises
    ------
    InputError
        If the file of a cloud cannot be read.
    """
    job, clouded = result.job, result.sights.get("clouds")
    heights = [course.height_m for course in job.courses]
    given = [course.welds_rad for course in job.courses]
    if clouded is None:
        return empty_gaps(list_welds(heights, given), "gap_no_cloud")
    wall, reading = clouded.cells, reading or Reading()
    welds = list_welds(heights, given, wall.welds, wall.surface.radius_m)
    telling = Telling(progress, reading.part_progress)
    placing = Placing.of(job.clouds, clouded.registration)
    with open_passes(placing, reading, telling) as passes:
        telling.step(
            message("cloud_weld_pass", "laying boards over {count} welds", count=len(welds))
        )
        return find_gaps_in_cloud(passes, wall, welds, limits_mm)


def find_gaps_in_cloud(passes, wall, welds, limits_mm, *, memory_bytes=MEMORY_BYTES):
    """Determine the gaps at the welds of an upright tank from the points of its scans.

    Parameters
    ----------
    passes : object
        Object with a method `gather(taken_of, *sizes)` that processes all points, such as
        `tankcal.clouds.wall.Passes`, `JobPasses` or `ClusterPasses`.
    wall : tankcal.clouds.wall.CloudWall
        Coarse cells of the same points.
    welds : sequence of KnownWeld
        Welds of `list_welds`, with heights above the lowest joint of the wall.
    limits_mm : dict
        Limits, {"peaking": mm, "banding": mm}. A gap whose u exceeds a quarter of its limit is not
        determined. With a missing key, a gap is determined for any u.
    memory_bytes : int, optional
        Memory of the fine cells. If the welds require more, they are processed in several passes.

    Returns
    -------
    WeldGaps
        Gaps in the order of the welds, with profiles of the three largest gaps of each kind. The k
        of U accounts for all gaps that may be the largest (two-sided, 95 % for all together).
    """
    across_m = choose_cell_width(wall)
    boards = []
    for batch in _batches(welds, wall, across_m, memory_bytes):
        boards += _board_batch(passes, wall, batch, across_m)
    gaps, figures = [None] * len(welds), []
    for kind in (PEAKING, BANDING):
        places = [i for i, weld in enumerate(welds) if weld.kind == kind]
        batch, figure = select_largest_gaps(kind, [boards[i] for i in places], limits_mm.get(kind))
        for i, gap in zip(places, batch, strict=True):
            gaps[i] = gap
        figures.append(figure)
    return WeldGaps(tuple(gaps), tuple(figures))


def _batches(welds, wall, across_m, memory_bytes):
    """Yield lists of welds whose cells fit into `memory_bytes`."""
    cell_bytes, around_m = len(wall.sides) * BINS * COUNT_BYTES, FULL_TURN * wall.surface.radius_m
    batch, used_bytes = [], 0
    for weld in welds:
        rows = 2 * board_reach(weld, across_m) / across_m
        tall = weld.high_m - weld.low_m
        along = (around_m if weld.kind == BANDING else tall) / ALONG_M + 1
        required_bytes = cell_bytes * rows * along
        if batch and used_bytes + required_bytes > memory_bytes:
            yield batch
            batch, used_bytes = [], 0
        batch.append(weld)
        used_bytes += required_bytes
    if batch:
        yield batch


def _board_batch(passes, wall, welds, across_m):
    """`Boards` of welds, from one pass over the points."""
    grids = {}
    for kind, grid_of in ((PEAKING, build_upright_grid), (BANDING, build_round_grid)):
        if strips := [(weld, board_reach(weld, across_m)) for weld in welds if weld.kind == kind]:
            grids[kind] = grid_of(wall, strips, across_m)
    cells = passes.gather(fill_weld_cells, wall.surface, tuple(grids.values()))
    fields = {
        kind: (grid, *locate_wall(grid, counts))
        for (kind, grid), counts in zip(grids.items(), cells.counts, strict=True)
    }
    return [lay_boards(wall, weld, across_m, *fields[weld.kind]) for weld in welds]


# Least share of determined boards: for a determined weld, and for all welds without a remark.
LEAST_SEEN, WELL_SEEN = 0.5, 0.9
KEPT = 3  # number of profiles saved for each kind of weld, at the largest gaps
PROBABILITY = 0.95  # coverage probability of U


@dataclass(frozen=True)
class GapFigure:
    """Largest gap of one kind of weld.

    Attributes
    ----------
    code : str
        "peaking" or "banding".
    value_mm, U_mm, k : float or None
        Gap, positive outwards, its expanded uncertainty and coverage factor; None if no gap is
        determined at any weld.
    course : int or None
        Course, counted from 1 at the bottom.
    height_m, azimuth_deg : float or None
        Middle of the board: height above the bottom of the shell, and azimuth clockwise from +y.
    used : int
        Number of welds with a determined gap.
    remark : str or None
        Without a value: "gap_no_weld", "gap_no_cloud", "gap_too_sparse" or "gap_too_uncertain".
        With a value: "gap_not_all" if some welds have no determined gap, "gap_partly_seen" if no
        board can be laid over some parts of the welds, or None.
    remark_values : dict
        Number of `welds` and of `determined` welds. With a value, also `seen`, the share of
        determined boards of these welds. For "gap_too_uncertain", also the least u, `u_mm`, and
        its limit, `most_mm`.
    """

    code: str
    value_mm: float | None
    U_mm: float | None
    k: float | None
    course: int | None
    height_m: float | None
    azimuth_deg: float | None
    used: int
    remark: str | None
    remark_values: dict


@dataclass(frozen=True)
class WeldGaps:
    """Gaps at the welds: a `WeldGap` for each weld, and a `GapFigure` for each kind of weld."""

    gaps: tuple
    figures: tuple


def select_largest_gaps(kind, boards, limit_mm):
    """Determine the largest gap of each weld of a kind, and of all these welds.

    Parameters
    ----------
    kind : str
        "peaking" or "banding".
    boards : sequence of Boards
        Boards of each weld of this kind.
    limit_mm : float or None
        Limit of the gap, mm; None if unknown.

    Returns
    -------
    list of WeldGap
        One gap for each weld.
    GapFigure
        Largest gap of all welds.
    """
    if not boards:
        return [], _no_figure(kind, 0, "gap_no_weld")
    # Neighbouring cells may share noise, so the variance of the noise is scaled.
    noise_scale = noise_factor(boards) ** 2
    most_m = np.inf if limit_mm is None else UNCERTAIN * limit_mm / MM_PER_M
    largest = [_largest(item, noise_scale, most_m) for item in boards]
    determined = [item.seen >= LEAST_SEEN for item in largest]
    sizes = [
        abs(item.gap_m) if known else -1.0 for item, known in zip(largest, determined, strict=True)
    ]
    order = np.argsort(sizes, kind="stable")[::-1]
    kept = set(order[:KEPT].tolist())
    gaps = [
        _weld_gap(item, gap, noise_scale, i in kept) if determined[i] else _no_gap(item.weld)
        for i, (item, gap) in enumerate(zip(boards, largest, strict=True))
    ]
    if not any(determined):
        least_m = min(item.least_u_m for item in largest)
        if not most_m < least_m < np.inf:
            return gaps, _no_figure(kind, len(boards), "gap_too_sparse")
        figure = _no_figure(kind, len(boards), "gap_too_uncertain")
        figure.remark_values.update(u_mm=MM_PER_M * least_m, most_mm=MM_PER_M * most_m)
        return gaps, figure
    known = [(boards[i], largest[i]) for i in np.flatnonzero(determined)]
    return gaps, _figure(kind, gaps[order[0]], largest[order[0]], known, len(boards), noise_scale)


def _figure(kind, gap, worst, known, welds, noise_scale):
    """`GapFigure` of the largest gap; `known` has (Boards, _Largest) of each determined weld."""
    # Gaps that may exceed the largest gap within 2 u of both are candidates for the true maximum.
    rivals = sum(_rivals(*pair, noise_scale, abs(worst.gap_m) - 2 * worst.u_m) for pair in known)
    k = maximum_coverage_factor(rivals)
    seen = float(np.mean([gap_of_weld.seen for _, gap_of_weld in known]))
    remark = "gap_partly_seen" if seen < WELL_SEEN else None
    return GapFigure(
        code=kind,
        value_mm=gap.gap_mm,
        U_mm=MM_PER_M * k * worst.u_m,
        k=k,
        course=gap.course,
        height_m=gap.height_m,
        azimuth_deg=gap.azimuth_deg,
        used=len(known),
        remark="gap_not_all" if len(known) < welds else remark,
        remark_values={"welds": welds, "determined": len(known), "seen": seen},
    )


def empty_gaps(welds, remark):
    """`WeldGaps` without any determined gap, as for a survey by points or strapping."""
    figures = []
    for kind in (PEAKING, BANDING):
        count = sum(weld.kind == kind for weld in welds)
        figures.append(_no_figure(kind, count, remark if count else "gap_no_weld"))
    return WeldGaps(tuple(_no_gap(weld) for weld in welds), tuple(figures))


def maximum_coverage_factor(rivals):
    """Coverage factor k of the largest of independent gaps.

    With a probability of 95 %, the error of none of the `rivals` gaps exceeds k u.

    >>> round(maximum_coverage_factor(1), 3), round(maximum_coverage_factor(20), 3)
    (1.96, 3.016)
    """
    return float(coverage_factor(PROBABILITY ** (1 / rivals), np.inf))


@dataclass(frozen=True)
class _Largest:
    """Largest gap of a weld.

    Attributes
    ----------
    board, cell : int
        Board and cell of the gap.
    gap_m, u_m : float
        Gap and its standard uncertainty, m.
    sure : ndarray of bool, shape (boards,)
        Boards that have a gap with a sufficiently small u.
    least_u_m : float
        Smallest u of all gaps, m; inf if no board has a gap.
    """

    board: int
    cell: int
    gap_m: float
    u_m: float
    sure: np.ndarray
    least_u_m: float

    @property
    def seen(self):
        """Share of the boards with a determined gap."""
        return float(np.mean(self.sure))


def _largest(boards, noise_scale, most_m):
    """`_Largest` within reach of the weld, from boards whose u is at most `most_m`."""
    sizes = np.where(np.isfinite(boards.gap_m), np.abs(boards.gap_m), -1.0)
    sizes[:, np.abs(boards.s_m) > REACH_M + 1e-9] = -1.0
    cell = np.argmax(sizes, axis=1)
    row = np.arange(len(cell))
    u = np.where(sizes[row, cell] >= 0, _standard_u(boards, noise_scale)[row, cell], np.inf)
    sure = (u < np.inf) & (u <= most_m)
    board = int(np.argmax(np.where(sure, sizes[row, cell], -1.0)))
    place = board, int(cell[board])
    return _Largest(*place, float(boards.gap_m[place]), float(u[board]), sure, float(u.min()))


def _standard_u(boards, noise_scale):
    """Standard uncertainties of the gaps, m; `noise_scale` multiplies the variance of the noise."""
    return np.sqrt(noise_scale * boards.noise_m2 + boards.missed_m2)


def _rivals(boards, largest, noise_scale, least_m):
    """Number of independent gaps of a weld whose value plus 2 u reaches `least_m`."""
    near = np.abs(boards.s_m) <= REACH_M + 1e-9
    with np.errstate(invalid="ignore"):
        is_candidate = np.abs(boards.gap_m) + 2 * _standard_u(boards, noise_scale) >= least_m
    return max(1, -(-np.count_nonzero(is_candidate[largest.sure][:, near]) // TOGETHER))


def _weld_gap(boards, largest, noise_scale, with_profile):
    """`WeldGap` of a determined weld."""
    weld, along = boards.weld, float(boards.along[largest.board])
    is_upright = weld.kind == PEAKING
    profile = boards.gap_m[largest.board]
    rivals = _rivals(boards, largest, noise_scale, abs(largest.gap_m) - 2 * largest.u_m)
    known = np.isfinite(profile) & with_profile
    azimuth = weld.azimuth_rad if is_upright else along
    return WeldGap(
        kind=weld.kind,
        course=weld.course + 1,
        height_m=along if is_upright else weld.low_m,
        azimuth_deg=float(np.degrees(azimuth) % 360),
        gap_mm=MM_PER_M * largest.gap_m,
        U_mm=MM_PER_M * maximum_coverage_factor(rivals) * largest.u_m,
        along_mm=np.round(MM_PER_M * boards.s_m[known], 1).tolist(),
        profile_mm=np.round(MM_PER_M * profile[known], 2).tolist(),
    )


def _no_gap(weld):
    """`WeldGap` of a weld without a determined gap."""
    return WeldGap(
        kind=weld.kind,
        course=weld.course + 1,
        height_m=(weld.low_m + weld.high_m) / 2,
        azimuth_deg=float(np.degrees(weld.azimuth_rad) % 360),
        gap_mm=None,
        U_mm=None,
        along_mm=[],
        profile_mm=[],
    )


def _no_figure(kind, welds, remark):
    """`GapFigure` without a determined gap."""
    values = {"welds": welds, "determined": 0}
    return GapFigure(kind, None, None, None, None, None, None, 0, remark, values)
