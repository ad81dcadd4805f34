"""What record, papers and workbook say of tangents, of the shipped example."""

import json
from pathlib import Path

import pytest
from paper_words import assert_tables_have_words, cells_of_sheet, instruments_said

import tankcal
from tankcal.methods.tangents import saved as tangents
from tankcal.record import record_of
from tankcal.text.shipped import LANGUAGES

EXAMPLE = Path("examples/tangents")


SLOW_FIXTURES = {"result", "record"}  # seconds each


@pytest.fixture(scope="module")
def result():
    return tankcal.run(tankcal.load(EXAMPLE), simulated=False)


@pytest.fixture(scope="module")
def record(result):
    return record_of(result)


def test_the_truth_is_within_U(result, figure):
    """Simulation: its truth is a wall of seams and waves that the sights were turned to touch."""
    truth = json.loads((EXAMPLE / "truth.json").read_text("utf-8"))["volume_m3"]
    error = result.table.volume_m3[-1] - truth
    figure("error over U of examples/tangents", f"{error / result.table.U_m3[-1]:.2f}")
    assert abs(error) < result.table.U_m3[-1]


def test_the_two_sights_that_met_a_rail_are_set_aside(record):
    gone = [one for one in record["tangents"]["readings"] if not one["used"] and one["w"]]
    assert [(one["setup"], one["side"]) for one in gone] == [("I3", "right"), ("I6", "right")]
    assert all(one["departure_m"] > 0.02 for one in gone)


def test_every_set_up_and_level_is_there(record):
    said = record["tangents"]
    assert len(said["setups"]) == 8
    assert sum(one["tangents"] for one in said["setups"]) == 156
    assert sum(one["checks"] for one in said["setups"]) == 2
    assert [one["level_m"] for one in said["levels"]] == sorted(
        one["level_m"] for one in said["levels"]
    )
    for one in said["levels"]:
        assert one["area_m2"] == pytest.approx(one["wall_area_m2"], rel=2e-4)
        assert one["perimeter_m"] ** 2 / (4 * 3.141592653589793) >= one["area_m2"]
    assert said["excess_m"] > 0


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_table_has_words(record, language):
    tables = tangents.SETUPS, tangents.LEVELS, tangents.READINGS
    assert_tables_have_words(record, tables, language)


@pytest.mark.slow
def test_the_workbook_has_a_sheet(record, tmp_path):
    cells = cells_of_sheet(record, tmp_path / "capacity.xlsx", "Tangents")
    assert cells.count("I1") == 1 + 20
    assert {"left", "right", "TS"} <= set(cells)


def test_instruments_of_tangents_are_on_the_certificate(record):
    said = instruments_said(record)
    assert "TS-2026-03" in said
    assert "B-2025-17" in said
