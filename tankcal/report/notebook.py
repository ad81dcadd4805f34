"""The notebook of a report: templates are joined and executed within this process.

A notebook is a dict {"cells": [...], "metadata": {...}, ...} with the structure of its file. The
notebooks of `nbformat` have this structure.
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
# Parameters that name files in the folder of the notebook.
FILES_IN_PARAMETERS = ("RECORD", "LETTERHEAD")
# Exceptions of a record with unexpected content.
BY_VALUES = (LookupError, TypeError, ValueError, AttributeError)
_TEXTS = ("source", "text")  # keys whose texts a notebook file stores as lists of lines


def join_templates(record_name, lacks=(), templates=TEMPLATES, **parameters):
    """Join the templates into a notebook.

    Cells with the tag "parameters" or "setup" are taken from the first template only. A cell with
    the tag "if:courses" is omitted if `lacks` contains "courses".

    Parameters
    ----------
    record_name : str
        File name of the record in the folder of the notebook.
    lacks : collection of str, optional
        Parts of the record without content.
    templates : sequence of str, optional
        Names of the templates.
    **parameters
        Values for other names of the parameters cell.

    Returns
    -------
    dict
        Notebook.

    Raises
    ------
    TankcalError
        For a parameter that the templates do not have.
    """
    folder = shipped_folder("report_templates")
    notebook, *others = (_read(folder / name) for name in templates)
    cells = notebook["cells"]
    for other in others:
        cells += [c for c in other["cells"] if not _tags(c) & {"parameters", "setup"}]
    omitted_tags = {f"if:{part}" for part in lacks}
    notebook["cells"] = [cell for cell in cells if not _tags(cell) & omitted_tags]
    set_parameters(notebook, {"RECORD": record_name, **parameters})
    for number, cell in enumerate(notebook["cells"], 1):
        cell["id"] = f"cell-{number}"
    return notebook


def _read(path):
    notebook = json.loads(path.read_text(encoding="utf-8"))
    for cell in notebook["cells"]:
        cell["source"] = "".join(cell["source"])
    return notebook


def set_parameters(notebook, values):
    """Set values in the cell with the tag "parameters"; other parameters keep their values.

    TankcalError is raised unless there is exactly one such cell, and for an unknown name.
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


def execute(notebook, folder, on_cell=None, **objects):
    """Execute a notebook of `join_templates` in place.

    The templates are part of tankcal and run in this process. The start of a Jupyter kernel would
    take as long as the execution of all cells. A notebook that a user has changed requires Jupyter
    or nbconvert.

    Parameters
    ----------
    notebook : dict
        Notebook; the outputs of its cells are replaced.
    folder : Path
        Folder of the notebook and of the files that it names.
    on_cell : callable, optional
        Called as on_cell(number of executed cells) after each cell.
    **objects
        Objects that replace parameters of the notebook in this process, such as a loaded record.

    Returns
    -------
    dict
        The notebook.

    Raises
    ------
    TankcalError
        If a cell fails; CellError if values of the record are the cause.
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
                names |= _files_beside(names, folder) | objects
            outputs = [_stream(name, text.getvalue()) for name, text in printed.items()]
            outputs += [*shown, _result(value, count)]
            cell["outputs"] = [output for output in outputs if output]
            cell["execution_count"] = count
        if on_cell:
            on_cell(number)
    notebook["metadata"]["language_info"] = {
        "codemirror_mode": {"name": "ipython", "version": sys.version_info.major},
        "file_extension": ".py",
        "mimetype": "text/x-python",
        "name": "python",
        "nbconvert_exporter": "python",
        "pygments_lexer": "ipython3",
        "version": ".".join(map(str, sys.version_info[:3])),
    }
    return notebook


def _run_cell(source, names):
    """Run the statements of a cell; return the value of a final expression, or None."""
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "<cell>", "exec"), names)
    return last and eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)


def _files_beside(names, folder):
    """Return file parameters as full paths, since the process may run in another folder."""
    file_names = {name: names.get(name) for name in FILES_IN_PARAMETERS}
    return {name: str(folder / value) for name, value in file_names.items() if value}


def _display(value):
    return {"output_type": "display_data", "data": _bundle(value), "metadata": {}}


def _result(value, count):
    if value is None:
        return None
    header = {"output_type": "execute_result", "execution_count": count}
    return {**header, "data": _bundle(value), "metadata": {}}


def _stream(name, text):
    return {"output_type": "stream", "name": name, "text": text} if text else None


def _bundle(value):
    """Return the output data that Jupyter would store for a value."""
    if hasattr(value, "_repr_mimebundle_"):
        return value._repr_mimebundle_()
    return {"text/plain": repr(value)}


def notebook_text(notebook):
    """Return the file content of a notebook in the format of `nbformat.writes`."""
    cells = [_split_cell(cell) for cell in notebook["cells"]]
    # Texts become lists of lines; the options are the options of nbformat.
    options = {"ensure_ascii": False, "indent": 1, "sort_keys": True, "separators": (",", ": ")}
    return json.dumps({**notebook, "cells": cells}, **options)


def _split_cell(cell):
    cell_in_lines = {key: _lines(value) if key in _TEXTS else value for key, value in cell.items()}
    if "outputs" in cell:
        cell_in_lines["outputs"] = [_split_output(output) for output in cell["outputs"]]
    return cell_in_lines


def _split_output(output):
    output_in_lines = {
        key: _lines(value) if key in _TEXTS else value for key, value in output.items()
    }
    if "data" in output:
        is_text = {name: not name.endswith("json") for name in output["data"]}
        output_in_lines["data"] = {
            name: _lines(value) if is_text[name] else value
            for name, value in output["data"].items()
        }
    return output_in_lines


def _lines(text):
    return text.splitlines(keepends=True) if isinstance(text, str) else text


def _load_matplotlib():
    """Import matplotlib without its message about a temporary folder for fonts."""
    logger = logging.getLogger("matplotlib")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        import matplotlib  # noqa: F401
    finally:
        logger.setLevel(level)
