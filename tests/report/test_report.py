"""The report, built from the shipped example and from a record that is hard on it."""

import json
import re
import shutil
import subprocess
import sys

import nbformat
import pytest
from nbclient import NotebookClient
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from tankcal.errors import CellError, TankcalError
from tankcal.report import blocks
from tankcal.report import pdf as pdf_of
from tankcal.report.document import PARTS, blocks_of, last_cell
from tankcal.report.markdown import _FUNCTIONS, _GREEK, _OPERATORS, _SPACES, _SYMBOLS
from tankcal.report.notebook import execute, join_templates, notebook_text
from tankcal.report.papers import FILES, build
from tankcal.report.pdf import pdf
from tankcal.report.web import page
from tankcal.text.digits import decimals_of_height, decimals_of_rows, fixed

HARD_TEXT = '#2 [west] *A* _b_ $x$ \\ "q" <b>&amp; </script> @ref `c` //'


@pytest.fixture(scope="module")
def example(example_run):
    """The folder of the example's results."""
    return example_run / "results"


@pytest.fixture(scope="module")
def hard(short_record, tmp_path_factory):
    """A report with text that could be read as markup, no number, k by rows, rejected points."""
    record = json.loads(short_record.read_text(encoding="utf-8"))
    record["job"]["tank"]["details"]["owner"] = HARD_TEXT
    record["job"]["tank"]["id"] = "TK $1$ <i>"
    record["job"]["certificate"] = {"notice": "DRAFT", "laboratory": "Lab & Söhne #1"}
    record["capacity"]["k"][1] = 4.3027
    record["capacity"]["dof"][1] = 2.0
    record["sections"][0]["section"] = "ring $a_1$ #"
    point = {"x_m": 1.0, "y_m": 2.0, "z_m": 3.0, "residual_m": -0.25, "w": None, "row": 7}
    record["rejected"] = [
        {"point": "$stair$", "reason": reason, **point} for reason in ("consensus", "same_place")
    ]
    place = {"file": "points.csv", "row": None, "column": None}
    record["warnings"] = [{**place, "text": HARD_TEXT, "code": None, "values": {}}]
    folder = tmp_path_factory.mktemp("hard")
    path = folder / "record.json"
    path.write_text(json.dumps(record), encoding="utf-8")
    build(path, folder)
    return folder


def pages(path):
    """The text of each page of a PDF, by poppler, lines joined by single spaces."""
    if not shutil.which("pdftotext"):
        pytest.skip("pdftotext (poppler) is not on this machine")
    made = subprocess.run(
        ["pdftotext", "-layout", str(path), "-"], capture_output=True, check=True, encoding="utf-8"
    )
    return [re.sub(r"\s+", " ", text) for text in made.stdout.split("\f")[:-1]]


def test_all_files_are_there(example):
    assert {path.name for path in example.iterdir()} > {*FILES, "record.json"}


@pytest.mark.slow
def test_every_page_has_notice_and_number(example):
    for name in ("certificate.pdf", "working-papers.pdf", "report.pdf"):
        texts = pages(example / name)
        for number, text in enumerate(texts, 1):
            assert "RECONSTRUCTION" in text
            assert "Tank SILVA-1995" in text
            assert f"Page {number} of {len(texts)}" in text


@pytest.mark.slow
def test_report_is_certificate_and_working_papers(example):
    counts = {name: len(pages(example / f"{name}.pdf")) for name in (
        "certificate", "working-papers", "report")}  # fmt: skip
    assert counts["report"] == counts["certificate"] + counts["working-papers"]
    assert counts["certificate"] <= 8


def test_certificate_has_required_statements(example):
    texts = pages(example / "certificate.pdf")
    whole = " ".join(texts)
    for words in (
        "Certificate No. RECONSTRUCTION-1", "coverage probability 95 %", "Assumptions",
        "Authorised by", "reproduced only in full", "Capacity table",
    ):  # fmt: skip
        assert words in whole
    assert "End of certificate" in texts[-1]
    assert whole.count("End of certificate") == 1
    assert "Working papers" not in whole


