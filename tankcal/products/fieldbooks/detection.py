"""Format of a file from its content, decoding of its text, and detection of truncated numbers."""

import re
from collections import Counter
from statistics import median

from tankcal.job.folder import has_too_many_lines
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.products.fieldbooks import gsi, jobxml, profile, rw5, sdr
from tankcal.text.delimited import decode_text, find_encoding

FORMATS = ("gsi", "rw5", "jxl", "sdr", "csv")
NAMES = {
    "gsi": "Leica GSI",
    "rw5": "RW5",
    "jxl": "Trimble JobXML",
    "sdr": "Sokkia SDR",
    "csv": "CSV",
}
MAX_BYTES, MAX_LINES, MAX_LINE, MOST_LINES_OF_TEST = (
    50_000_000,
    100_000,
    4000,
    60,
)  # of a file, characters
_JOBXML = re.compile(r"<(\w+:)?JOBFile[\s>]")
# Serial transfers add control characters (STX, ETX, Ctrl-Z, zero bytes) around lines and flow
# control characters (XON, XOFF) anywhere.
_CONTROL_BYTES = bytes((*range(0x09), *range(0x0B, 0x20), 0x7F))
_CONTROL_CHARACTERS = _CONTROL_BYTES.decode("ascii") + "\ufeff"
_WITHOUT_FLOW_CONTROL = str.maketrans(dict.fromkeys("\x11\x13"))
_FOREIGN = {  # unsupported formats: regular expressions of their lines
    "Nikon RAW": r"CO,\s*Nikon RAW|(MP|CC|ST|CP|SS|F[12]|UP)(,[^,]*){4,}$",
    "Trimble DC": r"00NMSC|10NM.*SCV",
    "Geodimeter": r"\d{1,3}=[^,;\t]*$",
    "Topcon GTS": r"GTS-\d+ v|(STN|BKB|XYZ|HV|SD)\t",
    "LandXML": r"<LandXML\b|<\?xml.*<LandXML\b",
}
FEWER = 3  # missing decimals of a truncated number; fields with a smaller median are not tested
OFTEN, SHARE = 3, 0.1  # count and share of a field that make a number of decimals regular


def read_book(file, data, log, wanted=None, described=None, custom=gsi.NO_CODES):
    """Return the FieldBook of a file, or None after adding a problem to the log.

    Parameters
    ----------
    file : str
        Name for messages.
    data : bytes
    log : Log
    wanted : str, optional
        One of FORMATS. None: determined from the content.
    described : Profile, optional
        Meaning of the columns of plain tables.
    custom : gsi.Custom
        Meaning of GSI code blocks.
    """
    text = _text(file, data, log)
    if text is None:
        return None
    format_name = wanted or _detect_format(text, described)
    if format_name is None:
        log.problem(file, _refusal(text))
        return None
    if format_name == "csv" and described is None:
        text = message(
            "profile_needed", "a plain table requires --profile with the meaning of its columns"
        )
        log.problem(file, text)
        return None
    if format_name == "jxl":
        is_plain = (
            find_encoding(data) == "utf-8"
        )  # bytes of UTF-16 letters may be control characters
        if is_plain:
            return jobxml.read(data.strip(_CONTROL_BYTES + b"\r\n\t "), file, log)
        # An editor that writes UTF-16 leaves encoding="UTF-8" in the declaration.
        return jobxml.read(text.strip().encode(errors="replace"), file, log, "utf-8")
    if has_too_many_lines(
        file, text, log, MAX_LINES
    ):  # not for JobXML, with many lines per reading
        return None
    for row, line in enumerate(text.split("\n"), 1):
        if len(line) > MAX_LINE and not (format_name == "gsi" and gsi.LINE.match(line)):
            expected = message("line_too_long", "a line of more than {most} characters; expected a"
                               " field book", most=MAX_LINE)  # fmt: skip
            log.problem(file, expected, row)
            return None
    if format_name == "csv":
        book = profile.read(text, file, log, described)
    elif format_name == "gsi":
        book = gsi.read(text, file, log, custom)
    else:
        book = {"rw5": rw5, "sdr": sdr}[format_name].read(text, file, log)
    if data.endswith(b"\0") and find_encoding(data) == "utf-8":
        count = len(data) - len(data.rstrip(b"\0"))
        book.note(
            message(
                "zeros_at_end",
                "{count} zero bytes at the end of the file, ignored (is the last line complete?)",
                count=count,
            )
        )
    report_truncated_numbers(book, log)
    return book


def is_field_book(data):
    """Return whether the content of a file is a field book in a known format."""
    text = _text("", data, Log())
    return text is not None and _detect_format(text, None) is not None


