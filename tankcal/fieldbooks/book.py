"""What stands in a field book, whatever the format: set-ups, shots, known points.

Angles are degrees, lengths metres. A reader fills a `FieldBook`; what it does not understand it
counts there, so that nothing is left out in silence.
"""

import datetime
import math
from dataclasses import dataclass, field

from tankcal.messages import message
from tankcal.text.numerals import NUMBER

FULL_TURN, HALF_TURN = 360.0, 180.0
FARTHEST_M, HIGHEST_M, MOST_M = 1e4, 50.0, 1e8
METRES = {"m": 1.0, "mm": 1e-3, "ft": 0.3048, "usft": 1200 / 3937}
DEGREES = {"deg": 1.0, "gon": 0.9, "mil": 360 / 6400}
MAX_NUMBER = 40  # characters
NO_YEAR = 1904  # of a time whose year the file does not say (a leap year)


@dataclass(frozen=True)
class SetUp:
    """A stand of the instrument.

    station   name of the point below it; "": the file names none
    height_m  of the instrument above the point, None: not given
    xyz_m     east, north and height of the point, None: not given
    is_told   whether a record of the file begins it; else only readings tell that there is one
    """

    station: str
    height_m: float | None
    xyz_m: tuple | None
    row: int
    is_told: bool = True


@dataclass(frozen=True)
class Shot:
    """One reading of a point: what the circles and the distance meter showed, on either face.

    setup             place of its `SetUp` in the book
    direction_deg, zenith_deg, distance_m  None: not read; on face 2 as the circles show them
    face              1 or 2
    target_height_m   None: not given
    prism_mm          prism constant that the file says was in force, None: not given
    """

    setup: int
    point: str
    direction_deg: float | None
    zenith_deg: float | None
    distance_m: float | None
    face: int
    target_height_m: float | None
    code: str
    time: datetime.datetime | None
    prism_mm: float | None
    row: int
    file: str = ""


@dataclass(frozen=True)
class KnownPoint:
    """Coordinates that the file gives a point: east, north, height (None: not given)."""

    point: str
    xyz_m: tuple
    row: int


