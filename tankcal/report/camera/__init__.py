"""Output of the camera analyses: lines in the terminal, papers, CSV tables and JSON.

A result is the dict of `plain_<kind>` of `tankcal.record.camera_<kind>`, possibly with the key
"made_from". This package computes no number.
"""

import json
from importlib import import_module
from pathlib import Path

from tankcal.messages import message
from tankcal.record import manifest
from tankcal.record.camera_versions import KINDS
from tankcal.report import folders
from tankcal.report.camera.paper import CameraPaper, describe_origin
from tankcal.report.outputs.csv_files import write_rows
from tankcal.report.papers import write_papers
from tankcal.report.terminal import lines_of

__all__ = ["CameraPaper", "describe_origin", "lines", "refuse_foreign", "write"]

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
    """Lines of text for the terminal, with aligned tables, in a language or English."""
    paper = CameraPaper(result, language)
    return lines_of(_load_module(result).summary(paper))


def write(result, directory, progress=None, language=None):
    """Write JSON, CSV tables, notebook, PDF and web page of a result, all or none of them.

    Parameters
    ----------
    result : dict
        Result of an analysis.
    directory : path-like
        Folder, created if missing. Earlier results of these analyses in it are replaced.
    progress : callable, optional
        Called as progress(text, done, total).
    language : str, optional
        Language of notebook, PDF and web page, one of languages.LANGUAGES; by default English.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        If the folder contains other files.
    TankcalError
        If the language has no words.
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
        for name, rows in _load_module(result).tables(result).items():
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
    """Raise InputError if `directory` exists and contains files other than those of write()."""
    folders.refuse_foreign(directory, FILES)


def _load_module(result):
    """Module that presents results of this kind."""
    return import_module(f"tankcal.report.camera.{result['kind']}")
