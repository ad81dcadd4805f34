"""Passes over the points of scans, in one process or divided among several.

`find_cloud_wall` calls `sample(most)` and `cells(surface, grid, scans)` of an object; the search
for the bottom and for objects calls `gather(taken_of, ...)`. `Passes` reads all points in this
process. Other processes can apply `sample_points` and `sum_cells` to parts of the points and merge
the results. Samples and sums do not depend on the parts or their order.

A sample is random: each point has a number, a hash of its coordinates and its scan, and the sample
consists of the points with the smallest numbers.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.clouds.wall.cells import WallCells
from tankcal.clouds.wall.screens import FILE
from tankcal.errors import InputError, Problem
from tankcal.messages import message

SEED = np.uint64(0x2011_7507_0000_0001)
MIX = tuple(  # multipliers of splitmix64
    np.uint64(word) for word in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
)
PIECE = 1 << 16  # points hashed at a time
FARTHEST_M = 1e8  # largest coordinate, m; the resolution of float64 is 15 nm there


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
            if self._waiting > self.most:
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
