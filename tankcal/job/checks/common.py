"""What all checks share: how a setting is told, and what is known of the tank's size."""

from dataclasses import dataclass

import numpy as np

from tankcal.job.contract.observations import READINGS
from tankcal.job.entries import settings_place
from tankcal.job.fields import is_blank
from tankcal.messages import message


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


def has_survey(tables):
    """Are there observations to be adjusted, readable or not?"""
    return any(has_rows(tables[name]) for name in ("image_points", *READINGS))


def has_wall_points(tables):
    """Does the wall come from points, handed in or to be adjusted?"""
    return has_rows(tables["points"]) or has_survey(tables)


def refuse_repeated(table, column, log):
    """A problem for each name that stands in the table a second time."""
    first_row = {}
    for row, name in zip(table.rows, table.of(column), strict=True):
        if name is None:
            continue
        if name in first_row:
            expected = message(
                "name_twice",
                "{name!r} is there already, in row {first_row}; expected once",
                name=name,
                first_row=first_row[name],
            )
            log.problem(table.file, expected, row, column)
        else:
            first_row[name] = row


def course_heights(courses):
    """Heights of all courses, m; None where one is missing, bad or unreadable."""
    if courses is None or courses.skipped:
        return None
    heights = courses.of("height_m")
    return None if None in heights or not heights else heights


def missing_beside(other):
    """What is said of a key that has to be given where another one is."""
    return message("missing_beside", "missing; expected beside {other}", other=other)


def same_parameter(other):
    """What is said of a key that stands beside another name of the same parameter."""
    return message(
        "same_parameter",
        "given beside {other}; expected one of them: they are the same parameter",
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


def zero_z(values):
    """z of the table's zero in the frame of the points, m, or None: not known."""
    plate = values["datum"]["dip_plate_z_m"]
    return values["datum"]["bottom_z_m"] if plate is None else plate


@dataclass(frozen=True)
class Extent:
    """What is known of a tank's size before anything is computed; None: not known.

    height_m          from its lowest to its highest inside point at the dip point
    lowest_m, top_m   dips of its lowest and highest inside points, from the table's zero
    area_m2           the largest free surface
    """

    height_m: float | None = None
    lowest_m: float | None = None
    top_m: float | None = None
    area_m2: float | None = None


def extent_of(values, tables, kind):
    """The Extent of a tank of the kind; nothing is known of a mesh, or of an unknown kind."""
    if kind == "vertical":
        return _of_vertical(values, tables["bottom"])
    if kind == "horizontal":
        return _of_horizontal(values["horizontal"], values, has_wall_points(tables))
    if kind == "sphere":
        diameter = values["sphere"]["diameter_m"] or values["tank"]["nominal_diameter_m"]
        area = None if diameter is None else np.pi / 4 * diameter**2
        return _lying(diameter, 0.0, area, values, has_wall_points(tables))
    return Extent()


def _of_vertical(values, bottom):
    height, diameter = (values["tank"][f"nominal_{name}_m"] for name in ("height", "diameter"))
    shell_z, zero = values["datum"]["bottom_z_m"], zero_z(values)
    area = None if diameter is None else np.pi / 4 * diameter**2
    if None in (shell_z, zero):
        return Extent(height, area_m2=area)
    centre = values["bottom"]["centre_z_m"]
    lowest = [shell_z - zero] if centre is None else [shell_z - zero, centre - zero]
    if bottom is not None:
        lowest += [z - zero for z in bottom.of("z_m") if z is not None]
        lowest += [level for level in bottom.of("level_m") if level is not None]
    top = None if height is None else shell_z + height - zero
    return Extent(height, min(lowest), top, area)


def _of_horizontal(given, values, has_points):
    height = given["height_m"] or given["diameter_m"] or values["tank"]["nominal_diameter_m"]
    width = given["width_m"] or height
    length = given["length_m"]
    if None in (height, width, length):
        return Extent(height)
    length += sum(given[f"end_{end}_depth_m"] or height / 2 for end in "ab")
    tilt = abs(given["tilt_mm_per_m"] or 0.0) / 1000
    return _lying(height, tilt * length, width * length, values, has_points)


def _lying(height, reach, area, values, has_points):
    """reach: how much the ends may lie above or below the place of the dip point, m."""
    if height is None or has_points:
        return Extent(height, area_m2=area)
    zero = values["datum"]["dip_plate_z_m"] or 0.0
    return Extent(height, -reach - zero, height + reach - zero, area)
