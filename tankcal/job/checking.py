"""Shared parts of the checks of all tables: messages, and questions about a table or a setting."""

import numpy as np

from tankcal.job.fields import is_blank
from tankcal.messages import message

RELATIVE_DENSITY = 20  # a smaller number is a relative density or g/cm3, not kg/m3
UNIT_FACTOR = 5  # largest ratio of two sizes in the same unit


def settings_place(raw, section, key):
    """(file, row, name) of a setting, for messages."""
    value = raw.settings.get(section, {}).get(key)
    return raw.settings_file, value.row if value else None, f"{section}.{key}"


def tell(report, raw, section, key, expected):
    """Report on one setting, with its file and row.

    Parameters
    ----------
    to : callable
        log.problem or log.warning.
    raw : RawJob
        Job as read.
    section, key : str
        Section and key of the setting.
    expected : Message or str
        Text of the report.
    """
    file, row, name = settings_place(raw, section, key)
    report(file, expected, row, name)


def is_not_given(raw, section, key):
    """Return True if the key is missing or blank; an invalid value counts as given."""
    value = raw.settings.get(section, {}).get(key)
    return value is None or is_blank(value.raw)


def has_rows(table):
    """Return True if the table has at least one row, readable or not."""
    return table is not None and not table.is_empty


def refuse_repeated(table, column, log):
    """Report each name that occurs in the column a second time."""
    first_row = {}
    for row, name in zip(table.rows, table.of(column), strict=True):
        if name is None:
            continue
        if name in first_row:
            log.problem(table.file, name_twice(name, first_row[name]), row, column)
        else:
            first_row[name] = row


def name_twice(name, first_row):
    """Message about a name that occurs in a table a second time."""
    return message(
        "name_twice",
        "{name!r} is already in row {first_row}; expected once",
        name=name,
        first_row=first_row,
    )


def tell_missing(log, file, table, column):
    """Report a missing table or register once, however many columns refer to it.

    Parameters
    ----------
    log : Log
        Receives the problem.
    file : str
        Name of the missing file.
    table, column : str
        A column that refers to its entries.
    """
    if log.has(file, None, None):
        return
    expected = message(
        "register_missing",
        "missing or empty; expected it: the column {column} of {table} refers to its entries",
        column=column,
        table=table,
    )
    log.problem(file, expected)


def course_heights(courses):
    """Heights of all courses, m; None if a height is missing, invalid or unreadable."""
    if courses is None or courses.skipped:
        return None
    heights = courses.of("height_m")
    return None if None in heights or not heights else heights


def missing_beside(other):
    """Message about a key that is required together with another key."""
    return message("missing_beside", "missing; expected together with {other}", other=other)


def temperature_missing():
    """Message about a tape with an expansion coefficient but no certificate temperature."""
    return message(
        "certified_temperature_missing",
        "missing, but expansion_per_k is given; expected the temperature of the certificate",
    )


def same_parameter(other):
    """Message about two keys that are names of the same parameter."""
    return message(
        "same_parameter",
        "given together with {other}; expected only one of them: they are the same parameter",
        other=other,
    )


def tiny_sd(unit, largest):
    """Message about standard deviations whose largest value is tiny in the unit given."""
    if unit == "mm":
        template = "at most {largest:g}; expected millimetres: is it in metres?"
        return message("tiny_sd_mm", template, largest=largest)
    if unit == "um":
        template = "at most {largest:g}; expected micrometres: is it in millimetres?"
        return message("tiny_sd_um", template, largest=largest)
    template = "at most {largest:g}; expected seconds of arc: is it in degrees or gon?"
    return message("tiny_sd_arcsec", template, largest=largest)


def loads_the_shell(values):
    """Return True if the table requires the expansion of the shell under liquid head."""
    table = values["table"]
    has_liquid = (table["liquid_density_kg_m3"] or 0) > 0 or table["other_densities_kg_m3"]
    return bool(has_liquid) and values["corrections"]["head"] is not False


def loads_sphere(values):
    """Return True if pressure or liquid, of the table or of the survey day, expands the sphere."""
    table, survey = values["table"], values["survey"]
    liquid = (survey["liquid_density_kg_m3"] or 0) * (survey["liquid_level_m"] or 0)
    loads = (table["pressure_bar"], survey["pressure_bar"], liquid, loads_the_shell(values))
    return any(loads) and values["corrections"]["head"] is not False


def zero_z(values):
    """z of the zero of the table in the frame of the points, m; None if not known."""
    plate = values["datum"]["dip_plate_z_m"]
    return values["datum"]["bottom_z_m"] if plate is None else plate


def places_of(table):
    """Coordinates, shape (n, 3), m, of the rows that have all three."""
    places = zip(table.of("x_m"), table.of("y_m"), table.of("z_m"), strict=True)
    return np.array([place for place in places if None not in place]).reshape(-1, 3)
