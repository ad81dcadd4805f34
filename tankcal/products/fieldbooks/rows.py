"""Rows of the tables of a job from readings of an instrument, written all or none.

Mean of both faces, classification of readings, and the rows of the tables of a job.

Readings are hits of the wall, control targets, or targets that tie set-ups. The readings of a
target on both faces determine the collimation and index errors of the instrument:

    c = (hz1 - hz2 + 180) / 2 . sin z        collimation error
    i = (v1 + v2 - 360) / 2                  index error of the vertical circle

The mean of both faces contains neither c nor i. A single reading on face 2 is converted to face 1.
Single readings are corrected with the mean c and i of the pairs of their set-up:

    hz = hz1 - c / sin z,    v = v1 - i

Writing of imported tables to the folder of a job, all or nothing.

A table with headings only, as written by `tankcal new`, is filled in. A table with rows is kept and
the import is refused, unless it is to be replaced.
"""

import io
import math
import os
import re
import shutil
import tempfile
from collections import Counter
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

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
from tankcal.job.folder import csv_marks, read_toml
from tankcal.job.tables import SETTINGS_FILE, Log, read_bytes
from tankcal.messages import message
from tankcal.products.fieldbooks.book import FULL_TURN, HALF_TURN
from tankcal.text.delimited import write_guarded

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
NO_PAIR_DEG = 0.1  # largest difference of the two faces of one point
LARGE_DEG = 0.0045  # 0.005 gon: larger errors cause a warning (own choice)
LARGE_M = 0.005  # largest difference of the distances on both faces
DEGREE = math.pi / HALF_TURN


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
    whole = [reading for reading in hits if None not in _readings_of_shot(reading.shot)]
    for reading in hits:
        if None in _readings_of_shot(reading.shot):
            leave_out(message("hit_not_whole", "hits without direction, zenith angle or distance"),
                      reading)  # fmt: skip
    setups_of_hits = {reading.shot.setup for reading in whole}
    targets = _targets(control, others, setups_of_hits, choices, known, leave_out)
    return SortedReadings(tuple(whole), *targets)


def _readings_of_shot(shot):
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
                        expected = message(
                            "imported_blank",
                            "not in the file; expected {wanted}",
                            wanted=field.expectation,
                        )
                        log.problem(row.file, expected, row.row, f"{table}.{field.name}")
                    continue
                try:
                    read_value(field, text, ".")
                except Refused as error:
                    if (field.name, text) not in reported:
                        log.problem(row.file, error.text, row.row, f"{table}.{field.name}")
                    reported.add((field.name, text))


def needed_columns(table, rows):
    """Return the columns that a table needs, in the order of the job format."""
    return [
        field.name
        for field in CONTRACT[table]
        if field.required or any(row.cells.get(field.name) for row in rows)
    ]


@dataclass(frozen=True)
class Pointing:
    """Result of pointings to one point on face 1: one face, or the mean of both.

    Attributes
    ----------
    shot : Shot
        Values of face 1.
    faces : str
        "1", "2" or "both".
    """

    shot: object
    faces: str


@dataclass(frozen=True)
class FaceReport:
    """Instrument errors from the pairs of a set-up; degrees, metres.

    Attributes
    ----------
    setup : int
    pairs : int
    single : tuple
        Number of single readings on face 1 and on face 2.
    collimation, index : tuple or None
        (mean, largest deviation from the mean); None without pairs.
    apart_m : float
        Largest difference of the distances of a pair.
    """

    setup: int
    pairs: int
    single: tuple
    collimation: tuple | None
    index: tuple | None
    apart_m: float


