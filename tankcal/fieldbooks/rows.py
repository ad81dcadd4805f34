"""Classification of readings on face 1, and the rows of the tables of a job.

Readings are hits of the wall, control targets, or targets that tie set-ups.
"""

import re
from collections import Counter
from dataclasses import dataclass
from fnmatch import fnmatchcase

from tankcal.job.contract import COLUMNS
from tankcal.job.contract.observations import (
    CONTROL,
    DIRECTIONS,
    SETUPS,
    SLOPE_DISTANCES,
    ZENITH_ANGLES,
)
from tankcal.job.field_values import read_value
from tankcal.job.fields import Refused
from tankcal.messages import message

CONTRACT = {
    "setups": SETUPS,
    "wall_hits": COLUMNS["wall_hits"],
    "control_readings": COLUMNS["control_readings"],
    "directions": DIRECTIONS,
    "zenith_angles": ZENITH_ANGLES,
    "slope_distances": SLOPE_DISTANCES,
    "control": CONTROL,
}
ANGLE_DECIMALS, LENGTH_DECIMALS = 7, 6  # 0.0004 seconds of arc, a micrometre
HIT_PREFIXES = ("WALL", "HIT", "PAREDE", "PARED")  # of names and codes of hits
MOST_NAMES = 8  # largest number of names in a message
_RANGE = re.compile(r"(\d{1,9})-(\d{1,9})")


@dataclass(frozen=True)
class SortedReadings:
    """Readings by kind; each a tuple of Pointing.

    Attributes
    ----------
    hits : tuple
        Reflectorless readings of the wall.
    control : tuple
        Repeated readings of control targets, for drift.
    ties : tuple
        Readings of targets that tie set-ups.
    """

    hits: tuple
    control: tuple
    ties: tuple


def matches_pattern(shot, patterns):
    """Return whether a pattern (1-200, or with * and ?) matches the name or code of a shot."""
    for pattern in patterns:
        limits = _RANGE.fullmatch(pattern)
        if limits and shot.point.isascii() and shot.point.isdigit():
            if int(limits[1]) <= int(shot.point[:18]) <= int(limits[2]):
                return True
        elif any(fnmatchcase(text.upper(), pattern.upper()) for text in (shot.point, shot.code)):
            return True
    return False


def _is_named_hit(shot):
    """Return whether the name or the code identifies a shot as a hit."""
    return any(text.upper().startswith(HIT_PREFIXES) for text in (shot.point, shot.code))


def sort_readings(readings, choices, known, log, leave_out):
    """Return the SortedReadings readings of all books.

    Parameters
    ----------
    readings : list of Pointing
    choices : Choices
    known : set of str
        Points with known coordinates.
    log : Log
    leave_out : callable
        leave_out(what, Pointing), called for each reading that is not used.
    """
    hits, control, others = [], [], []
    for reading in readings:
        shot = reading.shot
        if matches_pattern(shot, choices.leave):
            leave_out(message("left_by_choice", "left out by choice"), reading)
        elif matches_pattern(shot, choices.control):
            control.append(reading)
        elif matches_pattern(shot, choices.check) or (
            matches_pattern(shot, choices.hits) if choices.hits else _is_named_hit(shot)
        ):
            hits.append(reading)
        else:
            others.append(reading)
    if not hits and not choices.no_hits:
        _refuse_without_hits(readings, log)
    whole = [reading for reading in hits if None not in _values(reading.shot)]
    for reading in hits:
        if None in _values(reading.shot):
            leave_out(message("hit_not_whole", "hits without direction, zenith angle or distance"),
                      reading)  # fmt: skip
    setups_of_hits = {reading.shot.setup for reading in whole}
    targets = _targets(control, others, setups_of_hits, choices, known, leave_out)
    return SortedReadings(tuple(whole), *targets)


def _values(shot):
    """Return direction, zenith angle and distance."""
    return shot.direction_deg, shot.zenith_deg, shot.distance_m


def _targets(control, others, of_hits, choices, known, leave_out):
    """Return (control readings, ties), from the number of readings of each target.

    of_hits  indices of the set-ups of hits; a single set-up needs no tie
    """
    targets = sorted(
        (*others, *control), key=lambda reading: (reading.shot.setup, reading.shot.row)
    )
    setups, selected = {}, {id(reading) for reading in control}
    for reading in targets:
        setups.setdefault(reading.shot.point, set()).add(reading.shot.setup)
    times = Counter((reading.shot.setup, reading.shot.point) for reading in targets)
    are_several = len({reading.shot.setup for reading in targets} | of_hits) > 1
    again, ties = [], []
    for reading in targets:
        name = reading.shot.point
        is_tie = choices.no_hits or (are_several and (len(setups[name]) > 1 or name in known))
        is_again = id(reading) in selected or (
            times[reading.shot.setup, name] > 1 and not (choices.control or choices.no_hits)
        )
        if is_tie:
            ties.append(reading)
        if is_again:
            again.append(reading)
        if not is_tie and not is_again:
            what = message(
                "ties_nothing",
                "targets that tie no set-ups: read once, from one set-up or from the only set-up",
            )
            leave_out(what, reading)
    return tuple(again), tuple(ties)


