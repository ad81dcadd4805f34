"""The starter job of `tankcal new`: an empty form, as a folder of text files and as a workbook.

Both are written from the lists of `tankcal.job.contract`, so that they name every key and column.
"""

from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.job.contract import COLUMNS, INPUT_UNITS, KEYS
from tankcal.job.sheets import README_SHEET, SETTINGS_HEADINGS, SETTINGS_SHEET
from tankcal.job.tables import SETTINGS_FILE

WORKBOOK_FILE = "job.xlsx"
SECTION_NOTES = {
    "tank": "the tank, as in the drawing; the texts are printed when given",
    "survey": "how and when the wall was surveyed",
    "datum": "heights, in the frame of the points",
    "table": "what the capacity table is to be",
    "material": "the shell's steel",
    "adjustment": "how bad points are treated",
    "certificate": "printed when given, never invented",
    "csv": "how the CSV files are written; ; and , for a spreadsheet that uses decimal commas",
}
TABLE_NOTES = {
    "points": "one row for each surveyed point of the wall",
    "courses": "one row for each course (ring of plates), from the bottom up",
    "uncertainty": "one row for each uncertainty that the points do not carry themselves",
}
README_LINES = (
    "A tankcal job as a workbook: one sheet for the settings, one for each table.",
    "1. Sheet job: fill in every row whose note begins with FILL IN. Leave what you do not know.",
    "2. Sheet points: paste the surveyed points. Columns with optional headings may stay blank.",
    "3. Sheet courses: one row for each course, from the bottom up.",
    "4. Sheet uncertainty: what else is uncertain. It may stay empty.",
    "5. Run: tankcal run job.xlsx",
    "Hold the pointer over a heading to read what the column is. Units stand in the headings.",
    "Rows that begin with # are comments. This sheet, and any sheet whose name begins with #,"
    " is not read.",
    "The same job as a folder of text files stands beside this file; use one of the two.",
)
_LAST_ROW_WITH_LIST = 100


def write_starter(directory):
    """Write the starter job into `directory`, made when it does not exist.

    Raises InputError when the directory holds something already or cannot be written.
    """
    directory = Path(directory)
    try:
        if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
            found = "is not empty" if directory.is_dir() else "is a file"
            raise InputError(Problem(directory.name, f"{found}; expected a new or empty directory"))
        directory.mkdir(parents=True, exist_ok=True)
        (directory / SETTINGS_FILE).write_text(_toml(), encoding="utf-8")
        for table in COLUMNS:
            (directory / f"{table}.csv").write_text(_csv(table), encoding="utf-8")
        _write_workbook(directory / WORKBOOK_FILE)
    except OSError as error:
        reason = f"cannot be written ({error.strerror})"
        raise InputError(Problem(directory.name, reason)) from error


def _toml():
    lines = [
        "# A tankcal job. Fill in every line marked FILL IN; leave the others or fill them in.",
        '# "" is a blank. Numbers stand without quotation marks: nominal_diameter_m = 13.0',
        "# The units stand in the names. Then fill in points.csv and courses.csv, and run:",
        "#     tankcal run .",
    ]
    for section, fields in KEYS.items():
        lines += ["", f"# {SECTION_NOTES[section]}", f"[{section}]"]
        for field in fields:
            is_bare = field.kind == "number" and field.start
            value = field.start if is_bare else f'"{field.start}"'
            lines.append(f"{f'{field.name} = {value}':<32} # {_note(field)}")
    return "\n".join(lines) + "\n"


def _note(field):
    fill_in = "FILL IN: " if field.required and not field.start else ""
    choices = ""
    if field.kind == "choice" and field.required and not field.start:
        choices = f" ({field.expectation()})"
    return f"{fill_in}{field.note}{choices}"


def _csv(table):
    lines = [f"# {TABLE_NOTES[table]}; lines that begin with # are comments"]
    for field in COLUMNS[table]:
        required = "" if field.required else " [may be blank]"
        lines.append(f"# {field.name}: {field.note}{required}")
    lines += [f"# {name}: {row[3]}" for name, row in INPUT_UNITS.items() if table == "uncertainty"]
    return "\n".join([*lines, ",".join(field.name for field in COLUMNS[table])]) + "\n"


def _write_workbook(path):
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
        for row, line in enumerate(README_LINES):
            readme.write_string(row, 0, line, formats["bold"] if row == 0 else None)
        _write_settings(book.add_worksheet(SETTINGS_SHEET), formats)
        for table, fields in COLUMNS.items():
            _write_table(book.add_worksheet(table), table, fields, formats)


def _write_settings(sheet, formats):
    sheet.set_column(0, 1, 26)
    sheet.set_column(2, 2, 32)
    sheet.set_column(3, 3, 90)
    sheet.freeze_panes(1, 0)
    for column, heading in enumerate(SETTINGS_HEADINGS):
        sheet.write_string(0, column, heading, formats["bold"])
    row = 0
    for section, fields in KEYS.items():
        if section == "csv":  # of no use in a workbook
            continue
        for field in fields:
            row += 1
            sheet.write_string(row, 0, section)
            sheet.write_string(row, 1, field.name)
            sheet.write_string(row, 3, _note(field))
            _write_start(sheet, row, 2, field, formats)
            _offer_choices(sheet, row, row, 2, field)


def _write_start(sheet, row, column, field, formats):
    """The value the starter has, in a cell whose format keeps what will be typed there."""
    kind = {"number": "number", "flag": "number", "date": "date"}.get(field.kind, "text")
    if field.required and not field.start:
        kind = "fill in" if kind == "number" else f"fill in {kind}"
    if not field.start:
        sheet.write_blank(row, column, None, formats[kind])
    elif field.kind == "number":
        sheet.write_number(row, column, float(field.start), formats[kind])
    else:
        sheet.write_string(row, column, field.start, formats[kind])


def _write_table(sheet, table, fields, formats):
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
    if choices:
        rule = {"validate": "list", "source": list(choices), "ignore_blank": True}
        sheet.data_validation(first_row, column, last_row, column, rule)