@dataclass
class FieldBook:
    """One file as read.

    units      Messages: the units that were found
    notes      Messages: corrections that the instrument or this reader applied
    left_out   {Message or text: [count, first row]}: what was not understood
    rejected   the same of what the surveyor deleted
    instrument name of the instrument that the file gives
    texts      {field: [(text, row)]}: angles and distances as they stand in the file
    """

    file: str
    format: str
    setups: list = field(default_factory=list)
    shots: list = field(default_factory=list)
    known: list = field(default_factory=list)
    units: list = field(default_factory=list)
    notes: list = field(default_factory=list)
    left_out: dict = field(default_factory=dict)
    rejected: dict = field(default_factory=dict)
    instrument: str = ""
    texts: dict = field(default_factory=dict)

    @property
    def has_shots(self):
        """Has the last set-up a shot?"""
        return bool(self.shots) and self.shots[-1].setup == len(self.setups) - 1

    def leave_out(self, what, row):
        """Count something that is not understood, and so is not used."""
        _count(self.left_out, what, row)

    def reject(self, what, row):
        """Count something that the surveyor deleted."""
        _count(self.rejected, what, row)

    def note(self, text):
        """Keep what a reader has to say, once."""
        if text not in self.notes:
            self.notes.append(text)

    def unit(self, text):
        """Keep a unit that was found, once."""
        if text not in self.units:
            self.units.append(text)

    def keep_text(self, name, text, row):
        """Keep a number of a field as it is written; a blank one is none."""
        if text.strip():
            self.texts.setdefault(name, []).append((text.strip(), row))

    def say_units(self, *, length=None, angle=None, last=None):
        """Keep the units that were found: names of METRES, of DEGREES, or dms and packed_dms.

        last  what one of the last digit of a length is, such as "1 mm"
        """
        if angle is not None:
            self.unit(message("angles_in", "angles in {unit}", unit=angle))
        if last is not None:
            self.unit(message("lengths_in_last", "lengths in {unit}, last digit {last}",
                              unit=length, last=last))  # fmt: skip
        elif length is not None:
            self.unit(message("lengths_in", "lengths in {unit}", unit=length))

    def stand(self, station, height_m, xyz_m, row, *, is_told=True):
        """Begin a set-up."""
        self.setups.append(SetUp(station, height_m, xyz_m, row, is_told))

    def add_shot(self, log, row, *, point, direction, zenith, distance, face=None, height=None,
                 code="", time=None, prism=None, setup=None):  # fmt: skip
        """Keep a reading after its values are seen to be possible.

        direction, zenith  degrees or None; distance, height metres or None; prism mm or None
        face   None: 2 where the vertical circle shows more than half a turn
        setup  place of the set-up; None: the last
        """
        if not self.setups:
            self.stand("", None, None, row, is_told=False)
        if not all(
            (
                _is_within(log, self.file, row, direction, 2 * FULL_TURN, "deg"),
                _is_within(log, self.file, row, zenith, FULL_TURN, "deg"),
                _is_within(log, self.file, row, height, HIGHEST_M, "m"),
                _is_within(log, self.file, row, distance, FARTHEST_M, "m"),
            )
        ):
            return
        if distance is not None and distance < 0:
            text = message(
                "negative_distance", "found a negative distance; expected a positive distance"
            )
            log.problem(self.file, text, row)
            return
        distance = distance or None  # 0 is how instruments write that none was measured
        if direction is None and zenith is None and distance is None:
            self.leave_out(message("no_reading", "points without readings"), row)
            return
        zenith = None if zenith is None else zenith % FULL_TURN
        direction = None if direction is None else direction % FULL_TURN
        by_circle = 2 if zenith is not None and zenith > HALF_TURN else 1
        if face is not None and zenith is not None and face != by_circle:
            text = message(
                "face_unlike_circle",
                "found face {face} and a vertical circle of {circle_deg:.4f} degrees; expected a "
                "circle reading of this face (is the circle read from the zenith?)",
                face=face,
                circle_deg=zenith,
            )
            log.problem(self.file, text, row)
            return
        self.shots.append(
            Shot(len(self.setups) - 1 if setup is None else setup, point, direction, zenith,
                 distance, face or by_circle, height, code, time, prism, row, self.file)
        )  # fmt: skip


def _count(counts, what, row):
    counts.setdefault(what, [0, row])[0] += 1


def _is_within(log, file, row, value, most, unit):
    if value is None or abs(value) <= most:
        return True
    text = message(
        "beyond_reason",
        "found {value:g} {unit}; expected at most {most:g} {unit} (is the unit of the file "
        "correct?)",
        value=value,
        most=most,
        unit=unit,
    )
    log.problem(file, text, row)
    return False


def number_of(text):
    """A plain number, or None where the text is none."""
    text = text.strip()
    if len(text) > MAX_NUMBER or not NUMBER.fullmatch(text):
        return None
    value = float(text)
    return value if math.isfinite(value) else None


def unpacked(value):
    """Degrees of ddd.mmssss, as field books pack them; None: minutes or seconds are impossible."""
    text = f"{abs(value):.10f}"
    whole, _, behind = text.partition(".")
    minutes, seconds = int(behind[:2]), float(f"{behind[2:4]}.{behind[4:]}")
    if minutes >= 60 or seconds > 60:  # 60 is how some round 59.99
        return None
    return math.copysign(int(whole) + minutes / 60 + seconds / 3600, value)


def refuse_number(log, file, row, text):
    """Tell that a text is no number."""
    expected = message("no_plain_number", "found {text!r}; expected a number", text=text[:40])
    log.problem(file, expected, row)


def refuse_minutes(log, file, row, text):
    """Tell that the minutes or seconds of an angle cannot be."""
    expected = message(
        "impossible_minutes",
        "found {text!r}; expected degrees, minutes and seconds (is the angle in decimal "
        "degrees or gon?)",
        text=text[:40],
    )
    log.problem(file, expected, row)


def plain_name(text):
    """A point's name without the zeros or blanks that fill its field."""
    text = text.strip()
    return text.lstrip("0") or text[-1:]
