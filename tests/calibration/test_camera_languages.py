"""The camera's papers in each language: every text is of its words, every number has its marks."""

import json
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET

import pytest
from camera_sets import sets
from invented_language import bracketed, without_brackets
from paper_cells import blocks_of_cells

from tankcal.calibration.product import read_limits, shipped_limits
from tankcal.calibration.stability.comparison import compare
from tankcal.errors import TankcalError
from tankcal.record import camera as stability_json
from tankcal.record.versions import CAMERA_KINDS
from tankcal.report import camera as camera_papers
from tankcal.report.camera import paper as papers
from tankcal.report.camera.figures import widen_to_decades
from tankcal.report.camera.paper import shorten
from tankcal.report.notebook import join_templates
from tankcal.report.numbers import UNITS
from tankcal.text.shipped import DEFAULT, LANGUAGES, shipped_folder
from tankcal.text.words import load_words

pytest_plugins = ("camera_results",)
OTHERS = [language for language in LANGUAGES if language != DEFAULT]
MADE_FROM = {"version": "7", "notice": "", "files": [{"file": "own.toml", "sha256": "0a" * 32}]}
NO_TEXT = {"kind", "align", "language", "decimal_mark", "part", "svg"}  # of a block
DATA = ("name", "a", "b", "camera", "photos", "calibration", "calibrations", "point", "grade")
DATA += ("largest_point", "largest_photo", "file", "sha256", "message", "failed", "no_volume")
SVG_TEXT = "{http://www.w3.org/2000/svg}text"


