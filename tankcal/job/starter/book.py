"""Input workbook: a cover, a sheet of settings, and a sheet with examples for each table."""

import datetime
import io
import math
from dataclasses import dataclass

import xlsxwriter
from xlsxwriter.utility import xl_rowcol_to_cell

from tankcal.job.certificate_entries import MARKED
from tankcal.job.contract import columns_of
from tankcal.job.fields import MAX_TEXT, Field
from tankcal.job.sheets import KEY, SECTION, VALUE
from tankcal.job.starter.texts import is_number, is_wide, split_unit, texts_in
from tankcal.job.tables import REGISTERS, SETTINGS_SHEET
from tankcal.methods.base import methods
from tankcal.text.naming import MAX_NAME
from tankcal.text.words import NO, YES

EXAMPLES_OF_KEYS = {
    "tank.id": "T-17",
    "tank.nominal_diameter_m": 13.0,
    "tank.nominal_height_m": 9.5,
    "tank.nominal_volume_m3": 1260.0,
    "tank.year": "1994",
    "survey.date": "2024-05-31",
    "survey.side": "outside",
    "survey.shell_temperature_c": 23.5,
    "survey.liquid_level_m": 1.25,
    "survey.liquid_density_kg_m3": 998.0,
    "datum.bottom_z_m": 0.125,
    "datum.dip_plate_z_m": 0.131,
    "datum.dip_x_m": 4.2,
    "datum.dip_y_m": -1.8,
    "datum.reference_height_m": 10.842,
    "table.step_m": 0.01,
    "table.reference_temperature_c": 20.0,
    "table.liquid_density_kg_m3": 750.0,
    "table.fine_step_m": 0.001,
    "table.fine_zones": "0-0.3; 2.1-2.4",
    "table.other_densities_kg_m3": "700; 850",
    "table.coverage_probability": 0.95,
    "table.rule": "oiml_r71",
    "table.minimum_delivery_m": "1.5; 2",
    "horizontal.diameter_m": 2.4,
    "horizontal.length_m": 10.0,
    "horizontal.end_a": "torispherical",
    "horizontal.end_a_dish_radius_m": 2.4,
    "horizontal.end_a_knuckle_radius_m": 0.24,
    "horizontal.end_b": "ellipsoidal",
    "horizontal.end_b_depth_m": 0.6,
    "horizontal.tilt_mm_per_m": 5.0,
    "horizontal.dip_from_a_m": 5.0,
    "sphere.diameter_m": 20.0,
    "table.pressure_bar": 6.0,
    "survey.pressure_bar": 0.0,
    "material.poisson": 0.3,
    "sphere.ovality_mm": 10.0,
    "sphere.form_mm": 4.0,
    "mesh.file": "tank.stl",
    "mesh.unit": "m",
    "bottom.form": "cone",
    "bottom.centre_z_m": -0.15,
    "roof.mass_kg": 9000.0,
    "roof.critical_bottom_m": 1.0,
    "roof.critical_top_m": 1.3,
    "roof.reference_density_kg_m3": 850.0,
    "roof.weighing": "air",
    "levels.full_m": 9.5,
    "levels.maximum_m": 9.0,
    "levels.minimum_m": 1.0,
    "levels.pump_suction_m": 0.4,
    "material.e_gpa": 206.0,
    "material.expansion_per_k": 1.1e-5,
    "adjustment.datum_points": "P7; P9:xy; P3:z",
    "adjustment.refraction": 0.13,
    "checks.air_temperature_c": 21.0,
    "checks.top_z_m": 9.625,
    "checks.circumference_m": 40.892,
    "checks.length_m": 10.0,
    "inspection.rule": "api_653",
    "inspection.yield_mpa": 250.0,
    "certificate.number": "0123/2024",
    "certificate.date_of_issue": "2024-06-14",
    "cameras.format_mm": "180; 130",
    "cameras.c_mm": 100.12,
    "cameras.convention": "correction_added",
    "instruments.kind": "tape",
    "instruments.certified_temperature_c": 20.0,
    "instruments.u_scale_ppm": 15.0,
}
EXAMPLES_OF_TABLES = {
    "courses": [
        {"course": "1", "height_m": 1.9, "thickness_mm": 8.0, "paint_mm": 0.3},
        {"course": "2", "height_m": 1.9, "thickness_mm": 6.3, "paint_mm": 0.3},
    ],
    "welds": [{"course": "1", "azimuth_deg": 34.5}],
    "bottom": [{"x_m": 1.5, "y_m": -2.0, "z_m": 0.048, "s_mm": 2.0}],
    "deadwood": [
        {"name": "coil", "bottom_m": 0.5, "top_m": 1.0, "volume_m3": -0.2, "u_m3": 0.01},
        {"name": "manhole", "bottom_m": 0.6, "top_m": 1.2, "volume_m3": 0.05},
    ],
    "uncertainty": [
        {"input": "scale", "u": 10.0, "unit": "ppm", "u_is": "expanded", "k": 2.0, "type": "B"},
        {"input": "datum", "u": 1.0, "unit": "mm", "u_is": "standard", "type": "A", "dof": 9},
    ],
    "correlations": [{"input": "scale", "with": "datum", "r": 0.5}],
    "stated": [{"high_m": 9.0, "low_m": 2.0}],
    "overrulings": [
        {
            "point": "P102",
            "decision": "keep",
            "reason": "dent, seen on site and photographed",
            "by": "J. Silva",
            "date": "2026-01-05",
        },
        {
            "table": "directions",
            "row": 14,
            "decision": "leave_out",
            "reason": "the observer noted a bump against the tripod",
        },
    ],
    "stadia": [{"setup": "S1-1", "to": "S2", "bar": "bar 1", "angle_deg": 10.3942, "s_arcsec": 1}],
    "targets": [
        {"point": "P101", "section": "1", "generatrix": "A", "z_m": 0.95, "offset_mm": 0.2}
    ],
    "photos": [{"photo": "F1", "camera": "UMK 10/1318"}],
    "image_points": [
        {"photo": "F1", "point": "P101", "x_mm": -42.1873, "y_mm": 17.0934, "sx_um": 5, "sy_um": 5},
        {"photo": "F1", "point": "P102", "x_mm": -38.5521, "y_mm": 17.1102, "sx_um": 5, "sy_um": 5},
    ],
    "control": [
        {
            "point": "S1",
            "x_m": 12.0,
            "y_m": 9.0,
            "z_m": 0.4,
            "sx_mm": 2.0,
            "sy_mm": 2.0,
            "sz_mm": 1.0,
        }
    ],
    "check": [{"point": "C1", "x_m": 6.5, "y_m": 0.02, "z_m": 2.85}],
    "setups": [{"setup": "S1-1", "station": "S1", "instrument": "TS", "instrument_height_m": 1.55}],
    "distances": [
        {"from": "P101", "to": "P102", "distance_m": 1.677, "s_mm": 1.0, "instrument": "tape 1"}
    ],
    "slope_distances": [{"setup": "S1-1", "to": "P101", "distance_m": 12.4567, "s_mm": 2.0}],
    "directions": [{"setup": "S1-1", "to": "P101", "direction_deg": 123.4567, "s_arcsec": 3}],
    "zenith_angles": [{"setup": "S1-1", "to": "P101", "zenith_deg": 88.1234, "s_arcsec": 3}],
    "height_differences": [{"from": "S1", "to": "P101", "dz_m": 0.5502, "s_mm": 0.5}],
    "plumb_lines": [{"from": "P101", "to": "P201", "s_mm": 1.0}],
    "vectors": [
        {
            "from": "S1",
            "to": "S2",
            "dx_m": 18.4052,
            "dy_m": -9.1127,
            "dz_m": 0.3016,
            "sx_mm": 3.0,
            "sy_mm": 3.0,
            "sz_mm": 6.0,
            "r_xy": -0.12,
            "r_xz": 0.08,
            "r_yz": 0.25,
        }
    ],
    "correlated_readings": [
        {
            "table_1": "control",
            "row_1": 12,
            "value_1": "x",
            "table_2": "control",
            "row_2": 13,
            "value_2": "x",
            "r": 0.6,
        }
    ],
}
for _method in methods():
    EXAMPLES_OF_KEYS |= _method.setting_examples()
    EXAMPLES_OF_TABLES |= _method.examples()


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
    sheet.write_string(NOTE, 1, capitalize(texts.note("tables", table)), look.plain)
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


