"""The papers of a strapped tank: what the workbook, the CSV file and the certificate say of it."""

import csv

import openpyxl
import pytest
from job_builder import strapped_parts, write_folder

import tankcal
from tankcal.methods.strapping.saved import STRAPS, strapped_courses_of, straps_of
from tankcal.record import load as load_record
from tankcal.record import read
from tankcal.report.outputs import write
from tankcal.report.paper import Paper
from tankcal.text.words import load_words


@pytest.fixture(scope="module")
def strapped(tmp_path_factory):
    """Folder of the record and the CSV files of tank S-1: with a master, a shape, a free span."""
    parts = strapped_parts(shell__shape_sd_mm=5.0, strapping__wave_mm=20.0)
    tape = parts.registers["instruments"]["T-12"]
    parts.registers["instruments"] = {"T-12": tape | {"master": "M-1"}, "M-1": dict(tape)}
    parts.tables["tape_checks"] = [["level", "master_m", "working_m", "s_mm"],
                                   ["2", 45.315, 45.314, 0.3]]  # fmt: skip
    header, *rows = parts.tables["obstructions"]
    span = ["1a", "sag", 2, None, None, None, 10.0]
    parts.tables["obstructions"] = [[*header, "span_m"], *([*row, None] for row in rows), span]
    parts.registers["instruments"]["T-12"]["weight_n_per_m"] = 0.2
    folder = tmp_path_factory.mktemp("strapped")
    result = tankcal.run(tankcal.load(write_folder(folder / "job", parts)), simulated=False)
    write(result, folder / "results", papers=False)
    return result, folder / "results"


@pytest.mark.slow
def test_the_record_has_every_reading(strapped):
    result, folder = strapped
    found = read(folder / "record.json").strapping
    assert [one.circumference for one in found.readings] == [
        one.strap.name for one in result.strapped.reduced
    ]
    steps = (
        *("certificate", "temperature", "tension", "tape_thickness", "rise", "sag", "out_of_level"),
    )
    for one in found.readings:
        corrected = one.reading_m + sum(getattr(one, f"{step}_m") for step in steps)
        assert one.circumference_m == pytest.approx(corrected, abs=1e-9)
    for one, radius in zip(found.courses, result.strapped.radius_m, strict=True):
        assert one.radius_m == pytest.approx(radius)
        assert one.inside_radius_m == pytest.approx(radius - one.thickness_m - one.paint_m)
        assert 0 < one.radius_sd_m < 2e-3
    assert (found.tapes[0].master, found.tapes[0].comparisons) == ("M-1", 1)


def test_the_courses_are_those_of_the_table(strapped):
    result, folder = strapped
    record = read(folder / "record.json")
    assert sum(one.volume_m3 for one in record.courses) == pytest.approx(
        result.body.shell.volume.volume_m3([8.4])[0]
    )
    assert [one.points for one in record.courses] == [2] * 5
    assert record.sections == []


def test_the_csv_file_has_every_reading(strapped):
    result, folder = strapped
    with open(folder / "strapping.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["circumference_m"]) for row in rows] == pytest.approx(
        [one.circumference_m for one in result.strapped.reduced], abs=1e-6
    )
    assert {row["used"] for row in rows} == {"yes"}
    sags = [float(row["sag_mm"]) for row in rows]
    assert sags == pytest.approx([-2e3 * 0.2**2 * 10**3 / (24 * 60**2), *[0] * 9], abs=1e-6)


def test_the_budget_names_the_tape_that_hangs(strapped):
    paper = Paper(load_record(strapped[1] / "record.json"))
    lines = {one["input"]: paper.input_name(one) for one in paper.record["budget"]}
    assert lines["tape_weight"] == "Weight of the tape: T-12"


@pytest.mark.slow
@pytest.mark.parametrize("language", ["en", "es", "pt-BR"])
def test_the_workbook_has_a_sheet_of_it(strapped, tmp_path, language):
    from tankcal.report.workbook import write as write_workbook

    result, folder = strapped
    record = load_record(folder / "record.json")
    write_workbook(record, tmp_path / "capacity.xlsx", language)
    book = openpyxl.load_workbook(tmp_path / "capacity.xlsx")
    title = Paper(record, language=language).words["workbook"]["sheets"]["strapping"]
    cells = [cell.value for row in book[title].iter_rows() for cell in row]
    for one in result.strapped.reduced:
        assert one.strap.reading_m in cells


def test_the_certificate_names_the_tapes(strapped):
    from tankcal.report.certificate import calibration

    paper = Paper(load_record(strapped[1] / "record.json"))
    said = dict(calibration(paper).data["items"])[paper.label("instruments")]
    assert "T-12" in said
    assert "M-1" in said
    assert "T 12/2026" in said


def test_what_was_assumed_is_said(strapped):
    paper = Paper(load_record(strapped[1] / "record.json"))
    said = " ".join(paper.choices())
    assert "measured by tape" in said
    assert "deviations of 5 mm" in said
    assert "cylinder with the mean radius" in said
    missing = next(
        one["value"] for one in paper.record["choices"] if one["code"] == "not_in_budget"
    )
    assert "offset" not in missing
    assert "tilt" in missing  # not measured, and no standard uncertainty was declared


@pytest.mark.slow
def test_a_declared_tilt_is_not_missing(tmp_path):
    parts = strapped_parts()
    parts.tables["uncertainty"] = [["input", "u", "unit", "type"], ["tilt", 2.0, "mm/m", "B"]]
    result = tankcal.run(tankcal.load(write_folder(tmp_path, parts)), simulated=False)
    assert "tilt" not in result.body.undeclared()


@pytest.mark.parametrize("language", ["en", "pt-BR", "es"])
def test_papers_of_a_lying_tank_speak_of_rings(language):
    record = {"job": {"tank": {"kind": "horizontal"}}}
    headings = load_words(language)["table_headings"]
    for table in (straps_of(record), strapped_courses_of(record)):
        shown = {one.key: one.heading for one in table.on_paper()}
        assert shown["course"] == "ring"
        assert headings["ring"] != headings["level_m"]
    places = {one.key: one for one in straps_of(record).in_csv()}
    assert (places["course"].csv, places["level_m"].csv) == ("ring", "from_a_m")
    upright = {"job": {"tank": {"kind": "vertical"}}}
    assert straps_of(upright) is STRAPS
