"""Plain data: what JSON can hold, made of numbers, arrays, tuples and dicts."""

from dataclasses import is_dataclass
from math import isfinite

import numpy as np

from tankcal.messages import Message, as_plain
from tankcal.record.columns import ArrayColumns, ArrayRows
from tankcal.record.schema import keys_of

_AS_THEY_ARE = {str, int, bool, type(None)}


def to_plain(value):
    """What JSON can hold: dicts, lists, texts, numbers, and null for what is not a finite number.

    Parameters
    ----------
    value : object
        A dataclass (see `tankcal.record.schema`), or dicts, lists, tuples and arrays of anything
        plain, and of dataclasses. `ArrayColumns` and `ArrayRows` stay as they are.
    """
    kind = type(value)  # of a million values most are these two
    if kind is float:
        return value if isfinite(value) else None
    if kind in _AS_THEY_ARE:
        return value
    if isinstance(value, dict):
        return {str(name): to_plain(item) for name, item in value.items()}
    if isinstance(value, np.ndarray):
        return to_plain(value.tolist())
    if isinstance(value, list | tuple):
        types = set(map(type, value))  # a long column is of one type: it is looked at as a whole
        if types <= _AS_THEY_ARE:
            return list(value)
        if types == {float}:
            return [item if isfinite(item) else None for item in value]
        return [to_plain(item) for item in value]
    if is_dataclass(value):
        return _object(value)
    if isinstance(value, np.generic):
        return to_plain(value.item())
    if isinstance(value, str):  # a Message
        return str(value)
    if isinstance(value, float) and not isfinite(value):
        return None
    return value


def whole(record):
    """A record all of whose tables are lists and dicts, the long ones as well."""
    if isinstance(record, ArrayColumns | dict):
        return {key: whole(value) for key, value in record.items()}
    return list(record) if isinstance(record, ArrayRows) else record


def _object(value):
    keys = [one for one in keys_of(type(value)) if one.name]
    found = {one.key: one.value_in(value) for one in keys}
    told = [one for one in keys if one.type is Message]
    plain = {
        one.key: to_plain(found[one.key])
        for one in keys
        if one.required or found[one.key] is not None
    }
    for one in told:
        said = as_plain(found[one.key])
        plain[f"{one.key}_code"], plain[f"{one.key}_values"] = (
            said["code"],
            to_plain(said["values"]),
        )
    return plain


def columns_of(rows, names=()):
    """{key: values} of rows that have the same keys; of none, empty columns of these names."""
    return {one: [row[one] for row in rows] for one in (rows[0] if rows else names)}


def rows_of(columns):
    """The rows of {key: values}, each a dict."""
    names = tuple(columns)
    return [dict(zip(names, values, strict=True)) for values in zip(*columns.values(), strict=True)]
