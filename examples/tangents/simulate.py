"""Tangents of a tank from a traverse of eight stations round it: a simulated survey.

The wall leans, is oval, and has three seams that stand in or out; the telescope is turned until its
sight just touches it. Everything that a surveyor cannot know is drawn (seeded) from what the job
declares. Run it to write the tables again:

    python simulate.py
"""

import csv
import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEED = 5
RADIUS_M, CENTRE_M, COURSE_M, COURSES = 6.1, (500.0, 300.0), 1.8, 5
LEVELS = (0.2, 0.8)  # of a course
LEAN = (0.0012, -0.0007)
STATIONS, FROM_AXIS_M, HEIGHT_M, SPREAD_M = 8, 12.5, 1.55, 0.4
ARCSEC = np.pi / 180 / 3600
DIRECTION, LIMB = 2 * ARCSEC, 4 * ARCSEC  # sd of a sight to a station, and to a limb
DISTANCE_M, BAR_M, U_BAR_M = 0.0005, 2.0, 0.00002
SCALE = 5e-6  # standard uncertainty of the distance meter's
PLATES_MM, PAINT_MM = (7.0, 6.0, 6.0, 5.0, 5.0), 0.3
RAILED = (("I3", 0), ("I6", 5))  # set-up and level of two sights that meet a rail
COMPARED = "I8"  # set-up whose sights to the fifth level are only compared


class Wall:
    """The true wall, painted: waves, seams, and a small bulge of each course."""

    def __init__(self, rng):
        self.size = 0.004 * rng.normal(size=4) / np.arange(2, 6)
        self.phase = rng.uniform(0, 2 * np.pi, 4)
        self.seam = rng.uniform(0, 2 * np.pi, 3)
        self.deep = np.array([-0.004, -0.002, 0.001])
        self.mean = RADIUS_M + 0.0015 * rng.normal(size=COURSES)

    def radius(self, azimuth, z):
        course = np.clip((z / COURSE_M).astype(int), 0, COURSES - 1)
        zeta = 2 * (z / COURSE_M - course) - 1
        found = self.mean[course] + 0.0012 * (1 - zeta**2)
        for k, (size, phase) in enumerate(zip(self.size, self.phase, strict=True), 2):
            found = found + size * np.cos(k * azimuth - phase)
        for at, deep in zip(self.seam, self.deep, strict=True):
            arc = RADIUS_M * np.angle(np.exp(1j * (azimuth - at)))
            found = found + deep * np.exp(-np.abs(arc) / 0.3)
        return found

    def beyond(self, xyz):
        away = xyz[..., :2] - CENTRE_M - xyz[..., 2:] * LEAN
        return np.hypot(away[..., 0], away[..., 1]) - self.radius(
            np.arctan2(away[..., 0], away[..., 1]), xyz[..., 2]
        )

    def inside_m3(self):
        """True volume inside plate and paint, at the temperature of the survey."""
        z = (np.arange(9000) + 0.5) * COURSE_M * COURSES / 9000
        azimuth = np.arange(1440) * 2 * np.pi / 1440
        inset = (np.array(PLATES_MM) + PAINT_MM) / 1000
        course = np.clip((z / COURSE_M).astype(int), 0, COURSES - 1)
        radius = self.radius(azimuth[None, :], z[:, None]) - inset[course][:, None]
        return float(np.pi * np.mean(radius**2, axis=1).sum() * COURSE_M * COURSES / len(z))


def limb(wall, station, level, sign):
    """Azimuth and zenith angle of the sight that touches the wall; sign -1: the left limb."""
    centre = np.array(CENTRE_M) + level * np.array(LEAN)
    away = centre - station[:2]
    distance = np.hypot(*away)
    length = np.sqrt(distance**2 - RADIUS_M**2)
    zenith = np.arctan2(length, level - station[2])
    nominal = np.arctan2(*away) + sign * np.arcsin(RADIUS_M / distance)
    along = length + np.linspace(-2.5, 2.5, 4001)
    low, high = nominal - sign * 0.03, nominal + sign * 0.03
    for _ in range(40):
        middle = (low + high) / 2
        ray = np.array([np.sin(middle), np.cos(middle), 1 / np.tan(zenith)])
        if wall.beyond(station + along[:, None] * ray).min() < 0:
            low = middle
        else:
            high = middle
    return (low + high) / 2, zenith


