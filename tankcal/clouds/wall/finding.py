"""Wall of a tank from the points of scans, in two passes over the points.

The first pass takes a sample and finds the approximate surface of the wall. The second pass sums
all points in cells of this surface. `deciding` then decides which cells show the wall. Memory
depends on the size of the tank and the number of scans, not on the number of points.
"""

from itertools import pairwise

import numpy as np

from tankcal.clouds.wall.cells import CellGrid
from tankcal.clouds.wall.deciding import decide_wall
from tankcal.clouds.wall.passes import Passes
from tankcal.clouds.wall.start import find_surface
from tankcal.messages import message
from tankcal.units import FULL_TURN

SAMPLE = 500_000  # points of the sample
# Height and width of a cell, m; least number of columns, if memory and points suffice
ROW_M, COLUMN_M, FEWEST_COLUMNS = 0.05, 0.15, 360
MEMORY_BYTES = 256 << 20  # memory of the sums of all scans, bytes
POINTS_OF_CELL = 40  # desired number of points in a cell, for points spread evenly over the wall
# Least number of columns, and largest width of a cell, m, for few points
LEAST_COLUMNS, WIDEST_M = 90, 0.3
# Largest height of a row, m, and as a share of a course, because a course bulges between joints
COARSEST_M, TALLEST = 0.2, 0.1


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
    """Find the wall of a tank in the points of scans.

    Parameters
    ----------
    passes : callable or Passes
        Callable that returns a new iterator of (scan number, xyz (n, 3) in the frame of the tank,
        m), or an object with the methods of `passes.Passes`.
    radius_m : float
        Nominal radius, m, within 3 % of the radius of the wall.
    joints_m : sequence of float, optional
        Heights of the ends of the courses of an upright tank, from the bottom up, m. For a lying
        cylinder, its two ends relative to the centre of the points; by default the extent of the
        points.
    kind : str, optional
        "vertical", "horizontal" or "sphere".
    azimuth_rad : float, optional
        Azimuth of the axis of a lying cylinder, rad.
    sides : sequence of str, optional
        "inside" or "outside" for each scan; by default all scans see the same side.
    band_m : float, optional
        Half-width of the band about the mean radius in which the wall is searched, m.
    row_m : float, optional
        Height of a cell, m; larger if points or memory do not suffice.
    memory_bytes : int, optional
        Largest memory of the sums, bytes.
    progress : callable, optional
        Called with a message at the start of each pass.
    is_unit_defined : bool, optional
        Whether the format of the files defines their unit, so that no other unit is suggested.

    Returns
    -------
    CloudWall

    Raises
    ------
    InputError
        If the points show no wall, or two surfaces.
    """
    progress = progress or (lambda text: None)
    progress(message("cloud_first_pass", "looking for the wall in a sample of the points"))
    passes = Passes(passes) if callable(passes) else passes
    sample = passes.sample(SAMPLE)
    sampled = sample.points()
    surface, ends = find_surface(
        sampled,
        outwards=_viewing_directions(sample, sides),
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
        points=points * _share_in_band(sampled, surface, ends, band_m),
        memory_bytes=memory_bytes,
    )
    del sample, sampled
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
    return decide_wall(cells, joints, tuple(sides or ["one"] * scans))


def _viewing_directions(sample, sides):
    """Direction (k,) from the scanner to sampled points: 1 from inside, -1 from outside.

    None if the sides of the scans are not known.
    """
    if sides is None:
        return None
    return np.where(np.array(sides) == "inside", 1, -1)[sample.scans()]


def _share_in_band(xyz_m, surface, ends_m, band_m):
    """Share of a sample that lies between the ends and within the band of the surface."""
    u, _, distance = surface.places(xyz_m)
    return float(np.mean((u > ends_m[0]) & (u < ends_m[1]) & (np.abs(distance) < band_m)))


def make_grid(
    surface, joints_m, *, points, scans=1, band_m=0.1, row_m=ROW_M, memory_bytes=MEMORY_BYTES
):
    """Create a `CellGrid` with edges at the joints, as fine as points and memory permit.

    Parameters
    ----------
    surface : CylinderSurface or SphereSurface
        Approximate surface of the wall.
    joints_m : sequence of float
        Coordinate u of the ends of the courses, m.
    points : float
        Expected number of points within the band.
    scans : int, optional
        Number of scans.
    band_m, row_m, memory_bytes : optional
        As for `find_cloud_wall`.

    Returns
    -------
    CellGrid
    """
    around = FULL_TURN * surface.radius_m
    columns = max(FEWEST_COLUMNS, int(np.ceil(around / COLUMN_M)))
    area = around * (joints_m[-1] - joints_m[0])
    # The height of a row follows from the desired points of a cell, within the limits of a course.
    row_m = max(row_m, POINTS_OF_CELL * area / max(points, 1) / (around / columns))
    row_m = min(row_m, COARSEST_M, TALLEST * np.diff(joints_m).min())
    affordable = points / POINTS_OF_CELL / ((joints_m[-1] - joints_m[0]) / row_m)
    columns = min(columns, max(LEAST_COLUMNS, int(affordable), int(around / WIDEST_M)))
    # Enlarge the cells until the sums fit into the memory, keeping their sides similar.
    while True:
        edges = [joints_m[0]]
        for low, high in pairwise(joints_m):
            rows = max(1, int(np.ceil((high - low) / row_m)))
            edges.extend(low + (high - low) * np.arange(1, rows + 1) / rows)
        grid = CellGrid(np.array(edges), columns, band_m, max(8, round(band_m / 0.002)))
        is_coarsest = row_m >= COARSEST_M and columns <= 2 * LEAST_COLUMNS
        if is_coarsest or grid.count_bytes(scans) <= memory_bytes:
            return grid
        if row_m < COARSEST_M and row_m < 2 * around / columns:
            row_m *= 1.25
        elif columns > 2 * LEAST_COLUMNS:
            columns = max(2 * LEAST_COLUMNS, int(columns / 1.25))
        else:
            row_m *= 1.25
