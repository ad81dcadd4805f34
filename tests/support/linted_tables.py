"""The 216 tables of the linter's tests: exact volumes of 18 shapes, by 4 steps and 3 roundings."""

from itertools import pairwise

import numpy as np

from tankcal.tank.dips import table_heights

# exact volumes (closed forms) of many shapes, m3, as functions of dips, m


def lying(h, radius=1.2, length=10.0):
    h = np.clip(h, 0, 2 * radius)
    across = np.sqrt(2 * radius * h - h**2)
    return length * (radius**2 * np.arccos(1 - h / radius) - (radius - h) * across)


def ellipsoidal_ends(h, radius=1.2, depth=0.6):
    h = np.clip(h, 0, 2 * radius)
    return lying(h, radius) + np.pi * depth * h**2 * (1 - h / (3 * radius))


def courses(h, radii, joints):
    edges = [0.0, *joints, 100.0]
    return sum(
        np.pi * r**2 * (np.clip(h, low, high) - low)
        for r, (low, high) in zip(radii, pairwise(edges), strict=True)
    )


def cone_bottom(h, radius=6.5, depth=0.15):
    below = np.pi * (radius * np.minimum(h, depth) / depth) ** 2 * np.minimum(h, depth) / 3
    return below + np.pi * radius**2 * np.maximum(h - depth, 0)


def dished_bottom(h, radius=6.5, depth=0.15):
    sphere = (radius**2 + depth**2) / (2 * depth)
    low = np.minimum(h, depth)
    return np.pi * low**2 * (sphere - low / 3) + np.pi * radius**2 * np.maximum(h - depth, 0)


def liquid_head(h, radius=20.0, plates=(0.012, 0.010, 0.008, 0.006, 0.006), course=1.9):
    """Integral of pi (r + c (h - z) / t)^2 over the courses, c = rho g r^2 / E."""
    total, bottom = np.zeros_like(h), 0.0
    for plate in plates:
        c = 1000 * 9.80665 * radius**2 / (206e9 * plate)
        low, high = np.maximum(h - bottom - course, 0), np.maximum(h - bottom, 0)
        grown = radius**2 * (high - low) + radius * c * (high**2 - low**2)
        total += np.pi * (grown + c**2 * (high**3 - low**3) / 3)
        bottom += course
    return total


def barrels(h, radius=20.0, course=1.9, bulge=0.004, steps=(0, 0.004, 0.010, 0.012, 0.020)):
    """Courses with r = R + d + 4 b t (1 - t), t the part of the course: the exact polynomial."""
    total = np.zeros_like(h)
    for k, step in enumerate(steps):
        t = np.clip((h - k * course) / course, 0, 1)
        r, b = radius + step, 4 * bulge
        square = r**2 * t + r * b * (t**2 - 2 * t**3 / 3) + b**2 * (t**3 / 3 - t**4 / 2 + t**5 / 5)
        total += np.pi * course * square
    return total


def with_deadwood(h):
    total = np.pi * 6.5**2 * h
    for low, high, volume in ((0.3, 0.9, -0.2), (2.0, 2.5, -0.05), (0, 9.5, -0.3), (0.55, 1, 0.1)):
        total = total + volume * np.clip((h - low) / (high - low), 0, 1)
    return total


FIVE = (6.48, 6.4815, 6.483, 6.479, 6.4835)
WIDE = (30, 30.004, 30.02, 30.015, 30.03)
SHAPES = {
    "cylinder": (lambda h: np.pi * 6.478**2 * h, 9.5),
    "five courses": (lambda h: courses(h, FIVE, (1.9, 3.8, 5.7, 7.6)), 9.49996),
    "wide courses": (lambda h: courses(h, WIDE, (2.4, 4.7, 7.01, 9.6)), 11.873),
    "barrels": (barrels, 9.5),
    "liquid head": (liquid_head, 9.5),
    "lying": (lying, 2.4),
    "lying, small": (lambda h: lying(h, 0.4, 1.5), 0.8),
    "lying, long": (lambda h: lying(h, 1.6, 30.0), 3.2),
    "ellipsoidal ends": (ellipsoidal_ends, 2.4),
    "sphere": (lambda h: np.pi * h**2 * (10 - h / 3), 20.0),
    "cone": (cone_bottom, 9.5),
    "steep cone": (lambda h: cone_bottom(h, 1.5, 1.234), 6.0),
    "dish": (dished_bottom, 9.5),
    "deadwood": (with_deadwood, 9.5),
    "roof": (lambda h: with_deadwood(h) - 8 * np.clip((h - 1.6) / 0.25, 0, 1), 9.5),
    "plate below": (lambda h: courses(np.maximum(h - 0.0234, 0), (6.5, 6.504), (5.0,)), 9.5),
    "plate below, lying": (lambda h: lying(h - 0.0234), 2.4234),
    "plate above, lying": (lambda h: lying(h + 0.0234), 2.3766),
}
STEPS = {"mm": 0.001, "cm": 0.01, "dm": 0.1, "eighths": 0.003175}
DECIMALS = (2, 3, 4)  # of cubic metres: 10 L, 1 L, 0.1 L


def rows_of(shape, step, decimals):
    """Rows of a table as text, each rounded once from the exact volume."""
    volume, top = SHAPES[shape]
    heights = table_heights(STEPS[step], top)
    places = {"mm": 3, "cm": 2, "dm": 1, "eighths": 6}[step]
    texts = [f"{h:.{places}f}" for h in heights[:-1]] + [f"{heights[-1]:.6f}"]
    return list(zip(texts, (f"{v:.{decimals}f}" for v in volume(heights)), strict=True))
