"""What a user sees of the camera's analyses: lines in the terminal, a report, tables, JSON.

A result is the dict that `tankcal.record.camera_<kind>.as_json` gives; under "made_from" it
may say what it was made from. Nothing here computes a number.
"""

import json
from importlib import import_module
from pathlib import Path

from tankcal.messages import message
from tankcal.record import manifest
from tankcal.record.camera_versions import KINDS
from tankcal.report import folders
from tankcal.report.camera.paper import CameraPaper, made_from
from tankcal.report.outputs.csv_files import write_rows
from tankcal.report.papers import write_papers
from tankcal.report.terminal import lines_of

__all__ = ["CameraPaper", "lines", "made_from", "refuse_foreign", "write"]

RECORD = "camera.json"
TEMPLATE = "camera.ipynb"
TABLES = (
    "cameras.csv",
    "pairs.csv",
    "parameters.csv",
    "correlations.csv",
    "groups.csv",
    "components.csv",
    "loadings.csv",
    "dropped.csv",
    "advice.csv",
    "runs.csv",
    "check_points.csv",
    "axes.csv",
    "classes.csv",
)
FILES = (RECORD, *TABLES, "report.ipynb", "report.pdf", "report.html", manifest.FILE)


def lines(result, language=None):
    """What is printed in the terminal: lines of text, tables aligned, in a language or English."""
    paper = CameraPaper(result, language)
    return lines_of(_of_kind(result).summary(paper))


def write(result, directory, progress=None, language=None):
    """Write JSON, CSV tables, notebook, PDF and web page of a result, all or nothing.

    directory  made when missing; earlier results of these analyses there are replaced, and a
               folder that holds anything else is refused
    progress   called as progress(text, done, total)
    language   of notebook, PDF and web page, one of languages.LANGUAGES; None: English
    Returns the paths. Raises InputError for a folder that is not tankcal's to replace, and
    TankcalError for a language without words.
    """
    refuse_foreign(directory)
    from tankcal.report.notebook import (
        join_templates,  # not for lines in a terminal: it takes a second
    )

    kind = CameraPaper(result, language).result["kind"]
    progress = progress or (lambda text, done, total: None)
    with folders.replace_folder(directory, language) as temporary:
        text = json.dumps(result, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        (temporary / RECORD).write_text(text + "\n", encoding="utf-8")
        for name, rows in _of_kind(result).tables(result).items():
            if rows:
                write_rows(rows, temporary / name)
        others = [other for other in KINDS if other != kind]
        notebook = join_templates(RECORD, others, (TEMPLATE,), LANGUAGE=language)
        write_papers(
            notebook,
            temporary,
            (("report.pdf", ""),),
            lambda done, total: progress(
                message("camera_writing_report", "writing the report"), done, total
            ),
        )
    return [Path(directory) / name for name in FILES if (Path(directory) / name).exists()]


def refuse_foreign(directory):
    """Raise InputError when `directory` exists and holds anything but results of write()."""
    folders.refuse_foreign(directory, FILES)


def _of_kind(result):
    return import_module(f"tankcal.report.camera.{result['kind']}")
