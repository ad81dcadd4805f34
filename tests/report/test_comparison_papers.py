"""The papers of a comparison: what they show, in every language, whatever was compared."""

import csv
import json
import re
import shutil
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from compared_tables import HOSTILE, KINDS, hostile, plain, without_uncertainty
from invented_language import bracketed, without_brackets
from paper_pages import lone_headings, pages_of, sparse_pages
from paper_words import texts_in, texts_of

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.products.recalibration import comparison as verdicts
from tankcal.report import comparison
from tankcal.report.comparison import ComparisonPaper, rebuild, write_comparison
from tankcal.report.comparison.paper import (
    correlation,
    delivery_rows,
    pages,
    side_rows,
    verdict,
    write,
)
from tankcal.report.comparison.tables import (
    CODES,
    MOST_ROWS,
    select_rows,
    waterfall_table,
    worst_row,
)
from tankcal.text.shipped import DEFAULT, LANGUAGES
from tankcal.text.words import load_words

PROGRAM = {"tankcal", "comparison", "mm", "xlsx"}  # and units


# ---- what is shown


def test_the_waterfall_adds_up():
    """Property: saved to 1e-9 m3; as printed to the last digits, each rounded by itself."""
    found = plain()
    for one in found["waterfall"]:
        parts = [one[f"{key}_m3"] for key in ("former", *CODES, "tank")]
        assert sum(parts) == pytest.approx(one["new_m3"], abs=1e-9)
    columns = waterfall_table(found).on_paper()
    printed = ComparisonPaper(found).table("waterfall", found["waterfall"], columns)
    for _, *cells in printed.data["rows"]:
        former, *parts, new = (float(one.replace("\N{MINUS SIGN}", "-")) for one in cells)
        assert former + sum(parts) == pytest.approx(new, abs=0.5e-4 * len(cells))


def test_steps_that_move_nothing_have_no_column():
    keys = [one.key for one in waterfall_table(plain()).columns]
    assert "roof_m3" not in keys
    assert {"zero_m3", "temperature_m3", "head_m3", "tank_m3"} <= set(keys)
    assert "roof_m3" in [one.key for one in waterfall_table(hostile()).columns]


def test_a_selection_has_ends_joints_and_the_worst_row():
    found = plain()
    dips = found["rows"]["height_m"]
    chosen = [row["height_m"] for row in select_rows(found)]
    assert len(chosen) <= MOST_ROWS
    assert chosen == sorted(set(chosen))
    assert {dips[0], dips[-1], worst_row(found)["height_m"]} <= set(chosen)
    joints = [one["top_m"] for one in found["courses"]]
    assert all(min(abs(dip - joint) for dip in chosen) < 0.0501 for joint in joints)
    found["rows"] = {key: values[::60] for key, values in found["rows"].items()}
    assert [row["height_m"] for row in select_rows(found)] == found["rows"]["height_m"]


def test_dips_in_inches_are_selected_evenly():
    found = plain()
    dips = 0.0254 * np.arange(4, 4 + 166)
    found["rows"]["height_m"] = dips.tolist()
    found["courses"] = []
    chosen = [row["height_m"] for row in select_rows(found)]
    assert 20 <= len(chosen) <= MOST_ROWS
    assert np.ptp(np.diff(chosen)[2:-2]) < 0.2


def test_the_worst_row_is_one_that_is_judged():
    found = plain()
    found["rows"]["E_n"][0] = -99.0  # below judged_from_m
    found["rows"]["E_n"][-1], found["rows"]["for_use"][-1] = 98.0, False
    found["rows"]["E_n"][-3] = -3.5
    assert worst_row(found)["E_n"] == -3.5
    unknown = without_uncertainty()
    assert worst_row(unknown)["d_m3"] == max(unknown["rows"]["d_m3"], key=abs)
    found["judged_from_m"] = 1e3
    assert worst_row(found) is None


@pytest.mark.slow
def test_that_no_row_is_judged_is_said():
    found = plain() | {"judged_from_m": 1e3}
    assert any("No row is assessed" in text for text in texts_of(pages(ComparisonPaper(found))))


def test_a_delivery_that_is_worst_by_both_is_one_row():
    found = plain()
    places = {(o["minimum_m"], o["low_m"], o["high_m"]) for o in found["deliveries"]}
    rows = delivery_rows(ComparisonPaper(found))
    assert len(rows) == len(places)
    one = dict(found["deliveries"][0], by="E_n")
    found["deliveries"] = [one | {"by": "relative"}, one]
    assert [row["by"] for row in delivery_rows(ComparisonPaper(found))] == ["both"]


