"""Declared tables on sheets: their columns as cells, the widths they share, tables without rows."""

from itertools import zip_longest

from tankcal.report import numbers
from tankcal.report.tables import decimals_of_cells
from tankcal.report.workbook.look import Column, width_of
from tankcal.text.digits import NOTHING, decimals_of

HEAD_ROW = 3  # of a table that has a sheet of its own


def columns_of(book, table, rows=None):
    """The columns of a declared Table as cells, of these rows (None: its own of the record)."""
    rows = table.rows(book.paper.record) if rows is None else rows
    return [_cells(book, book.paper, one, rows) for one in table.in_workbook(rows)]


def _cells(book, paper, column, rows):
    """One declared column as cells: numbers as numbers in its unit, texts in the words."""
    unit = numbers.unit(column.unit)
    heading = _heading(book, column, unit)
    if column.is_text or column.text:
        return Column(heading, _texts(paper, column, rows), None, column.width)
    nothing = None if column.nothing == NOTHING else column.nothing
    is_share = column.unit == "share"  # a format of the spreadsheet makes percent of it
    factor = 1.0 if is_share else unit.factor
    values = [row.get(column.key) for row in rows]
    cells = [
        nothing if value is None else value if factor == 1.0 else factor * value for value in values
    ]
    return Column(heading, cells, _digits(column, rows, unit.factor), column.width, is_share)


def _heading(book, column, unit):
    if column.sheet is not True:
        return book.word(f"columns.{column.sheet}", **column.named)
    heading = book.words["table_headings"][column.heading or column.key]
    return f"{heading}, {unit.symbol}" if unit.symbol else heading


def _texts(paper, column, rows):
    if column.text is not None:
        return [column.text(paper, row) for row in rows]
    values = [row.get(column.key) for row in rows]
    known = paper.words[column.words] if column.words else {}
    return [known.get(str(value), value) for value in values] if known else values


def _digits(column, rows, factor):
    if column.digits is None:
        return decimals_of_cells(column, rows, factor, rounds_whole=False)
    most = 99 if column.most is None else column.most
    values = [factor * abs(row.get(column.key) or 0.0) for row in rows]
    return [min(decimals_of(value, significant=column.digits), most) for value in values]


def set_widths(book, sheet, *tables, least=()):
    """Make each column as wide as the widest that shares it; returns the widths.

    least  widths that the first columns have at least
    """
    of_tables = [[width_of(column) for column in columns] for columns in tables]
    widths = [max(shared) for shared in zip_longest(least, *of_tables, fillvalue=0)]
    book.widths(sheet, *widths)
    return widths


def table_sheet(book, code, table, rows):
    """A declared table on a sheet of its own, with headings that stay in sight.

    Gives the sheet and the columns.
    """
    sheet = book.sheet(code, landscape=True, tab="result")
    columns = columns_of(book, table, rows)
    widths = set_widths(book, sheet, columns)
    write_table(book, sheet, HEAD_ROW, table.name, columns, autofilter=True, widths=widths)
    book.freeze(sheet, HEAD_ROW, 1)
    return sheet, columns


def write_table(book, sheet, row, name, columns, **more):
    """A table, or the word None where it has no rows; returns the number of its last row."""
    if columns[0].cells:
        return book.table(sheet, row, name, columns, **more)
    book.put(sheet, row, 0, book.word("texts.no_rows"))
    return row


def write_tables(book, sheet, row, tables):
    """(title, name, columns) one below the other; returns the row after the last."""
    widths = set_widths(book, sheet, *(columns for _, _, columns in tables))
    for title, name, columns in tables:
        book.heading(sheet, row, title, len(columns))
        row = write_table(book, sheet, row + 1, name, columns, widths=widths) + 2
    return row
