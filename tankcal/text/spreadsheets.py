"""Protection of CSV texts that a spreadsheet would execute as formulas.

An apostrophe before the sign makes a spreadsheet show such a text. Tables of a job are read without
the apostrophe, so a text is unchanged after writing and reading.
"""

import csv

from tankcal.text.numerals import NUMBER

_SIGNS = ("=", "+", "-", "@", "\t")


def guard_formula(text):
    """Return the text, with an apostrophe if a spreadsheet would execute it as a formula.

    Signed numbers, with either decimal mark, and dashes for missing values are not changed.

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
    """Return the text without the apostrophe of `guard_formula`.

    Examples
    --------
    >>> unguard_formula("'=1+1"), unguard_formula("'P-1")
    ('=1+1', "'P-1")
    """
    return text[1:] if text[:1] == "'" and text[1:].lstrip(" ").startswith(_SIGNS) else text


def write_guarded(stream, rows, separator=","):
    """Write rows of cells as CSV to a stream, with protected texts."""
    guarded = ([guard_formula(c) if isinstance(c, str) else c for c in row] for row in rows)
    csv.writer(stream, delimiter=separator, lineterminator="\n").writerows(guarded)
