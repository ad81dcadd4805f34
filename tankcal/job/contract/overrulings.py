"""Columns of overrulings.csv, decisions that overrule the outlier test, and their checks.

A row names a point of the wall (a point of points.csv, a target, or a sight by its set-up and row)
or a reading of a survey network by its table and row.
"""

from tankcal.job.checking import has_rows
from tankcal.job.contract.observations import COLUMNS as OF_SURVEYS
from tankcal.job.fields import Field, choice, number
from tankcal.messages import message
from tankcal.methods.base import methods

DECISIONS = ("keep", "leave_out")
_WITHOUT_READINGS = (
    "targets",
    "photos",
    "setups",
    "check",
    "fiducials",
    "film",
    "correlated_readings",
)
READINGS = tuple(name for name in OF_SURVEYS if name not in (*_WITHOUT_READINGS, "control"))
_WALL_WITHOUT_NAMES = (
    "circumferences",
    "offsets",
)
MOST = 200  # largest number of decisions; more would replace the outlier test

OVERRULINGS = (
    Field(
        "point",
        "name",
        "point of the wall, as named in points.csv or targets.csv; for a sight to the wall its"
        " set-up, a space and its row, such as S1 14; blank for a reading",
    ),
    choice("table", "in place of a point: table of a reading of the survey", READINGS),
    number("row", "row of that reading in its table, as numbered in messages", 2, 1e7),
    choice(
        "decision",
        "keep: not rejected, whatever the result of the outlier test; leave_out: removed before"
        " the outlier test",
        DECISIONS,
        required=True,
    ),
    Field("reason", "text", "reason for the decision; stated on the certificate", required=True),
    Field("by", "text", "person who decided"),
    Field("date", "date", "date of the decision"),
)
COLUMNS = {"overrulings": OVERRULINGS}


def check_overrulings(table, tables, is_whole, log):
    """Check that each decision refers to an existing point or reading, and only once.

    Parameters
    ----------
    table : ColumnValues
        Rows of overrulings.csv.
    tables : dict
        ColumnValues of each table of the job by name; None if missing.
    is_whole : bool
        False: only the survey is computed, and points of the wall are not checked.
    log
        Log of the problems.
    """
    if len(table.rows) > MOST:
        expected = message(
            "overrulings_too_many",
            "{count} rows; expected at most {most} decisions that overrule the outlier test",
            count=len(table.rows),
            most=MOST,
        )
        log.problem(table.file, expected)
        return
    known, first_row = names_of_points(tables) if is_whole else None, {}
    columns = map(table.of, ("point", "table", "row"))
    for row, point, reading_table, reading_row in zip(table.rows, *columns, strict=True):
        item = _identify_item(table, row, point, reading_table, reading_row, log)
        if item is None:
            continue
        if item in first_row:
            expected = message(
                "overruled_twice",
                "{what} is decided in row {first_row} already; expected one decision",
                what=point if reading_table is None else f"{reading_table} {item[1]}",
                first_row=first_row[item],
            )
            log.problem(table.file, expected, row, "point" if reading_table is None else "row")
        first_row.setdefault(item, row)
        if reading_table is None:
            _check_point(table, row, point, known, log)
        else:
            _check_reading(table, row, *item, tables, log)


def _identify_item(table, row, point, reading_table, reading_row, log):
    """Return the point or reading of a decision; None after reporting a problem to `log`.

    Parameters
    ----------
    table : ColumnValues
        Rows of overrulings.csv.
    row : int
        Row of the decision.
    point : str or None
    reading_table : str or None
    reading_row : float or None
        Cells of the columns point, table and row.
    log
        Log of the problems.

    Returns
    -------
    (str or None, str or int) or None
        Table of the reading and its row, or None and the name of the point.
    """
    if point is not None and (reading_table is not None or reading_row is not None):
        expected = message(
            "overruled_both", "given beside a point; expected a point, or a table and a row of it"
        )
        log.problem(table.file, expected, row, "table" if reading_table is not None else "row")
        return None
    if point is not None:
        return None, point
    is_reported = any((problem.file, problem.row) == (table.file, row) for problem in log.problems)
    if reading_table is None and reading_row is None and not is_reported:
        expected = message("overruled_nothing", "blank; expected a point, or a table and its row")
        log.problem(table.file, expected, row, "point")
    if (reading_table is None) != (reading_row is None) and not is_reported:
        expected = message("overruled_half", "blank; expected a table together with a row of it")
        log.problem(table.file, expected, row, "table" if reading_table is None else "row")
    if None in (reading_table, reading_row):
        return None
    if reading_row != int(reading_row):
        expected = message(
            "row_not_whole", "found {value:g}; expected a whole number", value=reading_row
        )
        log.problem(table.file, expected, row, "row")
        return None
    return reading_table, int(reading_row)


