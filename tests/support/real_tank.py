"""The surveyed tank of the shared data as a job (read in place, see its NOTE)."""

import csv
from itertools import pairwise


def write_real_job(shared, folder):
    """Write the survey as a job: courses from the marks p0..p8, thickness zero, all rows as points.

    Returns the folder.
    """
    with open(shared / "data" / "real-vertical-tank" / "scan.csv", newline="") as file:
        rows = [row[:4] for row in csv.reader(file)]
    marks = {row[0]: float(row[3]) for row in rows}
    joints = [marks[f"p{i}"] for i in range(9)]
    (folder / "job.toml").write_text(
        f"""
        [tank]
        id = "REAL-1"
        kind = "vertical"
        nominal_diameter_m = 15.17
        nominal_height_m = {joints[-1] - joints[0]:.3f}
        [survey]
        side = "outside"
        date = "2020-01-01"
        [datum]
        bottom_z_m = {joints[0]}
        [table]
        step_m = 0.01
        reference_temperature_c = 15
        """
    )
    _write(folder / "points.csv", ["point", "x_m", "y_m", "z_m"], rows)
    courses = [[i + 1, f"{top - low:.3f}", 0] for i, (low, top) in enumerate(pairwise(joints))]
    _write(folder / "courses.csv", ["course", "height_m", "thickness_mm"], courses)
    return folder


def _write(path, heading, rows):
    with open(path, "w", newline="") as file:
        csv.writer(file).writerows([heading, *rows])