def _refuse_without_hits(readings, log):
    """Report that no reading is a hit."""
    names = _join_ranges([reading.shot.point for reading in readings])
    shown = [*names[:MOST_NAMES], *(["..."] if len(names) > MOST_NAMES else [])]
    text = message(
        "which_are_hits",
        "none of the points {names} is identified as a hit; expected --hits with names or "
        "codes, such as --hits '1-200' or --hits 'W*', or --no-hits",
        names=", ".join(shown) or "-",
    )
    log.problem("--hits", text)


def _join_ranges(names):
    """Return names in their order, with consecutive numbers as 1-200."""
    runs = []
    for name in dict.fromkeys(names):
        if name.isascii() and name.isdigit() and len(name) < 10:
            number = int(name)
            if runs and isinstance(runs[-1], list) and runs[-1][1] == number - 1:
                runs[-1][1] = number
                continue
            runs.append([number, number])
        else:
            runs.append(name[:30])
    return [
        run if isinstance(run, str) else str(run[0]) if run[0] == run[1] else f"{run[0]}-{run[1]}"
        for run in runs
    ]


# ---- rows of the tables


@dataclass(frozen=True)
class Row:
    """One row of a table, {column: text}, with its source."""

    cells: dict
    file: str
    row: int


def make_rows(setups, names, stations, sorted_readings, choices):
    """Return {table: list of Row}, without empty tables.

    Parameters
    ----------
    setups : dict
        {index: (SetUp, file)}
    names : dict
        {index: name of the set-up in the job}
    stations : dict
        {point: (xyz, file, row)} for control.csv.
    sorted_readings : SortedReadings
    choices : Choices
    """
    tables = {name: [] for name in CONTRACT}
    for place, name in names.items():
        setup, file = setups[place]
        cells = {
            "setup": name,
            "station": setup.station,
            "instrument": choices.instrument,
            "instrument_height_m": _length(setup.height_m),
        }
        tables["setups"].append(Row(cells, file, setup.row))
    for reading in sorted_readings.hits:
        cells = _both_angles(reading.shot)
        if matches_pattern(reading.shot, choices.check):
            cells["use"] = "check"
        tables["wall_hits"].append(_row(reading, names, cells, distance=True, time=True))
    for reading in sorted_readings.control:
        cells = {"target": reading.shot.point} | _both_angles(reading.shot)
        tables["control_readings"].append(_row(reading, names, cells, distance=True, time=True))
    for reading in sorted_readings.ties:
        _add_tie_rows(tables, reading, names, choices)
    for point, (xyz, file, row) in stations.items():
        cells = {"point": point} | dict(zip(("x_m", "y_m", "z_m"), map(_length, xyz), strict=True))
        tables["control"].append(Row(cells, file, row))
    return {name: rows for name, rows in tables.items() if rows}


def _row(reading, names, cells, *, distance=False, time=False):
    """Return the Row of a reading."""
    shot = reading.shot
    cells = {"setup": names[shot.setup]} | cells
    if distance:
        cells["distance_m"] = _length(shot.distance_m)
    if time:
        cells["time"] = "" if shot.time is None else shot.time.isoformat(timespec="seconds")
    return Row(cells, shot.file, shot.row)


def _both_angles(shot):
    """Return the cells of direction and zenith angle."""
    return {
        "direction_deg": _angle(shot.direction_deg),
        "zenith_deg": _angle(shot.zenith_deg),
    }


def _add_tie_rows(tables, reading, names, choices):
    """Add the rows of a reading that ties set-ups."""
    shot = reading.shot
    height = _length(shot.target_height_m)
    seconds, millimetres = _number(choices.targets_arcsec), _number(choices.targets_mm)
    for table, column, text, sd in (
        ("directions", "direction_deg", _angle(shot.direction_deg), ("s_arcsec", seconds)),
        ("zenith_angles", "zenith_deg", _angle(shot.zenith_deg), ("s_arcsec", seconds)),
        ("slope_distances", "distance_m", _length(shot.distance_m), ("s_mm", millimetres)),
    ):
        if text:
            cells = {"to": shot.point, column: text, sd[0]: sd[1], "target_height_m": height}
            tables[table].append(_row(reading, names, cells))


def _angle(value):
    return "" if value is None else _plain(value, ANGLE_DECIMALS)


def _length(value):
    return "" if value is None else _plain(value, LENGTH_DECIMALS)


def _number(value):
    return "" if value is None else f"{value:g}"


def _plain(value, decimals):
    """Format a number without final zeros, with at least three decimals."""
    text = f"{value:.{decimals}f}"
    while text.endswith("0") and len(text) - text.index(".") > 4:
        text = text[:-1]
    return text


def check_rows(tables, log):
    """Report values that the tables of a job do not allow, each once, with the source row."""
    reported = set()
    for table, rows in tables.items():
        for field in CONTRACT[table]:
            for row in rows:
                text = row.cells.get(field.name, "")
                if not text:
                    if field.required:
                        _refuse(log, row, table, field)
                    continue
                try:
                    read_value(field, text, ".")
                except Refused as error:
                    if (field.name, text) not in reported:
                        log.problem(row.file, error.text, row.row, f"{table}.{field.name}")
                    reported.add((field.name, text))


def _refuse(log, row, table, field):
    expected = message(
        "imported_blank", "not in the file; expected {wanted}", wanted=field.expectation()
    )
    log.problem(row.file, expected, row.row, f"{table}.{field.name}")


def needed_columns(table, rows):
    """Return the columns that a table needs, in the order of the job format."""
    return [
        field.name
        for field in CONTRACT[table]
        if field.required or any(row.cells.get(field.name) for row in rows)
    ]
