"""Leica GSI-8 and GSI-16: words with a two-digit index, a unit and a signed value.

A block begins with word 11 or 41, usually on a separate line. Digit 6 of a word is its unit. Slope
distances already contain the prism constant and the ppm of the instrument, which words 51, 58 and
59 only state. Blocks of words 41 to 49 contain codes. The surveyor determines whether a code
applies to the readings before or after it, or to a station. The file does not contain this
information.
"""

import datetime
import math
import re
from dataclasses import dataclass, replace

from tankcal.messages import message
from tankcal.products.fieldbooks.book import (
    DEGREES,
    METRES,
    NO_YEAR,
    FieldBook,
    KnownPoint,
    refuse_minutes,
    refuse_number,
    strip_name,
)

LINE = re.compile(r"\s*\*?\d\d[0-9. ]{4}[+-]")
_WORD = re.compile(r"(\d\d)(.)(.)(.)(.)([+-])(.+)", re.DOTALL)
_TWO_VALUES = re.compile(r"([+-]\d+)([+-]\d+)")
LENGTHS = {  # digit 6: (unit, number of last digits in one unit)
    "0": ("m", 1e3),
    "1": ("ft", 1e3),
    "6": ("m", 1e4),
    "7": ("ft", 1e4),
    "8": ("m", 1e5),
}
ANGLES = {"2": ("gon", 1e5), "3": ("deg", 1e5), "4": ("dms", 1e5), "5": ("mil", 1e4)}
OF_TARGET, OF_STATION = ("81", "82", "83"), ("84", "85", "86")
TEXTS = ("11", *(f"7{digit}" for digit in range(1, 10)))
LENGTH_WORDS = ("31", "32", "33", *OF_TARGET, *OF_STATION, "87", "88")
CODES = tuple(f"4{digit}" for digit in range(1, 10))
KNOWN = (*TEXTS, *CODES, *LENGTH_WORDS, "12", "13", "17", "19", "21", "22", "51", "58", "59")
SHOWN = 3  # code blocks
FILLER = re.compile(r"[-?]*")  # characters for a missing code or name
NO_VALUE = re.compile(r"0*[-?*. ]+")  # digits of a word without a value, usually -----
EARLIEST, LATEST = 1980, 2200  # years
SAME_M = 0.001  # tolerance of instrument heights and station coordinates
UNLIKE_M = 0.003  # tolerance between the horizontal distance and slope distance times sine


@dataclass(frozen=True)
class Custom:
    """Meaning of code blocks.

    Attributes
    ----------
    codes : str or None
        "before": codes of the following readings, up to the next block. "after": codes of the
        readings since the previous block. None: not codes of readings.
    station : str or None
        Code of the blocks that begin a station: word 42 is its name, word 43 the instrument height
        in millimetres. None: no such code.
    """

    codes: str | None = None
    station: str | None = None


NO_CODES = Custom()


def read(text, file, log, custom=NO_CODES):
    """Return the FieldBook of the text of a GSI file."""
    book, state = FieldBook(file, "gsi"), _State()
    for row, line in enumerate(text.split("\n"), 1):
        line = line.lstrip(" \t").rstrip("\t")
        if not line.strip():
            continue
        words = _words(line)
        if words is None:
            expected = message(
                "no_gsi_line",
                "not a GSI block; expected words of equal length, such as 21.102+07567500",
            )
            log.problem(file, expected, row)
            continue
        for block in _blocks(words):
            if block[0][0] == "41":
                _take_code(book, log, row, block, state, custom)
            else:
                _take(book, log, row, block, state)
    if state.blocks:
        _note_codes(book, state.blocks)
    return book


class _State:
    """Values that apply from one line to the next."""

    height = prism = None
    year = time = None
    code = ""  # code of the current code block
    first = 0  # index of the first shot after the last code block

    def __init__(self):
        self.blocks = []  # (text, row) of code blocks of unknown meaning


def _words(line):
    """Return [(index, digit 3, unit, sign and value)] of a line, or None."""
    width = 16 if line.startswith("*") else 8
    body = line.lstrip("*")
    step = 7 + width + 1
    parts = [body[start : start + step] for start in range(0, len(body), step)]
    parts = [
        part if part[step - 1 :].strip() else part[: step - 1] for part in parts if part.strip()
    ]
    if not all(len(part) == 7 + width and _WORD.fullmatch(part) for part in parts):
        parts = [part.lstrip("*") for part in body.split()]
        if not all(len(part) == 7 + width and _WORD.fullmatch(part) for part in parts):
            return None
    matches = [_WORD.fullmatch(part) for part in parts]
    return [
        (match[1], match[2] + match[3] + match[4], match[5], match[6] + match[7])
        for match in matches
    ] or None


def _blocks(words):
    """Return the blocks of a line; some programs write several, each with word 11 or 41 first."""
    blocks = [[words[0]]]
    for word in words[1:]:
        if word[0] in ("11", "41") and (word[1] + word[2]).isdigit():
            blocks.append([])
        blocks[-1].append(word)
    return blocks


