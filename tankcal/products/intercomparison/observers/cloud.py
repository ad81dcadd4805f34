"""Simulated survey by two scans from inside, registered by targets of a total station."""

import struct

import numpy as np

from tankcal.products.intercomparison.observers.total_station import (
    Tool,
    incidence,
    rays_of,
    read_targets,
)
from tankcal.products.intercomparison.site import finish, observe_site
from tankcal.units import FULL_TURN

# Standard uncertainties of the scanner: offset, scale, and bias at 60 degrees of incidence.
U_OFFSET_M, U_SCALE, U_BIAS_M = 1e-3, 10e-6, 1e-3
NOISE_M = (0.8e-3, 2.0e-3)  # smallest and largest standard deviation of a range
TARGET_SD_M, TARGETS = 6e-4, 6  # standard deviation of a scanned target, number of targets
TOOL = {"u_scale_ppm": 5.0, "u_offset_mm": 0.3}  # standard uncertainties of the total station
TOOL_SD_RAD, TOOL_SD_M = 2 / 206265, 5e-4  # standard deviations of the total station
# Largest tilt of the scanner about each axis; lowest and highest elevation of its rays.
LEVELLED_RAD, LOWEST_RAD, HIGHEST_RAD = 0.01, np.radians(-40), np.radians(72)
SPOILT, FAR_M = 0.002, 0.4  # share of stray points, and their largest distance before the wall
LAS_STEP_M = 1e-4  # resolution of coordinates in LAS files


