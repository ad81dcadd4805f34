"""The page of a batch, block by block: how many jobs became what, then a row each."""

from collections import Counter

from tankcal.report import blocks
from tankcal.report.batch.paper import STATUSES
from tankcal.report.batch.tables import JOBS

MOST_ROWS = 5000  # of the page: more are only in workbook and CSV, those that are not done first
MOST_GONE = 20
WRAPPED = ("changes", "told")  # columns whose cells are sentences


def pages(paper):
    """The blocks of a SummaryPaper."""
    found = paper.found
    title = paper.word("titles.summary")
    return [
        blocks.document(
            title=title,
            language=paper.words["language"]["code"],
            running=[title, ""],
            footer=f"{paper.words['page']['footer']} · tankcal {found['tankcal']}",
        ),
        blocks.masthead(title, paper.word("texts.steps", steps=_steps(paper))),
        blocks.key_values(_counts(paper)),
        *_gone(paper),
        *_rows(paper),
    ]


def _steps(paper):
    return ", ".join(paper.word(f"steps.{one}") for one in paper.found["do"])


def _counts(paper):
    """How many jobs there are of each status, how many changed."""
    rows = paper.found["rows"]
    counts = Counter(row["status"] for row in rows)
    items = [(paper.word("labels.jobs"), paper.number(len(rows), decimals=0))]
    items += [
        (paper.word(f"statuses.{one}"), paper.number(counts[one], decimals=0))
        for one in STATUSES
        if counts[one]
    ]
    if any(row["changes"] is not None for row in rows):
        changed = sum(bool(row["changes"]) for row in rows)
        items.append((paper.word("labels.changed"), paper.number(changed, decimals=0)))
    return items


def _gone(paper):
    """Jobs of the last batch that are not among these."""
    gone = paper.found["gone"]
    if not gone:
        return []
    names = ", ".join(gone[:MOST_GONE])
    if len(gone) > MOST_GONE:
        names = paper.word("texts.and_more", text=names, count=len(gone) - MOST_GONE)
    return [paper.paragraph("gone", names=names)]


def _rows(paper):
    """The table of the jobs, each with the way to its paper."""
    rows, told = paper.found["rows"], []
    if len(rows) > MOST_ROWS:
        worst_first = sorted(rows, key=lambda row: -STATUSES.index(row["status"]))
        rows = sorted(worst_first[:MOST_ROWS], key=lambda row: row["name"])
        told = [paper.paragraph("not_all", shown=MOST_ROWS, all=len(paper.found["rows"]))]
    table = paper.show(JOBS, known(rows))
    links = {len(table.data["columns"]) - 1: [paper.link(one) for one in rows]}
    shown = [one.key for one in JOBS.on_paper(None, known(rows))]
    whole = [number for number, key in enumerate(shown) if key not in WRAPPED]
    return [*told, blocks.Block(table.data | {"links": links, "whole": whole})]


def known(rows):
    """Rows without what none of them has: its column is left out."""
    empty = {
        key for row in rows for key in row if all(one.get(key) is None for one in rows)
    } if rows else set()  # fmt: skip
    return [{key: value for key, value in row.items() if key not in empty} for row in rows]
