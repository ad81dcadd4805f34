"""Proposal for the import of a file: its kind, format and columns, which the user can correct.

A table may have any of the usual encodings, separators, decimal marks and headings. The proposal
states the recognised format. An import is a single edit of the draft, which Undo reverts.
"""

import io
import re
from collections import Counter
from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction

from tankcal.job.contract import COLUMNS, columns_of
from tankcal.job.field_values import has_two_meanings
from tankcal.job.folder import is_row
from tankcal.job.headings import LENGTHS, Meaning, meanings_of, stated_meaning
from tankcal.job.sheets import SETTINGS_SHEET
from tankcal.products.desk.tables import cell_of, split_line
from tankcal.products.fieldbooks.detection import is_field_book
from tankcal.products.fieldbooks.lists import convert_cell
from tankcal.text.delimited import BY_CERTAINTY, decode_text, find_encoding, find_separator
from tankcal.text.naming import split_unit

SINGLE_BYTE = ("cp1252", "mac_roman", "cp850")  # encodings without a byte order mark
ENCODINGS = ("utf-8", "utf-16-le", "utf-16-be", *SINGLE_BYTE)
LETTERS = set("áàâãäéêèíîóôõöúüçñÁÀÂÃÄÉÊÍÓÔÕÖÚÜÇÑ°º²³±µ")  # beyond ASCII, in words of the languages
SEPARATORS = (*BY_CERTAINTY, " ")
TESTED_LINES = 200  # lines from which separator and width are determined
MOST_ROWS = 100_000
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
_MARKED = re.compile(r"[+-]?\d*([.,])\d+([eE][+-]?\d+)?")
# A number with separated thousands and a different decimal mark has one meaning.
_GROUPED = re.compile(r"[+-]?\d{1,3}(?:(?P<group>[.,' \u00a0\u202f])\d{3})+(?!(?P=group))([.,])\d+")


class Kind(StrEnum):
    """Kind of a file, determined from its content."""

    TABLE = "table"
    FIELD_BOOK = "field_book"
    JOB_BOOK = "job_book"  # a job as a workbook
    RECORD = "record"
    PDF = "pdf"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Column:
    """A column of a file.

    Attributes
    ----------
    heading : str
        Heading in the file, or the number of the column.
    target : str
        Column of the job; "": not imported.
    unit : str
        Unit of a length in the file; "" for other columns.
    is_sure : bool
        Whether the heading is known; False: assigned by its position, or not assigned.
    """

    heading: str
    target: str = ""
    unit: str = ""
    is_sure: bool = False


