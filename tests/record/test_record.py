"""The record: complete, plain, and equal to what was computed."""

import json
from copy import deepcopy

import numpy as np
import pytest
from job_builder import write_job

import tankcal
from tankcal import record as records
from tankcal.errors import InputError
from tankcal.record import load, record_of, save
from tankcal.record.covariance_factor import factor_of


@pytest.fixture(scope="module")
def record(example_record):
    return load(example_record)


@pytest.mark.slow
def test_it_is_strict_json_and_comes_back(example_result, tmp_path):
    record = record_of(example_result)
    save(record, tmp_path / "record.json")
    assert load(tmp_path / "record.json") == record
    assert "NaN" not in (tmp_path / "record.json").read_text()


@pytest.mark.slow
def test_it_is_read_as_dataclasses(example_record, example_result):
    read = records.read(example_record)
    assert read.capacity.volume_m3 == list(example_result.table.volume_m3)
    assert read.job.tank == example_result.job.tank
    assert read.corrections[0].formula == example_result.corrections[0].formula
    assert read.corrections[0].formula.code == example_result.corrections[0].formula.code
    circles = [section.circle.radius_m for section in example_result.wall.sections]
    assert [section.radius_m for section in read.sections] == circles


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"format": "tankcal-record/9"}', "\x00", "{" * 100_000]
)
def test_foreign_file_is_refused_as_record(text, tmp_path):
    path = tmp_path / "record.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"record\.json"):
        load(path)


@pytest.mark.parametrize("is_checked", [True, False])
@pytest.mark.parametrize(
    "damage",
    [
        lambda factor: factor.pop(),
        lambda factor: factor[-1].update(rows=factor[-1]["rows"] + 1),
        lambda factor: factor[-1].update(weights=[]),
        lambda factor: factor[-1]["factor_m3"][0].pop(),
        lambda factor: [row.append(0.0) for row in factor[-1]["factor_m3"]],
    ],
)
def test_a_damaged_factor_is_refused(record, damage, is_checked, tmp_path):
    damaged = deepcopy(dict(record["capacity"]))
    damage(damaged["factor"])
    save(record | {"capacity": damaged}, tmp_path / "record.json")
    with pytest.raises(InputError, match=r"record\.json, capacity\.factor: does not fit the "):
        load(tmp_path / "record.json", is_checked=is_checked)


def test_rows_of_the_table_equal_the_result(record, example_result):
    table = record["capacity"]
    assert table["volume_m3"] == list(example_result.table.volume_m3)
    factor = factor_of(table)
    assert factor.shape == (len(table["height_m"]), len(table["inputs"]))
    assert np.sqrt(np.sum(factor**2, axis=1)) == pytest.approx(table["u_m3"], rel=1e-12)
    assert np.array(table["k"]) * table["u_m3"] == pytest.approx(table["U_m3"], rel=1e-12)
    assert len(set(table["inputs"])) == len(table["inputs"])


def test_courses_add_up_to_the_top_row(record):
    total = sum(course["volume_m3"] for course in record["courses"])
    assert total == pytest.approx(record["capacity"]["volume_m3"][-1], rel=1e-12)


def test_corrections_lead_from_gross_to_the_table(record):
    """Closed: gross + plate + paint + temperature = the top row; tilt is contained."""
    sizes = {row["code"]: row["size_m3"] for row in record["corrections"]}
    net = record["gross"]["volume_m3"] + sizes["plate"] + sizes["paint"] + sizes["temperature"]
    assert net == pytest.approx(record["capacity"]["volume_m3"][-1], rel=1e-12)
    expected = -2 * np.pi * 6.479 * (1.9 * (8 + 7.1 + 3 * 6.3) / 1000)  # thin wall, closed form
    assert sizes["plate"] == pytest.approx(expected, rel=1e-3)


def test_shares_of_the_budget_add_up_to_one(record):
    assert sum(row["share"] for row in record["budget"]) == pytest.approx(1.0, abs=1e-12)
    datum = next(row for row in record["budget"] if row["input"] == "datum")
    assert datum["contribution_m3"] == pytest.approx(
        record["capacity"]["area_m2"][-1] * 0.004, rel=1e-12
    )
    assert datum["sensitivity"] == pytest.approx(
        record["capacity"]["area_m2"][-1] / 1000, rel=1e-12
    )
    assert datum["sensitivity_unit"] == "m3/mm"


def test_points_are_listed_once_and_sections_hold_used_ones(record):
    names = [row["point"] for row in record["points"]]
    assert len(names) == len(set(names)) == record["shell"]["points"]
    used = {row["point"] for row in record["points"] if row["used"]}
    assert used == {name for section in record["sections"] for name in section["points"]}
    assert used.isdisjoint(row["point"] for row in record["rejected"])
    assert len(used) + len(record["rejected"]) == len(names)


def test_files_are_identified_by_hash(record):
    import hashlib

    from conftest import EXAMPLE

    for file in record["files"]:
        content = (EXAMPLE / file["file"]).read_bytes()
        assert hashlib.sha256(content).hexdigest() == file["sha256"]
        assert len(content) == file["bytes"]
    assert {"job.toml", "points.csv", "courses.csv"} <= {file["file"] for file in record["files"]}


def test_no_path_of_a_machine_is_in_the_record(example_record):
    from conftest import ROOT

    assert str(ROOT) not in example_record.read_text()


@pytest.mark.slow
def test_undeclared_values_are_stated(tmp_path):
    write_job(tmp_path / "job", uncertainty=[("scale", 20, "ppm")])
    record = record_of(tankcal.run(tankcal.load(tmp_path / "job")))
    choices = {choice["code"]: choice["value"] for choice in record["choices"]}
    assert "scale" not in choices["not_in_budget"]
    assert "datum" in choices["not_in_budget"]
    assert choices["covariance"] == "estimated"
    assert choices["covariance_sd_mm"] > 0


@pytest.mark.slow
def test_rejected_points_have_row_reason_and_residual(tmp_path):
    write_job(tmp_path / "job", extra_points=[("stair", 7.4, 0.0, 3.0), ("roof", 1.0, 0.0, 10.2)])
    record = record_of(tankcal.run(tankcal.load(tmp_path / "job")))
    found = {row["point"]: row for row in record["rejected"]}
    assert found["stair"]["reason"] == "consensus"
    assert found["stair"]["residual_m"] == pytest.approx(0.9, abs=1e-3)
    assert found["stair"]["row"] == 122
    assert found["roof"]["reason"] == "above_shell"


def test_unused_numbers_are_null(record):
    assert record["rule"] is None


@pytest.mark.parametrize("rows", [0, 1, 999, 1000, 1001, 2500])
def test_a_record_is_written_in_pieces_of_the_same_json(rows, tmp_path):
    """Second method: all of it at once."""
    row = {"name": '\u00e9 "', "values": [1.5, None, True], "none": {}}
    record = {"table": {"rows": [row] * rows, "height_m": [0.1] * rows}, "empty": {}, "n": None}
    save(record, tmp_path / "record.json")
    whole = json.dumps(record, ensure_ascii=False, separators=(",", ":"))
    assert (tmp_path / "record.json").read_text(encoding="utf-8") == whole + "\n"
