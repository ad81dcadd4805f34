"""Welds of a shell, and fine cells of the wall beside them.

The coarse cells of the wall (`tankcal.clouds.wall`) determine the wall and its hidden parts. Fine
cells divide the coarse cells, each with a histogram of distances for each scan, counted from the
coarse mean of this scan. Only cells beside welds are kept, so that the memory depends on the number
of welds and scans, not on the number of points.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.units import FULL_TURN

PEAKING, BANDING = "peaking", "banding"
APART_M = 0.3  # distance beyond which a detected weld differs from a given weld
LOOSE_M = 0.12  # largest error of the place of a weld that was detected in coarse cells


@dataclass(frozen=True)
class KnownWeld:
    """Place of a weld for the gaps of boards.

    Attributes
    ----------
    kind : str
        "peaking" for a vertical weld, "banding" for a horizontal weld.
    course : int
        Course, counted from 0 at the bottom; for a horizontal weld, the course below it.
    low_m, high_m : float
        Heights of the ends of a vertical weld above the bottom of the shell, m; for a horizontal
        weld, both are its height.
    azimuth_rad : float
        Azimuth, clockwise from +y, rad; 0 for a horizontal weld.
    loose_m : float
        Largest error of the place, m; 0 for a given weld.
    """

    kind: str
    course: int
    low_m: float
    high_m: float
    azimuth_rad: float = 0.0
    loose_m: float = 0.0


def list_welds(course_heights_m, given_rad=(), detected=(), radius_m=np.inf):
    """List the welds of a shell: vertical welds, then horizontal welds, from the bottom up.

    Parameters
    ----------
    course_heights_m : sequence of float
        Heights of the courses between joints, from the bottom up, m.
    given_rad : sequence of sequence of float or None, optional
        Given azimuths of the vertical welds of each course, rad; None if unknown.
    detected : sequence of tankcal.clouds.wall.deciding.Weld, optional
        Welds detected in a cloud. A weld near a given weld of its course is ignored.
    radius_m : float, optional
        Radius of the shell, m.

    Returns
    -------
    tuple of KnownWeld

    Examples
    --------
    >>> [(weld.kind, weld.course, weld.high_m) for weld in list_welds([2.0, 1.5], [[0.5], None])]
    [('peaking', 0, 2.0), ('banding', 0, 2.0)]
    """
    joints = np.concatenate([[0.0], np.cumsum(course_heights_m)]).tolist()
    welds = []
    for course, (low, high) in enumerate(pairwise(joints)):
        given = list((given_rad[course] or ()) if course < len(given_rad) else ())
        welds += [KnownWeld(PEAKING, course, low, high, float(weld)) for weld in given]
        for weld in detected:
            if weld.course == course and all(
                abs(wrap_angle(weld.azimuth_rad - known)) * radius_m > APART_M for known in given
            ):
                at = float(weld.azimuth_rad)
                welds.append(KnownWeld(PEAKING, course, low, high, at, LOOSE_M))
    rounds = [KnownWeld(BANDING, course, at, at) for course, at in enumerate(joints[1:-1])]
    return (*welds, *rounds)


# Size of a cell: least and largest width across the weld, and length along the weld.
ACROSS_M, WIDEST_M, ALONG_M = 0.0125, 0.05, 0.15
ENOUGH = 12  # intended number of points in a cell
HALF_M, BINS = 0.020, 80  # range of a histogram on both sides of the coarse mean, and its bins
BIN_M = 2 * HALF_M / BINS  # width of a bin
FEWEST, LEAST_SHARE = 6, 0.4  # least number of points of a valid mode, and their share of the cell
MODE_BINS = 9  # number of neighbouring bins whose sum locates the mode
# Half width of the interval about a mode: least, largest and initial.
NARROW_M, WIDE_M, FIRST_M = 0.002, 0.012, 0.005
SPREAD, ROUNDS = 2.5, 5  # half width of the averaging interval in sds, and number of iterations
PART = 1 << 14  # number of cells, or half the number of points, processed together
COUNT_BYTES = 4  # memory of a bin


@dataclass(frozen=True)
class FineGrid:
    """Fine cells in rows and columns; only a part of the cells is kept.

    Attributes
    ----------
    edges_m : ndarray, shape (rows + 1,)
        Coordinates u of the edges between the rows, ascending, m.
    columns : int
        Number of columns around a row; the first column begins at azimuth 0.
    slot : ndarray of int32, shape (rows, columns)
        Index of the cell among the kept cells; -1 for other cells.
    base_m : ndarray, shape (scans, slots)
        Distance of the coarse cell of each scan, from which distances are counted, m; nan if the
        scan sees no wall.
    """

    edges_m: np.ndarray
    columns: int
    slot: np.ndarray
    base_m: np.ndarray

    @property
    def middles_m(self):
        """Coordinates u (rows,) of the middles of the rows, m."""
        return (self.edges_m[:-1] + self.edges_m[1:]) / 2


class WeldCells:
    """Histograms of the points of all scans in the kept cells of grids on one surface.

    Parameters
    ----------
    surface : CylinderSurface
        Surface from which distances are computed.
    grids : sequence of FineGrid
        Grids of fine cells.

    Attributes
    ----------
    counts : list of ndarray of uint32, shape (scans, slots, BINS)
        Histograms of each grid.
    """

    def __init__(self, surface, grids):
        self.surface, self.grids = surface, tuple(grids)
        self.counts = [np.zeros((*grid.base_m.shape, BINS), dtype=np.uint32) for grid in self.grids]

    def add(self, xyz_m, scan):
        """Add points (n, 3) of the scan with index `scan` to the histograms."""
        for start in range(0, len(xyz_m), 2 * PART):
            u, turn, distance = self.surface.places(xyz_m[start : start + 2 * PART])
            for grid, counts in zip(self.grids, self.counts, strict=True):
                _count(grid, counts[scan], scan, u, turn, distance)

    def merge(self, other):
        """New `WeldCells` with the sums of both histograms."""
        merged = WeldCells(self.surface, self.grids)
        for sums, first, second in zip(merged.counts, self.counts, other.counts, strict=True):
            np.add(first, second, out=sums)
        return merged


def fill_weld_cells(points, surface, grids):
    """`WeldCells` of an iterator of (scan, points); used by the passes over the clouds."""
    cells = WeldCells(surface, grids)
    for scan, xyz in points:
        cells.add(xyz, scan)
    return cells


def locate_wall(grid, counts):
    """Distances of the wall in fine cells and their standard deviations.

    The distance is the mean of the points within 2.5 standard deviations of the mode of a cell.
    Another surface or distant points do not move it.

    Parameters
    ----------
    grid : FineGrid
        Grid of fine cells.
    counts : ndarray, shape (scans, slots, BINS)
        Histograms of the grid.

    Returns
    -------
    distance, sd : ndarray, shape (scans, slots + 1)
        Distances and their standard deviations, m; nan if not determined. The last column is nan;
        it represents cells that are not kept, whose slot is -1.
    """
    scans, slots = grid.base_m.shape
    distance, sd = np.full((2, scans, slots + 1), np.nan)
    for scan in range(scans):
        for start in range(0, slots, PART):
            part = slice(start, min(start + PART, slots))
            off, sd[scan, part] = _modes(counts[scan, part].astype(np.float64))
            distance[scan, part] = grid.base_m[scan, part] + off
    return distance, sd


def choose_cell_width(wall):
    """Width of a fine cell with enough points, m, at most WIDEST_M."""
    width = FULL_TURN * wall.surface.radius_m / wall.grid.columns
    area = width * float(np.median(np.diff(wall.grid.edges_m)))
    count = wall.count.max(axis=0)
    density = float(np.median(count[count > 0])) / area if (count > 0).any() else 0.0
    needed = ENOUGH / (density * ALONG_M) if density else np.inf
    return float(np.clip(needed, ACROSS_M, WIDEST_M))


def build_upright_grid(wall, strips, across_m):
    """Build the `FineGrid` beside vertical welds, with rows of about 0.15 m within a course.

    Parameters
    ----------
    wall : CloudWall
        Coarse cells of the wall.
    strips : sequence of (KnownWeld, reach_m)
        Welds, and the distances on both sides within which cells are kept, m.
    across_m : float
        Approximate width of a cell, m.
    """
    columns = wall.grid.columns
    division = max(1, round(FULL_TURN * wall.surface.radius_m / columns / across_m))
    groups = [group for rows in _rows_of_courses(wall) for group in _groups(wall, rows)]
    edges = wall.grid.edges_m[[group[0] for group in groups] + [wall.grid.rows]]
    course = _course_of(wall, (edges[:-1] + edges[1:]) / 2)
    width = FULL_TURN / (columns * division)
    kept = np.zeros((len(groups), columns * division), dtype=bool)
    middle = (np.arange(columns * division) + 0.5) * width
    for weld, reach in strips:
        near = np.abs(wrap_angle(middle - weld.azimuth_rad)) * wall.surface.radius_m <= reach
        kept |= (course == weld.course)[:, None] & near
    base = np.stack([_medians(wall.radius_m[:, group]) for group in groups], axis=1)
    return _fine_grid(wall, edges, columns * division, kept, np.repeat(base, division, axis=2))


def build_round_grid(wall, strips, across_m):
    """Build the `FineGrid` beside horizontal welds, with columns of about 0.15 m.

    Parameters
    ----------
    wall : CloudWall
        Coarse cells of the wall.
    strips : sequence of (KnownWeld, reach_m)
        Welds, and the distances on both sides within which cells are kept, m.
    across_m : float
        Approximate height of a cell, m.
    """
    parts, parent = [wall.grid.edges_m[:1]], []
    for row, (low, high) in enumerate(pairwise(wall.grid.edges_m)):
        division = max(1, round((high - low) / across_m))
        parts.append(low + (high - low) * np.arange(1, division + 1) / division)
        parent += [row] * division
    edges = np.concatenate(parts)
    height = (edges[:-1] + edges[1:]) / 2 - wall.joints_m[0]
    is_near = np.any([np.abs(height - weld.low_m) <= reach for weld, reach in strips], axis=0)
    circumference = FULL_TURN * wall.surface.radius_m
    columns = min(wall.grid.columns, max(3, round(circumference / ALONG_M)))
    middle = (np.arange(wall.grid.columns) + 0.5) / wall.grid.columns
    groups = np.searchsorted(middle, np.arange(columns + 1) / columns)
    radius_by_column = wall.radius_m.transpose(0, 2, 1)
    base = [_medians(radius_by_column[:, low:high]) for low, high in pairwise(groups)]
    kept = np.repeat(is_near[:, None], columns, axis=1)
    return _fine_grid(wall, edges, columns, kept, np.stack(base, axis=2)[:, parent])


def wrap_angle(angle):
    """Equivalent angle from -pi to pi, rad."""
    return (angle + np.pi) % FULL_TURN - np.pi


def _count(grid, counts, scan, u, turn, distance):
    """Add points of a scan to the histograms `counts` of a grid."""
    row = np.searchsorted(grid.edges_m, u, side="right") - 1
    column = np.minimum((turn * (grid.columns / FULL_TURN)).astype(np.int64), grid.columns - 1)
    inside = (row >= 0) & (row < len(grid.slot))
    slot = np.where(inside, grid.slot[np.clip(row, 0, len(grid.slot) - 1), column], -1)
    is_near = slot >= 0
    slot = slot[is_near]
    offset = distance[is_near] - grid.base_m[scan, slot]
    is_near = np.abs(offset) < HALF_M  # False for nan
    bins = np.minimum(((offset[is_near] + HALF_M) / BIN_M).astype(np.int64), BINS - 1)
    np.add.at(counts.reshape(-1), slot[is_near].astype(np.int64) * BINS + bins, np.uint32(1))


def _modes(counts):
    """Mean of the points about the mode of histograms (n, BINS), and its sd, both (n,), m."""
    place = np.arange(BINS) + 0.5
    padded = np.pad(counts, ((0, 0), (MODE_BINS // 2, MODE_BINS // 2)))
    window_sums = sum(padded[:, k : k + BINS] for k in range(MODE_BINS))
    mean = place[np.argmax(window_sums, axis=1)]
    reach = np.full(len(counts), FIRST_M / BIN_M)
    with np.errstate(invalid="ignore", divide="ignore"):
        for _ in range(ROUNDS):
            used = np.where(np.abs(place - mean[:, None]) <= reach[:, None], counts, 0.0)
            count = used.sum(axis=1)
            mean = used @ place / count
            # Within a bin, the distribution is uniform, with the variance 1/12 of a bin squared.
            square = np.maximum((used * (place - mean[:, None]) ** 2).sum(axis=1) / count, 1 / 12)
            reach = np.clip(SPREAD * np.sqrt(square), NARROW_M / BIN_M, WIDE_M / BIN_M)
        is_valid = (count >= FEWEST) & (count >= LEAST_SHARE * counts.sum(axis=1))
        sd = np.sqrt(square / count)
    mean = np.where(is_valid, mean * BIN_M - HALF_M, np.nan)
    return mean, np.where(is_valid, sd * BIN_M, np.nan)


def _fine_grid(wall, edges, columns, kept, radius_m):
    """`FineGrid` of the kept cells in which at least one scan sees the wall."""
    seen = kept & np.isfinite(radius_m).any(axis=0)
    slot = np.full(seen.shape, -1, dtype=np.int32)
    slot[seen] = np.arange(np.count_nonzero(seen))
    return FineGrid(edges, columns, slot, radius_m[:, seen] - wall.surface.radius_m)


def _course_of(wall, u):
    """Index of the course at the coordinates u."""
    return np.searchsorted(np.array(wall.joints_m)[1:-1], u, side="right")


def _rows_of_courses(wall):
    """Indices of the coarse rows of each course."""
    course = _course_of(wall, wall.grid.middles_m)
    return [np.flatnonzero(course == index) for index in np.unique(course)]


def _groups(wall, rows):
    """Rows of a course in groups of about 0.15 m height."""
    height = wall.grid.edges_m[rows[-1] + 1] - wall.grid.edges_m[rows[0]]
    return np.array_split(rows, min(len(rows), max(1, round(height / ALONG_M))))


def _medians(values):
    """Medians (scans, columns) over the rows of (scans, rows, columns).

    A median is nan if half or more of its values are nan.
    """
    seen = np.isfinite(values).mean(axis=1) > 0.5
    filled = np.where(seen[:, None], values, 0.0)
    return np.where(seen, np.nanmedian(filled, axis=1), np.nan)
