"""The papers of a strapped sphere: what record, CSV file, workbook and certificate say of it."""

import csv

import openpyxl
import pytest
from conftest import EXAMPLE

import tankcal
from tankcal.methods.great_circles.saved import CIRCLES
from tankcal.record import load as load_record
from tankcal.record import read
from tankcal.report.outputs import write, write_tables
from tankcal.report.paper import Paper
from tankcal.report.tables.facts import REFERENCES
from tankcal.text.shipped import LANGUAGES

STEPS = ("certificate", "temperature", "tension", "tape_thickness", "rise", "sag")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The example's result, and the folder of its record."""
    folder = tmp_path_factory.mktemp("sphere") / "results"
    result = tankcal.run(tankcal.load(EXAMPLE.parent / "sphere-straps"), simulated=False)
    write(result, folder, papers=False)
    return result, folder


@pytest.mark.slow
def test_the_record_has_every_reading(written):
    result, folder = written
    found = read(folder / "record.json").great_circles
    assert [one.circle for one in found.readings][:3] == ["equator", "equator", "M12"]
    for one in found.readings:
        corrected = one.reading_m + sum(getattr(one, f"{step}_m") for step in STEPS)
        assert one.circumference_m == pytest.approx(corrected, abs=1e-9)
    axes = found.axis_a_m, found.axis_b_m, found.axis_c_m
    assert axes == pytest.approx(result.surveys["great_circles"].fit.axes_m)
    assert not found.oblateness_assumed


def test_the_file_of_circles(written):
    _, folder = written
    with open(folder / "great_circles.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 8
    assert rows[0]["azimuth_deg"] == ""
    assert float(rows[2]["azimuth_deg"]) == pytest.approx(12.0)


@pytest.mark.parametrize("language", LANGUAGES)
def test_papers_say_circles_pressure_and_temperature(written, language):
    _, folder = written
    paper = Paper(load_record(folder / "record.json"), language=language)
    for name in (None, "circle_corrections"):
        assert paper.show(CIRCLES, on=name)
    (row,) = REFERENCES.rows(paper.record)
    assert (row["table_pressure"], row["table_density"]) == (6e5, 510)
    assert row["reference_temperature"] == 15
    said = " ".join(paper.choices())
    assert paper.words["choices"]["survey"]["great_circles"] in said
    assert "6 bar" in said
    names = {one["input"]: paper.input_name(one) for one in paper.record["budget"]}
    assert "legs" in names
    assert "assumed" not in " ".join(names.values())


def test_a_sphere_without_straps_has_no_such_file(written, tmp_path):
    _, folder = written
    record = load_record(folder / "record.json")
    record.pop("great_circles")
    write_tables(record, tmp_path)
    assert not (tmp_path / "great_circles.csv").exists()


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_workbook_has_a_sheet_of_circles(written, tmp_path, language):
    from tankcal.report.workbook import write as write_workbook

    _, folder = written
    path = tmp_path / "capacity.xlsx"
    write_workbook(load_record(folder / "record.json"), path, language)
    names = openpyxl.load_workbook(path, read_only=True).sheetnames
    expected = {"en": "Great circles"}.get(language, "Círculos máximos")
    assert expected in names
