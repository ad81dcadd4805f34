"""A certificate names a standard of tank calibration only if an input of the job declares it."""

import re
from xml.etree import ElementTree

import pytest
from example_certificates import EXAMPLES, certificate_blocks, input_texts, record_of_example
from paper_cells import texts

from tankcal.report.dcc import DCC, certificate_xml
from tankcal.text.shipped import LANGUAGES

# ISO/IEC 17025 states what a certificate contains, not how a tank is calibrated.
NAMES = r"\b(?:ISO|API|EN|ABNT|ASTM|OIML|EI|IP)(?: [A-Z][A-Za-z]{0,3})* \d[\w.:-]*"
STANDARD = re.compile(NAMES)  # a space before the number: no part of a base64 text


def standards_in(found):
    return {name for text in found for name in STANDARD.findall(text)}


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_no_undeclared_standard_is_named(name, language):
    declared = standards_in([input_texts(name)])
    shown = texts(certificate_blocks(name, language))
    assert len(shown) > 50
    assert standards_in(shown) <= declared


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_no_undeclared_standard_is_in_the_digital_certificate(name):
    root = ElementTree.fromstring(certificate_xml(record_of_example(name), "0" * 64))
    declared = standards_in([input_texts(name)])
    assert standards_in(root.itertext()) <= declared
    norms = {element.text for element in root.iter(f"{{{DCC}}}norm")}
    assert norms <= declared | {"JCGM 100:2008", "JCGM 101:2008"}


def test_the_expression_finds_the_standards_of_tank_calibration():
    shown = [
        "ISO 7507-1:2003; API MPMS 2.2A",
        "API Std 2555",
        "ABNT NBR 7507",
        "ISO/IEC 17025:2017",
    ]
    assert standards_in(shown) == {
        "ISO 7507-1:2003",
        "API MPMS 2.2A",
        "API Std 2555",
        "ABNT NBR 7507",
    }


@pytest.mark.slow
def test_a_declared_standard_is_the_norm_of_the_method():
    record = record_of_example("strapping")
    certificate = record["job"]["certificate"] | {"standard": "ISO 7507-1:2003"}
    changed = record | {"job": record["job"] | {"certificate": certificate}}
    root = ElementTree.fromstring(certificate_xml(changed, "0" * 64))
    norms = [element.text for element in root.iter(f"{{{DCC}}}norm")]
    assert norms == ["ISO 7507-1:2003", "JCGM 100:2008"]
