"""The decimal mark of a CSV file of a job, by its numbers.

A number such as 12,5 or 0.125 has one meaning. 1,234 and 1.234 have two, with a decimal mark or
with one between thousands: the other numbers of the file, or [csv] in job.toml, decide.
"""

import re

from tankcal.job.tables import NOT_KNOWN, shown
from tankcal.messages import message
from tankcal.text.naming import MAX_NAME
from tankcal.text.numerals import NUMBER

_TWO_MEANINGS = re.compile(r"[+-]?[1-9][0-9]{0,2}[.,][0-9]{3}")


def has_two_meanings(text):
    """Whether a number may have a decimal mark or a mark between thousands.

    Examples
    --------
    >>> has_two_meanings("1,234"), has_two_meanings("0,234"), has_two_meanings("1,23")
    (True, False, False)
    """
    return _TWO_MEANINGS.fullmatch(text) is not None


def settle_decimal(table, fields, log):
    """The decimal mark of the numbers in a Table of a CSV file; None in a workbook.

    The marks of numbers with one meaning decide; without any, or with both, the mark that [csv]
    declares. A number with two meanings that neither decides is one problem for the file.
    """
    if table.decimal is None:
        return None
    places = [
        (table.headings.index(field.name), field.name)
        for field in fields
        if field.kind == "number" and field.name in table.headings
    ]
    marks = _marks_of(table, [place for place, _ in places])
    if len(marks) == 1:
        return marks.pop()
    usual = "." if table.decimal == NOT_KNOWN else table.decimal
    doubtful = _first_in_doubt(table, places, marks)
    if doubtful is None:
        return usual
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


def _marks_of(table, places):
    """The decimal marks of the numbers with one meaning."""
    marks = set()
    for place in places:
        cells = {row[place] for row in table.rows}
        for mark in {".", ","} - marks:
            if any(_shows(cell, mark) for cell in cells if cell and mark in cell):
                marks.add(mark)
    return marks


def _shows(cell, mark):
    text = cell.strip(" \t")
    if len(text) > MAX_NAME or text.count(",") + text.count(".") != 1 or has_two_meanings(text):
        return False
    return NUMBER.fullmatch(text.replace(mark, ".")) is not None


def _first_in_doubt(table, places, marks):
    """(text, row, column) of the first number that no mark decides, or None.

    Where both marks occur in numbers with one meaning, each other number is refused by itself.
    """
    if marks and table.decimal != NOT_KNOWN:
        return None
    for row, number in zip(table.rows, table.row_numbers, strict=True):
        for place, name in places:
            text = (row[place] or "").strip(" \t")
            if has_two_meanings(text) and table.decimal not in text:
                return text, number, name
    return None
