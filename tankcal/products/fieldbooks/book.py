"""Contents of a field book in any format: set-ups, shots, known points.

Angles are in degrees, lengths in metres. Each reader fills a `FieldBook` and counts the records
that it does not recognise, so that no record is left out without a message.
"""

import datetime
import math
from dataclasses import dataclass, field

from tankcal.messages import message
from tankcal.text.naming import NUMBER
from tankcal.units import FOOT_M, US_SURVEY_FOOT_M

FULL_TURN, HALF_TURN = 360.0, 180.0
FARTHEST_M, HIGHEST_M, MOST_M = 1e4, 50.0, 1e8
METRES = {"m": 1.0, "mm": 1e-3, "ft": FOOT_M, "usft": US_SURVEY_FOOT_M}
DEGREES = {"deg": 1.0, "gon": 0.9, "mil": 360 / 6400}
MAX_NUMBER = 40  # characters
NO_YEAR = 1904  # year of times without year in the file (a leap year)


@dataclass(frozen=True)
class SetUp:
    """A set-up of the instrument.

    Attributes
    ----------
    station : str
        Name of the point below the instrument; "" if the file has none.
    height_m : float or None
        Height of the instrument above the point; None if unknown.
    xyz_m : tuple or None
        East, north and height of the point; None if unknown.
    row : int
    is_recorded : bool
        Whether a record of the file begins the set-up; otherwise it is inferred from readings.
    """

    station: str
    height_m: float | None
    xyz_m: tuple | None
    row: int
    is_recorded: bool = True


@dataclass(frozen=True)
class Shot:
    """One reading of a point on one face: circles and distance as displayed.

    Attributes
    ----------
    setup : int
        Index of the `SetUp` in the book.
    direction_deg, zenith_deg, distance_m : float or None
        None if not read; on face 2 the circle readings of face 2.
    face : int
        1 or 2.
    target_height_m : float or None
    prism_mm : float or None
        Prism constant in effect according to the file.
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
    """Coordinates of a point in the file: east, north, height (None if unknown)."""

    point: str
    xyz_m: tuple
    row: int


@dataclass
class FieldBook:
    """Contents of one file.

    Attributes
    ----------
    units : list of Message
        Units of the file.
    notes : list of Message
        Corrections applied by the instrument or by the reader.
    left_out : dict
        {Message or text: [count, first row]} of records not recognised.
    rejected : dict
        The corresponding counts of records deleted by the surveyor.
    instrument : str
        Name of the instrument in the file.
    texts : dict
        {field: [(text, row)]}: angles and distances as written in the file.
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
        """Whether the last set-up has a shot."""
        return bool(self.shots) and self.shots[-1].setup == len(self.setups) - 1

    def leave_out(self, what, row):
        """Count a record that is not recognised and not used."""
        _count(self.left_out, what, row)

    def reject(self, what, row):
        """Count a record deleted by the surveyor."""
        _count(self.rejected, what, row)

    def note(self, text):
        """Add a note, if it is new."""
        if text not in self.notes:
            self.notes.append(text)

    def unit(self, text):
        """Add a unit, if it is new."""
        if text not in self.units:
            self.units.append(text)

    def add_text(self, name, text, row):
        """Add the text of a number of a field; a blank text is ignored."""
        if text.strip():
            self.texts.setdefault(name, []).append((text.strip(), row))

    def add_units(self, *, length=None, angle=None, last=None):
        """Add the units of a file: names in METRES and DEGREES, or dms and packed_dms.

        last  unit of the last digit of a length, such as "1 mm"
        """
        if angle is not None:
            self.unit(message("angles_in", "angles in {unit}", unit=angle))
        if last is not None:
            self.unit(message("lengths_in_last", "lengths in {unit}, last digit {last}",
                              unit=length, last=last))  # fmt: skip
        elif length is not None:
            self.unit(message("lengths_in", "lengths in {unit}", unit=length))

    def begin_setup(self, station, height_m, xyz_m, row, *, is_recorded=True):
        """Begin a set-up."""
        self.setups.append(SetUp(station, height_m, xyz_m, row, is_recorded))

    def add_shot(self, log, row, *, point, direction, zenith, distance, face=None, height=None,
                 code="", time=None, prism=None, setup=None):  # fmt: skip
        """Add a reading after a check of its values.

        Parameters
        ----------
        log : Log
        row : int
        point : str
        direction, zenith : float or None
            Degrees.
        distance, height : float or None
            Metres.
        face : int or None
            None: 2 if the vertical circle shows more than half a turn, else 1.
        code : str
        time : datetime or None
        prism : float or None
            Prism constant, mm.
        setup : int or None
            Index of the set-up; None: the last.
        """
        if not self.setups:
            self.begin_setup("", None, None, row, is_recorded=False)
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
        distance = distance or None  # instruments write 0 for no measurement
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
    """Return whether a value is within its limit; add a problem to the log otherwise."""
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


def parse_number(text):
    """Return a plain number, or None if the text is not a number."""
    text = text.strip()
    if len(text) > MAX_NUMBER or not NUMBER.fullmatch(text):
        return None
    value = float(text)
    return value if math.isfinite(value) else None


def unpack_dms(value):
    """Convert ddd.mmssss to degrees; None if minutes or seconds are impossible."""
    text = f"{abs(value):.10f}"
    whole, _, behind = text.partition(".")
    minutes, seconds = int(behind[:2]), float(f"{behind[2:4]}.{behind[4:]}")
    if minutes >= 60 or seconds > 60:  # some instruments round 59.99 to 60
        return None
    return math.copysign(int(whole) + minutes / 60 + seconds / 3600, value)


def refuse_number(log, file, row, text):
    """Report a text that is not a number."""
    expected = message("no_plain_number", "found {text!r}; expected a number", text=text[:40])
    log.problem(file, expected, row)


def refuse_minutes(log, file, row, text):
    """Report impossible minutes or seconds of an angle."""
    expected = message(
        "impossible_minutes",
        "found {text!r}; expected degrees, minutes and seconds (is the angle in decimal "
        "degrees or gon?)",
        text=text[:40],
    )
    log.problem(file, expected, row)


def strip_name(text):
    """Return the name of a point without the zeros or blanks that fill its field."""
    text = text.strip()
    return text.lstrip("0") or text[-1:]