def _text(file, data, log):
    """Decode UTF-8, UTF-16 or western Windows text; None after adding a problem to the log.

    Control characters of serial transfers are removed, because they are not part of the lines.
    """
    encoding = find_encoding(data)
    for name in ("utf-8", "cp1252", "latin-1") if encoding == "utf-8" else (encoding,):
        try:
            text = decode_text(data, name)
        except UnicodeDecodeError:
            continue
        lines = (
            text.replace("\r\n", "\n")
            .replace("\r", "\n")
            .translate(_WITHOUT_FLOW_CONTROL)
            .split("\n")
        )
        lines = [line.strip(_CONTROL_CHARACTERS) for line in lines]
        row = next((row for row, line in enumerate(lines, 1) if "\0" in line), None)
        if row is None and (any(lines) or "\0" not in text):
            return "\n".join(lines)
        text = message("binary_file", "contains a zero byte; expected a text file of an instrument")
        log.problem(file, text, row or 1)
        return None
    text = message(
        "cut_letters",
        "contains characters that are not {encoding} (is the file complete?)",
        encoding=encoding,
    )
    log.problem(file, text)
    return None


def _refusal(text):
    """Return the message for an unsupported format; it names the format if that is recognised."""
    lines = _first_lines(text)
    for name, pattern in _FOREIGN.items():
        count = sum(re.match(pattern, line.strip(), re.IGNORECASE) is not None for line in lines)
        if count and (2 * count >= len(lines) or name == "LandXML"):
            return message(
                "format_foreign",
                "a file in the format {name}, which tankcal does not read; expected GSI, RW5, "
                "JobXML or SDR33: export the job in one of these formats, or as a plain table "
                "with --profile",
                name=name,
            )
    return message(
        "format_unknown",
        "unknown format; expected GSI, RW5, JobXML, SDR33, or a plain table with --profile",
    )


def _detect_format(text, described):
    """Return the format of a text, or None."""
    lines = _first_lines(text)
    if lines and lines[0].lstrip().startswith("<"):
        return "jxl" if _JOBXML.search(text[:MAX_BYTES]) else None
    if lines and sdr.HEADER.match(lines[0]):
        return "sdr"
    for name, pattern in (("gsi", gsi.LINE), ("rw5", rw5.LINE)):
        count = sum(pattern.match(line) is not None for line in lines)
        if count and 2 * count >= len(lines):
            return name
    return "csv" if described is not None else None


def _first_lines(text):
    """Return the first non-blank lines."""
    lines = [line for line in text[: MOST_LINES_OF_TEST * MAX_LINE].split("\n") if line.strip()]
    return lines[:MOST_LINES_OF_TEST]


# ---- truncated numbers
#
# An instrument writes each kind of number with a constant number of decimals, including zeros. A
# number with at least FEWER decimals less than the median of its kind is therefore truncated. Only
# the text counts: 290.0000 is complete, 290. is not. Files of two programs, or with records in two
# forms, have two frequent numbers of decimals. Such numbers are read as written.


def report_truncated_numbers(book, log):
    """Report each truncated number among the texts of `FieldBook.add_text`."""
    reported_rows = {problem.row for problem in log.problems if problem.file == book.file}
    for column, texts in book.texts.items():
        decimals = [_decimals(text) for text, _ in texts]
        usual = median(decimals)
        if usual < FEWER or _omits_final_zeros(texts, decimals, usual):
            continue
        counts = Counter(decimals)
        regular = {
            count for count, times in counts.items() if times >= max(OFTEN, SHARE * len(texts))
        }
        short = [count for count in sorted(regular) if count <= usual - FEWER]
        if short:
            text = message(
                "ways_of_writing",
                "numbers of {column} with {short} and with {usual:.0f} decimals, each frequent: "
                "read as written",
                column=column,
                short=", ".join(map(str, short)),
                usual=usual,
            )
            book.note(text)
        for (text, row), count in zip(texts, decimals, strict=True):
            if count <= usual - FEWER and count not in regular and row not in reported_rows:
                expected = message(
                    "cut_short",
                    "found {text!r} with {count} decimals; expected {usual:.0f}: {many} of the "
                    "{all} numbers of this field have at least that many (truncated? If the "
                    "number is correct, add its zeros)",
                    text=text[:40],
                    count=count,
                    usual=usual,
                    many=sum(number >= usual for number in decimals),
                    all=len(texts),
                )
                log.problem(book.file, expected, row, column)


def _decimals(text):
    """Return the number of digits after the last decimal mark."""
    _, mark, behind = text.replace(",", ".").rpartition(".")
    return sum(character.isdigit() for character in behind) if mark else 0


def _omits_final_zeros(texts, decimals, usual):
    """Return whether the file omits final zeros: some numbers are short, none ends with 0."""
    whole = [text for (text, _), count in zip(texts, decimals, strict=True) if count >= usual]
    are_uneven = any(usual - FEWER < count < usual for count in decimals)
    return are_uneven and not any(re.search(r"0\D*$", text) for text in whole)
