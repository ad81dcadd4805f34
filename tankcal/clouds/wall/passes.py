"""Passes over the points of scans, in one process or divided among several.

`find_cloud_wall` calls `sample(most)` and `cells(surface, grid, scans)` of an object; the search
for the bottom and for objects calls `gather(taken_of, ...)`. `Passes` reads all points in this
process. Other processes can apply `sample_of` and `cells_of` to parts of the points and merge the
results. Samples and sums do not depend on the parts or their order.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.clouds.wall.cells import WallCells
from tankcal.clouds.wall.sampling import PointSample
from tankcal.clouds.wall.screens import FILE
from tankcal.errors import InputError, Problem
from tankcal.messages import message

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
        return sample_of(self.points(), most)

    def cells(self, surface, grid, scans):
        """Return the `WallCells` of all points."""
        return cells_of(self.points(), surface, grid, scans)

    def gather(self, taken_of, *sizes):
        """Apply `taken_of` to all points and the other arguments; the result must have `merged`."""
        return taken_of(self.points(), *sizes)


def sample_of(points, most):
    """Sample an iterator of (scan, points); raise InputError for invalid coordinates."""
    sample = PointSample(most)
    for scan, xyz in points:
        sample.add(_check_points(xyz, scan), scan)
    return sample


def cells_of(points, surface, grid, scans):
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
