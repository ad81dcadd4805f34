"""Runs the cells of the report's templates in this process: blocks of a paper in a second.

found = paper_blocks(record_path)                 blocks of certificate and working papers
blocks_of_cells(notebook)                         blocks of any notebook
of_part(found, "certificate")                     those of one part
texts(found)                                      every text in them
table_of(found, "Capacity at each height")        rows of the table whose caption begins so
"""

from pathlib import Path

from tankcal import record as records
from tankcal.report.blocks import MIME
from tankcal.report.notebook import TEMPLATES, execute, join_templates
from tankcal.report.papers import parts_without_content


def paper_blocks(record_path, templates=TEMPLATES[:2]):
    """The data of every block that the cells show, in order."""
    lacks = parts_without_content(records.load(record_path))
    return blocks_of_cells(join_templates(str(record_path), lacks, templates))


def of_part(found, part):
    """The blocks of one part: from its document block on to the next."""
    shown, current = [], ""
    for block in found:
        current = block["part"] if block["kind"] == "document" else current
        shown += [block] if current == part else []
    return shown


def blocks_of_cells(notebook, folder="."):
    """The data of every block that the cells of a notebook show, in order."""
    cells = execute(notebook, Path(folder))["cells"]
    shown = [output["data"] for cell in cells for output in cell["outputs"] if "data" in output]
    return [data[MIME] for data in shown if MIME in data]


def texts(found):
    """Every text in blocks, in order."""
    if isinstance(found, str):
        return [found]
    if isinstance(found, dict):
        found = [value for key, value in found.items() if key != "svg"]
    return [text for one in found if isinstance(one, str | dict | list) for text in texts(one)]


def table_of(found, caption):
    """The rows, as lists of texts, of the table whose caption begins so."""
    (one,) = (block for block in found if block.get("caption", "").startswith(caption))
    return one["rows"]
