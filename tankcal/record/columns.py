"""Long tables of a record by columns: arrays, looked at as the lists and dicts that they stand for.

A survey may have 200 000 readings. As lists of Python they take ten times the memory and the time
of arrays. Whoever reads a record need not know which of both it has: `ArrayColumns` is a mapping
{key: list of values}, `ArrayRows` a sequence of dicts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

MOST_ROWS = 10_000  # of a table of a record that is lists and dicts
NO_INTEGER = np.iinfo(np.int64).min  # stands for null in a column of whole numbers


@dataclass(frozen=True, eq=False)
class Texts:
    """A column of texts, each different one kept once.

    Attributes
    ----------
    codes : ndarray of int, shape (n,) or (n, k)
        Place of each text in `texts`; -1: null, or none of a row of lists of up to k texts.
    texts : tuple of str
    """

    codes: np.ndarray
    texts: tuple

    @classmethod
    def of(cls, values):
        """The column of texts and None, or of lists of texts.

        Examples
        --------
        >>> Texts.of(["b", "a", None, "b"]).codes.tolist()
        [0, 1, -1, 0]
        >>> Texts.of([["A", "B"], ["A"]]).tolist()
        [['A', 'B'], ['A']]
        """
        places = {None: -1}
        width = max((len(one) for one in values if type(one) in (list, tuple)), default=None)
        flat = values
        if width is not None:
            nothing = [None] * width
            flat = [text for one in values for text in [*one, *nothing][:width]]
        codes = [places.setdefault(text, len(places) - 1) for text in flat]
        codes = np.array(codes, dtype=np.int32)
        shaped = codes if width is None else codes.reshape(len(values), width)
        return cls(shaped, tuple(places)[1:])

    def __len__(self):
        return len(self.codes)

    def __getitem__(self, rows):
        return Texts(self.codes[rows], self.texts)

    def tolist(self):
        """The texts as they were."""
        found = self.filled(None).tolist()
        if self.codes.ndim > 1 and (self.codes < 0).any():
            return [[text for text in one if text is not None] for one in found]
        return found

    def filled(self, nothing):
        """The texts of a column as an array of objects, with another text where there is none."""
        table = np.empty(len(self.texts) + 1, dtype=object)
        table[:] = *self.texts, nothing
        return table[self.codes]

    def mapped(self, function):
        """The column with function(text) in place of each text."""
        return Texts(self.codes, tuple(map(function, self.texts)))


def column_of(values):
    """A column of plain values as an array or `Texts`; one of these stays as it is.

    Parameters
    ----------
    values : sequence
        Numbers, texts, True and False, or lists of equally many of one of these; None for null.

    Raises
    ------
    TypeError
        For values that are not alike.
    """
    if isinstance(values, np.ndarray | Texts):
        return values
    kinds = {str if issubclass(one, str) else one for one in map(type, values)} - {type(None)}
    if not kinds:
        return np.full(len(values), np.nan)
    if kinds == {str}:
        return Texts.of(values)
    if kinds == {bool} and None not in values:
        return np.array(values)
    if kinds == {int}:
        return np.array([NO_INTEGER if one is None else one for one in values], dtype=np.int64)
    if kinds <= {int, float}:
        return np.array(values, dtype=float)  # None becomes nan
    if kinds <= {list, tuple}:
        return _column_of_lists(values)
    raise TypeError(f"no column: values of {', '.join(sorted(one.__name__ for one in kinds))}")


def _column_of_lists(values):
    known = next(one for one in values if one is not None)
    leaves = {type(leaf) for one in values if one is not None for leaf in one}
    if leaves <= {str}:
        return Texts.of(values)
    if leaves == {bool}:
        return np.array(values)
    nothing = np.full(np.shape(known), np.nan)
    return np.array([nothing if one is None else one for one in values], dtype=float)


def values_of(column):
    """The plain values of a column: null (None) where a number is not finite.

    Examples
    --------
    >>> values_of(np.array([1.5, np.nan]))
    [1.5, None]
    >>> values_of(np.full((1, 2), np.nan))
    [None]
    """
    found = column.tolist()
    if isinstance(column, Texts) or column.dtype == bool:
        return found
    if column.dtype.kind == "i":
        null = column == NO_INTEGER
        return _with_null(found, null) if null.any() else found
    null = ~np.isfinite(column)
    if not null.any():
        return found
    if column.ndim == 1:
        return _with_null(found, null)
    null = null.reshape(len(column), -1)
    for row in np.flatnonzero(null.any(axis=1)).tolist():
        inner = np.where(null[row], None, column[row].astype(object).ravel())
        found[row] = None if null[row].all() else inner.reshape(column.shape[1:]).tolist()
    return found


def _with_null(values, null):
    for row in np.flatnonzero(null).tolist():
        values[row] = None
    return values


class ArrayColumns(Mapping):
    """ArrayColumns of equal length: {key: list of plain values}, made when it is asked for.

    Parameters
    ----------
    columns : mapping
        {key: values, as `column_of` takes them}.
    """

    def __init__(self, columns):
        self._columns = {key: column_of(values) for key, values in columns.items()}

    @classmethod
    def of_rows(cls, rows):
        """The columns of dicts with the same keys; of `ArrayRows` those that they are of."""
        if isinstance(rows, ArrayRows):
            return rows.columns
        return cls({key: [row[key] for row in rows] for key in (rows[0] if rows else ())})

    @property
    def arrays(self):
        """{key: array or `Texts`}."""
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
        return True  # as a dict of empty lists; nothing is read for it

    def __or__(self, others):
        return ArrayColumns({**self.arrays, **getattr(others, "arrays", others)})

    def take(self, rows):
        """The same columns of some rows: their numbers, a mask or a slice."""
        return ArrayColumns({key: column[rows] for key, column in self.arrays.items()})

    def rows(self):
        """A dict for each row, one after the other."""
        names = tuple(self)
        for values in zip(*self.values(), strict=True):
            yield dict(zip(names, values, strict=True))


class ArrayRows(Sequence):
    """`ArrayColumns` as a sequence of dicts, each made when it is asked for."""

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


def as_columns(found):
    """`ArrayColumns` of a table of a record, in whichever form it has it."""
    if isinstance(found, ArrayColumns):
        return found
    return ArrayColumns(found) if isinstance(found, Mapping) else ArrayColumns.of_rows(found)


def count_rows(found):
    """Number of rows of a table of a record, in whichever form it has it."""
    if isinstance(found, ArrayColumns):
        return found.count
    return len(next(iter(found.values()), ())) if isinstance(found, Mapping) else len(found)


def is_long(found):
    """Whether a table of a record has more than MOST_ROWS rows."""
    return count_rows(found) > MOST_ROWS


def plain_if_short(found):
    """The dict or list of `ArrayColumns` or `ArrayRows`; more than MOST_ROWS rows stay arrays."""
    if is_long(found):
        return found
    return dict(found) if isinstance(found, Mapping) else list(found)


def whole(record):
    """A record all of whose tables are lists and dicts, the long ones as well."""
    if isinstance(record, ArrayColumns | dict):
        return {key: whole(value) for key, value in record.items()}
    return list(record) if isinstance(record, ArrayRows) else record


def columns_of(rows, names=()):
    """{key: values} of rows that have the same keys; of none, empty columns of these names."""
    return {one: [row[one] for row in rows] for one in (rows[0] if rows else names)}


def rows_of(columns):
    """The rows of {key: values}, each a dict."""
    names = tuple(columns)
    return [dict(zip(names, values, strict=True)) for values in zip(*columns.values(), strict=True)]
