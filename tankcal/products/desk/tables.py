"""Editing of a table: headings and rows of text, and decimal marks of cells.

Each row has its place in the file.

A state is immutable. An edit returns a new state, so that the previous state is available for Undo.
Unedited parts of the file are preserved byte for byte.

Decimal marks of the file and of the language
---------------------------------------------

A number is shown with the decimal mark of the language. The other mark is never accepted silently:
1.234 is more than one thousand in some languages, and little more than one in others.
"""

import re
from dataclasses import dataclass, replace

from tankcal.job.fields import Field
from tankcal.job.folder import is_row, separator_of_text
from tankcal.text.delimited import guard_formula, unguard_formula
from tankcal.text.naming import NUMBER

_ENDING = re.compile("\r\n|\r|\n")
MARK_OF_ORDER = "\N{ZERO WIDTH NO-BREAK SPACE}"  # byte order mark
LISTS = ("numbers", "ranges", "rows")  # kinds with several numbers in a cell, with decimal points


@dataclass(frozen=True)
class Row:
    """A row of a table.

    Attributes
    ----------
    cells : tuple of str
        Texts of the cells.
    line : int or None
        Index of its line in the file as read; None for a new row.
    changed : frozenset of int
        Indices of the cells that differ from the file.
    """

    cells: tuple[str, ...]
    line: int | None = None
    changed: frozenset[int] = frozenset()

    @property
    def is_blank(self):
        """Whether all cells are blank."""
        return not any(self.cells)


