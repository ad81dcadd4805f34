"""Random tanks from families of typical new and aged shells.

    tank = draw_tank(rng, "T01", "brick")

coil    one to three seams over the full height, 5 to 30 mm, and an oval wall
brick   plates in brick pattern: peaking at vertical welds, banding at horizontal welds
dented  dents, and plates that were not rolled at their ends
leaning a tilt of 3 to 6 mm/m, and an ovality that grows to the top as after settlement
buckled one or two buckles of 15 to 50 mm, and contracted horizontal welds
round   nearly round: only steps between courses, and small waves from rolling

Every family has steps of the radius between courses, bulges between welds and waves round the
shell. The sizes do not exceed the tolerances of API 650 (radius 13 to 25 mm, peaking and banding
13 mm, plumbness 1/200), except those of buckles and tilt, which are typical of old tanks.
"""

from itertools import pairwise

import numpy as np

from tankcal.intercomparison.defects import (
    Band,
    Buckle,
    Course,
    Dent,
    Flat,
    Oval,
    Seam,
)
from tankcal.intercomparison.tank import Fitting, Floor, Tank, Wave
from tankcal.units import FULL_TURN

FAMILIES = ("brick", "coil", "dented", "leaning", "buckled", "round")
WIDTHS_M = (4.0, 10.0)  # smallest and largest radius
STEEL_E_PA, STEEL_E_SD = 206e9, 2e9  # Young's modulus, mean and standard deviation
# Coefficient of thermal expansion, 1/K, mean and standard deviation.
STEEL_EXPANSION, STEEL_EXPANSION_SD = 1.15e-5, 0.04e-5


def draw_tank(rng, name, family):
    """Draw a random tank.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of random numbers.
    name : str
        Name of the tank.
    family : str
        One of FAMILIES.

    Returns
    -------
    Tank
    """
    radius = round(float(rng.uniform(*WIDTHS_M)), 2)
    courses = _courses(rng, radius)
    joints = np.concatenate([[0.0], np.cumsum(courses)])
    height = float(joints[-1])
    defects = [*_course_forms(rng, joints), *_waves(rng, height, family)]
    defects += _DEFECTS_BY_FAMILY[family](rng, radius, joints)
    slope = rng.uniform(3e-3, 6e-3) if family == "leaning" else abs(rng.normal(0, 1.2e-3))
    tilt_azimuth = rng.uniform(0, FULL_TURN)
    thickness = 0.0045 * radius / 7 * (1 - joints[:-1] / height) + 0.005  # typical of storage tanks
    plates = np.round(thickness, 3) * (1 + 0.01 * rng.normal(size=len(thickness)))
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
        lean=(float(slope * np.sin(tilt_azimuth)), float(slope * np.cos(tilt_azimuth))),
        floor=floor,
        fittings=_fittings(rng, radius, height, plate_z),
        plate_z_m=plate_z,
        e_pa=float(STEEL_E_PA + STEEL_E_SD * rng.normal()),
        expansion_per_k=float(STEEL_EXPANSION + STEEL_EXPANSION_SD * rng.normal()),
    )


def _courses(rng, radius):
    """Heights of courses, equal but for deviations of 1.5 mm (standard deviation), m."""
    count = int(rng.integers(4, 7))
    nominal = rng.choice([1.5, 1.8, 2.0])
    return nominal + 1.5e-3 * rng.normal(size=count)


def _course_forms(rng, joints):
    """Step, taper and bulge of each course; the bulges of all courses have the same mean."""
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
    """Waves 2 to 9 round the shell, whose size decreases with their number."""
    typical = {"coil": 3e-3, "leaning": 3e-3, "round": 0.5e-3}.get(family, 1.5e-3)
    growth = 3.0 if family == "leaning" else 1.0
    waves = []
    for k in range(2, 10):
        size = typical * np.exp(0.5 * rng.normal()) * k**-0.5
        top = size * growth * np.exp(0.2 * rng.normal())
        turn = 0.4 * rng.normal()
        phase = rng.uniform(0, FULL_TURN)
        waves.append(Oval(0.0, height, k, *map(float, (size, top, phase, turn))))
    return waves


def _draw_bricks(rng, radius, joints):
    """Vertical welds in brick pattern, and horizontal welds."""
    plates = max(3, round(FULL_TURN * radius / rng.uniform(6, 10)))
    peak, flank = rng.choice([-1, 1]) * rng.uniform(2e-3, 10e-3), rng.uniform(0.1, 0.3)
    start = rng.uniform(0, FULL_TURN)
    defects = []
    for course, (low, high) in enumerate(pairwise(joints)):
        for plate in range(plates):
            azimuth = (
                start + FULL_TURN * (plate + 0.5 * (course % 2) + 0.03 * rng.normal()) / plates
            )
            size = peak * (1 + 0.3 * rng.normal())
            defects.append(Seam(*map(float, (low, high, azimuth % FULL_TURN, size, flank, 0.3))))
    reach = rng.uniform(0.1, 0.25)
    for z in joints[1:-1]:
        size = -rng.uniform(1e-3, 7e-3)
        defects.append(Band(0.0, float(joints[-1]), *map(float, (z, size, reach))))
    return defects


