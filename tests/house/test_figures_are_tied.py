"""Every figure of a page that looks like a result is compared by a test, or is declared as given.

A figure is compared if it is in a block of commands that `test_tutorials.py` runs, or in a sentence
that a test names (`figures_of`). `figures_given.toml` has the phrases with inputs and definitions.
"""

import tomllib

import pytest
from page_figures import RESULT, agree, pattern_of, shares_agree, untied_figures, words_of
from page_sessions import ROOT

GENERATED = {
    "docs/studies/benchmarks.md",
    "docs/job-format.md",
    "docs/saved-keys.md",
    "docs/plausible-values.md",
}
PAGES = sorted(
    {
        str(path.relative_to(ROOT))
        for pattern in ("*.md", "studies/*.md")
        for path in ROOT.glob(f"docs/{pattern}")
    }
    - GENERATED
)
GIVEN = tomllib.loads((ROOT / "tests/house/figures_given.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", PAGES)
def test_each_figure_has_a_test(page):
    untied = untied_figures(page, GIVEN.get(page, ()))
    assert untied == []


@pytest.mark.parametrize("page", GIVEN)
def test_given_figures_are_on_the_page(page):
    text = words_of(page)
    assert [phrase for phrase in GIVEN[page] if phrase not in text] == []


@pytest.mark.parametrize(
    ("text", "figures"),
    [
        ("with U = 0.37 m³ at 6 m", ["U = 0.37"]),
        ("12 ppm, and 3 of 40 tables", ["12 ppm", "3 of 40"]),
        ("held .95, or 0.963 of all", [".95", "0.963"]),
        ("1 234.5 L in 2.5 s", ["1 234.5 L", "2.5 s"]),
        ("R = 6.5 m, row 9500, JCGM 100:2008, 5.2, 0.25 m, 20 °C", []),
    ],
)
def test_figures_that_look_like_results(text, figures):
    assert [match[0] for match in RESULT.finditer(text)] == figures


def test_a_changed_figure_does_not_agree():
    assert agree([0.3749, 1250.4], ["0.37", "1 250"])
    assert not agree([0.3751], ["0.37"])
    assert shares_agree([0.95], ["0.94"], 100, 1000)
    assert not shares_agree([0.95], ["0.75"], 100, 1000)


def test_a_sentence_covers_its_figures_only(monkeypatch):
    monkeypatch.setattr("page_figures.words_of", lambda page: "takes 3 s of 5 MB. Needs 7 MB.")
    assert len(untied_figures("docs/none.md")) == 3
    assert len(untied_figures("docs/none.md", ["takes 3 s of 5 MB."])) == 1
    assert pattern_of("needs () MB").startswith("needs\\ (")
