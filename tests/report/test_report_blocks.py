"""Blocks, numbers, words and markdown: the small parts of the report."""

import re

import pandas as pd
import pytest
from matplotlib.figure import Figure

from tankcal.errors import TankcalError
from tankcal.job.contract import KEYS
from tankcal.report import blocks
from tankcal.report.markdown import formula, nodes
from tankcal.report.numbers import symbol, unit
from tankcal.report.paper import Column, Paper
from tankcal.report.web import block_html, decimal_fills
from tankcal.text.digits import ENGLISH, Marks
from tankcal.text.words import load_words


def test_unknown_unit_is_an_error():
    with pytest.raises(TankcalError, match="unit 'gallon' is not known"):
        unit("gallon")


def test_symbol():
    assert symbol("m3/mm") == "m³/mm"
    assert [symbol("deg"), symbol("m3/deg")] == ["°", "m³/°"]
    assert symbol(None) is None


def test_decimal_marks_line_up():
    fills = decimal_fills(["1.25", "10", "3.5"])
    assert [len(fill) for fill in fills] == [0, 3, 1]
    fills = decimal_fills(["1.234,5", "1.250", "3,75"], ",")  # a group is not a decimal
    assert [len(fill) for fill in fills] == [1, 3, 0]


def test_a_data_frame_becomes_a_table():
    frame = pd.DataFrame({"name": ["a", None], "value": [1.5, float("nan")]})
    data = blocks.table(frame, caption="Mine").data
    assert data["rows"] == [["a", "1.5"], ["–", "–"]]
    assert data["align"] == ["left", "right"]


def test_a_block_shows_itself_in_jupyter():
    bundle = blocks.table(["<x>"], [["a & b"]])._repr_mimebundle_()
    assert set(bundle) == {"text/html", "text/plain", blocks.MIME}
    assert "&lt;x&gt;" in bundle["text/html"]
    assert "a &amp; b" in bundle["text/html"]


def test_every_kind_of_block_has_html():
    made = [
        blocks.document(title="t", notice="N"),
        blocks.masthead("t", number_label="No."),
        blocks.heading("h"),
        blocks.paragraph("p"),
        blocks.listing(["i"]),
        blocks.notice("n"),
        blocks.result("l", "r", "n"),
        blocks.signature(["s"]),
        blocks.end_mark("e"),
        blocks.key_values([("k", None)]),
        blocks.table(["a"], [["1"]]),
        blocks.columns_table(["a"], [["1"]]),
        blocks.figure("<svg xmlns='http://www.w3.org/2000/svg'/>", "c", "alt"),
        blocks.code("c"),
    ]
    for block in made:
        assert block_html(block.data).startswith("<")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: blocks.table(["a", "b"], [["1"]]), "row 1 has 1 cells, the table 2 columns"),
        (lambda: blocks.table(["a"], [["1"]], align=["middle"]), "alignments"),
        (lambda: blocks.table(["a"], [["1"]], formulas=[1]), "in columns 0 to 0: "),
        (lambda: blocks.table([["a", ""]]), "DataFrame"),
        (lambda: blocks.figure("<svg/>", "c", " "), "alt"),
        (lambda: blocks.figure("<svg/>", "c", "a", width=2), "up to 1"),
        (lambda: blocks.heading("h", 4), "level 1, 2 or 3"),
        (lambda: blocks.document(name="x"), "a document has no name"),
    ],
)
def test_wrong_use_is_an_error(make, message):
    with pytest.raises(TankcalError, match=message):
        make()


def test_control_characters_become_spaces():
    assert blocks.paragraph("a\x00b\x1b\u202ec\ud800d").data["text"] == "a b  c d"


@pytest.mark.slow
def test_the_same_figure_gives_the_same_bytes():
    def drawn():
        figure = Figure(figsize=(2, 1))
        figure.subplots().plot([1, 2], [3, 4], label="U / m³")
        return blocks.figure(figure, "c", "a").data["svg"]

    assert drawn() == drawn()
    assert "<text" in drawn()  # searchable, not outlines
    assert "<dc:date>" not in drawn()


