"""Wall points into ring sections: time, memory, and the ratio to open3d and a loop of masks.

    python benchmarks/rings.py [POINTS] [RINGS]        (default: 10 000 000 into 950)

The goals: under 2 s and 500 MB in total on one core. Rounds are interleaved, medians of five or of
as many as $ROUNDS says. The loops by open3d and by masks only select the points of a ring,
`ring_sections` does all of its work; the loops run over a few rings of each round and are
extrapolated to all. open3d is left out where it is not installed.
"""

import os
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from tankcal.geometry.rings import Axis, ring_sections

ROUNDS, SAMPLED_RINGS = int(os.environ.get("ROUNDS", 5)), 5
HEIGHT_M, RADIUS_M, NOISE_M = 9.5, 6.5, 0.003
BLOCK = 100_000


def main(points, rings):
    """Print a line for each measurement, each kind in a process of its own."""
    print(f"{points} points, {rings} rings, median of {ROUNDS}, one core")
    for task in ("float64", "float32", "compare"):
        subprocess.run(
            [sys.executable, __file__, str(points), str(rings), task],
            check=True,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            cwd=Path(__file__).resolve().parent.parent,
        )


def wall(points, dtype):
    """(points, 3) of a noisy cylinder in random order, made in blocks to hold memory down."""
    rng = np.random.default_rng(1)
    xyz = np.empty((points, 3), dtype=dtype)
    for start in range(0, points, BLOCK):
        block = xyz[start : start + BLOCK]
        azimuth = rng.uniform(0, 2 * np.pi, len(block))
        radius = RADIUS_M + rng.normal(0, NOISE_M, len(block))
        block[:, 0], block[:, 1] = radius * np.sin(azimuth), radius * np.cos(azimuth)
        block[:, 2] = rng.uniform(0, HEIGHT_M, len(block))
    return xyz


def alone(points, rings, dtype):
    """Time of `ring_sections`, and the peak memory of the whole process."""
    xyz, edges = wall(points, dtype), np.linspace(0, HEIGHT_M, rings + 1)
    seconds = [timed(lambda: sections(xyz, edges)) for _ in range(ROUNDS)]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"ring_sections, {np.dtype(dtype)}: {statistics.median(seconds):.2f} s "
        f"(worst {max(seconds):.2f} s), peak {peak:.0f} MB, {xyz.nbytes / 2**20:.0f} MB of them "
        "the points"
    )


def compare(points, rings):
    """One interleaved run of `ring_sections` and the loops."""
    xyz, edges = wall(points, np.float64), np.linspace(0, HEIGHT_M, rings + 1)
    some = np.linspace(0, rings - 1, min(SAMPLED_RINGS, rings)).astype(int)
    tasks = {
        "ring_sections, all rings": (lambda: sections(xyz, edges), 1.0),
        "numpy masks": (lambda: masks(xyz, edges, some), rings / len(some)),
    }
    crop = open3d_crop(xyz, edges, some)
    if crop:
        tasks["open3d crop"] = (crop, rings / len(some))
    seconds = {name: [] for name in tasks}
    for _ in range(ROUNDS):
        for name, (task, factor) in tasks.items():
            seconds[name].append(timed(task) * factor)
    ours = statistics.median(seconds["ring_sections, all rings"])
    for name, values in seconds.items():
        median, factor = statistics.median(values), tasks[name][1]
        how = "" if factor == 1 else f", extrapolated from {len(some)} rings of {rings}"
        print(f"{name}: {median:.2f} s, ratio {median / ours:.0f}{how}")
    if not crop:
        print("open3d crop: left out, open3d is not installed")


def sections(xyz, edges):
    """The work that is measured."""
    return ring_sections(xyz, edges, Axis(0.0, 0.0, RADIUS_M))


def masks(xyz, edges, some):
    """The points of each ring by a mask over all points."""
    z = xyz[:, 2]
    return [xyz[(z >= edges[i]) & (z < edges[i + 1])] for i in some]


def open3d_crop(xyz, edges, some):
    """A function that crops the rings out of a cloud, None where open3d is not installed."""
    try:
        import open3d
    except ImportError:
        return None
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(xyz))
    wide = 2 * RADIUS_M

    def crop():
        for i in some:
            box = open3d.geometry.AxisAlignedBoundingBox(
                np.array([-wide, -wide, edges[i]]), np.array([wide, wide, edges[i + 1]])
            )
            cloud.crop(box)

    return crop


def timed(task):
    """Seconds of one call."""
    start = time.perf_counter()
    task()
    return time.perf_counter() - start


if __name__ == "__main__":
    sizes = [int(value) for value in sys.argv[1:3]]
    points, rings = sizes + [10_000_000, 950][len(sizes) :]
    task = sys.argv[3] if len(sys.argv) > 3 else None
    if task is None:
        main(points, rings)
    elif task == "compare":
        compare(points, rings)
    else:
        alone(points, rings, np.dtype(task))
