"""Plain tables (CSV), with columns and units declared in a profile (TOML)."""

import csv
import datetime
import re
from dataclasses import dataclass

from tankcal.job.folder import parsed_toml
from tankcal.job.tables import read_bytes
from tankcal.messages import message
from tankcal.products.fieldbooks.book import (
    DEGREES,
    FULL_TURN,
    METRES,
    FieldBook,
    parse_number,
    refuse_minutes,
    refuse_number,
    unpack_dms,
)

COLUMNS = ("point", "direction", "zenith", "distance", "setup", "instrument_height",
           "target_height", "code", "time", "face")  # fmt: skip
NEEDED = ("point", "direction", "zenith", "distance")
CHOICES = {
    "length": (*METRES,),
    "angle": (*DEGREES, "dms", "packed_dms"),
    "vertical": ("zenith", "horizon"),
    "separator": (",", ";", "\t", " ", "|"),
    "decimal": (".", ","),
}
USUAL = {"separator": ",", "decimal": ".", "vertical": "zenith"}
TEXTS = ("time_format", "station")
NUMBERS = ("first_row", "instrument_height_m")
MAX_PROFILE = 100_000
MOST = 1e6
_MARKS = str.maketrans({mark: " " for mark in "°º'’′\"″-:"})


@dataclass(frozen=True)
class Profile:
    """Columns and units of a plain table.

    Attributes
    ----------
    columns : dict
        {one of COLUMNS: heading, or number of the column from 1}
    values : dict
        {key of CHOICES, TEXTS or NUMBERS: value}
    """

    columns: dict
    values: dict


def read_profile(path, log):
    """Return the Profile of a TOML file, or None after adding problems to the log."""
    data, before = read_bytes(path, log, MAX_PROFILE), len(log.problems)
    parsed = None if data is None else parsed_toml(path.name, data, log)
    if parsed is None:
        return None
    content, rows = parsed
    columns = content.pop("columns", None)
    columns = columns if isinstance(columns, dict) else {}
    known = (*CHOICES, *TEXTS, *NUMBERS)
    for given, names, section in ((content, known, ""), (columns, COLUMNS, "columns.")):
        for key in given:
            if key not in names:
                text = message("profile_key", "unknown; expected one of {names}",
                               names=", ".join(names))  # fmt: skip
                log.problem(path.name, text, rows.get(f"{section}{key}"), f"{section}{key}")
    for key in NEEDED:
        if key not in columns:
            text = message("profile_column", "missing; expected the heading of the column, or its"
                           " number")  # fmt: skip
            log.problem(path.name, text, None, f"columns.{key}")
    for key, value in columns.items():
        if not (isinstance(value, str) and value) and not _is_place(value):
            log.problem(
                path.name,
                message("profile_place", "expected a heading or a column number from 1"),
                rows.get(f"columns.{key}"),
                f"columns.{key}",
            )
    values = USUAL | content
    _check_values(path.name, values, rows, log)
    return None if len(log.problems) > before else Profile(columns, values)


def _check_values(file, values, rows, log):
    """Report invalid values of a profile."""
    for key, choices in CHOICES.items():
        if values.get(key) not in choices:
            text = message("profile_choice", "expected one of {choices}",
                           choices=", ".join(map(repr, choices)))  # fmt: skip
            log.problem(file, text, rows.get(key), key)
    for key in TEXTS:
        if not isinstance(values.get(key, ""), str):
            log.problem(file, message("profile_text", "expected a text"), rows.get(key), key)
    for key in NUMBERS:
        value = values.get(key, 1)
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= MOST:
            log.problem(file, message("profile_number", "expected a number"), rows.get(key), key)


def _is_place(value):
    """Return whether a value is a column number from 1 to 1000."""
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= 1000


def read(text, file, log, profile):
    """Return the FieldBook of the text of a plain table."""
    book, values = FieldBook(file, "csv"), profile.values
    places = {
        key: place - 1 for key, place in profile.columns.items() if not isinstance(place, str)
    }
    headings = {
        key: heading for key, heading in profile.columns.items() if isinstance(heading, str)
    }
    first, key_of_setup = int(values.get("first_row", 1)), None
    for row, cells in _split_lines(text, file, values["separator"], log):
        if row < first or not any(cells) or cells[0].startswith("#"):
            continue
        if headings:
            missing = [heading for heading in headings.values() if heading not in cells]
            for heading in missing:
                expected = message(
                    "no_such_heading",
                    "no column {heading!r}; expected this heading in the first row",
                    heading=heading,
                )
                log.problem(file, expected, row)
            if missing:
                return book
            places |= {key: cells.index(heading) for key, heading in headings.items()}
            headings = None
            continue
        row_cells = {
            key: cells[place] if place < len(cells) else "" for key, place in places.items()
        }
        key_of_setup = _take(book, log, row, row_cells, values, key_of_setup)
    book.add_units(length=values["length"], angle=values["angle"])
    return book


