"""The tables of readings: one angle in each row, two different ends, sets that say something."""

import math

import numpy as np

from tankcal.errors import SHEET
from tankcal.job.checking import has_rows
from tankcal.job.checks.survey.files import tell_rows
from tankcal.job.checks.survey.instruments import TAKEN_FROM_SETUPS
from tankcal.job.checks.survey.packed_dms import refuse_packed
from tankcal.job.contract.observations import ANGLE_UNITS, ANGLES, READINGS
from tankcal.messages import join_with_or, list_some, message

# correlated_readings.csv: pairs of values that exist, each pair once, and none with itself.

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
                "correlated_with_itself",
                "a value is correlated with itself; expected two different values",
            )
            files.log.problem(table.file, expected, row, "row_2")
            continue
        before = first.setdefault(frozenset(ends), row)
        if before != row:
            expected = message(
                "correlated_twice",
                "this pair is already in row {before}; expected once",
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
            "{axis} in row {at:g} of control has no standard deviation above 0; expected "
            "one: a coordinate that is held, or only approximate, has no correlations",
            axis=axis,
            at=named.rows[place],
        )
    return None, None


BY_CHANCE = 0.1  # share of the rows: coarse readings repeat themselves
MOST_REPEATED = 3  # rows that a warning names


def check_readings(files):
    """All tables of readings, one by one."""
    for name in READINGS:
        table = files.tables[name]
        if not has_rows(table):
            continue
        if name in ANGLES:
            check_angle(files, table, ANGLES[name])
        _refuse_same_ends(files, name, table)
        warn_copies(files, table)
    if has_rows(files.tables["directions"]):
        _warn_single_directions(files, files.tables["directions"])
    if has_rows(files.tables["image_points"]):
        warn_copies(files, files.tables["image_points"])


def check_angle(files, table, angle, *, is_needed=True):
    """One of the units in each row, a column of one unit at least; not needed: at most one."""
    columns = [f"{angle}_{unit}" for unit in ANGLE_UNITS]
    wanted = join_with_or(columns)
    filled = [name for name, values in table.columns.items() if values is not None]
    headings = {*files.raw.tables[files_name(table)].headings, *filled}  # foreign ones by column
    if not any(column in headings for column in columns):
        if not is_needed:
            return
        expected = message(
            "angle_column_missing", "missing column; expected {wanted}", wanted=wanted
        )
        files.log.problem(table.file, expected, None, columns[0])
        return
    sound = files.sound(table)
    count = sum(~np.isnan(table.numbers(column)) for column in columns)
    first = next(column for column in columns if column in headings)
    expected = message("angle_blank", "blank; expected {wanted}", wanted=wanted)
    tell_rows(files.log.problem, table, is_needed & sound & (count == 0), first, expected)
    twice = sound & (count > 1)
    expected = message(
        "angle_in_two_units", "in two units; expected one of {wanted}", wanted=wanted
    )
    tell_rows(files.log.problem, table, twice, first, expected)
    if f"{angle}_deg" in headings:
        refuse_packed(table, f"{angle}_deg", files.log)


def files_name(table):
    """Name of a table of a job from that of its file or sheet."""
    return table.file.removeprefix(SHEET).removesuffix(".csv")


def _refuse_same_ends(files, name, table):
    """Nothing can be measured between one point and itself."""
    ends = ["from", "to"]
    if name == "horizontal_angles":
        ends = ["at", "from", "to"]
    columns = [table.of(end) for end in ends if end in table.columns]
    if name in TAKEN_FROM_SETUPS:
        setups = files.tables["setups"]
        if setups is None:
            return
        stations = dict(zip(setups.of("setup"), setups.of("station"), strict=True))
        columns = [[stations.get(setup) for setup in table.of("setup")], table.of("to")]
    what = name.replace("_", " ").rstrip("s")
    for row, points in zip(table.rows, zip(*columns, strict=True), strict=True):
        given = [point for point in points if point is not None]
        if len(set(given)) == len(given):
            continue
        twice = next(point for point in given if given.count(point) > 1)
        expected = message(
            "between_itself",
            "{kind} between {twice!r} and itself; expected different points",
            kind=what,
            twice=twice,
        )
        if name in TAKEN_FROM_SETUPS:
            expected = message(
                "station_to_itself",
                "{kind} from station {twice!r} to itself; expected another point",
                kind=what,
                twice=twice,
            )
        files.log.problem(table.file, expected, row, "to")


def warn_copies(files, table, *, are_sights=False):
    """Rows that are the same to the last digit, more than chance brings; one warning for a file.

    are_sights  of the wall, of which chance brings none that are alike
    """
    raw = files.raw.tables[files_name(table)]
    first, copies = {}, []
    for row, cells in zip(raw.row_numbers, raw.rows, strict=True):
        try:
            before = first.setdefault(cells, row)
        except TypeError:  # a cell that cannot be compared is told already
            continue
        if before != row:
            copies.append((row, before))
    if len(copies) <= BY_CHANCE * len(raw.rows):
        return
    told = {
        "count": len(copies),
        "pairs": list_some([f"{row} = {before}" for row, before in copies], MOST_REPEATED),
    }
    expected = (
        message(
            "pasted_rows",
            "{count} rows are the same as another one to the last digit (rows {pairs}): was a part"
            " of the file pasted twice?",
            **told,
        )
        if are_sights
        else message(
            "copied_rows",
            "{count} rows are the same as another one to the last digit (rows {pairs}): were "
            "they copied? Each counts as a separate reading",
            **told,
        )
    )
    files.log.warning(table.file, expected, copies[0][0])


def _warn_single_directions(files, table):
    """A direction that is alone in its set only says where the zero of the circle was."""
    sets = {}
    rows = zip(
        table.rows, table.of("setup"), table.of("set"), table.of("to"), table.of("use"), strict=True
    )
    for row, setup, name, to, use in rows:
        if setup is not None and to is not None and use != "check":
            sets.setdefault((setup, name), {})[to] = row
    for (setup, name), seen in sets.items():
        if len(seen) == 1 and not table.skipped:
            where = setup
            if name is not None:
                where = message("set_of_setup", "{setup}, set {set}", setup=setup, set=name)
            expected = message(
                "single_direction",
                "set-up {where} has directions to one point only; they determine only its "
                "orientation",
                where=where,
            )
            files.log.warning(table.file, expected, next(iter(seen.values())), "to")
