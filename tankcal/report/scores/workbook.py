"""Scores as a workbook: methods, tables and every row, numbers as numbers."""

from tankcal.report.scores.tables import METHODS_SHEET, PARTICIPANTS, ROWS, TABLES
from tankcal.report.workbook.book import Book
from tankcal.report.workbook.tables import columns_of, set_widths, write_table

HEAD_ROW = 3
SHEETS = {"methods": METHODS_SHEET, "tables": TABLES, "rows": ROWS, "participants": PARTICIPANTS}


def write(paper, path):
    """Write the workbook of a ScoresPaper; the same scores give the same bytes."""
    found = paper.found
    about = {
        "tankcal": found["tankcal"],
        "capacity": None,
        "job": {
            "certificate": {"notice": found["notice"]},
            "tank": None,
            "source": paper.subject(),
            "survey": {"date": paper.date()},
        },
    }
    with Book(path, about, paper.words, about="scores") as book:
        book.paper = paper
        for code, table in SHEETS.items():
            sheet = book.sheet(f"scored_{code}", landscape=True, tab="result")
            columns = columns_of(book, table, table.rows(found))
            widths = set_widths(book, sheet, columns)
            write_table(book, sheet, HEAD_ROW, table.name, columns, widths=widths, autofilter=True)
            book.freeze(sheet, HEAD_ROW, 1)
