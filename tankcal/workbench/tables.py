"""A table under edit: headings and rows of text, each row knowing where in its file it stands.

A state is never changed: an edit gives the next one, so that what was before can be had back.
What is not edited stays in the file byte for byte.
"""

import re
from dataclasses import dataclass, replace

from tankcal.job.folder import is_row, separator_of_text
from tankcal.text.spreadsheets import guard_formula, unguard_formula
from tankcal.workbench.decimals import Unwritten

_ENDING = re.compile("\r\n|\r|\n")
MARK_OF_ORDER = "\N{ZERO WIDTH NO-BREAK SPACE}"


@dataclass(frozen=True)
class Row:
    """One row: `line` is its place in the file as read, None of a new one.

    changed  positions of the cells that are no longer those of the file
    """

    cells: tuple[str, ...]
    line: int | None = None
    changed: frozenset[int] = frozenset()

    @property
    def is_blank(self):
        return not any(self.cells)


@dataclass(frozen=True)
class EditedTable:
    """A table of a job in one state.

    Attributes
    ----------
    name, file : str
        "points", "points.csv"; of a workbook "sheet points".
    headings : tuple of str
    rows : tuple of Row
    decimal : str
        The mark of its numbers.
    origin : CsvLines or SheetOrigin
        The file as it was read, which renders a state.
    """

    name: str
    file: str
    headings: tuple[str, ...]
    rows: tuple[Row, ...]
    decimal: str
    origin: object

    def set_cells(self, changes):
        """The state after [(row, column, text)]; row and column count from 0."""
        rows = list(self.rows)
        for place, column, text in changes:
            row = rows[place]
            cells = list(row.cells)
            cells[column] = text
            rows[place] = replace(row, cells=tuple(cells), changed=row.changed | {column})
        return replace(self, rows=tuple(rows))

    def insert_rows(self, place, count=1):
        """The state with blank rows before row `place`."""
        blank = (Row(("",) * len(self.headings)),) * count
        return replace(self, rows=(*self.rows[:place], *blank, *self.rows[place:]))

    def remove_rows(self, places):
        """The state without some rows."""
        gone = set(places)
        return replace(
            self, rows=tuple(row for place, row in enumerate(self.rows) if place not in gone)
        )

    def add_column(self, heading):
        """The state with one more column, blank, at the right.

        Where cells stand beyond the headings, the first of these columns gets the heading.
        """
        if "" in self.headings:
            place = self.headings.index("")
            headings = (*self.headings[:place], heading, *self.headings[place + 1 :])
            return replace(self, headings=headings)
        last = len(self.headings)
        rows = tuple(
            replace(row, cells=(*row.cells, ""), changed=row.changed | {last}) for row in self.rows
        )
        return replace(self, headings=(*self.headings, heading), rows=rows)

    @property
    def unwritten(self):
        """[(row, column)] of the entries that are not written."""
        return [
            (place, column)
            for place, row in enumerate(self.rows)
            for column in row.changed
            if isinstance(row.cells[column], Unwritten)
        ]

    def render(self):
        """(what the origin makes of it, number of each row in the file, None of a blank one)."""
        return self.origin.render(self)


