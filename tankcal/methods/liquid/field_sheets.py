"""Forms of the field sheets: meters, levels with all valves shut, and batches with their dips."""

from tankcal.report import blocks
from tankcal.report.field_forms import WIDE

ROWS_OF_METERS, ROWS_OF_VALVES = 5, 8


def blocks_of_liquid(paper, texts):
    """Return the blocks before the form of the batches."""
    shown = [blocks.paragraph(paper.word("forms.batches"))]
    return [*shown, *_meters(paper, texts), *_valves(paper)]


def columns_of_batches(paper, columns):
    """Return the columns of the batches; meters show totals, the office takes the differences."""
    columns = [(heading, unit, 1.0) for heading, unit, _ in columns]
    return [*columns[:2], (paper.word("forms.meter_shows"), "", WIDE["name"]), *columns[2:]]


def _meters(paper, texts):
    """Form of the meters, for the file meters.toml."""
    labels = texts.words["input"]["labels"]
    columns = [
        (labels["meter"], "", WIDE["name"]),
        (paper.word("forms.serial_number"), "", WIDE["name"]),
        (paper.word("forms.prover"), "", WIDE["name"]),
        (paper.word("forms.factor_before"), "", 1.0),
        (paper.word("forms.factor_after"), "", 1.0),
        (paper.word("forms.flows"), "m³/h", WIDE["name"]),
    ]
    return [
        blocks.heading(texts.words["input"]["titles"]["meters"]),
        blocks.form(columns, ROWS_OF_METERS),
    ]


def _valves(paper):
    """Form for the level with all valves shut, before and after the filling."""
    columns = [
        (paper.word("forms.time"), "", 1.0),
        (paper.word("forms.dip"), "m", 1.0),
        (paper.word("forms.later"), "", 1.0),
        (paper.word("forms.dip"), "m", 1.0),
        (paper.word("forms.valves_shut"), "", WIDE["text"]),
    ]
    return [
        blocks.heading(paper.word("forms.tight")),
        blocks.paragraph(paper.word("forms.tight_how")),
        blocks.form(columns, ROWS_OF_VALVES),
    ]
