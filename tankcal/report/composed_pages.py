"""Rows of long tables, written into pages that the typesetter sets with their headings alone.

The typesetter takes a quarter of a millisecond and 20 kB of memory for each cell of a table of
numbers. page.typ therefore sets the first pages, the last page and the pages of the `sample_rows`
in full. Each other page of the table has headings, header and footer, but no rows. This module
reads positions, glyphs and kerning from the full pages. With them it writes the rows of the other
pages, and tags each cell for screen readers.

A cell whose text, position or tag differs from the expected form ends the composition, and the
typesetter then sets all rows.
"""

import re
import zlib
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from tankcal.report.attachments import objects_of

LONG = 5000  # rows of a long table; two such documents typeset at a time would need gigabytes
_SAME_PT = 0.02  # largest difference of two positions of an edge; rounding of the PDF is 1e-4
_LEVEL = 3  # of compression: level 6 takes three times as long for 4 % less
_KIDS = re.compile(rb"/K\[([^]]*)\]")
_REFERENCE = re.compile(rb"(\d+) 0 R")
_RULES = re.compile(rb"/Artifact<</Type/Layout>>BDC\n.*?\nEMC", re.DOTALL)
_HEADING = re.compile(rb"/Span<<.*?\nEMC", re.DOTALL)
_CELL = re.compile(
    rb"/Span<</MCID (\d+)>>BDC\nq 1 0 0 -1 ([\d.]+) ([\d.]+) cm(/\w+ cs [\d. ]+ scn)\n"
    rb"BT 0 Tr(/\w+ [\d.]+ Tf) 1 0 0 -1 0 0 Tm(\[?\(.*?\)\]?)T[jJ]\nET\nQ\nEMC",
    re.DOTALL,
)
_BOX = re.compile(rb"/BBox\[([-\d.]+) [-\d. ]+\]")
_TOKENS = re.compile(rb"\\[0-7]{3}|\\.|[()]|[^\\()]", re.DOTALL)
_ESCAPED = re.compile(rb"\\([0-7]{3}|.)", re.DOTALL)
_SIGNS = {b"n": b"\n", b"r": b"\r", b"t": b"\t", b"b": b"\b", b"f": b"\f"}


class UnexpectedForm(ValueError):
    """The PDF differs from the form that this module reads."""


def is_composed(block):
    """Return whether the pages of a prepared block are composed: a long table of numbers."""
    return block.get("even", False) and len(block["rows"]) > LONG


def sample_rows(block):
    """Return the rows (list of int) that show all pairs of characters and all missing decimals.

    The pages of these rows contain each glyph and kerning of the table.
    """
    known, rows = set(), []
    for row, cells in enumerate(block["rows"]):
        shown = set()
        for x, cell in enumerate(cells):
            text, missing = _text(cell)
            shown.update(pairwise(text))
            shown.add((x, missing if text else None))
        if not shown <= known:
            known |= shown
            rows.append(row)
    return rows


def compose_pages(pdf, blocks):
    """Write the rows of long tables into the pages with headings alone.

    Parameters
    ----------
    pdf : bytes
        PDF of typst.
    blocks : list of dict
        Prepared tables with the key "samples", in their order in the PDF.

    Returns
    -------
    bytes or None
        None if the PDF has an unexpected form.
    """
    objects = objects_of(pdf)
    changed = {}
    try:
        runs = [run for run in _Tree(objects).runs() if any(page.is_empty for page in run)]
        free = len(objects.places)
        for run, block in zip(runs, blocks, strict=True):
            free = _compose_table(run, block, changed, free)
    except (AttributeError, LookupError, TypeError, ValueError, zlib.error):
        return None
    return objects.with_contents(changed)


