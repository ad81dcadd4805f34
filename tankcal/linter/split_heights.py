"""Heights in several columns: feet and inches, metres and centimetres.

Two columns of heights before the volumes are either one height in two units (1.25 m, 125 cm) or the
parts of one height (4 ft, 3 in). In the first case the first column is read; in the second case the
parts are added. The rows decide between the cases.
"""

import re
from fractions import Fraction
from itertools import pairwise

import numpy as np

from tankcal.errors import Problem
from tankcal.job.tables import BadCell, shown
from tankcal.linter.feet import number_with_fraction
from tankcal.linter.headings import Heading
from tankcal.linter.numbers import has_digit, is_blank, read_number, style_of
from tankcal.linter.units import Unit, plain_text
from tankcal.messages import message
from tankcal.units import INCH_M

_MOSTLY = 0.9  # share of the rows
_ROUNDED = 1.001  # largest difference of heights in two units, last digits
_SAME = 1e-9
_PARTS = re.compile(r"(?:1/)?(8|16|32|64) ?(?:ths?|nds?|avos?)?|(eighths?|oitavos?|octavos?)|"
                    r"(sixteenths?|dezesseis ?avos?|dieciseis ?avos?)|"
                    r"(fractions?|fracao|fracoes|fraccion|fracciones)", re.ASCII)  # fmt: skip


def parts_heading(cell):
    """Return the `Heading` of parts of an inch after a column of inches; None for other columns."""
    match = _PARTS.fullmatch(plain_text(str(cell)).strip(" ()[].")) if not is_blank(cell) else None
    if match is None:
        return None
    parts = int(match[1]) if match[1] else 8 if match[2] else 16 if match[3] else 1
    return Heading(str(cell).strip(), "height", Unit(INCH_M / parts))


def with_joined_heights(name, rows, places, headings):
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
    body = [(row, cells) for row, cells in rows if _has_height(cells, places)]
    columns = [_values([cells[k] if k < len(cells) else None for _, cells in body]) for k in places]
    columns[0] = _filled_down(columns[0])
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
        (row, _with_cell(cells, places, _sum(joined[row], cells, places, sizes, ratios)))
        if row in joined
        else (row, cells)
        for row, cells in rows
    ), None


def _has_height(cells, places):
    return any(place < len(cells) and has_digit(cells[place]) for place in places)


def _values(cells):
    """Numbers of a column, fractions included; None for a cell without a number."""
    style = style_of([cells])
    fractions = [number_with_fraction(cell) for cell in cells]
    return [
        read_number(cell, style).value if fraction is None else fraction
        for cell, fraction in zip(cells, fractions, strict=True)
    ]


def _filled_down(column):
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


def _with_cell(cells, places, cell):
    cells = list(cells) + [None] * (places[0] + 1 - len(cells))
    cells[places[0]] = cell
    return tuple(cells)
