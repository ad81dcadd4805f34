"""What the cells of a wall show beside its form: joints, welds, and what stands before it.

All of it is proposed: joints of the job stay true, and no volume is known of what hides the wall.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.clouds.wall.cells import FAR_BINS, FAR_M
from tankcal.clouds.wall.growing import EMPTY, WALL, spread_between
from tankcal.geometry.outlines import FULL_TURN

JOINT_ROWS, LEAST_STEP_M, SURE_STEP = 4, 0.002, 5.0  # rows on each side of a step; its size
WELD_M, WELD_REACH_M, LEAST_WELD_M = 0.6, 1.5, 0.003  # width, of what is level beside it, depth
SURE_WELD = 5.0
# of a weld: width at half its depth, cells that it is looked for in, depth in a third of its course
HALF_DEPTH_M, WELD_CELLS, RUNS_ON = 0.3, 12, 0.6
CLOSED_CELLS = 2  # between parts of one obstruction
SMALLEST_CELLS, LEAST_FAR = 6, 3
PIPE_WIDTH_M, RING_ARC, RING_HEIGHT_M, NOZZLE_M = 1.0, np.pi / 3, 0.6, 1.5


@dataclass(frozen=True)
class Joint:
    """A step of the radius.

    Attributes
    ----------
    height_m : float
        In the frame of the points, m.
    step_m : float
        Mean radius above less that below, m.
    nearest_m : float
        Height of the nearest joint of the job, m; nan: it has none.
    """

    height_m: float
    step_m: float
    nearest_m: float


@dataclass(frozen=True)
class Weld:
    """A narrow valley (negative depth: a ridge) over a course, such as a vertical weld.

    Attributes
    ----------
    course : int
        From the bottom, 0 is the first.
    azimuth_rad : float
    depth_m : float
        Of the wall beside it, inwards positive, m.
    """

    course: int
    azimuth_rad: float
    depth_m: float


@dataclass(frozen=True)
class Obstruction:
    """Cells that hang together where something hides the wall.

    Attributes
    ----------
    azimuth_rad : tuple of float
        First and last, clockwise; the last may pass 2 pi.
    height_m : tuple of float
        In the frame of the points, m.
    distance_m : tuple of float
        From the mean surface, outwards positive: 5 and 95 % of what is seen there; nan: nothing
        is, the wall is out of sight.
    cells : int
    guess : str
        "pipe", "stairs", "ring", "nozzle" or "unseen".
    """

    azimuth_rad: tuple[float, float]
    height_m: tuple[float, float]
    distance_m: tuple[float, float]
    cells: int
    guess: str

    @property
    def deadwood_row(self):
        """name, bottom_m, top_m of a row of deadwood; its volume cannot be known from a mask."""
        return f"{self.guess} {np.degrees(self.azimuth_rad[0]):.0f} deg", *self.height_m


def find_joints(radius_m, middle_m, joints_m):
    """`Joint` tuple: steps of the median radius (rows, columns) of neighbouring rows.

    middle_m  (rows,) height of the rows; joints_m  of the ends of the courses of the job
    """
    with np.errstate(invalid="ignore"):
        steps = radius_m[1:] - radius_m[:-1]
    rows = len(radius_m)
    if rows < 2 * JOINT_ROWS + 1:
        return ()
    between = _medians(steps)  # from cell to cell: what the form does round a row cancels
    scatter = max(spread_between(between[1:-1] - (between[:-2] + between[2:]) / 2), 1e-5)
    height, inner = np.diff(middle_m), joints_m[1:-1]
    found = []
    for i in np.argsort(-np.nan_to_num(np.abs(between)), kind="stable"):
        beside = np.delete(between[max(0, i - JOINT_ROWS) : i + JOINT_ROWS + 1], min(i, JOINT_ROWS))
        step = between[i] - np.nanmedian(beside) if np.isfinite(beside).any() else 0.0
        if not abs(step) > max(LEAST_STEP_M, SURE_STEP * scatter):
            break
        at = middle_m[i] + height[i] / 2
        if all(abs(at - one.height_m) > JOINT_ROWS * height[i] for one in found):
            nearest = inner[np.argmin(np.abs(inner - at))] if len(inner) else np.nan
            found.append(Joint(float(at), float(step), float(nearest)))
    return tuple(sorted(found, key=lambda one: one.height_m))


def find_welds(radius_m, course, column_m):
    """`Weld` tuple: narrow valleys and ridges in the median profile of each course.

    course  (rows,) of each row; column_m  (rows,) width of a cell
    """
    found = []
    for one in np.unique(course):
        mine = course == one
        width = float(np.median(column_m[mine]))
        reach = max(2, round(WELD_REACH_M / width))
        beside = radius_m[mine] - _medians(radius_m[mine])[:, None]
        depth = _depths(beside, reach)
        thirds = [_depths(part, reach) for part in np.array_split(beside, 3) if len(part)]
        is_empty = not np.isfinite(depth).any()
        noise = 1.0 if is_empty else max(SD_OVER_MEDIAN * np.nanmedian(np.abs(depth)), 1e-4)
        apart = max(1, round(WELD_M / width))
        left = np.nan_to_num(np.abs(depth))
        while left.max() > max(LEAST_WELD_M, SURE_WELD * noise):
            i = int(np.argmax(left))
            if _is_narrow(depth, i, width) and all(_runs_on(one, i, depth[i]) for one in thirds):
                turn = (i + 0.5) * FULL_TURN / len(depth)
                found.append(Weld(int(one), float(turn), float(depth[i])))
            left[np.arange(i - apart, i + apart + 1) % len(left)] = 0.0
    return tuple(found)


def _depths(beside_m, reach):
    """(columns,) how far the median of some rows lies inside of the columns beside it."""
    profile = _medians(beside_m.T)
    return _moving_median(profile, reach) - profile


def _is_narrow(depth, i, width):
    """Is what is deep here no wider than a weld at half of its depth?"""
    there = depth[(i + np.arange(-WELD_CELLS, WELD_CELLS + 1)) % len(depth)] / depth[i]
    wide = 0.0
    for side in (there[WELD_CELLS::-1], there[WELD_CELLS:]):
        under = np.flatnonzero(~(side > 0.5))
        if not len(under):
            return False
        k = under[0]
        part = (side[k - 1] - 0.5) / (side[k - 1] - side[k]) if np.isfinite(side[k]) else 1.0
        wide += (k - 1 + part) * width
    return wide < max(HALF_DEPTH_M, 1.5 * width)


def _runs_on(depth, i, whole):
    """Does a part of the course show it, too, here or in the column beside? A buckle ends."""
    near = depth[(i + np.arange(-1, 2)) % len(depth)] / whole
    return not np.isfinite(near).any() or np.nanmax(near) > RUNS_ON


def find_obstructions(seen, grown, cells, column_m):
    """`Obstruction` tuple, the largest first, of masked cells that hang together.

    seen  (rows, columns) cells that are wall for some scan; grown  `Grown` of each side
    """
    masked, columns = ~seen, seen.shape[1]
    around = CLOSED_CELLS + 1
    closed = np.pad(masked, ((0, 0), (around, around)), mode="wrap")
    closed = scipy.ndimage.binary_closing(closed, np.ones((3, 3)), CLOSED_CELLS - 1)
    closed = closed[:, around:-around] | masked
    label, count = scipy.ndimage.label(closed, np.ones((3, 3)))
    label = _joined_round(label, count)
    row, column = np.nonzero(masked)
    number = label[row, column]
    found = []
    for one in np.flatnonzero(np.bincount(number, minlength=1) >= SMALLEST_CELLS):
        mine = number == one
        found.append(
            _obstruction(row[mine], _unwound(column[mine], columns), grown, cells, column_m)
        )
    return tuple(sorted(found, key=lambda one: -one.cells))


def _joined_round(label, count):
    """Labels where those that meet between the last and the first column are one."""
    number = np.arange(count + 1)
    for step in (-1, 0, 1):
        first, last = label[max(0, step) :, 0], label[: len(label) - max(0, step), -1]
        if step < 0:
            first, last = label[:-1, 0], label[1:, -1]
        for a, b in set(zip(first.tolist(), last.tolist(), strict=True)):
            if a and b:
                number[number == number[b]] = number[a]
    return number[label]


def _unwound(column, columns):
    """Columns that run on beyond the last, from the first after the widest gap."""
    known = np.unique(column)
    gaps = np.diff(np.append(known, known[0] + columns))
    begin = known[(np.argmax(gaps) + 1) % len(known)]
    return begin + (column - begin) % columns


def _obstruction(row, column, grown, cells, column_m):
    grid = cells.grid
    turn = FULL_TURN / grid.columns
    index = row * grid.columns + column % grid.columns
    azimuth = column.min() * turn, min((column.max() + 1) * turn, column.min() * turn + FULL_TURN)
    height = float(grid.edges_m[row.min()]), float(grid.edges_m[row.max() + 1])
    distances = _distances(row, column % grid.columns, index, grown, cells)
    wide = float((azimuth[1] - azimuth[0]) / turn * np.median(column_m[row]))
    guess = _guess(row, column, azimuth, height, distances, wide)
    reach = np.percentile(distances, [5, 95]) if len(distances) else (np.nan, np.nan)
    return Obstruction(
        tuple(float(one) for one in azimuth),
        height,
        tuple(float(one) for one in reach),
        len(row),
        guess,
    )


def _distances(row, column, index, grown, cells):
    """Distances that are seen in some cells, from their other modes and from far points."""
    grid = cells.grid
    parts = []
    for one in grown:
        other = one.other[row, column]
        known = (other >= 0) & (one.why[row, column] != WALL) & (one.why[row, column] != EMPTY)
        parts.append((other[known] + 0.5) * grid.bin_m - grid.band_m)
    _, far = np.nonzero(cells.far[index] >= LEAST_FAR)
    parts.append((far + 0.5) * (2 * FAR_M / FAR_BINS) - FAR_M)
    return np.concatenate(parts)


def _guess(row, column, azimuth, height, distances, wide):
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
    """(n,) medians of rows; nan of rows without a value."""
    found = np.full(len(values), np.nan)
    known = np.isfinite(values).any(axis=1)
    if known.any():
        found[known] = np.nanmedian(values[known], axis=1)
    return found


def _moving_median(profile, reach):
    """(n,) median of the neighbours up to `reach` cells on both sides, round the row."""
    window = np.stack([np.roll(profile, step) for step in range(-reach, reach + 1)])
    return _medians(window.T)
