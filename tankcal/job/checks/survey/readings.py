"""The tables of readings: one angle in each row, two different ends, sets that say something."""

import numpy as np

from tankcal.job.checks.common import has_rows
from tankcal.job.checks.survey.files import tell_rows
from tankcal.job.checks.survey.instruments import TAKEN_FROM_SETUPS
from tankcal.job.contract.observations import ANGLE_UNITS, ANGLES, READINGS
from tankcal.messages import either, listed, message

BY_CHANCE = 0.1  # share of the rows: coarse readings repeat themselves
MOST_REPEATED = 3  # rows that a warning names


def check_readings(files):
    """All tables of readings, one by one."""
    for name in READINGS:
        table = files.tables[name]
        if not has_rows(table):
            continue
        if name in ANGLES:
            _check_angle(files, table, ANGLES[name])
        _refuse_same_ends(files, name, table)
        _warn_copies(files, table)
    if has_rows(files.tables["directions"]):
        _warn_single_directions(files, files.tables["directions"])
    if has_rows(files.tables["image_points"]):
        _warn_copies(files, files.tables["image_points"])


def _check_angle(files, table, angle):
    """One of the units in each row; a column of one unit at least."""
    columns = [f"{angle}_{unit}" for unit in ANGLE_UNITS]
    wanted = either(columns)
    headings = files.raw.tables[files_name(table)].headings
    if not any(column in headings for column in columns):
        expected = message(
            "angle_column_missing", "missing column; expected {wanted}", wanted=wanted
        )
        files.log.problem(table.file, expected, None, columns[0])
        return
    sound = files.sound(table)
    count = sum(~np.isnan(table.numbers(column)) for column in columns)
    first = next(column for column in columns if column in headings)
    expected = message("angle_blank", "blank; expected {wanted}", wanted=wanted)
    tell_rows(files.log.problem, table, sound & (count == 0), first, expected)
    twice = sound & (count > 1)
    expected = message(
        "angle_in_two_units", "in two units; expected one of {wanted}", wanted=wanted
    )
    tell_rows(files.log.problem, table, twice, first, expected)


def files_name(table):
    """Name of a table of a job from that of its file or sheet."""
    return table.file.removeprefix("sheet ").removesuffix(".csv")


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


def _warn_copies(files, table):
    """Rows that are the same to the last digit, more than chance brings; one warning for a file."""
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
    expected = message(
        "copied_rows",
        "{count} rows are the same as another one to the last digit (rows {pairs}): copied?"
        " Each counts as a reading of its own",
        count=len(copies),
        pairs=listed([f"{row} = {before}" for row, before in copies], MOST_REPEATED),
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
                "set-up {where} has directions to one point only; they determine nothing but its"
                " zero",
                where=where,
            )
            files.log.warning(table.file, expected, next(iter(seen.values())), "to")
