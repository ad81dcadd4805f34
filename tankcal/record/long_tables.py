"""Long tables of a record, in a file of arrays beside record.json.

Tables of more than MOST_ROWS rows are in this file, by columns, and null in record.json, which
contains the SHA-256 of the file. The file is read, and compared with its SHA-256, when a table is
first used. A program that needs no long table needs no such file.
"""

import errno
import hashlib
import io
import json
import os
import shutil
import zipfile
from functools import cached_property
from pathlib import Path

import numpy as np

from tankcal.errors import InputError, Problem, reason_of
from tankcal.messages import list_some, message
from tankcal.record.columns import (
    NO_INTEGER,
    ArrayColumns,
    ArrayRows,
    Texts,
    as_columns,
    is_long,
)
from tankcal.record.schema import Saved, key
from tankcal.record.versions import RECORD

FILE = "record_tables.npz"
KEY = "long_tables"
TABLES = {  # {place in the record: object of the schema that describes a row}
    "points": "SurveyedPoint",
    "adjustment.points": "AdjustedPoint",
    "adjustment.residuals": "AdjustedReading",
}
BY_COLUMNS = ("adjustment.residuals",)  # {key: values} in record.json; other tables: list of rows
MOST_UNPACKED_BYTES = 2_000_000_000
_TEXTS = ".texts"  # suffix of the name of a column: texts, to which the codes of the column refer


class LongTables(Saved):
    """The file beside record.json that contains its long tables."""

    file: str = key("its name")
    sha256: str = key("of its bytes")
    bytes: int = key("its size")
    rows: dict[str, int] = key("number of rows of each table in it, by the place in the record")


# ---- writing


def split_tables(record, folder):
    """Write the long tables of a record into a folder.

    Parameters
    ----------
    record : dict
        Record of `tankcal.record.record_of` or `attach_tables`.
    folder : path
        Folder of the file of long tables.

    Returns
    -------
    dict
        Content of record.json: the record with null for long tables and a description of their
        file. The same object if no table is long.
    """
    long = {}
    for place in TABLES:
        table = _table_at(record, place)
        if table is not None and is_long(table):
            long[place] = as_columns(table)
    if not long:
        return record
    path = Path(folder) / FILE
    _write_npz(path, _name_arrays(long))
    with path.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    rows = {place: table.count for place, table in long.items()}
    description = {"file": FILE, "sha256": digest, "bytes": path.stat().st_size, "rows": rows}
    return _replace_tables(record, dict.fromkeys(long)) | {KEY: description}


def _write_npz(path, arrays):
    """Write {name: array} as numpy.savez_compressed does, but with the fastest compression.

    Noise of measurements hardly compresses, so that a higher level would save little.
    """
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for name, array in arrays.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as stream:
                np.lib.format.write_array(stream, array, allow_pickle=False)


def _name_arrays(long):
    """Return {name in the file: array} of {place: ArrayColumns}."""
    arrays = {}
    for place, table in long.items():
        for name, column in table.arrays.items():
            if isinstance(column, Texts):
                texts = json.dumps(column.texts, ensure_ascii=False).encode("utf-8")
                arrays[f"{place}.{name}{_TEXTS}"] = np.frombuffer(texts, dtype=np.uint8)
                column = column.codes
            arrays[f"{place}.{name}"] = column
    return arrays


def copy_record(record, source, folder):
    """Copy a record.json, with its file of long tables if any, into a folder.

    Parameters
    ----------
    record : dict
        Record of `attach_tables`.
    source : path
        The record.json.
    folder : path
        Destination.

    Raises
    ------
    InputError
        If the file of long tables is missing or was altered.
    """
    problems = problems_of_tables(record)
    if problems:
        raise InputError(problems)
    shutil.copyfile(source, Path(folder) / RECORD.file)
    columns = _array_columns(record)
    for path in {table.path for table in columns if isinstance(table, _LazyColumns)}:
        shutil.copyfile(path, Path(folder) / path.name)


