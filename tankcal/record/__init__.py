"""The record: all that workbook and report need, as plain data (docs/record-format.md)."""

import json
from pathlib import Path

from tankcal.errors import InputError, Problem

FORMAT = "tankcal-record/1"


def record_of(result):
    """The record of a `chain.Result`: a dict of plain numbers, texts and lists."""
    from tankcal.record.making import record_of  # reading a record needs nothing of this

    return record_of(result)


def record_of_adjustment(job, adjustment):
    """The record of a job whose survey was only adjusted (`surveys.Adjustment`)."""
    from tankcal.record.making import record_of_adjustment

    return record_of_adjustment(job, adjustment)


def save(record, path):
    """Write a record as UTF-8 JSON."""
    text = json.dumps(record, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    Path(path).write_text(text + "\n", encoding="utf-8")


def load(path):
    """Read a record; raises InputError when it is no record of this format."""
    name = Path(path).name
    try:
        record = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(Problem(name, f"cannot be read as a record: {error}")) from error
    found = record.get("format") if isinstance(record, dict) else None
    if found != FORMAT:
        raise InputError(Problem(name, f"found format {found!r}, expected {FORMAT!r}"))
    return record
