"""No text of others is a formula in a CSV file; a name is read back as it was written."""

import csv
import io

import pytest

from tankcal.job.folder import read_csv
from tankcal.job.tables import Log
from tankcal.products.desk.tables import read_csv_table
from tankcal.report.outputs import write_rows
from tankcal.text.delimited import guard_formula, unguard_formula, write_guarded

HOSTILE = ["=1+1", "+1-1", "-1+1|' /C calc'!A0", "@SUM(A1)", "\t=1", "  =1", "=HYPERLINK(1)"]
HARMLESS = ["P1", "-0.25", "-0,25", "+3", "-1e-5", "-", "--", "'P1", "", "a=b"]


@pytest.mark.parametrize("text", HOSTILE)
def test_formulas_are_guarded_and_come_back(text):
    assert guard_formula(text) == f"'{text}"
    assert unguard_formula(guard_formula(text)) == text


@pytest.mark.parametrize("text", HARMLESS)
def test_other_texts_stay(text):
    assert guard_formula(text) == text == unguard_formula(text)


def cells_of(text):
    return [cell for row in csv.reader(io.StringIO(text, newline="")) for cell in row]


def test_rows_of_both_writers(tmp_path):
    stream = io.StringIO()
    write_guarded(stream, [[one, 1.5, None] for one in HOSTILE])
    write_rows([{"name": one, "size": -1.5} for one in HOSTILE], tmp_path / "rows.csv")
    with open(tmp_path / "rows.csv", encoding="utf-8", newline="") as file:
        for text in (stream.getvalue(), file.read()):
            cells = set(cells_of(text))
            assert {guard_formula(one) for one in HOSTILE} <= cells
            assert not set(HOSTILE) & cells


def test_a_note_of_a_job_is_read_without_its_guard(tmp_path):
    """And shown and written by the editor of tables as it was."""
    text = "point,note\nA,'=1+1\nB,'plain\nC,\"'=1,1\"\n"
    log = Log()
    found = read_csv("t.csv", text.encode(), ",", ".", log)
    assert log.problems == []
    assert [row[1] for row in found.rows] == ["=1+1", "'plain", "=1,1"]
    edited = read_csv_table("t", "t.csv", text, ",", ".")
    assert [row.cells[1] for row in edited.rows] == ["=1+1", "'plain", "=1,1"]
    changed = edited.set_cells([(1, 1, "=2+2")])
    assert changed.render()[0].decode() == text.replace("'plain", "'=2+2")


def test_a_carriage_return_begins_no_line():
    stream = io.StringIO()
    write_guarded(stream, [["a\r=1+1", "b"]])
    assert stream.getvalue() == "a =1+1,b\n"
