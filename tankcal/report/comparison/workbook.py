"""The comparison as a workbook: every row, to sort and filter; numbers as numbers."""

from tankcal.report.comparison.basis import side_rows
from tankcal.report.comparison.tables import (
    COURSES,
    DECIMALS,
    DELIVERIES,
    ROWS,
    STEPS,
    step_rows,
    symbol_of,
    waterfall_of,
)
from tankcal.report.comparison.verdict import DECIMALS_OF_LIMITED
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


def write(paper, path):
    """Write the workbook of a ComparisonPaper; the same comparison gives the same bytes."""
    with Book(path, _about(paper.found), paper.words, about="comparison") as book:
        book.paper = paper
        _verdict(book, paper)
        table_sheet(book, "rows", ROWS, ROWS.rows(paper.found))
        _others(book, paper)


def _about(found):
    new = found["new"]
    return about_saved(
        found["tankcal"],
        tank=found["tank"] or found["former"]["name"],
        date=new["date"],
        notice=found["notice"],
        laboratory=new["laboratory"],
    )


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
    """The numbers of the rule and its periods, numbers as numbers in the unit beside them."""
    found, ages = paper.found["legal"], paper.found["ages"]
    digits = [DECIMALS_OF_LIMITED[one["unit"]] for one in found] + [1] * len(ages)
    verdicts = [paper.word(f"limits.{one['verdict']}") for one in (*found, *ages)]
    years = [one["age_years"] for one in ages]
    names = [paper.word(f"numbers.{one['code']}") for one in found]
    units = [symbol_of(one["unit"]) for one in found]
    return [
        _column(paper, "number", names + [paper.word(f"ages.{one['of']}") for one in ages]),
        _column(paper, "value", [one["value"] for one in found] + years, digits),
        _column(paper, "as_printed", [one["as_printed"] for one in found] + [None for _ in ages],
                digits),
        _column(paper, "limit", [one["limit"] for one in found] + [one["years"] for one in ages],
                digits),
        _column(paper, "unit", units + [paper.word("texts.unit_years") for _ in ages]),
        _column(paper, "verdict", verdicts),
        _column(paper, "clause", [one["clause"] for one in (*found, *ages)]),
        _column(paper, "verified", [one["verified"] for one in (*found, *ages)]),
    ]  # fmt: skip


def _read(paper):
    found = paper.found["read"]
    digits = [DECIMALS.get(one["unit"], 6) for one in found]
    return [
        _column(paper, "table", [paper.word(f"sides_of_comparison.{o['table']}") for o in found]),
        _column(paper, "what", [paper.word(f"read.{one['code']}") for one in found]),
        _column(paper, "read_value", [one["value"] for one in found], digits),
        _column(paper, "u", [one["u"] for one in found], digits),
        _column(paper, "unit", [symbol_of(one["unit"]) for one in found]),
        _column(paper, "sure", [paper.word(f"sure.{one['sure']}") for one in found]),
        _column(paper, "used", [one["used"] for one in found]),
    ]


def _column(paper, key, cells, digits=None):
    return Cells(paper.word(f"table_headings.{key}"), cells, digits)


def _others(book, paper):
    """Steps and waterfall, worst deliveries and radii, a sheet each."""
    found = paper.found
    sheets = {
        "waterfall": ((STEPS, step_rows(paper)), (waterfall_of(found), found["waterfall"])),
        "deliveries": ((DELIVERIES, found["deliveries"]),),
        "courses": ((COURSES, found["courses"]),),
    }
    for code, tables in sheets.items():
        sheet, row = book.sheet(code, landscape=True), HEAD_ROW
        columns = [columns_of(book, table, rows) for table, rows in tables]
        widths = set_widths(book, sheet, *columns)
        for (table, _), cells in zip(tables, columns, strict=True):
            row = write_table(book, sheet, row, table.name, cells, widths=widths) + 2
