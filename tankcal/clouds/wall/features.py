"""Joints, welds and obstructions in the cells of a wall.

All are proposals. The joints of the job remain valid. The volume of an obstruction is not known.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.clouds.wall.cells import FAR_BINS, FAR_M
from tankcal.clouds.wall.growing import EMPTY, WALL, estimate_spread
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
