"""Read any file as grids of cells: CSV, Excel workbook, text of a PDF, or record."""

import csv
import json
from dataclasses import dataclass

from tankcal.job.excel import Unreadable, read_sheets
from tankcal.job.folder import decode, has_too_many_lines, is_row, split_lines
from tankcal.job.sheets import is_read
from tankcal.job.tables import MAX_COLUMNS, read_bytes, shown, too_many_columns
from tankcal.linter.pdf_grids import tables_of_text
from tankcal.linter.pdf_text import pages_of
from tankcal.messages import message
from tankcal.record import FORMAT, version_of
from tankcal.text.delimited import find_separator, split_cells

MOST_LINES = 100_000


@dataclass(frozen=True)
class Grid:
    """Cells of a sheet as written.

    Attributes
    ----------
    name : str
        File, or file and sheet, as shown in messages.
    rows : tuple
        (row number, cells) of each row that is not blank.
    is_text : bool
        CSV: every number is text, and a row wider than its heading is an error.
    sheet : str
        Name of the sheet.
    """

    name: str
    rows: tuple
    is_text: bool = False
    sheet: str | None = None


def read_grids(path, log):
    """Return the `Grid`s of a file; () after reporting to `log` why it cannot be read."""
    if not path.exists():
        log.problem(
            path.name,
            message(
                "lint_not_found",
                "not found; expected a CSV file, a workbook (.xlsx), a PDF or a record.json",
            ),
        )
        return ()
    data = read_bytes(path, log)
    if data is None:
        return ()
    if data[:5] == b"%PDF-" or path.suffix.lower() == ".pdf":
        return _pdf(path, log)
    if data[:2] == b"PK" or data[:4] == b"\xd0\xcf\x11\xe0" or path.suffix.lower() == ".xlsx":
        return _workbook(path.name, data, log)
    text = decode(path.name, data, log, or_western=path.suffix.lower() != ".json")
    if text is None:
        return ()
    if path.suffix.lower() == ".json" or text.lstrip()[:1] == "{":
        return _record(path.name, text, log)
    return _csv(path.name, text, log)


def _pdf(path, log):
    tables = tables_of_text(pages_of(path, log) or ())
    longest = max(tables, key=len, default=())
    for rows in tables:
        if rows is not longest and len(rows) > 1:
            text = message(
                "lint_other_table",
                "another table of heights and volumes begins here; only the longest is read",
            )
            log.warning(path.name, text, rows[0][0])
    return tuple(Grid(path.name, tuple(rows), True) for rows in tables)


def _workbook(file, data, log):
    try:
        sheets = read_sheets(data, is_read)
    except Unreadable as reason:
        log.problem(file, reason.args[0])
        return ()
    return tuple(
        Grid(
            message("lint_sheet", "{file}, sheet {sheet}", file=file, sheet=sheet.title),
            tuple((number, tuple(cells)) for number, cells in sheet.grid.rows),
            sheet=sheet.title,
        )
        for sheet in sheets
        if sheet.grid.rows
    )


def _record(file, text, log):
    try:
        record = json.loads(text)
        is_ours = version_of(record) is not None
        if is_ours and record.get("capacity") is None:
            expected = message(
                "lint_record_of_points",
                "a record of points without a table; expected the record of a tank",
            )
            log.problem(file, expected, None, "capacity")
            return ()
        table = record["capacity"]
        columns = [list(table[key]) for key in ("height_m", "volume_m3")]
    except (ValueError, KeyError, TypeError, RecursionError):
        is_ours = False
    if not is_ours:
        log.problem(
            file,
            message(
                "lint_no_record",
                "not a record of tankcal; expected format {format!r} or an older version of it",
                format=FORMAT,
            ),
        )
        return ()
    if len(columns[0]) != len(columns[1]):
        expected = message(
            "lint_unequal_columns",
            "{heights} heights and {volumes} volumes; expected as many of each",
            heights=len(columns[0]),
            volumes=len(columns[1]),
        )
        log.problem(file, expected, None, "capacity")
        return ()
    rows = [(0, ("height_m", "volume_m3"))]
    rows += [(number, cells) for number, cells in enumerate(zip(*columns, strict=True), 1)]
    return (Grid(f"{file}, capacity", tuple(rows)),)


def _csv(file, text, log):
    if has_too_many_lines(file, text, log, MOST_LINES):
        return ()
    lines = [(number, line) for number, line in enumerate(split_lines(text), 1) if is_row(line)]
    if not lines:
        log.problem(file, message("lint_empty", "empty; expected a table of heights and volumes"))
        return ()
    separator = find_separator([line for _, line in lines])
    rows = []
    for number, line in lines:
        try:
            cells = split_cells(line, separator)
        except csv.Error:
            log.problem(
                file,
                message(
                    "lint_quotes",
                    "found {found}; expected quotation marks in pairs",
                    found=shown(line),
                ),
                number,
            )
            continue
        if len(cells) > MAX_COLUMNS:
            log.problem(file, too_many_columns(len(cells)), number)
        elif any(cells):
            rows.append((number, tuple(cells)))
    return (Grid(file, tuple(rows), True),)
