"""Photograph Silva's tank again: a simulated survey, with its truth.

Silva (1995) prints what was measured with, not what was measured. Here the tank of
`../silva-1995` gets a wall that is known everywhere, targets, tapes and control, and is
photographed through tankcal's own camera. Everything that a surveyor cannot know is drawn (seeded)
from the standard uncertainties that the job declares. Run it to write the tables again:

    python simulate.py
"""

import csv
import json
from pathlib import Path

import numpy as np

from tankcal.camera.model import PARAMETERS, Form, distort_image_points
from tankcal.geometry.rotations import angles_of, rotation_of_view

HERE = Path(__file__).parent
SEED = 137
GENERATRICES, SECTIONS = 24, 5  # published
WAVES = 12  # from 0
CENTRE_M, BOTTOM_M, COURSE_M, GROUND_M = (15.782, 14.150), 10.000, 1.900, 9.700
CONTROL = (15, 75, 81, 95, 115, 135, 161, 175, 215, 235, 241)  # published names
H_TAPES, V_TAPES = (1, 3, 4, 5, 6), (1, 3, 4)  # published: H-2 and V-2 were not used
TARGET_M = 0.001  # from the centre of a target to the wall
STATIONS, FRAME_MM = 11, (83.0, 60.0)  # half of what is used of the 18 x 13 cm format
GRAZING = 0.27  # cosine of the angle of incidence below which a target is not measured
FEWEST_RAYS = 3
CAMERA = {
    "c": 100.021,
    "x0": 0.031,
    "y0": -0.044,
    "K1": 2.0e-8,
    "K2": -1.1e-12,
    "K3": 4.0e-17,
    "P1": 3.0e-7,
    "P2": -2.0e-7,
    "A": 1.2e-4,
    "B": -0.8e-4,
}
FORM = Form("correction_added", "both_y")
IMAGE_SD_MM, CONTROL_SD_M, TAPE_SD_M = 0.005, 0.002, 0.001
TAPE = {"correction": 4.0e-5, "expansion": 1.15e-5, "certified_c": 20.0, "read_c": 26.0}
# standard uncertainties of uncertainty.csv; the true values are drawn from them
SCALE, ZERO_M, PLATE_M, PAINT_M, SHELL_K = 20e-6, 0.001, 0.0002, 0.00005, 2.0
SHELL_C, REFERENCE_C, EXPANSION = 26.0, 20.0, 1.1e-5