def _take_code(book, log, row, words, state, custom):
    """Read a code block: a station, a code of readings, or a block of unknown meaning."""
    values = _select_words(book, log, row, words)
    if values is None:
        return
    texts = [_text(values[index]) if index in values else "" for index in CODES]
    code = " ".join(text for text in texts if text.strip("0"))
    if custom.station is not None and texts[0].upper() == strip_name(custom.station).upper():
        _begin_station(book, log, row, texts[1], values.get("43"), state)
    elif custom.codes == "before":
        state.code = code
    elif custom.codes == "after":
        for place in range(state.first, len(book.shots)):
            shot = book.shots[place]
            book.shots[place] = replace(shot, code=shot.code or code)
    else:
        state.blocks.append((code, row))
    state.first = len(book.shots)


def _begin_station(book, log, row, name, word, state):
    """Begin a set-up from a code block; the instrument height is in millimetres."""
    height = None
    if word is not None and _has_value(word):
        digits = word[1][1:]
        if not (digits.isascii() and digits.isdigit()):
            refuse_number(log, book.file, row, word[1])
            return
        height = float(word[1]) / 1000
    if not name.strip("0"):
        text = message(
            "gsi_station_name",
            "a code block of a station without word 42; expected the name of the station in word "
            "42",
        )
        log.problem(book.file, text, row)
        return
    book.begin_setup(name, height, None, row)
    state.height, state.code = None, ""


def _note_codes(book, blocks):
    """Add a note about code blocks that are not used."""
    shown = [code for code, _ in blocks if code][:SHOWN]
    text = message(
        "gsi_codes_not_used",
        "code blocks (words 41 to 49): {count}, the first in row {row}: {shown}; GSI does "
        "not state to which readings they belong: use --codes before or after for codes of "
        "readings, --station-code for the beginning of stations",
        count=len(blocks),
        row=str(blocks[0][1]),
        shown="; ".join(code[:40] for code in shown) or "-",
    )
    book.note(text)


def _take(book, log, row, words, state):
    """Read a block."""
    words_by_index = _select_words(book, log, row, words)
    if words_by_index is None:
        return
    values = {}
    for index in words_by_index:
        if (index in ("21", "22") or index in LENGTH_WORDS) and _has_value(words_by_index[index]):
            values[index] = _value(book, log, row, index, *words_by_index[index])
            if values[index] is None:
                return
    _take_times(words_by_index, state)
    _take_constants(book, words_by_index, state)
    if "12" in words_by_index or "13" in words_by_index:
        named = [_text(words_by_index[index]) for index in ("13", "12") if index in words_by_index]
        book.instrument = " ".join(
            name_part for name_part in named if not FILLER.fullmatch(name_part)
        )
    name = _text(words_by_index["11"]) if "11" in words_by_index else ""
    name = "" if FILLER.fullmatch(name) else name
    is_reading = any(index in values for index in ("21", "22", "31", "32"))
    _take_station(book, row, name, values, is_reading, state)
    if "87" in words_by_index:  # a word without value also cancels the previous target height
        state.height = values.get("87")
    if is_reading:
        texts = [
            _text(words_by_index[index])
            for index in (*TEXTS[1:], *CODES)
            if index in words_by_index
        ]
        code = " ".join(text for text in texts if not FILLER.fullmatch(text))
        _take_shot(book, log, row, name, values, code or state.code, state)
    elif all(index in values for index in OF_TARGET[:2]):
        xyz = tuple(values.get(index) for index in OF_TARGET)
        book.known.append(KnownPoint(name, xyz, row))
    elif not any(index in values for index in (*OF_STATION, "87", "88")):
        book.leave_out(message("gsi_without_reading", "blocks without a reading"), row)


def _select_words(book, log, row, words):
    """Return {index: (unit, signed value)} of known words; None after reporting a repeated word."""
    words_by_index = {}
    for index, digits, unit, value in words:
        if digits[0].isdigit() and index not in ("11", "41"):
            what = message(
                "gsi_level_word", "words {word} of a digital level", word=index + digits[0]
            )
            book.leave_out(what, row)
        elif index not in KNOWN:
            book.leave_out(message("gsi_word", "words {word}", word=index), row)
        elif index in words_by_index:
            text = message("gsi_word_twice", "word {word} occurs twice in a block", word=index)
            log.problem(book.file, text, row)
            return None
        else:
            words_by_index[index] = unit, value
    return words_by_index


def _text(word):
    """Return the text of a word without filling characters."""
    return strip_name(word[1][1:])


def _has_value(word):
    """Return whether a word has a value."""
    return NO_VALUE.fullmatch(word[1][1:]) is None


