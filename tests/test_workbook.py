"""The output workbook: it says what the record says, prints well, and its calculator calculates."""

import copy
import json
import random
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
import zipfile
from bisect import bisect_right
from itertools import pairwise

import openpyxl
import pytest
from openpyxl.utils import get_column_letter

from tankcal.uncertainty import decimals_for
from tankcal.words import choice_sentence, load_words, sentence
from tankcal.workbook import write

# openpyxl does not know our data bars, and says so each time
pytestmark = pytest.mark.filterwarnings("ignore:.*extension is not supported:UserWarning")

# XlsxWriter stores 16 significant digits, one less than a double may need
SAME = 1e-15
DIP_CELL = "B5"
SHELL_CELL = "B28"
SHEETS = [
    "Certificate",
    "Capacity",
    "Proportional parts",
    "Dip calculator",
    "Courses and sections",
    "Corrections",
    "Points and residuals",
    "Uncertainty budget",
    "Choices and provenance",
    "Charts",
]
NAMES = {
    "height_m": "capacity_height",
    "volume_m3": "capacity_volume",
    "U_m3": "capacity_U",
    "k": "capacity_k",
    "u_m3": "capacity_standard_u",
}


@pytest.fixture(scope="module")
def record(example_record):
    return json.loads(example_record.read_text(encoding="utf-8"))


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


def test_every_row_of_the_table_is_the_record(book, record):
    for key, name in NAMES.items():
        values = [cell.value for cell in named(book, name)]
        assert values == pytest.approx(record["capacity"][key], rel=SAME, abs=0), key
    litres = [cell.value for cell in named(book, "capacity_litres_per_cm")]
    # 1 m2 of area is 1 m3 per metre of height is 10 L per centimetre
    assert litres == pytest.approx([10 * area for area in record["capacity"]["area_m2"]], rel=SAME)


def test_each_row_shows_two_digits_of_its_U_and_keeps_its_litres(book, record):
    columns = (named(book, "capacity_volume"), named(book, "capacity_U"))
    for volume, expanded, U in zip(*columns, record["capacity"]["U_m3"], strict=True):
        if U > 0:
            assert _decimals(expanded) == decimals_for(U)
            assert _decimals(volume) == max(decimals_for(U), 3)


def _decimals(cell):
    return len(cell.number_format.partition(".")[2])


def test_the_certificate_has_volume_U_and_k_on_one_line(book, record):
    line = row_of(book["Certificate"], "Capacity at the top of the table")
    capacity = record["capacity"]
    expected = [capacity[key][-1] for key in ("volume_m3", "U_m3", "k", "height_m")]
    assert [cell.value for cell in line[1:5]] == pytest.approx(expected, rel=SAME)
    assert "m³" in line[1].number_format
    assert "±" in line[2].number_format
    assert "k =" in line[3].number_format


def test_the_certificate_lists_tank_and_choices_and_leaves_the_authorisation_empty(book, record):
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


def test_the_notice_is_on_every_sheet_and_every_page(book, record, tmp_path):
    noticed = copy.deepcopy(record)
    noticed["job"]["certificate"]["notice"] = "DRAFT & TRIAL"
    book = written(noticed, tmp_path)
    for sheet in book:
        assert "DRAFT & TRIAL" in sheet["A2"].value
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


def test_every_point_is_listed_and_a_rejected_one_with_its_reason(record, tmp_path):
    words = load_words("en")
    record = with_a_rejected_point(record)
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
        ("Uncertainty budget", "budget", 5, "contribution_m3", 9),
        ("Uncertainty budget", "budget", 5, "share", 10),
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
    for warning in record["warnings"]:
        assert warning["text"] in said
    assert record["tankcal"] in said


def test_a_record_with_nothing_rejected_corrected_or_warned_is_written(record, tmp_path):
    bare = copy.deepcopy(record)
    bare |= {"rejected": [], "warnings": [], "corrections": []}
    bare["points"] = [point for point in bare["points"] if point["used"]]
    bare["job"]["datum"]["reference_height_m"] = None
    bare["job"]["certificate"] = {}
    book = written(bare, tmp_path)
    assert "None." in texts(book["Choices and provenance"])
    assert "reference_height" not in book.defined_names
    assert not any("Ullage" in text for text in texts(book["Dip calculator"]))


