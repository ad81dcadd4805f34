"""Field sheets that a crew fills in by pen: which columns they have, in which words."""

import shutil
import subprocess

import pytest

from tankcal.cli import main
from tankcal.job.contract import SURVEYS_OF_KIND, tables_of_survey
from tankcal.job.starter.texts import texts_in
from tankcal.report.field_forms import (
    BY_PEN,
    FILE,
    FORMS,
    IN_THE_OFFICE,
    UNITS_OF_CIRCLES,
    sheets,
    write_field_sheets,
)
from tankcal.text.shipped import LANGUAGES

OF_THE_OFFICE = ("control",)  # known beforehand
LEAST_WORDS = 20  # of a page that has a form: head, foot and the line to sign on are fewer
HIGH_MM, ROW_MM = 245, 7  # of what is written on a page, and of a row


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    ("kind", "survey"),
    [
        *(("vertical", one) for one in BY_PEN if one != "liquid"),
        *(
            (kind, one)
            for kind, own in SURVEYS_OF_KIND.items()
            for one in own
            if one in BY_PEN and one != "liquid"
        ),
    ],
)
def test_every_table_of_readings_has_a_sheet(kind, survey, language):
    found = [block.data for block in sheets(survey, language, kind)]
    titles = [one["text"] for one in found if one["kind"] == "heading"]
    words = texts_in(language).words["input"]
    tables = [one for one in tables_of_survey(kind, survey) if one not in OF_THE_OFFICE]
    of_heights = texts_in(language).words["forms"]["heights"]
    assert (of_heights in titles) == (survey in ("tangents", "wall-hits"))
    told = "; ".join(one for one in titles if one != of_heights).split("; ")
    assert sorted(told) == sorted(words["titles"][table] for table in tables)
    forms = [one for one in found if one["kind"] == "form"]
    assert len(forms) == len(titles)
    for one in forms:
        assert 2 <= len(one["columns"]) <= 9
        assert (one["rows"] + 3) * ROW_MM < HIGH_MM
    said = {column["heading"] for one in forms for column in one["columns"]}
    # Hits inside a solid have a direction, a zenith angle and a distance, and no tape beside them.
    label = "reading" if kind == "vertical" or survey != "wall-hits" else "distance"
    assert words["labels"][label] in said
    assert not said & {words["labels"].get(name, "?") for name in IN_THE_OFFICE}


@pytest.mark.slow
@pytest.mark.parametrize("survey", BY_PEN)
def test_new_writes_them(tmp_path, survey, capsys):
    assert main(["new", str(tmp_path / "mine"), "--survey", survey]) == 0
    assert (tmp_path / "mine" / FILE).read_bytes().startswith(b"%PDF")
    assert FILE in capsys.readouterr().out
    assert main(["new", str(tmp_path / "other"), "--survey", "total-station"]) == 0
    assert not (tmp_path / "other" / FILE).exists()


def test_a_sheet_has_room():
    tables = {
        table
        for kind in ("vertical", *SURVEYS_OF_KIND)
        for survey in BY_PEN
        for table in tables_of_survey(kind, survey)
    }
    assert {name for names, _ in FORMS for name in names} == tables - set(OF_THE_OFFICE)


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_crew_writes_set_ups_and_the_traverse_before_its_tangents(language):
    """In the order of the work; the three readings to a station stand in one row, with units."""
    found = [block.data for block in sheets("tangents", language)]
    words = texts_in(language).words["input"]
    titles = [one["text"] for one in found if one["kind"] == "heading"]
    order = ["setups", "stadia", "directions", "tangents", "circumferences", "obstructions"]
    setups, *others = (words["titles"][name] for name in order)
    heights = texts_in(language).words["forms"]["heights"]
    assert [one.split("; ")[0] for one in titles] == [setups, heights, *others]
    traverse = [one for one in found if one["kind"] == "form"][3]["columns"]
    units = [one["unit"] for one in traverse]
    assert units == ["", "", "", UNITS_OF_CIRCLES, UNITS_OF_CIRCLES, "m", "m"]


def pages_of(path):
    """[words] of each page of a PDF."""
    if not shutil.which("pdftotext"):
        pytest.skip("no pdftotext here (poppler)")
    said = subprocess.run(["pdftotext", str(path), "-"], capture_output=True, check=True).stdout
    return [page.split() for page in said.decode().split("\f")[:-1]]


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_crew_that_fills_a_tank_writes_meters_valves_and_batches(language):
    """What the meter shows beside the batch: the office takes the difference."""
    found = [block.data for block in sheets("liquid", language)]
    words = texts_in(language).words
    titles = [one["text"] for one in found if one["kind"] == "heading"]
    of_tables = words["input"]["titles"]
    assert titles == [of_tables["meters"], words["forms"]["tight"], of_tables["liquid"]]
    *_, batches = (one for one in found if one["kind"] == "form")
    labels = words["input"]["labels"]
    headings = [column["heading"] for column in batches["columns"]]
    names = ("run", "meter", "volume", "dip", *(f"{one}_temperature" for one in
             ("meter", "tank", "shell")), "time")  # fmt: skip
    expected = [labels[name] for name in names]
    expected.insert(2, words["forms"]["meter_shows"])
    assert headings == expected
    assert (batches["rows"] + 3) * ROW_MM < HIGH_MM


@pytest.mark.slow
@pytest.mark.parametrize("survey", BY_PEN)
def test_no_page_is_nearly_empty(tmp_path, survey):
    """Each page of the PDF has a form, the last one more than the line to sign on."""
    write_field_sheets(tmp_path / FILE, survey, "pt-BR")
    pages = pages_of(tmp_path / FILE)
    assert all(len(words) > LEAST_WORDS for words in pages), [len(one) for one in pages]
