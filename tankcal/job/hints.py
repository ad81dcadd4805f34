"""Hints on values that a spreadsheet stores as another type than intended."""

import datetime
import re
import unicodedata

from tankcal.messages import message

_WITH_UNIT = re.compile(
    r"([+-]?[0-9][0-9.,]*(?:[eE][+-]?[0-9]+)?)([^\W\d_].{0,11}|[%°'\"′″].{0,5})?"
)
_SHARES = {"ppm": 1e-6, "%": 1e-2}
_OF_SHARES = "_ppm", "_percent"  # endings of keys in these units
_DAYS_OF_OUR_TIME = (18_000, 80_000)  # day numbers of spreadsheets for 1949 to 2119


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
