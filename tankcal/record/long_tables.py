"""The long tables of a record: in a file of arrays beside record.json, which names its SHA-256.

Tables of more than MOST_ROWS rows stand there, by columns, and null in their place in record.json.
They are read when somebody asks for them, and held against the SHA-256 then: what needs none of
them needs no such file.
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
TABLES = {  # its place: the object that a row of it is in the schema
    "points": "SurveyedPoint",
    "adjustment.points": "AdjustedPoint",
    "adjustment.residuals": "AdjustedReading",
}
BY_COLUMNS = ("adjustment.residuals",)  # {key: values} in record.json; the others lists of rows
MOST_UNPACKED_BYTES = 2_000_000_000
_TEXTS = ".texts"  # behind the name of a column: its texts, of which the column has the numbers


class LongTables(Saved):
    """The file beside record.json that holds its long tables."""

    file: str = key("its name")
    sha256: str = key("of its bytes")
    bytes: int = key("its size")
    rows: dict[str, int] = key("of each table that it holds, by its place in the record")


# ---- writing


def split(record, folder):
    """The record as its file has it: its long tables are written into `folder`, and named.

    Parameters
    ----------
    record : dict
        As `making` makes it or `attached` gives it.
    folder : path

    Returns
    -------
    dict
        The same where no table is long.
    """
    long = {}
    for place in TABLES:
        found = _at(record, place)
        if found is not None and is_long(found):
            long[place] = as_columns(found)
    if not long:
        return record
    path = Path(folder) / FILE
    _write_npz(path, _arrays(long))
    with path.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    rows = {place: table.count for place, table in long.items()}
    said = {"file": FILE, "sha256": digest, "bytes": path.stat().st_size, "rows": rows}
    return _with(record, dict.fromkeys(long)) | {KEY: said}


def _write_npz(path, arrays):
    """Write {name: array} as numpy's savez_compressed does, but fast: noise does not pack."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for name, array in arrays.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as stream:
                np.lib.format.write_array(stream, array, allow_pickle=False)


def _arrays(long):
    """{name in the file: array} of {place: ArrayColumns}."""
    arrays = {}
    for place, table in long.items():
        for name, column in table.arrays.items():
            if isinstance(column, Texts):
                told = json.dumps(column.texts, ensure_ascii=False).encode("utf-8")
                arrays[f"{place}.{name}{_TEXTS}"] = np.frombuffer(told, dtype=np.uint8)
                column = column.codes
            arrays[f"{place}.{name}"] = column
    return arrays


def copy_record(record, source, folder):
    """Copy a record.json, and the file that it reads its long tables from, into a folder.

    Parameters
    ----------
    record : dict
        As `attached` gives it.
    source : path
        Of the record.json.
    folder : path

    Raises
    ------
    InputError
        For a file of long tables that is missing, or another one than the record names.
    """
    problems = problems_of_tables(record)
    if problems:
        raise InputError(problems)
    shutil.copyfile(source, Path(folder) / RECORD.file)
    for path in {one.path for one in _tables_in(record) if isinstance(one, _LazyColumns)}:
        shutil.copyfile(path, Path(folder) / path.name)


# ---- reading


def attached(record, path):
    """A record with its long tables in their places; none of them is read before it is needed.

    Parameters
    ----------
    record : dict
        Of the last version, as parsed.
    path : path
        Of the record.json, which the file lies beside.

    Raises
    ------
    InputError
        In one line, when a table is neither in the record nor in FILE by its word.
    """
    said = record.get(KEY)
    rows = said["rows"] if said and said["file"] == FILE else {}
    places = [place for place in TABLES if _lacks(record, place)]
    missing = [place for place in places if place not in rows]
    if missing:
        text = message(
            "record_lacks_tables",
            "without {keys}, and it names no file that holds them; expected {file} as tankcal "
            "wrote it: make it again",
            keys=list_some(missing, len(TABLES)), file=RECORD.file,
        )  # fmt: skip
        raise InputError(Problem(Path(path).name, text))
    if said is None:
        return record
    beside = _Beside(Path(path), said)
    tables = {place: _LazyColumns(beside, place, rows[place]) for place in places}
    whole = {key: one for key, one in record.items() if key != KEY}
    return _with(
        whole,
        {place: one if place in BY_COLUMNS else ArrayRows(one) for place, one in tables.items()},
    )


def problems_of_tables(record):
    """Problems, one at most, of the file that holds the long tables of a record; () without any."""
    try:
        for table in _tables_in(record):
            len(table)  # reads them
    except InputError as error:
        return error.problems
    return ()


def without_tables(record):
    """The record with None in place of its long tables: nothing is read for it."""
    held = (ArrayColumns, ArrayRows)
    return _with(record, {one: None for one in TABLES if isinstance(_at(record, one), held)})