def _split_lines(text, file, separator, log):
    """Yield (row, cells) of each line."""
    for row, line in enumerate(text.split("\n"), 1):
        line = line.rstrip("\r")
        if separator == " ":
            yield row, line.split()
            continue
        try:
            cells = next(csv.reader([line], delimiter=separator), [])
        except csv.Error:
            log.problem(
                file,
                message(
                    "csv_row",
                    "a row that cannot be split into cells; expected cells with the separator of "
                    "the profile",
                ),
                row,
            )
            continue
        yield row, [cell.strip() for cell in cells]


def _take(book, log, row, row_cells, values, before):
    """Read a row; return the station and instrument height that identify its set-up."""
    lengths = {}
    for key in ("distance", "instrument_height", "target_height"):
        lengths[key] = _number(book, log, row, row_cells.get(key, ""), values)
        if lengths[key] is False:
            return before
    angles = {
        key: _angle(book, log, row, row_cells[key], values) for key in ("direction", "zenith")
    }
    if False in angles.values():
        return before
    for key in ("direction", "zenith", "distance"):
        book.add_text(key, row_cells[key], row)
    face = {"": None, "1": 1, "2": 2, "I": 1, "II": 2}.get(row_cells.get("face", "").upper(), 0)
    time = _time(row_cells.get("time", ""), values)
    if face == 0 or time is False:
        text = message(
            "csv_face_or_time",
            "found face {face!r} and time {time!r}; expected face 1 or 2, and a time in the form "
            "of time_format",
            face=row_cells.get("face", "")[:20],
            time=row_cells.get("time", "")[:40],
        )
        log.problem(book.file, text, row)
        return before
    scale = METRES[values["length"]]
    height = lengths["instrument_height"]
    height = values.get("instrument_height_m") if height is None else height * scale
    here = row_cells.get("setup") or values.get("station", ""), height
    if here != before:
        book.begin_setup(*here, None, row)
    zenith = angles["zenith"]
    if zenith is not None and values["vertical"] == "horizon":
        zenith = (FULL_TURN / 4 - zenith) % FULL_TURN
    book.add_shot(
        log, row, point=row_cells["point"], direction=angles["direction"], zenith=zenith, face=face,
        distance=None if lengths["distance"] is None else lengths["distance"] * scale,
        height=None if lengths["target_height"] is None else lengths["target_height"] * scale,
        code=row_cells.get("code", ""), time=time,
    )  # fmt: skip
    return here


def _number(book, log, row, text, values):
    """Return a number, None if blank, or False after adding a problem to the log."""
    if not text:
        return None
    mark = values["decimal"]
    is_other = mark == "," and "." in text  # 1.234 may mean one thousand
    value = None if is_other else parse_number(text.replace(mark, "."))
    if value is None:
        refuse_number(log, book.file, row, text)
        return False
    return value


def _angle(book, log, row, text, values):
    """Return degrees, None if blank, or False after adding a problem to the log."""
    if not text:
        return None
    if values["angle"] != "dms":
        value = _number(book, log, row, text, values)
        if value is False:
            return False
        if values["angle"] != "packed_dms":
            return value * DEGREES[values["angle"]]
        value = unpack_dms(value)
    else:
        value = _join_parts(text.replace(",", "."))
    if value is None:
        refuse_minutes(log, book.file, row, text)
        return False
    return value


def _join_parts(text):
    """Convert a text with degrees, minutes and seconds to degrees, or return None."""
    sign = -1.0 if text.startswith("-") else 1.0
    parts = [parse_number(part) for part in text.translate(_MARKS).split()]
    if not 1 <= len(parts) <= 3 or None in parts or any(part >= 60 for part in parts[1:]):
        return None
    return sign * sum(part / 60**power for power, part in enumerate(parts))


def _time(text, values):
    """Return a time, None if blank, or False if it does not have the form of the profile."""
    if not text:
        return None
    try:
        if values.get("time_format"):
            return datetime.datetime.strptime(text, values["time_format"]).replace(tzinfo=None)
        return datetime.datetime.fromisoformat(text).replace(tzinfo=None)
    except (ValueError, TypeError, OverflowError, re.error):
        return False
