"""How well everything fits: statistics, datum, groups of observations."""

from tankcal.report import blocks, numbers
from tankcal.report.paper import Column
from tankcal.report.survey.common import MOST_ROWS, SMALL_UNITS
from tankcal.text import words
from tankcal.text.digits import NOTHING


def facts(paper):
    """What was adjusted, and how well it fits."""
    a = paper.record["adjustment"]
    return paper.facts(
        [
            ("adjusted_points", paper.number(len(a["points"]), decimals=0)),
            *(
                (key, paper.number(a[key], decimals=0))
                for key in ("observations", "unknowns", "redundancy", "iterations")
            ),
            ("snooping", words.snooping_sentence(paper.words, a)),
            ("sigma0", paper.number(a["sigma0"], decimals=3) or NOTHING),
            ("global_test", words.global_test_sentence(paper.words, a)),
            ("cov_scale", words.scale_sentence(paper.words, a)),
        ]
    )


def method(paper):
    """One line for the certificate: what was measured, how many points, sigma0."""
    return words.method_line(paper.words, paper.record["adjustment"])


def datum(paper):
    """Sentences: what holds the frame, and what depends on that choice."""
    return [blocks.listing(words.datum_sentences(paper.words, paper.record["adjustment"]))]


def aside(paper):
    """Points that could not be adjusted, a sentence each."""
    sentences = paper.record["adjustment"]["aside"]
    if not sentences:
        return []
    shown = [words.as_sentence(one) for one in sentences[:MOST_ROWS]]
    if len(sentences) > MOST_ROWS:
        shown.append(paper.word("texts.more_aside", more=len(sentences) - MOST_ROWS))
    return [blocks.listing(shown)]


def groups(paper):
    """The groups of observations with their variance factors, and what is not as declared."""
    a = paper.record["adjustment"]
    table = paper.table(
        "groups",
        [_group(paper, row) for row in a["groups"]],
        [
            Column("group", heading="observations"),
            Column("count", decimals=0),
            Column("removed", decimals=0, heading="set_aside"),
            Column("declared_sd", align="right"),
            Column("rms", align="right"),
            Column("redundancy", decimals=1),
            Column("factor", align="right"),
            Column("interval", align="right"),
            Column("verdict", words="verdicts"),
        ],
        confidence=paper.percent(a["confidence"]),
    )
    sentences = words.verdict_sentences(paper.words, a)
    return [table, blocks.listing(sentences)] if sentences else [table]


def _group(paper, row):
    factor = interval = None
    if row["verdict"] in ("as_declared", "better", "worse"):
        keys = ("factor", "factor_low", "factor_high")
        factor, low, high = (words.factor_text(paper.words, row[key]) for key in keys)
        interval = f"{low}–{high}"
    smallest, largest = row["sd_smallest"], row["sd_largest"]
    declared = _small(paper, smallest, row["unit"])
    if smallest is not None and largest > smallest * (1 + 1e-9):
        unit = numbers.unit(SMALL_UNITS.get(row["unit"], ""))
        low = paper.number(smallest * unit.factor, digits=2)
        declared = f"{low}–{_small(paper, largest, row['unit'])}"
    return row | {
        "group": words.group_name(paper.words, row),
        "factor": factor,
        "declared_sd": declared,
        "rms": _small(paper, row["rms"], row["unit"]),
        "interval": interval,
    }


def _small(paper, value, unit):
    """A residual or an sd with its small unit: um, mm or arc seconds."""
    return paper.number(value, SMALL_UNITS.get(unit, ""), digits=2)
