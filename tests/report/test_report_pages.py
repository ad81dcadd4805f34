"""How pages are filled: no lone rows, headings or end mark, figures that shrink to their page."""

import re
import shutil
import subprocess

import pytest
import typst
from paper_pages import filled, lone_headings, pages_of, sparse_pages

from tankcal.report import blocks
from tankcal.report.papers import build
from tankcal.report.pdf import pdf, prepare_table
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

SQUARE = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">'
    '<rect width="100" height="100" fill="#1f4e79"/></svg>'
)
TOGETHER = 6  # rows of a long table that page.typ keeps together


@pytest.fixture
def printed(tmp_path):
    """Gives the text of each page of blocks, by poppler; arguments of pdftotext may follow."""
    if not shutil.which("pdftotext"):
        pytest.skip("pdftotext (poppler) is not on this machine")

    def of(*made, options=("-layout",), footer=""):
        path = tmp_path / "made.pdf"
        document = blocks.document(title="T", footer=footer)
        path.write_bytes(pdf([block.data for block in (document, *made)]))
        command = ["pdftotext", *options, str(path), "-"]
        said = subprocess.run(command, capture_output=True, check=True, encoding="utf-8").stdout
        return said.split("\f")[:-1] if said.endswith("\f") else [said]

    return of


def lines_above(count):
    return [blocks.paragraph(f"line {n}") for n in range(count)]


def rows_of(page):
    return len(re.findall(r"row \d+", page))


@pytest.mark.slow(after=4)
@pytest.mark.parametrize("above", range(20, 40, 2))
def test_a_long_table_has_no_lone_rows(printed, above):
    rows = [[f"row {n}"] for n in range(20)]
    found = [rows_of(page) for page in printed(*lines_above(above), blocks.table(["a"], rows, "c"))]
    found = [count for count in found if count]
    assert sum(found) == 20
    assert min(found) >= TOGETHER


@pytest.mark.slow
def test_each_page_of_a_captioned_table_has_its_caption(printed):
    table = blocks.table(["a"], [[f"row {n}"] for n in range(150)], "a list of 2 degrees")
    pages = printed(blocks.repeat_caption(table))
    assert len(pages) > 2
    assert all(page.count("a list of 2 degrees") == 1 for page in pages)
    assert "a list of 2 degrees" not in printed(table)[1]


@pytest.mark.slow(after=4)
@pytest.mark.parametrize("above", range(38, 46))
def test_caption_is_above_its_table(printed, above):
    rows = [[f"row {n}"] for n in range(20)]
    found = printed(*lines_above(above), blocks.table(["a"], rows, "the caption"))
    assert rows_of(next(page for page in found if "the caption" in page)) >= TOGETHER


def numbered(count):
    return [[f"row {n}"] for n in range(count)]


AFTER_A_HEADING = {
    "short table": lambda: [blocks.table(["a"], numbered(5), "c")],
    "long table": lambda: [blocks.table(["a"], numbered(13), "c")],
    "short columns": lambda: [blocks.columns_table(["a"], numbered(40), "c", across=4)],
    "facts": lambda: [blocks.key_values([(f"row {n}", "v") for n in range(20)])],
    "figure": lambda: [blocks.figure(SQUARE, "the caption", "a square", width=0.8)],
    "sentences": lambda: [blocks.listing([f"row {n}" for n in range(4)])],
}


@pytest.mark.slow
@pytest.mark.parametrize("what", AFTER_A_HEADING)
def test_no_heading_ends_a_page(tmp_path, what):
    """Each document of one PDF has one line more above the heading than the one before."""
    made = []
    for above in range(28, 44):
        heading = blocks.heading("Alone")
        document = blocks.document(title="T", footer="")
        made += [document, *lines_above(above), heading, *AFTER_A_HEADING[what]()]
    path = tmp_path / "made.pdf"
    path.write_bytes(pdf([block.data for block in made]))
    pages = pages_of(path)
    assert len(pages) > 16
    assert lone_headings(pages, {"Alone"}) == []


@pytest.mark.slow
@pytest.mark.parametrize(("above", "count"), [(31, 200), (38, 905)])
def test_a_heading_goes_with_its_long_table(tmp_path, above, count):
    table = blocks.columns_table(["a"], numbered(count), "c", across=4)
    document = blocks.document(title="T", footer="")
    path = tmp_path / "made.pdf"
    made = [document, *lines_above(above), blocks.heading("Alone"), table]
    path.write_bytes(pdf([block.data for block in made]))
    pages = pages_of(path)
    assert lone_headings(pages, {"Alone"}) == []
    assert sparse_pages(pages) == []
    assert min(map(filled, pages)) > 0.25


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("count", range(230, 400, 10))
def test_end_mark_is_below_rows(printed, count):
    rows = [[f"row {n}"] for n in range(count)]
    end = blocks.end_mark("the end")
    found = printed(*lines_above(3), blocks.columns_table(["a"], rows, "c", across=4), end)
    assert "the end" in found[-1]
    assert rows_of(found[-1]) > 0
    assert sum(map(rows_of, found)) == count


@pytest.mark.parametrize(("above", "pages"), [(19, 1), (25, 1), (26, 2)])
def test_a_figure_shrinks_to_its_page_but_not_too_far(printed, above, pages):
    figure = blocks.figure(SQUARE, "the caption", "a square", width=0.8)
    found = printed(*lines_above(above), figure)
    assert len(found) == pages
    assert "the caption" in found[-1]


