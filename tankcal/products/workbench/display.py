"""Display of a table of a draft: headings, notes, texts and marks in the reader's language."""

from dataclasses import dataclass
from html import escape

from tankcal.errors import SHEET
from tankcal.job.contract import KEYS, REGISTER_KEYS, SECTIONS
from tankcal.job.starter.texts import Texts, split_unit, texts_in
from tankcal.products.workbench.findings import BAD, DOUBTFUL
from tankcal.products.workbench.keys import READ_ONLY_SECTIONS, SETTINGS, field_of
from tankcal.products.workbench.tables import text_for_display, text_for_file
from tankcal.text.words import marks_of, say

# Names of the columns in which keys are shown.
OWNER, KEY, VALUE, UNIT, EXPECTED = "owner", "key", "value", "unit", "expected"
MOST_CHOICES = 12  # largest number of choices that are translated; longer lists are codes
MOST_ROWS = 400  # largest number of rows of a page; the middle of a longer table is omitted
STYLE = """<style>
.tankcal-plain { border-collapse: collapse; font-size: 13px; }
.tankcal-plain th, .tankcal-plain td { border: 1px solid #bbb; padding: 2px 6px; text-align: left; }
.tankcal-plain th small { display: block; font-weight: normal; }
.tankcal-plain td.number { text-align: right; font-variant-numeric: tabular-nums; }
.tankcal-plain .bad { background: #f7c6c5; color: #5c0a09; }
.tankcal-plain .doubtful { background: #fbe6b4; color: #4d3800; }
.tankcal-plain td.bad small, .tankcal-plain td.doubtful small, .tankcal-plain .reason {
  display: block; white-space: pre-line; }
ul.tankcal-list { padding-left: 1.2em; }
ul.tankcal-list li.bad { color: #8c1d18; } ul.tankcal-list li.doubtful { color: #6b4e00; }
</style>"""


@dataclass(frozen=True)
class ShownColumn:
    """A shown column: name in the file, heading, unit, and a note on the expected values."""

    name: str
    heading: str
    unit: str = ""
    note: str = ""
    is_edited: bool = True
    is_number: bool = False


@dataclass(frozen=True)
class ShownTable:
    """Content of a grid or a page for a table.

    Attributes
    ----------
    name, file, title, note : str
        Name of the table, its file, its title and its description.
    columns : tuple of ShownColumn
        Columns.
    rows : list of list of str
        Texts of the cells.
    marks : dict
        Problems and warnings, {(row, column): (BAD or DOUBTFUL, text)}, with row and column counted
        from 0. None denotes the whole row, column or table.
    addable : tuple of str
        Columns that can be added.
    takes_rows : bool
        Whether rows can be inserted and removed.
    """

    name: str
    file: str
    title: str
    note: str
    columns: tuple[ShownColumn, ...]
    rows: list[list[str]]
    marks: dict
    addable: tuple[str, ...] = ()
    takes_rows: bool = False