def test_main_result_has_volume_uncertainty_and_k(example):
    capacity = json.loads((example / "record.json").read_text())["capacity"]
    volume, expanded, k = (capacity[key][-1] for key in ("volume_m3", "U_m3", "k"))
    assert 1 < expanded < 10  # two significant digits are then one decimal
    assert f"V = {volume:.1f} m³ with U = {expanded:.1f} m³ (k = {k:.2f}, coverage" in " ".join(
        pages(example / "certificate.pdf")
    )


def test_every_row_of_the_capacity_table_is_printed(example):
    """Second method: the rows are read back from the PDF's text."""
    capacity = json.loads((example / "record.json").read_text())["capacity"]
    printed = set(
        re.findall(r"(\d+\.\d{3,5}) (\d+\.\d+) (\d\.\d+)(?= |$)", " ".join(
            pages(example / "certificate.pdf")))
    )  # fmt: skip
    rows = zip(capacity["height_m"], capacity["volume_m3"], capacity["U_m3"], strict=True)
    assert len(capacity["height_m"]) == 951
    of_rows = decimals_of_rows(capacity["U_m3"])
    for (height, volume, expanded), decimals in zip(rows, of_rows, strict=True):
        litres = max(decimals, 3)
        row = (fixed(height, decimals_of_height(height)), fixed(volume, litres))
        assert (*row, fixed(expanded, decimals)) in printed


def test_headings_of_the_capacity_table_repeat_on_its_pages(example):
    texts = pages(example / "certificate.pdf")
    long = [text for text in texts if len(re.findall(r"\d\.\d\d0 \d+\.\d{3} \d\.\d", text)) > 60]
    assert len(long) >= 3
    for text in long:
        assert re.search(r"Height Volume U", text)


@pytest.mark.slow
def test_text_is_never_markup_in_the_pdf(hard):
    certificate = " ".join(pages(hard / "certificate.pdf"))
    papers = " ".join(pages(hard / "working-papers.pdf"))
    assert HARD_TEXT in certificate
    assert HARD_TEXT in papers
    assert "Tank TK $1$ <i>" in certificate
    assert "ring $a_1$ #" in papers
    assert papers.count("$stair$") == 2


@pytest.mark.slow
def test_text_is_never_markup_in_the_html(hard):
    text = (hard / "report.html").read_text(encoding="utf-8")
    assert text.count("</script>") == text.count("<script") == 5  # words, data, their script
    assert "<i>" not in text
    assert "&lt;b&gt;&amp;amp; &lt;/script&gt;" in text


@pytest.mark.slow
def test_html_makes_no_network_request(hard):
    text = (hard / "report.html").read_text(encoding="utf-8")
    assert re.findall(r'(?:src|href|action)="(?!data:|#)', text) == []
    assert "url(" not in text
    assert "@import" not in text
    assert "default-src 'none'" in text


@pytest.mark.slow
def test_certificate_without_number_has_none(hard):
    first = pages(hard / "certificate.pdf")[0]
    assert first.startswith("Certificate No. ____________________ DRAFT")
    assert re.search(r"Certificate No\. (Address|Customer)", first)
    assert "DRAFT" in first
    assert "Lab & Söhne #1" in first


@pytest.mark.slow
def test_k_by_rows_is_a_column(hard, example):
    assert "m m³ m³ k" in " ".join(pages(hard / "certificate.pdf"))
    assert re.search(r"0\.250 \d+\.\d{3} \d\.\d+ 4\.30", " ".join(pages(hard / "certificate.pdf")))
    assert "with k = 1.96 in every row without a mark" in " ".join(
        pages(example / "certificate.pdf")
    )


