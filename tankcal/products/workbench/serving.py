"""Notebook of a job, shown in JupyterLab.

The notebook is written next to the job: a few cells with a line of Python each.
"""

import hashlib
import json
import os
import re
from importlib.util import find_spec

import tankcal
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.workbench.desk import open_job
from tankcal.text.delimited import read_json

HERE = "127.0.0.1"  # address that only this machine can reach
FOLDER_NAME = "tankcal.ipynb"  # file name of the notebook of a job folder
METADATA_KEY = "tankcal"  # key of the metadata with the hash of the written cells


def has_lab():
    """Whether JupyterLab and the widgets of the grids are installed."""
    return all(map(find_spec, ("jupyterlab", "ipywidgets", "anywidget")))


def open_lab(notebook):
    """Show a notebook in JupyterLab, on this machine only, until JupyterLab is stopped."""
    from jupyterlab.labapp import LabApp

    # Set environment variables for kernels; several BLAS threads are slow for small matrices.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("PYDEVD_DISABLE_FILE_VALIDATION", "1")
    arguments = [str(notebook), f"--ServerApp.ip={HERE}", "--ServerApp.answer_yes=True"]
    LabApp.launch_instance(arguments)


def notebook_path(source):
    """Default path of the notebook of a job (a Path)."""
    return source / FOLDER_NAME if source.is_dir() else source.with_suffix(".ipynb")


def make_notebook(source, path, language=None):
    """Build the notebook of a job as plain data (nbformat 4.5).

    Parameters
    ----------
    source : Path
        Folder or workbook of the job.
    path : Path
        Path of the notebook; the path of the job in the notebook is relative to its folder.
    language : str, optional
        Language of the texts; by default the language of the job.

    Returns
    -------
    dict
    """
    desk = open_job(source, language=language, live=False)
    reader = desk.reader
    words = reader.words["workbench"]["notebook"]
    job = _relative_path(source.resolve(), path.resolve().parent)
    name = source.resolve().name
    tank = _escape_markdown(desk.draft.value("tank", "id") or name)
    name = name.replace("`", "'")  # a backquote would end the code in Markdown
    cells = [
        _markdown_cell(
            f"# {words['title'].format(tank=tank)}\n\n{words['about'].format(job=name)}"
        ),
        _code_cell(
            f"# {words['parameters']}\nJOB = {job!r}\nOUT = None\n"
            f"LANGUAGE = {reader.language!r}\nLIVE = None",
            "parameters",
        ),
        _code_cell(
            "from tankcal.products.workbench.desk import open_job\n\n"
            "desk = open_job(JOB, out=OUT, language=LANGUAGE, live=LIVE)\ndesk"
        ),
        *_section(words["settings"], reader.note("job"), "desk.settings"),
    ]
    for name in (*desk.names, *desk.lists):
        cells += _section(reader.title(name), reader.note(name), f"desk.{name}")
    cells += _section(words["further"], "", "desk.more")
    cells += _section(words["problems"], "", "desk.problems")
    cells += _section(words["results"], "", "desk.results")
    for number, cell in enumerate(cells, 1):
        cell["id"] = f"tankcal-{number}"
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    metadata = {
        "kernelspec": kernel,
        "language_info": {"name": "python"},
        METADATA_KEY: {"version": tankcal.__version__, "sha256": _digest(cells)},
    }
    return {"cells": cells, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}


def write_notebook(source, path, language=None):
    """Write the notebook of a job.

    A file of keys that cannot be read is no obstacle, because the notebook shows its problems.

    Parameters
    ----------
    source : Path
        Folder or workbook of the job.
    path : Path
        Path of the notebook.
    language : str, optional
        Language of the texts; by default the language of the job.

    Returns
    -------
    bool
        False if the user has changed an existing notebook, which is then preserved. An existing
        notebook with the same cells is also preserved, with its outputs, and the result is True.

    Raises
    ------
    InputError
        If the path is a file that is no notebook.
    """
    notebook = make_notebook(source, path, language)
    if path.exists():
        existing = _read(path)
        if _digest(existing["cells"]) != existing["metadata"].get(METADATA_KEY, {}).get("sha256"):
            return False
        if _digest(existing["cells"]) == _digest(notebook["cells"]):
            return True
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.part")
    temporary.write_text(
        json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    temporary.replace(path)
    return True


def _read(path):
    """Read an existing notebook; InputError if the file is no notebook."""
    try:
        notebook = read_json(path)
        if isinstance(notebook["cells"], list) and isinstance(notebook["metadata"], dict):
            _digest(notebook["cells"])
            return notebook
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        pass
    expected = message(
        "no_notebook_there", "is no notebook; expected a new name: give another with --out"
    )
    raise InputError(Problem(path.name, expected))


def _relative_path(source, folder):
    """Path of a job, relative to a folder if the job is in the folder, else absolute."""
    if source == folder:
        return "."
    if folder in source.parents:
        return source.relative_to(folder).as_posix()
    return str(source)


def _digest(cells):
    """SHA-256 of the types and sources of cells."""
    sources = [[cell["cell_type"], "".join(cell["source"])] for cell in cells]
    return hashlib.sha256(json.dumps(sources).encode()).hexdigest()


def _escape_markdown(text):
    """Escape a text for Markdown, without backslashes, which may begin a formula."""
    return re.sub(r"[#$&*<>\[\\\]_`|~]", lambda mark: f"&#{ord(mark[0])};", " ".join(text.split()))


def _section(title, note, code):
    """Cells of a section: title with note, and code."""
    return [_markdown_cell(f"## {title}\n\n{note}".rstrip()), _code_cell(code)]


def _markdown_cell(source):
    """Markdown cell."""
    return {"cell_type": "markdown", "id": "", "metadata": {}, "source": source}


def _code_cell(source, *tags):
    """Code cell."""
    return {
        "cell_type": "code",
        "id": "",
        "metadata": {"tags": [*tags]} if tags else {},
        "execution_count": None,
        "outputs": [],
        "source": source,
    }
