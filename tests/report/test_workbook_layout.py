"""How the sheets are made: printed on A4, headings in sight, tables that can be sorted and read."""

import datetime
import re

import openpyxl
import pandas as pd
import pytest
from openpyxl.utils import range_boundaries
from workbook_records import KINDS

from tankcal.report import workbook
from tankcal.report.workbook.look import lines_of, pieces_of
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

pytestmark = pytest.mark.filterwarnings("ignore:.*extension is not supported:UserWarning")
LONG = 30  # rows: a longer table does not fit on a page in landscape
SHORT_DATE = "mm-dd-yy"  # Excel's format 14, which each system shows in its own order


@pytest.fixture(scope="module")
def records(records_of_kinds):
    return records_of_kinds


@pytest.fixture(scope="module")
def books(records, tmp_path_factory):
    """{kind: its workbook as openpyxl reads it}."""
    folder = tmp_path_factory.mktemp("books")
    for kind, record in records.items():
        workbook.write(record, folder / f"{kind}.xlsx")
    return {kind: openpyxl.load_workbook(folder / f"{kind}.xlsx") for kind in records}


def tables_of(sheet):
    """(first column, heading row, last column, last row) of each table, from 1."""
    return [range_boundaries(table.ref) for table in sheet.tables.values()]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_sheet_is_one_page_wide_on_A4(books, kind):
    for sheet in books[kind]:
        assert sheet.page_setup.paperSize == 9
        assert sheet.sheet_properties.pageSetUpPr.fitToPage
        assert sheet.page_setup.fitToWidth in (None, 1)  # 1 is the default and not stored
        assert sheet.page_setup.fitToHeight in (None, 0)  # the calculator is one page
        assert sheet.sheet_properties.tabColor is not None


@pytest.mark.slow
def test_headings_of_long_tables_stay_and_are_printed_again(books):
    found = set()
    for sheet in (sheet for book in books.values() for sheet in book):
        tables = tables_of(sheet)
        if len(tables) != 1 or tables[0][3] - tables[0][1] <= LONG:
            continue
        head = tables[0][1]
        found.add(sheet.title)
        assert sheet.print_title_rows == f"${head}:${head}", sheet.title
        assert int(re.sub(r"\D", "", sheet.freeze_panes)) == head + 1, sheet.title
    assert {"Capacity", "Points and residuals", "Observations"} <= found


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_cell_of_a_table_is_merged(books, kind):
    merged = 0
    for sheet in books[kind]:
        for cells in sheet.merged_cells.ranges:
            merged += 1
            for left, top, right, bottom in tables_of(sheet):
                beside = cells.max_col < left or cells.min_col > right
                assert beside or cells.max_row < top or cells.min_row > bottom, (sheet.title, cells)
    assert merged


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_headings_and_numbers_fit_their_columns(books, kind):
    for sheet in books[kind]:
        for left, top, right, _ in tables_of(sheet):
            for cell in sheet[top][left - 1 : right]:
                width = sheet.column_dimensions[cell.column_letter].width
                for word in pieces_of(cell.value):
                    assert lines_of(word, width, bold=True) == 1, (sheet.title, word, width)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_pandas_reads_every_table_as_it_stands(books, kind, tmp_path):
    """Headings over columns of numbers or of texts; "–" is what does not exist."""
    books[kind].save(tmp_path / "read.xlsx")
    with pd.ExcelFile(tmp_path / "read.xlsx") as file:
        read = {
            (sheet.title, place): pd.read_excel(
                file, sheet_name=sheet.title, header=place[1] - 1, nrows=place[3] - place[1],
                usecols=range(place[0] - 1, place[2]), na_values="–",
            )
            for sheet in books[kind]
            for place in tables_of(sheet)
        }  # fmt: skip
    assert read
    for (_, (_, top, _, bottom)), table in read.items():
        assert len(table) == bottom - top
        assert not any(str(name).startswith("Unnamed") for name in table.columns)


@pytest.mark.slow
def test_the_capacity_table_read_by_pandas_is_the_record(books, records, tmp_path):
    books["uncertain"].save(tmp_path / "read.xlsx")
    table = pd.read_excel(tmp_path / "read.xlsx", sheet_name="Capacity", header=3)
    capacity = records["uncertain"]["capacity"]
    for column, key in ((0, "height_m"), (1, "volume_m3"), (2, "stated_U_m3")):
        assert table.iloc[:, column].to_numpy() == pytest.approx(capacity[key], rel=1e-15)


