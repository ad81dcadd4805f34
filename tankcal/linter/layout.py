"""Where the heights and volumes of a table stand: headings, pairs across a page, pages.

A printed table repeats its pair of columns across the page, and its heading on every page. The
pairs are read column by column or row by row, whichever lets the heights rise.
"""

from dataclasses import dataclass, field, replace
from itertools import pairwise, zip_longest

from tankcal.errors import InputError, Problem
from tankcal.linter.feet import feet_reader
from tankcal.linter.headings import (
    Uncertainty,
    announces_parts,
    heading_of,
    is_coverage_factor,
    is_unit,
    uncertainty_of,
)
from tankcal.linter.numbers import (
    Reading,
    has_digit,
    has_letter,
    is_blank,
    read_number,
    style_of,
)
from tankcal.messages import message

_FEW_SPLIT_ROWS = 5


@dataclass(frozen=True)
class Entry:
    """One pair: its row in the file, heading of its volume column, height and volume as read.

    uncertainty, k  as read beside them; None where the table has no such column
    """

    row: int
    height_column: str
    volume_column: str
    height: Reading
    volume: Reading
    uncertainty: Reading | None = None
    k: Reading | None = None


@dataclass(frozen=True)
class Table:
    """One capacity table as it stands.

    name           of file and sheet, for messages
    entries        in the order of the table
    height_unit_m  size of the unit of heights, m; None: the heading names none
    volume_unit_m3 size of the unit of volumes, m3; None: the heading names none
    is_ullage      heights fall while volumes rise
    has_heading    False: the first two columns were taken
    is_text        every number is text (CSV)
    uncertainty    what the heading of its uncertainties says; None: it has none
    """

    name: str
    entries: tuple[Entry, ...]
    height_unit_m: float | None
    volume_unit_m3: float | None
    is_ullage: bool
    has_heading: bool
    is_text: bool
    uncertainty: Uncertainty | None = None


@dataclass(frozen=True)
class Pair:
    """Positions and headings of a column of heights and a column of volumes.

    beside  {"uncertainty" or "k": position} of what stands beside them
    uncertainty  what that heading says, or None
    """

    height: int
    volume: int
    height_heading: object
    volume_heading: object
    beside: dict = field(default_factory=dict)
    uncertainty: Uncertainty | None = None


@dataclass(frozen=True)
class Block:
    """The rows under one heading: pairs of each kind of volume, left to right."""

    pairs: tuple[Pair, ...]
    width: int
    rows: tuple
    is_parts: bool = False
    has_heading: bool = True

    @property
    def kind(self):
        return tuple((p.height_heading, p.volume_heading) for p in self.pairs)


def blocks_of(grid):
    """Tuple of `Block` of a grid; a text without headings is one block of columns 1 and 2."""
    found, start, is_parts = [], None, False
    rows = list(grid.rows)
    index = 0
    while index < len(rows):
        cells = rows[index][1]
        if not any(has_letter(cell) for cell in cells):
            index += 1
            continue
        if any(announces_parts(cell) for cell in cells):
            is_parts, start = True, index
        cells, used = _with_units(rows, index)
        pairs = _pairs(cells)
        if pairs:
            found.append(
                (
                    index + used,
                    pairs,
                    len(_trimmed(cells)),
                    is_parts,
                    index if start is None else start,
                )
            )
            is_parts, start = False, None
            index += used
        else:
            index += 1
    if not found:
        return _without_heading(rows) if grid.is_text else ()
    ends = [heading_start for *_, heading_start in found[1:]] + [len(rows)]
    return tuple(
        Block(pairs, width, tuple(rows[first:end]), parts)
        for (first, pairs, width, parts, _), end in zip(found, ends, strict=True)
    )


def _with_units(rows, index):
    """(heading cells, rows used): a row of units below a heading belongs to it."""
    cells = rows[index][1]
    if index + 1 < len(rows) and any(heading_of(cell).role for cell in cells):
        below = rows[index + 1][1]
        named = [cell for cell in below if not is_blank(cell)]
        if named and all(is_unit(cell) for cell in named):
            joined = [
                " ".join(str(part).strip() for part in both if not is_blank(part)) or None
                for both in zip_longest(cells, below)
            ]
            return joined, 2
    return cells, 1


def _pairs(cells):
    """Pairs of a heading: each run of heights, then volumes, gives the first height to each."""
    headings = [heading_of(cell) for cell in cells]
    pairs, heights, after_volume = [], [], False
    for position, heading in enumerate(headings):
        if heading.role in ("height", "ullage"):
            if after_volume:
                heights, after_volume = [], False
            heights.append((position, heading))
        elif heading.role == "volume" and heights:
            dips = [one for one in heights if one[1].role == "height"] or heights
            pairs.append(Pair(dips[0][0], position, dips[0][1], heading))
            after_volume = True
    return tuple(_with_uncertainty(pairs, cells))


def _with_uncertainty(pairs, cells):
    """Pairs with the columns of uncertainties and coverage factors that follow their volumes."""
    starts = [min(pair.height, pair.volume) for pair in pairs if pair.height] + [len(cells)]
    for pair in pairs:
        end = min(start for start in starts if start > pair.volume)
        end = min([end, *(other.volume for other in pairs if other.volume > pair.volume)])
        said = {n: uncertainty_of(cells[n]) for n in range(pair.volume + 1, end)}
        known = sorted((n for n in said if said[n]), key=lambda n: not said[n].is_expanded)
        if not known:
            yield pair
            continue
        beside = {"uncertainty": known[0]}
        factors = [n for n in said if said[n] is None and is_coverage_factor(cells[n])]
        if factors:
            beside["k"] = factors[0]
        yield replace(pair, beside=beside, uncertainty=said[known[0]])


