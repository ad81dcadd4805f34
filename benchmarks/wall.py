"""Processor time and memory from points to the table's volumes, by number of points.

    python benchmarks/wall.py

Ten courses of 2 m, R 7.5 m, oval, bulging, with one seam and noise of 2 mm; points anywhere on the
wall. Each size runs in a process of its own with one BLAS thread, and the sizes take turns. Beside
the seconds stands their ratio to those of the Cholesky factor of a matrix of 1600, the largest
that the field of a wall takes. The goals: 1200 points in 0.5 s, 50 000 in 5 s and 1 GB. A third of
the time of 1200 points is the likelihood of the sizes of the wall's components, an eighth factors
of its covariance.
"""

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from measured import ROUNDS, Row, tell

SIZES = (384, 1200, 50_000)
JOB = """[tank]
id = "BENCH"
kind = "vertical"
nominal_diameter_m = 15.0
nominal_height_m = 20.0
[survey]
side = "inside"
date = "2026-01-01"
[datum]
bottom_z_m = 0.0
[table]
step_m = 0.01
reference_temperature_c = 15
"""


def main():
    """A row for each size."""
    found = {size: [] for size in SIZES}
    for _ in range(ROUNDS):
        for size in SIZES:
            run = [sys.executable, __file__, str(size)]
            env = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
            out = subprocess.run(run, check=True, capture_output=True, text=True, env=env).stdout
            found[size].append([float(one) for one in out.split()])
    for size, rows in found.items():
        told, fitted, table, unit, megabytes = map(statistics.median, zip(*rows, strict=True))
        whole = tuple(sum(row[:3]) for row in rows)
        note = (
            f"told from clutter {told:.2f} s, field {fitted:.2f} s, volumes with u {table:.2f} s; "
            f"{statistics.median(whole) / unit:.0f} Cholesky factors of 1600"
        )
        tell(Row("points to volumes", f"{size} points", whole, memory_mb=megabytes, note=note))


def once(size):
    """Seconds of the three steps and of the factor, and megabytes, on one line."""
    import numpy as np
    import scipy.linalg

    import tankcal
    from tankcal.geometry.shell import find_shell
    from tankcal.pipeline.tanks import body_of
    from tankcal.pipeline.wall.finding import fit_wall

    rng = np.random.default_rng(1)
    azimuth, z = rng.uniform(0, 2 * np.pi, size), rng.uniform(0.01, 19.99, size)
    seam = np.exp(-np.abs(7.5 * np.angle(np.exp(1j * (azimuth - 2)))) / 0.4)
    radius = 7.5 + 0.004 * np.cos(2 * azimuth) + 0.003 * (1 - (z % 2 - 1) ** 2) - 0.01 * seam
    radius += rng.normal(0, 0.002, size)
    xyz = np.column_stack([radius * np.sin(azimuth), radius * np.cos(azimuth), z])
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "job.toml").write_text(JOB)
        courses = "\n".join(f"{one},2.0,0" for one in range(1, 11))
        Path(folder, "courses.csv").write_text(f"course,height_m,thickness_mm\n{courses}\n")
        rows = "\n".join(f"P{i},{x:.5f},{y:.5f},{h:.5f}" for i, (x, y, h) in enumerate(xyz))
        Path(folder, "points.csv").write_text(f"point,x_m,y_m,z_m\n{rows}\n")
        job = tankcal.load(folder)
    times = [time.process_time()]
    shell = find_shell(job.points.xyz_m, np.arange(0.0, 21.0, 2.0), 7.5)
    times.append(time.process_time())
    wall = fit_wall(job, shell)
    times.append(time.process_time())
    body_of(job, wall).rows(np.linspace(0.0, 19.9, 2000))
    times.append(time.process_time())
    matrix = np.eye(1600) + 0.1 * np.exp(-np.abs(np.subtract.outer(*2 * [np.arange(1600.0)])) / 100)
    scipy.linalg.cholesky(matrix)
    start = time.process_time()
    scipy.linalg.cholesky(matrix)
    unit = time.process_time() - start
    print(*np.diff(times), unit, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


if __name__ == "__main__":
    once(int(sys.argv[1])) if len(sys.argv) > 1 else main()
