"""The typesetter: control characters, and a process of its own where memory is limited."""

import io

import pypdf
import pytest

from tankcal.errors import TankcalError
from tankcal.report import blocks
from tankcal.report import pdf as module

PAGE = [blocks.document(title="T", date="2024-05-31").data, blocks.masthead("T").data]
BROKEN = [*PAGE, blocks.paragraph("a sign that no font has: \U00012345\U000e0100").data]


@pytest.mark.slow
def test_the_other_process_makes_the_same_bytes_and_reports_the_same_error(monkeypatch):
    found = []
    for limited in (False, True):
        monkeypatch.setattr(module, "_is_memory_limited", lambda limited=limited: limited)
        with pytest.raises(TankcalError) as refused:
            module.pdf(BROKEN)
        found.append((module.pdf(PAGE), str(refused.value)))
    assert found[0] == found[1]


@pytest.mark.slow
def test_control_characters_are_spelt_out():
    """No font has them, and PDF/UA admits no text without a glyph."""
    title = blocks.document(title="T", date="2024-05-31", running=["a\x00b \x7f \x85", ""]).data
    made = module.pdf([title, *PAGE[1:]])
    [page] = pypdf.PdfReader(io.BytesIO(made)).pages
    assert r"a\x00b \x7f \x85" in page.extract_text()


def test_a_process_that_ends_without_a_page_had_no_memory(monkeypatch):
    monkeypatch.setattr(module, "_is_memory_limited", lambda: True)
    monkeypatch.setattr(module, "IN_A_PROCESS", "import os; os.abort()")
    with pytest.raises(MemoryError):
        module.pdf(PAGE)
