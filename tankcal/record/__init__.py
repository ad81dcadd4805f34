"""The record: all data of workbook and report, as plain data (docs/record-format.md)."""

import json
from pathlib import Path

import numpy as np

from tankcal.errors import InputError, Problem, reason_of
from tankcal.memory import without_collection
from tankcal.messages import message
from tankcal.record import manifest
from tankcal.record.columns import whole
from tankcal.record.covariance_factor import factor_of
from tankcal.record.long_tables import attach_tables, copy_record, omit_tables, split_tables
from tankcal.record.versions import FORMAT, VERSION, migrated, version_of
from tankcal.text.delimited import read_json

__all__ = [
    "FORMAT", "VERSION", "content_error", "copy_record", "load", "migrated", "read", "record_of",
    "record_of_adjustment", "save", "version_of", "whole",
]  # fmt: skip

ROWS_AT_ONCE = 1000  # rows of a long list that are converted to JSON at once
MOST_HEIGHT_M = 1000  # no tank is higher
NOT_NEGATIVE = ("u_m3", "U_m3", "stated_U_m3", "k", "area_m2")  # columns of the capacity table
MOST_VOLUME_M3 = 1e9  # the largest tanks and ships hold less than 1e6 m3
VOLUME_ROUNDING = 1e-9  # largest decrease by rounding, relative to the largest volume
_JSON = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def record_of(result):
    """Make the record of a result, the only input of workbook and reports.

    Parameters
    ----------
    result : Result

    Returns
    -------
    dict
        Plain numbers, texts and lists; every key is in docs/saved-keys.md.
    """
    from tankcal.record.making import record_of  # not needed to read a record

    return record_of(result)


def record_of_adjustment(job, adjustment):
    """Make the record of a job whose survey was only adjusted.

    Parameters
    ----------
    job : Job
    adjustment : survey.Adjustment

    Returns
    -------
    dict
        Record in the form of `record_of`.
    """
    from tankcal.record.making import record_of_adjustment

    return record_of_adjustment(job, adjustment)


def save(record, path):
    """Write a record as UTF-8 JSON, and its long tables into a file in the same folder.

    Parameters
    ----------
    record : dict
        Record of `record_of` or `load`.
    path : path
        The file, record.json.
    """
    with Path(path).open("w", encoding="utf-8") as file:
        file.writelines(_encode_in_pieces(split_tables(record, Path(path).parent)))
        file.write("\n")


def _encode_in_pieces(value):
    """Yield the JSON of plain data in pieces, since the whole text would need much memory."""
    if isinstance(value, dict) and value:
        for number, (name, item) in enumerate(value.items()):
            yield f"{',' if number else '{'}{_JSON.encode(name)}:"
            yield from _encode_in_pieces(item)
        yield "}"
    elif isinstance(value, list) and len(value) > ROWS_AT_ONCE:
        for start in range(0, len(value), ROWS_AT_ONCE):
            yield "," if start else "["
            yield _JSON.encode(value[start : start + ROWS_AT_ONCE])[1:-1]
        yield "]"
    else:
        yield _JSON.encode(value)


def load(path, *, is_checked=True):
    """Read a record, and convert an older version to the current version.

    Long tables are in a file beside the record. They are read on first access, which raises
    InputError in one line if the file is missing or was altered.

    Parameters
    ----------
    path : path
        The file, record.json.
    is_checked : bool, default True
        Refuse a record with another SHA-256 than in SHA256SUMS of its folder, and a record with
        negative or decreasing volumes. A covariance factor that does not fit its table is always
        refused.

    Returns
    -------
    dict

    Raises
    ------
    InputError
        In one line, if the file is no record or has a version that cannot be read.
    """
    name = Path(path).name
    try:
        with without_collection():
            record = read_json(path)
    except (OSError, ValueError, RecursionError) as error:
        expected = message(
            "record_unreadable", "cannot be read as a record: {error}", error=reason_of(error)
        )
        raise InputError(Problem(name, expected)) from error
    record = attach_tables(migrated(record, name), path)
    if is_checked:
        _refuse_altered(Path(path))
        _refuse_impossible(record, name)
    if record["capacity"] is not None:
        _refuse_damaged_factor(record["capacity"], name)
    return record


