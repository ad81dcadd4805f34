"""Tanks drawn by lot: families of shells as they are built and as they age.

    tank = draw_tank(rng, "T01", "brick")

coil    one to three seams up the whole shell, 5 to 30 mm, and a wall that is oval
brick   plates in brick pattern: peaking at vertical welds, banding at girth welds
dented  dents, and plates that were never rolled at their ends
leaning a shell that leans by 3 to 6 mm/m and whose ovality grows to the top, as settlement makes it
buckled one or two buckles of 15 to 50 mm, courses drawn in
round   nearly round: only steps between courses, and what rolling leaves

Every family has steps of the radius from course to course, a bulge between welds and waves round
the shell. Sizes are those of tolerances of API 650 (radius 13 to 25 mm, peaking and banding 13 mm,
plumb 1/200) or below; those of buckles and lean are beyond it, as old tanks have them.
"""

from itertools import pairwise

import numpy as np

from tankcal.intercomparison.defects import (
    FULL_TURN,
    Band,
    Buckle,
    Course,
    Dent,
    Flat,
    Oval,
    Seam,
)
from tankcal.intercomparison.tank import Fitting, Floor, Tank, Wave

FAMILIES = ("brick", "coil", "dented", "leaning", "buckled", "round")
WIDTHS_M = (4.0, 10.0)  # radii
STEEL_E_PA, STEEL_E_SD = 206e9, 2e9
STEEL_EXPANSION, STEEL_EXPANSION_SD = 1.15e-5, 0.04e-5


def draw_tank(rng, name, family):
    """A Tank of a family."""
    radius = round(float(rng.uniform(*WIDTHS_M)), 2)
    courses = _courses(rng, radius)
    joints = np.concatenate([[0.0], np.cumsum(courses)])
    height = float(joints[-1])
    defects = [*_of_courses(rng, joints), *_waves(rng, height, family)]
    defects += _MAKERS[family](rng, radius, joints)
    slope = rng.uniform(3e-3, 6e-3) if family == "leaning" else abs(rng.normal(0, 1.2e-3))
    towards = rng.uniform(0, FULL_TURN)
    needed = 0.0045 * radius / 7 * (1 - joints[:-1] / height) + 0.005  # of a storage tank's plates
    plates = np.round(needed, 3) * (1 + 0.01 * rng.normal(size=len(needed)))
    plate_z = float(rng.uniform(0.02, 0.08))
    floor = _floor(rng, radius)
    return Tank(
        name=name,
        family=family,
        radius_m=radius,
        courses_m=tuple(map(float, courses)),
        plates_m=tuple(map(float, plates)),
        paint_m=float(rng.uniform(2e-4, 4e-4)),
        defects=tuple(defects),
        lean=(float(slope * np.sin(towards)), float(slope * np.cos(towards))),
        floor=floor,
        fittings=_fittings(rng, radius, height, plate_z),
        plate_z_m=plate_z,
        e_pa=float(STEEL_E_PA + STEEL_E_SD * rng.normal()),
        expansion_per_k=float(STEEL_EXPANSION + STEEL_EXPANSION_SD * rng.normal()),
    )


def _courses(rng, radius):
    """Heights of courses, all about alike, off the drawing by a millimetre or two."""
    count = int(rng.integers(4, 7))
    one = rng.choice([1.5, 1.8, 2.0])
    return one + 1.5e-3 * rng.normal(size=count)


def _of_courses(rng, joints):
    """Step, taper and bulge of each course: the bulge of one sign in all of them."""
    bulge, bell = rng.uniform(1e-3, 6e-3), rng.uniform()
    return [
        Course(
            float(low),
            float(high),
            step_m=float(1.5e-3 * rng.normal()),
            taper_m=float(1e-3 * rng.normal()),
            bulge_m=float(bulge * (1 + 0.2 * rng.normal())),
            bell=float(bell),
        )
        for low, high in pairwise(joints)
    ]


def _waves(rng, height, family):
    typical = {"coil": 3e-3, "leaning": 3e-3, "round": 0.5e-3}.get(family, 1.5e-3)
    grows = 3.0 if family == "leaning" else 1.0
    found = []
    for k in range(2, 10):
        size = typical * np.exp(0.5 * rng.normal()) * k**-0.5
        top = size * grows * np.exp(0.2 * rng.normal())
        turn = 0.4 * rng.normal()
        place = rng.uniform(0, FULL_TURN)
        found.append(Oval(0.0, height, k, *map(float, (size, top, place, turn))))
    return found


