"""Language of a job, determined before loading so that problems are reported in it."""

from pathlib import Path

from tankcal.job.folder import MAX_SETTINGS_BYTES, parsed_toml
from tankcal.job.tables import (
    SETTINGS_FILE,
    SETTINGS_SHEET,
    WORKBOOK_FILE,
    Log,
    read_bytes,
)
from tankcal.text.delimited import read_json
from tankcal.text.shipped import DEFAULT, LANGUAGES, nearest_language
from tankcal.text.words import load_words


def read_job_language(path):
    """Return the language of a job for `load`, or None if it cannot be read.

    No problem is reported here; `load` reports the problems of the job.
    """
    path, log = Path(path), Log()
    try:
        if (path / WORKBOOK_FILE).is_file() and not (path / SETTINGS_FILE).is_file():
            path /= WORKBOOK_FILE
        if path.suffix.lower() == ".xlsx":
            code = _read_workbook(path, log)
        else:
            code = _read_settings(path / SETTINGS_FILE if path.is_dir() else path, log)
    except (OSError, ValueError):
        return None
    return nearest_language(code)


def read_plan_language(path):
    """Return the language of a plan for `load_plan`, or None."""
    from tankcal.planning.contract import PLAN_FILE

    path = Path(path)
    try:
        return nearest_language(_read_settings(path / PLAN_FILE if path.is_dir() else path, Log()))
    except (OSError, ValueError):
        return None


def read_record_language(path):
    """Return the language of the job of a record, or of the record in a folder of results."""
    from tankcal.record.versions import RECORD

    path = Path(path)
    try:
        record = read_json(path / RECORD.file if path.is_dir() else path)
        return nearest_language(record["job"]["table"]["language"])
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return None


def _read_settings(path, log):
    """Return the language in job.toml or plan.toml."""
    data = read_bytes(path, log, MAX_SETTINGS_BYTES)
    parsed = None if data is None else parsed_toml(path.name, data, log)
    section = {} if parsed is None else parsed[0].get("table")
    return section.get("language") if isinstance(section, dict) else None


def _read_workbook(path, log):
    """Return the language in a job workbook."""
    from tankcal.job.excel import MAX_FILE_BYTES, Unreadable, read_sheets
    from tankcal.job.sheets import KEY, SECTION, VALUE, table_rows

    data = read_bytes(path, log, MAX_FILE_BYTES)
    if data is None:
        return None
    try:
        sheets = read_sheets(data, lambda title: title.strip().lower() == SETTINGS_SHEET)
    except Unreadable:
        return None
    for sheet in sheets:
        rows, _ = table_rows(sheet.title, sheet.grid, log)
        headings = rows[0][1] if rows else []
        if {SECTION, KEY, VALUE} <= {heading for heading in headings if isinstance(heading, str)}:
            place = [headings.index(heading) for heading in (SECTION, KEY, VALUE)]
            for _, cells in rows[1:]:
                section, key, value = (cells[position] for position in place)
                if (section, key) == ("table", "language"):
                    return value if nearest_language(value) else _language_of_form(cells)
    return None


def _language_of_form(cells):
    """Return the language of the explanations of a form."""
    for language in LANGUAGES:
        notes = load_words(language)["input"].get("notes", {})
        if language != DEFAULT and notes["keys"]["table.language"] in cells:
            return language
    return None
