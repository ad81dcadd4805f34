"""Texts in CSV files that a spreadsheet would execute as formulas.

With an apostrophe before its sign a spreadsheet shows such a text. A table of a job is read without
the apostrophe, so that a text is the same after it was written and read.
"""

import csv

from tankcal.text.numerals import NUMBER

_SIGNS = ("=", "+", "-", "@", "\t")


def guard_formula(text):
    """The text, with an apostrophe before it where a spreadsheet would take it for a formula.

    A number keeps its sign, with either decimal mark, and so does a dash for a missing value.

    Examples
    --------
    >>> guard_formula("=1+1"), guard_formula("-0.25"), guard_formula("P-1")
    ("'=1+1", '-0.25', 'P-1')
    """
    text = text.replace("\r", " ")  # csv.writer does not quote it, so that a new row would begin
    if not text.lstrip(" ").startswith(_SIGNS) or NUMBER.fullmatch(text.replace(",", ".")):
        return text
    return f"'{text}" if any(map(str.isalnum, text)) else text


def unguard_formula(text):
    """The text without the apostrophe of `guard_formula`.

    Examples
    --------
    >>> unguard_formula("'=1+1"), unguard_formula("'P-1")
    ('=1+1', "'P-1")
    """
    return text[1:] if text[:1] == "'" and text[1:].lstrip(" ").startswith(_SIGNS) else text


def write_guarded(stream, rows, separator=","):
    """Write rows of cells as CSV to a stream, the texts among them guarded."""
    guarded = ([guard_formula(c) if isinstance(c, str) else c for c in row] for row in rows)
    csv.writer(stream, delimiter=separator, lineterminator="\n").writerows(guarded)
