"""From a folder or a workbook to a checked `Job`, or to every problem that it has."""

from pathlib import Path

from tankcal.job.attached import read_mesh_file
from tankcal.job.checks import check_all
from tankcal.job.contract import COLUMNS, REQUIRED_TABLES, TABLES_OF_KIND
from tankcal.job.covariance import read_covariance
from tankcal.job.entries import kind_of, read_columns, read_settings
from tankcal.job.folder import read_folder
from tankcal.job.making import make_job
from tankcal.job.sheets import expected_sheets, read_workbook
from tankcal.job.tables import COVARIANCE_FILE, SETTINGS_FILE, TABLES, Log


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
    check_all(values, tables, raw, log)
    covariance = _covariance(raw, tables["points"], log)
    mesh = None
    if values is not None and values["mesh"]["file"] is not None:
        mesh = read_mesh_file(raw.folder, values["mesh"]["file"], log)
    log.stop_if_problems()
    return make_job(raw, values, tables, covariance, mesh, tuple(log.warnings))


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
    """{name: ColumnValues}, None for a table that is missing, cannot be read or does not belong."""
    kind = kind_of(raw)
    tables = {}
    for name in TABLES:
        table = raw.tables.get(name)
        if kind is not None and name not in TABLES_OF_KIND[kind]:
            if table is not None and (table.rows or table.skipped):
                log.problem(table.file, f"not for a tank of kind {kind}; remove the table")
            tables[name] = None
            continue
        tables[name] = None if table is None else read_columns(name, table, log)
        if name not in raw.tables and name in REQUIRED_TABLES.get(kind, ()):
            log.problem(raw.file_of(name), _missing(raw, name))
    return tables


def _missing(raw, name):
    if raw.file_of(name).startswith("sheet "):
        return f"missing sheet; {expected_sheets()}"
    needed = ", ".join(field.name for field in COLUMNS[name] if field.required)
    return f"missing file; expected one with the columns {needed}"


def _covariance(raw, points, log):
    """The full covariance of the points, m2, or None: not given, or told to `log`."""
    if raw.covariance is None:
        return None
    if points is None:
        expected = "given without points that it belongs to; expected points.csv beside it"
        log.problem(COVARIANCE_FILE, expected)
        return None
    if points.columns["sx_mm"] is not None:
        expected = "given beside sx_mm, sy_mm, sz_mm of the points; expected one of them"
        log.problem(COVARIANCE_FILE, expected)
    return read_covariance(raw.covariance, points.of("point"), log)
