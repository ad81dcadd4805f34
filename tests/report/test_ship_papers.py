"""What record, CSV, papers and workbook say of a tank of a ship, of the shipped example."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from paper_words import assert_tables_have_words, cells_of_sheet

import tankcal
from tankcal import record as records
from tankcal.record import record_of
from tankcal.report.certificate import calibration
from tankcal.report.outputs import write_tables
from tankcal.report.paper import Paper
from tankcal.report.plain import PlainPaper
from tankcal.report.tables import ship
from tankcal.report.tables import ship as tables
from tankcal.report.uncertainty.stated import stated_U_m3
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words, translate_record

EXAMPLE = Path("examples/ship")


@pytest.fixture(scope="module")
def result():
    return tankcal.run(tankcal.load(EXAMPLE), simulated=False)


@pytest.fixture(scope="module")
def record(result):
    return record_of(result)


@pytest.mark.slow
def test_the_record_holds_what_was_computed(result, record, tmp_path):
    said, found = record["ship"], result.ship
    assert len(said["cells"]) == 35
    assert said["list_deg"] == [-2.0, -1.0, 0.0, 1.0, 2.0]
    for place, one in zip(np.ndindex(7, 5), said["cells"], strict=True):
        assert one["trim_m"] == found.trim_m[place[0]]
        known = [np.nan if value is None else value for value in one["correction_m"]]
        np.testing.assert_array_equal(known, found.correction_m[place])
    records.save(record, tmp_path / "record.json")
    assert records.load(tmp_path / "record.json") == json.loads(json.dumps(record))
    assert record["capacity"]["zero"] == "pipe_bottom"


def test_a_record_without_a_ship_is_sound(record, tmp_path):
    """As every record before this one was."""
    records.save(
        {key: value for key, value in record.items() if key != "ship"}, tmp_path / "r.json"
    )
    assert "ship" not in records.load(tmp_path / "r.json")


def test_the_csv_has_every_correction(record, tmp_path):
    write_tables(record, tmp_path)
    with open(tmp_path / "ship_corrections.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 35 * len(record["ship"]["sounding_m"])
    cell = record["ship"]["cells"][28]  # a trim of 2 m and a list of 1 degree
    (row,) = [
        one
        for one in rows
        if (one["trim_m"], one["list_deg"], one["sounding_m"]) == ("2", "1", "2")
    ]
    assert float(row["correction_mm"]) == pytest.approx(1000 * cell["correction_m"][8])
    assert float(row["volume_m3"]) == pytest.approx(cell["volume_m3"][8])
    full = [one for one in rows if one["state"] == "full"]
    assert full
    assert {one["correction_mm"] for one in full} == {""}


def test_a_mesh_is_no_survey(record):
    paper = Paper(record)
    full = dict(paper.dimensions(record["solid"]).data["items"])[paper.label("full_capacity")]
    stated = paper.number(
        record["capacity"]["volume_m3"][-1], "m3", u=stated_U_m3(record["capacity"])[-1]
    )
    assert full == stated  # the digits of the headline
    assert "mesh is the inside surface" in " ".join(paper.choices())
    assert "Surveyed from" not in dict(calibration(paper).data["items"])


def test_even_keel_has_the_correction_zero_down_to_the_first_row(record):
    """By definition; the volumes of the two meshes differ by rounding only."""
    (level,) = [cell for cell in record["ship"]["cells"] if cell["trim_m"] == cell["list_deg"] == 0]
    corrections = [
        correction
        for correction, state in zip(level["correction_m"], level["state"], strict=True)
        if state != "full"
    ]
    assert corrections == pytest.approx([0.0] * len(corrections), abs=1e-9)
    assert level["full_m"] - record["ship"]["sounding_m"][len(corrections) - 1] < 0.25


@pytest.mark.parametrize("language", LANGUAGES)
def test_papers_in_every_language(record, language):
    """A matrix for each list, seven trims wide, and the states in words."""
    assert_tables_have_words(record, [tables.CELLS], language)
    words = load_words(language)
    paper = PlainPaper(words)
    paper.record = translate_record(words, record)
    matrices = [one.data for one in ship.corrections(paper)]
    assert len(matrices) == 5
    assert all(one["captioned"] for one in matrices)
    assert all(len(one["columns"]) == 9 for one in matrices)
    assert {len(one["rows"]) for one in matrices} == {len(record["ship"]["sounding_m"])}
    assert any(words["ship_states"]["full"] in row for row in matrices[0]["rows"])
    assert matrices[3]["rows"][8][6] == paper.number(-188.0, decimals=1)
    assert len(ship.facts(paper).data["items"]) == 5  # no contraction was given


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_tank_that_is_full_beyond_the_end_of_its_pipe(record, language):
    """A pipe that ends below the highest soundings when full: told in words above the tables."""
    soundings = sorted(cell["full_m"] for cell in record["ship"]["cells"])
    bottom = record["ship"]["pipe_bottom_m"]
    length = (soundings[-4] + soundings[-3]) / 2
    cut = record["ship"] | {"pipe_top_m": [*bottom[:2], bottom[2] + length]}
    beyond = sum(one > length + 0.0005 for one in soundings)
    words = load_words(language)
    paper = PlainPaper(words)
    paper.record = translate_record(words, record | {"ship": cut})
    (said, *matrices) = [one.data for one in ship.corrections(paper)]
    assert beyond in (2, 3)
    number = paper.number(length, "m", decimals=3)
    assert said["text"] == words["texts"]["ship_beyond_pipe"].format(
        count=beyond, cells=35, length=number
    )
    assert len(matrices) == 5


@pytest.mark.slow
def test_the_workbook_has_a_sheet(record, tmp_path):
    cells = cells_of_sheet(record, tmp_path / "capacity.xlsx", "Trim and list")
    assert cells.count("full") > 35
    found = [cell for cell in cells if isinstance(cell, float)]
    assert any(cell == pytest.approx(-188.0, abs=0.05) for cell in found)
