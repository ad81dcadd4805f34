"""Workbook of a comparison: all rows, to sort and filter, with numbers as numbers."""

from tankcal.report.comparison.pages import DECIMALS_OF_LIMITS, side_rows
from tankcal.report.comparison.tables import (
    COURSES,
    DECIMALS,
    DELIVERIES,
    ROWS,
    STEPS,
    step_rows,
    unit_symbol,
    waterfall_table,
)
from tankcal.report.workbook.book import Book, about_saved
from tankcal.report.workbook.look import Column as Cells
from tankcal.report.workbook.tables import (
    HEAD_ROW,
    columns_of,
    set_widths,
    table_sheet,
    write_table,
)

WIDTHS = (30, 34, 34, 12, 12, 24, 40, 12)
READ_DECIMALS = 6  # of values estimated from the tables, for units that DECIMALS lacks


def write(paper, path):
    """Write the workbook of a ComparisonPaper; equal comparisons give equal bytes."""
    comparison, new = paper.found, paper.found["new"]
    about = about_saved(
        comparison["tankcal"],
        tank=comparison["tank"] or comparison["former"]["name"],
        date=new["date"],
        notice=comparison["notice"],
        laboratory=new["laboratory"],
    )
    with Book(path, about, paper.words, about="comparison") as book:
        book.paper = paper
        _verdict(book, paper)
        table_sheet(book, "rows", ROWS, ROWS.rows(comparison))
        _other_sheets(book, paper)


def _verdict(book, paper):
    """Write the verdict, its reasons, both tables, the limits of the rule and estimated values."""
    comparison = paper.found
    sheet = book.sheet("verdict", landscape=True, tab="result")
    book.widths(sheet, *WIDTHS)
    row, bold = HEAD_ROW, {"bold": True, "font_size": 12}
    code = comparison["verdict"] or "none"
    texts = [(paper.word(f"verdicts.{code}"), bold), (paper.word(f"texts.verdict_{code}"), {})]
    texts += [(f"– {paper.reason(reason)}", {}) for reason in comparison["reasons"]]
    for text, look in texts:
        book.paragraph(sheet, row, text, WIDTHS, **look)
        row += 1
    row, starts = row + 1, []
    tables = {"sides": _sides(paper), "legal": _legal(paper), "read": _read(paper)}
    for name, columns in tables.items():
        if columns[0].cells:
            starts.append(row)
            book.heading(sheet, row, paper.word(f"sheet_headings.{name}"), len(columns))
            widths = list(WIDTHS[: len(columns)])
            row = book.table(sheet, row + 1, name, columns, widths=widths) + 2
    book.keep_together(sheet, starts, row, WIDTHS)


def _sides(paper):
    rows = side_rows(paper)
    return [_column(paper, key, [row[key] for row in rows]) for key in ("what", "former", "new")]


def _legal(paper):
    """Return the columns of the limits and periods of the rule; each number with its unit."""
    limits, ages = paper.found["legal"], paper.found["ages"]
    digits = [DECIMALS_OF_LIMITS[limit["unit"]] for limit in limits] + [1] * len(ages)
    names = [paper.word(f"numbers.{limit['code']}") for limit in limits]
    names += [paper.word(f"ages.{age['of']}") for age in ages]
    values = [limit["value"] for limit in limits] + [age["age_years"] for age in ages]
    printed = [limit["as_printed"] for limit in limits] + [None] * len(ages)
    largest = [limit["limit"] for limit in limits] + [age["years"] for age in ages]
    units = [unit_symbol(limit["unit"]) for limit in limits]
    units += [paper.word("texts.unit_years")] * len(ages)
    entries = [*limits, *ages]
    return [
        _column(paper, "number", names),
        _column(paper, "value", values, digits),
        _column(paper, "as_printed", printed, digits),
        _column(paper, "limit", largest, digits),
        _column(paper, "unit", units),
        _column(paper, "verdict", [paper.word(f"limits.{entry['verdict']}") for entry in entries]),
        _column(paper, "clause", [entry["clause"] for entry in entries]),
        _column(paper, "verified", [entry["verified"] for entry in entries]),
    ]


def _read(paper):
    """Return the columns of the values estimated from the tables."""
    entries = paper.found["read"]
    digits = [DECIMALS.get(entry["unit"], READ_DECIMALS) for entry in entries]
    sides = [paper.word(f"sides_of_comparison.{entry['table']}") for entry in entries]
    return [
        _column(paper, "table", sides),
        _column(paper, "what", [paper.word(f"read.{entry['code']}") for entry in entries]),
        _column(paper, "read_value", [entry["value"] for entry in entries], digits),
        _column(paper, "u", [entry["u"] for entry in entries], digits),
        _column(paper, "unit", [unit_symbol(entry["unit"]) for entry in entries]),
        _column(paper, "sure", [paper.word(f"sure.{entry['sure']}") for entry in entries]),
        _column(paper, "used", [entry["used"] for entry in entries]),
    ]


def _column(paper, key, cells, digits=None):
    return Cells(paper.word(f"table_headings.{key}"), cells, digits)


def _other_sheets(book, paper):
    """Write steps and waterfall, worst deliveries and radii, each on its own sheet."""
    comparison = paper.found
    sheets = {
        "waterfall": (
            (STEPS, step_rows(paper)),
            (waterfall_table(comparison), comparison["waterfall"]),
        ),
        "deliveries": ((DELIVERIES, comparison["deliveries"]),),
        "courses": ((COURSES, comparison["courses"]),),
    }
    for code, tables in sheets.items():
        sheet, row = book.sheet(code, landscape=True), HEAD_ROW
        columns = [columns_of(book, table, rows) for table, rows in tables]
        widths = set_widths(book, sheet, *columns)
        for (table, _), cells in zip(tables, columns, strict=True):
            row = write_table(book, sheet, row, table.name, cells, widths=widths) + 2
