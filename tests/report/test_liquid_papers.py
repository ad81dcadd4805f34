"""What record, papers and workbook say of liquid, of the shipped examples."""

import json
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from job_builder import write_folder
from metered_tanks import metered_parts, metered_rows
from paper_cells import paper_blocks, table_of
from paper_pages import lone_headings, pages_of, sparse_pages
from paper_words import assert_tables_have_words, instruments_said

import tankcal
from tankcal.record import load, record_of, save
from tankcal.record.making import Record
from tankcal.record.schema import from_plain, to_plain
from tankcal.report import liquid as drawn
from tankcal.report import workbook
from tankcal.report.papers import build, parts_without_content
from tankcal.report.plain import PlainPaper
from tankcal.report.tables import liquid
from tankcal.report.tables.facts import CERTIFICATE, SURVEY
from tankcal.report.web.tank_shape import tank_view
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words, translate_record

pytestmark = pytest.mark.slow  # seconds of runs and papers

EXAMPLES = "liquid", "liquid-lying"
ADDED = ["by_factor", "by_meter_temperature", "by_tank_temperature", "by_shell", "by_head"]


@pytest.fixture(scope="module", params=EXAMPLES)
def result(request):
    return tankcal.run(tankcal.load(f"examples/{request.param}"), simulated=False)


@pytest.fixture(scope="module")
def record(result):
    return record_of(result)


@pytest.fixture(scope="module")
def strapped():
    return tankcal.run(tankcal.load("examples/liquid"), simulated=False)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """An upright tank of the drawing alone, a heel of 0.5 m3 on its bottom, filled twice."""
    folder = tmp_path_factory.mktemp("alone")
    parts = metered_parts("vertical", table__step_m=0.1, liquid__bottom_flex_m3_per_m=0.01)
    dips = [None, *np.round(np.arange(0.3, 1.55, 0.2), 3).tolist()]
    volumes = np.diff(np.pi / 4 * 13.01**2 * np.array([0.0, *dips[1:]]) + [0, *[0.5] * 7])
    rows = [row for run in "12" for row in metered_rows(dips, np.round(volumes, 3), run)]
    parts.tables["liquid"][1:] = rows
    return tankcal.run(tankcal.load(write_folder(folder, parts) or folder), simulated=False)


# ---- the record


def test_a_step_is_the_sum_of_its_corrections(record):
    """Closed form: what was indicated and its corrections make the reference, less geometry the
    misclosure; U is k u of the normal distribution."""
    for one in record["liquid"]["steps"]:
        total = one["indicated_m3"] + sum(one[f"{name}_m3"] for name in ADDED)
        assert one["reference_m3"] == pytest.approx(total, abs=1e-9)
        less = one["reference_m3"] - one["geometry_m3"]
        assert one["misclosure_m3"] == pytest.approx(less, abs=1e-9)
        assert one["misclosure_U_m3"] == pytest.approx(1.959964 * one["misclosure_u_m3"], rel=1e-6)


def test_geometry_of_steps_is_the_table_of_geometry(result, record):
    """Second method: increments of geometry are differences of the rows of its table.

    Between rows it is linear here: a centimetre of an upright or lying tank.
    """
    told = record["liquid"]
    heights, volumes = record["capacity"]["height_m"], told["by_geometry"]["volume_m3"]
    for one in told["steps"]:
        if one["from_dip_m"] is not None:
            high, low = np.interp([one["to_dip_m"], one["from_dip_m"]], heights, volumes)
            temperatures = 1e-4 * one["geometry_m3"]  # the dip's own shell temperature is in it
            assert one["geometry_m3"] == pytest.approx(high - low, abs=2e-3 + temperatures)


def test_residuals_are_what_is_to_be_added(record):
    """Closed form: a reading has v = w sd sqrt(r); an uncontrolled one has no w."""
    for one in (*record["liquid"]["steps"], *record["liquid"]["dips"]):
        v, sd = (
            (one["residual_m3"], one["sd_m3"])
            if "sd_m3" in one
            else (one["residual_m"], one["sd_m"])
        )
        if one["w"] is not None:
            assert v == pytest.approx(one["w"] * sd * one["redundancy"] ** 0.5, abs=1e-9)


