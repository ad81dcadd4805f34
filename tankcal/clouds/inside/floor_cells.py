"""Sums over the points inside an upright shell: heights over a square grid of its plan.

Near the bottom each cell has a histogram of heights with the sums of heights and places, in whole
numbers that add; up to the top of the shell it has counts, by which what stands inside is found.
Of each scan it has counts in coarse classes, for what its points share, and over all heights above
the shell how many there are: a roof.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.clouds.wall.cells import COUNT, FINE, FINE_BITS, PLACE
from tankcal.clouds.wall.surfaces import CylinderSurface

PIECE = 1 << 16
BIN_M = 0.01  # of heights near the bottom
CELL_M, MOST_ACROSS = 0.25, 72  # of the plan; no more cells than these across
STACK_M = 0.1  # height of the counts up to the top
LEAST_REACH_M, REACH = 1.0, 0.12  # of heights near the bottom; of the radius
SKIN_M = 0.1  # before the mean wall, that is left to the wall
FOOT_M = 0.25  # under the bottom of the shell, from where on no wall can be
COARSE = 10  # bins of a class that the points of each scan are counted in
OVER_M = 0.2  # under the top of the shell, from where on a roof may be


@dataclass(frozen=True)
class FloorGrid:
    """Cells of the plan of an upright shell.

    Attributes
    ----------
    surface : CylinderSurface
        Of the wall; the plan is square to z, about the axis at the bottom of the shell.
    bottom_m, top_m : float
        Height of the lower and the upper end of the shell, m.
    below_m, above_m : float
        How far under and over the bottom of the shell heights are told apart, m.
    cell_m : float
        Side of a cell, m.

    Examples
    --------
    >>> grid = floor_grid(CylinderSurface(np.zeros(3), 5.0), 0.0, 8.0)
    >>> grid.across, grid.bins, grid.levels
    (42, 200, 90)
    """

    surface: CylinderSurface
    bottom_m: float
    top_m: float
    below_m: float
    above_m: float
    cell_m: float

    @property
    def across(self):
        """Cells in one direction: one more than the shell is wide on each side."""
        return 2 * int(np.ceil(self.surface.radius_m / self.cell_m)) + 2

    @property
    def bins(self):
        """Heights near the bottom."""
        return int(np.ceil((self.below_m + self.above_m) / BIN_M - 1e-9))

    @property
    def levels(self):
        """Heights of the counts, from below the bottom to the top."""
        return int(np.ceil((self.below_m + self.top_m - self.bottom_m) / STACK_M - 1e-9))

    @property
    def roof_levels(self):
        """Classes of heights over the shell, as high as it is wide at most."""
        return int(np.ceil((OVER_M + 2 * self.surface.radius_m) / STACK_M))

    @property
    def low_m(self):
        """Height of the lowest bin, m."""
        return self.bottom_m - self.below_m

    @property
    def corner_m(self):
        """(2,) x and y of the first cell, m."""
        s = self.surface
        axis = s.centre_m[:2] + np.array(s.slope) * (self.bottom_m - s.centre_m[2])
        return axis - self.across * self.cell_m / 2

    @property
    def bytes_needed(self):
        """Memory of the sums."""
        return self.across**2 * (3 * 8 * self.bins + 4 * self.levels)


def reach_of_floor(radius_m):
    """How far under the bottom of a shell of this radius its bottom is looked for, m."""
    return max(LEAST_REACH_M, REACH * radius_m)


def floor_grid(surface, bottom_m, top_m, *, below_m=None, above_m=None, cell_m=None):
    """`FloorGrid` of a shell.

    Parameters
    ----------
    surface : CylinderSurface
    bottom_m, top_m : float
        Heights of the ends of the shell, m.
    below_m, above_m : float, optional
        None: 0.12 of the radius, and 1 m at least, but no more above than half of the shell.
    cell_m : float, optional
        None: 0.25 m, more where the tank is wider than 18 m.
    """
    reach = reach_of_floor(surface.radius_m)
    return FloorGrid(
        surface,
        float(bottom_m),
        float(top_m),
        float(below_m or reach),
        float(above_m or min(reach, (top_m - bottom_m) / 2)),
        float(cell_m or max(CELL_M, 2 * surface.radius_m / MOST_ACROSS)),
    )


class FloorCells:
    """Sums over points in the cells of a plan.

    Attributes
    ----------
    sums : ndarray of int64, shape (across**2, bins)
        Count times 2**32, plus the sum of 256ths of a bin of height.
    places : ndarray of int64, shape (2, across**2, bins)
        Sums of x and y within the cell, in its 2**16th.
    stack : ndarray of uint32, shape (across**2, levels)
        Counts up to the top of the shell.
    by_scan : ndarray of uint32, shape (scans, across**2, classes)
        Counts of each scan near the bottom, in classes of COARSE bins.
    over : ndarray of uint32, shape (across**2,)
        Counts from OVER_M under the top of the shell on.
    roof : ndarray of int64, shape (roof_levels,)
        The same in all cells, by height.
    under : ndarray of uint32, shape (across**2,)
        Counts below the lowest bin.
    delivered, inside : int
        Points that came; of these inside the shell, SKIN_M off its mean radius.
    wall_below : int
        Points in line with the wall, but under it.
    """

    NAMES = ("sums", "places", "stack", "by_scan", "over", "roof", "under", "tally")

    def __init__(self, grid, scans=1):
        self.grid, self.scans = grid, scans
        cells = grid.across**2
        self.sums = np.zeros((cells, grid.bins), dtype=np.int64)
        self.places = np.zeros((2, cells, grid.bins), dtype=np.int64)
        self.stack = np.zeros((cells, grid.levels), dtype=np.uint32)
        self.by_scan = np.zeros((scans, cells, -(-grid.bins // COARSE)), dtype=np.uint32)
        self.over = np.zeros(cells, dtype=np.uint32)
        self.roof = np.zeros(grid.roof_levels, dtype=np.int64)
        self.under = np.zeros(cells, dtype=np.uint32)
        self.tally = np.zeros(3, dtype=np.int64)
        self._corner = grid.corner_m

    @property
    def delivered(self):
        """Points that came."""
        return int(self.tally[0])

    @property
    def inside(self):
        """Points inside the shell, SKIN_M off its mean radius."""
        return int(self.tally[1])

    @property
    def wall_below(self):
        """Points in line with the wall, but under it."""
        return int(self.tally[2])

    def add(self, xyz_m, scan=0):
        """Add points (n, 3) of one scan."""
        self.tally[0] += len(xyz_m)
        for start in range(0, len(xyz_m), PIECE):
            self._add(np.asarray(xyz_m[start : start + PIECE], dtype=float), scan)

    def merged(self, other):
        """The sums of the points of both, of the same grid."""
        both = FloorCells(self.grid, self.scans)
        for name in self.NAMES:
            np.add(getattr(self, name), getattr(other, name), out=getattr(both, name))
        return both

    __add__ = merged

    def counts(self):
        """(across, across, bins) points; the first axis is along x."""
        return (self.sums >> 32).reshape(self.grid.across, self.grid.across, -1)

    def counts_of_scans(self, low, high):
        """(across, across, scans) points in the classes that bins low to high, each (across,
        across), of each cell reach into.
        """
        number = np.arange(self.by_scan.shape[2])
        first, last = (one.ravel()[:, None] // COARSE for one in (low, high))
        within = (number >= first) & (number <= last)
        counts = np.einsum("scb,cb->cs", self.by_scan, within)
        return counts.reshape(self.grid.across, self.grid.across, self.scans)

    def means(self, within):
        """x, y, z (across, across) means over some bins (across, across, bins), nan: none; and
        their sd by the scatter of the points, and their count.
        """
        grid, number = self.grid, np.arange(self.grid.bins)
        within = within.reshape(self.sums.shape)
        counts = np.where(within, self.sums >> 32, 0)
        count = counts.sum(axis=1)
        units = np.where(within, self.sums & (COUNT - 1), 0).sum(axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            fine = (units + counts @ (number << FINE_BITS)) / count + 0.5
            z = grid.low_m + fine * (BIN_M / FINE)
            middle = counts @ number / count
            spread = np.sqrt(np.maximum(counts @ number**2 / count - middle**2, 0) / count) * BIN_M
            place = [np.where(within, one, 0).sum(axis=1) / count for one in self.places]
        cell = np.divmod(np.arange(len(count)), grid.across)
        xy = [
            corner + (one + (part + 0.5) / PLACE) * grid.cell_m
            for corner, one, part in zip(self._corner, cell, place, strict=True)
        ]
        shape = grid.across, grid.across
        return *(one.reshape(shape) for one in (*xy, z, spread)), count.reshape(shape)

    def _add(self, xyz_m, scan):
        grid = self.grid
        away = grid.surface.places(xyz_m)[2]
        at_wall = np.abs(away) <= SKIN_M
        self.tally[2] += np.count_nonzero(at_wall & (xyz_m[:, 2] < grid.bottom_m - FOOT_M))
        mine = away < -SKIN_M
        self.tally[1] += np.count_nonzero(mine)
        x, y, z = xyz_m[mine].T
        x, y = (x - self._corner[0]) / grid.cell_m, (y - self._corner[1]) / grid.cell_m
        column, row = x.astype(np.int64), y.astype(np.int64)
        sound = (column >= 0) & (column < grid.across) & (row >= 0) & (row < grid.across)
        x, y, z, column, row = (one[sound] for one in (x, y, z, column, row))
        cell = column * grid.across + row
        self._add_over(cell, z)
        below = z < grid.top_m
        x, y, z, column, row, cell = (one[below] for one in (x, y, z, column, row, cell))
        deep = z < grid.low_m
        np.add.at(self.under, cell[deep], np.uint32(1))
        x, y, z, column, row, cell = (one[~deep] for one in (x, y, z, column, row, cell))
        level = np.minimum(((z - grid.low_m) / STACK_M).astype(np.int64), grid.levels - 1)
        np.add.at(self.stack.ravel(), cell * grid.levels + level, np.uint32(1))
        fine = ((z - grid.low_m) * (FINE / BIN_M)).astype(np.int64)
        near = fine < grid.bins * FINE
        fine, cell = fine[near], cell[near]
        place = cell * grid.bins + (fine >> FINE_BITS)
        np.add.at(self.sums.ravel(), place, COUNT + (fine & (FINE - 1)))
        np.add.at(self.by_scan[scan], (cell, (fine >> FINE_BITS) // COARSE), np.uint32(1))
        for sums, part, whole in zip(self.places, (x, y), (column, row), strict=True):
            np.add.at(sums.ravel(), place, ((part[near] - whole[near]) * PLACE).astype(np.int64))

    def _add_over(self, cell, z):
        level = (z - (self.grid.top_m - OVER_M)) / STACK_M
        over = (level >= 0) & (level < len(self.roof))
        np.add.at(self.over, cell[over], np.uint32(1))
        np.add.at(self.roof, level[over].astype(np.int64), 1)


def floor_cells_of(points, grid, from_inside):
    """`FloorCells` of an iterator of (scan, points); from_inside: whether each scan stood there."""
    cells = FloorCells(grid, len(from_inside))
    for scan, xyz in points:
        if from_inside[scan]:
            cells.add(xyz, scan)
    return cells
