"""Readings of a wall from its cells: so many that a job can carry them, spread evenly.

Cells of one scan in a sector of a low band of rows are one reading: their mean. Its sd is that of
one cell as neighbouring cells show it; that many cells (or points) lie in it does not make it
smaller, for what neighbours share (mixed pixels, noise along a scan line) does not average out.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

LEVELS = 5  # of a course
TALLEST = 0.1  # of a course: 0.2 of half of it
ENOUGH_SECTORS = 24  # before a place that several scans show is told by all of them
LEVELS_OF_BODY = 24  # rows of readings of a lying cylinder or a sphere


@dataclass(frozen=True)
class CloudReadings:
    """Points of the wall, each the mean of cells of one scan; n of them.

    Attributes
    ----------
    scan : ndarray of int, shape (n,)
    xyz_m : ndarray, shape (n, 3)
        At the mean radius, in the frame of the tank.
    sd_m : ndarray, shape (n,)
        Of the radius, of what is independent between readings.
    course, level, sector : ndarray of int, shape (n,)
        Which they are of; levels count from the bottom of the shell.
    cells : ndarray of int, shape (n,)
        Cells that were averaged.
    """

    scan: np.ndarray
    xyz_m: np.ndarray
    sd_m: np.ndarray
    course: np.ndarray
    level: np.ndarray
    sector: np.ndarray
    cells: np.ndarray


def readings_of(cloud_wall, most=1200):
    """`CloudReadings` of a `CloudWall`, at most so many.

    Levels are spread evenly over each course; where `most` does not suffice for all scans that
    show a place, those with the most cells there are kept.
    """
    level, course = _levels(cloud_wall)
    columns, scans = cloud_wall.grid.columns, len(cloud_wall.sides)
    lines = level.max() + 1
    kept = cloud_wall.is_wall & (level >= 0)[None, :, None]
    scan, row, column = np.nonzero(kept)
    for ranked in range(scans, 0, -1):
        sectors = _most_sectors(scan, level[row], column, columns, lines, ranked, most)
        if sectors >= ENOUGH_SECTORS or ranked == 1:
            break
    group = _groups(scan, level[row], column, columns, lines, sectors)
    taken, cells = _ranked(*np.unique(group, return_counts=True), lines * sectors, ranked)
    taken, cells = taken[:most], cells[:most]
    place = np.searchsorted(taken, group)
    mine = (place < len(taken)) & (taken[np.minimum(place, len(taken) - 1)] == group)
    return _means(
        cloud_wall,
        (scan[mine], row[mine], column[mine]),
        place[mine],
        taken,
        cells,
        level,
        course,
        sectors,
    )


def _levels(cloud_wall):
    """(rows,) level of each row, -1: of none, and (levels,) its course."""
    edges, joints = cloud_wall.grid.edges_m, np.array(cloud_wall.joints_m)
    middle = (edges[:-1] + edges[1:]) / 2
    level, course = np.full(len(middle), -1), []
    per = LEVELS if len(joints) > 2 or cloud_wall.grid.rows < LEVELS_OF_BODY else LEVELS_OF_BODY
    tallest = TALLEST if per == LEVELS else 1 / per
    for one, (low, high) in enumerate(pairwise(joints)):
        rows = np.flatnonzero((middle > low) & (middle < high))
        height = (high - low) / len(rows)
        thick = max(1, int(tallest * (high - low) / height + 1e-9))
        count = min(per, len(rows) // thick)
        for k in range(count):
            begin = round((k + 0.5) * len(rows) / count - thick / 2)
            begin = min(max(begin, 0), len(rows) - thick)
            level[rows[begin : begin + thick]] = len(course)
            course.append(one)
    return level, np.array(course)


def _groups(scan, level, column, columns, lines, sectors):
    return (scan * lines + level) * sectors + column * sectors // columns


def _ranked(groups, cells, places, ranked):
    """The groups whose scan is among those of the most cells at its place."""
    if not len(groups):
        return groups, cells
    order = np.lexsort((groups, -cells, groups % places))
    place = groups[order] % places
    first = np.flatnonzero(np.append(True, place[1:] != place[:-1]))
    rank = np.arange(len(order)) - np.repeat(first, np.diff(np.append(first, len(order))))
    chosen = np.sort(order[rank < ranked])
    return groups[chosen], cells[chosen]


def _most_sectors(scan, level, column, columns, lines, ranked, most):
    """The largest number of sectors that gives no more readings than `most`; at least 3."""
    low, high = 3, columns
    while low < high:
        sectors = (low + high + 1) // 2
        groups = _groups(scan, level, column, columns, lines, sectors)
        found = np.unique(groups, return_counts=True)
        count = len(_ranked(*found, lines * sectors, ranked)[0])
        low, high = (sectors, high) if count <= most else (low, sectors - 1)
    return low


def _means(wall, index, place, taken, cells, level, course, sectors):
    turn, along = wall.turn_rad[index], wall.along_m[index]
    distance = wall.radius_m[index] - wall.surface.radius_m
    places, lines = len(taken), len(course)

    def mean(values):
        return np.bincount(place, values, places) / cells

    first = np.full(places, 0.0)
    first[place] = turn  # a sector does not pass the first column
    u, azimuth = mean(along), first + mean(turn - first[place])
    scan, rest = np.divmod(taken, lines * sectors)
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
