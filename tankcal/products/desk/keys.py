"""Editing of keys and values in job.toml and similar files, and of the sheets of job.xlsx.

The state is the text of the file. An edit changes one value in the text (tomlkit), and preserves
comments, order and spaces. A file that is no valid TOML cannot be edited here.

Workbook of a job
-----------------

Cells that were not edited keep value and format. A workbook with formulas in the sheets of the job
is read-only, because openpyxl does not save the values of formulas.
"""

import datetime
import io
import tomllib
from dataclasses import dataclass, field, replace

from tankcal.errors import sheet_named
from tankcal.job.contract import KEYS, REGISTER_KEYS, columns_of
from tankcal.job.contract.registers import FAMILIES, SHORT_KEYS
from tankcal.job.fields import Field
from tankcal.job.folder import flatten_entry
from tankcal.job.sheets import KEY, SECTION, VALUE, is_read
from tankcal.job.tables import REGISTERS, SETTINGS_SHEET, TABLES
from tankcal.products.desk.tables import AmbiguousNumber, EditedTable, Row
from tankcal.text.naming import NUMBER

SETTINGS = "job"  # name of the settings
READ_ONLY_SECTIONS = ("csv",)  # define the format of files


@dataclass(frozen=True)
class Entry:
    """Value of a key of a section, or of a camera or instrument (`owner`)."""

    owner: str
    key: str
    text: str


@dataclass(frozen=True)
class EditedKeys:
    """State of a file of keys.

    Attributes
    ----------
    name, file : str
        "job" or the name of a list, and the name of the file, such as "job.toml".
    text : str
        Text of the file.
    ambiguous : dict
        Ambiguous values that are not written, {(owner, key): text}.
    """

    name: str
    file: str
    text: str
    ambiguous: dict = field(default_factory=dict)

    decimal = "."

    @property
    def entries(self):
        """Entries of the file in its order, including values that are not written."""
        entries = [
            Entry(owner, key, self.ambiguous.get((owner, key)) or _text_of(value))
            for owner, given in self._owners(tomllib.loads(self.text))
            for key, value in given.items()
        ]
        known = {(entry.owner, entry.key) for entry in entries}
        new = [Entry(*place, text) for place, text in self.ambiguous.items() if place not in known]
        return entries + new

    def _owners(self, content):
        """Yield (owner, {key: value}); a key in a section of an entry is named section.key."""
        if self.name != SETTINGS:
            entries = content.get(self.name)
            for owner, given in (entries if isinstance(entries, dict) else {}).items():
                if isinstance(given, dict):
                    yield owner, dict(flatten_entry(given))
            return
        pending = [(name, given) for name, given in content.items() if isinstance(given, dict)]
        while pending:
            name, given = pending.pop(0)
            inner = [(key, item) for key, item in given.items() if isinstance(item, dict)]
            yield name, {key: item for key, item in given.items() if not isinstance(item, dict)}
            pending += [(f"{name}.{key}", item) for key, item in inner]

    def set_value(self, owner, key, text):
        """New state with the value of a key; a blank value of an existing key becomes ""."""
        import tomlkit

        ambiguous = {place: item for place, item in self.ambiguous.items() if place != (owner, key)}
        if isinstance(text, AmbiguousNumber):
            ambiguous[owner, key] = text
            text = ""
        document = tomlkit.parse(self.text)
        place, last = self._table_of(document, owner, key, bool(text))
        if place is not None and (text or last in place):
            new_value = toml_value(field_of(self.name, owner, key), text, place.get(last))
            old_value = place.get(last)
            if old_value != new_value or type(old_value) is not type(new_value):
                place[last] = new_value  # preserves its comment
        return replace(self, text=tomlkit.dumps(document), ambiguous=ambiguous)

    def _table_of(self, document, owner, key, is_added):
        """Table of the document that contains a key, or None, and the key in this table.

        With `is_added`, missing tables are added.
        """
        import tomlkit

        path = owner.split(".") if self.name == SETTINGS else [self.name, owner]
        first, dot, last = key.partition(".")
        if dot and self.name != SETTINGS:
            path, key = [*path, first], last
        place = document
        for depth, part in enumerate(path):
            if part not in place:
                if not is_added:
                    return None, key
                is_super = self.name != SETTINGS and depth == 0
                if depth < len(path) - 1 or is_super:
                    place[part] = tomlkit.table(is_super_table=True)
                else:
                    if document.as_string() and not document.as_string().endswith("\n\n"):
                        document.add(tomlkit.nl())
                    place[part] = tomlkit.table()
            place = place[part]
        return place, key

    def render(self):
        """Bytes of the file, and None for row numbers, as problems state owner and key."""
        return self.text.encode("utf-8"), None


