"""From a folder or a workbook to a checked `Job`, or to every problem that it has."""

from pathlib import Path

import numpy as np

from tankcal.job.checks import (
    check_courses,
    check_geometry,
    check_inputs,
    check_points,
    check_settings,
)
from tankcal.job.contract import COLUMNS, INPUT_UNITS
from tankcal.job.covariance import read_covariance
from tankcal.job.entries import read_columns, read_settings
from tankcal.job.folder import read_folder
from tankcal.job.model import (
    Course,
    Datum,
    DeclaredInput,
    InputFile,
    Job,
    Material,
    Points,
    Survey,
    TableSpec,
    Tank,
)
from tankcal.job.sheets import expected_sheets, read_workbook
from tankcal.job.tables import (
    COVARIANCE_FILE,
    OPTIONAL_TABLES,
    SETTINGS_FILE,
    TABLES,
    Log,
)


def load(path):
    """The Job in a folder, in the folder of a job.toml, or in a workbook (.xlsx).

    Raises InputError with every problem of the input, each with its file, row and column.
    """
    log = Log()
    raw = _read(Path(path), log)
    if raw is None:
        log.stop_if_problems()
    tables = _read_tables(raw, log)
    values = read_settings(raw, log) if raw.settings is not None else None
    covariance = _check(values, tables, raw, log)
    log.stop_if_problems()
    return _make_job(raw, values, tables, covariance, tuple(log.warnings))


def _read(path, log):
    """RawJob, or None after telling `log` what `path` is instead of a job."""
    expected = "expected a job folder, its job.toml or a workbook (.xlsx)"
    try:
        if path.is_dir():
            return read_folder(path, log)
        if path.name == SETTINGS_FILE and path.is_file():
            return read_folder(path.parent, log)
        if path.suffix.lower() == ".xlsx" and path.is_file():
            return read_workbook(path, log)
        found = f"found a {path.suffix or 'nameless'} file" if path.exists() else "not found"
    except (OSError, ValueError):
        found = "an impossible name"
    log.problem(path.name or ".", f"{found}; {expected}")
    return None


def _read_tables(raw, log):
    """{name: ColumnValues}, None for a table that is missing or cannot be read."""
    tables = {}
    for name in TABLES:
        table = raw.tables.get(name)
        tables[name] = None if table is None else read_columns(name, table, log)
        if name not in raw.tables and name not in OPTIONAL_TABLES:
            if raw.file_of(name).startswith("sheet "):
                expected = f"missing sheet; {expected_sheets()}"
            else:
                needed = ", ".join(field.name for field in COLUMNS[name] if field.required)
                expected = f"missing file; expected one with the columns {needed}"
            log.problem(raw.file_of(name), expected)
    return tables


def _check(values, tables, raw, log):
    """All checks that the readable parts allow; returns the covariance, m2, or None."""
    points, courses, inputs = (tables[name] for name in TABLES)
    covariance = None
    if values is not None:
        check_settings(values, raw, log)
    if courses is not None and values is not None:
        check_courses(courses, values, log)
    if points is not None:
        check_points(points, log)
        if raw.covariance is not None:
            covariance = read_covariance(raw.covariance, points.of("point"), log)
            if points.columns["sx_mm"] is not None:
                expected = "given beside sx_mm, sy_mm, sz_mm of the points; expected one of them"
                log.problem(COVARIANCE_FILE, expected)
    if points is not None and values is not None:
        check_geometry(points, courses, values, raw, log)
    if inputs is not None:
        check_inputs(inputs, values, log)
    return covariance


def _make_job(raw, values, tables, covariance, warnings):
    tank = dict(values["tank"])
    id, kind, diameter, height = (
        tank.pop(key) for key in ("id", "kind", "nominal_diameter_m", "nominal_height_m")
    )
    adjustment = values["adjustment"]
    return Job(
        tank=Tank(id, kind, diameter, height, _given(tank)),
        survey=Survey(**values["survey"]),
        datum=Datum(**values["datum"]),
        table=TableSpec(**_given(values["table"]) | {"language": "en"}),
        material=_material(values["material"]),
        courses=_courses(tables["courses"]),
        points=_points(tables["points"], covariance),
        inputs=_inputs(tables["uncertainty"]),
        certificate=_given(values["certificate"]),
        snooping=adjustment["snooping"] is not False,
        scale=adjustment["scale"] or "a_priori",
        files=tuple(InputFile(*file) for file in raw.files),
        warnings=warnings,
        source=raw.source,
    )


def _given(values):
    return {key: value for key, value in values.items() if value is not None}


def _material(values):
    given = _given(values)
    si = {"e_pa": 1e9 * given["e_gpa"]} if "e_gpa" in given else {}
    if "expansion_per_k" in given:
        si["expansion_per_k"] = given["expansion_per_k"]
    return Material(**si, expansion_given="expansion_per_k" in given)


def _courses(table):
    columns = (table.of(name) for name in ("course", "height_m", "thickness_mm", "paint_mm"))
    return tuple(
        Course(name, height_m, thickness_mm / 1000, (paint_mm or 0.0) / 1000)
        for name, height_m, thickness_mm, paint_mm in zip(*columns, strict=True)
    )


def _points(table, covariance):
    sd_m = None
    if table.columns["sx_mm"] is not None:
        sd_m = np.column_stack([table.of(f"s{axis}_mm") for axis in "xyz"]).astype(float) / 1000
    return Points(
        names=tuple(table.of("point")),
        xyz_m=np.column_stack([table.of(f"{axis}_m") for axis in "xyz"]).astype(float),
        sd_m=sd_m,
        covariance_m2=covariance,
        section=tuple(table.of("section")),
        generatrix=tuple(table.of("generatrix")),
        rows=table.rows,
    )


def _inputs(table):
    if table is None:
        return ()
    names = ("input", "u", "unit", "type", "distribution", "dof", "note")
    return tuple(
        DeclaredInput(
            name=name,
            u=u / INPUT_UNITS[name][1],
            unit=unit,
            u_as_read=u,
            type=type or "B",
            distribution=distribution or "normal",
            dof=np.inf if dof is None else dof,
            note=note or "",
        )
        for name, u, unit, type, distribution, dof, note in zip(
            *(table.of(name) for name in names), strict=True
        )
    )
