"""Display of a table of a draft: headings, notes, texts and marks in the reader's language."""

from dataclasses import dataclass

from tankcal.errors import SHEET
from tankcal.job.contract import KEYS, REGISTER_KEYS, SECTIONS
from tankcal.job.starter.texts import Texts, split_unit, texts_in
from tankcal.products.desk.findings import BAD
from tankcal.products.desk.keys import READ_ONLY_SECTIONS, SETTINGS, field_of
from tankcal.products.desk.tables import text_for_display, text_for_file
from tankcal.text.words import marks_of, say

# Names of the columns in which keys are shown.
KEY_COLUMNS = OWNER, KEY, VALUE, UNIT, EXPECTED = "owner", "key", "value", "unit", "expected"
STEPS = (  # methods of a draft, and the keys of the names of their edits
    *(("restore", "restore"), ("add_table", "add_table"), ("add_column", "column")),
    *(("insert_rows", "insert"), ("remove_rows", "remove")),
)
MOST_CHOICES = 12  # largest number of choices that are translated; longer lists are codes


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

    # ---- forms, and names of edits

    def label(self, section, field):
        """Short label of a setting."""
        labels, stem = self.words["desk"]["labels"], split_unit(field.name)[0]
        named = self.words["input"]["labels"].get(stem, field.name)
        return labels.get(f"{section}.{field.name}", named)

    def help(self, name, owner, field, with_expectation=True):
        """Description of a key, with its accepted values unless the entry shows them."""
        note = self._unit_and_note(name, owner, field.name, field)[1]
        return note if with_expectation else note.partition(" · ")[0]

    def choice(self, field, code):
        """Text of a choice of a setting, in the words of the form."""
        named = self.words["kinds"] if field.name == "kind" else {}
        return named.get(code) or self.texts.choice(code)

    def marks_of_keys(self, check, name):
        """Level and text of the problem of each key, {(owner, key): (level, text)}."""
        return self._marks(check, name, lambda place: place)

    def step(self, operations):
        """Name of an edit for Undo and Redo; "" without operations."""
        if not operations:
            return ""
        counts = dict.fromkeys(("cells", "rows"), 0)
        for method, *arguments in operations:
            counts["cells"] += len(arguments[1]) if method == "set_cells" else 0
            counts["cells"] += method == "set_value"
            counts["rows"] += arguments[2] if method == "insert_rows" else 0
            counts["rows"] += len(arguments[1]) if method == "remove_rows" else 0
        methods = {method for method, *_ in operations}
        code = next((code for method, code in STEPS if method in methods), "cell")
        if code == "insert" and counts["cells"]:
            code = "paste"
        if code == "cell" and counts["cells"] > 1:
            code = "cells"
        name = operations[0][1]
        table = self.title(name) if isinstance(name, str) else ""
        count = counts["cells"] if code == "cells" else counts["rows"]
        return self.words["desk"]["steps"][code].format(table=table, count=count)

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
        marks = self.marks_in_grid(draft, check, name)
        addable = tuple(heading for heading in fields if heading not in table.headings)
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

    def marks_in_grid(self, draft, check, name, every_key=False):
        """Marks {(row, column): (level, text)} of a table or list, as in `ShownTable`."""
        if name in draft.keys:
            index = {place: row for row, place in enumerate(key_places(draft, name, every_key))}
            value = KEY_COLUMNS.index(VALUE)
            return self._marks(check, name, lambda place: self._place_of_key(index, place, value))
        columns = {heading: place for place, heading in enumerate(draft.tables[name].headings)}
        return self._marks(check, name, lambda place: (place[0], columns.get(place[1])))

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
        marks = self.marks_in_grid(draft, check, name, every_key)
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