@pytest.mark.slow
def test_document_properties(hard):
    if not shutil.which("pdfinfo"):
        pytest.skip("pdfinfo (poppler) is not on this machine")
    made = subprocess.run(
        ["pdfinfo", str(hard / "certificate.pdf")], capture_output=True, text=True, check=True
    )
    assert re.search(r"Author: +Lab & Söhne #1\n", made.stdout)
    assert re.search(r"Title: +Calibration certificate, Tank TK \$1\$ <i>\n", made.stdout)
    assert re.search(r"CreationDate: .*Jun 30 .*1995", made.stdout)  # the survey's date
    assert re.search(r"Page size: .*A4", made.stdout)


@pytest.mark.study
def test_a_kernel_makes_the_same_report_to_the_byte(example):
    """Second method: nbclient with a kernel of its own, as a user's Jupyter would execute it."""
    notebook = nbformat.read(example / "report.ipynb", as_version=4)
    before = nbformat.writes(notebook)
    for cell in notebook.cells:
        cell.outputs, cell.execution_count = [], None
    del notebook.metadata["language_info"]
    NotebookClient(notebook, resources={"metadata": {"path": str(example)}}).execute()
    for cell in notebook.cells:
        del cell.metadata["execution"]  # clock times
    nbformat.validate(notebook)
    assert nbformat.writes(notebook) == before == (example / "report.ipynb").read_text("utf-8")
    assert pdf(blocks_of(notebook), example) == (example / "report.pdf").read_bytes()
    assert page(blocks_of(notebook)) == (example / "report.html").read_text(encoding="utf-8")


@pytest.mark.study
@pytest.mark.parametrize("target", ["tankcal-pdf", "tankcal-html"])
def test_nbconvert_makes_the_same_file(example, tmp_path, target):
    command = [sys.executable, "-m", "nbconvert", "--to", target, "--output-dir", str(tmp_path)]
    subprocess.run([*command, str(example / "report.ipynb")], check=True, capture_output=True)
    (made,) = tmp_path.iterdir()
    assert made.read_bytes() == (example / made.name).read_bytes()


@pytest.mark.slow
def test_nbconvert_takes_one_part(example, tmp_path):
    from tankcal.report.exporter import PdfExporter

    content, resources = PdfExporter(part="certificate").from_filename(
        str(example / "report.ipynb")
    )
    assert resources["output_extension"] == ".pdf"
    assert content == (example / "certificate.pdf").read_bytes()


def test_unknown_part_is_an_error(example):
    notebook = nbformat.read(example / "report.ipynb", as_version=4)
    with pytest.raises(TankcalError, match=r"part 'front' is not known.*certificate"):
        blocks_of(notebook, "front")


def test_part_that_is_absent_is_an_error():
    notebook = new_notebook(cells=[new_markdown_cell("text", metadata={"tags": ["certificate"]})])
    with pytest.raises(TankcalError, match="nothing to show that is tagged 'working-papers'"):
        blocks_of(notebook, "working-papers")


def test_an_untagged_cell_belongs_with_the_cell_before_it():
    notebook = new_notebook(
        cells=[
            new_markdown_cell("first", metadata={"tags": ["certificate"]}),
            new_markdown_cell("my own"),
            new_markdown_cell("last", metadata={"tags": ["working-papers"]}),
        ]
    )
    assert len(blocks_of(notebook, "certificate")) == 3  # the document itself, and two texts
    assert len(blocks_of(notebook, "working-papers")) == 2


@pytest.mark.slow
def notebook_of(*sources):
    cells = [
        {"cell_type": "code", "id": f"cell-{number}", "metadata": {}, "source": source}
        for number, source in enumerate(sources, 1)
    ]
    return {"cells": cells, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}


def test_failing_cell_stops_the_report_by_name(tmp_path):
    with pytest.raises(TankcalError, match=r"cell 2 \(1 / 0\): ZeroDivisionError"):
        execute(notebook_of("x = 1", "1 / 0"), tmp_path)


