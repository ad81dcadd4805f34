"""Writing of imported tables to the folder of a job, all or nothing.

A table with headings only, as written by `tankcal new`, is filled in. A table with rows is kept and
the import is refused, unless it is to be replaced.
"""

import io
import os
import shutil
import tempfile
from pathlib import Path

from tankcal.job.contract import COLUMNS
from tankcal.job.folder import csv_marks, read_toml
from tankcal.job.tables import SETTINGS_FILE, Log, read_bytes
from tankcal.messages import message
from tankcal.products.fieldbooks.rows import CONTRACT, needed_columns
from tankcal.text.delimited import write_guarded


def write_tables(folder, tables, *, replace):
    """Write {table: rows} to a folder; return (paths, names of other tables with rows).

    Raises InputError if the folder is a file, or if a table already contains rows.
    """
    folder = Path(folder)
    filled_tables = find_filled_tables(folder, CONTRACT)
    refuse_filled(folder, [] if replace else [name for name in filled_tables if name in tables])
    grids = {name: _make_grid(name, rows) for name, rows in tables.items()}
    paths = write_grids(folder, grids)
    return paths, [table for table in filled_tables if table not in tables]


def find_filled_tables(folder, names):
    """Return the tables of a job folder that contain rows."""
    return [name for name in names if _has_rows(folder / f"{name}.csv")]


def refuse_filled(folder, names):
    """Raise InputError if the folder is a file, or for tables that are not to be replaced."""
    log = Log()
    if folder.exists() and not folder.is_dir():
        text = message("import_into_file", "is a file; expected the folder of a job")
        log.problem(folder.name, text)
    for name in names:
        text = message(
            "table_stands",
            "already contains rows and is left unchanged; expected an empty table, or --replace",
        )
        log.problem(f"{name}.csv", text)
    log.stop_if_problems()


def write_grids(folder, grids, others=None):
    """Write {table: rows of cells with decimal points} and {name: text}; return the paths."""
    log = Log()
    separator, decimal = _marks(folder, log)
    log.stop_if_problems()
    texts = {
        f"{name}.csv": _comments(folder / f"{name}.csv") + _text(name, grid, separator, decimal)
        for name, grid in grids.items()
    }
    _write_files(folder, texts | (others or {}))
    return [folder / name for name in texts]


def _marks(folder, log):
    """Return separator and decimal mark of the job in the folder."""
    if not (folder / SETTINGS_FILE).is_file():
        return ",", "."
    data = read_bytes(folder / SETTINGS_FILE, log)
    settings = None if data is None else read_toml(SETTINGS_FILE, data, log)[0]
    return csv_marks(SETTINGS_FILE, settings or {}, log) or (",", ".")


def _lines(path):
    try:
        return path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError:
        return []


def _has_rows(path):
    """Return whether a file contains more than comments and headings."""
    return sum(bool(line.strip(" ,;\t")) and not line.startswith("#") for line in _lines(path)) > 1


def _comments(path):
    """Return the comments at the head of a table that is filled in."""
    if _has_rows(path):
        return ""
    return "".join(f"{line}\n" for line in _lines(path) if line.startswith("#"))


def _make_grid(name, rows):
    columns = needed_columns(name, rows)
    return [columns, *([row.cells.get(column, "") for column in columns] for row in rows)]


def _text(name, grid, separator, decimal):
    (columns, *rows), stream = grid, io.StringIO()
    numbers = {field.name for field in COLUMNS[name] if field.kind == "number"}
    written = [columns]
    for cells in rows:
        if decimal == ",":
            cells = [
                cell.replace(".", ",") if column in numbers else cell
                for column, cell in zip(columns, cells, strict=True)
            ]
        written.append(cells)
    write_guarded(stream, written, separator)
    return stream.getvalue()


def _write_files(folder, texts):
    """Write the files to a temporary folder, then move all of them into the folder."""
    target = folder.resolve()
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=".tankcal-", dir=target.parent))
    try:
        for name, text in texts.items():
            (temporary / name).write_text(text, encoding="utf-8", newline="")
        if not target.exists():
            temporary.chmod(0o755)
            temporary.rename(target)
            return
        _move_all(temporary, target, texts)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _move_all(temporary, target, names):
    """Move files into a folder; restore the previous state if a move fails."""
    kept, done = temporary / "before", []
    kept.mkdir()
    try:
        for name in names:
            if (target / name).exists():
                shutil.copy2(target / name, kept / name)
            os.replace(temporary / name, target / name)
            done.append(name)
    except OSError:
        for name in done:
            if (kept / name).exists():
                os.replace(kept / name, target / name)
            else:
                (target / name).unlink(missing_ok=True)
        raise
