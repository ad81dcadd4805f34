"""Numbers in the marks of a language, and as a spreadsheet and the CSV files show them."""

import copy
import csv
import json
import re
import shutil
import subprocess

import numpy as np
import openpyxl
import pytest
import xlsxwriter
from matplotlib.figure import Figure
from test_digits import CASES

from tankcal.report import blocks, workbook
from tankcal.report.outputs import write_tables
from tankcal.report.paper import Column
from tankcal.report.plain import PlainPaper
from tankcal.report.web import block_html
from tankcal.report.workbook.book import number_format
from tankcal.text.digits import PROGRAM, fixed, format_with_u
from tankcal.text.words import choice_sentence, load_words, percent, sentence

# openpyxl does not know our data bars, and says so
pytestmark = pytest.mark.filterwarnings("ignore:.*extension is not supported:UserWarning")
PORTUGUESE = {"decimal": ",", "group": ".", "least": 4}


@pytest.fixture
def words():
    """The English words with Portuguese marks: what a language's file sets."""
    found = copy.deepcopy(load_words("en"))
    found["language"]["marks"] = PORTUGUESE
    return found


@pytest.fixture
def paper(words):
    return PlainPaper(words)


def test_numbers_with_portuguese_marks(paper):
    assert paper.number(1249.765, "m3", u=1.439) == "1.249,8\N{NO-BREAK SPACE}m³"
    assert paper.number(0.25, "m", decimals=3) == "0,250\N{NO-BREAK SPACE}m"
    assert paper.number(12345.678, digits=6) == "12.345,7"
    assert paper.plain(1234.5, "px") == "1.234,5\N{NO-BREAK SPACE}px"
    assert paper.percent(0.9545) == "95,45\N{NO-BREAK SPACE}%"


def test_sentences_with_portuguese_marks(paper, words):
    assert percent(words, 0.995) == "99,5\N{NO-BREAK SPACE}%"
    choice = {"code": "head", "value": 1025.5}
    assert "of 1.025,5 kg/m³" in choice_sentence(words, choice)
    assert "above 3,29 were" in choice_sentence(words, {"code": "snooping", "value": 3.29053})
    assert sentence({**words, "g": {"c": "{value} m"}}, "g", "c", 1.5) == "1,5 m"
    assert "50 of 1.370 rows" in paper.word("texts.only_worst", shown=50, all=1370)


def test_a_table_with_portuguese_marks_lines_up(paper):
    """Second method: the width behind each decimal comma, as the page shows it, is the same."""
    rows = [{"volume_m3": 1234.5678, "u_m3": 0.034}, {"volume_m3": 12345.6, "u_m3": 12.0}]
    block = paper.table("capacity", rows, [Column("volume_m3", "m3", u="u_m3")], coverage="")
    assert block.data["rows"] == [["1.234,568"], ["12.346"]]
    cells = re.findall(r'<td class="decimal">(.*?)</td>', block_html(block.data))
    blank = "\N{PUNCTUATION SPACE}" + 3 * "\N{FIGURE SPACE}"
    assert cells == ["1.234,568", "12.346" + blank]


def test_axes_use_the_decimal_mark_but_names_do_not(paper):
    figure = Figure()
    left, right = figure.subplots(1, 2)
    left.plot([0.0, 0.5], [0.0, 0.25])
    right.set(xticks=[0, 1], xticklabels=["T.1", "T.2"])
    svg = paper.figure(figure, "capacity_curves").data["svg"]
    texts = re.findall(r"<text[^>]*>([^<]*)<", svg)
    assert {"0,0", "0,25", "T.1"} <= set(texts)
    assert not [text for text in texts if re.fullmatch(r"\d\.\d+", text)]


