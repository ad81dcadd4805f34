"""Processor time of a strapping workbook to its table.

    python benchmarks/strapping.py

Eight courses of two straps each; `tankcal run --no-papers`. The goal: under 1 s for the job itself,
from the workbook to record and table on disk, with the simulation. A process that runs one job
needs the time to start and to import besides, and draws the walls of the area term once; the first
figure has all of it.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import xlsxwriter
from measured import ROUNDS, Row, tell

COURSES, HEIGHT_M = 8, 1.5
JOB = {
    "tank.id": "E-8",
    "tank.kind": "vertical",
    "tank.nominal_diameter_m": 14.4,
    "tank.nominal_height_m": COURSES * HEIGHT_M,
    "survey.side": "outside",
    "survey.date": "2026-05-20",
    "survey.shell_temperature_c": 31.0,
    "datum.bottom_z_m": 0.0,
    "table.reference_temperature_c": 20.0,
    "table.step_m": 0.1,
    "table.liquid_density_kg_m3": 850.0,
    "shell.shape_sd_mm": 5.0,
}
TAPE = {
    "kind": "tape", "thickness_mm": 0.2, "section_mm2": 2.6, "e_gpa": 206.0, "tension_n": 50.0,
    "expansion_per_k": 1.15e-5, "certified_temperature_c": 20.0,
    "u_scale_ppm": 20.0, "laying_mm": 0.5,
}  # fmt: skip


TWICE = """
import time
from tankcal.cli import main
for number in range(2):
    begin = time.process_time()
    status = main(["run", {book!r}, "--no-papers", "--quiet", "--out", f"{folder}/{{number}}"])
    assert status == 0
print(time.process_time() - begin)
"""


def write_workbook(path):
    """A workbook of eight courses with two straps each."""
    rng = np.random.default_rng(8)
    straps = [
        [f"{i + 1}{letter}", str(i + 1), (i + part) * HEIGHT_M,
         round(45.25 + 0.002 * rng.normal(), 4), 0.5, 60.0]
        for i in range(COURSES)
        for letter, part in (("a", 0.2), ("b", 0.8))
    ]  # fmt: skip
    sheets = {
        "job": [["section", "key", "value"],
                *([*one.split("."), value] for one, value in JOB.items())],
        "courses": [["course", "height_m", "thickness_mm"],
                    *([str(i + 1), HEIGHT_M, 8.0] for i in range(COURSES))],
        "circumferences": [
            ["circumference", "course", "level_m", "reading_m", "s_mm", "tension_n"], *straps
        ],
        "instruments": [["instrument", "key", "value"], *(["T", *one] for one in TAPE.items())],
    }  # fmt: skip
    with xlsxwriter.Workbook(path) as book:
        for name, rows in sheets.items():
            sheet = book.add_worksheet(name)
            for place, row in enumerate(rows):
                sheet.write_row(place, 0, row)


def main():
    """Rows of a process, and of a second run in one."""
    with tempfile.TemporaryDirectory() as folder:
        book = Path(folder) / "tank.xlsx"
        write_workbook(book)
        alone, again = [], []
        for _ in range(ROUNDS):
            before = _spent()
            again.append(float(_python(TWICE.format(book=str(book), folder=folder))))
            whole = _spent() - before
            alone.append(whole - again[-1])
    for name, seconds in (("process of one run", alone), ("second run in a process", again)):
        tell(Row(f"strapping workbook, {name}", f"{COURSES} courses", tuple(seconds)))


def _python(code):
    """What a Python process prints last."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    return done.stdout.splitlines()[-1]


def _spent():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
