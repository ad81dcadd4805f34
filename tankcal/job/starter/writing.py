"""Where a starter job goes: a new folder, or one workbook that did not exist."""

from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.job.starter.book import write_book
from tankcal.job.starter.form import Form
from tankcal.job.starter.text_files import csv_text, register_text, settings_text
from tankcal.job.tables import SETTINGS_FILE
from tankcal.messages import message
from tankcal.text.languages import DEFAULT

WORKBOOK_FILE = "job.xlsx"


def write_starter(directory, kind="vertical", survey=None, language=DEFAULT):
    """Write the starter job of a kind of tank into `directory`, made when it does not exist.

    kind      "vertical", "horizontal", "sphere" or "mesh"; only what it can use is written
    survey    "photos" or "total-station": its files in place of the points; None: points
    language  of the papers that the job asks for, and of the workbook's explanations

    Raises InputError when the directory holds something already or cannot be written, ValueError
    for another kind, another survey, or a survey of a mesh.
    """
    write_form(directory, Form(kind, survey, language))


def write_form(directory, form):
    """Write the job of a Form into `directory`, text files and workbook; InputError as above."""
    directory = Path(directory)
    try:
        _make_empty(directory)
        (directory / SETTINGS_FILE).write_text(settings_text(form), encoding="utf-8")
        for table in form.tables:
            (directory / f"{table}.csv").write_text(csv_text(table, form), encoding="utf-8")
        for register in form.registers:
            path = directory / f"{register}.toml"
            path.write_text(register_text(register, form), encoding="utf-8")
        write_book(directory / WORKBOOK_FILE, form)
    except OSError as error:
        raise _unwritten(directory, error) from error


def write_input_workbook(path, kind="vertical", survey=None, language=DEFAULT):
    """Write the starter job as a workbook alone; returns its Path.

    path  of a workbook (.xlsx) that does not exist yet, or of a folder: job.xlsx in it

    The rest as `write_starter` has it.
    """
    form, path = Form(kind, survey, language), Path(path)
    try:
        if path.suffix.lower() != ".xlsx":
            _make_empty(path)
            path = path / WORKBOOK_FILE
        elif path.exists():
            raise InputError(
                Problem(
                    path.name,
                    message("workbook_exists", "exists; expected the name of a new workbook"),
                )
            )
        path.parent.mkdir(parents=True, exist_ok=True)
        write_book(path, form)
    except OSError as error:
        raise _unwritten(path, error) from error
    return path


def _make_empty(directory):
    if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
        found = "is not empty" if directory.is_dir() else "is a file"
        raise InputError(Problem(directory.name, f"{found}; expected a new or empty directory"))
    directory.mkdir(parents=True, exist_ok=True)


def _unwritten(path, error):
    return InputError(
        Problem(
            path.name,
            message("file_unwritten", "cannot be written ({reason})", reason=error.strerror),
        )
    )