@pytest.mark.slow
def test_texts_of_the_workbook_with_portuguese_marks(short_record, words, monkeypatch, tmp_path):
    """Its number formats know no language: a spreadsheet shows them with its own marks."""
    monkeypatch.setattr(workbook, "load_words", lambda language: words)
    record = json.loads(short_record.read_text(encoding="utf-8"))
    workbook.write(record, tmp_path / "capacity.xlsx")
    book = openpyxl.load_workbook(tmp_path / "capacity.xlsx", data_only=True)
    top = f"{record['capacity']['height_m'][-1]:.3f}".replace(".", ",")
    assert f"volume at {top}\N{NO-BREAK SPACE}m" in book["Uncertainty budget"]["A2"].value
    assert "from 0,000 m to 9,500 m" in book["Dip calculator"]["D5"].value.replace(
        "\N{NO-BREAK SPACE}", " "
    )
    assert book["Capacity"]["B6"].number_format.startswith("0.000")


@pytest.fixture(scope="module")
def as_shown(tmp_path_factory):
    """{(value, decimals): text} of cells as LibreOffice shows them."""
    soffice = shutil.which("soffice") or shutil.which("libreoffice")
    if soffice is None:
        pytest.skip("LibreOffice (soffice) is not installed: nothing shows the cells")
    rng = np.random.default_rng(11)
    found = [
        (value, format_with_u(value, u, least=0)) for value, u, *_ in CASES if value is not None
    ]
    cells = [(value, one.decimals) for value, one in found if 1e-9 < abs(value) < 1e9]
    cells += [(float(f"{value:.3f}5"), 3) for value in rng.uniform(0, 1000, 300)]  # halves
    cells += [(float(value), int(rng.integers(0, 9))) for value in rng.normal(0, 1e3, 300)]
    folder = tmp_path_factory.mktemp("shown")
    file = xlsxwriter.Workbook(folder / "shown.xlsx")
    sheet = file.add_worksheet()
    sheet.set_column(0, 0, 40)
    for row, (value, decimals) in enumerate(cells):
        look = file.add_format({"num_format": number_format(decimals)})
        sheet.write_number(row, 0, value, look)
    file.close()
    profile = f"-env:UserInstallation={(folder / 'profile').as_uri()}"
    csv_as_shown = "csv:Text - txt - csv (StarCalc):44,34,76,1,,0,false,true"
    convert = ["--headless", "--convert-to", csv_as_shown, "--outdir", str(folder)]
    command = [soffice, profile, *convert, str(folder / "shown.xlsx")]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    with open(folder / "shown.csv", encoding="utf-8", newline="") as shown:
        return dict(zip(cells, (row[0] for row in csv.reader(shown)), strict=True))


@pytest.mark.slow
def test_a_spreadsheet_rounds_as_the_paper_does(as_shown):
    """Other program: number formats of LibreOffice against `fixed`, halves included."""
    assert len(as_shown) > 600
    for (value, decimals), text in as_shown.items():
        assert text == fixed(value, decimals, PROGRAM), (value, decimals)


def test_volumes_of_the_csv_table_have_two_digits_of_U_at_least(example_record, tmp_path):
    record = json.loads(example_record.read_text(encoding="utf-8"))
    capacity = record["capacity"] | {
        "height_m": [0.0, 0.01, 0.02],
        "k": [2.0] * 3,
        "for_use": [True] * 3,
        "volume_m3": [0.0, 0.01234567891, 1.23456789],
        "u_m3": [0.0, 1.7e-7, 0.0012],
        "U_m3": [0.0, 3.4e-7, 0.0024],
        "low_m3": [0.0, 0.0123, 1.232],
        "high_m3": [0.0, 0.0124, 1.237],
        "interval": ["gum"] * 3,
        "stated_U_m3": [0.0, 3.4e-7, 0.0024],
    }
    write_tables(record | {"capacity": capacity, "densities": []}, tmp_path)
    with open(tmp_path / "capacity.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    shown = [(row["volume_m3"], row["u_m3"], row["U_m3"]) for row in rows]
    assert shown == [
        ("0.00000000", "0.00000000", "0.00000000"),
        ("0.01234568", "0.00000017", "0.00000034"),
        ("1.234568", "0.001200", "0.002400"),
    ]


def test_a_table_of_ones_own_lines_up_by_its_mark():
    block = blocks.table(["a"], [["1,5"], ["10"]], align=["decimal"], decimal_mark=",")
    assert re.findall(r'decimal">([^<]*)</td>', block_html(block.data)) == ["1,5", "10\u2008\u2007"]
