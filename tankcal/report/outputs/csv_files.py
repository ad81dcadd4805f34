"""Tables as CSV files, formatted by columns, since a survey may have 200 000 readings."""

import csv
import io
from math import isnan

import numpy as np

from tankcal.job.covariance import MAX_POINTS
from tankcal.methods.base import methods
from tankcal.record.columns import ArrayColumns, Texts, count_rows, values_of
from tankcal.report import numbers
from tankcal.report.tables import (
    capacity,
    readings,
    ship,
    survey,
    tank,
)
from tankcal.text.delimited import guard_formula
from tankcal.text.digits import PROGRAM, decimals_of_rows, fixed

BLOCK = 10_000  # number of rows that are formatted at a time
_YES = {True: "yes", False: "no"}
LEAST_DECIMALS = 6  # smallest number of decimals: volumes to millilitres
FILES = (
    "points.csv",
    "points_cov.npz",
    "sections.csv",
    *(file for method in methods() for file in method.csv_files),
    "capacity.csv",
    "ship_corrections.csv",
    "photos.csv",
    "cameras.csv",
    "groups.csv",
    "residuals.csv",
)


def write_table(table, path, rows):
    """Write a declared Table with its headings.

    Parameters
    ----------
    table : Table
        Declaration of the table.
    path : Path
        Path of the file.
    rows : list of dict, dict or ArrayColumns
        Rows, or columns {key: values}. Columns without values are omitted.
    """
    if isinstance(rows, ArrayColumns):
        values_of = rows.arrays
    else:
        values_of = rows if isinstance(rows, dict) else _columns_of_rows(rows)
    columns = {}
    for column in table.in_csv():
        if column.key not in values_of:
            continue
        cells = _plain(values_of[column.key], numbers.unit(column.csv_unit).factor)
        columns |= _spread(column.csv, cells)
    write_csv(columns, path, table.csv_style)


def _columns_of_rows(rows):
    keys = dict.fromkeys(key for row in rows for key in row)
    return {key: [row.get(key) for row in rows] for key in keys}


def _plain(values, factor):
    """Convert values by a factor of unit; True and False become yes and no."""
    if isinstance(values, Texts):
        return values
    if isinstance(values, np.ndarray):
        if values.dtype == bool:
            return Texts(values.astype(np.intp), ("no", "yes"))
        return values if factor == 1.0 or values.dtype.kind != "f" else factor * values
    types = set(map(type, values))
    if bool in types:
        return [_YES.get(value, value) for value in values]
    if factor == 1.0:
        return values
    return [None if value is None else factor * value for value in values]


def _spread(heading, cells):
    """Return a column; a column of lists becomes several columns, such as id_1 and id_2."""
    if isinstance(cells, Texts) and cells.codes.ndim > 1:
        each = [Texts(codes, cells.texts) for codes in cells.codes.T]
    elif not isinstance(cells, list) or not any(isinstance(cell, list) for cell in cells):
        return {heading: cells}
    else:
        width = max(map(len, cells), default=0)
        padded = ([*cell, *[""] * (width - len(cell))] for cell in cells)
        each = map(list, zip(*padded, strict=True))
    return {f"{heading}_{i}": column for i, column in enumerate(each, 1)}


def write_rows(rows, path):
    """Write rows (list of dict with equal keys) with twelve digits; lists are joined by spaces."""
    columns = {key: [_plain_cell(row[key]) for row in rows] for key in rows[0]}
    write_csv(columns, path, "%.12g")


def _plain_cell(value):
    if isinstance(value, bool):
        return _YES[value]
    return " ".join(map(str, value)) if isinstance(value, list) else value


def write_csv(columns, path, style):
    """Write columns as a CSV file.

    Parameters
    ----------
    columns : dict
        {heading: cells}, all of equal length.
    path : Path
        Path of the file.
    style : str
        Format of floats, such as "%.6f".
    """
    columns = {heading: _cells(values) for heading, values in columns.items()}
    count = len(next(iter(columns.values()), ()))
    with open(path, "w", encoding="utf-8", newline="") as file:
        file.write(",".join(map(_quoted, columns)) + "\n")
        for start in range(0, count, BLOCK):
            cells = [_texts(column[start : start + BLOCK], style) for column in columns.values()]
            file.write("\n".join(map(",".join, zip(*cells, strict=True))) + "\n")


def _cells(values):
    """Return a column as numbers or as quoted texts."""
    if isinstance(values, Texts):
        return values.mapped(_quoted).filled("")
    return values if isinstance(values, np.ndarray) else list(values)


def _texts(values, style):
    """Return the cells of a column: floats in the format `style`, missing values empty."""
    if isinstance(values, np.ndarray):
        if values.dtype == object:
            return values.tolist()
        values = values_of(values)
    types = set(map(type, values))
    if types <= {int}:
        return list(map(str, values))
    if types <= {float, type(None)}:
        return ["" if x is None or x != x else style % x for x in values]
    return [_text(value, style) for value in values]


def _text(value, style):
    if value is None:
        return ""
    if isinstance(value, float):
        return "" if isnan(value) else style % value
    return _quoted(str(value))


def _quoted(text):
    """Return a text as a cell, quoted if necessary and never a formula."""
    if text.isalnum():
        return text
    text = guard_formula(text)
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow((text, ""))
    return line.getvalue().removesuffix(",\n")


# ---- the CSV files: tables of the record in metres, millimetres and degrees


def write_tables(record, directory):
    """Write all tables of the record with rows as CSV files."""
    tables = {
        "points": (survey.POINTS, survey.point_columns(record)),
        "sections": (tank.SECTIONS, None),
    }
    for method in methods():
        if record.get(method.name):
            tables |= {name: (table, None) for name, table in method.csv_tables(record).items()}
    if record["capacity"]:
        tables["capacity"] = capacity.capacity_table(record), _capacity(record)
    if record.get("ship"):
        tables["ship_corrections"] = ship.CORRECTIONS, ship.corrections_columns(record)
    if record["adjustment"]:
        cameras, observed = (record["adjustment"][key] for key in ("cameras", "residuals"))
        free = dict.fromkeys(name for camera in cameras for name in camera["free"])
        tables |= {
            "photos": (survey.PHOTOS, None),
            "cameras": (survey.camera_table(free), None),
            "groups": (readings.GROUPS, None),
            "residuals": (readings.READINGS, readings.convert_units(observed)),
        }
    for name, (table, columns) in tables.items():
        rows = table.rows(record) if columns is None else columns
        if len(rows) and (columns is None or count_rows(columns)):
            write_table(table, directory / f"{name}.csv", rows)


def write_covariance(adjustment, directory):
    """Write points_cov.npz, the full covariance matrix of all points, in the format of a job.

    The file is omitted if the survey exceeds the limit of a job with a full covariance matrix. The
    record contains the covariance matrix of each point.
    """
    if len(adjustment.names) <= MAX_POINTS:
        np.savez(
            directory / "points_cov.npz",
            covariance_m2=adjustment.full_covariance_m2(),
            points=np.array(adjustment.names, dtype=str),
        )


def _capacity(record):
    """Return the columns of the capacity table, with volumes rounded to the digits of U."""
    columns = capacity.capacity_columns(record)
    digits = decimals_of_rows(columns["stated_U_m3"], least=LEAST_DECIMALS)
    return {
        key: [fixed(value, places, PROGRAM) for value, places in zip(values, digits, strict=True)]
        if "_m3" in key
        else values
        for key, values in columns.items()
    }
