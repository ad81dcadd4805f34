"""Former tables of the jobs of a batch."""

import os
from functools import lru_cache
from pathlib import Path

from tankcal.batch.finding import RECORD
from tankcal.batch.outcomes import known_names
from tankcal.errors import InputError, Problem
from tankcal.messages import message

ENDINGS = (".toml", ".csv", ".xlsx", ".pdf", ".json")


@lru_cache(maxsize=4)
def _names_in(folder):
    """Return {source: name} of the jobs of a former batch."""
    return known_names(folder)


def former_or_none(job):
    """Return the former table of a job; None if there is no table, or no comparison."""
    try:
        return former_of(job)
    except InputError:
        return None


def former_of(job):
    """Return the path of the former table of a job; None if the job is not compared.

    Raises
    ------
    InputError
        A folder of former tables contains no table of this job.
    """
    asked = job.asked
    if "compare" not in asked.do or asked.former is None:
        return None
    folder = Path(os.path.abspath(asked.former))
    if not folder.is_dir():
        return folder
    if (folder / RECORD).is_file():
        return folder / RECORD
    names = (_names_in(str(folder)).get(job.source), job.name, job.label)
    for name in dict.fromkeys(label for label in names if label):
        places = [folder / name, folder / "jobs" / name / "results", folder / name / "results"]
        tables = [folder / f"{name}{ending}" for ending in ENDINGS]
        for path in (*(place / RECORD for place in places), *tables):
            if path.is_file():
                return path
    text = message(
        "batch_no_former",
        "contains no former table of {name}; expected {name} with one of the endings "
        "{endings}, or a folder {name} with record.json",
        name=job.label,
        endings=[*ENDINGS],
    )
    raise InputError(Problem(str(asked.former), text))
