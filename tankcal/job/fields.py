"""Description of one value of a job: a number with bounds, a name, a date, a choice.

A `Field` describes one key of job.toml or one column of a table, and states in words which values
it accepts. `tankcal.job.field_values` reads the values and raises `Refused` for invalid ones.

Columns that tables of several methods share are here, and not in the package `contract`: a method
imports this module while the complete lists of `contract`, with the columns of all methods, are
built.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from math import inf

from tankcal.messages import message
from tankcal.text.naming import MAX_NAME

MAX_TEXT = 300  # longest text, characters


class Refused(ValueError):
    """A value that the field does not accept; `text` states the values found and expected."""

    @property
    def text(self):
        return self.args[0]


@dataclass(frozen=True)
class Field:
    """Description of one key or column.

    Attributes
    ----------
    name : str
        Name as written in the file, with its unit.
    kind : str
        "number", "text", "name", "tank id", "choice", "flag", "date", "time" (date and time of day;
        read as seconds since 2000), "mesh file", "cloud file", "rule name", "numbers" (several),
        "ranges" (pairs of numbers), "names" (several), "rows" (of numbers) or "dms" (degrees,
        minutes and seconds; read as degrees).
    note : str
        Explanation in one line for the user.
    required : bool
        True: must be filled in, for every kind of tank in `kinds`.
    low, high : float
        Bounds of a number, both allowed; see `above_low`.
    above_low : bool
        True: `low` itself is not allowed.
    choices : tuple of str
        Values of a choice; for a number, words accepted in place of a number; for a text, the usual
        values.
    in_full : bool
        True: an optional column that is filled in for all rows or for none.
    start : str
        Value in the starter job.
    kinds : tuple of str
        Kinds of tank that have the field; (): all.
    required_for : tuple of str
        Kinds of tank for which the field is required although `required` is False.
    of_survey : bool
        True: used only if observations are adjusted.
    width : int
        Count of numbers in each of the rows.
    """

    name: str
    kind: str
    note: str
    required: bool = False
    low: float = -math.inf
    high: float = math.inf
    above_low: bool = False
    choices: tuple[str, ...] = ()
    in_full: bool = False
    start: str = ""
    kinds: tuple[str, ...] = ()
    required_for: tuple[str, ...] = ()
    of_survey: bool = False
    width: int = 0

    def suits(self, tank_kind):
        """Return True if tanks of this kind have the field; None (kind not known): always True."""
        return tank_kind is None or not self.kinds or tank_kind in self.kinds

    def is_required(self, tank_kind):
        """Return True if the field is required for this kind of tank (None: not known)."""
        if self.required:
            return not self.kinds or tank_kind in self.kinds
        return tank_kind in self.required_for

    @cached_property
    def expectation(self):
        """Accepted values in words: "a number above 0, at most 300"."""
        if self.kind == "choice":
            return _one_of(self.choices)
        if self.kind == "number":
            return self._expected_number()
        if self.kind == "dms":
            return message(
                "a_dms",
                "degrees, minutes and seconds such as 123 04 05.6{bounds}",
                bounds=self._bounds_in_degrees(),
            )
        if self.kind == "rows":
            return self._expected_rows()
        if self.kind == "numbers":
            return message(
                "several_numbers",
                "numbers{bounds}, such as {one}; {other} (in a .toml file also [{one}, {other}])",
                bounds=self._bounds(),
                **self._two_of_them(),
            )
        return _EXPECTED[self.kind]

    def _expected_rows(self):
        row = " ".join(str(i) for i in range(1, self.width + 1))
        rows = message(
            "several_rows",
            "rows of {width} numbers, such as {row}; {row} (in a .toml file also [[{listed}]])",
            width=self.width,
            row=row,
            listed=row.replace(" ", ", "),
        )
        return self._or_words(rows)

    def _two_of_them(self):
        """Two accepted values as text, for an example: {one, other}."""
        low, high = max(self.low, 0.0), self.high
        two = (700.0, 850.0)
        if not low <= two[0] < two[1] <= high:
            two = (low + 0.2 * (high - low), low + 0.8 * (high - low))
        return {name: f"{value:g}" for name, value in zip(("one", "other"), two, strict=True)}

    def wanted(self):
        """Meaning and accepted values in words: "height of the course (a number above 0)"."""
        if not self.note:  # the notes of a product may be in the words of each language
            return self.expectation
        if self.kind in ("text", "name", "tank id"):
            return message("noted", "{note}", note=self.note)
        return message("wanted", "{note} ({expected})", note=self.note, expected=self.expectation)

    def _expected_number(self):
        number = message("a_number", "a number{bounds}", bounds=self._bounds())
        return self._or_words(number)

    def _or_words(self, number):
        if not self.choices:
            return number
        words = _one_of(self.choices)
        return message("a_number_or", "{number}, or {words}", number=number, words=words)

    def _bounds(self):
        low, high = self.low, self.high
        if low == -high and high >= 1e5:  # bounds that only exclude absurd values are not shown
            return ""
        if math.isinf(high) and self.above_low:
            return message("bound_above", " above {low:g}", low=low)
        if math.isinf(high):
            return message("bound_of_or_more", " of {low:g} or more", low=low)
        if self.above_low:
            return message(
                "bound_above_at_most", " above {low:g}, at most {high:g}", low=low, high=high
            )
        return message("bound_from_to", " from {low:g} to {high:g}", low=low, high=high)

    def _bounds_in_degrees(self):
        return message(
            "bound_in_degrees",
            ", from {low:g} to {high:g} degrees",
            low=self.low,
            high=self.high,
        )


_EXPECTED = {
    "text": message("a_text", "text of at most {most} characters in one line", most=MAX_TEXT),
    "name": message(
        "a_name",
        "a name of at most {most} characters (a letter, digit or underscore first, then letters, "
        "digits, spaces or _ - . ( ) / #)",
        most=MAX_NAME,
    ),
    "tank id": message(
        "a_tank_id",
        "a name of at most {most} characters (letters, digits, spaces or _ - . ( ), no .. and no "
        ". or - first)",
        most=MAX_NAME,
    ),
    "flag": message("a_flag", "true or false"),
    "date": message("a_date", "a date such as 2024-05-31"),
    "time": message("a_time", "a date with its time of day, such as 2024-05-31T14:30"),
    "ranges": message(
        "some_ranges",
        "pairs such as 0-0.3; 2.1-2.4 (in a .toml file also [[0, 0.3], [2.1, 2.4]])",
    ),
    "names": message("some_names", 'names such as P7; P9 (in a .toml file also ["P7", "P9"])'),
    "rule name": message(
        "a_rule_name", "the name of a rule of tankcal, or of a .toml file in the job's folder"
    ),
    "mesh file": message(
        "a_mesh_file",
        "the plain name of a .stl, .obj, .ply or .off file, in the job's folder",
    ),
    "cloud file": message(
        "a_cloud_file",
        "a .las, .laz, .e57, .ply, .ptx, .pts, .xyz or .asc file in the job's folder or below it,"
        " such as scans/a.e57",
    ),
}


def _one_of(choices):
    """List of the choices: "'a' or 'b' or 'c'".

    Other languages show the words of their forms.
    """
    *others, last = (message("choice", "{choice!r}", choice=choice) for choice in choices)
    for choice in reversed(others):
        last = message("either_or", "{one} or {other}", one=choice, other=last)
    return last


def is_blank(raw):
    """Return True for None, an empty text and an empty list; 0 and false are values."""
    return raw is None or raw == [] or (isinstance(raw, str) and not raw.strip())


# ---- columns of several methods

ANGLE_UNITS = ("deg", "gon", "dms")
FULL_CIRCLE = {"deg": 360, "gon": 400, "dms": 360}
SURFACES = ("paint", "rust", "tape")  # surfaces with separate biases of ranging
USE = Field(
    "use",
    "choice",
    "check: only compared with the adjusted values; blank: adjust",
    choices=("adjust", "check"),
)
NOTE = Field("note", "text", "remark for the reader")


def angle_fields(name, note, circles=(0, 1)):
    """Return the columns of an angle, a column for each unit of ANGLE_UNITS.

    Parameters
    ----------
    name : str
        Name of the columns without the unit.
    note : str
        Note of the columns without the unit, which is added before the first semicolon.
    circles : tuple of float, optional
        Lower and upper bound, in parts of the full circle.

    Returns
    -------
    tuple of Field
    """
    quantity, semicolon, condition = note.partition(";")
    words = {
        "deg": "degrees",
        "gon": "gon",
        "dms": "degrees, minutes and seconds: 123 04 05.6",
    }
    return tuple(
        Field(
            f"{name}_{unit}",
            "dms" if unit == "dms" else "number",
            f"{quantity}, {words[unit]}{semicolon}{condition}",
            low=circles[0] * FULL_CIRCLE[unit],
            high=circles[1] * FULL_CIRCLE[unit],
        )
        for unit in ANGLE_UNITS
    )


def readings_by_tape(reading_note):
    """Return the columns of a tape reading of a circumference, and of its conditions."""
    return (
        _number("reading_m", reading_note, 0.3, 1000, required=True),
        _number(
            "s_mm", "standard deviation of one reading, millimetres", 0, 100, required=True,
            above_low=True,
        ),
        Field(
            "instrument", "name", "tape of instruments.toml; blank: the only tape there except"
            " masters",
        ),
        _number(
            "temperature_c",
            "temperature of the tape, degrees Celsius; blank: equal to the shell temperature",
            -60,
            120,
        ),
        _number(
            "tension_n",
            "pull at the ends of the tape, newtons; for a tape without friction the mean round"
            " the tank; blank: tension of the certificate",
            0,
            1000,
            above_low=True,
        ),
    )  # fmt: skip


def _number(name, note, low, high, required=False, above_low=False):
    return Field(name, "number", note, required=required, low=low, high=high, above_low=above_low)


FREE = "free"  # in place of a standard uncertainty: estimated as an unknown


def number(name, note, low=-inf, high=inf, **more):
    """Return a `Field` for a number from `low` to `high`."""
    return Field(name, "number", note, low=low, high=high, **more)


def positive(name, note, high=inf, **more):
    """Return a `Field` for a number above 0, at most `high`."""
    return Field(name, "number", note, low=0, above_low=True, high=high, **more)


def choice(name, note, choices, **more):
    """Return a `Field` for a word of `choices`."""
    return Field(name, "choice", note, choices=choices, **more)


KINDS = ("vertical", "horizontal", "sphere", "mesh")
VERTICAL = ("vertical",)
LYING = ("horizontal",)
STRAPPED = ("vertical", "horizontal")
LOADED = ("vertical", "sphere")  # kinds whose wall expands under the load of the content
WITH_POINTS = ("vertical", "horizontal", "sphere")
