"""Editing of a job workbook: its sheets as tables and keys, written cell by cell (openpyxl).

Cells that were not edited keep value and format. A workbook with formulas in the sheets of the job
is read-only, because openpyxl does not save the values of formulas.
"""

import datetime
import io
from dataclasses import dataclass, field, replace

from tankcal.errors import sheet_named
from tankcal.job.contract import columns_of
from tankcal.job.sheets import KEY, SECTION, VALUE, is_read
from tankcal.job.tables import REGISTERS, SETTINGS_SHEET, TABLES
from tankcal.text.numerals import NUMBER
from tankcal.workbench.keys import Entry, field_of
from tankcal.workbench.tables import AmbiguousNumber, EditedTable, Row


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
