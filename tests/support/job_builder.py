"""Builds small valid jobs for tests: a cylinder of R 6.5 m and H 9.5 m in five courses, and others.

    write_job(folder)                                  a folder with job.toml and CSV files
    write_job(folder, radius=6.48, sd_mm=3.0)
    write_job(folder, radius=lambda theta, z: 6.5 + 0.01 * np.cos(2 * theta), rings=2)
    write_job(folder, settings={"table.step_m": 0.1, "survey.side": "inside", "tank.owner": None})
    write_workbook(path, rings=2)                      the same as a workbook
    write_job(folder, deadwood=[("coil", 0.5, 1.0, -0.2)], roof={"mass_kg": 9000.0})
    write_job(folder, settings={"bottom.form": "cone", "bottom.centre_z_m": -0.15})
    write_job(folder, kind="horizontal", settings={"horizontal.tilt_mm_per_m": 5.0})
    write_job(folder, kind="mesh", mesh=stl_bytes)

`job_parts` gives the job as plain data (`Parts`), to be spoilt before `write_folder` or
`write_book` writes it.
"""

import csv
import dataclasses
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

SETTINGS = {
    "tank.id": "T-1",
    "tank.kind": "vertical",
    "tank.nominal_diameter_m": 13.0,
    "tank.nominal_height_m": 9.5,
    "survey.side": "outside",
    "survey.date": "2024-05-31",
    "datum.bottom_z_m": 0.0,
    "table.step_m": 0.01,
    "table.reference_temperature_c": 20.0,
    "table.monte_carlo": False,  # a second a run; tests of it set it
}

OF_KIND = {
    "vertical": {},
    "horizontal": {
        "survey.side": "inside",
        "horizontal.diameter_m": 2.4,
        "horizontal.length_m": 10.0,
        "horizontal.end_a": "flat",
        "horizontal.end_b": "flat",
    },
    "sphere": {"survey.side": "inside", "sphere.diameter_m": 20.0},
    "mesh": {"survey.side": None, "mesh.file": "tank.stl", "mesh.unit": "m"},
}
VERTICAL_ONLY = ("tank.nominal_diameter_m", "tank.nominal_height_m", "datum.bottom_z_m")
ROOF = {
    "mass_kg": 9000.0,
    "critical_bottom_m": 1.0,
    "critical_top_m": 1.3,
    "reference_density_kg_m3": 850.0,
    "weighing": "air",
}


@dataclass
class Parts:
    """A job as plain data: settings by dotted key, tables as rows with the headings first."""

    settings: dict
    tables: dict
    covariance_m2: np.ndarray | None = None
    extra_files: dict = field(default_factory=dict)  # name: text or bytes, folder form only
    beside: dict = field(default_factory=dict)  # name: bytes, in the folder or beside the workbook
    registers: dict = field(default_factory=dict)  # "cameras": {name: {key: value}}


