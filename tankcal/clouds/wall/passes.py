"""The two passes over the points of scans: what is taken of them, here or shared out.

`find_cloud_wall` asks an object for `sample(most)` and `cells(surface, grid, scans)`, who looks for
more for `gather(taken_of, ...)`; `Passes` goes over all points in this process. Whoever shares
points out makes these of parts, with `sample_of` and `cells_of`, and adds them: samples and sums
are the same whatever the parts and their order.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.clouds.wall.cells import WallCells
from tankcal.clouds.wall.sampling import PointSample
from tankcal.clouds.wall.screens import FILE
from tankcal.errors import InputError, Problem
from tankcal.messages import message

FARTHEST_M = 1e8  # of coordinates: doubles tell 15 nm there


@dataclass(frozen=True)
class Passes:
    """Both passes in this process.

    Attributes
    ----------
    points : callable
        Gives a fresh iterator of (scan number, xyz (n, 3) in the frame of the tank, m).
    """

    points: object

    def sample(self, most):
        """`PointSample` of at most so many points."""
        return sample_of(self.points(), most)

    def cells(self, surface, grid, scans):
        """`WallCells` of all points."""
        return cells_of(self.points(), surface, grid, scans)

    def gather(self, taken_of, *sizes):
        """What `taken_of` takes of all points and these sizes; two of it have `merged`."""
        return taken_of(self.points(), *sizes)


def sample_of(points, most):
    """`PointSample` of an iterator of points; InputError for those that cannot be."""
    sample = PointSample(most)
    for scan, xyz in points:
        sample.add(_checked(xyz, scan), scan)
    return sample


def cells_of(points, surface, grid, scans):
    """`WallCells` of an iterator of points."""
    cells = WallCells(surface, grid, scans)
    for scan, xyz in points:
        cells.add(xyz, scan)
    return cells


def _checked(xyz_m, scan):
    """Points as float64 (n, 3), all finite."""
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
