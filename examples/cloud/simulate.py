"""Two scans from inside a tank, five targets and a total station: a simulated survey.

The wall leans, is oval, has two seams and bulges a little; a pipe and the neck of a manhole stand
before it. A scanner turns in equal steps of both angles and each beam ends at what it meets first.
Everything that a surveyor cannot know is drawn (seeded) from what the job declares. Run it to
write the scans, the tables and truth.json again:

    python simulate.py
"""

import csv
import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEED = 8
RADIUS_M, COURSE_M, COURSES = 2.5, 1.6, 2
HEIGHT_M = COURSE_M * COURSES
LEAN = (0.0012, -0.0008)
PIPE_AZIMUTH, PIPE_RADIUS_M, PIPE_GAP_M = 2.2, 0.125, 0.02  # upright, from the bottom to the top
NECK_AZIMUTH, NECK_Z_M, NECK_RADIUS_M, NECK_REACH_M = 4.4, 0.65, 0.3, 0.12
COLUMNS, LINES, LOWEST, HIGHEST = 330, 76, np.radians(-52), np.radians(52)
SCANS = {  # place, and turn about z
    "A": ((0.55, 0.20, 1.30), 0.8),
    "B": ((-0.35, -0.45, 1.60), -2.1),
}
LEVELLED = 0.01  # rad: how far the scanners stand out of level
NOISE_M, BEAM = 0.0012, 0.0004  # of a range at 2.5 m; half the width of a beam, rad
OFFSET_M, SCALE = 0.0008, 6e-6  # it ranges too long: certified to 1 mm and 10 ppm
TARGETS = {
    "T1": (1.90, -0.70, 0.20), "T2": (-1.55, 1.62, 2.60), "T3": (-1.05, -2.00, 0.40),
    "T4": (1.60, -1.35, 2.90), "T5": (0.25, 2.00, 1.20),
}  # fmt: skip
TARGET_M = 0.0006  # sd of each coordinate of the centre of a target in a scan
STATION, MARK = (0.10, 0.15, 1.50), (2.30, -0.10, 0.90)
ANGLE, DISTANCE_M = 2 * np.pi / 180 / 3600, 0.0005
TOOL_SCALE, TOOL_OFFSET_M = 5e-6, 0.0003  # of the total station, standard uncertainties


class Wall:
    """The true wall, inside."""

    def __init__(self, rng):
        self.size = 0.003 * rng.normal(size=4) / np.arange(2, 6)
        self.phase = rng.uniform(0, 2 * np.pi, 4)
        self.seam = rng.uniform(0, 2 * np.pi, 2)
        self.deep = np.array([-0.003, 0.002])
        self.mean = RADIUS_M + 0.001 * rng.normal(size=COURSES)

    def radius(self, azimuth, z):
        course = np.clip((z / COURSE_M).astype(int), 0, COURSES - 1)
        zeta = 2 * (z / COURSE_M - course) - 1
        found = self.mean[course] + 0.0008 * (1 - zeta**2)
        for k, (size, phase) in enumerate(zip(self.size, self.phase, strict=True), 2):
            found = found + size * np.cos(k * azimuth - phase)
        for at, deep in zip(self.seam, self.deep, strict=True):
            arc = RADIUS_M * np.angle(np.exp(1j * (azimuth - at)))
            found = found + deep * np.exp(-np.abs(arc) / 0.2)
        return found

    def range(self, origin, d):
        """How far rays d (n, 3) go from inside to the wall; inf: over its top or to the bottom."""
        low, high = np.zeros(len(d)), np.full(len(d), 4 * RADIUS_M)
        for _ in range(48):
            middle = (low + high) / 2
            at = origin + middle[:, None] * d
            away = at[:, :2] - at[:, 2:] * LEAN
            z = np.clip(at[:, 2], 0, HEIGHT_M - 1e-9)
            beyond = np.hypot(*away.T) > self.radius(np.arctan2(*away.T), z)
            low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
        z = origin[2] + low * d[:, 2]
        return np.where((z > 0) & (z < HEIGHT_M), low, np.inf)

    def volume_m3(self):
        """True volume at the temperature of the survey, empty."""
        z = (np.arange(6400) + 0.5) * HEIGHT_M / 6400
        azimuth = np.arange(1440) * 2 * np.pi / 1440
        radius = self.radius(azimuth[None, :], z[:, None])
        return float(np.pi * np.mean(radius**2, axis=1).mean() * HEIGHT_M)


def met(wall, origin, d):
    """How far rays go to what they meet first; inf: nothing."""
    found = wall.range(origin, d)
    if d[:, 2].min() < 0:
        down = np.where(d[:, 2] < 0, -origin[2] / np.minimum(d[:, 2], -1e-9), np.inf)
        found = np.minimum(found, np.where(np.isinf(found), down, np.inf))
    inwards = RADIUS_M - PIPE_RADIUS_M - PIPE_GAP_M
    axis = inwards * np.array([np.sin(PIPE_AZIMUTH), np.cos(PIPE_AZIMUTH)])
    found = np.minimum(found, upright(origin, d, axis, PIPE_RADIUS_M)[0])
    face = upright(origin, d, np.zeros(2), RADIUS_M - NECK_REACH_M)[1]
    at = origin + np.where(np.isfinite(face), face, 0)[:, None] * d
    arc = RADIUS_M * np.angle(np.exp(1j * (np.arctan2(at[:, 0], at[:, 1]) - NECK_AZIMUTH)))
    is_neck = np.hypot(arc, at[:, 2] - NECK_Z_M) < NECK_RADIUS_M
    return np.minimum(found, np.where(is_neck, face, np.inf))


