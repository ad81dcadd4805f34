"""Content for the windows that show a desk: state, and differences since a revision."""

from tankcal.products.desk.display import key_places
from tankcal.products.desk.forms import form_of
from tankcal.products.desk.keys import SETTINGS, field_of
from tankcal.products.desk.tables import text_for_display


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
