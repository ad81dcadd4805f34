"""Read a job from a folder: job.toml for the settings, a CSV file for each table."""

import csv
import re
import tomllib

from tankcal.errors import reason_of
from tankcal.job.tables import (
    ARCHIVES,
    MAX_FILE_BYTES,
    MAX_LINES,
    MAX_PROBLEMS_PER_FILE,
    NOT_KNOWN,
    REFUSED_FILE,
    REGISTERS,
    SEPARATORS,
    SETTINGS_FILE,
    TABLES,
    RawJob,
    Register,
    Value,
    fingerprint,
    make_table,
    nearest,
    read_beside,
    shown,
)
from tankcal.messages import message
from tankcal.text.delimited import (
    WESTERN,
    decode_text,
    is_western,
    separator_of_table,
    split_cells,
    unguard_formula,
)

SAVED_FILES = (  # results of commands; such a file without job.toml marks a folder of results
    *("record.json", "comparison.json", "inspection.json", "history.json", "camera.json"),
    *("plan.json", "scores.json"),
)
MAX_SETTINGS_BYTES = 1_000_000  # largest TOML file
MAX_SETTINGS_LINE = 4000  # longest line of a TOML file, characters
DECIMALS = (".", ",")
OF_INSPECTIONS = ("settlement.csv", "edge_profiles.csv")  # may lie beside a job, are not part of it
_LONGEST_START = 100_000  # most bytes of comments before a heading
_TWICE = message("toml_given_twice", "a key or a section is given twice")
_BROKEN_TEXT = message(
    "toml_text_broken", "a text without its closing quotation mark, or with a control character"
)
_ESCAPE = message(
    "toml_escape",
    "a backslash in a text between double quotation marks; write two of them, or put the text "
    "between single ones",
)
_TOML_REASONS = {  # {beginning of a message of tomllib: reason for the user}
    "Cannot overwrite": _TWICE,
    "Cannot declare": _TWICE,
    "Cannot redefine": _TWICE,
    "Cannot mutate": _TWICE,
    "Duplicate inline": _TWICE,
    "Invalid statement": message("toml_statement", "a line without a key"),
    "Expected newline": message("toml_two_values", "text behind the value that is no # comment"),
    "Expected '=' after": message("toml_no_equals", "a key without = behind it"),
    "Expected ']": message("toml_no_bracket", "a section whose name has no closing ]"),
    "Invalid initial": message("toml_no_key", "a key or a name without letters, digits, _ or -"),
    "Unclosed array": message("toml_list_open", "a list without its closing ], or without a comma"),
    "Unclosed inline": message("toml_table_open", "an inline table without its end or a comma"),
    "Unterminated string": _BROKEN_TEXT,
    "Illegal character": _BROKEN_TEXT,
    "Found invalid": _BROKEN_TEXT,
    "Expected ": _BROKEN_TEXT,  # its quotation mark
    "Unescaped": _ESCAPE,
    "Invalid hex": _ESCAPE,
    "Escaped character": _ESCAPE,
    "Invalid date": message("toml_no_date", "a date or a time that does not exist"),
    "Invalid value": message(
        "toml_value", "a value that is no number, date, list, true or false; a text needs "
        "quotation marks",
    ),
}  # fmt: skip
_DECIMAL_COMMA = re.compile(
    r"(\s*[\w.\"'-]+\s*=\s*[+-]?\d+),(\d+(?:[eE][+-]?\d+)?)\s*(?:#.*)?", re.DOTALL
)
_BARE_TEXT = re.compile(r"(\s*[\w.\"'-]+\s*=\s*)([^\s\"'\[\]{}#\\][^\"'\[\]{}#\\]*?)\s*(?:#.*)?")
_INVALID_DATE = re.compile(r"\d{1,2}[/.-]\d{1,2}[/.-]\d{4}|\d{4}[/.-]\d{1,2}[/.-]\d{1,2}")


