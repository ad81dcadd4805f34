"""The sheets that explain: the cover, and the inputs of uncertainty that may be declared."""

from tankcal.job.sheets import SETTINGS_SHEET
from tankcal.job.starter.look import LINE_PT, lines_of, print_on_a4
from tankcal.job.tables import REGISTERS

_WIDTHS = (4, 22, 78)


def write_cover(sheet, form, texts, look):
    """Write how the workbook is filled in, what the colours say, and a list of its sheets."""
    for column, width in enumerate(_WIDTHS):
        sheet.set_column(column, column, width)
    sheet.hide_gridlines(2)
    sheet.write_string(0, 1, texts.of("cover", "title"), look.title)
    sheet.write_string(1, 1, texts.words["kinds"][form.kind], look.bold)
    row = 3
    for number, code in enumerate(_steps(form), 1):
        text = texts.of("steps", code)
        sheet.write_string(row, 0, f"{number}.", look.wrapped)
        sheet.merge_range(row, 1, row, 2, text, look.wrapped)
        sheet.set_row(row, LINE_PT * 1.1 * lines_of(text, sum(_WIDTHS[1:]) * 0.8) + 4)
        row += 1
    row = _write_legend(sheet, row + 1, texts, look)
    _write_contents(sheet, row + 1, form, texts, look)
    print_on_a4(sheet, texts)


def _steps(form):
    names = ("names",) if form.registers else ()
    return ("settings", "tables", *names, "examples", "numbers", "codes", "run", "mistakes")


def _write_legend(sheet, row, texts, look):
    sheet.write_string(row, 1, texts.of("cover", "legend"), look.bold)
    samples = {
        "fill_in": look.cell("text", is_to_fill_in=True),
        "required": look.required,
        "optional": look.optional,
        "example": look.example(),
    }
    for place, (code, sample) in enumerate(samples.items(), row + 1):
        sheet.write_string(place, 1, texts.of("legend", f"{code}_sample"), sample)
        sheet.write_string(place, 2, texts.of("legend", code), look.plain)
    return row + len(samples) + 1


def _write_contents(sheet, row, form, texts, look):
    for column, code in enumerate(("sheet", "what"), 1):
        sheet.write_string(row, column, texts.of("cover", code), look.optional)
    for name in (SETTINGS_SHEET, *form.registers, *form.tables):
        row += 1
        said = texts.of("titles", name)
        if name != SETTINGS_SHEET:
            group = "registers" if name in REGISTERS else "tables"
            said = f"{said}: {texts.note(group, name)}"
        sheet.write_url(row, 1, f"internal:'{name}'!A1", look.link, name)
        sheet.write_string(row, 2, said, look.wrapped)
        sheet.set_row(row, LINE_PT * 1.1 * lines_of(said, _WIDTHS[2] * 0.85) + 3)


def write_inputs(sheet, form, texts, look):
    """Write the list of the inputs of uncertainty of this kind of tank, with their units."""
    for column, width in enumerate((22, 58, 10, 24)):
        sheet.set_column(column, column, width)
    sheet.write_string(0, 0, texts.of("cover", "inputs"), look.title)
    sheet.write_string(1, 0, texts.of("cover", "inputs_note"), look.plain)
    for column, code in enumerate(("input", "what", "unit", "assumed")):
        sheet.write_string(3, column, texts.of("inputs", code), look.optional)
    for row, (name, one) in enumerate(form.inputs.items(), 4):
        code = "deadwood_share" if name == "deadwood" else name
        sheet.write_string(row, 0, name, look.code)
        sheet.write_string(row, 1, texts.words["inputs"][code], look.wrapped)
        sheet.write_string(row, 2, one.unit, look.unit)
        sheet.write_string(row, 3, texts.assumption(one), look.plain)
    sheet.freeze_panes(4, 0)
    print_on_a4(sheet, texts)
