"""What the checks of all tables share: how they tell, and what they ask of a table or a setting."""

import numpy as np

from tankcal.job.fields import is_blank
from tankcal.messages import message

RELATIVE_DENSITY = 20  # smaller numbers are no densities in kg/m3
UNIT_FACTOR = 5  # sizes that differ by more cannot be in the same unit


def settings_place(raw, section, key):
    """(file, row, name) of a setting, for a message about it."""
    value = raw.settings.get(section, {}).get(key)
    return raw.settings_file, value.row if value else None, f"{section}.{key}"


def tell(to, raw, section, key, expected):
    """Tell log.problem or log.warning about one setting, with its file and row."""
    file, row, name = settings_place(raw, section, key)
    to(file, expected, row, name)


def is_not_given(raw, section, key):
    """Is the key missing or blank? A value that is bad counts as given: it is told already."""
    value = raw.settings.get(section, {}).get(key)
    return value is None or is_blank(value.raw)


def has_rows(table):
    """Does the table exist, with at least one row, be it readable or not?"""
    return table is not None and not table.is_empty


def refuse_repeated(table, column, log):
    """A problem for each name that stands in the table a second time."""
    first_row = {}
    for row, name in zip(table.rows, table.of(column), strict=True):
        if name is None:
            continue
        if name in first_row:
            log.problem(table.file, name_twice(name, first_row[name]), row, column)
        else:
            first_row[name] = row


def name_twice(name, first_row):
    """What is said of a name that stands in a table a second time."""
    return message(
        "name_twice",
        "{name!r} is already in row {first_row}; expected once",
        name=name,
        first_row=first_row,
    )


def tell_missing(log, file, table, column):
    """One problem for a table or a register that is not there, however many columns refer to it.

    table, column  of one of those that do
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
    """Heights of all courses, m; None where one is missing, bad or unreadable."""
    if courses is None or courses.skipped:
        return None
    heights = courses.of("height_m")
    return None if None in heights or not heights else heights


def missing_beside(other):
    """What is said of a key that has to be given where another one is."""
    return message("missing_beside", "missing; expected together with {other}", other=other)


def temperature_missing():
    """What is said of a tape that expands from a temperature that nobody gives."""
    return message(
        "certified_temperature_missing",
        "missing, but expansion_per_k is given; expected the temperature of the certificate",
    )


def same_parameter(other):
    """What is said of a key that stands beside another name of the same parameter."""
    return message(
        "same_parameter",
        "given together with {other}; expected only one of them: they are the same parameter",
        other=other,
    )


def tiny_sd(unit, largest):
    """What is said of standard deviations of which the largest is tiny in their unit."""
    if unit == "mm":
        template = "at most {largest:g}; expected millimetres: is it in metres?"
        return message("tiny_sd_mm", template, largest=largest)
    if unit == "um":
        template = "at most {largest:g}; expected micrometres: is it in millimetres?"
        return message("tiny_sd_um", template, largest=largest)
    template = "at most {largest:g}; expected seconds of arc: is it in degrees or gon?"
    return message("tiny_sd_arcsec", template, largest=largest)


def loads_the_shell(values):
    """Is the table to be made for a shell that the liquid stretches?"""
    table = values["table"]
    asked = (table["liquid_density_kg_m3"] or 0) > 0 or table["other_densities_kg_m3"]
    return bool(asked) and values["corrections"]["head"] is not False


def loads_sphere(values):
    """Does anything widen a sphere: pressure or liquid, of the table or of the survey day?"""
    table, survey = values["table"], values["survey"]
    liquid = (survey["liquid_density_kg_m3"] or 0) * (survey["liquid_level_m"] or 0)
    loads = (table["pressure_bar"], survey["pressure_bar"], liquid, loads_the_shell(values))
    return any(loads) and values["corrections"]["head"] is not False


def zero_z(values):
    """z of the table's zero in the frame of the points, m, or None: not known."""
    plate = values["datum"]["dip_plate_z_m"]
    return values["datum"]["bottom_z_m"] if plate is None else plate


def places_of(table):
    """(n, 3) coordinates of the rows of a table that have all three."""
    places = zip(table.of("x_m"), table.of("y_m"), table.of("z_m"), strict=True)
    return np.array([place for place in places if None not in place]).reshape(-1, 3)
