"""Long tables of a record as arrays by columns, with the interface of lists and dicts.

A survey may have 200 000 readings. Python lists need ten times the memory and time of arrays. A
reader of a record needs no distinction: `ArrayColumns` is a mapping {key: list of values}, and
`ArrayRows` a sequence of dicts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

MOST_ROWS = 10_000  # largest number of rows of a table that consists of lists and dicts
NO_INTEGER = np.iinfo(np.int64).min  # replaces null in a column of integers


@dataclass(frozen=True, eq=False)
class Texts:
    """Column of texts in which equal texts are stored once.

    Attributes
    ----------
    codes : ndarray of int, shape (n,) or (n, k)
        Index of each text in `texts`; -1: null, or the end of a row of fewer than k texts.
    texts : tuple of str
        The different texts.
    """

    codes: np.ndarray
    texts: tuple

    @classmethod
    def of(cls, values):
        """Return the column of texts and None, or of lists of texts.

        Examples
        --------
        >>> Texts.of(["b", "a", None, "b"]).codes.tolist()
        [0, 1, -1, 0]
        >>> Texts.of([["A", "B"], ["A"]]).tolist()
        [['A', 'B'], ['A']]
        """
        width = max((len(value) for value in values if type(value) in (list, tuple)), default=None)
        flat = values
        if width is not None:
            flat = [text for value in values for text in [*value, *[None] * width][:width]]
        indices = {None: -1}
        codes = [indices.setdefault(text, len(indices) - 1) for text in flat]
        codes = np.array(codes, dtype=np.int32)
        codes = codes if width is None else codes.reshape(len(values), width)
        return cls(codes, tuple(indices)[1:])

    def __len__(self):
        return len(self.codes)

    def __getitem__(self, rows):
        return Texts(self.codes[rows], self.texts)

    def tolist(self):
        """Return the texts as a list, or list of lists, without the fill of short rows."""
        values = self.filled(None).tolist()
        if self.codes.ndim > 1 and (self.codes < 0).any():
            return [[text for text in row if text is not None] for row in values]
        return values

    def filled(self, missing):
        """Return the texts as an array of objects, with `missing` in place of null."""
        table = np.empty(len(self.texts) + 1, dtype=object)
        table[:] = *self.texts, missing  # the code -1 selects the last entry
        return table[self.codes]

    def mapped(self, function):
        """Return the column with function(text) in place of each text."""
        return Texts(self.codes, tuple(map(function, self.texts)))


def column_of(values):
    """Convert plain values to a column.

    Parameters
    ----------
    values : sequence
        Numbers, texts, booleans, or lists of equal length of these; None for null. An array or
        `Texts` is returned unchanged.

    Returns
    -------
    ndarray or Texts

    Raises
    ------
    TypeError
        For values of different types.
    """
    if isinstance(values, np.ndarray | Texts):
        return values
    kinds = {str if issubclass(kind, str) else kind for kind in map(type, values)} - {type(None)}
    if not kinds:
        return np.full(len(values), np.nan)
    if kinds == {str}:
        return Texts.of(values)
    if kinds == {bool} and None not in values:
        return np.array(values)
    if kinds == {int}:
        integers = [NO_INTEGER if value is None else value for value in values]
        return np.array(integers, dtype=np.int64)
    if kinds <= {int, float}:
        return np.array(values, dtype=float)  # None becomes nan
    if kinds <= {list, tuple}:
        return _column_of_lists(values)
    raise TypeError(f"no column: values of {', '.join(sorted(kind.__name__ for kind in kinds))}")


def _column_of_lists(values):
    known = [value for value in values if value is not None]
    kinds = {type(item) for value in known for item in value}
    if kinds <= {str}:
        return Texts.of(values)
    if kinds == {bool}:
        return np.array(values)
    missing = np.full(np.shape(known[0]), np.nan)
    return np.array([missing if value is None else value for value in values], dtype=float)


def values_of(column):
    """Convert a column to plain values; numbers that are not finite become None.

    Examples
    --------
    >>> values_of(np.array([1.5, np.nan]))
    [1.5, None]
    >>> values_of(np.full((1, 2), np.nan))
    [None]
    """
    values = column.tolist()
    if isinstance(column, Texts) or column.dtype == bool:
        return values
    is_null = column == NO_INTEGER if column.dtype.kind == "i" else ~np.isfinite(column)
    if column.ndim == 1:
        for row in np.flatnonzero(is_null).tolist():
            values[row] = None
        return values
    is_null = is_null.reshape(len(column), -1)
    for row in np.flatnonzero(is_null.any(axis=1)).tolist():
        items = np.where(is_null[row], None, column[row].astype(object).ravel())
        values[row] = None if is_null[row].all() else items.reshape(column.shape[1:]).tolist()
    return values


class ArrayColumns(Mapping):
    """Columns of equal length: {key: list of plain values}, converted on access.

    Parameters
    ----------
    columns : mapping
        {key: values that `column_of` accepts}.
    """

    def __init__(self, columns):
        self._columns = {key: column_of(values) for key, values in columns.items()}

    @classmethod
    def of_rows(cls, rows):
        """Return the columns of dicts with common keys, or the columns of `ArrayRows`."""
        if isinstance(rows, ArrayRows):
            return rows.columns
        return cls(columns_of(rows))

    @property
    def arrays(self):
        """The columns, {key: array or `Texts`}."""
        return self._columns

    @property
    def count(self):
        """Number of rows."""
        return len(next(iter(self.arrays.values()), ()))

    def __getitem__(self, key):
        return values_of(self.arrays[key])

    def __iter__(self):
        return iter(self.arrays)

    def __len__(self):
        return len(self.arrays)

    def __bool__(self):
        return True  # as a dict of empty lists; the file of the columns is not read

    def __or__(self, others):
        return ArrayColumns({**self.arrays, **getattr(others, "arrays", others)})

    def take(self, rows):
        """Return the columns of some rows, selected by indices, a mask or a slice."""
        return ArrayColumns({key: column[rows] for key, column in self.arrays.items()})

    def rows(self):
        """Yield a dict for each row."""
        names = tuple(self)
        for values in zip(*self.values(), strict=True):
            yield dict(zip(names, values, strict=True))


class ArrayRows(Sequence):
    """`ArrayColumns` as a sequence of dicts, converted on access."""

    def __init__(self, columns):
        self.columns = columns

    def __len__(self):
        return self.columns.count

    def __getitem__(self, number):
        if isinstance(number, slice):
            return list(self.columns.take(number).rows())
        number = range(len(self))[number]
        return next(self.columns.take(slice(number, number + 1)).rows())

    def __iter__(self):
        return self.columns.rows()

    def __eq__(self, other):
        return isinstance(other, ArrayRows | list) and list(self) == list(other)

    __hash__ = None


# ---- tables of a record in either form


def as_columns(table):
    """Return a table of a record, in any form, as `ArrayColumns`."""
    if isinstance(table, ArrayColumns):
        return table
    return ArrayColumns(table) if isinstance(table, Mapping) else ArrayColumns.of_rows(table)


def count_rows(table):
    """Return the number of rows of a table of a record, in any form."""
    if isinstance(table, ArrayColumns):
        return table.count
    return len(next(iter(table.values()), ())) if isinstance(table, Mapping) else len(table)


def is_long(table):
    """Return whether a table of a record has more than MOST_ROWS rows."""
    return count_rows(table) > MOST_ROWS


def plain_if_short(table):
    """Return `ArrayColumns` as dict or `ArrayRows` as list, unless they are long."""
    if is_long(table):
        return table
    return dict(table) if isinstance(table, Mapping) else list(table)


def whole(record):
    """Return a record whose tables, also the long ones, are lists and dicts."""
    if isinstance(record, ArrayColumns | dict):
        return {key: whole(value) for key, value in record.items()}
    return list(record) if isinstance(record, ArrayRows) else record


def columns_of(rows, names=()):
    """Return {key: values} of dicts with common keys; without rows, empty columns `names`."""
    return {key: [row[key] for row in rows] for key in (rows[0] if rows else names)}


def rows_of(columns):
    """Return the rows of {key: values} (list of dict)."""
    names = tuple(columns)
    return [dict(zip(names, values, strict=True)) for values in zip(*columns.values(), strict=True)]
