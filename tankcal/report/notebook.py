"""The report's notebook: the templates joined, and executed within this process.

A notebook is plain data here, {"cells": [...], "metadata": {...}, ...} as its file has it; one that
`nbformat` read is such data, too.
"""

import ast
import io
import json
import logging
import sys
from contextlib import redirect_stderr, redirect_stdout

from tankcal.errors import CellError, TankcalError, VocabularyError
from tankcal.text.shipped import shipped_folder

TEMPLATES = ("certificate.ipynb", "working_papers.ipynb", "field_table.ipynb")
FILES_IN_PARAMETERS = ("RECORD", "LETTERHEAD")  # they lie in the folder of the notebook
BY_VALUES = (LookupError, TypeError, ValueError, AttributeError)  # a record holds something else
_TEXTS = ("source", "text")


def joined(record_name, lacks=(), templates=TEMPLATES, **parameters):
    """One notebook from the shipped templates, to be kept beside the record of that name.

    parameters   other names of the templates' parameters cell, and their values

    Cells tagged "parameters" or "setup" are taken from the first template only. A cell tagged
    "if:courses" is left out when "courses" is among `lacks`, what the record has nothing of.

    Raises TankcalError for a parameter that the templates do not have.
    """
    folder = shipped_folder("report_templates")
    whole, *others = (_read(folder / name) for name in templates)
    cells = whole["cells"]
    for other in others:
        cells += [c for c in other["cells"] if not _tags(c) & {"parameters", "setup"}]
    unneeded = {f"if:{part}" for part in lacks}
    whole["cells"] = [cell for cell in cells if not _tags(cell) & unneeded]
    set_parameters(whole, {"RECORD": record_name, **parameters})
    for number, cell in enumerate(whole["cells"], 1):
        cell["id"] = f"cell-{number}"
    return whole


def _read(path):
    notebook = json.loads(path.read_text(encoding="utf-8"))
    for cell in notebook["cells"]:
        cell["source"] = "".join(cell["source"])
    return notebook


def set_parameters(notebook, values):
    """Give the names in the cell tagged "parameters" their values; those not named keep theirs.

    Raises TankcalError when there is not one such cell, or when it has no such name.
    """
    cells = [cell for cell in notebook["cells"] if "parameters" in _tags(cell)]
    if len(cells) != 1:
        raise TankcalError(f"the notebook has {len(cells)} parameters cells, not one")
    known = {
        statement.targets[0].id: ast.literal_eval(statement.value)
        for statement in ast.parse(cells[0]["source"]).body
    }
    unknown = sorted(set(values) - set(known))
    if unknown:
        raise TankcalError(
            f"the notebook has no parameter {', '.join(unknown)}; it has: {', '.join(known)}"
        )
    lines = (f"{name} = {value!r}" for name, value in (known | values).items())
    cells[0]["source"] = "\n".join(lines)


def _tags(cell):
    return set(cell["metadata"].get("tags", []))


def execute(notebook, folder, on_cell=None, **handed):
    """Execute a notebook of `joined` in place, as Jupyter would; `folder` is where it will lie.

    on_cell   called with the number of cells done, after each
    handed    names of the parameters cell, and what they are in this process in place of what the
              notebook says: a file that has been read

    The templates are our own code: they run in this process, without a kernel, which takes as long
    to start as all of their cells to run. A notebook that somebody changed is a matter for Jupyter
    or nbconvert. Raises TankcalError naming the cell that failed, CellError where values made it.
    """
    _load_matplotlib()
    shown = []
    names = {"__name__": "__main__", "display": lambda *values: shown.extend(map(_display, values))}
    count = 0
    for number, cell in enumerate(notebook["cells"], 1):
        if cell["cell_type"] == "code":
            count += 1
            shown.clear()
            printed = {"stdout": io.StringIO(), "stderr": io.StringIO()}
            try:
                with redirect_stdout(printed["stdout"]), redirect_stderr(printed["stderr"]):
                    value = _run_cell(cell["source"], names)
            except VocabularyError:
                raise
            except Exception as error:
                first_line = (cell["source"].strip().splitlines() or [""])[0]
                kind = CellError if isinstance(error, BY_VALUES) else TankcalError
                raise kind(
                    f"the report stopped in cell {number} ({first_line}): "
                    f"{type(error).__name__}: {error}"
                ) from error
            if "parameters" in _tags(cell):
                names |= _files_beside(names, folder) | handed
            outputs = [_stream(name, text.getvalue()) for name, text in printed.items()]
            outputs += [*shown, _result(value, count)]
            cell["outputs"] = [output for output in outputs if output]
            cell["execution_count"] = count
        if on_cell:
            on_cell(number)
    notebook["metadata"]["language_info"] = _language_info()
    return notebook


def _run_cell(source, names):
    """Run the statements of a cell; the value of its last line where that is an expression."""
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "<cell>", "exec"), names)
    return last and eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)


def _files_beside(names, folder):
    """The parameters that name files, with their paths: this process has a folder of its own."""
    found = {name: names.get(name) for name in FILES_IN_PARAMETERS}
    return {name: str(folder / value) for name, value in found.items() if value}


def _display(value):
    return {"output_type": "display_data", "data": _bundle(value), "metadata": {}}


def _result(value, count):
    if value is None:
        return None
    of = {"output_type": "execute_result", "execution_count": count}
    return {**of, "data": _bundle(value), "metadata": {}}


def _stream(name, text):
    return {"output_type": "stream", "name": name, "text": text} if text else None


def _bundle(value):
    """What Jupyter would keep of a value: the forms of a block, the text of anything else."""
    if hasattr(value, "_repr_mimebundle_"):
        return value._repr_mimebundle_()
    return {"text/plain": repr(value)}


def _language_info():
    """What a kernel of this Python says of its language."""
    return {
        "codemirror_mode": {"name": "ipython", "version": sys.version_info.major},
        "file_extension": ".py",
        "mimetype": "text/x-python",
        "name": "python",
        "nbconvert_exporter": "python",
        "pygments_lexer": "ipython3",
        "version": ".".join(map(str, sys.version_info[:3])),
    }


def written(notebook):
    """The file of a notebook, as `nbformat.writes` makes it: long texts are lists of lines."""
    cells = [_in_lines(cell) for cell in notebook["cells"]]
    text = {"ensure_ascii": False, "indent": 1, "sort_keys": True, "separators": (",", ": ")}
    return json.dumps({**notebook, "cells": cells}, **text)


def _in_lines(cell):
    made = {key: _lines(value) if key in _TEXTS else value for key, value in cell.items()}
    if "outputs" in cell:
        made["outputs"] = [_output_in_lines(output) for output in cell["outputs"]]
    return made


def _output_in_lines(output):
    made = {key: _lines(value) if key in _TEXTS else value for key, value in output.items()}
    if "data" in output:
        of_text = {name: not name.endswith("json") for name in output["data"]}
        made["data"] = {
            name: _lines(value) if of_text[name] else value
            for name, value in output["data"].items()
        }
    return made


def _lines(text):
    return text.splitlines(keepends=True) if isinstance(text, str) else text


def _load_matplotlib():
    """Load it without the remark that it made a temporary folder for its fonts."""
    logger = logging.getLogger("matplotlib")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        import matplotlib  # noqa: F401
    finally:
        logger.setLevel(level)
