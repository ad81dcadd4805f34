"""The output workbook: it says what the record says, prints well, and user text stays text."""

import copy
import json
import re
import xml.etree.ElementTree as ET
import zipfile
from decimal import Decimal

import openpyxl
import pytest
from sheet_links import is_in_index
from xlsxwriter.worksheet import Worksheet

from tankcal.report.workbook import write
from tankcal.report.workbook.book import NumberRow, Sheet
from tankcal.report.workbook.look import Column, _longest_number
from tankcal.text.digits import decimals_of
from tankcal.text.words import choice_sentence, load_words, sentence, translate_record

# openpyxl does not know our data bars, and says so each time
pytestmark = pytest.mark.filterwarnings("ignore:.*extension is not supported:UserWarning")

# XlsxWriter stores 16 significant digits, one less than a double may need
SAME = 1e-15
SHEETS = [
    "Certificate",
    "Capacity",
    "Proportional parts",
    "Capacity mm",
    "Dip calculator",
    "Workings",
    "Quantity",
    "Quantity workings",
    "Covariance factor",
    "Covariance weights",
    "Courses and sections",
    "Corrections",
    "Deadwood, bottom, roof",
    "Uncertainty budget",
    "Deliveries",
    "Monte Carlo",
    "Points and residuals",
    "Choices and provenance",
    "Charts",
    "Deviations",
]
PLAIN = (
    "Capacity mm",
    "Covariance factor",
    "Covariance weights",
)  # a heading, and rows for programs
NAMES = {
    "height_m": "capacity_height",
    "volume_m3": "capacity_volume",
    "stated_U_m3": "capacity_U",
    "k": "capacity_k",
    "u_m3": "capacity_standard_u",
    "low_m3": "capacity_low",
    "high_m3": "capacity_high",
}
WORD_OF = {"gum": "GUM", "monte_carlo": "Monte Carlo"}


