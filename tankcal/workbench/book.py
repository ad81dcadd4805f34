"""A job workbook under edit: its sheets as tables and keys, written back cell by cell (openpyxl).

Cells that were not edited keep value and look. A workbook with formulas in the sheets of the job
is only looked at: what a formula gave is lost when another program than Excel writes the file.
"""

import datetime
import io
from dataclasses import dataclass, field, replace

from tankcal.errors import sheet_named
from tankcal.job.contract import columns_of
from tankcal.job.sheets import KEY, SECTION, VALUE, is_read
from tankcal.job.tables import REGISTERS, SETTINGS_SHEET, TABLES
from tankcal.text.numerals import NUMBER
from tankcal.workbench.decimals import Unwritten
from tankcal.workbench.keys import Entry, field_of
from tankcal.workbench.tables import EditedTable, Row


@dataclass(frozen=True)
class SheetOrigin:
    """Where a table stands in its sheet.

    slots  numbers of its rows, in which a state is written from the first on
    raws   what the cells of these rows hold
    """

    title: str
    first_column: int
    heading_row: int
    before: int
    slots: tuple[int, ...]
    raws: tuple[tuple, ...]
    kind: str

    def render(self, table):
        """(the table itself, number of each row): `written_book` puts it into the workbook."""
        written = [not (row.line is None and row.is_blank) for row in table.rows]
        places = iter(self._places(sum(written)))
        return table, [next(places) if is_written else None for is_written in written]

    def _places(self, count):
        last = max((self.heading_row, *self.slots))
        more = range(last + 1, last + 1 + max(0, count - len(self.slots)))
        return [*self.slots[:count], *more]

    def write(self, table, book):
        """Write a state into its sheet of an openpyxl workbook."""
        is_new = self.title not in book.sheetnames
        sheet = book.create_sheet(self.title) if is_new else book[self.title]
        _, numbers = self.render(table)
        fields = {one.name: one for one in columns_of(table.name, self.kind)}
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
    """Keys of a sheet under edit; the same as `keys.EditedKeys` of a file.

    rows  (Entry, number of its row in the sheet, None of a new one, is it changed)
    columns  of owner, key and value in the sheet
    """

    name: str
    file: str
    title: str
    columns: tuple[int, int, int]
    last_row: int
    rows: tuple[tuple, ...]
    unwritten: dict = field(default_factory=dict)

    decimal = "."

    @property
    def entries(self):
        """The Entries of the sheet, in its order."""
        return [
            replace(one, text=self.unwritten.get((one.owner, one.key)) or one.text)
            for one, _, _ in self.rows
        ]

    def set_value(self, owner, key, text):
        """The state after one value."""
        waiting = {place: one for place, one in self.unwritten.items() if place != (owner, key)}
        if isinstance(text, Unwritten):
            waiting[owner, key] = text
            text = ""
        known = [(one.owner, one.key) for one, _, _ in self.rows]
        made = Entry(owner, key, str(text))
        if (owner, key) in known:
            place = known.index((owner, key))
            row = (made, self.rows[place][1], True)
            rows = (*self.rows[:place], row, *self.rows[place + 1 :])
        else:
            rows = (*self.rows, (made, None, True))
        return replace(self, rows=rows, unwritten=waiting)

    def write(self, book):
        """Write what changed into its sheet of an openpyxl workbook."""
        sheet, new = book[self.title], self.last_row
        for entry, number, is_changed in self.rows:
            if not is_changed:
                continue
            if number is None:
                new = number = new + 1
                _put(sheet.cell(number, self.columns[0]), entry.owner)
                _put(sheet.cell(number, self.columns[1]), entry.key)
            of = field_of(self.name, entry.owner, entry.key)
            _put(sheet.cell(number, self.columns[2]), cell_value(of, entry.text))


def _put(cell, value):
    if cell.value == value and type(cell.value) is type(value):
        return
    cell.value = value
    if isinstance(value, str):
        cell.data_type = "s"  # never a formula, whatever it begins with


def cell_value(of, text):
    """A typed text as a cell holds it: a number or a day where it is one.

    Examples
    --------
    >>> from tankcal.job.fields import Field
    >>> cell_value(Field("x_m", "number", ""), "6.50"), cell_value(None, "=1+1")
    (6.5, '=1+1')
    """
    if not text or isinstance(text, Unwritten):
        return None
    kind = of.kind if of is not None else "text"
    if kind in ("number", "numbers") and NUMBER.fullmatch(text):
        return float(text)
    if kind == "date":
        try:
            return datetime.date.fromisoformat(text)
        except ValueError:
            return text
    return text


def read_book(data, kind_of):
    """(tables, keys, whether a sheet of the job has a formula) of the bytes of a workbook.

    kind_of  gives the kind of tank of the BookKeys of the settings, or None
    Sheets that the check refuses (two of a name, no headings) are left out: it says why.
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
        made = _keys(name, *grids[name]) if grids.get(name) else None
        if made is not None:
            keys[name] = made
    kind = kind_of(keys.get(SETTINGS_SHEET))
    tables = {name: _table(name, *grids[name], kind) for name in TABLES if grids.get(name)}
    return tables, keys, has_formula


def new_sheet_table(name, headings, kind):
    """EditedTable of a sheet that is not there yet, without rows."""
    origin = SheetOrigin(name, 1, 1, 0, (), (), kind)
    return EditedTable(name, sheet_named(name), tuple(headings), (), ".", origin)


def written_book(data, tables, keys):
    """The bytes of a workbook after the states that differ from what it holds."""
    from openpyxl import load_workbook

    book = load_workbook(io.BytesIO(data))
    for table in tables:
        table.origin.write(table, book)
    for one in keys:
        one.write(book)
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


def _grid(sheet):
    """(title, first column, [(number, values)] with the headings first, last row), or None."""
    rows = [
        (number, list(values))
        for number, values in enumerate(sheet.iter_rows(values_only=True), 1)
        if any(one is not None for one in values)
        and not (isinstance(values[0], str) and values[0].lstrip().startswith("#"))
    ]
    if not rows:
        return None
    first = 1 if rows[0][1][0] not in (None, "") else 2
    rows = [(number, values[first - 1 :]) for number, values in rows]
    last = max(place for place, one in enumerate(rows[0][1]) if one is not None) + 1
    return sheet.title, first, [(number, values[:last]) for number, values in rows], sheet.max_row


def _table(name, title, first, rows, _last_row, kind):
    number, headings = rows[0]
    headings = tuple("" if one is None else str(one).strip() for one in headings)
    origin = SheetOrigin(
        title,
        first,
        number,
        len(headings),
        tuple(number for number, _ in rows[1:]),
        tuple(tuple(values) for _, values in rows[1:]),
        kind,
    )
    made = tuple(Row(tuple(map(_text, values)), i) for i, (_, values) in enumerate(rows[1:]))
    return EditedTable(name, sheet_named(name), headings, made, ".", origin)


def _keys(name, title, first, rows, last_row):
    headings = [one.strip() if isinstance(one, str) else one for one in rows[0][1]]
    needed = (REGISTERS.get(name, SECTION), KEY, VALUE)
    if not set(needed) <= set(headings):
        return None
    places = [headings.index(one) for one in needed]
    entries = []
    for number, values in rows[1:]:
        owner, key, value = (values[place] for place in places)
        if isinstance(key, str) and owner is not None:
            owner = _text(owner).strip("[] ")
            entries.append((Entry(owner, key.strip(), _text(value)), number, False))
    columns = tuple(first + place for place in places)
    return BookKeys(name, sheet_named(name), title, columns, last_row, tuple(entries))


def _text(value):
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
