"""From a folder or a workbook to a checked `Job`, or to the list of all its problems.

Decision which form of a job folder is filled in: the text files, or the workbook job.xlsx.

`tankcal new` writes one form. Folders of older versions, and of `tankcal plan`, have both.
"""

import datetime
from os import PathLike
from pathlib import Path

from tankcal.job.building import job_of
from tankcal.job.contract import COLUMNS, KEYS
from tankcal.job.folder import read_folder, results_given_as_job
from tankcal.job.model import Job
from tankcal.job.tables import (
    SETTINGS_FILE,
    TABLES,
    WORKBOOK_FILE,
    Log,
)
from tankcal.messages import message
from tankcal.methods.base import methods
from tankcal.text.naming import NUMBER
from tankcal.text.words import NO, YES, meant

# Columns of upright tanks, with the columns that lying tanks have in their place.
OTHER_WORKBOOKS = (".xls", ".xlsm", ".xlsb", ".xltx", ".ods", ".numbers")
OF_EVERY_FORM = (("tank", "kind"), ("table", "language"))  # filled in by every starter job


def load(path: str | PathLike, only: str | None = None) -> Job:
    """Read a job and check it as a whole.

    Parameters
    ----------
    path : str or PathLike
        A folder with job.toml, a job.toml, or a workbook (.xlsx).
    only : {"adjustment"}, optional
        "adjustment" reads a job whose survey alone is needed. All values are checked singly. Tank,
        survey, datum and table of the job are None if they are incomplete. The parts of the tank
        (points, bottom, deadwood, ...) are left out.

    Returns
    -------
    Job
        In SI units. Its `warnings` list findings that do not prevent a calculation.

    Raises
    ------
    InputError
        With every problem of the input, each with its file, row and column.
    ValueError
        If `only` has another value.

    Examples
    --------
    >>> import tankcal
    >>> job = tankcal.load("examples/silva-1995")
    >>> len(job.courses), len(job.points.names), job.tank.nominal_diameter_m
    (5, 119, 13.0)
    """
    if only not in (None, "adjustment"):
        raise ValueError(f"found only = {only!r}; expected 'adjustment'")
    return _load(path, None, only is None)


def load_edited(path: str | PathLike, edited: dict[str, bytes]) -> Job:
    """Read a job with edited files that are not yet saved.

    Parameters
    ----------
    path : str or PathLike
        As for `load`.
    edited : dict of {str: bytes}
        Content of the edited files by name. They replace files of the folder or are added to them.

    Returns
    -------
    Job

    Raises
    ------
    InputError
        As for `load`.

    Examples
    --------
    >>> settings = open("examples/silva-1995/job.toml", "rb").read()
    >>> edited = {"job.toml": settings.replace(b"= 13.0 ", b"= 13.5 ")}
    >>> load_edited("examples/silva-1995", edited).tank.nominal_diameter_m
    13.5
    """
    return _load(path, edited, True)


def _load(path, edited, is_whole):
    log = Log()
    raw = _read(Path(path), log, edited)
    if raw is None:
        log.stop_if_problems()
    return job_of(raw, log, is_whole)


def _form_in(folder, log, edited):
    """The folder, or its workbook if that is the form filled in; None if they contradict."""
    book = folder / WORKBOOK_FILE
    if edited is not None or not book.is_file():
        return folder
    if not (folder / SETTINGS_FILE).is_file():
        ignored = [f"{table}.csv" for table in TABLES if (folder / f"{table}.csv").is_file()]
        if ignored:
            text = message(
                "beside_workbook",
                "not read: the job of this folder is {book}",
                book=WORKBOOK_FILE,
            )
            log.warning(ignored[0], text)
        return book

    before = len(log.problems)
    book = filled_workbook(folder, log)
    return (book or folder) if len(log.problems) == before else None


def _read(path, log, edited):
    """RawJob; None, with a problem in `log`, if the path is not a job."""
    expected = message("expected_job", "expected a job folder, its job.toml or a workbook (.xlsx)")
    try:
        results = results_given_as_job(path)
        if results is not None:
            log.problem(path.name or ".", results)
            return None
        if path.is_dir():
            path = _form_in(path, log, edited)
            if path is None:
                return None
        if path.is_dir():
            return read_folder(path, log, edited)
        if path.name == SETTINGS_FILE and path.is_file():
            return read_folder(path.parent, log, edited)
        if path.suffix.lower() == ".xlsx" and path.is_file():
            from tankcal.job.sheets import read_workbook

            return read_workbook(path, log, edited)
        found = message("not_found", "not found")
        if path.exists():
            suffix = path.suffix
            found = message("found_file_ending", "found a {suffix} file", suffix=suffix)
            if not suffix:
                found = message("found_nameless_file", "found a nameless file")
        if path.suffix.lower() in OTHER_WORKBOOKS and path.is_file():
            expected = message(
                "save_as_xlsx", "open it in Excel or LibreOffice and save it as .xlsx"
            )
    except (OSError, ValueError):
        found = message("an_impossible_name", "an impossible name")
    log.problem(
        path.name or ".", message("no_job", "{found}; {expected}", found=found, expected=expected)
    )
    return None


