"""Boards laid along welds: the gaps that each scan tells of them, put together.

Each scan tells the gaps of a board by itself, so that what its points share (offset, scale,
registration) drops out to first order, before the gaps of all scans are averaged. The noise of a
gap is that of its cells; neighbours may share noise, and the scatter of the gaps of boards that are
laid side by side along the welds says how much more it is.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.geometry.outlines import FULL_TURN
from tankcal.inspection.boards import BOARD_M, END_M, REACH_M, bead_height, gaps_of_profile
from tankcal.inspection.known_welds import BANDING, PEAKING

TOGETHER = 2  # boards along the weld that are averaged: 0.3 m
LAGS = 2, 4, 6  # boards between those whose scatter is looked at: apart, they share no point
FEWEST = 20  # gaps that a scatter is told by
LEAST_BEAD_M, SURE_BEAD = 0.001, 3.0  # height of a bead, and over its sd
LEAST_PEAK_M = 0.002  # that a loose weld is put in the middle of


@dataclass(frozen=True)
class Boards:
    """Gaps of the boards along a weld.

    Attributes
    ----------
    weld : KnownWeld
    s_m : ndarray, shape (cells,)
        Places across the weld, m.
    along : ndarray, shape (boards,)
        Middle of each board: height of a vertical weld, m; turn of a horizontal one, rad.
    gap_m, noise_m2, missed_m2 : ndarray, shape (boards, cells)
        As `boards.BoardGaps` has them; nan: not determined.
    """

    weld: object
    s_m: np.ndarray
    along: np.ndarray
    gap_m: np.ndarray
    noise_m2: np.ndarray
    missed_m2: np.ndarray


def reach_of(weld, across_m):
    """How far from a weld cells are asked for, m."""
    return BOARD_M / 2 + weld.loose_m + max(END_M, 1.5 * across_m) + 2 * across_m


def boards_of(wall, weld, across_m, grid, distance, sd):
    """`Boards` of a weld; a loose one is put where its peak is, and a bead is left out."""
    profiles = _profiles(wall, weld, across_m, grid, distance, sd)
    found = _averaged(weld, *profiles)
    if weld.loose_m and (moved := _moved(found)):
        azimuth = (weld.azimuth_rad + moved / wall.surface.radius_m) % FULL_TURN
        weld = replace(weld, azimuth_rad=azimuth)
        profiles = _profiles(wall, weld, across_m, grid, distance, sd)
        found = _averaged(weld, *profiles)
    if _has_bead(found):
        found = _averaged(weld, *profiles, has_bead=True)
    return found


def _profiles(wall, weld, across_m, grid, distance, sd):
    """Places (cells,) across, places (bands,) along, departures and sds (scans, bands, cells)."""
    reach = reach_of(replace(weld, loose_m=0.0), across_m)
    if weld.kind == PEAKING:
        step = FULL_TURN * wall.surface.radius_m / grid.columns
        middle = round(weld.azimuth_rad / FULL_TURN * grid.columns - 0.5)
        column = middle + np.arange(-int(reach / step), int(reach / step) + 1)
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


def _averaged(weld, s, along, e, sd, has_bead=False):
    """`Boards` of two bands each, means over the scans by the noise of their own gaps."""
    gap, noise, missed = np.full((3, *e.shape), np.nan)
    for scan, band in np.ndindex(e.shape[:2]):
        found = gaps_of_profile(s, e[scan, band], sd[scan, band], has_bead=has_bead)
        if found is not None:
            gap[scan, band], noise[scan, band] = found.gap_m, found.noise_m2
            missed[scan, band] = found.missed_m2
    weight = np.where(np.isfinite(gap), 1 / noise, 0.0)
    sums = [weight.sum(axis=0), np.nansum(weight * gap, axis=0), np.nansum(weight * missed, axis=0)]
    if weld.kind == BANDING:
        sums = [one + np.roll(one, -1, axis=0) for one in sums]
        along = along + (along[1] - along[0]) / 2
    elif len(along) >= TOGETHER:
        sums = [one[1:] + one[:-1] for one in sums]
        along = (along[1:] + along[:-1]) / 2
    total = np.where(sums[0] > 0, sums[0], np.nan)
    return Boards(weld, s, along, sums[1] / total, 1 / total, sums[2] / total)


def _middle(boards):
    """(cells,) medians of the gaps of all boards; nan where fewer than half of them are."""
    known = np.isfinite(boards.gap_m)
    told = known.any(axis=0)
    found = np.full(len(boards.s_m), np.nan)
    found[told] = np.nanmedian(boards.gap_m[:, told], axis=0)
    return found


def _moved(boards):
    """By how much the middle of a peak lies beside a loose weld, m; 0: there is none."""
    near = np.where(np.abs(boards.s_m) <= boards.weld.loose_m, np.abs(_middle(boards)), np.nan)
    if not np.nanmax(np.nan_to_num(near)) > LEAST_PEAK_M:
        return 0.0
    return float(boards.s_m[np.nanargmax(near)])


def _has_bead(boards):
    height = abs(bead_height(boards.s_m, _middle(boards)))
    known = boards.noise_m2[np.isfinite(boards.noise_m2)]
    if not len(known):
        return False
    return height > max(LEAST_BEAD_M, SURE_BEAD * np.sqrt(np.median(known) / len(boards.along)))


def noise_factor(boards):
    """By how much gaps scatter from board to board, over what the noise of their cells says; >= 1.

    The gap of a board less the middle of two others, as far on one side as on the other, has the
    variance of the noise where the wall changes evenly along the weld; boards that share no point
    are taken, at three distances, and the larger scatter counts. By medians: single bends of the
    wall do not count, the form of many does, and makes U larger.
    """
    ratios = {lag: [] for lag in LAGS}
    for one in boards:
        near = np.abs(one.s_m) <= REACH_M + 1e-9
        gap, noise = one.gap_m[:, near], one.noise_m2[:, near]
        for lag in LAGS:
            if len(gap) > 2 * lag:
                off = gap[lag:-lag] - (gap[: -2 * lag] + gap[2 * lag :]) / 2
                sd = np.sqrt(noise[lag:-lag] + (noise[: -2 * lag] + noise[2 * lag :]) / 4)
                known = np.isfinite(off)
                ratios[lag].append(np.abs(off[known] / sd[known]))
    told = [np.concatenate(one) for one in ratios.values() if one]
    medians = [float(np.median(one)) for one in told if len(one) >= FEWEST]
    return max(1.0, SD_OVER_MEDIAN * max(medians, default=0.0))
