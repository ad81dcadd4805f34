"""The working papers: courses, corrections, choices and provenance."""

from tankcal.report.workbook.look import in_mm, number_format, sd_digits, values_of
from tankcal.report.workbook.tables import set_widths, write_table, write_tables
from tankcal.text.digits import decimals_of, decimals_of_rows
from tankcal.text.words import choice_sentence, sentence

_HEAD_ROW = 3


def _digits(rows, key):
    """Decimals of each row by its standard uncertainty `key`."""
    return decimals_of_rows(values_of(rows, key), unknown=4)


def courses_sheet(book, record):
    """Courses, from the bottom up, and the horizontal sections in them."""
    sheet = book.sheet("courses", book.word("texts.courses_subtitle"), landscape=True)
    sections = record["sections"]
    tables = [
        (book.word("headings.courses"), "courses", _courses(book, record["courses"])),
        (book.word("headings.sections"), "sections", _sections(book, sections)),
        (book.word("headings.modes"), "modes", _modes(book, sections)),
        (book.word("headings.shell"), "shell", _shell(book, record["shell"])),
    ]
    write_tables(book, sheet, _HEAD_ROW, tables)


def _courses(book, rows):
    radius, area, volume = (_digits(rows, key) for key in ("radius_sd_m", "area_sd_m2", "u_m3"))
    radius_sd = values_of(rows, "radius_sd_m", 1e3)
    return [
        book.column("course", values_of(rows, "course"), None, 9),
        book.column("bottom_m", values_of(rows, "bottom_m"), 3, 9),
        book.column("top_m", values_of(rows, "top_m"), 3, 9),
        book.column("plate_mm", values_of(rows, "thickness_m", 1e3), 2, 9),
        book.column("paint_mm", values_of(rows, "paint_m", 1e3), 2, 9),
        book.column("points_used", values_of(rows, "points"), 0, 9),
        book.column("points_rejected", values_of(rows, "rejected"), 0, 9),
        book.column("radius_m", values_of(rows, "radius_m"), radius, 10),
        book.column("u_radius_mm", radius_sd, sd_digits(radius_sd), 10),
        book.column("inside_radius_m", values_of(rows, "inside_radius_m"), radius, 10),
        book.column("inside_area_m2", values_of(rows, "area_m2"), area, 11),
        book.column("u_area_m2", values_of(rows, "area_sd_m2"), area, 10),
        book.column("volume_m3", values_of(rows, "volume_m3"), volume, 11),
        book.column("u_volume_m3", values_of(rows, "u_m3"), volume, 11),
    ]


def _sections(book, rows):
    radius, area = _digits(rows, "radius_sd_m"), _digits(rows, "area_sd_m2")
    sds = {key: values_of(rows, f"{key}_sd_m", 1e3) for key in ("x", "y", "radius")}
    shapes = book.words["shapes"]
    return [
        book.column("section", values_of(rows, "section"), None, 9),
        book.column("course", values_of(rows, "course"), None, 9),
        book.column("height_m", values_of(rows, "height_m"), 3, 9),
        book.column("points", values_of(rows, "n"), 0, 9),
        book.column("centre_m", values_of(rows, "x_m"), _digits(rows, "x_sd_m"), 10, axis="x"),
        book.column("centre_m", values_of(rows, "y_m"), _digits(rows, "y_sd_m"), 10, axis="y"),
        book.column("u_of_mm", sds["x"], sd_digits(sds["x"]), 9, axis="x"),
        book.column("u_of_mm", sds["y"], sd_digits(sds["y"]), 9, axis="y"),
        book.column("radius_m", values_of(rows, "radius_m"), radius, 10),
        book.column("u_radius_mm", sds["radius"], sd_digits(sds["radius"]), 10),
        book.column("area_m2", values_of(rows, "area_m2"), area, 11),
        book.column("u_area_m2", values_of(rows, "area_sd_m2"), area, 10),
        book.column("variance_factor", values_of(rows, "variance_factor"), 2, 10),
        book.column("shape", [shapes.get(row["shape"], row["shape"]) for row in rows], None, 13),
    ]


