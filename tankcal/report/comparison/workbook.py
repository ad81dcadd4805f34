"""Workbook of a comparison: all rows, to sort and filter, with numbers as numbers."""

from tankcal.report.comparison.pages import DECIMALS_OF_LIMITS, side_rows
from tankcal.report.comparison.tables import (
    COURSES,
    DECIMALS,
    DELIVERIES,
    ROWS,
    STEPS,
    step_rows,
    unit_symbol,
    waterfall_table,
)
from tankcal.report.tables import Column, Table
from tankcal.report.workbook.book import workbook_head
from tankcal.report.workbook.sections import (
    FIRST_LINE,
    Sentences,
    SheetContent,
    cell_table,
    write_workbook,
)

WIDTHS = (30, 34, 34, 12, 12, 24, 40, 12)
READ_DECIMALS = 6  # of values estimated from the tables, for units that DECIMALS lacks

SIDES = Table("sides", tuple(Column(key, sheet=True) for key in ("what", "former", "new")))
LIMITS = Table(  # limits and periods of the rule; each number with its unit
    "legal",
    (
        Column("number", sheet=True),
        *(
            Column(key, decimals=lambda row: row["decimals"], sheet=True)
            for key in ("value", "as_printed", "limit")
        ),
        Column("unit", sheet=True),
        Column("verdict", words="limits", sheet=True),
        Column("clause", sheet=True),
        Column("verified", sheet=True),
    ),
)
READ_VALUES = Table(  # values estimated from the tables
    "read",
    (
        Column("table", words="sides_of_comparison", sheet=True),
        Column("code", words="read", heading="what", sheet=True),
        *(
            Column(
                key,
                decimals=lambda row: DECIMALS.get(row["unit"], READ_DECIMALS),
                heading=heading,
                sheet=True,
            )
            for key, heading in (("value", "read_value"), ("u", "u"))
        ),
        Column("unit", text=lambda paper, row: unit_symbol(row["unit"]), sheet=True),
        Column("sure", words="sure", sheet=True),
        Column("used", sheet=True),
    ),
    rows=lambda comparison: comparison["read"],
)


def write(paper, path):
    """Write the workbook of a ComparisonPaper; equal comparisons give equal bytes."""
    comparison, new = paper.record, paper.record["new"]
    head = workbook_head(
        comparison["tankcal"],
        tank=comparison["tank"] or comparison["former"]["name"],
        date=new["date"],
        notice=comparison["notice"],
        laboratory=new["laboratory"],
    )
    write_workbook(paper, path, "comparison", head, sheets)


def sheets(book):
    """Yield the content of each sheet, in order."""
    paper, comparison = book.paper, book.paper.record
    yield _verdict_sheet(book, paper)
    yield SheetContent("rows", [cell_table(book, ROWS)], tab="result", is_filtered=True)
    waterfall = cell_table(book, waterfall_table(comparison), comparison["waterfall"])
    yield SheetContent("waterfall", [cell_table(book, STEPS, step_rows(paper)), waterfall])
    yield SheetContent("deliveries", [cell_table(book, DELIVERIES)])
    yield SheetContent("courses", [cell_table(book, COURSES)])


def _verdict_sheet(book, paper):
    """Return verdict, its reasons, both tables, the limits of the rule and estimated values."""
    code = paper.record["verdict"] or "none"
    reasons = [f"– {paper.reason(reason)}" for reason in paper.record["reasons"]]
    verdict = (
        Sentences([paper.word(f"verdicts.{code}")], look=FIRST_LINE),
        Sentences([paper.word(f"texts.verdict_{code}"), *reasons]),
    )
    tables = (
        cell_table(
            book,
            table,
            rows,
            title=paper.word(f"sheet_headings.{table.name}"),
            is_optional=True,
        )
        for table, rows in (
            (SIDES, side_rows(paper)),
            (LIMITS, _limit_rows(paper)),
            (READ_VALUES, None),
        )
    )
    return SheetContent(
        "verdict", [verdict, *tables], tab="result", widths=WIDTHS, keeps_together=True
    )


def _limit_rows(paper):
    """Return a row for each limit and each period of the rule."""
    limits = [
        limit
        | {
            "number": paper.word(f"numbers.{limit['code']}"),
            "unit": unit_symbol(limit["unit"]),
            "decimals": DECIMALS_OF_LIMITS[limit["unit"]],
        }
        for limit in paper.record["legal"]
    ]
    periods = [
        age
        | {
            "number": paper.word(f"ages.{age['of']}"),
            "value": age["age_years"],
            "limit": age["years"],
            "unit": paper.word("texts.unit_years"),
            "decimals": 1,
        }
        for age in paper.record["ages"]
    ]
    return [*limits, *periods]
