"""Columns of cells for the declared tables, and their widths."""

from itertools import zip_longest

from tankcal.report import numbers
from tankcal.report.tables import decimals_of_cells
from tankcal.report.workbook.look import Column, width_of
from tankcal.text.digits import NOTHING, decimals_of


def columns_of(book, table, rows=None):
    """Return the columns of a declared table with their cells.

    Parameters
    ----------
    book : Book
        Workbook.
    table : Table
        Declaration of the table.
    rows : list of dict, optional
        Rows; None: the rows of the record.

    Returns
    -------
    list of Column
    """
    rows = table.rows(book.paper.record) if rows is None else rows
    return [_cells(book, book.paper, column, rows) for column in table.in_workbook(rows)]


def _cells(book, paper, column, rows):
    """Return a declared column as a Column: numbers in its unit, or translated texts."""
    unit = numbers.unit(column.unit)
    heading = _heading(book, column, unit)
    if column.is_text or column.text:
        return Column(heading, _texts(paper, column, rows), None, column.width)
    nothing = None if column.nothing == NOTHING else column.nothing
    is_share = column.unit == "share"  # the number format converts shares to percent
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
    """Set the widths of the columns of a sheet to the widest of its tables.

    Parameters
    ----------
    book : Book
        Workbook.
    sheet : Sheet
        Sheet of the tables.
    *tables : list of Column
        Columns of each table.
    least : sequence of float, optional
        Smallest widths of the first columns.

    Returns
    -------
    list of float
        Widths of the columns.
    """
    widths_of_tables = [[width_of(column) for column in columns] for columns in tables]
    widths = [
        max(column_widths) for column_widths in zip_longest(least, *widths_of_tables, fillvalue=0)
    ]
    book.widths(sheet, *widths)
    return widths
