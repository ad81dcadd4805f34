"""From the record to paper: executed notebook, certificate, working papers, report, web page.

Nothing here computes a number: the record's values are formatted (docs/report.md).
"""

from pathlib import Path

FILES = (
    *("report.ipynb", "certificate.pdf", "working-papers.pdf", "field-table.pdf"),
    *("report.pdf", "report.html"),
)
LETTERHEAD = "letterhead.json"  # there when a letterhead was given
WORKERS = 2  # that set PDFs: each goes on with what the ones before it have in common with it
_NOT_IN_ALL = (
    "top",
    "budgets",
    "deliveries",
    "rule",
    "monte_carlo",
    "homogeneity",
    "strapping",
    "lines",
    "hits",
    "tangents",
    "clouds",
    "liquid",
    "radii",
    "ship",
    "great_circles",
    "overrulings",
)
_PARTS = (
    ("certificate.pdf", "certificate"),
    ("working-papers.pdf", "working-papers"),
    ("field-table.pdf", "field-table"),
    ("report.pdf", ""),
)
_PARTS_OF_SURVEY = (("working-papers.pdf", "working-papers"),)


def build(record_path, directory, progress=None, language=None, letterhead=None, record=None):
    """Write the files of FILES into `directory`, from the record alone; give their paths.

    A record without a capacity, of a survey that was only adjusted, has no certificate: it gets
    working papers, notebook and web page.

    Parameters
    ----------
    record_path
        Path of a record.json; it is copied beside the notebook when it is not there yet.
    directory
        A workbook that lies there, too, is held inside the PDFs.
    progress : optional
        Called as progress(done, total) while it works.
    language : optional
        Of the papers; None: that of the job.
    letterhead : optional
        A letterhead.Letterhead, or None.
    record : optional
        The record as loaded from there, when it is at hand.

    Raises
    ------
    TankcalError
        When a cell of the notebook fails or a page cannot be set; then none of the files is
        written.
    """
    from tankcal import record as records
    from tankcal.report.notebook import joined
    from tankcal.report.paper import ReadRecord

    directory = Path(directory)
    beside = directory / "record.json"
    record = records.load(record_path) if record is None else record
    if Path(record_path).resolve() != beside.resolve():
        records.copy_record(record, record_path, directory)
    notebook = joined(
        beside.name,
        missing(record),
        LANGUAGE=language,
        LETTERHEAD=letterhead and letterhead.save(directory),
    )
    parts = _PARTS if record["capacity"] else _PARTS_OF_SURVEY
    return set_papers(notebook, directory, parts, progress, RECORD=ReadRecord(beside, record))


def missing(record):
    """Names of what a record has nothing of, or, of an earlier version, does not know.

    Parameters
    ----------
    record : dict

    Returns
    -------
    list of str
    """
    known = dict.fromkeys(_NOT_IN_ALL) | record
    return [part for part, value in known.items() if not value]


def set_papers(notebook, directory, parts, progress=None, **handed):
    """Execute a notebook in `directory` and write it there with its PDFs and web page.

    A PDF is set as soon as the cells of its part are done, while the others are executed.

    Gives the paths, and raises, as `build` does.

    Parameters
    ----------
    notebook
        As `notebook.joined` gives it.
    parts : sequence of (str, str)
        Name of each PDF, and the part of the notebook that it is of; part "" is all of it but the
        field table, and so is the web page.
    progress : optional
        Called as progress(done, total) while it works.
    **handed
        Parameters of the notebook, as `notebook.execute` takes them.
    """
    from concurrent.futures import ThreadPoolExecutor

    from tankcal.report.attachments import Packed
    from tankcal.report.document import BESIDE, blocks_of, last_cell
    from tankcal.report.notebook import execute, written
    from tankcal.report.pdf import pdf
    from tankcal.report.web import page

    cells = len(notebook["cells"])
    total = cells + len(parts) + 2
    progress = progress or (lambda done, total: None)
    ends = {name: last_cell(notebook, part) for name, part in parts}
    pages, packed = {}, Packed()

    def on_cell(done):
        for name, part in parts:
            if ends[name] == done:
                again = bool(part) and part not in BESIDE
                pages[name] = pool.submit(pdf, blocks_of(notebook, part), directory, again, packed)
        progress(done, total)

    with ThreadPoolExecutor(WORKERS) as pool:  # the typesetter works outside Python
        execute(notebook, directory, on_cell, **handed)
        contents = {"report.ipynb": written(notebook).encode("utf-8")}
        contents["report.html"] = page(blocks_of(notebook)).encode("utf-8")
        for name, _ in parts:
            contents[name] = pages[name].result()
            progress(cells + len(contents), total)
    for name, content in contents.items():
        (directory / name).write_bytes(content)
    progress(total, total)
    return [directory / name for name in ("report.ipynb", *dict(parts), "report.html")]