@pytest.mark.slow
def test_dates_are_dates_in_the_order_of_the_reader(records, tmp_path):
    dated = dict(records["uncertain"])
    job = dated["job"]
    dated["job"] = job | {"certificate": {"date_of_issue": "2024-03-01", "calibrated": "March"}}
    dated["job"]["survey"] = job["survey"] | {"date": "2024-02-28"}
    workbook.write(dated, tmp_path / "dated.xlsx")
    cells = {
        row[0].value: row[1]
        for row in openpyxl.load_workbook(tmp_path / "dated.xlsx")["Certificate"]
    }
    for label, day in (("Date of issue", 1), ("Date of survey", 28)):
        assert cells[label].value == datetime.datetime(2024, 3 if day == 1 else 2, day)
        assert cells[label].number_format == SHORT_DATE
    assert cells["Calibrated"].value == "March"


@pytest.mark.parametrize(
    ("text", "width", "lines"),
    [
        ("", 10, 1),
        ("short", 10, 1),
        ("two words", 9, 2),
        ("one\ntwo", 40, 2),
        ("WWWWWWWWWWWWWWWWWWWW", 10, 5),  # no place to break: within the word
        ("word " * 1000, 10, 27),  # as high as Excel allows
    ],
)
def test_lines_that_a_text_takes(text, width, lines):
    assert lines_of(text, width) == lines


@pytest.mark.slow
def test_deviations_are_drawn_from_the_residuals_of_the_record(books, records):
    record, book = records["photographed"], books["photographed"]
    sheet = book["Deviations"]
    rows = [[cell.value for cell in row] for row in sheet.iter_rows(min_row=5)]
    expected = sorted(
        (section["section"], azimuth, 1000 * residual)
        for section in record["sections"]
        for azimuth, residual in zip(section["azimuth_deg"], section["residual_m"], strict=True)
    )
    found = sorted((row[2], row[3], row[4]) for row in rows)
    assert [one[0] for one in found] == [one[0] for one in expected]
    assert [one[1:] for one in found] == [pytest.approx(one[1:]) for one in expected]
    charts = book["Charts"]._charts
    assert len(charts) == 2 + len({section["course"] for section in record["sections"]})


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_capacity_table_is_printed_in_a_size_that_is_read(records, language, tmp_path):
    """At 80 % of 10 point or more, on A4 in portrait."""
    workbook.write(records["uncertain"], tmp_path / "capacity.xlsx", language)
    book = openpyxl.load_workbook(tmp_path / "capacity.xlsx")
    sheet = book[load_words(language)["workbook"]["sheets"]["capacity"]]
    pixels = sum(
        (one.max - one.min + 1) * round(7 * one.width) for one in sheet.column_dimensions.values()
    )
    margins = sheet.page_margins.left + sheet.page_margins.right
    assert sheet.page_setup.orientation == "portrait"
    assert (210 / 25.4 - margins) / (pixels / 96) >= 0.8


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_all_rows_of_the_capacity_table_have_one_height(records, language, tmp_path):
    """Also where the interval of some rows is Monte Carlo's, and where some are not for use."""
    for kind in ("uncertain", "furnished"):
        workbook.write(records[kind], tmp_path / "capacity.xlsx", language)
        book = openpyxl.load_workbook(tmp_path / "capacity.xlsx")
        sheet = book[load_words(language)["workbook"]["sheets"]["capacity"]]
        ((_, top, _, last),) = tables_of(sheet)
        heights = {sheet.row_dimensions[row].height for row in range(top + 1, last + 1)}
        assert len(heights) == 1, (kind, heights)
        assert heights.pop() >= 1.5 * 10  # points, of digits that are 10 points high
    assert set(records["uncertain"]["capacity"]["interval"]) == {"gum", "monte_carlo"}
    assert not all(records["furnished"]["capacity"]["for_use"])


def test_a_line_may_break_after_a_hyphen():
    assert pieces_of("Incerteza-padrão u (m³) -1") == ["Incerteza-", "padrão", "u", "(m³)", "-1"]


@pytest.mark.slow
def test_calculator_states_units_that_differ_from_table(books):
    said = {kind: books[kind]["Dip calculator"]["A2"].value for kind in ("lying", "uncertain")}
    assert "metres and cubic metres" in said["lying"]  # a table in feet and barrels
    assert "metres" not in said["uncertain"]
