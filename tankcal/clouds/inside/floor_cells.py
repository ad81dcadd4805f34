"""Sums over the points inside an upright shell, in a square grid of its plan.

Near the bottom each cell has a histogram of heights, and integer sums of heights and positions. Up
to the top of the shell each cell has counts at levels, which show objects in the tank. Counts of
each scan in coarse classes give the share of each scan. Counts above the shell show a roof.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.clouds.wall.cells import COUNT, FINE, FINE_BITS, PLACE
from tankcal.clouds.wall.start import CylinderSurface

PIECE = 1 << 16  # points added at a time
BIN_M = 0.01  # width of a bin of the heights near the bottom, m
CELL_M, MOST_ACROSS = 0.25, 72  # side of a cell, m; largest number of cells across the tank
STACK_M = 0.1  # height of a level of the counts up to the top, m
LEAST_REACH_M, REACH = 1.0, 0.12  # range of heights near the bottom: least, m; share of the radius
SKIN_M = 0.1  # distance from the mean wall within which points belong to the wall, m
FOOT_M = 0.25  # depth under the shell below which no point can belong to the wall, m
COARSE = 10  # bins in a class of the counts of each scan
OVER_M = 0.2  # depth under the top of the shell from which points may belong to a roof, m


@dataclass(frozen=True)
class FloorGrid:
    """Cells of the plan of an upright shell.

    Attributes
    ----------
    surface : CylinderSurface
        Wall; the plan is normal to z, centred on the axis at the bottom of the shell.
    bottom_m, top_m : float
        Height of the lower and the upper end of the shell, m.
    below_m, above_m : float
        Range of the bins of height, below and above the bottom of the shell, m.
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
        """Number of cells in one direction, with one cell beyond the shell on each side."""
        return 2 * int(np.ceil(self.surface.radius_m / self.cell_m)) + 2

    @property
    def distance_m(self):
        """Distance (across, across) of the centre of each cell from the axis, m."""
        middle = (np.arange(self.across) + 0.5 - self.across / 2) * self.cell_m
        return np.hypot(middle[:, None], middle[None, :])

    @property
    def bins(self):
        """Number of bins of height near the bottom."""
        return int(np.ceil((self.below_m + self.above_m) / BIN_M - 1e-9))

    @property
    def levels(self):
        """Number of levels of the counts, from below the bottom to the top."""
        return int(np.ceil((self.below_m + self.top_m - self.bottom_m) / STACK_M - 1e-9))

    @property
    def roof_levels(self):
        """Number of levels above the shell, up to a height of one diameter."""
        return int(np.ceil((OVER_M + 2 * self.surface.radius_m) / STACK_M))

    @property
    def low_m(self):
        """Height of the lowest bin, m."""
        return self.bottom_m - self.below_m

    @property
    def corner_m(self):
        """Coordinates x and y (2,) of the corner of the first cell, m."""
        s = self.surface
        axis = s.centre_m[:2] + np.array(s.slope) * (self.bottom_m - s.centre_m[2])
        return axis - self.across * self.cell_m / 2


def floor_reach(radius_m):
    """Depth below the shell in which the bottom is searched, m, for a radius in m."""
    return max(LEAST_REACH_M, REACH * radius_m)


