"""A pass of cells over points in memory, beside loops that choose the points of each ring.

    python benchmarks/cloud_peers.py [POINTS] [RINGS]        (default: 10 000 000 into 950)

A pass is to take 2 s at most, 0.5 s is the aim, in seconds of processor. The peers do less: open3d
crops ring after ring, numpy sorts the points by their heights. The crop runs over a few rings and
is extrapolated to all. The right answer is how many points each ring has.
"""

import sys
import time

import numpy as np
from measured import ROUNDS, Row, digits_of, interleaved, peer_module, tell

from tankcal.clouds.wall import sum_cells
from tankcal.clouds.wall.cells import CellGrid
from tankcal.clouds.wall.start import CylinderSurface

RADIUS_M, HEIGHT_M, NOISE_M, PIECE = 6.5, 9.5, 0.002, 1 << 18
SAMPLED_RINGS = 5
LEAST = 15.0


def main(points, rings):
    """A row for each peer."""
    rng = np.random.default_rng(1)
    azimuth, z = rng.uniform(0, 2 * np.pi, points), rng.uniform(0, HEIGHT_M, points)
    radius = RADIUS_M + rng.normal(0, NOISE_M, points)
    xyz = np.stack([radius * np.sin(azimuth), radius * np.cos(azimuth), z]).T
    edges = np.linspace(0, HEIGHT_M, rings + 1)
    right = np.histogram(z, edges)[0]
    grid = CellGrid(edges, 360)
    surface = CylinderSurface(np.zeros(3), RADIUS_M)
    pieces = [(0, xyz[i : i + PIECE]) for i in range(0, points, PIECE)]

    def ours():
        return sum_cells(pieces, surface, grid, 1)

    def sort():
        order = np.argsort(xyz[:, 2])
        return np.diff(np.searchsorted(xyz[order, 2], edges))

    digits = {"numpy": digits_of(sort(), right)}
    own = digits_of(ours().counts(0).sum(axis=(1, 2)), right)
    tasks, versions = {"tankcal": ours, "numpy": sort}, {"numpy": np.__version__}
    name = "points into rings"
    if found := peer_module("open3d", name):
        crop, digits["open3d"] = cropping(found[0], xyz, edges, right)
        tasks["open3d"], versions["open3d"] = crop, found[1]
    seconds = interleaved(tasks, ROUNDS)
    notes = {
        "numpy": "sorts by height",
        "open3d": f"crops, extrapolated from {SAMPLED_RINGS} rings",
    }
    for peer, version in versions.items():
        tell(Row(name, f"{points} points, {rings} rings x {grid.columns} cells", seconds["tankcal"],
                 peer, version, seconds[peer], "points of each ring", (own, digits[peer]), LEAST,
                 note=notes[peer]))  # fmt: skip


def cropping(open3d, xyz, edges, right):
    """(task that gives the seconds of all rings, digits of the counts of some)."""
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.ascontiguousarray(xyz)))
    rings = len(edges) - 1
    chosen = range(0, rings, max(1, rings // SAMPLED_RINGS))[:SAMPLED_RINGS]

    def cropped(i):
        low, high = np.array([-99, -99, edges[i]]), np.array([99, 99, edges[i + 1]])
        return cloud.crop(open3d.geometry.AxisAlignedBoundingBox(low, high))

    def crop():
        start = time.process_time()
        for i in chosen:
            cropped(i)
        return (time.process_time() - start) * rings / len(chosen)

    return crop, digits_of([len(cropped(i).points) for i in chosen], right[list(chosen)])


if __name__ == "__main__":
    numbers = [int(float(one)) for one in sys.argv[1:3]]
    main(*(numbers + [10_000_000, 950][len(numbers) :]))