def field_of(name, owner, key):
    """`Field` of a key, or None for an unknown key."""
    if name == SETTINGS:
        fields = KEYS.get(owner, ())
    else:
        fields = REGISTER_KEYS.get(name, ())
        family = FAMILIES.get(name, {}).get(key.partition(".")[0])
        if "." in key and family is not None:
            return family
        long_names = {short: long for long, short in SHORT_KEYS[name].items()}
        key = long_names.get(key, key)
    return next((field for field in fields if field.name == key), None)


def _text_of(value):
    """Text of a TOML value in one line; lists are separated by ;, pairs are low-high."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, list):
        if value and all(isinstance(item, list) for item in value):
            pairs = all(len(item) == 2 for item in value)
            return "; ".join(("-" if pairs else " ").join(map(_text_of, item)) for item in value)
        return "; ".join(map(_text_of, value))
    if isinstance(value, datetime.datetime | datetime.date | datetime.time):
        return value.isoformat()
    return str(value)


def toml_value(key_field: Field | None, text: str, before=None):
    """Convert an entered text to a TOML value.

    Parameters
    ----------
    key_field : Field or None
        Field of the key; None for an unknown key.
    text : str
        Entered text.
    before : object, optional
        Previous value; a date or a list that was a string stays a string.

    Returns
    -------
    tomlkit item
        Number, flag, date or list if the text is valid for the field, else a string.

    Examples
    --------
    >>> toml_value(Field("step_m", "number", ""), "0.010").as_string()
    '0.010'
    >>> toml_value(Field("step_m", "number", ""), "a lot")
    'a lot'
    """
    import tomlkit

    kind = key_field.kind if key_field is not None else "text"
    words = text.strip().lower()
    if kind == "flag" and words in ("true", "false"):
        return tomlkit.item(words == "true")
    if kind == "number" and NUMBER.fullmatch(text):
        return _toml_number(text)
    if kind == "date" and not isinstance(before, str):
        try:
            return tomlkit.item(datetime.date.fromisoformat(text))
        except ValueError:
            pass
    if kind in ("numbers", "ranges", "rows", "names") and isinstance(before, list):
        parts = _list_of(kind, text)
        if parts is not None:
            return tomlkit.item(parts)
    return tomlkit.item(text)


def _toml_number(text):
    """TOML number with the digits of the text."""
    import tomlkit

    try:
        return tomlkit.value(text)
    except ValueError:  # 5. and 007 are numbers, but not in TOML
        return tomlkit.item(float(text))


def _list_of(kind, text):
    """List of a text with parts separated by ;, or None if the text is no such list."""
    parts = [part.strip() for part in text.split(";")]
    if kind == "names":
        return parts
    mark = {"numbers": None, "ranges": "-", "rows": " "}[kind]
    rows = [[item] if mark is None else item.split(mark) for item in parts]
    if not all(NUMBER.fullmatch(item.strip()) for row in rows for item in row):
        return None
    rows = [[float(item) for item in row] for row in rows]
    return [row[0] for row in rows] if mark is None else rows


@dataclass(frozen=True)
class SheetOrigin:
    """Place of a table in its sheet.

    Attributes
    ----------
    title : str
        Title of the sheet.
    first_column, heading_row : int
        First column of the table, and row of its headings, from 1.
    before : int
        Number of headings in the sheet as read.
    slots : tuple of int
        Numbers of the rows of the table, which are filled again from the first.
    raws : tuple of tuple
        Values of the cells of these rows.
    kind : str
        Kind of tank, which determines the columns.
    """

    title: str
    first_column: int
    heading_row: int
    before: int
    slots: tuple[int, ...]
    raws: tuple[tuple, ...]
    kind: str

    def render(self, table):
        """Table and number of each row in the sheet, None for a new blank row.

        `write_book` writes the table into the workbook.
        """
        written = [not (row.line is None and row.is_blank) for row in table.rows]
        places = iter(self._places(sum(written)))
        return table, [next(places) if is_written else None for is_written in written]

    def _places(self, count):
        last = max((self.heading_row, *self.slots))
        more = range(last + 1, last + 1 + max(0, count - len(self.slots)))
        return [*self.slots[:count], *more]

    def write(self, table, book):
        """Write a state of the table into its sheet of an openpyxl workbook."""
        is_new = self.title not in book.sheetnames
        sheet = book.create_sheet(self.title) if is_new else book[self.title]
        _, numbers = self.render(table)
        fields = {field.name: field for field in columns_of(table.name, self.kind)}
        for place, heading in enumerate(table.headings[self.before :], self.before):
            sheet.cell(self.heading_row, self.first_column + place, heading)
        for row, number in zip(table.rows, numbers, strict=True):
            for place, text in enumerate(row.cells if number is not None else ()):
                value = cell_value(fields.get(table.headings[place]), text)
                if row.line is not None and place not in row.changed:
                    value = self.raws[row.line][place]
                _put(sheet.cell(number, self.first_column + place), value)
        for number in set(self.slots) - set(numbers):
            for place in range(len(table.headings)):
                _put(sheet.cell(number, self.first_column + place), None)


@dataclass(frozen=True)
class BookKeys:
    """Edited keys of a sheet, with the interface of `keys.EditedKeys`.

    Attributes
    ----------
    name, file, title : str
        Name of the settings or list, file in messages, and title of the sheet.
    columns : tuple of int
        Columns of owner, key and value in the sheet, from 1.
    last_row : int
        Last row of the sheet.
    rows : tuple of (Entry, int or None, bool)
        Each entry, the number of its row (None for a new entry), and whether it was changed.
    ambiguous : dict
        Ambiguous values that are not written, {(owner, key): text}.
    """

    name: str
    file: str
    title: str
    columns: tuple[int, int, int]
    last_row: int
    rows: tuple[tuple, ...]
    ambiguous: dict = field(default_factory=dict)

    decimal = "."

    @property
    def entries(self):
        """Entries of the sheet in its order."""
        return [
            replace(entry, text=self.ambiguous.get((entry.owner, entry.key)) or entry.text)
            for entry, _, _ in self.rows
        ]

    def set_value(self, owner, key, text):
        """New state with the value of a key."""
        ambiguous = {place: item for place, item in self.ambiguous.items() if place != (owner, key)}
        if isinstance(text, AmbiguousNumber):
            ambiguous[owner, key] = text
            text = ""
        existing = [(item.owner, item.key) for item, _, _ in self.rows]
        new_entry = Entry(owner, key, str(text))
        if (owner, key) in existing:
            place = existing.index((owner, key))
            row = (new_entry, self.rows[place][1], True)
            rows = (*self.rows[:place], row, *self.rows[place + 1 :])
        else:
            rows = (*self.rows, (new_entry, None, True))
        return replace(self, rows=rows, ambiguous=ambiguous)

    def write(self, book):
        """Write the changed values into the sheet of an openpyxl workbook."""
        sheet, last = book[self.title], self.last_row
        for entry, number, is_changed in self.rows:
            if not is_changed:
                continue
            if number is None:
                last = number = last + 1
                _put(sheet.cell(number, self.columns[0]), entry.owner)
                _put(sheet.cell(number, self.columns[1]), entry.key)
            key_field = field_of(self.name, entry.owner, entry.key)
            _put(sheet.cell(number, self.columns[2]), cell_value(key_field, entry.text))


def _put(cell, value):
    """Set the value of a cell unless it is unchanged."""
    if cell.value == value and type(cell.value) is type(value):
        return
    cell.value = value
    if isinstance(value, str):
        cell.data_type = "s"  # never a formula, even if it begins with =


def cell_value(key_field, text):
    """Convert an entered text to the value of a cell: number, date or text.

    Examples
    --------
    >>> from tankcal.job.fields import Field
    >>> cell_value(Field("x_m", "number", ""), "6.50"), cell_value(None, "=1+1")
    (6.5, '=1+1')
    """
    if not text or isinstance(text, AmbiguousNumber):
        return None
    kind = key_field.kind if key_field is not None else "text"
    if kind in ("number", "numbers") and NUMBER.fullmatch(text):
        return float(text)
    if kind == "date":
        try:
            return datetime.date.fromisoformat(text)
        except ValueError:
            return text
    return text


def read_book(data, kind_of):
    """Read the tables and keys of a workbook.

    Sheets that the check refuses (two of the same name, no headings) are omitted; the check reports
    the reason.

    Parameters
    ----------
    data : bytes
        Content of the workbook.
    kind_of : callable
        Function that returns the kind of tank from the BookKeys of the settings or None.

    Returns
    -------
    tables : dict of EditedTable
    keys : dict of BookKeys
    has_formula : bool
        Whether a sheet of the job contains a formula.
    """
    from openpyxl import load_workbook

    book = load_workbook(io.BytesIO(data))
    sheets = {}
    for sheet in book.worksheets:
        if is_read(sheet.title):
            sheets.setdefault(sheet.title.strip().lower(), sheet)
    has_formula = any(
        cell.data_type == "f" for sheet in sheets.values() for row in sheet for cell in row
    )
    grids = {name: _grid(sheet) for name, sheet in sheets.items()}
    keys = {}
    for name in (SETTINGS_SHEET, *REGISTERS):
        sheet_keys = _keys(name, *grids[name]) if grids.get(name) else None
        if sheet_keys is not None:
            keys[name] = sheet_keys
    kind = kind_of(keys.get(SETTINGS_SHEET))
    tables = {name: _table(name, *grids[name], kind) for name in TABLES if grids.get(name)}
    return tables, keys, has_formula


def new_sheet_table(name, headings, kind):
    """`EditedTable` of a new sheet, without rows."""
    origin = SheetOrigin(name, 1, 1, 0, (), (), kind)
    return EditedTable(name, sheet_named(name), tuple(headings), (), ".", origin)


def write_book(data, tables, keys):
    """Bytes of a workbook after writing the changed tables and keys into it."""
    from openpyxl import load_workbook

    book = load_workbook(io.BytesIO(data))
    for table in tables:
        table.origin.write(table, book)
    for sheet_keys in keys:
        sheet_keys.write(book)
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


def _grid(sheet):
    """Title, first column, rows [(number, values)] from the headings on, and last row, or None."""
    rows = [
        (number, list(values))
        for number, values in enumerate(sheet.iter_rows(values_only=True), 1)
        if any(value is not None for value in values)
        and not (isinstance(values[0], str) and values[0].lstrip().startswith("#"))
    ]
    if not rows:
        return None
    first = 1 if rows[0][1][0] not in (None, "") else 2
    rows = [(number, values[first - 1 :]) for number, values in rows]
    last = max(place for place, value in enumerate(rows[0][1]) if value is not None) + 1
    return sheet.title, first, [(number, values[:last]) for number, values in rows], sheet.max_row


def _table(name, title, first, rows, _last_row, kind):
    """`EditedTable` of a sheet."""
    number, headings = rows[0]
    headings = tuple("" if heading is None else str(heading).strip() for heading in headings)
    origin = SheetOrigin(
        title,
        first,
        number,
        len(headings),
        tuple(number for number, _ in rows[1:]),
        tuple(tuple(values) for _, values in rows[1:]),
        kind,
    )
    table_rows = tuple(Row(tuple(map(_text, values)), i) for i, (_, values) in enumerate(rows[1:]))
    return EditedTable(name, sheet_named(name), headings, table_rows, ".", origin)


def _keys(name, title, first, rows, last_row):
    """`BookKeys` of a sheet, or None if a column is missing."""
    headings = [
        name_of_column.strip() if isinstance(name_of_column, str) else name_of_column
        for name_of_column in rows[0][1]
    ]
    required = (REGISTERS.get(name, SECTION), KEY, VALUE)
    if not set(required) <= set(headings):
        return None
    places = [headings.index(name_of_column) for name_of_column in required]
    entries = []
    for number, values in rows[1:]:
        owner, key, value = (values[place] for place in places)
        if isinstance(key, str) and owner is not None:
            owner = _text(owner).strip("[] ")
            entries.append((Entry(owner, key.strip(), _text(value)), number, False))
    columns = tuple(first + place for place in places)
    return BookKeys(name, sheet_named(name), title, columns, last_row, tuple(entries))


def _text(value):
    """Text of the value of a cell; numbers have the fewest digits that preserve the value."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.15g}" if float(f"{value:.15g}") == value else repr(value)
    if isinstance(value, datetime.datetime):
        is_day = value.time() == datetime.time(0)
        return value.date().isoformat() if is_day else value.isoformat(sep=" ")
    return str(value).strip()
