"""Decision which form of a job folder is filled in: the text files, or the workbook job.xlsx.

`tankcal new` writes one form. Folders of older versions, and of `tankcal plan`, have both.
"""

import datetime

from tankcal.job.contract import COLUMNS, KEYS
from tankcal.job.folder import read_folder
from tankcal.job.sheets import read_workbook
from tankcal.job.tables import SETTINGS_FILE, WORKBOOK_FILE, Log
from tankcal.messages import message
from tankcal.methods.base import methods
from tankcal.text.form_words import NO, YES, meant
from tankcal.text.naming import NUMBER

OF_EVERY_FORM = (("tank", "kind"), ("table", "language"))  # filled in by every starter job


def filled_workbook(folder, log):
    """Workbook of a folder with both forms, if it is the form to be read; else None.

    If the values agree, the form with more entries is read. Two forms with contradictory values are
    one problem in `log`.
    """
    book = folder / WORKBOOK_FILE
    if not ((folder / SETTINGS_FILE).is_file() and book.is_file()):
        return None
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
