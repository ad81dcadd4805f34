"""The working papers: courses, corrections, points, uncertainty budget, choices and provenance."""

from tankcal.uncertainty import decimals_for
from tankcal.words import choice_sentence, input_name, sentence
from tankcal.workbook.book import Column, in_mm

_HEAD_ROW = 3


def _of(rows, key):
    """The values of one key, row by row."""
    return [row[key] for row in rows]


def _digits(rows, key, default=4):
    """Decimals of each row by its standard uncertainty `key`."""
    return [decimals_for(row[key]) if row[key] else default for row in rows]


def _digits_of_size(rows, key, significant=4):
    """Decimals of each row so that its value `key` has so many significant digits."""
    return [decimals_for(abs(row[key]), significant) if row[key] else 0 for row in rows]


def _write_table(book, sheet, row, name, columns, **more):
    """A table, or the word None where it has no rows; returns the number of its last row."""
    if columns[0].cells:
        return book.table(sheet, row, name, columns, **more)
    book.put(sheet, row, 0, "None.")
    return row


def _set_widths(book, sheet, *tables):
    """Each column as wide as the widest column of the tables that share it."""
    most = max(len(columns) for columns in tables)
    book.widths(
        sheet,
        *(
            max(columns[place].width for columns in tables if place < len(columns))
            for place in range(most)
        ),
    )


def courses_sheet(book, record, words):
    """Courses, from the bottom up, and the horizontal sections in them."""
    sheet = book.sheet(
        "Courses and sections",
        "Courses and sections",
        "radii of courses and sections as surveyed; inside values after all corrections",
        landscape=True,
    )
    tables = (
        ("Courses, from the bottom up", "courses", _courses(record["courses"])),
        ("Sections, from the bottom up", "sections", _sections(record["sections"])),
        ("Form of the sections: amplitudes", "modes", _modes(record["sections"])),
    )
    _set_widths(book, sheet, *(columns for _, _, columns in tables))
    row = 3
    for title, name, columns in tables:
        book.heading(sheet, row, title, len(columns))
        row = _write_table(book, sheet, row + 1, name, columns) + 2
    _shell(book, sheet, row, record["shell"])


def _courses(rows):
    radius, area, volume = (_digits(rows, key) for key in ("radius_sd_m", "area_sd_m2", "u_m3"))
    return [
        Column("Course", _of(rows, "course"), None, 9),
        Column("Bottom (m)", _of(rows, "bottom_m"), 3, 10),
        Column("Top (m)", _of(rows, "top_m"), 3, 10),
        Column("Plate (mm)", [in_mm(row["thickness_m"]) for row in rows], 2, 10),
        Column("Paint (mm)", [in_mm(row["paint_m"]) for row in rows], 2, 10),
        Column("Points used", _of(rows, "points"), 0, 10),
        Column("Points rejected", _of(rows, "rejected"), 0, 10),
        Column("Radius (m)", _of(rows, "radius_m"), radius, 10),
        Column("u of radius (mm)", [in_mm(row["radius_sd_m"]) for row in rows], 2, 12),
        Column("Inside radius (m)", _of(rows, "inside_radius_m"), radius, 10),
        Column("Inside area (m²)", _of(rows, "area_m2"), area, 11),
        Column("u of area (m²)", _of(rows, "area_sd_m2"), area, 10),
        Column("Volume (m³)", _of(rows, "volume_m3"), volume, 11),
        Column("u of volume (m³)", _of(rows, "u_m3"), volume, 11),
    ]