def read_folder(folder, log, edited=None):
    """Read a job folder.

    Parameters
    ----------
    folder : Path
        Folder of the job.
    log : Log
        Receives the problems.
    edited : dict of {str: bytes}, optional
        Files that replace files of the folder or are added to them, by name.

    Returns
    -------
    RawJob
    """
    edited = edited or {}
    names = sorted({*_names_in(folder, log), *edited})
    _refuse_unknown_files(names, log)
    files = []

    def content(name, limit=MAX_FILE_BYTES):
        data = edited[name] if name in edited else read_beside(folder, name, log, limit)
        if data is not None:
            files.append(fingerprint(name, data))
        return data

    settings, sections = None, {}
    if SETTINGS_FILE in names:
        data = content(SETTINGS_FILE, MAX_SETTINGS_BYTES)
        if data is not None:
            settings, sections = read_toml(SETTINGS_FILE, data, log)
    else:
        expected = message(
            "no_settings_file", "missing file; every job folder has one{hint}", hint=_hint(names)
        )
        log.problem(SETTINGS_FILE, expected)
    marks = declared_marks(SETTINGS_FILE, settings or {}, log)
    tables = {}
    for table in TABLES:
        name = f"{table}.csv"
        if name in names:
            data = content(name)
            is_readable = data is not None and marks is not None
            if is_readable and settings is None:  # the declared separator is not known
                is_readable = _has_plain_heading(data)
            tables[table] = read_csv(name, data, *marks, log) if is_readable else None
    archives = {name: content(name) for name in ARCHIVES if name in names}
    registers = {}
    for register in REGISTERS:
        name = f"{register}.toml"
        if name in names:
            data = content(name, MAX_SETTINGS_BYTES)
            registers[register] = None if data is None else read_register(name, data, log)
    return RawJob(
        folder.resolve().name,
        folder,
        SETTINGS_FILE,
        settings,
        sections,
        tables,
        archives,
        tuple(files),
        registers,
    )


def _names_in(folder, log):
    """Sorted names of the files in a folder; [] and a problem if the folder cannot be read."""
    try:
        return sorted(item.name for item in folder.iterdir())
    except OSError as error:
        log.problem(
            folder.name,
            message(
                "folder_cannot_be_read",
                "the folder cannot be read ({strerror})",
                strerror=reason_of(error),
            ),
        )
        return []


def _hint(names):
    books = [name for name in names if name.endswith(".xlsx") and name[0] not in ".~"]
    return (
        message("or_the_workbook", " (or give the workbook itself: {book})", book=books[0])
        if books
        else ""
    )


def _has_plain_heading(data):
    """Return True if the heading contains no separator that requires [csv]."""
    for line in data[:_LONGEST_START].splitlines():
        if line.strip() and not line.lstrip(b'\xef\xbb\xbf \t"').startswith(b"#"):
            return not any(mark.encode() in line for mark in SEPARATORS[1:])
    return len(data) <= _LONGEST_START


def _refuse_unknown_files(names, log):
    known = [*(f"{table}.csv" for table in TABLES), *OF_INSPECTIONS]
    for name in names:
        ending = name.lower().rpartition(".")[2]
        if name.startswith((".", "~")) or name in known or name == REFUSED_FILE:
            continue
        if ending == "csv":
            listed = ", ".join(known)
            log.problem(
                name,
                message(
                    "unknown_file",
                    "unknown file; the CSV files of a job are {listed}{hint}",
                    listed=listed,
                    hint=nearest(name, known),
                ),
            )


def decode(file, data, log, or_western=False):
    """Decode a text file in UTF-8 or UTF-16.

    Parameters
    ----------
    file : str
        Name in messages.
    data : bytes
        Content.
    log : Log
        Receives problem or warning.
    or_western : bool, optional
        True: also accept Windows-1252, with a warning; western versions of spreadsheets write it.

    Returns
    -------
    str or None
        None if the file cannot be decoded.
    """
    if or_western and is_western(data):
        warning = message("lint_cp1252", "not UTF-8: read with the letters of Windows-1252")
        log.warning(file, warning)
        return data.decode(WESTERN)
    try:
        text = decode_text(data)
    except UnicodeDecodeError as error:
        row = data[: error.start].count(b"\n") + 1
        log.problem(
            file,
            message(
                "no_utf8",
                "a letter that is not UTF-8; save the file as {wanted}",
                wanted=_utf8(file),
            ),
            row,
        )
        return None
    if "\0" in text:
        row = text[: text.index("\0")].count("\n") + 1
        log.problem(
            file,
            message("zero_byte", "a zero byte; expected text (UTF-8): is this really a text file?"),
            row,
        )
        return None
    return text


