"""The starter job of `tankcal new`: an empty form, as a folder of text files and as a workbook.

Both are written from the lists of `tankcal.job.contract`, so that they name every key and column.
"""

from dataclasses import dataclass
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.job.contract import (
    COLUMNS,
    INPUTS,
    KEYS,
    OF_PHOTOS,
    REGISTER_KEYS,
    REGISTERS_OF_SURVEY,
    SURVEYS,
    TABLES_OF_KIND,
)
from tankcal.job.sheets import README_SHEET, SETTINGS_HEADINGS, SETTINGS_SHEET
from tankcal.job.tables import REGISTERS, SETTINGS_FILE

WORKBOOK_FILE = "job.xlsx"
SECTION_NOTES = {
    "tank": "the tank, as in the drawing; the texts are printed when given",
    "survey": "how and when the tank was surveyed",
    "datum": "heights, in the frame of the points",
    "table": "what the capacity table is to be; dips count from the table's zero",
    "horizontal": "the cylinder and its ends; sizes as measured, inside or outside (survey.side)",
    "sphere": "the sphere; its size as measured, inside or outside (survey.side)",
    "mesh": "the closed surface of the inside",
    "bottom": "what the bottom is like; see bottom.csv, too",
    "roof": "the floating roof: all of it, or nothing when there is none",
    "corrections": "false switches a correction off, and the report says so",
    "material": "the shell's steel",
    "adjustment": "how bad points are treated, and what holds the frame of a survey",
    "adjustment.camera": "what of the cameras is adjusted: off, camera free, camera weighted,"
    " camera fixed, or the same with block or photo in place of camera",
    "certificate": "printed when given, never invented",
    "csv": "how the CSV files are written; ; and , for a spreadsheet that uses decimal commas",
}
TABLE_NOTES = {
    "points": "one row for each surveyed point of the wall",
    "courses": "one row for each course (ring of plates), from the bottom up",
    "bottom": "one row for each surveyed point of the bottom (x_m, y_m, z_m), or for each level"
    " measured with liquid (level_m, volume_m3); leave it empty for other bottoms",
    "deadwood": "one row for each thing in the tank that takes or gives room; may stay empty",
    "uncertainty": "one row for each uncertainty that the points do not carry themselves",
    "targets": "one row for each target of the wall; may stay empty: the wall is then searched",
    "photos": "one row for each photo; orientations may stay blank, they are found",
    "image_points": "one row for each image of a point; a repeated row is a repeated reading",
    "control": "one row for each point that is known beforehand",
    "check": "one row for each known point that is only compared; may stay empty",
    "setups": "one row for each set-up of an instrument over a station",
    "distances": "one row for each distance read with a tape or between two points; may stay empty",
    "slope_distances": "one row for each distance measured from a set-up",
    "directions": "one row for each direction read on the horizontal circle",
    "zenith_angles": "one row for each zenith angle, of both faces the mean",
    "height_differences": "one row for each levelled difference; may stay empty",
    "plumb_lines": "one row for each pair of points on one vertical line; may stay empty",
}
REGISTER_NOTES = {
    "cameras": "one section for each camera; put its name, as in photos.csv, in place of NAME",
    "instruments": "one section for each instrument; put its name in place of NAME; may stay empty",
}
PLACEHOLDER = "NAME"
README_LINES = (
    "A tankcal job as a workbook: one sheet for the settings, one for each table.",
    "Sheet job: fill in every row whose note begins with FILL IN. Leave what you do not know.",
    "Run: tankcal run job.xlsx",
    "Hold the pointer over a heading to read what the column is. Units stand in the headings.",
    "Columns with optional headings may stay blank.",
    "Sheets cameras and instruments: give the rows of each one its name in place of NAME.",
    "Rows that begin with # are comments. This sheet, and any sheet whose name begins with #,"
    " is not read.",
    "The same job as a folder of text files stands beside this file; use one of the two.",
)
_LAST_ROW_WITH_LIST = 100


