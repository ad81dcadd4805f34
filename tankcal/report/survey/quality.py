"""Quality of an adjustment in the papers: statistics, datum, groups, and single readings."""

import numpy as np

from tankcal.record.columns import ArrayRows
from tankcal.report import blocks
from tankcal.report.tables.survey import GROUPS, MOST_IN_SHEET, READINGS, convert_units
from tankcal.text import words
from tankcal.text.digits import NOTHING

MOST_ROWS = 50  # largest number of rows of a table; a sentence states the number of all rows
WORST = 16  # rows of a table of the worst readings
WEAK = 0.1  # smaller redundancy numbers are weak: only blunders above 13 sd are detected


def chapter(paper, name, contents):
    """Return a heading of level 2 with its blocks; [] without blocks."""
    return [paper.heading(name, 2), *contents] if contents else []


def with_note(paper, block, shown, rows):
    """Return the table of the shown rows, followed by a sentence if further rows exist."""
    if len(rows) <= len(shown):
        return [block]
    name = "only_worst" if len(rows) <= MOST_IN_SHEET else "only_worst_of_many"
    return [block, paper.paragraph(name, shown=len(shown), all=len(rows))]


# ---- statistics


def facts(paper):
    """Block of the number of observations and unknowns, and the results of the global test."""
    adjustment = paper.record["adjustment"]
    return paper.facts(
        [
            ("adjusted_points", paper.number(len(adjustment["points"]), decimals=0)),
            *(
                (key, paper.number(adjustment[key], decimals=0))
                for key in ("observations", "unknowns", "redundancy", "iterations")
            ),
            ("snooping", words.snooping_sentence(paper.words, adjustment)),
            ("sigma0", paper.number(adjustment["sigma0"], decimals=3) or NOTHING),
            ("global_test", words.global_test_sentence(paper.words, adjustment)),
            ("cov_scale", words.scale_sentence(paper.words, adjustment)),
        ]
    )


def datum(paper):
    """Block of sentences on the datum, and on the results that depend on it."""
    return [blocks.listing(words.datum_sentences(paper.words, paper.record["adjustment"]))]


def excluded_points(paper):
    """Block with a sentence for each point that could not be adjusted; [] if there are none."""
    sentences = paper.record["adjustment"]["aside"]
    if not sentences:
        return []
    shown = [words.make_sentence(sentence) for sentence in sentences[:MOST_ROWS]]
    if len(sentences) > MOST_ROWS:
        shown.append(paper.word("texts.more_aside", more=len(sentences) - MOST_ROWS))
    return [blocks.listing(shown)]


def groups(paper):
    """Table of the groups of observations with their variance factors, and their verdicts."""
    adjustment = paper.record["adjustment"]
    block = paper.show(GROUPS, confidence=paper.percent(adjustment["confidence"]))
    sentences = words.verdict_sentences(paper.words, adjustment)
    return [block, blocks.listing(sentences)] if sentences else [block]


# ---- single readings


def readings_table(paper, name, rows, **values):
    """Table of readings called `name`, limited to the first MOST_ROWS; [] without rows."""
    if not rows:
        return []
    shown = list(convert_units(rows[:MOST_ROWS]).rows())
    return with_note(paper, paper.show(READINGS, shown, on=name, **values), shown, rows)


def select_adjusted(paper):
    """Select the adjusted readings: not rejected, not only compared, not held (ArrayColumns)."""
    columns = paper.readings.arrays
    return paper.readings.take(~columns["removed"] & ~columns["check"] & (columns["sd"] != 0))


def list_rejected(paper):
    """Return the rejected readings (list of dict), largest |w| first."""
    return _sort_by_w(paper.record["adjustment"]["removed"])


def list_compared(paper):
    """Return the readings that were only compared (list of dict), largest |w| first."""
    return _sort_by_w(paper.readings.take(paper.readings.arrays["check"]).rows())


def list_worst(paper):
    """Return the adjusted readings with the largest |w| (list of dict)."""
    return _list_largest(_select_controlled(paper), "w")


def control(paper):
    """Blocks on uncontrolled and weakly controlled readings, held values, and largest effects."""
    adjustment, adjusted = paper.record["adjustment"], select_adjusted(paper)
    uncontrolled = ArrayRows(adjusted.take(~adjusted.arrays["controlled"]))
    controlled = _select_controlled(paper)
    redundancies = controlled["redundancy"]
    contents = readings_table(
        paper, "uncontrolled", uncontrolled, count=len(uncontrolled), all=adjusted.count
    )
    if not uncontrolled and redundancies:
        smallest, largest, mean = (
            paper.number(value, digits=2)
            for value in (
                min(redundancies), max(redundancies), sum(redundancies) / len(redundancies)
            )
        )  # fmt: skip
        contents = [
            paper.paragraph("all_controlled", smallest=smallest, largest=largest, mean=mean)
        ]
    weak = sum(redundancy < WEAK for redundancy in redundancies)
    if weak:
        limit = paper.number(WEAK, digits=1)
        contents.append(paper.paragraph("weakly_controlled", count=weak, limit=limit))
    contents += _held_values(paper)
    return contents + readings_table(
        paper,
        "weakest_readings",
        _list_largest(controlled, "effect_m"),
        power=paper.percent(adjustment["power"]),
        alpha=paper.percent(adjustment["alpha"]),
    )


def _held_values(paper):
    """Table of the values held exactly with the results of their release; [] without any."""
    adjustment = paper.record["adjustment"]
    critical = paper.number(adjustment["critical_w"], digits=3)
    rows = _sort_by_w(adjustment.get("held", []))  # absent in records of earlier versions
    return readings_table(paper, "held", rows, critical=critical)


def _select_controlled(paper):
    """Select the adjusted readings that other readings control (ArrayColumns)."""
    adjusted = select_adjusted(paper)
    return adjusted.take(adjusted.arrays["controlled"])


def _list_largest(readings, key):
    """Return the WORST readings with the largest finite absolute value of `key`."""
    size = np.abs(readings.arrays[key])
    known = np.flatnonzero(np.isfinite(size))
    largest = known[np.argsort(-size[known], kind="stable")[:WORST]]
    return list(readings.take(largest).rows())


def _sort_by_w(rows):
    return sorted(rows, key=lambda row: -abs(row["w"] or 0.0))
