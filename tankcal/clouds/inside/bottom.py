"""Bottom of an upright tank in scans from inside, by a square grid of its plan.

Sums over the points inside an upright shell, in a square grid of its plan.

Near the bottom each cell has a histogram of heights, and integer sums of heights and positions. Up
to the top of the shell each cell has counts at levels, which show objects in the tank. Counts of
each scan in coarse classes give the share of each scan. Counts above the shell show a roof.

Heights are counted in cells of the plan. Heights that connect from cell to cell form a surface. The
largest surface is the bottom, and it must meet the foot of the shell. A film of liquid gives mirror
images; each lies as far below the bottom as its object lies above. Objects on the bottom are
excluded.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from tankcal.clouds.wall.cells import COUNT, FILE, FINE, FINE_BITS, PLACE
from tankcal.clouds.wall.growing import (
    FEWEST,
    WALL,
    estimate_spread,
    find_off_trend,
    grow_wall,
)
from tankcal.clouds.wall.passes import Passes
from tankcal.clouds.wall.start import CylinderSurface
from tankcal.errors import InputError, Problem
from tankcal.messages import message

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


LEAST_SHARE = 0.4  # least share of the plan that must show the bottom
# Width of the ring at the shell where the bottom is compared with the foot of the shell, cells;
# largest distance between them, m, and as a share of the radius
EDGE_CELLS, FOOT_OFF_M, FOOT_SHARE = 3, 0.25, 0.01
LEAST_SD_M = 1e-4  # least standard deviation of the height of a cell, m
CLEAR_BINS = 5  # bins about the bottom that belong to it; lower points belong to another object
LEAST_PIT_CELLS, LEAST_PIT_M = 2, 0.05  # least number of cells and least depth of a pit
FEWEST_OF_BLOCK = 9  # least number of cells for the fit of a quadratic
# Tolerance of the height of a mirror image, bins; least share of the lower points that are mirrored
MIRROR_BINS, MIRRORED = 3, 0.5
# Least points of a cell above the shell; least share of the plan with such cells for a roof
ROOF_POINTS, ROOF_SHARE = 3, 0.3


@dataclass(frozen=True)
class RoofSeen:
    """Roof over the shell; it has no part in the capacity table.

    Attributes
    ----------
    share : float
        Share of the plan in which the roof is seen.
    low_m, high_m : float
        Heights between which 90 % of its points lie, in the frame of the points, m.
    """

    share: float
    low_m: float
    high_m: float


@dataclass(frozen=True)
class Pit:
    """Connected cells whose ground is lower than the bottom, such as a sump.

    Attributes
    ----------
    x_m, y_m : float
        Centre of the pit, in the frame of the points, m.
    bottom_m, top_m : float
        Heights of the ground of the pit and of the bottom around it, m.
    area_m2, u_area_m2 : float
        Area of the ground, from whole cells, and its standard uncertainty due to the cell size, m2.
    """

    x_m: float
    y_m: float
    bottom_m: float
    top_m: float
    area_m2: float
    u_area_m2: float
    kind, box_m3, points = "pit", None, None

    @property
    def deadwood_row(self):
        """Row of deadwood: name, heights of bottom and top (m), volume and its u (m3)."""
        deep = self.top_m - self.bottom_m
        name = f"pit {self.x_m:.2f} {self.y_m:.2f}"
        return name, self.bottom_m, self.top_m, self.area_m2 * deep, self.u_area_m2 * deep


@dataclass(frozen=True)
class CloudBottom:
    """Bottom of a tank in cells of the plan; the first axis is along x.

    Attributes
    ----------
    grid : FloorGrid
        Cells of the plan.
    xyz_m : ndarray, shape (across, across, 3)
        Mean position of the points of the bottom in each cell, in the frame of the points, m; nan
        if the cell does not show the bottom.
    sd_m : ndarray, shape (across, across)
        Standard deviation of the height, from the points and from neighbouring cells, m.
    is_bottom, in_plan : ndarray of bool, shape (across, across)
        Cells that show the bottom; cells whose centre lies in the shell.
    mirror : ndarray of bool, shape (across, across)
        Cells with a mirror image below the bottom, which shows a film of liquid.
    mirrored : int
        Number of points below bottom and wall, as in a mirror. They show that liquid stands on the
        bottom. Its surface is taken as the bottom where it has points.
    scatter_m : float
        Standard deviation of the height of a cell, from its neighbours, m.
    seen_share : float
        Share of the cells of the plan that show the bottom.
    pits : tuple of Pit
        Pits in the bottom, the largest first.
    scan_counts : ndarray, shape (across, across, scans)
        Number of points of each scan near the bottom in each cell.
    roof : RoofSeen or None
        Roof over the shell, or None if no roof is seen.
    cells : FloorCells
        Sums from which the bottom was found.
    """

    grid: object
    xyz_m: np.ndarray
    sd_m: np.ndarray
    is_bottom: np.ndarray
    in_plan: np.ndarray
    mirror: np.ndarray
    mirrored: int
    scatter_m: float
    seen_share: float
    pits: tuple[Pit, ...]
    scan_counts: np.ndarray
    roof: RoofSeen | None
    cells: FloorCells


def find_cloud_bottom(passes, cloud_wall, sides=None, *, below_m=None, above_m=None, cell_m=None):
    """Find the bottom of a tank in the points of scans from inside.

    Parameters
    ----------
    passes : callable or Passes
        As for `find_cloud_wall`.
    cloud_wall : CloudWall
        Wall of an upright tank.
    sides : sequence of str, optional
        "inside" or "outside" for each scan; scans from outside are ignored.
    below_m, above_m, cell_m : float, optional
        As for `floor_grid`.

    Returns
    -------
    CloudBottom

    Raises
    ------
    InputError
        If no surface is found, or if the surface does not meet the foot of the shell.
    """
    joints = cloud_wall.joints_m
    sizes = {"below_m": below_m, "above_m": above_m, "cell_m": cell_m}
    grid = floor_grid(cloud_wall.surface, joints[0], joints[-1], **sizes)
    inside = [side != "outside" for side in sides or cloud_wall.sides]
    passes = Passes(passes) if callable(passes) else passes
    return find_bottom_in_cells(passes.gather(sum_floor_cells, grid, inside))


def find_bottom_in_cells(cells):
    """Find the bottom in the sums of `FloorCells`; return a `CloudBottom`."""
    # The largest surface that connects from cell to cell is the candidate for the bottom.
    grid, counts = cells.grid, cells.counts()
    radius_m = grid.surface.radius_m
    in_plan = grid.distance_m < radius_m - grid.cell_m / 2
    rim = in_plan & (grid.distance_m > radius_m - EDGE_CELLS * grid.cell_m)
    width = np.full(grid.across, grid.cell_m)
    surface = grow_wall(counts, column_m=width, row_m=grid.cell_m, bin_m=BIN_M)
    x, y, z, spread, count = cells.means(surface.wall_bins(grid.bins))
    # Cells that deviate from the trend of their neighbours show objects on the bottom. The slope
    # within a cell is removed first.
    is_bottom = (surface.why == WALL) & (count >= FEWEST)
    is_bottom &= ~find_off_trend(_reduce_to_centres(x, y, z, is_bottom, grid), spread, is_bottom)
    seen_share = float(np.mean(is_bottom[in_plan]))
    _check_bottom(z, is_bottom, rim, seen_share, grid)
    even = np.where(is_bottom, _reduce_to_centres(x, y, z, is_bottom, grid), np.nan)
    scatter = max(_scatter(even), LEAST_SD_M)
    level = extend_level(z, is_bottom)
    mirror, low, share, mirrored = _find_mirror_images(counts, level, grid)
    mirror |= cells.under.reshape(mirror.shape) >= FEWEST
    return CloudBottom(
        grid=grid,
        xyz_m=np.where(is_bottom[..., None], np.stack([x, y, z], axis=-1), np.nan),
        sd_m=np.where(is_bottom, np.maximum(spread, scatter), np.nan),
        is_bottom=is_bottom,
        in_plan=in_plan,
        mirror=mirror,
        mirrored=mirrored + int(cells.under.sum()) + cells.wall_below,
        scatter_m=scatter,
        seen_share=seen_share,
        pits=_find_pits(np.where(mirror, np.nan, low), share, level, grid),
        scan_counts=cells.count_by_scan(surface.low, surface.high),
        roof=_find_roof(cells, in_plan),
        cells=cells,
    )


def _find_roof(cells, in_plan):
    """Return `RoofSeen`, or None if too small a share of the plan has points above the shell."""
    share = float(np.mean(cells.over.reshape(in_plan.shape)[in_plan] >= ROOF_POINTS))
    if share < ROOF_SHARE:
        return None
    level = np.searchsorted(np.cumsum(cells.roof), np.array([0.05, 0.95]) * cells.roof.sum())
    low, high = cells.grid.top_m - OVER_M + (level + 0.5) * STACK_M
    return RoofSeen(share, float(low), float(high))


def _reduce_to_centres(x, y, z, known, grid):
    """Reduce heights to the centres of their cells, with the slope between the adjacent cells."""
    seen, carried = np.where(known, z, np.nan), z.copy()
    for axis, place in enumerate((x, y)):
        before, after = np.roll(seen, 1, axis=axis), np.roll(seen, -1, axis=axis)
        p, n = np.roll(place, 1, axis=axis), np.roll(place, -1, axis=axis)
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = np.nan_to_num((after - before) / (n - p), posinf=0, neginf=0)
        middle = grid.corner_m[axis] + (np.arange(grid.across) + 0.5) * grid.cell_m
        carried -= slope * np.nan_to_num(place - np.expand_dims(middle, 1 - axis))
    return carried


def _scatter(values):
    """Standard deviation of a cell from second differences, the larger of both directions."""
    differences = [values[1:-1] - (values[:-2] + values[2:]) / 2]
    differences.append(values[:, 1:-1] - (values[:, :-2] + values[:, 2:]) / 2)
    return max(estimate_spread(values_of_direction) for values_of_direction in differences)


def extend_level(z, is_bottom):
    """Height of the bottom in each cell (across, across), from the nearest cell that shows it."""
    nearest = scipy.ndimage.distance_transform_edt(~is_bottom, return_indices=True)[1]
    return np.where(is_bottom, z, np.nan)[tuple(nearest)]


def _check_bottom(z, is_bottom, rim, seen, grid):
    """Raise InputError if the bottom is too small or does not meet the foot of the shell."""
    foot = z[rim & is_bottom]
    if seen < LEAST_SHARE or not len(foot):
        text = message(
            "cloud_no_bottom",
            "only {share:.0f} % of the plan shows a bottom between {low_m:.2f} m and {high_m:.2f} "
            "m; expected {least:.0f} % at least: scans from inside, with dry steel under them, and "
            "no box of leave_out over it",
            share=100 * seen,
            low_m=grid.low_m,
            high_m=grid.bottom_m + grid.above_m,
            least=100 * LEAST_SHARE,
        )
        raise InputError(Problem(FILE, text))
    off = float(np.median(foot)) - grid.bottom_m
    if abs(off) > max(FOOT_OFF_M, FOOT_SHARE * grid.surface.radius_m):
        text = message(
            "cloud_bottom_elsewhere",
            "the largest surface that lies in the shell is at {found_m:.3f} m beside the wall, "
            "and the shell begins at {bottom_m:.3f} m: a floating roof, liquid, a mirror image, or "
            "bottom_z_m in another frame",
            found_m=off + grid.bottom_m,
            bottom_m=grid.bottom_m,
        )
        raise InputError(Problem(FILE, text))


def _find_mirror_images(counts, level, grid):
    """Separate the points below the bottom into mirror images and lower ground.

    A mirror image lies as far below the film of liquid as the object above it, in the same cell.

    Returns
    -------
    mirror : ndarray of bool, shape (across, across)
        Cells with mirror images.
    height : ndarray, shape (across, across)
        Height of lower ground, m; nan if there is none.
    share : ndarray, shape (across, across)
        Share of the lower points among the points near or below the bottom; nan without points.
    mirrored : int
        Number of mirrored points.
    """
    bins, number = grid.bins, np.arange(grid.bins)
    at = np.clip(np.floor((level - grid.low_m) / BIN_M), 0, bins - 1).astype(np.int64)[..., None]
    low = np.where(number < at - CLEAR_BINS, counts, 0)
    # A bin n below the bottom at bin `at` is a mirror image if bin 2 at - n above it has points.
    above = scipy.ndimage.maximum_filter1d(counts, 2 * MIRROR_BINS + 1, axis=2)
    image = np.clip(2 * at - number, 0, bins - 1)
    mirrored = np.where(np.take_along_axis(above, image, axis=2) > 0, low, 0).sum(axis=2)
    total = low.sum(axis=2)
    some = total >= FEWEST
    mirror = some & (mirrored > MIRRORED * total)
    peak = np.argmax(low, axis=2)
    ground = np.where(np.abs(number - at) <= CLEAR_BINS, counts, 0).sum(axis=2)
    share = total / np.maximum(total + ground, 1)
    height = np.where(some & ~mirror, grid.low_m + (peak + 0.5) * BIN_M, np.nan)
    share = np.where(total + ground > 0, share, np.nan)
    return mirror, height, share, int(mirrored[mirror].sum())


def _find_pits(low, share, level, grid):
    """Return a tuple of `Pit`, the largest first, from the height of lower ground in cells."""
    label, count = scipy.ndimage.label(np.isfinite(low), np.ones((3, 3)))
    pits = []
    for pit_number in range(1, count + 1):
        in_pit = label == pit_number
        deep, top = float(np.median(low[in_pit])), float(np.median(level[in_pit]))
        filled = scipy.ndimage.binary_fill_holes(
            scipy.ndimage.binary_closing(in_pit, np.ones((3, 3)))
        )
        area = float(np.nansum(np.where(np.isnan(share), 1.0, share)[filled])) * grid.cell_m**2
        if np.count_nonzero(in_pit) < LEAST_PIT_CELLS or top - deep < LEAST_PIT_M:
            continue
        x, y = grid.corner_m + (np.argwhere(filled).mean(axis=0) + 0.5) * grid.cell_m
        # The edge of a circle of this area, uncertain by a rectangular distribution of one cell
        edge = 2 * np.sqrt(np.pi * area) * grid.cell_m / np.sqrt(12)
        pits.append(Pit(float(x), float(y), deep, top, area, float(edge)))
    return tuple(sorted(pits, key=lambda pit: -pit.area_m2))


@dataclass(frozen=True)
class BottomPoints:
    """Points of a bottom for the file bottom.csv.

    Attributes
    ----------
    xyz_m : ndarray, shape (n, 3)
        Means of cells, in the frame of the points, m.
    sd_m : ndarray, shape (n,)
        Standard deviation of the height, m: the value of a single cell, not reduced by averaging.
    cells : ndarray of int, shape (n,)
        Number of cells of each point.
    share : ndarray, shape (n, scans)
        Share of each scan in the height.
    """

    xyz_m: np.ndarray
    sd_m: np.ndarray
    cells: np.ndarray
    share: np.ndarray


def bottom_points(bottom, most=400):
    """Reduce a `CloudBottom` to at most `most` points, one for each square block of cells.

    The height is the value of a quadratic fit to the cells of the block and the adjacent cells. The
    mean of the cells would be biased where the bottom is curved.
    """
    shown = bottom.is_bottom & bottom.in_plan
    column, row = np.nonzero(shown)
    for side in range(1, bottom.grid.across + 1):
        block = (column // side) * bottom.grid.across + row // side
        blocks, place, cells = np.unique(block, return_inverse=True, return_counts=True)
        if len(blocks) <= most:
            break
    # Blocks of more than one cell have the height of a quadratic at the mean position.
    values = bottom.xyz_m[column, row]
    xyz = np.column_stack([np.bincount(place, value) / cells for value in values.T])
    for i, value in enumerate(blocks) if side > 1 else ():
        first = np.array(divmod(int(value), bottom.grid.across)) * side
        low, high = np.maximum(first - 1, 0), first + side + 1
        window = np.s_[low[0] : high[0], low[1] : high[1]]
        xyz[i, 2] = _height_at(xyz[i], bottom.xyz_m[window][shown[window]])
    # The variance is averaged, not reduced: neighbouring cells share errors.
    variance = np.bincount(place, bottom.sd_m[column, row] ** 2) / cells
    scan_counts = bottom.scan_counts[column, row].astype(float)
    scan_counts /= np.maximum(scan_counts.sum(axis=1, keepdims=True), 1)
    share = np.column_stack([np.bincount(place, value) / cells for value in scan_counts.T])
    return BottomPoints(xyz, np.sqrt(variance), cells, share)


def _height_at(middle, xyz):
    """Height at a position from a quadratic fit to cells (n, 3).

    Too few cells, or cells on a line, do not determine the quadratic; the height is then unchanged.
    """
    x, y, z = (xyz - middle).T
    design = np.column_stack([np.ones(len(z)), x, y, x * x, x * y, y * y])
    scale = np.max(np.abs(design), axis=0)
    if len(z) < FEWEST_OF_BLOCK or not scale.all():
        return middle[2]
    solution, _, rank, _ = np.linalg.lstsq(design / scale, z, rcond=1e-4)
    return middle[2] + solution[0] if rank == design.shape[1] else middle[2]
