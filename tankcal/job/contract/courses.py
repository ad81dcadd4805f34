"""Columns of courses.csv and welds.csv, with their checks."""

from itertools import combinations

import numpy as np

from tankcal.job.checking import loads_the_shell, refuse_repeated, zero_z
from tankcal.job.fields import Field, number, positive
from tankcal.messages import message

COLUMNS = (
    Field("course", "name", "name of the ring of plates, from the bottom up", required=True),
    positive("height_m", "height of the course, metres", 50, required=True),
    number("thickness_mm", "plate thickness, millimetres", 0, 100, required=True),
    number("paint_mm", "paint thickness, millimetres; blank: 0", 0, 10),
)

# Largest difference of the sum of the heights from the nominal height: metres, or relative.
HEIGHT_MISS_M, HEIGHT_MISS_RELATIVE = 0.020, 0.002
SMALLEST_THICKNESS_MM = 1.0  # a thinner plate is assumed to be in metres


def no_courses():
    """Return the message for a courses.csv without rows."""
    return message("no_courses", "no rows; expected one row for each course, from the bottom up")


def thin_plate(thickness_mm):
    """Return the message for a plate that appears to be in metres."""
    return message(
        "thin_plate",
        "found {thickness:g}; expected millimetres, 0 or at least 1: is it in metres?",
        thickness=thickness_mm,
    )


def check_courses(courses, values, log):
    """Check that names are unique, plates plausible, and the heights add up to the shell height."""
    if courses.is_empty:
        log.problem(courses.file, no_courses())
        return
    refuse_repeated(courses, "course", log)
    for row, thickness in zip(courses.rows, courses.of("thickness_mm"), strict=True):
        if thickness is not None and 0 < thickness < SMALLEST_THICKNESS_MM:
            log.problem(courses.file, thin_plate(thickness), row, "thickness_mm")
    heights, nominal = courses.of("height_m"), values["tank"]["nominal_height_m"]
    if None in heights or courses.skipped:
        return  # unreadable courses are reported elsewhere
    _refuse_weightless_plates(courses, heights, values, log)
    if nominal is None:
        return
    miss = sum(heights) - nominal
    allowed = max(HEIGHT_MISS_M, HEIGHT_MISS_RELATIVE * nominal)
    if abs(miss) > allowed * (1 + 1e-9):
        expected = message(
            "courses_do_not_add_up",
            "the courses add up to {sum:.4g} m, expected tank.nominal_height_m = {nominal:g} "
            "m within {allowed:.0f} mm; they differ by {miss:.0f} mm",
            sum=sum(heights),
            nominal=nominal,
            allowed=1000 * allowed,
            miss=1000 * miss,
        )
        log.problem(courses.file, expected, None, "height_m")


def _refuse_weightless_plates(courses, heights, values, log):
    """Refuse plates of zero thickness below the liquid that stretches the shell."""
    level, zero = values["survey"]["liquid_level_m"], zero_z(values)
    loaded_to, why = -np.inf, ""
    if level and zero is not None and values["corrections"]["head"] is not False:
        loaded_to = level + zero - (values["datum"]["bottom_z_m"] or 0.0)
        why = message("because_of_level", "survey.liquid_level_m = {level:g}", level=level)
    if loads_the_shell(values):
        loaded_to = np.inf
        why = message("because_of_density", "the density in [table]")
    bottoms = np.concatenate([[0.0], np.cumsum(heights)[:-1]])
    plates = zip(courses.rows, courses.of("thickness_mm"), bottoms, strict=True)
    for row, thickness, bottom in plates:
        if thickness == 0 and bottom < loaded_to:
            expected = message(
                "plate_of_nothing",
                "found 0; expected the plate's thickness: the liquid head ({why}) needs it",
                why=why,
            )
            log.problem(courses.file, expected, row, "thickness_mm")


WELD_COLUMNS = (
    Field("course", "name", "course of courses.csv with the weld", required=True),
    number(
        "azimuth_deg",
        "azimuth of the vertical weld about the axis, clockwise from +y of the points, degrees",
        0,
        360,
        required=True,
    ),
)

APART_DEG = 0.1  # welds closer than this are considered as repeated


def check_welds(table, courses, log):
    """Check that each weld is in a course of courses.csv and is given once.

    Parameters
    ----------
    table : ColumnValues
        Rows of welds.csv.
    courses : ColumnValues or None
        Rows of courses.csv; None if missing or unreadable.
    log
        Log of the problems.
    """
    known = None if courses is None or courses.skipped else set(courses.of("course"))
    places = {}
    for row, course, azimuth in zip(
        table.rows, table.of("course"), table.of("azimuth_deg"), strict=True
    ):
        if None not in (course, known) and course not in known:
            expected = message(
                "weld_of_no_course",
                "found {course!r}; expected a course of {of}",
                course=course,
                of=courses.file,
            )
            log.problem(table.file, expected, row, "course")
        elif None not in (course, azimuth):
            places.setdefault(course, []).append((azimuth, row))
    for welds in places.values():
        for (first, first_row), (second, row) in combinations(welds, 2):
            if abs((first - second + 180) % 360 - 180) < APART_DEG:
                expected = message(
                    "weld_twice",
                    "a weld of this course at {azimuth_deg:g} degrees is already in row "
                    "{first_row}; expected once",
                    azimuth_deg=first,
                    first_row=first_row,
                )
                log.problem(table.file, expected, row, "azimuth_deg")
