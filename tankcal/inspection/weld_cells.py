"""Fine cells of the wall beside welds: for each scan a histogram of what is off its coarse cells.

The cells of the wall (`tankcal.clouds.wall`) say where the wall is, and where something hides it;
the fine ones divide them, so that each has the coarse mean of its own scan to count from. They are
kept beside welds only: memory hangs on the welds and the scans, never on the points.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.geometry.outlines import FULL_TURN

ACROSS_M, WIDEST_M, ALONG_M = 0.0125, 0.05, 0.15  # a cell across the weld, at least and at most
ENOUGH = 12  # points that a cell should get
HALF_M, BINS = 0.020, 80  # what is looked at on both sides of the coarse mean
BIN_M = 2 * HALF_M / BINS
FEWEST, LEAST_SHARE = 6, 0.4  # points of a mode that says anything, and its share of the cell
MODE_BINS = 9  # that the fullest place of a cell is looked for in
NARROW_M, WIDE_M, FIRST_M = 0.002, 0.012, 0.005  # on both sides of a mode: least, most, at first
SPREAD, ROUNDS = 2.5, 5  # sds that are averaged over, found in so many rounds
PART = 1 << 14  # cells at a time, and points
COUNT_BYTES = 4


@dataclass(frozen=True)
class FineGrid:
    """Fine cells in rows and columns, of which some are kept.

    Attributes
    ----------
    edges_m : ndarray, shape (rows + 1,)
        u between the rows, ascending, m.
    columns : int
        Round a row; the first begins at turn 0.
    slot : ndarray of int32, shape (rows, columns)
        Number of the cell among those that are kept; -1: it is not.
    base_m : ndarray, shape (scans, slots)
        Distance that each scan counts from: that of its coarse cell, m; nan: it sees no wall.
    """

    edges_m: np.ndarray
    columns: int
    slot: np.ndarray
    base_m: np.ndarray

    @property
    def middles_m(self):
        """(rows,) u of the middle of each row."""
        return (self.edges_m[:-1] + self.edges_m[1:]) / 2


class WeldCells:
    """Histograms over the points of scans in the kept cells of grids about one surface.

    Parameters
    ----------
    surface : CylinderSurface
    grids : sequence of FineGrid

    Attributes
    ----------
    counts : list of ndarray of uint32, shape (scans, slots, BINS)
        Of each grid.
    """

    def __init__(self, surface, grids):
        self.surface, self.grids = surface, tuple(grids)
        self.counts = [np.zeros((*one.base_m.shape, BINS), dtype=np.uint32) for one in self.grids]

    def add(self, xyz_m, scan):
        """Add points (n, 3) of one scan."""
        for start in range(0, len(xyz_m), 2 * PART):
            u, turn, distance = self.surface.places(xyz_m[start : start + 2 * PART])
            for grid, counts in zip(self.grids, self.counts, strict=True):
                _count(grid, counts[scan], scan, u, turn, distance)

    def merged(self, other):
        """The sums of the points of both."""
        both = WeldCells(self.surface, self.grids)
        for sums, one, two in zip(both.counts, self.counts, other.counts, strict=True):
            np.add(one, two, out=sums)
        return both


def weld_cells_of(points, surface, grids):
    """`WeldCells` of an iterator of points: what the passes over a job's clouds gather."""
    cells = WeldCells(surface, grids)
    for scan, xyz in points:
        cells.add(xyz, scan)
    return cells


def located(grid, counts):
    """Distance of the wall in fine cells, and the sd of it (scans, slots + 1), m; nan: not told.

    The mean about the fullest bins of a cell, out to 2.5 sds of what is near them: neither another
    surface nor single points far off move it. The last column is nan, for cells that are not kept.
    """
    scans, slots = grid.base_m.shape
    distance, sd = np.full((2, scans, slots + 1), np.nan)
    for scan in range(scans):
        for start in range(0, slots, PART):
            part = slice(start, min(start + PART, slots))
            off, sd[scan, part] = _modes(counts[scan, part].astype(np.float64))
            distance[scan, part] = grid.base_m[scan, part] + off
    return distance, sd


def width_by_density(wall):
    """Width of a fine cell that gets points enough, m; the widest where nothing is dense enough."""
    width = FULL_TURN * wall.surface.radius_m / wall.grid.columns
    area = width * float(np.median(np.diff(wall.grid.edges_m)))
    count = wall.count.max(axis=0)
    density = float(np.median(count[count > 0])) / area if (count > 0).any() else 0.0
    needed = ENOUGH / (density * ALONG_M) if density else np.inf
    return float(np.clip(needed, ACROSS_M, WIDEST_M))


def grid_of_uprights(wall, strips, across_m):
    """`FineGrid` beside vertical welds: fine columns, and rows of about 0.15 m within a course.

    Parameters
    ----------
    wall : CloudWall
    strips : sequence of (KnownWeld, reach_m)
        How far on both sides of which weld cells are kept, m.
    across_m : float
        Width of a cell, about, m.
    """
    columns = wall.grid.columns
    by = max(1, round(FULL_TURN * wall.surface.radius_m / columns / across_m))
    groups = [part for rows in _rows_of_courses(wall) for part in _groups(wall, rows)]
    edges = wall.grid.edges_m[[part[0] for part in groups] + [wall.grid.rows]]
    course = _course_of(wall, (edges[:-1] + edges[1:]) / 2)
    width = FULL_TURN / (columns * by)
    kept = np.zeros((len(groups), columns * by), dtype=bool)
    middle = (np.arange(columns * by) + 0.5) * width
    for weld, reach in strips:
        near = np.abs(turned(middle - weld.azimuth_rad)) * wall.surface.radius_m <= reach
        kept |= (course == weld.course)[:, None] & near
    base = np.stack([_medians(wall.radius_m[:, part]) for part in groups], axis=1)
    return _fine_grid(wall, edges, columns * by, kept, np.repeat(base, by, axis=2))