def test_correlation_is_said_with_who_declared_it():
    said = correlation(ComparisonPaper(plain()))
    assert "declared" in said
    assert "NOT declared" not in said
    undeclared = correlation(ComparisonPaper(hostile()))
    assert "NOT declared" in undeclared
    assert "c\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}\N{MINUS SIGN}0.40" in undeclared
    assert "cannot be computed" in correlation(ComparisonPaper(without_uncertainty()))


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_reason_of_a_verdict_has_a_sentence(language):
    """Codes as the verdict's module gives them; a reason without words says code and values."""
    source = Path(verdicts.__file__).read_text(encoding="utf-8")
    codes = set(re.findall(r'Reason\(\s*"(\w+)"', source))
    codes |= set(re.findall(r'"(limit_exceeded|in_guard_band|age\w*_exceeded)"', source))
    assert len(codes) >= 12
    paper = ComparisonPaper(plain(), language)
    assert codes <= paper.words["reasons"].keys()
    for code in paper.words["reasons"]:
        base = code.removesuffix("_of_delivery")
        assert not paper.reason({"code": base, "values": {}}).startswith(f"{base}:")
    assert paper.reason({"code": "unheard", "values": {"x": 2}}) == "unheard: x 2"


def test_a_reason_says_its_numbers():
    paper = ComparisonPaper(plain(), "pt-BR")
    values = {"limit": "top", "value": 0.41234, "most": 0.3, "unit": "%"}
    said = paper.reason({"code": "limit_exceeded", "values": values})
    assert "volume no topo" in said
    assert "0,412\N{NO-BREAK SPACE}%" in said
    assert "0,3\N{NO-BREAK SPACE}%" in said
    infinite = {"E_n": None, "c": 1.0, "high_m": 8.39, "low_m": 2.0, "d_m3": 1.2}
    said = paper.reason({"code": "tank_differs", "values": infinite})
    assert "∞" in said
    assert "entrega" in said
    assert "+1,200\N{NO-BREAK SPACE}m³" in said


def test_what_nobody_declared_is_called_so():
    rows = {row["what"]: row for row in side_rows(ComparisonPaper(without_uncertainty()))}
    assert rows["Laboratory"]["former"] == "not declared"
    assert rows["Laboratory"]["new"] != "not declared"


@pytest.mark.slow
def test_what_is_lacking_and_what_was_read_is_said():
    texts = texts_of(pages(ComparisonPaper(without_uncertainty())))
    assert any("former.reference_temperature_c" in one for one in texts)
    assert any(
        "includes the head of a liquid of 853.1\N{NO-BREAK SPACE}kg/m³" in one for one in texts
    )
    assert any("does not include liquid head" in one for one in texts)


def test_the_notice_of_a_record_stands_on_every_page():
    paper = ComparisonPaper(plain() | {"notice": "EXAMPLE"})
    assert paper.head()[0].data["notice"] == "EXAMPLE"


def test_a_house_rule_keeps_its_own_texts():
    """Those of a shipped rule are translated; one of a laboratory with its file's name is not."""
    found = plain()
    assert ComparisonPaper(found, "es").record["rule"]["name"].startswith("Francia")
    found["rule"]["name"] = "Ours"
    assert ComparisonPaper(found, "es").record["rule"]["name"] == "Ours"
    assert "NOT read" in " ".join(texts_of(verdict(ComparisonPaper(hostile()))))


# ---- words


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_text_is_of_the_words(kind, monkeypatch):
    """An invented language: what stands outside its brackets is the user's, or a number."""
    english, found = load_words("en"), KINDS[kind]()
    words = bracketed(english) | {"language": english["language"]}
    monkeypatch.setattr(comparison, "load_words", lambda _: words)
    own = texts_in(found) | texts_in(english["language"]["dates"])
    for text in texts_of(pages(ComparisonPaper(found))):
        rest = without_brackets(text)
        for word in re.findall(r"[^\W\d_]{4,}", rest):
            assert word.lower() in PROGRAM or any(word in one for one in own), text


@pytest.mark.parametrize("language", [one for one in LANGUAGES if one != DEFAULT])
def test_languages_have_the_same_words(language):
    def keys(words):
        return {k: keys(v) if isinstance(v, dict) else None for k, v in words.items()}

    assert keys(load_words(language)["comparison"]) == keys(load_words(DEFAULT)["comparison"])


# ---- files


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """{kind: its folder}, each in another language."""
    folder = tmp_path_factory.mktemp("compared")
    languages = dict(zip(KINDS, LANGUAGES, strict=True))
    for kind, language in languages.items():
        write_comparison(KINDS[kind](), folder / kind, language)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_pages_are_filled(written, kind):
    shown = pages_of(written / kind / "comparison.pdf")
    language = dict(zip(KINDS, LANGUAGES, strict=True))[kind]
    headings = set(load_words(language)["comparison"]["headings"].values())
    assert 3 <= len(shown) <= 7
    assert sparse_pages(shown) == []
    assert lone_headings(shown, headings) == []


