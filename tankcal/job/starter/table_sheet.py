"""Sheet of one table: explanations and examples above and below the row of headings."""

from xlsxwriter.utility import xl_rowcol_to_cell

from tankcal.job.contract import columns_of
from tankcal.job.starter.examples import EXAMPLES_OF_TABLES
from tankcal.job.starter.look import LINE_PT, YELLOW, lines_of, opened, print_on_a4, type_of_cell
from tankcal.job.starter.texts import is_number, split_unit
from tankcal.job.starter.validation import rule_of

MARK = "#"  # in the first cell of a row that is not read
TITLE, NOTE, RULE, NOTES, LABELS, UNITS, CODES, FIRST_EXAMPLE = range(8)
LAST_ROW = 1_048_575  # last row in Excel, counted from 0
_MARK_WIDTH = 6  # width of the column of marks, characters
_RULED_ROWS = 20  # number of ruled rows of an empty table
_PORTRAIT_WIDTH, _LANDSCAPE_WIDTH = 95, 180  # widest sheets of a page, characters


def write_table(sheet, table, form, texts, look):
    """Write the empty sheet of a table.

    Parameters
    ----------
    sheet : xlsxwriter worksheet
        Sheet to be written.
    table : str
        Name of the table.
    form : Form
        Kind of tank and of survey.
    texts : Texts
        Texts of the language.
    look : Look
        Formats.
    """
    fields = columns_of(table, form.kind)
    examples = EXAMPLES_OF_TABLES[table]
    first_row = FIRST_EXAMPLE + len(examples)
    widths = _widths(fields, [texts.note("columns", table, field) for field in fields])
    for row in range(FIRST_EXAMPLE):
        if row != CODES:
            sheet.write_string(row, 0, MARK, look.mark)
    sheet.set_column(0, 0, _MARK_WIDTH)
    sheet.write_string(TITLE, 1, texts.of("titles", table), look.title)
    sheet.write_string(NOTE, 1, opened(texts.note("tables", table)), look.plain)
    sheet.write_string(RULE, 1, texts.of("cover", "rows", row=first_row + 1), look.mark)
    for column, (field, width) in enumerate(zip(fields, widths, strict=True), 1):
        _write_heading(sheet, column, table, field, texts, look)
        sheet.set_column(column, column, width, look.column(type_of_cell(field)))
        cell = xl_rowcol_to_cell(first_row, column)
        rule = rule_of(field, form.choices(table, field), cell, texts)
        if rule is not None:
            sheet.data_validation(first_row, column, LAST_ROW, column, rule)
    heights = [
        lines_of(texts.note("columns", table, field), width)
        for field, width in zip(fields, widths, strict=True)
    ]
    sheet.set_row(NOTES, LINE_PT * max(heights) + 2)
    _write_examples(sheet, fields, examples, texts, look)
    given = form.rows(table)
    for row, values in enumerate(given, first_row):
        _write_row(sheet, row, fields, values, look)
    for row in range(first_row + len(given), first_row + max(len(given), _RULED_ROWS)):
        for column, field in enumerate(fields, 1):
            sheet.write_blank(row, column, None, look.row(type_of_cell(field)))
    sheet.freeze_panes(CODES + 1, 2)
    sheet.repeat_rows(LABELS, CODES)
    sheet.repeat_columns(0, 2)
    print_on_a4(sheet, texts, sum(widths) > _PORTRAIT_WIDTH)


def _widths(fields, notes):
    """Widths of the columns, characters: larger for a long note, limited by the page."""
    least = [max(12, len(field.name) + 1) for field in fields]
    wished = [min(34, 9 + len(note) / 6) for note in notes]
    share = min(1.0, _LANDSCAPE_WIDTH / sum(map(max, least, wished)))
    return [max(minimum, share * wish) for minimum, wish in zip(least, wished, strict=True)]


def _write_heading(sheet, column, table, field, texts, look):
    is_needed = field.required
    heading = look.required if is_needed else look.optional
    sheet.write_string(NOTES, column, texts.note("columns", table, field), look.note)
    sheet.write_string(LABELS, column, texts.heading(field), heading)
    sheet.write_string(UNITS, column, split_unit(field.name)[1], look.unit)
    sheet.write_string(CODES, column, field.name, look.code_heading)


def _write_row(sheet, row, fields, values, look):
    """Write the initial values of a row; required cells without a value are coloured."""
    for column, field in enumerate(fields, 1):
        text, kind = values.get(field.name, ""), type_of_cell(field)
        if not text:
            colour = {"bg_color": YELLOW} if field.required else {}
            sheet.write_blank(row, column, None, look.row(kind, **colour))
        elif kind == "number" and is_number(text):
            sheet.write_number(row, column, float(text), look.row(kind))
        else:
            sheet.write_string(row, column, text, look.row(kind))


def _write_examples(sheet, fields, examples, texts, look):
    grey = look.example()
    for row, example in enumerate(examples, FIRST_EXAMPLE):
        sheet.write_string(row, 0, f"{MARK} {texts.of('cover', 'example')}", look.mark)
        for column, field in enumerate(fields, 1):
            value = texts.example(field, example.get(field.name))
            if isinstance(value, str):
                sheet.write_string(row, column, value, grey)
            elif value is not None:
                sheet.write_number(row, column, value, grey)
