"""The gallery of the site: all examples, each with its computed result."""

import re
import sys

import pytest
from page_figures import agree, figures_of
from page_sessions import ROOT

sys.path.insert(0, str(ROOT / "docs"))
import gallery

ROWS = {  # of the table of docs/start.md
    "cloud": ("docs/start.md", "scanner, targets | () % ("),
    "liquid": ("docs/start.md", "certificate of the meter | () % ("),
    "rings": ("docs/start.md", "| tape, ends, tilt | () % ("),
    "sphere-straps": ("docs/start.md", "| tape, plates, legs | () % ("),
}


def test_the_gallery_lists_every_example():
    folders = {path.name for path in (ROOT / "examples").iterdir() if path.is_dir()}
    assert {example[0] for example in gallery.EXAMPLES} | set(gallery.OTHERS) == folders
    pages = {example[3] for example in gallery.EXAMPLES} | set(gallery.OTHERS.values())
    assert [page for page in pages if not (ROOT / f"docs/{page}.md").exists()] == []
    notebooks = {example[4] for example in gallery.EXAMPLES} - {None}
    assert [name for name in notebooks if not (ROOT / f"notebooks/{name}.ipynb").exists()] == []


@pytest.mark.slow
def test_an_example_shows_its_result(tmp_path):
    (text,) = gallery.write(tmp_path, [row for row in gallery.EXAMPLES if row[0] == "strapping"])
    assert "**Result at 8.4 m:** 1369.66 m3, U = 0.56 m3" in text
    assert "`bulge` 57 %" in text
    assert (tmp_path / "gallery/strapping.svg").stat().st_size > 10_000


@pytest.mark.study
@pytest.mark.parametrize("folder", ROWS)
def test_the_first_page_states_u_of_examples(folder, tmp_path):
    (text,) = gallery.write(tmp_path, [row for row in gallery.EXAMPLES if row[0] == folder])
    computed = float(re.search(r"U of this volume:\*\* ([\d.]+) %", text)[1])
    assert agree([computed], figures_of(*ROWS[folder]))
