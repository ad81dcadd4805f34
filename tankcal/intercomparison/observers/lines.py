"""Simulated survey by the optical reference line method, with strapping of the first course."""

import numpy as np

from tankcal.intercomparison.observers.tape import strap
from tankcal.intercomparison.site import finish, observe_site
from tankcal.units import FULL_TURN

# Least number of lines, largest arc between them, and levels as shares of a course.
FEWEST, ARC_M, PARTS = 8, 3.5, (0.2, 0.8)
COLLIMATION_RAD, STANDS_M = 6 / 206265, 0.3  # collimation error of the plummet, height above foot
READ_M = 5e-4  # standard deviation of an offset
REPEATS = 3  # number of circumference measurements at a level
CLOSE_M, MOST_STEPS = 1e-9, 60  # last step and number of iterations of `offsets_m`


def observe_lines(tank, chance, asked):
    """Simulate offsets from equally spaced lines, on both faces at two levels of each course.

    Parameters
    ----------
    tank : Tank
        The true tank.
    chance : Chance
        Random errors.
    asked : Asked
        Requested conditions of the capacity table.

    Returns
    -------
    Parts
    """
    rng = chance.rng
    site = observe_site(tank, chance, asked, outside=True)
    strap(site, [0], REPEATS)
    count = max(FEWEST, 4 * int(np.ceil(FULL_TURN * tank.radius_m / ARC_M / 4)))
    names = [f"L{k + 1}" for k in range(count)]
    azimuth = FULL_TURN * np.arange(count) / count
    stands = rng.uniform(0.15, 0.25, count)
    kappa, read_sd = chance.normal(COLLIMATION_RAD), chance.declared(1000 * READ_M)
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
                readings = offsets + tilt_errors + chance.normal(READ_M, count)
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
