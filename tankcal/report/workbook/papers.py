"""Sheets of the working papers: courses, surveys, corrections, and provenance."""

from tankcal.report.tables import (
    clouds,
    hits,
    lines,
    liquid,
    ship,
    strapping,
    tangents,
    tank,
)
from tankcal.report.workbook.look import Column, number_format
from tankcal.report.workbook.tables import columns_of, set_widths, write_table, write_tables
from tankcal.text.digits import decimals_of

_HEAD_ROW = 3  # row of the first headings, from 0


def courses_sheet(book, record):
    """Write the courses from the bottom up and their horizontal sections."""
    sheet = book.sheet("courses", book.word("texts.courses_subtitle"), landscape=True)
    tables = [(book.word("headings.courses"), "courses", columns_of(book, tank.COURSES))]
    if record["sections"]:
        tables += [
            (book.word("headings.sections"), "sections", columns_of(book, tank.SECTIONS)),
            *(
                (book.word(f"headings.{table.name}"), table.name, columns_of(book, table))
                for table in (tank.HOMOGENEITY, tank.SECTION_NOISE)
                if record.get("homogeneity")
            ),
            (book.word("headings.modes"), "modes", columns_of(book, tank.modes_table(record))),
            (book.word("headings.shell"), "shell", columns_of(book, tank.SHELL)),
        ]
    write_tables(book, sheet, _HEAD_ROW, tables)


def strapping_sheet(book, record):
    """Write the tape readings with their corrections, the tapes, and the courses."""
    sheet = book.sheet("strapping", book.word("texts.strapping_subtitle"), landscape=True)
    tables = [
        (book.word("headings.straps"), "straps", columns_of(book, strapping.straps_of(record))),
        (book.word("headings.strapped_courses"), "strapped_courses",
         columns_of(book, strapping.strapped_courses_of(record))),
        (book.word("headings.tapes"), "tapes", columns_of(book, strapping.TAPES)),
    ]  # fmt: skip
    write_tables(book, sheet, _HEAD_ROW, tables)


def great_circles_sheet(book, record):
    """Write the tape readings of a sphere with their corrections, and the tapes."""
    sheet = book.sheet("great_circles", book.word("texts.circles_subtitle"), landscape=True)
    tables = [
        (book.word("headings.great_circles"), "great_circles",
         columns_of(book, strapping.CIRCLES)),
        (book.word("headings.tapes"), "tapes", columns_of(book, strapping.TAPES_OF_SPHERE)),
    ]  # fmt: skip
    write_tables(book, sheet, _HEAD_ROW, tables)


def lines_sheet(book, record):
    """Write the offsets from reference lines, the lines, the levels and the plummets."""
    sheet = book.sheet("lines", book.word("texts.lines_subtitle"), landscape=True)
    tables = [
        (book.word("headings.levels"), "levels", columns_of(book, lines.LEVELS)),
        (book.word("headings.plummets"), "plummets", columns_of(book, lines.PLUMMETS)),
        (book.word("headings.lines"), "lines", columns_of(book, lines.LINES)),
        (book.word("headings.offsets"), "offsets", columns_of(book, lines.OFFSETS)),
    ]
    write_tables(book, sheet, _HEAD_ROW, tables)


def hits_sheet(book, record):
    """Write set-ups, common errors, rings, control targets and incidence of wall hits."""
    sheet = book.sheet("hits", book.word("texts.hits_subtitle"), landscape=True)
    chosen = [
        table
        for table in (
            hits.SETUPS,
            hits.SHARED,
            hits.RINGS,
            hits.CONTROL,
            hits.DRIFTS,
            hits.COMPARED,
            hits.INCIDENCE,
        )
        if table.rows(record)
    ]
    tables = [
        (book.word(f"headings.{table.name}"), table.name, columns_of(book, table))
        for table in chosen
    ]
    write_tables(book, sheet, _HEAD_ROW, tables)


def tangents_sheet(book, record):
    """Write the set-ups of tangents, the levels with perimeter and area, and all sights."""
    sheet = book.sheet("tangents", book.word("texts.tangents_subtitle"), landscape=True)
    tables = [
        (book.word(f"headings.{table.name}"), table.name, columns_of(book, table))
        for table in (tangents.SETUPS, tangents.LEVELS, tangents.READINGS)
    ]
    write_tables(book, sheet, _HEAD_ROW, tables)


