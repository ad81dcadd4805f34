"""A history on paper: its values in the words of a language."""

from typing import ClassVar

from tankcal.record.history import HISTORY
from tankcal.report.plain import words_with_part
from tankcal.report.saved_paper import SavedPaper, bearable
from tankcal.text.languages import DEFAULT
from tankcal.text.words import load_words

FILE = "history.json"
WORKBOOK = "history.xlsx"


class HistoryPaper(SavedPaper):
    """A `record.history.HistoryFile` as plain data, with the words of a language.

    found       as parsed; checked against its schema
    language    one of languages.LANGUAGES; None: English
    letterhead  a `letterhead.Letterhead`, or None

    Words are looked up in the group's part under `history` first, then in the group itself; the
    names of checks and steps are those of inspections and comparisons.
    """

    kind, file = "history", FILE
    attached: ClassVar[dict] = {FILE: "history", WORKBOOK: "history_workbook"}

    def __init__(self, found, language=None, letterhead=None):
        words = load_words(language or DEFAULT)
        super().__init__(words_with_part(words, "history"))
        self.words["checks"] = words["inspection"]["checks"]
        self.words["check_verdicts"] = words["inspection"]["verdicts"]
        self.words["steps"] = words["comparison"]["steps"]
        found = HISTORY.migrated(found, HISTORY.file)
        self.saved = self.found = found
        self.letterhead = letterhead.data() if letterhead else None

    def subject(self):
        """What the papers are about: the tank, or the file of the newest table."""
        tank = self.found["tank"]
        name = f"{self.word('page.tank')} {tank}" if tank else self.newest["file"]
        return bearable(name)

    def date(self):
        """The day of the newest table, ISO."""
        return self.newest["date"]

    @property
    def newest(self):
        """The newest certificate."""
        return self.found["certificates"][-1]
