"""Passes over the points of scans, in one process or divided among several.

`find_cloud_wall` calls `sample(most)` and `cells(surface, grid, scans)` of an object; the search
for the bottom and for objects calls `gather(taken_of, ...)`. `Passes` reads all points in this
process. Other processes can apply `sample_points` and `sum_cells` to parts of the points and merge
the results. Samples and sums do not depend on the parts or their order.

A sample is random: each point has a number, a hash of its coordinates and its scan, and the sample
consists of the points with the smallest numbers.

Wall of a tank from the points of scans, in two passes over the points.

The first pass takes a sample and finds the approximate surface of the wall. The second pass sums
all points in cells of this surface. `deciding` then decides which cells show the wall. Memory
depends on the size of the tank and the number of scans, not on the number of points.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.clouds.wall.cells import FILE, CellGrid, WallCells
from tankcal.clouds.wall.deciding import decide_wall
from tankcal.clouds.wall.start import find_surface
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.units import FULL_TURN

SEED = np.uint64(0x2011_7507_0000_0001)
MIX = tuple(  # multipliers of splitmix64
    np.uint64(word) for word in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
)
PIECE = 1 << 16  # points hashed at a time
FARTHEST_M = 1e8  # largest coordinate, m; the resolution of float64 is 15 nm there
SAMPLE = 500_000  # points of the sample
WAITING = 0.25  # points that wait for a reduction of the sample, as a share of the sample: memory
# Height and width of a cell, m; least number of columns, if memory and points suffice
ROW_M, COLUMN_M, FEWEST_COLUMNS = 0.05, 0.15, 360
MEMORY_BYTES = 256 << 20  # memory of the sums of all scans, bytes
POINTS_OF_CELL = 40  # desired number of points in a cell, for points spread evenly over the wall
# Least number of columns, and largest width of a cell, m, for few points
LEAST_COLUMNS, WIDEST_M = 90, 0.3
# Largest height of a row, m, and as a share of a course, because a course bulges between joints
COARSEST_M, TALLEST = 0.2, 0.1


@dataclass(frozen=True)
class Passes:
    """Passes over the points in this process.

    Attributes
    ----------
    points : callable
        Returns a new iterator of (scan number, xyz (n, 3) in the frame of the tank, m).
    """

    points: object

    def sample(self, most):
        """Return a `PointSample` of at most `most` points."""
        return sample_points(self.points(), most)

    def cells(self, surface, grid, scans):
        """Return the `WallCells` of all points."""
        return sum_cells(self.points(), surface, grid, scans)

    def gather(self, taken_of, *sizes):
        """Apply `taken_of` to all points and the other arguments; the result must have `merge`."""
        return taken_of(self.points(), *sizes)


def sample_points(points, most):
    """Sample an iterator of (scan, points); raise InputError for invalid coordinates."""
    sample = PointSample(most)
    for scan, xyz in points:
        sample.add(_check_points(xyz, scan), scan)
    return sample


def sum_cells(points, surface, grid, scans):
    """Sum an iterator of (scan, points) in `WallCells`."""
    cells = WallCells(surface, grid, scans)
    for scan, xyz in points:
        cells.add(xyz, scan)
    return cells


def _check_points(xyz_m, scan):
    """Convert points to float64 (n, 3); raise InputError if a coordinate is too large or nan."""
    xyz_m = np.asarray(xyz_m, dtype=float)
    if xyz_m.ndim != 2 or xyz_m.shape[1] != 3:
        raise ValueError(f"points of scan {scan} have shape {xyz_m.shape}; expected (n, 3)")
    bad = np.flatnonzero(~(np.abs(xyz_m) < FARTHEST_M).all(axis=1))
    if len(bad):
        text = message(
            "cloud_not_finite",
            "scan {scan} has points that cannot be, the first of them {point}; expected "
            "coordinates of less than {most:g} m",
            scan=scan + 1,
            point=str(tuple(xyz_m[bad[0]].tolist())),
            most=FARTHEST_M,
        )
        raise InputError(Problem(FILE, text))
    return xyz_m


class PointSample:
    """Sample of the added points, and the number of points added of each scan.

    Parameters
    ----------
    most : int
        Largest number of points in the sample.
    """

    def __init__(self, most):
        self.most, self.delivered = most, {}
        self._xyz, self._key = [np.empty((0, 3))], [np.empty(0, dtype=np.uint64)]
        self._scan = [np.empty(0, dtype=np.int64)]
        self._waiting, self._limit = 0, np.uint64(2**64 - 1)

    def add(self, xyz_m, scan):
        """Add points (n, 3) of one scan."""
        self.delivered[scan] = self.delivered.get(scan, 0) + len(xyz_m)
        for start in range(0, len(xyz_m), PIECE):
            part = xyz_m[start : start + PIECE]
            key = _hash(part, scan)
            taken = np.flatnonzero(key <= self._limit)
            self._xyz.append(part[taken])
            self._key.append(key[taken])
            self._scan.append(np.full(len(taken), scan, dtype=np.int64))
            self._waiting += len(taken)
            if self._waiting > self.most * WAITING:
                self.reduce()

    def merge(self, other):
        """Return the sample of both sets of points."""
        both = PointSample(self.most)
        both._xyz, both._key = self._xyz + other._xyz, self._key + other._key
        both._scan = self._scan + other._scan
        both.delivered = {
            scan: self.delivered.get(scan, 0) + other.delivered.get(scan, 0)
            for scan in self.delivered | other.delivered
        }
        return both

    def points(self):
        """Sampled points (k, 3), in the order of their numbers."""
        order = self._order()
        return self._xyz[0][order]

    def scans(self):
        """Scan (k,) of each point of `points`."""
        order = self._order()
        return self._scan[0][order]

    def _order(self):
        """Reduce the sample and return the order (k,) of the numbers."""
        self.reduce()
        return np.lexsort((*self._xyz[0].T, self._key[0]))

    def reduce(self):
        """Discard points that do not belong to the sample."""
        xyz, key, scan = np.vstack(self._xyz), *map(np.concatenate, (self._key, self._scan))
        if len(key) > self.most:
            best = np.argpartition(key, self.most - 1)[: self.most]
            xyz, key, scan = xyz[best], key[best], scan[best]
            self._limit = key.max()
        self._xyz, self._key, self._scan, self._waiting = [xyz], [key], [scan], 0


def _hash(xyz_m, scan):
    """Numbers (n,) of points, from splitmix64 over the bits of x, y and z."""
    bits = np.ascontiguousarray(xyz_m, dtype=float).view(np.uint64).reshape(-1, 3).T
    number = np.full(bits.shape[1], SEED ^ np.uint64(scan), dtype=np.uint64)
    for word in bits:
        number = (number ^ word) * MIX[0]
        number = (number ^ (number >> np.uint64(30))) * MIX[1]
        number = (number ^ (number >> np.uint64(27))) * MIX[2]
        number ^= number >> np.uint64(31)
    return number


# ---- wall of a tank from the points of scans, in two passes over the points


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