def long_pairs(record, other):
    """The tables of two records that are long in one of them: ({place: both as `ArrayColumns`}.

    And both records without these.
    """
    pairs = {place: (_at(record, place), _at(other, place)) for place in TABLES}
    pairs = {
        place: tuple(map(as_columns, pair))
        for place, pair in pairs.items()
        if None not in pair and any(map(is_long, pair))
    }
    return pairs, *(_with(one, dict.fromkeys(pairs)) for one in (record, other))


def _tables_in(record):
    """The `ArrayColumns` of a record."""
    found = (_at(record, place) for place in TABLES)
    found = (one.columns if isinstance(one, ArrayRows) else one for one in found)
    return [one for one in found if isinstance(one, ArrayColumns)]


class _LazyColumns(ArrayColumns):
    """The columns of a table in the file beside a record, of `count` rows."""

    count = None  # known before anything is read

    def __init__(self, beside, place, count):
        self._beside, self._place, self.count = beside, place, count

    @property
    def arrays(self):
        """{key: array or `Texts`}; InputError for a file that is missing or another one."""
        return self._beside.tables[self._place]

    @property
    def path(self):
        """The file that they are read from."""
        return self._beside.path


class _Beside:
    """The file beside a record; said: what the record says of it, as `LongTables`."""

    def __init__(self, record, said):
        self._record, self._said = record.name, said
        self.path = record.with_name(FILE)

    @cached_property
    def tables(self):
        """{place: {key: column}}."""
        content = self._content()
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
                if sum(one.file_size for one in arrays.zip.infolist()) > MOST_UNPACKED_BYTES:
                    raise ValueError("too large")
                return {
                    place: _table(arrays, place, rows) for place, rows in self._said["rows"].items()
                }
        except Exception as error:  # of a broken archive numpy raises whatever came of it
            text = message(
                "record_tables_damaged",
                "does not hold the tables that {record} says ({what}); expected it as tankcal "
                "wrote it: make it again",
                record=self._record, what=f"{type(error).__name__}: {error}"[:100],
            )  # fmt: skip
            raise InputError(Problem(self.path.name, text)) from None

    def _content(self):
        try:
            if self.path.exists() and not self.path.is_file():  # a pipe would be waited for
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
        if digest != self._said["sha256"]:
            text = message(
                "record_tables_altered",
                "was altered: its SHA-256 is {found}, in {record} {recorded}",
                found=digest[:12], recorded=str(self._said["sha256"])[:12], record=self._record,
            )  # fmt: skip
            raise InputError(Problem(self.path.name, text))
        return content


def _table(arrays, place, rows):
    """{key: column} of a table; ValueError for columns that are not those of the schema."""
    found = {}
    for name, schema in RECORD.schema()["$defs"][TABLES[place]]["properties"].items():
        column = arrays[f"{place}.{name}"]
        if f"{place}.{name}{_TEXTS}" in arrays:
            texts = json.loads(arrays[f"{place}.{name}{_TEXTS}"].tobytes())
            column = _texts(column, texts)
        if len(column) != rows or not _fits(column, schema):
            raise ValueError(f"{place}.{name}")
        found[name] = column
    return found


def _texts(codes, texts):
    is_sound = codes.dtype.kind == "i" and all(type(one) is str for one in texts)
    if not is_sound or codes.max(initial=-1) >= len(texts) or codes.min(initial=0) < -1:
        raise ValueError("texts")
    return Texts(codes, tuple(texts))


_KINDS = {"number": "fi", "integer": "i", "boolean": "b"}  # of arrays


def _fits(column, schema):
    """Whether a column holds what a key of the schema may be."""
    names = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    is_text = isinstance(column, Texts)
    array = column.codes if is_text else column
    if array.dtype.itemsize > 8:  # longer numbers than those of Python
        return False
    if "array" in names:
        is_deep = array.ndim == 2 if is_text else array.ndim > 1
        return is_deep and array.dtype.kind in "fib" and 0 not in array.shape[1:]
    if array.ndim != 1 or ("null" not in names and _has_null(column)):
        return False
    if is_text:
        return "string" in names
    kinds = "".join(_KINDS.get(one, "") for one in names)
    is_null = "null" in names and array.dtype.kind == "f" and np.isnan(array).all()
    return is_null or array.dtype.kind in kinds


def _has_null(column):
    if isinstance(column, Texts):
        return bool((column.codes < 0).any())
    return column.dtype.kind == "i" and bool((column == NO_INTEGER).any())


# ---- places in a record


def _at(record, place):
    *outer, name = place.split(".")
    for one in outer:
        record = record.get(one) or {}
    return record.get(name)


def _lacks(record, place):
    """Whether the object that a table stands in is there, and the table is not."""
    outer = place.rpartition(".")[0]
    return (not outer or record.get(outer) is not None) and _at(record, place) is None


def _with(record, tables):
    """The record with other tables: {place: table}."""
    record = dict(record)
    for place, table in tables.items():
        outer, _, name = place.rpartition(".")
        if outer:
            record[outer] = {**record[outer], name: table}
        else:
            record[name] = table
    return record