@pytest.mark.parametrize(("source", "kind"), [("None + 1", CellError), ("1 / 0", TankcalError)])
def test_what_stopped_a_cell(source, kind, tmp_path):
    """Values of another kind than a record has, or anything else."""
    with pytest.raises(TankcalError) as told:
        execute(notebook_of(source), tmp_path)
    assert type(told.value) is kind


def test_cells_take_what_is_handed_to_them(tmp_path):
    """A parameter that is read already is not read again; the notebook says what it said."""
    notebook = notebook_of("RECORD = 'record.json'", "RECORD['a']")
    notebook["cells"][0]["metadata"] = {"tags": ["parameters"]}
    execute(notebook, tmp_path, RECORD={"a": 5})
    assert notebook["cells"][1]["outputs"][0]["data"] == {"text/plain": "5"}
    assert notebook["cells"][0]["source"] == "RECORD = 'record.json'"


@pytest.mark.slow
def test_the_record_at_hand_is_not_read_again(short_record, tmp_path, monkeypatch):
    """Property: the papers are those of the file to the byte."""
    build(short_record, tmp_path)
    read = {name: (tmp_path / name).read_bytes() for name in FILES}
    record = json.loads((tmp_path / "record.json").read_text(encoding="utf-8"))
    monkeypatch.setattr("tankcal.report.paper.load", None)
    build(tmp_path / "record.json", tmp_path, record=record)
    assert {name: (tmp_path / name).read_bytes() for name in FILES} == read


def test_last_cell_of_a_part():
    cells = [new_markdown_cell(tag, metadata={"tags": [tag]}) for tag in PARTS]
    notebook = new_notebook(cells=[cells[0], new_markdown_cell("my own"), *cells[1:]])
    assert [last_cell(notebook, part) for part in ("", *PARTS)] == [3, 2, 3, 4]


def test_cells_share_their_names_and_show_what_jupyter_would(tmp_path):
    done = []
    notebook = notebook_of("x = 20\ndisplay(1, x)\nprint('said')\nx + 1", "x = None", "x", "")
    execute(notebook, tmp_path, on_cell=done.append)
    assert done == [1, 2, 3, 4]
    said, one, twenty, last = notebook["cells"][0]["outputs"]
    assert (said["name"], said["text"]) == ("stdout", "said\n")
    assert [shown["data"]["text/plain"] for shown in (one, twenty, last)] == ["1", "20", "21"]
    assert (last["output_type"], last["execution_count"]) == ("execute_result", 1)
    assert [cell["outputs"] for cell in notebook["cells"][1:]] == [[], [], []]
    read = nbformat.reads(notebook_text(notebook), as_version=4)
    assert nbformat.writes(read) == notebook_text(notebook)


@pytest.mark.slow
def test_broken_record_writes_nothing(example_record, tmp_path):
    record = json.loads(example_record.read_text(encoding="utf-8"))
    del record["shell"]["tilt"]
    path = tmp_path / "record.json"
    path.write_text(json.dumps(record), encoding="utf-8")
    with pytest.raises(TankcalError, match=r"without shell\.tilt"):
        build(path, tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["record.json"]


def test_error_output_in_a_notebook_is_refused():
    error = new_output("error", ename="ValueError", evalue="bad", traceback=[])
    notebook = new_notebook(cells=[new_code_cell("f()", outputs=[error])])
    with pytest.raises(TankcalError, match="cell 1 of the notebook failed: ValueError: bad"):
        blocks_of(notebook)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"kind": "poem"}, "unknown kind: 'poem'"),
        ("text", "unknown kind: None"),
        ({"kind": "heading", "text": "x"}, "its heading lacks level"),
    ],
)
def test_block_of_another_make_is_refused(data, message):
    output = new_output("display_data", data={blocks.MIME: data})
    notebook = new_notebook(cells=[new_code_cell("x", outputs=[output])])
    with pytest.raises(TankcalError, match=message):
        blocks_of(notebook)


