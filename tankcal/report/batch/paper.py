"""Rows of a summary in words of a language."""

from urllib.parse import quote

from tankcal.errors import problem_from
from tankcal.report.plain import PlainPaper, words_with_part
from tankcal.report.saved_paper import signed_text
from tankcal.text.words import load_words, say

STATUSES = ("done", "unsound", "refused", "failed")  # of a job, from the best to the worst
MOST_CHANGES = 3  # largest number of changes in a cell
OF_RULE = {  # {verdict: group of the short words for its codes}
    "rule_verdict": "rule_verdicts",
    "comparison_verdict": "comparison_verdicts",
    "inspection_verdict": "inspection_verdicts",
    "global_test": "global_tests",
}


class SummaryPaper(PlainPaper):
    """Formatter of the rows of a summary in a language.

    Attributes
    ----------
    summary : dict
        {"tankcal", "do", "rows", "gone"}, as in summary.json.
    """

    def __init__(self, summary, language):
        super().__init__(words_with_part(load_words(language), "batch"))
        self.summary = summary

    def status(self, row):
        """Return the word for the status of a job."""
        return self.word(f"statuses.{row['status']}")

    def verdict(self, key, row):
        """Return the short word for a verdict, or None if there is no verdict."""
        code = row.get(key)
        return None if code is None else self.word(f"{OF_RULE[key]}.{str(code).lower()}")

    def changes(self, row):
        """Return the changes since the last batch as one text, or None without an earlier batch."""
        if row["changes"] is None:
            return None
        if not row["changes"]:
            return self.word("changes.none")
        return "; ".join(self._change(change) for change in row["changes"][:MOST_CHANGES])

    def _change(self, change):
        code = change["code"]
        if code == "volume_m3":
            by_m3, U_m3 = change["by_m3"], change["U_m3"]
            volume = self.number(by_m3, "m3", u=U_m3 or None, decimals=None)
            times = ""
            if U_m3:
                ratio = self.number(abs(by_m3) / U_m3, decimals=1)
                times = self.word("changes.times_U", times=ratio)
            return self.word("changes.volume_m3", by=signed_text(by_m3, volume)) + times
        if code == "status":
            old, new = (self.word(f"statuses.{change[key]}") for key in ("old", "new"))
            return self.word("changes.status", old=old, new=new)
        if code in OF_RULE:
            nothing = self.word("changes.nothing")
            old, new = (
                self.verdict(code, {code: change[key]}) or nothing for key in ("old", "new")
            )
            what = self.word(f"table_headings.{code}")
            return self.word("changes.verdict", what=what, old=old, new=new)
        return self.word(f"changes.{code}")

    def first_message(self, row):
        """Return the first problem, else the first warning, with the number of others; or None."""
        entries, count = row["problems"], row["problem_count"]
        if not entries:
            entries, count = row["warnings"], row["warning_count"]
        if not entries:
            return None
        first = say(self.words, problem_from(entries[0]).text)
        return first if count <= 1 else self.word("texts.and_more", text=first, count=count - 1)

    def paper_name(self, row):
        """Return the file name of the most important paper of a job, or None without papers."""
        return row["papers"][0].rpartition("/")[2] if row["papers"] else None

    def paper_link(self, row):
        """Return the relative address of this paper, or "" without papers."""
        return quote(row["papers"][0]) if row["papers"] else ""

    def plain_row(self, row):
        """Return a row of the CSV file: codes and numbers, and texts in the language."""
        return row | {
            "changes": self.changes(row),
            "told": self.first_message(row),
            "papers": row["papers"][0] if row["papers"] else None,
        }
