"""Reduction of the cells of a wall to a limited number of evenly spread readings.

A reading is the mean of the cells of one scan in a sector of a few rows. Its standard deviation is
that of a single cell and does not decrease with the number of cells or points. Neighbouring cells
share errors (mixed pixels, noise along a scan line), which do not average out.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

LEVELS = 5  # levels of readings in a course
TALLEST = 0.1  # largest height of a level as a share of its course
ENOUGH_SECTORS = 24  # least number of sectors before several scans are kept at one position
LEVELS_OF_BODY = 24  # levels of readings of a lying cylinder or a sphere
MOST_CELLS = 20_000  # largest number of coarse cells: about 80 kB in a record
LEAST_SHOWN = 0.5  # smallest share of fine cells with wall in a coarse cell that is shown
TENTHS_PER_M = 1e4  # tenths of a millimetre per metre


@dataclass(frozen=True)
class CloudReadings:
    """Readings of the wall, each the mean of cells of one scan.

    Attributes
    ----------
    scan : ndarray of int, shape (n,)
        Scan of each reading.
    xyz_m : ndarray, shape (n, 3)
        Point at the mean radius, in the frame of the tank, m.
    sd_m : ndarray, shape (n,)
        Standard deviation of the radius, from errors independent between readings, m.
    course, level, sector : ndarray of int, shape (n,)
        Course, level and sector of each reading; levels count from the bottom of the shell.
    cells : ndarray of int, shape (n,)
        Number of cells in the mean.
    """

    scan: np.ndarray
    xyz_m: np.ndarray
    sd_m: np.ndarray
    course: np.ndarray
    level: np.ndarray
    sector: np.ndarray
    cells: np.ndarray


def readings_of(cloud_wall, most=1200):
    """Reduce a `CloudWall` to at most `most` readings (`CloudReadings`).

    Levels are spread evenly over each course. If `most` does not suffice for all scans at a
    position, the scans with the most cells at that position are kept.
    """
    level, course = _assign_levels(cloud_wall)
    columns, scans = cloud_wall.grid.columns, len(cloud_wall.sides)
    levels = level.max() + 1
    is_used = cloud_wall.is_wall & (level >= 0)[None, :, None]
    scan, row, column = np.nonzero(is_used)
    for ranked in range(scans, 0, -1):
        sectors = _most_sectors(scan, level[row], column, columns, levels, ranked, most)
        if sectors >= ENOUGH_SECTORS or ranked == 1:
            break
    group = _group_numbers(scan, level[row], column, columns, levels, sectors)
    groups, cells = _keep_largest(*np.unique(group, return_counts=True), levels * sectors, ranked)
    groups, cells = groups[:most], cells[:most]
    place = np.searchsorted(groups, group)
    in_reading = (place < len(groups)) & (groups[np.minimum(place, len(groups) - 1)] == group)
    return _mean_readings(
        cloud_wall,
        (scan[in_reading], row[in_reading], column[in_reading]),
        place[in_reading],
        groups,
        cells,
        level,
        course,
        sectors,
    )


def _assign_levels(cloud_wall):
    """Level of each row (rows,), -1 for none, and course of each level (levels,)."""
    middle, joints = cloud_wall.grid.middles_m, np.array(cloud_wall.joints_m)
    level, course = np.full(len(middle), -1), []
    count_per_course = (
        LEVELS if len(joints) > 2 or cloud_wall.grid.rows < LEVELS_OF_BODY else LEVELS_OF_BODY
    )
    tallest = TALLEST if count_per_course == LEVELS else 1 / count_per_course
    for course_number, (low, high) in enumerate(pairwise(joints)):
        rows = np.flatnonzero((middle > low) & (middle < high))
        height = (high - low) / len(rows)
        rows_of_level = max(1, int(tallest * (high - low) / height + 1e-9))
        count = min(count_per_course, len(rows) // rows_of_level)
        for k in range(count):
            begin = round((k + 0.5) * len(rows) / count - rows_of_level / 2)
            begin = min(max(begin, 0), len(rows) - rows_of_level)
            level[rows[begin : begin + rows_of_level]] = len(course)
            course.append(course_number)
    return level, np.array(course)


def _group_numbers(scan, level, column, columns, levels, sectors):
    """Number of the reading to which each cell belongs, unique for scan, level and sector."""
    return (scan * levels + level) * sectors + column * sectors // columns


def _keep_largest(groups, cells, places, ranked):
    """Keep at each position the `ranked` groups with the most cells; return groups and cells."""
    if not len(groups):
        return groups, cells
    order = np.lexsort((groups, -cells, groups % places))
    place = groups[order] % places
    first = np.flatnonzero(np.append(True, place[1:] != place[:-1]))
    rank = np.arange(len(order)) - np.repeat(first, np.diff(np.append(first, len(order))))
    chosen = np.sort(order[rank < ranked])
    return groups[chosen], cells[chosen]


def _most_sectors(scan, level, column, columns, levels, ranked, most):
    """Largest number of sectors, at least 3, that gives at most `most` readings, by bisection."""
    low, high = 3, columns
    while low < high:
        sectors = (low + high + 1) // 2
        groups = _group_numbers(scan, level, column, columns, levels, sectors)
        group_cells = np.unique(groups, return_counts=True)
        count = len(_keep_largest(*group_cells, levels * sectors, ranked)[0])
        low, high = (sectors, high) if count <= most else (low, sectors - 1)
    return low


def _mean_readings(wall, index, place, groups, cells, level, course, sectors):
    """Average the cells of each reading; `place` is the reading of each cell."""
    turn, along = wall.turn_rad[index], wall.along_m[index]
    distance = wall.radius_m[index] - wall.surface.radius_m
    places, levels = len(groups), len(course)

    def mean(values):
        return np.bincount(place, values, places) / cells

    first = np.full(places, 0.0)
    first[place] = turn  # azimuths relative to the first cell; no sector crosses azimuth 0
    u, azimuth = mean(along), first + mean(turn - first[place])
    scan, rest = np.divmod(groups, levels * sectors)
    row, sector = np.divmod(rest, sectors)
    return CloudReadings(
        scan=scan,
        xyz_m=wall.surface.points(u, azimuth, mean(distance)),
        sd_m=np.sqrt(mean(wall.sd_m[index] ** 2)),
        course=course[row],
        level=row,
        sector=sector,
        cells=cells,
    )


# ---- the wall of a cloud unrolled into coarse cells, small enough for a record and a web page


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
