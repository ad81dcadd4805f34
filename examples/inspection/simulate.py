"""Levellings of the foot and the bottom of a tank of 13 m: simulated, with their truth.

The tank was built with waves of up to some millimetres and has settled since: uniformly, tilted,
and out of the plane in two and three waves. Its bottom falls to the shell, bends down at its edge
on two radial lines, and bulges on a third. Run it to write the two tables and truth.json again:

    python simulate.py
"""

import csv
import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEED = 13
RADIUS_M, POINTS, FOOT_M = 6.5, 16, 10.25
LEVEL_SD_MM, EDGE_SD_MM = 0.7, 1.0
BUILT_MM = {2: (1.5, 40.0), 3: (1.2, 100.0), 5: (0.8, 10.0)}  # waves: amplitude, azimuth of a top
SETTLED_MM = {0: (-18.0, 0.0), 1: (30.0, 235.0), 2: (6.0, 70.0), 3: (1.0, 30.0)}
SLOPE = -0.008  # of the bottom, towards the shell
EDGES = {  # azimuth: break-over radius in m, slope of the edge
    20.0: (5.90, -0.020),
    110.0: (5.60, -0.060),
    200.0: None,
    290.0: None,
}
BULGE = (200.0, 3.2, 0.7, 28.0)  # azimuth, radius of its middle in m, half its length, height in mm


def waves(azimuth_deg, of):
    """Sum of waves, mm, at azimuths."""
    t = np.asarray(azimuth_deg)
    return sum(a * np.cos(np.radians(k * (t - top))) for k, (a, top) in of.items())


def bottom(azimuth, radius_m):
    """True elevations of the bottom along a radial line, m."""
    z = FOOT_M + 0.03 + SLOPE * (radius_m - RADIUS_M)
    if EDGES[azimuth] is not None:
        at, slope = EDGES[azimuth]
        z = z + (slope - SLOPE) * np.clip(radius_m - at, 0, None)
    if azimuth == BULGE[0]:
        _, middle, half, height = BULGE
        z = z + height / 1000 * np.clip(1 - ((radius_m - middle) / half) ** 2, 0, None)
    return z


def write(name, heading, rows):
    """A table as CSV."""
    with open(HERE / name, "w", newline="", encoding="utf-8") as file:
        written = csv.writer(file, lineterminator="\n")
        written.writerow(heading)
        written.writerows(rows)


def main():
    """Write settlement.csv, edge_profiles.csv and truth.json."""
    rng = np.random.default_rng(SEED)
    azimuth = 360 / POINTS * np.arange(POINTS)
    built = waves(azimuth, BUILT_MM)
    rows = []
    for epoch, z in (("2019-03-11", built), ("2026-05-04", built + waves(azimuth, SETTLED_MM))):
        read = FOOT_M + (z + rng.normal(0, LEVEL_SD_MM, POINTS)) / 1000
        rows += [
            (f"F{i + 1}", f"{azimuth[i]:g}", f"{read[i]:.4f}", LEVEL_SD_MM, epoch)
            for i in range(POINTS)
        ]
    write("settlement.csv", ("point", "azimuth_deg", "elevation_m", "s_mm", "epoch"), rows)
    radius = np.append(np.arange(0.5, 5.0, 0.25), np.arange(5.0, RADIUS_M + 0.01, 0.15))
    rows = []
    for line in EDGES:
        z = bottom(line, radius) + rng.normal(0, EDGE_SD_MM / 1000, len(radius))
        rows += [
            (f"{line:g}", f"{r:.2f}", f"{one:.4f}", EDGE_SD_MM)
            for r, one in zip(radius, z, strict=True)
        ]
    write("edge_profiles.csv", ("azimuth_deg", "radius_m", "z_m", "s_mm"), rows)
    fine = np.arange(0, 360, 0.01)
    bent = {k: (k * k * a, top) for k, (a, top) in SETTLED_MM.items() if k > 1}
    truth = {
        "seed": SEED,
        "settled_waves_mm_deg": SETTLED_MM,
        "curvature_of_settlement_per_m": float(
            np.abs(waves(fine, bent)).max() / 1000 / RADIUS_M**2
        ),
        "drop_of_edge_mm": {
            line: -1000 * one[1] * (RADIUS_M - one[0]) for line, one in EDGES.items() if one
        },
        "bulge_height_mm": BULGE[3],
        "bulge_half_length_m": BULGE[2],
    }
    (HERE / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