def job_parts(
    *,
    radius=6.5,
    height=9.5,
    courses=5,
    rings=1,
    points_per_ring=24,
    thickness_mm=8.0,
    paint_mm=None,
    sd_mm=None,
    covariance_m2=None,
    noise_mm=0.0,
    jitter=0.0,
    seed=1,
    centre=(0.0, 0.0),
    tilt=(0.0, 0.0),
    extra_points=(),
    uncertainty=(),
    settings=None,
    kind="vertical",
    bottom=(),
    bottom_volumes=(),
    deadwood=(),
    welds=(),
    roof=None,
    mesh=None,
):
    """Parts of a job.

    radius           m: a number, one for each course, or a function r(theta, z) of arrays;
                     theta is the azimuth, rad, clockwise from +y, z the height above the bottom, m
    courses          their number (equal heights), or a list of heights, m
    rings            rings of points in each course, at the middles of equal parts of its height
    thickness_mm     a number or one for each course; so paint_mm
    sd_mm            of x, y and z: a number or three of them; None: columns left out
    noise_mm         sd of Gaussian noise added to every coordinate
    jitter           part of the point spacing by which azimuths scatter (uniform, plus or minus)
    centre, tilt     x and y of the axis at the bottom, m, and its slopes dx/dz, dy/dz
    extra_points     rows (name, x_m, y_m, z_m)
    uncertainty      rows (input, u, unit), or with type, distribution, dof
    settings         {dotted key: value}; None removes the key
    kind             "vertical", "horizontal" (2.4 x 10 m, flat ends), "sphere" (20 m), "mesh": the
                     others have no courses, and no points but the extra_points
    bottom           rows (x_m, y_m, z_m) or (x_m, y_m, z_m, s_mm)
    bottom_volumes   rows (level_m, volume_m3) or (level_m, volume_m3, u_m3)
    deadwood         rows (name, bottom_m, top_m, volume_m3) or with u_m3
    welds            rows (course, azimuth_deg)
    roof             {key: value} over the keys of ROOF; {}: ROOF as it is
    mesh             bytes of the file tank.stl, for kind "mesh"
    """
    heights = [height / courses] * courses if isinstance(courses, int) else list(courses)
    given = _settings(kind, heights, roof, settings)
    rows = []
    if kind == "vertical":
        rows = _wall(
            radius,
            heights,
            rings,
            points_per_ring,
            noise_mm,
            jitter,
            seed,
            centre,
            tilt,
            given.get("datum.bottom_z_m", 0.0),
        )
    rows += [list(row) for row in extra_points]
    headings = ["point", "x_m", "y_m", "z_m"]
    if sd_mm is not None:
        headings += ["sx_mm", "sy_mm", "sz_mm"]
        sds = [float(sd) for sd in np.broadcast_to(sd_mm, 3)]
        rows = [row + sds for row in rows]
    tables = {}
    if rows:
        tables["points"] = [headings, *rows]
    if kind == "vertical":
        tables["courses"] = _courses(heights, thickness_mm, paint_mm)
    for name, columns, its_rows in (
        ("uncertainty", "input u unit type distribution dof", uncertainty),
        ("bottom", "x_m y_m z_m s_mm", bottom),
        ("bottom", "level_m volume_m3 u_m3", bottom_volumes),
        ("deadwood", "name bottom_m top_m volume_m3 u_m3", deadwood),
        ("welds", "course azimuth_deg", welds),
    ):
        if its_rows:
            tables[name] = _table(columns.split(), its_rows)
    return Parts(given, tables, covariance_m2, beside={} if mesh is None else {"tank.stl": mesh})


def _settings(kind, heights, roof, settings):
    given = {**SETTINGS, "tank.kind": kind}
    if kind == "vertical":
        given["tank.nominal_height_m"] = round(sum(heights), 9)
    else:
        given = {key: value for key, value in given.items() if key not in VERTICAL_ONLY}
    given |= OF_KIND[kind]
    if roof is not None:
        given |= {f"roof.{key}": value for key, value in (ROOF | roof).items()}
    given |= settings or {}
    return {key: value for key, value in given.items() if value is not None}


def _wall(radius, heights, rings, points_per_ring, noise_mm, jitter, seed, centre, tilt, bottom_z):
    rng = np.random.default_rng(seed)
    rows, bottom = [], 0.0
    for number, course_height in enumerate(heights, 1):
        for ring in range(rings):
            z = bottom + (ring + 0.5) * course_height / rings
            theta = (
                2
                * np.pi
                / points_per_ring
                * (np.arange(points_per_ring) + jitter * rng.uniform(-1, 1, points_per_ring))
            )
            r = _radius(radius, number, theta, z)
            xyz = np.column_stack(
                [
                    centre[0] + tilt[0] * z + r * np.sin(theta),
                    centre[1] + tilt[1] * z + r * np.cos(theta),
                    np.full(points_per_ring, bottom_z + z),
                ]
            )
            xyz += rng.normal(0.0, noise_mm / 1000, xyz.shape)
            for place, point in enumerate(xyz, 1):
                rows.append([f"C{number}R{ring + 1}P{place}", *map(float, point)])
        bottom += course_height
    return rows


def _table(columns, rows):
    width = max(len(row) for row in rows)
    padded = [[*row, *[None] * (width - len(row))] for row in rows]
    return [columns[:width], *padded]


def _radius(radius, course, theta, z):
    if callable(radius):
        return radius(theta, np.full_like(theta, z))
    return np.full_like(theta, radius if np.isscalar(radius) else radius[course - 1])


