"""Make old.csv: the table of a made-up tank, by integrating its shell numerically.

    python simulate.py

Six rings of plates that are flush outside, 0.4 to 1.4 mm from their circle, the head of 830 kg/m3
node by node, a bottom that rises by 60 mm to its centre, a thing in the tank, and a dip plate 18 mm
above the bottom of the shell.
"""

import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
HEIGHTS_M = np.array([2.0, 2.0, 2.0, 1.8, 1.8, 1.8])
PLATES_M = np.array([12.0, 10.0, 9.0, 8.0, 7.0, 7.0]) / 1000
RADII_M = 9.150 - PLATES_M + np.array([0.4, -0.7, 1.1, 1.4, -0.5, 0.8]) / 1000
DENSITY_KG_M3, STEEL_PA, GRAVITY = 830.0, 206e9, 9.80665
ZERO_M, RISE_M = -0.018, 0.060
THING = (3.20, 3.80, -0.140)  # m, m, m3
NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)


def volume_m3(dip):
    """Volume below a dip."""
    total, bottom = 0.0, ZERO_M
    for radius, height, plate in zip(RADII_M, HEIGHTS_M, PLATES_M, strict=True):
        end = min(dip, bottom + height)
        if end > bottom:
            z = bottom + (end - bottom) * (1 + NODES) / 2
            strain = DENSITY_KG_M3 * GRAVITY * (dip - z) * radius / (plate * STEEL_PA)
            total += np.pi * WEIGHTS @ (radius * (1 + strain)) ** 2 * (end - bottom) / 2
        bottom += height
    low, high, thing = THING
    total += thing * np.clip((dip - low) / (high - low), 0, 1)
    part = np.clip((dip - ZERO_M) / RISE_M, 0, 1)
    cone = np.pi * RADII_M[0] ** 2 * RISE_M / 3 * (1 - (1 - part) ** 3)
    return max(total - cone, 0.0)


def main():
    """Write old.csv, courses.csv, truth.json."""
    dips = np.arange(1139) / 100
    rows = [f"{dip:.2f},{1000 * volume_m3(dip):.0f}" for dip in dips]
    (HERE / "old.csv").write_text("\n".join(["dip_m,volume_L", *rows]) + "\n")
    courses = [
        f"{k},{height},{1000 * plate:g}"
        for k, (height, plate) in enumerate(zip(HEIGHTS_M, PLATES_M, strict=True), 1)
    ]
    (HERE / "courses.csv").write_text("\n".join(["course,height_m,thickness_mm", *courses]) + "\n")
    truth = {
        "radii_m": RADII_M.round(7).tolist(),
        "density_kg_m3": DENSITY_KG_M3,
        "zero_m": ZERO_M,
        "thing": THING,
    }
    (HERE / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


if __name__ == "__main__":
    main()
