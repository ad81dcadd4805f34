"""Workbooks made to harm are refused in one line, before any of them is parsed, soon and small.

The limits of time and memory are generous for a loaded machine: without the refusals these files
cost a minute or a gigabyte.
"""

import io
import time
import tracemalloc
import zipfile

import openpyxl
import pytest
from job_builder import job_parts, write_book
from spoilt import problems_of

from tankcal.job import excel
from tankcal.job.excel import MAX_COLUMNS, Unreadable, column_letters, parse, read_sheets

SHEET, STRINGS = "xl/worksheets/sheet2.xml", "xl/sharedStrings.xml"
SECONDS, BYTES = 40.0, 150_000_000  # openpyxl's; ours takes one to three seconds


@pytest.fixture
def book(tmp_path):
    return write_book(tmp_path / "job.xlsx", job_parts())


def packed(path, parts=(), **changes):
    """Bytes of the workbook with parts {name: content} added, and others changed.

    changes  sheet or strings: XML that is put at the end of the rows or the texts
    """
    ends = {SHEET: ("sheet", b"</sheetData>"), STRINGS: ("strings", b"</sst>")}
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(path) as old,
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as new,
    ):
        for name in old.namelist():
            content = old.read(name)
            if name in ends and ends[name][0] in changes:
                key, end = ends[name]
                content = content.replace(end, changes[key] + end)
            new.writestr(name, content)
        for name, content in dict(parts).items():
            new.writestr(name, content)
    return stream.getvalue()


def refusal(path, data):
    """The one line of a workbook that is refused, told within the limits."""
    path.write_bytes(data)
    tracemalloc.start()
    begin = time.process_time()
    (problem,) = problems_of(path)
    seconds, (_, peak) = time.process_time() - begin, tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert seconds < SECONDS
    assert peak < BYTES
    assert problem.file == "job.xlsx"
    return problem.expected


def rows(count, cell):
    """XML of rows from 200 on, each with one cell."""
    return b"".join(b'<row r="%d">%s</row>' % (r, cell(r)) for r in range(200, 200 + count))


# megabytes each, so made only where they are tested
OVERSIZED = {
    "formulas": lambda: rows(110_000, lambda r: b'<c r="A%d"><f>A1+%d</f></c>' % (r, r * r % 977)),
    "values": lambda: rows(110_000, lambda r: b'<c r="A%d"><v>%d</v></c>' % (r, r * r % 977)),
    "far right": lambda: rows(110_000, lambda r: b'<c r="CV%d"><v>%d</v></c>' % (r, r * r % 977)),
    "very many values": lambda: 7 * OVERSIZED["values"](),
    "many texts": lambda: b"".join(
        b"<si><t>%d</t></si>" % (i * i % 99_991) for i in range(700_000)
    ),
    "long text": lambda: b"<si><t>" + b"x" * 3_000_000 + b"</t></si>",
    "attributes": lambda: b'<row r="999" ' + b" ".join(b'a%d=""' % i for i in range(400_000)),
    "blanks": lambda: b" " * 20_000_000,
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("part", "oversized", "words"),
    [
        ("sheet", "formulas", "more than 100000 rows in sheet 'points'"),
        pytest.param(
            "sheet", "values", "more than 100000 rows in sheet 'points'", marks=pytest.mark.study
        ),
        pytest.param(
            "sheet", "far right", "more than 100000 rows in sheet 'points'", marks=pytest.mark.study
        ),
        ("sheet", "very many values", "holds more cells than a job needs"),
        ("strings", "many texts", "holds more cells than a job needs"),
        ("strings", "long text", "a text of more than a million characters"),
        ("sheet", "attributes", "a text of more than a million characters"),
        ("sheet", "blanks", "unpacks to more than 300 times its size"),
    ],
)
def test_oversized_input_is_refused_quickly(book, part, oversized, words):
    assert words in refusal(book, packed(book, **{part: OVERSIZED[oversized]()}))


@pytest.mark.slow
def test_an_archive_that_unpacks_to_more_than_a_job_needs(book):
    noise = bytes(range(256)) * 2000 + b"\0" * 20_000_000
    parts = {f"xl/media/image{i}.png": noise for i in range(6)}
    assert "unpacks to 1" in refusal(book, packed(book, parts))


@pytest.mark.slow
def test_very_many_parts(book):
    parts = {f"xl/media/{i}": b"" for i in range(6000)}
    assert "expected at most 5000" in refusal(book, packed(book, parts))


PART_OF_ANOTHER_FILE = [
    ("xl/vbaProject.bin", "macros"),
    ("xl/macrosheets/sheet1.xml", "macros"),
    ("xl/externalLinks/externalLink1.xml", "links to other workbooks"),
    ("xl/connections.xml", "connections to data elsewhere"),
    ("xl/queryTables/queryTable1.xml", "connections to data elsewhere"),
    ("xl/embeddings/oleObject1.bin", "embedded files"),
    ("xl/activeX/activeX1.xml", "controls"),
    ("xl/workbook.bin", "binary workbook (.xlsb)"),
]