def _brick(rng, radius, joints):
    plates = max(3, round(FULL_TURN * radius / rng.uniform(6, 10)))
    peak, flank = rng.choice([-1, 1]) * rng.uniform(2e-3, 10e-3), rng.uniform(0.1, 0.3)
    start = rng.uniform(0, FULL_TURN)
    found = []
    for course, (low, high) in enumerate(pairwise(joints)):
        for plate in range(plates):
            at = start + FULL_TURN * (plate + 0.5 * (course % 2) + 0.03 * rng.normal()) / plates
            size = peak * (1 + 0.3 * rng.normal())
            found.append(Seam(*map(float, (low, high, at % FULL_TURN, size, flank, 0.3))))
    reach = rng.uniform(0.1, 0.25)
    for z in joints[1:-1]:
        size = -rng.uniform(1e-3, 7e-3)
        found.append(Band(0.0, float(joints[-1]), *map(float, (z, size, reach))))
    return found


def _coil(rng, radius, joints):
    found = []
    for _ in range(int(rng.integers(1, 4))):
        size = rng.choice([-1, -1, 1]) * rng.uniform(5e-3, 30e-3)
        at, flank = rng.uniform(0, FULL_TURN), rng.uniform(0.08, 0.25)
        found.append(Seam(0.0, float(joints[-1]), *map(float, (at, size, flank, 0.0))))
    return found


def _dented(rng, radius, joints):
    found = []
    for _ in range(int(rng.integers(3, 8))):
        size = rng.choice([-1, -1, -1, 1]) * rng.uniform(5e-3, 25e-3)
        half, middle = rng.uniform(0.25, 0.9), rng.uniform(0.5, joints[-1] - 0.5)
        low, high = max(middle - half, 0.0), min(middle + half, joints[-1])
        at, width = rng.uniform(0, FULL_TURN), rng.uniform(0.25, 1.2)
        found.append(Dent(*map(float, (low, high, at, size, width))))
    for _ in range(int(rng.integers(2, 6))):
        course = int(rng.integers(len(joints) - 1))
        at, half = rng.uniform(0, FULL_TURN), rng.uniform(0.25, 0.55)
        found.append(Flat(*map(float, (joints[course], joints[course + 1], at, half, 0.3))))
    return found


def _buckled(rng, radius, joints):
    found = []
    for _ in range(int(rng.integers(1, 3))):
        course = int(rng.integers(len(joints) - 1))
        at, size = rng.uniform(0, FULL_TURN), -rng.uniform(15e-3, 50e-3)
        half, folds = rng.uniform(0.6, 1.5), rng.choice([0.0, 1.5])
        low, high = joints[course : course + 2]
        found.append(Buckle(*map(float, (low, high, at, size, half, folds))))
    for z in joints[1:-1]:
        size = -rng.uniform(0.5e-3, 4e-3)
        found.append(Band(0.0, float(joints[-1]), *map(float, (z, size, 0.3))))
    return found


def _nothing(rng, radius, joints):
    return []


_MAKERS = {
    "brick": _brick,
    "coil": _coil,
    "dented": _dented,
    "leaning": _nothing,
    "buckled": _buckled,
    "round": _nothing,
}


def _floor(rng, radius):
    """A cone down by 0.5 to 1.5 % of the radius, or up, uneven by a quarter of that at most."""
    depth = float(rng.choice([1, 1, 1, -1]) * rng.uniform(0.005, 0.015) * radius)
    waves = []
    for _ in range(4):
        length, towards = rng.uniform(2.5, 6.0), rng.uniform(0, FULL_TURN)
        k = FULL_TURN / length
        size = rng.uniform(0.02, 0.06) * abs(depth)
        runs = k * np.sin(towards), k * np.cos(towards)
        waves.append(Wave(float(size), *map(float, runs), float(rng.uniform(0, FULL_TURN))))
    return Floor(depth, tuple(waves))


def _fittings(rng, radius, height, plate_z):
    """A roof column or two, a heating coil above the dip plate, a manhole."""
    found = []
    for number in range(int(rng.integers(0, 3))):
        wide = float(rng.choice([0.168, 0.219]))
        away, at = radius * rng.uniform(0.35, 0.6), rng.uniform(0, FULL_TURN)
        place = float(away * np.sin(at)), float(away * np.cos(at))
        volume = -float(np.pi / 4 * wide**2 * height)
        found.append(Fitting(f"column {number + 1}", 0.0, height, volume, *place, wide))
    if rng.uniform() < 0.5:
        low = plate_z + float(rng.uniform(0.15, 0.25))
        found.append(Fitting("heating coil", low, low + 0.15, -float(rng.uniform(0.1, 0.4))))
    low = plate_z + float(rng.uniform(0.4, 0.6))
    found.append(Fitting("manhole", low, low + 0.6, float(rng.uniform(0.05, 0.12))))
    return tuple(found)
