"""Decision which cells show the wall, with joints, welds and obstructions.

Joints, welds and obstructions in the cells of a wall.

All are proposals. The joints of the job remain valid. The volume of an obstruction is not known.

Decision which cells show the wall, and the distance of the wall in each scan.

The scans of one side are decided together. The distance is then determined for each scan.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.clouds.wall.cells import (
    FAR_BINS,
    FAR_M,
    FILE,
    FINE_BITS,
    PLACE,
    CellGrid,
    two_surfaces_error,
)
from tankcal.clouds.wall.growing import (
    EMPTY,
    FEW,
    FEWEST,
    OFF_TREND,
    REFINE_BINS,
    WALL,
    estimate_spread,
    find_off_trend,
    grow_wall,
)
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.units import FULL_TURN

# Rows on each side of a step; least step, m, and as a multiple of the scatter
JOINT_ROWS, LEAST_STEP_M, SURE_STEP = 4, 0.002, 5.0
# Distance between welds; half-width of the wall that the depth refers to; least depth, m
WELD_M, WELD_REACH_M, LEAST_WELD_M = 0.6, 1.5, 0.003
SURE_WELD = 5.0  # least depth of a weld as a multiple of the noise
# Largest width of a weld at half its depth, m; cells in which the width is determined; least share
# of the depth in each third of the course
HALF_DEPTH_M, WELD_CELLS, RUNS_ON = 0.3, 12, 0.6
CLOSED_CELLS = 2  # largest gap between parts of one obstruction, cells
SMALLEST_CELLS, LEAST_FAR = 6, 3  # least cells of an obstruction; least points of a distant bin
# Largest width of a pipe, m; least arc and largest height of a ring, m; largest size of a nozzle, m
PIPE_WIDTH_M, RING_ARC, RING_HEIGHT_M, NOZZLE_M = 1.0, np.pi / 3, 0.6, 1.5


@dataclass(frozen=True)
class Joint:
    """Step of the radius between rows, proposed as a joint of two courses.

    Attributes
    ----------
    height_m : float
        Height of the step in the frame of the points, m.
    step_m : float
        Mean radius above the step less the mean radius below the step, m.
    nearest_m : float
        Height of the nearest joint of the job, m; nan if the job has no joint.
    """

    height_m: float
    step_m: float
    nearest_m: float


@dataclass(frozen=True)
class Weld:
    """Narrow valley or ridge over the height of a course, such as a vertical weld.

    Attributes
    ----------
    course : int
        Index of the course from the bottom, from 0.
    azimuth_rad : float
        Azimuth of the weld, rad.
    depth_m : float
        Displacement from the adjacent wall, m, positive inwards.
    """

    course: int
    azimuth_rad: float
    depth_m: float


@dataclass(frozen=True)
class Obstruction:
    """Connected cells in which an object hides the wall.

    Attributes
    ----------
    azimuth_rad : tuple of float
        First and last azimuth, clockwise, rad; the last may exceed 2 pi.
    height_m : tuple of float
        Lower and upper end in the frame of the points, m.
    distance_m : tuple of float
        Quantiles of 5 % and 95 % of the distances seen, from the mean surface, m, positive
        outwards; nan if nothing is seen.
    cells : int
        Number of cells.
    guess : str
        Probable kind: "pipe", "stairs", "ring", "nozzle" or "unseen".
    """

    azimuth_rad: tuple[float, float]
    height_m: tuple[float, float]
    distance_m: tuple[float, float]
    cells: int
    guess: str

    @property
    def deadwood_row(self):
        """Row of deadwood without volume: name, bottom_m, top_m."""
        return f"{self.guess} {np.degrees(self.azimuth_rad[0]):.0f} deg", *self.height_m


def find_joints(radius_m, middle_m, joints_m):
    """Find joints as steps of the median radius between neighbouring rows.

    Parameters
    ----------
    radius_m : ndarray, shape (rows, columns)
        Radius of the wall, m; nan where it is not seen.
    middle_m : ndarray, shape (rows,)
        Heights of the centres of the rows, m.
    joints_m : ndarray, shape (courses + 1,)
        Heights of the ends of the courses of the job, m.

    Returns
    -------
    tuple of Joint
        Joints in ascending height.
    """
    with np.errstate(invalid="ignore"):
        steps = radius_m[1:] - radius_m[:-1]
    rows = len(radius_m)
    if rows < 2 * JOINT_ROWS + 1:
        return ()
    between = _medians(steps)  # steps within a column are independent of the form along the row
    scatter = max(estimate_spread(between[1:-1] - (between[:-2] + between[2:]) / 2), 1e-5)
    height, inner = np.diff(middle_m), joints_m[1:-1]
    joints = []
    for i in np.argsort(-np.nan_to_num(np.abs(between)), kind="stable"):
        neighbours = np.delete(
            between[max(0, i - JOINT_ROWS) : i + JOINT_ROWS + 1], min(i, JOINT_ROWS)
        )
        step = between[i] - np.nanmedian(neighbours) if np.isfinite(neighbours).any() else 0.0
        if not abs(step) > max(LEAST_STEP_M, SURE_STEP * scatter):
            break
        height_m = middle_m[i] + height[i] / 2
        if all(abs(height_m - joint.height_m) > JOINT_ROWS * height[i] for joint in joints):
            nearest = inner[np.argmin(np.abs(inner - height_m))] if len(inner) else np.nan
            joints.append(Joint(float(height_m), float(step), float(nearest)))
    return tuple(sorted(joints, key=lambda joint: joint.height_m))


def find_welds(radius_m, course, column_m):
    """Find welds as narrow valleys and ridges in the median profile of each course.

    Parameters
    ----------
    radius_m : ndarray, shape (rows, columns)
        Radius of the wall, m; nan where it is not seen.
    course : ndarray of int, shape (rows,)
        Course of each row.
    column_m : ndarray, shape (rows,)
        Width of a cell, m.

    Returns
    -------
    tuple of Weld
    """
    welds = []
    for item in np.unique(course):
        rows = course == item
        width = float(np.median(column_m[rows]))
        reach = max(2, round(WELD_REACH_M / width))
        deviation = radius_m[rows] - _medians(radius_m[rows])[:, None]
        depth = _weld_depths(deviation, reach)
        thirds = [_weld_depths(part, reach) for part in np.array_split(deviation, 3) if len(part)]
        is_empty = not np.isfinite(depth).any()
        noise = 1.0 if is_empty else max(SD_OVER_MEDIAN * np.nanmedian(np.abs(depth)), 1e-4)
        apart = max(1, round(WELD_M / width))
        # Take the deepest column first, then exclude its neighbours.
        remaining = np.nan_to_num(np.abs(depth))
        while remaining.max() > max(LEAST_WELD_M, SURE_WELD * noise):
            i = int(np.argmax(remaining))
            if _is_narrow(depth, i, width) and all(
                _extends_to(item, i, depth[i]) for item in thirds
            ):
                turn = (i + 0.5) * FULL_TURN / len(depth)
                welds.append(Weld(int(item), float(turn), float(depth[i])))
            remaining[np.arange(i - apart, i + apart + 1) % len(remaining)] = 0.0
    return tuple(welds)


def _weld_depths(deviation_m, reach):
    """Depth (columns,) of the median profile below the adjacent columns, m, positive inwards."""
    profile = _medians(deviation_m.T)
    return _moving_median(profile, reach) - profile


def _is_narrow(depth, i, width):
    """Whether the width at half the depth is at most the width of a weld."""
    relative_depth = depth[(i + np.arange(-WELD_CELLS, WELD_CELLS + 1)) % len(depth)] / depth[i]
    total_width = 0.0
    for side in (relative_depth[WELD_CELLS::-1], relative_depth[WELD_CELLS:]):
        below_half = np.flatnonzero(~(side > 0.5))
        if not len(below_half):
            return False
        k = below_half[0]
        fraction = (side[k - 1] - 0.5) / (side[k - 1] - side[k]) if np.isfinite(side[k]) else 1.0
        total_width += (k - 1 + fraction) * width
    return total_width < max(HALF_DEPTH_M, 1.5 * width)


def _extends_to(depth, i, whole):
    """Whether a part of the course shows the weld in this or an adjacent column.

    A buckle does not extend over the whole course.
    """
    near = depth[(i + np.arange(-1, 2)) % len(depth)] / whole
    return not np.isfinite(near).any() or np.nanmax(near) > RUNS_ON


def find_obstructions(seen, side_walls, cells, column_m):
    """Find obstructions as connected cells in which no scan shows the wall.

    Parameters
    ----------
    seen : ndarray of bool, shape (rows, columns)
        Cells in which a scan shows the wall.
    side_walls : list of SideWall
        Decision of each side.
    cells : WallCells
        Sums over the points in cells.
    column_m : ndarray, shape (rows,)
        Width of a cell, m.

    Returns
    -------
    tuple of Obstruction
        The largest first.
    """
    masked, columns = ~seen, seen.shape[1]
    margin = CLOSED_CELLS + 1
    # Parts with small gaps form one obstruction; rows are closed, so that the mask is wrapped.
    closed = np.pad(masked, ((0, 0), (margin, margin)), mode="wrap")
    closed = scipy.ndimage.binary_closing(closed, np.ones((3, 3)), CLOSED_CELLS - 1)
    closed = closed[:, margin:-margin] | masked
    label, count = scipy.ndimage.label(closed, np.ones((3, 3)))
    label = _join_across_first_column(label, count)
    row, column = np.nonzero(masked)
    number = label[row, column]
    obstructions = []
    for item in np.flatnonzero(np.bincount(number, minlength=1) >= SMALLEST_CELLS):
        members = number == item
        obstructions.append(
            _describe_obstruction(
                row[members], _unwrap_columns(column[members], columns), side_walls, cells, column_m
            )
        )
    return tuple(sorted(obstructions, key=lambda item: -item.cells))


def _join_across_first_column(label, count):
    """Unite the labels that touch between the last and the first column."""
    number = np.arange(count + 1)
    for step in (-1, 0, 1):
        first, last = label[max(0, step) :, 0], label[: len(label) - max(0, step), -1]
        if step < 0:
            first, last = label[:-1, 0], label[1:, -1]
        for a, b in set(zip(first.tolist(), last.tolist(), strict=True)):
            if a and b:
                number[number == number[b]] = number[a]
    return number[label]


def _unwrap_columns(column, columns):
    """Number columns consecutively from the end of the widest gap, beyond the last column."""
    known = np.unique(column)
    gaps = np.diff(np.append(known, known[0] + columns))
    begin = known[(np.argmax(gaps) + 1) % len(known)]
    return begin + (column - begin) % columns


def _describe_obstruction(row, column, side_walls, cells, column_m):
    grid = cells.grid
    turn = FULL_TURN / grid.columns
    index = row * grid.columns + column % grid.columns
    azimuth = column.min() * turn, min((column.max() + 1) * turn, column.min() * turn + FULL_TURN)
    height = float(grid.edges_m[row.min()]), float(grid.edges_m[row.max() + 1])
    distances = _distances_of_others(row, column % grid.columns, index, side_walls, cells)
    wide = float((azimuth[1] - azimuth[0]) / turn * np.median(column_m[row]))
    guess = _guess_kind(row, column, azimuth, height, distances, wide)
    reach = np.percentile(distances, [5, 95]) if len(distances) else (np.nan, np.nan)
    return Obstruction(
        tuple(float(value) for value in azimuth),
        height,
        tuple(float(value) for value in reach),
        len(row),
        guess,
    )


def _distances_of_others(row, column, index, side_walls, cells):
    """Distances of other surfaces in some cells, from second modes and from distant points, m."""
    grid = cells.grid
    parts = []
    for side_wall in side_walls:
        other = side_wall.other[row, column]
        known = (
            (other >= 0)
            & (side_wall.why[row, column] != WALL)
            & (side_wall.why[row, column] != EMPTY)
        )
        parts.append((other[known] + 0.5) * grid.bin_m - grid.band_m)
    _, far = np.nonzero(cells.far[index] >= LEAST_FAR)
    parts.append((far + 0.5) * (2 * FAR_M / FAR_BINS) - FAR_M)
    return np.concatenate(parts)


def _guess_kind(row, column, azimuth, height, distances, wide):
    tall = height[1] - height[0]
    if len(distances) < 3:
        return "unseen"
    if azimuth[1] - azimuth[0] > RING_ARC and tall < RING_HEIGHT_M:
        return "ring"
    if max(tall, wide) < NOZZLE_M:
        return "nozzle"
    if len(row) > 20 and np.ptp(row) and np.ptp(column) and wide > PIPE_WIDTH_M:
        filled = len(row) / ((np.ptp(row) + 1) * (np.ptp(column) + 1))
        if abs(np.corrcoef(row, column)[0, 1]) > 0.7 and filled < 0.7:
            return "stairs"
    return "pipe" if min(tall, wide) < PIPE_WIDTH_M else "stairs" if tall > 1 else "ring"


def _medians(values):
    """Medians of rows (n,); nan for a row without values."""
    medians = np.full(len(values), np.nan)
    known = np.isfinite(values).any(axis=1)
    if known.any():
        medians[known] = np.nanmedian(values[known], axis=1)
    return medians


def _moving_median(profile, reach):
    """Median (n,) of the neighbours up to `reach` cells on both sides, around a closed row."""
    window = np.stack([np.roll(profile, step) for step in range(-reach, reach + 1)])
    return _medians(window.T)


LEAST_SD_M = 5e-5  # least standard deviation of the mean of a cell, m
# Distance of cells without common noise along a scan line, m; least number of values for a scatter
APART_M, FEWEST_DIFFERENCES = 0.4, 20
# Share of cells with a second mode that shows a second surface; number of sectors; least share of
# the sectors in which this surface is seen
TWO_SURFACES, SECTORS, SECTORS_WITH = 0.10, 36, 0.6
RIVAL = 0.15  # share of the cells from which a connected second surface is refused
LEAST_TURN = 0.15  # least share of the columns for the estimation of an axis
LEAST_WALL = 0.25  # least share of the wall in the cells with points


@dataclass(frozen=True)
class CloudWall:
    """Wall in cells, as seen by several scans.

    Attributes
    ----------
    surface : CylinderSurface or SphereSurface
        Approximate surface from which distances are measured.
    grid : CellGrid
        Rows and columns of the cells.
    joints_m : tuple of float
        Coordinate u of the ends of the courses, from the bottom up, m; two for a lying cylinder or
        a sphere.
    sides : tuple of str
        Side of each scan.
    radius_m : ndarray, shape (scans, rows, columns)
        Mean distance of the wall from the axis (sphere: from the centre), from the points near the
        mode of the cell, m; nan where the scan does not show the wall.
    sd_m : ndarray, shape (scans, rows, columns)
        Standard deviation of `radius_m`, from the points and from the scatter between neighbouring
        cells, m.
    count : ndarray of int, shape (scans, rows, columns)
        Number of points in the mean.
    turn_rad, along_m : ndarray, shape (scans, rows, columns)
        Mean azimuth (rad) and coordinate u (m) of the points near the wall.
    is_wall : ndarray of bool, shape (scans, rows, columns)
        Whether the scan shows the wall in the cell.
    why : dict of str to ndarray of uint8, shape (rows, columns)
        Class of each cell for each side: `growing.WALL`, `EMPTY`, `FEW` ...
    scatter_m : ndarray, shape (scans,)
        Standard deviation of the mean of a cell, from neighbouring cells of the same scan, m.
    masked_share : ndarray, shape (courses,)
        Share of the cells of each course that no scan shows as wall.
    joints, welds, obstructions : tuple
        Proposed joints, welds and obstructions.
    delivered, outside, beyond, of_wall : ndarray of int, shape (scans,)
        Number of points received; outside the shell; near the shell but outside the band; in the
        means of cells of the wall.
    are_separate : bool
        Whether the scans show the wall at such different distances that each was decided alone.
    """

    surface: object
    grid: CellGrid
    joints_m: tuple[float, ...]
    sides: tuple[str, ...]
    radius_m: np.ndarray
    sd_m: np.ndarray
    count: np.ndarray
    turn_rad: np.ndarray
    along_m: np.ndarray
    is_wall: np.ndarray
    why: dict
    scatter_m: np.ndarray
    masked_share: np.ndarray
    joints: tuple[Joint, ...]
    welds: tuple[Weld, ...]
    obstructions: tuple[Obstruction, ...]
    delivered: np.ndarray
    outside: np.ndarray
    beyond: np.ndarray
    of_wall: np.ndarray
    are_separate: bool = False


def decide_wall(cells, joints_m, sides):
    """Decide which cells show the wall, and determine its distance for each scan.

    Parameters
    ----------
    cells : WallCells
        Sums over the points in cells.
    joints_m : sequence of float
        Coordinate u of the ends of the courses, m.
    sides : sequence of str
        Side of each scan.

    Returns
    -------
    CloudWall
    """
    joints_m, column_m = (
        np.asarray(joints_m, dtype=float),
        FULL_TURN * cells.surface.width_m(cells.grid.middles_m) / cells.grid.columns,
    )
    wall_values = _ScanValues(cells)
    side_walls = {}
    for side in dict.fromkeys(sides):
        side_scans = [i for i, item in enumerate(sides) if item == side]
        side_walls[side] = wall_values.decide(side_scans, joints_m, column_m)
    is_seen = np.any(wall_values.is_wall, axis=0)
    course = np.searchsorted(joints_m[1:-1], cells.grid.middles_m, side="right")
    courses = np.arange(len(joints_m) - 1)
    count = np.where(wall_values.is_wall, wall_values.count, 0)
    best = _weighted_mean(wall_values.radius, wall_values.sd, count)[0]
    is_one_side = len(side_walls) == 1
    return CloudWall(
        surface=cells.surface,
        grid=cells.grid,
        joints_m=tuple(joints_m.tolist()),
        sides=tuple(sides),
        radius_m=wall_values.radius,
        sd_m=np.where(wall_values.is_wall, wall_values.sd, np.nan),
        count=count,
        turn_rad=wall_values.turn,
        along_m=wall_values.along,
        is_wall=wall_values.is_wall,
        why={side: side_wall.why for side, side_wall in side_walls.items()},
        scatter_m=wall_values.scatter,
        masked_share=np.array([1 - is_seen[course == item].mean() for item in courses]),
        joints=find_joints(best, cells.grid.middles_m, joints_m) if is_one_side else (),
        welds=find_welds(best, course, column_m) if is_one_side else (),
        obstructions=find_obstructions(is_seen, list(side_walls.values()), cells, column_m),
        delivered=cells.delivered,
        outside=cells.outside,
        beyond=cells.beyond,
        of_wall=count.sum(axis=(1, 2)),
        are_separate=wall_values.are_separate,
    )


class _ScanValues:
    """Results for each scan and cell (scans, rows, columns), filled one side after the other."""

    def __init__(self, cells):
        self.cells, grid = cells, cells.grid
        shape = cells.scans, grid.rows, grid.columns
        self.radius, self.sd, self.turn, self.along = np.full((4, *shape), np.nan)
        self.count, self.is_wall = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=bool)
        self.scatter = np.full(cells.scans, np.nan)
        self.are_separate = False

    def decide(self, side_scans, joints_m, column_m):
        """Decide the scans of one side and fill in their means; return `SideWall`."""
        cells, grid = self.cells, self.cells.grid
        total = sum(cells.counts(i) for i in side_scans)
        row_m = float(np.median(np.diff(grid.edges_m)))
        side_wall = grow_wall(
            total,
            column_m=column_m,
            row_m=row_m,
            bin_m=grid.bin_m,
            joined_rows=np.searchsorted(grid.edges_m, joints_m[1:-1] - 1e-9),
        )
        _refuse_no_wall(side_wall, cells)
        # Scans that do not overlap can show a single wall as two surfaces.
        second = _find_two_surfaces(side_wall, total, cells)
        if second is not None:
            return self._decide_alone(side_scans, joints_m, column_m, side_wall, second)
        for i in side_scans:
            mean, self.sd[i], self.count[i] = _average_distances(cells, i, side_wall)
            self.radius[i] = cells.surface.radius_m + mean
            self.turn[i], self.along[i] = _average_places(cells, i)
        # The mean over scans has the least noise, so that the trend test is applied to it.
        values, sds = _weighted_mean(
            self.radius[side_scans], self.sd[side_scans], self.count[side_scans]
        )
        side_wall.why[find_off_trend(values, sds, side_wall.why == WALL)] = OFF_TREND
        course = np.searchsorted(joints_m[1:-1], grid.middles_m, side="right")
        width_m = float(np.median(column_m))
        for i in side_scans:
            self.is_wall[i] = (side_wall.why == WALL) & (self.count[i] >= 3)
            self.radius[i][~self.is_wall[i]] = np.nan
            self.scatter[i] = _scatter_of_cells(self.radius[i], course, row_m, width_m)
            self.sd[i] = np.maximum(self.sd[i], max(LEAST_SD_M, self.scatter[i]))
        return side_wall

    def _decide_alone(self, side_scans, joints_m, column_m, side_wall, second):
        """Decide each scan alone where scans that do not overlap show one wall as two surfaces.

        Each scan must show a single surface. Otherwise another surface hides a part of the wall,
        and `second` is raised. The result is a `SideWall`.
        """
        if len(side_scans) == 1:
            raise second
        why = side_wall.why.copy()
        for scan in side_scans:
            try:
                alone = self.decide([scan], joints_m, column_m)
            except InputError:
                raise second from None
            why[alone.why == WALL] = WALL
        self.are_separate = True
        return replace(side_wall, why=why)


def _refuse_no_wall(side_wall, cells):
    """Raise InputError if only a small share of the cells with points shows the wall."""
    has_points = (side_wall.why.ravel() != EMPTY) | np.any(cells.far >= FEWEST, axis=1)
    seen = max(np.count_nonzero(has_points), 1)
    share = np.count_nonzero(side_wall.why == WALL) / seen
    if share >= LEAST_WALL:
        return
    if np.count_nonzero(side_wall.why == FEW) > seen / 2:
        text = message(
            "cloud_too_sparse",
            "found fewer than {least} points in most cells of the wall ({rows} x {columns}); "
            "expected a denser cloud: bring its points as points.csv",
            least=FEWEST,
            rows=cells.grid.rows,
            columns=cells.grid.columns,
        )
    else:
        text = message(
            "cloud_wall_too_small",
            "only {share:.1f} % of the cells in which anything is seen show a wall near the radius "
            "{radius_m:.3f} m; expected {least:.0f} % at least: check tank.kind, the unit, the "
            "frame and what stands before the wall",
            share=100 * share,
            radius_m=cells.surface.radius_m,
            least=100 * LEAST_WALL,
        )
    raise InputError(Problem(FILE, text))


def _find_two_surfaces(side_wall, counts, cells):
    """Return an InputError if a second surface surrounds the wall or rivals its size, else None.

    Parameters
    ----------
    side_wall : SideWall
        Wall of one side.
    counts : ndarray of int, shape (rows, columns, bins)
        Histograms in which the wall was found.
    cells : WallCells
        Sums over the points in cells.
    """
    grid, wall = cells.grid, side_wall.why == WALL
    seen = max(np.count_nonzero(wall | side_wall.two_modes | (side_wall.other >= 0)), 1)
    second = side_wall.other >= 0
    sector = np.arange(grid.columns) * SECTORS // grid.columns
    parts = np.bincount(sector, second.mean(axis=0), SECTORS) / np.bincount(sector)
    share = np.count_nonzero(second) / seen
    all_round = share >= TWO_SURFACES and np.mean(parts >= TWO_SURFACES) >= SECTORS_WITH
    if not all_round and not (side_wall.surfaces and side_wall.surfaces[0][0] >= RIVAL):
        return None
    first, other = _surface_distances(side_wall, counts, grid)
    radius_m = cells.surface.radius_m
    return two_surfaces_error(
        radius_m + first, np.count_nonzero(wall) / seen, radius_m + other, share
    )


def _surface_distances(side_wall, counts, grid):
    """Median distances of the wall and of the second surface, m.

    If the surfaces have similar numbers of points, the mode taken as wall may change from cell to
    cell. The inner of two modes in a cell is therefore assigned to the inner surface.
    """
    wall, second = side_wall.why == WALL, side_wall.other >= 0
    first = _mean_distances(counts, side_wall.low, side_wall.high, grid)
    near = side_wall.other - REFINE_BINS, side_wall.other + REFINE_BINS
    other = _mean_distances(counts, *near, grid)
    both = wall & second
    if 2 * np.count_nonzero(both) < np.count_nonzero(second):
        return _median_about_own_axis(first, wall), _median_about_own_axis(other, second)
    inner = np.nanmedian(np.fmin(first, other)[both])
    outer = np.nanmedian(np.fmax(first, other)[both])
    return (inner, outer) if np.median((first - other)[both]) < 0 else (outer, inner)


def _median_about_own_axis(distance_m, chosen):
    """Median distance of some cells from the axis of their own surface, m.

    The axis of one surface may differ from the common axis of both. Its offset is estimated from
    the first harmonic of the distances, without outliers.
    """
    columns = distance_m.shape[1]
    chosen = chosen & np.isfinite(distance_m)
    values, column = distance_m[chosen], np.nonzero(chosen)[1]
    if len(np.unique(column)) < columns * LEAST_TURN:
        return np.median(values)
    # A shift of the axis changes the distance by a sin t + b cos t.
    turn = column * (FULL_TURN / columns)
    design = np.column_stack([np.sin(turn), np.cos(turn), np.ones(len(turn))])
    near = np.ones(len(values), dtype=bool)
    for _ in range(3):
        solution = np.linalg.lstsq(design[near], values[near], rcond=None)[0]
        deviation = np.abs(values - design @ solution)
        near = deviation <= 4 * np.median(deviation) + 1e-6
    return np.median(values - design[:, :2] @ solution[:2])


def _mean_distances(counts, low, high, grid):
    """Mean distance (rows, columns) of the points between two bins of each cell, m."""
    number = np.arange(grid.bins)
    part = np.where((number >= low[..., None]) & (number <= high[..., None]), counts, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return (part @ number / part.sum(axis=2) + 0.5) * grid.bin_m - grid.band_m


def _average_distances(cells, scan, side_wall):
    """Mean distance of the points of one scan over the bins of the wall.

    Returns
    -------
    mean, spread : ndarray, shape (rows, columns)
        Mean and its standard deviation from the points alone, m; nan without points.
    count : ndarray of int, shape (rows, columns)
        Number of points.
    """
    grid = cells.grid
    number = np.arange(grid.bins)
    within = side_wall.wall_bins(grid.bins)
    counts = np.where(within, cells.counts(scan), 0)
    count = counts.sum(axis=2)
    # The sum of whole units is exact; half a unit compensates their truncation.
    units = np.where(within, cells.units(scan), 0).sum(axis=2) + counts @ (number << FINE_BITS)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (units / count + 0.5) * grid.unit_m - grid.band_m
        centre = (number + 0.5) * grid.bin_m - grid.band_m
        square = counts @ centre**2 / count - (counts @ centre / count) ** 2
        spread = np.sqrt(np.maximum(square, 0) / count)
    return mean, spread, count


def _average_places(cells, scan):
    """Mean azimuth (rad) and u (m), each (rows, columns), of the points of one scan in the band."""
    grid = cells.grid
    shape = grid.rows, grid.columns
    count = cells.counts(scan).sum(axis=2)
    with np.errstate(invalid="ignore", divide="ignore"):
        turn = (cells.turn[scan].reshape(shape) / count + 0.5) / PLACE
        along = (cells.along[scan].reshape(shape) / count + 0.5) / PLACE
    height = np.diff(grid.edges_m)[:, None]
    return (
        (np.arange(grid.columns) + turn) * (FULL_TURN / grid.columns),
        grid.edges_m[:-1, None] + along * height,
    )


def _weighted_mean(radius, sd, count):
    """Mean over scans, weighted by counts, and its standard deviation, each (rows, columns), m."""
    weight = np.where(np.isfinite(radius), count, 0).astype(float)
    total = weight.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (np.nan_to_num(radius) * weight).sum(axis=0) / total
        share = weight / total
        return mean, np.sqrt((np.nan_to_num(sd) ** 2 * share**2).sum(axis=0))


def _scatter_of_cells(radius, course, row_m, column_m):
    """Standard deviation of the mean of a cell, from second differences between cells, m.

    The result is the largest of up to four estimates: along rows and along columns, for adjacent
    cells and for cells so far apart that they share no noise of a scan line.

    The second difference m2 - (m1 + m3) / 2 has the variance 1.5 s2. Its median over a row or a
    column is the form of the wall, such as a bulge, and is subtracted. Columns end at each joint.
    """
    # Rows are closed: they are repeated, so that differences extend over the last column.
    parts = [(np.vstack([radius.T, radius.T]), column_m, "round")]
    parts += [(radius[course == item], row_m, "up") for item in np.unique(course)]
    differences = {}
    for values, size_m, direction in parts:
        most = (len(values) - 1) // 2
        for lag in {1, min(max(1, round(APART_M / size_m)), most)} - {0}:
            e = values[lag:-lag] - (values[: -2 * lag] + values[2 * lag :]) / 2
            e = e[np.isfinite(e).any(axis=1)]
            if len(e):
                e = e - np.nanmedian(e, axis=1, keepdims=True)
                differences.setdefault((direction, lag), []).append(e[np.isfinite(e)])
    scatters = [np.concatenate(item) for item in differences.values()]
    scatters = [
        SD_OVER_MEDIAN * np.median(np.abs(e)) for e in scatters if len(e) >= FEWEST_DIFFERENCES
    ]
    return float(max(scatters, default=0.0) / np.sqrt(1.5))
