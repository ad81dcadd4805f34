"""Texts of scores in a language."""

from tankcal.record.intercomparison import SCORES
from tankcal.report.plain import words_with_part
from tankcal.report.saved_paper import SavedPaper, bearable, iso_day
from tankcal.text.digits import fixed
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words

FILE, WORKBOOK, PAGE = SCORES.file, "scores.xlsx", "scores.html"
EVERY = "*"  # replaces the method in scores of all methods


class ScoresPaper(SavedPaper):
    """A `record.intercomparison.ScoresFile` as plain data, with the words of a language.

    Parameters
    ----------
    scores : dict
        Plain data; checked against its schema.
    language : str, optional
        One of languages.LANGUAGES; None: English.
    """

    kind, file = "scores", FILE
    letterhead = None

    def __init__(self, scores, language=None):
        super().__init__(words_with_part(load_words(language or DEFAULT), "scores"))
        self.saved = SCORES.migrated(scores, SCORES.file)
        self.record = {**self.saved, "notice": ""}

    def subject(self):
        """Name of the package: the first digits of the SHA-256 of its truth."""
        return self.word("texts.package", digest=self.record["truth_sha256"][:12])

    def date(self):
        """Latest date of the answers, ISO; "" without a date."""
        return max(
            (iso_day(participant["date"]) for participant in self.record["participants"]),
            default="",
        )

    def participant(self, row):
        """Name of a participant with the version; its number is added to equal names."""
        names = [
            f"{entry['name']} {entry['version']}" if entry["name"] == entry["software"] else
            f"{entry['name']} ({entry['software']} {entry['version']})"
            for entry in self.record["participants"]
        ]  # fmt: skip
        name = names[row["participant"]]
        if names.count(name) > 1:
            name = f"{name} [{row['participant'] + 1}]"
        return bearable(name)

    def method(self, code):
        """Name of a method; a method of another package keeps its code."""
        return self.words["methods_scored"].get("all" if code == EVERY else code, code)

    def with_sd(self, value, sd, decimals):
        """Value with its standard deviation, "12 ± 3"; None for None."""
        if value is None:
            return None
        text = fixed(value, decimals, self.marks)
        return text if sd is None else f"{text} ± {fixed(sd, decimals, self.marks)}"
