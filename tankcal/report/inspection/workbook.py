"""Workbook of an inspection: checks, places, welds and points, with numbers as numbers."""

from tankcal.report.inspection.pages import counts, remarks, rule_text
from tankcal.report.inspection.tables import (
    COURSES,
    EDGES,
    GAPS,
    GENERATRICES,
    LEVELS,
    PLACES,
    PLANES,
    POINTS,
    READINGS,
    SHEET_OF_CHECKS,
    course_rows,
    gap_rows,
    generatrix_rows,
    level_rows,
    place_rows,
    plane_rows,
    point_rows,
    reading_rows,
    sheet_rows,
)
from tankcal.report.saved_paper import bearable
from tankcal.report.workbook.book import Book, about_saved
from tankcal.report.workbook.tables import HEAD_ROW, columns_of, set_widths, write_table


def write(paper, path):
    """Write the workbook of an InspectionPaper; equal inspections give equal bytes."""
    inspection = paper.found
    tank = inspection["tank"]
    about = about_saved(
        inspection["tankcal"],
        tank=bearable(tank["id"]),
        date=tank["survey_date"],
        notice=inspection["notice"],
    )
    with Book(path, about, paper.words, about="inspection") as book:
        book.paper = paper
        _checks(book, paper)
        sheets = {
            "generatrices": ((GENERATRICES, generatrix_rows(inspection)),),
            "levels": (
                (LEVELS, level_rows(inspection)),
                (COURSES, course_rows(inspection)),
                (PLACES, place_rows(inspection)),
            ),
            "welds": ((GAPS, gap_rows(inspection)),),
            "settlement": ((PLANES, plane_rows(inspection)), (POINTS, point_rows(inspection))),
            "edges": ((EDGES, inspection["edges"]), (READINGS, reading_rows(inspection))),
        }
        for code, tables in sheets.items():
            if any(rows for _, rows in tables):
                _sheet(book, code, [(table, rows) for table, rows in tables if rows])


def _checks(book, paper):
    """Write the sheet of checks: summary, table of checks, remarks and warnings."""
    sheet = book.sheet("checks", landscape=True, tab="result")
    columns = columns_of(book, SHEET_OF_CHECKS, sheet_rows(paper))
    widths = set_widths(book, sheet, columns)
    inspection, row = paper.found, HEAD_ROW
    as_built = paper.word("texts.as_built" if inspection["as_built"] else "texts.as_built_unknown")
    lines = [counts(paper), rule_text(paper), paper.word("texts.not_of_certificate"), as_built]
    for number, text in enumerate(lines):
        look = {} if number else {"bold": True, "font_size": 12}
        book.paragraph(sheet, row, text, widths, **look)
        row += 1
    sheet.repeat_rows(row + 1)
    row = write_table(book, sheet, row + 1, SHEET_OF_CHECKS.name, columns, widths=widths) + 2
    for text in (*remarks(paper), *map(paper.warning, inspection["warnings"])):
        book.paragraph(sheet, row, text, widths)
        row += 1


def _sheet(book, code, tables):
    """Write tables one below the other; the headings of the last table repeat on every page.

    The headings of a single table also remain visible when the sheet is scrolled.
    """
    sheet, row = book.sheet(code, landscape=True), HEAD_ROW
    columns = [columns_of(book, table, rows) for table, rows in tables]
    widths = set_widths(book, sheet, *columns)
    for (table, _), cells in zip(tables, columns, strict=True):
        filtered = {"autofilter": True} if len(tables) == 1 else {}
        sheet.repeat_rows(row)
        row = write_table(book, sheet, row, table.name, cells, widths=widths, **filtered) + 2
    if len(tables) == 1:
        book.freeze(sheet, HEAD_ROW, 1)
