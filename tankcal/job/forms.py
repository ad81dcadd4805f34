"""Which form of a job folder is filled in: the text files, or the workbook job.xlsx.

`tankcal new` writes one form. Folders of older versions, and of `tankcal plan`, have both.
"""

import datetime

from tankcal.job.contract import COLUMNS, KEYS
from tankcal.job.contract.keys import STARTS_OF_LIQUID, STARTS_OF_STRAPPING
from tankcal.job.folder import read_folder
from tankcal.job.sheets import read_workbook
from tankcal.job.tables import SETTINGS_FILE, WORKBOOK_FILE, Log
from tankcal.messages import message
from tankcal.text.form_words import NO, YES, meant
from tankcal.text.numerals import NUMBER

OF_EVERY_FORM = (("tank", "kind"), ("table", "language"))  # every starter has them filled in


def filled_workbook(folder, log):
    """The workbook of a folder with both forms if it alone is filled in, else None.

    Where both are filled in and differ, `log` gets one problem, for neither can be preferred.
    """
    book = folder / WORKBOOK_FILE
    if not ((folder / SETTINGS_FILE).is_file() and book.is_file()):
        return None
    of_text, of_book = Log(), Log()
    text, sheets = read_folder(folder, of_text), read_workbook(book, of_book)
    if sheets is None or of_text.problems or text.settings is None:
        return None  # the text files, with their problems
    by_text, by_book = _entries(text), _entries(sheets)
    if not _adds(by_book, by_text):
        return None
    of_text, of_book = _columns(by_text), _columns(by_book)
    agree = all(by_text.get(place, value) == value for place, value in by_book.items()
                if place[0] in KEYS)  # fmt: skip
    if not _adds(by_text, by_book) or (agree and of_book > of_text):
        text = message(
            "workbook_is_read",
            "is read; the text files beside it are not filled in",
        )
        log.warning(WORKBOOK_FILE, text)
        return book
    if agree and of_text > of_book:  # as of a plan, some of whose rows were then deleted
        text = message(
            "workbook_is_not_read",
            "is not read, for it is less filled in than the text files beside it",
        )
        log.warning(WORKBOOK_FILE, text)
        return None
    text = message(
        "both_forms_filled",
        "{settings} with its CSV files and {book} are both filled in, and differ; expected one "
        "form: move the other one away",
        settings=SETTINGS_FILE,
        book=WORKBOOK_FILE,
    )
    log.problem(folder.resolve().name, text)
    return None


def _adds(entries, others):
    """Whether entries have a value that was typed, and that the other form does not have."""
    return any(others.get(place) != value for place, value in entries.items())


def _columns(entries):
    """{(section or table, key or heading)} that have a value."""
    return {(place[0], place[-1]) for place in entries}


def _entries(raw):
    """{place: value} of what a form may have been given, without the values it begins with."""
    found = {}
    for section, given in (raw.settings or {}).items():
        fields = {field.name: field for field in KEYS.get(section, ())}
        for key, value in given.items() if section != "csv" else ():
            plain = _plain(value.raw, fields.get(key))
            if plain not in _starts(section, fields.get(key)):
                found[section, key] = plain
    for name, register in raw.registers.items():
        for owner, given in register.entries.items() if register else ():
            found |= {(name, owner, key): _plain(value.raw) for key, value in given.items()}
    for name, table in raw.tables.items():
        fields = {field.name: field for field in COLUMNS[name]}
        for number, row in enumerate(table.rows if table else ()):
            for heading, cell in zip(table.headings, row, strict=True):
                found[name, number, heading] = _plain(cell, fields.get(heading))
    return {place: plain for place, plain in found.items() if plain != ""}


def _starts(section, field):
    """The values of a key that starter jobs have, as `_plain` has them."""
    if field is None:
        return [""]
    if (section, field.name) in OF_EVERY_FORM:
        return (*map(str, field.choices), "")
    name = f"{section}.{field.name}"
    given = [one.get(name, "") for one in (STARTS_OF_STRAPPING, STARTS_OF_LIQUID)]
    return [_plain(one, field) for one in ("", field.start, *given)]


def _plain(raw, field=None):
    """A value as a text that is the same in TOML, CSV and a workbook, in all languages."""
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
