"""Single readings: those rejected, those that fit worst, those that nothing controls."""

import numpy as np

from tankcal.record.columns import ArrayRows
from tankcal.report.survey.common import MOST_ROWS, with_note
from tankcal.report.tables.readings import READINGS, in_their_units

WORST = 16  # rows of a table of the worst readings
WEAK = 0.1  # redundancy number below which a blunder has to be 13 sds to be found


def adjusted(paper):
    """`ArrayColumns` of readings that took part: neither rejected nor only compared, nor held."""
    found = paper.readings.arrays
    return paper.readings.take(~found["removed"] & ~found["check"] & (found["sd"] != 0))


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
    shown = list(in_their_units(rows[:MOST_ROWS]).rows())
    return with_note(paper, paper.show(READINGS, shown, on=name, **values), shown, rows)


def removed(paper):
    """Readings that were rejected, the worst first."""
    return sorted(paper.record["adjustment"]["removed"], key=lambda row: -abs(row["w"] or 0.0))


def largest(paper):
    """Readings with the largest w of those that were adjusted."""
    return _first(_controlled(paper), "w")


def _controlled(paper):
    """Of the readings that took part those that others control."""
    found = adjusted(paper)
    return found.take(found.arrays["controlled"])


def _first(found, key):
    """The WORST readings with the largest size of `key`, where they have one."""
    size = np.abs(found.arrays[key])
    known = np.flatnonzero(np.isfinite(size))
    return list(found.take(known[np.argsort(-size[known], kind="stable")[:WORST]]).rows())


def control(paper):
    """What nothing controls, and where an undetected blunder would do most."""
    a, every = paper.record["adjustment"], adjusted(paper)
    alone = ArrayRows(every.take(~every.arrays["controlled"]))
    numbers_of = _controlled(paper)["redundancy"]
    found = table(paper, "uncontrolled", alone, count=len(alone), all=every.count)
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
        _first(_controlled(paper), "effect_m"),
        power=paper.percent(a["power"]),
        alpha=paper.percent(a["alpha"]),
    )


def compared(paper):
    """Readings that were only compared, the largest difference in its sd first."""
    checks = paper.readings.take(paper.readings.arrays["check"]).rows()
    return sorted(checks, key=lambda row: -abs(row["w"] or 0.0))
