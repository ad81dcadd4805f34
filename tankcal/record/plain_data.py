"""Plain data: what JSON can hold, made of numbers, arrays, tuples and dicts."""

import gc
from contextlib import contextmanager
from math import isfinite

import numpy as np

from tankcal.messages import as_plain

_AS_THEY_ARE = {str, int, bool, type(None)}


def plain(value):
    """Plain Python data: arrays as lists, and null for what is not a finite number."""
    kind = type(value)  # of a million values most are these two
    if kind is float:
        return value if isfinite(value) else None
    if kind in _AS_THEY_ARE:
        return value
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        types = set(map(type, value))  # a long column is of one type: it is looked at as a whole
        if types <= _AS_THEY_ARE:
            return list(value)
        if types == {float}:
            return [item if isfinite(item) else None for item in value]
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not isfinite(value):
        return None
    return value


@contextmanager
def without_collection():
    """A context in which the garbage collector rests while rows are made that are all kept.

    It would look through all of them again and again, and find nothing to free: of a survey with
    180 000 readings that takes as long as half of the work itself.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def columns_of(rows, names=()):
    """{key: values} of rows that have the same keys; of none, empty columns of these names."""
    return {key: [row[key] for row in rows] for key in (rows[0] if rows else names)}


def rows_of(columns):
    """The rows of {key: values}, each a dict."""
    names = tuple(columns)
    return [dict(zip(names, values, strict=True)) for values in zip(*columns.values(), strict=True)]


def plain_problems(problems):
    """[{file, row, column, text, code, values}] of `errors.Problem` rows."""
    return [
        {
            "file": one.file,
            "row": one.row,
            "column": one.column,
            "text": str(one.expected),
            **as_plain(one.expected),
        }
        for one in problems
    ]
