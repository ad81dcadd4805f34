"""Strapping: checks of its tables against each other and the shell, and `Strapping` in SI."""

from dataclasses import replace

import numpy as np

from tankcal.job.checking import has_rows, is_not_given
from tankcal.job.checks.extent import has_wall_points, is_completed
from tankcal.job.checks.tapes import (
    check_girths,
    check_levels,
    check_readings,
    check_strapping_settings,
    refuse_others,
    refuse_repeats_elsewhere,
    tapes_of,
    tapes_read,
    tell_without_effect,
)
from tankcal.job.contract.observations import READINGS
from tankcal.job.plausibility import IMPOSSIBLE_MISS
from tankcal.job.tapes import mean_plates, metres, strapping_equipment
from tankcal.messages import message
from tankcal.survey.strapping import MOST_STRAPS, Strap, Strapping, reduce_straps, too_many_straps


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
    # Are circumferences the only measurements of the wall?
    # An unreadable table of points counts as a measurement. Set-ups without sights are reported
    # separately.
    unreadable = (raw.tables.get(name, ()) is None for name in ("points", "wall_hits", *READINGS))
    is_alone = not (has_wall_points(tables) or has_rows(tables["setups"]) or any(unreadable))
    needs_each_course = is_alone and _tell_each_course(tables, raw)
    _check_courses(straps, tables, courses, known, needs_each_course, log)
    check_readings(straps, tables, registers, raw, log)
    if has_rows(tables["thickness"]):
        refuse_others(tables["thickness"], "course", known, log)
    if values is not None:
        check_girths(straps, values["tank"]["nominal_diameter_m"], IMPOSSIBLE_MISS, log)
        check_strapping_settings(values, tables, registers, is_alone, raw, log)
        check_levels(straps, courses, values, log)


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


CLOSE_M, ROUNDS = 1e-12, 20  # convergence limit and largest number of iterations


def make_strapping(values, tables, registers):
    """Build `Strapping` from settings, tables and registers without problems."""
    table = tables["circumferences"]
    tapes, keys = tapes_of(registers), values["strapping"]
    return Strapping(
        straps=_straps(table, tapes),
        **strapping_equipment(tables, tapes),
        shape_sd_m=metres(values["shell"]["shape_sd_mm"]),
        wave_m=metres(keys["wave_mm"]),
        helix_m=metres(keys["helix_mm"]),
        plate_sd_m={name: means[1] for name, means in mean_plates(tables["thickness"]).items()},
    )


def _straps(table, tapes):
    columns = (
        *map(table.of, ("circumference", "course", "level_m", "reading_m", "s_mm")),
        tapes_read(table, tapes),
        *map(table.of, ("temperature_c", "tension_n", "pulls", "use")),
    )
    return tuple(
        Strap(
            *(name, course, level, reading, s_mm / 1000, tape, temperature, tension),
            pulls=int(pulls or 1),
            check=use == "check",
            row=row,
        )
        for row, name, course, level, reading, s_mm, tape, temperature, tension, pulls, use in zip(
            table.rows, *columns, strict=True
        )
    )


# ---- readings by tape of a known wall: the reduction of the job, inverted


def observe_straps(job, wall, errors):
    """Return tape readings whose reduction gives the perimeters of the wall, by iteration."""
    strapping, diameter = job.strapping, job.tank.nominal_diameter_m
    shell_c = job.survey.shell_temperature_c
    girth = np.array([wall.girth_m(strap.course, strap.level_m) for strap in strapping.straps])
    reduced = reduce_straps(strapping, shell_c, diameter)
    # Errors are added to the reduced perimeters, in which the standard deviations are defined.
    girth += errors.draw([strap.sd_m for strap in reduced])
    girth += [
        sum(errors.draw_cause(e.kind, e.name) * e.by_m for e in strap.effects) for strap in reduced
    ]
    # The reduction (temperature, tension, friction) depends on the reading: invert by iteration.
    for _ in range(ROUNDS):
        reduced = reduce_straps(strapping, shell_c, diameter)
        short = girth - [strap.circumference_m for strap in reduced]
        straps = zip(strapping.straps, short, strict=True)
        strapping = replace(
            strapping,
            straps=tuple(
                replace(strap, reading_m=strap.reading_m + float(by)) for strap, by in straps
            ),
        )
        if np.abs(short).max() < CLOSE_M:
            break
    return strapping