@dataclass(frozen=True)
class _Form:
    """What a starter has: kind of tank, and kind of survey or None."""

    kind: str
    survey: str | None = None

    @property
    def tables(self):
        """Names of its tables; those of a survey stand in place of the points."""
        of_tank = TABLES_OF_KIND[self.kind]
        if self.survey is None:
            return of_tank
        return (*SURVEYS[self.survey], *(table for table in of_tank if table != "points"))

    @property
    def registers(self):
        """Names of its lists of cameras and instruments."""
        return REGISTERS_OF_SURVEY.get(self.survey, ())

    def has(self, section, field):
        """Does it have a key?"""
        if field.of_survey and self.survey is None:
            return False
        of_photos = section == "adjustment.camera" or field.name in OF_PHOTOS
        return field.suits(self.kind) and (self.survey == "photos" or not of_photos)

    @property
    def keys(self):
        """{section: its fields}; sections without any are left out."""
        suiting = {
            section: [field for field in fields if self.has(section, field)]
            for section, fields in KEYS.items()
        }
        return {section: fields for section, fields in suiting.items() if fields}


def write_starter(directory, kind="vertical", survey=None):
    """Write the starter job of a kind of tank into `directory`, made when it does not exist.

    kind    "vertical", "horizontal", "sphere" or "mesh"; only what it can use is written
    survey  "photos" or "total-station": its files in place of the points; None: points

    Raises InputError when the directory holds something already or cannot be written, ValueError
    for another kind, another survey, or a survey of a mesh.
    """
    if kind not in TABLES_OF_KIND:
        raise ValueError(f"found {kind!r}; expected one of {', '.join(TABLES_OF_KIND)}")
    if survey is not None and survey not in SURVEYS:
        raise ValueError(f"found {survey!r}; expected one of {', '.join(SURVEYS)}")
    if survey is not None and "points" not in TABLES_OF_KIND[kind]:
        raise ValueError(f"a tank of kind {kind} has no survey; expected another kind")
    form, directory = _Form(kind, survey), Path(directory)
    try:
        if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
            found = "is not empty" if directory.is_dir() else "is a file"
            raise InputError(Problem(directory.name, f"{found}; expected a new or empty directory"))
        directory.mkdir(parents=True, exist_ok=True)
        (directory / SETTINGS_FILE).write_text(_toml(form), encoding="utf-8")
        for table in form.tables:
            (directory / f"{table}.csv").write_text(_csv(table, kind), encoding="utf-8")
        for register in form.registers:
            text = _register(register)
            (directory / f"{register}.toml").write_text(text, encoding="utf-8")
        _write_workbook(directory / WORKBOOK_FILE, form)
    except OSError as error:
        reason = f"cannot be written ({error.strerror})"
        raise InputError(Problem(directory.name, reason)) from error


def _start(field, kind):
    return kind if field.name == "kind" else field.start


def _toml(form):
    kind = form.kind
    tables = [f"{table}.csv" for table in form.tables]
    tables += [f"{register}.toml" for register in form.registers]
    lines = [
        "# A tankcal job. Fill in every line marked FILL IN; leave the others or fill them in.",
        '# "" is a blank. Numbers stand without quotation marks: nominal_diameter_m = 13.0',
        f"# The units stand in the names. Then fill in {', '.join(tables)}",
        "# (each says what it is for, and which may stay empty), and run:",
        "#     tankcal run .",
    ]
    for section, fields in form.keys.items():
        lines += ["", f"# {SECTION_NOTES[section]}", f"[{section}]"]
        for field in fields:
            start = _start(field, kind)
            value = start if field.kind == "number" and start else f'"{start}"'
            lines.append(f"{f'{field.name} = {value}':<32} # {_note(field, kind)}")
    return "\n".join(lines) + "\n"


def _register(register):
    """cameras.toml or instruments.toml: one empty entry."""
    lines = [f"# {REGISTER_NOTES[register]}", "", f"[{register}.{PLACEHOLDER}]"]
    for field in REGISTER_KEYS[register]:
        lines.append(f"{f'{field.name} = {chr(34) * 2}':<32} # {_note(field, None)}")
    return "\n".join(lines) + "\n"


def _note(field, kind):
    is_blank = field.is_required(kind) and not _start(field, kind)
    choices = ""
    if field.kind == "choice" and is_blank:
        choices = f" ({field.expectation()})"
    return f"{'FILL IN: ' if is_blank else ''}{field.note}{choices}"


