"""Input workbook: a cover, a sheet of settings, and a sheet for each table and list."""

import datetime
import io
from dataclasses import dataclass

import xlsxwriter
from xlsxwriter.utility import xl_rowcol_to_cell

from tankcal.job.certificate_entries import MARKED
from tankcal.job.fields import Field
from tankcal.job.sheets import KEY, SECTION, VALUE
from tankcal.job.starter.examples import EXAMPLES_OF_KEYS
from tankcal.job.starter.table_sheet import (
    LINE_PT,
    MARK,
    Look,
    lines_of,
    print_on_a4,
    rule_of,
    type_of_cell,
    write_table,
)
from tankcal.job.starter.texts import is_number, split_unit, texts_in
from tankcal.job.tables import REGISTERS, SETTINGS_SHEET

# Sheets with explanations: the cover, and the inputs of uncertainty.

_WIDTHS = (4, 22, 78)  # columns of the cover, characters


def write_cover(sheet, form, texts, look):
    """Write instructions, a legend of the colours, and a list of the sheets.

    Parameters
    ----------
    sheet : xlsxwriter worksheet
        Sheet to be written.
    form : Form
        Kind of tank and of survey.
    texts : Texts
        Texts of the language.
    look : Look
        Formats.
    """
    for column, width in enumerate(_WIDTHS):
        sheet.set_column(column, column, width)
    sheet.hide_gridlines(2)
    sheet.write_string(0, 1, texts.of("cover", "title"), look.title)
    sheet.write_string(1, 1, texts.words["kinds"][form.kind], look.bold)
    row = 3
    for number, code in enumerate(_steps(form), 1):
        text = texts.of("steps", code)
        sheet.write_string(row, 0, f"{number}.", look.wrapped)
        sheet.merge_range(row, 1, row, 2, text, look.wrapped)
        sheet.set_row(row, LINE_PT * 1.1 * lines_of(text, sum(_WIDTHS[1:]) * 0.8) + 4)
        row += 1
    row = _write_legend(sheet, row + 1, texts, look)
    _write_contents(sheet, row + 1, form, texts, look)
    print_on_a4(sheet, texts)


def _steps(form):
    names = ("names",) if form.registers else ()
    return ("settings", "tables", *names, "examples", "numbers", "codes", "run", "mistakes")


def _write_legend(sheet, row, texts, look):
    sheet.write_string(row, 1, texts.of("cover", "legend"), look.bold)
    samples = {
        "fill_in": look.cell("text", is_to_fill_in=True),
        "required": look.required,
        "optional": look.optional,
        "example": look.example(),
    }
    for place, (code, sample) in enumerate(samples.items(), row + 1):
        sheet.write_string(place, 1, texts.of("legend", f"{code}_sample"), sample)
        sheet.write_string(place, 2, texts.of("legend", code), look.plain)
    return row + len(samples) + 1


def _write_contents(sheet, row, form, texts, look):
    for column, code in enumerate(("sheet", "what"), 1):
        sheet.write_string(row, column, texts.of("cover", code), look.optional)
    for name in (SETTINGS_SHEET, *form.registers, *form.tables):
        row += 1
        text = texts.of("titles", name)
        if name != SETTINGS_SHEET:
            group = "registers" if name in REGISTERS else "tables"
            text = f"{text}: {texts.note(group, name)}"
        sheet.write_url(row, 1, f"internal:'{name}'!A1", look.link, name)
        sheet.write_string(row, 2, text, look.wrapped)
        sheet.set_row(row, LINE_PT * 1.1 * lines_of(text, _WIDTHS[2] * 0.85) + 3)


def write_inputs(sheet, form, texts, look):
    """Write the inputs of uncertainty of this kind of tank; parameters as for `write_cover`."""
    for column, width in enumerate((22, 58, 10, 24)):
        sheet.set_column(column, column, width)
    sheet.write_string(0, 0, texts.of("cover", "inputs"), look.title)
    sheet.write_string(1, 0, texts.of("cover", "inputs_note"), look.plain)
    for column, code in enumerate(("input", "what", "unit", "assumed")):
        sheet.write_string(3, column, texts.of("inputs", code), look.optional)
    for row, (name, declarable) in enumerate(form.inputs.items(), 4):
        code = "deadwood_share" if name == "deadwood" else name
        sheet.write_string(row, 0, name, look.code)
        sheet.write_string(row, 1, texts.words["inputs"][code], look.wrapped)
        sheet.write_string(row, 2, declarable.unit, look.unit)
        sheet.write_string(row, 3, texts.assumption(declarable), look.plain)
    sheet.freeze_panes(4, 0)
    print_on_a4(sheet, texts)


_NO_DAY = datetime.datetime(2000, 1, 1)  # constant, so that equal forms give equal files


def book_bytes(form):
    """Empty workbook of a Form, as bytes."""
    texts, data = texts_in(form.language), io.BytesIO()
    with xlsxwriter.Workbook(data) as book:
        book.set_properties({"title": texts.of("cover", "title"), "created": _NO_DAY})
        look = Look(book)
        write_cover(book.add_worksheet(texts.of("cover", "name")), form, texts, look)
        sheet = book.add_worksheet(SETTINGS_SHEET)
        write_settings(sheet, SETTINGS_SHEET, SECTION, _sections(form, texts), texts, look)
        for register in form.registers:
            sheet = book.add_worksheet(register)
            groups = _entries(register, form, texts)
            write_settings(sheet, register, REGISTERS[register], groups, texts, look)
        for table in form.tables:
            write_table(book.add_worksheet(table), table, form, texts, look)
        write_inputs(book.add_worksheet(texts.of("cover", "inputs_name")), form, texts, look)
    return data.getvalue()


def _sections(form, texts):
    """Groups of the sheet job; a workbook needs no marks of CSV files."""
    return [
        Group(
            section,
            f"{texts.of('sections', section)}: {texts.note('sections', section)}",
            tuple(
                Entry(
                    field,
                    texts.note("keys", section, field),
                    form.start(section, field),
                    form.is_to_fill_in(section, field)
                    or (section == "certificate" and field.name in MARKED),
                    EXAMPLES_OF_KEYS.get(f"{section}.{field.name}"),
                )
                for field in fields
            ),
        )
        for section, fields in form.keys.items()
        if section != "csv"
    ]


def _entries(register, form, texts):
    """One group for each entry of a sheet such as cameras."""
    return [
        Group(
            name,
            None,
            tuple(
                Entry(
                    field,
                    texts.note("entries", register, field) if field.note else "",
                    given.get(field.name, ""),
                    field.required and not given.get(field.name),
                    EXAMPLES_OF_KEYS.get(f"{register}.{field.name}"),
                )
                for field in form.fields(register, given)
            ),
        )
        for name, given in form.entries(register).items()
    ]


# ---- sheets of settings: job, cameras and instruments, one row for each key


TITLE, NOTE, RULE, LABELS, CODES = range(5)
_MARK, _NOTE, _VALUE, _UNIT, _EXAMPLE, _OWNER, _KEY = range(7)
_SETTINGS_WIDTHS = {_MARK: 3, _NOTE: 52, _VALUE: 28, _UNIT: 8, _EXAMPLE: 16, _OWNER: 17, _KEY: 27}


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
    for column, width in _SETTINGS_WIDTHS.items():
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
    sheet.set_row(row, max(15.0, LINE_PT * lines_of(entry.note, _SETTINGS_WIDTHS[_NOTE] * 0.9) + 4))


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
