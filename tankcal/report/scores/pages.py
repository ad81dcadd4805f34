"""What the page of scores says, block by block."""

from tankcal.report import blocks
from tankcal.report.scores import figures
from tankcal.report.scores.tables import ERRORS, FORMS, PARTICIPANTS, TABLES

FORMULAS = ("E_n", "zeta", "share", "form", "deliveries", "ranking")


def pages(paper):
    """The blocks of a ScoresPaper."""
    return [
        *paper.head(),
        *_subject(paper),
        *_scores(paper),
        *_reading(paper),
        *_figures(paper),
        *_tables(paper),
        *_warnings(paper),
    ]


def _subject(paper):
    found = paper.found
    tanks = {one["tank"] for one in found["tables"]}
    methods = figures.methods_of(found)
    return [
        paper.heading("subject"),
        paper.paragraph(
            "subject", tanks=len(tanks), methods=len(methods), tables=len(found["tables"])
        ),
        paper.paragraph("commitment", digest=found["truth_sha256"]),
        paper.show(PARTICIPANTS, PARTICIPANTS.rows(found)),
    ]


def _scores(paper):
    found = paper.found
    coverage = paper.percent(found["coverage_probability"])
    return [
        paper.heading("scores"),
        paper.show(ERRORS, ERRORS.rows(found), coverage=coverage),
        paper.show(FORMS, FORMS.rows(found)),
    ]


def _reading(paper):
    said = [paper.word(f"reading.{one}") for one in FORMULAS]
    return [paper.heading("reading"), blocks.listing(said)]


def _figures(paper):
    found = paper.found
    made = [paper.heading("figures")]
    for method in figures.methods_of(found):
        name = paper.method(method)
        made.append(paper.figure(figures.errors(paper, method), "scored_lines", method=name))
    pair = figures.tanks_of_youden(found)
    if pair:
        first, second = pair
        made.append(
            paper.figure(figures.youden(paper, *pair), "youden", width=0.75, first=first,
                         second=second)
        )  # fmt: skip
    return made


def _tables(paper):
    return [paper.heading("tables"), paper.show(TABLES, TABLES.rows(paper.found))]


def _warnings(paper):
    said = [paper.warning(one) for one in paper.found["warnings"]]
    return [paper.heading("warnings"), blocks.listing(said)] if said else []
