"""Tables of a grid: heights and volumes of each row as read.

A printed table repeats its pair of columns across the page, and its heading on every page. Pairs
are read by column or by row, whichever makes the heights rise.

A heading may have a row of units above or below it, a title above it, heights in several columns,
or steps of the height as columns (`tankcal.products.linter.wide`).
"""

import re
from dataclasses import dataclass, field, replace
from itertools import pairwise, zip_longest

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.linter.numbers import (
    Reading,
    feet_reader,
    fraction_reader,
    has_digit,
    has_letter,
    is_blank,
    join_heights,
    parts_heading,
    read_number,
    style_of,
)
from tankcal.products.linter.units import (
    Uncertainty,
    Unit,
    countries_in,
    heading_of,
    is_coverage_factor,
    is_heading_of_parts,
    is_unit,
    plain_text,
    uncertainty_of,
)
from tankcal.products.linter.wide import (
    WideHeading,
    find_unnamed_columns,
    title_unit,
    wide_cells,
    wide_heading,
)
from tankcal.units import INCH_M

_FEW_SPLIT_ROWS = 5
_FEWEST_MULTIPLES = 3  # fewest volumes that show whether a factor is the rounding
_WHOLE = 1e-9
_TOTAL = re.compile("(?:(?:grand|sub)[ -]?)?tota(?:ls?|is|les)|sum(?:a|as|me)?|soma|average|mean|"
                    "media|promedio|max|maximum|maxim[oa]|nominal|end|fim|fin")  # fmt: skip
_LINES_OF_HEADING = 3  # largest number of heading lines above the steps of a wide table
_LONGEST_UNIT = 24  # largest number of letters of a cell in a row of units


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
        longest = max(len(page) for page in cells)
        columns = [page[k] for k in range(longest) for page in cells if k < len(page)]
        orders.append([item for column in columns for item in column])  # through all pages
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
    return any(_TOTAL.fullmatch(word) for label in words for word in label)


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
