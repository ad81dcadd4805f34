"""Single readings: those set aside, those that fit worst, those that nothing controls."""

from heapq import nlargest

from tankcal.record.plain_data import columns_of, rows_of
from tankcal.report.survey.common import MOST_ROWS, with_note
from tankcal.report.tables.readings import READINGS, in_their_units

WORST = 16  # rows of a table of the worst readings
WEAK = 0.1  # redundancy number below which a blunder has to be 13 sds to be found


def held(paper):
    """What was held exactly, with what its release would say: the largest test quantity first."""
    rows = paper.record["adjustment"].get("held", [])
    if not rows:
        return []
    rows = sorted(rows, key=lambda row: -abs(row["w"] or 0.0))
    critical = paper.number(paper.record["adjustment"]["critical_w"], digits=3)
    return table(paper, "held", rows, critical=critical)


def table(paper, name, rows, **values):
    """The table of readings of that name, cut to the first MOST_ROWS."""
    if not rows:
        return []
    shown = rows_of(in_their_units(columns_of(rows[:MOST_ROWS])))
    return with_note(paper, paper.show(READINGS, shown, on=name, **values), shown, rows)


def removed(paper):
    """Readings that were set aside, the worst first."""
    return sorted(paper.record["adjustment"]["removed"], key=lambda row: -abs(row["w"] or 0.0))


def largest(paper):
    """Readings with the largest w of those that were adjusted."""
    rows = paper.adjusted_readings
    controlled = [row for row in rows if row["controlled"] and row["w"] is not None]
    return nlargest(WORST, controlled, key=lambda row: abs(row["w"]))


def control(paper):
    """What nothing controls, and where an undetected blunder would do most."""
    a, rows = paper.record["adjustment"], paper.adjusted_readings
    alone = [row for row in rows if not row["controlled"]]
    numbers_of = [row["redundancy"] for row in rows if row["controlled"]]
    found = table(paper, "uncontrolled", alone, count=len(alone), all=len(rows))
    if not alone and numbers_of:
        smallest, largest, mean = (
            paper.number(value, digits=2)
            for value in (min(numbers_of), max(numbers_of), sum(numbers_of) / len(numbers_of))
        )
        found = [paper.paragraph("all_controlled", smallest=smallest, largest=largest, mean=mean)]
    weak = sum(number < WEAK for number in numbers_of)
    if weak:
        limit = paper.number(WEAK, digits=1)
        found.append(paper.paragraph("weakly_controlled", count=weak, limit=limit))
    found += held(paper)
    return found + table(
        paper,
        "weakest_readings",
        _weakest(paper),
        power=paper.percent(a["power"]),
        alpha=paper.percent(a["alpha"]),
    )


def _weakest(paper):
    """Readings whose undetected bias would move a point most."""
    rows = paper.adjusted_readings
    felt = [row for row in rows if row["controlled"] and row["effect_m"] is not None]
    return nlargest(WORST, felt, key=lambda row: row["effect_m"])


def compared(paper):
    """Readings that were only compared, the largest difference in its sd first."""
    checks = [row for row in paper.readings if row["check"]]
    return sorted(checks, key=lambda row: -abs(row["w"] or 0.0))
