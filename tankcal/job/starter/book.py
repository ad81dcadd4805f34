"""The input workbook: a cover, a sheet of settings, and a sheet for each table and list."""

import datetime

import xlsxwriter

from tankcal.job.sheets import SECTION, SETTINGS_SHEET
from tankcal.job.starter.cover import write_cover, write_inputs
from tankcal.job.starter.examples import EXAMPLES_OF_KEYS
from tankcal.job.starter.look import Look
from tankcal.job.starter.settings_sheet import Entry, Group, write_settings
from tankcal.job.starter.table_sheet import write_table
from tankcal.job.starter.texts import texts_in
from tankcal.job.tables import REGISTERS

_NO_DAY = datetime.datetime(2000, 1, 1)  # the same form gives the same bytes


def write_book(path, form):
    """Write the empty workbook of a Form."""
    texts = texts_in(form.language)
    with xlsxwriter.Workbook(path) as book:
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


def _sections(form, texts):
    """The groups of the sheet job; the marks of CSV files are of no use to a workbook."""
    return [
        Group(
            section,
            f"{texts.of('sections', section)}: {texts.note('sections', section)}",
            tuple(
                Entry(
                    field,
                    texts.note("keys", section, field),
                    form.start(section, field),
                    form.is_to_fill_in(section, field),
                    EXAMPLES_OF_KEYS.get(f"{section}.{field.name}"),
                )
                for field in fields
            ),
        )
        for section, fields in form.keys.items()
        if section != "csv"
    ]


def _entries(register, form, texts):
    """A group of the sheet cameras or instruments for each of them."""
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
