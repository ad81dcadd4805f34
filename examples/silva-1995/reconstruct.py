"""Rebuild the points of Silva's tank (1995, table 11) that the dissertation does not print.

Printed are the centre, radius and area of five sections and the magnitude of the residual of each
of 24 generatrices. The points are rebuilt so that the least-squares circles come back: the signs of
the residuals are such that they are free of a mean and of a shift of the centre, what is left is
taken from the magnitudes within their rounding, and the radius is taken from the area, which is
printed with more digits. Run it to write points.csv again, or to search for such signs:

    python reconstruct.py
    python reconstruct.py --search

Many sets of signs do. The search is seeded, but the last digit of a sum may send it elsewhere on
another processor, so the signs that it found once stand here.
"""

import csv
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEED = 1995
SECTION_HEIGHTS_M = (0.95, 2.85, 4.75, 6.65, 8.55)  # invented: the middle of five equal courses
BOTTOM_Z_M = 10.000  # invented
FIRST_AZIMUTH_DEG = -7.5  # invented, so that the printed sds of section 3 come back
COORDINATE_SD_MM = 14.142  # published: coordinate variance 2.0e-4 m2
HEADINGS = "point x_m y_m z_m sx_mm sy_mm sz_mm section generatrix"
ROUNDING_M = 0.0005  # residuals are printed to a millimetre
SIGNS = (  # of the residuals of each section, generatrix by generatrix; not surveyed: a blank
    "-+--++-+++++++---+-+++++",
    "---+--+--++--++---++-++-",
    "++--++++-++-+++-+-+-+-+ ",
    "+--+-+-++++---++-++++-+-",
    "+---+-+-++-+--+--++-+++-",
)


def main():
    """Write points.csv beside this script."""
    lines = []
    for number, (circle, generatrices, azimuth, size) in enumerate(sections(), 1):
        kept = SIGNS[number - 1].replace(" ", "")
        sign = np.array([1.0 if one == "+" else -1.0 for one in kept])
        radius = np.sqrt(float(circle["area_m2"]) / np.pi) + signed_residuals(sign * size, azimuth)
        x = float(circle["x_m"]) + radius * np.sin(azimuth)
        y = float(circle["y_m"]) + radius * np.cos(azimuth)
        z = BOTTOM_Z_M + SECTION_HEIGHTS_M[number - 1]
        for generatrix, px, py in zip(generatrices, x, y, strict=True):
            place = [f"{number}-{generatrix:02d}", f"{px:.5f}", f"{py:.5f}", f"{z:.5f}"]
            lines.append([*place, *[COORDINATE_SD_MM] * 3, number, generatrix])
    with open(HERE / "points.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADINGS.split())
        writer.writerows(lines)


def search():
    """Print signs that do, section by section."""
    rng = np.random.default_rng(SEED)
    for _, _, azimuth, size in sections():
        sign = search_signs(size, azimuth, rng)
        signed_residuals(sign * size, azimuth)
        print("".join("-+"[int(one > 0)] for one in sign))


def sections():
    """Of each section its printed circle, generatrices, their azimuths and sizes of residuals."""
    residuals = _rows("published/table11_residuals.csv")
    for number, circle in enumerate(_rows("published/table11_circles.csv"), 1):
        seen = [row for row in residuals if row[f"s{number}_m"]]
        generatrices = [int(row["generatrix"]) for row in seen]
        azimuth = np.radians([15 * (one - 1) + FIRST_AZIMUTH_DEG for one in generatrices])
        yield circle, generatrices, azimuth, np.array([float(row[f"s{number}_m"]) for row in seen])


def _design(azimuth):
    return np.column_stack([np.ones_like(azimuth), np.cos(azimuth), np.sin(azimuth)])


def signed_residuals(rough, azimuth):
    """Residuals near the signed sizes that neither change the radius nor move the centre."""
    design = _design(azimuth)
    residual = rough - design @ np.linalg.lstsq(design, rough, rcond=None)[0]
    if np.abs(residual - rough).max() > ROUNDING_M:
        raise SystemExit("these signs do not do within the rounding of the table: change the seed")
    return residual


def search_signs(size, azimuth, rng):
    """Signs with the least change of the circle, by simulated annealing."""
    design, n = _design(azimuth), len(size)
    sign = rng.choice([-1.0, 1.0], size=n)

    def cost(sign):
        return np.sum((design.T @ (sign * size)) ** 2)

    best, best_cost = sign.copy(), cost(sign)
    now = best_cost
    for temperature in np.geomspace(1e-3, 1e-10, 40_000):
        trial = sign.copy()
        trial[rng.integers(n, size=rng.integers(1, 3))] *= -1
        then = cost(trial)
        if then < now or rng.random() < np.exp((now - then) / temperature):
            sign, now = trial, then
            if now < best_cost:
                best, best_cost = sign.copy(), now
    return best


def _rows(name):
    with open(HERE / name, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


if __name__ == "__main__":
    search() if "--search" in sys.argv[1:] else main()