def capitalize(text):
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
        return _number_validation(field, cell)
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


def _number_validation(field, cell):
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


# Sheets with explanations: the cover, and the inputs of uncertainty.

_WIDTHS = (4, 22, 78)  # columns of the cover, characters


def write_cover(sheet, form, texts, look):
    """Write instructions, a legend of the colours, and a list of the sheets.

    Parameters
    ----------
    sheet : xlsxwriter worksheet
        Sheet to be written.
    form : Form
        Kind of tank and of survey.
    texts : Texts
        Texts of the language.
    look : Look
        Formats.
    """
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
        text = texts.of("titles", name)
        if name != SETTINGS_SHEET:
            group = "registers" if name in REGISTERS else "tables"
            text = f"{text}: {texts.note(group, name)}"
        sheet.write_url(row, 1, f"internal:'{name}'!A1", look.link, name)
        sheet.write_string(row, 2, text, look.wrapped)
        sheet.set_row(row, LINE_PT * 1.1 * lines_of(text, _WIDTHS[2] * 0.85) + 3)


def write_inputs(sheet, form, texts, look):
    """Write the inputs of uncertainty of this kind of tank; parameters as for `write_cover`."""
    for column, width in enumerate((22, 58, 10, 24)):
        sheet.set_column(column, column, width)
    sheet.write_string(0, 0, texts.of("cover", "inputs"), look.title)
    sheet.write_string(1, 0, texts.of("cover", "inputs_note"), look.plain)
    for column, code in enumerate(("input", "what", "unit", "assumed")):
        sheet.write_string(3, column, texts.of("inputs", code), look.optional)
    for row, (name, declarable) in enumerate(form.inputs.items(), 4):
        code = "deadwood_share" if name == "deadwood" else name
        sheet.write_string(row, 0, name, look.code)
        sheet.write_string(row, 1, texts.words["inputs"][code], look.wrapped)
        sheet.write_string(row, 2, declarable.unit, look.unit)
        sheet.write_string(row, 3, texts.assumption(declarable), look.plain)
    sheet.freeze_panes(4, 0)
    print_on_a4(sheet, texts)


