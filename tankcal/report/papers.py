"""Documents of a notebook: the executed notebook, its PDFs and its web page."""

from pathlib import Path

FILES = (
    *("report.ipynb", "certificate.pdf", "working-papers.pdf", "field-table.pdf"),
    *("report.pdf", "report.html"),
)
WORKERS = 2  # threads that typeset PDFs; the typesetter reuses the layout of earlier PDFs
_NOT_IN_ALL = (  # keys that some kinds of record, or records of earlier versions, do not have
    "top",
    "budgets",
    "deliveries",
    "rule",
    "monte_carlo",
    "homogeneity",
    "strapping",
    "lines",
    "radii",
    "ship",
    "overrulings",
    "limits",
)
_PARTS = (  # name of each PDF and the part of the notebook that it contains
    ("certificate.pdf", "certificate"),
    ("working-papers.pdf", "working-papers"),
    ("field-table.pdf", "field-table"),
    ("report.pdf", ""),
)
# PDFs of a record without a capacity table.
_PARTS_OF_SURVEY = (("working-papers.pdf", "working-papers"),)


def is_certifiable(record):
    """Whether a record may have a certificate: everyday data need a traceable meter."""
    upkeep = record.get("upkeep")
    has_meter = upkeep is None or any(meter["certificate"] for meter in upkeep["meters"])
    return bool(record["capacity"]) and has_meter


def build(record_path, directory, progress=None, language=None, letterhead=None, record=None):
    """Write the report files of a record into a folder and return their paths.

    The record of a survey without a capacity table has no certificate. Its report consists of
    the working papers, the notebook and the web page.

    Parameters
    ----------
    record_path : str or Path
        Path of a record.json; the file is copied into `directory` if it lies elsewhere.
    directory : str or Path
        Folder of the report. The PDFs embed an Excel workbook that lies in this folder.
    progress : callable, optional
        Called as progress(done, total) after each step.
    language : str, optional
        Language of the report; None: the language of the job.
    letterhead : letterhead.Letterhead, optional
        Letterhead of the laboratory.
    record : dict, optional
        The loaded record, if it has been read before.

    Returns
    -------
    list of Path
        Notebook, PDFs and web page.

    Raises
    ------
    TankcalError
        If a cell of the notebook fails or a page cannot be typeset. No file of FILES is written in
        this case.
    """
    from tankcal import record as records
    from tankcal.report.notebook import join_templates
    from tankcal.report.paper import ReadRecord

    directory = Path(directory)
    beside = directory / "record.json"
    record = records.load(record_path) if record is None else record
    if Path(record_path).resolve() != beside.resolve():
        records.copy_record(record, record_path, directory)
    notebook = join_templates(
        beside.name,
        parts_without_content(record),
        LANGUAGE=language,
        LETTERHEAD=letterhead and letterhead.save(directory),
    )
    parts = _PARTS if record["capacity"] else _PARTS_OF_SURVEY
    if not is_certifiable(record):
        parts = tuple(part for part in parts if part[1] != "certificate")
    return write_papers(notebook, directory, parts, progress, RECORD=ReadRecord(beside, record))


def parts_without_content(record):
    """Return the keys of a record without content, also of keys that it lacks (list of str)."""
    from tankcal.methods.base import methods

    of_methods = (method.name for method in methods())
    known = dict.fromkeys((*_NOT_IN_ALL, *of_methods)) | record
    return [part for part, value in known.items() if not value]


def write_papers(notebook, directory, parts, progress=None, **parameters):
    """Execute a notebook in a folder and write the notebook, its PDFs and its web page.

    The typesetting of a PDF starts as soon as the cells of its part have been executed.

    Parameters
    ----------
    notebook : dict
        Notebook of `notebook.join_templates`.
    directory : Path
        Folder of the report.
    parts : sequence of (str, str)
        Name of each PDF and the part of the notebook that it contains. Part "" is the whole
        notebook without the field table. The web page also has this extent.
    progress : callable, optional
        Called as progress(done, total) after each step.
    **parameters
        Parameters of the notebook, as in `notebook.execute`.

    Returns
    -------
    list of Path
        Notebook, PDFs and web page.

    Raises
    ------
    TankcalError
        As `build` does.
    """
    from concurrent.futures import ThreadPoolExecutor
    from contextlib import ExitStack

    from tankcal.report.attachments import Packed
    from tankcal.report.document import BESIDE, blocks_of, last_cell
    from tankcal.report.folders import replace_file
    from tankcal.report.notebook import execute, notebook_text
    from tankcal.report.pdf import pdf
    from tankcal.report.web import page

    cells = len(notebook["cells"])
    total = cells + len(parts) + 2  # cells, PDFs, the notebook file and the web page
    progress = progress or (lambda done, total: None)
    ends = {name: last_cell(notebook, part) for name, part in parts}
    pages, packed = [], Packed()

    def set_pages(name, *arguments):
        files[name].write_bytes(pdf(*arguments))

    def on_cell(done):
        # Start a PDF when the last cell of its part is done.
        for name, part in parts:
            if ends[name] == done:
                is_reused = bool(part) and part not in BESIDE
                blocks = blocks_of(notebook, part)
                pages.append(pool.submit(set_pages, name, blocks, directory, is_reused, packed))
        progress(done, total)

    names = ("report.ipynb", *dict(parts), "report.html")
    with ExitStack() as stack:
        # All files are complete before the first file receives its name.
        files = {name: stack.enter_context(replace_file(directory / name)) for name in names}
        with ThreadPoolExecutor(WORKERS) as pool:  # the typesetter runs outside Python
            execute(notebook, directory, on_cell, **parameters)
            files["report.ipynb"].write_bytes(notebook_text(notebook).encode("utf-8"))
            files["report.html"].write_bytes(page(blocks_of(notebook)).encode("utf-8"))
            for done, setting in enumerate(pages, cells + 3):
                setting.result()
                progress(done, total)
    return [directory / name for name in names]
