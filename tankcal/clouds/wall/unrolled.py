"""The wall of a cloud unrolled into coarse cells, small enough for a record and a web page."""

from dataclasses import dataclass

import numpy as np

MOST_CELLS = 20_000  # largest number of coarse cells: about 80 kB in a record
LEAST_SHOWN = 0.5  # smallest share of fine cells with wall in a coarse cell that is shown
TENTHS_PER_M = 1e4  # tenths of a millimetre per metre


@dataclass(frozen=True)
class UnrolledWall:
    """Mean deviations of the wall in coarse cells.

    Attributes
    ----------
    height_edges_m : ndarray, shape (rows + 1,)
        Coordinate u of the edges of the rows, ascending, m.
    azimuth_edges_deg : ndarray, shape (columns + 1,)
        Azimuths of the edges of the columns, from 0 to 360, clockwise.
    departure_tenths_mm : ndarray of int, shape (rows, columns)
        Mean deviation outwards from the mean of the course, in tenths of a millimetre.
    is_shown : ndarray of bool, shape (rows, columns)
        Whether enough of the cell is wall; the deviation of other cells has no meaning.
    """

    height_edges_m: np.ndarray
    azimuth_edges_deg: np.ndarray
    departure_tenths_mm: np.ndarray
    is_shown: np.ndarray


def unroll_wall(cells, most=MOST_CELLS):
    """Average the cells of a wall over blocks that do not pass a joint between courses.

    Parameters
    ----------
    cells : CloudWall
        Wall in fine cells.
    most : int, optional
        Largest number of coarse cells.

    Returns
    -------
    UnrolledWall
    """
    grid = cells.grid
    course = np.searchsorted(np.array(cells.joints_m)[1:-1], grid.middles_m, side="right")
    departure_m = _average_scans(cells, course)
    is_wall = np.isfinite(departure_m)
    row_edges, column_edges = _block_edges(course, grid.columns, most)
    row = np.searchsorted(row_edges, np.arange(grid.rows), side="right") - 1
    column = np.searchsorted(column_edges, np.arange(grid.columns), side="right") - 1
    shape = len(row_edges) - 1, len(column_edges) - 1
    block = (row[:, None] * shape[1] + column).ravel()
    size = shape[0] * shape[1]
    count = np.bincount(block, minlength=size)
    wall_count = np.bincount(block, is_wall.ravel(), size)
    sums_m = np.bincount(block, np.nan_to_num(departure_m).ravel(), size)
    tenths = np.rint(TENTHS_PER_M * sums_m / np.maximum(wall_count, 1)).astype(int)
    return UnrolledWall(
        height_edges_m=grid.edges_m[row_edges],
        azimuth_edges_deg=column_edges * 360 / grid.columns,
        departure_tenths_mm=tenths.reshape(shape),
        is_shown=(wall_count >= LEAST_SHOWN * count).reshape(shape),
    )


def _average_scans(cells, course):
    """Mean deviation of the cells over the scans, m, shape (rows, columns); nan without wall.

    The deviation of a scan refers to the mean radius of its side of the plate in the course.
    """
    total, count = np.zeros((2, *cells.is_wall.shape[1:]))
    sides = np.array(cells.sides)
    for side in dict.fromkeys(cells.sides):
        radius_m = np.where(cells.is_wall, cells.radius_m, np.nan)[sides == side]
        for number in np.unique(course):
            part = radius_m[:, course == number]
            if np.isfinite(part).any():
                departure_m = part - np.nanmean(part)
                total[course == number] += np.nansum(departure_m, axis=0)
                count[course == number] += np.isfinite(departure_m).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _block_edges(course, columns, most):
    """Edges of the blocks along the rows and along the columns, as numbers of fine cells.

    A block has up to `side` rows and columns. `side` grows until at most `most` blocks remain.
    """
    rows_of_course = np.unique(course, return_counts=True)[1]
    side = 1
    while True:
        column_edges = _split_evenly(columns, side)
        row_edges = [0]
        for rows in rows_of_course.tolist():
            row_edges += (_split_evenly(rows, side)[1:] + row_edges[-1]).tolist()
        if (len(row_edges) - 1) * (len(column_edges) - 1) <= most or side > columns:
            return np.array(row_edges), column_edges
        side += 1


def _split_evenly(count, largest):
    """Edges of parts of up to `largest` cells, of nearly equal size."""
    parts = -(-count // largest)
    return np.arange(parts + 1) * count // parts
