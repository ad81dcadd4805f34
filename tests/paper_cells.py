"""Runs the cells of the report's templates in this process: blocks of a paper in a second.

found = paper_blocks(record_path)                 blocks of certificate and working papers
blocks_of_cells(notebook)                         blocks of any notebook
of_part(found, "certificate")                     those of one part
texts(found)                                      every text in them
table_of(found, "Capacity at each height")        rows of the table whose caption begins so
"""

import ast

from tankcal import record as records
from tankcal.report import missing
from tankcal.report.blocks import Block
from tankcal.report.notebook import TEMPLATES, joined


def paper_blocks(record_path, templates=TEMPLATES[:2]):
    """The data of every block that the cells show, in order."""
    lacks = missing(records.load(record_path))
    return blocks_of_cells(joined(str(record_path), lacks, templates))


def of_part(found, part):
    """The blocks of one part: from its document block on to the next."""
    shown, current = [], ""
    for block in found:
        current = block["part"] if block["kind"] == "document" else current
        shown += [block] if current == part else []
    return shown


def blocks_of_cells(notebook):
    """The data of every block that the cells of a notebook show, in order."""
    shown = []
    names = {"display": lambda *found: shown.extend(found)}
    for cell in notebook.cells:
        shown.append(_value_of(cell.source, names))
    return [one.data for one in shown if isinstance(one, Block)]


def _value_of(source, names):
    """Execute a cell; the value of its last line when that is an expression."""
    tree = ast.parse(source)
    last = tree.body[-1] if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(ast.Module(tree.body[: -1 if last else None], []), "cell", "exec"), names)
    return eval(compile(ast.Expression(last.value), "cell", "eval"), names) if last else None


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
