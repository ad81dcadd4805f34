"""Conversion of cells and keys to values by the kind of their field, with their decimal mark.

Decimal mark of the numbers in a CSV file of a job.

A number such as 12,5 or 0.125 has one meaning. The numbers 1,234 and 1.234 have two meanings: the
mark may be a decimal mark or separate thousands. The bounds of the column, the other numbers of the
file, or [csv] in the settings decide: a dip of up to 200 m is not 1234 m.

`read_value` converts the content of a file to a Python value, or raises `Refused` with the value
found and the value expected. `tankcal.job.fields` describes the fields.
The message of a refusal contains a hint if a spreadsheet stores a value as another type than
intended.
"""

import datetime
import math
import re
import unicodedata

from tankcal.job.fields import MAX_TEXT, Field, Refused, is_blank
from tankcal.job.tables import NOT_KNOWN, BadCell, Percent, nearest, shown
from tankcal.messages import message
from tankcal.text.naming import MAX_NAME, NUMBER, is_name
from tankcal.text.words import NO, YES, meant

_TWO_MEANINGS = re.compile(r"[+-]?[1-9][0-9]{0,2}[.,][0-9]{3}")


def has_two_meanings(text):
    """Return True if the mark of a number may be a decimal mark or separate thousands.

    Examples
    --------
    >>> has_two_meanings("1,234"), has_two_meanings("0,234"), has_two_meanings("1,23")
    (True, False, False)
    """
    return _TWO_MEANINGS.fullmatch(text) is not None


def settle_decimal(table, fields, log):
    """Determine the decimal mark of the numbers in a table; None for a table of a workbook.

    The numbers with one meaning decide if they all have the same mark. Without a declared mark, a
    number has one meaning if the other is outside the bounds of its column. Otherwise the mark
    declared in [csv] applies. A number with two meanings that neither decides is one problem for
    the file.

    Parameters
    ----------
    table : Table
        Table as read.
    fields : sequence of Field
        Columns of the table.
    log : Log
        Receives the problem.

    Returns
    -------
    str or None
    """
    if table.decimal is None:
        return None
    places = [
        (table.headings.index(field.name), field)
        for field in fields
        if field.kind == "number" and field.name in table.headings
    ]
    marks = _marks_of(table, places, table.decimal == NOT_KNOWN)
    if len(marks) == 1:
        return marks.pop()
    default = "." if table.decimal == NOT_KNOWN else table.decimal
    doubtful = _first_in_doubt(table, places, marks)
    if doubtful is None:
        return default
    text, row, column = doubtful
    plain = text.replace(",", ".")
    found = {"found": shown(text), "small": plain, "large": plain.replace(".", "")}
    expected = message(
        "two_meanings",
        "found {found}, which is {small} or {large}; expected a decimal mark that is known: set "
        "[csv] decimal = '.' or ','",
        **found,
    )
    if table.decimal != NOT_KNOWN:
        expected = message(
            "two_meanings_declared",
            "found {found}, which is {small} or {large}; expected '{mark}' as decimal mark: "
            "set [csv] decimal = '{other}' if it is {small}",
            **found,
            mark=table.decimal,
            other="," if table.decimal == "." else ".",
        )
    log.problem(table.file, expected, row, column)
    return "," if "," in text else "."


def _marks_of(table, places, by_bounds):
    """Set of the decimal marks of numbers with one meaning, also `by_bounds` of their columns."""
    marks = set()
    for place, field in places:
        cells = {row[place] for row in table.rows}
        for mark in {".", ","} - marks:
            present = [cell.strip(" \t") for cell in cells if cell and mark in cell]
            if any(
                _shows(text, mark) or (by_bounds and _is_decimal(text, mark, field))
                for text in present
            ):
                marks.add(mark)
    return marks


def _shows(text, mark):
    """Return True if the text is a number with one meaning and this decimal mark."""
    if len(text) > MAX_NAME or text.count(",") + text.count(".") != 1 or has_two_meanings(text):
        return False
    return NUMBER.fullmatch(text.replace(mark, ".")) is not None


def _is_decimal(text, mark, field):
    """Return True if the field accepts a number with two meanings as a decimal fraction only."""
    if not has_two_meanings(text):
        return False
    small, large = float(text.replace(mark, ".")), float(text.replace(mark, ""))
    return field.low <= small <= field.high and not field.low <= large <= field.high


