"""`tankcal report`: the papers again from record.json alone, and the files held inside the PDFs."""

import json
import shutil
import subprocess

import pytest

from tankcal.cli import main
from tankcal.errors import TankcalError
from tankcal.record import FORMAT
from tankcal.report import attachments, blocks, outputs
from tankcal.report.pdf import pdf


@pytest.fixture(scope="module")
def results(short_result, tmp_path_factory):
    """The folder of the shipped example's results, as `tankcal run` leaves it."""
    folder = tmp_path_factory.mktemp("run") / "results"
    outputs.write(short_result, folder)
    return folder


@pytest.fixture(scope="module")
def again(results, tmp_path_factory):
    """The folder that `tankcal report` made from the record alone."""
    alone = tmp_path_factory.mktemp("alone")
    shutil.copyfile(results / "record.json", alone / "record.json")
    assert main(["report", str(alone / "record.json"), "--out", str(alone / "out"), "--quiet"]) == 0
    return alone / "out"


def names_of(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.slow
def test_every_file_is_the_same_to_the_byte(results, again):
    assert names_of(again) == names_of(results)
    for name in names_of(again):
        assert (again / name).read_bytes() == (results / name).read_bytes(), name


@pytest.mark.study
def test_a_folder_of_results_is_rebuilt_in_its_place(again, tmp_path, capsys):
    folder = tmp_path / "results"
    shutil.copytree(again, folder)
    for name in ("certificate.pdf", "capacity.xlsx", "points.csv"):
        (folder / name).write_text("spoilt", encoding="utf-8")
    assert main(["report", str(folder), "--quiet"]) == 0
    assert names_of(folder) == names_of(again)
    assert (folder / "certificate.pdf").read_bytes() == (again / "certificate.pdf").read_bytes()
    assert str(folder / "capacity.xlsx") in capsys.readouterr().out


@pytest.mark.study
def test_the_covariance_that_no_record_holds_is_taken_over(again, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(again, folder)
    (folder / "points_cov.npz").write_bytes(b"as it was")
    outputs.rebuild(folder, tmp_path / "other")
    assert (tmp_path / "other" / "points_cov.npz").read_bytes() == b"as it was"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        ({"format": "tankcal-record/9"}, [], "record.json: found format 'tankcal-record/9'"),
        ("no json", [], "record.json: cannot be read as a record"),
        (
            {"capacity": {}, "points": 7},
            [],
            f"record.json: found format {FORMAT} without capacity.",
        ),
        ({"rejected": {}, "gross": 7}, [], f"record.json: found format {FORMAT} without gross."),
        ({"deadwood": [7]}, [], "record.json: found format"),
        (
            {"densities": [{"density_kg_m3": "x", "volume_m3": []}]},
            [],
            "record.json, densities[0].density_kg_m3: found 'x', expected a number",
        ),
        ({}, ["--language", "pt"], "--language: found 'pt'; expected one of en, pt-BR, es"),
        ({}, ["--letterhead", "none.toml"], "none.toml: not found"),
    ],
)
def test_unusable_letterhead_is_one_problem(again, tmp_path, capsys, change, options, message):
    record = tmp_path / "record.json"
    text = (again / "record.json").read_text(encoding="utf-8")
    if isinstance(change, dict):
        text = json.dumps(json.loads(text) | change)
    record.write_text(change if isinstance(change, str) else text, encoding="utf-8")
    assert main(["report", str(tmp_path), "--out", str(tmp_path / "out"), "--quiet", *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"tankcal: {message}")
    assert names_of(tmp_path) == ["record.json"]


@pytest.mark.slow
def test_a_code_that_has_no_words_is_one_line(again, tmp_path, capsys):
    record = json.loads((again / "record.json").read_text(encoding="utf-8"))
    record["capacity"]["zero"] = "elsewhere"
    (tmp_path / "record.json").write_text(json.dumps(record), encoding="utf-8")
    assert main(["report", str(tmp_path), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("tankcal: record.json: does not have the content of a record (")
    assert names_of(tmp_path) == ["record.json"]


@pytest.mark.slow
def test_foreign_folder_is_refused(again, tmp_path, capsys):
    shutil.copyfile(again / "record.json", tmp_path / "record.json")
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    assert main(["report", str(tmp_path), "--quiet"]) == 2
    assert "holds 'notes.txt', which tankcal did not write" in capsys.readouterr().err
    assert names_of(tmp_path) == ["notes.txt", "record.json"]


def test_a_letterhead_that_is_bad_stops_a_run_before_it_begins(tmp_path, capsys):
    (tmp_path / "lab.toml").write_text("[laboratory]\n", encoding="utf-8")
    command = ["run", str(tmp_path / "no-job"), "--letterhead", str(tmp_path / "lab.toml")]
    assert main([*command, "--quiet"]) == 2
    assert capsys.readouterr().err.startswith("tankcal: lab.toml, row 1, laboratory.name: missing")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["certificate.pdf", "report.pdf"])
def test_record_and_workbook_are_inside_byte_for_byte(results, tmp_path, name):
    if not shutil.which("pdfdetach"):
        pytest.skip("pdfdetach (poppler) is not on this machine")
    command = ["pdfdetach", "-saveall", "-o", str(tmp_path), str(results / name)]
    subprocess.run(command, check=True, capture_output=True)
    assert names_of(tmp_path) == ["capacity.xlsx", "certificate.xml", "record.json"]
    for held in names_of(tmp_path):
        assert (tmp_path / held).read_bytes() == (results / held).read_bytes()


@pytest.mark.slow
def test_attachments_are_named_and_described(results):
    content = (results / "certificate.pdf").read_bytes()
    for entry in (b"Source", b"Data", b"Alternative"):
        assert b"/AFRelationship/" + entry in content
    assert b"/AFRelationship" not in (results / "working-papers.pdf").read_bytes()


@pytest.mark.slow
def test_a_workbook_changed_since_is_not_held_inside(results, tmp_path):
    (tmp_path / "capacity.xlsx").write_bytes(b"as made")
    (held,) = attachments.beside(tmp_path, {"capacity.xlsx": "The table"})
    document = blocks.document(title="t", attachments=[held.data()]).data
    assert pdf([document], tmp_path).startswith(b"%PDF")
    (tmp_path / "capacity.xlsx").write_bytes(b"changed")
    with pytest.raises(TankcalError, match=r"capacity\.xlsx .* was changed since"):
        pdf([document], tmp_path)
    with pytest.raises(TankcalError, match="no such file beside the notebook"):
        pdf([document], results / "elsewhere")