def grid_of_rounds(wall, strips, across_m):
    """`FineGrid` beside horizontal welds: fine rows, and columns of about 0.15 m.

    wall, strips, across_m  as for `grid_of_uprights`
    """
    parts, parent = [wall.grid.edges_m[:1]], []
    for row, (low, high) in enumerate(pairwise(wall.grid.edges_m)):
        by = max(1, round((high - low) / across_m))
        parts.append(low + (high - low) * np.arange(1, by + 1) / by)
        parent += [row] * by
    edges = np.concatenate(parts)
    height = (edges[:-1] + edges[1:]) / 2 - wall.joints_m[0]
    near = np.any([np.abs(height - weld.low_m) <= reach for weld, reach in strips], axis=0)
    around = FULL_TURN * wall.surface.radius_m
    columns = min(wall.grid.columns, max(3, round(around / ALONG_M)))
    middle = (np.arange(wall.grid.columns) + 0.5) / wall.grid.columns
    groups = np.searchsorted(middle, np.arange(columns + 1) / columns)
    turned_over = wall.radius_m.transpose(0, 2, 1)
    base = [_medians(turned_over[:, low:high]) for low, high in pairwise(groups)]
    kept = np.repeat(near[:, None], columns, axis=1)
    return _fine_grid(wall, edges, columns, kept, np.stack(base, axis=2)[:, parent])


def turned(angle):
    """Angles from -pi to pi."""
    return (angle + np.pi) % FULL_TURN - np.pi


def _count(grid, counts, scan, u, turn, distance):
    row = np.searchsorted(grid.edges_m, u, side="right") - 1
    column = np.minimum((turn * (grid.columns / FULL_TURN)).astype(np.int64), grid.columns - 1)
    inside = (row >= 0) & (row < len(grid.slot))
    slot = np.where(inside, grid.slot[np.clip(row, 0, len(grid.slot) - 1), column], -1)
    near = slot >= 0
    slot = slot[near]
    off = distance[near] - grid.base_m[scan, slot]
    near = np.abs(off) < HALF_M  # nan is not
    bins = np.minimum(((off[near] + HALF_M) / BIN_M).astype(np.int64), BINS - 1)
    np.add.at(counts.reshape(-1), slot[near].astype(np.int64) * BINS + bins, np.uint32(1))


def _modes(counts):
    """Mean and its sd (n,), m, of the points about the mode of histograms (n, BINS)."""
    place = np.arange(BINS) + 0.5
    beside = np.pad(counts, ((0, 0), (MODE_BINS // 2, MODE_BINS // 2)))
    wide = sum(beside[:, k : k + BINS] for k in range(MODE_BINS))
    mean = place[np.argmax(wide, axis=1)]
    reach = np.full(len(counts), FIRST_M / BIN_M)
    with np.errstate(invalid="ignore", divide="ignore"):
        for _ in range(ROUNDS):
            used = np.where(np.abs(place - mean[:, None]) <= reach[:, None], counts, 0.0)
            count = used.sum(axis=1)
            mean = used @ place / count
            # a bin is 1/12 wide, squared: what only its middle is known of
            square = np.maximum((used * (place - mean[:, None]) ** 2).sum(axis=1) / count, 1 / 12)
            reach = np.clip(SPREAD * np.sqrt(square), NARROW_M / BIN_M, WIDE_M / BIN_M)
        told = (count >= FEWEST) & (count >= LEAST_SHARE * counts.sum(axis=1))
        sd = np.sqrt(square / count)
    mean = np.where(told, mean * BIN_M - HALF_M, np.nan)
    return mean, np.where(told, sd * BIN_M, np.nan)


def _fine_grid(wall, edges, columns, kept, radius_m):
    """The grid of cells that are kept, where some scan sees the wall."""
    seen = kept & np.isfinite(radius_m).any(axis=0)
    slot = np.full(seen.shape, -1, dtype=np.int32)
    slot[seen] = np.arange(np.count_nonzero(seen))
    return FineGrid(edges, columns, slot, radius_m[:, seen] - wall.surface.radius_m)


def _course_of(wall, u):
    return np.searchsorted(np.array(wall.joints_m)[1:-1], u, side="right")


def _rows_of_courses(wall):
    course = _course_of(wall, (wall.grid.edges_m[:-1] + wall.grid.edges_m[1:]) / 2)
    return [np.flatnonzero(course == one) for one in np.unique(course)]


def _groups(wall, rows):
    """The rows of a course in groups of about 0.15 m."""
    height = wall.grid.edges_m[rows[-1] + 1] - wall.grid.edges_m[rows[0]]
    return np.array_split(rows, min(len(rows), max(1, round(height / ALONG_M))))


def _medians(values):
    """(scans, columns) medians over rows (scans, rows, columns); nan where half of them is."""
    seen = np.isfinite(values).mean(axis=1) > 0.5
    filled = np.where(seen[:, None], values, 0.0)
    return np.where(seen, np.nanmedian(filled, axis=1), np.nan)
