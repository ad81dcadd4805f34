"""Input of `tankcal compare`: two tables, declared facts, courses, a rule."""

from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from tankcal.errors import InputError
from tankcal.job.folder import parsed_toml
from tankcal.job.rule_files import named_rule
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.recalibration.comparison import compare
from tankcal.recalibration.declared import read_courses
from tankcal.recalibration.reading import read_former
from tankcal.record.comparison import ComparisonFile

RECORD = "record.json"


@dataclass(frozen=True)
class Asked:
    """Paths of the tables to compare.

    Attributes
    ----------
    old, new : path
        Tables in any form that `read_former` reads, or folders of results.
    former, new_former : path or None
        former.toml of each table.
    courses : path or None
        courses.csv.
    rule : str or None
        Name of a shipped rule, or path of a file.
    """

    old: str | Path
    new: str | Path
    former: str | Path | None = None
    new_former: str | Path | None = None
    courses: str | Path | None = None
    rule: str | None = None


def compare_files(asked) -> ComparisonFile:
    """Compare the tables in two files; report all problems of all files together.

    Parameters
    ----------
    asked : Asked

    Returns
    -------
    record.comparison.ComparisonFile

    Raises
    ------
    InputError
        With every problem of the tables, their former.toml, courses.csv and the rule; or if the
        tables cannot be compared (`comparison.compare`).
    """
    log = Log()
    old, former = _table(asked.old, asked.former, log)
    recent, new = _table(asked.new, asked.new_former, log)
    courses = None if asked.courses is None else read_course_sizes(asked.courses, log)
    rule = None if asked.rule is None else named_rule(asked.rule, log)
    log.stop_if_problems()
    if former.name == new.name:
        former, new = _name_with_folders((old, former), (recent, new))
    fingerprints = tuple(
        sha256(rows_file(source).read_bytes()).hexdigest() for source in (old, recent)
    )
    return compare(former, new, rule=rule, courses=courses, fingerprints=fingerprints)


def _table(source, declared, log):
    """Return (path, FormerTable or None) of a file, or of the record in a folder of results."""
    path = Path(source)
    if path.is_dir():
        folder, path = path, path / RECORD
        if not path.is_file():
            expected = message(
                "compare_no_record",
                "a folder without record.json; expected a table, or a folder of results",
            )
            log.problem(folder.name or str(folder), expected)
            return path, None
    try:
        return path, read_former(path, declared)
    except InputError as error:
        log.problems += error.problems
        return path, None


def _name_with_folders(*tables):
    """Return both FormerTables, with enough folders in their names to make the names differ."""
    folders = [path.resolve().parent.parts for path, _ in tables]
    for count in range(1, max(map(len, folders))):
        first, second = ("/".join(parts[-count:]) for parts in folders)
        if first != second:
            return [
                replace(table, name=f"{folder}/{table.name}")
                for folder, (_, table) in zip((first, second), tables, strict=True)
            ]
    return [table for _, table in tables]


def rows_file(path):
    """Path of the file with the rows: for a former.toml, the file that it names."""
    if path.suffix.lower() != ".toml":
        return path
    content, _ = parsed_toml(path.name, path.read_bytes(), Log())
    return path.parent / content["former"]["file"]


def read_course_sizes(path, log):
    """Return (heights, thicknesses) of a courses.csv, m, from the bottom up.

    None after problems.
    """
    courses = read_courses(path, log)
    if courses is None:
        return None
    if np.isnan(courses.heights_m).any():
        expected = message(
            "compare_no_height",
            "heights that are not known; expected all of them: tankcal read-table finds the seams",
        )
        log.problem(courses.file, expected, None, "height_m")
    return courses.heights_m, courses.thickness_m
