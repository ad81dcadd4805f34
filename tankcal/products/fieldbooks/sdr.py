"""Sokkia SDR33 and SDR20 (SDR2x): fields of fixed width after a four-character code.

The header states units and order of coordinates, record 01 the origin of vertical angles. SDR33 has
names of 16 characters and numbers of 16, SDR20 names of 4 and numbers of 10. Angles are decimal.
"""

import datetime
import re
from dataclasses import replace

from tankcal.messages import message
from tankcal.products.fieldbooks.book import (
    DEGREES,
    FULL_TURN,
    METRES,
    FieldBook,
    KnownPoint,
    parse_number,
    strip_name,
)

HEADER = re.compile(r"00..SDR(33|2)", re.IGNORECASE)
ANGLES, LENGTHS = {"1": "deg", "2": "gon", "4": "mil"}, {"1": "m", "2": "ft"}
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_STAMP = re.compile(r"(\d\d?)-([A-Za-z]{3})-(\d\d(?:\d\d)?)\s+(\d\d?):(\d\d)(?::(\d\d))?")
_CONSTANT = re.compile(r"(?:P\.?C\.?\s*mm[^:]*|\bPrism):\s*([+-]?[0-9.]+)", re.IGNORECASE)
# Mounting and vertical circle, before the three constants at the end of record 01. The column is
# not fixed, because some programs write names of 17 characters.
_FLAGS = re.compile(r"\d([12])(?:\s+[+-]?\d*\.\d*)*\s*$")
OTHERS = ("04", "05", "10", "12")  # collimation, atmosphere, job: not needed


class _State:
    """Values that apply from one line to the next."""

    wide = True
    angle = length = None
    east_first = False
    from_zenith = True
    station = rod = prism = time = None


def read(text, file, log):
    """Return the FieldBook of the text of an SDR file."""
    book, state = FieldBook(file, "sdr"), _State()
    lines = text.split("\n")
    derived = any(line[:3] == "09F" for line in lines)
    for row, line in enumerate(lines, 1):
        if not line.strip():
            continue
        kind, way = line[:2], line[2:4]
        if line.strip() == "0000":  # end of a file
            continue
        if kind == "00":
            _take_header(book, log, row, line, state)
        elif state.length is None:
            text = message(
                "sdr_header", "no header before this record; expected a record 00NM with units"
            )
            log.problem(file, text, row)
            return book
        elif kind == "09" and way == "MC" and derived:
            book.leave_out(message("means", "means computed by the instrument from other readings"),
                           row)  # fmt: skip
        else:
            _take(book, log, row, line, state)
    return book


def _take_header(book, log, row, line, state):
    """Read format, units and order of coordinates."""
    units = line[40:46].ljust(6)
    if not HEADER.match(line) or units[0] not in ANGLES or units[1] not in LENGTHS:
        text = message(
            "sdr_units",
            "found {header!r}; expected SDR33 or SDR20 and at column 41 the units: 1 degrees, 2"
            " gon or 4 mil, then 1 metres or 2 feet",
            header=line[:46],
        )
        log.problem(book.file, text, row)
        return
    state.wide = HEADER.match(line)[1] == "33"
    state.angle, state.length = ANGLES[units[0]], LENGTHS[units[1]]
    state.east_first = units[4] == "2"
    book.add_units(length=state.length, angle=state.angle)


def _take(book, log, row, line, state):
    """Read a record."""
    kind, way = line[:2], line[2:4]
    readers = {
        "01": _take_instrument,
        "02": _take_station,
        "03": _take_rod,
        "06": _take_scale,
        "07": _take_backsight,
        "08": _take_point,
        "09": _take_shot,
        "13": _take_note,
    }
    if kind in readers:
        readers[kind](book, log, row, line, state)
    elif kind == "11":
        what = message("reduced", "reduced readings (azimuth, horizontal distance)")
        book.leave_out(what, row)
    elif kind not in OTHERS:
        book.leave_out(message("sdr_records", "records {kind}", kind=kind + way), row)


def _take_instrument(book, _log, _row, line, state):
    """Read the instrument name and the origin of vertical angles."""
    flags = _FLAGS.search(line[5:][-80:])
    state.from_zenith = flags is None or flags[1] == "1"
    book.instrument = " ".join(line[5:21].split())


def _take_station(book, log, row, line, state):
    """Begin a set-up."""
    parts = _fields(line, state, 1, 4)
    values = _numbers(book, log, row, parts[1:], METRES[state.length])
    if values is None:
        return
    xyz, name = _coordinates(values, state), strip_name(parts[0])
    book.begin_setup(name, values[3], xyz if None not in xyz[:2] else None, row)


def _take_rod(book, log, row, line, state):
    """Read the height of the target."""
    values = _numbers(book, log, row, [line[4:20]], METRES[state.length])
    state.rod = values[0] if values else state.rod