LETTERHEAD = {
    "name": "Laboratory",
    "address": [f"line {n} of the address" for n in range(4)],
    "logo": None,
    "colours": {"ink": "#0b3d2e", "line": "#8fb8a8"},
}
ADDRESS = "Avenida do Porto 1200, third floor, Harbour District, 59000-000 Natal, Brazil"


@pytest.mark.slow(after=2)
@pytest.mark.parametrize(("parties", "facts"), [(3, 10), (6, 13), (9, 13), (10, 14)])
def test_sketch_is_on_the_first_page(tmp_path, parties, facts):
    """However many addresses and facts there are above it."""
    of_parties = [(f"party {n}", ADDRESS) for n in range(parties)]
    made = [
        blocks.document(title="T", letterhead=LETTERHEAD),
        blocks.masthead("Certificate", "of a tank", number_label="Number", number="1"),
        blocks.key_values(of_parties),
        blocks.result("Capacity", "1260 m3", "at 20 degC"),
        blocks.heading("Tank"),
        blocks.key_values([(f"fact {n}", "a value of some letters") for n in range(facts)]),
        blocks.figure(SQUARE, "the sketch", "a square", width=0.35),
        blocks.heading("Calibration"),
        *lines_above(60),
    ]
    path = tmp_path / "made.pdf"
    path.write_bytes(pdf([block.data for block in made]))
    first = pages_of(path)[0]
    said = " ".join(line.text for line in first)
    assert "the sketch" in said
    assert all(f"fact {n}" in said for n in range(facts))
    assert said.count("Avenida") == parties
    assert filled(first) > 0.7


def test_a_first_page_without_facts_has_its_figure(printed):
    made = (blocks.masthead("Papers"), blocks.figure(SQUARE, "the sketch", "a square", width=0.35))
    (page,) = printed(*made)
    assert "the sketch" in page


@pytest.mark.slow
def test_facts_keep_distance_from_text_above(tmp_path):
    """A list too long for one block stands no closer below a paragraph than a short one."""
    found = []
    for count in (5, 20):
        facts = blocks.key_values([(f"row {n}", "v") for n in range(count)])
        path = tmp_path / f"{count}.pdf"
        made = (blocks.document(title="T"), blocks.paragraph("above"), facts)
        path.write_bytes(pdf([block.data for block in made]))
        above, first = pages_of(path)[0][:2]
        found.append(first.top - above.bottom)
    assert found[1] == pytest.approx(found[0], abs=0.5)


def test_a_label_does_not_touch_its_value(printed):
    fact = blocks.key_values([("i " * 60, "value")])  # fills its column
    (page,) = printed(fact, options=("-bbox",))
    edges = re.findall(r'xMin="([\d.]+)".*?xMax="([\d.]+)".*?>(\w+)</word>', page)
    of_label = [float(right) for _, right, word in edges if word == "i"]
    (value,) = (float(left) for left, _, word in edges if word == "value")
    assert value - max(of_label) >= 6.0


@pytest.mark.study
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_papers_of_the_example_have_full_pages(example_record, tmp_path, language):
    build(example_record, tmp_path, language=language)
    headings = {*load_words(language)["headings"].values()}
    for name in ("certificate", "working-papers", "field-table"):
        pages = pages_of(tmp_path / f"{name}.pdf")
        assert sparse_pages(pages) == []
        assert lone_headings(pages, headings) == []


@pytest.mark.slow
@pytest.mark.parametrize("mark", ["", "*"])
def test_even_rows_stand_where_measured_ones_do(monkeypatch, mark):
    """Second method: the typesetter measures each row by itself."""
    rows = [[f"{n / 100:.2f}", f"{n * n}{'.5' * (n % 3 == 0)}", mark] for n in range(430)]
    heads = [["Height", "m"], ["Volume", "L"], ""]
    table = blocks.columns_table(heads, rows, "t", ["decimal", "decimal", "left"], across=3)
    made = [blocks.document(title="T").data, *(one.data for one in lines_above(9)), table.data]
    assert prepare_table(table.data)["even"]
    by_height = pdf(made)
    monkeypatch.setattr("tankcal.report.pdf._ON_ONE_LINE", re.compile("none"))
    assert not prepare_table(table.data)["even"]
    assert pdf(made) == by_height


def test_rows_of_long_texts_are_not_even():
    table = blocks.columns_table(["a"], [["two words"]], "t", ["left"])
    assert not prepare_table(table.data)["even"]


@pytest.mark.study
@pytest.mark.parametrize(
    ("sign", "places"), [("", ["asked"]), ("x", ["asked", "tables", "no"])], ids=["even", "texts"]
)
def test_long_tables_are_complete_with_page_numbers(printed, monkeypatch, sign, places):
    """typst cannot find the places of eight tables of texts in its five passes: then none is
    asked for. Of rows of a height that is known it finds them.
    """
    asked = []
    compiled = typst.compile_with_warnings

    def watched(*arguments, **options):
        asked.append(options["sys_inputs"]["places"])
        return compiled(*arguments, **options)

    monkeypatch.setattr(typst, "compile_with_warnings", watched)
    made = []
    for table in range(8):
        rows = [[f"{sign}{table}.{row}"] for row in range(700)]
        made += [
            blocks.paragraph("between"),
            blocks.columns_table(["a"], rows, f"t{table}", across=4),
        ]
    pages = printed(*made, footer="page {page} of {pages}")
    found = re.findall(r"\d\.\d+", "".join(pages))
    assert len(found) == len(set(found)) == 8 * 700
    numbers = [re.findall(r"page (\d+) of (\d+)", page)[-1] for page in pages]
    assert numbers == [(str(n), str(len(pages))) for n in range(1, len(pages) + 1)]
    assert asked == places
