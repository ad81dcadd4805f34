"""What record, papers and workbook say of bare wall hits, of the shipped example."""

import numpy as np
import pytest
from paper_words import assert_tables_have_words, cells_of_sheet, instruments_said

import tankcal
from tankcal.methods.hits import saved as hits
from tankcal.record import record_of
from tankcal.text.shipped import LANGUAGES

SLOW_FIXTURES = {"result", "record"}  # seconds each


@pytest.fixture(scope="module")
def result():
    return tankcal.run(tankcal.load("examples/wall-hits"), simulated=False)


@pytest.fixture(scope="module")
def record(result):
    return record_of(result)


def test_the_record_has_set_ups_rings_and_what_is_shared(result, record):
    (setup,) = record["hits"]["setups"]
    assert (setup["hits"], setup["rejected"], setup["checks"]) == (197, 3, 6)
    assert setup["tie"] == "frame"
    rings = record["hits"]["rings"]
    assert sum(one["hits"] for one in rings) == 197
    assert sum(one["rejected"] for one in rings) == 3
    assert [one["level_m"] for one in rings] == sorted(one["level_m"] for one in rings)
    assert sum(one["hits"] for one in record["hits"]["incidence"]) == 206
    offset = next(one for one in record["hits"]["shared"] if one["what"] == "instrument_offset")
    assert offset["u_before"] is None
    assert offset["value"] == pytest.approx(-2.1, abs=2 * offset["u_after"])
    first = (
        1000 * result.sighting.estimated_m["TS-4"]
    )  # taken off; the wall without it tells the rest
    (rest,) = (
        1000 * one.value for one in result.sighting.estimates if one.what == "instrument_offset"
    )
    assert offset["value"] == pytest.approx(first + rest, abs=1e-9)
    assert abs(rest) < 0.05 * offset["u_after"]
    assert -1 < offset["correlation"] < 0


def test_the_two_hits_of_the_ladder_are_rejected(record):
    rejected = {one["point"] for one in record["rejected"]}
    assert {"I 57", "I 117"} <= rejected


def test_control_targets_count_from_their_first_reading(record):
    control = record["hits"]["control"]
    assert [one["elapsed_h"] for one in control[:3]] == pytest.approx([0, 0.5, 62 / 60])
    assert control[0]["direction_rad"] == 0
    (drift,) = record["hits"]["drifts"]
    per_hour = np.degrees(drift["direction_rad_h"]) * 3600
    assert 0 < per_hour < 4  # drawn: 1.2 and 1.7 arcsec after 30 and 62 minutes


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_table_has_words(record, language):
    tables = (
        *(hits.SETUPS, hits.SHARED, hits.RINGS, hits.INCIDENCE),
        *(hits.CONTROL, hits.DRIFTS, hits.COMPARED),
    )
    assert_tables_have_words(record, tables, language)


@pytest.mark.slow
def test_the_workbook_has_a_sheet(record, tmp_path):
    cells = cells_of_sheet(record, tmp_path / "capacity.xlsx", "Wall hits")
    assert "TS-4" in cells
    assert "Offset of the instrument" in cells
    assert cells.count("I") == 1 + 9 + 1 + 6


def test_straps_beside_hits_are_on_the_certificate(record):
    said = instruments_said(record)
    assert "TS 4/2026" in said
    assert "T 12/2026" in said
    assert {one["code"]: one["value"] for one in record["choices"]}["straps"] == "beside_points"
