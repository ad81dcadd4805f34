"""Safe reading of workbooks (.xlsx) from any source, in bounded time and memory.

Archive of a workbook: checked before any part is parsed.

Refused are passwords, macros, links to other files, embedded files, entity declarations, and
archives whose unpacked size is out of proportion.
"""

import datetime
import io
import posixpath
import re
import zipfile
from dataclasses import dataclass, field
from functools import cache
from xml.parsers import expat

from tankcal.job.tables import MAX_COLUMNS, BadCell, Percent, shown
from tankcal.messages import message

MAX_FILE_BYTES = 50_000_000  # largest workbook
MAX_UNPACKED_BYTES = 100_000_000  # largest sum of all parts
MAX_MEMBERS = 5000  # largest number of parts
MAX_RATIO, RATIO_FROM_BYTES = 300, 10_000_000  # largest unpacked over packed size, above a size
MAX_TAGS = 2_500_000  # most start and end tags of all parts; a cell with a value has four
CHUNK_BYTES = 1_000_000  # size of the pieces in which a part is read
_BLANK_CELL = re.compile(rb"<c r=[^<>]*(?:/>|></c>)")
_BLANK_ROW = re.compile(rb"<row r=[^<>]*(?:/>|>\s*</row>)")
_OLE = b"\xd0\xcf\x11\xe0"
_NOT_A_WORKBOOK = message("not_a_workbook", "not an Excel workbook (.xlsx)")
_SAVE_AGAIN = message("save_again", "open it in Excel or LibreOffice and save it as .xlsx")
_DAMAGED = message("damaged_workbook", "damaged: open it in Excel or LibreOffice and save it again")
_HUGE = message(
    "delete_formatted_rows",
    "delete the empty rows and columns that are formatted below and beside the data, or hand in "
    "a folder with CSV files",
)
_MACROS = message("holds_macros", "holds macros; save it as .xlsx (a workbook without macros)")
_LINKS = message(
    "holds_links",
    "holds links to other workbooks; put values in place of those formulas (in Excel: Data, Edit "
    "Links, Break Link) and save it again",
)
_CONNECTIONS = message(
    "holds_connections", "holds connections to data elsewhere; remove them and save it again"
)
# {beginning of the name of a part, in lower case: reason to refuse the workbook}
_REFUSED_PARTS = {
    "xl/vbaproject": _MACROS,
    "xl/macrosheets/": _MACROS,
    "xl/externallinks/": _LINKS,
    "xl/connections": _CONNECTIONS,
    "xl/querytables/": _CONNECTIONS,
    "xl/embeddings/": message(
        "holds_embedded_files", "holds embedded files; remove them and save it again"
    ),
    "xl/activex/": message(
        "holds_controls", "holds controls (ActiveX); remove them and save it again"
    ),
    "xl/workbook.bin": message(
        "is_xlsb", "a binary workbook (.xlsb); {save_again}", save_again=_SAVE_AGAIN
    ),
}
MAX_PIECES = 20  # most pieces of the text of one element
PIECE_CHARACTERS = 65_536  # longest piece of text, characters


class Unreadable(Exception):
    """The workbook cannot be read; the text states the reason and the remedy."""


def damaged():
    """`Unreadable` for an incomplete workbook."""
    return Unreadable(_DAMAGED)


def open_archive(data):
    """Open the content of a workbook as a ZipFile; raises Unreadable if it is refused."""
    if data.startswith(_OLE):
        raise Unreadable(
            message(
                "is_old_xls",
                "an old .xls or a workbook with a password; save it as .xlsx without password",
            )
        )
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
        _refuse_directory(archive.infolist(), len(data))
        _refuse_kind(archive)
        _refuse_content(archive)
    except Unreadable:
        raise
    except Exception:  # zipfile and zlib raise many types for damaged parts
        raise Unreadable(
            message(
                "not_a_workbook_or_damaged",
                "{not_a_workbook}, or damaged",
                not_a_workbook=_NOT_A_WORKBOOK,
            )
        ) from None
    return archive


def chunks(archive, member):
    """Yield the content of a part in pieces, at most the size in its directory entry."""
    with archive.open(member) as stream:
        while chunk := stream.read(CHUNK_BYTES):
            yield chunk


def without_blanks(chunk):
    """Remove cells without content, and rows of such cells, from XML.

    A sheet that is formatted down to its last row contains millions of them.
    """
    return _BLANK_ROW.sub(b"", _BLANK_CELL.sub(b"", chunk))


