"""Tables that share the columns of a sheet: their widths, and tables without rows."""

from itertools import zip_longest

from tankcal.report.workbook.look import width_of


def set_widths(book, sheet, *tables, least=()):
    """Make each column as wide as the widest that shares it; returns the widths.

    least  widths that the first columns have at least
    """
    of_tables = [[width_of(column) for column in columns] for columns in tables]
    widths = [max(shared) for shared in zip_longest(least, *of_tables, fillvalue=0)]
    book.widths(sheet, *widths)
    return widths


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