def degrees(angle):
    return round(float(np.degrees(angle) % 360), 5)


def write(name, heading, rows):
    with (HERE / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([heading, *rows])


def main():
    rng = np.random.default_rng(SEED)
    wall = Wall(rng)
    f = 2 * np.pi * np.arange(STATIONS) / STATIONS + 0.3
    stations = np.column_stack(
        [CENTRE_M[0] + FROM_AXIS_M * np.sin(f), CENTRE_M[1] + FROM_AXIS_M * np.cos(f),
         HEIGHT_M + SPREAD_M * rng.uniform(-1, 1, STATIONS)]
    )  # fmt: skip
    stations[:, :2] += SPREAD_M * rng.normal(size=(STATIONS, 2))
    zeros, scale = rng.uniform(0, 2 * np.pi, STATIONS), SCALE * rng.normal()
    traverse(rng, stations, zeros, scale)
    rows = []
    z = [(c + part) * COURSE_M for c in range(COURSES) for part in LEVELS]
    for i, station in enumerate(stations):
        for place, level in enumerate(z):
            for side, sign in (("left", -1), ("right", 1)):
                azimuth, zenith = limb(wall, station, level, sign)
                azimuth, zenith = [azimuth, zenith] + LIMB * rng.normal(size=2)
                if (f"I{i + 1}", place) in RAILED and sign > 0:
                    azimuth += 0.0035  # some 40 mm before the wall
                use = "check" if f"I{i + 1}" == COMPARED and place == 4 else ""
                direction = degrees(azimuth - zeros[i])
                course = place // len(LEVELS) + 1
                rows.append([f"I{i + 1}", course, round(level, 3), side, direction,
                             degrees(zenith), 4, use])  # fmt: skip
    heading = [
        "setup",
        "course",
        "level_m",
        "side",
        "direction_deg",
        "zenith_deg",
        "s_arcsec",
        "use",
    ]
    write("tangents", heading, rows)
    plates = [[i + 1, COURSE_M, plate, PAINT_MM] for i, plate in enumerate(PLATES_MM)]
    write("courses", ["course", "height_m", "thickness_mm", "paint_mm"], plates)
    truth = {"volume_m3": round(wall.inside_m3(), 4), "lean": LEAN}
    (HERE / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


def traverse(rng, stations, zeros, scale):
    """Each station reads the two beside it; one base is read with the bar from both ends, too."""
    directions, zeniths, distances, stadia = [], [], [], []
    for i, at in enumerate(stations):
        for k in ((i - 1) % STATIONS, (i + 1) % STATIONS):
            away = stations[k] - at
            length, plan = np.linalg.norm(away), np.hypot(*away[:2])
            names = f"I{i + 1}", f"S{k + 1}"
            angle = np.arctan2(*away[:2]) - zeros[i] + DIRECTION * rng.normal()
            directions.append([*names, degrees(angle), 2])
            angle = np.arctan2(plan, away[2]) + DIRECTION * rng.normal()
            zeniths.append([*names, degrees(angle), 2])
            read = (1 + scale) * length + DISTANCE_M * rng.normal()
            distances.append([*names, round(read, 4), 0.5])
            if {i, k} == {0, 1}:
                angle = 2 * np.arctan(BAR_M / 2 / plan) + 1 * ARCSEC * rng.normal()
                stadia.append([*names, "bar 1", degrees(angle), 1])
    write("directions", ["setup", "to", "direction_deg", "s_arcsec"], directions)
    write("zenith_angles", ["setup", "to", "zenith_deg", "s_arcsec"], zeniths)
    write("slope_distances", ["setup", "to", "distance_m", "s_mm"], distances)
    write("stadia", ["setup", "to", "bar", "angle_deg", "s_arcsec"], stadia)
    setups = [[f"I{i + 1}", f"S{i + 1}", "TS", 0] for i in range(STATIONS)]
    write("setups", ["setup", "station", "instrument", "instrument_height_m"], setups)
    about = [[f"S{i + 1}", *np.round(at, 2)] for i, at in enumerate(stations)]
    about[0][1:] = np.round(stations[0], 3)
    rows = [[*map(str, row), *("", "", "")] for row in about]
    rows[0][4:] = ["0", "0", "0"]
    rows[1][4:] = ["", "", ""]
    write("control", ["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"], rows)


if __name__ == "__main__":
    main()
