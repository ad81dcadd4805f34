"""Files of `tankcal history`: tables of a tank over the years as JSON, CSV, workbook, PDF, page.

All values come from history.json; no number is computed here.
"""

from typing import ClassVar

from tankcal.record.recalibration import HISTORY
from tankcal.report.history.tables import (
    CERTIFICATES,
    CHANGES,
    CHECKS,
    MONTHS,
    RADII,
    RADIUS_CHANGES,
    VOLUMES,
)
from tankcal.report.plain import words_with_part
from tankcal.report.saved_document import SavedDocument, SavedPaper, bearable
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words

__all__ = ["DOCUMENT", "HistoryPaper", "rebuild", "refuse_foreign", "write_history"]

FILE, WORKBOOK = "history.json", "history.xlsx"
TABLES = {
    "certificates.csv": CERTIFICATES,
    "volumes.csv": VOLUMES,
    "radii.csv": RADII,
    "changes.csv": CHANGES,
    "radius_changes.csv": RADIUS_CHANGES,
    "inspections.csv": CHECKS,
    "months.csv": MONTHS,
}


class HistoryPaper(SavedPaper):
    """Formatter of a `record.recalibration.HistoryFile` in a language.

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
        self.words["month_verdicts"] = words["upkeep"]["verdicts"]
        self.words["steps"] = words["comparison"]["steps"]
        self.saved = self.record = HISTORY.migrated(history, HISTORY.file)
        self.letterhead = letterhead.data() if letterhead else None

    def subject(self):
        """Return the tank, or the file of the newest table if the tank is unknown."""
        tank = self.record["tank"]
        name = f"{self.word('page.tank')} {tank}" if tank else self.newest["file"]
        return bearable(name)

    def date(self):
        """Return the ISO date of the newest table."""
        return self.newest["date"]

    @property
    def newest(self):
        """The newest certificate."""
        return self.record["certificates"][-1]


def _load_renderers():
    from tankcal.report.history.pages import pages, write_sheets

    return pages, write_sheets


DOCUMENT = SavedDocument(
    HISTORY,
    HistoryPaper,
    _load_renderers,
    tables=TABLES,
)
refuse_foreign, rebuild = DOCUMENT.refuse_foreign, DOCUMENT.rebuild
write_history = DOCUMENT.write