def _draw_coil_seams(rng, radius, joints):
    """One to three seams over the full height."""
    defects = []
    for _ in range(int(rng.integers(1, 4))):
        size = rng.choice([-1, -1, 1]) * rng.uniform(5e-3, 30e-3)
        azimuth, flank = rng.uniform(0, FULL_TURN), rng.uniform(0.08, 0.25)
        defects.append(Seam(0.0, float(joints[-1]), *map(float, (azimuth, size, flank, 0.0))))
    return defects


def _draw_dents(rng, radius, joints):
    """Three to seven dents or bumps, and two to five flat places."""
    defects = []
    for _ in range(int(rng.integers(3, 8))):
        size = rng.choice([-1, -1, -1, 1]) * rng.uniform(5e-3, 25e-3)
        half, middle = rng.uniform(0.25, 0.9), rng.uniform(0.5, joints[-1] - 0.5)
        low, high = max(middle - half, 0.0), min(middle + half, joints[-1])
        azimuth, width = rng.uniform(0, FULL_TURN), rng.uniform(0.25, 1.2)
        defects.append(Dent(*map(float, (low, high, azimuth, size, width))))
    for _ in range(int(rng.integers(2, 6))):
        course = int(rng.integers(len(joints) - 1))
        azimuth, half = rng.uniform(0, FULL_TURN), rng.uniform(0.25, 0.55)
        defects.append(Flat(*map(float, (joints[course], joints[course + 1], azimuth, half, 0.3))))
    return defects


def _draw_buckles(rng, radius, joints):
    """One or two buckles, and horizontal welds."""
    defects = []
    for _ in range(int(rng.integers(1, 3))):
        course = int(rng.integers(len(joints) - 1))
        azimuth, size = rng.uniform(0, FULL_TURN), -rng.uniform(15e-3, 50e-3)
        half, folds = rng.uniform(0.6, 1.5), rng.choice([0.0, 1.5])
        low, high = joints[course : course + 2]
        defects.append(Buckle(*map(float, (low, high, azimuth, size, half, folds))))
    for z in joints[1:-1]:
        size = -rng.uniform(0.5e-3, 4e-3)
        defects.append(Band(0.0, float(joints[-1]), *map(float, (z, size, 0.3))))
    return defects


def _no_defects(rng, radius, joints):
    """No further defects."""
    return []


_DEFECTS_BY_FAMILY = {
    "brick": _draw_bricks,
    "coil": _draw_coil_seams,
    "dented": _draw_dents,
    "leaning": _no_defects,
    "buckled": _draw_buckles,
    "round": _no_defects,
}


def _floor(rng, radius):
    """Bottom: a cone down or up by 0.5 to 1.5 % of the radius, with four small waves."""
    depth = float(rng.choice([1, 1, 1, -1]) * rng.uniform(0.005, 0.015) * radius)
    waves = []
    for _ in range(4):
        length, direction = rng.uniform(2.5, 6.0), rng.uniform(0, FULL_TURN)
        k = FULL_TURN / length
        size = rng.uniform(0.02, 0.06) * abs(depth)
        wave_numbers = k * np.sin(direction), k * np.cos(direction)
        waves.append(Wave(float(size), *map(float, wave_numbers), float(rng.uniform(0, FULL_TURN))))
    return Floor(depth, tuple(waves))


def _fittings(rng, radius, height, plate_z):
    """Up to two roof columns, possibly a heating coil above the dip plate, and a manhole."""
    fittings = []
    for number in range(int(rng.integers(0, 3))):
        width = float(rng.choice([0.168, 0.219]))
        distance, azimuth = radius * rng.uniform(0.35, 0.6), rng.uniform(0, FULL_TURN)
        place = float(distance * np.sin(azimuth)), float(distance * np.cos(azimuth))
        volume = -float(np.pi / 4 * width**2 * height)
        fittings.append(Fitting(f"column {number + 1}", 0.0, height, volume, *place, width))
    if rng.uniform() < 0.5:
        low = plate_z + float(rng.uniform(0.15, 0.25))
        fittings.append(Fitting("heating coil", low, low + 0.15, -float(rng.uniform(0.1, 0.4))))
    low = plate_z + float(rng.uniform(0.4, 0.6))
    fittings.append(Fitting("manhole", low, low + 0.6, float(rng.uniform(0.05, 0.12))))
    return tuple(fittings)