# how it is made


def test_the_book_opens_on_the_certificate(book):
    assert book.sheetnames == SHEETS
    assert book.active.title == "Certificate"


def test_every_sheet_prints_on_A4_with_tank_and_page(book, record):
    for sheet in book:
        assert sheet.page_setup.paperSize == 9
        assert sheet.sheet_properties.pageSetUpPr.fitToPage
        assert sheet.page_setup.fitToWidth in (None, 1)  # 1 is the default and not stored
        assert record["job"]["tank"]["id"][:20].replace("&", "&&") in sheet.oddHeader.left.text
        assert sheet.oddFooter.right.text == "Page &P of &N"
    for name in ("Capacity", "Points and residuals"):
        assert book[name].print_title_rows == "$4:$4"
        assert book[name].freeze_panes in ("A5", "B5")


def test_only_dip_and_shell_temperature_are_open(book):
    open_cells = [
        (sheet.title, cell.coordinate)
        for sheet in book
        for row in sheet
        for cell in row
        if not cell.protection.locked
    ]
    assert open_cells == [("Dip calculator", DIP_CELL), ("Dip calculator", SHELL_CELL)]
    assert all(sheet.protection.sheet and not sheet.protection.password for sheet in book)


def test_the_dip_cell_takes_only_heights_of_the_table(book, record):
    (rule,) = book["Dip calculator"].data_validations.dataValidation
    height = record["capacity"]["height_m"]
    assert (str(rule.sqref), rule.type) == (DIP_CELL, "decimal")
    assert float(rule.formula1) == height[0]
    assert height[-1] <= float(rule.formula2) <= height[-1] + 5e-4
    assert rule.prompt
    assert "not extended" in rule.error


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


def test_formulas_carry_the_record_as_their_result(path, record):
    results = openpyxl.load_workbook(path, data_only=True)["Dip calculator"]
    formulas = openpyxl.load_workbook(path)["Dip calculator"]
    capacity = record["capacity"]
    at = capacity["height_m"].index(pytest.approx(results[DIP_CELL].value, abs=1e-12))
    for label, key in (
        ("Volume", "volume_m3"),
        ("Expanded uncertainty U", "U_m3"),
        ("Coverage factor k", "k"),
        ("Standard uncertainty u", "u_m3"),
    ):
        assert row_of(formulas, label)[1].value.startswith("=")
        assert row_of(results, label)[1].value == pytest.approx(capacity[key][at], rel=SAME)
    assert all(
        results[cell.coordinate].value is not None
        for row in formulas
        for cell in row
        if cell.data_type == "f"
    )


HOSTILE = ["=cmd|' /C calc'!A0", "@SUM(1)", "http://x", "+1+1", "{=1}", "&P&N &9 9", "mailto:a@b"]


def test_user_text_stays_text(record, tmp_path):
    hostile = copy.deepcopy(record)
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
            assert cell.hyperlink is None
            if cell.data_type == "f":
                assert sheet.title == "Dip calculator"
                assert re.match(r"=IF\((ISNUMBER|ISBLANK|OR)\(", cell.value)
    for name in ("Certificate", "Choices and provenance", "Points and residuals"):
        assert set(HOSTILE) <= set(texts(book[name]))
    assert book["Capacity"].oddFooter.center.text == f"Certificate {HOSTILE[1]}"


def test_the_same_record_gives_the_same_bytes(record, path, tmp_path):
    write(record, tmp_path / "again.xlsx")
    assert (tmp_path / "again.xlsx").read_bytes() == path.read_bytes()
    created = openpyxl.load_workbook(path).properties.created
    issued = record["job"]["certificate"].get("date_of_issue") or record["job"]["survey"]["date"]
    assert created.date().isoformat() == issued
    with zipfile.ZipFile(path) as archive:
        assert {info.date_time[0] for info in archive.infolist()} == {1980}


