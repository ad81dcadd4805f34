"""The table of the jobs of a batch, declared once for page and workbook; that of the CSV file."""

from tankcal.report.saved_paper import bearable
from tankcal.report.tables import Column, Table


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
        Column("told", text=lambda paper, row: paper.told(row), sheet=True, width=50),
        Column("papers", text=lambda paper, row: paper.papers(row), sheet=True, width=20),
    ),
    rows=lambda found: found["rows"],
)  # fmt: skip

FILE_OF_JOBS = Table(
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
