"""Files far beyond any table are refused in one line, before anything is made of their lines."""

import shutil

import pypdf
import pytest
from conftest import EXAMPLE
from simulated_fieldbooks import two_stands
from written_fieldbooks import WRITERS

from tankcal import load
from tankcal.errors import InputError
from tankcal.job import folder
from tankcal.job.tables import MAX_COLUMNS, MAX_LINES, Log
from tankcal.products.fieldbooks.detection import read_book
from tankcal.products.linter import grids
from tankcal.products.linter.grids import MOST_CONTENT
from tankcal.products.linter.linting import lint


@pytest.fixture
def unread(monkeypatch):
    """Fail when a line of a table is looked at."""

    def split(text):
        raise AssertionError("lines were made of a text that has too many")

    monkeypatch.setattr(folder, "split_lines", split)
    monkeypatch.setattr(grids, "split_lines", split)


def refusal(read):
    with pytest.raises(InputError) as refused:
        read()
    [line] = str(refused.value).splitlines()
    return line


@pytest.mark.parametrize("end", ["\n", "\r", "\r\n"])
def test_a_table_of_a_job_has_a_last_line(end, unread):
    log = Log()
    text = f"point,x_m{end}" + f"1,2{end}" * MAX_LINES
    assert folder.read_csv("points.csv", text.encode(), ",", ".", log) is None
    assert [str(one) for one in log.problems] == [
        "points.csv: 500001 lines; expected at most 500000"
    ]


def test_as_many_lines_as_allowed_are_counted_with_and_without_a_last_end():
    for text in ("a\n" * MAX_LINES, "a\n" * MAX_LINES + "a"):
        assert folder.has_too_many_lines("", text, Log()) == text.endswith("a")


@pytest.mark.slow
def test_a_heading_of_a_million_columns(tmp_path):
    job = shutil.copytree(EXAMPLE, tmp_path / "job")
    row = ",".join(["1"] * 1_000_000)
    (job / "points.csv").write_text(f"{row}\n{row}\n")
    expected = f"points.csv, row 1: 1000000 cells; expected at most {MAX_COLUMNS}"
    assert refusal(lambda: load(job)) == expected


def test_a_table_to_be_looked_through(tmp_path, unread):
    path = tmp_path / "old.csv"
    path.write_text("dip,volume\n" + "1,1\n" * grids.MOST_LINES)
    assert refusal(lambda: lint(path)) == "old.csv: 100001 lines; expected at most 100000"


def test_a_field_book():
    log = Log()
    line = b"110001+00000001 21.102+00000000 22.102+09000000 31..00+00010000\n"
    assert read_book("a.gsi", line * 100_001, log) is None
    assert [str(one) for one in log.problems] == ["a.gsi: 100001 lines; expected at most 100000"]


def test_jobxml_has_many_lines_for_each_reading():
    log = Log()
    text = WRITERS["jxl"](two_stands(hits=4)).replace("\n", "\n" * 100_001, 1)
    book = read_book("a.jxl", text.encode(), log)
    assert log.problems == []
    assert book.format == "jxl"


def write_pdf(path, pages, content):
    """Write a PDF whose pages have this content and a font F1."""
    name, mapping = pypdf.generic.NameObject, pypdf.generic.DictionaryObject
    font = {"/Type": "/Font", "/Subtype": "/Type1", "/BaseFont": "/Helvetica"}
    font = mapping({name(key): name(value) for key, value in font.items()})
    resources = mapping({name("/Font"): mapping({name("/F1"): font})})
    written = pypdf.PdfWriter()
    for _ in range(pages):
        page = written.add_blank_page(595, 842)
        drawn = pypdf.generic.DecodedStreamObject()
        drawn.set_data(content)
        page[name("/Resources")] = resources
        page[name("/Contents")] = written._add_object(drawn)
    written.write(path)


@pytest.mark.slow
def test_pages_that_draw_more_than_a_table(tmp_path):
    path = tmp_path / "old.pdf"
    write_pdf(path, 2, b"BT (1.0 2.0) Tj ET\n" * (MOST_CONTENT // 30))
    expected = "more than 2.5 MB of text and drawings on its pages"
    assert expected in refusal(lambda: lint(path))


def test_prose_is_no_heading(monkeypatch):
    """The words of prose are not examined: their number made a report of 200 pages take 29 s."""

    def examine(cell):
        raise AssertionError(f"{cell!r} was examined")

    monkeypatch.setattr(grids, "heading_of", examine)
    monkeypatch.setattr(grids, "is_unit", examine)
    assert (
        grids.tables_in_text(["The volume at each height of 3 m is printed below.\n" * 900]) == []
    )


@pytest.mark.slow
def test_pages_that_take_too_long(tmp_path, monkeypatch):
    monkeypatch.setattr(grids, "MOST_SECONDS", 1)
    path = tmp_path / "old.pdf"
    write_pdf(path, 20, b"BT /F1 8 Tf\n" + b"1 0 0 1 20 700 Tm (7) Tj\n" * 4000 + b"ET")
    expected = "old.pdf: not read within 1 seconds; expected only the pages of the table"
    assert refusal(lambda: lint(path)) == expected
