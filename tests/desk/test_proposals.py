"""Proposals for the import of files: 60 tables in all formats, and other kinds of files."""

import itertools
from io import BytesIO
from pathlib import Path

import pytest
from openpyxl import Workbook

from tankcal.products.desk.proposals import Kind, propose

EXAMPLES = Path(__file__).parents[2] / "examples"
ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "cp1252", "mac_roman")
SEPARATORS = (";", ",", "\t", " ")
MARKS = (".", ",", "ambiguous")
NUMBERS = (("14.932", "-1.5", "10.95"), ("16.6", "0.25", "10.950"), ("9.125", "20.141", "0.5"))
AMBIGUOUS = (("1.234", "2.345", "3.456"), ("4.567", "5.678", "6.789"))


@pytest.mark.slow(after=4)
@pytest.mark.parametrize(
    ("encoding", "separator", "mark"), [*itertools.product(ENCODINGS, SEPARATORS, MARKS)]
)
def test_a_table_of_any_format_is_recognised(encoding, separator, mark):
    if separator == "," and mark != ".":
        mark = "."  # a decimal comma would separate
    headings = ("Estação", "Este", "Norte", "Cota")
    numbers = AMBIGUOUS if mark == "ambiguous" else NUMBERS
    lines = [separator.join(headings)]
    for place, row in enumerate(numbers):
        cells = [text.replace(".", "," if mark == "," else ".") for text in row]
        lines.append(separator.join((f"São-{place}", *cells)))
    data = ("# levantamento de março\r\n" + "\r\n".join(lines) + "\r\n").encode(encoding)
    proposal = propose(data)
    assert proposal.kind is Kind.TABLE
    assert proposal.separator == separator
    assert proposal.heading_row == 2
    assert [column.heading for column in proposal.columns] == list(headings)
    assert [column.target for column in proposal.columns] == ["", "x_m", "y_m", "z_m"]
    assert proposal.missing == ["point"]
    assert [row[1:] for row in proposal.rows] == [
        tuple(text.replace(".", "," if mark == "," else ".") for text in row) for row in numbers
    ]
    assert proposal.rows[0][0] == "São-0"
    if mark == "ambiguous":
        assert proposal.decimal == ""  # to be asked
        chosen = propose(data, decimal=".")
        assert chosen.convert()[1][0][0] == "1.234"
    else:
        assert proposal.decimal == mark
        assert proposal.convert()[1] == list(numbers)


def test_units_are_converted_exactly():
    data = b"Point;X (mm);Y (ft);Z\nA;14932,5;10;1,25\n"
    proposal = propose(data)
    assert [column.unit for column in proposal.columns] == ["", "mm", "ft", "m"]
    headings, rows = proposal.convert()
    assert headings == ("point", "x_m", "y_m", "z_m")
    assert rows == [("A", "14.9325", "3.048", "1.25")]
    chosen = propose(data, units=["", "m", "in", "cm"])
    assert chosen.convert()[1] == [("A", "14932.5", "0.254", "0.0125")]


@pytest.mark.parametrize(
    ("heading", "numbers", "decimal", "converted"),
    [
        ("Pt ID", ("1,098.425", "-12,345.5", "7.546"), ".", ("1098.425", "-12345.5", "7.546")),
        ("N.º", ("1.098,425", "1.234.567,5", "7,546"), ",", ("1098.425", "1234567.5", "7.546")),
        ("pt no", ("1 098,425", "1'098.425", "7,546"), "", None),  # two decimal marks
        ("Nº", ("1.098.425", "1,098.425", "1.23"), ".", ("1.098.425", "1098.425", "1.23")),
    ],
)
def test_thousands_with_a_decimal_mark_have_one_meaning(heading, numbers, decimal, converted):
    rows = ";".join((heading, "E", "N", "Z")), ";".join(("A", *numbers))
    proposal = propose("\r\n".join(rows).encode("utf-8-sig"))
    assert proposal.columns[0].target == "point"
    assert proposal.decimal == decimal
    if converted:
        assert proposal.convert()[1] == [("A", *converted)]


def test_the_user_assigns_columns():
    data = b"a,b,c,d\nP1,1.5,2.5,3.5\n"
    assert propose(data).missing == ["point", "x_m", "y_m", "z_m"]
    proposal = propose(data, targets=["point", "y_m", "x_m", "z_m"])
    assert proposal.missing == []
    assert proposal.convert() == (("point", "y_m", "x_m", "z_m"), [("P1", "1.5", "2.5", "3.5")])


def test_a_table_without_headings_is_assigned_by_position_and_unsure():
    proposal = propose(b"P1 1.5 2.5 3.5\nP2 1.6 2.6 3.6\n")
    assert proposal.heading_row is None
    assert [column.target for column in proposal.columns] == ["point", "x_m", "y_m", "z_m"]
    assert not any(column.is_sure for column in proposal.columns)
    assert len(proposal.rows) == 2


def test_titles_above_and_ragged_rows_do_not_disturb():
    data = b"Tank 7\nsurveyed today\npoint,x_m,y_m,z_m\nA,1.5,2.5,3.5\nB,1.5,2.5\nC,1.5,2.5,3.5,x\n"
    proposal = propose(data)
    assert proposal.heading_row == 3
    assert [row[0] for row in proposal.rows] == ["A", "B", "C"]
    assert all(len(row) == 5 for row in proposal.rows)


def test_a_spreadsheet_is_a_table():
    book = Workbook()
    book.active.append(["Ponto", "Este", "Norte", "Cota"])
    book.active.append(["P1", 1.5, 2.25, 3])
    buffer = BytesIO()
    book.save(buffer)
    proposal = propose(buffer.getvalue())
    assert proposal.missing == []
    assert proposal.convert()[1] == [("P1", "1.5", "2.25", "3")]


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (b"%PDF-1.7 ...", Kind.PDF),
        (b'{\n "format": "tankcal-record 40",', Kind.RECORD),
        (b"PK\x03\x04 damaged", Kind.UNKNOWN),
        (b"\0\1\2\3", Kind.UNKNOWN),
        (b"", Kind.UNKNOWN),
    ],
)
def test_other_files_are_known_by_their_content(data, kind):
    assert propose(data).kind is kind


def test_field_books_and_job_workbooks_are_known(tmp_path):
    book = (EXAMPLES / "wall-hits" / "field-book.gsi").read_bytes()
    assert propose(book).kind is Kind.FIELD_BOOK
    from job_builder import write_workbook

    path = write_workbook(tmp_path / "any name.xlsx", rings=2)
    assert propose(path.read_bytes()).kind is Kind.JOB_BOOK


def test_the_points_of_an_example_are_read_as_written():
    data = (EXAMPLES / "silva-1995" / "points.csv").read_bytes()
    headings, rows = propose(data).convert()
    assert {"point", "x_m", "y_m", "z_m"} <= set(headings)
    assert len(rows) == 119