def _utf8(file):
    """Name of the expected text format, as in the menus of programs."""
    return (
        message("utf8_text", "UTF-8 text")
        if file.lower().endswith(".toml")
        else message("utf8_csv", "'CSV UTF-8' or plain UTF-8 text")
    )


def split_lines(text):
    """Lines of a text with the line ends of any operating system."""
    return re.split("\r\n|\r|\n", text)


def read_toml(file, data, log):
    """({section: {key: Value}}, {section: row}) of a TOML file; (None, {}) if unreadable."""
    parsed = parsed_toml(file, data, log)
    return (None, {}) if parsed is None else flattened(file, *parsed, log)


def read_register(file, data, log, register=None):
    """Read a list of cameras, instruments, clouds or meters.

    Parameters
    ----------
    file : str
        Name of the file in messages.
    data : bytes
        Content of the TOML file.
    log : Log
        Receives the problems.
    register : str, optional
        Name of the list, such as "cameras"; None: the name of the file.

    Returns
    -------
    Register or None
        None if unreadable.
    """
    parsed = parsed_toml(file, data, log)
    if parsed is None:
        return None
    content, rows = parsed
    register = register or file.rpartition(".")[0]
    entries, places = {}, {}
    for section, items in content.items():
        if section != register or not isinstance(items, dict):
            expected = message(
                "outside_register",
                "is in no section; expected sections such as [{register}.NAME]",
                register=register,
            )
            log.problem(file, expected, rows.get(section), section)
            continue
        for name, given in items.items():
            place = re.sub(r"[\s\"']", "", f"{register}.{name}")
            if not isinstance(given, dict):
                expected = message(
                    "in_no_register",
                    "is in no section [{register}.NAME]; expected in one",
                    register=register,
                )
                log.problem(file, expected, rows.get(place), name)
                continue
            entries[name] = {
                key: Value(value, rows.get(re.sub(r"[\s\"']", "", f"{place}.{key}")))
                for key, value in flatten_entry(given)
            }
            places[name] = rows.get(place)
    return Register(file, entries, places)


def flatten_entry(given):
    """Yield (key, value) of an entry; a key in a nested section becomes section.key."""
    for key, value in given.items():
        if isinstance(value, dict):
            yield from ((f"{key}.{inner}", item) for inner, item in value.items())
        else:
            yield key, value


def parsed_toml(file, data, log):
    """(content, {section or section.key: row}) of a TOML file; None if unreadable."""
    text = decode(file, data, log)
    if text is None:
        return None
    for number, line in enumerate(split_lines(text), 1):
        if len(line) > MAX_SETTINGS_LINE:
            log.problem(
                file,
                message(
                    "long_line", "a line of more than {most} characters", most=MAX_SETTINGS_LINE
                ),
                number,
            )
            return None
    content = _content(file, text, log)
    return None if content is None else (content, _toml_rows(text))