class Reader:
    """Display and entry of tables in a language.

    Parameters
    ----------
    language : str
        Code of the language, such as "pt-BR".
    """

    def __init__(self, language):
        self.language = language
        self.texts: Texts = texts_in(language)
        self.words = self.texts.words
        self.mark = marks_of(self.words).decimal

    def word(self, code, **values):
        """Text of the group [workbench] of the words."""
        return self.words["workbench"][code].format(**values)

    def say(self, text):
        """Text of a message in the language, in a single line."""
        return say(self.words, text)

    def title(self, name):
        """Title of a table, the settings or a list."""
        return self.words["input"]["titles"].get(name, name)

    def note(self, name):
        """Description of a table or a list."""
        notes = self.texts.notes
        note = notes["tables"].get(name) or notes["registers"].get(name)
        return note or self.word("settings_note")

    # ---- showing

    def show(self, draft, check, name, every_key=False):
        """Build the `ShownTable` of a table, of the settings or of a list.

        Parameters
        ----------
        draft : Draft
            Edited files of the job.
        check : Check
            Check of the job.
        name : str
            Name of the table or list, or "job".
        every_key : bool
            Whether to show all keys, not only given and required keys.

        Returns
        -------
        ShownTable
        """
        if name in draft.keys:
            return self._show_keys(draft, check, name, every_key)
        return self._show_table(draft, check, name)

    def _show_table(self, draft, check, name):
        """`ShownTable` of a table."""
        table, fields = draft.tables[name], draft.fields(name)
        columns = tuple(
            self._column(name, heading, fields.get(heading)) for heading in table.headings
        )
        kinds = [fields.get(heading) for heading in table.headings]
        rows = [
            [
                text_for_display(field, text, table.decimal, self.mark)
                for field, text in zip(kinds, row.cells, strict=True)
            ]
            for row in table.rows
        ]
        places = {heading: place for place, heading in enumerate(table.headings)}
        marks = self._marks(check, name, lambda place: (place[0], places.get(place[1])))
        addable = tuple(heading for heading in fields if heading not in places)
        return ShownTable(
            name,
            _plain_file(table.file),
            self.title(name),
            self.note(name),
            columns,
            rows,
            marks,
            addable,
            True,
        )

    def _column(self, name, heading, field):
        """`ShownColumn` of a column of a table."""
        if field is None:
            return ShownColumn(heading, heading or "?")
        note = self.texts.notes["columns"].get(f"{name}.{field.name}", field.note)
        expected = self._expectation(field)
        label = self.words["input"]["labels"].get(split_unit(field.name)[0], field.name)
        unit = split_unit(field.name)[1]
        return ShownColumn(
            heading, label, unit, f"{note} · {expected}", True, field.kind == "number"
        )

    def _expectation(self, field):
        """Text of the expected values of a field."""
        if len(field.choices) > MOST_CHOICES:  # codes, such as the inputs of uncertainty
            return ", ".join(field.choices)
        if field.kind == "choice" or (field.choices and field.kind != "number"):
            return ", ".join(self.texts.choice(choice) for choice in field.choices)
        return self.say(field.expectation())

    def _show_keys(self, draft, check, name, every_key):
        """`ShownTable` of the settings or of a list."""
        places = key_places(draft, name, every_key)
        texts = {(entry.owner, entry.key): entry.text for entry in draft.keys[name].entries}
        rows = []
        for owner, key in places:
            field = field_of(name, owner, key)
            shown = text_for_display(field, texts.get((owner, key), ""), ".", self.mark)
            rows.append([owner, key, shown, *self._unit_and_note(name, owner, key, field)])
        index = {place: number for number, place in enumerate(places)}
        value = 2
        marks = self._marks(check, name, lambda place: self._place_of_key(index, place, value))
        columns = (
            ShownColumn(OWNER, self.word("owner" if name == SETTINGS else "name"), "", "", False),
            ShownColumn(KEY, self.word("key"), "", "", False),
            ShownColumn(VALUE, self.word("value")),
            ShownColumn(UNIT, self.word("unit"), "", "", False),
            ShownColumn(EXPECTED, self.word("expected"), "", "", False),
        )
        file = _plain_file(draft.keys[name].file)
        title, note = self.title(name), self.note(name)
        return ShownTable(name, file, title, note, columns, rows, marks)

    @staticmethod
    def _place_of_key(index, place, value):
        """Row and column in which a problem of (owner, key) is shown."""
        owner, key = place
        if key is None:
            first = next((row for (name, _), row in index.items() if name == owner), None)
            return first, None
        return index.get(place), value

    def _unit_and_note(self, name, owner, key, field):
        """Unit of a key, and its description with the expected values."""
        if owner in READ_ONLY_SECTIONS:
            return "", self.word("in_file")
        if field is None:
            return "", self.word("own_field")
        group, place = "keys", f"{owner}.{field.name}"
        if name != SETTINGS:
            group, place = "entries", f"{name}.{field.name}"
        note = self.texts.notes[group].get(place, field.note)
        return split_unit(field.name)[1], f"{note} · {self._expectation(field)}"

    def _marks(self, check, name, find_place):
        """Marks {(row, column): (level, text)}; several marks of a cell share the worst level.

        `find_place` converts a place of the check to a place of the grid. The name of the column
        is added to a problem whose cell is not shown.
        """
        texts = {}
        for place, marks in check.marks.get(name, {}).items():
            place_in_grid = find_place(place)
            is_bad = any(mark.level == BAD for mark in marks)
            text = "\n".join(
                f"{mark.problem.column}: {self.say(mark.problem.expected)}"
                if mark.problem.column and place_in_grid == (None, None)
                else self.say(mark.problem.expected)
                for mark in marks
            )
            level = BAD if is_bad else marks[0].level
            known = texts.get(place_in_grid)
            if known is not None:
                level = BAD if BAD in (level, known[0]) else level
                text = f"{known[1]}\n{text}"
            texts[place_in_grid] = level, text
        return texts

    # ---- entry

    def enter(self, draft, name, changes, every_key=False):
        """Enter texts in a table.

        Parameters
        ----------
        draft : Draft
            Edited files of the job.
        name : str
            Name of the table or list, or "job".
        changes : list of (int, str, str)
            Row from 0, name of the column and entered text.
        every_key : bool
            Whether all keys are shown, which determines the rows of keys.
        """
        if name in draft.keys:
            places = key_places(draft, name, every_key)
            for row, column, text in changes:
                if column == VALUE and 0 <= row < len(places):
                    owner, key = places[row]
                    field = field_of(name, owner, key)
                    draft.set_value(name, owner, key, text_for_file(field, text, ".", self.mark))
            return
        fields, decimal = draft.fields(name), draft.tables[name].decimal
        draft.set_cells(
            name,
            [
                (row, column, text_for_file(fields.get(column), text, decimal, self.mark))
                for row, column, text in changes
            ],
        )

    def line(self, problem):
        """Text of a problem or a warning in a single line."""
        return self.say(problem.text)


