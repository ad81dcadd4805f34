"""Summary of a batch as JSON, CSV, workbook and web page.

All values come from the rows of `tankcal.products.batch.running`; no number is computed here.
"""

import json
from collections import Counter
from urllib.parse import quote

from tankcal.errors import problem_from
from tankcal.report import blocks
from tankcal.report.plain import PlainPaper, words_with_part
from tankcal.report.saved_document import bearable, signed_text
from tankcal.report.tables import Column, Table
from tankcal.text.words import load_words, say

JSON, CSV, WORKBOOK, PAGE = "summary.json", "summary.csv", "summary.xlsx", "summary.html"
ALARMS = "alarms.csv"  # of tanks in service
FILES = JSON, CSV, WORKBOOK, PAGE, ALARMS
STATUSES = ("done", "unsound", "refused", "failed")  # of a job, from the best to the worst
MOST_CHANGES = 3  # largest number of changes in a cell
OF_RULE = {  # {verdict: group of the short words for its codes}
    "rule_verdict": "rule_verdicts",
    "comparison_verdict": "comparison_verdicts",
    "inspection_verdict": "inspection_verdicts",
    "alarm_verdict": "alarm_verdicts",
    "global_test": "global_tests",
}
MOST_ROWS = 5000  # of the page; jobs that are not done take precedence
MOST_GONE = 20  # largest number of names of former jobs
SENTENCE_COLUMNS = ("changes", "told")  # columns whose cells may be wrapped
MOST_LINKS = 65_530  # Excel allows no more links in a sheet


def summary_files(summary, language, folder):
    """Write the files of a summary into a folder and return their names.

    Parameters
    ----------
    summary : dict
        {"tankcal", "do", "rows", "gone"}, as in summary.json.
    language : str
        Language of workbook and page, one of languages.LANGUAGES.
    folder : Path

    Returns
    -------
    list of str
    """
    from tankcal.report.outputs import write_table
    from tankcal.report.web import page

    text = json.dumps(summary, ensure_ascii=False, allow_nan=False, indent=1)
    data = text.encode("utf-8", "replace")
    (folder / JSON).write_bytes(data + b"\n")
    # Names of files may contain bytes that are not UTF-8; all other summaries need no copy.
    is_utf8 = data == text.encode("utf-8", "surrogatepass")
    paper = SummaryPaper(summary if is_utf8 else json.loads(data), language)
    del text, data
    rows = [paper.plain_row(row) for row in paper.summary["rows"]]
    write_table(CSV_COLUMNS, folder / CSV, rows)
    if is_watched := "upkeep" in summary["do"]:
        alarms = [row for row in rows if row.get("alarm")]
        columns = {
            column.key: [row[column.key] for row in alarms] for column in ALARM_COLUMNS.in_csv()
        }
        write_table(ALARM_COLUMNS, folder / ALARMS, columns)
    write_summary(paper, folder / WORKBOOK)
    web_page = page([block.data for block in page_blocks(paper)])
    (folder / PAGE).write_text(web_page, encoding="utf-8", errors="replace")
    return [name for name in FILES if name != ALARMS or is_watched]


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

    def causes(self, row):
        """Return the possible causes of an alarm as a text, or None without alarm."""
        kinds = row.get("causes") or ()
        return ", ".join(self.words["upkeep"]["kinds"][kind] for kind in kinds) or None

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
        """Return the file name of the most important paper of a job, or None if there is none."""
        return row["papers"][0].rpartition("/")[2] if row["papers"] else None

    def paper_link(self, row):
        """Return the relative address of this report, or "" if there is none."""
        return quote(row["papers"][0]) if row["papers"] else ""

    def plain_row(self, row):
        """Return a row of the CSV file: codes and numbers, and texts in the language."""
        return row | {
            "changes": self.changes(row),
            "causes": self.causes(row),
            "told": self.first_message(row),
            "papers": row["papers"][0] if row["papers"] else None,
        }


def _verdict(key):
    return Column(
        key, text=lambda paper, row: paper.verdict(key, row), sheet=True, width=14, optional=True
    )


JOBS = Table(
    "jobs",
    (
        Column("name", text=lambda paper, row: bearable(row["name"]), sheet=True, width=18),
        Column("tank", text=lambda paper, row: row.get("tank") and bearable(row["tank"]),
               sheet=True, width=14),
        Column("status", text=lambda paper, row: paper.status(row), sheet=True, width=14),
        Column("height_m", "m", height=True, sheet=True, width=10, optional=True),
        Column("volume_m3", "m3", u="U_m3", sheet=True, width=14, optional=True),
        Column("U_m3", "m3", u="U_m3", sheet=True, width=10, optional=True),
        _verdict("global_test"),
        _verdict("rule_verdict"),
        _verdict("comparison_verdict"),
        _verdict("inspection_verdict"),
        _verdict("alarm_verdict"),
        Column("alarm", text=lambda paper, row: row.get("alarm"), sheet=True, width=12,
               optional=True),
        Column("causes", text=lambda paper, row: paper.causes(row), sheet=True, width=30,
               optional=True),
        Column("leak_l_h", u="leak_U_l_h", least=1, sheet=True, width=12, optional=True),
        Column("leak_U_l_h", u="leak_U_l_h", least=1, sheet=True, width=12, optional=True),
        Column("warning_count", decimals=0, sheet=True, width=10),
        Column("changes", text=lambda paper, row: paper.changes(row), sheet=True, width=30,
               optional=True),
        Column("told", text=lambda paper, row: paper.first_message(row), sheet=True, width=50),
        Column("papers", text=lambda paper, row: paper.paper_name(row), sheet=True, width=20),
    ),
    rows=lambda summary: summary["rows"],
)  # fmt: skip

