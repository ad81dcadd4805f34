"""The first page: what U does not include, and effects of known sign without correction."""

import json
import shutil

import pytest
from example_certificates import EXAMPLES, certificate_blocks, record_of_example
from paper_cells import texts

import tankcal
from tankcal.job.rule_files import shipped_rule
from tankcal.record import load, record_of, save
from tankcal.report import certificate
from tankcal.report.dcc import certificate_xml
from tankcal.report.paper import Paper
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words


def with_correction_off(record, code, size_m3):
    rows = [
        row | ({"applied": False, "size_m3": size_m3} if row["code"] == code else {})
        for row in record["corrections"]
    ]
    return record | {"corrections": rows}


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_the_sentences_follow_the_result(name, language):
    shown = certificate_blocks(name, language)
    (place,) = (i for i, block in enumerate(shown) if block["kind"] == "result")
    sentence = load_words(language)["certificate"]["not_in_u"]
    assert shown[place + 1]["text"].startswith(sentence)


@pytest.mark.slow
def test_every_undeclared_input_is_named_there():
    record = record_of_example("strapping")
    (choice,) = (row for row in record["choices"] if row["code"] == "not_in_budget")
    text = certificate.limits_of_u(Paper(record, language="en"))
    names = load_words("en")["inputs"]
    assert choice["value"]
    assert all(names[name] in text for name in choice["value"])


@pytest.mark.slow
@pytest.mark.parametrize(("size", "shown"), [(0.4312, "+0.431"), (-2.7718, "−2.77")])
def test_an_effect_that_is_not_corrected_has_its_sign(size, shown):
    record = record_of_example("strapping")
    sound = certificate.limits_of_u(Paper(record, language="en"))
    assert "not corrected" not in sound
    off = certificate.limits_of_u(Paper(with_correction_off(record, "head", size), language="en"))
    assert f"Internal pressure (gas, liquid), {shown}\N{NO-BREAK SPACE}m³" in off


@pytest.mark.parametrize("name", ["france_2003", "france_2003_outside", "france_2003_alcohol"])
def test_the_french_rules_bring_two_sentences(name):
    """Article 24 of the order of 8 July 2003."""
    first, second = shipped_rule(name).statements
    assert "ne comprennent pas les incertitudes d'exploitation" in first
    assert second.endswith("annule le présent certificat.")


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_statements_of_the_rule_are_printed_as_they_are(language, tmp_path):
    shutil.copytree("examples/strapping", tmp_path / "job")
    settings = (tmp_path / "job" / "job.toml").read_text(encoding="utf-8")
    settings = settings.replace("[table]", '[table]\nrule = "france_2003"')
    (tmp_path / "job" / "job.toml").write_text(settings, encoding="utf-8")
    job = tankcal.load(tmp_path / "job")
    save(record_of(tankcal.run(job, simulated=False)), tmp_path / "record.json")
    saved = load(tmp_path / "record.json")
    assert saved["rule"]["rule"]["statements"] == list(shipped_rule("france_2003").statements)
    shown = certificate.statements(Paper(saved, language=language)).data["items"]
    assert set(shipped_rule("france_2003").statements) <= set(shown)
    # A record of a version before has none.
    del saved["rule"]["rule"]["statements"]
    earlier = json.loads(json.dumps(saved))
    shown = certificate.statements(Paper(earlier, language=language)).data["items"]
    assert not set(shipped_rule("france_2003").statements) & set(shown)


@pytest.mark.slow
def test_a_tilt_that_is_not_applied_has_its_size():
    """The horizontal cut of a cylinder of slope m has the area A sqrt(1 + m^2)."""
    record = record_of_example("reference-line")
    lines, top_m3 = record["lines"], record["capacity"]["volume_m3"][-1]
    lines |= {"lean_x": 0.003, "lean_y": 0.004}
    text = certificate.limits_of_u(Paper(record, language="en"))
    assert f"({shown(5.0, 2)}\N{NO-BREAK SPACE}mm/m), +{shown(top_m3 * 12.5e-6, 4)}" in text


def shown(value, decimals):
    return f"{value:.{decimals}f}"


@pytest.mark.slow
def test_first_and_last_day_digits_and_software_are_stated():
    record = record_of_example("strapping")
    dated = record["job"]["certificate"] | {"survey_end": "2026-05-06"}
    record = record | {"job": record["job"] | {"certificate": dated}}
    paper = Paper(record, language="en")
    facts = dict(certificate.calibration(paper).data["items"])
    assert facts["Date of survey"] == "4 May 2026"
    assert facts["Last day of the survey"] == "6 May 2026"
    assert "Survey end" not in dict(certificate.parties(paper).data["items"])
    xml = certificate_xml(record, "0" * 64).decode()
    assert "<dcc:endPerformanceDate>2026-05-06</dcc:endPerformanceDate>" in xml
    shown_blocks = certificate_blocks("strapping", "en")
    (code,) = (block for block in shown_blocks if block["kind"] == "hash_code")
    assert f"tankcal {record['tankcal']}" in code["text"]
    (_,) = (text for text in texts(shown_blocks) if "more decimals than U" in text)
