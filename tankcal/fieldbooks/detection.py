"""Which format a file is in, by its content, and its text."""

import re

from tankcal.fieldbooks import gsi, jobxml, profile, rw5, sdr
from tankcal.fieldbooks.cutting import tell_cut_numbers
from tankcal.messages import message

FORMATS = ("gsi", "rw5", "jxl", "sdr", "csv")
NAMES = {
    "gsi": "Leica GSI",
    "rw5": "RW5",
    "jxl": "Trimble JobXML",
    "sdr": "Sokkia SDR",
    "csv": "CSV",
}
MAX_BYTES, MAX_LINE, LOOKED_AT = 50_000_000, 4000, 60  # of a file, characters, lines
_MARKS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))
_JOBXML = re.compile(r"<(\w+:)?JOBFile[\s>]")


def read_book(file, data, log, wanted=None, described=None, custom=gsi.UNSAID):
    """FieldBook of the bytes of a file, or None after telling the log why it cannot be read.

    wanted     one of FORMATS; None: by its content
    described  Profile of plain tables, or None
    custom     gsi.Custom: what code blocks of GSI mean
    """
    text = _text(file, data, log)
    if text is None:
        return None
    found = wanted or _format_of(text, described)
    if found is None:
        expected = message(
            "format_unknown",
            "not recognised; expected GSI, RW5, JobXML, SDR33, or a plain table with --profile",
        )
        log.problem(file, expected)
        return None
    if found == "csv" and described is None:
        text = message(
            "profile_needed", "a plain table needs --profile, which says what its columns are"
        )
        log.problem(file, text)
        return None
    if found == "jxl":
        return jobxml.read(data, file, log)
    for row, line in enumerate(text.split("\n"), 1):
        if len(line) > MAX_LINE and not (found == "gsi" and gsi.LINE.match(line)):
            expected = message("line_too_long", "a line of more than {most} characters; expected a"
                               " field book", most=MAX_LINE)  # fmt: skip
            log.problem(file, expected, row)
            return None
    if found == "csv":
        book = profile.read(text, file, log, described)
    elif found == "gsi":
        book = gsi.read(text, file, log, custom)
    else:
        book = {"rw5": rw5, "sdr": sdr}[found].read(text, file, log)
    tell_cut_numbers(book, log)
    return book


def _text(file, data, log):
    """The text of a file: UTF-8, UTF-16 with its mark, else the letters of western Windows."""
    encoding = next((name for mark, name in _MARKS if data.startswith(mark)), None)
    if encoding != "utf-16" and b"\0" in data:
        row = data[: data.index(b"\0")].count(b"\n") + 1
        text = message("binary_file", "a zero byte; expected a text file of an instrument")
        log.problem(file, text, row)
        return None
    for name in (encoding,) if encoding else ("utf-8", "cp1252", "latin-1"):
        try:
            return data.decode(name).replace("\r\n", "\n").replace("\r", "\n")
        except UnicodeDecodeError:
            continue
    text = message("cut_letters", "letters that cannot be read as {encoding}: is the file whole?",
                   encoding=encoding)  # fmt: skip
    log.problem(file, text)
    return None


def _format_of(text, described):
    lines = [line for line in text[: LOOKED_AT * MAX_LINE].split("\n") if line.strip()]
    lines = lines[:LOOKED_AT]
    if lines and lines[0].lstrip().startswith("<"):
        return "jxl" if _JOBXML.search(text[:MAX_BYTES]) else None
    if lines and sdr.HEADER.match(lines[0].lstrip("\x02")):
        return "sdr"
    for name, pattern in (("gsi", gsi.LINE), ("rw5", rw5.LINE)):
        count = sum(pattern.match(line) is not None for line in lines)
        if count and 2 * count >= len(lines):
            return name
    return "csv" if described is not None else None
