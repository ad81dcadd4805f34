"""Decoding of text files written by any program.

Editors and spreadsheets write UTF-8 with or without a byte order mark, and UTF-16 under the name
"Unicode". The encoding is determined from the first bytes.
"""

import codecs
import json
import re
from pathlib import Path

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