def test_notebook_of_ones_own_can_be_printed(tmp_path):
    """Markdown with mathematics, printed text, a plain result and a block, without a document."""
    notebook = new_notebook(
        cells=[
            new_markdown_cell("### My *check* of $u^2$\n\n- one\n- two `#x`\n\n$$V=\\frac{a}{b}$$"),
            new_code_cell("print('#[printed] $')", outputs=[
                new_output("stream", name="stdout", text="#[printed] $\n")]),
            new_code_cell("1", outputs=[
                new_output("execute_result", data={"text/plain": "{'a': 1}"}, execution_count=1)]),
            new_markdown_cell("|a|b|\n|-|-:|\n|x_1|2|\n\n> quoted\n\n[t](https://example.org)"),
        ]
    )  # fmt: skip
    found = blocks_of(notebook, name="mine")
    path = tmp_path / "mine.pdf"
    path.write_bytes(pdf(found))
    (text,) = pages(path)
    for words in ("My check of", "• one", "two #x", "#[printed] $", "{'a': 1}", "x_1", "quoted"):
        assert words in text
    assert "<title>mine</title>" in page(found)
    assert "<mfrac>" in page(found)


def test_all_of_the_mathematics_can_be_set(tmp_path):
    macros = [*_GREEK, *_SYMBOLS, *_FUNCTIONS, *_SPACES]
    source = " ".join(f"\\{macro} {{}}" for macro in macros)
    source += r" \sqrt{2}\bar{x}\hat{y}\frac{a}{b}x_1^2\text{a-b}\mathrm{d}" + _OPERATORS
    found = blocks_of(new_notebook(cells=[new_markdown_cell(f"$$\n{source}\n$$")]))
    assert found[1]["nodes"][0]["t"] == "math"
    assert pdf(found).startswith(b"%PDF")


def test_importing_the_report_loads_nothing_heavy():
    source = "import sys, tankcal.report; print(*sys.modules)"
    made = subprocess.run(
        [sys.executable, "-c", source], capture_output=True, text=True, check=True
    )
    loaded = set(made.stdout.split())
    assert "tankcal.report" in loaded
    assert loaded.isdisjoint({"numpy", "matplotlib", "nbformat", "nbclient", "nbconvert", "typst"})


def test_a_sign_that_no_font_has_is_an_error_not_a_box():
    found = [
        blocks.document(title="t").data,
        blocks.paragraph("\U0001f9ff\U00012345\U000e0100").data,
    ]
    with pytest.raises(TankcalError, match="could not be displayed"):
        pdf(found)


def test_templates_have_no_outputs_and_one_parameters_cell():
    notebook = join_templates("record.json")
    assert all(cell["outputs"] == [] for cell in notebook["cells"])
    assert notebook["cells"][0]["source"] == (
        "RECORD = 'record.json'\nLANGUAGE = None\nLETTERHEAD = None"
    )
    assert sum("setup" in cell["metadata"]["tags"] for cell in notebook["cells"]) == 1


@pytest.mark.parametrize(("rows", "again", "forgets"), [(4, False, 1), (4, True, 0), (3, False, 0)])
def test_what_is_kept_of_a_long_table_is_forgotten(rows, again, forgets, monkeypatch):
    """Unless a later document has it again."""
    done = []
    monkeypatch.setattr(pdf_of, "LONG", 3)
    monkeypatch.setattr(pdf_of, "_compile", lambda files, timestamp: b"%PDF")
    monkeypatch.setattr(pdf_of, "_discard_cache", lambda: done.append("forgot"))
    table = blocks.table(["a"], [["1"]] * rows).data
    assert pdf_of.pdf([blocks.document(title="t").data, table], again=again) == b"%PDF"
    assert len(done) == forgets
