"""Tables as CSV files, column by column: a survey may have 200 000 readings."""

import csv
from math import isnan

from pandas import NA


def write_csv(table, path, style):
    """Write a DataFrame with its headings; `style` ("%.6f") is that of numbers, "" for none."""
    columns = [_texts(table[name].tolist(), style) for name in table.columns]
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table.columns)
        writer.writerows(zip(*columns, strict=True))


def _texts(values, style):
    """The cells of a column: of floats as `style` says, of nothing empty, of all else its text."""
    types = set(map(type, values))
    if types <= {str, int}:
        return values
    if types <= {float, type(None)}:
        return ["" if x is None or x != x else style % x for x in values]
    return [_text(value, style) for value in values]


def _text(value, style):
    if value is None or value is NA:
        return ""
    if isinstance(value, float):
        return "" if isnan(value) else style % value
    return value
