"""The bottom of an upright tank in points of scans from inside.

Over cells of the plan the heights are counted; what hangs together from cell to cell is a surface,
and the largest that meets the foot of the shell is the bottom. What a film of liquid mirrors lies
under it, at the height below that it has above; what stands out of the bottom is left out.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from tankcal.clouds.inside.floor_cells import (
    BIN_M,
    OVER_M,
    STACK_M,
    FloorCells,
    floor_cells_of,
    floor_grid,
)
from tankcal.clouds.wall.growing import (
    FEWEST,
    WALL,
    grow_wall,
    off_trend,
    spread_between,
)
from tankcal.clouds.wall.passes import Passes
from tankcal.clouds.wall.screens import FILE
from tankcal.errors import InputError, Problem
from tankcal.messages import message

LEAST_SHARE = 0.4  # of the plan that must be seen as bottom
EDGE_CELLS, FOOT_M, FOOT_SHARE = 3, 0.25, 0.01  # ring at the shell, how far off its foot (radius)
LEAST_SD_M = 1e-4  # no height of a cell is told better
CLEAR_BINS = 5  # under the bottom, from which on something is another thing
LEAST_PIT_CELLS, LEAST_PIT_M = 2, 0.05
FEWEST_OF_BLOCK = 9  # cells that a quadratic is laid through
MIRROR_BINS, MIRRORED = 3, 0.5  # how near the thing above, and how much of what is below
ROOF_POINTS, ROOF_SHARE = 3, 0.3  # of a cell over the shell; of the plan, from which it is a roof


@dataclass(frozen=True)
class RoofSeen:
    """What closes the tank over its shell; no part of a table.

    Attributes
    ----------
    share : float
        Of the plan that shows it.
    low_m, high_m : float
        Heights between which 90 % of its points lie, in the frame of the points, m.
    """

    share: float
    low_m: float
    high_m: float


@dataclass(frozen=True)
class Pit:
    """Cells that hang together whose ground lies lower than the bottom, such as a sump.

    Attributes
    ----------
    x_m, y_m : float
        Middle, in the frame of the points.
    bottom_m, top_m : float
        Height of its ground and of the bottom round it.
    area_m2, u_area_m2 : float
        Of its ground, by whole cells, and how well cells tell it.
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
        """name, bottom, top (heights in the frame of the points, m), volume and u, m3."""
        deep = self.top_m - self.bottom_m
        name = f"pit {self.x_m:.2f} {self.y_m:.2f}"
        return name, self.bottom_m, self.top_m, self.area_m2 * deep, self.u_area_m2 * deep


