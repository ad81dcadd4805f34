"""Refusal of cells that show no wall, or two surfaces."""

import numpy as np

from tankcal.clouds.wall.growing import EMPTY, FEW, FEWEST, REFINE_BINS, WALL
from tankcal.clouds.wall.screens import FILE, two_surfaces
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.units import FULL_TURN

# Share of cells with a second mode that shows a second surface; number of sectors; least share of
# the sectors in which this surface is seen
TWO_SURFACES, SECTORS, SECTORS_WITH = 0.10, 36, 0.6
RIVAL = 0.15  # share of the cells from which a connected second surface is refused
LEAST_TURN = 0.15  # least share of the columns for the estimation of an axis
LEAST_WALL = 0.25  # least share of the wall in the cells with points


def refuse_no_wall(grown, cells):
    """Raise InputError if only a small share of the cells with points shows the wall."""
    has_points = (grown.why.ravel() != EMPTY) | np.any(cells.far >= FEWEST, axis=1)
    seen = max(np.count_nonzero(has_points), 1)
    share = np.count_nonzero(grown.why == WALL) / seen
    if share >= LEAST_WALL:
        return
    if np.count_nonzero(grown.why == FEW) > seen / 2:
        text = message(
            "cloud_too_sparse",
            "found fewer than {least} points in most cells of the wall ({rows} x {columns}); "
            "expected a denser cloud: bring its points as points.csv",
            least=FEWEST,
            rows=cells.grid.rows,
            columns=cells.grid.columns,
        )
    else:
        text = message(
            "cloud_wall_too_small",
            "only {share:.1f} % of the cells in which anything is seen show a wall near the radius "
            "{radius_m:.3f} m; expected {least:.0f} % at least: check tank.kind, the unit, the "
            "frame and what stands before the wall",
            share=100 * share,
            radius_m=cells.surface.radius_m,
            least=100 * LEAST_WALL,
        )
    raise InputError(Problem(FILE, text))


def two_surfaces_in(grown, counts, cells):
    """Return an InputError if a second surface surrounds the wall or rivals its size, else None.

    Parameters
    ----------
    grown : Grown
        Wall of one side.
    counts : ndarray of int, shape (rows, columns, bins)
        Histograms in which the wall was found.
    cells : WallCells
        Sums over the points in cells.

    Returns
    -------
    InputError or None
    """
    grid, wall = cells.grid, grown.why == WALL
    seen = max(np.count_nonzero(wall | grown.two_modes | (grown.other >= 0)), 1)
    second = grown.other >= 0
    sector = np.arange(grid.columns) * SECTORS // grid.columns
    parts = np.bincount(sector, second.mean(axis=0), SECTORS) / np.bincount(sector)
    share = np.count_nonzero(second) / seen
    all_round = share >= TWO_SURFACES and np.mean(parts >= TWO_SURFACES) >= SECTORS_WITH
    if not all_round and not (grown.surfaces and grown.surfaces[0][0] >= RIVAL):
        return None
    first, other = _surface_distances(grown, counts, grid)
    radius_m = cells.surface.radius_m
    return two_surfaces(radius_m + first, np.count_nonzero(wall) / seen, radius_m + other, share)


def _surface_distances(grown, counts, grid):
    """Median distances of the wall and of the second surface, m.

    If the surfaces have similar numbers of points, the mode taken as wall may change from cell to
    cell. The inner of two modes in a cell is therefore assigned to the inner surface.
    """
    wall, second = grown.why == WALL, grown.other >= 0
    first = _mean_distances(counts, grown.low, grown.high, grid)
    near = grown.other - REFINE_BINS, grown.other + REFINE_BINS
    other = _mean_distances(counts, *near, grid)
    both = wall & second
    if 2 * np.count_nonzero(both) < np.count_nonzero(second):
        return _median_about_own_axis(first, wall), _median_about_own_axis(other, second)
    inner = np.nanmedian(np.fmin(first, other)[both])
    outer = np.nanmedian(np.fmax(first, other)[both])
    return (inner, outer) if np.median((first - other)[both]) < 0 else (outer, inner)


def _median_about_own_axis(distance_m, chosen):
    """Median distance of some cells from the axis of their own surface, m.

    The axis of one surface may differ from the common axis of both. Its offset is estimated from
    the first harmonic of the distances, without outliers.
    """
    columns = distance_m.shape[1]
    chosen = chosen & np.isfinite(distance_m)
    values, column = distance_m[chosen], np.nonzero(chosen)[1]
    if len(np.unique(column)) < columns * LEAST_TURN:
        return np.median(values)
    # A shift of the axis changes the distance by a sin t + b cos t.
    turn = column * (FULL_TURN / columns)
    design = np.column_stack([np.sin(turn), np.cos(turn), np.ones(len(turn))])
    near = np.ones(len(values), dtype=bool)
    for _ in range(3):
        solution = np.linalg.lstsq(design[near], values[near], rcond=None)[0]
        deviation = np.abs(values - design @ solution)
        near = deviation <= 4 * np.median(deviation) + 1e-6
    return np.median(values - design[:, :2] @ solution[:2])


def _mean_distances(counts, low, high, grid):
    """Mean distance (rows, columns) of the points between two bins of each cell, m."""
    number = np.arange(grid.bins)
    part = np.where((number >= low[..., None]) & (number <= high[..., None]), counts, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return (part @ number / part.sum(axis=2) + 0.5) * grid.bin_m - grid.band_m