@dataclass(frozen=True)
class Proposal:
    """Recognised content of a file.

    Attributes
    ----------
    kind : Kind
        Kind of the file.
    name : str
        Table of the job.
    encoding, separator, decimal : str
        Format of a table; the decimal mark is "" if the numbers do not determine it.
    heading_row : int or None
        Row of the headings, from 1; None without headings.
    columns : tuple of Column
        Columns.
    rows : tuple of tuple of str
        Cells below the headings.
    """

    kind: Kind
    name: str = ""
    encoding: str = ""
    separator: str = ""
    decimal: str = ""
    heading_row: int | None = None
    columns: tuple[Column, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()

    @property
    def missing(self):
        """Required columns of the table that no column of the file supplies."""
        targets = {column.target for column in self.columns}
        return [
            field.name
            for field in COLUMNS.get(self.name, ())
            if field.required and field.name not in targets
        ]

    def convert(self):
        """Headings of the job, and rows with decimal points in its units."""
        used = [place for place, column in enumerate(self.columns) if column.target]
        fields = {field.name: field for field in COLUMNS[self.name]}
        rows = []
        for row in self.rows:
            cells = []
            for place in used:
                column, text = self.columns[place], row[place]
                if fields[column.target].kind == "number":
                    unit, factor = split_unit(column.target)[1], Fraction(1)
                    if column.unit in LENGTHS and unit in LENGTHS:
                        factor = LENGTHS[column.unit] / LENGTHS[unit]
                    grouped = _GROUPED.fullmatch(text)
                    if grouped and grouped[2] == self.decimal:
                        text = text.replace(grouped["group"], "")
                    text = convert_cell(text, factor, self.decimal)
                cells.append(text)
            rows.append(tuple(cells))
        return tuple(self.columns[place].target for place in used), rows


def propose(data, name="points", *, encoding="", separator="", decimal="", targets=None, units=()):
    """Propose the import of a file.

    Parameters
    ----------
    data : bytes
        Content of the file.
    name : str
        Table of the job.
    encoding, separator, decimal : str
        Choices of the user; "": recognised.
    targets : list of str, optional
        Column of the job for each column of the file, as chosen by the user.
    units : list of str
        Unit of each column of the file, as chosen by the user.

    Returns
    -------
    Proposal
    """
    kind = kind_of(data)
    if kind is not Kind.TABLE:
        return Proposal(kind)
    if data.startswith(b"PK"):
        encoding, separator, rows = "", "", _sheet_rows(data)
        decimal = "."
    else:
        encoding = encoding or recognise_encoding(data)
        text = decode_text(data, encoding) if encoding else ""
        lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if is_row(line)]
        separator = separator or _recognise_separator([line for _, line in lines])
        rows = []
        for number, line in lines[:MOST_ROWS]:
            parts = line.split() if separator == " " else split_line(line, separator)
            rows.append((number, tuple(map(cell_of, parts))))
    heading_row, headings, rows = _divide(rows)
    decimal = decimal or _recognise_decimal(rows, separator)
    columns = _assign(headings, heading_row, name, rows, targets, units)
    return Proposal(kind, name, encoding, separator, decimal, heading_row, columns, tuple(rows))


def kind_of(data):
    """Determine the kind of a file from its content."""
    if data.startswith(b"%PDF"):
        return Kind.PDF
    if data.startswith(b"PK"):
        titles = _sheet_titles(data)
        if not titles:
            return Kind.UNKNOWN
        return Kind.JOB_BOOK if SETTINGS_SHEET in titles else Kind.TABLE
    if re.match(rb'\s*\{\s*"format"\s*:\s*"tankcal', data):
        return Kind.RECORD
    if is_field_book(data):
        return Kind.FIELD_BOOK
    encoding = recognise_encoding(data)
    return Kind.TABLE if encoding and data.strip() else Kind.UNKNOWN


def recognise_encoding(data):
    """Return the encoding of a text, from its mark or from the letters of its words; "": none."""
    encoding = find_encoding(data)
    for name in (encoding,) if encoding != "utf-8" else ("utf-8", *SINGLE_BYTE):
        try:
            text = data.decode(name)
        except UnicodeDecodeError:
            continue
        if name == "utf-8" or encoding != "utf-8":
            return name if "\0" not in text else ""
    texts = {}
    for name in SINGLE_BYTE:
        try:
            text = data.decode(name)
        except UnicodeDecodeError:
            continue
        if not re.search(r"[\0-\x08\x0e-\x1f]", text):
            beyond = [letter for letter in text if letter > "\x7f"]
            texts[name] = sum(letter in LETTERS for letter in beyond)
    return max(texts, key=texts.get, default="")


def _recognise_separator(lines):
    """Return the separator of lines; a space only if no other mark divides them."""
    lines = lines[:TESTED_LINES]
    if not lines:
        return BY_CERTAINTY[-1]
    separator = find_separator(lines)
    # Numbers with decimal commas and blanks between them: the comma does not separate.
    is_blank_separated = separator == "," and all(
        re.search(r"\d,\d+\s+\S*\d,\d", line) for line in lines[1:]
    )
    if any(separator in line for line in lines) and not is_blank_separated:
        return separator
    return " "