def _value(book, log, row, index, unit, text):
    """Return the degrees or metres of a word, or None after adding a problem to the log."""
    digits, is_angle = text[1:], index in ("21", "22")
    known = (ANGLES if is_angle else LENGTHS).get(unit)
    if known is None or not (digits.isascii() and digits.isdigit()):
        expected = message(
            "gsi_value",
            "word {word}: found unit {unit!r} and {text!r}; expected digits and a unit of {units}",
            word=index,
            unit=unit,
            text=text,
            units=", ".join(ANGLES if is_angle else LENGTHS),
        )
        log.problem(book.file, expected, row)
        return None
    name, parts = known
    sign, number = (-1.0 if text[0] == "-" else 1.0), int(digits)
    if not is_angle:
        last = f"{1000 / parts:g} mm" if name == "m" else f"1/{parts:.0f} ft"
        book.add_units(length=name, last=last)
        return sign * number / parts * METRES[name]
    book.add_units(angle=name)
    if name != "dms":
        return sign * number / parts * DEGREES[name]
    degrees, rest = divmod(number, 100000)  # dddmmsss: the last digit is a tenth of a second
    minutes, tenths = divmod(rest, 1000)
    if minutes >= 60 or tenths >= 600:
        refuse_minutes(log, book.file, row, text)
        return None
    return sign * (degrees + minutes / 60 + tenths / 36000)


def _take_times(words_by_index, state):
    """Read words 17 (day, month, year: ddmmyyyy) and 19 (month, day, hour, minute)."""
    date, clock = (
        words_by_index[index][1][-8:] if index in words_by_index else "" for index in ("17", "19")
    )
    if date.isdigit() and EARLIEST <= int(date[-4:]) <= LATEST:
        state.year = int(date[-4:])
    if clock.isdigit():
        month, day, hour, minute = (int(clock[place : place + 2]) for place in (0, 2, 4, 6))
        try:  # without a year, NO_YEAR marks a time to be completed
            state.time = datetime.datetime(state.year or NO_YEAR, month, day, hour, minute)
        except ValueError:
            state.time = None


def _take_constants(book, words_by_index, state):
    """Read prism constant and ppm for notes only, because the instrument applied them."""
    ppm = None
    if "51" in words_by_index:
        both = _TWO_VALUES.fullmatch(words_by_index["51"][1])
        if both:
            ppm, state.prism = float(both[1]), float(both[2])
    if "58" in words_by_index and words_by_index["58"][1][1:].isdigit():
        state.prism = float(words_by_index["58"][1]) / (10 if words_by_index["58"][0] == "6" else 1)
    if "59" in words_by_index and words_by_index["59"][1][1:].isdigit():
        ppm = float(words_by_index["59"][1]) / 1e4
    if ppm:
        text = message(
            "ppm_in_distances", "ppm {ppm:g}: included in the distances, not applied again", ppm=ppm
        )
        book.note(text)


def _take_station(book, row, name, values, is_reading, state):
    """Begin a set-up if name, coordinates or height of the station change."""
    xyz = tuple(values.get(index) for index in OF_STATION)
    xyz, height = None if None in xyz[:2] else xyz, values.get("88")
    if xyz is None and height is None:
        return
    if book.setups:
        now = book.setups[-1]
        # In a block with a reading, the name is that of the target.
        same_name = is_reading or name == now.station
        same_place = None in (xyz, now.xyz_m) or all(map(_are_same, xyz, now.xyz_m))
        same_height = _are_same(height, now.height_m)
        if same_name and same_place and (same_height or not book.has_shots):
            book.setups[-1] = replace(
                now,
                xyz_m=xyz or now.xyz_m,
                height_m=now.height_m if height is None else height,
            )
            return
        if same_name and same_place:
            name, xyz = now.station, xyz or now.xyz_m
        elif is_reading:
            name = ""
    elif is_reading:
        name = ""
    book.begin_setup(name, height, xyz, row)
    state.height = state.height if is_reading else None


def _are_same(first, second):
    """Return whether two lengths agree within the resolution of different units."""
    return None in (first, second) or abs(first - second) <= SAME_M


def _take_shot(book, log, row, name, values, code, state):
    """Read a reading."""
    zenith, distance, level = (values.get(index) for index in ("22", "31", "32"))
    sine = None if zenith is None else abs(math.sin(math.radians(zenith)))
    if distance is None and level and sine:
        distance = level / sine
    elif distance and level and sine and abs(distance * sine - level) > UNLIKE_M:
        text = message(
            "horizontal_unlike_slope",
            "horizontal distance {level_m:.3f} m, but slope distance and vertical circle give "
            "{made_m:.3f} m (is the circle read from the zenith, in the unit of the file?)",
            level_m=level,
            made_m=distance * sine,
        )
        log.problem(book.file, text, row)
        return
    book.add_shot(log, row, point=name, direction=values.get("21"), zenith=zenith,
                  distance=distance, height=state.height, code=code, time=state.time,
                  prism=state.prism)  # fmt: skip
