"""Formulas of the record set as mathematics; whatever else a sentence holds stays text."""

import ast
import inspect
import subprocess
from collections import defaultdict

import pytest
from paper_pages import pages_of

from tankcal.messages import fill_template
from tankcal.pipeline import tanks
from tankcal.report import blocks
from tankcal.report.pdf import pdf
from tankcal.report.plain import Column, PlainPaper
from tankcal.report.plain_formulas import STEP_FORMULAS, formula_nodes
from tankcal.report.web import block_html
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

SIGNS = set("√π²αρΔ−_")  # signs of mathematics, none of which stays in the words around it
HOSTILE = 'r_in"#x = r − t #read("main.typ") $x$ <b>'


def templates(language):
    """The formulas of the corrections, in English as their module says them."""
    if language != "en":
        return load_words(language)["formulas"].values()
    nodes = ast.walk(ast.parse(inspect.getsource(tanks)))
    found = [node.value for node in nodes if isinstance(node, ast.Constant)]
    return [
        one for one in found if isinstance(one, str) and set(one) & (SIGNS - {"_"}) and " " in one
    ]


def sentences(language):
    mark = "." if language == "en" else ","
    known = defaultdict(lambda: 1.25)
    return [
        fill_template(template, known, number=lambda value, form: str(value).replace(".", mark))
        for template in templates(language)
    ]


@pytest.mark.parametrize("language", LANGUAGES)
def test_no_formula_of_a_correction_stays_text(language):
    kept = [formula_nodes(text) for text in sentences(language)]
    assert sum(any(node["t"] == "math" for node in nodes) for nodes in kept) >= 8
    for nodes in kept:
        words = "".join(node["s"] for node in nodes if node["t"] == "text")
        assert not set(words.replace("m/s²", "")) & SIGNS, words


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_sentence_with_its_formulas_read_out_is_the_sentence(language):
    for text in sentences(language):
        assert "".join(node.get("s") or node["alt"] for node in formula_nodes(text)) == text


@pytest.mark.parametrize(
    ("text", "typst"),
    [
        ("r_interno = r − t", 'r_(upright("interno")) \\= r minus t'),
        ("-m/rho_ref", 'minus m \\/ rho_(upright("ref"))'),
        ("√(1 + m²)", "sqrt(1 plus m^(2))"),
        (
            "t_S = (7 t_L + t_A)/8",
            't_(upright("S")) \\= \\( 7 thin t_(upright("L")) plus t_(upright("A")) \\) \\/ 8',
        ),
        ("CSW = 1 − S&W", 'upright("CSW") \\= 1 minus upright("SW")'),
    ],
)
def test_a_formula_as_typst(text, typst):
    (node,) = formula_nodes(text)
    assert (node["typst"], node["alt"]) == (typst, text)


@pytest.mark.parametrize("text", STEP_FORMULAS.values())
def test_the_formula_of_a_step_is_set_as_a_whole(text):
    (node,) = formula_nodes(text)
    assert (node["t"], node["alt"]) == ("math", text)


@pytest.mark.parametrize("text", [HOSTILE, "", "–", "r_1 = r − t", "g = x", "weighing = 3"])
def test_other_text_stays_text(text):
    assert formula_nodes(text) == [{"t": "text", "s": text}]


def test_only_columns_of_formulas_are_set():
    paper = PlainPaper(load_words("en"))
    row = {"code": "√(1 + m²)", "formula": "a <b> times √(1 + m²)"}
    columns = [Column("code"), Column("formula", formulas=True)]
    html = block_html(paper.table("corrections", [row], columns).data)
    assert '<td class="left">√(1 + m²)</td>' in html
    assert '<td class="left">a &lt;b&gt; times <math display="inline"><mrow><msqrt>' in html
    assert html.count("<math") == 1


@pytest.mark.slow
def test_every_formula_is_set_on_paper(tmp_path):
    """typst sets a PDF/UA-1 only where each formula has its words; markup is never read."""
    texts = [text for language in LANGUAGES for text in sentences(language)]
    rows = [[text] for text in [*texts, HOSTILE]]
    table = blocks.table(["Formula"], rows, formulas=[0])
    path = tmp_path / "formulas.pdf"
    path.write_bytes(pdf([blocks.document(title="t").data, table.data]))
    assert pages_of(path)
    said = subprocess.run(["pdftotext", str(path), "-"], capture_output=True, check=True).stdout
    assert HOSTILE in said.decode("utf-8")