@pytest.mark.slow
def test_a_pdf_is_archival_and_holds_what_it_was_made_from(written):
    pypdf = pytest.importorskip("pypdf")
    folder = written / "plain"
    pdf = pypdf.PdfReader(folder / "comparison.pdf")
    metadata = pdf.trailer["/Root"]["/Metadata"].get_object().get_data().decode("utf-8")
    assert re.search(r"pdfaid:part(>|=\")3", metadata)
    assert re.search(r"pdfuaid:part(>|=\")1", metadata)
    held = {name: content[0] for name, content in pdf.attachments.items()}
    names = ("comparison.json", "comparison.xlsx")
    assert held == {name: (folder / name).read_bytes() for name in names}
    assert json.loads(held["comparison.json"]) == plain()


@pytest.mark.slow
def test_the_page_has_every_row(written):
    page = (written / "plain" / "comparison.html").read_text(encoding="utf-8")
    assert page.count("<tr>") > len(plain()["rows"]["height_m"])
    hostile_page = (written / "hostile" / "comparison.html").read_text(encoding="utf-8")
    assert "<script>alert" not in hostile_page
    assert "&lt;script&gt;alert" in hostile_page


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_csv_files_are_what_was_saved(written, kind):
    found = KINDS[kind]()
    with open(written / kind / "rows.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(found["rows"]["height_m"])
    for key in ("height_m", "former_on_basis_m3", "d_m3", "E_n"):
        read = [None if row[key] == "" else float(row[key]) for row in rows]
        saved = [np.nan if one is None else one for one in found["rows"][key]]
        read = [np.nan if one is None else one for one in read]
        np.testing.assert_allclose(read, saved, rtol=1e-10)


@pytest.mark.slow
def test_a_workbook_has_every_row_as_numbers(tmp_path):
    found = plain()
    write(ComparisonPaper(found, "pt-BR"), tmp_path / "c.xlsx")
    book = openpyxl.load_workbook(tmp_path / "c.xlsx")
    assert book.sheetnames == ["Veredito", "Linhas", "Passos", "Entregas", "Raios"]
    heads, *rows = list(book["Linhas"].iter_rows(min_row=4, values_only=True))
    assert heads[:3] == ("Altura, m", "Anterior, m³", "Anterior, na base, m³")
    assert [row[0] for row in rows] == found["rows"]["height_m"]
    assert [row[4] for row in rows] == pytest.approx(found["rows"]["d_m3"], rel=1e-13)
    assert book["Linhas"]["B5"].number_format == "0.000"


@pytest.mark.slow
def test_no_text_of_a_user_is_a_formula(tmp_path):
    write(ComparisonPaper(hostile()), tmp_path / "c.xlsx")
    cells = [
        cell
        for sheet in openpyxl.load_workbook(tmp_path / "c.xlsx")
        for row in sheet
        for cell in row
    ]
    assert [cell.value for cell in cells if cell.data_type == "f"] == []
    assert any(str(cell.value).startswith(HOSTILE[:12]) for cell in cells)


@pytest.mark.slow
def test_papers_are_made_again_from_the_file_alone(written, tmp_path, capsys):
    """The same bytes in the same language; another language by --language."""
    folder = tmp_path / "c"
    shutil.copytree(written / "plain", folder)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert main(["report", str(folder), "--language", LANGUAGES[0], "--quiet"]) == 0
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert main(["report", str(folder / "comparison.json"), "--language", "es", "--quiet"]) == 0
    assert "Comparación de dos tablas" in (folder / "comparison.html").read_text(encoding="utf-8")
    assert (folder / "comparison.json").read_bytes() == before["comparison.json"]


def test_a_folder_of_others_stays(tmp_path):
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="mine"):
        write_comparison(plain(), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "cannot be read"),
        ("[]", "format"),
        ('{"format": "tankcal-record/1"}', "format"),
        ('{"format": "tankcal-comparison/1"}', "without"),
    ],
)
def test_what_is_no_comparison_is_refused(tmp_path, text, said):
    path = tmp_path / "comparison.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        rebuild(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("change", [{"verdict": "unheard"}, {"waterfall": []}])
def test_a_damaged_comparison_is_told_in_one_line(tmp_path, change):
    path = tmp_path / "comparison.json"
    path.write_text(json.dumps(plain() | change), encoding="utf-8")
    with pytest.raises(InputError, match="lacks the content") as told:
        rebuild(path, tmp_path / "out")
    assert len(told.value.problems) == 1
    assert [one.name for one in tmp_path.iterdir()] == ["comparison.json"]


@pytest.mark.parametrize("language", ["pt-BR", "es"])
def test_clauses_of_a_shipped_rule_are_in_the_language(language):
    paper = ComparisonPaper(plain(), language)
    said = {one["clause"] for one in (*paper.record["legal"], *paper.record["ages"])}
    known = paper.words["rule_texts"]["france_2020_recalibration"]["clauses"]
    assert said & set(known.values())
    assert not said & set(known)
