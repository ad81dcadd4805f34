"""Value of a cell, by the type and the format of the cell."""

import datetime
import re
from dataclasses import dataclass

from tankcal.job.excel.archive import damaged
from tankcal.job.excel.markup import parse
from tankcal.job.tables import BadCell, Percent, shown
from tankcal.messages import message

_ESCAPED = re.compile(r"_x([0-9A-Fa-f]{4})_")
# Parts of a number format that are not placeholders.
_NOT_SHOWN = re.compile(r'"[^"]*"|\\.|\[[^\]]*\]')
_INTEGER = re.compile(r"-?[0-9]{1,15}")
DATE, DURATION, PERCENT = "date", "duration", "percent"


def uncalculated():
    """`BadCell` for a formula without a stored result.

    Such a cell looks blank; without this mark an optional cell would count as not given.
    """
    return BadCell(
        message(
            "not_calculated",
            "a formula without its result; open the workbook in Excel or LibreOffice and save it",
        )
    )


@dataclass(frozen=True)
class Values:
    """Common data of the cells of a workbook.

    Attributes
    ----------
    strings : list of str
        Shared texts, to which cells refer by index.
    formats : list
        DATE, DURATION, PERCENT or None for each cell style.
    epoch : datetime
        First day of the calendar of dates.
    """

    strings: list
    formats: list
    epoch: datetime.datetime

    def of(self, attributes, content):
        """Value of a cell: text, number, bool, date, Percent, BadCell, or None if blank."""
        kind = attributes.get("t", "n")
        if kind == "n":
            return self._number(attributes, content) if content else None
        if kind == "s":
            index = int(content)
            return self.strings[index] if index >= 0 else None
        if kind in ("str", "inlineStr"):
            return unescaped(content) or None
        if kind == "b":
            return content.strip() in ("1", "true")
        if kind == "e":
            return BadCell(message("cell_shows", "the cell shows {found}", found=shown(content)))
        if kind == "d":
            return _iso_date(content)
        raise damaged()

    def _number(self, attributes, content):
        value = int(content) if _INTEGER.fullmatch(content) else float(content)
        style = attributes.get("s")
        shown_as = None if style is None else self.formats[int(style)]
        if shown_as is None:
            return value
        if shown_as == PERCENT:
            return Percent(value)
        from openpyxl.utils.datetime import from_excel

        try:
            return from_excel(value, self.epoch, timedelta=shown_as == DURATION)
        except (OverflowError, ValueError):
            return BadCell(
                message(
                    "no_such_day",
                    "the cell shows {value:g} as a date, and there is no such day",
                    value=value,
                )
            )


def _iso_date(content):
    try:
        return datetime.datetime.fromisoformat(content.removesuffix("Z"))
    except ValueError:
        return content


def unescaped(text):
    """Text as shown by Excel; _x000D_ represents one character."""
    return _ESCAPED.sub(lambda match: chr(int(match[1], 16)), text) if "_x" in text else text


def read_strings(archive, member):
    """Shared texts of the cells, without the phonetic readings of Asian texts."""
    strings, pieces, reading = [], [], []

    def text(piece):
        if not reading:
            pieces.append(piece)

    def end_of_string(_text):
        strings.append(unescaped("".join(pieces)) or None)
        pieces.clear()

    parse(
        archive,
        member,
        {"rPh": lambda _attributes: reading.append(True)},
        {"t": text, "rPh": lambda _text: reading.pop(), "si": end_of_string},
    )
    return strings


def read_formats(archive, member):
    """DATE, DURATION, PERCENT or None for each cell style."""
    from openpyxl.styles.numbers import BUILTIN_FORMATS

    codes, numbers, inside = dict(BUILTIN_FORMATS), [], []

    def number_format(attributes):
        codes[int(attributes["numFmtId"])] = attributes["formatCode"]

    def cell_style(attributes):
        if inside:
            numbers.append(int(attributes.get("numFmtId", 0)))

    parse(
        archive,
        member,
        {
            "numFmt": number_format,
            "cellXfs": lambda _attributes: inside.append(True),
            "xf": cell_style,
        },
        {"cellXfs": lambda _text: inside.pop()},
    )
    kinds = {number: _kind(codes.get(number, "General")) for number in set(numbers)}
    return [kinds[number] for number in numbers]


def _kind(code):
    from openpyxl.styles.numbers import is_date_format, is_timedelta_format

    if is_timedelta_format(code):
        return DURATION
    if is_date_format(code):
        return DATE
    return PERCENT if "%" in _NOT_SHOWN.sub("", code) else None
