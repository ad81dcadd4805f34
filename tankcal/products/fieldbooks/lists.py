"""Conversion of a list (CSV) with user-defined headings, units and marks to a table of a job."""

import json
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from tankcal.job.contract import COLUMNS
from tankcal.job.entries import read_columns
from tankcal.job.field_values import has_two_meanings, settle_decimal
from tankcal.job.fields import is_blank
from tankcal.job.folder import declared_marks, parsed_toml, read_csv, read_toml
from tankcal.job.headings import Meaning, meanings_of, stated_meaning
from tankcal.job.tables import NOT_KNOWN, SETTINGS_FILE, Log, Table, nearest, read_bytes
from tankcal.messages import message
from tankcal.products.fieldbooks.rows import find_filled_tables, refuse_filled, write_grids
from tankcal.text.naming import MAX_NAME, NUMBER

MEMORY_FILE = "headings.toml"  # in the job folder: meanings of headings of earlier lists
MOST_DECIMALS = 9  # decimals of a converted length in the unit of the column
MAX_BYTES = 50_000_000


@dataclass
class ForeignList:
    """A list and the meanings of its headings.

    Attributes
    ----------
    name : str
        Table of the job to which it is converted.
    table : Table
        Rows as read; its decimal mark is the mark of the list.
    meanings : dict of Meaning
        Meanings by heading; other headings are not used.
    warnings : tuple of Problem
        Warnings of the reading, such as another encoding.
    """

    name: str
    table: Table
    meanings: dict
    warnings: tuple = ()

    @property
    def unused(self):
        """Headings without a meaning."""
        return [heading for heading in self.table.headings if heading not in self.meanings]

    @property
    def missing(self):
        """Required fields without a heading."""
        columns = {meaning.column for meaning in self.meanings.values()}
        return [
            field for field in COLUMNS[self.name] if field.required and field.name not in columns
        ]


def is_table(name):
    """Return whether a job has a table of this name."""
    return name in COLUMNS


def read_list(path, folder, name="points", given=None):
    """Read a CSV file as a ForeignList for a table of the job in a folder.

    Parameters
    ----------
    path, folder : Path
    name : str
        Name of the table.
    given : dict, optional
        {heading: column} stated by the user. Other headings are recognised, or known from earlier
        lists.

    Raises
    ------
    InputError
        The file cannot be read, or a heading or column of `given` does not exist.
    """
    log, fields = Log(), COLUMNS[name]
    data = read_bytes(path, log, MAX_BYTES)
    decimal = _read_decimal(folder, log)
    table = None if data is None else read_csv(path.name, data, ",", decimal, log)
    log.stop_if_problems()
    stated = _read_memory(folder, name, log) | (given or {})
    stated = {head: column for head, column in stated.items() if head in table.headings}
    for heading, column in (given or {}).items():
        _check_stated(heading, column, table, fields, log)
    log.stop_if_problems()
    # Stated meanings take precedence, then headings equal to a column, then recognised headings.
    by_name = {field.name: field for field in fields}
    meanings = {head: stated_meaning(head, by_name[column]) for head, column in stated.items()}
    free = [field for field in fields if field.name not in stated.values()]
    identical = {field.name for field in free} & set(table.headings) - stated.keys()
    meanings |= {head: Meaning(head, Fraction(1)) for head in identical}
    rest = [head for head in table.headings if head not in meanings]
    free = [field for field in free if field.name not in identical]
    meanings |= {
        head: meaning
        for head, meaning in meanings_of(rest, free).items()
        if meaning.factor is not None
    }
    in_order = {head: meanings[head] for head in table.headings if head in meanings}
    return ForeignList(name, table, in_order, tuple(log.warnings))


def _check_stated(heading, column, table, fields, log):
    """Report a stated heading or column that does not exist."""
    names = [field.name for field in fields]
    if heading not in table.headings:
        text = message(
            "list_no_heading",
            "no heading {heading!r}; expected one of {headings}",
            heading=heading,
            headings=[*table.headings],
        )
        log.problem(table.file, text, table.heading_row)
    if column not in names:
        text = message(
            "list_no_column",
            "no column {column!r}{hint}; expected one of {names}",
            column=column,
            hint=nearest(column, names),
            names=names,
        )
        log.problem("--column", text)


def _read_decimal(folder, log):
    """Return the decimal mark declared in job.toml, or NOT_KNOWN."""
    path = folder / SETTINGS_FILE
    data = read_bytes(path, log) if path.is_file() else None
    settings = None if data is None else read_toml(SETTINGS_FILE, data, Log())[0]
    marks = declared_marks(SETTINGS_FILE, settings or {}, Log())
    return NOT_KNOWN if marks is None else marks[1]


