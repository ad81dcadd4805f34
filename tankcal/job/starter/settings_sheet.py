"""Sheets of settings: job, cameras and instruments, one row for each key."""

import datetime
from dataclasses import dataclass

from xlsxwriter.utility import xl_rowcol_to_cell

from tankcal.job.fields import Field
from tankcal.job.sheets import KEY, VALUE
from tankcal.job.starter.table_sheet import (
    LINE_PT,
    MARK,
    lines_of,
    print_on_a4,
    rule_of,
    type_of_cell,
)
from tankcal.job.starter.texts import is_number, split_unit

TITLE, NOTE, RULE, LABELS, CODES = range(5)
_MARK, _NOTE, _VALUE, _UNIT, _EXAMPLE, _OWNER, _KEY = range(7)
_WIDTHS = {_MARK: 3, _NOTE: 52, _VALUE: 28, _UNIT: 8, _EXAMPLE: 16, _OWNER: 17, _KEY: 27}


@dataclass(frozen=True)
class Entry:
    """One row: a key, its note, its initial value, and an example or None."""

    field: Field
    note: str
    start: str
    is_to_fill_in: bool
    example: object


@dataclass(frozen=True)
class Group:
    """Rows of one section, camera or instrument, below a title or None."""

    owner: str
    title: str | None
    entries: tuple


def write_settings(sheet, name, owner, groups, texts, look):
    """Write an empty sheet of settings.

    Parameters
    ----------
    sheet : xlsxwriter worksheet
        Sheet to be written.
    name : str
        Name of the sheet.
    owner : str
        Heading of the column of sections: "section", "camera" or "instrument".
    groups : sequence of Group
        Rows, from the top down.
    texts : Texts
        Texts of the language.
    look : Look
        Formats.
    """
    for column, width in _WIDTHS.items():
        sheet.set_column(column, column, width)
    sheet.write_string(TITLE, _NOTE, texts.of("titles", name), look.title)
    sheet.write_string(NOTE, _NOTE, texts.of("cover", f"{owner}_rows"), look.plain)
    sheet.write_string(RULE, _NOTE, texts.of("cover", "settings"), look.mark)
    for row in range(CODES):
        sheet.write_string(row, _MARK, MARK, look.mark)
    codes = {_NOTE: "note", _VALUE: VALUE, _UNIT: "unit", _EXAMPLE: "example"}
    for column, code in (codes | {_OWNER: owner, _KEY: KEY}).items():
        heading = look.required if column == _VALUE else look.optional
        sheet.write_string(LABELS, column, texts.of("settings", code), heading)
        sheet.write_string(CODES, column, code, look.code_heading)
    row = CODES + 1
    for group in groups:
        if group.title is not None:
            _write_title(sheet, row, group.title, look)
            row += 1
        for entry in group.entries:
            _write_entry(sheet, row, group.owner, entry, texts, look)
            row += 1
    sheet.freeze_panes(CODES + 1, 0)
    sheet.repeat_rows(LABELS, CODES)
    print_on_a4(sheet, texts)


def _write_title(sheet, row, title, look):
    sheet.write_string(row, _MARK, MARK, look.section)
    for column in range(_NOTE, _KEY + 1):
        sheet.write_blank(row, column, None, look.section)
    sheet.write_string(row, _NOTE, title, look.section)


def _write_entry(sheet, row, owner, entry, texts, look):
    field = entry.field
    sheet.write_string(row, _NOTE, entry.note, look.key_note)
    sheet.write_string(row, _UNIT, split_unit(field.name)[1], look.unit)
    sheet.write_string(row, _OWNER, owner, look.code)
    sheet.write_string(row, _KEY, field.name, look.code)
    cell = look.cell(type_of_cell(field), entry.is_to_fill_in)
    _write_start(sheet, row, field, texts.value(field, entry.start), cell)
    _write_example(sheet, row, texts.example(field, entry.example), look)
    rule = rule_of(field, field.choices, xl_rowcol_to_cell(row, _VALUE), texts)
    if rule is not None:
        sheet.data_validation(row, _VALUE, row, _VALUE, rule)
    sheet.set_row(row, max(15.0, LINE_PT * lines_of(entry.note, _WIDTHS[_NOTE] * 0.9) + 4))


def _write_start(sheet, row, field, start, cell):
    if not start:
        sheet.write_blank(row, _VALUE, None, cell)
    elif field.kind == "number" and is_number(start):
        sheet.write_number(row, _VALUE, float(start), cell)
    else:
        sheet.write_string(row, _VALUE, start, cell)


def _write_example(sheet, row, example, look):
    if isinstance(example, float):
        sheet.write_number(row, _EXAMPLE, example, look.example(align="left"))
    elif example is not None and (len(example) == 10 and example[4] == example[7] == "-"):
        day = datetime.date.fromisoformat(example)
        grey = look.example(align="left", num_format="yyyy-mm-dd")
        sheet.write_datetime(row, _EXAMPLE, day, grey)
    elif example is not None:
        sheet.write_string(row, _EXAMPLE, example, look.example(align="left"))
