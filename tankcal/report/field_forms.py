"""Field sheets of a starter job: its tables of readings as a crew fills them in by pen."""

from tankcal.job.contract import COLUMNS, SURVEYS
from tankcal.job.starter.form import OF_SHELLS
from tankcal.job.starter.texts import parted, texts_in
from tankcal.report import blocks
from tankcal.report.plain import PlainPaper

FILE = "field-sheets.pdf"
ROWS = {  # that a sheet has room for
    "lines": 12,
    "offsets": 30,
    "circumferences": 18,
    "obstructions": 10,
    "thickness": 12,
    "tape_checks": 6,
    "setups": 6,
    "control_readings": 24,
    "wall_hits": 30,
    "tangents": 30,
    "stadia": 10,
}
IN_THE_OFFICE = ("use", "s_mm", "s_arcsec", "note")  # columns that nobody fills in on site
UNIT_OF_CIRCLE = "_deg"  # of three columns of one angle the one that stands for all
OTHER_UNITS = ("_gon", "_dms")
WIDE = {"name": 1.5, "text": 2.0}  # shares of the width, beside one of a number
FACTS = ("tank", "date", "crew", "weather", "shell_temperature", "instruments", "masters")


def is_filled_by_pen(survey):
    """Are there field sheets for that kind of survey?"""
    return survey in OF_SHELLS


def write_field_sheets(path, survey, language):
    """Write the field sheets of a survey as a PDF.

    Parameters
    ----------
    path : Path
        Of the new file.
    survey : str
        "strapping", "reference-line", "wall-hits" or "tangents".
    language : str
        One of `languages.LANGUAGES`.
    """
    from tankcal.report.pdf import pdf

    found = sheets(survey, language)
    path.write_bytes(pdf([block.data for block in found], path.parent))


def sheets(survey, language):
    """The blocks of the field sheets."""
    texts = texts_in(language)
    paper = PlainPaper(texts.words)
    title = paper.word("forms.title")
    found = [
        blocks.document(
            title=title,
            language=language,
            running=[title, paper.word(f"forms.{_code(survey)}")],
            footer=texts.words["page"]["footer"],
        ),
        blocks.masthead(title, paper.word(f"forms.{_code(survey)}")),
        blocks.key_values([(paper.word(f"forms.{fact}"), " ") for fact in FACTS]),
        blocks.paragraph(paper.word("forms.how")),
    ]
    for name in (one for one in ROWS if one in SURVEYS[survey]):
        found += [
            blocks.heading(texts.words["input"]["titles"][name]),
            blocks.form([_column(texts, field) for field in _columns(name)], ROWS[name]),
        ]
    return [*found, blocks.signature([paper.word("forms.signed")])]


def _code(survey):
    return survey.replace("-", "_")


def _columns(table):
    return [
        field
        for field in COLUMNS[table]
        if field.name not in IN_THE_OFFICE and not field.name.endswith(OTHER_UNITS)
    ]


def _column(texts, field):
    heading, (_, unit) = texts.heading(field), parted(field.name)
    if field.name.removesuffix(UNIT_OF_CIRCLE) in ("direction", "zenith", "angle"):
        unit = ""  # as the circle shows it
    return heading, unit, WIDE.get(field.kind, 1.0)