def _first_in_doubt(table, places, marks):
    """(text, row, column) of the first number whose meaning is not decided, or None.

    If both marks occur in numbers with one meaning, `read_value` refuses each other number.
    """
    if marks and table.decimal != NOT_KNOWN:
        return None
    for row, number in zip(table.rows, table.row_numbers, strict=True):
        for place, field in places:
            text = (row[place] or "").strip(" \t")
            if has_two_meanings(text) and table.decimal not in text:
                return text, number, field.name
    return None


MAX_LIST = 50  # largest count of numbers or pairs in one value
MAX_NAMES = 5000  # largest count of names in one value
MAX_ROWS = 4000  # largest count of rows of numbers in one value
IN_LIST = "list"  # in place of a decimal mark: a point, because a comma may separate numbers
IN_TOML = "toml"  # in place of a decimal mark: a text is not a number
NEXT_TO_ZERO = 1e-30  # smallest size or sd other than 0; its square must not underflow

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
_WITH_UNIT = re.compile(
    r"([+-]?[0-9][0-9.,]*(?:[eE][+-]?[0-9]+)?)([^\W\d_].{0,11}|[%°'\"′″].{0,5})?"
)
_SHARES = {"ppm": 1e-6, "%": 1e-2}
_OF_SHARES = "_ppm", "_percent"  # endings of keys in these units
_DAYS_OF_OUR_TIME = (18_000, 80_000)  # day numbers of spreadsheets for 1949 to 2119