def _csv(table, kind):
    lines = [f"# {TABLE_NOTES[table]}; lines that begin with # are comments"]
    for field in COLUMNS[table]:
        required = "" if field.required else " [may be blank]"
        lines.append(f"# {field.name}: {field.note}{required}")
    if table == "uncertainty":
        lines += [f"# {name}: {one.note}" for name, one in INPUTS.items() if kind in one.kinds]
    return "\n".join([*lines, ",".join(field.name for field in COLUMNS[table])]) + "\n"


def _write_workbook(path, form):
    import xlsxwriter

    with xlsxwriter.Workbook(path) as book:
        formats = {
            "bold": book.add_format({"bold": True}),
            "text": book.add_format({"num_format": "@"}),
            "date": book.add_format({"num_format": "yyyy-mm-dd"}),
            "number": book.add_format(),
            "fill in": book.add_format({"bg_color": "#FFF2CC", "border": 1}),
            "fill in text": book.add_format(
                {"bg_color": "#FFF2CC", "border": 1, "num_format": "@"}
            ),
            "fill in date": book.add_format(
                {"bg_color": "#FFF2CC", "border": 1, "num_format": "yyyy-mm-dd"}
            ),
        }
        readme = book.add_worksheet(README_SHEET)
        readme.set_column(0, 0, 100)
        tables = [f"Sheet {table}: {TABLE_NOTES[table]}." for table in form.tables]
        if not form.registers:
            lines = [line for line in README_LINES if "cameras" not in line]
        else:
            lines = README_LINES
        for row, line in enumerate((*lines[:2], *tables, *lines[2:])):
            readme.write_string(row, 0, line, formats["bold"] if row == 0 else None)
        keys = {section: fields for section, fields in form.keys.items() if section != "csv"}
        _write_settings(book.add_worksheet(SETTINGS_SHEET), "section", keys, form.kind, formats)
        for register in form.registers:
            keys = {PLACEHOLDER: REGISTER_KEYS[register]}
            sheet = book.add_worksheet(register)
            _write_settings(sheet, REGISTERS[register], keys, None, formats)
        for table in form.tables:
            _write_table(book.add_worksheet(table), table, formats)


def _write_settings(sheet, owner, keys, kind, formats):
    """A sheet of settings; owner: heading of its first column; keys: {section: its fields}."""
    sheet.set_column(0, 1, 26)
    sheet.set_column(2, 2, 32)
    sheet.set_column(3, 3, 90)
    sheet.freeze_panes(1, 0)
    for column, heading in enumerate((owner, *SETTINGS_HEADINGS[1:])):
        sheet.write_string(0, column, heading, formats["bold"])
    row = 0
    for section, fields in keys.items():
        for field in fields:
            row += 1
            sheet.write_string(row, 0, section)
            sheet.write_string(row, 1, field.name)
            sheet.write_string(row, 3, _note(field, kind))
            _write_start(sheet, row, field, kind, formats)
            _offer_choices(sheet, row, row, 2, field)


def _write_start(sheet, row, field, kind, formats):
    """The value the starter has, in a cell whose format keeps what will be typed there."""
    start, column = _start(field, kind), 2
    cell = {"number": "number", "flag": "number", "date": "date"}.get(field.kind, "text")
    if field.is_required(kind) and not start:
        cell = "fill in" if cell == "number" else f"fill in {cell}"
    if not start:
        sheet.write_blank(row, column, None, formats[cell])
    elif field.kind == "number":
        sheet.write_number(row, column, float(start), formats[cell])
    else:
        sheet.write_string(row, column, start, formats[cell])


def _write_table(sheet, table, formats):
    fields = COLUMNS[table]
    sheet.freeze_panes(1, 0)
    for column, field in enumerate(fields):
        kind = "number" if field.kind == "number" else "text"
        sheet.set_column(column, column, 18, formats[kind])  # text: 1-2 stays a name, not a date
        sheet.write_string(0, column, field.name, formats["bold"])
        required = "" if field.required else " May be blank."
        first = f"{TABLE_NOTES[table]}. " if column == 0 else ""
        sheet.write_comment(0, column, f"{first}{field.note}.{required}")
        _offer_choices(sheet, 1, _LAST_ROW_WITH_LIST, column, field)


def _offer_choices(sheet, first_row, last_row, column, field):
    choices = ("true", "false") if field.kind == "flag" else field.choices
    if choices and field.kind != "number":
        rule = {"validate": "list", "source": list(choices), "ignore_blank": True}
        sheet.data_validation(first_row, column, last_row, column, rule)
