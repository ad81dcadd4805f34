"""`tankcal docs`: the pages that are installed."""

from pathlib import Path

import pytest

from tankcal.cli import main
from tankcal.text.shipped import page_names

DOCS = Path(__file__).parents[2] / "docs"


def test_every_page_is_listed_with_its_title(capsys):
    assert main(["docs"]) == 0
    *lines, folder = capsys.readouterr().out.splitlines()
    names = [line.split()[0] for line in lines]
    pages = sorted(path.stem for path in DOCS.glob("*.md"))
    studies = sorted(path.stem for path in DOCS.glob("studies/*.md"))
    assert names == [*pages, *(f"studies/{name}" for name in studies)]
    assert all(len(line.split()) > 1 for line in lines)
    assert Path(folder) == DOCS


def test_a_study_is_printed(capsys):
    assert main(["docs", "studies/coverage"]) == 0
    assert capsys.readouterr().out.startswith("# Study: coverage")


@pytest.mark.parametrize("name", ["limits", "limits.md", "docs/limits.md"])
def test_a_page_is_printed_as_it_stands(name, capsys):
    assert main(["docs", name]) == 0
    assert capsys.readouterr().out == (DOCS / "limits.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "name", ["limit", "../README", "/etc/passwd", "", "conf.py", "x" * 5000, "a\nb", "\0", "é"]
)
def test_no_such_page(name, capsys):
    assert main(["docs", name]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.count("\n") <= 2
    assert "tankcal docs" in told.err
    assert ("limits?" in told.err) == (name == "limit")


def test_names_are_those_that_help_and_messages_say():
    assert {"job-format", "conventions", "compare", "exports", "inspection"} <= set(page_names())
