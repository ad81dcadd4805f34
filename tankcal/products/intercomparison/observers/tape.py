"""Simulated strapping of every course, or of the first course with optical reference lines.

The tape follows the convex hull of the outside.
"""

import numpy as np
from scipy.spatial import ConvexHull

from tankcal.products.intercomparison.site import finish, observe_site
from tankcal.units import FULL_TURN

LEVELS, REPEATS = (0.2, 0.8), 2  # levels as shares of a course, measurements at a level
# Tape: u of its scale, thermal expansion, 1/K, certified temperature and tension.
U_SCALE, TAPE_EXPANSION, TAPE_C, TAPE_N = 12e-6, 1.15e-5, 20.0, 50.0
# Tape: thickness, cross-section, Young's modulus, and standard deviations of laying and reading.
THICK_M, SECTION_MM2, TAPE_E_GPA, LAYING_M, READ_M = 2e-4, 2.5, 206.0, 3e-4, 4e-4
PULL_SD_N = 3.0  # standard deviation of the mean tension round the tank from the reading
LONGEST_STEP_M = 0.004  # largest distance between points of the hull
# Least number of lines, largest arc between them, and levels as shares of a course.
FEWEST, ARC_M, PARTS = 8, 3.5, (0.2, 0.8)
COLLIMATION_RAD, STANDS_M = 6 / 206265, 0.3  # collimation error of the plummet, height above foot
OFFSET_READ_M = 5e-4  # standard deviation of an offset
FIRST_COURSE_REPEATS = 3  # number of circumference measurements at a level
CLOSE_M, MOST_STEPS = 1e-9, 60  # last step and number of iterations of `offsets_m`


def girth_m(tank, z):
    """Perimeter of the convex hull of the outside at a height, m, at the reference temperature.

    The difference of length between polygon and curve is corrected as for a circle.
    """
    count = int(FULL_TURN * tank.radius_m / LONGEST_STEP_M)
    azimuth = FULL_TURN * (np.arange(count) + 0.5) / count
    places = tank.places_m(azimuth, np.full(count, float(z)), outside=True)[:, :2]
    half = np.pi / count
    return float(ConvexHull(places - places.mean(axis=0)).area * half / np.sin(half))


def observe_tape(tank, chance, asked):
    """Simulate two circumferences at each of two levels of each course."""
    site = observe_site(tank, chance, asked, outside=True)
    strap(site, range(len(tank.courses_m)))
    # Standard deviation of the radius round the wall, root mean square over the courses, m.
    azimuth = FULL_TURN * np.arange(2048) / 2048
    middles = (tank.joints_m[:-1] + tank.joints_m[1:]) / 2
    form = float(np.sqrt(np.mean([np.var(tank.radii_m(azimuth, z)) for z in middles])))
    site.parts.settings["shell.shape_sd_mm"] = chance.declared(1000 * form, 1)
    return finish(site)


def strap(site, courses, repeats=REPEATS):
    """Add simulated circumferences and the tape to the files of a site.

    Parameters
    ----------
    site : Site
        Tank during the survey.
    courses : iterable of int
        Indices of the courses.
    repeats : int
        Number of measurements at a level.
    """
    tank, chance, parts = site.tank, site.chance, site.parts
    scale, read_sd = chance.normal(U_SCALE), chance.declared(1000 * READ_M)
    stiff_n = SECTION_MM2 * 1e-6 * TAPE_E_GPA * 1e9
    rows = [["circumference", "course", "level_m", "reading_m", "s_mm", "tension_n"]]
    for course in courses:
        for part in LEVELS:
            z = tank.joints_m[course] + part * tank.courses_m[course]
            true = site.expansion_factor * girth_m(tank, z) + np.pi * THICK_M
            for _ in range(repeats):
                pull = float(np.round(chance.rng.uniform(45, 60)))
                # True length of a nominal metre: scale, temperature and tension of the tape.
                unit = (1 + scale) * (1 + TAPE_EXPANSION * (site.shell_c - TAPE_C))
                unit *= 1 + (pull + chance.normal(PULL_SD_N) - TAPE_N) / stiff_n
                error = chance.normal(LAYING_M) + chance.normal(READ_M)
                reading = round(float(true / unit + error), 5)
                level = round(float(site.level(z)), 4)
                name = f"{course + 1}-{round(100 * part)}"
                rows.append([name, str(course + 1), level, reading, read_sd, pull])
    parts.tables["circumferences"] = rows
    parts.registers.setdefault("instruments", {})["T-1"] = {
        "kind": "tape",
        "certificate": "simulated",
        "certified_temperature_c": TAPE_C,
        "tension_n": TAPE_N,
        "expansion_per_k": TAPE_EXPANSION,
        "thickness_mm": 1000 * THICK_M,
        "section_mm2": SECTION_MM2,
        "e_gpa": TAPE_E_GPA,
        "u_scale_ppm": 1e6 * U_SCALE,
        "laying_mm": 1000 * LAYING_M,
    }


