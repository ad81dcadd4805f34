"""Tables as CSV files, column by column: a survey may have 200 000 readings."""

import csv
from math import isnan

from tankcal.report import numbers

FORMULA_SIGNS = ("=", "+", "-", "@", "\t", "\r")
_YES = {True: "yes", False: "no"}


def write_table(table, path, rows):
    """Write a declared Table with its headings.

    rows  dicts, or {key: values}; a column that none of them knows is left out
    """
    values_of = rows if isinstance(rows, dict) else _by_keys(rows)
    columns = {}
    for column in table.in_csv():
        if column.key not in values_of:
            continue
        cells = _plain(values_of[column.key], numbers.unit(column.csv_unit).factor)
        if any(isinstance(cell, list) for cell in cells):
            columns |= _spread(column.csv, cells)
        else:
            columns[column.csv] = cells
    write_csv(columns, path, table.csv_style)


def _by_keys(rows):
    keys = dict.fromkeys(key for row in rows for key in row)
    return {key: [row.get(key) for row in rows] for key in keys}


def _plain(values, factor):
    """The values in another unit; yes and no for True and False."""
    types = set(map(type, values))
    if bool in types:
        return [_YES.get(value, value) for value in values]
    if factor == 1.0:
        return values
    return [None if value is None else factor * value for value in values]


def _spread(heading, lists):
    """Lists of one or more as columns of their own: id_1, id_2."""
    width = max(map(len, lists), default=0)
    padded = ([*one, *[""] * (width - len(one))] for one in lists)
    return {f"{heading}_{i}": list(cells) for i, cells in enumerate(zip(*padded, strict=True), 1)}


def write_rows(rows, path):
    """Write rows (dicts with the same keys) with twelve digits, lists with blanks between.

    A text that a spreadsheet would take for a formula gets an apostrophe before it.
    """
    columns = {key: [_safe(row[key]) for row in rows] for key in rows[0]}
    write_csv(columns, path, "%.12g")


def _safe(value):
    if isinstance(value, bool):
        return _YES[value]
    if isinstance(value, list):
        value = " ".join(map(str, value))
    is_formula = isinstance(value, str) and value.startswith(FORMULA_SIGNS)
    return f"'{value}" if is_formula else value


def write_csv(columns, path, style):
    """Write {heading: cells}; `style` ("%.6f") is that of numbers, "" for none."""
    cells = [_texts(list(values), style) for values in columns.values()]
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*cells, strict=True))


def _texts(values, style):
    """The cells of a column: of floats as `style` says, of nothing empty, of all else its text."""
    types = set(map(type, values))
    if types <= {str, int}:
        return values
    if types <= {float, type(None)}:
        return ["" if x is None or x != x else style % x for x in values]
    return [_text(value, style) for value in values]


def _text(value, style):
    if value is None:
        return ""
    if isinstance(value, float):
        return "" if isnan(value) else style % value
    return value
