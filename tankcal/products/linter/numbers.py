"""Parse numbers as people write them: decimal comma or point, feet and inches, fractions.

A file is read in the style that leaves the fewest cells unreadable and the fewest falls in its
columns. So 1.234 is 1.234 m3 in one file and 1234 L in another.

A height may have several parts. A column of labels has one of these notations:

    5' 3 3/16", 5 ft 3 3/16 in   marks identify the parts
    5-3 3/16, 5-03-3/16, 5-3     feet and inches, with an optional fraction
    5-03-03                      feet, inches, and eighths or sixteenths of an inch
    10 1/4, 10¼, 10-1/4          inches, or another unit in the heading except feet

In 5-03-03, the heading states the unit of the last part (ft-in-16, ft-in-8ths). Without such a
heading, a part of 8 or more anywhere in the column means sixteenths. Parts up to 7 are ambiguous
and cause an error.

Two columns of heights before the volumes are either one height in two units (1.25 m, 125 cm) or the
parts of one height (4 ft, 3 in). In the first case the first column is read; in the second case the
parts are added. The rows decide between the cases.
"""

import re
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from math import isfinite
from typing import NamedTuple
from unicodedata import normalize

import numpy as np

from tankcal.errors import HeightError, InputError, Problem
from tankcal.job.tables import BadCell, shown
from tankcal.messages import message
from tankcal.products.linter.units import Heading, Unit, parts_of_inch, plain_text
from tankcal.tank.dips import INCHES_PER_FOOT, METRES_PER_INCH, parse_dip
from tankcal.units import FOOT_M, INCH_M

THOUSANDS = (",", ".", " ", "'", "\u2019", "\u00a0", "\u2009", "\u202f")
MOST_DECIMALS = 15
LARGEST = 1e12
BLANK = message("lint_blank", "blank; expected a number")
_SAME = 1e-9
_FEET_DECIMALS = 4  # decimals of a metre in a label with decimals of an inch
_MARKS = ("'", '"', "\u2032", "\u2033", "\u2019", "\u201d", "ft")
_FRACTION = re.compile(r"\d{1,3}-\d{1,2}(?:[ -]+\d{1,2}/\d{1,2})?", re.ASCII)
_PARTS = re.compile(r"(\d{1,3})-(\d{1,2})-(\d{1,2})", re.ASCII)
_WITH_FRACTION = re.compile(r"(?:(\d{1,4})(?:[ -]+| ?- ?))?(\d{1,2})/(\d{1,2})", re.ASCII)
_VULGAR = re.compile("(\\d?)([¼-¾⅐-⅞])")
_EIGHTHS, _SIXTEENTHS = 8, 16
_MOSTLY = 0.9  # share of the rows
_ROUNDED = 1.001  # largest difference of heights in two units, last digits
_PART_HEADING = re.compile(
    r"(?:1/)?(8|16|32|64) ?(?:ths?|nds?|avos?)?|(eighths?|oitavos?|octavos?)|"
    r"(sixteenths?|dezesseis ?avos?|dieciseis ?avos?)|"
    r"(fractions?|fracao|fracoes|fraccion|fracciones)",
    re.ASCII,
)


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


def feet_reader(name, cells, heading, rows, log):
    """Return a function from a cell to its `Reading` in metres; None for a column of plain numbers.

    Parameters
    ----------
    name : str
        Name of the table, for messages.
    cells : sequence
        Cells of the column of heights.
    heading : str
        Heading of the column.
    rows : sequence of int
        Row numbers of the cells in the file.
    log : Log
        Receives a note if only the parts show that they are sixteenths.

    Raises
    ------
    InputError
        If parts of an inch may be eighths or sixteenths.
    """
    cells = [(cell, row) for cell, row in zip(cells, rows, strict=True) if has_digit(cell)]
    texts = [_spell_fractions(cell) if isinstance(cell, str) else "" for cell, _ in cells]
    most, unit_of_parts = len(texts) / 2, parts_of_inch(heading.text)
    in_parts = [_PARTS.fullmatch(text) for text in texts]
    if sum(in_part is not None for in_part in in_parts) > most:
        unit = unit_of_parts or _guess_unit_of_parts(name, in_parts, [row for _, row in cells], log)
        return lambda cell: _read_parts(cell, unit)
    in_fractions = sum(_FRACTION.fullmatch(text) is not None for text in texts)
    is_stated = heading.is_in_feet or any("/" in text for text in texts)
    marked = sum(any(mark in text for mark in _MARKS) for text in texts)
    if marked > most or (is_stated and in_fractions + marked > most):
        return _read_marks
    return None