def names_of_points(tables):
    """Return the names of the points of the wall, as keys of a dict.

    Parameters
    ----------
    tables : dict
        ColumnValues of each table of the job by name; None if missing.

    Returns
    -------
    dict or None
        Empty if the points of the wall have no names; None if they are not known, because a table
        is unreadable or the points result from an adjustment.
    """
    names = []
    if any(method.has_means and method.is_given(tables) for method in methods()):
        return {}
    for name in ("points", "targets"):
        if has_rows(tables[name]):
            if tables[name].skipped:
                return None
            names += tables[name].of("point")
    of_methods = (method.tables[0] for method in methods() if method.has_named_points)
    for name in of_methods:
        if has_rows(tables[name]):
            if tables[name].skipped:
                return None
            sights = zip(tables[name].of("setup"), tables[name].rows, strict=True)
            names += [f"{setup} {row}" for setup, row in sights]
    if not names and any(has_rows(tables[name]) for name in READINGS):
        return None  # the wall is selected from adjusted points
    unnamed = [method.tables for method in methods() if not method.has_named_points]
    without_names = (*_WALL_WITHOUT_NAMES, *(table for tables_of in unnamed for table in tables_of))
    if not names and not any(has_rows(tables[name]) for name in without_names):
        return None  # missing or unreadable wall, reported elsewhere
    return dict.fromkeys(names)


def _check_point(table, row, point, known, log):
    """Check that a point of the wall exists; known: names of the points, None if unknown."""
    if known is None or point in known:
        return
    expected = message(
        "overruled_unknown",
        "found {point!r}; expected a point of points.csv or targets.csv, or for a sight its"
        " set-up, a space and its row",
        point=point,
    )
    if not known:
        expected = message(
            "overruled_nameless",
            "found {point!r}, but this job has no named points of the wall; readings of tapes,"
            " reference lines, clouds and liquid cannot be overruled",
            point=point,
        )
    log.problem(table.file, expected, row, "point")


def _check_reading(table, row, reading_table, reading_row, tables, log):
    """Check that a reading exists, is adjusted, and is not correlated with another value."""
    readings = tables[reading_table]
    if readings is None or (readings.skipped and reading_row not in readings.rows):
        if readings is None:
            expected = message(
                "overruled_no_table", "found {of}; the job has no such table", of=reading_table
            )
            log.problem(table.file, expected, row, "table")
        return
    if reading_row not in readings.rows:
        expected = message(
            "overruled_no_row",
            "found {number}; {file} has no reading in that row",
            number=reading_row,
            file=readings.file,
        )
        log.problem(table.file, expected, row, "row")
    elif _is_correlated(tables["correlated_readings"], reading_table, reading_row):
        expected = message(
            "overruled_correlated",
            "row {number} of {file} is correlated with another value; expected an uncorrelated"
            " reading: remove the pair from correlated_readings first",
            number=reading_row,
            file=readings.file,
        )
        log.problem(table.file, expected, row, "row")
    elif "use" in readings.columns:
        use = readings.of("use")[readings.rows.index(reading_row)]
        if use == "check":
            expected = message(
                "overruled_check",
                "row {number} of {file} is only compared (use = check); expected an adjusted"
                " reading",
                number=reading_row,
                file=readings.file,
            )
            log.problem(table.file, expected, row, "row")


def _is_correlated(pairs, reading_table, reading_row):
    """Determine whether a reading is part of a pair of correlated_readings.csv."""
    if pairs is None:
        return False
    ends = (zip(pairs.of(f"table_{i}"), pairs.of(f"row_{i}"), strict=True) for i in "12")
    return any((reading_table, reading_row) in end for end in ends)
