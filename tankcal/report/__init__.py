"""From the record to paper: executed notebook, certificate, working papers, report, web page.

Nothing here computes a number: the record's values are formatted (docs/report.md).
"""

from pathlib import Path

FILES = ("report.ipynb", "certificate.pdf", "working-papers.pdf", "report.pdf", "report.html")


def build(record_path, directory, progress=None):
    """Write the five files of FILES into `directory`, from the record alone; give their paths.

    record_path   path of a record.json; it is copied beside the notebook when it is not there yet
    progress      called as progress(done, total) while it works

    Raises TankcalError when a cell of the notebook fails or a page cannot be set; then none of the
    five files is written.
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
    total = len(notebook.cells) + len(FILES)
    tell = progress or (lambda done, total: None)
    execute(notebook, directory, on_cell=lambda done: tell(done, total))

    contents = {"report.ipynb": nbformat.writes(notebook).encode("utf-8")}
    for name, part in (
        ("certificate.pdf", "certificate"),
        ("working-papers.pdf", "working-papers"),
        ("report.pdf", ""),
    ):
        contents[name] = pdf(blocks_of(notebook, part))
        tell(total - len(FILES) + len(contents), total)
    contents["report.html"] = page(blocks_of(notebook)).encode("utf-8")
    for name, content in contents.items():
        (directory / name).write_bytes(content)
    tell(total, total)
    return [directory / name for name in FILES]
