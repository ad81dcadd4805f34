"""Simulated surveys by points of the wall: read by a total station, or already adjusted.

The total station reads without a reflector, in the tank off its middle. Adjusted points have a
common scale and offset error.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.products.intercomparison.site import finish, observe_site
from tankcal.units import FULL_TURN

# Standard uncertainties of scale, offset and incidence bias; standard deviation of a distance.
U_SCALE, U_OFFSET_M, U_BIAS_M, HIT_SD_M, ARCSEC = 10e-6, 5e-4, 1e-3, 1.2e-3, 1 / 206265
HIT_SD_RAD = 5 * ARCSEC  # standard deviation of an angle
PARTS, COUNTS = (0.2, 0.8), (20, 24, 30)  # levels as shares of a course, points per level
TOOL_HEIGHT_M, OFF_PART = 1.6, 0.15  # height, and largest offset from the middle over the radius
TARGETS, TIMES = 3, ("2026-05-04T09:00", "2026-05-04T10:15")  # number and times of control targets
SPOILT, LADDER_M = 0.01, (0.06, 0.15)  # share of points on a ladder, and its distance
MOST_HITS = 2400  # largest number of points
ADJUSTED_U_SCALE, ADJUSTED_U_OFFSET_M = 15e-6, 3e-4  # standard uncertainties of scale and offset
FRAME_M = (512.0, 347.0, 21.0)  # foot of the axis in the coordinate system of the survey
ADJUSTED_PARTS = {
    2: (0.2, 0.8),
    3: (0.15, 0.5, 0.85),
}  # levels as shares of a course, by number of rings
ADJUSTED_SPOILT, FAR_M = 0.005, (0.015, 0.04)  # share and size of gross errors
PIPE_POINTS, PIPE_M = 4, (0.07, 0.12)  # number of points on a fitting, and distance from the wall


def observe_hits(tank, chance, asked):
    """Simulate one set-up with two levels of each course.

    The ground mark of the set-up is the origin, and its horizontal circle defines the axes.
    """
    rng = chance.rng
    offset = OFF_PART * tank.radius_m * rng.uniform(-1, 1, 2)
    mark = np.array([*offset, float(tank.floor.height_m(*offset, tank.radius_m))])
    site = observe_site(tank, chance, asked, outside=False, frame_m=-np.round(mark, 3))
    height = float(np.round(TOOL_HEIGHT_M + 0.05 * rng.normal(), 3))
    station = np.array([0.0, 0.0, height])
    tool = Tool(
        chance.normal(U_SCALE), chance.normal(U_OFFSET_M), chance.normal(U_BIAS_M),
        HIT_SD_M, HIT_SD_RAD,
    )  # fmt: skip
    course, aims = _aims(rng, site)
    readings = read_wall(chance, site, station, aims, tool)
    spoilt = chance.blunders(len(readings), SPOILT)
    readings[spoilt, 2] -= rng.uniform(*LADDER_M, len(spoilt))
    parts = site.parts
    parts.tables["wall_hits"] = [["setup", "course", "direction_deg", "zenith_deg", "distance_m",
                                  "time"]]  # fmt: skip
    parts.tables["wall_hits"] += [
        ["I", str(number + 1), *_angles(reading), round(float(reading[2]), 5), TIMES[0]]
        for number, reading in zip(course, readings, strict=True)
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
    """Course indices and aimed points, equally spaced from a random azimuth at each level."""
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
    """Rows of readings to three targets on the wall, before and after the wall points."""
    rows = [["setup", "target", "direction_deg", "zenith_deg", "distance_m", "time"]]
    tank, chance = site.tank, site.chance
    azimuth = FULL_TURN * (np.arange(TARGETS) + 0.2) / TARGETS
    places = site.places(azimuth, np.full(TARGETS, min(1.5, 0.4 * tank.height_m)), -0.002)
    target_tool = Tool(tool.scale, tool.offset_m, 0.0, 0.5e-3, 3 * ARCSEC)
    for time in TIMES:
        for k, reading in enumerate(read_targets(chance, station, places, target_tool)):
            rows.append(["I", f"K{k + 1}", *_angles(reading), round(float(reading[2]), 5), time])
    return rows


def _angles(reading):
    """Direction and zenith angle of a reading in degrees."""
    return [round(float(angle), 6) for angle in np.degrees(reading[:2])]


@dataclass(frozen=True)
class Tool:
    """Errors of an instrument.

    Attributes
    ----------
    scale, offset_m : float
        Scale error and offset of distances.
    bias_m : float
        Additional distance to the wall at 60 degrees of incidence, compared with 0 degrees.
    sd_m, sd_rad : float
        Standard deviations of distances and angles.
    """

    scale: float = 0.0
    offset_m: float = 0.0
    bias_m: float = 0.0
    sd_m: float = 0.0
    sd_rad: float = 0.0


def angles_of(away, zero=0.0):
    """Directions (n,), clockwise from `zero`, and zenith angles (n,) of vectors (n, 3), rad."""
    direction = np.arctan2(away[:, 0], away[:, 1]) - zero
    return direction % (2 * np.pi), np.arctan2(np.hypot(away[:, 0], away[:, 1]), away[:, 2])


def rays_of(direction, zenith):
    """Unit vectors (n, 3) of directions, clockwise from +y, and zenith angles, rad."""
    level = np.sin(zenith)
    return np.column_stack([level * np.sin(direction), level * np.cos(direction), np.cos(zenith)])


def read_targets(chance, station, targets, tool, zero=0.0):
    """Simulate direction, zenith angle and distance (n, 3) to targets.

    Parameters
    ----------
    chance : Chance
        Random errors.
    station : ndarray, shape (3,)
        Place of the instrument.
    targets : array_like, shape (n, 3)
        Places of the targets.
    tool : Tool
        Errors of the instrument.
    zero : float
        Azimuth of the zero of the horizontal circle, rad.
    """
    vectors = np.asarray(targets, float) - station
    direction, zenith = angles_of(vectors, zero)
    length = np.linalg.norm(vectors, axis=1) * (1 + tool.scale) + tool.offset_m
    readings = np.column_stack([direction, zenith, length])
    return readings + chance.normal(1.0, readings.shape) * [tool.sd_rad, tool.sd_rad, tool.sd_m]


def incidence(tank, places, rays):
    """Cosines (n,) of the incidence of rays (n, 3) on the wall at places (n, 3).

    The places are those of the tank at the reference temperature.
    """
    radial_vector = places[:, :2] - tank.axis_m(places[:, 2])
    normal = np.column_stack([radial_vector, -(radial_vector @ tank.lean)])
    return np.abs(np.sum(normal * rays, axis=1)) / np.linalg.norm(normal, axis=1)


def read_wall(chance, site, station, aims, tool, zero=0.0):
    """Simulate direction, zenith angle and distance (n, 3) to the expanded wall from inside.

    Parameters
    ----------
    chance : Chance
        Random errors.
    site : Site
        Tank during the survey.
    station : array_like, shape (3,)
        Place of the instrument in the coordinate system of the survey.
    aims : array_like, shape (n, 3)
        Points on the lines of sight, in the same system.
    tool : Tool
        Errors of the instrument.
    zero : float
        Azimuth of the zero of the horizontal circle, rad.
    """
    tank, f = site.tank, site.expansion_factor
    vectors = np.asarray(aims, float) - station
    rays = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    origin = (np.asarray(station, float) - site.frame_m) / f
    cool = tank.ranges_m(origin, rays)
    cosine = incidence(tank, origin + cool[:, None] * rays, rays)
    direction, zenith = angles_of(vectors, zero)
    length = f * cool * (1 + tool.scale) + tool.offset_m + tool.bias_m * (1 / cosine - 1)
    readings = np.column_stack([direction, zenith, length])
    return readings + chance.normal(1.0, readings.shape) * [tool.sd_rad, tool.sd_rad, tool.sd_m]


def observe_points(tank, chance, asked):
    """Simulate rings of points in each course, from inside or outside."""
    rng = chance.rng
    site = observe_site(tank, chance, asked, outside=rng.uniform() < 0.5, frame_m=FRAME_M)
    azimuth, z, names = _layout(rng, tank)
    sd = rng.uniform(0.7e-3, 1.5e-3)
    scale, offset = chance.normal(ADJUSTED_U_SCALE), chance.normal(ADJUSTED_U_OFFSET_M)
    offsets = np.full(len(z), float(offset))
    spoilt = chance.blunders(len(z), ADJUSTED_SPOILT)
    offsets[spoilt] += rng.choice([-1, 1], len(spoilt)) * rng.uniform(*FAR_M, len(spoilt))
    if chance.size:
        pipe = rng.integers(len(z), size=PIPE_POINTS)
        offsets[pipe] = (1 if site.outside else -1) * rng.uniform(*PIPE_M, PIPE_POINTS)
    observed = site.places(azimuth, z, offsets)
    observed = (
        site.frame_m + (1 + scale) * (observed - site.frame_m) + chance.normal(sd, observed.shape)
    )
    declared_sd = chance.declared(1000 * sd)
    rows = [["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"]]
    rows += [
        [name, *np.round(point, 5).tolist(), declared_sd, declared_sd, declared_sd]
        for name, point in zip(names, observed, strict=True)
    ]
    site.parts.tables["points"] = rows
    site.add_input("scale", 1e6 * ADJUSTED_U_SCALE, "ppm", "certificate of the instrument")
    site.add_input("offset", 1000 * ADJUSTED_U_OFFSET_M, "mm", "reflectorless ranging, certificate")
    return finish(site)


def _layout(rng, tank):
    """Azimuths, heights and names of rings of nearly equally spaced points."""
    count, rings = int(rng.choice([24, 32, 40])), int(rng.choice([2, 3]))
    azimuth, z, names = [], [], []
    for course, (low, high) in enumerate(zip(tank.joints_m[:-1], tank.joints_m[1:], strict=True)):
        for ring, part in enumerate(ADJUSTED_PARTS[rings]):
            turn = FULL_TURN * (np.arange(count) + rng.uniform() + 0.2 * rng.uniform(-1, 1, count))
            azimuth.append(turn / count)
            z.append(low + (high - low) * (part + 0.03 * rng.uniform(-1, 1, count)))
            names += [f"C{course + 1}R{ring + 1}P{k + 1}" for k in range(count)]
    return np.concatenate(azimuth), np.concatenate(z), names