def observe_cloud(tank, chance, asked, points=200_000):
    """Simulate two scans with together `points` points; roof columns hide parts of the wall.

    Parameters
    ----------
    tank : Tank
        The true tank.
    chance : Chance
        Random errors.
    asked : Asked
        Requested conditions of the capacity table.
    points : int
        Number of rays of both scans.

    Returns
    -------
    Parts
    """
    rng = chance.rng
    site = observe_site(tank, chance, asked, outside=False)
    scale, offset = chance.normal(U_SCALE), chance.normal(U_OFFSET_M)
    bias = chance.normal(U_BIAS_M)
    noise = float(rng.uniform(*NOISE_M))
    targets = _targets(rng, site)
    rows = [["scan", "target", "x_m", "y_m", "z_m", "s_mm"]]
    parts, clouds = site.parts, {}
    reach = 1.02 * tank.radius_m * site.expansion_factor
    low = -0.3
    for name, place in zip("AB", _stands(rng, tank), strict=True):
        rotation = _rotation(rng)
        rays, ranges = _scan(chance, site, place, rotation, points // 2, bias, noise)
        ranges = ranges * (1 + scale) + offset
        parts.files[f"scans/{name.lower()}.las"] = las_bytes(ranges[:, None] * rays)
        for target, position in targets.items():
            observed = (position - place) @ rotation + chance.normal(TARGET_SD_M, 3)
            rows.append([name, target, *np.round(observed, 5).tolist(), 1000 * TARGET_SD_M])
        clouds[name] = {
            "file": f"scans/{name.lower()}.las",
            "unit": "m",
            "scanner": "scanner 1",
            "u_offset_mm": 1000 * U_OFFSET_M,
            "u_scale_ppm": 1e6 * U_SCALE,
            "u_incidence_mm": 1000 * U_BIAS_M,
            "certificate": "simulated",
            "leave_out": [[-reach, -reach, low, reach, reach, 0.05]],
        }
    parts.registers["clouds"] = clouds
    parts.tables["scan_targets"] = rows
    _read_network(site, targets)
    return finish(site)


def _stands(rng, tank):
    """Yield two places of the scanner, on opposite sides of the middle."""
    azimuth = rng.uniform(0, FULL_TURN)
    distances = tank.radius_m * rng.uniform(0.2, 0.35, 2)
    for turn, distance in ((azimuth, distances[0]), (azimuth + np.pi + 0.5, distances[1])):
        yield np.array([distance * np.sin(turn), distance * np.cos(turn), rng.uniform(1.4, 1.7)])


def _targets(rng, site):
    """Places of targets in the tank, {name: place}, at different heights and azimuths."""
    tank = site.tank
    places = {}
    for k in range(TARGETS):
        azimuth = FULL_TURN * (k + 0.3 * rng.uniform(-1, 1)) / TARGETS
        distance = tank.radius_m * rng.uniform(0.75, 0.9)
        z = rng.uniform(0.3, 1.0) if k % 2 else rng.uniform(0.5, 0.8) * tank.height_m
        places[f"T{k + 1}"] = np.array([distance * np.sin(azimuth), distance * np.cos(azimuth), z])
    return places


def _read_network(site, targets):
    """Add a set-up of a total station, whose station and mark are control points."""
    chance, rng = site.chance, site.chance.rng
    station, mark = np.array([0.1, 0.15, 1.5]), np.array([0.3 * site.tank.radius_m, -0.1, 0.9])
    tool = Tool(
        chance.normal(1e-6 * TOOL["u_scale_ppm"]), chance.normal(1e-3 * TOOL["u_offset_mm"]),
        0.0, TOOL_SD_M, TOOL_SD_RAD,
    )  # fmt: skip
    zero = float(rng.uniform(0, FULL_TURN))
    sighted = {**targets, "R1": mark}
    readings = read_targets(chance, station, np.array(list(sighted.values())), tool, zero)
    tables = site.parts.tables
    tables["directions"] = [["setup", "to", "direction_deg", "s_arcsec"]]
    tables["zenith_angles"] = [["setup", "to", "zenith_deg", "s_arcsec"]]
    tables["slope_distances"] = [["setup", "to", "distance_m", "s_mm"]]
    for name, (direction, zenith, length) in zip(sighted, readings.tolist(), strict=True):
        tables["directions"].append(["1", name, round(float(np.degrees(direction)), 6), 2.0])
        tables["zenith_angles"].append(["1", name, round(float(np.degrees(zenith)), 6), 2.0])
        tables["slope_distances"].append(["1", name, round(length, 5), 1000 * TOOL_SD_M])
    tables["setups"] = [
        ["setup", "station", "instrument", "instrument_height_m"],
        ["1", "S1", "TS-1", 0.0],
    ]
    held = [
        [name, *map(float, position), 0.0, 0.0, 0.0]
        for name, position in (("S1", station), ("R1", mark))
    ]
    tables["control"] = [["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"], *held]
    site.parts.registers["instruments"] = {
        "TS-1": {"kind": "total_station", "certificate": "simulated", **TOOL}
    }


def _rotation(rng):
    """Random rotation (3, 3) from the scanner's to the tank's coordinates, with a small tilt."""
    a, b = LEVELLED_RAD * rng.uniform(-1, 1, 2)
    c = rng.uniform(0, FULL_TURN)
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    about_z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def _scan(chance, site, place, rotation, count, bias, noise):
    """Unit rays (n, 3) in the scanner's coordinates and noisy ranges (n,) of the returns, m."""
    rng, tank, f = chance.rng, site.tank, site.expansion_factor
    lines = int(np.sqrt(count * (HIGHEST_RAD - LOWEST_RAD) / FULL_TURN))
    columns = count // lines
    rise, turn = np.meshgrid(
        np.linspace(LOWEST_RAD, HIGHEST_RAD, lines), FULL_TURN * np.arange(columns) / columns
    )
    scanner_rays = rays_of(turn.ravel(), np.pi / 2 - rise.ravel())
    origin, rays = place / f, scanner_rays @ rotation.T
    cool = tank.ranges_m(origin, rays)
    is_hit = np.isfinite(cool)
    cosine = np.ones(len(scanner_rays))
    cosine[is_hit] = incidence(tank, origin + cool[is_hit, None] * rays[is_hit], rays[is_hit])
    ranges = f * cool + bias * (1 / np.maximum(cosine, 0.1) - 1)
    for fitting in tank.fittings:
        if fitting.width_m > 0:
            ranges = np.minimum(ranges, f * _column_ranges_m(fitting, origin, rays))
    ranges = np.minimum(ranges, f * _floor_ranges_m(tank, origin, rays))
    ranges += chance.normal(noise, len(scanner_rays))
    spoilt = chance.blunders(len(scanner_rays), SPOILT)
    ranges[spoilt] -= rng.uniform(0, FAR_M, len(spoilt))
    is_return = np.isfinite(ranges)
    return scanner_rays[is_return], ranges[is_return]


def _column_ranges_m(column, origin, rays):
    """Distances along rays to an upright round column, m; inf for rays that miss it."""
    x, y = origin[0] - column.x_m, origin[1] - column.y_m
    a = rays[:, 0] ** 2 + rays[:, 1] ** 2
    b = rays[:, 0] * x + rays[:, 1] * y
    root = b**2 - a * (x**2 + y**2 - column.width_m**2 / 4)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (-b - np.sqrt(np.maximum(root, 0))) / a
    z = origin[2] + t * rays[:, 2]
    return np.where((root > 0) & (t > 0) & (z < column.high_m), t, np.inf)


def _floor_ranges_m(tank, origin, rays):
    """Distances along rays to the bottom, m; inf for rays that miss it."""
    down = rays[:, 2] < -1e-3
    t = np.full(len(rays), np.inf)
    direction = rays[down]
    length = origin[2] / -direction[:, 2]
    # The bottom is nearly level, so that a vertical correction converges.
    for _ in range(20):
        points = origin + length[:, None] * direction
        height = points[:, 2] - tank.floor.height_m(points[:, 0], points[:, 1], tank.radius_m)
        length = length + height / -direction[:, 2]
    t[down] = length
    return t


def las_bytes(xyz):
    """Bytes of a LAS 1.2 file, point format 0, with coordinates (n, 3) in steps of 0.1 mm."""
    steps = np.round(xyz / LAS_STEP_M).astype("<i4")
    low, high = steps.min(axis=0) * LAS_STEP_M, steps.max(axis=0) * LAS_STEP_M
    bounds = [bound for pair in zip(high, low, strict=True) for bound in map(float, pair)]
    head = struct.pack(
        "<4sHHIHH8sBB32s32sHHHIIBHI5I3d3d6d",
        *(b"LASF", 0, 0, 0, 0, 0, b"\0" * 8, 1, 2),
        *(b"simulated", b"tankcal intercomparison", 124, 2026, 227, 227, 0, 0, 20),
        *(len(xyz), len(xyz), 0, 0, 0, 0),
        *(LAS_STEP_M,) * 3,
        *(0.0,) * 3,
        *bounds,
    )
    rows = np.zeros(
        len(xyz),
        dtype=[("xyz", "<i4", 3), ("intensity", "<u2"), ("rest", "u1", 4), ("source", "<u2")],
    )
    rows["xyz"] = steps
    rows["rest"][:, 0] = 0b00001001  # the first of one return
    return head + rows.tobytes()
