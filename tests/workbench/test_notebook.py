"""The notebook of a job: what is written, what is kept, and the papers from it without hands."""

import json
import subprocess
import sys
from html import escape
from pathlib import Path

import nbformat
import pytest
from job_builder import write_job, write_workbook
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

import tankcal
from tankcal.cli import main
from tankcal.products.workbench.serving import make_notebook
from tankcal.text.shipped import LANGUAGES

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def folder(tmp_path):
    return write_job(tmp_path / "job", rings=2)


def sources(path):
    return [cell.source for cell in nbformat.read(path, as_version=4).cells]


@pytest.mark.parametrize("language", LANGUAGES)
def test_notebook_is_valid_and_in_the_language(folder, language):
    assert main(["notebook", str(folder), "--no-open", "--language", language]) == 0
    notebook = nbformat.read(folder / "tankcal.ipynb", as_version=4)
    nbformat.validate(notebook)
    (parameters,) = [c for c in notebook.cells if "parameters" in c.metadata.get("tags", [])]
    assert f"LANGUAGE = {language!r}" in parameters.source
    code = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    assert "desk.points" in code
    assert "desk.results" in code
    assert all(len(one.splitlines()) <= 5 for one in code)
    assert tankcal.load(folder)  # the notebook in its folder is no file of the job


@pytest.mark.slow
def test_notebook_of_a_workbook_lies_beside_it(tmp_path):
    book = write_workbook(tmp_path / "T 1.xlsx", rings=2)
    assert main(["notebook", str(book), "--no-open"]) == 0
    assert "JOB = 'T 1.xlsx'" in sources(tmp_path / "T 1.ipynb")[1]


@pytest.mark.parametrize("tank", ["T (7) _a_ 2", "<img src=x>", "`a` *b* [c](d)"])
def test_a_name_is_shown_as_it_is(folder, tank):
    from nbconvert.filters import markdown2html

    path = folder / "job.toml"
    path.write_text(path.read_text().replace('id = "T-1"', f'id = "{tank}"'))
    folder = folder.rename(folder.parent / "j `<b>x`")
    page = markdown2html(make_notebook(folder, folder / "n.ipynb", "en")["cells"][0]["source"])
    assert escape(tank, quote=False) in page.splitlines()[0]
    assert "<code>j '&lt;b&gt;x'</code>" in page


def test_changed_notebook_is_kept(folder, capsys):
    path = folder / "tankcal.ipynb"
    main(["notebook", str(folder), "--no-open"])
    notebook = nbformat.read(path, as_version=4)
    notebook.cells.append(nbformat.v4.new_code_cell("desk.problems[0]"))
    nbformat.write(notebook, path)
    before = path.read_bytes()
    assert main(["notebook", str(folder), "--no-open", "--language", "es"]) == 0
    assert path.read_bytes() == before
    assert "cambió a mano" in capsys.readouterr().out
    assert main(["notebook", str(folder), "--no-open", "--out", str(folder / "new.ipynb")]) == 0
    assert "JOB = '.'" in sources(folder / "new.ipynb")[1]


def test_outputs_of_an_unchanged_notebook_are_kept_and_its_language_may_change(folder):
    path = folder / "tankcal.ipynb"
    main(["notebook", str(folder), "--no-open"])
    notebook = nbformat.read(path, as_version=4)
    notebook.cells[2].execution_count = 7
    nbformat.write(notebook, path)
    main(["notebook", str(folder), "--no-open"])
    assert nbformat.read(path, as_version=4).cells[2].execution_count == 7
    main(["notebook", str(folder), "--no-open", "--language", "pt-BR"])
    assert "Bancada" in sources(path)[0]


