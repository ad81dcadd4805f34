"""Workbook of scores: methods, tables and all rows, with numbers as numbers."""

from tankcal.report.scores.tables import METHODS_SHEET, PARTICIPANTS, ROWS, TABLES
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.sections import SheetContent, cell_table, write_workbook

SHEETS = {
    "scored_methods": METHODS_SHEET,
    "scored_tables": TABLES,
    "scored_rows": ROWS,
    "scored_participants": PARTICIPANTS,
}


def write(paper, path):
    """Write the workbook of a ScoresPaper; equal scores give equal bytes."""
    scores = paper.found
    head = workbook_head(
        scores["tankcal"], source=paper.subject(), date=paper.date(), notice=scores["notice"]
    )
    write_workbook(paper, path, "scores", head, sheets)


def sheets(book):
    """Yield the content of each sheet, in order."""
    for code, table in SHEETS.items():
        yield SheetContent(code, [cell_table(book, table)], tab="result", is_filtered=True)
