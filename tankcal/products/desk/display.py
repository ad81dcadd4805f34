"""Display of a desk: tables in the language of the reader, form of the settings, windows."""

from dataclasses import dataclass
from enum import StrEnum

from tankcal.errors import SHEET
from tankcal.job.certificate_entries import missing_entries
from tankcal.job.contract import KEYS, OF_PHOTOS, REGISTER_KEYS, SECTIONS
from tankcal.job.starter.texts import Texts, split_unit, texts_in
from tankcal.methods.base import methods
from tankcal.products.desk.draft import BAD
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
        return self.say(field.expectation)

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


# Settings that most jobs state although they are not required, {section: keys}.
USUAL_KEYS = {
    "tank": ("nominal_diameter_m", "nominal_height_m", "nominal_volume_m3"),
    "survey": ("shell_temperature_c", "liquid_level_m", "liquid_density_kg_m3", "pressure_bar"),
    "datum": ("bottom_z_m", "dip_plate_z_m", "dip_x_m", "dip_y_m", "reference_height_m"),
    "table": (
        *("step_m", "height_unit", "volume_unit", "liquid_density_kg_m3", "pressure_bar"),
        "language",
    ),
    "horizontal": (
        *("diameter_m", "end_a_depth_m", "end_b_depth_m", "tilt_mm_per_m", "thickness_mm"),
        "azimuth_deg",
    ),
    "sphere": ("diameter_m", "thickness_mm"),
    "shell": ("shape_sd_mm",),
}
# Settings of the tank that only the certificate prints; [certificate] belongs to them.
PRINTED_KEYS = (
    *("owner", "location", "product", "manufacturer", "year", "serial_number", "construction"),
    "remarks",
)


class Group(StrEnum):
    """Group of settings; the values are keys of the words."""

    NEEDED = "needed"
    CERTIFICATE = "certificate"
    EXPERT = "expert"


@dataclass(frozen=True)
class FormField:
    """A setting as an entry of a form.

    Attributes
    ----------
    section, key : str
        Its place in the settings.
    group : Group
        Group of the form.
    label, unit, help : str
        Short label, symbol of the unit, and explanation with the accepted values.
    entry : {"text", "number", "choice", "flag", "date"}
        Kind of entry.
    choices : tuple of (str, str)
        Codes and texts of a choice; usual values of a text.
    value : str
        Text with the decimal mark of the language.
    is_required : bool
        Whether the kind of tank requires it.
    is_asked : bool
        Whether ISO/IEC 17025 requires it on a certificate and it is blank.
    level, problem : str
        Level and text of its problem or warning; "" without any.
    """

    section: str
    key: str
    group: Group
    label: str
    unit: str = ""
    help: str = ""
    entry: str = "text"
    choices: tuple = ()
    value: str = ""
    is_required: bool = False
    is_asked: bool = False
    level: str = ""
    problem: str = ""

    @property
    def name(self):
        """Name of the entry: section and key."""
        return f"{self.section}.{self.key}"


def form_of(desk):
    """Build the form of the settings of a job.

    Returns
    -------
    list of FormField
        In the order of the contract, without the format of the files and without the settings of
        methods of which the job has neither a table nor a setting.
    """
    draft, reader = desk.draft, desk.reader
    if SETTINGS not in draft.keys:
        return []
    entries = {(entry.owner, entry.key): entry.text for entry in draft.keys[SETTINGS].entries}
    marks = reader.marks_of_keys(desk.outcome, SETTINGS)
    asked = _find_asked_entries(entries)
    fields = []
    for section in SECTIONS:
        if section in READ_ONLY_SECTIONS or not _is_used(section, draft, entries):
            continue
        for field in KEYS[section]:
            place = section, field.name
            if place not in entries and not _is_usable(field, draft):
                continue
            level, problem = marks.get(place, ("", ""))
            codes = ("true", "false") if field.kind == "flag" else field.choices
            codes = () if len(codes) > MOST_CHOICES else codes
            fields.append(
                FormField(
                    *place,
                    _group_of(section, field, draft.kind, level),
                    reader.label(section, field),
                    split_unit(field.name)[1],
                    reader.help(SETTINGS, section, field, not codes and field.kind != "date"),
                    _entry_of(field),
                    tuple((code, reader.choice(field, code)) for code in codes),
                    text_for_display(field, entries.get(place, ""), ".", reader.mark),
                    field.is_required(draft.kind),
                    place in asked,
                    level,
                    problem,
                )
            )
    return fields


def _find_asked_entries(entries):
    """Places of blank entries that ISO/IEC 17025 requires on a certificate."""
    stated = {key: text for (section, key), text in entries.items() if section == "certificate"}
    location = entries.get(("tank", "location"))
    certificate = {key: text for key, text in stated.items() if text.strip()}
    return {("certificate", str(key)) for key in missing_entries(certificate, location)}


