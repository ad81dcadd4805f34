"""Wide tables, whose columns are steps of the height: rows of centimetres, columns of 0 to 9 mm.

The height of a cell is the height of its row plus the label of its column. The unit of the labels
comes from the heading. If the heading states none, the rows determine it: a row continues where the
row below it ends, so that the step of the rows is the number of columns times the step of the
labels.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.products.linter.numbers import has_digit, has_letter, is_blank, read_number, style_of
from tankcal.products.linter.units import (
    LENGTH,
    VOLUME,
    Heading,
    Unit,
    drop_prepositions,
    heading_of,
    number_of,
    size_of,
    tokens_of,
    unit_of,
)

_FEWEST, _FEWEST_WITH_UNITS = 4, 2  # fewest labels of columns, without and with units
_MOST_WORDS = 4  # largest number of words in the heading of a column
_SAME = 1e-6
# possible ratios of the unit of the labels to the unit of the rows, if no heading states it
_RATIOS = (1.0, 0.1, 0.01, 0.001, 1 / 12, 1 / 8, 1 / 16)


@dataclass(frozen=True)
class WideHeading:
    """Heading of a table whose columns are steps of the height.

    Attributes
    ----------
    first : int
        Position of the first column of volumes.
    has_volumes_first : bool
        Whether the heading of this column is that of volumes (height, volume, 1, 2 ... 9).
    labels : tuple of float
        Heights added by the columns, in `label_m`.
    texts : tuple of str
        Labels as written.
    row_m, label_m : float or None
        Sizes of the units of rows and labels, m; None if no heading states them.
    height, volume : Heading
        Headings of the rows and of the volumes.
    """

    first: int
    has_volumes_first: bool
    labels: tuple[float, ...]
    texts: tuple[str, ...]
    row_m: float | None
    label_m: float | None
    height: Heading
    volume: Heading


def wide_heading(rows, index, above):
    """Return the `WideHeading` in a row, or None.

    rows: (row number, cells) of a grid; above: cells of the rows above that belong to the heading.
    """
    cells = rows[index][1]
    if len(cells) < 3 or (has_digit(cells[0]) and not has_letter(cells[0])):
        return None
    has_volume = heading_of(cells[1]).role == "volume"
    start = 2 if has_volume else 1
    labels = []
    for cell in cells[start:]:
        label = read_label(cell)
        if label is None:
            break
        labels.append(label)
    if has_volume and labels:
        labels.insert(0, (0.0, labels[0][1]))
    if not are_even(labels) or not _has_rows(rows, index, len(labels)):
        return None
    units = [unit for _, unit in labels if unit is not None]
    named = units[-1] if units else None
    row_m, label_m = _units(cells, above, named)
    volume = _volume_heading(cells, above)
    titles = [line[0] for line in (cells, *above[::-1]) if line and _is_short(line[0])]
    roles = [heading_of(title) for title in titles]
    role = next(
        (heading.role for heading in roles if heading.role in ("height", "ullage")), "height"
    )
    text = cells[0].strip() if isinstance(cells[0], str) else ""
    text = text or next((heading.text for heading in roles if heading.text), "")
    texts = tuple(str(cell).strip() for cell in cells[1 : 1 + len(labels)])
    values = tuple(value for value, _ in labels)
    unit = Unit(row_m) if row_m is not None else Unit()
    return WideHeading(
        1, has_volume, values, texts, row_m, label_m, Heading(text, role, unit), volume
    )


def _is_short(cell):
    """Whether a cell may be the heading of a column; a title of the table has more words."""
    return isinstance(cell, str) and len(cell.split()) <= _MOST_WORDS


def _volume_heading(cells, above):
    """Return the `Heading` of the volumes: of a cell beside the heights, or a title."""
    for line in (cells, *above[::-1]):
        for position, cell in enumerate(line):
            heading = heading_of(cell)
            is_title = position == 0 and sum(not is_blank(cell) for cell in line) == 1
            if heading.role == "volume" and not is_title:
                return heading
    return Heading("", "volume", title_unit(above))


def read_label(cell):
    """(number, size of its unit or None) of the label of a column, or None."""
    if isinstance(cell, int | float) and not isinstance(cell, bool):
        return float(cell), None
    if not isinstance(cell, str) or not has_digit(cell):
        return None
    tokens = [token for token in tokens_of(cell) if token not in ("(", ")", "=")]
    if len(tokens) == 2 and tokens[0][0].isalpha():
        tokens.reverse()
    value = number_of(tokens[0]) if tokens else None
    if value is None or len(tokens) > 2:
        return None
    if len(tokens) == 1:
        return value, None
    size = size_of(tokens[1], LENGTH)
    return None if size is None else (value, size)


def are_even(labels):
    """Whether labels rise by even steps from 0 or from their first step."""
    values = [value for value, _ in labels]
    has_units = any(unit is not None for _, unit in labels[1:])
    if len(values) < (_FEWEST_WITH_UNITS if has_units else _FEWEST):
        return False
    steps = np.diff(values)
    return bool(
        steps.min() > 0
        and np.ptp(steps) <= _SAME * steps[0]
        and 0 <= values[0] <= steps[0] * (1 + _SAME)
    )


def _has_rows(rows, index, count):
    """Whether the next row has a height, and volumes below the labels."""
    if index + 1 >= len(rows):
        return False
    cells = rows[index + 1][1]
    volumes = cells[1 : 1 + count]
    return (
        has_digit(cells[0])
        and not has_letter(cells[0])
        and sum(has_digit(cell) and not has_letter(cell) for cell in volumes) >= min(2, count)
    )


def _units(cells, above, label_unit):
    """(unit of the rows, unit of the labels) in the heading, m; None if not stated.

    A first cell such as cm / mm states both.
    """
    row_units = []
    for line in (cells, *above[::-1]):
        text = line[0] if line and _is_short(line[0]) else ""
        tokens = drop_prepositions(tokens_of(text))
        row_units += [
            size for size in (size_of(token, LENGTH) for token in tokens) if size is not None
        ]
        if row_units:
            break
    label_units = [label_unit] if label_unit is not None else row_units[1:]
    if not label_units:
        texts = [cell for line in above for cell in line[1:] if isinstance(cell, str)]
        tokens = [token for text in texts for token in drop_prepositions(tokens_of(text))]
        label_units = [
            size for size in (size_of(token, LENGTH) for token in tokens) if size is not None
        ]
    return (row_units[0] if row_units else None), (label_units[0] if label_units else None)


def wide_cells(name, wide, rows, log):
    """For each label, a list of (row, name of height, name of volume, height, volume, {}).

    Heights are numbers in the unit of the rows. If rows and labels do not continue each other, the
    problem is reported to `log` and the lists are empty.
    """
    rows = [(row, cells) for row, cells in rows if has_digit(cells[0]) and not has_letter(cells[0])]
    style = style_of([[cells[0] for _, cells in rows]])
    bases = [read_number(cells[0], style).value for _, cells in rows]
    ratio = _ratio(wide, [base for base in bases if base is not None])
    columns = [[] for _ in wide.labels]
    if wide.has_volumes_first and _are_parts(wide, rows):
        text = message(
            "lint_columns_of_parts",
            "columns {first} to {last} have parts of a step, not volumes: they are not read",
            first=wide.texts[1],
            last=wide.texts[-1],
        )
        log.warning(name, text, rows[0][0])
        wide, ratio = replace(wide, labels=wide.labels[:1]), 1.0
    if ratio is None:
        text = message(
            "lint_wide_layout",
            "columns {first} to {last} are steps of the height, but they do not fill the steps of "
            "the rows; expected as many columns as steps fit between two rows, and the units of "
            "both in the heading, such as cm / mm",
            first=wide.texts[0],
            last=wide.texts[-1],
        )
        log.problem(name, text, rows[0][0])
        return columns
    digits = 12  # decimals of a height, which hide binary fractions of decimal steps
    for number, ((row, cells), base) in enumerate(zip(rows, bases, strict=True)):
        volumes = [
            cells[wide.first + k] if wide.first + k < len(cells) else None
            for k in range(len(wide.labels))
        ]
        filled = [k for k, volume in enumerate(volumes) if not is_blank(volume)]
        first = filled[0] if filled and number == 0 else 0
        last = (filled[-1] if filled else -1) if number == len(rows) - 1 else len(volumes) - 1
        for k in range(first, last + 1):
            height = cells[0] if base is None else round(base + wide.labels[k] * ratio, digits)
            column = f"{wide.height.text}, {wide.texts[k]}".strip(", ")
            columns[k].append((row, wide.height.text, column, height, volumes[k], {}))
    return columns


def _are_parts(wide, rows):
    """Whether the columns after the first are smaller: parts, to be added to it."""
    columns = [
        [cells[wide.first + k] if wide.first + k < len(cells) else None for _, cells in rows]
        for k in (0, 1)
    ]
    style = style_of(columns)
    pairs = [
        [read_number(cell, style).value for cell in pair] for pair in zip(*columns, strict=True)
    ]
    known = [pair for pair in pairs if None not in pair]
    return sum(after < first for first, after in known) > 0.5 * len(known)


def _ratio(wide, bases):
    """Ratio of the unit of the labels to that of the rows.

    None if they do not continue each other.
    """
    steps = [abs(b - a) for a, b in pairwise(bases) if b != a]
    if not steps:
        return None
    base_step, label_step = float(np.median(steps)), wide.labels[1] - wide.labels[0]
    row_by_row = base_step / (len(wide.labels) * label_step)  # the columns continue in the next row
    # the rows continue in the next column
    by_column = (len(bases) * base_step) / label_step
    if wide.row_m is not None and wide.label_m is not None:
        ratio = wide.label_m / wide.row_m
        fits = (abs(ratio / expected - 1) <= _SAME for expected in (row_by_row, by_column))
        return ratio if any(fits) else None
    known = (ratio for ratio in _RATIOS if abs(ratio / row_by_row - 1) <= _SAME)
    return next(known, None)


def find_unnamed_columns(name, block_rows, pairs, heading_row, heading_cells):
    """Return the Problem of several columns of numbers without a heading.

    None if there are none.
    """
    used_columns = {
        place for pair in pairs for place in (pair.height, pair.volume, *pair.beside.values())
    }
    width = max((len(cells) for _, cells in block_rows), default=0)
    unnamed = []
    for place in set(range(width)) - used_columns:
        title = heading_cells[place] if place < len(heading_cells) else None
        if has_letter(title):
            continue
        filled = sum(
            place < len(cells) and has_digit(cells[place]) and not has_letter(cells[place])
            for _, cells in block_rows
        )
        if filled > 0.5 * len(block_rows):
            unnamed.append(place + 1)
    if len(unnamed) < 2:
        return None
    text = message(
        "lint_unnamed_columns",
        "{count} columns of numbers (from column {first} on) have no heading of heights or "
        "volumes; expected a heading for each column, or steps of the height as headings (0 mm, "
        "1 mm ...)",
        count=len(unnamed),
        first=unnamed[0],
    )
    return Problem(name, text, heading_row)


def title_unit(above):
    """Return the `Unit` of volumes in a title above the heading ("volumes in litres", "US gal")."""
    for line in above[::-1]:
        for cell in line:
            if not isinstance(cell, str):
                continue
            title = heading_of(cell)
            is_alone = sum(bool(other) for other in line) == 1
            if is_alone and title.role == "volume" and title.named.is_named:
                return title.named
            tokens = tokens_of(cell)
            for k, token in enumerate(tokens[:-1]):
                if token in ("in", "em", "en") and heading_of(cell).role == "volume":
                    unit = unit_of(" ".join(tokens[k + 1 :]), VOLUME)
                    if unit.is_named:
                        return unit
    return Unit()
