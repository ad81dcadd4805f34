"""Bottom of an upright tank in scans from inside.

Heights are counted in cells of the plan. Heights that connect from cell to cell form a surface. The
largest surface is the bottom, and it must meet the foot of the shell. A film of liquid gives mirror
images; each lies as far below the bottom as its object lies above. Objects on the bottom are
excluded.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from tankcal.clouds.inside.floor_cells import (
    BIN_M,
    OVER_M,
    STACK_M,
    FloorCells,
    floor_grid,
    sum_floor_cells,
)
from tankcal.clouds.wall.cells import FILE
from tankcal.clouds.wall.growing import (
    FEWEST,
    WALL,
    estimate_spread,
    find_off_trend,
    grow_wall,
)
from tankcal.clouds.wall.passes import Passes
from tankcal.errors import InputError, Problem
from tankcal.messages import message

LEAST_SHARE = 0.4  # least share of the plan that must show the bottom
# Width of the ring at the shell where the bottom is compared with the foot of the shell, cells;
# largest distance between them, m, and as a share of the radius
EDGE_CELLS, FOOT_M, FOOT_SHARE = 3, 0.25, 0.01
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
    if abs(off) > max(FOOT_M, FOOT_SHARE * grid.surface.radius_m):
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
