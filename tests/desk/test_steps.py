"""Undo, Redo, names of edits, revisions, and the journal of unsaved edits."""

import json
import random
from pathlib import Path

import pytest
from job_builder import write_job, write_workbook

from tankcal.errors import InputError
from tankcal.products.desk.desk import Desk
from tankcal.products.desk.display import Reader
from tankcal.products.desk.draft import BAD, Draft
from tankcal.products.desk.jobs import Journal
from tankcal.products.desk.tables import AmbiguousNumber


@pytest.fixture
def folder(tmp_path):
    return write_job(tmp_path / "job", rings=2)


def open_desk(folder, language="en", state=None):
    desk = Desk(Draft.open(folder), folder / "results", Reader(language))
    if state is not None:
        desk.keep_journal(Journal(folder, state))
    return desk


def rendered(draft):
    """Bytes of all tables and keys in their edited state, and the ambiguous texts.

    Blank rows are not compared, because they are not in the files.
    """
    states = {**draft.tables, **draft.keys}
    texts = {
        name: [(column, table.rows[row].cells) for row, column in table.ambiguous]
        for name, table in draft.tables.items()
    }
    return {name: state.render()[0] for name, state in states.items()}, texts


def edit_at_random(desk, draw):
    """One random edit; returns nothing, because the draft has the state."""
    draft, table = desk.draft, desk.draft.tables["points"]
    count = len(table.rows)
    choice = draw.randrange(7)
    if choice == 0 and count > 3:
        draft.remove_rows("points", draw.sample(range(count), 2))
    elif choice == 1:
        draft.insert_rows("points", draw.randrange(count + 1), draw.randrange(1, 3))
    elif choice == 2:
        draft.set_value("job", "tank", "nominal_diameter_m", str(draw.randrange(5, 50)))
    elif choice == 3:
        cells = [["N", str(draw.random()), "1.234", "x"]] * 2
        desk.act("points", {"kind": "paste", "row": count, "column": 0, "cells": cells})
    elif choice == 4 and "welds" not in draft.tables:
        draft.add_table("welds")
    else:
        row = draw.randrange(count)
        text = draw.choice(["1.5", "", "abc", AmbiguousNumber("1,234")])
        draft.set_cells("points", [(row, draw.choice(["x_m", "z_m"]), text)])


@pytest.mark.slow
def test_undo_and_redo_walk_through_all_states(folder):
    desk, draw = open_desk(folder), random.Random(3)
    states = [rendered(desk.draft)]
    for _ in range(40):
        edit_at_random(desk, draw)
        if rendered(desk.draft) != states[-1]:
            states.append(rendered(desk.draft))
    for state in reversed(states[:-1]):
        while rendered(desk.draft) != state:
            assert desk.draft.undo()
    while desk.draft.undo():
        assert rendered(desk.draft) == states[0]
    for state in states[1:]:
        while rendered(desk.draft) != state:
            assert desk.draft.redo()


def test_an_edit_after_undo_ends_redo(folder):
    draft = Draft.open(folder)
    draft.set_cells("points", [(0, "x_m", "1")])
    draft.undo()
    assert draft.redo_operations
    draft.set_cells("points", [(0, "x_m", "2")])
    assert not draft.redo()
    assert draft.tables["points"].rows[0].cells[1] == "2"


@pytest.mark.parametrize(
    ("language", "names"),
    [
        ("en", ["Entry in Points of the wall", "Paste of 2 rows into Points of the wall"]),
        ("pt-BR", ["Valor em Pontos da parede", "Colagem de 2 linhas em Pontos da parede"]),
        ("es", ["Valor en Puntos de la pared", "Pegado de 2 filas en Puntos de la pared"]),
    ],
)
def test_edits_have_names(folder, language, names):
    desk = open_desk(folder, language)
    desk.draft.set_cells("points", [(0, "x_m", "1")])
    assert desk.reader.step(desk.draft.undo_operations) == names[0]
    count = len(desk.draft.tables["points"].rows)
    cells = [["A", "1"], ["B", "2"]]
    desk.act("points", {"kind": "paste", "row": count, "column": 0, "cells": cells})
    assert desk.reader.step(desk.draft.undo_operations) == names[1]
    desk.draft.undo()
    assert desk.reader.step(desk.draft.redo_operations) == names[1]
    assert desk.reader.step([]) == ""


@pytest.mark.slow
def test_changes_since_a_revision_redraw_a_window(folder):
    """A window that takes over the changed cells shows what the draft has."""
    desk, draw = open_desk(folder), random.Random(5)
    draft = desk.draft
    shown, seen = [list(row.cells) for row in draft.tables["points"].rows], draft.revision
    partly = 0
    for number in range(60):
        draft.undo() if number % 5 == 4 else edit_at_random(desk, draw)
        if number % 3 == 0:
            continue  # the window does not ask after each edit
        changes = draft.changes_since(seen)
        seen = draft.revision
        rows = draft.tables["points"].rows
        if changes.get("points", ()) is None:
            shown = [list(row.cells) for row in rows]
        for row, heading in changes.get("points") or ():
            column = draft.tables["points"].headings.index(heading)
            shown[row][column] = rows[row].cells[column]
            partly += 1
        assert shown == [list(row.cells) for row in rows]
    assert partly > 10
    assert draft.changes_since(draft.revision) == {}
    assert draft.changes_since(-1) is None


