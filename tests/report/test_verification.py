"""`tankcal verify`: every disagreement between the files of a run is told, and nothing else."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from compared_tables import plain
from draws import draws
from job_builder import write_job, write_workbook
from test_adjustment_outputs import write_station

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.record.manifest import PACKAGES
from tankcal.report.comparison import write_comparison
from tankcal.report.verification import verify
from tankcal.report.verified_again import content_of_paper

pytestmark = pytest.mark.slow


@pytest.fixture
def job(example_run, tmp_path):
    """A copy of the example with its results, to be spoilt."""
    return shutil.copytree(example_run, tmp_path / "job")


def told(path, **options):
    options = {"hashes_only": True} | options
    return [(one.file, one.expected.code) for one in verify(path, **options).problems]


def test_a_run_agrees_with_itself(job, capsys):
    found = verify(job / "results")
    assert found.problems == []
    assert found.inputs_found
    assert found.papers_again
    assert found.notes == []
    again = found.recomputed
    assert (again.different, again.largest, again.agrees) == (0, None, True)
    assert again.numbers > 100_000
    names = {"record.json", "certificate.pdf", "report.pdf", "field-table.pdf", "certificate.xml",
             "working-papers.pdf", "capacity.xlsx", "capacity.csv", "report.html", "report.ipynb",
             "job.toml", "points.csv"}  # fmt: skip
    assert names <= set(found.compared)
    assert main(["verify", str(job / "results"), "--hashes-only"]) == 0
    assert found.digest in capsys.readouterr().out
    for name in ("certificate.pdf", "report.pdf"):
        assert verify(job / "results" / name, hashes_only=True).problems == []


def test_a_changed_record_is_told_of_by_every_paper(job, capsys):
    path = job / "results" / "record.json"
    path.write_bytes(path.read_bytes().replace(b"RECONSTRUCTION-1", b"RECONSTRUCTION-2", 1))
    found = told(job / "results")
    for name in ("certificate.pdf", "working-papers.pdf", "field-table.pdf", "report.pdf",
                 "capacity.xlsx", "certificate.xml", "report.html", "report.ipynb"):  # fmt: skip
        assert (name, "verify_other_record") in found
    assert ("certificate.pdf", "verify_differs_inside") in found
    assert main(["verify", str(job / "results"), "--language", "pt-BR", "--hashes-only"]) == 2
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
    assert told(job / "results") == [*inside, ("capacity.xlsx", "verify_altered")]


def test_changed_and_missing_input_files_are_told_of(job):
    (job / "points.csv").write_text("point,x_m,y_m,z_m\n", encoding="utf-8")
    (job / "courses.csv").unlink()
    assert told(job / "results") == [
        ("points.csv", "verify_input_changed"),
        ("courses.csv", "verify_input_missing"),
    ]
    moved = shutil.move(job / "results", job.parent / "alone")
    assert not verify(moved, hashes_only=True).inputs_found
    assert told(moved, job=job)[0] == ("points.csv", "verify_input_changed")


def test_a_paper_of_another_run_is_told_of(job, adjusted_record, tmp_path):
    assert main(["report", str(adjusted_record), "--out", str(tmp_path / "other"), "--quiet"]) == 0
    assert verify(tmp_path / "other", hashes_only=True).problems == []
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
    status = main(["verify", str(job / "results"), "--hashes-only"])
    said = capsys.readouterr()
    assert "Traceback" not in said.out + said.err
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
    assert main(["verify", str(job / "results"), "--json", "--hashes-only"]) == 2
    found = json.loads(capsys.readouterr().out)
    assert found["exit_status"] == 2
    assert found["inputs_compared"]
    assert [one["code"] for one in found["problems"]] == ["verify_input_changed"]
    assert found["record_sha256"] in (job / "results" / "report.html").read_text(encoding="utf-8")
    assert found["manifest_sha256"] == sha256_of(job / "results" / "SHA256SUMS")
    assert found["recomputed"] is None


def sha256_of(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def write_sums_again(folder):
    """A manifest that fits files that were altered, as who alters them can write it."""
    kept = [row for row in (folder / "SHA256SUMS").read_text().splitlines() if row[0] == "#"]
    names = sorted(one.name for one in folder.iterdir() if one.name != "SHA256SUMS")
    rows = [f"{sha256_of(folder / name)}  {name}" for name in names]
    (folder / "SHA256SUMS").write_text("\n".join([*kept, *rows, ""]), encoding="utf-8")


HIDDEN = ("report.html", "report.ipynb", "working-papers.pdf", "field-table.pdf")


def alter(path):
    """Change what a reader sees, or the last bytes of a PDF, and no hash that it names."""
    content = path.read_bytes()
    at = content.rfind(b"13.0") if path.suffix != ".pdf" else content.rfind(b"endobj") - 8
    path.write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])


@pytest.mark.parametrize("name", HIDDEN)
def test_a_change_that_no_hash_inside_shows_is_told_of(job, name):
    alter(job / "results" / name)
    found = told(job / "results")
    assert (name, "verify_altered") in found or (name, "verify_no_pdf") in found
    assert {file for file, _ in found} == {name}


def test_papers_made_again_see_what_an_altered_manifest_hides(job):
    for name in ("report.html", "report.ipynb"):
        alter(job / "results" / name)
    write_sums_again(job / "results")
    assert told(job / "results") == []
    assert told(job / "results", hashes_only=False) == [
        ("report.html", "verify_other_paper"),
        ("report.ipynb", "verify_other_paper"),
    ]


def test_missing_and_extra_files_are_told_of(job):
    (job / "results" / "working-papers.pdf").unlink()
    (job / "results" / "notes.txt").write_text("x", encoding="utf-8")
    assert told(job / "results") == [
        ("working-papers.pdf", "verify_missing"),
        ("notes.txt", "verify_extra"),
    ]


def made_by(folder, one, other):
    """Say in SHA256SUMS that other versions made the papers, as a forger may."""
    path = folder / "SHA256SUMS"
    path.write_text(path.read_text(encoding="utf-8").replace(one, other, 1), "utf-8")


OTHERS = {
    "another typst": ("typst ", "typst 0."),
    "a later tankcal": ("made by tankcal ", "made by tankcal 9"),
    "nothing": ("# made by ", "# "),
}


@pytest.mark.parametrize("other", OTHERS)
def test_papers_of_another_maker_are_compared_by_words_and_numbers(job, other):
    made_by(job / "results", *OTHERS[other])
    found = verify(job / "results")
    assert found.problems == []
    assert found.papers_again
    (code,) = [one.code for one in found.notes]
    assert code == ("verify_maker_unknown" if other == "nothing" else "verify_other_maker")


def in_page(path):
    """Another volume of the full tank, wherever the page has it."""
    text = path.read_text(encoding="utf-8")
    volume = json.loads((path.parent / "record.json").read_text())["capacity"]["volume_m3"][-1]
    assert text.count(f"{volume:.3f}")
    path.write_text(text.replace(f"{volume:.3f}", f"{volume + 10:.3f}"), "utf-8")


def in_workbook(path):
    book = openpyxl.load_workbook(path)
    cells = (cell for sheet in book for row in sheet.iter_rows() for cell in row)
    cell = next(one for one in cells if isinstance(one.value, float) and one.value > 1000)
    cell.value += 10
    book.save(path)


def in_pdf(path):
    """Another page over the first one: same attachments and metadata."""
    from pypdf import PdfReader, PdfWriter
    from pypdf.generic import NameObject

    writer = PdfWriter(clone_from=PdfReader(path))
    page = writer.pages[0]
    data = page.get_contents().get_data()
    stream = writer._add_object(_stream_of(data[: len(data) // 2]))  # half of the text is gone
    page[NameObject("/Contents")] = stream
    writer.write(path)


def _stream_of(data):
    from pypdf.generic import DecodedStreamObject

    stream = DecodedStreamObject()
    stream.set_data(data)
    return stream


def note_on_page(path):
    from pypdf import PdfReader, PdfWriter
    from pypdf.annotations import FreeText

    writer = PdfWriter(clone_from=PdfReader(path))
    writer.add_annotation(0, FreeText(text="U = 0.1 m3", rect=(50, 50, 300, 100)))
    writer.write(path)


FORGERIES = {"report.html": in_page, "capacity.xlsx": in_workbook, "certificate.pdf": in_pdf,
             "working-papers.pdf": note_on_page}  # fmt: skip


@pytest.mark.parametrize(("name", "other"), draws(
    [("report.html", "another typst"), ("capacity.xlsx", "a later tankcal"),
     ("certificate.pdf", "nothing"), ("working-papers.pdf", "a later tankcal")],
    list(product(FORGERIES, OTHERS)),
))  # fmt: skip
def test_forged_papers_of_another_maker_are_told_of(job, capsys, name, other):
    """The forger alters a paper, writes its hash again, and says that another version made it."""
    results = job / "results"
    FORGERIES[name](results / name)
    write_sums_again(results)
    made_by(results, *OTHERS[other])
    if name == "certificate.pdf" and other == "a later tankcal":
        pytest.skip("a later version may leave numbers out; pages that are gone are no numbers")
    assert name in {file for file, _ in told(results, hashes_only=False)}


def script_of_pdf(path):
    from pypdf import PdfReader, PdfWriter
    from pypdf.generic import DictionaryObject, NameObject

    writer = PdfWriter(clone_from=PdfReader(path))
    writer.root_object[NameObject("/OpenAction")] = DictionaryObject()
    writer.write(path)


def in_text(before, after):
    def alter(path):
        text = path.read_text(encoding="utf-8")
        assert before in text
        path.write_text(text.replace(before, after, 1), encoding="utf-8")

    return alter


def format_of_cells(path):
    """Every cell of a number format shows 9.9."""
    book = openpyxl.load_workbook(path)
    cells = (cell for sheet in book for row in sheet.iter_rows() for cell in row)
    next(one for one in cells if isinstance(one.value, float)).number_format = '"9.9"'
    book.save(path)


COVERS = {
    "text of a style": ("report.html", in_text("</style>", "td::after{content:'9'}</style>")),
    "handler": ("report.html", in_text("<body", "<body onload=\"this.innerHTML='9'\"")),
    "frame": ("report.html", in_text("</body>", "<iframe srcdoc='9'></iframe></body>")),
    "style from elsewhere": ("report.html", in_text("</head>", "<link href='a.css'></head>")),
    "annotation": ("certificate.pdf", note_on_page),
    "script of a PDF": ("certificate.pdf", script_of_pdf),
    "format of cells": ("capacity.xlsx", format_of_cells),
}


@pytest.mark.slow(after=4)
@pytest.mark.parametrize("cover", COVERS)
def test_what_covers_the_text_of_a_paper_is_told_of(cover, tmp_path, job):
    """Numbers with few digits are not compared with papers of other versions; covers are."""
    name, alter = COVERS[cover]
    path = tmp_path / name
    path.write_bytes((job / "results" / name).read_bytes())
    before = content_of_paper(name, path.read_bytes()).elements
    alter(path)
    assert content_of_paper(name, path.read_bytes()).elements - before


def test_papers_older_than_their_record_are_refused(job):
    made_by(job / "results", f"made by tankcal {tankcal.__version__}", "made by tankcal 0.0.1")
    assert ("SHA256SUMS", "verify_older_papers") in told(job / "results", hashes_only=False)


def test_what_was_not_compared_is_named(job, capsys):
    """Hashes alone, or no input files: never "all agree"."""
    assert main(["verify", str(job / "results"), "--hashes-only"]) == 0
    said = capsys.readouterr().out
    assert "all agree" not in said
    assert "hash in SHA256SUMS only" in said
    results = shutil.move(job / "results", job.parent / "alone")
    assert main(["verify", str(results), "--quiet"]) == 0
    assert "all agree" not in capsys.readouterr().out
    assert main(["verify", str(results), "--job", str(job), "--quiet"]) == 0
    assert "all agree" in capsys.readouterr().out


def test_names_of_files_do_not_act_on_the_terminal(job, capsys):
    """A name that takes its own complaint back, and one that adds a line of praise."""
    for name in ("\x1b[1A\x1b[2Kcapacity.csv", "x\n16 files compared, all agree"):
        (job / "results" / name).write_text("forged")
    assert main(["verify", str(job / "results"), "--hashes-only"]) == 2
    said = "".join(capsys.readouterr())
    assert "\x1b" not in said
    assert "\\x1b[1A\\x1b[2Kcapacity.csv: is extra" in said
    assert "x\\n16 files compared, all agree: is extra" in said


def test_without_the_page_papers_are_made_again(job):
    """A forger takes away the page that said that there are papers."""
    (job / "results" / "report.html").unlink()
    alter(job / "results" / "field-table.pdf")
    write_sums_again(job / "results")
    assert "field-table.pdf" in {file for file, _ in told(job / "results", hashes_only=False)}


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"abc  x\n", b"# made by tankcal\n"])
def test_a_manifest_that_is_none_is_refused_in_a_line(job, content, capsys):
    (job / "results" / "SHA256SUMS").write_bytes(content)
    assert main(["verify", str(job / "results"), "--hashes-only"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("tankcal: SHA256SUMS")


def test_a_folder_without_a_manifest_says_so(job):
    (job / "results" / "SHA256SUMS").unlink()
    found = verify(job / "results", hashes_only=True)
    assert found.problems == []
    assert [one.code for one in found.notes] == ["verify_no_manifest_here"]


@pytest.mark.skipif(shutil.which("sha256sum") is None, reason="no sha256sum here")
def test_coreutils_check_the_manifest(job):
    """Other program: an archive is checked without tankcal, too."""
    done = subprocess.run(["sha256sum", "-c", "--strict", "SHA256SUMS"], cwd=job / "results",
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count(": OK") == len(os.listdir(job / "results")) - 1


def change_record(folder, change):
    path = folder / "record.json"
    record = json.loads(path.read_text(encoding="utf-8"))
    change(record)
    path.write_text(json.dumps(record), encoding="utf-8")
    write_sums_again(folder)  # else no command takes the record


def test_a_number_that_does_not_come_out_again_is_told_of(job):
    """The forger made every paper again of a record with another volume."""
    change_record(
        job / "results", lambda one: one["capacity"]["volume_m3"].__setitem__(950, 1250.0)
    )
    out = job / "results"
    assert main(["report", str(out), "--quiet"]) == 0
    assert told(out) == []
    found = verify(out)
    assert [one.expected.code for one in found.problems] == ["verify_number_apart"]
    assert found.recomputed.beyond[0].place == "capacity.volume_m3[950]"
    assert found.recomputed.beyond[0].recorded == 1250.0


def test_a_last_digit_of_another_machine_is_within_tolerance(job, capsys):
    """A few parts in 10^12, as another processor may give."""

    def nudge(record):
        record["capacity"]["volume_m3"][950] *= 1 + 3e-12

    change_record(job / "results", nudge)
    assert main(["report", str(job / "results"), "--quiet"]) == 0
    capsys.readouterr()
    assert main(["verify", str(job / "results"), "--json"]) == 0
    again = json.loads(capsys.readouterr().out)["recomputed"]
    assert (again["different"], again["agrees"]) == (1, True)
    assert again["largest"]["place"] == "capacity.volume_m3[950]"
    assert again["largest"]["relative"] == pytest.approx(3e-12, rel=1e-3)


def test_a_changed_input_is_not_computed_again(job):
    (job / "points.csv").write_text("point,x_m,y_m,z_m\n", encoding="utf-8")
    found = verify(job / "results")
    assert [one.expected.code for one in found.problems] == ["verify_input_changed"]
    assert found.recomputed is None
    assert [one.code for one in found.notes] == ["verify_inputs_differ"]


def test_a_file_that_came_into_the_job_later_is_not_read(job):
    """Only the files that the record names count: a new uncertainty would change every U."""
    (job / "deadwood.csv").write_text("name,bottom_m,top_m,volume_m3\na,0,1,1\n", "utf-8")
    found = verify(job / "results")
    assert (found.problems, found.recomputed.different) == ([], 0)


def test_papers_in_another_language_come_out_again(job, tmp_path):
    assert main(["report", str(job / "results"), "--language", "es", "--quiet",
                 "--out", str(tmp_path / "es")]) == 0  # fmt: skip
    found = verify(tmp_path / "es", job)
    assert (found.problems, found.papers_again, found.recomputed.different) == ([], True, 0)


def run_small(job, out, **options):
    """A small job, record and tables only."""
    return tankcal.write(tankcal.run(tankcal.load(job), **options), out, papers=False)


def test_a_run_without_monte_carlo_comes_out_again(tmp_path):
    """The record has none though its job asks for it: what was left out is left out again."""
    job = write_job(tmp_path / "job", settings={"table.step_m": 0.1})
    run_small(job, job / "results", simulated=False)
    found = verify(job / "results")
    assert (found.problems, found.recomputed.otherwise) == ([], ())


def test_the_job_of_a_workbook_comes_out_again(tmp_path):
    book = tmp_path / "tank.xlsx"
    write_workbook(book, settings={"table.step_m": 0.1})
    run_small(book, tmp_path / "tank-results")
    for given in (None, tmp_path, book):
        found = verify(tmp_path / "tank-results", given)
        assert (found.problems, found.inputs_found) == ([], True)
        assert found.recomputed.different == 0


def test_a_record_that_names_files_elsewhere_writes_nothing_there(tmp_path):
    """Names with .. are read where they are, never linked."""
    job = write_job(tmp_path / "job", settings={"table.step_m": 0.1})
    run_small(job, job / "results")

    def elsewhere(record):
        record["files"][0]["file"] = "../job/" + record["files"][0]["file"]

    change_record(job / "results", elsewhere)
    before = sorted(tmp_path.rglob("*"))
    found = verify(job / "results")
    assert sorted(tmp_path.rglob("*")) == before
    codes = {one.expected.code for one in found.problems}
    assert codes == {"verify_text_apart"}


def test_a_job_that_this_version_refuses_is_told(tmp_path):
    job = write_job(tmp_path / "job", settings={"table.step_m": 0.1})
    run_small(job, job / "results")
    text = (job / "job.toml").read_text(encoding="utf-8") + "\n[unheard]\nx = 1\n"
    (job / "job.toml").write_text(text, encoding="utf-8")

    def of_the_changed_file(record):
        for one in record["files"]:
            one["sha256"] = sha256_of(job / one["file"])

    change_record(job / "results", of_the_changed_file)
    found = verify(job / "results")
    assert next(one.expected.code for one in found.problems) == "verify_not_computed"
    assert "unheard" in str(found.problems[0])


def test_papers_with_a_letterhead_come_out_again(job, tmp_path):
    head = tmp_path / "lab.toml"
    head.write_text('[laboratory]\nname = "Lab X"\naddress = ["A 1"]\n', encoding="utf-8")
    out = tmp_path / "headed"
    arguments = ("--letterhead", str(head), "--quiet", "--out", str(out))
    assert main(["report", str(job / "results"), *arguments]) == 0
    found = verify(out)
    assert (found.problems, found.papers_again, found.inputs_found) == ([], True, False)
    (out / "letterhead.json").write_text("{", encoding="utf-8")
    assert next(one.file for one in verify(out).problems) == "letterhead.json"


def test_an_adjusted_survey_alone_comes_out_again_with_its_covariance(tmp_path, job_station):
    results = job_station / "results"
    assert main(["run", str(job_station), "--only", "adjustment", "--no-papers", "--quiet"]) == 0
    found = verify(results)
    assert (found.problems, found.recomputed.different) == ([], 0)
    assert "points_cov.npz" in found.compared
    with np.load(results / "points_cov.npz") as held:
        matrix, points = 1.1 * held["covariance_m2"], held["points"]
    np.savez(results / "points_cov.npz", covariance_m2=matrix, points=points)
    write_sums_again(results)
    codes = [one.expected.code for one in verify(results).problems]
    assert codes == ["verify_covariance_apart"]


@pytest.fixture
def job_station(tmp_path):
    """A small survey by a total station."""
    return write_station(tmp_path / "station")


def test_other_folders_say_what_cannot_be_verified(tmp_path):
    """A comparison: hashes and papers; its tables lie nobody knows where."""
    out = tmp_path / "c"
    write_comparison(plain(), out, "pt-BR")
    found = verify(out)
    assert (found.problems, found.papers_again) == ([], True)
    assert [one.code for one in found.notes] == ["verify_not_from_inputs"]
    (out / "comparison.html").write_bytes(b"x")
    assert [one.file for one in verify(out).problems] == ["comparison.html"]
    (out / "comparison.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError):
        verify(out)


def test_packages_of_the_manifest_are_those_that_make_papers(job):
    """What a run loads is named; a package that makes no paper would tell papers apart in vain."""
    code = f"""
import sys
from tankcal.cli import main
main(["run", {str(job)!r}, "--quiet"])
print(*sys.modules)"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert {name for name in PACKAGES if name != "pypdf"} <= loaded  # a field to sign in: not here
    assert loaded.isdisjoint({"pandas", "nbformat", "nbclient", "ipykernel"})
