"""Bare hits of the wall by a total station in the tank, off its middle."""

import numpy as np

from tankcal.intercomparison.defects import FULL_TURN
from tankcal.intercomparison.observers.sighting import Tool, read_targets, read_wall
from tankcal.intercomparison.site import finish, observe_site

U_SCALE, U_OFFSET_M, U_BIAS_M, HIT_SD_M, ARCSEC = 10e-6, 5e-4, 1e-3, 1.2e-3, 1 / 206265
HIT_SD_RAD = 5 * ARCSEC
PARTS, COUNTS = (0.2, 0.8), (20, 24, 30)
TOOL_HEIGHT_M, OFF_PART = 1.6, 0.15  # of the instrument; off the middle, of the radius
TARGETS, TIMES = 3, ("2026-05-04T09:00", "2026-05-04T10:15")
SPOILT, LADDER_M = 0.01, (0.06, 0.15)
MOST_HITS = 2400


def observe_hits(tank, chance, asked):
    """One set-up, two levels of each course; its mark is the origin, its circle gives the axes."""
    rng = chance.rng
    aside = OFF_PART * tank.radius_m * rng.uniform(-1, 1, 2)
    mark = np.array([*aside, float(tank.floor.height_m(*aside, tank.radius_m))])
    site = observe_site(tank, chance, asked, outside=False, frame_m=-np.round(mark, 3))
    height = float(np.round(TOOL_HEIGHT_M + 0.05 * rng.normal(), 3))
    station = np.array([0.0, 0.0, height])
    tool = Tool(
        chance.normal(U_SCALE), chance.normal(U_OFFSET_M), chance.normal(U_BIAS_M),
        HIT_SD_M, HIT_SD_RAD,
    )  # fmt: skip
    course, aims = _aims(rng, site)
    read = read_wall(chance, site, station, aims, tool)
    spoilt = chance.blunders(len(read), SPOILT)
    read[spoilt, 2] -= rng.uniform(*LADDER_M, len(spoilt))
    parts = site.parts
    parts.tables["wall_hits"] = [["setup", "course", "direction_deg", "zenith_deg", "distance_m",
                                  "time"]]  # fmt: skip
    parts.tables["wall_hits"] += [
        ["I", str(number + 1), *_angles(one), round(float(one[2]), 5), TIMES[0]]
        for number, one in zip(course, read, strict=True)
    ]
    parts.tables["control_readings"] = _control(site, station, tool)
    parts.tables["setups"] = [
        ["setup", "station", "instrument", "instrument_height_m"],
        ["I", "SI", "TS-1", height],
    ]
    parts.registers["instruments"] = {
        "TS-1": {
            "kind": "total_station",
            "certificate": "simulated",
            "u_scale_ppm": 1e6 * U_SCALE,
            "u_offset_mm": 1000 * U_OFFSET_M,
            "u_incidence_mm": 1000 * U_BIAS_M,
            "s_mm": chance.declared(1000 * HIT_SD_M),
            "s_arcsec": 5.0,
        }
    }
    return finish(site)


def _aims(rng, site):
    """Number of the course, and places that the sight goes to: evenly round, by lot turned."""
    tank = site.tank
    count = min(int(rng.choice(COUNTS)), MOST_HITS // (2 * len(tank.courses_m)))
    course, azimuth, z = [], [], []
    for k, (low, height) in enumerate(zip(tank.joints_m[:-1], tank.courses_m, strict=True)):
        for part in PARTS:
            azimuth.append(FULL_TURN * (np.arange(count) + rng.uniform()) / count)
            z.append(np.full(count, low + part * height))
            course += [k] * count
    azimuth, z = np.concatenate(azimuth), np.concatenate(z)
    return course, site.places(azimuth, z)


def _control(site, station, tool):
    """Three targets on the wall, read before the hits and after them."""
    rows = [["setup", "target", "direction_deg", "zenith_deg", "distance_m", "time"]]
    tank, chance = site.tank, site.chance
    azimuth = FULL_TURN * (np.arange(TARGETS) + 0.2) / TARGETS
    places = site.places(azimuth, np.full(TARGETS, min(1.5, 0.4 * tank.height_m)), -0.002)
    steady = Tool(tool.scale, tool.offset_m, 0.0, 0.5e-3, 3 * ARCSEC)
    for time in TIMES:
        for k, one in enumerate(read_targets(chance, station, places, steady)):
            rows.append(["I", f"K{k + 1}", *_angles(one), round(float(one[2]), 5), time])
    return rows


def _angles(read):
    return [round(float(one), 6) for one in np.degrees(read[:2])]
