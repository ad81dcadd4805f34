"""Rows of the tables of a job from readings on face 1."""

from dataclasses import dataclass

from tankcal.fieldbooks.sorting import is_meant
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


@dataclass(frozen=True)
class Row:
    """One row of a table, {column: text}, with its source."""

    cells: dict
    file: str
    row: int


def make_rows(stands, names, stations, sorted_readings, choices):
    """Return {table: list of Row}, without empty tables.

    Parameters
    ----------
    stands : dict
        {index: (SetUp, file)}
    names : dict
        {index: name of the set-up in the job}
    stations : dict
        {point: (xyz, file, row)} for control.csv.
    sorted_readings : Sorted
    choices : Choices
    """
    tables = {name: [] for name in CONTRACT}
    for place, name in names.items():
        setup, file = stands[place]
        cells = {
            "setup": name,
            "station": setup.station,
            "instrument": choices.instrument,
            "instrument_height_m": _length(setup.height_m),
        }
        tables["setups"].append(Row(cells, file, setup.row))
    for reading in sorted_readings.hits:
        cells = _both_angles(reading.shot)
        if is_meant(reading.shot, choices.check):
            cells["use"] = "check"
        tables["wall_hits"].append(_row(reading, names, cells, distance=True, time=True))
    for reading in sorted_readings.control:
        cells = {"target": reading.shot.point} | _both_angles(reading.shot)
        tables["control_readings"].append(_row(reading, names, cells, distance=True, time=True))
    for reading in sorted_readings.ties:
        _tie(tables, reading, names, choices)
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


def _tie(tables, reading, names, choices):
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


def columns_of(table, rows):
    """Return the columns that a table needs, in the order of the job format."""
    return [
        field.name
        for field in CONTRACT[table]
        if field.required or any(row.cells.get(field.name) for row in rows)
    ]