def _take_scale(book, _log, _row, line, _state):
    """Add a note about a scale factor, which is not applied."""
    scale = parse_number(line[4:20])
    if scale not in (None, 1.0):
        text = message(
            "sdr_scale", "scale {scale:g} of record 06: not applied to distances", scale=scale
        )
        book.note(text)


def _take_backsight(book, _log, row, _line, _state):
    """Begin a set-up after readings, because a new backsight changes the zero of the circle."""
    if book.has_shots:
        now = book.setups[-1]
        book.begin_setup(now.station, now.height_m, now.xyz_m, row, is_recorded=now.is_recorded)


def _fields(line, state, names, numbers):
    """Return the texts of the fields of a record: names, then numbers."""
    widths = [16 if state.wide else 4] * names + [16 if state.wide else 10] * numbers
    fields, place = [], 4
    for width in widths:
        fields.append(line[place : place + width].strip())
        place += width
    return [*fields, line[place:].strip()]


def _numbers(book, log, row, texts, scale):
    """Return numbers (None if blank), or None after adding a problem to the log."""
    numbers = [parse_number(text) if text.strip() else None for text in texts[:4]]
    bad = [
        text
        for text, number in zip(texts[:4], numbers, strict=True)
        if text.strip() and number is None
    ]
    if bad:
        text = message(
            "sdr_number",
            "found {text!r}; expected a number (do the field widths agree with the header?)",
            text=bad[0],
        )
        log.problem(book.file, text, row)
        return None
    return [None if number is None else number * scale for number in numbers]


def _coordinates(values, state):
    """Return east, north and height."""
    north, east, height = values[:3]
    return (north, east, height) if state.east_first else (east, north, height)


def _take_point(book, log, row, line, state):
    """Read known coordinates; computed coordinates are left out."""
    if line[2:4] != "KI":
        book.leave_out(message("computed_points", "coordinates computed from readings"),
                       row)  # fmt: skip
        return
    parts = _fields(line, state, 1, 3)
    values = _numbers(book, log, row, parts[1:4], METRES[state.length])
    if values and None not in values[:2]:
        book.known.append(KnownPoint(strip_name(parts[0]), _coordinates(values, state), row))


def _take_shot(book, log, row, line, state):
    """Read an observation."""
    way = line[2:4]
    face = {"F1": 1, "F2": 2}.get(way)
    if face is None and way != "MC":
        book.leave_out(message("sdr_observations", "observations {kind}", kind=line[:4]), row)
        return
    station, point, distance, vertical, direction, code = _fields(line, state, 2, 3)
    if not book.setups:  # without record 02 the reading names its station
        book.begin_setup(strip_name(station), None, None, row, is_recorded=False)
    if strip_name(station) != book.setups[-1].station:
        text = message(
            "sdr_station",
            "read from {found!r}, but the last record 02 is of {station!r}; expected the same "
            "point",
            found=station,
            station=book.setups[-1].station,
        )
        log.problem(book.file, text, row)
        return
    values = _numbers(book, log, row, [distance, vertical, direction], 1.0)
    if values is None:
        return
    for name, text in (("distance", distance), ("zenith", vertical), ("direction", direction)):
        book.add_text(name, text, row)
    distance, vertical, direction = values
    scale = DEGREES[state.angle]
    zenith = None if vertical is None else vertical * scale
    if zenith is not None and not state.from_zenith:
        zenith = (FULL_TURN / 4 - zenith) % FULL_TURN
    book.add_shot(
        log, row, point=strip_name(point), zenith=zenith, face=face, height=state.rod, code=code,
        direction=None if direction is None else direction * scale,
        distance=None if distance is None else distance * METRES[state.length],
        time=state.time, prism=state.prism,
    )  # fmt: skip
    state.time = None


def _take_note(book, _log, row, line, state):
    """Read a time stamp of the previous reading, or a prism constant of the next readings."""
    stamp, constant = _STAMP.search(line), _CONSTANT.search(line)
    if stamp and line[2:4] == "TS":
        when = _time(stamp)
        if when is not None and book.shots and book.shots[-1].time is None:
            book.shots[-1] = replace(book.shots[-1], time=when)
        return
    if constant:
        state.prism = parse_number(constant[1])
        return
    book.leave_out(message("sdr_notes", "notes (records 13)"), row)


def _time(stamp):
    """Return the time of a stamp, or None."""
    day, month, year, hour, minute, second = stamp.groups()
    if month.lower() not in MONTHS:
        return None
    year = int(year) + (2000 if len(year) == 2 else 0)
    try:
        return datetime.datetime(year, MONTHS.index(month.lower()) + 1, int(day), int(hour),
                                 int(minute), int(second or 0))  # fmt: skip
    except ValueError:
        return None
