"""From the points of scans to the cells of a wall, in two passes over them.

The first takes a sample, and with it finds where the wall is; the second sums up all points in
cells about it. What is wall is decided of all scans of one side together, its distance then told
for each scan. Memory hangs on the tank and the number of scans, not on the points.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.clouds.wall.cells import FINE_BITS, PLACE, CellGrid
from tankcal.clouds.wall.features import (
    Joint,
    Obstruction,
    Weld,
    find_joints,
    find_obstructions,
    find_welds,
)
from tankcal.clouds.wall.growing import (
    EMPTY,
    FEW,
    FEWEST,
    OFF_TREND,
    WALL,
    grow_wall,
    off_trend,
    spread_between,
)
from tankcal.clouds.wall.passes import Passes
from tankcal.clouds.wall.start import FILE, find_surface
from tankcal.errors import InputError, Problem
from tankcal.geometry.outlines import FULL_TURN
from tankcal.messages import message

SAMPLE = 500_000
ROW_M, COLUMN_M, FEWEST_COLUMNS = 0.05, 0.15, 360  # of a cell, where memory and points allow
MEMORY_BYTES = 256 << 20  # of the sums of all scans
POINTS_OF_CELL = 40  # that a cell should get, were they even over the wall: they never are
LEAST_COLUMNS, WIDEST_M = 90, 0.3  # where points are few
COARSEST_M, TALLEST = 0.2, 0.1  # a row, and how much of a course: it bulges between its joints
LEAST_SD_M = 5e-5  # no mean of a cell is told better
TWO_SURFACES, SECTORS, SECTORS_WITH = 0.10, 36, 0.6  # cells with two modes; where they are
LEAST_WALL = 0.25  # of the cells in which anything is seen


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


def find_cloud_wall(
    passes,
    *,
    radius_m,
    joints_m=None,
    kind="vertical",
    azimuth_rad=0.0,
    sides=None,
    band_m=0.1,
    row_m=ROW_M,
    memory_bytes=MEMORY_BYTES,
    progress=None,
):
    """The wall that the points of scans show.

    Parameters
    ----------
    passes : callable, or an object as `passes.Passes` is
        Gives a fresh iterator of (scan number, xyz (n, 3) in the frame of the tank, m); or takes
        the sample and the sums of all points itself.
    radius_m : float
        Nominal, within 3 % of the wall's.
    joints_m : sequence of float, optional
        Heights of the ends of the courses of an upright tank, from the bottom up, m; of a lying
        cylinder its two ends from the middle of the points (None: as far as they go).
    kind : str, optional
        "vertical", "horizontal" or "sphere".
    azimuth_rad : float, optional
        Of the axis of a lying cylinder.
    sides : sequence of str, optional
        "inside" or "outside" for each scan; None: all see the same side.
    band_m : float, optional
        How far from its mean radius the wall is looked for, m.
    row_m : float, optional
        Height of a cell; larger where points or memory do not suffice, m.
    memory_bytes : int, optional
        That the sums may take.
    progress : callable, optional
        Is told what is being done.

    Returns
    -------
    CloudWall

    Raises
    ------
    InputError
        Where the points show no wall, or two of them, in words.
    """
    progress = progress or (lambda text: None)
    progress(message("cloud_first_pass", "looking for the wall in a sample of the points"))
    passes = Passes(passes) if callable(passes) else passes
    sample = passes.sample(SAMPLE)
    some = sample.points()
    surface, ends = find_surface(
        some,
        kind=kind,
        ends_m=None if joints_m is None else (joints_m[0], joints_m[-1]),
        radius_m=radius_m,
        azimuth_rad=azimuth_rad,
    )
    scans = max([*sample.delivered, len(sides or ()) - 1]) + 1
    joints = tuple(joints_m) if kind == "vertical" else ends
    points = sum(sample.delivered.values())
    grid = make_grid(
        surface,
        joints,
        band_m=band_m,
        row_m=row_m,
        scans=scans,
        points=points * _share_near(some, surface, ends, band_m),
        memory_bytes=memory_bytes,
    )
    del sample, some
    progress(
        message(
            "cloud_second_pass",
            "summing up {count} points in {rows} x {columns} cells",
            count=points,
            rows=grid.rows,
            columns=grid.columns,
        )
    )
    cells = passes.cells(surface, grid, scans)
    return wall_of_cells(cells, joints, tuple(sides or ["one"] * scans))


def _share_near(xyz_m, surface, ends_m, band_m):
    """Which part of a sample lies between the ends, near the surface."""
    u, _, distance = surface.places(xyz_m)
    return float(np.mean((u > ends_m[0]) & (u < ends_m[1]) & (np.abs(distance) < band_m)))


def make_grid(
    surface, joints_m, *, points, scans=1, band_m=0.1, row_m=ROW_M, memory_bytes=MEMORY_BYTES
):
    """`CellGrid` whose rows begin at the joints, as fine as points and memory allow.

    Parameters
    ----------
    surface : CylinderSurface or SphereSurface
    joints_m : sequence of float
        u of the ends of the courses.
    points : float
        That are expected within the band.
    scans, band_m, row_m, memory_bytes : optional
        As for `find_cloud_wall`.
    """
    around = FULL_TURN * surface.radius_m
    columns = max(FEWEST_COLUMNS, int(np.ceil(around / COLUMN_M)))
    area = around * (joints_m[-1] - joints_m[0])
    row_m = max(row_m, POINTS_OF_CELL * area / max(points, 1) / (around / columns))
    row_m = min(row_m, COARSEST_M, TALLEST * np.diff(joints_m).min())
    affordable = points / POINTS_OF_CELL / ((joints_m[-1] - joints_m[0]) / row_m)
    columns = min(columns, max(LEAST_COLUMNS, int(affordable), int(around / WIDEST_M)))
    while True:
        edges = [joints_m[0]]
        for low, high in pairwise(joints_m):
            rows = max(1, int(np.ceil((high - low) / row_m)))
            edges.extend(low + (high - low) * np.arange(1, rows + 1) / rows)
        grid = CellGrid(np.array(edges), columns, band_m, max(8, round(band_m / 0.002)))
        is_coarsest = row_m >= COARSEST_M and columns <= 2 * LEAST_COLUMNS
        if is_coarsest or grid.bytes_of(scans) <= memory_bytes:
            return grid
        if row_m < COARSEST_M and row_m < 2 * around / columns:
            row_m *= 1.25
        elif columns > 2 * LEAST_COLUMNS:
            columns = max(2 * LEAST_COLUMNS, int(columns / 1.25))
        else:
            row_m *= 1.25


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
    grid, surface = cells.grid, cells.surface
    shape = (cells.scans, grid.rows, grid.columns)
    found = {name: np.full(shape, np.nan) for name in ("radius", "sd", "turn", "along")}
    count, is_wall = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=bool)
    why, grown_of = {}, {}
    scatter = np.full(cells.scans, np.nan)
    joint_rows = np.searchsorted(grid.edges_m, np.asarray(joints_m)[1:-1] - 1e-9)
    middle = (grid.edges_m[:-1] + grid.edges_m[1:]) / 2
    column_m = FULL_TURN * surface.width_m(middle) / grid.columns
    for side in dict.fromkeys(sides):
        mine = [i for i, one in enumerate(sides) if one == side]
        total = sum(cells.counts(i) for i in mine)
        grown = grow_wall(
            total,
            column_m=column_m,
            row_m=float(np.median(np.diff(grid.edges_m))),
            bin_m=grid.bin_m,
            joined_rows=joint_rows,
        )
        _refuse_no_wall(grown, cells)
        _refuse_two_surfaces(grown, grid, surface)
        for i in mine:
            mean, spread, count[i] = _means(cells, i, grown)
            found["radius"][i], found["sd"][i] = surface.radius_m + mean, spread
            found["turn"][i], found["along"][i] = _places(cells, i)
        values, sds = _together(found["radius"][mine], found["sd"][mine], count[mine])
        off = off_trend(values, sds, grown.why == WALL)
        grown.why[off] = OFF_TREND
        why[side], grown_of[side] = grown.why, grown
        for i in mine:
            is_wall[i] = (grown.why == WALL) & (count[i] >= 3)
            found["radius"][i][~is_wall[i]] = np.nan
            scatter[i] = _scatter(found["radius"][i])
            least = max(LEAST_SD_M, float(np.nan_to_num(scatter[i])))
            found["sd"][i] = np.maximum(found["sd"][i], least)
    seen = np.any(is_wall, axis=0)
    course = np.searchsorted(np.asarray(joints_m)[1:-1], middle, side="right")
    courses = np.arange(len(joints_m) - 1)
    best = _together(found["radius"], found["sd"], np.where(is_wall, count, 0))[0]
    first = dict.fromkeys(sides)
    return CloudWall(
        surface=surface,
        grid=grid,
        joints_m=tuple(float(one) for one in joints_m),
        sides=tuple(sides),
        radius_m=found["radius"],
        sd_m=np.where(is_wall, found["sd"], np.nan),
        count=np.where(is_wall, count, 0),
        turn_rad=found["turn"],
        along_m=found["along"],
        is_wall=is_wall,
        why=why,
        scatter_m=scatter,
        masked_share=np.array([1 - seen[course == one].mean() for one in courses]),
        joints=find_joints(best, middle, np.asarray(joints_m)) if len(first) == 1 else (),
        welds=find_welds(best, course, column_m) if len(first) == 1 else (),
        obstructions=find_obstructions(seen, list(grown_of.values()), cells, column_m),
        delivered=cells.delivered,
        outside=cells.outside,
        beyond=cells.beyond,
        of_wall=np.array([int(np.where(is_wall[i], count[i], 0).sum()) for i in range(shape[0])]),
    )


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


def _scatter(radius):
    """Sd of the mean of a cell as its neighbours show it, the smaller of along rows and columns."""
    around = radius - (np.roll(radius, 1, axis=1) + np.roll(radius, -1, axis=1)) / 2
    up = radius[1:-1] - (radius[:-2] + radius[2:]) / 2 if len(radius) > 2 else around
    return min(one for one in (spread_between(around), spread_between(up), np.inf) if one > 0)


def _refuse_no_wall(grown, cells):
    """Raise InputError where few of the cells in which anything is seen are wall."""
    something = (grown.why.ravel() != EMPTY) | np.any(cells.far >= FEWEST, axis=1)
    seen = max(np.count_nonzero(something), 1)
    share = np.count_nonzero(grown.why == WALL) / seen
    if share >= LEAST_WALL:
        return
    if np.count_nonzero(grown.why == FEW) > seen / 2:
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


def _refuse_two_surfaces(grown, grid, surface):
    """Raise InputError where a second surface goes round with the wall."""
    seen = np.count_nonzero((grown.why == WALL) | grown.two_modes | (grown.other >= 0))
    second = grown.other >= 0
    sector = np.arange(grid.columns) * SECTORS // grid.columns
    cells = np.bincount(sector, np.ones(grid.columns) * grid.rows, SECTORS)
    parts = np.bincount(sector, second.sum(axis=0), SECTORS) / cells
    share = np.count_nonzero(second) / max(seen, 1)
    if share < TWO_SURFACES or np.mean(parts >= TWO_SURFACES) < SECTORS_WITH:
        return
    bins = grown.other[second]
    middle = (grown.low + grown.high)[grown.why == WALL] / 2
    text = message(
        "cloud_two_surfaces",
        "found two surfaces all round the tank: {first_m:.3f} m in {first:.0f} % of the cells and "
        "{second_m:.3f} m in {second:.0f} %; expected one wall: insulation, a double wall, or "
        "scans of both sides told as one (side)",
        first_m=surface.radius_m + (np.median(middle) + 0.5) * grid.bin_m - grid.band_m,
        first=100 * np.count_nonzero(grown.why == WALL) / max(seen, 1),
        second_m=surface.radius_m + (np.median(bins) + 0.5) * grid.bin_m - grid.band_m,
        second=100 * share,
    )
    raise InputError(Problem(FILE, text))
