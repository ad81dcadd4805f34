"""Spoilt jobs: written in either form, and the places that their problems must name."""

import pytest
from job_builder import toml_text, write_book, write_folder
from messages_told import lines

from tankcal.errors import InputError
from tankcal.job import load

FORMS = ("folder", "workbook")


def write(tmp_path, parts, form):
    """Write Parts as a "folder" or a "workbook"; returns its path."""
    if form == "folder":
        return write_folder(tmp_path / "job", parts)
    return write_book(tmp_path / "job.xlsx", parts)


def problems_of(path):
    """The problems of a job, which must have some, each with the code that others say it by."""
    with pytest.raises(InputError) as caught:
        load(path)
    lines(caught.value.problems)
    return caught.value.problems


def places(problems):
    """(file, row, column) of each problem."""
    return [(problem.file, problem.row, problem.column) for problem in problems]


def table_file(form, table):
    """What messages call a table."""
    return f"{table}.csv" if form == "folder" else f"sheet {table}"


def settings_place(form, parts, key):
    """(file, row, column) of a key; the row is None when `parts` does not have it."""
    file = "sheet job" if form == "workbook" else "job.toml"
    if key not in parts.settings:
        return file, None, key
    if form == "workbook":
        return file, [*parts.settings].index(key) + 2, key
    section, _, name = key.rpartition(".")
    lines = toml_text(parts.settings).split("\n")
    start = lines.index(f"[{section}]")
    row = next(i for i, line in enumerate(lines) if i > start and line.startswith(f"{name} ="))
    return file, row + 1, key
