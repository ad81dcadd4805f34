"""The desk without a browser: numbers of a language, what is shown, live grids, running."""

import json
from html import unescape
from pathlib import Path

import pytest
from job_builder import write_job, write_workbook

import tankcal
from tankcal.job.fields import Field
from tankcal.job.tables import REGISTERS, TABLES
from tankcal.products.desk.computing import Refusal, Run, Stopped
from tankcal.products.desk.tables import AmbiguousNumber, text_for_display, text_for_file
from tankcal.products.workbench import desk
from tankcal.products.workbench.desk import Desk, open_job
from tankcal.products.workbench.panels import warnings_page
from tankcal.text.shipped import LANGUAGES

EXAMPLES = Path(__file__).parents[2] / "examples"
NUMBER = Field("x_m", "number", "")
LIST = Field("minimum_delivery_m", "numbers", "")


@pytest.fixture
def folder(tmp_path):
    return write_job(tmp_path / "job", rings=2)


# ---- decimal marks


@pytest.mark.parametrize(
    ("field", "typed", "in_file", "mark", "entered"),
    [
        (NUMBER, "1,5", ".", ",", "1.5"), (NUMBER, " -0,25e1 ", ".", ",", "-0.25e1"),
        (NUMBER, "12", ".", ",", "12"), (NUMBER, "1,5", ".", ".", "1,5"),
        (NUMBER, "1,5", ",", ",", "1,5"), (NUMBER, "1.5", ",", ".", "1,5"),
        (NUMBER, "abc", ".", ",", "abc"), (NUMBER, "1.234,5", ".", ",", "1.234,5"),
        (LIST, "1,5; 2", ".", ",", "1.5; 2"), (LIST, "1,5; 2", ",", ",", "1.5; 2"),
        (None, "a,b", ".", ",", "a,b"),
    ],
)  # fmt: skip
def test_numbers_are_typed_with_the_mark_of_the_language(field, typed, in_file, mark, entered):
    found = text_for_file(field, typed, in_file, mark)
    assert found == entered
    assert not isinstance(found, AmbiguousNumber)


@pytest.mark.parametrize("typed", ["1.234", "14.5", "1.5"])
def test_the_other_mark_is_never_taken_in_silence(typed):
    assert isinstance(text_for_file(NUMBER, typed, ".", ","), AmbiguousNumber)
    assert isinstance(text_for_file(NUMBER, typed.replace(".", ","), ",", "."), AmbiguousNumber)


@pytest.mark.parametrize("text", ["1.5", "-3", "1e-5", "abc", "", "1.2.3"])
@pytest.mark.parametrize(("in_file", "mark"), [(".", ","), (",", "."), (".", "."), (",", ",")])
def test_what_is_shown_can_be_typed_again(text, in_file, mark):
    in_cell = text.replace(".", in_file)
    shown = text_for_display(NUMBER, in_cell, in_file, mark)
    assert text_for_file(NUMBER, shown, in_file, mark) == in_cell


# ---- what is shown


@pytest.mark.slow(after=2)
@pytest.mark.parametrize("language", LANGUAGES)
def test_every_table_is_shown_in_every_language(language):
    made = open_job(EXAMPLES / "total-station", language=language, live=False)
    for name in (*made.names, *made.lists, "job"):
        shown = made.show(name)
        assert shown.title
        assert shown.note
        assert all(len(row) == len(shown.columns) for row in shown.rows)
        assert shown.marks == {}
    for name in (*TABLES, *REGISTERS):
        assert made.reader.note(name) or name


def test_words_of_all_languages_are_there():
    readers = [open_job(EXAMPLES / "silva-1995", language=one, live=False).reader
               for one in LANGUAGES]  # fmt: skip
    groups = [reader.words["workbench"] for reader in readers]
    assert all(group.keys() == groups[0].keys() for group in groups)
    for part in ("grid", "notebook"):
        assert all(group[part].keys() == groups[0][part].keys() for group in groups)


def test_a_marked_cell_says_why_on_the_page(folder):
    made = open_job(folder, language="es", live=False)
    made.enter("points", 2, "x_m", "<b>")
    page = made.points._repr_mimebundle_()["text/html"]
    assert 'class="number bad"' in page
    assert "se espera" in page
    assert "&lt;b&gt;" in page
    assert "<b>" not in page
    assert len(made.problems) == 1
    assert "points.csv" in made.problems._repr_mimebundle_()["text/html"]


