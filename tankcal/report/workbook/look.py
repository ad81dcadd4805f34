"""Appearance of the sheets: colours, number formats, and sizes of columns and texts."""

import re
from dataclasses import dataclass
from datetime import date
from functools import lru_cache

from xlsxwriter.utility import xl_pixel_width

from tankcal.text.digits import decimals_of_heights

ACCENT = "#1F4E79"
RULE = "#BFC9D4"
MUTED = "#595959"
INPUT = "#FFF7DB"
CRITICAL = "#FCE4D6"  # background of rows in the critical zone of a floating roof
# Metric-compatible substitutes exist on every system.
FONT = {"font_name": "Arial", "font_size": 10}
DATE = 14  # Excel's built-in short date in the format of the reader's system
LINE_PT = 15.0  # height of a line of text, points
ROW_PT = 15.75  # height of a row with a single line, points; the default of 13.5 clips digits
_MOST_LINES = 27  # largest number of lines in a row, since Excel limits its height to 409 points
_UNIT_PX = 7  # pixels per unit of column width, the width of a digit
_EMPTY_PX = 8  # margins of a cell, both sides together
_INDENT_PX = 9  # indent of a text in a table
_LONG_WORD_PX = 150  # width above which a word may be broken, such as the name of a file
_BOLD = 1.1  # width of bold letters relative to plain letters
_BREAKS = re.compile(r"\s+|(?<=\w-)(?=\w)")  # line breaks: between words, and after hyphens


@dataclass(frozen=True)
class Column:
    """Column of a table.

    Attributes
    ----------
    heading : str
        Heading with the unit.
    cells : list
        Values of the cells.
    digits : int, str, list or None
        Decimals of all cells, or an Excel number format, or a list with these for each cell; None:
        the cells are texts.
    width : float
        Smallest width in letters; the column becomes wider for long words and numbers.
    percent : bool
        True: the values are shares, printed in percent.
    """

    heading: str
    cells: list
    digits: int | str | list | None = None
    width: float = 12
    percent: bool = False


def number_format(digits, percent=False, unit="", power=False):
    """Return an Excel number format.

    Spreadsheets round with this format in the same way as `tankcal.text.digits`, and print the
    decimal mark of their own language.

    Parameters
    ----------
    digits : int or str
        Decimals, of the mantissa if `power`; or an Excel number format, which is returned.
    percent : bool, optional
        True: print in percent.
    unit : str, optional
        Unit after the number.
    power : bool, optional
        True: print with a power of ten.

    Returns
    -------
    str
    """
    if isinstance(digits, str):
        return digits
    form = "0" + ("." + "0" * digits if digits else "") + ("E+00" if power else "")
    return form + (" %" if percent else "") + (f' "{unit}"' if unit else "")


def height_digits(heights_m):
    """Return the decimals of heights in m: 3, or more for finer heights."""
    return decimals_of_heights([height or 0.0 for height in heights_m])


def day(text):
    """Return the date at the start of an ISO text, or None."""
    try:
        return date.fromisoformat(str(text or "")[:10])
    except ValueError:
        return None


def width_of(column):
    """Return the width of a column, in digits, for its numbers and its words of usual length."""
    heading = _BOLD * max(map(_pixels, pieces_of(column.heading)))
    if column.digits is None:
        words = {word for cell in set(column.cells) if cell for word in str(cell).split()}
        cells = min(max(map(_pixels, words), default=0), _LONG_WORD_PX) + _INDENT_PX
    else:
        cells = _UNIT_PX * _longest_number(column)
    return max(column.width, (max(heading, cells) + 1.5 * _EMPTY_PX) / _UNIT_PX)


def width_of_lines(texts):
    """Return the width of a column, in digits, in which each text fits on a single line."""
    longest = max(map(_pixels, set(texts)), default=0)
    return (longest + _INDENT_PX + 1.5 * _EMPTY_PX) / _UNIT_PX


def pieces_of(text):
    """Return the parts of a text between possible line breaks."""
    return [piece for piece in _BREAKS.split(text) if piece]


def lines_in(column, width):
    """Return the number of lines of each cell of a column of texts."""
    width_of_text = width - _INDENT_PX / _UNIT_PX
    texts = [cell if cell is None else str(cell) for cell in column.cells]
    lines = {text: 1 if text is None else lines_of(text, width_of_text) for text in set(texts)}
    return [lines[text] for text in texts]


def lines_of(text, width, bold=False):
    """Return the number of lines of a text, wrapped between words, for a width in digits.

    Parameters
    ----------
    text : str
        Text, possibly with line breaks.
    width : float
        Width of the columns, in digits.
    bold : bool, optional
        True: the letters are bold.

    Returns
    -------
    int
    """
    width_px = (_UNIT_PX * width - _EMPTY_PX) / (_BOLD if bold else 1.0)
    return min(sum(_count_lines(part, width_px) for part in str(text).split("\n")), _MOST_LINES)


def _count_lines(text, width_px):
    lines, used, space = 1, 0.0, _pixels(" ")
    for word in pieces_of(text):
        length = _pixels(word)
        # A word that does not fit starts a new line; a word longer than a line is broken.
        if used and used + length > width_px:
            lines, used = lines + 1, 0.0
        breaks = max(int((length - 1) // width_px), 0)
        lines, used = lines + breaks, used + length - breaks * width_px + space
    return lines


@lru_cache(maxsize=10_000)
def _pixels(word):
    """Return the width of a word in Calibri 11, which is 5 % wider than Arial 10 of the sheets."""
    return xl_pixel_width(word)


def _longest_number(column):
    if column.digits is None:
        return 0
    each = column.digits if isinstance(column.digits, list) else [column.digits] * len(column.cells)
    values_by_digits = {}
    for value, digits in zip(column.cells, each, strict=True):
        values_by_digits.setdefault(digits, []).append(value)
    longest = max(
        (_longest(values, digits) for digits, values in values_by_digits.items()), default=0
    )
    return longest + (len(" %") if column.percent else 0)


def _longest(values, digits):
    """Return the letters of the longest cell; the longest number is the least or the greatest."""
    if isinstance(digits, str):
        return len(digits)
    texts = [value for value in values if isinstance(value, str)]
    numbers = [value for value in values if value is not None and not isinstance(value, str)]
    if numbers:
        texts += [f"{value:.{digits}f}" for value in (min(numbers), max(numbers))]
    return max(map(len, texts), default=0)
