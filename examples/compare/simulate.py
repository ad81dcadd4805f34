"""The table of another laboratory for the tank of ../strapping: simulated, with its truth.

The courses are half a millimetre smaller than the strapping of 2026 finds them, its tape being
another one; the table is for 15 degrees, without head, and its zero lies 2 mm lower.
Volumes are areas times heights, rounded to litres. Run it to write former.csv and truth.json again:

    python simulate.py
"""

import csv
import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEED = 3
RADII_M = np.array([7.20304, 7.20302, 7.20327, 7.20341, 7.20301])  # of 2026, empty, at 20 degrees
TAPE_M, OWN_SD_M = -0.0005, 0.00015  # of the radii of 2018: common, and of each course
HEIGHTS_M = np.array([1.8, 1.8, 1.8, 1.5, 1.5])
ZERO_M = 0.002  # of the former table below the new one
EXPANSION, TABLE_C, NEW_C = 1.1e-5, 15.0, 20.0
FIRST_CM, LAST_CM = 10, 840


def held(level_m, radii_m):
    """What courses hold below a level above the bottom, m3."""
    feet = np.concatenate([[0.0], np.cumsum(HEIGHTS_M)[:-1]])
    wet = np.clip(level_m - feet, 0.0, HEIGHTS_M)
    return float(np.sum(np.pi * radii_m**2 * wet))


def main():
    """Write former.csv and truth.json."""
    rng = np.random.default_rng(SEED)
    radii_m = RADII_M + TAPE_M + OWN_SD_M * rng.normal(size=len(RADII_M))
    warm = (1 + EXPANSION * (TABLE_C - NEW_C)) ** 2
    with open(HERE / "former.csv", "w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["dip_cm", "volume_m3"])
        for dip_cm in range(FIRST_CM, LAST_CM + 1):
            volume = warm * held(dip_cm / 100 - ZERO_M, radii_m)
            rows.writerow([dip_cm, f"{volume:.3f}"])
    truth = {
        "seed": SEED,
        "radii_at_20_c_m": [round(float(one), 6) for one in radii_m],
        "zero_below_the_new_one_m": ZERO_M,
        "temperature_c": TABLE_C,
        "liquid_density_kg_m3": 0.0,
    }
    (HERE / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