@dataclass(frozen=True)
class _Tree:
    """Tags of a PDF of typst."""

    objects: object

    def content(self, number):
        """Content of an object; UnexpectedForm for an absent object."""
        content = self.objects.content(number) if number < len(self.objects.places) else None
        if content is None:
            raise UnexpectedForm
        return content

    def kids(self, number, tag):
        """Numbers of the children of a tag of this kind; [] for another kind."""
        content = self.content(number)
        kids = _KIDS.search(content)
        if not kids or b"/S/%s/" % tag not in content:
            return []
        return [int(kid) for kid in _REFERENCE.findall(kids[1])]

    def number(self, content, key):
        """Number of the object to which a key refers."""
        match = re.search(rb"/%s[ \[](\d+) 0 R" % key, content)
        if not match:
            raise UnexpectedForm
        return int(match[1])

    @cached_property
    def root(self):
        """Root of the tags."""
        catalog = self.content(self.number(self.objects.trailer, b"Root"))
        return self.content(self.number(catalog, b"StructTreeRoot"))

    @cached_property
    def parents(self):
        """Object of the tags of each page, {StructParents of the page: number}."""
        entries = re.search(rb"/Nums\[([^]]*)\]", self.root)
        if not entries:
            raise UnexpectedForm
        pairs = re.findall(rb"(\d+) (\d+) 0 R", entries[1])
        return {int(key): int(number) for key, number in pairs}

    def runs(self):
        """Return the pages of each table that consists of pages of columns (list of list)."""
        runs = [[]]
        for child in self.kids(self.number(self.root, b"K"), b"Document"):
            inner = [self.kids(column, b"Div") for column in self.kids(child, b"Div")]
            tables = [kids[0] for kids in inner if len(kids) == 1]
            rows = [self._rows(table) for table in tables]
            if inner and len(tables) == len(inner) and None not in rows:
                runs[-1].append(_Page(self, tables, rows))
            elif runs[-1]:
                runs.append([])
        return [run for run in runs if run]

    def _rows(self, table):
        """Numbers of the rows below the headings of a table; None if it is no table."""
        bodies = (self.kids(kid, b"TBody") for kid in self.kids(table, b"Table"))
        return next((rows for rows in bodies if rows), None)


@dataclass(frozen=True)
class _Page:
    """A page of a long table: the tags of its tables and of their rows."""

    tree: _Tree
    tables: list[int]
    rows: list[list[int]]

    @property
    def is_empty(self):
        """Whether the page has headings alone: a single row without text in each table."""
        is_single = all(len(rows) == 1 for rows in self.rows)
        return is_single and not any(match for *_, match in self.cells())

    @cached_property
    def lefts(self):
        """Left edge of each table, pt."""
        boxes = (_BOX.search(self.tree.content(table)) for table in self.tables)
        return [float(box[1]) for box in boxes]

    @cached_property
    def page(self):
        """Number of the page object."""
        tag = self.tables[0]
        while not (page := re.search(rb"/Pg (\d+) 0 R", self.tree.content(tag))):
            tag = int(_REFERENCE.search(_KIDS.search(self.tree.content(tag))[1])[1])
        return int(page[1])

    @cached_property
    def stream(self):
        """Number of the object with the content of the page."""
        return self.tree.number(self.tree.content(self.page), b"Contents")

    @cached_property
    def content(self):
        """Drawing operators of the page."""
        _, _, packed = self.tree.content(self.stream).partition(b"stream\n")
        return zlib.decompress(packed.rpartition(b"\nendstream")[0])

    def cells(self):
        """Yield (table, row, column, match of _CELL or None) of each cell."""
        drawn = {int(match[1]): match for match in _CELL.finditer(self.content)}
        for t, rows in enumerate(self.rows):
            for y, row in enumerate(rows):
                for x, cell in enumerate(self.tree.kids(row, b"TR")):
                    marks = _KIDS.search(self.tree.content(cell))[1]
                    yield t, y, x, drawn[int(marks)] if marks else None