@pytest.mark.parametrize(
    ("latex", "typst"),
    [
        (r"u_c^2(y)", r"u_(c)^(2) \( y \)"),
        (r"\frac{a,b}{2.5}", r"frac(a \, b, 2.5)"),
        (r"\sqrt{\bar{x}-1}", "sqrt(overline(x) minus 1)"),
        (r"\text{at 20 C}\cdot\alpha", 'upright("at 20 C") dot.op alpha'),
        ("1{,}25", r'1 class("normal", \,) 25'),
    ],
)
def test_formula(latex, typst):
    assert formula(latex).typst == typst


@pytest.mark.parametrize(
    ("latex", "message"),
    [
        (r"\input{x}", r"macro \\input is not supported"),
        (r"a#b", "character '#' is not supported"),
        (r"{a", "'}' is missing"),
        (r"\text{a", "'}' is missing"),
        (r'\text{"}', "is not supported"),
        (r"\frac a b", "'{' expected"),
        (r"a^", "missing at the end"),
        (r"a^1^2", "two '\\^'"),
        ("a}", "'}' is not supported"),
        ("é", "'é' is not supported"),
    ],
)
def test_unknown_mathematics_is_an_error(latex, message):
    with pytest.raises(TankcalError, match=message):
        formula(latex)


def test_images_in_markdown_are_refused():
    with pytest.raises(TankcalError, match="cannot show: image"):
        nodes("![x](http://example.org/x.png)")


def test_a_link_that_runs_code_is_only_text():
    assert nodes("[x](javascript:alert)") == [
        {"t": "paragraph", "c": [{"t": "plain", "c": [{"t": "text", "s": "x"}]}]}
    ]


def test_html_in_markdown_is_printed_as_written():
    data = {"kind": "markdown", "nodes": nodes("a <b>c</b>\n\n<div>d</div>")}
    assert "&lt;b&gt;c&lt;/b&gt;" in block_html(data)
    assert "&lt;div&gt;" in block_html(data)


def test_every_field_that_may_be_printed_has_a_label():
    labels = load_words("en")["labels"]
    fields = [*KEYS["tank"], *KEYS["certificate"]]
    printed = {field.name for field in fields if field.kind == "text"}
    assert printed - {"number", "notice"} <= set(labels)


def test_a_language_has_the_same_words_as_english():
    """Every placeholder of every sentence can be filled: no stray brace in the file."""
    groups = load_words("en")
    marks = groups["language"].pop("marks")
    assert Marks(**marks) == ENGLISH
    for group, words in groups.items():
        for template in _templates(words):
            for name in re.findall(r"\{([^}]*)\}", template):
                assert re.fullmatch(r"[A-Za-z_]+", name), (group, template)


def _templates(words):
    for value in words.values():
        yield from _templates(value) if isinstance(value, dict) else [value]


def test_missing_word_is_an_error(example_record):
    paper = Paper(example_record)
    with pytest.raises(TankcalError, match=r"lack headings\.weather"):
        paper.heading("weather")


def test_a_file_that_is_no_record_is_an_error(tmp_path):
    path = tmp_path / "record.json"
    path.write_text('{"format": "tankcal-record/9"}', encoding="utf-8")
    with pytest.raises(TankcalError, match=r"expected .tankcal-record/2"):
        Paper(path)


def test_every_choice_of_the_example_is_a_sentence(example_record):
    sentences = Paper(example_record).choices()
    assert all(text[0].isupper() and text.endswith(".") for text in sentences)
    assert any("95\N{NO-BREAK SPACE}%" in text for text in sentences)


def test_column_of_the_record(example_record):
    paper = Paper(example_record)
    rows = [{"x_m": 1.23456, "u_m": 0.012, "names": ["a", "b"], "dof": None}]
    texts = paper.column_texts
    assert texts(rows, Column("x_m", "mm", u="u_m")) == ["1235"]
    assert texts(rows, Column("x_m", "m", u="u_m")) == ["1.235"]
    assert texts(rows, Column("names")) == ["a, b"]
    assert texts(rows, Column("dof", digits=3, nothing="∞")) == ["∞"]
