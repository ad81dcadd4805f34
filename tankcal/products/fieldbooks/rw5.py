"""Carlson and TDS raw data (RW5): records with fields that begin with a two-letter code.

Angles are packed as ddd.mmssss (MO, AU0) or in gon (AU1). Lengths are in feet, metres or US feet
(UN).
"""

import datetime
import math
import re
from dataclasses import replace

from tankcal.messages import message
from tankcal.products.fieldbooks.book import (
    FULL_TURN,
    HALF_TURN,
    METRES,
    FieldBook,
    KnownPoint,
    parse_number,
    refuse_minutes,
    refuse_number,
    unpack_dms,
)

RECORDS = {"SS", "TR", "BD", "FD", "BR", "FR"}
FACES = {"BD": 1, "FD": 1, "BR": 2, "FR": 2}
UNITS = {0: "ft", 1: "m", 2: "usft"}
_CODES = ("OP", "FP", "BP", "PN", "BS", "BC", "HI", "HR", "AR", "AL", "AZ", "DR", "DL", "BR", "ZE",
          "VA", "CE", "SD", "HD", "EL", "NM", "DT", "TM", "UN", "AU", "AD", "SF", "EC", "EO", "FE",
          "TS", "FC", "N", "E")  # fmt: skip
# Two fields with codes, because Nikon raw files have records SS without codes.
_FIELD = rf"\s*(?:{'|'.join(_CODES)})"
LINE = re.compile(
    rf"\s*(--|(JB|MO|OC|BK|LS|SS|TR|BD|FD|BR|FR|SP)\s*,{_FIELD}[^,]*(,(--|{_FIELD})|$))"
)
_HORIZONTAL = ("AR", "AL", "AZ", "DR", "DL", "BR")
_BEARING = re.compile(r"([NS])\s*([0-9.]+)\s*([EW])", re.IGNORECASE)
_DATE = re.compile(r"--\s*DT\s*(\d\d?)-(\d\d?)-(\d{4})", re.IGNORECASE)
_TIME = re.compile(r"(?:--|,)\s*TM\s*(\d\d?):(\d\d):(\d\d)", re.IGNORECASE)


class _State:
    """Values that apply from one line to the next."""

    length = angle = None  # of MO
    units_reported = False  # whether unknown units were reported
    station = back = height = rod = None
    azimuth = circle = None  # of the backsight
    key = None  # of the set-up
    is_recorded = False  # whether there was a record OC
    date = None  # date of the last note with a date
    follows_shot = False  # whether a time in this line belongs to the last reading
    kind = None  # kind of horizontal angle in this set-up: "turned" or "azimuth"


def read(text, file, log):
    """Return the FieldBook of the text of an RW5 file."""
    book, state = FieldBook(file, "rw5"), _State()
    for row, line in enumerate(text.split("\n"), 1):
        line = line.strip()
        if line.startswith("--"):
            _take_note(book, row, line, state)
        elif line:
            _take(book, log, row, line, state)
    return book


def _take(book, log, row, line, state):
    """Read a record."""
    kind, fields, code = _fields(line)
    before = len(book.shots)
    if kind in RECORDS:
        _take_shot(book, log, row, kind, fields, code, state)
    elif kind == "MO":
        _take_mode(book, log, row, fields, state)
    elif kind == "OC":
        state.is_recorded = True
        state.station = fields.get("OP", fields.get("PN", ""))
        state.back = state.azimuth = state.circle = None
        _take_point(book, log, row, state.station, fields, state)
    elif kind == "BK":
        state.back = fields.get("BP")
        state.azimuth, state.circle = (_angle(fields.get(key), state) for key in ("BS", "BC"))
    elif kind == "LS":
        if "HI" in fields:
            state.height = _length(book, log, row, fields["HI"], state)
        if "HR" in fields:
            state.rod = _length(book, log, row, fields["HR"], state)
    elif kind == "SP":
        _take_point(book, log, row, fields.get("PN", ""), fields, state)
    elif kind not in ("JB", "TE", "AH"):
        book.leave_out(message("records_of_kind", "records {kind}", kind=kind[:12]), row)
    state.follows_shot = len(book.shots) > before