CSV_COLUMNS = Table(
    "summary",
    tuple(
        Column(key, csv=key)
        for key in (
            *("name", "source", "status", "tank", "kind", "date", "height_m", "volume_m3", "U_m3"),
            *("global_test", "rule", "rule_verdict", "comparison_verdict", "inspection_verdict"),
            *("alarm_verdict", "alarm", "causes", "leak_l_h", "leak_U_l_h"),
            *("warning_count", "problem_count", "changes", "told", "papers"),
        )
    ),
)


ALARM_COLUMNS = Table(
    "alarms",
    tuple(Column(key, csv=key) for key in (
        "name", "tank", "date", "alarm", "alarm_verdict", "causes", "leak_l_h", "leak_U_l_h",
        "false_alarms")),
)  # fmt: skip


def _without_empty_columns(rows):
    """Return the rows without the keys that are None in every row."""
    known = {key for row in rows for key, value in row.items() if value is not None}
    return [{key: value for key, value in row.items() if key in known} for row in rows]


# ---- web page


def page_blocks(paper):
    """Return the blocks of the web page of a SummaryPaper."""
    title = paper.word("titles.summary")
    steps = ", ".join(paper.word(f"steps.{step}") for step in paper.summary["do"])
    return [
        blocks.document(
            title=title,
            language=paper.words["language"]["code"],
            running=[title, ""],
            footer=f"{paper.words['page']['footer']} · tankcal {paper.summary['tankcal']}",
        ),
        blocks.masthead(title, paper.word("texts.steps", steps=steps)),
        blocks.key_values(_counts(paper)),
        *_false_alarms(paper),
        *_missing_jobs(paper),
        *_jobs_table(paper),
    ]


def _false_alarms(paper):
    """Number of false alarms that the declared rates of all watched tanks let expect."""
    expected = [row["false_alarms"] for row in paper.summary["rows"] if row.get("false_alarms")]
    if not expected:
        return []
    number = paper.number(sum(expected), decimals=1)
    return [blocks.paragraph(paper.word("texts.false_alarms", number=number))]


def _counts(paper):
    """Return (label, number) of all jobs, of each status, and of changed jobs."""
    rows = paper.summary["rows"]
    counts = Counter(row["status"] for row in rows)
    items = [(paper.word("labels.jobs"), paper.number(len(rows), decimals=0))]
    items += [
        (paper.word(f"statuses.{status}"), paper.number(counts[status], decimals=0))
        for status in STATUSES
        if counts[status]
    ]
    if any(row["changes"] is not None for row in rows):
        changed = sum(bool(row["changes"]) for row in rows)
        items.append((paper.word("labels.changed"), paper.number(changed, decimals=0)))
    return items


def _missing_jobs(paper):
    """Return a paragraph with the jobs of the last batch that this batch does not contain."""
    gone = paper.summary["gone"]
    if not gone:
        return []
    names = ", ".join(gone[:MOST_GONE])
    if len(gone) > MOST_GONE:
        names = paper.word("texts.and_more", text=names, count=len(gone) - MOST_GONE)
    return [paper.paragraph("gone", names=names)]


def _jobs_table(paper):
    """Return the table of the jobs, with links to their reports."""
    rows, note = paper.summary["rows"], []
    if len(rows) > MOST_ROWS:
        worst_first = sorted(rows, key=lambda row: -STATUSES.index(row["status"]))
        rows = sorted(worst_first[:MOST_ROWS], key=lambda row: row["name"])
        note = [paper.paragraph("not_all", shown=MOST_ROWS, all=len(paper.summary["rows"]))]
    shown = _without_empty_columns(rows)
    table = paper.show(JOBS, shown)
    links = {len(table.data["columns"]) - 1: [paper.paper_link(row) for row in rows]}
    keys = [column.key for column in JOBS.on_paper(None, shown)]
    whole = [place for place, key in enumerate(keys) if key not in SENTENCE_COLUMNS]
    return [*note, blocks.Block(table.data | {"links": links, "whole": whole})]


# ---- workbook


def write_summary(paper, path):
    """Write the workbook of a SummaryPaper; equal rows give equal bytes."""
    from tankcal.report.workbook.book import workbook_head
    from tankcal.report.workbook.sections import SheetContent, cell_table, write_workbook

    def sheets(book):
        # The only sheet: the table of the jobs, with links to their reports.
        rows = paper.summary["rows"]
        links = [
            (f"external:{row['papers'][0]}", paper.paper_name(row)) if row["papers"] else ("", "")
            for row in rows[:MOST_LINKS]
        ]
        table = cell_table(book, JOBS, _without_empty_columns(rows), links=links)
        yield SheetContent("jobs", [table], tab="result", is_filtered=True)

    head = workbook_head(paper.summary["tankcal"], source=str(len(paper.summary["rows"])))
    write_workbook(paper, path, "batch", head, sheets, subject=paper.word("titles.summary"))