def _is_usable(field, draft):
    """Whether a job of this kind of tank and survey may have a setting."""
    has_photos = "photos" in draft.tables
    has_network = has_photos or "setups" in draft.tables or "distances" in draft.tables
    is_of_photos = field.name in OF_PHOTOS and not has_photos
    return field.suits(draft.kind) and not is_of_photos and (has_network or not field.of_survey)


def _is_used(section, draft, entries):
    """Whether the job may use a section; a section of a method needs its tables or settings."""
    if section == "adjustment.camera":
        return "photos" in draft.tables
    owners = [method for method in methods() if section in method.settings()]
    if not owners:
        return True
    tables = {name for method in owners for name in method.columns()}
    is_stated = any(owner == section and text for (owner, _), text in entries.items())
    return is_stated or bool(tables & draft.tables.keys())


def _group_of(section, field, kind, level):
    """Group of a setting; a setting with a problem is needed."""
    if section == "certificate" or (section == "tank" and field.name in PRINTED_KEYS):
        return Group.CERTIFICATE
    if level == "bad" or field.is_required(kind) or field.name in USUAL_KEYS.get(section, ()):
        return Group.NEEDED
    return Group.EXPERT


def _entry_of(field):
    """Kind of entry of a field."""
    if field.kind == "choice" and len(field.choices) <= MOST_CHOICES:
        return "choice"
    if field.kind in ("flag", "date"):
        return field.kind
    return "number" if field.kind == "number" and not field.choices else "text"


def describe_state(desk):
    """State of a desk for all its windows: revision, problems, names of Undo and Redo."""
    draft, check = desk.draft, desk.present_check
    return {
        "revision": draft.revision,
        "undo": desk.reader.step(draft.undo_operations),
        "redo": desk.reader.step(draft.redo_operations),
        "is_changed": draft.is_changed,
        "is_checked": check is not None,
        "problems": None if check is None else len(check.problems),
        "warnings": None if check is None else len(check.warnings),
    }


def describe_grid(desk, name):
    """Content of the grid of a table or list, with the marks of a full check."""
    shown = desk.show(name)
    return {
        "columns": [vars(column) for column in shown.columns],
        "rows": shown.rows,
        "marks": [[*place, *mark] for place, mark in shown.marks.items()],
        "addable": list(shown.addable),
        "takes_rows": shown.takes_rows,
        "every_key": desk.every_key.get(name, False),
        "locked": desk.draft.locked is not None,
    }


def describe_changes(desk, name, since, entered=()):
    """Differences of a table or of the settings since a revision.

    Parameters
    ----------
    desk : Desk
        Desk of the job.
    name : str
        Name of a table, of a list, or "job" for the form of the settings.
    since : int
        Revision that the window shows.
    entered : sequence of (int or str, str)
        Cells that were just entered. Until the full check, they are checked by their fields.

    Returns
    -------
    dict
        State, and "cells" [[row, column, text]] or, if the form of a table differs, its whole
        content; for the settings "fields" {name: [text, level, problem]}.
    """
    draft, reader, state = desk.draft, desk.reader, describe_state(desk)
    if name is None or (name not in draft.tables and name not in draft.keys):
        return state
    changes = draft.changes_since(since)
    cells = None if changes is None else changes.get(name, [])
    if name == SETTINGS:
        fields = form_of(desk)
        return state | {"fields": {item.name: [item.value, item.level, item.problem]
                                   for item in fields}}  # fmt: skip
    if cells is None:
        return state | describe_grid(desk, name)
    if cells:
        table, fields = draft.tables[name], draft.fields(name)
        column_of = {heading: place for place, heading in enumerate(table.headings)}
        state["cells"] = [
            [
                row,
                column_of[heading],
                text_for_display(
                    fields.get(heading),
                    table.rows[row].cells[column_of[heading]],
                    table.decimal,
                    reader.mark,
                ),
            ]
            for row, heading in cells
        ]
    if desk.present_check is not None:
        marks = reader.marks_in_grid(draft, desk.present_check, name, desk.every_key.get(name))
        return state | {"marks": [[*place, *mark] for place, mark in marks.items()]}
    return state | {"entered": _marks_of_entries(desk, name, entered)}


def _marks_of_entries(desk, name, entered):
    """Marks [[row, column, level, text]] of entered cells by their fields; level "" if valid."""
    marks = desk.draft.quick_check(name, entered)
    if name in desk.draft.keys:
        rows = {place: row for row, place in enumerate(key_places(desk.draft, name, True))}
        places = {place: (rows.get(place), 2) for place in entered}
    else:
        headings = desk.draft.tables[name].headings
        places = {place: (place[0], headings.index(place[1])) for place in entered}
    return [
        [*places[place], marks[place].level, desk.reader.say(marks[place].problem.expected)]
        if place in marks
        else [*places[place], "", ""]
        for place in entered
    ]


def enter_setting(desk, section, key, text):
    """Enter a setting of the form, with the decimal mark of the language."""
    if field_of(SETTINGS, section, key) is not None:
        desk.enter(SETTINGS, section, key, text)