def _fields(line):
    """Return (kind, {code: text}, note) of a record."""
    body, _, note = line.partition(",--")
    kind, *parts = body.split(",")
    fields = {}
    for part in parts:
        part = part.strip()
        code = next((prefix for prefix in _CODES if part.upper().startswith(prefix)), None)
        if code is not None:
            fields.setdefault(code, part[len(code) :].strip())
    return kind.strip().upper(), fields, note.strip() or fields.get("FC", "")


def _take_note(book, row, line, state):
    """Read the date and time of a note; count other notes."""
    date, time = _DATE.match(line), _TIME.search(line)
    if date:
        month, day, year = (int(number) for number in date.groups())
        state.date = (year, month, day)
    if time and state.date:
        try:
            when = datetime.datetime(*state.date, *(int(number) for number in time.groups()))
        except ValueError:
            return
        if state.follows_shot:
            book.shots[-1] = replace(book.shots[-1], time=when)
            state.follows_shot = False
    elif not date and not time:
        book.leave_out(message("notes", "notes"), row)


def _take_mode(book, log, row, fields, state):
    """Read the units of a record MO."""
    length, angle = (parse_number(fields.get(key_, "")) for key_ in ("UN", "AU"))
    angle = 0 if "AU" not in fields else angle
    if length not in UNITS or angle not in (0, 1):
        text = message(
            "rw5_units",
            "found UN {un!r} and AU {au!r}; expected UN 0 (feet), 1 (metres) or 2 (US feet) and AU"
            " 0 (degrees) or 1 (gon)",
            un=fields.get("UN", ""),
            au=fields.get("AU", ""),
        )
        log.problem(book.file, text, row)
        state.units_reported = True
        return
    state.length, state.angle = UNITS[length], "gon" if angle else "packed_dms"
    book.add_units(length=state.length, angle=state.angle)
    for key, usual in (("SF", 1.0), ("EO", 0.0)):
        value = parse_number(fields.get(key, ""))
        if value is not None and value != usual:
            text = message(
                "rw5_correction",
                "{key} {value:g} of MO: not applied, distances are used as written",
                key=key,
                value=value,
            )
            book.note(text)


def _length(book, log, row, text, state):
    """Return a length in metres, or None."""
    value = parse_number(text)
    if value is None:
        refuse_number(log, book.file, row, text)
        return None
    return value * METRES[state.length] if state.length else None


def _angle(text, state):
    """Return degrees, or None."""
    value = None if text is None else parse_number(text)
    if value is None or state.angle is None:
        return None
    return 0.9 * value if state.angle == "gon" else unpack_dms(value)


def _take_point(book, log, row, name, fields, state):
    """Read the coordinates of a point."""
    if state.length is None:
        return
    coordinates = [parse_number(fields.get(axis, "")) for axis in ("E", "N", "EL")]
    for value, code in zip(coordinates, ("E", "N", "EL"), strict=True):
        if value is None and fields.get(code):
            refuse_number(log, book.file, row, fields[code])
    if name and None not in coordinates[:2]:
        scale = METRES[state.length]
        xyz = tuple(None if value is None else value * scale for value in coordinates)
        book.known.append(KnownPoint(name, xyz, row))