# ---- reading


def attach_tables(record, path):
    """Put the long tables of a record in their places; the file is read on first access.

    Parameters
    ----------
    record : dict
        Record of the current version, as parsed.
    path : path
        The record.json; the file of long tables is in its folder.

    Returns
    -------
    dict

    Raises
    ------
    InputError
        In one line, if a table is neither in the record nor listed in the description of FILE.
    """
    description = record.get(KEY)
    rows = description["rows"] if description and description["file"] == FILE else {}
    places = [place for place in TABLES if _lacks_table(record, place)]
    missing = [place for place in places if place not in rows]
    if missing:
        text = message(
            "record_lacks_tables",
            "without {keys}, and it names no file that holds them; expected {file} as tankcal "
            "wrote it: make it again",
            keys=list_some(missing, len(TABLES)), file=RECORD.file,
        )  # fmt: skip
        raise InputError(Problem(Path(path).name, text))
    if description is None:
        return record
    file = _TablesFile(Path(path), description)
    tables = {place: _LazyColumns(file, place, rows[place]) for place in places}
    return _replace_tables(
        {name: value for name, value in record.items() if name != KEY},
        {
            place: table if place in BY_COLUMNS else ArrayRows(table)
            for place, table in tables.items()
        },
    )


def problems_of_tables(record):
    """Return the problem of the file of long tables of a record (list or tuple of Problem)."""
    try:
        for table in _array_columns(record):
            len(table)  # reads the file
    except InputError as error:
        return error.problems
    return ()


def omit_tables(record):
    """Return the record with None in place of its long tables; their file is not read."""
    kinds = (ArrayColumns, ArrayRows)
    return _replace_tables(
        record, {place: None for place in TABLES if isinstance(_table_at(record, place), kinds)}
    )


def long_pairs(record, other):
    """Separate the tables of two records that are long in one of them.

    Returns
    -------
    pairs : dict
        {place: `ArrayColumns` of both records}.
    record, other : dict
        Both records without these tables.
    """
    pairs = {place: (_table_at(record, place), _table_at(other, place)) for place in TABLES}
    pairs = {
        place: tuple(map(as_columns, pair))
        for place, pair in pairs.items()
        if None not in pair and any(map(is_long, pair))
    }
    return pairs, *(_replace_tables(both, dict.fromkeys(pairs)) for both in (record, other))


def _array_columns(record):
    """Return the tables of a record that consist of arrays (list of ArrayColumns)."""
    tables = (_table_at(record, place) for place in TABLES)
    columns = (table.columns if isinstance(table, ArrayRows) else table for table in tables)
    return [table for table in columns if isinstance(table, ArrayColumns)]


class _LazyColumns(ArrayColumns):
    """Columns of a table of `count` rows in a `_TablesFile`."""

    count = None  # known before the file is read

    def __init__(self, file, place, count):
        self._file, self._place, self.count = file, place, count

    @property
    def arrays(self):
        """Columns {key: array or `Texts`}; InputError if the file is missing or was altered."""
        return self._file.tables[self._place]

    @property
    def path(self):
        """Path of the file."""
        return self._file.path