def _content(file, text, log):
    """Parse a TOML text; None if unreadable.

    A decimal comma is reported and read as a point, and a text without quotation marks as a text.
    The remaining text is so checked in the same run.
    """
    lines = split_lines(text)  # tomllib does not accept a lone carriage return as line end
    for _ in range(MAX_PROBLEMS_PER_FILE):
        try:
            return tomllib.loads("\n".join(lines))
        except (ValueError, RecursionError) as error:
            line = re.search(r"at line (\d+)", str(error))
            row = int(line[1]) if line else None
            number = _DECIMAL_COMMA.fullmatch(lines[row - 1]) if row else None
            is_bare = number is None and str(error).startswith(
                ("Invalid value", "Expected newline")
            )
            bare = _BARE_TEXT.fullmatch(lines[row - 1]) if row and is_bare else None
            if bare is not None and number is None:
                log.problem(file, _bare_value(bare[2]), row)
                date = _INVALID_DATE.fullmatch(bare[2])
                lines[row - 1] = bare[1] + ("2000-01-01" if date else f'"{bare[2]}"')
                continue
            if number is None:
                reason = _reason(error)
                expected = message(
                    "toml_cannot_be_read",
                    'cannot be read: {reason}; expected lines such as key = "text"',
                    reason=reason,
                )
                log.problem(file, expected, row)
                return None
            found = shown(f"{number[1]},{number[2]}".strip())
            expected = message(
                "comma_in_toml",
                "found {found}; expected a decimal point, as in every .toml file",
                found=found,
            )
            log.problem(file, expected, row)
            lines[row - 1] = f"{number[1]}.{number[2]}"
    return None


def _bare_value(text):
    """Message about a value that is neither number nor date and has no quotation marks."""
    if _INVALID_DATE.fullmatch(text):
        return message("date_in_toml", "found {text}; expected a date as year-month-day, such as "
                       "2024-05-31", text=text)  # fmt: skip
    if text[0].isdigit():
        return message("number_in_toml", "found {text}; expected a number alone, without unit, or "
                       "a text in quotation marks", text=text)  # fmt: skip
    return message(
        "bare_text_in_toml", 'found {text}; expected "{text}", with quotation marks', text=text
    )


def _reason(error):
    if isinstance(error, RecursionError):
        return message("too_deep", "too deeply nested")
    reason = re.sub(r"\s*\(at .*\)$", "", str(error))
    known = (text for start, text in _TOML_REASONS.items() if reason.startswith(start))
    return next(known, reason)


def _toml_rows(text):
    """Row of each section and section.key, for messages."""
    rows, section = {}, ""
    for number, line in enumerate(split_lines(text), 1):
        heading = re.match(r"[ \t]*\[+([^\[\]]+)\]", line)
        key = re.match(r"[ \t]*([\w.\"'-]+)[ \t]*=", line)
        if heading:
            section = re.sub(r"[\s\"']", "", heading[1])
            rows.setdefault(section, number)
        elif key:
            name = re.sub(r"[\"']", "", key[1])
            rows.setdefault(f"{section}.{name}" if section else name, number)
    return rows


def flattened(file, data, rows, log):
    """Flatten the nested sections of a TOML file.

    Parameters
    ----------
    file : str
        Name of the file in messages.
    data : dict
        Content as parsed.
    rows : dict
        Row of each section and section.key.
    log : Log
        Receives keys outside a section.

    Returns
    -------
    settings : dict
        {section: {key: Value}}.
    sections : dict
        {section: row}.
    """
    settings, sections = {}, {}
    queue = [("", data, 0)]
    while queue:
        section, entries, depth = queue.pop(0)
        if section:
            settings.setdefault(section, {})
            sections[section] = rows.get(section)
        for key, value in entries.items():
            name = f"{section}.{key}" if section else key
            if isinstance(value, dict) and depth < 3:
                queue.append((name, value, depth + 1))
            elif section:
                settings[section][key] = Value(value, rows.get(name))
            else:
                expected = message(
                    "in_no_section", "is in no [section]; expected in one, such as [tank]"
                )
                log.problem(file, expected, rows.get(name), name)
    return settings, sections


def csv_marks(file, settings, log):
    """(separator, decimal mark) declared in [csv]; the defaults are , and . ; None if unusable.

    The check of the settings reports unknown marks.
    """
    given = {key: value.raw for key, value in settings.get("csv", {}).items()}
    separator, decimal = given.get("separator") or ",", given.get("decimal") or "."
    if separator not in SEPARATORS or decimal not in DECIMALS:
        return None
    if separator == decimal:
        row = next(iter(settings["csv"].values())).row
        expected = message(
            "two_commas",
            "separator and decimal are both a comma; expected two different marks, such as ; and ,",
        )
        log.problem(file, expected, row, "csv.separator")
        return None
    return separator, decimal