@dataclass(frozen=True)
class CsvLines:
    """The lines of a CSV file as read.

    lines    with the line's end of each beside it, in `endings`
    heading  index of the line of headings, None: there is none
    before   headings of that line
    """

    separator: str
    lines: tuple[str, ...] = ()
    endings: tuple[str, ...] = ()
    heading: int | None = None
    before: tuple[str, ...] = ()
    mark: str = ""
    ending: str = "\n"

    def render(self, table):
        """(bytes of the file, number of each row)."""
        out, numbers = [], []
        rest = iter(range(len(self.lines)))
        of_rows = set(self.row_lines)

        def emit(text, ending=None):
            out.append(text + (self.ending if ending is None else ending))

        def copy_until(stop):
            for line in rest:
                if line == stop:
                    return True
                if line not in of_rows:
                    emit(self.lines[line], self.endings[line])
            return False

        if self.heading is None:
            copy_until(None)
            if table.headings:
                emit(self.separator.join(map(self._quoted, table.headings)))
        else:
            copy_until(self.heading)
            emit(self._heading_of(table), self.endings[self.heading])
        for row in table.rows:
            if row.line is None and row.is_blank:
                numbers.append(None)
                continue
            ending = None
            if row.line is not None:
                copy_until(row.line)
                ending = self.endings[row.line]
            if out and not out[-1].endswith(("\n", "\r")):
                out[-1] += self.ending  # the last line of the file had no end
            emit(self._text_of(row), ending)
            numbers.append(len(out))
        copy_until(None)
        text = self.mark + "".join(out)
        return text.encode("utf-8"), numbers

    @property
    def row_lines(self):
        """Indices of the lines that were rows when the file was read."""
        begin = 0 if self.heading is None else self.heading + 1
        return [i for i in range(begin, len(self.lines)) if is_row(self.lines[i])]

    def _heading_of(self, table):
        added = [one for one in table.headings[len(self.before) :] if one]
        return self.separator.join((self.lines[self.heading], *map(self._quoted, added)))

    def _text_of(self, row):
        if row.line is None:
            return self.separator.join(map(self._quoted, row.cells))
        line = self.lines[row.line]
        if not row.changed:
            return line
        parts = split_line(line, self.separator)
        parts += [""] * (len(row.cells) - len(parts))
        for column in row.changed:
            if cell_of(parts[column]) != row.cells[column]:
                parts[column] = self._quoted(row.cells[column])
        return self.separator.join(parts)

    def _quoted(self, text):
        if isinstance(text, Unwritten):
            return ""
        text = guard_formula(_ENDING.sub(" ", text).strip())
        if self.separator not in text and '"' not in text:
            return text
        return '"' + text.replace('"', '""') + '"'


def read_csv_table(name, file, text, separator, decimal):
    """EditedTable of the text of a CSV file (the byte order mark still before it)."""
    mark = MARK_OF_ORDER if text.startswith(MARK_OF_ORDER) else ""
    lines, endings = _lines(text.removeprefix(mark))
    heading = next((i for i, line in enumerate(lines) if is_row(line)), None)
    separator = separator_of_text(text.removeprefix(mark), separator)
    before = ()
    if heading is not None:
        before = tuple(cell_of(part) for part in split_line(lines[heading], separator))
    ending = next((one for one in endings if one), "\n")
    origin = CsvLines(separator, lines, endings, heading, before, mark, ending)
    split = [
        (line, tuple(cell_of(part) for part in split_line(lines[line], separator)))
        for line in (origin.row_lines if heading is not None else ())
    ]
    width = max([len(before), *(len(cells) for _, cells in split)])
    headings = before + ("",) * (width - len(before))  # cells beyond them are shown, too
    rows = tuple(Row(cells + ("",) * (width - len(cells)), line) for line, cells in split)
    return EditedTable(name, file, headings, rows, decimal, origin)


def new_csv_table(name, file, headings, separator, decimal):
    """EditedTable of a file that is not there yet, without rows."""
    return EditedTable(name, file, tuple(headings), (), decimal, CsvLines(separator))


def _lines(text):
    """(lines, the end of each); the last end is "" where the text does not end with one."""
    lines, endings, begin = [], [], 0
    for end in _ENDING.finditer(text):
        lines.append(text[begin : end.start()])
        endings.append(end.group())
        begin = end.end()
    if begin < len(text):
        lines.append(text[begin:])
        endings.append("")
    return tuple(lines), tuple(endings)


def split_line(line, separator):
    """The cells of a line as they are written, with their quotation marks and spaces.

    Examples
    --------
    >>> split_line('1, "a, b",3', ",")
    ['1', ' "a, b"', '3']
    """
    if '"' not in line:
        return line.split(separator)
    parts, begin, quoted, fresh = [], 0, False, True
    for place, char in enumerate(line):
        if char == '"' and (quoted or fresh):
            quoted = not quoted
        elif char == separator and not quoted:
            parts.append(line[begin:place])
            begin, fresh = place + 1, True
            continue
        fresh = (fresh and char == " ") or quoted
    return [*parts, line[begin:]]


def cell_of(part):
    """What a written cell says.

    Examples
    --------
    >>> cell_of(' "a, b"')
    'a, b'
    """
    plain = part.strip()
    if not plain.startswith('"'):
        return unguard_formula(plain)
    return unguard_formula(plain[1:].removesuffix('"').replace('""', '"').strip())
