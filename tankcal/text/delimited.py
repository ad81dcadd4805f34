"""Text tables: encoding, separator and cells of lines, and protection from spreadsheets.

A spreadsheet executes a text that begins with a sign such as "=" as a formula. An apostrophe before
the sign makes it show the text. Tables of a job are read without the apostrophe, so a text is
unchanged after writing and reading.

Encoding
--------

Editors and spreadsheets write UTF-8 with or without a byte order mark, and UTF-16 under the name
"Unicode". The encoding is determined from the first bytes.
"""

import codecs
import csv
import json
import re
from pathlib import Path

from tankcal.text.naming import NUMBER

BY_CERTAINTY = (";", "\t", ",")  # a comma may be a decimal mark
_SIGNS = ("=", "+", "-", "@", "\t")  # before a formula
_MARKS = (  # UTF-32 before UTF-16, whose mark begins the mark of UTF-32
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
WESTERN = "cp1252"  # Windows-1252
_NO_WESTERN = re.compile(rb"[\0-\x08\x0b\x0e-\x1f\x7f]")  # control characters that no text has
_MARK = "\ufeff"  # the byte order mark after decoding


def find_separator(lines):
    """Return the separator that divides most lines into the same number of cells.

    Examples
    --------
    >>> find_separator(["dip;volume", "0,01;1,5", "0,02;3,1"])
    ';'
    """
    return max(BY_CERTAINTY, key=lambda mark: count_agreeing(lines, mark))


def count_agreeing(lines, separator):
    """Count the lines with the most frequent number of separators; -1 if this number is 0."""
    counts = [line.count(separator) for line in lines]
    usual = max(set(counts), key=lambda count: (count > 0, counts.count(count)))
    return counts.count(usual) if usual > 0 else -1


def separator_of_table(lines, usual):
    """Return the separator of a table with headings in the first line.

    Parameters
    ----------
    lines : list of str
        Lines without comments and blank lines.
    usual : str
        Separator returned for a table with one column.
    """
    heading = "".join(lines[0].split('"')[::2]) if lines else ""  # text outside quotation marks
    marks = [mark for mark in BY_CERTAINTY if mark in heading]
    if len(marks) == 1:
        return marks[0]
    return find_separator(lines) if marks else usual


def split_cells(line, separator):
    """Split a line of a CSV file into cells without surrounding blanks.

    A cell contains no line break.

    Raises
    ------
    csv.Error
        The line has an unmatched quotation mark.

    Examples
    --------
    >>> split_cells('a, "b ""c""; d" ,e  ', ",")
    ['a', 'b "c"; d', 'e']
    """
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        cells = _read_cells(line, separator)
    except csv.Error:  # `csv` accepts blanks before a quotation mark, not after it
        cells = _read_cells(_BLANKS_BEHIND[separator].sub('"', line), separator)
    return [cell.strip() for cell in cells]


_BLANKS_BEHIND = {  # pattern of blanks between a quotation mark and the end of its cell
    mark: re.compile(rf'"[^\S{mark}]+(?={mark}|$)') for mark in BY_CERTAINTY
}


def _read_cells(line, separator):
    """Split a line into cells with the strict parser of `csv`."""
    return next(csv.reader([line], delimiter=separator, strict=True, skipinitialspace=True))


def guard_formula(text):
    """Return the text, with an apostrophe if a spreadsheet would execute it as a formula.

    Signed numbers, with either decimal mark, and dashes for missing values are not changed.

    Examples
    --------
    >>> guard_formula("=1+1"), guard_formula("-0.25"), guard_formula("P-1")
    ("'=1+1", '-0.25', 'P-1')
    """
    text = text.replace("\r", " ")  # csv.writer does not quote it, so that a new row would begin
    if not text.lstrip(" ").startswith(_SIGNS) or NUMBER.fullmatch(text.replace(",", ".")):
        return text
    return f"'{text}" if any(map(str.isalnum, text)) else text


def unguard_formula(text):
    """Return the text without the apostrophe of `guard_formula`.

    Examples
    --------
    >>> unguard_formula("'=1+1"), unguard_formula("'P-1")
    ('=1+1', "'P-1")
    """
    return text[1:] if text[:1] == "'" and text[1:].lstrip(" ").startswith(_SIGNS) else text


def write_guarded(stream, rows, separator=","):
    """Write rows of cells as CSV to a stream, with protected texts."""
    guarded = ([guard_formula(c) if isinstance(c, str) else c for c in row] for row in rows)
    csv.writer(stream, delimiter=separator, lineterminator="\n").writerows(guarded)


def find_encoding(data):
    """Return the encoding of bytes, from the byte order mark or from zeros in ASCII letters."""
    for mark, name in _MARKS:
        if data.startswith(mark):
            return name
    first, second, third, fourth = data[:4] if len(data) > 3 else b"    "
    if second == fourth == 0 and first and third:
        return "utf-16-le"
    if first == third == 0 and second and fourth:
        return "utf-16-be"
    return "utf-8"


def decode_text(data, encoding=None):
    """Decode bytes and remove byte order marks at the start.

    Parameters
    ----------
    data : bytes
    encoding : str or None
        Name of the encoding. None: determined by `find_encoding`.

    Raises
    ------
    UnicodeDecodeError
        The bytes are not text in this encoding.

    Examples
    --------
    >>> decode_text(b"\\xef\\xbb\\xbfa,b")
    'a,b'
    >>> decode_text("a,b".encode("utf-16"))
    'a,b'
    """
    return data.decode(encoding or find_encoding(data)).lstrip(_MARK)


def is_western(data):
    """Return whether bytes are text in Windows-1252 and not in a Unicode encoding.

    Examples
    --------
    >>> is_western("posição".encode("cp1252")), is_western("posição".encode())
    (True, False)
    """
    if find_encoding(data) != "utf-8" or data.startswith(_MARKS[0][0]):
        return False
    if _can_decode(data, "utf-8") or _NO_WESTERN.search(data):
        return False
    return _can_decode(data, WESTERN)


def _can_decode(data, encoding):
    """Return whether bytes can be decoded with an encoding."""
    try:
        data.decode(encoding)
    except UnicodeDecodeError:
        return False
    return True


def read_json(path):
    """Return the content of a JSON file in UTF-8 or UTF-16, with or without a byte order mark.

    Raises
    ------
    OSError
        The file cannot be read.
    ValueError
        The file is not JSON.
    """
    return json.loads(decode_text(Path(path).read_bytes()))