def clouds_sheet(book, record):
    """Write files, scans, common errors, targets and obstructions of point clouds."""
    sheet = book.sheet("clouds", book.word("texts.clouds_subtitle"), landscape=True)
    tables = [
        (book.word(f"headings.{table.name}"), table.name, columns_of(book, table))
        for table in clouds.TABLES
        if table.rows(record)
    ]
    write_tables(book, sheet, _HEAD_ROW, tables)


def liquid_sheet(book, record):
    """Write the metered runs: meters, runs, causes, steps, dips, and compared volumes."""
    tables_by_sheet = {
        "liquid": (liquid.METERS, liquid.RUNS, liquid.SIZES, liquid.CAUSES),
        "liquid_steps": (liquid.STEPS, liquid.DIPS, liquid.volumes_table(record)),
    }
    for name, declared in tables_by_sheet.items():
        sheet = book.sheet(name, book.word(f"texts.{name}_subtitle"), landscape=True)
        tables = [
            (book.word(f"headings.{table.name}"), table.name, columns_of(book, table))
            for table in declared
            if table.rows(record)
        ]
        write_tables(book, sheet, _HEAD_ROW, tables)


def radii_sheet(book, record):
    """Write the radii of the courses: former, measured and adopted."""
    sheet = book.sheet("radii", book.word("texts.radii_subtitle"), landscape=True)
    heading = book.word("headings.radii")
    columns = columns_of(book, tank.RADII)
    write_tables(book, sheet, _HEAD_ROW, [(heading, "radii", columns)])


def ship_sheet(book, record):
    """Write the corrections for trim and list: range of the pipe, and a table for each list."""
    sheet = book.sheet("ship", book.word("texts.ship_subtitle"), landscape=True)
    tables = [(book.word("headings.ship_cells"), "ship_cells", columns_of(book, ship.CELLS))]
    for number, (list_deg, cells) in enumerate(ship.group_by_list(record), 1):
        title = book.word("texts.ship_list", list=f"{list_deg:g}")
        tables.append((title, f"ship_list_{number}", _corrections(book, record, cells)))
    write_tables(book, sheet, _HEAD_ROW, tables)


def _corrections(book, record, cells):
    """Return the columns soundings, correction (or state) at each trim, and largest U."""
    soundings, words = record["ship"]["sounding_m"], book.words["table_headings"]
    columns = [Column(f"{words['ship_sounding_m']}, m", soundings, 3, 12)]
    for cell in cells:
        values = [
            book.paper.word(f"ship_states.{state}") if state else 1000 * correction
            for state, correction in zip(cell["state"], cell["correction_m"], strict=True)
        ]
        heading = book.paper.word("texts.ship_trim", trim=f"{cell['trim_m']:g}")
        columns.append(Column(f"{heading}, mm", values, 1, 14))
    largest_U = [ship.largest_U_m(cells, index) for index in range(len(soundings))]
    in_mm = [None if U is None else 1000 * U for U in largest_U]
    return [*columns, Column(f"{words['ship_U']}, mm", in_mm, 1, 14)]


def corrections_sheet(book, record):
    """Write the corrections with their sizes at the top of the table."""
    sheet = book.sheet("corrections", book.word("texts.corrections_subtitle"), landscape=True)
    digits = decimals_of(record["capacity"]["u_m3"][-1]) + 1
    columns = columns_of(book, tank.CORRECTIONS.but(size_m3={"decimals": digits}))
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
    """Write choices, warnings, input files and versions of programs."""
    sheet = book.sheet("provenance", tab="origin")
    declared = (
        ("choices", "choices", tank.CHOICES),
        ("warnings", "warnings", tank.WARNINGS),
        ("files", "input_files", tank.FILES),
        ("programs", "programs", tank.PROGRAMS),
    )
    tables = [
        (book.word(f"headings.{title}"), name, columns_of(book, table))
        for title, name, table in declared
    ]
    write_tables(book, sheet, _HEAD_ROW, tables)
