"""Safe reading of workbooks (.xlsx) from any source, in bounded time and memory."""

import datetime
import posixpath
import re
from dataclasses import dataclass, field
from functools import cache

from tankcal.job.excel.archive import MAX_FILE_BYTES, Unreadable, damaged, open_archive, parse
from tankcal.job.tables import MAX_COLUMNS, BadCell, Percent, shown
from tankcal.messages import message

__all__ = [
    "MAX_COLUMNS",
    "MAX_FILE_BYTES",
    "Sheet",
    "Unreadable",
    "column_letters",
    "read_sheets",
]


_ESCAPED = re.compile(r"_x([0-9A-Fa-f]{4})_")
# Parts of a number format that are not placeholders.
_NOT_SHOWN = re.compile(r'"[^"]*"|\\.|\[[^\]]*\]')
_INTEGER = re.compile(r"-?[0-9]{1,15}")
DATE, DURATION, PERCENT = "date", "duration", "percent"
MAX_ROWS = 100_000  # most rows that are not blank
LAST_ROW = 1_048_576  # last row in Excel
_RANGE = re.compile(r"([A-Z]{1,3})([0-9]{1,7})(?::([A-Z]{1,3})([0-9]{1,7}))?")
_TRUE = ("1", "true")
_BOOK = "xl/workbook.xml"
_RELATIONS = "xl/_rels/workbook.xml.rels"


# ---- value of a cell, by the type and the format of the cell


def uncalculated():
    """`BadCell` for a formula without a stored result.

    Such a cell looks blank; without this mark an optional cell would count as not given.
    """
    return BadCell(
        message(
            "not_calculated",
            "a formula without its result; open the workbook in Excel or LibreOffice and save it",
        )
    )


@dataclass(frozen=True)
class Values:
    """Common data of the cells of a workbook.

    Attributes
    ----------
    strings : list of str
        Shared texts, to which cells refer by index.
    formats : list
        DATE, DURATION, PERCENT or None for each cell style.
    epoch : datetime
        First day of the calendar of dates.
    """

    strings: list
    formats: list
    epoch: datetime.datetime

    def of(self, attributes, content):
        """Value of a cell: text, number, bool, date, Percent, BadCell, or None if blank."""
        kind = attributes.get("t", "n")
        if kind == "n":
            return self._number(attributes, content) if content else None
        if kind == "s":
            index = int(content)
            return self.strings[index] if index >= 0 else None
        if kind in ("str", "inlineStr"):
            return unescaped(content) or None
        if kind == "b":
            return content.strip() in ("1", "true")
        if kind == "e":
            return BadCell(message("cell_shows", "the cell shows {found}", found=shown(content)))
        if kind == "d":
            try:
                return datetime.datetime.fromisoformat(content.removesuffix("Z"))
            except ValueError:
                return content
        raise damaged()

    def _number(self, attributes, content):
        value = int(content) if _INTEGER.fullmatch(content) else float(content)
        style = attributes.get("s")
        shown_as = None if style is None else self.formats[int(style)]
        if shown_as is None:
            return value
        if shown_as == PERCENT:
            return Percent(value)
        from openpyxl.utils.datetime import from_excel

        try:
            return from_excel(value, self.epoch, timedelta=shown_as == DURATION)
        except (OverflowError, ValueError):
            return BadCell(
                message(
                    "no_such_day",
                    "the cell shows {value:g} as a date, and there is no such day",
                    value=value,
                )
            )


def unescaped(text):
    """Text as shown by Excel; _x000D_ represents one character."""
    return _ESCAPED.sub(lambda match: chr(int(match[1], 16)), text) if "_x" in text else text


def read_strings(archive, member):
    """Shared texts of the cells, without the phonetic readings of Asian texts."""
    strings, pieces, reading = [], [], []

    def text(piece):
        if not reading:
            pieces.append(piece)

    def end_of_string(_text):
        strings.append(unescaped("".join(pieces)) or None)
        pieces.clear()

    parse(
        archive,
        member,
        {"rPh": lambda _attributes: reading.append(True)},
        {"t": text, "rPh": lambda _text: reading.pop(), "si": end_of_string},
    )
    return strings