def _divide(rows):
    """Divide rows [(number, cells)] into the row of headings, the headings and the other rows."""
    counts = Counter(len(cells) for _, cells in rows[:TESTED_LINES])
    width = max(counts, key=lambda count: (counts[count], count), default=0)
    first = next((place for place, (_, cells) in enumerate(rows) if len(cells) == width), 0)
    body = rows[first:]
    names, heading_row = (), None
    if body and not any(_NUMBER.fullmatch(cell) for cell in body[0][1]):
        heading_row, names = body[0]
        body = body[1:]
    columns = max([width, *(len(cells) for _, cells in body)])
    headings = [name or str(place) for place, name in enumerate(names, 1)]
    headings += [str(place) for place in range(len(headings) + 1, columns + 1)]
    for place, heading in enumerate(headings):
        if heading in headings[:place]:
            headings[place] = f"{heading} ({place + 1})"
    padded = [cells + ("",) * (columns - len(cells)) for _, cells in body]
    return heading_row, headings, padded


def _recognise_decimal(rows, separator):
    """Return the decimal mark of the numbers; "" if they have none or do not determine it."""
    marks, doubtful = set(), set()
    for row in rows:
        for cell in row:
            marked, grouped = _MARKED.fullmatch(cell), _GROUPED.fullmatch(cell)
            if grouped:
                marks.add(grouped[2])
            elif marked:
                (doubtful if has_two_meanings(cell) else marks).add(marked[1])
    if separator == ",":
        return "."
    if len(marks) == 1:
        return marks.pop()
    # Without any mark, the numbers are whole and each mark suits.
    return "." if not marks and not doubtful else ""


def _assign(headings, heading_row, name, rows, targets, units):
    """Columns of a file, as recognised or as chosen by the user."""
    fields = {field.name: field for field in columns_of(name, None)}
    if targets is None:
        meanings = meanings_of([head for head in headings if not head.isdigit()], fields.values())
        identical = [head for head in headings if head in fields]
        meanings |= {head: Meaning(head, Fraction(1)) for head in identical}
        if heading_row is None:
            required = [field.name for field in fields.values() if field.required]
            meanings = {
                head: Meaning(column, Fraction(1))
                for head, column in zip(headings, required, strict=False)
            }
    else:
        chosen = zip(headings, targets, strict=False)
        meanings = {
            head: stated_meaning(head, fields[target])
            for head, target in chosen
            if target in fields
        }
    columns = []
    for place, heading in enumerate(headings):
        meaning = meanings.get(heading)
        target = "" if meaning is None or meaning.factor is None else meaning.column
        field_unit = split_unit(target)[1]
        unit = field_unit if field_unit in LENGTHS else ""
        if unit and meaning.unit in LENGTHS:
            unit = meaning.unit
        if unit and place < len(units) and units[place] in LENGTHS:
            unit = units[place]
        is_sure = bool(target) and heading_row is not None
        columns.append(Column(heading, target, unit, is_sure))
    return tuple(columns)


def _sheet_titles(data):
    """Titles of the sheets of a workbook; () if the file is no workbook."""
    from openpyxl import load_workbook

    try:
        return tuple(load_workbook(io.BytesIO(data), read_only=True).sheetnames)
    except Exception:  # a damaged archive fails in many ways
        return ()


def _sheet_rows(data):
    """Rows [(number, cells)] of the first sheet of a workbook, as texts with decimal points."""
    from openpyxl import load_workbook

    book = load_workbook(io.BytesIO(data), read_only=True, data_only=True)
    rows = []
    for number, row in enumerate(book.worksheets[0].iter_rows(values_only=True), 1):
        cells = tuple("" if cell is None else str(cell).strip() for cell in row)
        if any(cells) and not cells[0].startswith("#"):
            rows.append((number, cells))
        if len(rows) >= MOST_ROWS:
            break
    return rows