def floor_grid(surface, bottom_m, top_m, *, below_m=None, above_m=None, cell_m=None):
    """Create the `FloorGrid` of a shell.

    Parameters
    ----------
    surface : CylinderSurface
        Wall of the tank.
    bottom_m, top_m : float
        Heights of the ends of the shell, m.
    below_m, above_m : float, optional
        Range of the bins of height, m. By default 0.12 of the radius, but at least 1 m; `above_m`
        is at most half the height of the shell.
    cell_m : float, optional
        Side of a cell, m. By default 0.25 m, and more for a tank wider than 18 m.
    """
    reach = floor_reach(surface.radius_m)
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
        Count times 2**32, plus the sum of the heights within the bin in 1/256 of its width.
    places : ndarray of int64, shape (2, across**2, bins)
        Sums of x and y within the cell, in 1/2**16 of its side.
    stack : ndarray of uint32, shape (across**2, levels)
        Counts at the levels up to the top of the shell.
    scan_counts : ndarray of uint32, shape (scans, across**2, classes)
        Counts of each scan near the bottom, in classes of COARSE bins.
    over : ndarray of uint32, shape (across**2,)
        Counts above the height of OVER_M below the top of the shell.
    roof : ndarray of int64, shape (roof_levels,)
        The counts of `over` in all cells together, by height.
    under : ndarray of uint32, shape (across**2,)
        Counts below the lowest bin.
    tally : ndarray of int64, shape (2,)
        The numbers of points `inside` and `wall_below`.
    """

    NAMES = ("sums", "places", "stack", "scan_counts", "over", "roof", "under", "tally")

    def __init__(self, grid, scans=1):
        self.grid, self.scans = grid, scans
        cells = grid.across**2
        self.sums = np.zeros((cells, grid.bins), dtype=np.int64)
        self.places = np.zeros((2, cells, grid.bins), dtype=np.int64)
        self.stack = np.zeros((cells, grid.levels), dtype=np.uint32)
        self.scan_counts = np.zeros((scans, cells, -(-grid.bins // COARSE)), dtype=np.uint32)
        self.over = np.zeros(cells, dtype=np.uint32)
        self.roof = np.zeros(grid.roof_levels, dtype=np.int64)
        self.under = np.zeros(cells, dtype=np.uint32)
        self.tally = np.zeros(2, dtype=np.int64)
        self._corner = grid.corner_m

    @property
    def inside(self):
        """Number of points inside the shell, SKIN_M from its mean radius."""
        return int(self.tally[0])

    @property
    def wall_below(self):
        """Number of points on the surface of the wall, but below the shell."""
        return int(self.tally[1])

    def add(self, xyz_m, scan=0):
        """Add points (n, 3) of one scan."""
        for start in range(0, len(xyz_m), PIECE):
            self._add(np.asarray(xyz_m[start : start + PIECE], dtype=float), scan)

    def merge(self, other):
        """Return the sums of both sets of points, in the same grid."""
        both = FloorCells(self.grid, self.scans)
        for name in self.NAMES:
            np.add(getattr(self, name), getattr(other, name), out=getattr(both, name))
        return both

    __add__ = merge

    def counts(self):
        """Number of points in each bin (across, across, bins); the first axis is along x."""
        return (self.sums >> 32).reshape(self.grid.across, self.grid.across, -1)

    def count_by_scan(self, low, high):
        """Number of points of each scan (across, across, scans) in a range of bins of each cell.

        The range from `low` to `high`, each (across, across), is widened to whole classes.
        """
        class_number = np.arange(self.scan_counts.shape[2])
        first, last = (bins.ravel()[:, None] // COARSE for bins in (low, high))
        within = (class_number >= first) & (class_number <= last)
        counts = np.einsum("scb,cb->cs", self.scan_counts, within)
        return counts.reshape(self.grid.across, self.grid.across, self.scans)

    def means(self, within):
        """Means of x, y and z over some bins of each cell.

        Parameters
        ----------
        within : ndarray of bool, shape (across, across, bins)
            Bins to include.

        Returns
        -------
        x, y, z, spread, count : ndarray, shape (across, across)
            Means, m (nan without points); standard deviation of the mean height from the scatter of
            the points, m; number of points.
        """
        grid, bin_number = self.grid, np.arange(self.grid.bins)
        within = within.reshape(self.sums.shape)
        counts = np.where(within, self.sums >> 32, 0)
        count = counts.sum(axis=1)
        units = np.where(within, self.sums & (COUNT - 1), 0).sum(axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            # Half a unit compensates the truncation of each height to whole units.
            fine = (units + counts @ (bin_number << FINE_BITS)) / count + 0.5
            z = grid.low_m + fine * (BIN_M / FINE)
            middle = counts @ bin_number / count
            spread = (
                np.sqrt(np.maximum(counts @ bin_number**2 / count - middle**2, 0) / count) * BIN_M
            )
            place = [np.where(within, values, 0).sum(axis=1) / count for values in self.places]
        cell = np.divmod(np.arange(len(count)), grid.across)
        xy = [
            corner + (values + (part + 0.5) / PLACE) * grid.cell_m
            for corner, values, part in zip(self._corner, cell, place, strict=True)
        ]
        shape = grid.across, grid.across
        return *(values.reshape(shape) for values in (*xy, z, spread)), count.reshape(shape)

    def _add(self, xyz_m, scan):
        grid = self.grid
        distance = grid.surface.places(xyz_m)[2]
        at_wall = np.abs(distance) <= SKIN_M
        self.tally[1] += np.count_nonzero(at_wall & (xyz_m[:, 2] < grid.bottom_m - FOOT_M))
        is_inside = distance < -SKIN_M
        self.tally[0] += np.count_nonzero(is_inside)
        x, y, z = xyz_m[is_inside].T
        x, y = (x - self._corner[0]) / grid.cell_m, (y - self._corner[1]) / grid.cell_m
        column, row = x.astype(np.int64), y.astype(np.int64)
        in_grid = (column >= 0) & (column < grid.across) & (row >= 0) & (row < grid.across)
        x, y, z, column, row = (values[in_grid] for values in (x, y, z, column, row))
        cell = column * grid.across + row
        self._add_over(cell, z)
        # Points above the shell and below the lowest bin are excluded from the histograms.
        below = z < grid.top_m
        x, y, z, column, row, cell = (values[below] for values in (x, y, z, column, row, cell))
        deep = z < grid.low_m
        np.add.at(self.under, cell[deep], np.uint32(1))
        x, y, z, column, row, cell = (values[~deep] for values in (x, y, z, column, row, cell))
        level = np.minimum(((z - grid.low_m) / STACK_M).astype(np.int64), grid.levels - 1)
        np.add.at(self.stack.ravel(), cell * grid.levels + level, np.uint32(1))
        fine = ((z - grid.low_m) * (FINE / BIN_M)).astype(np.int64)
        near = fine < grid.bins * FINE
        fine, cell = fine[near], cell[near]
        bin_index = cell * grid.bins + (fine >> FINE_BITS)
        np.add.at(self.sums.ravel(), bin_index, COUNT + (fine & (FINE - 1)))
        np.add.at(self.scan_counts[scan], (cell, (fine >> FINE_BITS) // COARSE), np.uint32(1))
        for sums, part, whole in zip(self.places, (x, y), (column, row), strict=True):
            np.add.at(
                sums.ravel(), bin_index, ((part[near] - whole[near]) * PLACE).astype(np.int64)
            )

    def _add_over(self, cell, z):
        level = (z - (self.grid.top_m - OVER_M)) / STACK_M
        over = (level >= 0) & (level < len(self.roof))
        np.add.at(self.over, cell[over], np.uint32(1))
        np.add.at(self.roof, level[over].astype(np.int64), 1)


def sum_floor_cells(points, grid, from_inside):
    """Sum an iterator of (scan, points) in `FloorCells`.

    Only the scans for which `from_inside` (sequence of bool) is true are included.
    """
    cells = FloorCells(grid, len(from_inside))
    for scan, xyz in points:
        if from_inside[scan]:
            cells.add(xyz, scan)
    return cells