class _Look:
    """Positions, glyphs and kerning of a table, read from its full pages."""

    def __init__(self, block):
        self.block, self.style, self.widths = block, None, None
        self.glyphs, self.gaps, self.edges, self.heights = {}, {}, {}, {}
        self.has_gaps, self.lefts = False, {}

    def learn(self, page, start, has_heights):
        """Read the cells of a page whose rows begin at row `start` of the table."""
        offsets = np.cumsum([0, *map(len, page.rows)]) + start
        for t, y, x, match in page.cells():
            text, missing = _text(self.block["rows"][offsets[t] + y][x])
            if (match is None) != (not text):
                raise UnexpectedForm
            if not match:
                continue
            style = match[4], match[5]
            if self.style is None:
                self.style, self.widths = style, _widths(page, style[1].split()[0])
            codes, gaps = _glyphs(match[6])
            if len(codes) != len(text) or style != self.style:
                raise UnexpectedForm
            for letter, code in zip(text, codes, strict=True):
                self._agree(self.glyphs, letter, code)
            for i, gap in enumerate(gaps):
                self._agree(self.gaps, text[i : i + 2], gap)
                self.has_gaps |= gap != 0
            left, height = float(match[2]), float(match[3])
            edge = left + self._shift(x, text) - page.lefts[t]
            self._agree(self.edges, (x, missing), edge, _SAME_PT)
            if has_heights:
                self._agree(self.heights, y, height, _SAME_PT)

    @staticmethod
    def _agree(known, key, value, tolerance=0):
        """Keep a value; UnexpectedForm if another value is known."""
        other = known.setdefault(key, value)
        if other != value and not (tolerance and abs(other - value) <= tolerance):
            raise UnexpectedForm

    def _shift(self, x, text):
        """Distance, pt, from the left of a text to the edge that its column aligns."""
        align = self.block["align"][x]
        if align == "left":
            return 0.0
        if align == "center":
            raise UnexpectedForm
        thousandths = sum(self.widths[self.glyphs[letter]] for letter in text)
        if self.has_gaps:
            thousandths -= sum(self.gaps[text[i : i + 2]] for i in range(len(text) - 1))
        return thousandths / 1000 * self.size

    @cached_property
    def size(self):
        """Size of the letters, pt."""
        return float(self.style[1].split()[1])

    def shown(self, x, text, missing):
        """Return the place of a text in its table and its glyphs, as the operators of a PDF."""
        hexadecimal = text.translate(self._hexadecimal)
        if not self.has_gaps:
            # Texts that differ in letters of equal width only have a common place.
            form = x, missing, text.translate(self._letters_of_equal_width)
            left = self.lefts.get(form)
            if left is None:
                left = self.lefts[form] = self.edges[x, missing] - self._shift(x, text)
            return left, f"<{hexadecimal}>Tj"
        left = self.edges[x, missing] - self._shift(x, text)
        gaps = (self.gaps.get(text[i : i + 2], 0) for i in range(len(text)))
        glyphs = (f"<{hexadecimal[4 * i : 4 * i + 4]}>{-g or ''}" for i, g in enumerate(gaps))
        return left, f"[{''.join(glyphs)}]TJ"

    @cached_property
    def _hexadecimal(self):
        return {ord(letter): f"{code:04X}" for letter, code in self.glyphs.items()}

    @cached_property
    def _letters_of_equal_width(self):
        """First letter of the width of each letter, for str.translate."""
        letters = {}
        return {
            ord(letter): letters.setdefault(self.widths[code], letter)
            for letter, code in self.glyphs.items()
        }


def _text(cell):
    return (cell, "") if isinstance(cell, str) else (cell["text"], cell["missing"])


def _glyphs(shown):
    """Return the glyphs of a text of a PDF (list of int) and the gap after each but the last.

    Brackets within a string stay without a backslash if they are in pairs (ISO 32000-1, 7.3.4.2).
    """
    codes, gaps, depth, string, gap = [], [], 0, b"", b""
    for token in _TOKENS.findall(shown):
        if token == b"(" and not depth:
            gaps[-1:] = [float(gap or 0)] if gaps else []
            depth, string, gap = 1, b"", b""
        elif token == b")" and depth == 1:
            depth = 0
            codes += [int.from_bytes(string[i : i + 2], "big") for i in range(0, len(string), 2)]
            gaps += [0.0] * (len(codes) - len(gaps))
        elif depth:
            depth += {b"(": 1, b")": -1}.get(token, 0)
            string += _ESCAPED.sub(_unescape, token)
        elif token not in b"[]":
            gap += token
    return codes, gaps[:-1]


def _unescape(match):
    sign = match[1]
    return bytes([int(sign, 8)]) if len(sign) == 3 else _SIGNS.get(sign, sign)


def _widths(page, name):
    """Width of each glyph of the font of this name on a page, thousandths of its size."""
    tree = page.tree
    resources = tree.content(tree.number(tree.content(page.page), b"Resources"))
    font = tree.content(tree.number(resources, name[1:]))
    listed = re.search(rb"/W\[([\d. ]*)\]", tree.content(tree.number(font, b"DescendantFonts")))
    numbers = listed[1].split()
    return {
        code: float(width)
        for first, last, width in zip(*[iter(numbers)] * 3, strict=True)
        for code in range(int(first), int(last) + 1)
    }