@pytest.mark.parametrize(("issued", "year"), [("2024-02-30", 2023), ("soon", 2023), (None, 2023)])
def test_a_date_of_issue_that_is_none_gives_way_to_the_survey(record, tmp_path, issued, year):
    undated = copy.deepcopy(record)
    undated["job"]["certificate"]["date_of_issue"] = issued
    undated["job"]["survey"]["date"] = "2023-05-06"
    assert written(undated, tmp_path).properties.created.year == year


def test_a_path_that_cannot_be_written_is_said(record, tmp_path):
    with pytest.raises(OSError, match="cannot be written"):
        write(record, tmp_path / "missing" / "capacity.xlsx")


# what it calculates, in LibreOffice


def between_rows(heights):
    """Dips between the rows: the middle of some, and seeded places in others."""
    draw = random.Random(1995)
    pairs = list(pairwise(heights))
    return [low + draw.choice([0.5, draw.random()]) * (high - low) for low, high in pairs[::7]]


def refused_dips(heights):
    return {
        "below": heights[0] - 0.01,
        "just below": heights[0] - 0.0001,
        "above": heights[-1] + 0.01,
        "just above": max(heights[-1], round(heights[-1], 3)) + 0.0001,
        "far above": 1e9,
        "text": "4.75 m",
        "text that looks like a number": "4.75",
        "blank": None,
        "spaces": "  ",
        "truth value": True,
    }


def with_dips(path, dips, out):
    """Copy the calculator's column once for each dip; openpyxl saves formulas without results."""
    book = openpyxl.load_workbook(path)
    sheet = book["Dip calculator"]
    column = [cell for (cell,) in sheet["B4" : f"B{sheet.max_row}"] if cell.value is not None]
    for place, dip in enumerate(dips, start=6):
        letter = get_column_letter(place)
        for cell in column:
            value = cell.value
            if cell.coordinate == DIP_CELL:
                value = dip
            elif cell.data_type == "f":
                value = re.sub(r"\bB(\d+)\b", rf"{letter}\1", value)
            sheet[f"{letter}{cell.row}"] = value
    sheet[DIP_CELL] = dips[1]
    sheet[SHELL_CELL] = 55.0
    book.save(out)


@pytest.fixture(scope="module")
def recalculated(path, record, tmp_path_factory):
    """(the workbook as LibreOffice recalculated it, all dips in the order of their columns)."""
    soffice = shutil.which("soffice") or shutil.which("libreoffice")
    if soffice is None:
        pytest.skip("LibreOffice (soffice) is not installed: the formulas cannot be recalculated")
    folder = tmp_path_factory.mktemp("recalculated")
    heights = record["capacity"]["height_m"]
    dips = [*heights, *between_rows(heights), *refused_dips(heights).values()]
    dips.append(round(heights[-1], 3))  # the last row, as it is printed
    source = folder / "dips.xlsx"
    with_dips(path, dips, source)
    stored = openpyxl.load_workbook(source, data_only=True)["Dip calculator"]
    assert row_of(stored, "Volume")[1].value is None  # nothing to copy: it must be calculated
    (folder / "out").mkdir()
    subprocess.run(
        [
            soffice,
            f"-env:UserInstallation={(folder / 'profile').as_uri()}",
            "--headless",
            *("--convert-to", "xlsx", "--outdir", str(folder / "out"), str(source)),
        ],
        check=True,
        capture_output=True,
        timeout=120,
    )
    return openpyxl.load_workbook(folder / "out" / "dips.xlsx", data_only=True), dips


def result_lines(recalculated):
    """{label: results in the order of the dips}."""
    book, dips = recalculated
    sheet = book["Dip calculator"]
    return {
        row[0].value: [cell.value for cell in row[5 : 5 + len(dips)]]
        for row in sheet.iter_rows(min_row=6)
    }


def test_the_dip_cell_was_changed_and_recalculated(recalculated, record):
    book, dips = recalculated
    line = row_of(book["Dip calculator"], "Volume")
    assert book["Dip calculator"][DIP_CELL].value == dips[1]
    assert line[1].value == pytest.approx(record["capacity"]["volume_m3"][1], rel=1e-12)


