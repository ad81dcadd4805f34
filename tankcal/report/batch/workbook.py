"""The summary of a batch as a workbook: a row for each job, to sort and filter."""

from tankcal.report.batch.pages import known
from tankcal.report.batch.tables import JOBS
from tankcal.report.workbook.book import Book, about_saved
from tankcal.report.workbook.tables import HEAD_ROW, table_sheet

MOST_LINKS = 65_530  # of a sheet, as Excel takes them


def write(paper, path):
    """Write the workbook of a SummaryPaper; the same rows give the same bytes."""
    rows = paper.found["rows"]
    about = about_saved(paper.found["tankcal"], source=str(len(rows)))
    with Book(path, about, paper.words, about="batch") as book:
        book.paper = paper
        book.subject = paper.word("titles.summary")
        sheet, columns = table_sheet(book, "jobs", JOBS, known(rows))
        _link(book, sheet, len(columns) - 1, rows, paper)


def _link(book, sheet, column, rows, paper):
    """Lead the cells of the last column to the papers that they name."""
    look = book.format(bottom=4, align="left", indent=1, underline=1, font_color="blue")
    for place, row in enumerate(rows[:MOST_LINKS], start=HEAD_ROW + 1):
        if row["papers"]:
            sheet.write_url(place, column, f"external:{row['papers'][0]}", look, paper.papers(row))
