"""Page of a digital certificate: own certificates, those of other laboratories, bad files."""

import json
import re

import pytest

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.record import record_of
from tankcal.report.dcc import certificate_xml
from tankcal.report.dcc.viewer import MOST_SEARCHED, _unit, certificate_blocks, read_certificate
from tankcal.report.plain import PlainPaper
from tankcal.text.words import load_words

# A certificate with other prefixes, without translations, with content that tankcal never writes.
FOREIGN = """<?xml version="1.0" encoding="utf-8"?>
<digitalCalibrationCertificate xmlns="https://ptb.de/dcc" xmlns:s="https://ptb.de/si"
  schemaVersion="3.2.1">
 <administrativeData>
  <coreData><uniqueIdentifier>X-7</uniqueIdentifier>
   <beginPerformanceDate>2024-01-02</beginPerformanceDate></coreData>
  <calibrationLaboratory><contact><name><content>Lab &lt;script&gt;</content></name>
   <location><street>Rua 1</street><city>Natal</city></location></contact></calibrationLaboratory>
  <customer><name><content lang="de">Kunde</content></name></customer>
  <items><item><name><content>Gauge block</content></name></item></items>
 </administrativeData>
 <measurementResults><measurementResult><name><content>Lengths</content></name>
  <results><result><name><content>Deviations</content></name><data>
   <quantity><name><content>Length</content></name><s:real><s:value>10.0005</s:value>
    <s:unit>\\milli\\metre</s:unit><s:expandedUnc><s:uncertainty>1</s:uncertainty></s:expandedUnc>
    <s:measurementUncertaintyUnivariate><s:expandedMU>
     <s:valueExpandedMU>0.00012</s:valueExpandedMU><s:coverageFactor>2</s:coverageFactor>
    </s:expandedMU></s:measurementUncertaintyUnivariate></s:real></quantity>
   <list><quantity><name><content>Force</content></name><s:realListXMLList>
     <s:valueXMLList>1 2 3</s:valueXMLList><s:unitXMLList>\\kilo\\newton</s:unitXMLList>
    </s:realListXMLList></quantity></list>
   <formula><latex>x</latex></formula>
  </data></result></results></measurementResult></measurementResults>
</digitalCalibrationCertificate>
"""


def shown(path, language="en"):
    paper = PlainPaper(load_words(language))
    found = certificate_blocks(read_certificate(path), paper, language, "0" * 64)
    return [block.data for block in found]


@pytest.fixture(scope="module")
def own(example_result, tmp_path_factory):
    record = json.loads(json.dumps(record_of(example_result), default=float))
    path = tmp_path_factory.mktemp("dcc") / "certificate.xml"
    path.write_bytes(certificate_xml(record, "ab" * 32))
    return path, record


@pytest.mark.parametrize("language", ["en", "es", "pt-BR"])
def test_each_row_of_the_table_is_on_the_page(language, own):
    path, record = own
    tables = [block for block in shown(path, language) if "rows" in block]
    table = max(tables, key=lambda block: len(block["rows"]))
    capacity = record["capacity"]
    assert [float(row[0]) for row in table["rows"]] == pytest.approx(capacity["height_m"])
    assert [float(row[1]) for row in table["rows"]] == pytest.approx(
        capacity["volume_m3"], rel=1e-8, abs=1e-9
    )
    assert len(table["columns"]) > MOST_SEARCHED
    words = load_words(language)
    headings = [block["text"] for block in shown(path, language) if block["kind"] == "heading"]
    assert words["headings"]["capacity"] in headings  # in the language of the page


def test_certificate_of_another_laboratory(tmp_path):
    path = tmp_path / "x.xml"
    path.write_text(FOREIGN, encoding="utf-8")
    text = json.dumps(shown(path), ensure_ascii=False)
    for part in ("X-7", "3.2.1", "Rua 1, Natal", "Kunde", "Gauge block", "2024-01-02"):
        assert part in text
    tables = [block for block in shown(path) if "rows" in block]
    assert tables[0]["rows"] == [["Length", "10.0005", "mm", "0.00012", "2"]]
    assert [row[0] for row in tables[1]["rows"]] == ["1", "2", "3"]
    assert "Element formula: not shown here" in text


def test_the_page_loads_nothing_and_runs_no_text_of_the_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.xml").write_text(FOREIGN, encoding="utf-8")
    assert main(["dcc", "x.xml"]) == 0
    page = (tmp_path / "x.html").read_text(encoding="utf-8")
    assert "Lab &lt;script&gt;" in page
    assert "Lab <script>" not in page
    assert "default-src 'none'" in page
    assert not re.search(r"(?:src|href)=[\"']?(?:https?:)?//", page)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("<a/>", "no digital calibration certificate"),
        ("text", "is no XML"),
        ("", "is no XML"),
        ('<!DOCTYPE a [<!ENTITY b "bbbb">]><a>&b;</a>', "document type or entities"),
    ],
)
def test_other_files_are_refused(content, expected, tmp_path):
    path = tmp_path / "x.xml"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=expected):
        read_certificate(path)


@pytest.mark.parametrize(
    ("unit", "symbol"),
    [
        (r"\metre\tothe{3}", "m³"),
        (r"\kilogram\metre\tothe{-3}", "kg·m⁻³"),
        (r"\milli\metre", "mm"),
        (r"\micro\metre \micro\metre", "µm"),
        (r"\one", ""),
        (r"\candela", "candela"),
        ("", ""),
    ],
)
def test_units_of_the_si(unit, symbol):
    assert _unit(unit) == symbol
