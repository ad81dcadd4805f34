"""A table of a draft as it is shown: headings, notes, texts and marks in the reader's language."""

from dataclasses import dataclass

from tankcal.errors import SHEET
from tankcal.job.contract import KEYS, REGISTER_KEYS, SECTIONS
from tankcal.job.starter.texts import Texts, parted, texts_in
from tankcal.text.words import marks_of, say
from tankcal.workbench.decimals import entered_text, shown_text
from tankcal.workbench.findings import BAD
from tankcal.workbench.keys import NOT_HERE, SETTINGS, field_of

OWNER, KEY, VALUE, UNIT, EXPECTED = "owner", "key", "value", "unit", "expected"
MOST_CHOICES = 12  # that are said in words


@dataclass(frozen=True)
class ShownColumn:
    """A column: its name in the file, heading and unit, and what it takes, in words."""

    name: str
    heading: str
    unit: str = ""
    note: str = ""
    is_edited: bool = True
    is_number: bool = False


@dataclass(frozen=True)
class ShownTable:
    """What a grid or a page shows of a table.

    Attributes
    ----------
    name, file, title, note : str
    columns : tuple of ShownColumn
    rows : list of list of str
    marks : dict
        {(row, column): (BAD or DOUBTFUL, text)}, both counted from 0; None: the whole row, column
        or table.
    addable : tuple of str
        Columns that the table may have and has not.
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
    """How tables are shown to a reader of a language, and what he types is understood.

    Parameters
    ----------
    language : str
    """

    def __init__(self, language):
        self.language = language
        self.texts: Texts = texts_in(language)
        self.words = self.texts.words
        self.mark = marks_of(self.words).decimal

    def word(self, code, **values):
        """A text of the group [workbench]."""
        return self.words["workbench"][code].format(**values)

    def say(self, text):
        """A message in the language, in one line."""
        return say(self.words, text)

    def title(self, name):
        """What a table, the settings or a list is called."""
        return self.words["input"]["titles"].get(name, name)

    def note(self, name):
        """What a table or a list is for."""
        notes = self.texts.notes
        found = notes["tables"].get(name) or notes["registers"].get(name)
        return found or self.word("settings_note")

    # ---- showing

    def show(self, draft, check, name, every_key=False):
        """The ShownTable of a table, of the settings or of a list."""
        if name in draft.keys:
            return self._show_keys(draft, check, name, every_key)
        return self._show_table(draft, check, name)

    def _show_table(self, draft, check, name):
        table, fields = draft.tables[name], draft.fields(name)
        columns = tuple(self._column(name, one, fields.get(one)) for one in table.headings)
        kinds = [fields.get(one) for one in table.headings]
        rows = [
            [
                shown_text(field, text, table.decimal, self.mark)
                for field, text in zip(kinds, row.cells, strict=True)
            ]
            for row in table.rows
        ]
        places = {one: place for place, one in enumerate(table.headings)}
        marks = self._marks(check, name, lambda place: (place[0], places.get(place[1])))
        addable = tuple(one for one in fields if one not in places)
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
        if field is None:
            return ShownColumn(heading, heading or "?")
        note = self.texts.notes["columns"].get(f"{name}.{field.name}", field.note)
        expected = self._expectation(field)
        label = self.words["input"]["labels"].get(parted(field.name)[0], field.name)
        unit = parted(field.name)[1]
        return ShownColumn(
            heading, label, unit, f"{note} · {expected}", True, field.kind == "number"
        )

    def _expectation(self, field):
        if len(field.choices) > MOST_CHOICES:  # codes, such as the inputs of uncertainty
            return ", ".join(field.choices)
        if field.kind == "choice" or (field.choices and field.kind != "number"):
            return ", ".join(self.texts.choice(one) for one in field.choices)
        return self.say(field.expectation())

    def _show_keys(self, draft, check, name, every_key):
        places = key_places(draft, name, every_key)
        texts = {(one.owner, one.key): one.text for one in draft.keys[name].entries}
        rows = []
        for owner, key in places:
            field = field_of(name, owner, key)
            shown = shown_text(field, texts.get((owner, key), ""), ".", self.mark)
            rows.append([owner, key, shown, *self._told(name, owner, key, field)])
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
        owner, key = place
        if key is None:
            first = next((row for (one, _), row in index.items() if one == owner), None)
            return first, None
        return index.get(place), value

    def _told(self, name, owner, key, field):
        """Unit of a key, and what it is and takes."""
        if owner in NOT_HERE:
            return "", self.word("in_file")
        if field is None:
            return "", self.word("own_field")
        group, place = "keys", f"{owner}.{field.name}"
        if name != SETTINGS:
            group, place = "entries", f"{name}.{field.name}"
        note = self.texts.notes[group].get(place, field.note)
        return parted(field.name)[1], f"{note} · {self._expectation(field)}"

    def _marks(self, check, name, placed):
        """{(row, column): (level, text)}; of several in a cell the worst level, each on a line."""
        found = {}
        for place, marks in check.marks.get(name, {}).items():
            is_bad = any(one.level == BAD for one in marks)
            text = "\n".join(
                f"{place_of_key(one)}{self.say(one.problem.expected)}"
                if placed(place) == (None, None)
                else self.say(one.problem.expected)
                for one in marks
            )
            level = BAD if is_bad else marks[0].level
            known = found.get(placed(place))
            if known is not None:
                level = BAD if BAD in (level, known[0]) else level
                text = f"{known[1]}\n{text}"
            found[placed(place)] = level, text
        return found

    # ---- typing

    def enter(self, draft, name, changes, every_key=False):
        """Put what was typed into a table: [(row, name of the column, text)].

        Parameters
        ----------
        draft : Draft
        name : str
        changes : list of (int, str, str)
        every_key : bool
            As the table was shown.
        """
        if name in draft.keys:
            places = key_places(draft, name, every_key)
            for row, column, text in changes:
                if column == VALUE and 0 <= row < len(places):
                    owner, key = places[row]
                    field = field_of(name, owner, key)
                    draft.set_value(name, owner, key, entered_text(field, text, ".", self.mark))
            return
        fields, decimal = draft.fields(name), draft.tables[name].decimal
        draft.set_cells(
            name,
            [
                (row, column, entered_text(fields.get(column), text, decimal, self.mark))
                for row, column, text in changes
            ],
        )

    def line(self, problem):
        """A problem or a warning as one line."""
        return self.say(problem.text)


def place_of_key(mark):
    """Where a problem is whose cell is not shown: "x_m: " or nothing."""
    return f"{mark.problem.column}: " if mark.problem.column else ""


def key_places(draft, name, every_key=False):
    """(owner, key) of each row that is shown of the settings or of a list.

    Those that stand in the file or must be given; with every_key all that the tank may have.
    """
    given = [(one.owner, one.key) for one in draft.keys[name].entries]
    known = set(given)
    if name != SETTINGS:
        owners = dict.fromkeys(owner for owner, _ in given)
        fields = {owner: REGISTER_KEYS[name] for owner in owners}
    else:
        fields = {section: KEYS[section] for section in SECTIONS if section not in NOT_HERE}
    kind = draft.kind if name == SETTINGS else None
    places = []
    for owner, of_owner in fields.items():
        places += [
            (owner, one.name)
            for one in of_owner
            if (owner, one.name) in known
            or (one.suits(kind) and (every_key or (kind is not None and one.is_required(kind))))
        ]
        own = [place for place in given if place[0] == owner]
        places += [place for place in own if place not in set(places)]
    seen = set(places)
    return places + [place for place in given if place not in seen]


def _plain_file(file):
    return str(file).removeprefix(SHEET)
