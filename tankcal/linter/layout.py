"""Tables of a grid: heights and volumes of each row as read.

A printed table repeats its pair of columns across the page, and its heading on every page. Pairs
are read by column or by row, whichever makes the heights rise.
"""

import re
from dataclasses import dataclass
from itertools import pairwise

from tankcal.errors import InputError, Problem
from tankcal.linter.blocks import find_blocks, trim_cells
from tankcal.linter.compound_heights import feet_reader, fraction_reader
from tankcal.linter.headings import Uncertainty
from tankcal.linter.numbers import Reading, has_digit, read_number, style_of
from tankcal.linter.units import plain_text
from tankcal.linter.wide import wide_cells
from tankcal.messages import message
from tankcal.units import INCH_M

_FEW_SPLIT_ROWS = 5
_FEWEST_MULTIPLES = 3  # fewest volumes that show whether a factor is the rounding
_WHOLE = 1e-9
_TOTAL = re.compile("(?:(?:grand|sub)[ -]?)?tota(?:ls?|is|les)|sum(?:a|as|me)?|soma|average|mean|"
                    "media|promedio|maximum|maximo|end|fim|fin")  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """One pair: row in the file, heading of its volumes, height and volume as read.

    uncertainty and k are read from columns beside them; None without such columns.
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
    """A capacity table as read.

    Attributes
    ----------
    name : str
        File and sheet, for messages.
    entries : list of Entry
        In the order of the table.
    height_unit_m : float or None
        Size of the unit of heights, m; None: not stated.
    volume_unit_m3 : float or None
        Size of the unit of volumes, m3; None: not stated.
    is_ullage : bool
        Whether heights fall while volumes rise.
    has_heading : bool
        False: the first two columns were used.
    is_text : bool
        Whether every number is text (CSV).
    uncertainty : Uncertainty or None
        From the heading of its uncertainties.
    volume_choices : tuple of float
        Sizes of an ambiguous unit of volumes (gallons), m3.
    complaints : tuple of Problem
        Problems of the heading that prevent reading the table.
    """

    name: str
    entries: tuple[Entry, ...]
    height_unit_m: float | None
    volume_unit_m3: float | None
    is_ullage: bool
    has_heading: bool
    is_text: bool
    uncertainty: Uncertainty | None = None
    volume_choices: tuple[float, ...] = ()
    complaints: tuple[Problem, ...] = ()


def find_tables(grid, log):
    """Return the `Table`s of a grid; blocks with equal headings are pages of one table."""
    pages = {}
    for block in find_blocks(grid):
        pages.setdefault((block.kind, block.is_parts), []).append(block)
    tables = []
    for blocks in pages.values():
        for volumes in _pairs_by_kind(blocks[0].pairs):
            table = _table(grid, blocks, volumes, log)
            if table.entries:
                tables.append(table)
    return tuple(tables)


def _pairs_by_kind(pairs):
    """Indices of the pairs of each kind: equal units and equal position after a height."""
    kinds = {}
    for number, pair in enumerate(pairs):
        place = sum(earlier.height == pair.height for earlier in pairs[:number])
        units = (pair.height_heading.named, pair.volume_heading.named)
        kinds.setdefault((place, units), []).append(number)
    return list(kinds.values())


def _table(grid, blocks, numbers, log):
    """Read a `Table` from pairs of one kind on all pages, in the order with fewer reversals."""
    cells = [_read_cells(grid, block, [block.pairs[k] for k in numbers], log) for block in blocks]
    by_column = [item for page in cells for column in page for item in column]
    orders = [by_column]
    if len(numbers) > 1 or blocks[0].wide is not None:
        orders.append([item for page in cells for row in _rows_of_page(page) for item in row])
    style = style_of([[item[3] for item in by_column], [item[4] for item in by_column]])
    first = blocks[0].pairs[numbers[0]]
    heights, rows = [item[3] for item in by_column], [item[0] for item in by_column]
    in_feet = feet_reader(grid.name, heights, first.height_heading, rows, log)
    in_fractions = None if in_feet else fraction_reader(heights, first.height_heading, style)
    orders = [[_entry(item, style, in_feet or in_fractions) for item in order] for order in orders]
    entries = min(orders, key=_count_reversals)
    height_m = 1.0 if in_feet else _height_unit(grid.name, first, in_fractions, entries, log)
    complaints = [problem for block in blocks for problem in block.complaints]
    if blocks[0].has_heading:
        row = blocks[0].heading[0]
        checked = () if in_feet else _complaints_of_heights(first, in_fractions, entries)
        checked = [*checked, *_complaints_of_volumes(first, entries)]
        complaints += [Problem(grid.name, text, row, column) for text, column in checked]
    return Table(
        grid.name,
        tuple(entries),
        height_m,
        first.volume_heading.unit,
        first.height_heading.role == "ullage",
        blocks[0].has_heading,
        grid.is_text,
        first.uncertainty,
        first.volume_heading.named.choices,
        tuple(dict.fromkeys(complaints)),
    )


def _height_unit(name, pair, in_fractions, entries, log):
    """Unit of the heights, m; fractions without a unit in the heading are of inches."""
    named = pair.height_heading.named
    if not in_fractions:
        return named.size
    if named.is_named:
        # 10 1/4 below "1/8 in" is in inches: the factor is the graduation
        return None if named.size is None else named.size / min(named.factor, 1.0)
    example = next(entry for entry in entries if "/" in entry.height.text)
    text = message(
        "lint_by_inches",
        "heights such as {found} are taken as inches: the heading names no unit",
        found=example.height.text,
    )
    log.warning(name, text, example.row, example.height_column)
    return INCH_M


def _complaints_of_heights(pair, in_fractions, entries):
    """Return (text, column) of headings of heights that cannot be used."""
    heading = pair.height_heading
    if heading.named.complaint:
        yield heading.named.complaint, heading.text
    elif heading.is_in_feet_and_inches and not pair.parts:
        text = message(
            "lint_plain_feet",
            "the heading names feet and inches, but the heights are plain numbers; expected "
            "labels such as 5' 3 3/16\" or 5-3 3/16, or one column each",
        )
        yield text, heading.text
    elif not in_fractions:
        yield from _complaints_of_factor(heading, [entry.height for entry in entries])


def _complaints_of_volumes(pair, entries):
    """Yield (text, column) of headings of volumes that cannot be used."""
    heading = pair.volume_heading
    if heading.named.complaint:
        yield heading.named.complaint, heading.text
    else:
        yield from _complaints_of_factor(heading, [entry.volume for entry in entries])
    if pair.uncertainty is not None and pair.uncertainty.complaint:
        yield pair.uncertainty.complaint, None


def _complaints_of_factor(heading, readings):
    """Return (text, column) if a factor may be the rounding of the numbers: 10 L, 1/8 in."""
    factor = heading.named.factor
    values = [reading.value for reading in readings if reading.value]
    if factor == 1 or heading.named.is_multiplied or not values:
        return
    multiples = values if factor < 1 else [value / factor for value in values]
    are_whole = [abs(value - round(value)) <= _WHOLE * max(1.0, abs(value)) for value in multiples]
    is_rounding = all(are_whole) and len(set(values)) >= _FEWEST_MULTIPLES
    if is_rounding if factor > 1 else not all(are_whole):
        text = message(
            "lint_factor_or_rounding",
            "the heading has a factor of {factor:g}, but numbers such as {found} suggest that it "
            "is the graduation or rounding; expected a heading with x before the factor, such as "
            "(x 10 L), or with the unit alone",
            factor=factor,
            found=_example(readings, are_whole, factor),
        )
        yield text, heading.text


def _example(readings, are_whole, factor):
    """Text of a number that is not a multiple of the graduation, or of the last multiple."""
    texts = [reading.text for reading in readings if reading.value]
    return texts[-1] if factor > 1 else texts[are_whole.index(False)]


def _read_cells(grid, block, pairs, log):
    """For each pair of columns, the list of (row, two names, height, volume, related cells)."""
    if block.wide is not None:
        rows = [row for row in block.rows if not _is_total(row[1], block.pairs[0])]
        return wide_cells(grid.name, block.wide, rows, log)
    names = _column_names(block.pairs)
    columns = [[] for _ in pairs]
    _refuse_split_rows(grid, block)
    for row, cells in block.rows:
        is_split = grid.is_text and len(trim_cells(cells)) > block.width
        if is_split:
            expected = message(
                "lint_split_row",
                "{count} cells, expected {width} as in the heading (a decimal comma, or a "
                "thousands mark?)",
                count=len(trim_cells(cells)),
                width=block.width,
            )
            log.problem(grid.name, expected, row)
        for column, pair in zip(columns, pairs, strict=True):
            height = cells[pair.height] if pair.height < len(cells) else None
            volume = cells[pair.volume] if pair.volume < len(cells) else None
            if not has_digit(height) and (not has_digit(volume) or _is_total(cells, pair)):
                continue  # a note or a total between the rows
            unreadable = Reading(None) if is_split else None  # reported already
            beside = {
                kind: cells[place] if place < len(cells) else None
                for kind, place in pair.beside.items()
            }
            column.append(
                (row, names[pair.height], names[pair.volume], height, unreadable or volume, beside)
            )
    return columns


def _is_total(cells, pair):
    """Whether a row without a height is a total or another summary of the rows."""
    if pair.height < len(cells) and has_digit(cells[pair.height]):
        return False
    words = (re.findall("[a-z-]+", plain_text(cell)) for cell in cells if isinstance(cell, str))
    return any(bool(word) and _TOTAL.fullmatch(word[0]) is not None for word in words)


def _refuse_split_rows(grid, block):
    """Raise InputError if the numbers themselves are split into several cells, row after row."""
    split = [(row, cells) for row, cells in block.rows if len(trim_cells(cells)) > block.width]
    if grid.is_text and len(split) > max(_FEW_SPLIT_ROWS, 0.2 * len(block.rows)):
        row, cells = split[0]
        expected = message(
            "lint_split_rows",
            "{count} cells, expected {width} as in the heading, as in {more} more "
            "rows: write ; between the cells when decimals have a comma",
            count=len(trim_cells(cells)),
            width=block.width,
            more=len(split) - 1,
        )
        raise InputError(Problem(grid.name, expected, row))


def _column_names(pairs):
    """{position: heading}, with the number of the column if a heading appears twice."""
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


def _rows_of_page(page):
    """Pairs of a page row by row, from its columns."""
    longest = max((len(column) for column in page), default=0)
    return [[column[k] for column in page if k < len(column)] for k in range(longest)]


def _entry(cells, style, read_height):
    """Read an `Entry`."""
    row, height_name, volume_name, height, volume, beside = cells
    volume = volume if isinstance(volume, Reading) else read_number(volume, style)
    height = read_height(height) if read_height else read_number(height, style)
    beside = {kind: read_number(cell, style) for kind, cell in beside.items()}
    return Entry(row, height_name, volume_name, height, volume, **beside)


def _count_reversals(entries):
    """Number of reversals of the heights."""
    heights = [entry.height.value for entry in entries if entry.height.value is not None]
    rises = [b > a for a, b in pairwise(heights)]
    return min(sum(rises), len(rises) - sum(rises))
