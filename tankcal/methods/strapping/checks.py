"""Checks of a strapping as a whole: its tables against each other and against the shell."""

from tankcal.job.checking import has_rows, is_not_given
from tankcal.job.checks.extent import has_wall_points, is_completed
from tankcal.job.checks.tapes import (
    check_girths,
    check_levels,
    check_readings,
    check_strapping_settings,
    refuse_others,
    refuse_repeats_elsewhere,
    tell_without_effect,
)
from tankcal.job.contract.observations import READINGS
from tankcal.job.plausibility import IMPOSSIBLE_MISS
from tankcal.messages import message
from tankcal.survey.strapping import MOST_STRAPS, too_many_straps


def check_strapping(values, tables, registers, raw, log):
    """Check circumferences, courses, obstructions and comparisons; as for `Method.check`."""
    straps = tables["circumferences"]
    if not has_rows(straps):
        tell_without_effect(tables, log)
        return
    if len(straps.rows) > MOST_STRAPS:
        log.problem(straps.file, too_many_straps(len(straps.rows)))
        return
    courses = tables["courses"]
    known = () if courses is None else tuple(courses.of("course"))
    is_alone = _stands_alone(tables, raw)
    needs_each_course = is_alone and _tell_each_course(tables, raw)
    _check_courses(straps, tables, courses, known, needs_each_course, log)
    check_readings(straps, tables, registers, raw, log)
    if has_rows(tables["thickness"]):
        refuse_others(tables["thickness"], "course", known, log)
    if values is not None:
        check_girths(straps, values["tank"]["nominal_diameter_m"], IMPOSSIBLE_MISS, log)
        check_strapping_settings(values, tables, registers, is_alone, raw, log)
        check_levels(straps, courses, values, log)


def _stands_alone(tables, raw):
    """Return True if circumferences are the only measurements of the wall.

    An unreadable table of points counts as a measurement. Set-ups without sights are reported
    separately.
    """
    unreadable = (raw.tables.get(name, ()) is None for name in ("points", "wall_hits", *READINGS))
    return not (has_wall_points(tables) or has_rows(tables["setups"]) or any(unreadable))


def _tell_each_course(tables, raw):
    """Return True if each course needs a circumference.

    Otherwise lines or radii may determine it; if they are incomplete or unreadable, this is
    reported separately.
    """
    others = ("radii", "lines", "offsets")
    is_unreadable = any(raw.tables.get(name, ()) is None for name in others)
    has_others = any(has_rows(tables.get(name)) for name in others)
    has_complete_lines = has_rows(tables["lines"]) and has_rows(tables["offsets"])
    has_declared_radii = not is_not_given(raw, "radii", "source")
    return not (is_unreadable or has_declared_radii or is_completed(tables)) and (
        has_complete_lines or not has_others
    )


def _check_courses(straps, tables, courses, known, every, log):
    """Check the courses of circumferences; every: True if each course needs one."""
    refuse_others(straps, "course", known, log)
    reached = {
        course
        for table in (straps, tables["offsets"])
        if has_rows(table)
        for course, use in zip(table.of("course"), table.of("use"), strict=True)
        if use != "check"
    }
    if straps.skipped or courses is None or courses.skipped or None in reached:
        return
    for row, name in zip(courses.rows, known, strict=True):
        if name is not None and name not in reached and every:
            expected = message(
                "course_not_strapped",
                "no circumference was measured on course {course!r}; expected one at least in"
                " {file}",
                course=name,
                file=straps.file,
            )
            log.problem(courses.file, expected, row, "course")
    refuse_repeats_elsewhere(straps, "level_m", log)
