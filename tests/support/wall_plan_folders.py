"""Folders of plans of the bare wall made from the examples, and their empty jobs filled in."""

import csv

import numpy as np
from conftest import EXAMPLE
from plan_folders import changed_plan

LINES, HITS, TANGENTS = (
    EXAMPLE.parent / f"plan-{name}" for name in ("reference-line", "wall-hits", "tangents")
)
BAR_M = 2.0


def plan_of(folder, source=LINES, *pairs):
    """The folder of a shipped plan of the bare wall, with texts of its plan.toml replaced."""
    return changed_plan(folder, *pairs, source=source)


def with_bar(folder, *pairs):
    """The example by tangents whose traverse has a stadia in place of its distances."""
    plan_of(folder, TANGENTS, ("s_mm = 0.5", "s_bar_arcsec = 1"), *pairs)
    with open(folder / "instruments.toml", "a", encoding="utf-8") as file:
        file.write(f'\n[instruments."bar 1"]\nkind = "stadia"\nlength_m = {BAR_M}\nu_mm = 0.05\n')
    return folder


def fill(folder, job, settings):
    """Fill an empty job in with the readings of a Job, row by row."""
    text = (folder / "job.toml").read_text(encoding="utf-8")
    for key, value in settings.items():
        text = "\n".join(
            f"{key} = {value}" if line.startswith(f"{key} = ") else line
            for line in text.splitlines()
        )
    (folder / "job.toml").write_text(text, encoding="utf-8")
    values = {}
    if job.strapping is not None:
        values["circumferences"] = [{"reading_m": one.reading_m} for one in job.strapping.straps]
    if job.tangents is not None:
        rows = zip(job.tangents.direction_rad, job.tangents.zenith_rad, strict=True)
        values["tangents"] = [
            {"direction_deg": np.degrees(a), "zenith_deg": np.degrees(z)} for a, z in rows
        ]
        for one in job.measurements.readings:
            if one.table == "distances":  # of a stadia
                angles = np.degrees(2 * np.arctan(BAR_M / 2 / one.value))
                values["stadia"] = [{"angle_deg": angle} for angle in angles]
                continue
            key = {"directions": "direction_deg", "zenith_angles": "zenith_deg"}.get(one.table)
            read = one.value if key is None else np.degrees(one.value)
            values[one.table] = [{key or "distance_m": value} for value in read]
    if job.lines is not None:
        values["offsets"] = [{"offset_mm": 1000 * one.offset_m} for one in job.lines.offsets]
    if job.hits is not None:
        hits = job.hits
        rows = zip(hits.direction_rad, hits.zenith_rad, hits.distance_m, strict=True)
        values["wall_hits"] = [
            {"direction_deg": np.degrees(a), "zenith_deg": np.degrees(z), "distance_m": d}
            for a, z, d in rows
        ]
    if job.hits is not None:
        values["control_readings"] = [
            {"direction_deg": np.degrees(one.direction_rad), "time": f"2026-07-01T09:{k:02d}"}
            for k, one in enumerate(job.hits.control)
        ]
    for name, read in values.items():
        path = folder / f"{name}.csv"
        lines = [one for one in path.read_text(encoding="utf-8").splitlines() if one[0] != "#"]
        headings, *rows = csv.reader(lines)
        assert len(rows) == len(read)
        for row, one in zip(rows, read, strict=True):
            for key, value in one.items():
                row[headings.index(key)] = value if key == "time" else repr(float(value))
        with open(path, "w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([headings, *rows])