def declared_marks(file, settings, log):
    """(separator, decimal mark) for reading, with NOT_KNOWN as decimal mark if [csv] is blank."""
    marks = csv_marks(file, settings, log)
    is_declared = any(value.raw for value in settings.get("csv", {}).values())
    return marks if marks is None or is_declared else (marks[0], NOT_KNOWN)


def read_csv(file, data, separator, decimal, log, settings_file=SETTINGS_FILE):
    """Read a CSV file. The headings determine the separator.

    Parameters
    ----------
    file : str
        Name of the file in messages.
    data : bytes
        Content.
    separator : str
        Separator of a file with a single column.
    decimal : str
        Declared decimal mark; NOT_KNOWN: not declared.
    log : Log
        Receives the problems.
    settings_file : str, optional
        File with the section [csv], for messages.

    Returns
    -------
    Table or None
        None if unreadable.
    """
    text = decode(file, data, log, or_western=True)
    if text is None or has_too_many_lines(file, text, log):
        return None
    separator = separator_of_text(text, separator)
    hint = ""
    if separator == "," and decimal != ",":
        hint = message(
            "for_decimal_commas",
            "; for decimal commas set [csv] separator = ';' and decimal = ',' in {settings_file}",
            settings_file=settings_file,
        )
    if separator == "," and decimal == NOT_KNOWN:
        decimal = "."  # a decimal comma would have split the number
    return make_table(file, _csv_rows(file, text, separator, log), decimal, log, hint)


def has_too_many_lines(file, text, log, most=MAX_LINES):
    """Return True, and report it, if a text has more lines than a table may have.

    Callers check this before they split the text, to bound the memory.
    """
    count = max(text.count("\n"), text.count("\r")) + (not text.endswith(("\n", "\r")))
    if count > most:
        expected = message(
            "too_many_lines", "{count} lines; expected at most {most}", count=count, most=most
        )
        log.problem(file, expected)
    return count > most


def separator_of_text(text, usual):
    """Separator of a CSV text with comments; `usual` if the text has a single column."""
    return separator_of_table([line for line in split_lines(text) if is_row(line)], usual)


def is_row(line):
    """Return True if a line is neither blank nor a comment."""
    return bool(line) and not line.isspace() and not line.lstrip(' \t"').startswith("#")


def _csv_rows(file, text, separator, log):
    """Yield (row, cells) of each line that is neither blank nor a comment; None: unreadable cells.

    A cell contains no line break, so that a missing quotation mark affects one row only.
    """
    for number, line in enumerate(split_lines(text), 1):
        if not is_row(line):
            continue
        if '"' not in line and "'" not in line:
            yield number, line.split(separator)
            continue
        try:
            yield number, [unguard_formula(cell) for cell in split_cells(line, separator)]
        except csv.Error:
            log.problem(
                file,
                message(
                    "odd_quotation_marks",
                    "quotation marks without a partner in the row; expected pairs",
                ),
                number,
            )
            yield number, None


def results_given_as_job(path):
    """Message about a path to results where a job is expected; None for any other path.

    The message names the job of the results if the job lies in its usual place.
    """
    saved = saved_file_in(path)
    if saved is None or (path / SETTINGS_FILE).exists():
        return None
    folder = (path if path.is_dir() else path.parent).resolve()
    book = folder.with_name(f"{folder.name.removesuffix('-results')}.xlsx")
    job = next(
        (candidate for candidate in (folder.parent / SETTINGS_FILE, book) if candidate.is_file()),
        None,
    )
    hint = "" if job is None else message("job_of_results", ": {job}", job=str(job))
    return message(
        "results_as_job",
        "holds results ({saved}), not a job; expected a job folder, its job.toml or a workbook "
        "(.xlsx){hint}",
        saved=saved, hint=hint,
    )  # fmt: skip


def saved_file_in(path):
    """Name of the file of results that is the path or lies in this folder; None if none."""
    if path.is_dir():
        return next((name for name in SAVED_FILES if (path / name).is_file()), None)
    return path.name if path.name in SAVED_FILES and path.is_file() else None