def read_formats(archive, member):
    """DATE, DURATION, PERCENT or None for each cell style."""
    from openpyxl.styles.numbers import BUILTIN_FORMATS

    codes, numbers, inside = dict(BUILTIN_FORMATS), [], []

    def number_format(attributes):
        codes[int(attributes["numFmtId"])] = attributes["formatCode"]

    def cell_style(attributes):
        if inside:
            numbers.append(int(attributes.get("numFmtId", 0)))

    parse(
        archive,
        member,
        {
            "numFmt": number_format,
            "cellXfs": lambda _attributes: inside.append(True),
            "xf": cell_style,
        },
        {"cellXfs": lambda _text: inside.pop()},
    )
    kinds = {number: _kind(codes.get(number, "General")) for number in set(numbers)}
    return [kinds[number] for number in numbers]


def _kind(code):
    from openpyxl.styles.numbers import is_date_format, is_timedelta_format

    if is_timedelta_format(code):
        return DURATION
    if is_date_format(code):
        return DATE
    return PERCENT if "%" in _NOT_SHOWN.sub("", code) else None


# ---- cells of one sheet of a workbook


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


# ---- content of a workbook as plain cells, sheet by sheet


@dataclass(frozen=True)
class Sheet:
    """A sheet with its title; is_hidden: its tab is hidden."""

    title: str
    is_hidden: bool
    grid: Grid


def read_sheets(data, is_wanted):
    """Read the sheets of a workbook.

    Parameters
    ----------
    data : bytes
        Content of the workbook.
    is_wanted : callable
        is_wanted(title) returns False for sheets that are not parsed.

    Returns
    -------
    list of Sheet

    Raises
    ------
    Unreadable
        If the workbook cannot be read, with the reason.
    """
    archive = open_archive(data)
    try:
        return _sheets(archive, is_wanted)
    except Unreadable:
        raise
    except Exception:  # a damaged part may contain any value
        raise damaged() from None


def _sheets(archive, is_wanted):
    listed, epoch = _read_book(archive)
    parts = _read_relations(archive)
    strings = formats = ()
    for kind, member in parts.values():
        if kind == "sharedStrings":
            strings = read_strings(archive, member)
        elif kind == "styles":
            formats = read_formats(archive, member)
    values = Values(strings, formats, epoch)
    sheets = []
    for title, is_hidden, relation in listed:
        kind, member = parts[relation]
        if kind == "worksheet" and is_wanted(title):
            sheets.append(Sheet(title, is_hidden, read_grid(archive, member, values, title)))
    return sheets


def _read_book(archive):
    """([(title, is it hidden, its relation)], first day of the calendar of dates)."""
    from openpyxl.utils.datetime import CALENDAR_MAC_1904, CALENDAR_WINDOWS_1900

    listed, epochs = [], [CALENDAR_WINDOWS_1900]

    def sheet(attributes):
        relation = next(value for key, value in attributes.items() if key.endswith(":id"))
        is_hidden = attributes.get("state", "visible") != "visible"
        listed.append((attributes["name"], is_hidden, relation))

    def properties(attributes):
        if attributes.get("date1904") in ("1", "true"):
            epochs.append(CALENDAR_MAC_1904)

    parse(archive, _BOOK, {"sheet": sheet, "workbookPr": properties}, {})
    return listed, epochs[-1]


def _read_relations(archive):
    """{relation: (kind of part, its name in the archive)}."""
    parts = {}

    def relation(attributes):
        target = posixpath.normpath(posixpath.join("/xl", attributes["Target"]))
        kind = attributes["Type"].rpartition("/")[2]
        parts[attributes["Id"]] = (kind, target.lstrip("/"))

    parse(archive, _RELATIONS, {"Relationship": relation}, {})
    return parts