def texts_in(value):
    """Every text of plain data."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return [text for one in value for text in texts_in(one)]
    return [value] if isinstance(value, str) else []


def data_in(value):
    """Every text of a result that is shown as it is: names, files, messages of the program."""
    if isinstance(value, list):
        return [text for one in value for text in data_in(one)]
    if not isinstance(value, dict):
        return []
    own = [text for key in DATA if key in value for text in texts_in(value[key])]
    return own + [text for one in value.values() for text in data_in(one)]


def letters_in(texts):
    """Runs of two letters or more."""
    parts = "".join(c if c.isalpha() else " " for text in texts for c in f"{text} ").split()
    return {part for part in parts if len(part) > 1}


def shown_in(block):
    """Every text of a block that a reader sees, those of its figure too."""
    texts = texts_in({key: value for key, value in block.items() if key not in NO_TEXT})
    if not block.get("svg"):
        return texts
    return texts + ["".join(one.itertext()) for one in ET.fromstring(block["svg"]).iter(SVG_TEXT)]


def texts_of_paper(result, folder, language=None):
    """Every text that the cells of the template show of a result."""
    path = folder / "camera.json"
    path.write_text(json.dumps(result), encoding="utf-8")
    others = [kind for kind in CAMERA_KINDS if kind != result["kind"]]
    notebook = join_templates(str(path), others, (camera_papers.TEMPLATE,), LANGUAGE=language)
    return [text for block in blocks_of_cells(notebook) for text in shown_in(block)]


SLOW_FIXTURES = {"result", "results"}  # seconds each


@pytest.fixture(params=CAMERA_KINDS)
def result(request, results):
    return results[request.param] | {"made_from": MADE_FROM}


def names_in(result):
    """Letters of data: they may stand in any paper."""
    data = data_in(result)
    return letters_in([*data, *map(shorten, data)])


@pytest.mark.slow
def test_every_text_is_of_the_words(result, tmp_path, monkeypatch):
    english = load_words()
    monkeypatch.setattr(
        papers, "load_words", lambda _: bracketed(english) | {"language": english["language"]}
    )
    units = letters_in(unit.symbol for unit in UNITS.values())
    outside = [without_brackets(text) for text in texts_of_paper(result, tmp_path)]
    assert not letters_in(outside) - names_in(result) - units


@pytest.mark.slow
@pytest.mark.parametrize(
    "language", [OTHERS[0], *(pytest.param(one, marks=pytest.mark.study) for one in OTHERS[1:])]
)
def test_no_word_of_english_is_left(result, language, tmp_path):
    own = letters_in(texts_in(load_words(language)))
    english = letters_in(texts_in(load_words())) - own - names_in(result)
    assert not letters_in(texts_of_paper(result, tmp_path, language)) & english
    assert len(letters_in(texts_of_paper(result, tmp_path)) & english) > 30


@pytest.mark.slow
@pytest.mark.parametrize("language", OTHERS)
def test_numbers_have_the_marks_of_the_language(result, language, tmp_path):
    found = set(texts_of_paper(result, tmp_path, language)) - set(data_in(result))
    wrong = r"\d\.(?!\d{3}(?!\d))\d" if language == "pt-BR" else r"\d\.\d"  # 1.234 is one
    assert not [text for text in found if re.search(wrong, text)]
    assert any(re.search(r"\d,\d", text) for text in found)


@pytest.mark.parametrize(("language", "count"), [("en", "1610"), ("pt-BR", "1.610")])
def test_counts_have_the_marks_of_the_language(language, count):
    result = stability_json.plain_stability(compare(sets(("a", "b")), "spr"))
    text = " ".join(" ".join(camera_papers.lines(result, language)).split())
    assert f"n = {count} " in text
    assert ("(300; 300; 450)" if language == "pt-BR" else "(300, 300, 450)") in text


def test_scales_have_the_marks_of_the_language(product):
    assert any(" 1:10.000 " in line for line in camera_papers.lines(product, "pt-BR"))
    assert any(" 1:10000 " in line for line in camera_papers.lines(product))


@pytest.mark.parametrize("language", LANGUAGES)
def test_shipped_limits_have_words(language):
    words = load_words(language)["camera"]
    folder = shipped_folder("calibration/product/limit_tables")
    codes = {path.stem for path in folder.glob("*.toml")}
    assert set(words["limits_sources"]) == set(words["limits_remarks"]) == codes
    assert {shipped_limits(code).code for code in codes} == codes
    assert read_limits(folder / "pec_pcd.toml").code is None


def test_limits_of_ones_own_keep_their_texts(product):
    own = product["table"] | {"code": None, "source": "contract 12", "remark": "as signed"}
    text = " ".join(camera_papers.lines(product | {"table": own}, "es"))
    assert "contract 12; " in text
    assert "as signed" in text


@pytest.mark.slow
def test_an_axis_of_less_than_a_decade_has_no_decimals():
    from matplotlib.figure import Figure

    ax = Figure().subplots()
    ax.barh([0, 1], [1.1, 2.4])
    ax.set_xscale("log")
    widen_to_decades(ax)
    assert ax.get_xlim() == pytest.approx((1, 10))
    ax.figure.canvas.draw()
    shown = {tick.get_text() for tick in ax.get_xticklabels(which="both")}
    assert len(shown) > 2
    assert not any("." in text for text in shown)


def test_a_language_without_words_is_refused(product, tmp_path):
    with pytest.raises(TankcalError, match="no words in language 'xx'"):
        camera_papers.write(product, tmp_path / "papers", language="xx")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("language", OTHERS)
def test_papers_are_written_in_the_language(language, product, tmp_path):
    camera_papers.write(product, tmp_path / "papers", language=language)
    words = load_words(language)
    page = (tmp_path / "papers" / "report.html").read_text(encoding="utf-8")
    assert f'<html lang="{language}">' in page
    assert words["camera"]["subtitles"]["product"] in page
    notebook = json.loads((tmp_path / "papers" / "report.ipynb").read_text(encoding="utf-8"))
    assert f"LANGUAGE = '{language}'" in "".join(notebook["cells"][0]["source"])
    if shutil.which("pdftotext") is None:
        pytest.skip("pdftotext is not installed")
    text = subprocess.run(
        ["pdftotext", tmp_path / "papers" / "report.pdf", "-"], capture_output=True, text=True
    ).stdout
    assert words["page"]["footer"].format(page=1, pages=2) in text
