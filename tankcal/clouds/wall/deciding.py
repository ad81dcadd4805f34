"""What is wall in the cells of scans, and its distance for each scan.

All scans of one side decide together what is wall; the distance of it is then told for each scan.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.clouds.wall.cells import FINE_BITS, PLACE, CellGrid
from tankcal.clouds.wall.features import (
    Joint,
    Obstruction,
    Weld,
    find_joints,
    find_obstructions,
    find_welds,
)
from tankcal.clouds.wall.growing import OFF_TREND, WALL, grow_wall, off_trend
from tankcal.clouds.wall.refusals import refuse_no_wall, two_surfaces_in
from tankcal.errors import InputError
from tankcal.geometry.outlines import FULL_TURN

LEAST_SD_M = 5e-5  # no mean of a cell is told better
APART_M, FEWEST_TOLD = 0.4, 20  # cells that noise along a line does not tie; that a scatter needs


@dataclass(frozen=True)
class CloudWall:
    """The wall that scans show, in cells.

    Attributes
    ----------
    surface : CylinderSurface or SphereSurface
        What distances count from.
    grid : CellGrid
    joints_m : tuple of float
        u of the ends of the courses, from the bottom up; of a lying cylinder or a sphere two.
    sides : tuple of str
        Of each scan.
    radius_m : ndarray, shape (scans, rows, columns)
        Mean distance of the wall from the axis (of a sphere: its centre) about its mode; nan where
        a scan does not see the wall.
    sd_m : ndarray, shape (scans, rows, columns)
        Of that mean, by its points and by the scatter between neighbouring cells.
    count : ndarray of int, shape (scans, rows, columns)
        Points of that mean.
    turn_rad, along_m : ndarray, shape (scans, rows, columns)
        Mean azimuth and height (turn and u of the surface) of the points near the wall.
    is_wall : ndarray of bool, shape (scans, rows, columns)
    why : dict of str to ndarray of uint8, shape (rows, columns)
        For each side why a cell is wall or not: `growing.WALL`, `EMPTY`, `FEW` ...
    scatter_m : ndarray, shape (scans,)
        Sd of the mean of one cell as neighbouring cells of the same scan show it.
    masked_share : ndarray, shape (courses,)
        Of the cells of each course, those that no scan shows as wall.
    joints, welds, obstructions : tuple
        What was found, as proposals.
    delivered, outside, beyond, of_wall : ndarray of int, shape (scans,)
        Points that came; beside the shell; near it, but not in the band; averaged in cells of wall.
    are_apart : bool
        Whether scans show the wall at distances so different that each was decided alone.
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
    are_apart: bool = False


def wall_of_cells(cells, joints_m, sides):
    """`CloudWall` of the sums in cells: what is wall, and its distance for each scan.

    Parameters
    ----------
    cells : WallCells
    joints_m : sequence of float
        u of the ends of the courses.
    sides : sequence of str
        Of each scan.
    """
    joints_m, column_m = np.asarray(joints_m, dtype=float), _column_widths(cells)
    found = _Found(cells)
    grown_of = {}
    for side in dict.fromkeys(sides):
        mine = [i for i, one in enumerate(sides) if one == side]
        grown_of[side] = found.decide(mine, joints_m, column_m)
    seen = np.any(found.is_wall, axis=0)
    course = np.searchsorted(joints_m[1:-1], _middles(cells.grid), side="right")
    courses = np.arange(len(joints_m) - 1)
    count = np.where(found.is_wall, found.count, 0)
    best = _together(found.radius, found.sd, count)[0]
    one_side = len(grown_of) == 1
    return CloudWall(
        surface=cells.surface,
        grid=cells.grid,
        joints_m=tuple(joints_m.tolist()),
        sides=tuple(sides),
        radius_m=found.radius,
        sd_m=np.where(found.is_wall, found.sd, np.nan),
        count=count,
        turn_rad=found.turn,
        along_m=found.along,
        is_wall=found.is_wall,
        why={side: grown.why for side, grown in grown_of.items()},
        scatter_m=found.scatter,
        masked_share=np.array([1 - seen[course == one].mean() for one in courses]),
        joints=find_joints(best, _middles(cells.grid), joints_m) if one_side else (),
        welds=find_welds(best, course, column_m) if one_side else (),
        obstructions=find_obstructions(seen, list(grown_of.values()), cells, column_m),
        delivered=cells.delivered,
        outside=cells.outside,
        beyond=cells.beyond,
        of_wall=count.sum(axis=(1, 2)),
        are_apart=found.are_apart,
    )


