"""How the sheets look: colours, number formats, columns and how wide and high texts are."""

import re
from dataclasses import dataclass
from datetime import date
from functools import lru_cache

from xlsxwriter.utility import xl_pixel_width

from tankcal.text.digits import decimals_of_height

ACCENT = "#1F4E79"
RULE = "#BFC9D4"
MUTED = "#595959"
INPUT = "#FFF7DB"
FONT = {"font_name": "Arial", "font_size": 10}  # or its equal in measure, on every machine
DATE = 14  # Excel's built-in short date: in the order and with the marks of the reader's system
LINE_PT = 15.0  # height of a line of text
ROW_PT = 15.75  # of a row of one line: the 13.5 that XlsxWriter takes for Arial 10 clip its digits
_MOST_LINES = 27  # Excel allows a row 409 pt
_UNIT_PX = 7  # of width of a column: one digit
_EMPTY_PX = 8  # of a cell, at both sides of its text
_INDENT_PX = 9  # of a text in a table
_LONG_WORD_PX = 150  # a longer word is broken, such as the name of a file
_BOLD = 1.1  # times the width of plain letters
_BREAKS = re.compile(r"\s+|(?<=\w-)(?=\w)")  # of lines: between words, and after hyphens


@dataclass(frozen=True)
class Column:
    """One column of a table: heading with its unit, cells from the top down, and their look.

    digits  decimals of all cells, or a list with those of each cell, or None: text; in place of a
            number of decimals a number format of Excel
    width   the least, in letters; it grows for long words and numbers
    """

    heading: str
    cells: list
    digits: int | str | list | None = None
    width: float = 12
    percent: bool = False


def number_format(digits, percent=False, unit="", power=False):
    """The Excel number format with so many decimals (of the mantissa, with `power`) and a unit.

    A format stays as it is. A spreadsheet rounds by it as `tankcal.text.digits` does, and shows
    it with     the marks of its own language.
    """
    if isinstance(digits, str):
        return digits
    form = "0" + ("." + "0" * digits if digits else "") + ("E+00" if power else "")
    return form + (" %" if percent else "") + (f' "{unit}"' if unit else "")


def height_digits(heights_m):
    """Decimals of heights: millimetres, or finer where they are."""
    return [3 if one is None else decimals_of_height(one) for one in heights_m]


def day(text):
    """The date that a text of the record begins with, in ISO form; None when it is none."""
    try:
        return date.fromisoformat(str(text or "")[:10])
    except ValueError:
        return None


def width_of(column):
    """The width of a column, in digits: its words, if not very long, and its numbers fit in."""
    heading = _BOLD * max(map(_pixels, pieces_of(column.heading)))
    if column.digits is None:
        words = {word for cell in set(column.cells) if cell for word in str(cell).split()}
        cells = min(max(map(_pixels, words), default=0), _LONG_WORD_PX) + _INDENT_PX
    else:
        cells = _UNIT_PX * _longest_number(column)
    return max(column.width, (max(heading, cells) + 1.5 * _EMPTY_PX) / _UNIT_PX)


def width_of_lines(texts):
    """The width of a column, in digits, in which each of these texts stands on one line."""
    longest = max(map(_pixels, set(texts)), default=0)
    return (longest + _INDENT_PX + 1.5 * _EMPTY_PX) / _UNIT_PX


def pieces_of(text):
    """The parts of a text between which a line may break."""
    return [piece for piece in _BREAKS.split(text) if piece]


def lines_in(column, width):
    """How many lines each cell of a column of texts takes."""
    room = width - _INDENT_PX / _UNIT_PX
    texts = [cell if cell is None else str(cell) for cell in column.cells]
    lines = {text: 1 if text is None else lines_of(text, room) for text in set(texts)}
    return [lines[text] for text in texts]


def lines_of(text, width, bold=False):
    """How many lines a text takes, wrapped between its words, in columns of this width."""
    room = (_UNIT_PX * width - _EMPTY_PX) / (_BOLD if bold else 1.0)
    return min(sum(_lines_of(part, room) for part in str(text).split("\n")), _MOST_LINES)


def _lines_of(text, room):
    lines, used, space = 1, 0.0, _pixels(" ")
    for word in pieces_of(text):
        length = _pixels(word)
        if used and used + length > room:
            lines, used = lines + 1, 0.0
        broken = max(int((length - 1) // room), 0)
        lines, used = lines + broken, used + length - broken * room + space
    return lines


@lru_cache(maxsize=10_000)
def _pixels(word):
    """The width of a word; of Calibri 11, which is 5 % wider than the Arial 10 of the sheets."""
    return xl_pixel_width(word)


def _longest_number(column):
    if column.digits is None:
        return 0
    each = column.digits if isinstance(column.digits, list) else [column.digits] * len(column.cells)
    of_digits = {}
    for value, digits in zip(column.cells, each, strict=True):
        of_digits.setdefault(digits, []).append(value)
    longest = max((_longest(values, digits) for digits, values in of_digits.items()), default=0)
    return longest + (len(" %") if column.percent else 0)


def _longest(values, digits):
    """The letters of the longest of some cells: of numbers that is the least or the greatest."""
    if isinstance(digits, str):
        return len(digits)
    texts = [value for value in values if isinstance(value, str)]
    numbers = [value for value in values if value is not None and not isinstance(value, str)]
    if numbers:
        texts += [f"{value:.{digits}f}" for value in (min(numbers), max(numbers))]
    return max(map(len, texts), default=0)
