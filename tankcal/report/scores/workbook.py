"""Scores as a workbook: methods, tables and every row, numbers as numbers."""

from tankcal.report.scores.tables import METHODS_SHEET, PARTICIPANTS, ROWS, TABLES
from tankcal.report.workbook.book import Book, about_saved
from tankcal.report.workbook.tables import table_sheet

SHEETS = {"methods": METHODS_SHEET, "tables": TABLES, "rows": ROWS, "participants": PARTICIPANTS}


def write(paper, path):
    """Write the workbook of a ScoresPaper; the same scores give the same bytes."""
    found = paper.found
    about = about_saved(
        found["tankcal"], source=paper.subject(), date=paper.date(), notice=found["notice"]
    )
    with Book(path, about, paper.words, about="scores") as book:
        book.paper = paper
        for code, table in SHEETS.items():
            table_sheet(book, f"scored_{code}", table, table.rows(found))
