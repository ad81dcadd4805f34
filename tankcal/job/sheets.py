"""Read a job from an Excel workbook: a sheet `job` for the settings, a sheet for each table."""

from bisect import bisect_left

from tankcal.errors import sheet_named
from tankcal.job.excel import MAX_COLUMNS, MAX_FILE_BYTES, Unreadable, column_letters, read_sheets
from tankcal.job.tables import (
    ARCHIVES,
    REGISTERS,
    SETTINGS_SHEET,
    TABLES,
    RawJob,
    Register,
    Value,
    expected_sheets,
    fingerprint,
    make_table,
    missing_sheet,
    nearest,
    read_bytes,
    shown,
)
from tankcal.messages import message

README_SHEET = "read me"
KEY, VALUE = "key", "value"
REMARKS = ("note", "label", "unit", "example")  # columns of settings that are not read
SECTION = "section"


def read_workbook(path, log, edited=None):
    """Read a job in a workbook.

    Parameters
    ----------
    path : Path
        The workbook.
    log : Log
        Receives the problems.
    edited : dict of {str: bytes}, optional
        Content that replaces the content of the file, by file name.

    Returns
    -------
    RawJob or None
        None if the workbook cannot be read.
    """
    log.book = path.name
    data = (edited or {}).get(path.name) or read_bytes(path, log, MAX_FILE_BYTES)
    if data is None:
        return None
    try:
        sheets_of_book = read_sheets(data, is_read)
    except Unreadable as reason:
        log.problem(path.name, reason.args[0])
        return None
    sheets = _known_sheets(path.name, sheets_of_book, log)
    tables = {name: _table(name, sheet, log) for name, sheet in sheets.items()}
    settings, sections = None, {}
    if SETTINGS_SHEET not in tables:
        log.problem(sheet_named(SETTINGS_SHEET), missing_sheet())
    elif tables[SETTINGS_SHEET] is not None:
        settings, sections = _settings(tables[SETTINGS_SHEET], SECTION, log)
    files = (fingerprint(path.name, data),)
    tables_of_job = {name: tables[name] for name in TABLES if name in tables}
    place = sheet_named(SETTINGS_SHEET)
    registers = {
        name: _register(tables[name], owner, log)
        for name, owner in REGISTERS.items()
        if name in tables
    }
    return RawJob(
        path.name, path.parent, place, settings, sections, tables_of_job, {}, files, registers
    )


def is_read(title):
    """Return True if a sheet with this title belongs to a job; notes and explanations do not."""
    return title.strip().lower() != README_SHEET and not title.strip().startswith("#")


def _known_sheets(file, sheets_of_book, log):
    """{name: Sheet} of the sheets of a job; other sheets are reported."""
    known = (SETTINGS_SHEET, *TABLES, *REGISTERS)
    sheets = {}
    for sheet in sheets_of_book:
        name = sheet.title.strip().lower()
        if name in sheets:
            log.problem(
                file,
                message(
                    "two_sheets", "two sheets are called {found}; expected one", found=shown(name)
                ),
            )
        elif name in known:
            sheets[name] = sheet
        elif f"{name}.npz" in ARCHIVES:
            log.problem(
                sheet_named(name),
                message("covariance_in_workbook", "a full covariance needs the job as a folder"),
            )
        else:
            hint = nearest(name, known)
            expected = message(
                "unknown_sheet",
                "unknown sheet {found}{hint}; {sheets}; name it '# notes' to keep it",
                found=shown(sheet.title),
                hint=hint,
                sheets=expected_sheets(),
            )
            log.problem(file, expected)
    return sheets


def _table(name, sheet, log):
    """Table of a sheet; None, with a problem in `log`, if unreadable."""
    place = sheet_named(name)
    if sheet.is_hidden:
        log.problem(
            place,
            message(
                "hidden_sheet", "the sheet is hidden; expected a visible sheet: unhide or delete it"
            ),
        )
    rows, first_column = table_rows(place, sheet.grid, log)
    letters = placed_columns(rows, first_column)
    if name == SETTINGS_SHEET or name in REGISTERS:
        # Messages name the keys of settings; their cell is in the column of values.
        fallbacks = dict.fromkeys((REGISTERS.get(name, SECTION), KEY, VALUE))
        letters = {None: letters.get(VALUE)} | fallbacks | letters
    log.place_columns(place, letters)
    return make_table(place, rows, None, log)


def _register(table, owner, log):
    """Register of a sheet such as cameras; None if unreadable."""
    if table is None:
        return None
    entries, rows = _settings(table, owner, log)
    return None if entries is None else Register(table.file, entries, rows)


