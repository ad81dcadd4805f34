"""A pass of cells over points in memory, against the loop that crops ring after ring by open3d.

    python benchmarks/cloud_peers.py [POINTS] [RINGS]        (default: 10 000 000 into 950)

A pass is to take 2 s at most, 0.5 s is the aim, in seconds of processor. The loop only selects the
points of a ring; it runs over a few rings and is extrapolated to all. It is left out where open3d
cannot be imported.
"""

import sys
import time

import numpy as np

from tankcal.clouds.wall import cells_of
from tankcal.clouds.wall.cells import CellGrid
from tankcal.clouds.wall.surfaces import CylinderSurface

RADIUS_M, HEIGHT_M, NOISE_M, PIECE = 6.5, 9.5, 0.002, 1 << 18
ROUNDS, SAMPLED_RINGS = 3, 5


def main(points, rings):
    """Print a line for each of both."""
    rng = np.random.default_rng(1)
    azimuth, z = rng.uniform(0, 2 * np.pi, points), rng.uniform(0, HEIGHT_M, points)
    radius = RADIUS_M + rng.normal(0, NOISE_M, points)
    xyz = np.stack([radius * np.sin(azimuth), radius * np.cos(azimuth), z]).T
    edges = np.linspace(0, HEIGHT_M, rings + 1)
    grid = CellGrid(edges, 360)
    surface = CylinderSurface(np.zeros(3), RADIUS_M)
    pieces = [(0, xyz[i : i + PIECE]) for i in range(0, points, PIECE)]
    ours = min(timed(lambda: cells_of(pieces, surface, grid, 1)) for _ in range(ROUNDS))
    print(f"cells of {rings} x {grid.columns}, {points} points: {ours:.2f} s a pass")
    try:
        import open3d
    except ImportError as error:  # not there, or without a library of the system that it needs
        print(f"open3d is left out: {error}")
        return
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.ascontiguousarray(xyz)))

    def crop():
        for i in range(0, rings, max(1, rings // SAMPLED_RINGS)):
            low, high = np.array([-99, -99, edges[i]]), np.array([99, 99, edges[i + 1]])
            cloud.crop(open3d.geometry.AxisAlignedBoundingBox(low, high))

    cropped = len(range(0, rings, max(1, rings // SAMPLED_RINGS)))
    theirs = min(timed(crop) for _ in range(ROUNDS)) * rings / cropped
    print(
        f"open3d {open3d.__version__}, crop of {rings} rings: {theirs:.1f} s, {theirs / ours:.0f}x"
    )


def timed(task):
    """Seconds of processor of a task."""
    start = time.process_time()
    task()
    return time.process_time() - start


if __name__ == "__main__":
    numbers = [int(float(one)) for one in sys.argv[1:3]]
    main(*(numbers + [10_000_000, 950][len(numbers) :]))