def test_a_warm_shell_holds_ctsh_times_the_volume(recalculated, record):
    book, _ = recalculated
    sheet, job = book["Dip calculator"], record["job"]
    warmer = 55.0 - job["table"]["reference_temperature_c"]
    ctsh = (1 + job["material"]["expansion_per_k"] * warmer) ** 2
    assert sheet["B29"].value == pytest.approx(ctsh, rel=1e-14)
    assert sheet["B30"].value == pytest.approx(ctsh * record["capacity"]["volume_m3"][1], rel=1e-13)


def test_recalculated_at_every_row_it_is_the_record(recalculated, record):
    capacity, lines = record["capacity"], result_lines(recalculated)
    for label, key in (
        ("Volume", "volume_m3"),
        ("Expanded uncertainty U", "U_m3"),
        ("Coverage factor k", "k"),
        ("Standard uncertainty u", "u_m3"),
    ):
        # LibreOffice stores 15 digits, far more than any row shows
        values = lines[label][: len(capacity[key])]
        assert values == pytest.approx(capacity[key], rel=1e-12, abs=1e-12), label
    for key, name in NAMES.items():
        values = [cell.value for cell in named(recalculated[0], name)]
        assert values == pytest.approx(capacity[key], rel=1e-14)


def test_between_rows_it_interpolates_and_takes_the_larger_U(recalculated, record):
    """Second method: the interpolation written out here, row by row."""
    capacity, lines = record["capacity"], result_lines(recalculated)
    heights = capacity["height_m"]
    dips = between_rows(heights)
    assert len(dips) > len(heights) / 8
    for place, dip in enumerate(dips, start=len(heights)):
        low = bisect_right(heights, dip) - 1
        part = (dip - heights[low]) / (heights[low + 1] - heights[low])
        volume = (1 - part) * capacity["volume_m3"][low] + part * capacity["volume_m3"][low + 1]
        assert lines["Volume"][place] == pytest.approx(volume, rel=1e-12)
        larger = max((low, low + 1), key=lambda row: capacity["U_m3"][row])
        assert lines["Expanded uncertainty U"][place] == pytest.approx(capacity["U_m3"][larger])
        assert lines["Coverage factor k"][place] == pytest.approx(capacity["k"][larger])
        assert lines["Check"][place] == "Within the table."


def test_ullage_is_the_reference_height_less_the_dip(recalculated, record):
    reference = record["job"]["datum"]["reference_height_m"]
    if reference is None:
        pytest.skip("the example has no reference height")
    lines = result_lines(recalculated)
    expected = [reference - height for height in record["capacity"]["height_m"]]
    ullage = lines["Ullage (reference height less dip)"][: len(expected)]
    assert ullage == pytest.approx(expected, abs=1e-9)


def test_it_refuses_what_is_not_a_height_of_the_table(recalculated, record):
    heights, lines = record["capacity"]["height_m"], result_lines(recalculated)
    refused = refused_dips(heights)
    first = len(heights) + len(between_rows(heights))
    says = {
        "below": "below the table, which begins at 0.000 m",
        "above": f"above the table, which ends at {heights[-1]:.3f} m",
        "far above": "above the table",
        "text": "not a number",
        "blank": "type a dip",
    }
    for place, name in enumerate(refused, start=first):
        message = lines["Check"][place]
        assert message.startswith("Refused: "), name
        assert says.get(name, "") in message
        for label in ("Volume", "Expanded uncertainty U", "Coverage factor k"):
            assert lines[label][place] == "–", name


def test_the_last_height_as_it_is_printed_is_the_last_row(recalculated, record):
    lines = result_lines(recalculated)
    assert lines["Check"][-1] == "Within the table."
    last = record["capacity"]["volume_m3"][-1]
    area = record["capacity"]["area_m2"][-1]
    assert lines["Volume"][-1] == pytest.approx(last, abs=0.0005 * area)
