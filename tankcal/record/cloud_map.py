"""The wall of a cloud unrolled, small enough for a record: coarse cells of what scans show."""

import numpy as np

from tankcal.record.schema import Finite, Saved, key

MOST_CELLS = 20_000  # of a map: some 80 kB
LEAST_SHOWN = 0.5  # of the cells in one of the map: fewer, and it is hidden
TENTHS = 1e4  # of a millimetre in a metre


class CloudMap(Saved):
    """The wall unrolled: means of cells, coarse enough for paper and page."""

    height_edges_m: list[Finite] = key(
        "between its rows, from below, above the table's zero; of a lying tank along its axis"
    )
    azimuth_edges_deg: list[Finite] = key("between its columns, from 0 to 360, clockwise")
    departure_tenths_mm: list[list[int | None]] = key(
        "rows x columns: outwards from the mean of its course, 0.1 mm; null: hidden from all scans"
    )
    cells: int = key("that it was made of: rows x columns of each scan before")


def map_of(cells, low_m=0.0, most=MOST_CELLS):
    """`CloudMap` of the cells of a wall.

    Parameters
    ----------
    cells : CloudWall
    low_m : float, optional
        Height that heights count from, m.
    most : int, optional
        Cells that it has at most.

    Returns
    -------
    CloudMap
        Neighbouring cells of a course put together; of one of which less than half is wall nothing
        is shown.
    """
    grid = cells.grid
    middle = grid.middles_m
    course = np.searchsorted(np.array(cells.joints_m)[1:-1], middle, side="right")
    departure = _departures(cells, course)
    shown = np.isfinite(departure)
    row, row_edges, column, column_edges = _blocks(grid.rows, grid.columns, course, most)
    shape = len(row_edges) - 1, len(column_edges) - 1
    block = (row[:, None] * shape[1] + column).ravel()
    size = shape[0] * shape[1]
    whole, seen = np.bincount(block, minlength=size), np.bincount(block, shown.ravel(), size)
    sums = np.bincount(block, np.nan_to_num(departure).ravel(), size)
    tenths = np.rint(TENTHS * sums / np.maximum(seen, 1)).astype(int)
    told = [
        [int(value) if is_shown else None for value, is_shown in zip(*one, strict=True)]
        for one in zip(
            tenths.reshape(shape), (seen >= LEAST_SHOWN * whole).reshape(shape), strict=True
        )
    ]
    return CloudMap(
        height_edges_m=(grid.edges_m[row_edges] - low_m).tolist(),
        azimuth_edges_deg=(column_edges * 360 / grid.columns).tolist(),
        departure_tenths_mm=told,
        cells=grid.rows * grid.columns,
    )


def _departures(cells, course):
    """(rows, columns) mean of the scans, each less the mean of its side in the course; nan."""
    total, count = np.zeros((2, *cells.is_wall.shape[1:]))
    sides = np.array(cells.sides)
    for side in dict.fromkeys(cells.sides):
        mine = np.where(cells.is_wall, cells.radius_m, np.nan)[sides == side]
        for one in np.unique(course):
            part = mine[:, course == one]
            if np.isfinite(part).any():
                off = part - np.nanmean(part)
                total[course == one] += np.nansum(off, axis=0)
                count[course == one] += np.isfinite(off).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _blocks(rows, columns, course, most):
    """(rows,) and (columns,) number of the block of each, and the first of each with the end."""
    by = 1
    while True:
        column_edges = _split(columns, by)
        row_edges = [0]
        for one in np.unique(course):
            row_edges += (
                _split(int(np.count_nonzero(course == one)), by)[1:] + row_edges[-1]
            ).tolist()
        if (len(row_edges) - 1) * (len(column_edges) - 1) <= most or by > columns:
            break
        by += 1
    row_edges = np.array(row_edges)
    return (
        np.searchsorted(row_edges, np.arange(rows), side="right") - 1,
        row_edges,
        np.searchsorted(column_edges, np.arange(columns), side="right") - 1,
        column_edges,
    )


def _split(count, by):
    """Edges of parts of `by` or a little less, as even as whole numbers are."""
    parts = -(-count // by)
    return np.arange(parts + 1) * count // parts