_NO_DAY = datetime.datetime(2000, 1, 1)  # constant, so that equal forms give equal files


def book_bytes(form):
    """Empty workbook of a Form, as bytes."""
    texts, data = texts_in(form.language), io.BytesIO()
    with xlsxwriter.Workbook(data) as book:
        book.set_properties({"title": texts.of("cover", "title"), "created": _NO_DAY})
        look = Look(book)
        write_cover(book.add_worksheet(texts.of("cover", "name")), form, texts, look)
        sheet = book.add_worksheet(SETTINGS_SHEET)
        write_settings(sheet, SETTINGS_SHEET, SECTION, _sections(form, texts), texts, look)
        for register in form.registers:
            sheet = book.add_worksheet(register)
            groups = _entries(register, form, texts)
            write_settings(sheet, register, REGISTERS[register], groups, texts, look)
        for table in form.tables:
            write_table(book.add_worksheet(table), table, form, texts, look)
        write_inputs(book.add_worksheet(texts.of("cover", "inputs_name")), form, texts, look)
    return data.getvalue()


def _sections(form, texts):
    """Groups of the sheet job; a workbook needs no marks of CSV files."""
    return [
        Group(
            section,
            f"{texts.of('sections', section)}: {texts.note('sections', section)}",
            tuple(
                Entry(
                    field,
                    texts.note("keys", section, field),
                    form.start(section, field),
                    form.is_to_fill_in(section, field)
                    or (section == "certificate" and field.name in MARKED),
                    EXAMPLES_OF_KEYS.get(f"{section}.{field.name}"),
                )
                for field in fields
            ),
        )
        for section, fields in form.keys.items()
        if section != "csv"
    ]


def _entries(register, form, texts):
    """One group for each entry of a sheet such as cameras."""
    return [
        Group(
            name,
            None,
            tuple(
                Entry(
                    field,
                    texts.note("entries", register, field) if field.note else "",
                    given.get(field.name, ""),
                    field.required and not given.get(field.name),
                    EXAMPLES_OF_KEYS.get(f"{register}.{field.name}"),
                )
                for field in form.fields(register, given)
            ),
        )
        for name, given in form.entries(register).items()
    ]


# ---- sheets of settings: job, cameras and instruments, one row for each key


BOOK_TITLE, BOOK_NOTE, BOOK_RULE, BOOK_LABELS, BOOK_CODES = range(5)
_MARK, _NOTE, _VALUE, _UNIT, _BOOK_EXAMPLE, _OWNER, _KEY = range(7)
_SETTINGS_WIDTHS = {
    _MARK: 3,
    _NOTE: 52,
    _VALUE: 28,
    _UNIT: 8,
    _BOOK_EXAMPLE: 16,
    _OWNER: 17,
    _KEY: 27,
}