def test_job_elsewhere_is_named_in_full(folder, tmp_path):
    made = make_notebook(folder, tmp_path / "elsewhere" / "n.ipynb")
    assert repr(str(folder.resolve())) in made["cells"][1]["source"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["{tmp}/none"], "tankcal new"), (["{tmp}"], "tankcal new"),
        (["{job}", "--out", "{tmp}/a.txt"], ".ipynb"), (["{job}", "--out", "{tmp}"], ".ipynb"),
        (["{job}", "--out", "{tmp}/text.ipynb"], "no notebook"),
        (["{job}", "--out", "{job}/job.toml/n.ipynb"], "job.toml"),
    ],
)  # fmt: skip
def test_bad_arguments_are_told_in_a_line(folder, tmp_path, capsys, arguments, told):
    (tmp_path / "text.ipynb").write_text("[1, 2]")
    given = [one.format(tmp=tmp_path, job=folder) for one in arguments]
    assert main(["notebook", *given, "--no-open"]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1


def test_what_is_not_installed_is_told_in_a_line(folder, capsys, monkeypatch):
    from tankcal.products.workbench import serving

    monkeypatch.setattr(serving, "find_spec", lambda name: None)
    assert main(["notebook", str(folder)]) == 0
    assert "jupyterlab>=" in capsys.readouterr().err


# ---- without hands: the same papers


def same_record(record, job):
    """Is a record that of the job, computed anew by the calls that `tankcal run` makes?

    Loops that are compiled and those that are not differ in the last digits.
    """
    from tankcal.record import record_of, save
    from tankcal.record.recomputation import compare_records

    fresh = record.with_name("fresh.json")
    save(record_of(tankcal.run(tankcal.load(job))), fresh)
    found, wanted = (json.loads(path.read_text(encoding="utf-8")) for path in (record, fresh))
    fresh.unlink()
    return compare_records(wanted, found).agrees


@pytest.mark.slow
def test_nbconvert_writes_the_papers_of_the_job(tmp_path):
    notebook = tmp_path / "silva.ipynb"
    made = make_notebook(EXAMPLES / "silva-1995", notebook)
    made["cells"][1]["source"] += f"\nOUT = {str(tmp_path / 'out')!r}"
    notebook.write_text(json.dumps(made), encoding="utf-8")
    command = ["nbconvert", "--to", "html", "--execute", str(notebook)]
    subprocess.run([sys.executable, "-m", "jupyter", *command], check=True, capture_output=True)
    assert same_record(tmp_path / "out" / "record.json", EXAMPLES / "silva-1995")
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"certificate.pdf", "capacity.xlsx", "report.html"} <= names
    page = (tmp_path / "silva.html").read_text(encoding="utf-8")
    assert "tankcal-plain" in page
    assert "14.93294" in page


@pytest.mark.slow
def test_papermill_writes_the_papers_of_another_job(folder, tmp_path):
    papermill = pytest.importorskip("papermill")
    main(["notebook", str(folder), "--no-open", "--language", "es"])
    job, out = EXAMPLES / "strapping", tmp_path / "out"
    papermill.execute_notebook(
        folder / "tankcal.ipynb",
        tmp_path / "done.ipynb",
        parameters={"JOB": str(job), "OUT": str(out), "LANGUAGE": "pt-BR"},
        progress_bar=False,
    )
    assert same_record(out / "record.json", job)
    assert (out / "certificate.pdf").exists()


def executed(notebook, folder):
    """By a kernel, as nbconvert does it."""
    NotebookClient(notebook, resources={"metadata": {"path": str(folder)}}).execute()


@pytest.mark.slow
def test_a_bad_job_stops_the_notebook(folder):
    main(["notebook", str(folder), "--no-open"])
    courses = folder / "courses.csv"
    courses.write_text(courses.read_text().replace("1.9", "abc", 1))
    notebook = nbformat.read(folder / "tankcal.ipynb", as_version=4)
    with pytest.raises(CellExecutionError, match=r"courses\.csv, row 2, height_m"):
        executed(notebook, folder)
    shown = str([cell.outputs for cell in notebook.cells if cell.cell_type == "code"])
    assert "Traceback" not in shown
    assert not (folder / "results").exists()


@pytest.mark.slow
def test_total_station_is_executed_like_the_others(tmp_path):
    notebook = tmp_path / "n.ipynb"
    made = make_notebook(EXAMPLES / "total-station", notebook, "pt-BR")
    made["cells"][1]["source"] += f"\nOUT = {str(tmp_path / 'out')!r}"
    executed(nbformat.from_dict(made), tmp_path)
    assert same_record(tmp_path / "out" / "record.json", EXAMPLES / "total-station")
