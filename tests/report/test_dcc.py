"""The digital calibration certificate: its structure, its numbers, and that nothing is invented."""

import copy
import io
import json
import sys
from unittest.mock import MagicMock
from xml.etree import ElementTree

import pytest
from dcc_schema import DCC, SI, schema
from workbook_records import KINDS, read_records, write_records_of_every_kind

from tankcal.report import dcc
from tankcal.report.attachments import sha256
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

NAMES = {"dcc": DCC, "si": SI}
OF_TANKS = [kind for kind in KINDS if kind != "survey"]
HARD = '<b>&amp; "q" \x00\x07\x1b ]]> <!-- \ud7ff \ufffe \u2028 {value} \n\t two'


@pytest.fixture(scope="module")
def structure():
    return schema()


@pytest.fixture(scope="module")
def records(made_once):
    return read_records(made_once("records-of-dcc", write_records_of_every_kind))


@pytest.fixture(scope="module")
def example(example_record):
    return json.loads(example_record.read_text(encoding="utf-8"))


def certificate_of(record, language=None):
    return dcc.certificate_xml(record, "0" * 64, language)


def problems(structure, xml):
    return [f"{one.path}: {one.reason}" for one in structure.iter_errors(io.BytesIO(xml))]


def tree(xml):
    return ElementTree.fromstring(xml)


def numbers(root, path):
    return [float(one) for one in root.findtext(path, namespaces=NAMES).split()]


@pytest.mark.slow
@pytest.mark.parametrize("kind", OF_TANKS)
def test_certificates_of_every_kind_have_the_structure_of_the_schema(structure, records, kind):
    assert problems(structure, certificate_of(records[kind])) == []


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_structure_of_the_example_in_every_language(structure, example, language):
    xml = certificate_of(example, language)
    assert problems(structure, xml) == []
    core = tree(xml).find(".//dcc:coreData", NAMES)
    assert core.findtext("dcc:mandatoryLangCodeISO639_1", namespaces=NAMES) == language[:2]
    used = [one.text for one in core.findall("dcc:usedLangCodeISO639_1", NAMES)]
    assert sorted(used) == ["en", "es", "pt"]


@pytest.mark.slow
def test_the_structure_refuses_what_the_schema_refuses(structure, example):
    """Otherwise the tests above could not fail: order, a missing element, k below 1, a language."""
    whole = certificate_of(example).decode()
    for before, after in (
        ("dcc:beginPerformanceDate", "dcc:endPerformanceDate"),
        ("<dcc:mainSigner>true", "<dcc:mainSigner>perhaps"),
        ('schemaVersion="3.3.0"', 'schemaVersion="3.2.1"'),
        ('lang="en"', 'lang="en-GB"'),
        ("<si:valueStandardMUXMLList>0.5", "<si:valueStandardMUXMLList>-0.5"),
        ("<dcc:value>SILVA-1995</dcc:value>", "<dcc:value> </dcc:value>"),
    ):
        assert before in whole
        assert problems(structure, whole.replace(before, after).encode())


def test_every_text_stands_in_every_language_or_in_none(example):
    for parent in tree(certificate_of(example)).iter():
        spoken = [one.get("lang") for one in parent.findall("dcc:content", NAMES)]
        assert spoken in ([], [None]) or sorted(spoken) == ["en", "es", "pt"]


def test_rows_are_those_of_the_record(example):
    root, capacity = tree(certificate_of(example)), example["capacity"]
    table = ".//dcc:list[@refType='tankcal_table']/dcc:quantity[@refType='{}']/si:realListXMLList/"
    volume = table.format("basic_measuredValue")
    assert numbers(root, table.format("tankcal_dip") + "si:valueXMLList") == capacity["height_m"]
    assert numbers(root, volume + "si:valueXMLList") == capacity["volume_m3"]
    interval = volume + "/si:coverageIntervalMUXMLList/si:"
    assert numbers(root, interval + "valueStandardMUXMLList") == capacity["u_m3"]
    assert numbers(root, interval + "intervalMinXMLList") == capacity["low_m3"]
    assert numbers(root, interval + "intervalMaxXMLList") == capacity["high_m3"]
    U, k = (table.format(f"tankcal_{one}") for one in ("expandedUncertainty", "coverageFactor"))
    assert numbers(root, U + "si:valueXMLList") == capacity["stated_U_m3"]
    factors = numbers(root, k + "si:valueXMLList")
    simulated = [code == "monte_carlo" for code in capacity["interval"]]
    assert any(simulated)
    assert [one != one for one in factors] == simulated
    assert [k for k in factors if k == k] == [
        k for k, one in zip(capacity["k"], simulated, strict=True) if not one
    ]