def read_value(field, raw, decimal=None):
    """Convert the content of a cell or key to a value.

    Parameters
    ----------
    field : Field
        Description of the cell or key.
    raw : object
        Content, not blank.
    decimal : str, optional
        Decimal mark of numbers given as text (CSV). None (workbook) or IN_TOML: numbers must be
        given as numbers.

    Returns
    -------
    float, str, bool or tuple

    Raises
    ------
    Refused
        If the field does not accept the value.
    """
    if isinstance(raw, BadCell):
        raise Refused(
            message(
                "complaint",
                "{complaint}; expected {expected}",
                complaint=raw.complaint,
                expected=field.expectation,
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


def _refusal(field, found, hint=""):
    """`Refused` for a value that the field does not accept."""
    return Refused(
        message(
            "found_expected",
            "found {found}; expected {expected}{hint}",
            found=found,
            expected=field.expectation,
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
        raise _refusal(field, _kind_of(raw), hint_of_number(raw))
    if not math.isfinite(value):
        raise _refusal(field, shown(raw), message("not_infinite", ", not NaN or infinite"))
    if field.low == 0 < value < NEXT_TO_ZERO:
        raise _refusal(
            field, shown(raw), message("next_to_zero", ": 0, or a number further from 0")
        )
    if value > field.high or value < field.low or (field.above_low and value == field.low):
        hint = _other_unit(field, value)
        raise _refusal(field, shown(raw), hint)
    return value


def _number_of_text(field, raw, decimal):
    """Number given as text, with the decimal mark of the file or an unambiguous other mark."""
    text = raw.strip(" \t")
    if len(text) > MAX_NAME:
        raise _refusal(field, shown(raw))
    plain = text.replace(",", ".") if decimal == "," else text
    is_number = NUMBER.fullmatch(plain) is not None
    if decimal in (None, IN_TOML):
        hint = hint_of_text(text, in_cell=decimal is None, name=field.name)
        found = message("the_text", "the text {found}", found=shown(raw))
        raise _refusal(field, found, hint)
    if is_number and not (decimal == "," and "." in text):
        return float(plain)
    # A mark that differs from the declared mark is accepted if the number has one meaning.
    with_point = text.replace(",", ".")
    if decimal != IN_LIST and NUMBER.fullmatch(with_point) and not has_two_meanings(text):
        return float(with_point)
    if decimal == "." and NUMBER.fullmatch(text.replace(",", ".")):
        hint = message(
            "with_decimal_point",
            " with a decimal point; for decimal commas set [csv] decimal = ','",
        )
    elif decimal == "," and NUMBER.fullmatch(text):
        hint = message("with_decimal_comma", " with a decimal comma, as [csv] decimal says")
    else:
        hint = ""
    raise _refusal(field, shown(raw), hint)


def _float(raw):
    try:
        return float(raw)
    except OverflowError:
        return math.inf


def _kind_of(raw):
    """Value as shown in a message, with its type if the type is wrong."""
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
    if value < 0 <= field.low < -value <= field.high:
        return message("is_negative", " (is the sign wrong?)")
    if field.name.endswith("_mm"):
        return message("in_millimetres", " (in millimetres: is it in another unit?)")
    if field.name.endswith("_m"):
        return message("in_metres", " (in metres: is it in another unit?)")
    return ""


def _read_text(field, raw, _decimal):
    if isinstance(raw, str):
        text = raw.replace("\u00a0", " ").strip()
    elif isinstance(raw, bool | dict | list):
        raise _refusal(field, _kind_of(raw))
    elif isinstance(raw, float) and raw.is_integer() and abs(raw) < 1e15:
        text = str(int(raw))
    elif isinstance(raw, int) and abs(raw) >= 1e15:
        raise _refusal(field, shown(raw))
    elif isinstance(raw, datetime.datetime) and raw.time() == datetime.time(0):
        text = raw.date().isoformat()
    else:
        text = str(raw)
    if field.kind == "text":
        is_valid = len(text) <= MAX_TEXT and all(
            (char.isprintable() or unicodedata.category(char) == "Zs") for char in text
        )
    elif field.kind == "name":
        is_valid = is_name(text)
    else:
        patterns = {
            "tank id": _TANK_ID,
            "mesh file": _MESH_FILE,
            "cloud file": _CLOUD_FILE,
            "rule name": _RULE_NAME,
        }
        pattern = patterns[field.kind]
        is_valid = len(text) <= MAX_NAME and pattern.fullmatch(text) is not None
    if not is_valid:
        raise _refusal(field, shown(text))
    return meant(text, field.choices) or text


def _read_choice(field, raw, _decimal):
    is_padded = isinstance(raw, str) and raw not in field.choices
    text = raw.strip() if is_padded else raw
    if is_padded and text not in field.choices:
        text = meant(text, field.choices) or text
    if text not in field.choices:
        hint = nearest(text, field.choices) if isinstance(text, str) else ""
        raise _refusal(field, shown(raw), hint)
    return text


def _read_flag(field, raw, _decimal):
    if isinstance(raw, bool):
        return raw
    if isinstance(raw, str):
        word = raw.strip().lower()
        word = word if word in (YES, NO) else meant(word, (YES, NO))
        if word is not None:
            return word == YES
    raise _refusal(field, shown(raw))


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
    raise _refusal(field, shown(raw), hint_of_date(raw))


def _read_time(field, raw, _decimal):
    text = raw.strip() if isinstance(raw, str) else ""
    try:
        if isinstance(raw, datetime.datetime):
            moment = raw
        elif _ISO_TIME.fullmatch(text):
            moment = datetime.datetime.fromisoformat(text)
        else:
            raise _refusal(field, shown(raw), hint_of_date(raw))
    except ValueError as error:
        if isinstance(error, Refused):
            raise
        raise _refusal(field, shown(raw)) from error
    return (moment.replace(tzinfo=None) - _EPOCH).total_seconds()


def _read_numbers(field, raw, decimal):
    """Tuple of numbers from a list, a text such as 700; 850, or a single number."""
    parts = raw.split(";") if isinstance(raw, str) else raw if isinstance(raw, list) else [raw]
    if not parts or len(parts) > MAX_LIST:
        raise Refused(
            message(
                "found_not_so_many",
                "found {found}; expected 1 to {most} {expected}",
                found=shown(raw),
                most=MAX_LIST,
                expected=field.expectation,
            )
        )
    is_text = isinstance(raw, str)
    mark = IN_LIST if is_text else decimal
    try:
        return tuple(_read_number(field, part.strip() if is_text else part, mark) for part in parts)
    except Refused as refusal:
        raise _refusal(field, refusal.text.values["found"]) from None


def _read_rows(field, raw, decimal):
    """Tuple of rows of numbers from a list of lists or a text such as 1 0 0; 0 1 0."""
    if isinstance(raw, str) and raw.strip() in field.choices:
        return raw.strip()
    rows = raw
    if isinstance(raw, str):
        rows = [part.split() for part in raw.split(";") if part.strip()]
    elif isinstance(raw, list) and raw and not any(isinstance(row, list) for row in raw):
        rows = [raw]
    if not isinstance(rows, list) or not 0 < len(rows) <= MAX_ROWS:
        raise _refusal(field, shown(raw))
    if not all(isinstance(row, list) and len(row) == field.width for row in rows):
        raise _refusal(field, shown(raw))
    mark = IN_LIST if isinstance(raw, str) else decimal
    number = Field(field.name, "number", field.note, low=field.low, high=field.high)
    try:
        return tuple(tuple(_read_number(number, value, mark) for value in row) for row in rows)
    except Refused as refusal:
        raise _refusal(field, refusal.text.values["found"]) from None


def _read_names(field, raw, _decimal):
    """Tuple of names from a list, a text such as P7; P9, or a single number used as a name."""
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
            raise _refusal(field, shown(raw))
        names.append(_read_text(text, part, None))
    return tuple(names)


def _read_dms(field, raw, _decimal):
    """Degrees from a text such as 123 04 05.6, 123-04-05.6 or 123°04'05.6\"; negative: -0 30 00."""
    if not isinstance(raw, str):
        raise Refused(
            message(
                "expected_text_of",
                "found {found}; expected the text of {expected}",
                found=_kind_of(raw),
                expected=field.expectation,
            )
        )
    match = _DMS.fullmatch(raw.replace("\u00a0", " ").strip())
    if match is None:
        raise _refusal(field, shown(raw))
    sign, degrees, minutes, seconds = match.groups()
    seconds = float((seconds or "0").replace(",", "."))  # a comma is a decimal mark below 60
    if int(minutes) >= 60 or seconds >= 60:
        hint = message("minutes_below_60", ", minutes and seconds below 60")
        raise _refusal(field, shown(raw), hint)
    value = (int(degrees) * 3600 + int(minutes) * 60 + seconds) / 3600
    value = -value if sign == "-" else value
    if not field.low <= value <= field.high:
        raise _refusal(field, shown(raw))
    return value


def _read_ranges(field, raw, _decimal):
    """Tuple of (low, high) from a list of pairs or a text such as 0-0.3; 2.1-2.4."""
    pairs = raw
    if isinstance(raw, str):
        matches = [_PAIR.fullmatch(part) for part in raw.split(";")]
        pairs = [match.groups() for match in matches] if all(matches) else None
    is_list = isinstance(pairs, list) and 0 < len(pairs) <= MAX_LIST
    if not is_list or not all(isinstance(pair, list | tuple) and len(pair) == 2 for pair in pairs):
        raise _refusal(field, _kind_of(raw))
    decimal = IN_LIST if isinstance(raw, str) else None
    number = Field(field.name, "number", field.note, low=0, high=200)
    return tuple(tuple(_read_number(number, end, decimal) for end in pair) for pair in pairs)


def hint_of_text(text, in_cell=True, name=""):
    """Hint on how to correct a text that looks like a number.

    Parameters
    ----------
    text : str
        Content of the cell or key.
    in_cell : bool, optional
        False: the text is in a TOML file.
    name : str, optional
        Name of the key, which ends with its unit.

    Returns
    -------
    Message or str
        "" if the text does not look like a number.
    """
    plain = unicodedata.normalize("NFKC", text).strip().lstrip("'\u2019`").replace(" ", "")
    match = _WITH_UNIT.fullmatch(plain)
    if match is None:
        return ""
    number, unit = match.groups()
    marks = len(re.findall("[.,]", number))
    if not in_cell:
        whole = number.replace(",", ".") if marks < 2 else "it"
        if unit in _SHARES and marks < 2 and not name.endswith(_OF_SHARES):
            whole = f"{float(whole) * _SHARES[unit]:g}"
        return message(
            "without_quotation_marks",
            ", stored as a number: write {whole} without quotation marks",
            whole=whole,
        )
    if unit is not None:
        return message(
            "number_alone",
            ", stored as a number: type {number} alone, the unit is in the heading",
            number=number,
        )
    if marks > 1:
        return message(
            "without_thousands",
            ", stored as a number: type it again without marks between thousands",
        )
    return message(
        "no_text_cell",
        ", stored as a number: type {number} again without quotation marks or apostrophe, in a "
        "cell that is not of text format",
        number=number,
    )


def hint_of_number(raw):
    """Hint on how to correct a date or a percentage in the cell of a number."""
    if isinstance(raw, float):
        return message(
            "without_percent",
            " without percent format (the cell holds {cell:.12g})",
            cell=float(raw),
        )
    if isinstance(raw, datetime.date | datetime.time | datetime.timedelta):
        return message(
            "taken_for_a_date",
            " (spreadsheets take 12/5 for a date: give the cell a number format, type it again)",
        )
    return ""


def hint_of_date(raw):
    """Hint on how to correct a day number in the cell of a date."""
    low, high = _DAYS_OF_OUR_TIME
    if isinstance(raw, int | float) and not isinstance(raw, bool) and low < raw < high:
        return message("give_date_format", ": give the cell a date format")
    return ""
