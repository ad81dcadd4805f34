"""The changelog: short sections, short entries, and the journal of what came before."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MOST_LINES = 120  # of a section, its heading and blank lines included
MOST_WORDS = 25  # of an entry
JOURNAL = ROOT / "docs/journal/2026.md"


def sections(text):
    """{heading: lines} of the sections of a changelog; the heading is the first line."""
    parts = re.split(r"^(?=## )", text, flags=re.MULTILINE)[1:]
    return {part.partition("\n")[0]: part.splitlines() for part in parts}


def long_sections(text):
    """Headings of the sections with more than MOST_LINES lines."""
    return [heading for heading, lines in sections(text).items() if len(lines) > MOST_LINES]


def long_entries(text):
    """Entries with more than MOST_WORDS words, and lines that continue an entry."""
    entries = re.findall(r"^ *[-*] +(.*)$", text, flags=re.MULTILINE)
    continued = re.findall(r"^ *[-*] .*\n((?! *[-*] |#|\n).+)$", text, flags=re.MULTILINE)
    return [entry for entry in entries if len(entry.split()) > MOST_WORDS] + continued


@pytest.fixture(scope="module")
def changelog():
    return (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_sections_are_short(changelog):
    assert sections(changelog)
    assert long_sections(changelog) == []


def test_entries_are_short(changelog):
    assert long_entries(changelog) == []


def test_long_sections_and_entries_are_found():
    """The tests above can fail."""
    text = "# Changelog\n\n## 0.2.0\n\n- a\n\n## 0.1.0\n"
    assert long_sections(text + "- b\n" * MOST_LINES) == ["## 0.1.0"]
    assert long_sections(text + "- b\n" * (MOST_LINES - 1)) == []
    words = "word " * MOST_WORDS
    assert long_entries(f"- {words}\n- {words}more\n\nno entry: {words}\n") == [f"{words}more"]
    assert long_entries("- begins here\n  and continues\n") == ["  and continues"]


def test_sections_have_two_lists_at_most(changelog):
    allowed = ["### What you can do", "### Numbers that changed"]
    for lines in sections(changelog).values():
        lists = [line for line in lines if line.startswith("### ")]
        assert lists == [heading for heading in allowed if heading in lists]


def test_journal_is_linked():
    text = JOURNAL.read_text(encoding="utf-8")
    assert text.startswith("# Journal of development, 2026\n")
    for page in ("CHANGELOG.md", "docs/index.md"):
        goals = re.findall(r"\]\(([^()\s#]+)", (ROOT / page).read_text(encoding="utf-8"))
        assert JOURNAL in {((ROOT / page).parent / goal).resolve() for goal in goals}