def reduce_faces(shots, log):
    """Return the pointings in the order of the shots, and a FaceReport for each set-up.

    The second face of a point is the next shot with its name on the other face of the same set-up.
    """
    mates, waiting = {}, {}
    for place, shot in enumerate(shots):
        stack = waiting.setdefault((shot.setup, shot.point), [])
        if stack and shots[stack[-1]].face != shot.face:
            mates[stack.pop()] = place
        else:
            stack.append(place)
    readings, errors, seconds = [], {}, set(mates.values())
    for place, shot in enumerate(shots):
        tally = errors.setdefault(shot.setup, {"pairs": [], "1": 0, "2": 0, "apart": 0.0})
        if place in seconds:
            continue
        if place in mates:
            pair = sorted((shot, shots[mates[place]]), key=lambda member: member.face)
            mean = _mean(*pair, tally, log)
            if mean is not None:
                readings.append(Pointing(replace(mean, row=shot.row, time=shot.time), "both"))
        else:
            tally[str(shot.face)] += 1
            readings.append(Pointing(_convert_to_face_1(shot), str(shot.face)))
    reports = {
        setup: FaceReport(
            setup,
            len(tally["pairs"]),
            (tally["1"], tally["2"]),
            _spread([collimation for collimation, _ in tally["pairs"] if collimation is not None]),
            _spread([index for _, index in tally["pairs"] if index is not None]),
            tally["apart"],
        )
        for setup, tally in errors.items()
    }
    return [_correct_single(reading, reports[reading.shot.setup]) for reading in readings], [
        *reports.values()
    ]


def _correct_single(reading, report):
    """Return a single reading corrected by the mean c and i of its set-up."""
    if reading.faces == "both":
        return reading
    # Readings of face 2 are already converted to face 1, which reverses the sign.
    sign = 1.0 if reading.faces == "1" else -1.0
    shot, sine = reading.shot, 1.0
    if shot.zenith_deg is not None and report.index is not None:
        shot = replace(shot, zenith_deg=shot.zenith_deg - sign * report.index[0])
    if shot.zenith_deg is not None:
        sine = _sine(shot.zenith_deg)
    if shot.direction_deg is not None and report.collimation is not None:
        direction = shot.direction_deg - sign * report.collimation[0] / sine
        shot = replace(shot, direction_deg=direction % FULL_TURN)
    return replace(reading, shot=shot)


def _sine(zenith):
    """Return the sine of a zenith angle in degrees, at least 0.001."""
    return max(math.sin(zenith * DEGREE), 1e-3)


def _convert_to_face_1(shot):
    """Return a shot converted to face 1."""
    if shot.face == 1:
        return shot
    direction, zenith = shot.direction_deg, shot.zenith_deg
    # The telescope is transited: half a turn of the circle, and the zenith angle counted back.
    return replace(
        shot,
        direction_deg=None if direction is None else (direction + HALF_TURN) % FULL_TURN,
        zenith_deg=None if zenith is None else FULL_TURN - zenith,
    )


def _mean(first, second, tally, log):
    """Return the mean of a pair on face 1, or None after reporting that the faces disagree."""
    turned, means = _convert_to_face_1(second), {}
    sine = 1.0
    collimation = index = None
    # Half the difference of the faces is i, and half their difference across is c / sin z.
    if None not in (first.zenith_deg, turned.zenith_deg):
        index = (first.zenith_deg - turned.zenith_deg) / 2
        means["zenith_deg"] = first.zenith_deg - index
        sine = _sine(means["zenith_deg"])
    if None not in (first.direction_deg, turned.direction_deg):
        apart = (first.direction_deg - turned.direction_deg + HALF_TURN) % FULL_TURN - HALF_TURN
        collimation = apart / 2 * sine
        means["direction_deg"] = (first.direction_deg - apart / 2) % FULL_TURN
    if any(abs(error) > NO_PAIR_DEG for error in (collimation, index) if error is not None):
        text = message(
            "no_pair_of_faces",
            "point {point!r}: face 2 differs from face 1 (row {row}) by {across_deg:+.4f} "
            "degrees across and {up_deg:+.4f} degrees up; expected less than {most:g}: if two "
            "points have one name, change a name in the file; otherwise correct the unit of the "
            "angles",
            point=first.point,
            across_deg=-2 * (collimation or 0.0),
            up_deg=2 * (index or 0.0),
            row=str(first.row),
            most=2 * NO_PAIR_DEG,
        )
        log.problem(second.file, text, second.row)
        return None
    tally["pairs"].append((collimation, index))
    if None not in (first.distance_m, turned.distance_m):
        means["distance_m"] = (first.distance_m + turned.distance_m) / 2
        tally["apart"] = max(tally["apart"], abs(first.distance_m - turned.distance_m))
    # A value read on one face only is that of this face.
    merged = {
        key: getattr(turned, key) if getattr(first, key) is None else getattr(first, key)
        for key in ("direction_deg", "zenith_deg", "distance_m")
    }
    return replace(first, **(merged | means))