class _TablesFile:
    """File of long tables beside a record.json, with its description in the record."""

    def __init__(self, record_path, description):
        self._record, self._description = record_path.name, description
        self.path = record_path.with_name(FILE)

    @cached_property
    def tables(self):
        """Tables of the file, {place: {key: column}}."""
        content = self._read()
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
                if sum(part.file_size for part in arrays.zip.infolist()) > MOST_UNPACKED_BYTES:
                    raise ValueError("too large")
                return {
                    place: _read_table(arrays, place, rows)
                    for place, rows in self._description["rows"].items()
                }
        except Exception as error:  # numpy raises errors of any kind for a damaged archive
            text = message(
                "record_tables_damaged",
                "does not hold the tables that {record} says ({what}); expected it as tankcal "
                "wrote it: make it again",
                record=self._record, what=f"{type(error).__name__}: {error}"[:100],
            )  # fmt: skip
            raise InputError(Problem(self.path.name, text)) from None

    def _read(self):
        """Return the bytes of the file, compared with the SHA-256 in the record."""
        try:
            if self.path.exists() and not self.path.is_file():  # reading a pipe would block
                raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
            content = self.path.read_bytes()
        except OSError as error:
            text = message(
                "record_tables_missing",
                "cannot be read ({reason}); expected it beside {record}, whose readings and points "
                "it holds",
                reason=reason_of(error), record=self._record,
            )  # fmt: skip
            raise InputError(Problem(self.path.name, text)) from None
        digest = hashlib.sha256(content).hexdigest()
        if digest != self._description["sha256"]:
            recorded = str(self._description["sha256"])
            text = message(
                "record_tables_altered",
                "was altered: its SHA-256 is {found}, in {record} {recorded}",
                found=digest[:12], recorded=recorded[:12], record=self._record,
            )  # fmt: skip
            raise InputError(Problem(self.path.name, text))
        return content


def _read_table(arrays, place, rows):
    """Return the columns {key: column} of a table; ValueError if they differ from the schema."""
    columns = {}
    for name, schema in RECORD.schema()["$defs"][TABLES[place]]["properties"].items():
        column = arrays[f"{place}.{name}"]
        if f"{place}.{name}{_TEXTS}" in arrays:
            texts = json.loads(arrays[f"{place}.{name}{_TEXTS}"].tobytes())
            column = _make_texts(column, texts)
        if len(column) != rows or not _matches(column, schema):
            raise ValueError(f"{place}.{name}")
        columns[name] = column
    return columns


def _make_texts(codes, texts):
    """Return `Texts`; ValueError for invalid codes or texts."""
    is_valid = codes.dtype.kind == "i" and all(type(text) is str for text in texts)
    if not is_valid or codes.max(initial=-1) >= len(texts) or codes.min(initial=0) < -1:
        raise ValueError("texts")
    return Texts(codes, tuple(texts))


_KINDS = {"number": "fi", "integer": "i", "boolean": "b"}  # kinds of numpy for a type of JSON


def _matches(column, schema):
    """Return whether a column agrees with the schema of its key."""
    names = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    is_text = isinstance(column, Texts)
    array = column.codes if is_text else column
    if array.dtype.itemsize > 8:  # wider than the numbers of Python
        return False
    if "array" in names:
        is_deep = array.ndim == 2 if is_text else array.ndim > 1
        return is_deep and array.dtype.kind in "fib" and 0 not in array.shape[1:]
    if array.ndim != 1 or ("null" not in names and _has_null(column)):
        return False
    if is_text:
        return "string" in names
    kinds = "".join(_KINDS.get(name, "") for name in names)
    is_null = "null" in names and array.dtype.kind == "f" and np.isnan(array).all()
    return is_null or array.dtype.kind in kinds


def _has_null(column):
    if isinstance(column, Texts):
        return bool((column.codes < 0).any())
    return column.dtype.kind == "i" and bool((column == NO_INTEGER).any())


# ---- places in a record


def _table_at(record, place):
    """Return the table at a place such as "adjustment.points", or None."""
    *outer, name = place.split(".")
    for part in outer:
        record = record.get(part) or {}
    return record.get(name)


def _lacks_table(record, place):
    """Return whether the record has the object of a table, but not the table."""
    outer = place.rpartition(".")[0]
    return (not outer or record.get(outer) is not None) and _table_at(record, place) is None


def _replace_tables(record, tables):
    """Return the record with other tables {place: table}."""
    record = dict(record)
    for place, table in tables.items():
        outer, _, name = place.rpartition(".")
        if outer:
            record[outer] = {**record[outer], name: table}
        else:
            record[name] = table
    return record