def fraction_reader(cells, heading, style):
    """Return a function from a cell to its `Reading` in the unit of the heading.

    None if not needed.

    Parameters
    ----------
    cells : sequence
        Cells of the column of heights.
    heading : str
        Heading of the column; 10 1/4 under feet may be 10 ft 1/4 in, and is refused.
    style : Style
        Style of plain numbers in the column.
    """
    if not any(number_with_fraction(cell) is not None for cell in cells):
        return None
    is_in_feet = heading.unit is not None and abs(heading.unit / FOOT_M - 1) < _SAME

    def read(cell):
        value = number_with_fraction(cell)
        if value is None:
            if isinstance(cell, str) and "/" in _spell_fractions(cell):
                return Reading(None, complaint=_no_fraction(cell))
            return read_number(cell, style)
        if is_in_feet:
            return Reading(None, complaint=_no_fraction(cell))
        return Reading(float(value), cell.strip(), MOST_DECIMALS)

    return read


def number_with_fraction(cell):
    """Return the Fraction of a cell such as 10 1/4, 10-1/4, 10¼ or 3/8; None for any other cell."""
    match = _WITH_FRACTION.fullmatch(_spell_fractions(cell)) if isinstance(cell, str) else None
    if match is None or not 0 <= int(match[2]) < int(match[3]):
        return None
    return int(match[1] or 0) + Fraction(int(match[2]), int(match[3]))


def _no_fraction(cell):
    """Message about a cell that has no proper fraction."""
    return message(
        "lint_no_fraction",
        "found {found}; expected a number with a proper fraction, such as 10 1/4, or feet and "
        "inches with their marks, such as 10' 4 1/2\"",
        found=shown(cell),
    )


def _spell_fractions(text):
    """Return a label with its fraction in digits: 10¼ as 10 1/4."""

    def figures(match):
        return f"{match[1]} " * bool(match[1]) + normalize("NFKD", match[2]).replace("\u2044", "/")

    return _VULGAR.sub(figures, text.strip()).replace("\u2044", "/")


def _guess_unit_of_parts(name, in_parts, rows, log):
    """Return 16, or any value if no part matters; raise InputError if eighths are as likely."""
    parts = {int(parts[3]): row for parts, row in zip(in_parts, rows, strict=True) if parts}
    first = next(row for parts, row in zip(in_parts, rows, strict=True) if parts)
    if max(parts) == 0:
        return _SIXTEENTHS
    if max(parts) < _EIGHTHS:
        example = next(in_part[0] for in_part in in_parts if in_part and int(in_part[3]))
        text = message(
            "lint_parts_of_inch",
            "found {found}, and no part of an inch over 7; expected a heading that says ft-in-8 or "
            "ft-in-16",
            found=example,
        )
        raise InputError(Problem(name, text, first))
    text = message(
        "lint_by_sixteenths",
        "heights such as {found} are taken as feet, inches and sixteenths: the heading does not "
        "say so",
        found=next(in_part[0] for in_part in in_parts if in_part and int(in_part[3]) >= _EIGHTHS),
    )
    log.warning(name, text, first)
    return _SIXTEENTHS


def _read_parts(cell, unit):
    """Read feet, inches and parts of an inch."""
    match = _PARTS.fullmatch(cell.strip()) if isinstance(cell, str) else None
    feet, inches, parts = map(int, match.groups()) if match else (0, INCHES_PER_FOOT, 0)
    if inches >= INCHES_PER_FOOT or parts >= unit:
        text = message(
            "lint_no_parts_of_inch",
            "found {found}; expected feet, inches up to 11 and parts of an inch up to {most}, such "
            "as 5-03-{most:02d}",
            found=shown(cell),
            most=unit - 1,
        )
        return Reading(None, complaint=text)
    inches = INCHES_PER_FOOT * feet + inches + Fraction(parts, unit)
    return Reading(float(inches * METRES_PER_INCH), cell.strip(), MOST_DECIMALS)


def _read_marks(cell):
    """Read feet and inches with their marks."""
    text = _spell_fractions(str(cell))
    try:
        decimals = _FEET_DECIMALS if "." in text else MOST_DECIMALS
        return Reading(parse_dip(text, "ft-in-16"), text, decimals)
    except HeightError as error:
        return Reading(None, complaint=error.args[0])


# ---- heights in several columns


def parts_heading(cell):
    """Return the `Heading` of parts of an inch after a column of inches; None for other columns."""
    match = (
        _PART_HEADING.fullmatch(plain_text(str(cell)).strip(" ()[]."))
        if not is_blank(cell)
        else None
    )
    if match is None:
        return None
    parts = int(match[1]) if match[1] else 8 if match[2] else 16 if match[3] else 1
    return Heading(str(cell).strip(), "height", Unit(INCH_M / parts))


