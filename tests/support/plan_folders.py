"""Folders of plans made from the example, and empty jobs of plans filled in."""

import csv
import re

import numpy as np
import openpyxl
from conftest import EXAMPLE
from filled_forms import fill_form, first_row, headings_of

PLAN = EXAMPLE.parent / "plan-silva"
MEASURED_DAY = "2025-03-04"


def changed_plan(folder, *pairs, source=PLAN):
    """A shipped plan in `folder`, the example's or another, with texts of plan.toml replaced."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in source.iterdir():
        (folder / path.name).write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    text = (folder / "plan.toml").read_text(encoding="utf-8")
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    (folder / "plan.toml").write_text(text, encoding="utf-8")
    return folder


def with_setups(folder):
    """The example with six set-ups in place of photographs and tapes."""
    text = (PLAN / "plan.toml").read_text()
    head, rest = text.split("[[photo_rings]]")
    tail = rest[rest.index("[limits]") :]
    ring = (
        '[[setup_rings]]\ninstrument = "TS"\nstations = 6\ndistance_m = 8.0\nheights_m = [1.5]\n'
        "s_direction_arcsec = 3.0\ns_zenith_arcsec = 3.0\ns_mm = 1.0\nsets = 2\n\n"
    )
    (folder / "plan.toml").write_text(head + ring + tail)
    (folder / "instruments.toml").write_text('[instruments.TS]\nkind = "total_station"\n')
    (folder / "control.csv").write_text(
        "point,x_m,y_m,z_m,sx_mm,sy_mm,sz_mm\n1-1,,,,1,1,1\n9-5,,,,1,1,1\n17-1,,,,1,1,1\n"
    )
    for name in ("courses.csv", "uncertainty.csv"):
        (folder / name).write_text((PLAN / name).read_text())
    return folder


def with_stadia(folder, rows="T1-1,T1-2,1,2\nT1-2,T1-1,1,2\n"):
    """Three theodolites within a tank of no example, and a bar between two of them; its rows."""
    (folder / "plan.toml").write_text(TRIANGULATION)
    (folder / "courses.csv").write_text("course,height_m,thickness_mm\n1,2.1,9\n2,2.3,8\n3,1.9,6\n")
    (folder / "instruments.toml").write_text(
        '[instruments.TH]\nkind = "theodolite"\n\n[instruments."bar 1"]\nkind = "stadia"\n'
        f"length_m = {BAR_M}\nu_mm = 0.03\n"
    )
    if rows:
        (folder / "stadia.csv").write_text("setup,to,s_arcsec,readings\n" + rows)
    return folder


BAR_M = 2.0
TRIANGULATION = """
[tank]
id = "TRI-7"
kind = "vertical"
nominal_diameter_m = 17.3
nominal_height_m = 6.3

[survey]
side = "inside"
date = 2026-10-05
shell_temperature_c = 26

[datum]
bottom_z_m = 10.0

[table]
step_m = 0.1
reference_temperature_c = 20
liquid_density_kg_m3 = 0

[adjustment]
datum = "inner"

[pattern]
generatrices = 10
levels = 1

[[setup_rings]]
instrument = "TH"
stations = 3
radius_m = 3.7
heights_m = [1.6]
s_direction_arcsec = 3
s_zenith_arcsec = 4

[costs]
setup = 50
base = 10
reading = 1
"""


def values_of(measurements):
    """{table: {names: {column: value}}} of measurements that have values, in units of a job."""
    found = {"control": {}}
    for one in measurements.readings:
        if one.file == "stadia.csv":
            found["stadia"] = {
                (start, end): {"angle_deg": float(np.degrees(2 * np.arctan(BAR_M / 2 / value)))}
                for start, end, value in zip(one.start, one.end, one.value, strict=True)
            }
            continue
        unit = {"distances": "distance_m", "slope_distances": "distance_m"} | {
            "directions": "direction_deg", "zenith_angles": "zenith_deg",
            "height_differences": "dz_m", "plumb_lines": None,
        }  # fmt: skip
        column = unit[one.table]
        angle = column in ("direction_deg", "zenith_deg")
        starts = one.setup or one.start
        found[one.table] = {
            (start, end): {column: float(np.degrees(value) if angle else value)}
            for start, end, value in zip(starts, one.end, one.value, strict=True)
        }
    known = measurements.control
    for name, xyz, sd in (
        () if known is None else zip(known.point, known.xyz_m, known.sd_m, strict=True)
    ):
        found["control"][name,] = {
            f"{axis}_m": float(x)
            for axis, x, s in zip("xyz", xyz, sd, strict=True)
            if np.isfinite(s)
        }
    return found


def image_rows(measurements):
    """Rows of image_points.csv, headings first."""
    images = measurements.image_points
    if images is None:
        return []
    names = zip(images.photo, images.point, images.xy_mm.tolist(), strict=True)
    rows = [[photo, point, *map(repr, xy)] for photo, point, xy in names]
    return [["photo", "point", "x_mm", "y_mm"], *rows]


SETTINGS = {
    "survey.date": MEASURED_DAY,
    "survey.shell_temperature_c": 26.0,
    "datum.bottom_z_m": 10.0,
}


def fill_folder(folder, measurements):
    """Fill the empty job in `folder` as somebody does with a text editor."""
    text = (folder / "job.toml").read_text(encoding="utf-8")
    for name, value in SETTINGS.items():
        key = name.partition(".")[2]
        shown = f'"{value}"' if isinstance(value, str) else value
        text, count = re.subn(rf'(?m)^{key} = "" ', f"{key} = {shown} ", text)
        assert count == 1
    (folder / "job.toml").write_text(text, encoding="utf-8")
    for table, values in values_of(measurements).items():
        _fill_table(folder / f"{table}.csv", values)
    if measurements.image_points is not None:
        with open(folder / "image_points.csv", "w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(image_rows(measurements))


def _fill_table(path, values):
    lines = path.read_text(encoding="utf-8").splitlines()
    notes = [line for line in lines if line.startswith("#")]
    headings, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    with open(path, "w", newline="", encoding="utf-8") as file:
        file.write("\n".join(notes) + "\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(headings)
        for row in rows:
            for column, value in values[names_of(headings, row)].items():
                if column is not None:
                    row[headings.index(column)] = repr(value)
            writer.writerow(row)


def names_of(headings, row):
    """What a row is of: its point, or both ends of its reading."""
    keys = ("point",) if "point" in headings else ("setup", "to")
    keys = ("from", "to") if "from" in headings else keys
    return tuple(row[headings.index(key)] for key in keys)


def fill_workbook(path, measurements):
    """Fill the empty job in a workbook as somebody does with a spreadsheet."""
    headings, *rows = image_rows(measurements) or [()]
    points = [[photo, point, float(x), float(y)] for photo, point, x, y in rows]
    fill_form(path, SETTINGS, {"image_points": [headings, *points]} if rows else {})
    book = openpyxl.load_workbook(path)
    for table, values in values_of(measurements).items():
        sheet = book[table]
        columns, _ = headings_of(sheet)
        headings = list(columns)
        for number in range(first_row(sheet), sheet.max_row + 1):
            row = [sheet.cell(number, columns[name]).value for name in headings]
            if not any(row):
                break
            for column, value in values[names_of(headings, row)].items():
                sheet.cell(number, columns[column]).value = value
    book.save(path)