def upright(origin, d, axis, radius):
    """Where rays enter and leave an upright cylinder; inf: they do not meet it."""
    away = origin[:2] - axis
    a, b = d[:, 0] ** 2 + d[:, 1] ** 2, d[:, :2] @ away
    root = b**2 - a * (away @ away - radius**2)
    is_met = root > 0
    half = np.sqrt(np.where(is_met, root, 0))
    enters, leaves = (-b - half) / a, (-b + half) / a
    return (
        np.where(is_met & (enters > 0), enters, np.inf),
        np.where(is_met & (leaves > 0), leaves, np.inf),
    )


def rotation(vector):
    """(3, 3) of a rotation vector."""
    angle = np.linalg.norm(vector)
    x, y, z = np.array(vector) / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def directions(turn, rise):
    level = np.cos(rise)
    return np.column_stack([level * np.sin(turn), level * np.cos(turn), np.sin(rise)])


def scan(rng, wall, place, turned):
    """(n, 3) points in the frame of the scanner."""
    rise, turn = np.meshgrid(
        np.linspace(LOWEST, HIGHEST, LINES), np.arange(COLUMNS) * 2 * np.pi / COLUMNS
    )
    own = directions(turn.ravel(), rise.ravel())
    origin = np.array(place)
    distance = met(wall, origin, own @ turned.T)
    aside = directions(*(np.stack([turn.ravel(), rise.ravel()]) + BEAM * rng.normal(size=(2, 1))))
    other = met(wall, origin, aside @ turned.T)
    share = rng.uniform(size=len(own))
    both = np.isfinite(distance) & np.isfinite(other)
    between = np.where(both, share * (np.where(both, other, 0) - np.where(both, distance, 0)), 0)
    is_edge = both & (np.abs(between) > 0.02 * share)
    distance = np.where(is_edge, distance + between, distance)  # a beam on an edge
    distance = distance * (1 + SCALE) + OFFSET_M + NOISE_M * rng.normal(size=len(own))
    seen = np.isfinite(distance)
    return distance[seen, None] * own[seen]


def write_ply(path, xyz):
    """Tenths of a millimetre, as numbers of 32 bits."""
    head = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(xyz)}\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n"
    )
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(head.encode("ascii") + np.round(xyz, 4).astype("<f4").tobytes())


def degrees(angle):
    return f"{np.degrees(angle) % 360:.5f}"


def write(name, heading, rows):
    with (HERE / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([heading, *rows])


def station_rows(rng):
    """One set-up of the total station that reads the targets and a mark, on which it is turned."""
    scale, offset = TOOL_SCALE * rng.normal(), TOOL_OFFSET_M * rng.normal()
    zero = np.radians(30)
    rows = {"directions": [], "zenith_angles": [], "slope_distances": []}
    for name, place in (TARGETS | {"R1": MARK}).items():
        away = np.subtract(place, STATION)
        direction = np.arctan2(*away[:2]) - zero + ANGLE * rng.normal()
        zenith = np.arctan2(np.hypot(*away[:2]), away[2]) + ANGLE * rng.normal()
        length = np.linalg.norm(away) * (1 + scale) + offset + DISTANCE_M * rng.normal()
        rows["directions"].append(["1", name, degrees(direction), 2])
        rows["zenith_angles"].append(["1", name, degrees(zenith), 2])
        rows["slope_distances"].append(["1", name, f"{length:.5f}", 0.5])
    return rows


def main():
    rng = np.random.default_rng(SEED)
    wall = Wall(rng)
    targets = []
    for name, (place, turn) in SCANS.items():
        turned = rotation([*(LEVELLED * rng.uniform(-1, 1, 2)), turn])
        write_ply(HERE / "scans" / f"{name.lower()}.ply", scan(rng, wall, place, turned))
        for target, at in TARGETS.items():
            own = np.subtract(at, place) @ turned + TARGET_M * rng.normal(size=3)
            targets.append([name, target, *(f"{one:.5f}" for one in own), 0.6])
    write("scan_targets", ["scan", "target", "x_m", "y_m", "z_m", "s_mm"], targets)
    rows = station_rows(rng)
    write("directions", ["setup", "to", "direction_deg", "s_arcsec"], rows["directions"])
    write("zenith_angles", ["setup", "to", "zenith_deg", "s_arcsec"], rows["zenith_angles"])
    write("slope_distances", ["setup", "to", "distance_m", "s_mm"], rows["slope_distances"])
    write("setups", ["setup", "station", "instrument", "instrument_height_m"], [[1, "S1", "TS", 0]])
    fixed = [["S1", *STATION, 0, 0, 0], ["R1", *MARK, 0, 0, 0]]
    write("control", ["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"], fixed)
    truth = {
        "volume_m3": round(wall.volume_m3(), 4),
        "lean": LEAN,
        "offset_mm": 1000 * OFFSET_M,
        "scale_ppm": 1e6 * SCALE,
        "pipe": {"azimuth_deg": round(np.degrees(PIPE_AZIMUTH), 2), "width_m": 2 * PIPE_RADIUS_M},
        "neck": {"azimuth_deg": round(np.degrees(NECK_AZIMUTH), 2), "z_m": NECK_Z_M,
                 "diameter_m": 2 * NECK_RADIUS_M},
    }  # fmt: skip
    (HERE / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