def _refuse_directory(members, packed_bytes):
    unpacked = sum(member.file_size for member in members)
    if len(members) > MAX_MEMBERS:
        raise Unreadable(
            message(
                "too_many_parts",
                "{count} parts inside, expected at most {most}",
                count=len(members),
                most=MAX_MEMBERS,
            )
        )
    if unpacked > MAX_UNPACKED_BYTES:
        raise Unreadable(
            message(
                "unpacks_too_large",
                "unpacks to {unpacked:.0f} MB, expected at most {most:.0f} MB: {huge}",
                unpacked=unpacked / 1e6,
                most=MAX_UNPACKED_BYTES / 1e6,
                huge=_HUGE,
            )
        )
    if unpacked > RATIO_FROM_BYTES and unpacked > MAX_RATIO * packed_bytes:
        raise Unreadable(
            message(
                "unpacks_too_often",
                "unpacks to more than {most} times its size, which no workbook of a job does",
                most=MAX_RATIO,
            )
        )
    usual = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
    if any(member.flag_bits & 1 or member.compress_type not in usual for member in members):
        raise Unreadable(
            message(
                "packed_unusually", "packed in an unusual way; {save_again}", save_again=_SAVE_AGAIN
            )
        )
    if len({member.filename for member in members}) < len(members):
        raise Unreadable(
            message(
                "same_part_twice", "holds the same part twice; {save_again}", save_again=_SAVE_AGAIN
            )
        )


def _refuse_kind(archive):
    names = archive.namelist()
    if "mimetype" in names and b"opendocument" in archive.read("mimetype")[:100]:
        raise Unreadable(
            message("is_ods", "an OpenDocument file (.ods); {save_again}", save_again=_SAVE_AGAIN)
        )
    for name in names:
        for beginning, reason in _REFUSED_PARTS.items():
            if name.lower().startswith(beginning):
                raise Unreadable(reason)
    if "xl/workbook.xml" not in names:
        raise Unreadable(_NOT_A_WORKBOOK)


def _refuse_content(archive):
    tags = 0
    for member in archive.infolist():
        if not member.filename.lower().endswith((".xml", ".rels", ".vml")):
            continue
        before = b""
        for chunk in chunks(archive, member):
            if not before and _is_disguised(chunk):
                raise _foreign_declarations()
            # A declaration may begin in one piece and end in the next.
            joined = before[-16:] + chunk
            if b"<!DOCTYPE" in joined or b"<!ENTITY" in joined or b"\0" in chunk:
                raise _foreign_declarations()
            if len(chunk) == CHUNK_BYTES and b">" not in chunk:
                raise Unreadable(
                    message(
                        "text_too_long",
                        "holds a text of more than a million characters; {save_again}",
                        save_again=_SAVE_AGAIN,
                    )
                )
            tags += without_blanks(chunk).count(b"<")
            if tags > MAX_TAGS:
                raise Unreadable(
                    message(
                        "too_many_cells_in_workbook",
                        "holds more cells than a job needs: {huge}",
                        huge=_HUGE,
                    )
                )
            before = chunk


def _foreign_declarations():
    return Unreadable(
        message(
            "xml_declarations",
            "holds XML declarations that no workbook needs (DOCTYPE, ENTITY, encoding)",
        )
    )


def _is_disguised(start):
    """Return True if the XML has an encoding that would hide a DOCTYPE."""
    encoding = re.match(rb"\s*(?:\xef\xbb\xbf)?<\?xml[^>]*?encoding\s*=\s*[\"']([^\"']*)", start)
    usual = (b"utf-8", b"us-ascii", b"ascii", b"iso-8859-1", b"windows-1252")
    return encoding is not None and encoding[1].lower() not in usual


# ---- XML of one part, read element by element; only the requested elements are kept


def parse(archive, member, starts, ends):
    """Read a part from beginning to end.

    Names are without their prefix. Blank cells and rows are skipped.

    Parameters
    ----------
    archive : ZipFile
        The workbook.
    member : str
        Name of the part.
    starts : dict of {str: callable}
        {element: function(attributes)}, called at the start of an element.
    ends : dict of {str: callable}
        {element: function(text)}, called at its end with the text after its last child.

    Raises
    ------
    Unreadable
        For a declaration or a text that is too long.
    ExpatError
        For invalid XML.
    """
    parser = expat.ParserCreate()
    parser.buffer_text, parser.buffer_size = True, PIECE_CHARACTERS
    part = _Part(starts, ends)
    parser.StartElementHandler = part.root
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = _refuse
    part.parser = parser
    for chunk in chunks(archive, member):
        parser.Parse(without_blanks(chunk), False)
    parser.Parse(b"", True)


def _refuse(*_declaration):
    raise damaged()


class _Part:
    """Handlers of one part; the prefix of the root element is removed from all names."""

    def __init__(self, starts, ends):
        self.starts, self.ends = starts, ends
        self.pieces = []
        self.parser = None

    def root(self, name, attributes):
        prefix = name[: name.find(":") + 1]
        self.starts = {prefix + local: call for local, call in self.starts.items()}
        self.ends = {prefix + local: call for local, call in self.ends.items()}
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.text
        self.start(name, attributes)

    def start(self, name, attributes):
        if self.pieces:
            self.pieces.clear()
        call = self.starts.get(name)
        if call is not None:
            call(attributes)

    def end(self, name):
        call = self.ends.get(name)
        if call is not None:
            call("".join(self.pieces))
        if self.pieces:
            self.pieces.clear()

    def text(self, piece):
        self.pieces.append(piece)
        if len(self.pieces) > MAX_PIECES:
            raise damaged()


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
