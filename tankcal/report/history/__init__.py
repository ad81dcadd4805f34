"""Files of `tankcal history`: tables of a tank over the years as JSON, CSV, workbook, PDF, page.

All values come from history.json; no number is computed here.
"""

from functools import partial
from typing import ClassVar

from tankcal.messages import message
from tankcal.record import manifest, save
from tankcal.record.history import HISTORY
from tankcal.record.schema import to_plain
from tankcal.report.history.tables import (
    CERTIFICATES,
    CHANGES,
    CHECKS,
    RADII,
    RADIUS_CHANGES,
    VOLUMES,
    check_rows,
    radius_change_rows,
    radius_rows,
    volume_rows,
)
from tankcal.report.plain import words_with_part
from tankcal.report.saved_folder import SavedFolder, write_pages
from tankcal.report.saved_paper import SavedPaper, bearable
from tankcal.text.languages import DEFAULT
from tankcal.text.words import load_words

__all__ = [
    *("FILES", "HistoryPaper", "history_file", "rebuild", "refuse_foreign"),
    "write_history",
]

FILE, WORKBOOK = "history.json", "history.xlsx"
PDF, PAGE = "history.pdf", "history.html"
TABLES = {
    "certificates.csv": (CERTIFICATES, lambda history: history["certificates"]),
    "volumes.csv": (VOLUMES, volume_rows),
    "radii.csv": (RADII, radius_rows),
    "changes.csv": (CHANGES, lambda history: history["changes"]),
    "radius_changes.csv": (RADIUS_CHANGES, radius_change_rows),
    "inspections.csv": (CHECKS, check_rows),
}
FILES = (FILE, *TABLES, WORKBOOK, PDF, PAGE, manifest.FILE)
_FOLDER = SavedFolder(
    HISTORY,
    FILES,
    unreadable=lambda error: message(
        "history_unreadable", "cannot be read as a history: {error}", error=error
    ),
    without_content=lambda what: message(
        "no_history", "does not have the content of a history ({what})", what=what
    ),
)
refuse_foreign, history_file, load = _FOLDER.refuse_foreign, _FOLDER.file_of, _FOLDER.load


def write_history(history, folder, language=None, progress=None, letterhead=None):
    """Write history.json, CSV files, workbook, PDF and web page, all or nothing.

    Parameters
    ----------
    history : HistoryFile or dict
        Result of `recalibration.history.history_of`, or the same as plain data.
    folder : path
        Created if missing. An earlier history in the folder is replaced.
    language : str, optional
        Language of papers and workbook, one of languages.LANGUAGES; None: English.
    progress : callable, optional
        progress(text), called at the beginning of each step.
    letterhead : report.letterhead.Letterhead, optional
        Letterhead of the author.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        For a folder with other files, or for data that are not a history.
    """
    plain = history if isinstance(history, dict) else to_plain(history)
    paper = HistoryPaper(plain, language, letterhead)
    return _FOLDER.write(folder, partial(_write, paper), language, progress)


def rebuild(source, folder, language=None, progress=None, letterhead=None):
    """Write the files from a history.json; other arguments as in `write_history`."""
    return _FOLDER.rebuild(
        source, lambda plain: write_history(plain, folder, language, progress, letterhead)
    )


def _write(paper, folder, progress):
    from tankcal.report.history import workbook
    from tankcal.report.history.pages import pages
    from tankcal.report.outputs.csv_files import write_table

    progress(message("history_tables", "writing the tables of the history"))
    save(paper.saved, folder / FILE)
    for name, (table, rows_of) in TABLES.items():
        if rows := rows_of(paper.found):
            write_table(table, folder / name, rows)
    workbook.write(paper, folder / WORKBOOK)
    progress(message("history_papers", "setting the papers of the history"))
    write_pages(pages, paper, folder, PDF, PAGE)


class HistoryPaper(SavedPaper):
    """Formatter of a `record.history.HistoryFile` in a language.

    Words are looked up in the part of a group under `history` first, then in the group. The names
    of checks and steps are those of inspections and comparisons.

    Parameters
    ----------
    history : dict
        The history as plain data; it is checked by its schema.
    language : str, optional
        One of languages.LANGUAGES; None: English.
    letterhead : letterhead.Letterhead, optional
    """

    kind, file = "history", FILE
    attached: ClassVar[dict] = {FILE: "history", WORKBOOK: "history_workbook"}

    def __init__(self, history, language=None, letterhead=None):
        words = load_words(language or DEFAULT)
        super().__init__(words_with_part(words, "history"))
        self.words["checks"] = words["inspection"]["checks"]
        self.words["check_verdicts"] = words["inspection"]["verdicts"]
        self.words["steps"] = words["comparison"]["steps"]
        self.saved = self.found = HISTORY.migrated(history, HISTORY.file)
        self.letterhead = letterhead.data() if letterhead else None

    def subject(self):
        """Return the tank, or the file of the newest table if the tank is unknown."""
        tank = self.found["tank"]
        name = f"{self.word('page.tank')} {tank}" if tank else self.newest["file"]
        return bearable(name)

    def date(self):
        """Return the ISO date of the newest table."""
        return self.newest["date"]

    @property
    def newest(self):
        """The newest certificate."""
        return self.found["certificates"][-1]
