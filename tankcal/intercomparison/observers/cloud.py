"""Two scans from within the tank, placed by targets that a total station has read."""

import struct

import numpy as np

from tankcal.intercomparison.defects import FULL_TURN
from tankcal.intercomparison.observers.sighting import Tool, incidence, rays_of, read_targets
from tankcal.intercomparison.site import finish, observe_site

U_OFFSET_M, U_SCALE, U_BIAS_M = 1e-3, 10e-6, 1e-3
NOISE_M = (0.8e-3, 2.0e-3)  # of a range, by lot
TARGET_SD_M, TARGETS = 6e-4, 6
TOOL = {"u_scale_ppm": 5.0, "u_offset_mm": 0.3}
TOOL_SD_RAD, TOOL_SD_M = 2 / 206265, 5e-4
LEVELLED_RAD, LOWEST_RAD, HIGHEST_RAD = 0.01, np.radians(-40), np.radians(72)
SPOILT, FAR_M = 0.002, 0.4  # share of points that come from nowhere, and how far before the wall
LAS_STEP_M = 1e-4


def observe_cloud(tank, chance, asked, points=200_000):
    """So many points in two scans; columns of the roof stand before the wall."""
    rng = chance.rng
    site = observe_site(tank, chance, asked, outside=False)
    scale, offset = chance.normal(U_SCALE), chance.normal(U_OFFSET_M)
    bias = chance.normal(U_BIAS_M)
    noise = float(rng.uniform(*NOISE_M))
    targets = _targets(rng, site)
    rows = [["scan", "target", "x_m", "y_m", "z_m", "s_mm"]]
    parts, clouds = site.parts, {}
    reach = 1.02 * tank.radius_m * site.grown
    low = -0.3
    for name, place in zip("AB", _stands(rng, tank), strict=True):
        turned = _rotation(rng)
        own, ranges = _scan(chance, site, place, turned, points // 2, bias, noise)
        ranges = ranges * (1 + scale) + offset
        parts.files[f"scans/{name.lower()}.las"] = las_bytes(ranges[:, None] * own)
        for target, at in targets.items():
            seen = (at - place) @ turned + chance.normal(TARGET_SD_M, 3)
            rows.append([name, target, *np.round(seen, 5).tolist(), 1000 * TARGET_SD_M])
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
    """Two places of the scanner, some way off the middle on either side."""
    at = rng.uniform(0, FULL_TURN)
    away = tank.radius_m * rng.uniform(0.2, 0.35, 2)
    for turn, off in ((at, away[0]), (at + np.pi + 0.5, away[1])):
        yield np.array([off * np.sin(turn), off * np.cos(turn), rng.uniform(1.4, 1.7)])


def _targets(rng, site):
    """{name: place} of targets within the tank, at different heights, all around."""
    tank = site.tank
    found = {}
    for k in range(TARGETS):
        at = FULL_TURN * (k + 0.3 * rng.uniform(-1, 1)) / TARGETS
        off = tank.radius_m * rng.uniform(0.75, 0.9)
        z = rng.uniform(0.3, 1.0) if k % 2 else rng.uniform(0.5, 0.8) * tank.height_m
        found[f"T{k + 1}"] = np.array([off * np.sin(at), off * np.cos(at), z])
    return found


def _read_network(site, targets):
    """One set-up of a total station that gives the frame: it and a mark are held."""
    chance, rng = site.chance, site.chance.rng
    station, mark = np.array([0.1, 0.15, 1.5]), np.array([0.3 * site.tank.radius_m, -0.1, 0.9])
    tool = Tool(
        chance.normal(1e-6 * TOOL["u_scale_ppm"]), chance.normal(1e-3 * TOOL["u_offset_mm"]),
        0.0, TOOL_SD_M, TOOL_SD_RAD,
    )  # fmt: skip
    zero = float(rng.uniform(0, FULL_TURN))
    seen = {**targets, "R1": mark}
    read = read_targets(chance, station, np.array(list(seen.values())), tool, zero)
    tables = site.parts.tables
    tables["directions"] = [["setup", "to", "direction_deg", "s_arcsec"]]
    tables["zenith_angles"] = [["setup", "to", "zenith_deg", "s_arcsec"]]
    tables["slope_distances"] = [["setup", "to", "distance_m", "s_mm"]]
    for name, (direction, zenith, length) in zip(seen, read.tolist(), strict=True):
        tables["directions"].append(["1", name, round(float(np.degrees(direction)), 6), 2.0])
        tables["zenith_angles"].append(["1", name, round(float(np.degrees(zenith)), 6), 2.0])
        tables["slope_distances"].append(["1", name, round(length, 5), 1000 * TOOL_SD_M])
    tables["setups"] = [
        ["setup", "station", "instrument", "instrument_height_m"],
        ["1", "S1", "TS-1", 0.0],
    ]
    held = [[name, *map(float, at), 0.0, 0.0, 0.0] for name, at in (("S1", station), ("R1", mark))]
    tables["control"] = [["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"], *held]
    site.parts.registers["instruments"] = {
        "TS-1": {"kind": "total_station", "certificate": "simulated", **TOOL}
    }


def _rotation(rng):
    """(3, 3) from the scanner's frame to that of the tank: turned, and a little out of level."""
    a, b = LEVELLED_RAD * rng.uniform(-1, 1, 2)
    c = rng.uniform(0, FULL_TURN)
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    about_z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def _scan(chance, site, place, turned, count, bias, noise):
    """Rays in the scanner's own frame, and their ranges with noise; only those that return."""
    rng, tank, f = chance.rng, site.tank, site.grown
    lines = int(np.sqrt(count * (HIGHEST_RAD - LOWEST_RAD) / FULL_TURN))
    columns = count // lines
    rise, turn = np.meshgrid(
        np.linspace(LOWEST_RAD, HIGHEST_RAD, lines), FULL_TURN * np.arange(columns) / columns
    )
    own = rays_of(turn.ravel(), np.pi / 2 - rise.ravel())
    origin, rays = place / f, own @ turned.T
    cool = tank.ranges_m(origin, rays)
    met = np.isfinite(cool)
    across = np.ones(len(own))
    across[met] = incidence(tank, origin + cool[met, None] * rays[met], rays[met])
    ranges = f * cool + bias * (1 / np.maximum(across, 0.1) - 1)
    for one in tank.fittings:
        if one.width_m > 0:
            ranges = np.minimum(ranges, f * _column_ranges_m(one, origin, rays))
    ranges = np.minimum(ranges, f * _floor_ranges_m(tank, origin, rays))
    ranges += chance.normal(noise, len(own))
    spoilt = chance.blunders(len(own), SPOILT)
    ranges[spoilt] -= rng.uniform(0, FAR_M, len(spoilt))
    seen = np.isfinite(ranges)
    return own[seen], ranges[seen]


def _column_ranges_m(column, origin, rays):
    """Where rays first meet an upright round column; inf: they do not."""
    x, y = origin[0] - column.x_m, origin[1] - column.y_m
    a = rays[:, 0] ** 2 + rays[:, 1] ** 2
    b = rays[:, 0] * x + rays[:, 1] * y
    root = b**2 - a * (x**2 + y**2 - column.width_m**2 / 4)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (-b - np.sqrt(np.maximum(root, 0))) / a
    z = origin[2] + t * rays[:, 2]
    return np.where((root > 0) & (t > 0) & (z < column.high_m), t, np.inf)


def _floor_ranges_m(tank, origin, rays):
    """Where rays meet the bottom; inf: they do not."""
    down = rays[:, 2] < -1e-3
    t = np.full(len(rays), np.inf)
    d = rays[down]
    length = origin[2] / -d[:, 2]
    for _ in range(20):
        at = origin + length[:, None] * d
        miss = at[:, 2] - tank.floor.height_m(at[:, 0], at[:, 1], tank.radius_m)
        length = length + miss / -d[:, 2]
    t[down] = length
    return t


def las_bytes(xyz):
    """A LAS 1.2 file, point format 0, of coordinates in steps of 0.1 mm (no library is needed)."""
    steps = np.round(xyz / LAS_STEP_M).astype("<i4")
    low, high = steps.min(axis=0) * LAS_STEP_M, steps.max(axis=0) * LAS_STEP_M
    bounds = [one for pair in zip(high, low, strict=True) for one in map(float, pair)]
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
