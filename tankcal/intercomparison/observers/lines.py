"""Offsets from plumb lines round the tank; the first course is strapped."""

import numpy as np

from tankcal.intercomparison.defects import FULL_TURN
from tankcal.intercomparison.observers.tape import strap
from tankcal.intercomparison.site import finish, observe_site

FEWEST, ARC_M, PARTS = 8, 3.5, (0.2, 0.8)  # lines: one for so much of the circumference
COLLIMATION_RAD, STANDS_M = 6 / 206265, 0.3  # of the plummet; its height above the foot
READ_M = 5e-4
REPEATS = 3  # of the straps
CLOSE_M, MOST_STEPS = 1e-9, 60


def observe_lines(tank, chance, asked):
    """One plummet on lines evenly round the tank, read on both faces at two levels of a course."""
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
    feet = tank.places_m(azimuth, np.full(count, reference), outside=True)[:, :2] * site.grown
    outwards = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
    lines = feet + stands[:, None] * outwards  # warm places of the plumb lines
    for course, (low, height) in enumerate(zip(tank.joints_m[:-1], tank.courses_m, strict=True)):
        for part in PARTS:
            z = low + part * height
            true = offsets_m(site, lines, outwards, z)
            for face, sign in ((1, 1), (2, -1)):
                leans = sign * kappa * (z - STANDS_M)
                read = true + leans + chance.normal(READ_M, count)
                level = round(float(site.level(z)), 4)
                is_reference = "true" if course == 0 and part == PARTS[0] else ""
                rows += [
                    [
                        name,
                        str(course + 1),
                        level,
                        round(1000 * one, 3),
                        read_sd,
                        face,
                        is_reference,
                    ]
                    for name, one in zip(names, read.tolist(), strict=True)
                ]
    parts = site.parts
    angles = np.degrees(azimuth).round(6).tolist()
    parts.tables["lines"] = [["line", "azimuth_deg", "side"]]
    parts.tables["lines"] += [[name, at, "outside"] for name, at in zip(names, angles, strict=True)]
    parts.tables["offsets"] = rows
    parts.registers["instruments"]["ZL-1"] = {"kind": "plummet", "certificate": "simulated"}
    parts.settings["shell.shape_sd_mm"] = chance.declared(1000 * _form_m(tank), 1)
    return finish(site)


def offsets_m(site, lines, inwards_from, z):
    """(n,) horizontal distances from plumb lines to the warm wall at a height of the cool tank."""
    tank, f = site.tank, site.grown
    found = np.full(len(lines), 0.2)
    for _ in range(MOST_STEPS):
        there = (lines - found[:, None] * inwards_from) / f
        beyond = tank.beyond_m(np.column_stack([there, np.full(len(lines), z)]), outside=True)
        found += f * beyond
        if np.abs(beyond).max() < CLOSE_M:
            break
    return found


def _form_m(tank):
    azimuth = FULL_TURN * np.arange(2048) / 2048
    return float(np.std(tank.radii_m(azimuth, tank.courses_m[0] / 2)))