@pytest.mark.slow
def test_expanded_uncertainty_and_k_where_every_row_has_them(structure, example):
    record = copy.deepcopy(example)
    record["capacity"]["interval"] = ["gum"] * len(record["capacity"]["k"])
    xml = certificate_of(record)
    stated = ".//si:expandedMUXMLList/si:"
    root = tree(xml)
    assert numbers(root, stated + "valueExpandedMUXMLList") == record["capacity"]["stated_U_m3"]
    assert numbers(root, stated + "coverageFactorXMLList") == record["capacity"]["k"]
    assert set(numbers(root, stated + "coverageProbabilityXMLList")) == {0.95}
    assert problems(structure, xml) == []


@pytest.mark.slow
def test_no_uncertainty_is_stated_where_none_was_declared(structure, example):
    record = copy.deepcopy(example)
    rows = len(record["capacity"]["k"])
    record["capacity"] |= {"stated_U_m3": [0.0] * rows, "U_m3": [0.0] * rows}
    xml = certificate_of(record)
    assert b"MUXMLList" not in xml
    assert problems(structure, xml) == []


@pytest.mark.slow
def test_a_coverage_factor_below_1_is_stated_as_an_interval(structure, example):
    record = copy.deepcopy(example)
    rows = len(record["capacity"]["k"])
    record["capacity"] |= {"k": [0.67] * rows, "interval": ["gum"] * rows}
    xml = certificate_of(record)
    assert b"coverageIntervalMUXMLList" in xml
    assert problems(structure, xml) == []


@pytest.mark.slow
def test_what_the_job_does_not_give_is_said_to_be_not_stated(structure, example):
    record = copy.deepcopy(example)
    record["job"]["certificate"] = {}
    xml = certificate_of(record, "pt-BR")
    assert problems(structure, xml) == []
    root = tree(xml)
    words = load_words("pt-BR")["dcc"]["not_stated"]
    for place in ("dcc:calibrationLaboratory", "dcc:respPersons", "dcc:customer"):
        said = [one.text for one in root.find(f".//{place}", NAMES).iter(f"{{{DCC}}}content")]
        assert words in said
    assert root.findtext(".//dcc:countryCodeISO3166_1", namespaces=NAMES) == "ZZ"
    assert root.findtext(".//dcc:uniqueIdentifier", namespaces=NAMES) == "sha256:" + "0" * 64
    missing = root.find(".//dcc:statement[@refType='tankcal_notStated']/dcc:declaration", NAMES)
    assert "País de emissão" in missing[0].text


def test_what_the_job_gives_is_there(example):
    record = copy.deepcopy(example)
    given = {
        "number": "0123/2026", "country": "br", "laboratory": "Lab", "laboratory_address": "Rua 1",
        "customer": "Cia", "customer_address": "Rua 2", "authorised_by": "A. Silva",
        "authorised_role": "Signatory", "accreditation_number": "CAL 0123", "permit": "own text",
        "date_of_issue": "2026-01-02", "operator": "B. Souza",
        "method": "tape", "traceability": "SI", "conditions": "calm", "condition_of_tank": "empty",
    }  # fmt: skip
    record["job"]["certificate"] = given
    xml = certificate_of(record).decode()
    for value in given.values():
        assert (value if value != "br" else ">BR<") in xml
    assert "notStated" not in xml


@pytest.mark.slow
@pytest.mark.parametrize("where", ["certificate", "details", "names"])
def test_no_text_of_a_user_breaks_it(structure, example, where):
    record = copy.deepcopy(example)
    job = record["job"]
    if where == "certificate":
        keys = ("number", "laboratory", "customer", "remarks", "own_key", "accreditation_number")
        job["certificate"] = dict.fromkeys(keys, HARD) | {"country": HARD, "operator": "\x00"}
    elif where == "details":
        job["tank"]["details"] = {"owner": HARD, "product": "\x01\x02"}
    else:
        job["tank"]["id"] = HARD
        record["courses"][0]["course"] = HARD
        record["files"][0]["file"] = HARD
        thing = {"name": HARD, "bottom_m": 0.1, "top_m": 0.2, "volume_m3": -0.1, "u_m3": None}
        record["deadwood"] = [thing]
    xml = certificate_of(record)
    assert problems(structure, xml) == []
    assert '<b>&amp; "q"' in " ".join(tree(xml).itertext())


