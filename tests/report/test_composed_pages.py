"""Pages of long tables that are composed without the typesetter.

Truth: the same document, whose rows the typesetter sets."""

import io
import re

import pypdf
import pytest

from tankcal.report import blocks
from tankcal.report import composed_pages as composed
from tankcal.report import pdf as pages_module

HEADS = [["Height", "m"], ["Volume", "m³"], ["U", "m³"], "", "k"]
ALIGN = ["decimal", "decimal", "decimal", "left", "decimal"]
MARKS = {"en": ".", "es": ",", "pt-BR": ","}
WIDTH_PT = 0.01  # 0.0035 mm; positions of typst are rounded to 1e-5 pt


def document_of(language, count):
    """Blocks with a table of rows of which some have other decimals, marks or characters."""
    rows = []
    for n in range(count):
        decimals = 3 if n > count // 3 else 4
        volume = f"{n * n / 7:,.{decimals}f}".replace(",", "\N{NARROW NO-BREAK SPACE}")
        is_simulated = count // 2 < n < count // 2 + 40
        u = "–" if n == 0 else f"{n / 99:.2f}"
        factor = ["*", ""] if is_simulated else ["", "1.96"]
        rows.append([f"{n / 1000:.3f}", volume, u, *factor])
    rows = [[text.replace(".", MARKS[language]) for text in row] for row in rows]
    table = blocks.columns_table(HEADS, rows, "t", ALIGN, 3, MARKS[language])
    document = blocks.document(title="T", language=language, footer="{page} of {pages}")
    shown = [document, blocks.heading("Table"), blocks.paragraph("before"), table]
    return [block.data for block in [*shown, blocks.end_mark("the end")]]


def cells_of(page):
    """(left edge, base line, text) of each text of a page."""
    found = []

    def visit(text, matrix, text_matrix, *_):
        if text.strip():
            found.append((*place(matrix, text_matrix), text.strip()))

    page.extract_text(visitor_text=visit)
    return sorted(found)


def place(matrix, text_matrix):
    x, y = text_matrix[4:6]
    a, b, c, d, e, f = matrix
    return a * x + c * y + e, b * x + d * y + f


@pytest.mark.slow
@pytest.mark.parametrize("language", MARKS)
def test_composed_pages_equal_those_of_the_typesetter(monkeypatch, language):
    made = document_of(language, 2400)
    typeset = pages_module.pdf(made)
    monkeypatch.setattr(composed, "LONG", 2000)
    written = pages_module.pdf(made)
    assert written != typeset
    (first, second) = (pypdf.PdfReader(io.BytesIO(file)).pages for file in (typeset, written))
    assert len(first) == len(second) > 8
    for expected, page in zip(first, second, strict=True):
        assert page.extract_text().split() == expected.extract_text().split()
        for cell, other in zip(cells_of(page), cells_of(expected), strict=True):
            assert cell[2] == other[2]
            assert cell[:2] == pytest.approx(other[:2], abs=WIDTH_PT)
    assert_marks_agree(io.BytesIO(written), 5 * 2400)


def assert_marks_agree(file, count):
    """Each mark of a page belongs to a tag that names it, and all cells are below the root."""
    reader = pypdf.PdfReader(file)
    root = reader.root_object["/StructTreeRoot"]
    listed = root["/ParentTree"]["/Nums"]
    tags = dict(zip(listed[::2], listed[1::2], strict=True))
    for page in reader.pages:
        marks = re.findall(rb"/MCID (\d+)>>BDC", page.get_contents().get_data())
        of_page = tags[page["/StructParents"]].get_object()
        assert sorted(map(int, marks)) == [*range(len(of_page))]
        for mark, tag in enumerate(of_page):
            assert mark in tag.get_object()["/K"]
            assert tag.get_object()["/Pg"].indirect_reference == page.indirect_reference
    cells, waiting = 0, [*root["/K"]]
    while waiting:
        tag = waiting.pop().get_object()
        kids = [kid for kid in tag["/K"] if isinstance(kid, pypdf.generic.IndirectObject)]
        assert all(kid.get_object()["/P"].get_object() == tag for kid in kids[:2])
        cells += tag["/S"] == "/TD"
        waiting += kids
    assert cells == count


@pytest.mark.slow
def test_typesetter_sets_the_rows_of_another_form(monkeypatch):
    made = document_of("en", 1500)
    typeset = pages_module.pdf(made)
    monkeypatch.setattr(composed, "LONG", 1000)
    monkeypatch.setattr(composed, "_BOX", re.compile(b"another form"))
    assert pages_module.pdf(made) == typeset


def test_glyphs_of_strings_with_brackets_and_gaps():
    text = rb"[(\000(\000)\000\\)-12.5(\001\n\000\051)]"
    assert composed._glyphs(text) == ([40, 41, 92, 266, 41], [0.0, 0.0, -12.5, 0.0])
    assert composed._glyphs(rb"(\000\()") == ([40], [])


def test_samples_show_each_pair_and_each_missing_decimal():
    table = {"rows": [["12", "3"], ["12", {"text": "1", "missing": ".0"}], ["12", "3"], ["21", ""]]}
    assert composed.sample_rows(table) == [0, 1, 3]