class Wall:
    """The true wall: an outline in each course, upright in it, about an axis that leans a little.

    Its waves are those of the 24 points of each section of `../silva-1995`: r(a) = c_0 + 2 Re sum
    c_k exp(i k (a - a_1)), so that areas are sums of squares. The shorter ones are damped by
    2/k: in the reconstruction they are mostly noise of the points and chance of their signs.
    """

    def __init__(self):
        rows = _read(HERE.parent / "silva-1995" / "points.csv")
        sections = [[row for row in rows if row["section"] == str(k + 1)] for k in range(SECTIONS)]
        xyz = [np.array([[float(p[f"{a}_m"]) for a in "xyz"] for p in s]) for s in sections]
        middle = np.array([section.mean(axis=0) for section in xyz])
        self.lean = np.array([np.polyfit(middle[:, 2], middle[:, i], 1)[0] for i in (0, 1)])
        self.first = np.radians(-7.5)  # azimuth of generatrix 1
        self.waves = []
        for section, points in zip(sections, xyz, strict=True):
            away = points[:, :2] - self.axis(points[:, 2])
            radius = np.full(GENERATRICES, np.hypot(*away.T).mean())
            radius[[int(row["generatrix"]) - 1 for row in section]] = np.hypot(*away.T)
            damped = 2 / np.maximum(np.arange(WAVES), 2)
            self.waves.append(damped * np.fft.rfft(radius)[:WAVES] / GENERATRICES)

    def axis(self, z_m):
        """Points (n, 2) of the axis."""
        middle = BOTTOM_M + SECTIONS * COURSE_M / 2
        return np.array(CENTRE_M) + np.outer(np.asarray(z_m) - middle, self.lean)

    def radius_m(self, azimuth, z_m):
        """Outside radius about the axis."""
        course = np.clip((z_m - BOTTOM_M) // COURSE_M, 0, SECTIONS - 1).astype(int)
        k = np.arange(WAVES)
        waves = np.array(self.waves)[course] * np.where(k == 0, 1, 2)
        turn = np.exp(1j * np.outer(azimuth - self.first, k))
        return np.real(np.sum(waves * turn, axis=1))

    def point(self, azimuth, z_m, off_m=0.0):
        """Points (n, 3) at a distance off the wall."""
        azimuth, z_m = np.broadcast_arrays(np.asarray(azimuth, float), np.asarray(z_m, float))
        r = self.radius_m(azimuth, z_m) + off_m
        plan = self.axis(z_m) + r[:, None] * np.column_stack([np.sin(azimuth), np.cos(azimuth)])
        return np.column_stack([plan, z_m])

    def volume_m3(self, dip_m, true):
        """Inside volume below a dip, of the tank at the table's temperature: exact."""
        skin = np.array(true["plate_mm"]) / 1000 + true["paint_mm"] / 1000
        upright = 1 / np.sqrt(1 + self.lean @ self.lean)
        joints = np.arange(SECTIONS) * COURSE_M * upright
        filled = np.diff(np.minimum(np.append(joints, np.inf), dip_m + true["zero_mm"] / 1000))
        waves = np.array(self.waves)
        inside = waves[:, 0].real - skin
        areas = np.pi * (inside**2 + 2 * np.sum(np.abs(waves[:, 1:]) ** 2, axis=1))
        stretch = 1 + EXPANSION * (REFERENCE_C - true["shell_c"])
        return float(stretch**2 * np.dot(areas, np.maximum(filled, 0.0)))


def targets(wall, rng):
    """{name: (section, generatrix, xyz)} of all 137 points; only those of the wall have numbers."""
    found = {}
    for g in range(1, GENERATRICES + 1):
        for s in range(1, SECTIONS + 1):
            azimuth = np.radians(15 * (g - 1)) + wall.first + rng.normal(0, 0.001)
            z = BOTTOM_M + (s - 0.5) * COURSE_M + rng.normal(0, 0.010)
            found[f"{g}{s}"] = (s, g, wall.point([azimuth], [z], TARGET_M)[0])
    for number in H_TAPES:  # along a tangent, the ends on stands
        azimuth, z = np.radians(60 * number - 40), BOTTOM_M + 1.5 + rng.normal(0, 0.05)
        middle = wall.point([azimuth], [z], 0.15)[0]
        along = np.array([np.cos(azimuth), -np.sin(azimuth), rng.normal(0, 0.005)])
        half = (6.900 + rng.normal(0, 0.003)) / 2
        found[f"H{number}a"], found[f"H{number}b"] = (
            ("", "", middle + side * half * along / np.linalg.norm(along)) for side in (-1, 1)
        )
    for number in V_TAPES:  # hanging beside the wall
        azimuth = np.radians(90 * number - 53) + rng.normal(0, 0.001)
        low = wall.point([azimuth], [BOTTOM_M + 0.25 + rng.normal(0, 0.005)], 0.06)[0]
        up = [*rng.normal(0, 0.003, 2), 9.000 + rng.normal(0, 0.003)]
        found[f"V{number}a"], found[f"V{number}b"] = ("", "", low), ("", "", low + up)
    found["M1"] = ("", "", wall.point([np.radians(200)], [BOTTOM_M + 0.300], TARGET_M)[0])
    return found


def stations(rng):
    """Projection centres (11, 3) and rotations: around the tank, the whole shell in each photo."""
    azimuth = 2 * np.pi * (np.arange(STATIONS) + 0.05 * rng.standard_normal(STATIONS)) / STATIONS
    off = rng.uniform(9.5, 11.0, STATIONS)
    height = GROUND_M + 1.5 + 0.3 * rng.random(STATIONS)
    centre = np.array(CENTRE_M) + (6.5 + off)[:, None] * np.column_stack(
        [np.sin(azimuth), np.cos(azimuth)]
    )
    tilt = np.arctan2(BOTTOM_M + 4.4 - height, off) + rng.normal(0, 0.01, STATIONS)
    roll = rng.normal(0, 0.02, STATIONS) + np.where(np.arange(STATIONS) % 4 == 3, np.pi / 2, 0)
    rotation = rotation_of_view(azimuth + np.pi + rng.normal(0, 0.02, STATIONS), tilt, roll)
    return np.column_stack([centre, height]), rotation


def photographed(xyz, on_wall, centre, rotation):
    """Image points (n, 2) of a photo without errors, and which of them are seen."""
    u, v, w = rotation @ (xyz - centre).T
    interior = np.array([CAMERA.get(name, 0.0) for name in PARAMETERS])
    ahead = w < -1.0
    ideal = -CAMERA["c"] * np.column_stack([u, v]) / np.where(ahead, w, -1.0)[:, None]
    inside = ahead & (np.abs(ideal) < np.add(FRAME_MM, 2.0)).all(axis=1)
    image = np.zeros_like(ideal)
    image[inside] = distort_image_points(ideal[inside], interior, FORM)
    seen = inside & (np.abs(image) < FRAME_MM).all(axis=1)
    return image, seen & _in_view(xyz, on_wall, centre)


def _in_view(xyz, on_wall, centre):
    """Is no part of the tank in the way, and a target of the wall not seen too obliquely?"""
    away = xyz[:, :2] - np.array(CENTRE_M)
    back = centre[:2] - xyz[:, :2]
    distance = np.hypot(*back.T)
    outwards = np.sum(away * back, axis=1) / np.hypot(*away.T) / distance
    nearest = np.abs(away[:, 0] * back[:, 1] - away[:, 1] * back[:, 0]) / distance
    beside = (nearest > 6.6) | (np.sum(away * back, axis=1) > 0)
    return np.where(on_wall, outwards > GRAZING, beside)


def photographs(found, centres, rotations, rng):
    """Rows of image_points.csv, with their errors."""
    names = list(found)
    xyz = np.array([found[name][2] for name in names])
    on_wall = np.array([name[0] not in "HV" for name in names])
    rows = []
    for i, (centre, rotation) in enumerate(zip(centres, rotations, strict=True)):
        image, seen = photographed(xyz, on_wall, centre, rotation)
        image += rng.normal(0, IMAGE_SD_MM, image.shape)
        rows += [[f"S{i + 1}", names[k], *_fixed(image[k], 4)] for k in np.flatnonzero(seen)]
    rays = {name: sum(row[1] == name for row in rows) for name in names}
    if min(rays.values()) < FEWEST_RAYS:
        raise SystemExit(f"too few rays: {rays}; change the stations")
    return rows


def on_site(found, scale, rng):
    """Rows of control.csv and distances.csv, with their errors and a common error of scale."""
    sd, middle = [1000 * CONTROL_SD_M] * 3, np.array([*CENTRE_M, BOTTOM_M])
    control = []
    for name in map(str, CONTROL):
        xyz = middle + (1 + scale) * (found[name][2] - middle) + rng.normal(0, CONTROL_SD_M, 3)
        control.append([name, *_fixed(xyz, 4), *sd])
    warm = 1 + TAPE["expansion"] * (TAPE["read_c"] - TAPE["certified_c"])
    tapes = []
    for name in [f"H{k}" for k in H_TAPES] + [f"V{k}" for k in V_TAPES]:
        length = (1 + scale) * np.linalg.norm(found[f"{name}b"][2] - found[f"{name}a"][2])
        reading = length / (1 + TAPE["correction"]) / warm + rng.normal(0, TAPE_SD_M)
        row = [f"{name}a", f"{name}b", f"{reading:.4f}", 1000 * TAPE_SD_M, "tape", TAPE["read_c"]]
        tapes.append(row)
    return control, tapes


def unseen(rng):
    """What a surveyor cannot know: true values within the declared uncertainties."""
    courses = _read(HERE / "courses.csv")
    plate_mm = 1000 * rng.normal(0, PLATE_M)
    return {
        "scale": rng.normal(0, SCALE),
        "zero_mm": 1000 * rng.normal(0, ZERO_M),
        "plate_mm": [float(row["thickness_mm"]) + plate_mm for row in courses],
        "paint_mm": float(courses[0]["paint_mm"]) + 1000 * rng.normal(0, PAINT_M),
        "shell_c": SHELL_C + rng.normal(0, SHELL_K),
    }


def main():
    """Write the tables and truth/ beside this script."""
    rng = np.random.default_rng(SEED)
    wall, true = Wall(), unseen(rng)
    found = targets(wall, rng)
    centres, rotations = stations(rng)
    control, tapes = on_site(found, true["scale"], rng)
    photos = [f"S{i + 1}" for i in range(STATIONS)]
    _write("targets.csv", "point section generatrix z_m offset_mm", _target_rows(found))
    _write("photos.csv", "photo camera", [[name, "UMK"] for name in photos])
    images = photographs(found, centres, rotations, rng)
    _write("image_points.csv", "photo point x_mm y_mm", images)
    _write("control.csv", "point x_m y_m z_m sx_mm sy_mm sz_mm", control)
    _write("distances.csv", "from to distance_m s_mm instrument temperature_c", tapes)
    (HERE / "truth").mkdir(exist_ok=True)
    points = [[name, *_fixed(one[2], 6)] for name, one in found.items()]
    _write("truth/points.csv", "point x_m y_m z_m", points)
    angles = np.degrees(angles_of(rotations))
    stood = [
        [name, *_fixed(xyz, 6), *_fixed(turn, 6)]
        for name, xyz, turn in zip(photos, centres, angles, strict=True)
    ]
    _write("truth/photos.csv", "photo x_m y_m z_m omega_deg phi_deg kappa_deg", stood)
    _write_tank(wall, true)


def _write_tank(wall, true):
    """truth/tank.json."""
    dips = [round(COURSE_M * k, 3) for k in range(SECTIONS + 1)]
    tank = {
        "camera": CAMERA,
        **{key: _rounded(value, 9) for key, value in true.items()},
        "lean": _rounded(wall.lean, 9),
        "mean_outside_radius_m": _rounded([waves[0].real for waves in wall.waves], 6),
        "dip_m": dips,
        "volume_m3": _rounded([wall.volume_m3(dip, true) for dip in dips], 4),
    }
    text = json.dumps(tank, indent=1)
    (HERE / "truth" / "tank.json").write_text(text + "\n", encoding="utf-8")


def _target_rows(found):
    """Those of the wall: tapes and the mark are points of the survey, but not of the wall."""
    rows = [[name, *one[:2]] for name, one in found.items() if one[0]]
    return [
        [name, s, g, f"{BOTTOM_M + (s - 0.5) * COURSE_M:.3f}", 1000 * TARGET_M]
        for name, s, g in rows
    ]


def _rounded(value, digits):
    return (
        round(float(value), digits)
        if np.ndim(value) == 0
        else [round(float(v), digits) for v in value]
    )


def _fixed(values, digits):
    return [f"{value:.{digits}f}" for value in values]


def _read(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def _write(name, headings, rows):
    with open(HERE / name, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(headings.split())
        writer.writerows(rows)


if __name__ == "__main__":
    main()