def _courses(heights, thickness_mm, paint_mm):
    n = len(heights)
    columns = {
        "course": [str(number) for number in range(1, n + 1)],
        "height_m": heights,
        "thickness_mm": np.broadcast_to(thickness_mm, n).tolist(),
    }
    if paint_mm is not None:
        columns["paint_mm"] = np.broadcast_to(paint_mm, n).tolist()
    return [list(columns), *map(list, zip(*columns.values(), strict=True))]


def write_job(folder, **changes):
    """Write a job folder (see `job_parts` for the changes); returns its path."""
    return write_folder(folder, job_parts(**changes))


def write_workbook(path, **changes):
    """Write the same job as a workbook; returns its path."""
    return write_book(path, job_parts(**changes))


S_1 = (  # course: height, plate mm, readings at 20 and 80 % of it
    (1.8, 9.0, 45.3184, 45.3176),
    (1.8, 8.0, 45.3094, 45.3101),
    (1.8, 7.0, 45.3042, 45.3036),
    (1.5, 6.0, 45.2981, 45.2989),
    (1.5, 6.0, 45.2963, 45.2957),
)
TAPE = {
    "kind": "tape",
    "certificate": "T 12/2026",
    "certified_temperature_c": 20.0,
    "tension_n": 50.0,
    "expansion_per_k": 1.15e-5,
    "correction": 35e-6,
    "u_scale_ppm": 20.0,
    "thickness_mm": 0.2,
    "section_mm2": 2.5,
    "e_gpa": 206.0,
}


def strapped_parts(**settings):
    """Parts of tank S-1, strapped at two levels of each course; settings with dots for "__"."""
    heights = [row[0] for row in S_1]
    given = {
        **SETTINGS,
        "tank.id": "S-1",
        "tank.nominal_diameter_m": 14.4,
        "tank.nominal_height_m": 8.4,
        "survey.side": "outside",
        "survey.shell_temperature_c": 31.0,
        "table.reference_temperature_c": 20.0,
        "material.e_gpa": 206.0,
        "material.expansion_per_k": 1.1e-5,
        "shell.shape_sd_mm": 0.0,
        "table.step_m": 0.1,
    } | {key.replace("__", "."): value for key, value in settings.items()}
    bottoms = np.concatenate([[0.0], np.cumsum(heights)])
    straps = [["circumference", "course", "level_m", "reading_m", "s_mm", "tension_n"]]
    for number, (height, _, *readings) in enumerate(S_1, 1):
        for letter, part, reading in zip("ab", (0.2, 0.8), readings, strict=True):
            level = round(float(bottoms[number - 1]) + part * height, 6)
            straps.append([f"{number}{letter}", str(number), level, reading, 0.5, 60.0])
    obstructions = [
        ["circumference", "kind", "count", "thickness_mm", "width_mm", "excess_mm"],
        ["1a", "butt_strap", 4.0, 9.0, 120.0, None],
        ["1b", "butt_strap", 4.0, 9.0, 120.0, None],
        ["2b", "measured", None, None, None, 2.3],
    ]
    tables = {
        "courses": _courses(heights, [row[1] for row in S_1], 0.25),
        "circumferences": straps,
        "obstructions": obstructions,
    }
    given = {key: value for key, value in given.items() if value is not None}
    return Parts(given, tables, registers={"instruments": {"T-12": dict(TAPE)}})


LEVELS_B = {0.45: ["201.0 203.2 202.2 197.8 198.4 203.0 196.0 202.6 202.4 199.7"],
            1.9: ["195.3 199.0 205.3 203.0 202.6 208.7 199.5 201.0 200.6 197.9",
                  "195.1 198.9 205.2 202.8 202.5 208.6 199.4 200.8 200.5 197.8"],
            3.6: ["189.1 195.3 207.4 209.8 209.9 213.4 201.8 201.9 199.5 193.6",
                  "188.8 195.1 207.1 209.5 209.6 213.1 201.5 201.7 199.3 193.3"],
            5.2: ["183.1 190.2 209.2 216.4 216.2 218.2 204.0 201.0 198.0 191.0",
                  "182.6 189.8 208.8 216.0 215.8 217.8 203.6 200.6 197.6 190.6"],
            7.0: ["175.3 183.9 211.7 224.5 222.8 222.1 206.0 200.8 196.7 187.4",
                  "174.7 183.3 211.1 223.9 222.3 221.5 205.4 200.3 196.1 186.8"]}  # fmt: skip


