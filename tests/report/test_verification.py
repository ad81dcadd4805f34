"""`tankcal verify`: every disagreement between the files of a run is told, and nothing else."""

import json
import shutil

import pytest

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.report.verification import verify

pytestmark = pytest.mark.slow


@pytest.fixture
def job(example_run, tmp_path):
    """A copy of the example with its results, to be spoilt."""
    return shutil.copytree(example_run, tmp_path / "job")


def told(path, **options):
    return [(one.file, one.expected.code) for one in verify(path, **options).problems]


def test_a_run_agrees_with_itself(job, capsys):
    found = verify(job / "results")
    assert found.problems == []
    assert found.inputs_found
    names = {"record.json", "certificate.pdf", "report.pdf", "field-table.pdf", "certificate.xml",
             "working-papers.pdf", "capacity.xlsx", "capacity.csv", "report.html", "report.ipynb",
             "job.toml", "points.csv"}  # fmt: skip
    assert names <= set(found.compared)
    assert main(["verify", str(job / "results")]) == 0
    assert found.digest in capsys.readouterr().out
    for name in ("certificate.pdf", "report.pdf"):
        assert verify(job / "results" / name).problems == []


def test_a_changed_record_is_told_of_by_every_paper(job, capsys):
    path = job / "results" / "record.json"
    path.write_bytes(path.read_bytes().replace(b"RECONSTRUCTION-1", b"RECONSTRUCTION-2", 1))
    found = told(job / "results")
    for name in ("certificate.pdf", "working-papers.pdf", "field-table.pdf", "report.pdf",
                 "capacity.xlsx", "certificate.xml", "report.html", "report.ipynb"):  # fmt: skip
        assert (name, "verify_other_record") in found
    assert ("certificate.pdf", "verify_differs_inside") in found
    assert main(["verify", str(job / "results"), "--language", "pt-BR"]) == 2
    assert "certificate.pdf: foi feito de outro registro" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "before", "after", "code"),
    [
        ("capacity.csv", b"1", b"2", "verify_other_table"),
        ("certificate.xml", b"<si:value>13.0", b"<si:value>13.1", "verify_other_content"),
        ("certificate.xml", b"</dcc:", b"</dc:", "verify_no_xml"),
    ],
)
def test_a_changed_file_is_told_of(job, name, before, after, code):
    path = job / "results" / name
    path.write_bytes(path.read_bytes().replace(before, after, 1))
    expected = [(name, code)]
    if name == "certificate.xml":
        expected += [(one, "verify_differs_inside") for one in ("certificate.pdf", "report.pdf")]
    assert sorted(told(job / "results")) == sorted(expected)


def test_a_changed_workbook_differs_from_that_inside(job):
    path = job / "results" / "capacity.xlsx"
    path.write_bytes(path.read_bytes() + b" ")
    inside = [(one, "verify_differs_inside") for one in ("certificate.pdf", "report.pdf")]
    assert told(job / "results") == inside


def test_changed_and_missing_input_files_are_told_of(job):
    (job / "points.csv").write_text("point,x_m,y_m,z_m\n", encoding="utf-8")
    (job / "courses.csv").unlink()
    assert told(job / "results") == [
        ("points.csv", "verify_input_changed"),
        ("courses.csv", "verify_input_missing"),
    ]
    moved = shutil.move(job / "results", job.parent / "alone")
    assert not verify(moved).inputs_found
    assert told(moved, job=job)[0] == ("points.csv", "verify_input_changed")


def test_a_paper_of_another_run_is_told_of(job, adjusted_record, tmp_path):
    assert main(["report", str(adjusted_record), "--out", str(tmp_path / "other"), "--quiet"]) == 0
    assert verify(tmp_path / "other").problems == []
    shutil.copyfile(tmp_path / "other" / "working-papers.pdf", job / "results" / "report.pdf")
    found = told(job / "results")
    assert ("report.pdf", "verify_other_record") in found
    assert {file for file, _ in found} == {"report.pdf"}


JUNK = {"empty": b"", "zeros": b"\0" * 5000, "words": b"no PDF", "head": b"%PDF-1.7\n1 0 obj\n"}


@pytest.mark.parametrize("content", JUNK.values(), ids=JUNK)
@pytest.mark.parametrize("name", ["certificate.pdf", "capacity.xlsx", "certificate.xml",
                                  "report.html", "record.json"])  # fmt: skip
def test_junk_is_told_of_in_a_line(job, capsys, name, content):
    (job / "results" / name).write_bytes(content)
    status = main(["verify", str(job / "results")])
    said = capsys.readouterr()
    assert "Traceback" not in said.out + said.err
    if name == "report.html":  # a page without a hash is nobody's paper
        assert status == 0
    else:
        assert status == 2
        assert f"{name}: " in said.out + said.err


@pytest.mark.parametrize("cut", [0.2, 0.5, 0.9, 0.999])
def test_a_cut_pdf_is_told_of_in_a_line(job, cut):
    path = job / "results" / "certificate.pdf"
    content = path.read_bytes()
    path.write_bytes(content[: int(cut * len(content))])
    assert {file for file, _ in told(job / "results")} <= {"certificate.pdf"}


def test_there_must_be_something_to_compare(tmp_path, capsys):
    for path in (tmp_path / "nothing", tmp_path):
        with pytest.raises(InputError):
            verify(path)
    (tmp_path / "x.pdf").write_bytes(b"x")
    assert main(["verify", str(tmp_path / "x.pdf")]) == 2
    capsys.readouterr()
    assert main(["verify", str(tmp_path / "nothing"), "--json"]) == 2
    found = json.loads(capsys.readouterr().out)
    assert found["problems"][0]["code"] == "verify_nothing"


def test_one_json_object(job, capsys):
    (job / "points.csv").write_text("x", encoding="utf-8")
    assert main(["verify", str(job / "results"), "--json"]) == 2
    found = json.loads(capsys.readouterr().out)
    assert found["exit_status"] == 2
    assert found["inputs_compared"]
    assert [one["code"] for one in found["problems"]] == ["verify_input_changed"]
    assert found["record_sha256"] in (job / "results" / "report.html").read_text(encoding="utf-8")
