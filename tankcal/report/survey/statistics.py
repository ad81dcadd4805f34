"""How well everything fits: statistics, datum, groups of observations."""

from tankcal.report import blocks
from tankcal.report.survey.common import MOST_ROWS
from tankcal.report.tables.readings import GROUPS
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


def datum(paper):
    """Sentences: what holds the frame, and what depends on that choice."""
    return [blocks.listing(words.datum_sentences(paper.words, paper.record["adjustment"]))]


def aside(paper):
    """Points that could not be adjusted, a sentence each."""
    sentences = paper.record["adjustment"]["aside"]
    if not sentences:
        return []
    shown = [words.make_sentence(one) for one in sentences[:MOST_ROWS]]
    if len(sentences) > MOST_ROWS:
        shown.append(paper.word("texts.more_aside", more=len(sentences) - MOST_ROWS))
    return [blocks.listing(shown)]


def groups(paper):
    """The groups of observations with their variance factors, and what is not as declared."""
    a = paper.record["adjustment"]
    table = paper.show(GROUPS, confidence=paper.percent(a["confidence"]))
    sentences = words.verdict_sentences(paper.words, a)
    return [table, blocks.listing(sentences)] if sentences else [table]
