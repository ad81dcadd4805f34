"""A floating roof with two positions of its legs: papers, exports, tickets, digital certificate."""

import io
from xml.etree import ElementTree

import pytest
from dcc_schema import DCC, schema
from job_builder import write_job
from paper_words import cells_of_sheet

import tankcal
from tankcal import record as records
from tankcal.products.exports.exporting import export_record
from tankcal.products.exports.profiles import find_profile
from tankcal.products.quantity.table import table_of
from tankcal.record import record_of
from tankcal.report.dcc import certificate_xml
from tankcal.report.laboratory import load
from tankcal.report.paper import Paper
from tankcal.report.uncertainty.capacity import roof_blocks
from tankcal.report.web import calculator_html
from tankcal.report.web.calculator_data import calculator
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

LEGS = {"weighing": "vacuum", "high_critical_bottom_m": 1.62, "high_critical_top_m": 2.0}
DISPLACED_M3 = 9000 / 850  # whole displacement of the roof


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("legs")
    settings = {"survey.side": "inside", "table.step_m": 0.01}
    result = tankcal.run(tankcal.load(write_job(folder / "job", settings=settings, roof=LEGS)))
    records.save(record_of(result), folder / "record.json")
    return folder / "record.json"


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_calculators_name_the_dips_of_the_second_table(path, language):
    paper = Paper(path, language=language)
    block = calculator(paper).data
    ends = [paper.height(height) for height in (1.0, 2.0)]
    assert all(end in block["note"] for end in ends)
    assert block["note"] in calculator_html(block | {"id": "c"}, load_words(language)["web"])
    captions = [one.data.get("caption", "") for one in roof_blocks(paper)]
    reason = {"en": "was not simulated", "es": "no se simuló", "pt-BR": "não foi simulada"}
    assert any(reason[language] in caption for caption in captions)


@pytest.mark.slow
def test_an_export_has_the_volumes_of_the_high_legs(path):
    profile = find_profile("csv")
    usual, raised = (
        export_record(path, profile, on_high_legs=is_high) for is_high in (False, True)
    )
    differences = dict(
        zip(usual.dip_m.round(3).tolist(), raised.volume_m3 - usual.volume_m3, strict=True)
    )
    for dip, expected in ((0.9, 0.0), (1.5, DISPLACED_M3), (2.5, 0.0)):
        assert differences[dip] == pytest.approx(expected, abs=1e-3)
    facts = " ".join(map(str, raised.facts))
    assert "1.62 to 2 m" in facts


@pytest.mark.slow
def test_a_ticket_knows_the_dips_of_the_second_table(path):
    assert table_of(path).high_legs_m == (1.0, 2.0)


@pytest.mark.slow
def test_the_digital_certificate_with_every_part_is_valid(path):
    """Two positions, corrections, seals, next verification, and the certificate it replaces."""
    record = records.load(path)
    seal = {"place": "manhole", "mark": "LAB 1", "secures": "plate", "attached": "2026-05-04"}
    job = record["job"]
    changed = record | {
        "job": job
        | {
            "certificate": job["certificate"] | {"replaces": "TC-7", "survey_end": "2026-05-06"},
            "seals": [seal],
            "next_verification": {
                "date": "2036-05-04",
                "rule": None,
                "clause": None,
                "years": None,
            },
        }
    }
    xml = certificate_xml(changed, "0" * 64)
    assert [error.reason for error in schema().iter_errors(io.BytesIO(xml))] == []
    root = ElementTree.fromstring(xml)
    (replaced,) = root.iter(f"{{{DCC}}}reportAmendedSubstituted")
    assert [child.text for child in replaced] == ["substituted", "TC-7"]
    kinds = {element.get("refType") for element in root.iter()}
    expected = {"onHighLegs", "roofCorrections", "seal", "nextVerification"}
    assert {f"tankcal_{name}" for name in expected} <= kinds


@pytest.mark.slow
def test_the_calculator_of_the_workbook_has_the_note(path, tmp_path):
    record = records.load(path)
    note = Paper(record, language="en").word("texts.high_legs", low="1.000 m", high="2.000 m")
    shown = cells_of_sheet(record, tmp_path / "capacity.xlsx", "Dip calculator")
    assert note in [cell.replace("\xa0", " ") for cell in shown if isinstance(cell, str)]


@pytest.mark.slow
def test_a_letterhead_supplies_entries_of_the_warning(path, tmp_path):
    (tmp_path / "lab.toml").write_text(
        '[laboratory]\nname = "Lab"\naddress = ["A 1"]\n', encoding="utf-8"
    )
    file = load(tmp_path / "lab.toml").save(tmp_path)
    texts = [
        next(
            warning["text"]
            for warning in Paper(path, language="en", letterhead=letterhead).record["warnings"]
            if warning["code"] == "certificate_incomplete"
        )
        for letterhead in (None, tmp_path / file)
    ]
    assert ["Address of the customer" in text for text in texts] == [True, True]
    assert ["Laboratory" in text for text in texts] == [True, False]