def _take_shot(book, log, row, kind, fields, code, state):
    """Read a reading; begin a set-up if station, backsight or instrument height change."""
    if state.length is None:
        if not state.units_reported:
            state.units_reported = True
            text = message(
                "units_unknown", "no units before this record; expected a record MO with UN and AU"
            )
            log.problem(book.file, text, row)
        return
    if state.station is None:  # without record OC the reading names its station
        state.station = fields.get("OP")
    if "OP" in fields and fields["OP"] != state.station:
        text = message(
            "other_station",
            "read from {found!r}, but the set-up is over {station!r}; expected the same point",
            found=fields["OP"][:40],
            station=state.station or "",
        )
        log.problem(book.file, text, row)
        return
    here = (state.station, state.back, state.azimuth, state.circle, state.height)
    if here != state.key:
        state.key, state.kind = here, None
        book.begin_setup(
            state.station or "", state.height, None, row, is_recorded=state.is_recorded
        )
    codes = [
        field_code for field_code in (*_HORIZONTAL, "ZE", "VA", "SD", "HD") if field_code in fields
    ]
    texts = {field_code: fields[field_code] for field_code in codes}
    bad = [
        field_code
        for field_code in codes
        if field_code != "BR" and parse_number(texts[field_code]) is None
    ]
    if bad or "CE" in fields:
        text = message(
            "rw5_fields",
            "field {field}: expected a number, a zenith or vertical angle and a slope or"
            " horizontal distance",
            field=(bad or ["CE"])[0],
        )
        log.problem(book.file, text, row)
        return
    for field_code in codes:
        book.add_text(field_code, texts[field_code], row)
    _add(book, log, row, kind, {field_code: texts[field_code] for field_code in codes}, code, state,
         fields.get("FP", ""))  # fmt: skip


def _add(book, log, row, kind, texts, code, state, name):
    """Add a reading to the book."""
    angles = {
        field_code: _angle(text, state)
        for field_code, text in texts.items()
        if field_code not in ("SD", "HD")
    }
    angles |= {"BR": _convert_bearing(texts["BR"], state)} if "BR" in texts else {}
    bad = [field_code for field_code, value in angles.items() if value is None]
    if bad:
        refuse_minutes(log, book.file, row, texts[bad[0]])
        return
    direction, is_turned = _direction(angles)
    if direction is not None:
        wanted = "turned" if is_turned else "azimuth"
        if state.kind not in (None, wanted):
            if state.azimuth is None:
                text = message(
                    "azimuths_and_angles",
                    "azimuths and angles from the backsight in one set-up, whose BK has no "
                    "azimuth; expected one kind of angle, or the azimuth of the backsight",
                )
                log.problem(book.file, text, row)
                return
            zero = state.azimuth - (state.circle or 0.0)  # azimuth of the zero of the circle
            direction += zero if is_turned else -zero
        state.kind = state.kind or wanted
    zenith = angles.get("ZE")
    if zenith is None and "VA" in angles:
        zenith = FULL_TURN / 4 - angles["VA"]
    distance = parse_number(texts["SD"]) if "SD" in texts else None
    if distance is None and "HD" in texts and zenith:
        distance = parse_number(texts["HD"]) / max(abs(math.sin(math.radians(zenith))), 1e-6)
    distance = None if distance is None else distance * METRES[state.length]
    book.add_shot(log, row, point=name, direction=direction, zenith=zenith, distance=distance,
                  face=FACES.get(kind), height=state.rod, code=code)  # fmt: skip


def _direction(angles):
    """Return (degrees clockwise or None, whether they count from the backsight)."""
    turns = {
        "AR": lambda value: value,
        "AL": lambda value: -value,
        "DR": lambda value: value - HALF_TURN,
        "DL": lambda value: HALF_TURN - value,
    }
    for code, turn in turns.items():
        if code in angles:
            return turn(angles[code]), True
    return angles.get("AZ", angles.get("BR")), False


def _convert_bearing(text, state):
    """Return the azimuth of a quadrant bearing such as N45.3000E."""
    match = _BEARING.fullmatch(text.strip())
    value = _angle(match[2], state) if match else None
    if value is None:
        return None
    quarter = (match[1].upper(), match[3].upper())
    return {
        ("N", "E"): value,
        ("S", "E"): HALF_TURN - value,
        ("S", "W"): HALF_TURN + value,
        ("N", "W"): FULL_TURN - value,
    }[quarter]