# ---- decision which form of a job folder is filled in: the text files, or the workbook job.xlsx


def filled_workbook(folder, log):
    """Workbook of a folder with both forms, if it is the form to be read; else None.

    If the values agree, the form with more entries is read. Two forms with contradictory values are
    one problem in `log`.
    """
    book = folder / WORKBOOK_FILE
    if not ((folder / SETTINGS_FILE).is_file() and book.is_file()):
        return None
    from tankcal.job.sheets import read_workbook

    log_of_texts = Log()
    texts, sheets = read_folder(folder, log_of_texts), read_workbook(book, Log())
    if sheets is None or log_of_texts.problems or texts.settings is None:
        return None  # read the text files and report their problems
    by_texts, by_book = _entries(texts), _entries(sheets)
    if not _adds(by_book, by_texts):
        return None
    if not _adds(by_texts, by_book):
        expected = message(
            "workbook_is_read", "is read; the text files beside it are not filled in"
        )
        log.warning(WORKBOOK_FILE, expected)
        return book
    # A user may delete rows written by a plan in one form only, so compare filled-in columns.
    agree = all(
        by_texts.get(place, value) == value for place, value in by_book.items() if place[0] in KEYS
    )
    in_texts, in_book = _columns(by_texts), _columns(by_book)
    if agree and in_book > in_texts:
        expected = message(
            "workbook_is_fuller",
            "is read, because it is further filled in than the text files beside it",
        )
        log.warning(WORKBOOK_FILE, expected)
        return book
    if agree and in_texts > in_book:
        expected = message(
            "workbook_is_not_read",
            "is not read, because the text files beside it are further filled in",
        )
        log.warning(WORKBOOK_FILE, expected)
        return None
    expected = message(
        "both_forms_filled",
        "{settings} with its CSV files and {book} are both filled in, and differ; expected one "
        "form: move the other one away",
        settings=SETTINGS_FILE,
        book=WORKBOOK_FILE,
    )
    log.problem(folder.resolve().name, expected)
    return None


def _adds(entries, others):
    """Return True if entries contain a value that the other form does not have."""
    return any(others.get(place) != value for place, value in entries.items())


def _columns(entries):
    """{(section or table, key or heading)} with a value."""
    return {(place[0], place[-1]) for place in entries}


def _entries(raw):
    """{place: value} of the values that differ from those of the empty form."""
    entries = {}
    for section, given in (raw.settings or {}).items():
        fields = {field.name: field for field in KEYS.get(section, ())}
        for key, value in given.items() if section != "csv" else ():
            plain = _plain(value.raw, fields.get(key))
            if plain not in _starts(section, fields.get(key)):
                entries[section, key] = plain
    for name, register in raw.registers.items():
        for owner, given in register.entries.items() if register else ():
            entries |= {(name, owner, key): _plain(value.raw) for key, value in given.items()}
    for name, table in raw.tables.items():
        fields = {field.name: field for field in COLUMNS[name]}
        for number, row in enumerate(table.rows if table else ()):
            for heading, cell in zip(table.headings, row, strict=True):
                entries[name, number, heading] = _plain(cell, fields.get(heading))
    return {place: plain for place, plain in entries.items() if plain != ""}


def _starts(section, field):
    """Values of a key in starter jobs, normalised by `_plain`."""
    if field is None:
        return [""]
    if (section, field.name) in OF_EVERY_FORM:
        return (*map(str, field.choices), "")
    name = f"{section}.{field.name}"
    of_methods = (method.starter_settings(kind) for method in methods() for kind in method.kinds)
    given = [start.get(name, "") for start in of_methods]
    return [_plain(start, field) for start in ("", field.start, *given)]


def _plain(raw, field=None):
    """Value as a text that is equal in TOML, CSV and a workbook, in all languages."""
    if raw is None:
        return ""
    if isinstance(raw, list):
        return "; ".join(map(_plain, raw))
    if isinstance(raw, datetime.datetime) and raw.time() == datetime.time(0):
        raw = raw.date()
    text = str(raw).strip()
    if NUMBER.fullmatch(text.replace(",", ".")):
        return f"{float(text.replace(',', '.')):.12g}"
    choices = (*(field.choices if field else ()), YES, NO)
    lower = text.lower()
    return lower if lower in choices else meant(text, choices) or text
