"""Gaps of boards laid along welds, combined from all scans.

The gaps of a board are computed for each scan, then averaged over the scans. The common errors of
the points of a scan (offset, scale and registration) therefore cancel to first order. The noise of
a gap follows from the noise of its cells. Neighbouring cells may have common noise. The scatter
of the gaps of boards side by side along the welds determines the additional noise.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.inspection.boards import BOARD_M, END_M, REACH_M, bead_height, gaps_of_profile
from tankcal.inspection.known_welds import BANDING, PEAKING
from tankcal.units import FULL_TURN

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
        Gaps and variances as in `boards.BoardGaps`; nan if not determined.
    """

    weld: object
    s_m: np.ndarray
    along: np.ndarray
    gap_m: np.ndarray
    noise_m2: np.ndarray
    missed_m2: np.ndarray


def reach_of(weld, across_m):
    """Distance from a weld within which cells are required, m."""
    return BOARD_M / 2 + weld.loose_m + max(END_M, 1.5 * across_m) + 2 * across_m


def boards_of(wall, weld, across_m, grid, distance, sd):
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
        Distances of the wall in the fine cells and their standard deviations, m, of `located`.

    Returns
    -------
    Boards
    """
    profiles = _profiles(wall, weld, across_m, grid, distance, sd)
    boards = _averaged_boards(weld, *profiles)
    if weld.loose_m and (offset := _peak_offset(boards)):
        azimuth = (weld.azimuth_rad + offset / wall.surface.radius_m) % FULL_TURN
        weld = replace(weld, azimuth_rad=azimuth)
        profiles = _profiles(wall, weld, across_m, grid, distance, sd)
        boards = _averaged_boards(weld, *profiles)
    if _has_bead(boards):
        boards = _averaged_boards(weld, *profiles, has_bead=True)
    return boards


def _profiles(wall, weld, across_m, grid, distance, sd):
    """Distances (cells,) across and (bands,) along; deviations and sds (scans, bands, cells)."""
    reach = reach_of(replace(weld, loose_m=0.0), across_m)
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


def _averaged_boards(weld, s, along, e, sd, has_bead=False):
    """`Boards` of two bands each, as means over the scans with weights 1 / noise variance."""
    gap, noise, missed = np.full((3, *e.shape), np.nan)
    for scan, band in np.ndindex(e.shape[:2]):
        board = gaps_of_profile(s, e[scan, band], sd[scan, band], has_bead=has_bead)
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
