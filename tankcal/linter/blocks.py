"""Headings of a grid and the rows below them: columns of heights and columns of volumes.

A heading may have a row of units above or below it, a title above it, heights in several columns,
or steps of the height as columns (`tankcal.linter.wide`).
"""

from dataclasses import dataclass, field, replace
from itertools import zip_longest

from tankcal.errors import InputError, Problem
from tankcal.linter.compound_heights import join_heights, parts_heading
from tankcal.linter.headings import (
    Uncertainty,
    heading_of,
    is_coverage_factor,
    is_heading_of_parts,
    is_unit,
    uncertainty_of,
)
from tankcal.linter.numbers import has_digit, has_letter, is_blank
from tankcal.linter.units import Unit, countries_in
from tankcal.linter.wide import WideHeading, find_unnamed_columns, title_unit, wide_heading
from tankcal.messages import message
from tankcal.units import INCH_M

_LINES_OF_HEADING = 3  # largest number of heading lines above the steps of a wide table
_LONGEST_UNIT = 24  # largest number of letters of a cell in a row of units


@dataclass(frozen=True)
class Pair:
    """Positions and headings of a column of heights and a column of volumes.

    Attributes
    ----------
    beside : dict
        {"uncertainty" or "k": position} of related columns.
    uncertainty : Uncertainty or None
        From the heading of that column.
    parts : tuple
        ((position, heading), ...) of other columns of heights before the volumes.
    """

    height: int
    volume: int
    height_heading: object
    volume_heading: object
    beside: dict = field(default_factory=dict)
    uncertainty: Uncertainty | None = None
    parts: tuple = ()


@dataclass(frozen=True)
class Block:
    """The rows below one heading, with the pairs of each kind of volume from left to right.

    Attributes
    ----------
    heading : tuple or None
        (row number, cells) of the heading.
    wide : WideHeading or None
        Heading of a table whose columns are steps of the height.
    complaints : tuple of Problem
        Problems of its columns.
    """

    pairs: tuple[Pair, ...]
    width: int
    rows: tuple
    is_parts: bool = False
    heading: tuple | None = None
    wide: WideHeading | None = None
    complaints: tuple[Problem, ...] = ()

    @property
    def has_heading(self):
        return self.heading is not None

    @property
    def kind(self):
        """Key of the block; blocks of equal kind are pages of one table."""
        pairs = tuple((p.height_heading, p.volume_heading) for p in self.pairs)
        return pairs, None if self.wide is None else self.wide.texts


def find_blocks(grid):
    """Return the `Block`s of a grid; a text without headings is one block of columns 1 and 2."""
    rows = list(grid.rows)
    blocks, start, is_parts, end = [], None, False, 0
    first_pages = {}
    index = 0
    while index < len(rows):
        cells = rows[index][1]
        above = [cells for _, cells in rows[max(end, index - _LINES_OF_HEADING) : index]]
        above = [line for line in above if any(map(has_letter, line))]
        wide = wide_heading(rows, index, above)
        if wide is None and not any(has_letter(cell) for cell in cells):
            index, end = index + 1, index + 1
            continue
        if any(is_heading_of_parts(cell) for cell in cells):
            is_parts, start = True, index
        if wide is not None:
            first = index + 1
            pairs = (Pair(0, wide.first, wide.height, wide.volume),)
            heading = (rows[index][0], cells)
        else:
            joined, used = _read_heading_lines(rows, index)
            pairs, first = _pairs(joined), index + used
            pairs = () if _is_over_wide(rows, index, above) else pairs
            pairs = tuple(_add_title_unit(pair, above) for pair in pairs)
            heading = (rows[index][0], joined)
        if not pairs:
            index += 1
            continue
        pairs = _copy_units_of_first_page(pairs, wide, first_pages)
        blocks.append((first, pairs, heading, is_parts, index if start is None else start, wide))
        is_parts, start, index, end = False, None, first, first
    if not blocks:
        return _block_without_heading(grid.name, rows) if grid.is_text else ()
    ends = [heading_start for *_, heading_start, _ in blocks[1:]] + [len(rows)]
    return tuple(
        _block(grid, pairs, tuple(rows[first:end]), parts, heading, wide)
        for (first, pairs, heading, parts, _, wide), end in zip(blocks, ends, strict=True)
    )


