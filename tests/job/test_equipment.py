"""Equipment of a survey: register of the laboratory, dates of its calibrations, certificate."""

import json
import re
import shutil
from xml.etree import ElementTree

import pytest
from conftest import EXAMPLE

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError

SURVEY_DATE = tankcal.load(EXAMPLE).survey.date
REGISTER = """
[equipment.TS-12]
description = "total station, Leica TS16"
serial_number = "3012345"
laboratory = "Metrolab"
certificate = "2024/118"
date = {date}
due = {due}
uncertainty = "0.6 mm + 1 ppm, k = 2"

[equipment.T-3]
description = "thermometer"
"""


def write_job(folder, register=None, survey=(), place="equipment.toml"):
    """Copy the example, with keys of [survey] and a register at a place relative to the job."""
    job = shutil.copytree(EXAMPLE, folder / "job")
    text = (job / "job.toml").read_text(encoding="utf-8")
    keys = "".join(f"{key}\n" for key in survey)
    (job / "job.toml").write_text(text.replace("[survey]\n", f"[survey]\n{keys}"), "utf-8")
    if register is not None:
        (job / place).write_text(register, encoding="utf-8")
    return job


def dated(date="1990-01-01", due="2090-01-01"):
    return REGISTER.format(date=date, due=due)


def test_a_register_of_the_job_is_used_whole(tmp_path):
    job = tankcal.load(write_job(tmp_path, dated()))
    assert [item.name for item in job.equipment] == ["TS-12", "T-3"]
    assert job.equipment[0].serial_number == "3012345"
    assert job.equipment[1].due == ""
    assert not [one for one in job.warnings if "equipment" in str(one)]


def test_jobs_share_the_register_of_a_laboratory(tmp_path):
    keys = ['equipment_register = "../equipment.toml"', 'equipment_used = ["T-3"]']
    folder = write_job(tmp_path, dated(), keys, place="../equipment.toml")
    job = tankcal.load(folder)
    assert [item.name for item in job.equipment] == ["T-3"]
    assert "../equipment.toml" in [file.file for file in job.files]
    assert tankcal.load(EXAMPLE).equipment == ()


@pytest.mark.parametrize(
    ("dates", "expected"),
    [
        ({"due": "1990-02-01"}, r"TS-12\.due: .* due on 1990-02-01, before the survey"),
        ({"date": "2089-01-01"}, r"TS-12\.date: .*2089-01-01, after the survey"),
        ({"due": str(SURVEY_DATE), "date": str(SURVEY_DATE)}, None),
    ],
)
def test_calibrations_that_do_not_cover_the_survey(dates, expected, tmp_path):
    job = tankcal.load(write_job(tmp_path, dated(**dates)))
    told = [str(one) for one in job.warnings if "equipment.toml" in str(one)]
    assert len(told) == (expected is not None)
    assert expected is None or re.search(expected, told[0])


@pytest.mark.parametrize(
    ("keys", "register", "place", "expected"),
    [
        (['equipment_register = "../no.toml"'], None, "", ["../no.toml"]),
        (['equipment_register = "/etc/passwd"'], None, "", ["/etc/passwd"]),
        (['equipment_register = "../x.csv"'], "", "../x.csv", ["../x.csv"]),
        (['equipment_used = ["T-4", "T-3"]'], dated(), "equipment.toml", ["'T-4'"]),
        (['equipment_used = ["T-4"]'], None, "", ["'T-4'"]),
        (['equipment_register = "../e.toml"'], "[x", "../e.toml", ["e.toml"]),
        (
            ['equipment_register = "equipment.toml"'],
            dated(),
            "equipment.toml",
            ["expected one register"],
        ),
    ],
)
def test_bad_registers_have_a_line_each(keys, register, place, expected, tmp_path):
    folder = write_job(tmp_path, register, keys, place)
    with pytest.raises(InputError) as refused:
        tankcal.load(folder)
    lines = str(refused.value).splitlines()
    assert len(lines) == len(expected)
    assert all(part in line for part, line in zip(expected, lines, strict=True))


def test_a_link_out_of_the_job_is_not_followed(tmp_path):
    """A message on its content would show a line of a file that the job does not own."""
    (tmp_path / "secret").write_text("password\n", encoding="utf-8")
    folder = write_job(tmp_path, survey=['equipment_register = "lab.toml"'])
    (folder / "lab.toml").symlink_to(tmp_path / "secret")
    with pytest.raises(InputError) as refused:
        tankcal.load(folder)
    [line] = str(refused.value).splitlines()
    assert "symbolic link" in line
    assert "password" not in line


@pytest.mark.slow
def test_equipment_is_on_the_certificate(tmp_path):
    pypdf = pytest.importorskip("pypdf")
    folder, out = write_job(tmp_path, dated()), tmp_path / "results"
    assert main(["run", str(folder), "--quiet", "--out", str(out)]) == 0
    saved = json.loads((out / "record.json").read_text(encoding="utf-8"))
    assert [item["name"] for item in saved["job"]["equipment"]] == ["TS-12", "T-3"]
    text = " ".join(page.extract_text() for page in pypdf.PdfReader(out / "certificate.pdf").pages)
    for part in ("TS-12", "3012345", "2024/118", "2090-01-01", "0.6 mm + 1 ppm, k = 2"):
        assert part in " ".join(text.split()), part
    root = ElementTree.parse(out / "certificate.xml").getroot()
    values = [item.text for item in root.iter() if item.tag.endswith("}value")]
    assert {"2024/118", "3012345"} <= set(values)
    assert main(["verify", str(out)]) == 0


@pytest.mark.slow
def test_results_of_a_shared_register_are_verified(tmp_path, capsys):
    keys = ['equipment_register = "../equipment.toml"']
    folder = write_job(tmp_path, dated(), keys, place="../equipment.toml")
    assert main(["run", str(folder), "--quiet", "--no-papers"]) == 0
    assert main(["verify", str(folder / "results")]) == 0
    (tmp_path / "equipment.toml").write_text(dated(due="2091-01-01"), encoding="utf-8")
    capsys.readouterr()
    assert main(["verify", str(folder / "results")]) == 2
    assert "../equipment.toml: was changed after the run" in capsys.readouterr().out
