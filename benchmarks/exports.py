"""Time of the best rows for an export: 20 to 1000 of 2 400, 12 000 and 25 000 rows.

    python benchmarks/exports.py

A lying tank, a sphere and an upright tank with head and deadwood (the closed forms of the tests).
The goal: under 1 s each, once the loops are compiled.
"""

import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import numpy as np
from exported_records import lying, rows, sphere, tank_s1

from tankcal.exports.breakpoints import best_breakpoints

TANKS = {
    "lying, 2 401 rows": (lying, 2.4, 0.001),
    "lying, 25 001 rows": (lying, 2.4, 0.000096),
    "sphere, 12 001 rows": (sphere, 12.0, 0.001),
    "upright, 8 401 rows": (tank_s1, 8.4, 0.001),
    "upright, 25 001 rows": (tank_s1, 8.4, 0.000336),
}
POINTS = (10, 20, 50, 100, 1000)
ROUNDS = 3


def main():
    """Print a row for each tank: for each number of points seconds and the error in litres."""
    best_breakpoints(*rows(lying, 2.4, 0.001), 20)  # compiles
    print(f"{'tank':<24}" + "".join(f"{f'K = {points}':>20}" for points in POINTS))
    for name, tank in TANKS.items():
        height, volume = rows(*tank)
        cells = []
        for points in POINTS:
            seconds = []
            for _ in range(ROUNDS):
                start = time.process_time()
                found = best_breakpoints(height, volume, points, written=np.round(volume, 6))
                seconds.append(time.process_time() - start)
            cells.append(f"{min(seconds):.2f} s, {1000 * found.error:.4g} L")
        print(f"{name:<24}" + "".join(f"{cell:>20}" for cell in cells))


if __name__ == "__main__":
    main()
