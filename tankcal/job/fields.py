"""What one value of a job may be: a number with its bounds, a name, a date, a choice.

A `Field` describes one key of job.toml or one column of a table; `read_value` turns what stands in
the file into a Python value, or raises `Refused` with what was found and what was expected.
"""

import datetime
import math
import re
import unicodedata
from dataclasses import dataclass

from tankcal.job.hints import hint_of_date, hint_of_number, hint_of_text
from tankcal.job.tables import BadCell, Percent, nearest, shown
from tankcal.messages import message
from tankcal.text.form_words import NO, YES, meant
from tankcal.text.naming import MAX_NAME, is_name
from tankcal.text.numerals import NUMBER

MAX_TEXT = 300
MAX_LIST = 50  # numbers or pairs
IN_TOML = "toml"  # in place of a decimal mark: a number is a number, and never a cell
MAX_NAMES = 5000
MAX_ROWS = 4000
NEXT_TO_ZERO = 1e-30  # no size, no standard deviation is so small: its square would be nothing

_TANK_ID = re.compile(r"(?!.*\.\.)[\w(][\w .()-]*")
_RULE_NAME = re.compile(r"(?!.*\.\.)\w[\w .()-]*")
_MESH_FILE = re.compile(r"(?!.*\.\.)\w[\w .()-]*\.(stl|obj|ply|off)", re.IGNORECASE)
_CLOUD_FILE = re.compile(
    r"(?!.*\.\.)\w[\w .()/-]*\.(las|laz|e57|ply|ptx|pts|xyz|asc|txt|csv)", re.IGNORECASE
)
_DMS = re.compile(
    r"([+-]?)([0-9]{1,3})(?:[ \t]*[°º][ \t]*|[ \t]+|-)([0-9]{1,2})(?:"
    r"(?:[ \t]*['′’][ \t]*|[ \t]+|-)([0-9]{1,2}(?:[.,][0-9]{0,9})?)[ \t]*(?:\"|″|”|''|′′)?|['′’]?)"
)
_PAIR = re.compile(r"\s*([0-9.]+)\s*[-–]\s*([0-9.]+)\s*")
_ISO_TIME = re.compile(
    r"[0-9]{4}-[0-9]{2}-[0-9]{2}[T ][0-9]{2}:[0-9]{2}(:[0-9]{2}(\.[0-9]{1,6})?)?"
)
_EPOCH = datetime.datetime(2000, 1, 1)
_ISO_DATE = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}")


class Refused(ValueError):
    """The value is not what the field takes; `text` says what was found and expected."""

    @property
    def text(self):
        return self.args[0]