def plumbed_parts(**settings):
    """Parts of a tank of five courses strapped on the first one, and plumbed on ten lines."""
    parts = strapped_parts(
        **{
            "tank__id": "B-2",
            "tank__nominal_diameter_m": 10.45,
            "tank__nominal_height_m": 8.0,
            "survey__shell_temperature_c": 20.0,
        }
        | settings
    )
    offsets = [["line", "course", "level_m", "offset_mm", "s_mm", "face"]]
    for number, (level, faces) in enumerate(LEVELS_B.items(), 1):
        for face, text in enumerate(faces, 1):
            offsets += [
                [f"L{line}", str(number), level, float(reading), 0.5, face]
                for line, reading in enumerate(text.split(), 1)
            ]
    heights, thicknesses = [1.2, 1.7, 1.5, 1.7, 1.9], [7.0, 6.0, 6.0, 5.0, 5.0]
    parts.tables = {
        "courses": _courses(heights, thicknesses, 0.25),
        "circumferences": [
            ["circumference", "course", "level_m", "reading_m", "s_mm", "instrument"],
            *([name, "1", 0.45, 32.8673 + np.pi * 2e-4, 0.3, "T-12"] for name in ("1a", "1a")),
        ],
        "lines": [["line"], *([f"L{line}"] for line in range(1, 11))],
        "offsets": offsets,
    }
    parts.registers["instruments"]["T-12"] = {
        "kind": "tape",
        "thickness_mm": 0.2,
        "u_scale_ppm": 10.0,
    }
    parts.registers["instruments"]["ZL"] = {"kind": "plummet"}
    return parts


def write_strapped_job(folder, **settings):
    """Write tank S-1 as a job folder; returns its path."""
    return write_folder(folder, strapped_parts(**settings))


