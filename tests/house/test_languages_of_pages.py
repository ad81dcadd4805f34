"""Pages in three languages: equal headings, blocks and tables; equal figures."""

import re

import pytest
from page_figures import figures_of
from page_sessions import FENCE, ROOT

PAGES = {
    "start": ("start", "comece-aqui", "empiece-aqui"),
    "results": ("results", "results-pt-BR", "results-es"),
    "points": ("tutorial-points", "tutorial-points-pt-BR", "tutorial-points-es"),
    "strapping": ("tutorial-strapping", "tutorial-pt-BR", "tutorial-es"),
}
WORKBOOK = {  # sentences of the check by hand, {page: (radii, check)}
    "docs/tutorial-points.md": (
        ("docs/tutorial-points.md", "courses are () and () m at 26 °C"),
        (
            "docs/tutorial-points.md",
            "the true radii hold () m³ at 26 °C. Contraction to 20 °C reduces this volume by "
            "() m³. The load of a liquid of 850 kg/m³ increases it by () m³. The sum is () m³, and "
            "the table states () m³ with U = () m³.",
        ),
    ),
    "docs/tutorial-points-pt-BR.md": (
        ("docs/tutorial-points-pt-BR.md", "dois anéis são () e () m a 26 °C"),
        (
            "docs/tutorial-points-pt-BR.md",
            "os raios verdadeiros contêm () m³ a 26 °C. A contração até 20 °C reduz esse volume em "
            "() m³, e a carga de um líquido de 850 kg/m³ o aumenta em () m³. São () m³, e a tabela "
            "dá () m³ com U = () m³.",
        ),
    ),
    "docs/tutorial-points-es.md": (
        ("docs/tutorial-points-es.md", "dos anillos son () y () m a 26 °C"),
        (
            "docs/tutorial-points-es.md",
            "los radios verdaderos contienen () m³ a 26 °C. La contracción hasta 20 °C reduce ese "
            "volumen en () m³, y la carga de un líquido de 850 kg/m³ lo aumenta en () m³. Son "
            "() m³, y la tabla da () m³ con U = () m³.",
        ),
    ),
}
TAPE = (
    "docs/tutorial-strapping.md",
    "simulated are (), (), () and () m. The four cylinders of () m (π r² h) hold () m³; manhole "
    "and drain, () m³; the pressure of the liquid increases the radius of each course by "
    "ρ g z r² / (E t), in all () m³. The sum is () m³, and the table states () m³ with U = () m³.",
)
TAPE_ES = (
    "docs/tutorial-es.md",
    "son (), (), () y () m. Los cuatro cilindros de () m (π r² h) suman () m³; la boca de "
    "hombre y el drenaje, () m³; la presión del líquido aumenta el radio de cada anillo en "
    "ρ g z r² / (E t), en total () m³. Son () m³, y la tabla da () m³ con U = () m³.",
)


def text_of(page):
    return (ROOT / f"docs/{page}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("pages", PAGES.values(), ids=PAGES)
def test_headings_blocks_and_tables_agree(pages):
    shapes = set()
    for page in pages:
        text = text_of(page)
        prose = FENCE.sub("", text)
        headings = re.findall(r"^(#+) (\d*)", prose, flags=re.M)
        kinds = [match[1] for match in FENCE.finditer(text)]
        items = len(re.findall(r"^(?:- |\d+\. )", prose, flags=re.M))
        rows = len(re.findall(r"^\| ", prose, flags=re.M))
        shapes.add((tuple(headings), tuple(kinds), items, rows))
    assert len(shapes) == 1


@pytest.mark.parametrize("pages", PAGES.values(), ids=PAGES)
def test_pages_link_to_their_translations(pages):
    if pages[0] in ("start", "results"):
        for page in pages:
            links = {f"]({other}.md)" for other in pages if other != page}
            assert [link for link in links if link not in text_of(page)] == []


TABLES = (  # all rows of the tables of the translated first pages
    ("docs/comece-aqui.md", "| () a () % |"),
    ("docs/comece-aqui.md", "| () % ([exemplo]"),
    ("docs/empiece-aqui.md", "| () a () % |"),
    ("docs/empiece-aqui.md", "| () % ([ejemplo]"),
)


def test_tables_of_the_first_pages_have_equal_figures():
    assert all(figures_of(*table) for table in TABLES)
    rows = [
        re.findall(r"\| (\d[\d.,]*(?: (?:to|a) \d[\d.,]*)? %)", text_of(page))
        for page in PAGES["start"]
    ]
    plain = [[re.sub(r" (?:to|a) ", "-", cell.replace(",", ".")) for cell in row] for row in rows]
    assert len(plain[0]) == 13, plain[0]
    assert plain[0] == plain[1] == plain[2]


@pytest.mark.parametrize("page", WORKBOOK)
def test_check_by_hand_of_the_workbook_tutorial(page):
    """Closed form: two cylinders, thermal contraction, thin hoops under the head."""
    numbers = [
        float(text.replace(",", "."))
        for sentence in WORKBOOK[page]
        for text in figures_of(*sentence)
    ]
    *radii, cylinders, contraction, load, whole, table, expanded = numbers
    height, pi = 1.5, 3.141592653589793
    assert abs(sum(pi * height * radius**2 for radius in radii) - cylinders) < 6e-4
    assert abs(cylinders * 2 * 1.1e-5 * 6 - contraction) < 6e-4
    heads = ((2.25, 6e-3), (0.75, 5e-3))
    grown = (
        2 * pi * radius * height * 850 * 9.80665 * head * radius**2 / (206e9 * plate)
        for radius, (head, plate) in zip(radii, heads, strict=True)
    )
    assert abs(sum(grown) - load) < 6e-4
    assert abs(cylinders - contraction + load - whole) < 1.1e-3
    assert abs(table - whole) < expanded
    printed = re.search(
        r"^T\w+-30: ([\d.,]+) m[3³] .*?U = ([\d.,]+) m", (ROOT / page).read_text(), re.M
    )
    assert [float(text.replace(",", ".")) for text in printed.groups()] == [table, expanded]


def test_tutorials_of_strapping_have_equal_numbers():
    english, spanish = (
        [text.replace(",", ".") for text in figures_of(*one)] for one in (TAPE, TAPE_ES)
    )
    assert english == spanish