def _modes(book, rows):
    """Amplitudes of the form of each section: mode 2 is the ellipse, mode 3 has three lobes."""
    columns = [book.column("section", values_of(rows, "section"), None, 9)]
    for order in sorted({mode["k"] for row in rows for mode in row["modes"]}):
        amplitude = [
            next((in_mm(mode["amplitude_m"]) for mode in row["modes"] if mode["k"] == order), None)
            for row in rows
        ]
        columns.append(book.column("mode_mm", amplitude, 1, 9, order=order))
    return columns


def _shell(book, shell):
    """The wall as one body: one row."""
    tilt = decimals_of(in_mm(shell["tilt_sd"]))
    return [
        book.column("shell_height_m", [shell["height_m"]], 3),
        book.column("tilt_mm_m", [in_mm(shell["tilt"])], tilt),
        book.column("u_tilt_mm_m", [in_mm(shell["tilt_sd"])], tilt),
        book.column("tilt_azimuth_deg", [shell["tilt_azimuth_deg"]], 1),
        book.column("residual_sd_mm", [in_mm(shell["residual_sd_m"])], 2),
    ]


def corrections_sheet(book, record):
    """Corrections with their size at the top of the table, from the surveyed shell to the net."""
    rows, words = record["corrections"], book.words
    sheet = book.sheet("corrections", book.word("texts.corrections_subtitle"), landscape=True)
    digits = decimals_of(record["capacity"]["u_m3"][-1]) + 1
    names = [sentence(words, "corrections", row["code"]) for row in rows]
    columns = [
        book.column("correction", names, None, 34),
        book.column("applied", values_of(rows, "applied"), None, 10),
        book.column("size_m3", values_of(rows, "size_m3"), digits, 12),
        book.column("size_percent", values_of(rows, "size_percent"), 4, 10),
        book.column("formula", values_of(rows, "formula"), None, 40),
        book.column("source", values_of(rows, "source"), None, 34),
    ]
    set_widths(book, sheet, columns)
    last = write_table(book, sheet, _HEAD_ROW, "corrections", columns)
    shown = number_format(digits, unit="m³")
    gross = record["gross"] and record["gross"]["volume_m3"]
    for below, label, value in (
        (2, "gross_volume", gross),
        (3, "top_row", record["capacity"]["volume_m3"][-1]),
    ):
        if value is None:
            continue
        book.put(sheet, last + below, 0, book.word(f"labels.{label}"))
        book.put(sheet, last + below, 2, value, num_format=shown)


def provenance_sheet(book, record):
    """What was assumed, what was warned of, and from which files by which versions."""
    sheet = book.sheet("provenance", tab="origin")
    files = record["files"]
    tables = [
        (book.word("headings.choices"), "choices", _choices(book, record["choices"])),
        (book.word("headings.warnings"), "warnings", _warnings(book, record["warnings"])),
        (
            book.word("headings.files"),
            "input_files",
            [
                book.column("file", values_of(files, "file"), None, 24),
                book.column("bytes", values_of(files, "bytes"), 0, 24),
                book.column("sha256", values_of(files, "sha256"), None, 80),
            ],
        ),
        (
            book.word("headings.programs"),
            "programs",
            [
                book.column("program", ["tankcal", *record["versions"]], None, 24),
                book.column("version", [record["tankcal"], *record["versions"].values()], None, 24),
            ],
        ),
    ]
    write_tables(book, sheet, _HEAD_ROW, tables)


def _choices(book, choices):
    return [
        book.column("code", values_of(choices, "code"), None, 24),
        book.column("value", [_text(row["value"]) for row in choices], None, 24),
        book.column("meaning", [choice_sentence(book.words, row) for row in choices], None, 80),
    ]


def _warnings(book, warnings):
    return [
        book.column("file", values_of(warnings, "file"), None, 24),
        book.column("place", [_place(book, row) for row in warnings], None, 24),
        book.column("warning", values_of(warnings, "text"), None, 80),
    ]


def _text(value):
    """A choice's value as text: a list by its items, a number in full."""
    if isinstance(value, list | tuple):
        return ", ".join(str(item) for item in value)
    return "" if value is None else str(value)


def _place(book, warning):
    """Row and column of a warning, as far as they are known."""
    row = warning["row"]
    row = None if row is None else book.word("texts.row", row=row)
    return ", ".join(part for part in (row, warning["column"]) if part)
