"""The papers of a tank with reference lines: record, CSV file, workbook, certificate."""

import csv

import numpy as np
import openpyxl
import pytest
from job_builder import plumbed_parts, write_folder

import tankcal
from tankcal.record import load as load_record
from tankcal.record import read
from tankcal.report.outputs import write
from tankcal.report.paper import Paper


@pytest.fixture(scope="module")
def plumbed(tmp_path_factory):
    """Result and folder of tank B-2, of whose offsets one is only compared and one misread."""
    parts = plumbed_parts()
    header, *rows = parts.tables["offsets"]
    rows = [[*row, None] for row in rows]
    rows[20][-1] = "check"
    rows[70][3] += 30.0
    parts.tables["offsets"] = [[*header, "use"], *rows]
    parts.registers["instruments"]["ZL"]["certificate"] = "ZL 7/2026"
    folder = tmp_path_factory.mktemp("plumbed")
    result = tankcal.run(tankcal.load(write_folder(folder / "job", parts)), simulated=False)
    write(result, folder / "results", papers=False)
    return result, folder / "results"


@pytest.mark.slow
def test_the_record_has_every_offset(plumbed):
    result, folder = plumbed
    found = read(folder / "record.json").lines
    assert [one.offset_m for one in found.offsets] == [
        one.offset_m for one in result.job.lines.offsets
    ]
    states = [one.state for one in found.offsets]
    assert states[20] == "check"
    assert found.offsets[20].w is None
    assert [place for place, one in enumerate(states) if one == "rejected"] == [70]
    assert abs(found.offsets[70].departure_m + 0.030) < 0.003
    assert (found.reference_course, found.reference_level_m) == ("1", pytest.approx(0.45))
    assert sum(one.offsets for one in found.lines) == 88
    assert [one.rejected for one in found.lines] == [1] + [0] * 9
    for one, radius in zip(found.levels, result.strapped.radius_m[1:], strict=True):
        assert one.radius_m == pytest.approx(radius, abs=2e-6)
        assert one.radius_m - one.rise_m == pytest.approx(32.8673 / 2 / np.pi, abs=1e-4)


def test_the_csv_file_has_every_offset(plumbed):
    result, folder = plumbed
    with open(folder / "offsets.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["offset_mm"]) for row in rows] == pytest.approx(
        [1000 * one.offset_m for one in result.job.lines.offsets], abs=1e-6
    )
    assert [row["reference"] for row in rows[:10]] == ["yes"] * 10


def test_paper_has_every_offset_by_its_level(plumbed):
    from tankcal.methods.lines.saved import largest_departures, offsets_by_level

    result, folder = plumbed
    paper = Paper(load_record(folder / "record.json"))
    (table,) = offsets_by_level(paper)
    assert [one["heading"] for one in table.data["columns"]][3:] == list(result.job.lines.lines)
    cells = [cell for row in table.data["rows"] for cell in row[3:]]
    given = [f"{1000 * one.offset_m:.1f}" for one in result.job.lines.offsets]
    assert sorted(cell.strip("()*") for cell in cells) == sorted(given)
    assert [cell for cell in cells if not cell[-1].isdigit()] == [f"({given[20]})", f"{given[70]}*"]
    shown = paper.show(largest_departures(paper.record)).data["rows"]
    assert shown[0][-1] == "rejected"
    assert [row[-1] for row in shown[1:]] == ["used"] * 19


def test_many_lines_stand_in_several_tables(plumbed):
    from tankcal.methods.lines.saved import offsets_by_level

    record = load_record(plumbed[1] / "record.json")
    record["lines"]["lines"] *= 3
    assert len(offsets_by_level(Paper(record))) == 3
    for one in record["lines"]["lines"]:
        one["line"] = "a line with a long name"
    assert len(offsets_by_level(Paper(record))) == 10


@pytest.mark.slow
@pytest.mark.parametrize("language", ["en", "es", "pt-BR"])
def test_the_workbook_has_a_sheet_of_it(plumbed, tmp_path, language):
    from tankcal.report.workbook import write as write_workbook

    record = load_record(plumbed[1] / "record.json")
    write_workbook(record, tmp_path / "capacity.xlsx", language)
    book = openpyxl.load_workbook(tmp_path / "capacity.xlsx")
    title = Paper(record, language=language).words["workbook"]["sheets"]["lines"]
    cells = [cell.value for row in book[title].iter_rows() for cell in row]
    for one in record["lines"]["offsets"]:
        assert pytest.approx(1000 * one["offset_m"]) in cells


def test_the_certificate_names_the_plummet(plumbed):
    from tankcal.report.certificate import calibration

    paper = Paper(load_record(plumbed[1] / "record.json"))
    said = dict(calibration(paper).data["items"])[paper.label("instruments")]
    assert "ZL 7/2026" in said
    assert "T-12" in said


def test_what_was_assumed_is_said(plumbed):
    said = " ".join(Paper(load_record(plumbed[1] / "record.json")).choices())
    assert "vertical lines of sight" in said
    assert "surface of revolution" in said
    assert "takes the shell as vertical" in said
