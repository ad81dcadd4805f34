"""CSV files under edit: what is not edited stays byte for byte; what is read back is the state."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tankcal.job.folder import read_csv
from tankcal.job.tables import Log
from tankcal.products.desk.tables import AmbiguousNumber, new_csv_table, read_csv_table

TEXT = (
    "\ufeff# of the crew; kept\r\n"
    "point, x_m ,note\r\n"
    "A,1.50,\"a, \"\"b\"\"\"\r\n"
    "\r\n"
    "# a comment between\r\n"
    " B , 2.0 ,  plain\r\n"
    "C,3.0,last"
)  # fmt: skip


def table(text=TEXT, separator=","):
    return read_csv_table("points", "points.csv", text, separator, ".")


def text_of(edited_table):
    return edited_table.render()[0].decode("utf-8")


def test_unedited_file_is_byte_for_byte_the_same():
    read = table()
    assert read.headings == ("point", "x_m", "note")
    assert [row.cells for row in read.rows] == [
        ("A", "1.50", 'a, "b"'), ("B", "2.0", "plain"), ("C", "3.0", "last"),
    ]  # fmt: skip
    data, numbers = read.render()
    assert data == TEXT.encode("utf-8")
    assert numbers == [3, 6, 7]


def test_one_cell_changes_alone():
    changed = text_of(table().set_cells([(0, 1, "1.51")]))
    assert changed == TEXT.replace("1.50", "1.51")
    changed = text_of(table().set_cells([(1, 2, 'x, "y"')]))
    assert changed == TEXT.replace("  plain", '"x, ""y"""')


def test_same_value_again_changes_nothing():
    assert text_of(table().set_cells([(1, 1, "2.0")])) == TEXT


def test_rows_come_and_go_in_their_place():
    edited_table = table().insert_rows(1, 2).set_cells([(1, 0, "N"), (1, 1, "9")])
    data, numbers = edited_table.render()
    lines = data.decode("utf-8").split("\r\n")
    assert lines[3] == "N,9,"
    assert numbers == [3, 4, None, 7, 8]  # the blank one is not written
    assert text_of(table().remove_rows([1])) == TEXT.replace(" B , 2.0 ,  plain\r\n", "")


def test_rows_after_a_last_line_without_end():
    edited_table = table().insert_rows(3).set_cells([(3, 0, "D")])
    assert text_of(edited_table) == TEXT + "\r\nD,,\r\n"


def test_a_column_is_added_at_the_right():
    edited_table = table().add_column("section").set_cells([(0, 3, "1")])
    lines = text_of(edited_table).split("\r\n")
    assert lines[1:3] == ["point, x_m ,note,section", 'A,1.50,"a, ""b""",1']
    assert lines[-1] == "C,3.0,last,"


def test_cells_beyond_the_headings_can_be_mended():
    read = table("a,b\n1,2,3\n4,5\n")
    assert read.headings == ("a", "b", "")
    assert [row.cells for row in read.rows] == [("1", "2", "3"), ("4", "5", "")]
    assert text_of(read.set_cells([(0, 2, "")])) == "a,b\n1,2,\n4,5\n"
    named = read.add_column("c")
    assert text_of(named).splitlines()[0] == "a,b,c"


def test_missing_cells_of_a_short_row_can_be_filled():
    assert text_of(table("a,b,c\n1\n").set_cells([(0, 2, "3")])) == "a,b,c\n1,,3\n"


def test_a_new_file_has_its_headings():
    made = new_csv_table("welds", "welds.csv", ("course", "azimuth_deg"), ";", ",")
    assert text_of(made.insert_rows(0)) == "course;azimuth_deg\n"


def test_what_is_not_told_apart_is_not_written():
    edited_table = table().set_cells([(0, 1, AmbiguousNumber("1.234"))])
    assert edited_table.ambiguous == [(0, 1)]
    assert 'A,,"a' in text_of(edited_table)


@pytest.mark.parametrize("text", ["", "\n\n", "# only a comment\n", "\ufeff", "a", "a\n", '"a\n"b'])
def test_odd_files_come_back_as_they_are(text):
    assert text_of(table(text)) == text


CELL = st.text(
    st.characters(codec="utf-8", exclude_categories=("C", "Z")) | st.sampled_from(' ,;"'),
    max_size=6,
).map(lambda text: " ".join(text.split()).lstrip("#"))
ROWS = st.lists(st.tuples(CELL.filter(lambda one: one and one[0] != '"'), CELL, CELL), max_size=5)
EDITS = st.lists(st.tuples(st.integers(0, 4), st.integers(1, 2), CELL), max_size=6)


@pytest.mark.slow
@given(ROWS, EDITS, st.sampled_from([",", ";", "\t"]), st.sampled_from(["\n", "\r\n"]))
def test_what_is_read_back_is_the_state(rows, edits, separator, ending):
    """Property: after any edits the reader of jobs finds the cells that the state has."""
    made = new_csv_table("t", "t.csv", ("a", "b", "c"), separator, ".").insert_rows(0, len(rows))
    cells = [(i, j, text) for i, row in enumerate(rows) for j, text in enumerate(row)]
    first = text_of(made.set_cells(cells)).replace("\n", ending)
    state = table(first, separator)
    state = state.set_cells([one for one in edits if one[0] < len(state.rows)])
    data, numbers = state.render()
    log = Log()
    found = read_csv("t.csv", data, separator, "." if separator == "," else ",", log)
    assert log.problems == []
    assert [tuple(cell or "" for cell in row) for row in found.rows] == [
        row.cells for row in state.rows
    ]
    assert list(found.row_numbers) == numbers


@pytest.mark.parametrize("separator", [";", "\t"])
def test_a_file_keeps_its_separator_in_a_job_of_another(separator):
    text = "# as tankcal new wrote it\npoint,x_m,note\n"
    blank = table(text, separator)
    assert blank.headings == ("point", "x_m", "note")
    assert text_of(blank) == text_of(blank.insert_rows(0)) == text
    filled = blank.insert_rows(0).set_cells([(0, 0, "A"), (0, 1, "1,5")])
    assert text_of(filled) == text + 'A,"1,5",\n'
    widened = text_of(blank.add_column("section")).splitlines()[1]
    assert widened == "point,x_m,note,section"
    again = read_csv("points.csv", text_of(filled).encode(), separator, ",", Log())
    assert list(again.headings) == ["point", "x_m", "note"]
