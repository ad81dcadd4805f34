"""Jobs of tanks that were scanned, as files of a scanner that no formula of the package has made.

    parts = scanned_parts(rng)                two scans inside, five targets, a control
    write_folder(folder, parts)

A scanner turns in equal steps of both angles; each beam is followed to the wall by `take_hits`. It
ranges too long by an offset, a scale and its angle of incidence, and stands at a pose of its own.
"""

from dataclasses import dataclass, field

import numpy as np
from generated_hits import Surface, Tool, take_hits
from job_builder import SETTINGS, Parts
from scipy.spatial.transform import Rotation

RADIUS_M, COURSE_M, COURSES = 3.0, 2.0, 2
ROUND = Surface(lambda a, z: RADIUS_M + 0.004 * np.sin(2 * a) + 0.0005 * z, (0.4, -0.2))
TARGETS_M = np.array(
    [[2.0, 0.5, 0.3], [-1.5, 1.6, 2.9], [-0.8, -2.3, 0.6], [1.9, -1.4, 3.4], [0.2, 2.4, 1.5]]
)


@dataclass(frozen=True)
class ScannerAt:
    """A scanner and the pose of its scan: rotation vector (rad) and place (m)."""

    place_m: tuple = (0.0, 0.0, 1.5)
    turn: tuple = (0.0, 0.0, 0.0)
    tool: Tool = field(default_factory=Tool)

    @property
    def rotation(self):
        """(3, 3) from the scan's frame to that of the tank."""
        return Rotation.from_rotvec(self.turn).as_matrix()

    def own(self, xyz_m):
        """Places of the tank in the frame of the scan."""
        return (xyz_m - np.array(self.place_m)) @ self.rotation


def scan(surface, at, rng, *, columns=720, rows=60, height_m=COURSES * COURSE_M):
    """(n, 3) points of a scan in its own frame, from the foot of the wall to its top."""
    azimuth = np.tile(np.arange(columns) * 2 * np.pi / columns, rows)
    z = np.repeat((np.arange(rows) + 0.5) / rows * height_m, columns)
    aims = surface.at(azimuth + rng.uniform(0, 0.01), z)
    direction, zenith, distance = take_hits(surface, np.array(at.place_m), aims, at.tool, rng).T
    flat = distance * np.sin(zenith)
    away = np.column_stack(
        [flat * np.sin(direction), flat * np.cos(direction), distance * np.cos(zenith)]
    )
    return away @ at.rotation


def target_rows(scans, rng, s_mm=0.5, targets_m=TARGETS_M):
    """Rows of scan_targets.csv of scans {name: ScannerAt}."""
    rows = [["scan", "target", "x_m", "y_m", "z_m", "s_mm"]]
    for name, at in scans.items():
        own = at.own(targets_m) + s_mm / 1000 * rng.normal(size=targets_m.shape)
        rows += [[name, f"T{i + 1}", *map(float, place), s_mm] for i, place in enumerate(own)]
    return rows


def control_rows(rng, s_mm=0.3, targets_m=TARGETS_M):
    """Rows of control.csv of the targets."""
    rows = [["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"]]
    known = targets_m + s_mm / 1000 * rng.normal(size=targets_m.shape)
    return rows + [
        [f"T{i + 1}", *map(float, place), s_mm, s_mm, s_mm] for i, place in enumerate(known)
    ]


def xyz_text(xyz_m):
    """A file of points as text, tenths of a millimetre."""
    return "\n".join(" ".join(f"{value:.4f}" for value in place) for place in xyz_m) + "\n"


CLOUD = {
    "unit": "m",
    "scanner": "S",
    "u_offset_mm": 0.5,
    "u_scale_ppm": 10.0,
}
SCANS = {
    "A": ScannerAt((0.2, 0.3, 1.4), (0.01, -0.02, 0.5)),
    "B": ScannerAt((0.9, -0.6, 1.7), (-0.01, 0.005, -1.9)),
}


def scanned_parts(rng, scans=None, *, surface=ROUND, clouds=None, targets=True, **sizes):
    """Parts of a tank of two courses of 2 m, R 3 m, scanned from inside.

    scans   {name: ScannerAt}
    clouds  {key: value} of all files, beside CLOUD
    targets whether there are any, with control.csv
    sizes   of `scan`
    """
    scans = SCANS if scans is None else scans
    settings = {
        **SETTINGS,
        "tank.id": "C-1",
        "tank.nominal_diameter_m": 2 * RADIUS_M,
        "tank.nominal_height_m": COURSES * COURSE_M,
        "survey.side": "inside",
        "table.step_m": 0.1,
    }
    courses = [["course", "height_m", "thickness_mm"]]
    tables = {"courses": courses + [[str(i + 1), COURSE_M, 8.0] for i in range(COURSES)]}
    if targets:
        tables |= {"scan_targets": target_rows(scans, rng), "control": control_rows(rng)}
    files, registers = {}, {}
    for name, at in scans.items():
        files[f"{name}.xyz"] = xyz_text(scan(surface, at, rng, **sizes))
        registers[name] = {"file": f"{name}.xyz", **CLOUD, **(clouds or {})}
    return Parts(settings, tables, extra_files=files, registers={"clouds": registers})
