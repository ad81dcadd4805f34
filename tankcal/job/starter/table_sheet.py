"""Sheet of one table: explanations and examples above and below the row of headings."""

import datetime
import math

from xlsxwriter.utility import xl_rowcol_to_cell

from tankcal.job.contract import columns_of
from tankcal.job.fields import MAX_TEXT
from tankcal.job.starter.examples import EXAMPLES_OF_TABLES
from tankcal.job.starter.texts import is_number, is_wide, split_unit
from tankcal.text.form_words import NO, YES
from tankcal.text.naming import MAX_NAME

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


# ---- formats of cells, and page layout

DARK, LIGHT, YELLOW, GREY, INK = "#1F4E79", "#DCE6F1", "#FFF2CC", "#7F7F7F", "#404040"
_FONT = {"font_name": "Arial", "font_size": 10}
_EXAMPLE = {"italic": True, "font_color": GREY}
# The text format keeps the name 1-2 from becoming a date.
_NUMBERS = {"text": "@", "date": "yyyy-mm-dd"}
A4 = 9  # code of the page size
LETTERS_TO_LINE = 1.45  # letters of the small font in one unit of column width
LINE_PT = 12.0  # height of a line


class Look:
    """Named formats, each created once."""

    def __init__(self, book):
        self._book, self._made = book, {}
        self.title = self._format(bold=True, font_size=14, font_color=DARK)
        self.section = self._format(bold=True, bg_color=LIGHT, font_color=DARK)
        self.plain = self._format()
        self.wrapped = self._format(text_wrap=True, valign="top")
        self.link = self._format(font_color="#0563C1", underline=1, valign="top")
        self.bold = self._format(bold=True)
        self.mark = self._format(font_color=GREY, font_size=8, valign="top")
        self.note = self._format(
            font_size=8, font_color=INK, text_wrap=True, valign="top", align="left"
        )
        self.key_note = self._format(font_size=9, font_color=INK, text_wrap=True, valign="vcenter")
        self.code = self._format(
            font_name="Courier New", font_size=9, font_color=GREY, valign="vcenter"
        )
        self.required = self._heading(DARK, "#FFFFFF")
        self.optional = self._heading(LIGHT, DARK)
        self.unit = self._format(align="center", valign="vcenter", font_color=DARK)
        self.code_heading = self._format(
            font_name="Courier New", font_size=9, font_color=GREY, bottom=2, align="center"
        )

    def cell(self, kind, is_to_fill_in=False):
        """Format of an input cell; kind is "number", "text" or "date"."""
        given = {"align": "left", "bg_color": YELLOW} if is_to_fill_in else {"align": "left"}
        return self.row(kind, **given)

    def row(self, kind, **more):
        """Format of a ruled cell in the first rows of a table."""
        given = {"border": 1, "border_color": "#BFBFBF", "valign": "vcenter"} | more
        if kind in _NUMBERS:
            given["num_format"] = _NUMBERS[kind]
        return self._format(**given)

    def column(self, kind):
        """Format of a column of values."""
        return self._format(**({"num_format": _NUMBERS[kind]} if kind in _NUMBERS else {}))

    def example(self, **more):
        """Format of an example, which is never read."""
        return self._format(**_EXAMPLE, valign="vcenter", **more)

    def _heading(self, fill, ink):
        return self._format(
            bold=True, bg_color=fill, font_color=ink, align="center", valign="top", text_wrap=True
        )

    def _format(self, **given):
        key = tuple(sorted(given.items()))
        if key not in self._made:
            self._made[key] = self._book.add_format(_FONT | given)
        return self._made[key]


def type_of_cell(field):
    """Cell format for the values of a field: "number", "date" or "text"."""
    return {"number": "number", "flag": "number", "date": "date"}.get(field.kind, "text")


def print_on_a4(sheet, texts, is_landscape=False):
    """Print on A4, one page wide, with the name of the sheet and the page number below."""
    sheet.set_paper(A4)
    if is_landscape:
        sheet.set_landscape()
    sheet.fit_to_pages(1, 0)
    sheet.set_margins(left=0.5, right=0.5, top=0.6, bottom=0.7)
    sheet.set_footer(f"&L&8&A&R&8{texts.of('cover', 'page')}")


def opened(text):
    """Note with a capital letter."""
    return text[:1].upper() + text[1:]


def lines_of(text, width):
    """Number of lines of a text in the small font, in a column of this width."""
    letters, lines, length = width * LETTERS_TO_LINE, 1, 0
    for word in text.split():
        if length and length + 1 + len(word) > letters:
            lines, length = lines + 1, 0
        length += len(word) + (1 if length else 0)
    return lines


# ---- validation rules

LONGEST_LIST = 255  # longest list of choices in Excel, characters
LONGEST_TITLE, LONGEST_MESSAGE = 32, 255  # longest title and message in Excel, characters
_LENGTHS = {
    "name": MAX_NAME,
    "tank id": MAX_NAME,
    "text": MAX_TEXT,
    "rule name": MAX_NAME,
    "mesh file": MAX_NAME,
}
FIRST_DAY, LAST_DAY = datetime.date(1950, 1, 1), datetime.date(2119, 1, 1)


def rule_of(field, choices, cell, texts):
    """Options of XlsxWriter's data_validation; None if the field accepts any text.

    Parameters
    ----------
    field : Field
        Description of the cells.
    choices : sequence of str
        Choices that replace those of the field.
    cell : str
        First cell of the range, such as "C7".
    texts : Texts
        Texts of the language.

    Returns
    -------
    dict or None
    """
    condition = _condition(field, choices, cell, texts)
    if condition is None:
        return None
    return condition | {
        "ignore_blank": True,
        "error_type": "stop",
        "error_title": texts.of("expected", "title")[:LONGEST_TITLE],
        "error_message": texts.expectation(field)[:LONGEST_MESSAGE],
    }


def _condition(field, choices, cell, texts):
    if field.kind == "flag":
        return {"validate": "list", "source": [texts.choice(YES), texts.choice(NO)]}
    if field.kind == "choice":
        listed = [texts.choice(choice) for choice in choices]
        return (
            {"validate": "list", "source": listed}
            if (len(",".join(listed)) <= LONGEST_LIST)
            else None
        )
    if field.kind == "number":
        return _of_number(field, cell)
    if field.kind == "date":
        return {
            "validate": "date",
            "criteria": "between",
            "minimum": FIRST_DAY,
            "maximum": LAST_DAY,
        }
    if field.kind in _LENGTHS:
        return {"validate": "length", "criteria": "<=", "value": _LENGTHS[field.kind]}
    return None


def _of_number(field, cell):
    bounds = {"validate": "decimal", "criteria": "between"}
    if is_wide(field) or (not field.above_low and not field.choices and field.high < math.inf):
        return bounds | {"minimum": field.low, "maximum": field.high}
    parts = [f"ISNUMBER({cell})", f"{cell}{'>' if field.above_low else '>='}{field.low!r}"]
    if field.high < math.inf:
        parts.append(f"{cell}<={field.high!r}")
    formula = f"AND({','.join(parts)})"
    if field.choices:
        words = ",".join(f'{cell}="{word}"' for word in field.choices)
        formula = f"OR({words},IF(ISNUMBER({cell}),{formula},FALSE))"
    return {"validate": "custom", "value": f"={formula}"}
