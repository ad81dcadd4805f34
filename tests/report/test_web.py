"""The page of the report as a text: its policy, its scripts, what its data say."""

import base64
import hashlib
import io
import json
import re

import nbformat
import numpy as np
import pytest
from fontTools.ttLib import TTFont
from job_builder import write_job
from nbformat.v4 import new_markdown_cell, new_notebook
from paper_cells import paper_blocks

import tankcal
from tankcal.record import record_of, save
from tankcal.record.covariance_factor import factor_of
from tankcal.report import blocks
from tankcal.report.document import blocks_of
from tankcal.report.exporter import HtmlExporter
from tankcal.report.paper import Paper
from tankcal.report.pdf import pdf
from tankcal.report.web import PIECE, embed_fonts, page, script_data
from tankcal.report.web.calculator_data import BEND, calculator, sources_of, straight_rows
from tankcal.report.web.tank_shape import tank_view


@pytest.fixture(scope="module")
def found(example_record):
    return paper_blocks(example_record)


@pytest.fixture(scope="module")
def text(found):
    return page(found)


def numbers(packed, kind="<f8"):
    return np.frombuffer(base64.b64decode(packed), dtype=kind)


def block_of(found, kind):
    (one,) = (block for block in found if block["kind"] == kind)
    return one


@pytest.mark.slow
def test_content_policy_has_hashes_of_scripts_and_style(text):
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)[1]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    for tag in ("script", "style"):
        (inline,) = re.findall(rf"<{tag}>(.*?)</{tag}>", text, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(inline.encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}'" in policy


def test_the_page_needs_nothing_from_elsewhere(text):
    assert re.findall(r'(?:src|href|action)="(?!data:|#)', text) == []
    assert not re.search(r"\burl\(|@import|\beval\b|new Function|innerHTML|\son\w+=", text)
    assert not re.search(r'\sstyle="', text)


@pytest.mark.parametrize("look", [0, 1])
def test_words_can_be_read_on_their_ground(text, look):
    """WCAG 2.1, 1.4.3: a contrast of 4.5 or more, light and dark."""
    pairs = dict(re.findall(r"(--\w+): light-dark\((#\w+, #\w+)\)", text))
    colours = {name: pair.split(", ")[look] for name, pair in pairs.items()}
    for ground in ("--paper", "--panel", "--ground"):
        for word in ("--text", "--ink", "--muted", "--alarm", "--accent"):
            assert contrast(colours[word], colours[ground]) >= 4.5, (word, ground)
    assert contrast(colours["--text"], colours["--found"]) >= 4.5


def contrast(*colours):
    """The ratio of two relative luminances, (L1 + 0.05) / (L2 + 0.05)."""
    light = []
    for colour in colours:
        digits = colour[1:] if len(colour) == 7 else "".join(2 * one for one in colour[1:])
        channel = np.array([int(digits[i : i + 2], 16) for i in (0, 2, 4)]) / 255
        linear = np.where(channel <= 0.04045, channel / 12.92, ((channel + 0.055) / 1.055) ** 2.4)
        light.append(linear @ [0.2126, 0.7152, 0.0722] + 0.05)
    return max(light) / min(light)


@pytest.mark.slow
def test_the_same_record_gives_the_same_page(example_record, text):
    assert page(paper_blocks(example_record)) == text


def test_every_link_of_the_contents_leads_to_a_heading(text):
    links = re.findall(r'href="#(\w+)"', text)
    assert len(links) > 20
    for name in links:
        assert text.count(f'id="{name}"') == 1, name


def test_names_of_elements_are_there_once(text):
    names = re.findall(r'\sid="([^"]+)"', text)
    assert len(names) == len(set(names))


def test_every_field_has_a_label(text):
    labels = set(re.findall(r'<label for="([^"]+)"', text))
    fields = re.findall(r'<(?:input|select)[^>]* id="([^"]+)"', text)
    within = re.findall(r'<label><input[^>]* id="([^"]+)"', text)
    assert set(fields) == labels | set(within)


def test_the_pdf_has_no_widgets(found):
    kinds = {block["kind"] for block in found}
    assert {"calculator", "tank_view"} <= kinds
    bare = [block for block in found if block["kind"] in ("document", "calculator", "tank_view")]
    plain = [block for block in bare if block["kind"] == "document"]
    assert pdf([one | {"attachments": []} for one in bare]) == pdf(
        [one | {"attachments": []} for one in plain]
    )


def test_data_for_scripts_cannot_end_their_element():
    hostile = "</script><!-- \u2028 &lt;"
    written = script_data({"a": hostile})
    assert not re.search("[<>&\u2028]", written)
    assert json.loads(written) == {"a": hostile}


def test_the_data_are_those_of_the_record(example_record, found):
    capacity = json.loads(example_record.read_text())["capacity"]
    data = block_of(found, "calculator")
    for name, key in (("height_m", "height_m"), ("volume", "volume_m3"), ("U", "stated_U_m3")):
        assert numbers(data[name]).tolist() == capacity[key]
    assert numbers(data["u"], "<f4") == pytest.approx(capacity["u_m3"], rel=1e-7)


def test_few_rows_of_factor_represent_all(example_record, found, figure):
    """Second method: the factor between the kept rows against every row of the record."""
    capacity = json.loads(example_record.read_text())["capacity"]
    factor, height = factor_of(capacity), np.array(capacity["height_m"])
    data = block_of(found, "calculator")["deliveries"]
    rows = numbers(data["rows"], "<u4")
    kept = numbers(data["factor"], "<f4").reshape(len(rows), -1)
    again = np.column_stack([np.interp(height, height[rows], column) for column in kept.T])
    error = np.linalg.norm(again - factor, axis=1).max()
    largest = np.linalg.norm(factor, axis=1).max()
    assert error <= (BEND + 1e-7) * largest
    figure("rows of the factor kept, of 951", len(rows))


def test_straight_rows_of_a_curve():
    """Closed form: a parabola of pieces of length d is off its chords by d^2/8 at most."""
    height = np.linspace(0, 1, 1025)
    rows = straight_rows(height, np.column_stack([height**2, 3 * height]), 0.25 * (1 / 16) ** 2)
    assert rows.tolist() == list(range(0, 1025, 64))


def test_sources_of_the_factor():
    record = {
        "capacity": {"input_kind": ["points", "points", "deadwood", "deadwood", "a & b", "a & b"]},
        "budget": [
            {"kind": "points", "dof": 7.5},
            {"kind": "deadwood", "dof": 3.0},
            {"kind": "deadwood", "dof": None},
            {"kind": "a", "dof": 9.0},
            {"kind": "b", "dof": 4.0},
        ],
    }
    assert sources_of(record) == ([0, 0, 1, 2, 3, 3], [7.5, 3.0, None, 4.0])


def test_degrees_of_freedom_are_those_of_the_deliveries(example_record):
    """Second method: k of the record's worst deliveries from what the page is given."""
    record = json.loads(example_record.read_text())
    capacity = record["capacity"]
    owner, dof = sources_of(record)
    factor = factor_of(capacity)
    for one in record["deliveries"]:
        low, high = (
            [np.interp(one["absolute"][key], capacity["height_m"], column) for column in factor.T]
            for key in ("low_m", "high_m")
        )
        by_source = np.bincount(owner, np.subtract(high, low) ** 2)
        inverse = [0 if one is None else 1 / one for one in dof]
        by_dof = np.sum(by_source**2 * inverse)
        effective = by_source.sum() ** 2 / by_dof if by_dof else np.inf
        told = one["absolute"]["dof"]
        assert effective == (np.inf if told is None else pytest.approx(told, rel=1e-9))


def test_outlines_and_points_of_the_view(example_record, found):
    record = json.loads(example_record.read_text())
    shell = block_of(found, "tank_view")["shell"]
    sections = record["sections"]
    form = numbers(shell["form"], "<i2").reshape(len(sections), -1) / 1e4
    for one, section in zip(form, sections, strict=True):
        expected = np.array(section["outline"]["radius_m"]) - section["radius_m"]
        assert one == pytest.approx(expected, abs=0.5001e-4)
    assert numbers(shell["points"]["residual_m"], "<f4") == pytest.approx(
        [r for section in sections for r in section["residual_m"]], rel=1e-6
    )
    assert [ring[0] for ring in shell["rings"][0]] == pytest.approx([0.0, 0.95, 1.9], abs=1e-4)


@pytest.fixture(scope="module")
def without_courses(tmp_path_factory):
    """{kind: (record, paper)} of a lying cylinder, and of a sphere."""
    made = {}
    for kind in ("horizontal", "sphere"):
        folder = tmp_path_factory.mktemp(kind)
        settings = {"table.step_m": 0.1}
        if kind == "horizontal":
            settings |= {"horizontal.end_a": "ellipsoidal", "horizontal.end_a_depth_m": 0.6}
        result = tankcal.run(tankcal.load(write_job(folder / "job", kind=kind, settings=settings)))
        save(record_of(result), folder / "record.json")
        made[kind] = Paper(folder / "record.json")
    return made


@pytest.mark.parametrize("kind", ["horizontal", "sphere"])
def test_solid_of_revolution_has_the_volume_of_the_tank(without_courses, kind):
    """Other method: Pappus' sum over the curve that is drawn, against the full capacity."""
    paper = without_courses[kind]
    solid = tank_view(paper).data["solid"]
    along, radius = np.array(solid["profile"]).T
    ends, cuts = np.diff(along), radius**2
    volume = np.sum(np.pi * ends * (cuts[1:] + cuts[:-1] + radius[1:] * radius[:-1]) / 3)
    full = next(one["value"] for one in paper.record["solid"] if one["code"] == "full_capacity")
    assert volume * np.prod(solid["flat"]) == pytest.approx(full, rel=2e-3)


def test_view_that_cannot_be_drawn_states_why(without_courses):
    paper = without_courses["sphere"]
    record = paper.record["job"]["tank"] | {"kind": "mesh"}
    other = {**paper.record, "job": {**paper.record["job"], "tank": record}}
    data = tank_view(Paper(other)).data
    assert data["solid"] is None
    written = page([blocks.document(title="t").data, data])
    assert "contains no form that can be drawn" in written
    assert "<canvas" not in written


def test_an_empty_second_source_has_one_k(without_courses):
    data = calculator(without_courses["sphere"]).data["deliveries"]["k"]
    assert np.exp(numbers(data["log_k"])) == pytest.approx(1.959963984540054)


def test_a_notebook_of_ones_own_is_a_page_without_widgets():
    notebook = new_notebook(cells=[new_markdown_cell("# One $x^2$\n\n## Two"), *_long_table()])
    text, resources = HtmlExporter().from_notebook_node(notebook)
    assert resources["output_extension"] == ".html"
    assert 'id="calculator"' not in text
    assert '<a href="#s1">One x^2</a>' in text
    assert text.count('<div class="piece">') == -(-120 // PIECE) > 1


def _long_table():
    table = blocks.columns_table(["dip"], [[f"{n / 1000:.3f}"] for n in range(120)])
    output = nbformat.v4.new_output("display_data", data={blocks.MIME: table.data})
    return [nbformat.v4.new_code_cell("x", outputs=[output])]


def test_a_page_in_a_language_without_words_has_english_buttons():
    written = page([blocks.document(title="t", language="fr").data])
    assert '<html lang="fr">' in written
    assert ">Print</button>" in written


def test_a_letterhead_is_text_and_a_picture():
    head = {
        "name": "Lab <b>",
        "address": ["Street & 1"],
        "logo": {"kind": "svg", "content": "<svg onload='x()'/>", "alt": '"logo"'},
        "colours": {"ink": "#123456", "line": "red; } body { display: none"},
    }
    written = page([blocks.document(title="t").data | {"letterhead": head}])
    assert "<strong>Lab &lt;b&gt;</strong><br>Street &amp; 1" in written
    assert 'alt="&quot;logo&quot;" src="data:image/svg+xml;base64,' in written
    assert "light-dark(#123456" in written
    assert "body { display" not in written


def test_blocks_of_the_report_are_known_to_the_exporter(found):
    # With "copy", a whole notebook shows a notice in place of the lines of signature.
    found = [{key: value for key, value in block.items() if key != "copy"} for block in found]
    cells = [
        nbformat.v4.new_code_cell(
            "x", outputs=[nbformat.v4.new_output("display_data", data={blocks.MIME: block})]
        )
        for block in found
    ]
    assert [one["kind"] for one in blocks_of(new_notebook(cells=cells))] == [
        one["kind"] for one in found
    ]


def test_a_chart_brings_the_letters_of_its_font():
    """Without STIX fonts a browser would set wider labels, which overlap."""
    svg = (
        '<svg width="1"><text style="font: 8px \'STIXGeneral\'">U / m³ &amp; 4</text>'
        "<text style=\"font-family: 'STIXGeneral'\">h</text></svg>"
    )
    made = embed_fonts(svg)
    assert made == embed_fonts(svg)  # the same bytes
    assert made.startswith('<svg width="1"><style>@font-face{font-family:STIXGeneral;src:url(data:')
    data = re.search(r"base64,([^)]+)", made)[1]
    letters = TTFont(io.BytesIO(base64.b64decode(data))).getBestCmap()
    assert set("U / m³ & 4h") == set(map(chr, letters))
    assert embed_fonts("<svg><path/></svg>") == "<svg><path/></svg>"