@dataclass(frozen=True)
class CloudBottom:
    """The bottom in cells of the plan; the first axis is along x.

    Attributes
    ----------
    grid : FloorGrid
    xyz_m : ndarray, shape (across, across, 3)
        Mean place of the points of the bottom in each cell, in the frame of the points, m; nan:
        the cell does not show the bottom.
    sd_m : ndarray, shape (across, across)
        Of its height, by the points and by what neighbouring cells differ by.
    is_bottom, in_plan : ndarray of bool, shape (across, across)
        Cells that show it; cells whose middle lies in the shell.
    mirror : ndarray of bool, shape (across, across)
        Cells under which something is seen upside down: a film of liquid lies there.
    mirrored : int
        Points that lie under bottom and wall, as in a mirror: liquid stands on the bottom, whose
        surface is taken for it where it gave points.
    scatter_m : float
        Sd of the height of one cell as its neighbours show it.
    seen_share : float
        Of the cells of the plan.
    pits : tuple of Pit
    by_scan : ndarray, shape (across, across, scans)
        Points of each scan about the bottom in each cell.
    roof : RoofSeen or None
        None: hardly anything is seen over the shell.
    cells : FloorCells
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
    by_scan: np.ndarray
    roof: RoofSeen | None
    cells: FloorCells


def find_cloud_bottom(passes, cloud_wall, sides=None, *, below_m=None, above_m=None, cell_m=None):
    """The bottom that the points of scans from inside show.

    Parameters
    ----------
    passes : callable, or an object as `passes.Passes` is
        As for `find_cloud_wall`.
    cloud_wall : CloudWall
        Of an upright tank.
    sides : sequence of str, optional
        "inside" or "outside" for each scan: others than those from inside are passed over.
    below_m, above_m, cell_m : float, optional
        As for `floor_grid`.

    Returns
    -------
    CloudBottom

    Raises
    ------
    InputError
        Where no surface, or one that does not meet the foot of the shell, is seen.
    """
    joints = cloud_wall.joints_m
    sizes = {"below_m": below_m, "above_m": above_m, "cell_m": cell_m}
    grid = floor_grid(cloud_wall.surface, joints[0], joints[-1], **sizes)
    inside = [one != "outside" for one in sides or cloud_wall.sides]
    passes = Passes(passes) if callable(passes) else passes
    return bottom_of_cells(passes.gather(floor_cells_of, grid, inside))


def bottom_of_cells(cells):
    """`CloudBottom` of the sums in cells."""
    grid, counts = cells.grid, cells.counts()
    in_plan, rim = _plan(grid)
    width = np.full(grid.across, grid.cell_m)
    grown = grow_wall(counts, column_m=width, row_m=grid.cell_m, bin_m=BIN_M)
    number = np.arange(grid.bins)
    within = (number >= grown.low[..., None]) & (number <= grown.high[..., None])
    within &= (grown.why == WALL)[..., None]
    x, y, z, spread, count = cells.means(within)
    is_bottom = (grown.why == WALL) & (count >= FEWEST)
    is_bottom &= ~off_trend(_flattened(x, y, z, is_bottom, grid), spread, is_bottom)
    seen = float(np.mean(is_bottom[in_plan]))
    _refuse(z, is_bottom, rim, seen, grid)
    even = np.where(is_bottom, _flattened(x, y, z, is_bottom, grid), np.nan)
    scatter = max(_scatter(even), LEAST_SD_M)
    level = level_everywhere(z, is_bottom)
    mirror, low, share, mirrored = _what_lies_below(counts, level, grid)
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
        seen_share=seen,
        pits=_pits(np.where(mirror, np.nan, low), share, level, grid),
        by_scan=cells.counts_of_scans(grown.low, grown.high),
        roof=_roof(cells, in_plan),
        cells=cells,
    )


def _roof(cells, in_plan):
    share = float(np.mean(cells.over.reshape(in_plan.shape)[in_plan] >= ROOF_POINTS))
    if share < ROOF_SHARE:
        return None
    level = np.searchsorted(np.cumsum(cells.roof), np.array([0.05, 0.95]) * cells.roof.sum())
    low, high = cells.grid.top_m - OVER_M + (level + 0.5) * STACK_M
    return RoofSeen(share, float(low), float(high))


def _plan(grid):
    """Cells whose middle lies in the shell, and those of them at its foot."""
    middle = (np.arange(grid.across) + 0.5 - grid.across / 2) * grid.cell_m
    away = np.hypot(middle[:, None], middle[None, :])
    in_plan = away < grid.surface.radius_m - grid.cell_m / 2
    return in_plan, in_plan & (away > grid.surface.radius_m - EDGE_CELLS * grid.cell_m)


def _flattened(x, y, z, known, grid):
    """Heights carried to the middle of their cells along the slope of the cells beside them."""
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
    """Sd of a cell by the second differences along both directions, the larger of them."""
    parts = [values[1:-1] - (values[:-2] + values[2:]) / 2]
    parts.append(values[:, 1:-1] - (values[:, :-2] + values[:, 2:]) / 2)
    return max(spread_between(one) for one in parts)


def level_everywhere(z, is_bottom):
    """(across, across) height of the bottom in every cell; where it is not seen, of the nearest."""
    nearest = scipy.ndimage.distance_transform_edt(~is_bottom, return_indices=True)[1]
    return np.where(is_bottom, z, np.nan)[tuple(nearest)]


def _refuse(z, is_bottom, rim, seen, grid):
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


def _what_lies_below(counts, level, grid):
    """Cells that a film mirrors; height of what else lies lower (across, across), nan: none;
    the share of the points that it has; and the number of points that are mirrored.

    A mirror image lies as deep under the film as the thing stands above it, at the same place.
    """
    bins, number = grid.bins, np.arange(grid.bins)
    at = np.clip(np.floor((level - grid.low_m) / BIN_M), 0, bins - 1).astype(np.int64)[..., None]
    low = np.where(number < at - CLEAR_BINS, counts, 0)
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


def _pits(low, share, level, grid):
    label, count = scipy.ndimage.label(np.isfinite(low), np.ones((3, 3)))
    found = []
    for one in range(1, count + 1):
        mine = label == one
        deep, top = float(np.median(low[mine])), float(np.median(level[mine]))
        whole = scipy.ndimage.binary_fill_holes(scipy.ndimage.binary_closing(mine, np.ones((3, 3))))
        area = float(np.nansum(np.where(np.isnan(share), 1.0, share)[whole])) * grid.cell_m**2
        if np.count_nonzero(mine) < LEAST_PIT_CELLS or top - deep < LEAST_PIT_M:
            continue
        x, y = grid.corner_m + (np.argwhere(whole).mean(axis=0) + 0.5) * grid.cell_m
        edge = 2 * np.sqrt(np.pi * area) * grid.cell_m / np.sqrt(12)
        found.append(Pit(float(x), float(y), deep, top, area, float(edge)))
    return tuple(sorted(found, key=lambda pit: -pit.area_m2))


@dataclass(frozen=True)
class BottomPoints:
    """Points of a bottom as bottom.csv takes them.

    Attributes
    ----------
    xyz_m : ndarray, shape (n, 3)
        Means of cells, in the frame of the points.
    sd_m : ndarray, shape (n,)
        Of the height: that of one cell, however many it is the mean of.
    cells : ndarray of int, shape (n,)
    share : ndarray, shape (n, scans)
        Of each scan in the height.
    """

    xyz_m: np.ndarray
    sd_m: np.ndarray
    cells: np.ndarray
    share: np.ndarray


def bottom_points(bottom, most=400):
    """`BottomPoints` of a `CloudBottom`: one for each square block of cells, at most so many.

    The height is that of a quadratic through the cells of the block and those beside it, so that a
    dish is not taken for as deep as the mean of its parts.
    """
    shown = bottom.is_bottom & bottom.in_plan
    column, row = np.nonzero(shown)
    for side in range(1, bottom.grid.across + 1):
        block = (column // side) * bottom.grid.across + row // side
        taken, place, cells = np.unique(block, return_inverse=True, return_counts=True)
        if len(taken) <= most:
            break
    values = bottom.xyz_m[column, row]
    xyz = np.column_stack([np.bincount(place, one) / cells for one in values.T])
    for i, one in enumerate(taken) if side > 1 else ():
        first = np.array(divmod(int(one), bottom.grid.across)) * side
        low, high = np.maximum(first - 1, 0), first + side + 1
        window = np.s_[low[0] : high[0], low[1] : high[1]]
        xyz[i, 2] = _height_at(xyz[i], bottom.xyz_m[window][shown[window]])
    variance = np.bincount(place, bottom.sd_m[column, row] ** 2) / cells
    of_scans = bottom.by_scan[column, row].astype(float)
    of_scans /= np.maximum(of_scans.sum(axis=1, keepdims=True), 1)
    share = np.column_stack([np.bincount(place, one) / cells for one in of_scans.T])
    return BottomPoints(xyz, np.sqrt(variance), cells, share)


def _height_at(middle, xyz):
    """Height at a place by a quadratic through cells (n, 3); their mean where they are too few."""
    x, y, z = (xyz - middle).T
    design = np.column_stack([np.ones(len(z)), x, y, x * x, x * y, y * y])
    scale = np.max(np.abs(design), axis=0)
    if len(z) < FEWEST_OF_BLOCK or not scale.all():
        return middle[2]
    solution, _, rank, _ = np.linalg.lstsq(design / scale, z, rcond=1e-4)
    return middle[2] + solution[0] if rank == design.shape[1] else middle[2]
