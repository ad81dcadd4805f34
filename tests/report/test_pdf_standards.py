"""PDF/A-3a and PDF/UA-1: what veraPDF says of every PDF, in every language."""

import os
import shlex
import shutil
import subprocess

import pytest
from compared_tables import KINDS
from conftest import EXAMPLE

from tankcal.planning import load_plan, predict
from tankcal.report import planning as planning_papers
from tankcal.report.comparison import write_comparison
from tankcal.report.laboratory import load
from tankcal.report.papers import build
from tankcal.text.shipped import DEFAULT, LANGUAGES

FLAVOURS = ("3a", "ua1")
LOGO = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 3 1">'
    '<rect width="3" height="1" fill="#0b3d2e" opacity="0.5"/></svg>'
)


@pytest.fixture(scope="module")
def verapdf():
    """The command of veraPDF: that in VERAPDF, else the one on the PATH."""
    command = shlex.split(os.environ.get("VERAPDF", "")) or ["verapdf"]
    if not shutil.which(command[0]):
        pytest.skip("veraPDF is not on this machine: set VERAPDF to its command")
    return command


@pytest.mark.study
@pytest.mark.parametrize("language", LANGUAGES)
def test_every_pdf_conforms(verapdf, example_record, tmp_path, language):
    (tmp_path / "logo.svg").write_text(LOGO, encoding="utf-8")
    letterhead = tmp_path / "lab.toml"
    letterhead.write_text('[laboratory]\nname = "Lab"\nlogo = "logo.svg"', encoding="utf-8")
    out = tmp_path / "out"
    out.mkdir()
    (out / "capacity.xlsx").write_bytes(b"any workbook")
    build(example_record, out, language=language, letterhead=load(letterhead))
    names = ("field-table", "report")  # the report is certificate and working papers
    if language == DEFAULT:
        names += ("certificate", "working-papers")
    paths = [str(out / f"{name}.pdf") for name in names]
    assert_conform(verapdf, paths)


@pytest.fixture(scope="module")
def prediction():
    return predict(load_plan(EXAMPLE.parent / "plan-silva"))


@pytest.mark.study
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_papers_of_a_plan_conform(verapdf, prediction, tmp_path, language):
    planning_papers.write(prediction, tmp_path / "out", language=language)
    names = ("prediction.pdf", "field-sheets.pdf")
    assert_conform(verapdf, [str(tmp_path / "out" / name) for name in names])


@pytest.mark.study
@pytest.mark.parametrize(("language", "kind"), [*zip(LANGUAGES, KINDS, strict=True)])
def test_the_paper_of_a_comparison_conforms(verapdf, tmp_path, language, kind):
    write_comparison(KINDS[kind](), tmp_path / "out", language)
    assert_conform(verapdf, [str(tmp_path / "out" / "comparison.pdf")])


def assert_conform(verapdf, paths):
    """Each file passes in each flavour; without --flavour veraPDF takes those that it declares."""
    command = [*verapdf, "--format", "text", *paths]
    said = subprocess.run(command, capture_output=True, encoding="utf-8", check=False).stdout
    expected = [f"PASS {path} {flavour}" for path in paths for flavour in FLAVOURS]
    assert sorted(said.splitlines()) == sorted(expected)
