"""Parse numbers as people write them: decimal comma or point, thousands separators, decimals.

A file is read in the style that leaves the fewest cells unreadable and the fewest falls in its
columns. So 1.234 is 1.234 m3 in one file and 1234 L in another.
"""

import re
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import isfinite
from typing import NamedTuple

from tankcal.job.tables import BadCell, shown
from tankcal.messages import message

THOUSANDS = (",", ".", " ", "'", "\u2019", "\u00a0", "\u2009", "\u202f")
MOST_DECIMALS = 15
LARGEST = 1e12
BLANK = message("lint_blank", "blank; expected a number")


class Style(NamedTuple):
    """Number format: decimal mark, and thousands separator ("": none)."""

    decimal: str
    thousands: str


@dataclass(frozen=True)
class Reading:
    """A cell read as a number.

    Attributes
    ----------
    value : float or None
        None if unreadable; see `complaint`.
    text : str
        As written, with a decimal point and without thousands separators.
    decimals : int
        Number of decimals written.
    marks : bool
        Whether it has thousands separators.
    is_typed : bool
        Whether it is text (in a workbook: text that looks like a number).
    """

    value: float | None
    text: str = ""
    decimals: int = 0
    marks: bool = False
    is_typed: bool = True
    complaint: str = ""


STYLES = (
    Style(".", ""),
    Style(",", ""),
    *(Style(".", mark) for mark in THOUSANDS if mark != "."),
    *(Style(",", mark) for mark in THOUSANDS if mark != ","),
)
PLAIN = STYLES[0]
_PLAIN_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?", re.ASCII)


def is_blank(cell):
    """Whether a cell is empty."""
    return cell is None or (isinstance(cell, str) and not cell.strip())


def has_digit(cell):
    """Whether a cell is a number, or text with a digit."""
    return not is_blank(cell) and (not isinstance(cell, str) or bool(re.search(r"\d", cell)))


def has_letter(cell):
    """Whether a cell is text with a letter."""
    return isinstance(cell, str) and bool(re.search(r"[^\W\d_]", cell))


def read_number(cell, style):
    """Return the `Reading` of a cell (a number or text) in a style."""
    if isinstance(cell, str):
        text = cell.strip()
        return _read_text(text, style) if text else Reading(None, complaint=BLANK)
    if isinstance(cell, BadCell):
        return Reading(None, complaint=cell.complaint)
    if is_blank(cell):
        return Reading(None, complaint=BLANK)
    if isinstance(cell, bool) or not isinstance(cell, int | float) or not isfinite(cell):
        return Reading(None, complaint=_no_number(cell))
    return _read_text(f"{cell:.15g}" if isinstance(cell, float) else str(cell), PLAIN, False)


def _no_number(text):
    """Message that a cell is no number."""
    return message("lint_no_number", "found {found}; expected a number", found=shown(text))


@lru_cache(maxsize=50_000)  # cached because style_of reads most cells several times
def _read_text(text, style, is_typed=True):
    """Read a number in a text."""
    plain, marks = text, False
    if style.thousands and style.thousands in text:
        groups = re.fullmatch(
            rf"[+-]?\d{{1,3}}(?:{re.escape(style.thousands)}\d{{3}})+"
            rf"(?:{re.escape(style.decimal)}\d*)?",
            text,
            re.ASCII,
        )
        if groups is None:
            return Reading(None, complaint=_no_number(text))
        plain, marks = text.replace(style.thousands, ""), True
    if style.decimal == ",":
        if "." in plain:
            return Reading(
                None,
                complaint=message(
                    "lint_decimal_comma",
                    "found {found}; expected a decimal comma",
                    found=shown(text),
                ),
            )
        plain = plain.replace(",", ".")
    if len(plain) > 40 or not _PLAIN_NUMBER.fullmatch(plain):
        return Reading(None, complaint=_no_number(text))
    value = float(plain)
    if not abs(value) < LARGEST:
        return Reading(
            None,
            complaint=message(
                "lint_too_large_number",
                "found {found}; expected less than {most:g}",
                found=shown(text),
                most=LARGEST,
            ),
        )
    mantissa, _, exponent = plain.lower().partition("e")
    decimals = len(mantissa.partition(".")[2]) - int(exponent or 0)
    decimals = min(max(decimals, 0), MOST_DECIMALS)
    return Reading(
        value, plain if not exponent else f"{value:.{decimals}f}", decimals, marks, is_typed
    )


def style_of(columns):
    """Return the style that reads the columns best.

    columns: lists of cells, in the order of the table: heights, volumes.
    """
    texts = [[cell.strip() for cell in column if isinstance(cell, str)] for column in columns]
    sample = "".join("".join(column) for column in texts)
    possible = [style for style in STYLES if not style.thousands or style.thousands in sample]

    columns = [[cell for cell in column if not is_blank(cell)] for column in columns]

    def badness(style, least):
        """Unreadable cells and falls; counted no further than to `least` unreadable ones."""
        bad = 0
        for column in columns:
            good = []
            for cell in column:
                value = read_number(cell, style).value
                if value is not None:
                    good.append(value)
                    continue
                bad += 1
                if bad >= least:
                    return bad
            rises = sum(b > a for a, b in pairwise(good))
            bad += min(rises, sum(b < a for a, b in pairwise(good)))
        return bad

    best, least = PLAIN, float("inf")
    for style in possible:
        score = badness(style, least)
        if score < least:
            best, least = style, score
        if least == 0:
            break
    return best
