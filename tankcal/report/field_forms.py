"""Field sheets of a starter job: empty tables of readings to fill in by hand on site."""

from tankcal.job.contract import columns_of, tables_of_survey
from tankcal.job.starter.texts import split_unit, texts_in
from tankcal.methods.base import Method, methods, methods_for
from tankcal.report import blocks
from tankcal.report.plain import PlainPaper

FILE = "field-sheets.pdf"
# Surveys recorded by hand.
BY_PEN = (*(method.starter for method in methods_for("vertical") if method.field_forms),)
FORMS = (  # input tables of each form, read together, and the number of rows on a sheet
    (("setups",), 9),
    (("stadia",), 6),
    (("directions", "zenith_angles", "slope_distances"), 30),
    *(
        form
        for method in sorted(methods(), key=lambda method: method.comes_last)
        for form in method.field_forms
    ),
)
ROWS_BESIDE = {("tangents", "directions"): 20}  # rows if another form is on the same page
# Surveys with heights of the stations above the bottom.
HEIGHTS_OF = tuple(method.starter for method in methods() if method.needs_station_heights)
ROWS_OF_HEIGHTS = 4  # rows of the form for the heights of stations
IN_THE_OFFICE = (  # columns that are not filled in on site
    *("use", "s_mm", "s_arcsec", "note", "s_dip_mm", "s_volume_l"),
    "flow_m3_h",  # computed from volume and time
)
UNIT_OF_CIRCLE = "_deg"  # column that represents the three columns of an angle
UNITS_OF_CIRCLES = "gon / ° / ° ′ ″"  # the crew strikes out the units that the circle does not show
ANGLES = ("direction", "zenith", "angle")
OTHER_UNITS = ("_gon", "_dms")
WIDE = {"name": 1.5, "text": 2.0}  # widths of columns relative to a column of numbers
FACTS = ("tank", "date", "crew", "weather", "shell_temperature", "instruments", "masters")


def is_filled_by_pen(survey):
    """Return whether field sheets exist for this kind of survey."""
    return survey in BY_PEN


def write_field_sheets(path, survey, language, kind="vertical"):
    """Write the field sheets of a survey as a PDF.

    Parameters
    ----------
    path : Path
        Path of the new file.
    survey : str
        "strapping", "reference-line", "wall-hits", "tangents" or "liquid".
    language : str
        One of `shipped.LANGUAGES`.
    kind : str, optional
        Kind of the tank.
    """
    from tankcal.report.pdf import pdf

    forms = sheets(survey, language, kind)
    path.write_bytes(pdf([block.data for block in forms], path.parent))


def sheets(survey, language, kind="vertical"):
    """Return the blocks of the field sheets.

    Parameters
    ----------
    survey, language, kind
        As in `write_field_sheets`.

    Returns
    -------
    list of Block
    """
    texts = texts_in(language)
    paper = PlainPaper(texts.words)
    title = paper.word("forms.title")
    method = next((method for method in methods_for(kind) if method.starter == survey), Method())
    facts = method.field_facts or FACTS
    shown = [
        blocks.document(
            title=title,
            language=language,
            running=[title, paper.word(f"forms.{_code(survey)}")],
            footer=texts.words["page"]["footer"],
        ),
        blocks.masthead(title, paper.word(f"forms.{_code(survey)}")),
        blocks.key_values([(paper.word(f"forms.{fact}"), " ") for fact in facts]),
        blocks.paragraph(paper.word("forms.how")),
    ]
    shown += method.field_blocks(paper, texts)
    tables = tables_of_survey(kind, survey)
    forms = [(names, rows) for names, rows in FORMS if set(names) <= set(tables)]
    if any(_is_angle(field) for names, _ in forms for field in _columns(names, kind)):
        shown.append(blocks.paragraph(paper.word("forms.angles")))
    for names, rows in forms:
        titles = [texts.words["input"]["titles"][name] for name in names]
        columns = [_column(texts, field) for field in _columns(names, kind)]
        shown.append(blocks.heading("; ".join(titles)))
        if names == method.tables[:1]:
            columns = method.field_columns(paper, columns)
        shown.append(blocks.form(columns, ROWS_BESIDE.get((survey, names[0]), rows)))
        if names == ("setups",) and survey in HEIGHTS_OF:
            shown += _heights(paper, texts)
    return [*shown, blocks.signature([paper.word("forms.signed")])]


def _heights(paper, texts):
    """Form for the heights of stations above the bottom, for z_m of control.csv."""
    columns = [
        (texts.words["input"]["labels"]["station"], "", WIDE["name"]),
        (paper.word("forms.height"), "m", WIDE["name"]),
        (paper.word("forms.how_found"), "", WIDE["text"]),
    ]
    return [
        blocks.heading(paper.word("forms.heights")),
        blocks.paragraph(paper.word("forms.heights_become")),
        blocks.form(columns, ROWS_OF_HEIGHTS),
    ]


def _code(survey):
    return survey.replace("-", "_")


def _columns(tables, kind):
    """Return the columns of tables that share a form, each once; target heights come last."""
    columns = {
        field.name: field
        for table in tables
        for field in columns_of(table, kind)
        if field.name not in IN_THE_OFFICE and not field.name.endswith(OTHER_UNITS)
    }
    return sorted(columns.values(), key=lambda field: field.name == "target_height_m")


def _is_angle(field):
    return field.name.removesuffix(UNIT_OF_CIRCLE) in ANGLES


def _column(texts, field):
    """Return (heading, unit, relative width) of a column."""
    heading, (_, unit) = texts.heading(field), split_unit(field.name)
    if _is_angle(field):
        return heading, UNITS_OF_CIRCLES, WIDE["name"]
    return heading, unit, WIDE.get(field.kind, 1.0)