def _spread(values):
    """Return (mean, largest deviation from the mean), or None without values."""
    if not values:
        return None
    mean = sum(values) / len(values)
    return mean, max(abs(value - mean) for value in values)


def write_tables(folder, tables, *, replace):
    """Write {table: rows} to a folder; return (paths, names of other tables with rows).

    Raises InputError if the folder is a file, or if a table already contains rows.
    """
    folder = Path(folder)
    filled_tables = find_filled_tables(folder, CONTRACT)
    refuse_filled(folder, [] if replace else [name for name in filled_tables if name in tables])
    grids = {name: _make_grid(name, rows) for name, rows in tables.items()}
    paths = write_grids(folder, grids)
    return paths, [table for table in filled_tables if table not in tables]


def find_filled_tables(folder, names):
    """Return the tables of a job folder that contain rows."""
    return [name for name in names if _has_rows(folder / f"{name}.csv")]


def refuse_filled(folder, names):
    """Raise InputError if the folder is a file, or for tables that are not to be replaced."""
    log = Log()
    if folder.exists() and not folder.is_dir():
        text = message("import_into_file", "is a file; expected the folder of a job")
        log.problem(folder.name, text)
    for name in names:
        text = message(
            "table_stands",
            "already contains rows and is left unchanged; expected an empty table, or --replace",
        )
        log.problem(f"{name}.csv", text)
    log.stop_if_problems()


def write_grids(folder, grids, others=None):
    """Write {table: rows of cells with decimal points} and {name: text}; return the paths."""
    log = Log()
    separator, decimal = _marks(folder, log)
    log.stop_if_problems()
    texts = {
        f"{name}.csv": _comments(folder / f"{name}.csv") + _text(name, grid, separator, decimal)
        for name, grid in grids.items()
    }
    _write_files(folder, texts | (others or {}))
    return [folder / name for name in texts]


def _marks(folder, log):
    """Return separator and decimal mark of the job in the folder."""
    if not (folder / SETTINGS_FILE).is_file():
        return ",", "."
    data = read_bytes(folder / SETTINGS_FILE, log)
    settings = None if data is None else read_toml(SETTINGS_FILE, data, log)[0]
    return csv_marks(SETTINGS_FILE, settings or {}, log) or (",", ".")


def _lines(path):
    try:
        return path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError:
        return []


def _has_rows(path):
    """Return whether a file contains more than comments and headings."""
    return sum(bool(line.strip(" ,;\t")) and not line.startswith("#") for line in _lines(path)) > 1


def _comments(path):
    """Return the comments at the head of a table that is filled in."""
    if _has_rows(path):
        return ""
    return "".join(f"{line}\n" for line in _lines(path) if line.startswith("#"))


def _make_grid(name, rows):
    columns = needed_columns(name, rows)
    return [columns, *([row.cells.get(column, "") for column in columns] for row in rows)]


def _text(name, grid, separator, decimal):
    (columns, *rows), stream = grid, io.StringIO()
    numbers = {field.name for field in COLUMNS[name] if field.kind == "number"}
    written = [columns]
    for cells in rows:
        if decimal == ",":
            cells = [
                cell.replace(".", ",") if column in numbers else cell
                for column, cell in zip(columns, cells, strict=True)
            ]
        written.append(cells)
    write_guarded(stream, written, separator)
    return stream.getvalue()


def _write_files(folder, texts):
    """Write the files to a temporary folder, then move all of them into the folder."""
    target = folder.resolve()
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=".tankcal-", dir=target.parent))
    try:
        for name, text in texts.items():
            (temporary / name).write_text(text, encoding="utf-8", newline="")
        if not target.exists():
            temporary.chmod(0o755)
            temporary.rename(target)
            return
        _move_all(temporary, target, texts)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _move_all(temporary, target, names):
    """Move files into a folder; restore the previous state if a move fails."""
    kept, done = temporary / "before", []
    kept.mkdir()
    try:
        for name in names:
            if (target / name).exists():
                shutil.copy2(target / name, kept / name)
            os.replace(temporary / name, target / name)
            done.append(name)
    except OSError:
        for name in done:
            if (kept / name).exists():
                os.replace(kept / name, target / name)
            else:
                (target / name).unlink(missing_ok=True)
        raise