def _sections(rows):
    radius, area = _digits(rows, "radius_sd_m"), _digits(rows, "area_sd_m2")
    return [
        Column("Section", _of(rows, "section"), None, 9),
        Column("Course", _of(rows, "course"), None, 9),
        Column("Height (m)", _of(rows, "height_m"), 3, 10),
        Column("Points", _of(rows, "n"), 0, 9),
        Column("Centre x (m)", _of(rows, "x_m"), _digits(rows, "x_sd_m"), 12),
        Column("Centre y (m)", _of(rows, "y_m"), _digits(rows, "y_sd_m"), 16),
        Column("u of x (mm)", [in_mm(row["x_sd_m"]) for row in rows], 2, 10),
        Column("u of y (mm)", [in_mm(row["y_sd_m"]) for row in rows], 2, 10),
        Column("Radius (m)", _of(rows, "radius_m"), radius, 10),
        Column("u of radius (mm)", [in_mm(row["radius_sd_m"]) for row in rows], 2, 12),
        Column("Area (m²)", _of(rows, "area_m2"), area, 11),
        Column("u of area (m²)", _of(rows, "area_sd_m2"), area, 10),
        Column("Variance factor", _of(rows, "variance_factor"), 2, 10),
        Column("Shape", _of(rows, "shape"), None, 13),
    ]


def _modes(rows):
    """Amplitudes of the form of each section: mode 2 is the ellipse, mode 3 has three lobes."""
    columns = [Column("Section", _of(rows, "section"), None, 9)]
    for order in sorted({mode["k"] for row in rows for mode in row["modes"]}):
        amplitude = [
            next((in_mm(mode["amplitude_m"]) for mode in row["modes"] if mode["k"] == order), None)
            for row in rows
        ]
        columns.append(Column(f"Mode {order} (mm)", amplitude, 1, 9))
    return columns


def _shell(book, sheet, row, shell):
    """The wall as one body, a line each."""
    book.heading(sheet, row, "Shell as one body", 6)
    for label, value, shown in (
        ("Height along the vertical (m)", shell["height_m"], "0.000"),
        ("Tilt of the axis (mm/m)", in_mm(shell["tilt"]), "0.00"),
        ("u of the tilt (mm/m)", in_mm(shell["tilt_sd"]), "0.00"),
        ("Azimuth of the tilt (°)", shell["tilt_azimuth_deg"], "0.0"),
        ("Residual standard deviation (mm)", in_mm(shell["residual_sd_m"]), "0.00"),
    ):
        row += 1
        book.put(sheet, row, 0, label)
        book.put(sheet, row, 4, value, num_format=shown)


def corrections_sheet(book, record, words):
    """Corrections with their size at the top of the table, from the surveyed shell to the net."""
    rows = record["corrections"]
    sheet = book.sheet(
        "Corrections", "Corrections", "sizes at the top row of the table", landscape=True
    )
    u_top = record["capacity"]["u_m3"][-1]
    digits = decimals_for(u_top) + 1
    columns = [
        Column(
            "Correction", [sentence(words, "corrections", row["code"]) for row in rows], None, 46
        ),
        Column("Applied", _of(rows, "applied"), None, 9),
        Column("Size (m³)", _of(rows, "size_m3"), digits, 12),
        Column("Size (%)", _of(rows, "size_percent"), 4, 10),
        Column("Formula", _of(rows, "formula"), None, 34),
        Column("Source", _of(rows, "source"), None, 30),
    ]
    _set_widths(book, sheet, columns)
    last = _write_table(book, sheet, _HEAD_ROW, "corrections", columns)
    shown = f'0.{"0" * digits} "m³"'
    gross = record["gross"] and record["gross"]["volume_m3"]
    for below, label, value in (
        (2, "Shell as surveyed, full height", gross),
        (3, "Top row of the table", record["capacity"]["volume_m3"][-1]),
    ):
        if value is None:
            continue
        book.put(sheet, last + below, 0, label)
        book.put(sheet, last + below, 2, value, num_format=shown)