def _read_memory(folder, name, log):
    """Return {heading: column} of earlier lists for a table."""
    path = folder / MEMORY_FILE
    data = read_bytes(path, log) if path.is_file() else None
    parsed = None if data is None else parsed_toml(MEMORY_FILE, data, log)
    section = {} if parsed is None else parsed[0].get(name, {})
    columns = {field.name for field in COLUMNS[name]}
    section = section if isinstance(section, dict) else {}
    return {heading: column for heading, column in section.items() if column in columns}


def refuse_missing(foreign_list):
    """Raise InputError with one problem for each required column without a heading."""
    log = Log()
    for field in foreign_list.missing:
        text = message(
            "list_lacks_column",
            "no heading for {column} ({note}); expected --column 'HEADING={column}', where "
            "HEADING is one of {headings}",
            column=field.name,
            note=field.expectation,
            headings=foreign_list.unused or [*foreign_list.table.headings],
        )
        log.problem(foreign_list.table.file, text, foreign_list.table.heading_row)
    log.stop_if_problems()


def write_list(foreign_list, folder, *, replace=False):
    """Write a ForeignList as a table of the job, save its headings, and return the paths.

    Raises InputError with all problems of its values; no file is written then.
    """
    folder, log = Path(folder), Log()
    refuse_missing(foreign_list)
    filled_tables = [] if replace else find_filled_tables(folder, [foreign_list.name])
    refuse_filled(folder, filled_tables)
    table = _convert_table(foreign_list, log)
    log.stop_if_problems()
    read_columns(foreign_list.name, table, log)
    log.stop_if_problems()
    rows = [["" if cell is None else cell for cell in row] for row in table.rows]
    memory = {MEMORY_FILE: _memory_text(foreign_list, folder)}
    return write_grids(folder, {foreign_list.name: [table.headings, *rows]}, memory)


def _convert_table(foreign_list, log):
    """Return the Table with the columns of the job, decimal points, and lengths in their units."""
    table = foreign_list.table
    fields = {field.name: field for field in COLUMNS[foreign_list.name]}
    used = [(place, foreign_list.meanings[heading]) for place, heading in enumerate(table.headings)
            if heading in foreign_list.meanings]  # fmt: skip
    headings = tuple(meaning.column for _, meaning in used)
    rows = [tuple(row[place] for place, _ in used) for row in table.rows]
    plain = Table(table.file, headings, table.heading_row, tuple(rows), table.row_numbers,
                  table.decimal, table.skipped)  # fmt: skip
    decimal = settle_decimal(plain, [*fields.values()], log)
    kinds = [fields[meaning.column].kind for _, meaning in used]
    rows = tuple(
        tuple(
            convert_cell(cell, meaning.factor, decimal) if kind == "number" else cell
            for cell, kind, (_, meaning) in zip(row, kinds, used, strict=True)
        )
        for row in rows
    )
    return Table(table.file, headings, table.heading_row, rows, table.row_numbers, ".",
                 table.skipped)  # fmt: skip


def convert_cell(cell, factor, decimal):
    """Return a number with a decimal point in the unit of its column; other texts are unchanged."""
    if is_blank(cell):
        return cell
    text = cell.strip(" \t")
    if ("," in text and "." in text) or len(text) > MAX_NAME:
        return cell
    plain = text.replace(",", ".")
    if not NUMBER.fullmatch(plain) or (has_two_meanings(text) and decimal not in text):
        return cell
    if factor == 1:
        return plain
    value = f"{float(Fraction(plain) * factor):.{MOST_DECIMALS}f}"
    return value.rstrip("0").rstrip(".")


def _memory_text(foreign_list, folder):
    """Return headings.toml with the meanings of the headings of this and earlier lists."""
    path = folder / MEMORY_FILE
    kept = {}
    if path.is_file():
        parsed = parsed_toml(MEMORY_FILE, path.read_bytes(), Log())
        kept = {name: columns for name, columns in (parsed or ({},))[0].items() if is_table(name)}
    now = {heading: meaning.column for heading, meaning in foreign_list.meanings.items()}
    kept[foreign_list.name] = kept.get(foreign_list.name, {}) | now
    lines = []
    for name, headings in kept.items():
        lines += [f"[{name}]", *(f"{json.dumps(head, ensure_ascii=False)} = {json.dumps(column)}"
                                 for head, column in headings.items()), ""]  # fmt: skip
    return "\n".join(lines)
