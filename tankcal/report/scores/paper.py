"""Scores in the words of a language."""

from tankcal.record.intercomparison import SCORES
from tankcal.report.plain import words_with_part
from tankcal.report.saved_paper import SavedPaper, bearable, iso_day
from tankcal.text.digits import fixed
from tankcal.text.languages import DEFAULT
from tankcal.text.words import load_words

FILE, WORKBOOK, PAGE = SCORES.file, "scores.xlsx", "scores.html"
EVERY = "*"  # in place of a method: all of them


class ScoresPaper(SavedPaper):
    """A `record.intercomparison.ScoresFile` as plain data, with the words of a language.

    found     as parsed; checked against its schema
    language  one of languages.LANGUAGES; None: English
    """

    kind, file = "scores", FILE
    letterhead = None

    def __init__(self, found, language=None):
        super().__init__(words_with_part(load_words(language or DEFAULT), "scores"))
        self.saved = SCORES.migrated(found, SCORES.file)
        self.found = {**self.saved, "notice": ""}

    def subject(self):
        """What the papers are about: the package, by the first digits of its truth."""
        return self.word("texts.package", digest=self.found["truth_sha256"][:12])

    def date(self):
        """The latest day of the answers, ISO; "" where none says it."""
        return max((iso_day(one["date"]) for one in self.found["participants"]), default="")

    def participant(self, row):
        """The name of a participant with its version; of equal names also its place."""
        said = [
            f"{one['name']} {one['version']}" if one["name"] == one["software"] else
            f"{one['name']} ({one['software']} {one['version']})"
            for one in self.found["participants"]
        ]  # fmt: skip
        name = said[row["participant"]]
        if said.count(name) > 1:
            name = f"{name} [{row['participant'] + 1}]"
        return bearable(name)

    def method(self, code):
        """The name of a method; one of another package stays as it is."""
        return self.words["methods_scored"].get("all" if code == EVERY else code, code)

    def with_sd(self, value, sd, decimals):
        """A value with its standard deviation: "12 ± 3"; None of None."""
        if value is None:
            return None
        text = fixed(value, decimals, self.marks)
        return text if sd is None else f"{text} ± {fixed(sd, decimals, self.marks)}"
