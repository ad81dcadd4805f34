"""The summary of a batch as a workbook: a row for each job, to sort and filter."""

from tankcal.report.batch.pages import known
from tankcal.report.batch.tables import JOBS
from tankcal.report.workbook.book import Book
from tankcal.report.workbook.tables import columns_of, set_widths, write_table

HEAD_ROW = 3
MOST_LINKS = 65_530  # of a sheet, as Excel takes them


def write(paper, path):
    """Write the workbook of a SummaryPaper; the same rows give the same bytes."""
    with Book(path, _as_record(paper.found), paper.words, about="batch") as book:
        book.paper = paper
        book.subject = paper.word("titles.summary")
        sheet = book.sheet("jobs", landscape=True, tab="result")
        rows = paper.found["rows"]
        columns = columns_of(book, JOBS, known(rows))
        widths = set_widths(book, sheet, columns)
        write_table(book, sheet, HEAD_ROW, JOBS.name, columns, autofilter=True, widths=widths)
        book.freeze(sheet, HEAD_ROW, 1)
        _link(book, sheet, len(columns) - 1, rows, paper)


def _link(book, sheet, column, rows, paper):
    """Lead the cells of the last column to the papers that they name."""
    look = book.format(bottom=4, align="left", indent=1, underline=1, font_color="blue")
    for place, row in enumerate(rows[:MOST_LINKS], start=HEAD_ROW + 1):
        if row["papers"]:
            sheet.write_url(place, column, f"external:{row['papers'][0]}", look, paper.papers(row))


def _as_record(found):
    """What a Book asks of a record: what the workbook is about."""
    return {
        "tankcal": found["tankcal"],
        "capacity": None,
        "job": {
            "certificate": {},
            "tank": None,
            "source": f"{len(found['rows'])}",
            "survey": None,
        },
    }