def test_record_and_input_files_are_named_by_their_hashes(example):
    found = {
        one.find("dcc:description/dcc:content", NAMES).text: one.findtext(
            "dcc:reference", namespaces=NAMES
        )
        for one in tree(certificate_of(example)).iter(f"{{{DCC}}}metaData")
        if one.find("dcc:reference", NAMES) is not None
    }
    expected = {one["file"]: f"sha256:{one['sha256']}" for one in example["files"]}
    assert found == expected | {"record.json": "sha256:" + "0" * 64}


def test_the_same_record_gives_the_same_bytes(example):
    assert certificate_of(example) == certificate_of(copy.deepcopy(example))


@pytest.fixture
def pydcc(monkeypatch):
    """PyDCC, without the library that verifies its signatures, which does not start beside OpenSSL
    3.0.10 and later, and without the schemas that it would fetch from the network."""
    pytest.importorskip("signxml")
    monkeypatch.setitem(sys.modules, "certvalidator", MagicMock())
    found = pytest.importorskip("dcc.dcc")
    monkeypatch.setattr(found, "DCCXMLValidator", MagicMock())
    return found


@pytest.mark.slow
def test_pydcc_reads_it(pydcc, tmp_path, example):
    """Second program: PyDCC of Siemens and PTB finds number, date, laboratory and the table."""
    path = tmp_path / "certificate.xml"
    path.write_bytes(certificate_of(example))
    found = pydcc.DCC(str(path))
    assert found.is_loaded()
    assert found.uid() == example["job"]["certificate"]["number"]
    assert found.mandatory_language() == "en"
    assert str(found.calibration_date().date()) == example["job"]["survey"]["date"]
    assert found.calibration_laboratory_name() == example["job"]["certificate"]["laboratory"]
    results = dict(found.get_calibration_results("name", "en"))
    (dips,) = (value for name, value in results.items() if name.endswith("Capacity table Dip"))
    listed = dips["realListXMLList"]["valueXMLList"].split()
    assert list(map(float, listed)) == example["capacity"]["height_m"]


def test_digest_of_the_file_is_that_of_the_record(example_record, example):
    digest = sha256(example_record.read_bytes())
    assert f"sha256:{digest}" in dcc.certificate_xml(example, digest).decode()


@pytest.mark.slow
def test_operating_levels_have_the_volumes_of_the_record(structure, example):
    """A level and a volume between two levels; without a valid k, U is a separate quantity."""
    record = copy.deepcopy(example)
    below = next(entry for entry in record["budgets"] if entry["low_m"] is None)
    between = next(entry for entry in record["budgets"] if entry["low_m"] is not None)
    between |= {"interval": "monte_carlo"}
    below |= {"interval": "gum"}
    record["limits"] = [
        {"code": code, "low_m": entry["low_m"], "high_m": entry["high_m"]}
        for code, entry in (("maximum", below), ("working_capacity", between))
    ]
    xml = certificate_of(record)
    assert problems(structure, xml) == []
    levels = tree(xml).findall(".//dcc:list[@refType='tankcal_limit']", NAMES)
    first, second = levels
    text = first.find("dcc:name/dcc:content[@lang='pt']", NAMES).text
    assert text == load_words("pt-BR")["tank_limits"]["maximum"]

    def values(element, path):
        return [float(found.text) for found in element.findall(f".//si:{path}", NAMES)]

    assert values(first, "real/si:value") == [below["high_m"], below["volume_m3"]]
    assert values(first, "expandedMU/si:valueExpandedMU") == [below["stated_U_m3"]]
    assert values(first, "expandedMU/si:coverageFactor") == [below["k"]]
    dips = [between["low_m"], between["high_m"]]
    assert values(second, "real/si:value") == [
        *dips, between["volume_m3"], between["stated_U_m3"]
    ]  # fmt: skip
    assert second.find(".//si:expandedMU", NAMES) is None