def budget_sheet(book, record, words):
    """The uncertainty budget of the top row of the table."""
    rows, capacity = record["budget"], record["capacity"]
    sheet = book.sheet(
        "Uncertainty budget",
        "Uncertainty budget",
        f"volume at {capacity['height_m'][-1]:.3f} m, the top row of the table",
        landscape=True,
    )
    digits = decimals_for(capacity["u_m3"][-1]) + 1
    columns = [
        Column("Input", [input_name(words, row) for row in rows], None, 34),
        Column("u of the input", _of(rows, "u"), _digits(rows, "u"), 12),
        Column("Unit", _of(rows, "unit"), None, 8),
        Column("Type", _of(rows, "type"), None, 7),
        Column("Distribution", _of(rows, "distribution"), None, 14),
        Column(
            "Degrees of freedom", ["∞" if row["dof"] is None else row["dof"] for row in rows], 0, 11
        ),
        Column("Sensitivity", _of(rows, "sensitivity"), _digits_of_size(rows, "sensitivity"), 12),
        Column("Unit of sensitivity", _of(rows, "sensitivity_unit"), None, 12),
        Column("Contribution (m³)", _of(rows, "contribution_m3"), digits, 13),
        Column("Share of variance", _of(rows, "share"), 1, 12, percent=True),
    ]
    _set_widths(book, sheet, columns)
    last = _write_table(book, sheet, _HEAD_ROW, "budget", columns)
    share = len(columns) - 1
    sheet.conditional_format(
        _HEAD_ROW + 1,
        share,
        last,
        share,
        {
            "type": "data_bar",
            "bar_color": "#B8CCE4",
            "bar_solid": True,
            "min_type": "num",
            "min_value": 0,
            "max_type": "num",
            "max_value": 1,
        },
    )
    cubic = f'0.{"0" * (digits - 1)} "m³"' if digits > 1 else '0 "m³"'
    for below, label, key, shown in (
        (2, "Standard uncertainty u", "u_m3", cubic),
        (3, "Coverage factor k", "k", "0.00"),
        (4, "Expanded uncertainty U", "U_m3", cubic),
    ):
        book.put(sheet, last + below, 0, label, bold=True)
        book.put(sheet, last + below, 1, capacity[key][-1], num_format=shown, bold=True)
    sheet.freeze_panes(_HEAD_ROW + 1, 0)


def provenance_sheet(book, record, words):
    """What was assumed, what was warned of, and from which files by which versions."""
    sheet = book.sheet("Choices and provenance", "Choices and provenance")
    choices = record["choices"]
    tables = (
        (
            "Choices: everything that was assumed",
            "choices",
            [
                Column("Code", _of(choices, "code"), None, 24),
                Column("Value", [_text(row["value"]) for row in choices], None, 24),
                Column(
                    "Meaning",
                    [choice_sentence(words, row) for row in choices],
                    None,
                    90,
                ),
            ],
        ),
        (
            "Warnings: what did not stop the job but should be read",
            "warnings",
            [
                Column("File", _of(record["warnings"], "file"), None, 24),
                Column("Row and column", [_place(row) for row in record["warnings"]], None, 24),
                Column("Warning", _of(record["warnings"], "text"), None, 90),
            ],
        ),
        (
            "Input files",
            "input_files",
            [
                Column("File", _of(record["files"], "file"), None, 24),
                Column("Bytes", _of(record["files"], "bytes"), 0, 24),
                Column("SHA-256", _of(record["files"], "sha256"), None, 90),
            ],
        ),
        (
            "Programs",
            "programs",
            [
                Column("Program", ["tankcal", *record["versions"]], None, 24),
                Column("Version", [record["tankcal"], *record["versions"].values()], None, 24),
            ],
        ),
    )
    _set_widths(book, sheet, *(columns for _, _, columns in tables))
    row = 3
    for title, name, columns in tables:
        book.heading(sheet, row, title, 3)
        row = _write_table(book, sheet, row + 1, name, columns) + 2


def _text(value):
    """A choice's value as text: a list by its items, a number in full."""
    if isinstance(value, list | tuple):
        return ", ".join(str(item) for item in value)
    return "" if value is None else str(value)


def _place(warning):
    """Row and column of a warning, as far as they are known."""
    row = f"row {warning['row']}" if warning["row"] is not None else None
    return ", ".join(part for part in (row, warning["column"]) if part)
