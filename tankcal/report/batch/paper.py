"""The summary of a batch in the words of a language."""

from urllib.parse import quote

from tankcal.errors import problem_from
from tankcal.report.plain import PlainPaper, words_with_part
from tankcal.report.saved_paper import signed_text
from tankcal.text.words import load_words, say

STATUSES = ("done", "unsound", "refused", "failed")  # of a job, from the best to the worst
MOST_CHANGES = 3  # that a cell tells
OF_RULE = {  # codes of verdicts in words of their own: short ones
    "rule_verdict": "rule_verdicts",
    "comparison_verdict": "comparison_verdicts",
    "inspection_verdict": "inspection_verdicts",
    "global_test": "global_tests",
}


class SummaryPaper(PlainPaper):
    """Rows of a summary as texts.

    found     {"tankcal", "do", "rows", "gone"}
    language  one of languages.LANGUAGES
    """

    def __init__(self, found, language):
        super().__init__(words_with_part(load_words(language), "batch"))
        self.found = found

    def status(self, row):
        """What became of a job."""
        return self.word(f"statuses.{row['status']}")

    def verdict(self, key, row):
        """One verdict in a word or two; None where there is none."""
        code = row.get(key)
        return None if code is None else self.word(f"{OF_RULE[key]}.{str(code).lower()}")

    def changes(self, row):
        """What changed since the last batch, as one text; None where nothing is known."""
        if row["changes"] is None:
            return None
        if not row["changes"]:
            return self.word("changes.none")
        return "; ".join(self._change(one) for one in row["changes"][:MOST_CHANGES])

    def _change(self, one):
        code = one["code"]
        if code == "volume_m3":
            by = self.number(one["by_m3"], "m3", u=one["U_m3"] or None, decimals=None)
            times = ""
            if one["U_m3"]:
                share = self.number(abs(one["by_m3"]) / one["U_m3"], decimals=1)
                times = self.word("changes.times_U", times=share)
            return self.word("changes.volume_m3", by=signed_text(one["by_m3"], by)) + times
        if code == "status":
            old, new = (self.word(f"statuses.{one[key]}") for key in ("old", "new"))
            return self.word("changes.status", old=old, new=new)
        if code in OF_RULE:
            old, new = (self.verdict(code, {code: one[key]}) for key in ("old", "new"))
            nothing = self.word("changes.nothing")
            what = self.word(f"table_headings.{code}")
            return self.word("changes.verdict", what=what, old=old or nothing, new=new or nothing)
        return self.word(f"changes.{code}")

    def told(self, row):
        """The first problem, else the first warning, and how many more there are; or None."""
        told, count = (row["problems"], row["problem_count"])
        if not told:
            told, count = row["warnings"], row["warning_count"]
        if not told:
            return None
        first = say(self.words, problem_from(told[0]).text)
        return first if count <= 1 else self.word("texts.and_more", text=first, count=count - 1)

    def papers(self, row):
        """What the best paper of a job is called; None where it has none."""
        return row["papers"][0].rpartition("/")[2] if row["papers"] else None

    def link(self, row):
        """The address of that paper from the folder of the summary; "" where it has none."""
        return quote(row["papers"][0]) if row["papers"] else ""

    def plain_row(self, row):
        """A row for the CSV file: codes and numbers, texts in the language."""
        return row | {
            "changes": self.changes(row),
            "told": self.told(row),
            "papers": row["papers"][0] if row["papers"] else None,
        }