class _Found:
    """What is told of each scan and cell (scans, rows, columns), side by side filled in."""

    def __init__(self, cells):
        self.cells, grid = cells, cells.grid
        shape = cells.scans, grid.rows, grid.columns
        self.radius, self.sd, self.turn, self.along = np.full((4, *shape), np.nan)
        self.count, self.is_wall = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=bool)
        self.scatter = np.full(cells.scans, np.nan)
        self.are_apart = False

    def decide(self, mine, joints_m, column_m):
        """`Grown` of the scans of one side; their means are filled in."""
        cells, grid = self.cells, self.cells.grid
        total = sum(cells.counts(i) for i in mine)
        grown = grow_wall(
            total,
            column_m=column_m,
            row_m=float(np.median(np.diff(grid.edges_m))),
            bin_m=grid.bin_m,
            joined_rows=np.searchsorted(grid.edges_m, joints_m[1:-1] - 1e-9),
        )
        refuse_no_wall(grown, cells)
        second = two_surfaces_in(grown, total, cells)
        if second is not None:
            return self._apart(mine, joints_m, column_m, grown, second)
        for i in mine:
            mean, self.sd[i], self.count[i] = _means(cells, i, grown)
            self.radius[i] = cells.surface.radius_m + mean
            self.turn[i], self.along[i] = _places(cells, i)
        values, sds = _together(self.radius[mine], self.sd[mine], self.count[mine])
        grown.why[off_trend(values, sds, grown.why == WALL)] = OFF_TREND
        for i in mine:
            self.is_wall[i] = (grown.why == WALL) & (self.count[i] >= 3)
            self.radius[i][~self.is_wall[i]] = np.nan
            course = np.searchsorted(joints_m[1:-1], _middles(grid), side="right")
            width, row_m = float(np.median(column_m)), float(np.median(np.diff(grid.edges_m)))
            self.scatter[i] = _scatter(self.radius[i], course, row_m, width)
            least = max(LEAST_SD_M, self.scatter[i])
            self.sd[i] = np.maximum(self.sd[i], least)
        return grown

    def _apart(self, mine, joints_m, column_m, grown, second):
        """`Grown` where two surfaces are one wall in scans that do not meet; else raise `second`.

        Each scan then decides alone. It must show a single surface itself: a wall with another
        surface before a part of it has two in the scan that sees both.
        """
        if len(mine) == 1:
            raise second
        why = grown.why.copy()
        for one in mine:
            try:
                alone = self.decide([one], joints_m, column_m)
            except InputError:
                raise second from None
            why[alone.why == WALL] = WALL
        self.are_apart = True
        return replace(grown, why=why)


def _middles(grid):
    return (grid.edges_m[:-1] + grid.edges_m[1:]) / 2


def _column_widths(cells):
    """(rows,) width of a cell, m."""
    return FULL_TURN * cells.surface.width_m(_middles(cells.grid)) / cells.grid.columns


def _means(cells, scan, grown):
    """Mean and its sd by the points alone (rows, columns), m, and their count, of one scan, over
    the bins of the wall; nan where there is none.
    """
    grid = cells.grid
    number = np.arange(grid.bins)
    within = (number >= grown.low[..., None]) & (number <= grown.high[..., None])
    within &= (grown.why == WALL)[..., None]
    counts = np.where(within, cells.counts(scan), 0)
    count = counts.sum(axis=2)
    # exact: whole numbers of units, and half a unit for what was cut off
    units = np.where(within, cells.units(scan), 0).sum(axis=2) + counts @ (number << FINE_BITS)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (units / count + 0.5) * grid.unit_m - grid.band_m
        centre = (number + 0.5) * grid.bin_m - grid.band_m
        square = counts @ centre**2 / count - (counts @ centre / count) ** 2
        spread = np.sqrt(np.maximum(square, 0) / count)
    return mean, spread, count


def _places(cells, scan):
    """Mean turn and u (rows, columns) of the points of one scan in the band."""
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


def _together(radius, sd, count):
    """Mean over scans (rows, columns) by their counts, and its sd."""
    weight = np.where(np.isfinite(radius), count, 0).astype(float)
    total = weight.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (np.nan_to_num(radius) * weight).sum(axis=0) / total
        share = weight / total
        return mean, np.sqrt((np.nan_to_num(sd) ** 2 * share**2).sum(axis=0))


def _scatter(radius, course, row_m, column_m):
    """Sd of the mean of a cell as its neighbours show it: the largest of those told along rows and
    along columns, by cells side by side and by cells that noise along a line does not tie.

    m2 - (m1 + m3) / 2 has the variance 1.5 s2. What all of a row or of a column show alike is the
    form of the wall, such as a bulge, and taken off. Columns are not followed over a joint.
    """
    parts = [(np.vstack([radius.T, radius.T]), column_m, "round")]  # columns go on round
    parts += [(radius[course == one], row_m, "up") for one in np.unique(course)]
    found = {}
    for values, size_m, way in parts:
        most = (len(values) - 1) // 2
        for lag in {1, min(max(1, round(APART_M / size_m)), most)} - {0}:
            e = values[lag:-lag] - (values[: -2 * lag] + values[2 * lag :]) / 2
            e = e[np.isfinite(e).any(axis=1)]
            if len(e):
                e = e - np.nanmedian(e, axis=1, keepdims=True)
                found.setdefault((way, lag), []).append(e[np.isfinite(e)])
    told = [np.concatenate(one) for one in found.values()]
    told = [SD_OVER_MEDIAN * np.median(np.abs(e)) for e in told if len(e) >= FEWEST_TOLD]
    return float(max(told, default=0.0) / np.sqrt(1.5))
