"""From the points of scans to the cells of a wall, in two passes over them.

The first takes a sample, and with it finds where the wall is; the second sums up all points in
cells about it. What is wall is decided by `deciding`. Memory hangs on the tank and the number of
scans, not on the points.
"""

from itertools import pairwise

import numpy as np

from tankcal.clouds.wall.cells import CellGrid
from tankcal.clouds.wall.deciding import wall_of_cells
from tankcal.clouds.wall.passes import Passes
from tankcal.clouds.wall.start import find_surface
from tankcal.geometry.outlines import FULL_TURN
from tankcal.messages import message

SAMPLE = 500_000
ROW_M, COLUMN_M, FEWEST_COLUMNS = 0.05, 0.15, 360  # of a cell, where memory and points allow
MEMORY_BYTES = 256 << 20  # of the sums of all scans
POINTS_OF_CELL = 40  # that a cell should get, were they even over the wall: they never are
LEAST_COLUMNS, WIDEST_M = 90, 0.3  # where points are few
COARSEST_M, TALLEST = 0.2, 0.1  # a row, and how much of a course: it bulges between its joints


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
    is_unit_defined=False,
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
    is_unit_defined : bool, optional
        Whether the format of the files defines their unit, so that no other unit is suggested.

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
        outwards=_outwards(sample, sides),
        is_unit_defined=is_unit_defined,
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


def _outwards(sample, sides):
    """(k,) 1 of sampled points seen from inside, -1 from outside; None: no sides are known."""
    if sides is None:
        return None
    return np.where(np.array(sides) == "inside", 1, -1)[sample.scans()]


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
