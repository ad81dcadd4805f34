"""The notebook of a job: few cells, a line of Python each; it is written beside the job."""

import hashlib
import json
import re

import tankcal
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.text.decoding import read_json
from tankcal.workbench.desk import open_job

FOLDER_NAME = "tankcal.ipynb"
OURS = "tankcal"  # of the metadata: which cells we wrote


def notebook_path(source):
    """Where the notebook of a job (a Path) goes when nobody says where."""
    return source / FOLDER_NAME if source.is_dir() else source.with_suffix(".ipynb")


def make_notebook(source, path, language=None):
    """The notebook of a job as plain data (nbformat 4.5).

    Parameters
    ----------
    source : Path
        Folder or workbook.
    path : Path
        Where the notebook is to lie: JOB is counted from there.
    language : str, optional
        None: that of the job.
    """
    desk = open_job(source, language=language, live=False)
    reader = desk.reader
    words = reader.words["workbench"]["notebook"]
    job = _counted_from(source.resolve(), path.resolve().parent)
    name = source.resolve().name
    tank = _plain(desk.draft.value("tank", "id") or name)
    name = name.replace("`", "'")  # which would end the code that it stands in
    cells = [
        _text(f"# {words['title'].format(tank=tank)}\n\n{words['about'].format(job=name)}"),
        _code(
            f"# {words['parameters']}\nJOB = {job!r}\nOUT = None\n"
            f"LANGUAGE = {reader.language!r}\nLIVE = None",
            "parameters",
        ),
        _code(
            "from tankcal.workbench import open_job\n\n"
            "desk = open_job(JOB, out=OUT, language=LANGUAGE, live=LIVE)\ndesk"
        ),
        *_part(words["settings"], reader.note("job"), "desk.settings"),
    ]
    for name in (*desk.names, *desk.lists):
        cells += _part(reader.title(name), reader.note(name), f"desk.{name}")
    cells += _part(words["further"], "", "desk.more")
    cells += _part(words["problems"], "", "desk.problems")
    cells += _part(words["results"], "", "desk.results")
    for number, cell in enumerate(cells, 1):
        cell["id"] = f"tankcal-{number}"
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    metadata = {
        "kernelspec": kernel,
        "language_info": {"name": "python"},
        OURS: {"version": tankcal.__version__, "sha256": _digest(cells)},
    }
    return {"cells": cells, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}


def write_notebook(source, path, language=None):
    """Write the notebook of a job; returns whether it was written.

    A file of keys that cannot be read does not prevent it: the notebook shows what is wrong.

    One that somebody changed is left as it is (False); so is one of the same cells, whose outputs
    stay. Any other file of that name is refused (InputError).
    """
    made = make_notebook(source, path, language)
    if path.exists():
        there = _read(path)
        if _digest(there["cells"]) != there["metadata"].get(OURS, {}).get("sha256"):
            return False
        if _digest(there["cells"]) == _digest(made["cells"]):
            return True
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.part")
    temporary.write_text(json.dumps(made, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    temporary.replace(path)
    return True


def _read(path):
    """The notebook that lies there; InputError for what is none."""
    try:
        found = read_json(path)
        if isinstance(found["cells"], list) and isinstance(found["metadata"], dict):
            _digest(found["cells"])
            return found
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        pass
    expected = message(
        "no_notebook_there", "is no notebook; expected a new name: give another with --out"
    )
    raise InputError(Problem(path.name, expected))


def _counted_from(source, folder):
    """The path of a job from a folder: short where the job is there or below, else in full."""
    if source == folder:
        return "."
    if folder in source.parents:
        return source.relative_to(folder).as_posix()
    return str(source)


def _digest(cells):
    sources = [[one["cell_type"], "".join(one["source"])] for one in cells]
    return hashlib.sha256(json.dumps(sources).encode()).hexdigest()


def _plain(text):
    """A text as Markdown that shows it as it is; no backslashes, for some begin a formula."""
    return re.sub(r"[#$&*<>\[\\\]_`|~]", lambda mark: f"&#{ord(mark[0])};", " ".join(text.split()))


def _part(title, note, code):
    return [_text(f"## {title}\n\n{note}".rstrip()), _code(code)]


def _text(source):
    return {"cell_type": "markdown", "id": "", "metadata": {}, "source": source}


def _code(source, *tags):
    return {
        "cell_type": "code",
        "id": "",
        "metadata": {"tags": [*tags]} if tags else {},
        "execution_count": None,
        "outputs": [],
        "source": source,
    }
