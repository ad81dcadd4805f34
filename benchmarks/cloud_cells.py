"""Processor time and peak memory of the cells of a wall, from points in memory.

    python benchmarks/cloud_cells.py [millions of points] [scans]

The points are those of a round tank of 7.5 m by 10 m, made anew for each piece, in the order of a
scanner: one turn after the other.
"""

import resource
import sys
import time

import numpy as np
from measured import Row, tell

from tankcal.clouds.wall import find_cloud_wall, readings_of

RADIUS_M, HEIGHT_M, PIECE = 7.5, 10.0, 1 << 20


def passes_of(millions, scans, spent):
    """Passes over points that are made on the way; their making is not counted."""

    def passes():
        count = int(millions * 1e6)
        for start in range(0, count, PIECE):
            before = time.process_time()
            rng = np.random.default_rng(start)
            size = min(PIECE, count - start)
            turn = 2 * np.pi * np.arange(size) / (1 << 14)
            z = HEIGHT_M * (start + np.arange(size)) / count
            r = RADIUS_M + rng.normal(0, 0.002, size) + 0.01 * np.cos(2 * turn)
            xyz = np.column_stack([r * np.sin(turn), r * np.cos(turn), z])
            spent[0] += time.process_time() - before
            yield start // PIECE % scans, xyz

    return passes


def main():
    """Rows of one run."""
    millions = float(sys.argv[1]) if len(sys.argv) > 1 else 10
    scans = int(sys.argv[2]) if len(sys.argv) > 2 else 4
    spent = [0.0]
    before = time.process_time()
    wall = find_cloud_wall(
        passes_of(millions, scans, spent),
        radius_m=RADIUS_M,
        joints_m=np.linspace(0, HEIGHT_M, 6),
    )
    found = time.process_time()
    readings = readings_of(wall)
    read = time.process_time() - found
    cells = f"{wall.grid.rows} x {wall.grid.columns} cells"
    size = f"{millions:g} million points, {scans} scans, {cells}"
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    tell(Row("cells of a wall", size, (found - before - spent[0],), memory_mb=memory))
    tell(Row("readings of the cells", f"{len(readings.scan)} readings", (read,)))


if __name__ == "__main__":
    main()