@pytest.fixture(scope="module")
def record(example_record):
    return json.loads(example_record.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def short(short_record):
    """The example with fewer rows: of what is beside the table, and a fifth of its cells."""
    return json.loads(short_record.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def path(record, tmp_path_factory):
    path = tmp_path_factory.mktemp("workbook") / "capacity.xlsx"
    write(record, path)
    return path


@pytest.fixture(scope="module")
def book(path):
    return openpyxl.load_workbook(path)


def written(record, folder):
    """The workbook of a record, as openpyxl sees it: formulas as text, no results."""
    write(record, folder / "capacity.xlsx")
    return openpyxl.load_workbook(folder / "capacity.xlsx")


def named(book, name):
    """The cells of a named range, from the top down."""
    ((sheet, cells),) = book.defined_names[name].destinations
    block = book[sheet][cells]
    return [row[0] for row in block] if isinstance(block, tuple) else [block]


def texts(sheet):
    return [cell.value for row in sheet for cell in row if isinstance(cell.value, str)]


def row_of(sheet, label):
    return next(row for row in sheet if row[0].value == label)


# what it says


@pytest.mark.slow
def test_every_row_of_the_table_is_the_record(book, record):
    by_gum = [code == "gum" for code in record["capacity"]["interval"]]
    for key, name in NAMES.items():
        values = [cell.value for cell in named(book, name)]
        expected = record["capacity"][key]
        if key == "k":  # no k beside U by Monte Carlo
            assert [value not in ("", None) for value in values] == by_gum
            values, expected = (
                [value for value, is_kept in zip(column, by_gum, strict=True) if is_kept]
                for column in (values, expected)
            )
        assert values == pytest.approx(expected, rel=SAME, abs=0), key
    intervals = [cell.value for cell in named(book, "capacity_interval")]
    assert intervals == [WORD_OF[code] for code in record["capacity"]["interval"]]
    litres = [cell.value for cell in named(book, "capacity_litres_per_cm")]
    # 1 m2 of area is 1 m3 per metre of height is 10 L per centimetre
    assert litres == pytest.approx([10 * area for area in record["capacity"]["area_m2"]], rel=SAME)


def test_each_row_shows_two_digits_of_its_U_and_keeps_its_litres(book, record):
    columns = (named(book, "capacity_volume"), named(book, "capacity_U"))
    for volume, expanded, U in zip(*columns, record["capacity"]["stated_U_m3"], strict=True):
        if U > 0:
            assert _decimals(expanded) == decimals_of(U)
            assert _decimals(volume) == max(decimals_of(U), 3)


@pytest.mark.slow
def test_litres_have_a_U_of_two_digits(record, tmp_path):
    """417 L are printed 420 L, as in the papers; no number format makes that of 417."""
    spec = record["job"]["table"] | {"volume_unit": "L"}
    in_litres = record | {"job": record["job"] | {"table": spec}}
    sheet = written(in_litres, tmp_path)["Capacity"]
    headings = {cell.value: cell.column for cell in sheet[4]}
    column = headings["Expanded uncertainty U (L)"]
    for row, U in enumerate(record["capacity"]["stated_U_m3"], start=5):
        cell = sheet.cell(row, column)
        assert cell.value == pytest.approx(1000 * U, rel=0.05)
        shown = Decimal(f"{cell.value:.{_decimals(cell)}f}")
        assert len(shown.normalize().as_tuple().digits) <= 2, (row, shown)


def _decimals(cell):
    return len(cell.number_format.partition(".")[2])


def test_the_certificate_has_volume_U_and_k_on_one_line(book, record):
    line = row_of(book["Certificate"], "Capacity at the top of the table")
    capacity = record["capacity"]
    assert capacity["interval"][-1] == "gum"
    expected = [capacity[key][-1] for key in ("volume_m3", "stated_U_m3", "k", "height_m")]
    assert [cell.value for cell in line[1:5]] == pytest.approx(expected, rel=SAME)
    assert "m³" in line[1].number_format
    assert "±" in line[2].number_format
    assert "k =" in line[3].number_format


def test_certificate_sheet_lists_tank_and_choices(book, record):
    sheet = book["Certificate"]
    words = load_words("en")
    said = texts(sheet)
    assert record["job"]["tank"]["id"] in said
    for value in record["job"]["tank"]["details"].values():
        assert str(value) in said
    for choice in record["choices"]:
        assert choice_sentence(words, choice) in said
    for key in ("authorised_by", "signature", "place_and_date"):
        line = row_of(sheet, words["labels"][key])
        assert all(cell.value is None for cell in line[1:])


@pytest.mark.slow
def test_the_notice_is_on_every_sheet_and_every_page(short, tmp_path):
    noticed = copy.deepcopy(short)
    noticed["job"]["certificate"]["notice"] = "DRAFT & TRIAL"
    book = written(noticed, tmp_path)
    for sheet in book:
        assert sheet.title in PLAIN or "DRAFT & TRIAL" in sheet["A2"].value
        assert "DRAFT && TRIAL" in sheet.oddHeader.center.text
    assert "DRAFT & TRIAL" in texts(book["Certificate"])
    del noticed["job"]["certificate"]["notice"]
    for sheet in written(noticed, tmp_path):
        assert not any("DRAFT" in text for text in texts(sheet))


def with_a_rejected_point(record):
    """A copy of the record in which the second point was found to be clutter."""
    rejecting = copy.deepcopy(record)
    point = rejecting["points"][1]
    place = {key: point[key] for key in ("point", "x_m", "y_m", "z_m")}
    point |= {"used": False, "residual_m": None, "section": None, "cov_m2": None}
    rejecting["rejected"].append(
        {**place, "residual_m": 0.25, "w": 7.5, "reason": "snooping", "row": 3}
    )
    return rejecting


@pytest.mark.slow
def test_points_sheet_lists_all_with_rejection_reasons(short, tmp_path):
    words = load_words("en")
    record = with_a_rejected_point(short)
    book = written(record, tmp_path)
    listed = {row[0].value: row for row in book["Points and residuals"].iter_rows(min_row=5)}
    assert len(listed) == len(record["points"])
    for point in record["points"]:
        row = listed[point["point"]]
        assert [cell.value for cell in row[3:6]] == pytest.approx(
            [point["x_m"], point["y_m"], point["z_m"]], rel=SAME
        )
        assert row[7].value == ("yes" if point["used"] else "no")
        if point["used"]:
            assert row[6].value == pytest.approx(1000 * point["residual_m"], rel=1e-12)
            assert not row[8].value
    for point in record["rejected"]:
        row = listed[point["point"]]
        assert row[8].value == sentence(words, "reasons", point["reason"])
        assert row[6].value == pytest.approx(1000 * point["residual_m"])
        assert [row[9].value, row[10].value] == [point["w"], point["row"]]


@pytest.mark.parametrize(
    ("sheet", "rows", "first", "key", "column"),
    [
        ("Courses and sections", "courses", 6, "volume_m3", 13),
        ("Corrections", "corrections", 5, "size_m3", 3),
        ("Uncertainty budget", "budget", 5, "contribution_m3", 10),
        ("Uncertainty budget", "budget", 5, "share", 11),
    ],
)
def test_the_papers_are_the_record(book, record, sheet, rows, first, key, column):
    cells = [book[sheet].cell(first + index, column) for index in range(len(record[rows]))]
    expected = [row[key] for row in record[rows]]
    assert [cell.value for cell in cells] == pytest.approx(expected, rel=SAME)


def test_provenance_names_every_file_by_its_hash(book, record):
    said = texts(book["Choices and provenance"])
    for file in record["files"]:
        assert file["sha256"] in said
    for warning in translate_record(load_words("en"), record)["warnings"]:
        assert warning["text"] in said
    assert record["tankcal"] in said


@pytest.mark.slow
def test_workbook_of_record_without_rejections_or_warnings(short, tmp_path):
    bare = copy.deepcopy(short)
    bare |= {"rejected": [], "warnings": [], "corrections": []}
    bare["points"] = [point for point in bare["points"] if point["used"]]
    bare["job"]["datum"]["reference_height_m"] = None
    bare["job"]["certificate"] = {}
    book = written(bare, tmp_path)
    assert "None." in texts(book["Choices and provenance"])
    assert "reference_height" not in book.defined_names


# how it is made


def test_the_book_opens_on_the_dip_calculator(book):
    assert book.sheetnames == SHEETS
    assert book.active.title == "Dip calculator"


def test_whole_workbook_prints_certificate_and_table(book):
    """Hidden sheets are not printed with the whole workbook."""
    shown = [sheet.title for sheet in book if sheet.sheet_state == "visible"]
    assert shown[:4] == ["Certificate", "Capacity", "Proportional parts", "Dip calculator"]
    assert {"Charts", "Uncertainty budget", "Corrections"} <= set(shown)
    assert not {"Capacity mm", "Monte Carlo", "Deviations", "Covariance factor"} & set(shown)


def test_first_sheet_has_a_link_to_each_sheet_that_shows(book):
    first = book["Certificate"]
    links = {cell.value: cell.hyperlink.location for row in first for cell in row if cell.hyperlink}
    shown = [sheet.title for sheet in book if sheet.sheet_state == "visible"]
    assert links == {name: f"'{name}'!A1" for name in shown[1:]}
    said = texts(first)
    assert all(sheet.title in said for sheet in book if sheet.sheet_state != "visible")
    assert first.print_area == f"'Certificate'!$A$1:$E${first.print_area.rpartition('$')[2]}"


@pytest.mark.slow
def test_headline_is_in_the_unit_of_the_job(short, tmp_path):
    in_litres = copy.deepcopy(short)
    in_litres["job"]["table"]["volume_unit"] = "L"
    top = short["capacity"]["volume_m3"][-1]
    values = [cell for row in written(in_litres, tmp_path)["Certificate"] for cell in row]
    (headline,) = (one for one in values if one.value == pytest.approx(1000 * top, rel=1e-12))
    assert headline.number_format.endswith('L"')


def test_every_sheet_prints_tank_and_page(book, record):
    for sheet in book:
        assert record["job"]["tank"]["id"][:20].replace("&", "&&") in sheet.oddHeader.left.text
        assert sheet.oddFooter.right.text == "Page &P of &N"


def test_tables_have_headings_and_names_that_excel_takes(path, book):
    names = [name.lower() for name in book.defined_names]
    with zipfile.ZipFile(path) as archive:
        for part in archive.namelist():
            if part.startswith("xl/tables/"):
                table = ET.fromstring(archive.read(part))
                names.append(table.get("name").lower())
                columns = table.iter(table.tag.replace("}table", "}tableColumn"))
                headings = [column.get("name").lower() for column in columns]
                assert len(headings) == len(set(headings)) >= 2
    assert len(names) == len(set(names))
    assert "capacity_table" in names


HOSTILE = ["=cmd|' /C calc'!A0", "@SUM(1)", "http://x", "+1+1", "{=1}", "&P&N &9 9", "mailto:a@b"]


@pytest.mark.slow
def test_user_text_stays_text(short, tmp_path):
    hostile = copy.deepcopy(short)
    hostile["job"]["tank"]["id"] = HOSTILE[0]
    hostile["job"]["tank"]["details"] = dict(zip("abcdefg", HOSTILE, strict=True))
    hostile["job"]["certificate"] = {"number": HOSTILE[1], "laboratory": HOSTILE[5]}
    for point, text in zip(hostile["points"], HOSTILE, strict=False):
        point["point"] = text
    hostile["courses"][0]["course"] = HOSTILE[0]
    hostile["warnings"] = [{"file": t, "row": None, "column": t, "text": t} for t in HOSTILE]
    book = written(hostile, tmp_path)
    for sheet in book:
        for cell in (cell for row in sheet for cell in row):
            assert is_in_index(cell, book) or cell.hyperlink is None
            if cell.data_type == "f":
                assert sheet.title in (
                    *("Dip calculator", "Workings", "Quantity", "Quantity workings"),
                )
                assert not any(text in cell.value for text in HOSTILE)
    for name in ("Certificate", "Choices and provenance", "Points and residuals"):
        assert set(HOSTILE) <= set(texts(book[name]))
    assert book["Capacity"].oddFooter.center.text == f"Certificate No. {HOSTILE[1]}"


class CellByCell(Worksheet):
    """Second method: XlsxWriter's own sheet."""

    def write_numbers(self, first_row, column, values, looks):
        for row, (value, look) in enumerate(zip(values, looks, strict=True), first_row):
            if value is not None:
                self.write_number(row, column, value, look)

    def write_number_rows(self, first_row, rows):
        for row, (values, looks) in enumerate(rows, first_row):
            for column, look in enumerate(looks):
                self.write_numbers(row, column, values[column : column + 1], [look])


@pytest.mark.slow
def test_columns_of_numbers_are_the_cells_of_xlsxwriter(short, tmp_path, monkeypatch):
    write(short, tmp_path / "columns.xlsx")
    monkeypatch.setattr("tankcal.report.workbook.book.Sheet", CellByCell)
    write(short, tmp_path / "cells.xlsx")
    ours, theirs = (parts_of(tmp_path / name) for name in ("columns.xlsx", "cells.xlsx"))
    # A row without blanks between its cells has no places: its cells follow each other.
    whole = re.compile(rb'<c r="A(\d+)" s="\d+"><v>[^<]*</v></c>(?:<c r="[A-Z]+\1" s="\d+"><v>'
                       rb"[^<]*</v></c>)*(?=</row>)")  # fmt: skip
    bare = 0
    for name, content in theirs.items():
        if ours[name] != content:
            content = whole.sub(lambda cells: re.sub(rb' r="[A-Z]+\d+"', b"", cells[0]), content)
            bare += 1
        assert ours[name] == content
    assert 0 < bare <= 3


def parts_of(path):
    """Content of each file in a workbook."""
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.mark.parametrize(
    ("first_row", "value", "error"),
    [(0, float("nan"), TypeError), (0, float("inf"), TypeError), (2**20, 1.0, ValueError)],
)
def test_a_number_that_no_cell_holds_is_refused(first_row, value, error):
    with pytest.raises(error):
        Sheet().write_numbers(first_row, 0, [None, value], [None, None])
    with pytest.raises(error):
        Sheet().write_number_rows(first_row, [NumberRow([None, value], (None, None))] * 2)


@pytest.mark.parametrize(
    ("cells", "digits", "length"),
    [
        ([0.5, -1e-9, 3.0], 3, 6),  # -0.000
        ([1.0, 123.4, None], [0, 2, 5], 6),
        ([-5.0, 99.996], 2, 6),
        ([1.0, "none"], [2, 2], 4),
        ([None], "0.0E+00", 7),
        ([], 2, 0),
    ],
)
def test_the_longest_number_of_a_column(cells, digits, length):
    assert _longest_number(Column("", cells, digits)) == length


@pytest.mark.slow
def test_the_same_record_gives_the_same_bytes(short, tmp_path):
    path, again = tmp_path / "once.xlsx", tmp_path / "again.xlsx"
    write(short, path)
    write(short, again)
    assert again.read_bytes() == path.read_bytes()
    created = openpyxl.load_workbook(path).properties.created
    issued = short["job"]["certificate"].get("date_of_issue") or short["job"]["survey"]["date"]
    assert created.date().isoformat() == issued
    with zipfile.ZipFile(path) as archive:
        assert {info.date_time[0] for info in archive.infolist()} == {1980}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("issued", "year"),
    [
        ("2024-02-30", 2023),
        pytest.param("soon", 2023, marks=pytest.mark.study),
        pytest.param(None, 2023, marks=pytest.mark.study),
    ],
)
def test_impossible_date_of_issue_is_replaced_by_survey_date(short, tmp_path, issued, year):
    undated = copy.deepcopy(short)
    undated["job"]["certificate"]["date_of_issue"] = issued
    undated["job"]["survey"]["date"] = "2023-05-06"
    assert written(undated, tmp_path).properties.created.year == year


@pytest.mark.slow
def test_a_path_that_cannot_be_written_is_said(short, tmp_path):
    with pytest.raises(OSError, match="cannot be written"):
        write(short, tmp_path / "missing" / "capacity.xlsx")
