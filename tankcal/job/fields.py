"""What one value of a job may be: a number with its bounds, a name, a date, a choice.

A `Field` describes one key of job.toml or one column of a table; `read_value` turns what stands in
the file into a Python value, or raises `Refused` with what was found and what was expected.
"""

import datetime
import math
import re
import unicodedata
from dataclasses import dataclass

from tankcal.job.misread import hint_of_date, hint_of_number, hint_of_text
from tankcal.job.tables import BadCell, Percent, nearest, shown
from tankcal.naming import MAX_NAME, is_name
from tankcal.numerals import NUMBER

MAX_TEXT = 300
MAX_LIST = 50  # numbers or pairs
IN_TOML = "toml"  # in place of a decimal mark: a number is a number, and never a cell
MAX_NAMES = 5000
NAME_RULE = "a letter, digit or underscore first, then letters, digits, spaces or _ - . ( ) / #"
TANK_ID_RULE = "letters, digits, spaces or _ - . ( ), no .. and no . or - first"

_TANK_ID = re.compile(r"(?!.*\.\.)[\w(][\w .()-]*")
_RULE_NAME = re.compile(r"(?!.*\.\.)\w[\w .()-]*")
_MESH_FILE = re.compile(r"(?!.*\.\.)\w[\w .()-]*\.(stl|obj|ply|off)", re.IGNORECASE)
_DMS = re.compile(
    r"([+-]?)([0-9]{1,3})(?:[ \t]*[°º][ \t]*|[ \t]+|-)([0-9]{1,2})(?:"
    r"(?:[ \t]*['′’][ \t]*|[ \t]+|-)([0-9]{1,2}(?:[.,][0-9]{0,9})?)[ \t]*(?:\"|″|”|''|′′)?|['′’]?)"
)
_PAIR = re.compile(r"\s*([0-9.]+)\s*[-–]\s*([0-9.]+)\s*")
_ISO_DATE = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}")


class Refused(ValueError):
    """The value is not what the field takes; the text says what was found and expected."""


