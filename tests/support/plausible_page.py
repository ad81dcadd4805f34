"""Writes docs/plausible-values.md from the table of plausible ranges (`make job-format`)."""

from pathlib import Path

from tankcal.job.plausibility import TABLE

PAGE = Path(__file__).parents[2] / "docs/plausible-values.md"
HEAD = """# Plausible values

This page lists the plausible range of each number of a job, the error that it detects, and its
reference. It is generated from `tankcal/job/plausibility.py` by
`make job-format`. The checks are explained in [plausibility checks](plausibility.md).

| what | plausible range | typical error detected | compared with |
| --- | --- | --- | --- |
"""


def page():
    """Text of the page."""
    rows = (
        (
            row.what,
            row.expected + ("" if row.verified else " (not verified)"),
            row.slip,
            row.against,
        )
        for row in TABLE
    )
    return HEAD + "".join(f"| {' | '.join(text or '–' for text in row)} |\n" for row in rows)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
