"""Table of the jobs of a batch, and the web page and the workbook that show it."""

from collections import Counter

from tankcal.report import blocks
from tankcal.report.batch.paper import STATUSES
from tankcal.report.saved_paper import bearable
from tankcal.report.tables import Column, Table
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.sections import SheetContent, cell_table, write_workbook

MOST_ROWS = 5000  # of the page; jobs that are not done take precedence
MOST_GONE = 20  # largest number of names of former jobs
SENTENCE_COLUMNS = ("changes", "told")  # columns whose cells may be wrapped
MOST_LINKS = 65_530  # Excel allows no more links in a sheet


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
            *("warning_count", "problem_count", "changes", "told", "papers"),
        )
    ),
)


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
        *_gone(paper),
        *_rows(paper),
    ]


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


def _gone(paper):
    """Return a paragraph with the jobs of the last batch that this batch does not contain."""
    gone = paper.summary["gone"]
    if not gone:
        return []
    names = ", ".join(gone[:MOST_GONE])
    if len(gone) > MOST_GONE:
        names = paper.word("texts.and_more", text=names, count=len(gone) - MOST_GONE)
    return [paper.paragraph("gone", names=names)]


def _rows(paper):
    """Return the table of the jobs, with links to their papers."""
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
    head = workbook_head(paper.summary["tankcal"], source=str(len(paper.summary["rows"])))
    write_workbook(paper, path, "batch", head, _sheets, subject=paper.word("titles.summary"))


def _sheets(book):
    """Yield the only sheet: the table of the jobs, with links to their papers."""
    paper, rows = book.paper, book.paper.summary["rows"]
    links = [
        (f"external:{row['papers'][0]}", paper.paper_name(row)) if row["papers"] else ("", "")
        for row in rows[:MOST_LINKS]
    ]
    table = cell_table(book, JOBS, _without_empty_columns(rows), links=links)
    yield SheetContent("jobs", [table], tab="result", is_filtered=True)
