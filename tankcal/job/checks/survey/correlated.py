"""correlated_readings.csv: pairs of values that exist, each pair once, and none with itself."""

import math

from tankcal.job.checks.common import has_rows
from tankcal.messages import message

OF_AXES = ("control", "vectors")  # tables with x, y and z in a row


def check_correlated(files):
    """Every pair names two values of two rows that are adjusted."""
    table = files.tables["correlated_readings"]
    if not has_rows(table):
        return
    first = {}
    columns = [table.of(f"{what}_{i}") for i in "12" for what in ("table", "row", "value")]
    for row, *cells in zip(table.rows, *columns, strict=True):
        ends = []
        for i, (name, at, axis) in enumerate((cells[:3], cells[3:]), start=1):
            if name is None or at is None:
                break  # told already
            column, expected = _doubt_of_end(files.tables[name], name, at, axis)
            if column:
                files.log.problem(table.file, expected, row, f"{column}_{i}")
                break
            ends.append((name, int(at), axis))
        if len(ends) < 2:
            continue
        if ends[0] == ends[1]:
            expected = message(
                "correlated_with_itself", "a value with itself; expected two different values"
            )
            files.log.problem(table.file, expected, row, "row_2")
            continue
        before = first.setdefault(frozenset(ends), row)
        if before != row:
            expected = message(
                "correlated_twice",
                "this pair is there already, in row {before}; expected once",
                before=before,
            )
            files.log.problem(table.file, expected, row, "row_2")


def _doubt_of_end(named, name, at, axis):
    """Column ("row" or "value") and text of what is wrong with one end of a pair, or (None, None).

    named  the table of that name, None: not there        at, axis  row and x, y or z, or None
    """
    if named is None or at not in named.rows:
        return "row", message(
            "correlated_no_such_row",
            "found {at:g}, and {table} has no such row; expected a row of that table, the heading"
            " being row 1",
            at=at,
            table=name,
        )
    place = list(named.rows).index(at)
    if "use" in named.columns and named.of("use")[place] == "check":
        return "row", message(
            "correlated_only_compared",
            "row {at:g} of {table} is only compared (use = check); expected one that is adjusted",
            at=at,
            table=name,
        )
    if name == "control" and axis is not None:
        return _doubt_of_control(named, place, axis)
    if (name in OF_AXES) == (axis is not None):
        return None, None
    if axis is None:
        return "value", message(
            "correlated_which_axis",
            "expected x, y or z, which of the three values of a row of {table} it is",
            table=name,
        )
    return "value", message(
        "correlated_one_value",
        "found {axis}; expected nothing: a row of {table} has one value",
        axis=axis,
        table=name,
    )


def _doubt_of_control(named, place, axis):
    """The same of a control coordinate: it must be an observation in the survey's own system."""
    if "system" in named.columns and named.of("system")[place] is not None:
        return "row", message(
            "correlated_other_system",
            "row {at:g} of control is in the system {system}; expected one in the system of the"
            " survey: coordinates of further systems have no correlations",
            at=named.rows[place],
            system=named.of("system")[place],
        )
    sd = named.numbers(f"s{axis}_mm")[place] if f"s{axis}_mm" in named.columns else math.nan
    if not sd > 0:
        return "value", message(
            "correlated_no_observation",
            "{axis} in row {at:g} of control has no standard deviation above 0; expected one: what"
            " is held, or only approximate, is correlated with nothing",
            axis=axis,
            at=named.rows[place],
        )
    return None, None