def write_folder(folder, parts):
    """Write Parts as a job folder, in the separator and decimal mark of its [csv] settings."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "job.toml").write_text(toml_text(parts.settings), encoding="utf-8")
    separator = parts.settings.get("csv.separator", ",")
    decimal = parts.settings.get("csv.decimal", ".")
    for name, rows in parts.tables.items():
        with open(folder / f"{name}.csv", "w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, delimiter=separator)
            writer.writerows([_csv_cell(cell, decimal) for cell in row] for row in rows)
    for register, entries in parts.registers.items():
        settings = {
            f'{register}."{name}".{key}': value
            for name, given in entries.items()
            for key, value in given.items()
        }
        (folder / f"{register}.toml").write_text(toml_text(settings), encoding="utf-8")
    if parts.covariance_m2 is not None:
        names = np.array([row[0] for row in parts.tables["points"][1:]])
        np.savez(folder / "points_cov.npz", covariance_m2=parts.covariance_m2, points=names)
    for name, content in (parts.extra_files | parts.beside).items():
        data = content.encode() if isinstance(content, str) else content
        (folder / name).write_bytes(data)
    return folder


def _csv_cell(cell, decimal):
    if isinstance(cell, float):
        return repr(float(cell)).replace(".", decimal)
    return "" if cell is None else cell


def toml_text(settings):
    """job.toml with one section after the other, keys in the order given."""
    sections = {}
    for dotted, value in settings.items():
        section, _, key = dotted.rpartition(".")
        sections.setdefault(section, []).append(f"{key} = {_toml_value(value)}")
    return "\n".join(
        line for section, lines in sections.items() for line in (f"[{section}]", *lines, "")
    )


def _toml_value(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(_toml_char(char) for char in escaped) + '"'
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml_value, value)) + "]"
    return repr(value)


def _toml_char(char):
    return f"\\u{ord(char):04x}" if ord(char) < 32 or ord(char) == 127 else char


def write_book(path, parts):
    """Write Parts as a workbook with the sheets job, points, courses, ..."""
    import xlsxwriter

    path = Path(path)
    for name, content in parts.beside.items():
        (path.parent / name).write_bytes(content)
    with xlsxwriter.Workbook(path) as book:
        rows = [["section", "key", "value"]]
        rows += [
            [*dotted.rpartition(".")[::2], _book_cell(value)]
            for dotted, value in parts.settings.items()
        ]
        _write_sheet(book.add_worksheet("job"), rows)
        for name, table in parts.tables.items():
            _write_sheet(book.add_worksheet(name), table)
        for register, entries in parts.registers.items():
            rows = [[register[:-1], "key", "value"]]
            rows += [
                [name, key, _book_cell(value)]
                for name, given in entries.items()
                for key, value in given.items()
            ]
            _write_sheet(book.add_worksheet(register), rows)
    return path


def _book_cell(value):
    """A list as the text of a cell: 700; 850, or 0-0.3; 2.1-2.4 for pairs."""
    if not isinstance(value, list):
        return value
    if all(isinstance(one, str) for one in value):
        return "; ".join(value)
    return "; ".join("-".join(map(repr, v)) if isinstance(v, list) else repr(v) for v in value)


def _write_sheet(sheet, rows):
    for number, row in enumerate(rows):
        for column, cell in enumerate(row):
            if isinstance(cell, str):
                sheet.write_string(number, column, cell)
            elif cell is not None:
                sheet.write(number, column, cell)


def assert_same_job(one, other):
    """The two jobs are equal but for where they come from: files, rows, name of the source."""
    for part in dataclasses.fields(one):
        if part.name not in ("files", "source", "warnings"):
            _assert_same(getattr(one, part.name), getattr(other, part.name), part.name)


def _assert_same(one, other, name):
    assert type(one) is type(other), name
    if isinstance(one, np.ndarray | float):
        np.testing.assert_allclose(one, other, rtol=1e-15)  # a workbook keeps 16 digits
    elif dataclasses.is_dataclass(one):
        for part in dataclasses.fields(one):
            if part.name not in ("rows", "row", "file", "meters_file", "sheet"):
                values = (getattr(one, part.name), getattr(other, part.name))
                _assert_same(*values, f"{name}.{part.name}")
    elif isinstance(one, dict):
        assert one.keys() == other.keys(), name
        for key in one:
            _assert_same(one[key], other[key], f"{name}[{key!r}]")
    elif isinstance(one, tuple):
        assert len(one) == len(other), name
        for a, b in zip(one, other, strict=True):
            _assert_same(a, b, name)
    else:
        assert one == other, name


def hit_parts(rows, **settings):
    """Parts of a tank of four courses of 2 m, R 6.5 m, hit from one set-up in it.

    rows  of wall_hits.csv, {column: value} each
    """
    given = {
        **SETTINGS,
        "tank.id": "E-1",
        "tank.nominal_diameter_m": 13.0,
        "tank.nominal_height_m": 8.0,
        "survey.side": "inside",
        "table.step_m": 0.1,
    } | {key.replace("__", "."): value for key, value in settings.items()}
    columns = list(dict.fromkeys(name for row in rows for name in row))
    tables = {
        "courses": _courses([2.0] * 4, 8.0, None),
        "setups": [["setup", "station", "instrument_height_m"], ["I", "SI", 1.5]],
        "wall_hits": [columns, *([row.get(name) for name in columns] for row in rows)],
    }
    tool = {"kind": "total_station", "s_mm": 1.0, "s_arcsec": 5.0, "u_offset_mm": 0.5}
    given = {key: value for key, value in given.items() if value is not None}
    return Parts(given, tables, registers={"instruments": {"TS": tool}})


def tangent_parts(rows, traverse, **settings):
    """Parts of a tank of four courses of 2 m, R 6.5 m, whose limbs were sighted from outside.

    rows      of tangents.csv, {column: value} each
    traverse  {table: its rows} of the network of the set-ups
    """
    given = {
        **SETTINGS,
        "tank.id": "TT-1",
        "tank.nominal_diameter_m": 13.0,
        "tank.nominal_height_m": 8.0,
        "table.step_m": 0.1,
        "adjustment.datum": "inner",
    } | {key.replace("__", "."): value for key, value in settings.items()}
    columns = list(dict.fromkeys(name for row in rows for name in row))
    setups = dict.fromkeys(row["setup"] for row in rows)
    tables = {
        "courses": _courses([2.0] * 4, 8.0, None),
        "setups": [
            ["setup", "station", "instrument", "instrument_height_m"],
            *([name, "S" + name[1:], "TS", 0.0] for name in setups),
        ],
        "tangents": [columns, *([row.get(name) for name in columns] for row in rows)],
        **traverse,
    }
    tool = {"kind": "total_station", "u_scale_ppm": 5.0, "certificate": "TS-7"}
    given = {key: value for key, value in given.items() if value is not None}
    return Parts(given, tables, registers={"instruments": {"TS": tool}})
