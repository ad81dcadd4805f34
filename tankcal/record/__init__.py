"""The record: all that workbook and report need, as plain data (docs/record-format.md)."""

import json
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.record.plain_data import without_collection
from tankcal.record.versions import FORMAT, VERSION, migrated, version_of

__all__ = [
    "FORMAT", "VERSION", "load", "migrated", "read", "record_of", "record_of_adjustment", "save",
    "version_of",
]  # fmt: skip


def record_of(result):
    """The record of a `chain.Result`: a dict of plain numbers, texts and lists."""
    from tankcal.record.making import record_of  # reading a record needs nothing of this

    return record_of(result)


def record_of_adjustment(job, adjustment):
    """The record of a job whose survey was only adjusted (`survey.Adjustment`)."""
    from tankcal.record.making import record_of_adjustment

    return record_of_adjustment(job, adjustment)


def save(record, path):
    """Write a record as UTF-8 JSON."""
    text = json.dumps(record, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    Path(path).write_text(text + "\n", encoding="utf-8")


def load(path):
    """Read a record of this version, or of an older one, to which is added what it did not have.

    Raises
    ------
    InputError
        In one line, when it is no record or of a version that cannot be read.
    """
    name = Path(path).name
    try:
        with without_collection():
            record = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        expected = message(
            "record_unreadable", "cannot be read as a record: {error}", error=str(error)
        )
        raise InputError(Problem(name, expected)) from error
    return migrated(record, name)


def read(path):
    """The record at `path` as a `record.making.Record`, each part a dataclass.

    read("results/record.json").capacity.volume_m3[-1] is the volume at the top of the table.
    """
    from tankcal.record.making import Record
    from tankcal.record.schema import from_plain

    return from_plain(Record, load(path), Path(path).name)