def test_a_long_table_is_cut_but_never_a_marked_row(tmp_path):
    folder = write_job(tmp_path / "job", rings=20)
    made = open_job(folder, live=False)
    count = len(made.draft.tables["points"].rows)
    assert count > 500
    made.enter("points", count // 2, "x_m", "abc")
    page = made.points._repr_mimebundle_()["text/html"]
    assert page.count("<tr>") < 450
    assert "abc" in page


def test_settings_show_what_must_be_given(folder):
    made = open_job(folder, language="pt-BR", live=False)
    made.enter("job", "tank", "nominal_diameter_m", "13,05")
    shown = made.show("job")
    row = next(row for row in shown.rows if row[:2] == ["tank", "nominal_diameter_m"])
    assert row[2:4] == ["13,05", "m"]
    assert made.draft.value("tank", "nominal_diameter_m") == "13.05"
    made.every_key["job"] = True
    assert len(made.show("job").rows) > 2 * len(shown.rows)


def test_a_missing_table_is_told(folder):
    made = open_job(folder, live=False)
    assert "no such table" in made.welds._repr_mimebundle_()["text/html"]
    (folder / "courses.csv").write_bytes(b"\x81\xff")
    made = open_job(folder, live=False)
    assert "UTF-8" in made.courses._repr_mimebundle_()["text/html"]
    with pytest.raises(AttributeError):
        made.nothing  # noqa: B018


def test_no_job_is_refused_without_a_traceback(tmp_path):
    with pytest.raises(Refusal) as error:
        open_job(tmp_path / "none", language="es")
    shown = error.value._render_traceback_()
    assert "servicio" in shown[0]
    assert str(Path.cwd()) in shown[1]


def test_tables_of_the_kind_may_be_added(folder):
    assert {"welds", "deadwood", "circumferences"} <= set(open_job(folder, live=False).addable)
    sphere = open_job(EXAMPLES / "sphere-straps", live=False)
    assert "welds" not in sphere.addable


def test_who_looks_on_is_found_out(monkeypatch):
    for name in desk.SESSION_VARIABLES:
        monkeypatch.delenv(name, raising=False)
    assert not desk.is_attended()
    monkeypatch.setenv("JPY_SESSION_NAME", "tankcal.ipynb")
    assert desk.is_attended()


# ---- grids, as a browser would talk to them


def live_grid(folder, name, language="en"):
    pytest.importorskip("ipywidgets")
    pytest.importorskip("anywidget")
    from tankcal.products.workbench.panels import TableGrid

    made = open_job(folder, language=language, live=True)
    return made, TableGrid(made, name)


def test_a_grid_hands_over_what_is_typed(folder):
    _, table = live_grid(folder, "points")
    table._handle_message(None, {"kind": "enter", "changes": [[2, "x_m", "abc"]]}, [])
    assert [mark[:3] for mark in table.grid.marks] == [[2, 1, "bad"]]
    assert table.grid.rows[2][1] == "abc"
    table._handle_message(None, {"kind": "undo"}, [])
    assert table.grid.marks == []
    assert table.grid.rows[2][1] != "abc"


def test_a_block_is_pasted_and_makes_rows(folder):
    made, table = live_grid(folder, "points", "pt-BR")
    count = len(table.grid.rows)
    block = [["N1", "6,5", "0,1", "0,9"], ["N2", "6,5", "0,2", "9.1"]]
    table._handle_message(None, {"kind": "paste", "row": count, "column": 0, "cells": block}, [])
    assert len(table.grid.rows) == count + 2
    assert made.draft.tables["points"].rows[count].cells[:3] == ("N1", "6.5", "0.1")
    (row, column, level), _text = table.grid.marks[0][:3], table.grid.marks[0][3]
    assert (row, column, level) == (count + 1, 3, "bad")  # 9.1: which number is that?


def test_rows_and_columns_of_a_grid(folder):
    _, table = live_grid(folder, "courses")
    table._handle_message(None, {"kind": "insert", "row": 1, "count": 1}, [])
    assert table.grid.rows[1][0] == ""
    table._handle_message(None, {"kind": "remove", "rows": [1]}, [])
    assert len(table.grid.rows) == 5
    name = table.grid.addable[0]
    table._handle_message(None, {"kind": "column", "name": name}, [])
    assert table.grid.columns[-1]["name"] == name
    _, table = live_grid(folder, "job")
    count = len(table.grid.rows)
    table._handle_message(None, {"kind": "every", "value": True}, [])
    assert len(table.grid.rows) > count


def test_a_grid_of_a_locked_workbook_says_so(tmp_path):
    from openpyxl import load_workbook

    path = write_workbook(tmp_path / "job.xlsx", rings=2)
    book = load_workbook(path)
    book["courses"]["B2"] = "=1+0.9"
    book.save(path)
    made, table = live_grid(path, "points")
    assert table.grid.locked
    table._handle_message(None, {"kind": "enter", "changes": [[0, "x_m", "1"]]}, [])
    assert "formulas" in made.status


# ---- computing


def test_a_desk_with_problems_does_not_run(folder):
    made = open_job(folder, language="pt-BR", live=False)
    made.enter("points", 0, "x_m", "abc")
    with pytest.raises(Refusal, match="esperado"):
        made.run()
    assert not (folder / "results").exists()
    with pytest.raises(Refusal):
        made.results  # noqa: B018
    assert "abc" not in (folder / "points.csv").read_text()


@pytest.mark.slow
def test_run_saves_and_writes_the_record_of_the_files(folder, tmp_path):
    made = open_job(folder, out=tmp_path / "out", live=False)
    made.enter("courses", 0, "thickness_mm", "9.9")
    result = made.run(papers=False)
    assert not made.is_stale
    again = tankcal.run(tankcal.load(folder))
    assert result.at(5.0).value_m3 == again.at(5.0).value_m3
    kept = json.loads((tmp_path / "out" / "record.json").read_text())
    from tankcal.record import record_of
    from tankcal.record.schema import to_plain

    fresh = json.loads(json.dumps(to_plain(record_of(again))))
    assert kept["capacity"] == fresh["capacity"]
    assert kept["files"] == fresh["files"]
    made.enter("courses", 0, "thickness_mm", "8")
    assert made.is_stale


@pytest.mark.slow
def test_overruling_is_noted_in_the_job(folder, tmp_path):
    made = open_job(folder, out=tmp_path / "out", live=False)
    made.run(papers=False)
    name = made.draft.tables["points"].rows[3].cells[0]
    made.overrule(name, "leave_out", "a clamp, seen on the photo")
    made.overrule(name, "leave_out", "a clamp of the ladder, seen on the photo")
    assert made.is_stale
    assert made.problems[:] == ()
    result = made.run(papers=False)
    lines = (folder / "overrulings.csv").read_text().splitlines()
    assert lines[0] == "point,decision,reason,date"
    assert lines[1].startswith(f'{name},leave_out,"a clamp of the ladder, seen on the photo",2')
    assert len(lines) == 2
    assert len(result.accepted) == len(result.job.points.names) - 1


def test_overruling_in_a_new_job_of_decimal_commas(folder):
    """A table whose heading has commas keeps them where the job has semicolons."""
    for path in folder.glob("*.csv"):
        path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    with (folder / "job.toml").open("a") as file:
        file.write('\n[csv]\nseparator = ";"\ndecimal = ","\n')
    noted = folder / "overrulings.csv"
    noted.write_text("# decisions\npoint,table,row,decision,reason,by,date\n")
    made = open_job(folder, live=False)
    assert [one.name for one in made.show("overrulings").columns][:3] == ["point", "table", "row"]
    name = made.draft.tables["points"].rows[3].cells[0]
    made.overrule(name, "leave_out", "a clamp; seen")
    assert made.problems[:] == ()
    made.save()
    lines = noted.read_text().splitlines()
    assert lines[:2] == ["# decisions", "point,table,row,decision,reason,by,date"]
    assert lines[2].startswith(f"{name},,,leave_out,a clamp; seen,,2")
    assert open_job(folder, live=False).problems[:] == ()


@pytest.mark.slow
def test_warnings_of_a_run_stand_with_its_results(folder, tmp_path):
    """What only the run knows: the certificate lacks what ISO/IEC 17025 requires."""
    made = open_job(folder, out=tmp_path / "out", live=False, language="pt-BR")
    made.run(papers=False)
    page = made.results._repr_mimebundle_()["text/html"]
    own = [one for one in made.last_run.result.warnings if one.column == "certificate"]
    assert own
    assert made.reader.line(own[0]) in unescape(page)
    assert str((tmp_path / "out").resolve()) in page
    told = [made.reader.line(one) for one in made.outcome.warnings]
    assert not any(one in unescape(warnings_page(made)) for one in told)


def insert_rows_of_two(draft, *names):
    with draft.group_edits():
        for name in names:
            draft.insert_rows(name, 0)


@pytest.mark.slow
def test_nothing_is_computed_but_what_is_shown(folder, tmp_path):
    made = open_job(folder, out=tmp_path / "out", live=False)
    path = folder / "courses.csv"
    before = path.read_bytes()
    path.write_bytes(before + b"# a word\n")
    for act in (made.save, made.run):  # nothing was edited here
        with pytest.raises(Refusal, match=r"courses\.csv: another program has changed"):
            act()
    assert not (tmp_path / "out").exists()
    name = made.draft.tables["points"].rows[3].cells[0]
    made.overrule(name, "leave_out", "a clamp")  # what was edited can be saved
    assert [one.name for one in made.save()] == ["overrulings.csv"]
    path.write_bytes(before)
    assert made.run(papers=False)


def test_what_was_done_at_once_is_taken_back_at_once(folder):
    made, _table = live_grid(folder, "points")
    before = dict(made.draft.tables)
    made.overrule(made.draft.tables["points"].rows[3].cells[0], "leave_out", "a clamp")
    block = [["N1", "6.5", "0", "0.9"], ["N2", "0", "6.5", "0.9"]]
    made.act(
        "points", {"kind": "paste", "row": len(before["points"].rows), "column": 0, "cells": block}
    )
    assert made.draft.undo()
    assert made.draft.tables["points"] is before["points"]
    assert "overrulings" in made.draft.tables
    assert made.draft.undo()
    assert made.draft.tables == before
    assert not made.draft.undo()
    with pytest.raises(KeyError):
        insert_rows_of_two(made.draft, "points", "nothing")
    assert made.draft.tables == before
    assert not made.draft.undo()


@pytest.mark.slow
def test_a_run_can_be_stopped(folder, tmp_path):
    run, heard = Run(folder, tmp_path / "out", papers=False), []

    def tell(text, share):
        heard.append(str(text))
        if len(heard) == 3:
            run.stop()

    run._on_progress = tell
    with pytest.raises(Stopped):
        run.wait()
    assert len(heard) == 3
    assert not (tmp_path / "out").exists()


def test_results_of_somebody_else_are_not_replaced(folder, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("a")
    made = open_job(folder, out=tmp_path / "out", live=False)
    with pytest.raises(Refusal, match=r"mine\.txt"):
        made.run()
    assert (tmp_path / "out" / "mine.txt").exists()


@pytest.mark.slow
def test_progress_tells_parts_and_shares(folder, tmp_path):
    heard = []
    run = Run(folder, tmp_path / "out", lambda *one: heard.append(one), papers=False)
    run._part("writing the report", 3, 12)
    assert heard == [("writing the report 3/12", 0.25)]
    run.wait()
    assert ("reading the job", None) in heard
    assert ("writing the record and the tables", 0.0) in heard


def test_desk_lists_its_tables(folder):
    made = open_job(folder, live=False)
    assert {"points", "courses", "settings", "problems"} <= set(dir(made))
    assert not set(TABLES) & set(vars(Desk))


@pytest.mark.slow
def test_what_cannot_be_written_is_told_without_a_traceback(folder, monkeypatch):
    def refuse(*_args, **_options):
        raise OSError(30, "Read-only file system")

    made = open_job(folder, live=False, language="es")
    monkeypatch.setattr("tempfile.mkstemp", refuse)
    monkeypatch.setattr("tankcal.report.outputs.write", refuse)
    with pytest.raises(Refusal, match="solo lectura"):
        made.run(papers=False)
    made.enter("courses", 0, "thickness_mm", "8,5")
    with pytest.raises(Refusal, match="solo lectura"):
        made.save()
