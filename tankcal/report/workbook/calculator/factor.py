"""The sheet with the factor of the covariance of all rows: a row for each dip, plain columns."""

from collections import Counter

from tankcal.record.covariance_factor import factor_of
from tankcal.report.workbook.look import Column, height_digits
from tankcal.text.words import name_of_input

_DIGITS = 6
_WIDTH = 15


def column_names(book, capacity):
    """The heading of each column: the input, numbered where it has several."""
    kinds = capacity["input_kind"]
    counts, seen, names = Counter(kinds), Counter(), []
    for kind in kinds:
        seen[kind] += 1
        name = name_of_input(book.words, kind)
        names.append(name if counts[kind] == 1 else f"{name} {seen[kind]}")
    return names


def factor_sheet(book, record):
    """Dips in m and the columns of the factor in m³; no sheet where nothing is uncertain.

    The covariance of two rows is the sum over the columns of the products of their factors.
    """
    capacity = record["capacity"]
    if not capacity["inputs"]:
        return
    heights = capacity["height_m"]
    columns = [Column(_dip(book), heights, height_digits(heights), 12)]
    by_column = factor_of(capacity).T
    columns += [
        Column(name, cells.tolist(), _DIGITS, _WIDTH)
        for name, cells in zip(column_names(book, capacity), by_column, strict=True)
    ]
    sheet = book.plain_sheet("covariance_factor", columns, landscape=True)
    book.name("covariance_factor", sheet, 1, len(heights), 1, len(columns) - 1)


def _dip(book):
    return book.word("columns.dip_m", of="calculator")