@dataclass(frozen=True)
class Field:
    """One key or column.

    name       as written in the file, with its unit
    kind       "number", "text", "name", "tank id", "choice", "flag", "date", "mesh file",
               "rule name", "numbers" (several of them), "ranges" (pairs of numbers), "names"
               (several of them) or "dms" (degrees, minutes and seconds; read as degrees)
    note       one line for the person who fills it in
    required   must be there and filled in, for every kind of tank in `kinds`
    kinds      the kinds of tank that it is for; (): all
    required_for  kinds of tank for which it is required though `required` is not set
    low, high  bounds of a number, both allowed unless `above_low`: then low itself is not
    choices    what a choice may be; of a number, words that may stand in its place
    in_full    an optional column that is filled in for every row, or for none
    start      what the starter job has there
    of_survey  of use only where observations are adjusted
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
            return " or ".join(repr(choice) for choice in self.choices)
        if self.kind == "number":
            words = "".join(f", or {choice!r}" for choice in self.choices)
            return "a number" + self._bounds() + words
        if self.kind == "dms":
            return f"degrees, minutes and seconds such as 123 04 05.6{self._bounds(' degrees')}"
        if self.kind == "numbers":
            return f"numbers{self._bounds()}, such as 700; 850 (in a .toml file also [700, 850])"
        return {
            "text": f"text of at most {MAX_TEXT} characters in one line",
            "name": f"a name of at most {MAX_NAME} characters ({NAME_RULE})",
            "tank id": f"a name of at most {MAX_NAME} characters ({TANK_ID_RULE})",
            "flag": "true or false",
            "date": "a date such as 2024-05-31",
            "ranges": "pairs such as 0-0.3; 2.1-2.4 (in a .toml file also [[0, 0.3], [2.1, 2.4]])",
            "names": 'names such as P7; P9 (in a .toml file also ["P7", "P9"])',
            "rule name": "the name of a rule of tankcal, or of a .toml file in the job's folder",
            "mesh file": "the plain name of a .stl, .obj, .ply or .off file, in the job's folder",
        }[self.kind]

    def wanted(self):
        """What is expected where nothing stands: "height of the course (a number above 0)"."""
        is_plain = self.kind in ("text", "name", "tank id")
        return self.note if is_plain else f"{self.note} ({self.expectation()})"

    def _bounds(self, unit=""):
        if self.low == -self.high and self.high >= 1e5:  # bounds that only keep nonsense out
            return ""
        if math.isinf(self.high):
            return f" above {self.low:g}" if self.above_low else f" of {self.low:g} or more"
        if self.above_low:
            return f" above {self.low:g}, at most {self.high:g}{unit}"
        if unit:
            return f", from {self.low:g} to {self.high:g}{unit}"
        return f" from {self.low:g} to {self.high:g}"


def is_blank(raw):
    """Is nothing given? An empty text and an empty list count as blank; 0 and false do not."""
    return raw is None or raw == [] or (isinstance(raw, str) and not raw.strip())


def read_value(field, raw, decimal=None):
    """The value of a field as float, text or bool; `raw` is not blank.

    decimal is the mark of numbers that stand as text (CSV), or None (workbook) or IN_TOML where a
    number is a number. Raises Refused.
    """
    if isinstance(raw, BadCell):
        raise Refused(f"{raw.complaint}; expected {field.expectation()}")
    reader = {
        "number": _read_number,
        "choice": _read_choice,
        "flag": _read_flag,
        "date": _read_date,
        "numbers": _read_numbers,
        "ranges": _read_ranges,
        "names": _read_names,
        "dms": _read_dms,
    }.get(field.kind, _read_text)
    return reader(field, raw, decimal)


def _read_number(field, raw, decimal):
    if field.choices and isinstance(raw, str) and raw.strip() in field.choices:
        return raw.strip()
    if isinstance(raw, str):
        value = _number_of_text(field, raw, decimal)
    elif isinstance(raw, int | float) and not isinstance(raw, bool | Percent):
        value = _float(raw)
    else:
        found, hint = _kind_of(raw) + shown(raw), hint_of_number(raw)
        raise Refused(f"found {found}; expected {field.expectation()}{hint}")
    if not math.isfinite(value):
        raise Refused(f"found {shown(raw)}; expected {field.expectation()}, not NaN or infinite")
    if value > field.high or value < field.low or (field.above_low and value == field.low):
        hint = _other_unit(field, value)
        raise Refused(f"found {shown(raw)}; expected {field.expectation()}{hint}")
    return value


def _number_of_text(field, raw, decimal):
    wanted = field.expectation()
    text = raw.strip(" \t")
    if len(text) > MAX_NAME:
        raise Refused(f"found {shown(raw)}; expected {wanted}")
    plain = text.replace(",", ".") if decimal != "." else text
    is_number = NUMBER.fullmatch(plain) is not None
    if decimal in (None, IN_TOML):
        hint = hint_of_text(text, in_cell=decimal is None)
        raise Refused(f"found the text {shown(raw)}; expected {wanted}{hint}")
    if is_number and not (decimal == "," and "." in text):
        return float(plain)
    if decimal == "." and NUMBER.fullmatch(text.replace(",", ".")):
        hint = " with a decimal point; for decimal commas set [csv] decimal = ','"
    elif decimal == "," and NUMBER.fullmatch(text):
        hint = " with a decimal comma, as [csv] decimal says"
    else:
        hint = ""
    raise Refused(f"found {shown(raw)}; expected {wanted}{hint}")


def _float(raw):
    try:
        return float(raw)
    except OverflowError:
        return math.inf


def _kind_of(raw):
    if isinstance(raw, bool):
        return "the truth value "
    if isinstance(raw, datetime.date):
        return "the date "
    if isinstance(raw, datetime.time | datetime.timedelta):
        return "the time "
    return "the percentage " if isinstance(raw, Percent) else ""


def _other_unit(field, value):
    if "_per_" in field.name:
        return ""
    if field.name.endswith("_deg") and field.high < abs(value) <= field.high * 10 / 9:
        return " (is it in gon?)"
    if field.name.startswith("zenith_") and value > field.high:
        return " (in the second face? give the mean of both)"
    unit = {"_m": "metres", "_mm": "millimetres"}.get("_" + field.name.rpartition("_")[2])
    return f" (in {unit}: is it in another unit?)" if unit else ""


def _read_text(field, raw, _decimal):
    if isinstance(raw, str):
        text = raw.replace("\u00a0", " ").strip()
    elif isinstance(raw, bool | dict | list):
        raise Refused(f"found {_kind_of(raw)}{shown(raw)}; expected {field.expectation()}")
    elif isinstance(raw, float) and raw.is_integer() and abs(raw) < 1e15:
        text = str(int(raw))
    elif isinstance(raw, int) and abs(raw) >= 1e15:
        raise Refused(f"found {shown(raw)}; expected {field.expectation()}")
    elif isinstance(raw, datetime.datetime) and raw.time() == datetime.time(0):
        text = raw.date().isoformat()
    else:
        text = str(raw)
    if field.kind == "text":
        sound = len(text) <= MAX_TEXT and all(_is_writing(char) for char in text)
    elif field.kind == "name":
        sound = is_name(text)
    else:
        patterns = {"tank id": _TANK_ID, "mesh file": _MESH_FILE, "rule name": _RULE_NAME}
        pattern = patterns[field.kind]
        sound = len(text) <= MAX_NAME and pattern.fullmatch(text) is not None
    if not sound:
        raise Refused(f"found {shown(text)}; expected {field.expectation()}")
    return text


def _is_writing(char):
    return char.isprintable() or unicodedata.category(char) == "Zs"


def _read_choice(field, raw, _decimal):
    is_padded = isinstance(raw, str) and raw not in field.choices
    text = raw.strip() if is_padded else raw
    if text not in field.choices:
        hint = nearest(text, field.choices) if isinstance(text, str) else ""
        raise Refused(f"found {shown(raw)}; expected {field.expectation()}{hint}")
    return text


def _read_flag(field, raw, _decimal):
    if isinstance(raw, bool):
        return raw
    if isinstance(raw, str) and raw.strip().lower() in ("true", "false"):
        return raw.strip().lower() == "true"
    raise Refused(f"found {shown(raw)}; expected {field.expectation()}")


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
    raise Refused(f"found {shown(raw)}; expected {field.expectation()}{hint_of_date(raw)}")


def _read_numbers(field, raw, decimal):
    """Tuple of a list of numbers, of a text such as 700; 850, or of one number."""
    parts = raw.split(";") if isinstance(raw, str) else raw if isinstance(raw, list) else [raw]
    if not parts or len(parts) > MAX_LIST:
        raise Refused(f"found {shown(raw)}; expected 1 to {MAX_LIST} {field.expectation()}")
    is_text = isinstance(raw, str)
    mark = "." if is_text else decimal
    try:
        return tuple(_read_number(field, part.strip() if is_text else part, mark) for part in parts)
    except Refused as refusal:
        found = str(refusal).partition("; expected")[0]
        raise Refused(f"{found}; expected {field.expectation()}") from None


def _read_names(field, raw, _decimal):
    """Tuple of texts of a list, of a text such as P7; P9, or of one number that is a name."""
    parts = raw.split(";") if isinstance(raw, str) else raw if isinstance(raw, list) else [raw]
    if len(parts) > MAX_NAMES:
        raise Refused(f"{len(parts)} of them; expected at most {MAX_NAMES}")
    text = Field(field.name, "text", field.note)
    names = []
    for part in parts:
        if is_blank(part) or isinstance(part, dict | list):
            raise Refused(f"found {shown(raw)}; expected {field.expectation()}")
        names.append(_read_text(text, part, None))
    return tuple(names)


def _read_dms(field, raw, _decimal):
    """Degrees of a text such as 123 04 05.6, 123-04-05.6 or 123°04'05.6\"; negative: -0 30 00."""
    wanted = field.expectation()
    if not isinstance(raw, str):
        raise Refused(f"found {_kind_of(raw)}{shown(raw)}; expected the text of {wanted}")
    match = _DMS.fullmatch(raw.replace("\u00a0", " ").strip())
    if match is None:
        raise Refused(f"found {shown(raw)}; expected {wanted}")
    sign, degrees, minutes, seconds = match.groups()
    seconds = float((seconds or "0").replace(",", "."))  # a thousands mark it cannot be
    if int(minutes) >= 60 or seconds >= 60:
        raise Refused(f"found {shown(raw)}; expected {wanted}, minutes and seconds below 60")
    value = (int(degrees) * 3600 + int(minutes) * 60 + seconds) / 3600
    value = -value if sign == "-" else value
    if not field.low <= value <= field.high:
        raise Refused(f"found {shown(raw)}; expected {wanted}")
    return value


def _read_ranges(field, raw, _decimal):
    """Tuple of (low, high) of a list of pairs, or of a text such as 0-0.3; 2.1-2.4."""
    pairs = raw
    if isinstance(raw, str):
        matches = [_PAIR.fullmatch(part) for part in raw.split(";")]
        pairs = [match.groups() for match in matches] if all(matches) else None
    is_list = isinstance(pairs, list) and 0 < len(pairs) <= MAX_LIST
    if not is_list or not all(isinstance(pair, list | tuple) and len(pair) == 2 for pair in pairs):
        raise Refused(f"found {_kind_of(raw)}{shown(raw)}; expected {field.expectation()}")
    decimal = "." if isinstance(raw, str) else None
    number = Field(field.name, "number", field.note, low=0, high=200)
    return tuple(tuple(_read_number(number, end, decimal) for end in pair) for pair in pairs)
