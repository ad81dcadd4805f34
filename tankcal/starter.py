"""The starter job of `tankcal new`: an empty form, as a folder of text files and as a workbook.

Both are written from the lists of `tankcal.job.contract`, so that they name every key and column.
"""

from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.job.contract import COLUMNS, INPUTS, KEYS, TABLES_OF_KIND
from tankcal.job.sheets import README_SHEET, SETTINGS_HEADINGS, SETTINGS_SHEET
from tankcal.job.tables import SETTINGS_FILE

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
    "adjustment": "how bad points are treated",
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
}
README_LINES = (
    "A tankcal job as a workbook: one sheet for the settings, one for each table.",
    "Sheet job: fill in every row whose note begins with FILL IN. Leave what you do not know.",
    "Run: tankcal run job.xlsx",
    "Hold the pointer over a heading to read what the column is. Units stand in the headings.",
    "Columns with optional headings may stay blank.",
    "Rows that begin with # are comments. This sheet, and any sheet whose name begins with #,"
    " is not read.",
    "The same job as a folder of text files stands beside this file; use one of the two.",
)
_LAST_ROW_WITH_LIST = 100


def write_starter(directory, kind="vertical"):
    """Write the starter job of a kind of tank into `directory`, made when it does not exist.

    kind  "vertical", "horizontal", "sphere" or "mesh"; only what it can use is written

    Raises InputError when the directory holds something already or cannot be written, ValueError
    for another kind.
    """
    if kind not in TABLES_OF_KIND:
        raise ValueError(f"found {kind!r}; expected one of {', '.join(TABLES_OF_KIND)}")
    directory = Path(directory)
    try:
        if directory.exists() and (not directory.is_dir() or any(directory.iterdir())):
            found = "is not empty" if directory.is_dir() else "is a file"
            raise InputError(Problem(directory.name, f"{found}; expected a new or empty directory"))
        directory.mkdir(parents=True, exist_ok=True)
        (directory / SETTINGS_FILE).write_text(_toml(kind), encoding="utf-8")
        for table in TABLES_OF_KIND[kind]:
            (directory / f"{table}.csv").write_text(_csv(table, kind), encoding="utf-8")
        _write_workbook(directory / WORKBOOK_FILE, kind)
    except OSError as error:
        reason = f"cannot be written ({error.strerror})"
        raise InputError(Problem(directory.name, reason)) from error


def _keys_of(kind):
    """{section: its fields} of the kind of tank; sections without any are left out."""
    suiting = {
        section: [field for field in fields if field.suits(kind)]
        for section, fields in KEYS.items()
    }
    return {section: fields for section, fields in suiting.items() if fields}


def _start(field, kind):
    return kind if field.name == "kind" else field.start


def _toml(kind):
    tables = [f"{table}.csv" for table in TABLES_OF_KIND[kind]]
    lines = [
        "# A tankcal job. Fill in every line marked FILL IN; leave the others or fill them in.",
        '# "" is a blank. Numbers stand without quotation marks: nominal_diameter_m = 13.0',
        f"# The units stand in the names. Then fill in {', '.join(tables)}",
        "# (each says what it is for, and which may stay empty), and run:",
        "#     tankcal run .",
    ]
    for section, fields in _keys_of(kind).items():
        lines += ["", f"# {SECTION_NOTES[section]}", f"[{section}]"]
        for field in fields:
            start = _start(field, kind)
            value = start if field.kind == "number" and start else f'"{start}"'
            lines.append(f"{f'{field.name} = {value}':<32} # {_note(field, kind)}")
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


def _write_workbook(path, kind):
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
        tables = [f"Sheet {table}: {TABLE_NOTES[table]}." for table in TABLES_OF_KIND[kind]]
        for row, line in enumerate((*README_LINES[:2], *tables, *README_LINES[2:])):
            readme.write_string(row, 0, line, formats["bold"] if row == 0 else None)
        _write_settings(book.add_worksheet(SETTINGS_SHEET), kind, formats)
        for table in TABLES_OF_KIND[kind]:
            _write_table(book.add_worksheet(table), table, formats)


def _write_settings(sheet, kind, formats):
    sheet.set_column(0, 1, 26)
    sheet.set_column(2, 2, 32)
    sheet.set_column(3, 3, 90)
    sheet.freeze_panes(1, 0)
    for column, heading in enumerate(SETTINGS_HEADINGS):
        sheet.write_string(0, column, heading, formats["bold"])
    row = 0
    for section, fields in _keys_of(kind).items():
        if section == "csv":  # of no use in a workbook
            continue
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
    if choices:
        rule = {"validate": "list", "source": list(choices), "ignore_blank": True}
        sheet.data_validation(first_row, column, last_row, column, rule)
