"""Columns of courses.csv, and checks of its names, plates and heights."""

import numpy as np

from tankcal.job.checking import loads_the_shell, refuse_repeated, zero_z
from tankcal.job.contract.shorthand import number, positive
from tankcal.job.fields import Field
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