def _settings(table, owner, log):
    """Read a sheet of settings.

    Parameters
    ----------
    table : Table
        Table of the sheet.
    owner : str
        Heading of the column of sections: "section", "camera" or "instrument".
    log : Log
        Receives the problems.

    Returns
    -------
    settings : dict or None
        {section: {key: Value}}; None if columns are missing.
    sections : dict
        {section: row}.
    """
    needed = (owner, KEY, VALUE)
    known = (*needed, *REMARKS)
    for heading in table.headings:
        if heading not in known:
            expected = message(
                "unknown_column_of_settings",
                "unknown column{hint}; expected {known}",
                hint=nearest(heading, known),
                known=[*known],
            )
            log.problem(table.file, expected, table.heading_row, heading)
    missing = [heading for heading in needed if heading not in table.headings]
    for heading in missing:
        log.problem(
            table.file,
            message("missing_column_of_settings", "missing column"),
            table.heading_row,
            heading,
        )
    if missing:
        return None, {}
    place = [table.headings.index(heading) for heading in needed]
    settings, sections = {}, {}
    for row, cells in zip(table.row_numbers, table.rows, strict=True):
        section, key, value = (cells[position] for position in place)
        if key is None and value is None:
            continue  # a row with only a section or a note
        if owner != SECTION and isinstance(section, int | float):
            section = f"{section:.15g}"  # a camera called 1
        if not isinstance(section, str) or not isinstance(key, str):
            expected = message(
                "no_owner_or_key", "a value without {owner} or key; expected both", owner=owner
            )
            if owner == SECTION:
                expected = message(
                    "no_section_or_key",
                    "a value without section or key; expected both, such as tank and id",
                )
            log.problem(table.file, expected, row, KEY if isinstance(section, str) else owner)
            continue
        section = section.strip("[] ")
        known = settings.setdefault(section, {})
        sections.setdefault(section, row)
        if key in known:
            expected = message(
                "key_twice", "given twice, first in row {row}; expected once", row=known[key].row
            )
            log.problem(table.file, expected, row, f"{section}.{key}")
        else:
            known[key] = Value(value, row)
    return settings, sections


# ---- rows of a sheet


def table_rows(place, grid, log):
    """Rows of a table in a sheet.

    A first column without a heading is reserved for marks: # switches its row off. The column is
    left out.

    Parameters
    ----------
    place : str
        Name of the sheet in messages.
    grid : Grid
        Cells of the sheet.
    log : Log
        Receives merged and hidden cells, and cells beyond the last column.

    Returns
    -------
    rows : list of (int, list)
        Row number and cells of the heading and of the rows below it.
    first_column : int
        Number of the first column.
    """
    rows = [
        (number, cells)
        for number, cells in grid.rows
        if not (isinstance(cells[0], str) and cells[0].lstrip().startswith("#"))
    ]
    for number, cells in rows:
        if len(cells) > MAX_COLUMNS:
            log.problem(
                place,
                message(
                    "beyond_last_column",
                    "cells beyond column {last}",
                    last=column_letters(MAX_COLUMNS),
                ),
                number,
            )
            del cells[MAX_COLUMNS:]
    _tell_merged(place, grid, rows, log)
    _tell_hidden(place, grid, rows, log)
    for _, cells in rows:
        cells.extend([None] * (len(rows[0][1]) - len(cells)))
    if not rows or not _is_blank(rows[0][1][0]):
        return rows, 1
    for number, cells in rows:
        if not _is_blank(cells[0]):
            expected = message(
                "in_column_of_marks",
                "found {found} in a column without a heading; expected nothing there, or # to "
                "switch the row off",
                found=shown(cells[0]),
            )
            log.place_columns(place, {"": "A"})
            log.problem(place, expected, number, "")
    return [(number, cells[1:]) for number, cells in rows], 2


def placed_columns(rows, first_column):
    """{heading: letters of its column} from the first of the rows."""
    headings = rows[0][1] if rows else []
    return {
        heading.strip(): column_letters(column)
        for column, heading in enumerate(headings, first_column)
        if isinstance(heading, str)
    }


def _is_blank(cell):
    return cell is None or (isinstance(cell, str) and not cell.strip())


def _tell_merged(place, grid, rows, log):
    numbers = [number for number, _ in rows]
    for top, bottom, left, right in grid.merged:
        nearest_row = bisect_left(numbers, top)
        if nearest_row < len(numbers) and numbers[nearest_row] <= bottom:
            cells = f"{column_letters(left)}{top}:{column_letters(right)}{bottom}"
            expected = message(
                "merged_cells",
                "the cells {cells} are merged; expected one cell for each value: unmerge them",
                cells=cells,
            )
            log.problem(place, expected, top)


def _tell_hidden(place, grid, rows, log):
    hidden = [number for number, _ in rows if number in grid.hidden_rows]
    for first, last in _runs(hidden):
        expected = message(
            "hidden_row",
            "the row is hidden, and not blank; expected visible rows: unhide or delete it",
        )
        if last > first:
            expected = message(
                "hidden_rows",
                "the rows {first} to {last} are hidden, and not blank; expected visible "
                "rows: unhide or delete them",
                first=first,
                last=last,
            )
        log.problem(place, expected, first)
    for first, last in grid.hidden_columns:
        if any(cell is not None for _, cells in rows for cell in cells[first - 1 : last]):
            left, right = column_letters(first), column_letters(last)
            expected = message(
                "hidden_column",
                "column {left} is hidden, and not blank; expected visible columns: unhide or "
                "delete it",
                left=left,
            )
            if last > first:
                expected = message(
                    "hidden_columns",
                    "one of the columns {left} to {right} is hidden, and not blank; expected "
                    "visible columns: unhide or delete it",
                    left=left,
                    right=right,
                )
            log.problem(place, expected)


def _runs(numbers):
    """(first, last) of each run of consecutive numbers."""
    runs = []
    for number in numbers:
        if runs and number == runs[-1][1] + 1:
            runs[-1] = (runs[-1][0], number)
        else:
            runs.append((number, number))
    return runs