def key_places(draft, name, every_key=False):
    """Owner and key of each shown row of the settings or of a list.

    Shown are keys in the file and required keys; with `every_key`, all keys for the kind of tank.
    """
    given = [(item.owner, item.key) for item in draft.keys[name].entries]
    known = set(given)
    if name != SETTINGS:
        owners = dict.fromkeys(owner for owner, _ in given)
        fields = {owner: REGISTER_KEYS[name] for owner in owners}
    else:
        fields = {
            section: KEYS[section] for section in SECTIONS if section not in READ_ONLY_SECTIONS
        }
    kind = draft.kind if name == SETTINGS else None
    places = []
    for owner, owner_fields in fields.items():
        places += [
            (owner, item.name)
            for item in owner_fields
            if (owner, item.name) in known
            or (item.suits(kind) and (every_key or (kind is not None and item.is_required(kind))))
        ]
        owner_places = [place for place in given if place[0] == owner]
        places += [place for place in owner_places if place not in set(places)]
    seen = set(places)
    return places + [place for place in given if place not in seen]


def _plain_file(file):
    """Name of a file, or of a sheet without its prefix."""
    return str(file).removeprefix(SHEET)


# ---- tables, lists and results as plain HTML, with the texts and colours of the widgets


def table_page(shown, left_out):
    """HTML of a ShownTable, with the problem in each marked cell.

    `left_out(count)` returns the text of the row that replaces omitted rows.
    """
    head = "".join(
        f"<th{_class_of(shown.marks, None, place)}>{escape(column.heading)}"
        f"<small>{escape(column.name if shown.takes_rows else column.unit)}</small>"
        f"{_reason(shown.marks, None, place)}</th>"
        for place, column in enumerate(shown.columns)
    )
    half = MOST_ROWS // 2
    cut = len(shown.rows) > MOST_ROWS
    marked = {row for row, _ in shown.marks if row is not None}
    body = []
    for row in range(len(shown.rows)):
        if not cut or row < half or row >= len(shown.rows) - half or row in marked:
            body.append(_row(shown, row))
        elif row == half:
            gone = len(shown.rows) - 2 * half
            span = len(shown.columns) + 1
            body.append(f'<tr><td colspan="{span}">{escape(left_out(gone))}</td></tr>')
    reason = _reason(shown.marks, None, None)
    level = shown.marks.get((None, None), ("",))[0]
    above = (
        f'<div class="tankcal-plain"><div class="{level}">{reason}</div></div>' if reason else ""
    )
    return (
        f'{STYLE}{above}<table class="tankcal-plain"><thead><tr><th>#</th>{head}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table>"
    )


def _row(shown, row):
    """HTML of a row."""
    cells = "".join(
        f"<td{_class_of(shown.marks, row, place, 'number' if column.is_number else '')}>"
        f"{escape(text)}{_reason(shown.marks, row, place)}</td>"
        for place, (column, text) in enumerate(zip(shown.columns, shown.rows[row], strict=True))
    )
    whole = f"{row + 1}{_reason(shown.marks, row, None)}"
    return f"<tr><th{_class_of(shown.marks, row, None)}>{whole}</th>{cells}</tr>"


def _class_of(marks, row, column, also=""):
    """HTML attribute with the classes of a cell."""
    level = marks.get((row, column), ("",))[0]
    names = " ".join(name for name in (also, level) if name)
    return f' class="{names}"' if names else ""


def _reason(marks, row, column):
    """HTML of the problem of a cell, or ""."""
    mark = marks.get((row, column))
    return f'<small class="reason">{escape(mark[1])}</small>' if mark else ""


def list_page(lines, nothing):
    """HTML of a list [(level, text)], or the text `nothing` if the list is empty."""
    if not lines:
        return f"{STYLE}<p>{escape(nothing)}</p>"
    items = "".join(f'<li class="{level}">{escape(text)}</li>' for level, text in lines)
    return f'{STYLE}<ul class="tankcal-list">{items}</ul>'


def text_page(text):
    """HTML of a text with a paragraph for each line."""
    return "".join(f"<p>{escape(line)}</p>" for line in text.splitlines())


# ---- results of the last computation


def warnings_page(desk):
    """HTML of warnings of the last computation that the check did not give, or ""."""
    result = desk.last_run.result
    known = {warning.text for warning in result.job.warnings}
    warnings = [warning for warning in result.warnings if warning.text not in known]
    if not warnings:
        return ""
    return list_page([(DOUBTFUL, desk.reader.line(warning)) for warning in warnings], "")


def results_page(desk):
    """HTML of the last computation, without buttons, below the list of written files."""
    from tankcal.products.workbench.views.page import SavedView
    from tankcal.record import record_of
    from tankcal.report.paper import Paper

    paper = Paper(record_of(desk.last_run.result), language=desk.reader.language)
    names = ", ".join(path.name for path in desk.last_run.files)
    written = desk.reader.word("written", folder=str(desk.out.resolve()), files=names)
    above = f"<p>{escape(written)}</p>{warnings_page(desk)}"
    return f"{above}{SavedView(paper)._repr_html_()}"
