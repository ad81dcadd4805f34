"""Field sheets that a crew fills in by pen: which columns they have, in which words."""

import pytest

from tankcal.cli import main
from tankcal.job.contract import SURVEYS
from tankcal.job.starter.form import OF_SHELLS
from tankcal.job.starter.texts import texts_in
from tankcal.report.field_forms import FILE, IN_THE_OFFICE, ROWS, sheets
from tankcal.text.languages import LANGUAGES

OF_A_NETWORK = ("control", "directions", "zenith_angles", "slope_distances")  # kept by instruments
HIGH_MM, ROW_MM = 245, 7  # of what is written on a page, and of a row


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("survey", OF_SHELLS)
def test_every_table_of_readings_has_a_sheet(survey, language):
    found = [block.data for block in sheets(survey, language)]
    titles = [one["text"] for one in found if one["kind"] == "heading"]
    words = texts_in(language).words["input"]
    tables = [table for table in SURVEYS[survey] if table not in OF_A_NETWORK]
    assert sorted(titles) == sorted(words["titles"][table] for table in tables)
    forms = [one for one in found if one["kind"] == "form"]
    assert len(forms) == len(tables)
    for one in forms:
        assert 2 <= len(one["columns"]) <= 9
        assert (one["rows"] + 3) * ROW_MM < HIGH_MM
    said = {column["heading"] for one in forms for column in one["columns"]}
    assert words["labels"]["reading"] in said
    assert not said & {words["labels"].get(name, "?") for name in IN_THE_OFFICE}


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("survey", OF_SHELLS)
def test_new_writes_them(tmp_path, survey, capsys):
    assert main(["new", str(tmp_path / "mine"), "--survey", survey]) == 0
    assert (tmp_path / "mine" / FILE).read_bytes().startswith(b"%PDF")
    assert FILE in capsys.readouterr().out
    assert main(["new", str(tmp_path / "other"), "--survey", "total-station"]) == 0
    assert not (tmp_path / "other" / FILE).exists()


def test_a_sheet_has_room():
    tables = {table for survey in OF_SHELLS for table in SURVEYS[survey]}
    assert set(ROWS) == tables - set(OF_A_NETWORK)