def test_a_dip_read_too_high_is_to_be_lowered(tmp_path):
    """Planted: 12 mm too high; the residual, the cause and its size say so."""
    parts = metered_parts("vertical", strapped=True, table__step_m=0.1)
    dips = [None, *np.round(np.arange(0.3, 1.55, 0.2), 3).tolist()]
    bare = tankcal.load(_without_liquid(tmp_path / "bare"))
    table = tankcal.run(bare, simulated=False).table
    volumes = np.diff(np.interp([0.0, *dips[1:]], table.height_m, table.volume_m3)) / 1.0005
    rows = metered_rows(dips, np.round(volumes, 4))
    rows[4][3] += 0.012
    parts.tables["liquid"][1:] = rows
    write_folder(tmp_path / "job", parts)
    told = record_of(tankcal.run(tankcal.load(tmp_path / "job"), simulated=False))["liquid"]
    named = [one for one in told["causes"] if one["named"]]
    row = told["dips"][3]["row"]
    assert (named[0]["kind"], named[0]["row"]) == ("dip", row)
    assert named[0]["size"] == pytest.approx(-0.012, abs=0.002)
    assert told["dips"][3]["residual_m"] < -0.009
    assert named[0]["w"] == pytest.approx(told["dips"][3]["w"], rel=1e-3)


def _without_liquid(folder):
    parts = metered_parts("vertical", strapped=True, table__step_m=0.1)
    parts.tables.pop("liquid")
    parts.registers.pop("meters")
    parts.settings = {k: v for k, v in parts.settings.items() if not k.startswith("liquid.")}
    write_folder(folder, parts)
    return folder


def test_three_tables_of_the_printed_rows(result, record):
    """Property: the joint one is the table itself; liquid alone is silent beyond its dips."""
    told, rows = record["liquid"], len(record["capacity"]["height_m"])
    assert told["certified"] == "joint"
    np.testing.assert_allclose(
        told["joint"]["volume_m3"], record["capacity"]["volume_m3"], rtol=1e-9, atol=1e-9
    )
    np.testing.assert_allclose(told["joint"]["U_m3"], record["capacity"]["U_m3"], rtol=1e-6)
    for name in ("by_geometry", "by_liquid", "joint"):
        assert {len(column) for column in told[name].values()} == {rows}
    for height, volume in zip(
        record["capacity"]["height_m"], told["by_liquid"]["volume_m3"], strict=True
    ):
        inside = told["lowest_dip_m"] - 1e-9 <= height <= told["highest_dip_m"] + 1e-9
        assert (volume is not None) == inside


def test_liquid_is_the_last_correction(record):
    """Closed form: the corrections lead from the surveyed shell to the top row."""
    assert record["corrections"][-1]["code"] == "liquid"
    if record["gross"]:
        sizes = sum(one["size_m3"] for one in record["corrections"] if one["applied"])
        top = record["capacity"]["volume_m3"][-1]
        assert record["gross"]["volume_m3"] + sizes == pytest.approx(top, abs=1e-6)


def test_courses_are_those_of_the_joint_table(strapped):
    """Closed form: courses, the volume below the first dip, the bottom's flexing and the head make
    the top row, but for what liquid says of the inputs of the head (density, stiffness: 0.8 L)."""
    record = record_of(strapped)
    told = record["liquid"]
    head = strapped.body.head * record["capacity"]["height_m"][-1]
    loaded = next(one["size_m3"] for one in record["corrections"] if one["code"] == "head")
    rest = told["below_first_dip_m3"] + told["bottom_flex"] * head + loaded
    whole = sum(one["volume_m3"] for one in record["courses"]) + rest
    top = record["capacity"]["volume_m3"][-1]
    assert whole == pytest.approx(top, abs=1e-3)


def test_a_tank_of_the_drawing_has_its_courses(alone):
    record = record_of(alone)
    told = record["liquid"]
    assert told["geometry"] == "drawing"
    assert [one["radius_m"] for one in record["courses"]] == [6.5] * 5
    assert record["courses"][0]["inside_radius_m"] == pytest.approx(6.505, abs=0.004)
    assert told["below_first_dip_m3"] == pytest.approx(0.5, abs=2.5 * told["u_below_first_dip_m3"])
    assert (
        tank_view(paper_of(record)).data["reason"] == load_words("en")["web"]["no_view_of_drawing"]
    )
    said = {one["code"]: one["value"] for one in record["choices"]}
    assert said["thickness"] == "drawing"
    assert said["liquid_beside"] == "drawing"


def test_the_record_is_read_as_it_was_saved(record, tmp_path):
    save(record, tmp_path / "record.json")
    found = load(tmp_path / "record.json")
    assert found == json.loads((tmp_path / "record.json").read_text("utf-8"))
    assert to_plain(from_plain(Record, found, "record.json"))["liquid"] == found["liquid"]


def test_a_record_without_liquid_has_no_chapter():
    assert "liquid" in parts_without_content({})


