"""A certificate without an entry that ISO/IEC 17025 requires is a draft, everywhere."""

import shutil

import openpyxl
import pytest
from example_certificates import record_of_example
from pypdf import PdfReader

from tankcal.cli import main
from tankcal.job.certificate_entries import MARKED, REQUIRED, missing_entries
from tankcal.job.contract.keys import COMMON_KEYS
from tankcal.job.starter import write_input_workbook
from tankcal.report import certificate
from tankcal.report.paper import Paper
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

COMPLETE = {key: "given" for key in MARKED} | {"date_of_issue": "2026-05-10"}
DRAFT = {"en": "Draft", "es": "Borrador", "pt-BR": "Minuta"}


def paper_of(language="en", **entries):
    record = record_of_example("strapping")
    return Paper(record | {"job": record["job"] | {"certificate": entries}}, language=language)


def test_every_required_key_is_a_key_of_the_certificate():
    known = {field.name for field in COMMON_KEYS["certificate"]}
    assert {key for group in REQUIRED for key in group} <= known


@pytest.mark.parametrize("group", REQUIRED)
def test_each_missing_entry_is_found(group):
    entries = {key: value for key, value in COMPLETE.items() if key not in group}
    assert missing_entries(entries) == [group[0]]
    for key in group:
        assert missing_entries(entries | {key: "given"}) == []
        assert missing_entries(entries | {key: "  "}) == [group[0]]


def test_location_and_letterhead_replace_their_entries():
    entries = dict.fromkeys(set(MARKED) - {"place", "laboratory", "laboratory_address"}, "given")
    assert missing_entries(entries, "Santos", has_letterhead=True) == []
    assert missing_entries(entries) == ["laboratory", "laboratory_address", "place"]


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_title_names_a_draft(language):
    assert certificate.title(paper_of(language)).startswith(DRAFT[language])
    complete = paper_of(language, **COMPLETE)
    assert certificate.title(complete) == load_words(language)["titles"]["certificate"]
    assert not any("17025" in text for text in certificate.statements(complete).data["items"])
    lacking = paper_of(language, **(COMPLETE | {"conditions": ""}))
    assert certificate.title(lacking).startswith(DRAFT[language])
    (text,) = (text for text in certificate.statements(lacking).data["items"] if "17025" in text)
    assert text.endswith(f": {lacking.label('conditions')}.")


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_data_of_the_customer_have_a_disclaimer(language):
    disclaimer = load_words(language)["certificate"]["data_of_customer"]
    assert disclaimer not in certificate.statements(paper_of(language)).data["items"]
    given = paper_of(language, customer_data="plate thickness")
    assert disclaimer in certificate.statements(given).data["items"]


def job_with(folder, **entries):
    shutil.copytree("examples/strapping", folder)
    lines = "".join(f'{key} = "{value}"\n' for key, value in entries.items())
    lines = lines.replace('date_of_issue = "2026-05-10"', "date_of_issue = 2026-05-10")
    path = folder / "job.toml"
    text = path.read_text(encoding="utf-8").split("[certificate]")[0]
    path.write_text(f"{text}[certificate]\n{lines}", encoding="utf-8")
    return str(folder)


@pytest.mark.slow
def test_strict_refuses_a_draft(tmp_path, capsys):
    lacking = {key: value for key, value in COMPLETE.items() if key != "traceability"}
    job, out = job_with(tmp_path / "job", **lacking), tmp_path / "out"
    assert main(["run", job, "--out", str(out), "--strict", "--quiet"]) == 2
    assert "not given: traceability; ISO/IEC 17025" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.slow
def test_only_the_certificate_is_an_original(tmp_path, capsys):
    job, out = job_with(tmp_path / "job", **COMPLETE), tmp_path / "out"
    assert main(["run", job, "--out", str(out), "--strict", "--quiet"]) == 0
    assert "17025" not in capsys.readouterr().err
    original, whole = (PdfReader(out / f"{name}.pdf") for name in ("certificate", "report"))
    first = original.pages[0].extract_text()
    assert "Calibration certificate" in first
    assert "copy" not in first
    assert "/AcroForm" in original.trailer["/Root"]
    assert "The original, to be signed, is certificate.pdf" in whole.pages[0].extract_text()
    assert "/AcroForm" not in whole.trailer["/Root"]
    assert "is a copy" in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_workbook_marks_the_required_entries(tmp_path):
    path = write_input_workbook(tmp_path / "tank.xlsx", "vertical", None, "en")
    sheet = openpyxl.load_workbook(path)["job"]
    marked = {
        row[6].value
        for row in sheet.iter_rows()
        if row[5].value == "certificate" and row[2].fill.fgColor.rgb == "FFFFF2CC"
    }
    assert marked == set(MARKED)
