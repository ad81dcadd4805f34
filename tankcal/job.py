"""The job: what the user hands in, read, checked and converted to SI (docs/job-format.md)."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tankcal.checks import (
    check_courses,
    check_geometry,
    check_inputs,
    check_points,
    check_settings,
)
from tankcal.contract import COLUMNS, INPUT_UNITS
from tankcal.covariance import read_covariance
from tankcal.entries import read_columns, read_settings
from tankcal.folder import read_folder
from tankcal.sheets import expected_sheets, read_workbook
from tankcal.tables import (
    COVARIANCE_FILE,
    OPTIONAL_TABLES,
    SETTINGS_FILE,
    TABLES,
    Log,
)


@dataclass(frozen=True)
class Tank:
    """The tank: `id`, `kind` ("vertical"), nominal sizes in m, and what is printed about it."""

    id: str
    kind: str
    nominal_diameter_m: float
    nominal_height_m: float
    details: dict  # owner, location, product, ...: text, printed when given


@dataclass(frozen=True)
class Survey:
    """The survey: `side` "outside" or "inside", `date` ISO text, temperatures in degC, or None."""

    side: str
    date: str
    shell_temperature_c: float | None = None
    liquid_level_m: float | None = None
    liquid_density_kg_m3: float | None = None


@dataclass(frozen=True)
class Datum:
    """Heights of the bottom of the first course and of the dip plate in the survey's frame, m."""

    bottom_z_m: float
    dip_plate_z_m: float | None = None  # None: the table's zero is the bottom
    dip_x_m: float | None = None
    dip_y_m: float | None = None
    reference_height_m: float | None = None


@dataclass(frozen=True)
class TableSpec:
    """What the capacity table is to be: row step m, reference temperature degC, coverage."""

    step_m: float
    reference_temperature_c: float
    liquid_density_kg_m3: float = 0.0
    coverage_probability: float = 0.95
    rule: str | None = None
    minimum_delivery_m: float | None = None
    language: str = "en"


@dataclass(frozen=True)
class Material:
    """The shell's steel: Young's modulus Pa, thermal expansion 1/K."""

    e_pa: float = 206e9
    expansion_per_k: float = 1.1e-5
    given: bool = False  # False: the default was taken, and the report says so


@dataclass(frozen=True)
class Course:
    """One ring of plates, from the bottom up: height, plate and paint thickness, m."""

    name: str
    height_m: float
    thickness_m: float
    paint_m: float = 0.0


@dataclass(frozen=True)
class Points:
    """Surveyed points, in the order of the file.

    names       (n,) text            rows        (n,) row of each in its file, for messages
    xyz_m       (n, 3) coordinates   covariance_m2  (3n, 3n), or None: not given
    sd_m        (n, 3) standard deviations, or None: not given (estimated from residuals)
    section     (n,) text or None: given section name
    generatrix  (n,) text or None
    """

    names: tuple
    xyz_m: np.ndarray
    sd_m: np.ndarray | None
    covariance_m2: np.ndarray | None
    section: tuple
    generatrix: tuple
    rows: tuple


@dataclass(frozen=True)
class DeclaredInput:
    """One row of uncertainty.csv: a standard uncertainty that the survey itself does not carry.

    u is SI (dimensionless for "scale", m, K, 1/K); `unit` and `u_as_read` are as the user wrote.
    """

    name: str
    u: float
    unit: str
    u_as_read: float
    type: str = "B"
    distribution: str = "normal"
    dof: float = np.inf
    note: str = ""


@dataclass(frozen=True)
class InputFile:
    """Name, size and SHA-256 of one file that the job was read from."""

    file: str
    sha256: str
    bytes: int


@dataclass(frozen=True)
class Job:
    """A checked job, all in SI; `load` makes it, `tankcal.run` computes it."""

    tank: Tank
    survey: Survey
    datum: Datum
    table: TableSpec
    material: Material
    courses: tuple[Course, ...]
    points: Points
    inputs: tuple[DeclaredInput, ...] = ()
    certificate: dict = field(default_factory=dict)  # text, printed when given, never invented
    snooping: bool = True
    scale: str = "a_priori"
    files: tuple[InputFile, ...] = ()
    warnings: tuple = ()  # Problem rows that do not stop the job
    source: str = ""


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
        check_inputs(inputs, log)
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
    return Material(**si, given=bool(given))


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
