"""The comparison as a workbook: every row, to sort and filter; numbers as numbers."""

from tankcal.report.comparison import basis, verdict
from tankcal.report.comparison.tables import COURSES, DELIVERIES, ROWS, waterfall_of
from tankcal.report.tables import Table
from tankcal.report.workbook.book import Book
from tankcal.report.workbook.look import Column as Cells
from tankcal.report.workbook.tables import columns_of, set_widths, write_tables

HEAD_ROW = 3
WIDTHS = (34, 40, 40, 18, 26)


def write(paper, path):
    """Write the workbook of a ComparisonPaper; the same comparison gives the same bytes."""
    with Book(path, _as_record(paper.found), paper.words, about="comparison") as book:
        book.paper = paper
        _verdict(book, paper)
        _rows(book, paper)
        _others(book, paper)


def _as_record(found):
    """What a Book asks of a record: whose the workbook is, and the day."""
    new = found["new"]
    return {
        "tankcal": found["tankcal"],
        "capacity": None,
        "job": {
            "certificate": {"laboratory": new["laboratory"]},
            "tank": {"id": found["tank"] or found["former"]["name"]},
            "survey": {"date": new["date"]},
        },
    }


def _verdict(book, paper):
    """Verdict, reasons, both tables, the numbers of the rule, how sure what was read is."""
    found = paper.found
    sheet = book.sheet("verdict", landscape=True, tab="result")
    book.widths(sheet, *WIDTHS)
    row, bold = HEAD_ROW, {"bold": True, "font_size": 12}
    code = found["verdict"] or "none"
    said = [(paper.word(f"verdicts.{code}"), bold), (paper.word(f"texts.verdict_{code}"), {})]
    said += [(f"– {paper.reason(one)}", {}) for one in found["reasons"]]
    for text, look in said:
        book.paragraph(sheet, row, text, WIDTHS, **look)
        row += 1
    row += 1
    for name, columns, rows in (
        ("sides", basis.SIDES, basis.side_rows(paper)),
        ("legal", verdict.LEGAL, [*verdict.legal_rows(paper), *verdict.age_rows(paper)]),
        ("read", basis.READ, basis.read_rows(paper)),
    ):
        if rows:
            row = _texts(book, sheet, row, name, columns, rows)


def _texts(book, sheet, row, name, columns, rows):
    """A table of texts with its heading; returns the row after it."""
    paper = book.paper
    cells = [
        Cells(paper.word(f"table_headings.{one.heading or one.key}"), [r[one.key] for r in rows])
        for one in columns
    ]
    book.heading(sheet, row, paper.word(f"sheet_headings.{name}"), len(columns))
    return book.table(sheet, row + 1, name, cells, widths=list(WIDTHS[: len(cells)])) + 2


def _rows(book, paper):
    """Every row, with headings that stay in sight."""
    sheet = book.sheet("rows", landscape=True, tab="result")
    columns = columns_of(book, ROWS, ROWS.rows(paper.found))
    widths = set_widths(book, sheet, columns)
    book.table(sheet, HEAD_ROW, ROWS.name, columns, autofilter=True, widths=widths)
    book.freeze(sheet, HEAD_ROW, 1)


def _others(book, paper):
    """Waterfall, worst deliveries and radii, a sheet each."""
    found = paper.found
    tables = {
        "waterfall": (waterfall_of(found), found["waterfall"]),
        "deliveries": (DELIVERIES, found["deliveries"]),
        "courses": (COURSES, found["courses"]),
    }
    for code, (table, rows) in tables.items():
        if rows:
            _sheet(book, code, table, rows)


def _sheet(book, code, table: Table, rows):
    sheet = book.sheet(code, landscape=True)
    title = book.word(f"titles.{code}")
    write_tables(book, sheet, HEAD_ROW, [(title, table.name, columns_of(book, table, rows))])