def _block(grid, pairs, rows, is_parts, heading, wide):
    """Return a `Block` with combined heights; report unnamed columns of numbers."""
    width = len(trim_cells(heading[1]))
    if wide is not None:
        return Block(pairs, width, rows, is_parts, heading, wide)
    problems = []
    for places in dict.fromkeys((pair.height, pair.parts) for pair in pairs):
        first = next(pair for pair in pairs if pair.height == places[0])
        columns = ((first.height, first.height_heading), *first.parts)
        rows, problem = join_heights(grid.name, rows, *zip(*columns, strict=True))
        problems += [] if problem is None else [problem]
    if not is_parts:
        body = [row for row in rows if any(has_digit(cell) for cell in row[1])]
        problem = find_unnamed_columns(grid.name, body, pairs, *heading)
        problems += [] if problem is None else [problem]
    return Block(pairs, width, rows, is_parts, heading, None, tuple(problems))


def _copy_units_of_first_page(pairs, wide, first_pages):
    """Return the pairs with units that only a title above the first page states.

    first_pages {texts of a heading: its pairs} is extended.
    """
    heights = tuple(pair.height_heading.text for pair in pairs)
    volumes = wide.texts if wide else tuple(pair.volume_heading.text for pair in pairs)
    before = first_pages.setdefault((heights, volumes), pairs)
    return tuple(
        pair
        if pair.volume_heading.unit is not None or pair.volume_heading.named.complaint
        else replace(pair, volume_heading=first.volume_heading)
        for pair, first in zip(pairs, before, strict=True)
    )


def _is_over_wide(rows, index, above):
    """Whether the steps of a wide table follow within the lines of one heading."""
    for below in range(index + 1, min(index + _LINES_OF_HEADING, len(rows))):
        lines = [*above, *(cells for _, cells in rows[index:below])]
        if wide_heading(rows, below, lines) is not None:
            return True
        if not any(has_letter(cell) for cell in rows[below][1]):
            return False
    return False


def _add_title_unit(pair, above):
    """Return a pair with the unit of volumes of a title, if its heading states none."""
    named = pair.volume_heading.named
    if named.choices:
        texts = [cell for line in above for cell in line if isinstance(cell, str)]
        sizes = {countries[0] for text in texts if len(countries := countries_in(text)) == 1}
        if len(sizes) == 1:
            named = Unit(named.factor * sizes.pop(), named.factor, named.is_multiplied)
    elif not named.is_named:
        named = title_unit(above)
    return replace(pair, volume_heading=replace(pair.volume_heading, named=named))


def _read_heading_lines(rows, index):
    """Return (heading cells, rows used), including a row of units above or below it."""
    cells = rows[index][1]
    if index + 1 >= len(rows):
        return cells, 1
    below = rows[index + 1][1]
    if _is_row_of_units(below) and any(heading_of(cell).role for cell in cells):
        return _join_names_and_units(cells, below), 2
    has_names = any(heading_of(cell).role for cell in below) and not _is_row_of_units(below)
    has_units = any(heading_of(cell).named.is_named for cell in below)
    if _is_row_of_units(cells) and has_names and not has_units:
        return _join_names_and_units(below, cells), 2
    return cells, 1


def _is_row_of_units(cells):
    """Whether most cells of a row are units, usable or not, and the other cells are short texts."""
    named = [cell for cell in cells if not is_blank(cell)]
    are_texts = all(isinstance(cell, str) and len(cell) <= _LONGEST_UNIT for cell in named)
    if not named or not are_texts or not any(is_unit(cell) for cell in named):
        return False
    others = [cell for cell in named if not is_unit(cell)]
    return all(has_letter(cell) and not heading_of(cell).role for cell in others)


def _join_names_and_units(names, units):
    """Combine cells of names and cells of units into heading cells."""
    joined = []
    for name, unit in zip_longest(names, units):
        parts = [str(part).strip() for part in (name, unit) if not is_blank(part)]
        is_odd = len(parts) == 2 and not is_unit(parts[1])
        joined.append(" ".join(parts[:1] + [f"({parts[1]})"] if is_odd else parts) or None)
    return joined