def test_a_cell_is_checked_at_once(folder):
    draft = Draft.open(folder)
    draft.set_cells("points", [(0, "x_m", "abc"), (1, "x_m", "5.5"), (2, "x_m", "")])
    draft.set_cells("points", [(3, "x_m", AmbiguousNumber("1.234"))])
    draft.set_value("job", "table", "step_m", "-1")
    places = [(row, "x_m") for row in range(4)]
    marks = draft.quick_check("points", places)
    assert set(marks) == {(0, "x_m"), (3, "x_m")}
    assert all(mark.level == BAD for mark in marks.values())
    assert set(draft.quick_check("job", [("table", "step_m"), ("tank", "id")])) == {
        ("table", "step_m")
    }
    # The full check finds these problems in the same cells.
    assert set(marks) <= set(draft.check().marks["points"])


def test_an_entry_on_a_cell_that_changed_is_refused(folder):
    desk = open_desk(folder, "pt-BR")
    seen = desk.draft.revision
    enter = {"kind": "enter", "changes": [[0, "x_m", "7,5"]]}
    desk.act("points", enter, seen)
    with pytest.raises(InputError) as refused:  # a second window still sees the first revision
        desk.act("points", {"kind": "enter", "changes": [[0, "x_m", "8,5"]]}, seen)
    text = desk.reader.say(refused.value.problems[0].text)
    assert "'7,5'" in text
    assert "'8,5'" in text
    desk.act("points", {"kind": "enter", "changes": [[1, "x_m", "8,5"]]}, seen)  # another cell
    desk.act("points", {"kind": "insert", "row": 0, "count": 1}, desk.draft.revision)
    with pytest.raises(InputError):  # the rows are no longer those of the window
        desk.act("points", enter, seen)


# ---- journal


@pytest.mark.slow
def test_unsaved_edits_are_recovered(folder, tmp_path):
    desk = open_desk(folder, state=tmp_path)
    draw = random.Random(7)
    for _ in range(30):
        edit_at_random(desk, draw)
    desk.draft.undo()
    desk.draft.undo()
    expected = rendered(desk.draft)
    again = open_desk(folder, state=tmp_path)  # the first process was killed
    assert again.unsaved.is_applicable
    assert rendered(again.draft) != expected
    assert again.recover() == desk.draft.revision
    assert rendered(again.draft) == expected
    third = open_desk(folder, state=tmp_path)  # killed again: the recovery is in the journal
    third.recover()
    assert rendered(third.draft) == expected


def test_undo_beyond_a_save_is_recovered(folder, tmp_path):
    desk = open_desk(folder, state=tmp_path)
    before = rendered(desk.draft)
    desk.draft.set_cells("points", [(0, "x_m", "7.5"), (1, "x_m", "7.6")])
    desk.draft.add_table("welds")
    desk.save()
    assert open_desk(folder, state=tmp_path / "other").unsaved is None
    assert Journal(folder, tmp_path).read(desk.draft.digests()) is None
    desk.draft.undo()
    desk.draft.undo()
    assert rendered(desk.draft) == before
    again = open_desk(folder, state=tmp_path)
    assert again.recover() == 2
    assert rendered(again.draft) == before


@pytest.mark.slow
def test_a_journal_killed_at_every_byte_loses_the_last_edit_only(folder, tmp_path):
    desk = open_desk(folder, state=tmp_path)
    path = Journal(folder, tmp_path).path
    states, ends = [], []
    for row in range(3):
        desk.draft.set_cells("points", [(row, "x_m", f"{row}.5")])
        states.append(desk.draft.tables["points"].render()[0])
        ends.append(path.stat().st_size)
    data = path.read_bytes()
    digests = desk.draft.digests()
    for length in (*range(0, ends[1], 9), *range(ends[1], len(data) + 1)):
        path.write_bytes(data[:length])
        unsaved = Journal(folder, tmp_path).read(digests)
        count = sum(end <= length for end in ends)
        assert (0 if unsaved is None else len(unsaved.edits)) == count
    for length in (ends[0], ends[2] - 1):
        path.write_bytes(data[:length])
        again = open_desk(folder, state=tmp_path)
        count = again.recover()
        assert again.draft.tables["points"].render()[0] == states[count - 1]


def test_edits_of_changed_files_are_not_repeated(folder, tmp_path):
    desk = open_desk(folder, state=tmp_path)
    desk.draft.set_cells("points", [(0, "x_m", "7.5")])
    with (folder / "points.csv").open("a") as file:
        file.write("# meanwhile\n")
    again = open_desk(folder, state=tmp_path)
    assert len(again.unsaved.edits) == 1  # listed beside the present values
    assert not again.unsaved.is_applicable
    assert again.recover() == 0
    assert "7.5" not in again.draft.tables["points"].rows[0].cells
    again.discard_unsaved()
    assert open_desk(folder, state=tmp_path).unsaved is None