def _trimmed(cells):
    cells = list(cells)
    while cells and is_blank(cells[-1]):
        cells.pop()
    return cells


def _column(number):
    return message("lint_column", "column {number}", number=str(number))


def _without_heading(rows):
    body = [row for row in rows if all(has_digit(cell) for cell in row[1][:2]) and row[1][1:]]
    if not body or len(body) < 0.5 * len(rows):
        return ()
    nothing = heading_of(None)
    pair = Pair(0, 1, *(replace(nothing, text=_column(k)) for k in (1, 2)))
    width = max(len(_trimmed(cells)) for _, cells in body)
    return (Block((pair,), width, tuple(body), False, False),)


def tables_of(grid, log):
    """Tuple of `Table`: blocks with the same headings are pages of one table."""
    pages = {}
    for block in blocks_of(grid):
        pages.setdefault((block.kind, block.is_parts), []).append(block)
    tables = []
    for blocks in pages.values():
        for volumes in _kinds(blocks[0].pairs):
            table = _table(grid, blocks, volumes, log)
            if table.entries:
                tables.append(table)
    return tuple(tables)


def _kinds(pairs):
    """Numbers of the pairs of each kind: of the same units, and the same place after a height."""
    kinds = {}
    for number, pair in enumerate(pairs):
        place = sum(other.height == pair.height for other in pairs[:number])
        units = (pair.height_heading.unit, pair.volume_heading.unit)
        kinds.setdefault((place, units), []).append(number)
    return list(kinds.values())


def _table(grid, blocks, numbers, log):
    cells = [_cells(grid, block, [block.pairs[k] for k in numbers], log) for block in blocks]
    by_column = [one for page in cells for column in page for one in column]
    orders = [by_column]
    if len(numbers) > 1:
        orders.append([one for page in cells for row in _by_row(page) for one in row])
    style = style_of([[one[3] for one in by_column], [one[4] for one in by_column]])
    first = blocks[0].pairs[numbers[0]]
    heights, rows = [one[3] for one in by_column], [one[0] for one in by_column]
    in_feet = feet_reader(grid.name, heights, first.height_heading, rows, log)
    orders = [[_entry(one, style, in_feet) for one in order] for order in orders]
    entries = min(orders, key=_turns)
    return Table(
        grid.name,
        tuple(entries),
        1.0 if in_feet else first.height_heading.unit,
        first.volume_heading.unit,
        first.height_heading.role == "ullage",
        blocks[0].has_heading,
        grid.is_text,
        first.uncertainty,
    )


def _cells(grid, block, pairs, log):
    """For each pair of columns the list of (row, two names, height, volume, what is beside)."""
    names = _names(block.pairs)
    columns = [[] for _ in pairs]
    _refuse_split_rows(grid, block)
    for row, cells in block.rows:
        is_split = grid.is_text and len(_trimmed(cells)) > block.width
        if is_split:
            expected = message(
                "lint_split_row",
                "{count} cells, expected {width} as in the heading (a decimal comma, or a "
                "thousands mark?)",
                count=len(_trimmed(cells)),
                width=block.width,
            )
            log.problem(grid.name, expected, row)
        for column, pair in zip(columns, pairs, strict=True):
            height = cells[pair.height] if pair.height < len(cells) else None
            volume = cells[pair.volume] if pair.volume < len(cells) else None
            if not has_digit(height) and not has_digit(volume):
                continue  # a note between the rows
            told = Reading(None) if is_split else None  # told already
            beside = {
                what: cells[place] if place < len(cells) else None
                for what, place in pair.beside.items()
            }
            column.append(
                (row, names[pair.height], names[pair.volume], height, told or volume, beside)
            )
    return columns


def _refuse_split_rows(grid, block):
    """Raise InputError when the numbers themselves are split into cells, row after row."""
    split = [(row, cells) for row, cells in block.rows if len(_trimmed(cells)) > block.width]
    if grid.is_text and len(split) > max(_FEW_SPLIT_ROWS, 0.2 * len(block.rows)):
        row, cells = split[0]
        expected = message(
            "lint_split_rows",
            "{count} cells, expected {width} as in the heading, as in {more} more "
            "rows: write ; between the cells when decimals have a comma",
            count=len(_trimmed(cells)),
            width=block.width,
            more=len(split) - 1,
        )
        raise InputError(Problem(grid.name, expected, row))


def _names(pairs):
    """{position: heading}, with the number of the column where a heading stands there twice."""
    named = {p.height: p.height_heading.text for p in pairs}
    named |= {p.volume: p.volume_heading.text for p in pairs}
    texts = list(named.values())
    return {
        position: text
        if texts.count(text) == 1
        else message(
            "lint_column_of", "{heading} (column {column})", heading=text, column=position + 1
        )
        for position, text in named.items()
    }


def _by_row(page):
    longest = max((len(column) for column in page), default=0)
    return [[column[k] for column in page if k < len(column)] for k in range(longest)]


def _entry(cells, style, in_feet):
    row, height_name, volume_name, height, volume, beside = cells
    volume = volume if isinstance(volume, Reading) else read_number(volume, style)
    height = in_feet(height) if in_feet else read_number(height, style)
    beside = {what: read_number(cell, style) for what, cell in beside.items()}
    return Entry(row, height_name, volume_name, height, volume, **beside)


def _turns(entries):
    """How often the heights turn back."""
    heights = [entry.height.value for entry in entries if entry.height.value is not None]
    rises = [b > a for a, b in pairwise(heights)]
    return min(sum(rises), len(rises) - sum(rises))
