"""Decisions that override the search for blunders in the documents, in three languages."""

from dataclasses import replace

import numpy as np
import openpyxl
import pytest
from job_builder import job_parts, write_folder

import tankcal
from tankcal.job.model import Overruling
from tankcal.record import load, record_of, save
from tankcal.record.versions import FORMAT
from tankcal.report.paper import Paper
from tankcal.report.papers import parts_without_content
from tankcal.report.tables.survey import OVERRULINGS, sentences
from tankcal.text.shipped import LANGUAGES

TURN = np.radians(7.5)
DENT = ("dent", 6.46 * np.sin(TURN), 6.46 * np.cos(TURN), 5.225)
SOUND = ("a", 6.5, 0.0, 5.2)
WHY = 'dent <b>"seen"</b>; photograph 14.'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    parts = job_parts(
        rings=2, noise_mm=1.0, extra_points=[DENT, SOUND], settings={"table.step_m": 1.9}
    )
    parts.tables["overrulings"] = [
        ["point", "decision", "reason", "by", "date"],
        ["dent", "keep", WHY, "J. Silva", "2024-06-01"],
        ["a", "leave_out", "target fell off", None, None],
    ]
    return write_folder(tmp_path_factory.mktemp("overruled") / "job", parts)


@pytest.fixture(scope="module")
def result(folder):
    return tankcal.run(tankcal.load(folder), simulated=False)


@pytest.fixture(scope="module")
def record(result):
    return record_of(result)


@pytest.mark.slow
def test_the_record_keeps_them(record, result, tmp_path):
    save(record, tmp_path / "record.json")
    kept = load(tmp_path / "record.json")
    assert kept["format"] == FORMAT  # an optional key needs no new version
    dent, left = kept["overrulings"]["each"]
    assert (dent["what"], dent["decision"], dent["reason"]) == ("dent", "keep", WHY)
    assert (dent["by"], dent["date"], dent["row"]) == ("J. Silva", "2024-06-01", 2)
    assert (dent["searched"], dent["is_outrageous"]) == ("snooping", True)
    assert (left["searched"], left["is_outrageous"]) == ("", False)
    assert dent["moved_m3"] == result.overrulings.each[0].moved_m3
    assert "dent" not in [one["point"] for one in kept["rejected"]]
    assert ("a", "overruled") in [(one["point"], one["reason"]) for one in kept["rejected"]]


@pytest.mark.slow
def test_without_decisions_there_is_no_key(folder):
    job = replace(tankcal.load(folder), overrulings=())
    record = record_of(tankcal.run(job, simulated=False))
    assert "overrulings" not in record
    assert "overrulings" in parts_without_content(record)
    assert sentences(Paper(record)) == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_certificate_states_each(record, language):
    paper = Paper(record, language=language)
    dent, left, together = sentences(paper)
    row = record["overrulings"]["each"][0]
    assert "dent" in dent
    assert 'dent <b>"seen"</b>; photograph 14.' in dent  # one full stop, not two
    assert "14.." not in dent
    assert "J. Silva" in dent
    assert paper.day("2024-06-01") in dent
    assert paper.words["reasons"]["snooping"] in dent
    for value, unit, decimals in ((row["off_m"], "mm", 1), (row["moved_m3"], "m3", 3)):
        assert paper.number(value, unit, decimals=decimals) in dent
    assert "target fell off" in left
    assert paper.number(abs(record["overrulings"]["moved_m3"]), "m3", decimals=3) in together


@pytest.mark.slow
def test_a_single_decision_is_told_once(folder):
    job = tankcal.load(folder)
    record = record_of(tankcal.run(replace(job, overrulings=job.overrulings[:1]), simulated=False))
    assert len(sentences(Paper(record))) == 1


def test_a_reading_is_named_by_table_and_row(record):
    row = dict(record["overrulings"]["each"][0], what="zenith_angles 17", kind="reading")
    row |= {"off_m": None, "searched": "removed", "moved_m3": None}
    other = record | {"overrulings": {"each": [row], "moved_m3": None, "others": ["directions 9"]}}
    told, others = sentences(Paper(other))
    assert told.startswith("reading in row 17 of zenith_angles: kept")
    assert "directions 9" in others


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_working_papers_list_them(record, language):
    paper = Paper(record, language=language)
    rows = paper.show(OVERRULINGS).data["rows"]
    assert [row[0] for row in rows] == ["dent", "a"]
    assert rows[0][2] == WHY


@pytest.mark.slow
def test_only_adjusted_readings_are_told():
    decided = (
        Overruling(None, "directions", 7, "leave_out", "bumped", row=2),
        Overruling("3-01", None, None, "keep", "of the wall", row=3),
    )
    job = tankcal.load("examples/total-station", only="adjustment")
    from tankcal.record import record_of_adjustment

    job = replace(job, overrulings=decided)
    record = record_of_adjustment(job, tankcal.adjust_job(job))
    (row,) = record["overrulings"]["each"]
    assert (row["what"], row["searched"], row["moved_m3"]) == ("directions 7", None, None)
    assert len(sentences(Paper(record))) == 1


@pytest.mark.slow
def test_all_papers(folder, result, tmp_path):
    out = tmp_path / "out"
    tankcal.write(result, out)
    sheet = openpyxl.load_workbook(out / "capacity.xlsx").worksheets[0]
    cells = [str(cell.value) for line in sheet.iter_rows() for cell in line if cell.value]
    assert any(one.startswith("dent: kept, regardless of the search") for one in cells)
    html = (out / "report.html").read_text(encoding="utf-8")
    assert "<b>&quot;seen" not in html
    assert "Decisions that override the search for gross errors" in html


def test_the_digital_certificate_states_each(record):
    from tankcal.report.dcc import certificate_xml

    text = certificate_xml(record, digest="0" * 64).decode("utf-8")
    assert text.count("tankcal_overruling") == 2
    assert "dent: mantido, independentemente da busca" in text