@pytest.mark.slow(after=7)
@pytest.mark.parametrize(("name", "words"), PART_OF_ANOTHER_FILE)
def test_unneeded_workbook_parts_are_refused(book, name, words):
    said = refusal(book, packed(book, {name: b"<x/>"}))
    assert words in said
    assert "save it" in said


@pytest.mark.slow(after=9)
@pytest.mark.parametrize(
    "content",
    [
        b'<!DOCTYPE x [<!ENTITY a "b">]><x>&a;</x>',
        b'<?xml version="1.0"?><!DOCTYPE x SYSTEM "file:///etc/passwd"><x/>',
        b"<x>" + b" " * (excel.CHUNK_BYTES - 8) + b"<y/><!DOCTYPE x></x>",
        '<?xml version="1.0" encoding="utf-16"?><x/>'.encode("utf-16"),
        b'<?xml version="1.0" encoding="utf-7"?><x/>',
    ],
)
@pytest.mark.parametrize("name", ["xl/drawings/drawing1.xml", "docProps/custom.xml"])
def test_declarations_in_any_part(book, name, content):
    assert "(DOCTYPE, ENTITY, encoding)" in refusal(book, packed(book, {name: content}))


def test_a_declaration_in_a_part_of_another_name_is_not_followed(book):
    """A part without .xml in its name is not looked at beforehand; its parsing stops there."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as new:
        new.writestr("part", b'<!DOCTYPE x [<!ENTITY a "b">]><x>&a;</x>')
    with zipfile.ZipFile(stream) as opened, pytest.raises(Unreadable, match="damaged"):
        parse(opened, "part", {}, {})


def test_the_same_part_twice(book):
    with pytest.warns(UserWarning, match="Duplicate name"):
        data = packed(book, {SHEET: b"<worksheet/>"})
    assert "the same part twice" in refusal(book, data)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9, 0.999])
def test_a_truncated_workbook(book, share):
    data = book.read_bytes()
    said = refusal(book, data[: int(share * len(data))])
    assert "not an Excel workbook (.xlsx), or damaged" in said


def test_an_open_document_under_another_name(book):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as new:
        new.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        new.writestr("content.xml", "<x/>")
    assert "OpenDocument file (.ods)" in refusal(book, stream.getvalue())


@pytest.mark.parametrize("ending", [".xls", ".xlsm", ".xlsb", ".ods"])
def test_other_workbooks_are_to_be_saved_again(tmp_path, ending):
    path = tmp_path / f"job{ending}"
    path.write_bytes(b"PK")
    (problem,) = problems_of(path)
    assert problem.expected == (
        f"found a {ending} file; open it in Excel or LibreOffice and save it as .xlsx"
    )


@pytest.mark.parametrize("place", ["XFE1", "a1", "1", "A-1"])
def test_a_cell_that_no_sheet_has(book, place):
    said = refusal(book, packed(book, sheet=b'<row><c r="%s"><v>1</v></c></row>' % place.encode()))
    assert "damaged" in said


# ---- and what is sound is read as openpyxl reads it


@pytest.mark.slow
def test_a_sheet_formatted_to_its_end_is_read(book):
    blank = rows(400_000, lambda r: b'<c r="A%d" s="0"/><c r="B%d" s="0"/>' % (r, r))
    data = packed(book, sheet=blank)
    begin = time.process_time()
    (sheet,) = read_sheets(data, lambda title: title == "points")
    assert time.process_time() - begin < SECONDS
    assert len(sheet.grid.rows) == 121


def test_every_kind_of_cell_is_read_as_openpyxl_reads_it(tmp_path):
    """Second method: openpyxl."""
    import datetime

    book = openpyxl.Workbook()
    sheet = book.active
    values = [
        *("text", " text ", "a_x000D_b", "é&<>\"'", "=1+1", 0, 1, -2.5, 1e-300, 12345678901234.5),
        *(True, False, datetime.datetime(2024, 5, 31), datetime.datetime(1900, 1, 1, 12, 30)),
        *(datetime.time(13, 45), datetime.timedelta(hours=30), "２", "line\nbreak", None),
    ]
    for row, value in enumerate(values, 2):
        sheet.cell(row, 3).value = value
    sheet.cell(3, MAX_COLUMNS).value = "last"
    path = tmp_path / "cells.xlsx"
    book.save(path)
    ours = dict(read_sheets(path.read_bytes(), lambda title: True)[0].grid.rows)
    theirs = openpyxl.load_workbook(path, data_only=True).active
    for row, value in enumerate(values, 2):
        if value == "=1+1":
            assert "formula without its result" in ours[row][2].complaint
        elif value is None:
            assert row not in ours
        else:
            expected = "a\rb" if value == "a_x000D_b" else theirs.cell(row, 3).value
            assert ours[row][2] == expected
            assert type(ours[row][2]) is type(expected)
    assert ours[3][MAX_COLUMNS - 1] == "last"


def test_letters_of_columns():
    assert [column_letters(number) for number in (1, 26, 27, 702, 703)] == [
        *("A", "Z", "AA", "ZZ", "AAA")
    ]
