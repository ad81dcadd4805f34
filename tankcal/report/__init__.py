"""From the record to paper: executed notebook, certificate, working papers, report, web page.

Nothing here computes a number: the record's values are formatted (docs/report.md).
"""

from pathlib import Path

FILES = ("report.ipynb", "certificate.pdf", "working-papers.pdf", "report.pdf", "report.html")
_PARTS = (("certificate.pdf", "certificate"), ("working-papers.pdf", "working-papers"))


def build(record_path, directory, progress=None):
    """Write the files of FILES into `directory`, from the record alone; give their paths.

    A record without a capacity, of a survey that was only adjusted, has no certificate: it gets
    working papers, notebook and web page.

    record_path   path of a record.json; it is copied beside the notebook when it is not there yet
    progress      called as progress(done, total) while it works

    Raises TankcalError when a cell of the notebook fails or a page cannot be set; then none of the
    files is written.
    """
    import shutil

    import nbformat

    from tankcal import record as records
    from tankcal.report.document import blocks_of
    from tankcal.report.html import page
    from tankcal.report.notebook import execute, joined
    from tankcal.report.pdf import pdf

    directory = Path(directory)
    beside = directory / "record.json"
    if Path(record_path).resolve() != beside.resolve():
        shutil.copyfile(record_path, beside)
    record = records.load(beside)
    notebook = joined(beside.name, [part for part, value in record.items() if not value])
    parts = (*_PARTS, ("report.pdf", "")) if record["capacity"] else _PARTS[1:]
    total = len(notebook.cells) + len(parts) + 2
    tell = progress or (lambda done, total: None)
    execute(notebook, directory, on_cell=lambda done: tell(done, total))

    contents = {"report.ipynb": nbformat.writes(notebook).encode("utf-8")}
    for name, part in parts:
        contents[name] = pdf(blocks_of(notebook, part))
        tell(len(notebook.cells) + len(contents), total)
    contents["report.html"] = page(blocks_of(notebook)).encode("utf-8")
    for name, content in contents.items():
        (directory / name).write_bytes(content)
    tell(total, total)
    return [directory / name for name in contents]
