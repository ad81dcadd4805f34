"""Differences at check points from an adjustment, from a record, or from a CSV file."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job.field_values import read_value
from tankcal.job.fields import Field, Refused, is_blank
from tankcal.job.folder import read_csv
from tankcal.job.tables import Log, nearest, read_bytes
from tankcal.messages import message

AXES = "xyz"
FARTHEST_M = 1e8  # largest accepted length, m
_POINT = Field(
    "point", "name", message("check_note_point", "name of the check point"), required=True
)
_DIFFERENCES = tuple(f"d{axis}_m" for axis in AXES)
_PAIRS = tuple((f"{axis}_m", f"{axis}_ref_m") for axis in AXES)
_NUMBERS = tuple(
    Field(name, "number", "length, m", low=-FARTHEST_M, high=FARTHEST_M)
    for name in (*_DIFFERENCES, *(name for pair in _PAIRS for name in pair))
)
FORMS = "point, dx_m, dy_m, dz_m or point, x_m, y_m, z_m, x_ref_m, y_ref_m, z_ref_m"


@dataclass(frozen=True)
class Differences:
    """Product minus reference at n points, shape (n, 3), m; nan if it is not known."""

    names: tuple
    difference_m: np.ndarray

    def select_known_axes(self):
        """Return the k axes with at least one known value, and their differences (n, k), m."""
        known = np.isfinite(self.difference_m).any(axis=0)
        return tuple(axis for axis, has in zip(AXES, known, strict=True) if has), (
            self.difference_m[:, known]
        )


def collect_differences(adjustment):
    """Return the differences at the check points of an adjustment or of a record.

    Parameters
    ----------
    adjustment : survey.Adjustment or dict
        Adjustment, record, or the part "adjustment" of a record.

    Returns
    -------
    Differences

    Raises
    ------
    InputError
        If there are no check points.
    """
    if isinstance(adjustment, Mapping):
        part = adjustment.get("adjustment") or adjustment
        check_points = part.get("check_points") if isinstance(part, Mapping) else None
        rows = check_points.get("points") if isinstance(check_points, Mapping) else None
        if not rows:
            raise InputError(
                Problem(
                    "record.json",
                    message("check_no_points_in_record", "no check points; expected one or more"),
                )
            )
        values = [[row.get(name) for name in _DIFFERENCES] for row in rows]
        return Differences(
            tuple(str(row["point"]) for row in rows), np.array(values, dtype=float).reshape(-1, 3)
        )
    check_points = adjustment.check_points
    if check_points is None:
        raise InputError(
            Problem(
                "check.csv",
                message("check_no_points", "no check points; expected one or more"),
            )
        )
    return Differences(tuple(check_points.names), np.array(check_points.difference_m, dtype=float))


def read_differences(path, separator=",", decimal="."):
    """Read differences from a CSV file with the columns of FORMS; axes may be missing or blank.

    Parameters
    ----------
    path : path-like
        Path of the file.
    separator, decimal : str, optional
        Column separator and decimal sign of the file, such as ";" and ",".

    Returns
    -------
    Differences

    Raises
    ------
    InputError
        If the file is invalid; the error lists all problems.
    """
    path, log = Path(path), Log()
    data = read_bytes(path, log)
    table = None if data is None else read_csv(path.name, data, separator, decimal, log)
    if table is None:
        log.stop_if_problems()
    fields = {field.name: field for field in (_POINT, *_NUMBERS)}
    columns = _find_columns(table, fields, log)
    rows = [_read_row(table, i, columns, fields, log) for i in range(len(table.rows))]
    _log_repeated_points(table, rows, log)
    if not (table.rows or table.skipped):
        log.problem(
            table.file,
            message("check_no_rows", "no rows; expected check points"),
            table.heading_row,
        )
    log.stop_if_problems()
    values = np.array([[row.get(name, np.nan) for name in _DIFFERENCES] for row in rows])
    return Differences(tuple(row["point"] for row in rows), values)


def _find_columns(table, fields, log):
    """Return {heading: index} of the known columns; problems are added to the log."""
    columns = {}
    for place, heading in enumerate(table.headings):
        if heading in fields:
            columns[heading] = place
        else:
            text = message(
                "check_unknown_column",
                "unknown column; expected {forms}{hint}",
                forms=FORMS,
                hint=nearest(heading, fields),
            )
            log.problem(table.file, text, table.heading_row, heading)
    if "point" not in columns:
        log.problem(
            table.file,
            message("check_point_column", "missing column; expected the names of points"),
            1,
            "point",
        )
    direct = [name for name in _DIFFERENCES if name in columns]
    paired = [pair for pair in _PAIRS if any(name in columns for name in pair)]
    if direct and paired:
        text = message(
            "check_both_forms",
            "differences and coordinates are both given; expected only one of them: {forms}",
            forms=FORMS,
        )
        log.problem(table.file, text, table.heading_row, direct[0])
    for name in (name for pair in paired for name in pair if name not in columns):
        log.problem(
            table.file,
            message(
                "check_column_of_pair",
                "missing column; the other one of its pair is given, expected both",
            ),
            table.heading_row,
            name,
        )
    if not (direct or paired):
        log.problem(
            table.file,
            message("check_no_differences", "no differences; expected {forms}", forms=FORMS),
            table.heading_row,
        )
    return columns


def _read_row(table, number, columns, fields, log):
    """Return {"point": name, "dx_m": ...} of a row; problems are added to the log."""
    values, row = {}, table.row_numbers[number]
    for name, place in columns.items():
        raw = table.rows[number][place]
        if is_blank(raw):
            if name == "point":
                log.problem(
                    table.file,
                    message("check_point_name", "missing; expected the name of the point"),
                    row,
                    name,
                )
            continue
        try:
            values[name] = read_value(fields[name], raw, table.decimal)
        except Refused as refusal:
            log.problem(table.file, refusal.text, row, name)
            values[name] = None if name == "point" else np.nan
    for difference, pair in zip(_DIFFERENCES, _PAIRS, strict=True):
        is_given = [name in values for name in pair]
        if all(is_given):
            values[difference] = values[pair[0]] - values[pair[1]]
        elif any(is_given):
            missing = pair[is_given.index(False)]
            if missing in columns:
                log.problem(
                    table.file,
                    message(
                        "check_value_of_pair",
                        "missing; the other value of its pair is given, expected both",
                    ),
                    row,
                    missing,
                )
    if not any(name in values for name in _DIFFERENCES) and not any(
        name in values for pair in _PAIRS for name in pair
    ):
        log.problem(
            table.file,
            message("check_row_without", "no difference in this row; expected at least one"),
            row,
        )
    return values


def _log_repeated_points(table, rows, log):
    """Add a problem to the log for each repeated point."""
    seen = {}
    for row, number in zip(rows, table.row_numbers, strict=True):
        name = row.get("point")
        if name in seen and name is not None:
            text = message(
                "check_point_twice",
                "point {point} is already in row {row}; expected once",
                point=name,
                row=seen[name],
            )
            log.problem(table.file, text, number, "point")
        seen.setdefault(name, number)