@dataclass(frozen=True)
class Field:
    """One key or column.

    name       as written in the file, with its unit
    kind       "number", "text", "name", "tank id", "choice", "flag", "date", "time" (date and time
               of day; read as seconds since 2000), "mesh file",
               "rule name", "numbers" (several of them), "ranges" (pairs of numbers), "names"
               (several of them), "rows" (of so many numbers each), "cloud file" or "dms"
               (degrees, minutes and seconds; read as degrees)
    note       one line for the person who fills it in
    required   must be there and filled in, for every kind of tank in `kinds`
    kinds      the kinds of tank that it is for; (): all
    required_for  kinds of tank for which it is required though `required` is not set
    low, high  bounds of a number, both allowed unless `above_low`: then low itself is not
    choices    what a choice may be; of a number, words that may stand in its place; of a text, what
               it mostly is
    in_full    an optional column that is filled in for every row, or for none
    start      what the starter job has there
    of_survey  of use only where observations are adjusted
    width      numbers in each of the rows
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
        """Is it for tanks of this kind? Of a kind that is not known (None), nothing is refused."""
        return tank_kind is None or not self.kinds or tank_kind in self.kinds

    def is_required(self, tank_kind):
        """Must it be filled in for tanks of this kind (None: not known)?"""
        if self.required:
            return not self.kinds or tank_kind in self.kinds
        return tank_kind in self.required_for

    def expectation(self):
        """What is expected, in words: "a number above 0, at most 300"."""
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
        """Two values that the field allows, as a file has them: {one, other}."""
        low, high = max(self.low, 0.0), self.high
        two = (700.0, 850.0)
        if not low <= two[0] < two[1] <= high:
            two = (low + 0.2 * (high - low), low + 0.8 * (high - low))
        return {name: f"{value:g}" for name, value in zip(("one", "other"), two, strict=True)}

    def wanted(self):
        """What is expected where nothing stands: "height of the course (a number above 0)"."""
        if self.kind in ("text", "name", "tank id"):
            return message("noted", "{note}", note=self.note)
        return message("wanted", "{note} ({expected})", note=self.note, expected=self.expectation())

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
        if low == -high and high >= 1e5:  # bounds that only keep nonsense out
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
    """ "'a' or 'b' or 'c'"; in another language by the words that its forms have for them."""
    *others, last = (message("choice", "{choice!r}", choice=one) for one in choices)
    for one in reversed(others):
        last = message("either_or", "{one} or {other}", one=one, other=last)
    return last


def is_blank(raw):
    """Is nothing given? An empty text and an empty list count as blank; 0 and false do not."""
    return raw is None or raw == [] or (isinstance(raw, str) and not raw.strip())


def read_value(field, raw, decimal=None):
    """The value of a field as float, text or bool; `raw` is not blank.

    decimal is the mark of numbers that stand as text (CSV), or None (workbook) or IN_TOML where a
    number is a number. Raises Refused.
    """
    if isinstance(raw, BadCell):
        raise Refused(
            message(
                "complaint",
                "{complaint}; expected {expected}",
                complaint=raw.complaint,
                expected=field.expectation(),
            )
        )
    reader = {
        "number": _read_number,
        "choice": _read_choice,
        "flag": _read_flag,
        "date": _read_date,
        "time": _read_time,
        "numbers": _read_numbers,
        "ranges": _read_ranges,
        "names": _read_names,
        "rows": _read_rows,
        "dms": _read_dms,
    }.get(field.kind, _read_text)
    return reader(field, raw, decimal)


def _refused(field, found, hint=""):
    """Refused of a value that is not what the field takes."""
    return Refused(
        message(
            "found_expected",
            "found {found}; expected {expected}{hint}",
            found=found,
            expected=field.expectation(),
            hint=hint,
        )
    )


def _read_number(field, raw, decimal):
    if field.choices and isinstance(raw, str) and raw.strip() in field.choices:
        return raw.strip()
    if isinstance(raw, str):
        value = _number_of_text(field, raw, decimal)
    elif isinstance(raw, int | float) and not isinstance(raw, bool | Percent):
        value = _float(raw)
    else:
        raise _refused(field, _kind_of(raw), hint_of_number(raw))
    if not math.isfinite(value):
        raise _refused(field, shown(raw), message("not_infinite", ", not NaN or infinite"))
    if field.low == 0 < value < NEXT_TO_ZERO:
        raise _refused(
            field, shown(raw), message("next_to_zero", ": 0, or a number further from 0")
        )
    if value > field.high or value < field.low or (field.above_low and value == field.low):
        hint = _other_unit(field, value)
        raise _refused(field, shown(raw), hint)
    return value


def _number_of_text(field, raw, decimal):
    text = raw.strip(" \t")
    if len(text) > MAX_NAME:
        raise _refused(field, shown(raw))
    plain = text.replace(",", ".") if decimal != "." else text
    is_number = NUMBER.fullmatch(plain) is not None
    if decimal in (None, IN_TOML):
        hint = hint_of_text(text, in_cell=decimal is None)
        found = message("the_text", "the text {found}", found=shown(raw))
        raise _refused(field, found, hint)
    if is_number and not (decimal == "," and "." in text):
        return float(plain)
    if decimal == "." and NUMBER.fullmatch(text.replace(",", ".")):
        hint = message(
            "with_decimal_point",
            " with a decimal point; for decimal commas set [csv] decimal = ','",
        )
    elif decimal == "," and NUMBER.fullmatch(text):
        hint = message("with_decimal_comma", " with a decimal comma, as [csv] decimal says")
    else:
        hint = ""
    raise _refused(field, shown(raw), hint)


def _float(raw):
    try:
        return float(raw)
    except OverflowError:
        return math.inf


def _kind_of(raw):
    """A value as found, with its kind where that is what is wrong with it."""
    found = shown(raw)
    if isinstance(raw, bool):
        return message("the_truth_value", "the truth value {found}", found=found)
    if isinstance(raw, datetime.date):
        return message("the_date", "the date {found}", found=found)
    if isinstance(raw, datetime.time | datetime.timedelta):
        return message("the_time", "the time {found}", found=found)
    if isinstance(raw, Percent):
        return message("the_percentage", "the percentage {found}", found=found)
    return found


def _other_unit(field, value):
    if "_per_" in field.name:
        return ""
    if field.name.endswith("_deg") and field.high < abs(value) <= field.high * 10 / 9:
        return message("is_in_gon", " (is it in gon?)")
    if field.name.startswith("zenith_") and value > field.high:
        return message("second_face", " (in the second face? give the mean of both)")
    if field.name.endswith("_mm"):
        return message("in_millimetres", " (in millimetres: is it in another unit?)")
    if field.name.endswith("_m"):
        return message("in_metres", " (in metres: is it in another unit?)")
    return ""


def _read_text(field, raw, _decimal):
    if isinstance(raw, str):
        text = raw.replace("\u00a0", " ").strip()
    elif isinstance(raw, bool | dict | list):
        raise _refused(field, _kind_of(raw))
    elif isinstance(raw, float) and raw.is_integer() and abs(raw) < 1e15:
        text = str(int(raw))
    elif isinstance(raw, int) and abs(raw) >= 1e15:
        raise _refused(field, shown(raw))
    elif isinstance(raw, datetime.datetime) and raw.time() == datetime.time(0):
        text = raw.date().isoformat()
    else:
        text = str(raw)
    if field.kind == "text":
        sound = len(text) <= MAX_TEXT and all(_is_writing(char) for char in text)
    elif field.kind == "name":
        sound = is_name(text)
    else:
        patterns = {
            "tank id": _TANK_ID,
            "mesh file": _MESH_FILE,
            "cloud file": _CLOUD_FILE,
            "rule name": _RULE_NAME,
        }
        pattern = patterns[field.kind]
        sound = len(text) <= MAX_NAME and pattern.fullmatch(text) is not None
    if not sound:
        raise _refused(field, shown(text))
    return meant(text, field.choices) or text


def _is_writing(char):
    return char.isprintable() or unicodedata.category(char) == "Zs"


def _read_choice(field, raw, _decimal):
    is_padded = isinstance(raw, str) and raw not in field.choices
    text = raw.strip() if is_padded else raw
    if is_padded and text not in field.choices:
        text = meant(text, field.choices) or text
    if text not in field.choices:
        hint = nearest(text, field.choices) if isinstance(text, str) else ""
        raise _refused(field, shown(raw), hint)
    return text


def _read_flag(field, raw, _decimal):
    if isinstance(raw, bool):
        return raw
    if isinstance(raw, str):
        word = raw.strip().lower()
        word = word if word in (YES, NO) else meant(word, (YES, NO))
        if word is not None:
            return word == YES
    raise _refused(field, shown(raw))


def _read_date(field, raw, _decimal):
    if isinstance(raw, datetime.datetime):
        return raw.date().isoformat()
    if isinstance(raw, datetime.date):
        return raw.isoformat()
    text = raw.strip() if isinstance(raw, str) else ""
    try:
        if _ISO_DATE.fullmatch(text):
            return datetime.date.fromisoformat(text).isoformat()
    except ValueError:
        pass
    raise _refused(field, shown(raw), hint_of_date(raw))


def _read_time(field, raw, _decimal):
    text = raw.strip() if isinstance(raw, str) else ""
    try:
        if isinstance(raw, datetime.datetime):
            moment = raw
        elif _ISO_TIME.fullmatch(text):
            moment = datetime.datetime.fromisoformat(text)
        else:
            raise _refused(field, shown(raw), hint_of_date(raw))
    except ValueError as error:
        if isinstance(error, Refused):
            raise
        raise _refused(field, shown(raw)) from error
    return (moment.replace(tzinfo=None) - _EPOCH).total_seconds()


def _read_numbers(field, raw, decimal):
    """Tuple of a list of numbers, of a text such as 700; 850, or of one number."""
    parts = raw.split(";") if isinstance(raw, str) else raw if isinstance(raw, list) else [raw]
    if not parts or len(parts) > MAX_LIST:
        raise Refused(
            message(
                "found_not_so_many",
                "found {found}; expected 1 to {most} {expected}",
                found=shown(raw),
                most=MAX_LIST,
                expected=field.expectation(),
            )
        )
    is_text = isinstance(raw, str)
    mark = "." if is_text else decimal
    try:
        return tuple(_read_number(field, part.strip() if is_text else part, mark) for part in parts)
    except Refused as refusal:
        raise _refused(field, refusal.text.values["found"]) from None


def _read_rows(field, raw, decimal):
    """Tuple of rows of numbers, of a list of lists or of a text such as 1 0 0; 0 1 0."""
    if isinstance(raw, str) and raw.strip() in field.choices:
        return raw.strip()
    rows = raw
    if isinstance(raw, str):
        rows = [part.split() for part in raw.split(";") if part.strip()]
    elif isinstance(raw, list) and raw and not any(isinstance(row, list) for row in raw):
        rows = [raw]
    if not isinstance(rows, list) or not 0 < len(rows) <= MAX_ROWS:
        raise _refused(field, shown(raw))
    if not all(isinstance(row, list) and len(row) == field.width for row in rows):
        raise _refused(field, shown(raw))
    mark = "." if isinstance(raw, str) else decimal
    one = Field(field.name, "number", field.note, low=field.low, high=field.high)
    try:
        return tuple(tuple(_read_number(one, value, mark) for value in row) for row in rows)
    except Refused as refusal:
        raise _refused(field, refusal.text.values["found"]) from None


def _read_names(field, raw, _decimal):
    """Tuple of texts of a list, of a text such as P7; P9, or of one number that is a name."""
    parts = raw.split(";") if isinstance(raw, str) else raw if isinstance(raw, list) else [raw]
    if len(parts) > MAX_NAMES:
        raise Refused(
            message(
                "too_many_of_them",
                "{count} of them; expected at most {most}",
                count=len(parts),
                most=MAX_NAMES,
            )
        )
    text = Field(field.name, "text", field.note)
    names = []
    for part in parts:
        if is_blank(part) or isinstance(part, dict | list):
            raise _refused(field, shown(raw))
        names.append(_read_text(text, part, None))
    return tuple(names)


def _read_dms(field, raw, _decimal):
    """Degrees of a text such as 123 04 05.6, 123-04-05.6 or 123°04'05.6\"; negative: -0 30 00."""
    if not isinstance(raw, str):
        raise Refused(
            message(
                "expected_text_of",
                "found {found}; expected the text of {expected}",
                found=_kind_of(raw),
                expected=field.expectation(),
            )
        )
    match = _DMS.fullmatch(raw.replace("\u00a0", " ").strip())
    if match is None:
        raise _refused(field, shown(raw))
    sign, degrees, minutes, seconds = match.groups()
    seconds = float((seconds or "0").replace(",", "."))  # a thousands mark it cannot be
    if int(minutes) >= 60 or seconds >= 60:
        hint = message("minutes_below_60", ", minutes and seconds below 60")
        raise _refused(field, shown(raw), hint)
    value = (int(degrees) * 3600 + int(minutes) * 60 + seconds) / 3600
    value = -value if sign == "-" else value
    if not field.low <= value <= field.high:
        raise _refused(field, shown(raw))
    return value


def _read_ranges(field, raw, _decimal):
    """Tuple of (low, high) of a list of pairs, or of a text such as 0-0.3; 2.1-2.4."""
    pairs = raw
    if isinstance(raw, str):
        matches = [_PAIR.fullmatch(part) for part in raw.split(";")]
        pairs = [match.groups() for match in matches] if all(matches) else None
    is_list = isinstance(pairs, list) and 0 < len(pairs) <= MAX_LIST
    if not is_list or not all(isinstance(pair, list | tuple) and len(pair) == 2 for pair in pairs):
        raise _refused(field, _kind_of(raw))
    decimal = "." if isinstance(raw, str) else None
    number = Field(field.name, "number", field.note, low=0, high=200)
    return tuple(tuple(_read_number(number, end, decimal) for end in pair) for pair in pairs)