def test_a_damaged_journal_is_no_obstacle(folder, tmp_path):
    desk = open_desk(folder, state=tmp_path)
    desk.draft.set_cells("points", [(0, "x_m", "7.5")])
    path = Journal(folder, tmp_path).path
    header, edit = path.read_text().splitlines()
    for content in (
        *("", "[]\n", "{}\n[]\n", "\0\n", f"{header}\n3\n"),
        edit.replace("set_cells", "save") + "\n",
    ):
        path.write_text(content)
        assert open_desk(folder, state=tmp_path).unsaved is None
    for bad in ('[["save"]]', '[["set_cells", "nothing", []]]', '[["set_cells"]]', "[[3]]"):
        path.write_text(f"{header}\n{edit}\n{bad}\n{edit}\n")
        again = open_desk(folder, state=tmp_path)
        assert again.recover() == 1
        assert again.draft.tables["points"].rows[0].cells[1] == "7.5"


@pytest.mark.slow
def test_a_workbook_is_recovered(tmp_path):
    pytest.importorskip("openpyxl")
    book = write_workbook(tmp_path / "job.xlsx", rings=2)
    desk = Desk(Draft.open(book), tmp_path / "out", Reader("en"))
    desk.keep_journal(Journal(book, tmp_path))
    desk.draft.set_cells("points", [(0, "x_m", "7.5")])
    desk.draft.set_cells("points", [(1, "x_m", "8.5")])
    desk.draft.undo()
    again = Desk(Draft.open(book), tmp_path / "out", Reader("en"))
    again.keep_journal(Journal(book, tmp_path))
    assert again.recover() == 3
    cells = [row.cells[1] for row in again.draft.tables["points"].rows[:2]]
    assert cells[0] == "7.5"
    assert cells[1] != "8.5"


def test_rows_are_imported_as_a_single_edit(folder):
    for path in Path(folder).glob("*.csv"):
        path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    with (folder / "job.toml").open("a") as file:
        file.write('\n[csv]\nseparator = ";"\ndecimal = ","\n')
    desk = open_desk(folder)
    before = rendered(desk.draft)
    count = len(desk.draft.tables["points"].rows)
    rows = [("A1", "6.5", "0.25", "0.95"), ("A2", "0", "6.5", "")]
    headings = ("point", "x_m", "y_m", "z_m")
    desk.import_rows("points", headings, rows, is_replacing=False)
    table = desk.draft.tables["points"]
    assert len(table.rows) == count + 2
    assert table.rows[count].cells[:4] == ("A1", "6,5", "0,25", "0,95")
    desk.import_rows("points", headings, rows, is_replacing=True)
    assert [row.cells[0] for row in desk.draft.tables["points"].rows] == ["A1", "A2"]
    desk.draft.undo()
    desk.draft.undo()
    assert rendered(desk.draft) == before


@pytest.mark.slow
def test_undo_continues_after_a_restart(folder, tmp_path):
    """Edits, some undone, Save, restart: each further Undo and Redo gives the earlier files."""
    state, draw, desk = tmp_path / "state", random.Random(7), open_desk(folder)
    desk.keep_journal(Journal(folder, state))
    for _ in range(30):
        edit_at_random(desk, draw)
        desk.draft.set_value("job", "tank", "owner", str(draw.random()))
    for _ in range(5):
        desk.draft.undo()
    while desk.draft.undo_operations and any(desk.draft._ambiguous_values()):
        desk.draft.undo()
    desk.save()
    again = open_desk(folder, state=state)
    assert not again.draft.is_changed
    for step in ("redo",) * 3 + ("undo",) * 40:
        names = [getattr(item.draft, f"{step}_operations") for item in (desk, again)]
        assert json.dumps(names[0]) == json.dumps(names[1])
        assert getattr(desk.draft, step)() == getattr(again.draft, step)()
        assert rendered(desk.draft)[0] == rendered(again.draft)[0]
    # A file that another program changed has no earlier states here.
    path = folder / "points.csv"
    path.write_text(path.read_text() + "# other\n")
    assert not open_desk(folder, state=state).draft.undo_operations


@pytest.mark.parametrize("content", ["", "{", "[]", '{"files": 1}', '{"undo": [1]}'])
def test_a_damaged_history_is_ignored(folder, tmp_path, content):
    desk = open_desk(folder, state=tmp_path)
    Journal(folder, tmp_path).keep_history(desk.draft.digests(), {"undo": [[1, 2]], "redo": 3})
    assert not open_desk(folder, state=tmp_path).draft.undo_operations
    Journal(folder, tmp_path).history.write_text(content)
    assert not open_desk(folder, state=tmp_path).draft.undo_operations
