"""What record, papers, page and workbook say of point clouds, of the shipped example."""

import json
import re

import numpy as np
import openpyxl
import pytest
from browser import Browser
from paper_cells import paper_blocks

import tankcal
from tankcal.methods.clouds.saved import shared_part_of
from tankcal.record import record_of
from tankcal.report import clouds as drawn
from tankcal.report import workbook
from tankcal.report.paper import Paper
from tankcal.report.plain import PlainPaper
from tankcal.report.tables import clouds
from tankcal.report.web import page
from tankcal.tank.capacity import Capacity, Source
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words, translate_record

# ---- U with and without the shared part


def test_variances_of_the_shared_part_and_of_the_rest_add_up():
    """Closed form: 3-4-5 of columns; inputs found together are shared where one of them is."""
    columns = {"points": 3.0, "registration": 2.0, "incidence & bulge": 12**0.5}
    sources = tuple(Source(kind, np.array([[0.0], [u]])) for kind, u in columns.items())
    part = shared_part_of(
        Capacity(np.array([0, 1.0]), np.array([0, 9.0]), np.ones(2), sources, 0.95)
    )
    assert (part.without_u_m3, part.shared_u_m3, part.u_m3) == pytest.approx((3, 4, 5))
    assert part.without_U_m3 == pytest.approx(3 * 1.959964, rel=1e-6)


# ---- the example


@pytest.fixture(scope="module")
def record():
    return record_of(tankcal.run(tankcal.load("examples/cloud"), simulated=False))


@pytest.mark.slow
def test_the_record_counts_every_point(record):
    found = record["clouds"]
    for file, scan in zip(found["files"], found["scans"], strict=True):
        assert file["declared"] == scan["delivered"] + scan["left_out"]
        assert scan["of_wall"] <= scan["delivered"] - scan["outside"] - scan["beyond"]
        assert file["sha256"] in [one["sha256"] for one in record["files"]]
    part = found["shared_part"]
    assert part["u_m3"] == pytest.approx(np.hypot(part["shared_u_m3"], part["without_u_m3"]))
    assert part["u_m3"] == pytest.approx(record["capacity"]["u_m3"][-1])
    assert part["without_u_m3"] < 0.6 * part["u_m3"]


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_every_table_has_words(record, language):
    words = load_words(language)
    paper, said = PlainPaper(words), translate_record(words, record)
    for table in clouds.TABLES:
        assert table.rows(said) or table in (clouds.JOINTS, clouds.WELDS, clouds.THINGS)
        assert words["workbook"]["headings"][table.name]
        for column in table.on_paper(table.name):
            assert paper.word(f"table_headings.{column.heading or column.key}")
    for block in drawn.blocks_of_tables(Paper(record, words)):
        assert block.data["rows"]


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_certificate_tells_points_and_what_they_are_worth(record, language):
    from tankcal.report.certificate import calibration

    facts = dict(calibration(Paper(record, load_words(language))).data["items"])
    told = facts[load_words(language)["labels"]["scanned"]]
    used = sum(one["of_wall"] for one in record["clouds"]["scans"])
    assert re.sub(r"\D", "", str(used)) in re.sub(r"[\s.,\u202f]", "", told)
    assert "MADE-UP-17" in " ".join(facts.values())


@pytest.mark.slow
def test_the_figure_is_an_image_and_stays_small(record):
    """Property: hundreds of thousands of cells do not become outlines."""
    paper = Paper(record, load_words("en"))
    svg = paper.figure(drawn.cloud_map(paper), "cloud_map", count=1).data["svg"]
    assert svg.count("<path") < 200
    assert "data:image/png" in svg


@pytest.mark.slow
def test_the_workbook_has_a_sheet(record, tmp_path):
    workbook.write(record, tmp_path / "capacity.xlsx")
    sheet = openpyxl.load_workbook(tmp_path / "capacity.xlsx")["Point clouds"]
    cells = [cell.value for row in sheet.iter_rows() for cell in row if cell.value is not None]
    assert {"pipe", "nozzle", "T5", "targets", "MADE-UP-17"} <= set(cells)
    numbers = [one for one in cells if isinstance(one, float)]
    assert pytest.approx(record["clouds"]["shared_part"]["without_u_m3"]) in numbers


@pytest.mark.slow
def test_the_page_tells_the_cell_under_the_pointer(record, tmp_path):
    (tmp_path / "record.json").write_text(json.dumps(record), encoding="utf-8")
    path = tmp_path / "report.html"
    path.write_text(page(paper_blocks(tmp_path / "record.json")), encoding="utf-8")
    drawn_map = record["clouds"]["map"]
    row, column = 3, 10
    with Browser() as browser:
        browser.open(path)
        assert browser.requests == []
        assert browser.complaints == []
        canvas = "document.querySelector('#map canvas')"
        browser.run(f"{canvas}.focus()")
        for key, code, times in (("ArrowRight", 39, column + 1), ("ArrowUp", 38, row)):
            for _ in range(times):
                browser.press(key, code)
        told = browser.text("#map-told")
        value = drawn_map["departure_tenths_mm"][row][column] / 10
        assert told == f"42.0°, 0.56 m: {value:.1f} mm".replace("-", "\N{MINUS SIGN}")
        for _ in range(21):
            browser.press("ArrowRight", 39)
        assert browser.text("#map-told") == "126.0°, 0.56 m: hidden (pipe?)"
        picture = browser.picture("#map canvas")
    assert picture.reshape(-1, 3).std(axis=0).min() > 20  # it is not one colour