def _pairs(cells):
    """Return the pairs of a heading; in each run of heights and volumes, the first height applies.

    A column with an unusable unit is replaced by another column of its run.
    """
    headings = [heading_of(cell) for cell in cells]
    pairs, heights, volumes, before = [], [], [], []
    for position, heading in enumerate(headings):
        if not heading.role and heights and not volumes and heights[-1][1].unit == INCH_M:
            heading = parts_heading(cells[position]) or heading
        if heading.role in ("height", "ullage"):
            if volumes:
                pairs += _pairs_of_run(heights, volumes)
                heights, volumes = [], []
            heights.append((position, heading))
        elif heading.role == "volume":
            (volumes if heights else before).append((position, heading))
    pairs += _pairs_of_run(heights, volumes)
    if not pairs and heights:  # volumes stand to the left of their heights
        pairs = _pairs_of_run(heights, before)
    return tuple(_add_uncertainties(pairs, cells))


def _pairs_of_run(heights, volumes):
    """Pairs of a run of columns of heights, then of volumes."""
    if not volumes:
        return []
    dips = [height for height in heights if height[1].role == "height"] or heights
    dips = [height for height in dips if not height[1].named.complaint] or dips
    volumes = [volume for volume in volumes if not volume[1].named.complaint] or volumes[:1]
    (place, heading), *parts = dips
    return [Pair(place, k, heading, volume, parts=tuple(parts)) for k, volume in volumes]


def _add_uncertainties(pairs, cells):
    """Return pairs with the columns of uncertainties and coverage factors next to their volumes."""
    starts = [min(pair.height, pair.volume) for pair in pairs if pair.height] + [len(cells)]
    for pair in pairs:
        end = min(start for start in starts if start > pair.volume)
        end = min(
            [end, *(following.volume for following in pairs if following.volume > pair.volume)]
        )
        announced = {n: uncertainty_of(cells[n]) for n in range(pair.volume + 1, end)}
        known = sorted(
            (n for n in announced if announced[n]), key=lambda n: not announced[n].is_expanded
        )
        if not known:
            yield pair
            continue
        beside = {"uncertainty": known[0]}
        factors = [n for n in announced if announced[n] is None and is_coverage_factor(cells[n])]
        if factors:
            beside["k"] = factors[0]
        yield replace(pair, beside=beside, uncertainty=announced[known[0]])


def trim_cells(cells):
    """Return the cells without trailing blank cells."""
    cells = list(cells)
    while cells and is_blank(cells[-1]):
        cells.pop()
    return cells


def _block_without_heading(name, rows):
    """Block of columns 1 and 2 of a text without headings, or () if it has no numbers."""
    body = [row for row in rows if all(has_digit(cell) for cell in row[1][:2]) and row[1][1:]]
    if not body or len(body) < 0.5 * len(rows):
        return ()
    _refuse_partial_heading(name, rows)
    counts = [sum(has_digit(cell) for cell in cells) for _, cells in body]
    if sum(count > 2 for count in counts) > 0.5 * len(counts):
        text = message(
            "lint_columns_no_heading",
            "no heading, and {count} columns of numbers; expected a heading that names the columns "
            "of heights and of volumes",
            count=max(counts),
        )
        raise InputError(Problem(name, text, body[0][0]))
    nothing = heading_of(None)
    names = (message("lint_column", "column {number}", number=number) for number in "12")
    pair = Pair(0, 1, *(replace(nothing, text=name) for name in names))
    width = max(len(trim_cells(cells)) for _, cells in body)
    return (Block((pair,), width, tuple(body)),)


def _refuse_partial_heading(name, rows):
    """Raise InputError for a heading with heights but no volumes, or the reverse."""
    for row, cells in rows:
        texts = [cell for cell in cells if has_letter(cell)]
        headings = [heading_of(cell) for cell in texts]
        roles = {heading.role for heading in headings} - {""}
        if len(texts) < 2 or not roles:
            continue
        refused = next((heading for heading in headings if heading.named.complaint), None)
        if refused is not None:
            raise InputError(Problem(name, refused.named.complaint, row, refused.text))
        text = message(
            "lint_half_heading",
            "a heading without a column of volumes ({headings}); expected heights and volumes, "
            "with headings such as height_m, volume_m3",
            headings=[heading.text for heading in headings],
        )
        if roles == {"volume"}:
            text = message(
                "lint_heading_no_heights",
                "a heading without a column of heights ({headings}); expected heights and volumes, "
                "with headings such as height_m, volume_m3",
                headings=[heading.text for heading in headings],
            )
        raise InputError(Problem(name, text, row))
