"""overrulings.csv: its columns; who was overruled, by whom and why, and the checks of it.

A row names a point of the wall (a point of points.csv, a target, or a sight by its set-up and row)
or a reading of a survey network by its table and row.
"""

from tankcal.job.checking import has_rows
from tankcal.job.contract.observations import COLUMNS as OF_SURVEYS
from tankcal.job.contract.shorthand import choice, number
from tankcal.job.fields import Field
from tankcal.messages import message

DECISIONS = ("keep", "leave_out")
_BESIDE = ("targets", "photos", "setups", "check", "fiducials", "film", "correlated_readings")
READINGS = tuple(name for name in OF_SURVEYS if name not in (*_BESIDE, "control"))
_NAMELESS = (
    "circumferences",
    "offsets",
    "liquid",
    "radii",
    "rings",
    "great_circles",
    "scan_targets",
)
MOST = 200  # whoever overrules more than that does not overrule a search, but replaces it

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
    """Each decision of something that the job has, once, and with a reason.

    tables    {name: ColumnValues, or None: not there}
    is_whole  False: the survey alone is asked for, and points of the wall are not looked at
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
    for row, point, of, number_of in zip(table.rows, *columns, strict=True):
        what = _what(table, row, point, of, number_of, log)
        if what is None:
            continue
        if what in first_row:
            expected = message(
                "overruled_twice",
                "{what} is decided in row {first_row} already; expected one decision",
                what=point if of is None else f"{of} {what[1]}",
                first_row=first_row[what],
            )
            log.problem(table.file, expected, row, "point" if of is None else "row")
        first_row.setdefault(what, row)
        if of is None:
            _check_point(table, row, point, known, log)
        else:
            _check_reading(table, row, of, what[1], tables, log)


def _what(table, row, point, of, number_of, log):
    """(table or None, name or row) of what is decided; None after telling `log` that it is none."""
    if point is not None and (of is not None or number_of is not None):
        expected = message(
            "overruled_both", "given beside a point; expected a point, or a table and a row of it"
        )
        log.problem(table.file, expected, row, "table" if of is not None else "row")
        return None
    if point is not None:
        return None, point
    bad = _are_told(table, row, log)
    if of is None and number_of is None and not bad:
        expected = message("overruled_nothing", "blank; expected a point, or a table and its row")
        log.problem(table.file, expected, row, "point")
    if (of is None) != (number_of is None) and not bad:
        expected = message("overruled_half", "blank; expected a table together with a row of it")
        log.problem(table.file, expected, row, "table" if of is None else "row")
    if None in (of, number_of):
        return None
    if number_of != int(number_of):
        expected = message(
            "row_not_whole", "found {value:g}; expected a whole number", value=number_of
        )
        log.problem(table.file, expected, row, "row")
        return None
    return of, int(number_of)


def names_of_points(tables):
    """{name: None} of what the wall is taken from; None: it, or a part of it, cannot be read.

    tables  {name: ColumnValues, or None: not there}
    """
    names = []
    if has_rows(tables["clouds"]):
        return {}
    for name in ("points", "targets"):
        if has_rows(tables[name]):
            if tables[name].skipped:
                return None
            names += tables[name].of("point")
    for name in ("wall_hits", "tangents"):
        if has_rows(tables[name]):
            if tables[name].skipped:
                return None
            own = zip(tables[name].of("setup"), tables[name].rows, strict=True)
            names += [f"{setup} {row}" for setup, row in own]
    if not names and any(has_rows(tables[one]) for one in READINGS):
        return None  # the adjusted points, among which the wall is searched
    if not names and not any(has_rows(tables[one]) for one in _NAMELESS):
        return None  # what shows the wall is missing or cannot be read, which is told by itself
    return dict.fromkeys(names)


def _check_point(table, row, point, known, log):
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


def _check_reading(table, row, of, number_of, tables, log):
    readings = tables[of]
    if readings is None or (readings.skipped and number_of not in readings.rows):
        if readings is None:
            expected = message("overruled_no_table", "found {of}; the job has no such table", of=of)
            log.problem(table.file, expected, row, "table")
        return
    if number_of not in readings.rows:
        expected = message(
            "overruled_no_row",
            "found {number}; {file} has no reading in that row",
            number=number_of,
            file=readings.file,
        )
        log.problem(table.file, expected, row, "row")
    elif _is_correlated(tables["correlated_readings"], of, number_of):
        expected = message(
            "overruled_correlated",
            "row {number} of {file} is correlated with another value; expected an uncorrelated"
            " reading: remove the pair from correlated_readings first",
            number=number_of,
            file=readings.file,
        )
        log.problem(table.file, expected, row, "row")
    elif "use" in readings.columns:
        use = readings.of("use")[readings.rows.index(number_of)]
        if use == "check":
            expected = message(
                "overruled_check",
                "row {number} of {file} is only compared (use = check); expected an adjusted"
                " reading",
                number=number_of,
                file=readings.file,
            )
            log.problem(table.file, expected, row, "row")


def _is_correlated(pairs, of, number_of):
    if pairs is None:
        return False
    ends = (zip(pairs.of(f"table_{i}"), pairs.of(f"row_{i}"), strict=True) for i in "12")
    return any((of, number_of) in end for end in ends)


def _are_told(table, row, log):
    """Was a cell of that row told to be bad already?"""
    return any((one.file, one.row) == (table.file, row) for one in log.problems)
