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
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.sections import (
    FIRST_LINE,
    Sentences,
    SheetContent,
    cell_table,
    write_workbook,
)

# Tables of each sheet after the checks, with the function of their rows.
SHEETS = {
    "generatrices": ((GENERATRICES, generatrix_rows),),
    "levels": ((LEVELS, level_rows), (COURSES, course_rows), (PLACES, place_rows)),
    "welds": ((GAPS, gap_rows),),
    "settlement": ((PLANES, plane_rows), (POINTS, point_rows)),
    "edges": ((EDGES, EDGES.rows), (READINGS, reading_rows)),
}


def write(paper, path):
    """Write the workbook of an InspectionPaper; equal inspections give equal bytes."""
    inspection, tank = paper.record, paper.record["tank"]
    head = workbook_head(
        inspection["tankcal"],
        tank=bearable(tank["id"]),
        date=tank["survey_date"],
        notice=inspection["notice"],
    )
    write_workbook(paper, path, "inspection", head, sheets)


def sheets(book):
    """Yield the content of each sheet, in order; tables without rows are omitted."""
    yield _checks_sheet(book, book.paper)
    for code, declared in SHEETS.items():
        tables = [
            cell_table(book, table, rows)
            for table, rows_of in declared
            if (rows := rows_of(book.paper.record))
        ]
        if tables:
            is_single = len(tables) == 1
            yield SheetContent(code, tables, is_filtered=is_single, repeats_headings=True)


def _checks_sheet(book, paper):
    """Return the result and its scope, all checks with their limits, remarks and warnings."""
    inspection = paper.record
    as_built = paper.word("texts.as_built" if inspection["as_built"] else "texts.as_built_unknown")
    scope = [rule_text(paper), paper.word("texts.not_of_certificate"), as_built]
    sections = [
        (Sentences([counts(paper)], look=FIRST_LINE), Sentences(scope)),
        cell_table(book, SHEET_OF_CHECKS, sheet_rows(paper)),
        Sentences([*remarks(paper), *map(paper.warning, inspection["warnings"])]),
    ]
    return SheetContent("checks", sections, tab="result", repeats_headings=True)