def content_error(file, error):
    """Return the InputError for a record whose parts contradict one another.

    Parameters
    ----------
    file : str
        Name of the record.
    error : Exception
        LookupError, TypeError, ValueError or AttributeError raised by the content.
    """
    expected = message(
        "no_record",
        "does not have the content of a record ({name}: {error})",
        name=type(error).__name__,
        error=str(error),
    )
    return InputError(Problem(file, expected))


def altered_since(path):
    """Return the Message that a record was altered after it was written, or None.

    Parameters
    ----------
    path : Path
        The record; SHA256SUMS of its folder states its SHA-256.

    Returns
    -------
    Message or None
        None also without SHA256SUMS.
    """
    try:
        listed = manifest.read_manifest(path.parent)
    except InputError:  # SHA256SUMS of another program
        return None
    digest = listed.digests.get(path.name) if listed else None
    if digest in (None, manifest.digest_of(path)):
        return None
    return message(
        "record_altered",
        "was altered after tankcal wrote it: its SHA-256 is not the one in {file}; expected "
        "the file as it was: run the job again",
        file=manifest.FILE,
    )


def _refuse_altered(path):
    """Raise InputError for a file with another SHA-256 than in SHA256SUMS of its folder."""
    expected = altered_since(path)
    if expected is not None:
        raise InputError(Problem(path.name, expected))


def _refuse_impossible(record, name):
    """Raise InputError for a capacity table that no tank can have."""
    if record["capacity"] is None:
        return
    heights = np.asarray(record["capacity"]["height_m"], dtype=float)
    volumes = np.asarray(record["capacity"]["volume_m3"], dtype=float)
    rises = np.diff(heights) > 0  # False for nan
    if len(heights) != len(volumes) or not (rises.all() and np.all(heights < MOST_HEIGHT_M)):
        expected = message(
            "record_heights",
            "has a capacity table whose {count} heights do not rise up to at most {most} m, one "
            "for each of its {volumes} volumes; expected such heights: run the job again",
            count=len(heights),
            most=MOST_HEIGHT_M,
            volumes=len(volumes),
        )
        raise InputError(Problem(name, expected))
    for column in NOT_NEGATIVE:
        values = np.asarray(record["capacity"][column], dtype=float)  # null becomes nan
        if len(values) != len(volumes) or np.any(values < 0):
            expected = message(
                "record_column",
                "{count} values, or some below 0; expected 0 or more for each of the {rows} rows "
                "of the table: run the job again",
                count=len(values),
                rows=len(volumes),
            )
            raise InputError(Problem(name, expected, column=f"capacity.{column}"))
    least = -VOLUME_ROUNDING * np.max(np.abs(volumes), initial=0.0)
    falls = ~(np.diff(volumes, prepend=0.0) >= least)  # True for nan
    is_impossible = falls | (volumes > MOST_VOLUME_M3)
    if is_impossible.any():
        row = int(np.argmax(is_impossible))
        expected = message(
            "record_impossible",
            "has a capacity table that falls, is below 0 or above {most} m3 (row {row}: {volume} "
            "m3); expected volumes that rise: run the job again",
            row=row + 1,
            most=f"{MOST_VOLUME_M3:g}",
            volume=f"{volumes[row]:g}",
        )
        raise InputError(Problem(name, expected))


def _refuse_damaged_factor(capacity, name):
    """Raise InputError for a covariance factor of other rows or inputs than those of its table."""
    try:
        factor_of(capacity)
    except ValueError as error:
        expected = message(
            "record_factor",
            "does not fit the {rows} rows and {inputs} inputs of the table; expected a factor that "
            "does: run the job again",
            rows=len(capacity["height_m"]),
            inputs=len(capacity["inputs"]),
        )
        raise InputError(Problem(name, expected, column="capacity.factor")) from error


def read(path, *, tables=True):
    """Read a record as dataclasses.

    For example, read("results/record.json").capacity.volume_m3[-1] is the volume at the top of the
    table.

    Parameters
    ----------
    path : path
        The file, record.json.
    tables : bool, default True
        False: long tables are None, and their file is not needed.

    Returns
    -------
    record.making.Record

    Raises
    ------
    InputError
        For the reasons of `load`.
    """
    from tankcal.record.making import Record
    from tankcal.record.schema import from_plain

    record = load(path)
    record = whole(record) if tables else omit_tables(record)
    return from_plain(Record, record, Path(path).name)
