"""An inspection as a workbook: every check, place, weld and point, numbers as numbers."""

from tankcal.report.inspection.pages import counts, remarks
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
    """Write the workbook of an InspectionPaper; the same inspection gives the same bytes."""
    found = paper.found
    with Book(path, _about(found), paper.words, about="inspection") as book:
        book.paper = paper
        _checks(book, paper)
        sheets = {
            "generatrices": ((GENERATRICES, generatrix_rows(found)),),
            "levels": (
                (LEVELS, level_rows(found)),
                (COURSES, course_rows(found)),
                (PLACES, place_rows(found)),
            ),
            "welds": ((GAPS, gap_rows(found)),),
            "settlement": ((PLANES, plane_rows(found)), (POINTS, point_rows(found))),
            "edges": ((EDGES, found["edges"]), (READINGS, reading_rows(found))),
        }
        for code, tables in sheets.items():
            if any(rows for _, rows in tables):
                _sheet(book, code, [(table, rows) for table, rows in tables if rows])


def _about(found):
    tank = found["tank"]
    return about_saved(
        found["tankcal"],
        tank=bearable(tank["id"]),
        date=tank["survey_date"],
        notice=found["notice"],
    )


def _checks(book, paper):
    """What came out, what it is not, every check with its limit, remarks and warnings."""
    sheet = book.sheet("checks", landscape=True, tab="result")
    columns = columns_of(book, SHEET_OF_CHECKS, sheet_rows(paper))
    widths = set_widths(book, sheet, columns)
    found, row = paper.found, HEAD_ROW
    rule = found["rule"]
    by = paper.word("texts.no_rule")
    if rule:
        verified = paper.word(f"verified.{rule['verified']}")
        by = paper.word("texts.by_rule", rule=bearable(rule["name"]), verified=verified)
    built = paper.word("texts.as_built" if found["as_built"] else "texts.as_built_unknown")
    said = [counts(paper), by, paper.word("texts.not_of_certificate"), built]
    for number, text in enumerate(said):
        look = {} if number else {"bold": True, "font_size": 12}
        book.paragraph(sheet, row, text, widths, **look)
        row += 1
    sheet.repeat_rows(row + 1)
    row = write_table(book, sheet, row + 1, SHEET_OF_CHECKS.name, columns, widths=widths) + 2
    for text in (*remarks(paper), *map(paper.warning, found["warnings"])):
        book.paragraph(sheet, row, text, widths)
        row += 1


def _sheet(book, code, tables):
    """Tables one below the other, the last with headings on every page; one alone keeps them."""
    sheet, row = book.sheet(code, landscape=True), HEAD_ROW
    columns = [columns_of(book, table, rows) for table, rows in tables]
    widths = set_widths(book, sheet, *columns)
    for (table, _), cells in zip(tables, columns, strict=True):
        filtered = {"autofilter": True} if len(tables) == 1 else {}
        sheet.repeat_rows(row)
        row = write_table(book, sheet, row, table.name, cells, widths=widths, **filtered) + 2
    if len(tables) == 1:
        book.freeze(sheet, HEAD_ROW, 1)
