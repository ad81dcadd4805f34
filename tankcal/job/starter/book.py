"""Input workbook: a cover, a sheet of settings, and a sheet for each table and list."""

import datetime
import io

import xlsxwriter

from tankcal.job.certificate_entries import MARKED
from tankcal.job.sheets import SECTION
from tankcal.job.starter.examples import EXAMPLES_OF_KEYS
from tankcal.job.starter.settings_sheet import Entry, Group, write_settings
from tankcal.job.starter.table_sheet import LINE_PT, Look, lines_of, print_on_a4, write_table
from tankcal.job.starter.texts import texts_in
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