def _compose_table(run, block, changed, free):
    """Add the changed and new objects of the pages of a table; return the next free number.

    Parameters
    ----------
    run : list of _Page
        Pages of the table.
    block : dict
        The table.
    changed : dict
        {number of an object: content}.
    free : int
        First unused number of an object.
    """
    model, look, start = run[1], _Look(block), 0
    per_column = len(model.rows[0])
    empty = []
    for page in run:
        if page.is_empty:
            empty.append((page, start))
            start += per_column * len(page.tables)
        else:
            look.learn(page, start, has_heights=page is model)
            start += sum(map(len, page.rows))
    if start != len(block["rows"]):
        raise UnexpectedForm
    rules = b"\n".join(_RULES.findall(model.content))
    for page, first in empty:
        free = _compose_page(page, first, model, look, rules, changed, free)
    return free


def _compose_page(page, start, model, look, rules, changed, free):
    """Write the rows of a page from row `start` of the table; return the next free number."""
    tree, rows = page.tree, look.block["rows"]
    listed = tree.parents[int(re.search(rb"/StructParents (\d+)", tree.content(page.page))[1])]
    parents = tree.content(listed)
    mark = parents.count(b" R")  # of the headings; the cells follow
    drawn, tags = [[] for _ in page.tables], []
    for t, table in enumerate(page.tables):
        (row,) = page.rows[t]  # the row without text becomes the first row
        cell_tags, row_tags = tree.kids(row, b"TR"), []
        body = tree.number(tree.content(row), b"P")
        for y in range(len(model.rows[t])):
            row_tags.append(row)
            for x, (cell, tag) in enumerate(zip(rows[start], cell_tags, strict=True)):
                text, missing = _text(cell)
                content = f"<</Type/StructElem/S/TD/P {row} 0 R/K["
                if text:
                    left, shown = look.shown(x, text, missing)
                    place = f"{page.lefts[t] + left:.3f} {look.heights[y]:.3f}"
                    drawn[t].append(
                        f"/Span<</MCID {mark}>>BDC\nBT 1 0 0 1 {place} Tm{shown} ET\nEMC"
                    )
                    tags.append(tag)
                    content += f"{mark}]/Pg {page.page} 0 R>>"
                    mark += 1
                changed[tag] = (content if text else f"{content}]>>").encode()
            changed[row] = b"<</Type/StructElem/S/TR/P %d 0 R/K[%s]>>" % (
                body,
                _refer(cell_tags),
            )
            start += 1
            row, cell_tags = free, range(free + 1, free + 1 + len(rows[0]))
            free += 1 + len(rows[0])
        free = row  # of the row after the last
        changed[body] = b"<</Type/StructElem/S/TBody/P %d 0 R/K[%s]>>" % (
            table,
            _refer(row_tags),
        )
        box = _BOX.search(tree.content(model.tables[t]))[0]
        changed[table] = _BOX.sub(box, tree.content(table))
    changed[listed] = b"%s %s]" % (parents.rstrip(b"]"), _refer(tags))
    # The cells of a table follow its headings, so that programs without tags read them in order.
    headings = [*_HEADING.finditer(page.content)]
    per_table = len(headings) // len(page.tables)
    pieces, copied_to = [], 0
    for t, cells in enumerate(drawn):
        end = headings[(t + 1) * per_table - 1].end()
        shown = "\n".join(cells).encode()
        pieces += [page.content[copied_to:end], b"\nq %s%s 0 Tr\n%s\nQ\n" % (*look.style, shown)]
        copied_to = end
    content = _RULES.sub(b"", b"".join([*pieces, page.content[copied_to:]]))
    packed = zlib.compress(b"%s\n%s" % (content, rules), _LEVEL)
    stream = b"<</Length %d/Filter/FlateDecode>>\nstream\n%s\nendstream"
    changed[page.stream] = stream % (len(packed), packed)
    return free


def _refer(numbers):
    """Text of references to objects."""
    return b" ".join(b"%d 0 R" % number for number in numbers)
