"""Cells of one sheet of a workbook."""

import re
from dataclasses import dataclass, field
from functools import cache

from tankcal.job.excel.archive import Unreadable, damaged
from tankcal.job.excel.markup import parse
from tankcal.job.excel.values import uncalculated
from tankcal.job.tables import MAX_COLUMNS, shown
from tankcal.messages import message

MAX_ROWS = 100_000  # most rows that are not blank
LAST_ROW = 1_048_576  # last row in Excel
_RANGE = re.compile(r"([A-Z]{1,3})([0-9]{1,7})(?::([A-Z]{1,3})([0-9]{1,7}))?")
_TRUE = ("1", "true")


@dataclass(frozen=True)
class Grid:
    """Content of a sheet.

    Attributes
    ----------
    rows : list of (int, list)
        (row, values) of each row that is not blank; at most MAX_COLUMNS + 1 values.
    merged : list of tuple of int
        (first row, last row, first column, last column) of each merged range.
    hidden_rows : frozenset of int
        Hidden rows.
    hidden_columns : list of (int, int)
        (first, last) of each range of hidden columns.
    """

    rows: list
    merged: list
    hidden_rows: frozenset
    hidden_columns: list


def read_grid(archive, member, values, title):
    """Read the cells of a sheet.

    Parameters
    ----------
    archive : ZipFile
        The workbook.
    member : str
        Name of the part.
    values : Values
        Common data of the cells.
    title : str
        Title of the sheet, for messages.

    Returns
    -------
    Grid

    Raises
    ------
    Unreadable
        If the sheet is damaged or too large.
    """
    reader = _Cells(values, title)
    starts = {
        "row": reader.row,
        "c": reader.cell,
        "f": reader.formula,
        "col": reader.columns,
        "mergeCell": reader.merge,
    }
    ends = {"v": reader.value, "t": reader.inline_text, "c": reader.end_of_cell}
    parse(archive, member, starts, ends)
    rows = [(number, reader.rows[number]) for number in sorted(reader.rows)]
    return Grid(rows, reader.merged, frozenset(reader.hidden_rows), reader.hidden_columns)


@dataclass
class _Cells:
    """Handlers of the elements of a sheet, which collect its cells."""

    values: object
    title: str
    rows: dict = field(default_factory=dict)
    merged: list = field(default_factory=list)
    hidden_rows: set = field(default_factory=set)
    hidden_columns: list = field(default_factory=list)
    row_number: int = 0
    column: int = 0
    attributes: dict = field(default_factory=dict)
    content: str | None = None
    has_formula: bool = False

    def row(self, attributes):
        given = attributes.get("r")
        self.row_number = self.row_number + 1 if given is None else int(given)
        if not 0 < self.row_number <= LAST_ROW:
            raise damaged()
        self.column = 0
        if attributes.get("hidden") in _TRUE:
            self.hidden_rows.add(self.row_number)

    def cell(self, attributes):
        place = attributes.get("r")
        self.column = self.column + 1 if place is None else _column(place.rstrip("0123456789"))
        self.attributes, self.content, self.has_formula = attributes, None, False

    def formula(self, _attributes):
        self.has_formula = True

    def value(self, text):
        self.content = text

    def inline_text(self, text):
        self.content = (self.content or "") + text

    def end_of_cell(self, _text):
        is_text = self.attributes.get("t") == "str"  # an empty text may be a result
        if self.has_formula and not self.content and not (is_text and self.content == ""):
            self._keep(uncalculated())
            return
        if self.content is None:
            return
        value = self.values.of(self.attributes, self.content)
        if value is not None:
            self._keep(value)

    def _keep(self, value):
        row = self.rows.get(self.row_number)
        if row is None:
            if len(self.rows) == MAX_ROWS:
                raise Unreadable(
                    message(
                        "too_many_rows",
                        "more than {most} rows in sheet {found}; hand in a folder with CSV files",
                        most=MAX_ROWS,
                        found=shown(self.title),
                    )
                )
            row = self.rows[self.row_number] = []
        place = min(self.column, MAX_COLUMNS + 1)
        row.extend([None] * (place - len(row)))
        row[place - 1] = value

    def columns(self, attributes):
        if attributes.get("hidden") in _TRUE:
            self.hidden_columns.append((int(attributes["min"]), int(attributes["max"])))

    def merge(self, attributes):
        match = _RANGE.fullmatch(attributes.get("ref", ""))
        if match is None:
            raise damaged()
        left, top, right, bottom = match.groups()
        right, bottom = right or left, bottom or top
        self.merged.append((int(top), int(bottom), _column(left), _column(right)))


@cache
def _column(letters):
    """Number of a column from its letters: 1 for A."""
    number = 0
    for letter in letters:
        if not "A" <= letter <= "Z":
            raise damaged()
        number = 26 * number + ord(letter) - 64
    if not 0 < number <= 16_384:
        raise damaged()
    return number


def column_letters(number):
    """Letters of a column from its number: A for 1."""
    letters = ""
    while number:
        number, rest = divmod(number - 1, 26)
        letters = chr(65 + rest) + letters
    return letters
