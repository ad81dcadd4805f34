"""Time of the best rows for an export: 20 to 1000 of 2 400, 12 000 and 25 000 rows.

    python benchmarks/exports.py

A lying tank, a sphere and an upright tank with head and deadwood (the closed forms of the tests).
The goal: under 1 s each, once the loops are compiled.
"""

import os
import sys
from functools import partial
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import numpy as np
from exported_records import lying, rows, sphere, tank_s1
from measured import Row, interleaved, tell

from tankcal.products.exports.breakpoints import best_breakpoints

TANKS = {
    "lying, 2 401 rows": (lying, 2.4, 0.001),
    "lying, 25 001 rows": (lying, 2.4, 0.000096),
    "sphere, 12 001 rows": (sphere, 12.0, 0.001),
    "upright, 8 401 rows": (tank_s1, 8.4, 0.001),
    "upright, 25 001 rows": (tank_s1, 8.4, 0.000336),
}
POINTS = (20, 100, 1000)


def main():
    """A row for each tank and number of points; its note has the error in litres."""
    best_breakpoints(*rows(lying, 2.4, 0.001), 20)  # compiles
    for name, tank in TANKS.items():
        height, volume = rows(*tank)
        written = np.round(volume, 6)
        for points in POINTS:
            work = partial(best_breakpoints, height, volume, points, written=written)
            error = 1000 * work().error
            (seconds,) = interleaved({name: work}).values()
            tell(Row(f"best {points} rows", name, seconds, note=f"error {error:.4g} L"))


if __name__ == "__main__":
    main()
