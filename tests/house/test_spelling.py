"""The checks of spelling find what they are for."""

import pytest

pytest.importorskip("spellchecker")
pytest.importorskip("codespell_lib")

from page_sessions import ROOT
from spelling import check_english, language_of, list_pages, unknown_words, words_of


def test_pages_have_a_language():
    languages = {page.name: language_of(page.name) for page in list_pages()}
    assert languages["start.md"] == "en"
    assert languages["comece-aqui.md"] == languages["tutorial-points-pt-BR.md"] == "pt-BR"
    assert languages["empiece-aqui.md"] == languages["results-es.md"] == "es"


def test_code_is_left_out():
    text = "Palavra `codigo`\n\n    tankcal run\n\n```csv\nabc\n```\n"
    assert words_of(text) == {"palavra"}


@pytest.mark.slow
def test_misspellings_are_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("The recieved volume.")
    assert "received" in check_english([page])[0]
    assert unknown_words(["A tabela volumétrica do tanqeu"], "pt-BR") == ["tanqeu"]
    assert unknown_words(["La tabla de capacidad del tanqeu"], "es") == ["tanqeu"]


@pytest.mark.slow
def test_pages_are_spelt_correctly():
    pages = [page for page in list_pages() if language_of(page.name) == "en"]
    assert check_english(pages) == []
    assert (ROOT / "tests/house/spelling.toml").exists()