@dataclass(frozen=True)
class Entry:
    """One row: a key, its note, its initial value, and an example or None."""

    field: Field
    note: str
    start: str
    is_to_fill_in: bool
    example: object


@dataclass(frozen=True)
class Group:
    """Rows of one section, camera or instrument, below a title or None."""

    owner: str
    title: str | None
    entries: tuple


def write_settings(sheet, name, owner, groups, texts, look):
    """Write an empty sheet of settings.

    Parameters
    ----------
    sheet : xlsxwriter worksheet
        Sheet to be written.
    name : str
        Name of the sheet.
    owner : str
        Heading of the column of sections: "section", "camera" or "instrument".
    groups : sequence of Group
        Rows, from the top down.
    texts : Texts
        Texts of the language.
    look : Look
        Formats.
    """
    for column, width in _SETTINGS_WIDTHS.items():
        sheet.set_column(column, column, width)
    sheet.write_string(BOOK_TITLE, _NOTE, texts.of("titles", name), look.title)
    sheet.write_string(BOOK_NOTE, _NOTE, texts.of("cover", f"{owner}_rows"), look.plain)
    sheet.write_string(BOOK_RULE, _NOTE, texts.of("cover", "settings"), look.mark)
    for row in range(BOOK_CODES):
        sheet.write_string(row, _MARK, MARK, look.mark)
    codes = {_NOTE: "note", _VALUE: VALUE, _UNIT: "unit", _BOOK_EXAMPLE: "example"}
    for column, code in (codes | {_OWNER: owner, _KEY: KEY}).items():
        heading = look.required if column == _VALUE else look.optional
        sheet.write_string(BOOK_LABELS, column, texts.of("settings", code), heading)
        sheet.write_string(BOOK_CODES, column, code, look.code_heading)
    row = BOOK_CODES + 1
    for group in groups:
        if group.title is not None:
            _write_title(sheet, row, group.title, look)
            row += 1
        for entry in group.entries:
            _write_entry(sheet, row, group.owner, entry, texts, look)
            row += 1
    sheet.freeze_panes(BOOK_CODES + 1, 0)
    sheet.repeat_rows(BOOK_LABELS, BOOK_CODES)
    print_on_a4(sheet, texts)


def _write_title(sheet, row, title, look):
    sheet.write_string(row, _MARK, MARK, look.section)
    for column in range(_NOTE, _KEY + 1):
        sheet.write_blank(row, column, None, look.section)
    sheet.write_string(row, _NOTE, title, look.section)


def _write_entry(sheet, row, owner, entry, texts, look):
    field = entry.field
    sheet.write_string(row, _NOTE, entry.note, look.key_note)
    sheet.write_string(row, _UNIT, split_unit(field.name)[1], look.unit)
    sheet.write_string(row, _OWNER, owner, look.code)
    sheet.write_string(row, _KEY, field.name, look.code)
    cell = look.cell(type_of_cell(field), entry.is_to_fill_in)
    _write_start(sheet, row, field, texts.value(field, entry.start), cell)
    _write_example(sheet, row, texts.example(field, entry.example), look)
    rule = rule_of(field, field.choices, xl_rowcol_to_cell(row, _VALUE), texts)
    if rule is not None:
        sheet.data_validation(row, _VALUE, row, _VALUE, rule)
    sheet.set_row(row, max(15.0, LINE_PT * lines_of(entry.note, _SETTINGS_WIDTHS[_NOTE] * 0.9) + 4))


def _write_start(sheet, row, field, start, cell):
    if not start:
        sheet.write_blank(row, _VALUE, None, cell)
    elif field.kind == "number" and is_number(start):
        sheet.write_number(row, _VALUE, float(start), cell)
    else:
        sheet.write_string(row, _VALUE, start, cell)


def _write_example(sheet, row, example, look):
    if isinstance(example, float):
        sheet.write_number(row, _BOOK_EXAMPLE, example, look.example(align="left"))
    elif example is not None and (len(example) == 10 and example[4] == example[7] == "-"):
        day = datetime.date.fromisoformat(example)
        grey = look.example(align="left", num_format="yyyy-mm-dd")
        sheet.write_datetime(row, _BOOK_EXAMPLE, day, grey)
    elif example is not None:
        sheet.write_string(row, _BOOK_EXAMPLE, example, look.example(align="left"))