# ---- words and papers


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_table_has_words(record, language):
    tables = [liquid.METERS, liquid.RUNS, liquid.STEPS, liquid.DIPS, liquid.CAUSES]
    if record["liquid"]["sizes"]:
        tables.append(liquid.SIZES)
    assert_tables_have_words(record, tables, language)
    words = load_words(language)
    for one in record["budget"]:
        assert one["kind"] in words["inputs"]
    for kind in ("fahrenheit", "swapped", *(one["kind"] for one in record["liquid"]["causes"])):
        assert kind in words["liquid_causes"]


def paper_of(record, language="en"):
    words = load_words(language)
    paper = PlainPaper(words)
    paper.record = translate_record(words, record)
    return paper


@pytest.fixture(scope="module")
def found(record, tmp_path_factory):
    """Blocks of certificate and working papers."""
    path = tmp_path_factory.mktemp("paper") / "record.json"
    save(record, path)
    return paper_blocks(path)


def test_the_paper_says_the_numbers_of_the_record(record, found):
    told = record["liquid"]
    rows = table_of(found, "Each step compared with the geometry")
    assert len(rows) == len(told["steps"])
    for row, one in zip(rows, told["steps"], strict=True):
        assert int(row[0]) == one["row"]
        cells = [float(cell.replace("−", "-").replace("\xa0", "")) for cell in row[3:]]
        assert cells[0] == pytest.approx(one["to_dip_m"], abs=6e-5)
        assert cells[3] == pytest.approx(1000 * one["misclosure_m3"], abs=0.6)
        assert cells[4] == pytest.approx(1000 * one["misclosure_U_m3"], abs=0.6)
        assert cells[5] == pytest.approx(one["misclosure_w"], abs=6e-3)
    shown = table_of(found, "Volumes by geometry alone")
    places = drawn.chosen_rows(record)
    assert len(shown) == len(places) <= drawn.MOST_ROWS + 2
    for row, place in zip(shown, places, strict=True):
        volume = float(row[5].replace("\xa0", ""))
        assert volume == pytest.approx(told["joint"]["volume_m3"][place], abs=6e-4)


def test_figures_show_every_step_and_the_filled_range(record):
    told, paper = record["liquid"], paper_of(record)
    paper.words["axes"] = load_words("en")["axes"]
    (ax,) = drawn.misclosures(paper).axes
    assert sum(len(one[0].get_xdata()) for one in ax.containers) == len(told["steps"])
    left, right = drawn.differences(paper).axes
    assert left.get_xlim()[0] >= told["lowest_dip_m"] - 1e-9
    assert left.get_xlim()[1] <= told["highest_dip_m"] + 1e-9
    assert right.get_xlim()[1] == pytest.approx(record["capacity"]["height_m"][-1])


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_certificate_says_what_was_filled(record, language):
    paper = paper_of(record, language)
    facts = dict(paper.facts_of(SURVEY, CERTIFICATE))
    told = record["liquid"]
    assert str(len(told["steps"])) in facts["metered"]
    assert (
        paper.number(told["meters"][0]["factor"], u=told["meters"][0]["u_factor"])
        in (facts["metered_with"])
    )
    assert told["meters"][0]["prover"] in facts["metered_with"]
    assert facts["metered_table"] == load_words(language)["liquid_tables"]["joint"]
    assert told["meters"][0]["certificate"] in instruments_said(record)
    said = [text for text in facts.values() if text]
    assert not any("ISO" in text or "API" in text for text in said)  # a method is the job's to name


@pytest.mark.slow
def test_the_workbook_has_two_sheets(record, tmp_path):
    workbook.write(record, tmp_path / "capacity.xlsx")
    book = openpyxl.load_workbook(tmp_path / "capacity.xlsx")
    names = [name for sheet in book.worksheets for name in sheet.tables]
    expected = {"liquid_meters", "liquid_runs", "liquid_causes", "liquid_steps", "liquid_dips"}
    assert expected | {"liquid_volumes"} <= set(names)  # none is refused for equal headings
    sheet = book["Steps by liquid"]
    rows = [[cell.value for cell in row] for row in sheet.iter_rows()]
    found = [row for row in rows if row[0] == record["liquid"]["steps"][1]["row"]]
    expected = record["liquid"]["steps"][1]["reference_m3"]
    assert any(cell == pytest.approx(expected, rel=1e-12) for cell in found[0][6:])


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_pages_are_filled(strapped, language, tmp_path):
    save(record_of(strapped), tmp_path / "record.json")
    build(tmp_path / "record.json", tmp_path, language=language)
    headings = load_words(language)["headings"].values()
    for name in ("certificate.pdf", "working-papers.pdf"):
        pages = pages_of(Path(tmp_path) / name)
        assert not sparse_pages(pages)
        assert not lone_headings(pages, headings)
