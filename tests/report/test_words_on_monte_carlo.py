"""The certificates of the examples say in one sentence how U was obtained, and no jargon."""

import re

import pytest
from example_certificates import EXAMPLES, certificate_blocks
from paper_cells import texts

from tankcal.text.shipped import LANGUAGES

# Verdicts and settings of the simulation, for the working papers.
DETAILS = re.compile(r"validat|validad|valida\b|validó|seed|semente|semilla", re.IGNORECASE)


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", EXAMPLES)
def test_the_certificate_leaves_the_details_to_the_working_papers(name, language):
    shown = texts(certificate_blocks(name, language))
    assert [text for text in shown if DETAILS.search(text) and len(text) < 2000] == []
    assert sum("JCGM 100:2008" in text or "JCGM 101:2008" in text for text in shown) == 1