@dataclass(frozen=True)
class EditedTable:
    """State of a table of a job.

    Attributes
    ----------
    name, file : str
        Name such as "points", and file "points.csv", or "sheet points" in a workbook.
    headings : tuple of str
        Headings of the columns.
    rows : tuple of Row
        Rows.
    decimal : str
        Decimal mark.
    origin : CsvLines or SheetOrigin
        File or sheet as read, which renders a state.
    """

    name: str
    file: str
    headings: tuple[str, ...]
    rows: tuple[Row, ...]
    decimal: str
    origin: object

    def set_cells(self, changes):
        """New state with changed cells, [(row, column, text)]; row and column count from 0."""
        rows = list(self.rows)
        for place, column, text in changes:
            row = rows[place]
            cells = list(row.cells)
            cells[column] = text
            rows[place] = replace(row, cells=tuple(cells), changed=row.changed | {column})
        return replace(self, rows=tuple(rows))

    def insert_rows(self, place, count=1):
        """New state with blank rows before row `place`."""
        blank = (Row(("",) * len(self.headings)),) * count
        return replace(self, rows=(*self.rows[:place], *blank, *self.rows[place:]))

    def remove_rows(self, places):
        """New state without the rows at `places`."""
        removed = set(places)
        return replace(
            self, rows=tuple(row for place, row in enumerate(self.rows) if place not in removed)
        )

    def add_column(self, heading):
        """New state with a blank column at the right.

        If there are cells beyond the headings, the first column without a heading gets the heading.
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
    def ambiguous(self):
        """Places [(row, column)] of the ambiguous values, which are not written."""
        return [
            (place, column)
            for place, row in enumerate(self.rows)
            for column in row.changed
            if isinstance(row.cells[column], AmbiguousNumber)
        ]

    def render(self):
        """Content rendered by the origin, and number of each row in the file, None for blank."""
        return self.origin.render(self)


@dataclass(frozen=True)
class CsvLines:
    """Lines of a CSV file as read.

    Attributes
    ----------
    separator : str
        Separator of the columns.
    lines, endings : tuple of str
        Lines without their ends, and the end of each line.
    heading : int or None
        Index of the line of headings; None without headings.
    before : tuple of str
        Headings of this line.
    mark : str
        Byte order mark, or "".
    ending : str
        End of new lines.
    """

    separator: str
    lines: tuple[str, ...] = ()
    endings: tuple[str, ...] = ()
    heading: int | None = None
    before: tuple[str, ...] = ()
    mark: str = ""
    ending: str = "\n"

    def render(self, table):
        """Bytes of the file, and number of each row in the file, None for a new blank row."""
        output, numbers = [], []
        remaining = iter(range(len(self.lines)))
        row_lines = set(self.row_lines)

        def emit(text, ending=None):
            """Append a line."""
            output.append(text + (self.ending if ending is None else ending))

        def copy_until(stop):
            """Copy lines that are no rows, such as comments, up to the line `stop`."""
            for line in remaining:
                if line == stop:
                    return True
                if line not in row_lines:
                    emit(self.lines[line], self.endings[line])
            return False

        if self.heading is None:
            copy_until(None)
            if table.headings:
                emit(self.separator.join(map(self._quote_cell, table.headings)))
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
            if output and not output[-1].endswith(("\n", "\r")):
                output[-1] += self.ending  # if the last line of the file has no end
            emit(self._text_of(row), ending)
            numbers.append(len(output))
        copy_until(None)
        text = self.mark + "".join(output)
        return text.encode("utf-8"), numbers

    @property
    def row_lines(self):
        """Indices of the lines that are rows of the file as read."""
        begin = 0 if self.heading is None else self.heading + 1
        return [i for i in range(begin, len(self.lines)) if is_row(self.lines[i])]

    def _heading_of(self, table):
        """Line of headings with added columns."""
        added = [heading for heading in table.headings[len(self.before) :] if heading]
        return self.separator.join((self.lines[self.heading], *map(self._quote_cell, added)))

    def _text_of(self, row):
        """Line of a row, in which only changed cells differ from the file."""
        if row.line is None:
            return self.separator.join(map(self._quote_cell, row.cells))
        line = self.lines[row.line]
        if not row.changed:
            return line
        parts = split_line(line, self.separator)
        parts += [""] * (len(row.cells) - len(parts))
        for column in row.changed:
            if cell_of(parts[column]) != row.cells[column]:
                parts[column] = self._quote_cell(row.cells[column])
        return self.separator.join(parts)

    def _quote_cell(self, text):
        """Text of a cell in the file, with quotation marks if required; "" if ambiguous."""
        if isinstance(text, AmbiguousNumber):
            return ""
        text = guard_formula(_ENDING.sub(" ", text).strip())
        if self.separator not in text and '"' not in text:
            return text
        return '"' + text.replace('"', '""') + '"'


def read_csv_table(name, file, text, separator, decimal):
    """Read the `EditedTable` of a CSV file.

    Parameters
    ----------
    name, file : str
        Name of the table and of the file.
    text : str
        Text of the file, with its byte order mark if it has a mark.
    separator, decimal : str
        Declared separator and decimal mark.
    """
    mark = MARK_OF_ORDER if text.startswith(MARK_OF_ORDER) else ""
    lines, endings = _lines(text.removeprefix(mark))
    heading = next((i for i, line in enumerate(lines) if is_row(line)), None)
    separator = separator_of_text(text.removeprefix(mark), separator)
    before = ()
    if heading is not None:
        before = tuple(cell_of(part) for part in split_line(lines[heading], separator))
    ending = next((line_end for line_end in endings if line_end), "\n")
    origin = CsvLines(separator, lines, endings, heading, before, mark, ending)
    split_rows = [
        (line, tuple(cell_of(part) for part in split_line(lines[line], separator)))
        for line in (origin.row_lines if heading is not None else ())
    ]
    width = max([len(before), *(len(cells) for _, cells in split_rows)])
    headings = before + ("",) * (width - len(before))  # cells without a heading are also shown
    rows = tuple(Row(cells + ("",) * (width - len(cells)), line) for line, cells in split_rows)
    return EditedTable(name, file, headings, rows, decimal, origin)


def new_csv_table(name, file, headings, separator, decimal):
    """`EditedTable` of a new file, without rows."""
    return EditedTable(name, file, tuple(headings), (), decimal, CsvLines(separator))


def _lines(text):
    """Lines, and the end of each line; the last end is "" if the text ends without it."""
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
    """Split a line into the cells as written, with quotation marks and spaces.

    Examples
    --------
    >>> split_line('1, "a, b",3', ",")
    ['1', ' "a, b"', '3']
    """
    if '"' not in line:
        return line.split(separator)
    parts, begin, quoted, at_start = [], 0, False, True
    for place, char in enumerate(line):
        if char == '"' and (quoted or at_start):
            quoted = not quoted
        elif char == separator and not quoted:
            parts.append(line[begin:place])
            begin, at_start = place + 1, True
            continue
        at_start = (at_start and char == " ") or quoted
    return [*parts, line[begin:]]


def cell_of(part):
    """Text of a cell as written, without quotation marks and spaces.

    Examples
    --------
    >>> cell_of(' "a, b"')
    'a, b'
    """
    plain = part.strip()
    if not plain.startswith('"'):
        return unguard_formula(plain)
    return unguard_formula(plain[1:].removesuffix('"').replace('""', '"').strip())


class AmbiguousNumber(str):
    """An ambiguous number, which is shown and reported, but not written to the file."""


def text_for_display(field: Field | None, text: str, in_file: str, in_language: str) -> str:
    """Convert the text of a cell in the file to the text in the grid.

    Parameters
    ----------
    field : Field or None
        Field of the column; None for an unknown column.
    text : str
        Text in the file.
    in_file, in_language : str
        Decimal marks of the file and of the language.

    Returns
    -------
    str

    Examples
    --------
    >>> text_for_display(Field("z_m", "number", ""), "10.950", ".", ",")
    '10,950'
    """
    if isinstance(text, AmbiguousNumber) or field is None or not text:
        return str(text)
    if field.kind in LISTS:
        return text.replace(".", in_language)
    if field.kind != "number" or in_file == in_language:
        return text
    is_number = NUMBER.fullmatch(text.replace(in_file, "."))
    return text.replace(in_file, in_language) if is_number else text


def text_for_file(field: Field | None, text: str, in_file: str, in_language: str) -> str:
    """Convert an entered text to the text in the file.

    Parameters
    ----------
    field : Field or None
        Field of the column; None for an unknown column.
    text : str
        Entered text.
    in_file, in_language : str
        Decimal marks of the file and of the language.

    Returns
    -------
    str
        An `AmbiguousNumber` if the text is ambiguous.

    Examples
    --------
    >>> column = Field("z_m", "number", "")
    >>> text_for_file(column, " 10,950 ", ".", ",")
    '10.950'
    >>> type(text_for_file(column, "1.234", ".", ",")).__name__
    'AmbiguousNumber'
    """
    text = " ".join(text.replace("\N{NO-BREAK SPACE}", " ").split())
    if field is None:
        return text
    if field.kind in LISTS:
        in_file = "."
    elif field.kind != "number":
        return text
    if in_file == in_language:
        return text
    if in_file in text and NUMBER.fullmatch(text.replace(in_file, ".").split(";")[0].strip()):
        return AmbiguousNumber(text)
    plain = text.replace(in_language, in_file)
    if field.kind in LISTS:
        return plain
    return plain if NUMBER.fullmatch(plain.replace(in_file, ".")) else text
