"""Plain data: what JSON can hold, made of numbers, arrays, tuples and dicts."""

import numpy as np

from tankcal.messages import as_plain


def plain(value):
    """Plain Python data: arrays as lists, and null for what is not a finite number."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


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
