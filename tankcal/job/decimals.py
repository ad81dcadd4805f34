"""Decimal mark of the numbers in a CSV file of a job.

A number such as 12,5 or 0.125 has one meaning. The numbers 1,234 and 1.234 have two meanings: the
mark may be a decimal mark or separate thousands. The bounds of the column, the other numbers of the
file, or [csv] in the settings decide: a dip of up to 200 m is not 1234 m.
"""

import re

from tankcal.job.tables import NOT_KNOWN, shown
from tankcal.messages import message
from tankcal.text.naming import MAX_NAME, NUMBER

_TWO_MEANINGS = re.compile(r"[+-]?[1-9][0-9]{0,2}[.,][0-9]{3}")


def has_two_meanings(text):
    """Return True if the mark of a number may be a decimal mark or separate thousands.

    Examples
    --------
    >>> has_two_meanings("1,234"), has_two_meanings("0,234"), has_two_meanings("1,23")
    (True, False, False)
    """
    return _TWO_MEANINGS.fullmatch(text) is not None


def settle_decimal(table, fields, log):
    """Determine the decimal mark of the numbers in a table; None for a table of a workbook.

    The numbers with one meaning decide if they all have the same mark. Without a declared mark, a
    number has one meaning if the other is outside the bounds of its column. Otherwise the mark
    declared in [csv] applies. A number with two meanings that neither decides is one problem for
    the file.

    Parameters
    ----------
    table : Table
        Table as read.
    fields : sequence of Field
        Columns of the table.
    log : Log
        Receives the problem.

    Returns
    -------
    str or None
    """
    if table.decimal is None:
        return None
    places = [
        (table.headings.index(field.name), field)
        for field in fields
        if field.kind == "number" and field.name in table.headings
    ]
    marks = _marks_of(table, places, table.decimal == NOT_KNOWN)
    if len(marks) == 1:
        return marks.pop()
    default = "." if table.decimal == NOT_KNOWN else table.decimal
    doubtful = _first_in_doubt(table, places, marks)
    if doubtful is None:
        return default
    text, row, column = doubtful
    plain = text.replace(",", ".")
    found = {"found": shown(text), "small": plain, "large": plain.replace(".", "")}
    expected = message(
        "two_meanings",
        "found {found}, which is {small} or {large}; expected a decimal mark that is known: set "
        "[csv] decimal = '.' or ','",
        **found,
    )
    if table.decimal != NOT_KNOWN:
        expected = message(
            "two_meanings_declared",
            "found {found}, which is {small} or {large}; expected '{mark}' as decimal mark: "
            "set [csv] decimal = '{other}' if it is {small}",
            **found,
            mark=table.decimal,
            other="," if table.decimal == "." else ".",
        )
    log.problem(table.file, expected, row, column)
    return "," if "," in text else "."


def _marks_of(table, places, by_bounds):
    """Set of the decimal marks of numbers with one meaning, also `by_bounds` of their columns."""
    marks = set()
    for place, field in places:
        cells = {row[place] for row in table.rows}
        for mark in {".", ","} - marks:
            present = [cell.strip(" \t") for cell in cells if cell and mark in cell]
            if any(
                _shows(text, mark) or (by_bounds and _is_decimal(text, mark, field))
                for text in present
            ):
                marks.add(mark)
    return marks


def _shows(text, mark):
    """Return True if the text is a number with one meaning and this decimal mark."""
    if len(text) > MAX_NAME or text.count(",") + text.count(".") != 1 or has_two_meanings(text):
        return False
    return NUMBER.fullmatch(text.replace(mark, ".")) is not None


def _is_decimal(text, mark, field):
    """Return True if the field accepts a number with two meanings as a decimal fraction only."""
    if not has_two_meanings(text):
        return False
    small, large = float(text.replace(mark, ".")), float(text.replace(mark, ""))
    return field.low <= small <= field.high and not field.low <= large <= field.high


def _first_in_doubt(table, places, marks):
    """(text, row, column) of the first number whose meaning is not decided, or None.

    If both marks occur in numbers with one meaning, `read_value` refuses each other number.
    """
    if marks and table.decimal != NOT_KNOWN:
        return None
    for row, number in zip(table.rows, table.row_numbers, strict=True):
        for place, field in places:
            text = (row[place] or "").strip(" \t")
            if has_two_meanings(text) and table.decimal not in text:
                return text, number, field.name
    return None
