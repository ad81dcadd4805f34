"""Tables in the text of a PDF: lines of numbers below a heading, as grids of cells.

The text keeps the layout of the page, so that cells below each other stay below each other. Each
heading with heights and volumes begins a table, which may continue over pages; lines of prose are
skipped. The cells of a line are assigned to the columns of numbers on its page.
"""

import re
from dataclasses import dataclass, field
from itertools import zip_longest

from tankcal.linter.headings import heading_of, is_unit

MOST_LINES_OF_PAGE = 1000  # row 4032: line 32 of page 4
_CELL = re.compile(r"\S+(?:[ \t]\S+)*")
_NUMBER = re.compile(r"[+-]?[\d.,'\u2019\u00a0\u2009\u202f ]*\d[\d.,'\u2019\u00a0\u2009\u202f ]*")
_FEET = re.compile(r"\d+ ?(?:'|\u2032|\u2019|ft)[\d /.]*(?:\"|\u2033|\u201d|''|in)?|"
                   r"\d{1,3}-\d{1,2}(?:-\d{1,2}|[ -]\d{1,2}/\d{1,2})?")  # fmt: skip
_GROUPED = re.compile(r"\d{1,3}(?: \d{3})+(?:[.,]\d+)?")
_MARKS = "*\u2020\u2021"  # footnote marks
_MOSTLY = 0.6
_LINES_OF_HEADING = 3
_HALF = 0.5  # share of the lines


@dataclass(frozen=True)
class Word:
    """A cell on its line, from column `start` of the text to `end`."""

    start: int
    end: int
    text: str


@dataclass
class _Section:
    """A heading, and the lines below it on each page."""

    heading: list
    units: list = field(default_factory=list)
    row: int = 0
    pages: dict = field(default_factory=dict)  # {page: [(row, words)]}


def tables_of_text(pages):
    """Return rows (number, cells) of each table in the text of pages, heading first."""
    sections, current, since = [], None, 0
    for page, text in enumerate(pages, 1):
        for line, content in enumerate(text.split("\n")[: MOST_LINES_OF_PAGE - 1], 1):
            words, row = words_of(content), MOST_LINES_OF_PAGE * page + line
            is_units = bool(words) and all(is_unit(word.text) for word in words)
            if is_units and current is not None and since < _LINES_OF_HEADING:
                current.units, since = current.units or words, since + 1
            elif _is_heading(words):
                current, since = _Section(words, row=row), 0
                sections.append(current)
            elif current is not None and is_data(words):
                current.pages.setdefault(page, []).append((row, words))
                since = _LINES_OF_HEADING
            elif words:
                since += 1
    return _joined([page for section in sections for page in _pages(section)])


def words_of(line):
    """Return the `Word`s of a line; cells are two blanks apart, or numbers one blank apart."""
    words = []
    for match in _CELL.finditer(line):
        text = match[0].rstrip(_MARKS + " ")
        parts = text.split(" ")
        is_split = len(parts) > 1 and all(map(_NUMBER.fullmatch, parts))
        if is_split and not _GROUPED.fullmatch(text):
            start = match.start()
            for part in parts:
                words.append(Word(start, start + len(part), part))
                start += len(part) + 1
        elif text:
            words.append(Word(match.start(), match.start() + len(text), text))
    return words


def is_data(words):
    """Whether a line is a row of a table: at least two cells, most of them numbers."""
    numbers = sum(_is_number(word.text) for word in words)
    return len(words) > 1 and numbers > _MOSTLY * len(words) and numbers > 1


def _is_number(text):
    return _NUMBER.fullmatch(text) is not None or _FEET.fullmatch(text) is not None


def _is_heading(words):
    roles = [heading_of(word.text).role for word in words]
    return "volume" in roles and ("height" in roles or "ullage" in roles)


def _pages(section):
    """Return the rows (number, cells) of a section by page, each page with the heading first."""
    pages, heading = [], None
    for lines in section.pages.values():
        columns = _columns(lines)
        if heading is None:
            columns = _with_empty(columns, section.heading)
            heading = _placed(section.heading, columns)
            units = _placed(section.units, columns)
            both = zip_longest(heading, units)
            heading = tuple(" ".join(filter(None, pair)) or None for pair in both)
        rows = [(section.row if not pages else lines[0][0], heading)]
        for row, words in lines:
            cells = [None] * len(columns)
            for word in words:
                cells[_column(word, columns)] = word.text
            rows.append((row, tuple(cells)))
        pages.append(_headed(rows))
    return pages


def _columns(lines):
    """Return [(start, end)] covered by the words of lines, overlapping ranges merged."""
    spans = sorted((word.start, word.end) for _, words in lines for word in words)
    joined = [list(spans[0])]
    for start, end in spans[1:]:
        if start < joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], end)
        else:
            joined.append([start, end])
    return joined


def _with_empty(columns, heading):
    """Return the columns, including columns of the heading without numbers."""
    if len(heading) <= len(columns):
        return columns
    empty = [
        [word.start, word.end]
        for word in heading
        if not any(word.start < end and start < word.end for start, end in columns)
    ]
    return sorted(columns + empty)


def _column(word, columns):
    """Index of the column that contains a word, or is nearest to it."""

    def apart(column):
        overlap = min(word.end, column[1]) - max(word.start, column[0])
        middle = abs(word.start + word.end - column[0] - column[1]) / 2
        return (-min(overlap, 1), middle)

    return min(range(len(columns)), key=lambda k: apart(columns[k]))


def _placed(words, columns):
    """Return the heading texts by column; texts of one column are joined."""
    if len(words) == len(columns):
        return [word.text for word in words]
    texts = [None] * len(columns)
    for word in words:
        k = _column(word, columns)
        texts[k] = word.text if texts[k] is None else f"{texts[k]} {word.text}"
    return texts


def _joined(pages):
    """Merge pages with the same heading, and pages that have only its first columns."""
    headings = [page[0][1] for page in pages]
    merged = {}
    for (row, heading), *rows in pages:
        wider = [
            known_heading for known_heading in headings if known_heading[: len(heading)] == heading
        ]
        widest = max(wider, key=len)
        merged.setdefault(widest, []).extend([(row, widest), *rows])
    return list(merged.values())


def _headed(rows):
    """Remove one column without a heading from the rows; several are kept, to be refused."""
    width = max(len(cells) for _, cells in rows)
    texts = [rows[0][1][k] if k < len(rows[0][1]) else None for k in range(width)]
    filled = [sum(k < len(cells) and bool(cells[k]) for _, cells in rows[1:]) for k in range(width)]
    unnamed = [k for k in range(width) if not texts[k] and filled[k] > _HALF * (len(rows) - 1)]
    kept = [k for k in range(width) if texts[k] or (len(unnamed) > 1 and k in unnamed)]
    return [(row, tuple(cells[k] if k < len(cells) else None for k in kept)) for row, cells in rows]