def observe_lines(tank, chance, asked):
    """Simulate offsets from equally spaced lines, on both faces at two levels of each course."""
    rng = chance.rng
    site = observe_site(tank, chance, asked, outside=True)
    strap(site, [0], FIRST_COURSE_REPEATS)
    count = max(FEWEST, 4 * int(np.ceil(FULL_TURN * tank.radius_m / ARC_M / 4)))
    names = [f"L{k + 1}" for k in range(count)]
    azimuth = FULL_TURN * np.arange(count) / count
    stands = rng.uniform(0.15, 0.25, count)
    kappa, read_sd = chance.normal(COLLIMATION_RAD), chance.declared(1000 * OFFSET_READ_M)
    rows = [["line", "course", "level_m", "offset_mm", "s_mm", "face", "reference"]]
    reference = PARTS[0] * tank.courses_m[0]
    feet = (
        tank.places_m(azimuth, np.full(count, reference), outside=True)[:, :2]
        * site.expansion_factor
    )
    outwards = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
    lines = feet + stands[:, None] * outwards  # places at the temperature of the shell
    for course, (low, height) in enumerate(zip(tank.joints_m[:-1], tank.courses_m, strict=True)):
        for part in PARTS:
            z = low + part * height
            offsets = offsets_m(site, lines, outwards, z)
            for face, sign in ((1, 1), (2, -1)):
                tilt_errors = sign * kappa * (z - STANDS_M)
                readings = offsets + tilt_errors + chance.normal(OFFSET_READ_M, count)
                level = round(float(site.level(z)), 4)
                is_reference = "true" if course == 0 and part == PARTS[0] else ""
                rows += [
                    [
                        name,
                        str(course + 1),
                        level,
                        round(1000 * offset, 3),
                        read_sd,
                        face,
                        is_reference,
                    ]
                    for name, offset in zip(names, readings.tolist(), strict=True)
                ]
    parts = site.parts
    angles = np.degrees(azimuth).round(6).tolist()
    parts.tables["lines"] = [["line", "azimuth_deg", "side"]]
    parts.tables["lines"] += [
        [name, azimuth_deg, "outside"] for name, azimuth_deg in zip(names, angles, strict=True)
    ]
    parts.tables["offsets"] = rows
    parts.registers["instruments"]["ZL-1"] = {"kind": "plummet", "certificate": "simulated"}
    parts.settings["shell.shape_sd_mm"] = chance.declared(1000 * _shape_sd_of_course_m(tank), 1)
    return finish(site)


def offsets_m(site, lines, inwards_from, z):
    """Horizontal distances (n,) from vertical lines to the expanded wall, m.

    Parameters
    ----------
    site : Site
        Tank during the survey.
    lines : ndarray, shape (n, 2)
        Places of the lines.
    inwards_from : ndarray, shape (n, 2)
        Unit vectors outwards.
    z : float
        Height at the reference temperature.
    """
    tank, f = site.tank, site.expansion_factor
    offsets = np.full(len(lines), 0.2)
    for _ in range(MOST_STEPS):
        places = (lines - offsets[:, None] * inwards_from) / f
        beyond = tank.beyond_m(np.column_stack([places, np.full(len(lines), z)]), outside=True)
        offsets += f * beyond
        if np.abs(beyond).max() < CLOSE_M:
            break
    return offsets


def _shape_sd_of_course_m(tank):
    """Standard deviation of the radius round the middle of the first course, m."""
    azimuth = FULL_TURN * np.arange(2048) / 2048
    return float(np.std(tank.radii_m(azimuth, tank.courses_m[0] / 2)))
