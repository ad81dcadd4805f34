"""Sheets of the working papers: courses, surveys, ship, corrections, tank, and provenance."""

from tankcal.methods.base import methods
from tankcal.report.numbers import unit
from tankcal.report.paper import DECIMALS_OF_PARTS
from tankcal.report.tables import (
    ship,
    tank,
)
from tankcal.report.workbook.look import Column, number_format
from tankcal.report.workbook.sections import (
    HEAD_ROW,
    CellTable,
    Sentences,
    SheetContent,
    cell_table,
    columns_of,
    write_sheet,
)
from tankcal.text.digits import decimals_of
from tankcal.text.words import choice_sentence

_INSIDE_WIDTHS = (50, 16, 16, 16, 16)  # widths of the columns of the sheet inside, letters


def _course_tables(record):
    if not record["sections"]:
        return (tank.COURSES,)
    noise = (tank.HOMOGENEITY, tank.SECTION_NOISE) if record.get("homogeneity") else ()
    return (tank.COURSES, tank.SECTIONS, *noise, tank.modes_table(record), tank.SHELL)


def tables_sheets(book, record):
    """Write the sheet of courses, and the sheets of the methods whose content the record has."""
    if record.get("courses"):
        tables = _course_tables(record)
        _tables_sheet(
            book, "courses", "courses_subtitle", [(table.name, table) for table in tables]
        )
    for method in methods():
        if record.get(method.name):
            for code, subtitle, tables in method.sheets(record):
                _tables_sheet(book, code, subtitle, tables)


def _tables_sheet(book, code, subtitle, tables):
    """Write a sheet of tables, each under its heading [workbook.headings].<name>."""
    sections = [
        cell_table(book, table, name=name, title=book.word(f"headings.{name}"))
        for name, table in tables
    ]
    write_sheet(book, SheetContent(code, sections, book.word(f"texts.{subtitle}")))


def ship_sheet(book, record):
    """Write the corrections for trim and list: range of the pipe, and a table for each list."""
    sections = [cell_table(book, ship.CELLS, title=book.word("headings.ship_cells"))]
    for number, (list_deg, cells) in enumerate(ship.group_by_list(record), 1):
        columns = _correction_columns(book, record, cells)
        title = book.word("texts.ship_list", list=f"{list_deg:g}")
        sections.append(CellTable(f"ship_list_{number}", columns, title))
    write_sheet(book, SheetContent("ship", sections, book.word("texts.ship_subtitle")))


def _correction_columns(book, record, cells):
    """Return the columns soundings, correction (or state) at each trim, and largest U."""
    soundings, words = record["ship"]["sounding_m"], book.words["table_headings"]
    columns = [Column(f"{words['ship_sounding_m']}, m", soundings, 3, 12)]
    for cell in cells:
        values = [
            book.paper.word(f"ship_states.{state}") if state else 1000 * correction
            for state, correction in zip(cell["state"], cell["correction_m"], strict=True)
        ]
        heading = book.paper.word("texts.ship_trim", trim=f"{cell['trim_m']:g}")
        columns.append(Column(f"{heading}, mm", values, 1, 14))
    largest_U = [ship.largest_U_m(cells, index) for index in range(len(soundings))]
    in_mm = [None if U is None else 1000 * U for U in largest_U]
    return [*columns, Column(f"{words['ship_U']}, mm", in_mm, 1, 14)]


def corrections_sheet(book, record):
    """Write the corrections with their sizes at the top of the table."""
    digits = decimals_of(record["capacity"]["u_m3"][-1]) + 1
    table = cell_table(book, tank.CORRECTIONS.but(size_m3={"decimals": digits}))
    subtitle = book.word("texts.corrections_subtitle")
    sheet, row = write_sheet(book, SheetContent("corrections", [table], subtitle))
    gross_m3 = record["gross"] and record["gross"]["volume_m3"]
    for below, label, value in (
        (0, "gross_volume", gross_m3),
        (1, "top_row", record["capacity"]["volume_m3"][-1]),
    ):
        if value is not None:
            book.put(sheet, row + below, 0, book.word(f"labels.{label}"))
            book.put(sheet, row + below, 2, value, num_format=number_format(digits, unit="m³"))


def provenance_sheet(book, record):
    """Write choices, warnings, input files and versions of programs."""
    declared = (
        ("warnings", "warnings", tank.WARNINGS),
        ("files", "input_files", tank.FILES),
        ("programs", "programs", tank.PROGRAMS),
    )
    if record["job"].get("equipment"):
        declared += (("equipment", "equipment", tank.EQUIPMENT),)
    if record["job"].get("seals"):
        declared += (("seals", "seals", tank.SEALS),)
    choices = [choice_sentence(book.words, choice) for choice in record["choices"]]
    sections = [Sentences(choices, title=book.word("headings.choices"))]
    sections += [
        cell_table(book, table, name=name, title=book.word(f"headings.{title}"))
        for title, name, table in declared
    ]
    write_sheet(book, SheetContent("provenance", sections, landscape=False, tab="origin"))


# ---- the tank


def inside_sheet(book, record):
    """Write the dimensions of a solid, and bottom, deadwood, top and roof."""
    paper, corrections = book.paper, book.words["corrections"]
    sheet = book.sheet("inside")
    book.widths(sheet, *_INSIDE_WIDTHS)
    row = HEAD_ROW
    if record["solid"]:
        row = _described(book, sheet, row, book.words["headings"]["dimensions"], record["solid"])
    for code in ("deadwood", "bottom", "top", "roof"):
        texts, declared = paper.choices(code), record.get(code)
        if not (texts or declared):
            continue
        title = corrections[code]
        if declared and code != "deadwood":
            row = _described(book, sheet, row, title, declared) - 1
        else:
            book.heading(sheet, row, title, len(_INSIDE_WIDTHS))
            row += 1
        for text in texts:
            book.paragraph(sheet, row, text, _INSIDE_WIDTHS)
            row += 1
        if declared and code == "deadwood":
            row = book.table(sheet, row + 1, "deadwood", columns_of(book, tank.DEADWOOD)) + 1
        row += 1


def _described(book, sheet, row, title, lines):
    """Write a heading and a line for each {code, value, unit}; return the next row."""
    words = book.words
    book.heading(sheet, row, title, len(_INSIDE_WIDTHS))
    for line in lines:
        row += 1
        value = line["value"]
        book.put(sheet, row, 0, words["labels"].get(line["code"], line["code"]))
        if line["unit"] is None:
            book.put(sheet, row, 1, words["parts"].get(value, value))
            continue
        shown, decimals = unit(line["unit"]), DECIMALS_OF_PARTS.get(line["unit"], 0)
        look = {"num_format": number_format(decimals)}
        book.put(sheet, row, 1, shown.factor * value, **look)
        book.put(sheet, row, 2, shown.symbol, indent=1)
    return row + 2
