"""Heights in feet and inches: determine the notation of a column.

    5' 3 3/16", 5 ft 3 3/16 in   marks identify the parts
    5-3 3/16, 5-03-3/16, 5-3     feet and inches, with an optional fraction
    5-03-03                      feet, inches, and eighths or sixteenths of an inch
    10 1/4, 10¼, 10-1/4          inches, or another unit in the heading except feet

In 5-03-03, the heading states the unit of the last part (ft-in-16, ft-in-8ths). Without such a
heading, a part of 8 or more anywhere in the column means sixteenths. Parts up to 7 are ambiguous
and cause an error.
"""

import re
from fractions import Fraction
from unicodedata import normalize

from tankcal.errors import HeightError, InputError, Problem
from tankcal.job.tables import shown
from tankcal.linter.headings import parts_of_inch
from tankcal.linter.numbers import MOST_DECIMALS, Reading, has_digit, read_number
from tankcal.messages import message
from tankcal.tank.dips import INCHES_PER_FOOT, METRES_PER_INCH, parse_dip
from tankcal.units import FOOT_M

_SAME = 1e-9
_FEET_DECIMALS = 4  # decimals of a metre in a label with decimals of an inch
_MARKS = ("'", '"', "\u2032", "\u2033", "\u2019", "\u201d", "ft")
_FRACTION = re.compile(r"\d{1,3}-\d{1,2}(?:[ -]+\d{1,2}/\d{1,2})?", re.ASCII)
_PARTS = re.compile(r"(\d{1,3})-(\d{1,2})-(\d{1,2})", re.ASCII)
_WITH_FRACTION = re.compile(r"(?:(\d{1,4})(?:[ -]+| ?- ?))?(\d{1,2})/(\d{1,2})", re.ASCII)
_VULGAR = re.compile("(\\d?)([¼-¾⅐-⅞])")
_EIGHTHS, _SIXTEENTHS = 8, 16


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
    texts = [_typed(cell) if isinstance(cell, str) else "" for cell, _ in cells]
    most, unit_of_parts = len(texts) / 2, parts_of_inch(heading.text)
    in_parts = [_PARTS.fullmatch(text) for text in texts]
    if sum(in_part is not None for in_part in in_parts) > most:
        unit = unit_of_parts or _parts_by_shape(name, in_parts, [row for _, row in cells], log)
        return lambda cell: _read_parts(cell, unit)
    in_fractions = sum(_FRACTION.fullmatch(text) is not None for text in texts)
    is_told = heading.is_in_feet or any("/" in text for text in texts)
    marked = sum(any(mark in text for mark in _MARKS) for text in texts)
    if marked > most or (is_told and in_fractions + marked > most):
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
            if isinstance(cell, str) and "/" in _typed(cell):
                return Reading(None, complaint=_no_fraction(cell))
            return read_number(cell, style)
        if is_in_feet:
            return Reading(None, complaint=_no_fraction(cell))
        return Reading(float(value), cell.strip(), MOST_DECIMALS)

    return read


def number_with_fraction(cell):
    """Return the Fraction of a cell such as 10 1/4, 10-1/4, 10¼ or 3/8; None for any other cell."""
    match = _WITH_FRACTION.fullmatch(_typed(cell)) if isinstance(cell, str) else None
    if match is None or not 0 <= int(match[2]) < int(match[3]):
        return None
    return int(match[1] or 0) + Fraction(int(match[2]), int(match[3]))


def _no_fraction(cell):
    return message(
        "lint_no_fraction",
        "found {found}; expected a number with a proper fraction, such as 10 1/4, or feet and "
        "inches with their marks, such as 10' 4 1/2\"",
        found=shown(cell),
    )


def _typed(text):
    """Return a label with its fraction in digits: 10¼ as 10 1/4."""

    def figures(match):
        return f"{match[1]} " * bool(match[1]) + normalize("NFKD", match[2]).replace("\u2044", "/")

    return _VULGAR.sub(figures, text.strip())


def _parts_by_shape(name, in_parts, rows, log):
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
    text = _typed(str(cell))
    try:
        decimals = _FEET_DECIMALS if "." in text else MOST_DECIMALS
        return Reading(parse_dip(text, "ft-in-16"), text, decimals)
    except HeightError as error:
        return Reading(None, complaint=error.args[0])