def join_heights(name, rows, places, headings):
    """Return (rows, Problem or None), with the heights of several columns combined in the first.

    Parameters
    ----------
    name : str
        Name of the table, for messages.
    rows : sequence
        (row number, cells). If columns are parts of one height, the first cell becomes a number in
        its unit, or a `BadCell`.
    places : sequence of int
        Positions of the columns of heights, left to right.
    headings : sequence of Heading
    """
    sizes = [heading.unit for heading in headings]
    if len(places) < 2 or None in sizes or not all(a >= b for a, b in pairwise(sizes)):
        return rows, None
    body = [
        (row, cells)
        for row, cells in rows
        if any(place < len(cells) and has_digit(cells[place]) for place in places)
    ]
    columns = [
        _column_numbers([cells[k] if k < len(cells) else None for _, cells in body]) for k in places
    ]
    columns[0] = _fill_down(columns[0])
    values = np.array([[np.nan if cell is None else float(cell) for cell in c] for c in columns])
    if len(body) < 2 or _are_one_height(values[:2], sizes[:2]):
        return rows, None
    ratios = [round(a / b) for a, b in pairwise(sizes)]
    if not _are_parts(values, ratios):
        first = values[0][~np.isnan(values[0])]
        if np.all(np.diff(first) > 0) or np.all(np.diff(first) < 0):
            return rows, None
        text = message(
            "lint_two_heights",
            "{columns} are neither one height in two units nor the parts of one height; expected "
            "one column of heights, or parts such as feet and inches up to 11",
            columns=[heading.text for heading in headings],
        )
        return rows, Problem(name, text, body[0][0] if body else None)
    joined = dict(zip((row for row, _ in body), zip(*columns, strict=True), strict=True))
    return tuple(
        (row, _replace_cell(cells, places, _sum(joined[row], cells, places, sizes, ratios)))
        if row in joined
        else (row, cells)
        for row, cells in rows
    ), None


def _column_numbers(cells):
    """Numbers of a column, fractions included; None for a cell without a number."""
    style = style_of([cells])
    fractions = [number_with_fraction(cell) for cell in cells]
    return [
        read_number(cell, style).value if fraction is None else fraction
        for cell, fraction in zip(cells, fractions, strict=True)
    ]


def _fill_down(column):
    """Return a column with omitted repetitions of a value filled in."""
    last, filled = None, []
    for value in column:
        last = value if value is not None else last
        filled.append(last)
    return filled


def _are_one_height(values, sizes):
    """Whether two columns are one height in two units, within the last digit of the coarser one."""
    metres = values * np.array(sizes)[:, None]
    known = ~np.isnan(metres).any(axis=0)
    if not known.any():
        return False
    digits = max(_digit(column[known]) * size for column, size in zip(values, sizes, strict=True))
    same = np.abs(metres[0, known] - metres[1, known]) <= _ROUNDED * digits / 2 + _SAME
    return bool(same.mean() >= _MOSTLY)


def _digit(values):
    """Value of the last decimal of numbers, at most 1."""
    for decimals in range(7):
        if np.all(np.abs(values - np.round(values, decimals)) < _SAME):
            return 10.0**-decimals
    return 0.0


def _are_parts(values, ratios):
    """Whether all columns but the last are whole numbers, and each part is smaller than a whole."""
    whole = values[:-1]
    parts = values[1:]
    is_whole = np.isnan(whole) | (np.abs(whole - np.round(whole)) < _SAME)
    limit = np.array(ratios, dtype=float)[:, None]
    is_part = np.isnan(parts) | ((parts >= 0) & (parts < limit))
    return bool(is_whole.mean() >= _MOSTLY and is_part.mean() >= _MOSTLY)


def _sum(values, cells, places, sizes, ratios):
    """Height of a row in the unit of the first column, or a `BadCell`."""
    total = Fraction(0)
    for k, (value, place) in enumerate(zip(values, places, strict=True)):
        cell = cells[place] if place < len(cells) else None
        is_part = k > 0
        if value is None or value < 0 or (is_part and value >= ratios[k - 1]):
            if is_part and is_blank(cell):
                continue
            text = message(
                "lint_bad_part",
                "found {found} in column {column}, a part of a height; expected a number from 0 "
                "to below {limit}",
                found=shown(cell),
                column=place + 1,
                limit=ratios[k - 1] if is_part else 1000,
            )
            return BadCell(text)
        total += Fraction(value) * Fraction(sizes[k] / sizes[0]).limit_denominator(10_000)
    return float(total)


def _replace_cell(cells, places, cell):
    """Cells with another first height."""
    cells = list(cells) + [None] * (places[0] + 1 - len(cells))
    cells[places[0]] = cell
    return tuple(cells)
