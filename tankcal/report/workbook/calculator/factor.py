"""The sheet with the covariance factor: a row for each dip of the table."""

from collections import Counter

from tankcal.record.covariance_factor import factor_of
from tankcal.report.workbook.look import Column, height_digits
from tankcal.text.words import name_of_input

_DIGITS = 6  # decimals of the factor in m³
_WIDTH = 15  # width of a column, letters


def column_names(book, capacity):
    """Return the heading of each column: the input, numbered if it has several columns."""
    kinds = capacity["input_kind"]
    counts, numbers, names = Counter(kinds), Counter(), []
    for kind in kinds:
        numbers[kind] += 1
        name = name_of_input(book.words, kind)
        names.append(name if counts[kind] == 1 else f"{name} {numbers[kind]}")
    return names


def factor_sheet(book, record):
    """Write dips in m and the columns of the factor in m³; no sheet without uncertain inputs.

    The covariance of two rows is the sum over the columns of the products of their factors.
    """
    capacity = record["capacity"]
    if not capacity["inputs"]:
        return
    heights = capacity["height_m"]
    columns = [
        Column(book.word("columns.dip_m", of="calculator"), heights, height_digits(heights), 12)
    ]
    factor_columns = factor_of(capacity).T
    columns += [
        Column(name, cells.tolist(), _DIGITS, _WIDTH)
        for name, cells in zip(column_names(book, capacity), factor_columns, strict=True)
    ]
    sheet = book.plain_sheet("covariance_factor", columns, landscape=True)
    book.name("covariance_factor", sheet, 1, len(heights), 1, len(columns) - 1)
