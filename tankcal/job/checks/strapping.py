"""Does a strapping make sense as a whole? What its tables say of each other, and of the shell."""

import numpy as np

from tankcal.job.checking import (
    course_heights,
    has_rows,
    is_not_given,
    tell,
    tell_missing,
    temperature_missing,
)
from tankcal.job.checks.extent import has_radii, has_wall_points, is_strapped
from tankcal.job.checks.obstructions import check_obstructions
from tankcal.job.checks.spans import check_spans
from tankcal.job.contract.observations import READINGS
from tankcal.job.contract.registers import FREE
from tankcal.job.plausibility import IMPOSSIBLE_MISS, unit_guess
from tankcal.job.tables import nearest
from tankcal.messages import message

MOST_STRAPS = 1000  # readings round one tank
END_M = 0.02  # so far beyond its course a level may stand


def too_many_straps(count):
    """What is said of more straps than can be used."""
    return message(
        "too_many_straps",
        "{count} readings; expected at most {most}",
        count=count,
        most=MOST_STRAPS,
    )


def check_strapping(values, tables, registers, raw, log):
    """Circumferences with a tape, on courses that are there; obstructions and checks that fit."""
    straps = tables["circumferences"]
    if not is_strapped(tables):
        tell_without_effect(tables, log)
        return
    if len(straps.rows) > MOST_STRAPS:
        log.problem(straps.file, too_many_straps(len(straps.rows)))
        return
    courses = tables["courses"]
    known = () if courses is None else tuple(courses.of("course"))
    alone = _stands_alone(tables, raw)
    every = alone and _tell_each_course(tables, raw)
    _check_courses(straps, tables, courses, known, every, log)
    check_readings(straps, tables, registers, raw, log)
    if has_rows(tables["thickness"]):
        refuse_others(tables["thickness"], "course", known, log)
    if values is not None:
        check_girths(straps, values["tank"]["nominal_diameter_m"], IMPOSSIBLE_MISS, log)
        check_strapping_settings(values, tables, registers, alone, raw, log)
        check_levels(straps, courses, values, log)


def check_readings(straps, tables, registers, raw, log):
    """The tapes that were read, what was in their way, and their comparison with a master.

    straps  readings, with the names of their circumferences
    """
    tapes = tapes_of(registers)
    _check_tapes(straps, registers["instruments"], tapes, raw, log)
    _check_pulls(straps, log)
    if has_rows(tables["obstructions"]):
        names = names_of(straps, "circumference")
        refuse_others(tables["obstructions"], "circumference", names, log)
        check_obstructions(tables["obstructions"], straps, log)
        check_spans(tables["obstructions"], straps, tapes_read(straps, tapes), tapes, raw, log)
    _check_comparisons(tables["tape_checks"], tapes, raw, log)


def _stands_alone(tables, raw):
    """Was the wall strapped and nothing else? A table of its points that cannot be read is one, and
    set-ups of which nothing was sighted are told by themselves.
    """
    unreadable = (raw.tables.get(name, ()) is None for name in ("points", "wall_hits", *READINGS))
    return not (has_wall_points(tables) or has_rows(tables["setups"]) or any(unreadable))


def _tell_each_course(tables, raw):
    """Is a course without a circumference a problem? Not where lines or radii may tell it, be they
    incomplete or unreadable, which is told.
    """
    others = ("radii", "lines", "offsets")
    unreadable = any(raw.tables.get(name, ()) is None for name in others)
    elsewhere = any(has_rows(tables.get(name)) for name in others)
    complete = has_rows(tables["lines"]) and has_rows(tables["offsets"])
    declared = not is_not_given(raw, "radii", "source")
    return not (unreadable or declared or has_radii(tables)) and (complete or not elsewhere)


def tapes_of(registers):
    """{name: {key: value}} of the instruments that are tapes."""
    return {
        name: given
        for name, given in registers["instruments"].items()
        if (given["kind"] or "").lower() == "tape"
    }


def tapes_read(straps, tapes):
    """(n,) name of the tape of each reading: the only one that is no master where it is blank."""
    masters = {given["master"] for given in tapes.values()}
    read = [name for name in tapes if name not in masters]
    usual = read[0] if len(read) == 1 else None
    return [name or usual for name in straps.of("instrument")]


def tell_without_effect(tables, log):
    """Warnings about tables that belong to circumferences, where there are none."""
    for name in ("obstructions", "thickness", "tape_checks"):
        if has_rows(tables.get(name)):
            expected = message(
                "not_strapped", "without effect: the job has no circumferences by tape"
            )
            log.warning(tables[name].file, expected)


def _check_courses(straps, tables, courses, known, every, log):
    """every: whether each course needs a circumference."""
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


def refuse_repeats_elsewhere(straps, column, log):
    """A problem for each reading that is not where others of its name are.

    column  of its place, as the file has it
    """
    places = {}
    names = zip(straps.rows, straps.of("circumference"), straps.of("course"),
                straps.of("level_m"), strict=True)  # fmt: skip
    for row, name, *place in names:
        if None in (name, *place):
            continue
        first = places.setdefault(name, (place, row))
        if first[0] != place:
            expected = message(
                "repeat_elsewhere",
                "circumference {name!r} is at another level in row {row}; expected repeats at one"
                " level, or another name",
                name=name,
                row=first[1],
            )
            log.problem(straps.file, expected, row, column)


def names_of(table, column):
    """The names of a table; none where a row of it was dropped, which is told already."""
    return () if table.skipped else tuple(table.of(column))


def refuse_others(table, column, known, log):
    """A problem for each name that is not among the known; none where these cannot be read."""
    if not known or None in known:
        return
    for row, name in zip(table.rows, table.of(column), strict=True):
        if name is not None and name not in known:
            expected = message(
                "no_such_name",
                "found {name!r}; expected one of those that are there{hint}",
                name=name,
                hint=nearest(name, known),
            )
            log.problem(table.file, expected, row, column)


def _check_tapes(straps, instruments, tapes, raw, log):
    """A tape for each reading, and of each what its readings need.

    straps  readings with instrument; instruments, tapes  {name: {key: value}}
    """
    file = raw.file_of("instruments")
    if raw.registers.get("instruments", ()) is None:  # unreadable, which is told
        return
    if not instruments:
        tell_missing(log, file, straps.file, "instrument")
        return
    for row, name, tape in zip(
        straps.rows, straps.of("instrument"), tapes_read(straps, tapes), strict=True
    ):
        if name is None and tape is None:
            expected = message("tape_not_named", "blank; expected a tape of {file}", file=file)
            log.problem(straps.file, expected, row, "instrument")
            if not tapes:
                return
        elif tape not in tapes:
            found = instruments.get(tape)
            expected = message(
                "no_such_tape",
                "found {name!r}; expected a tape of {file}{hint}",
                name=tape,
                file=file,
                hint=nearest(tape, tapes) if found is None else "",
            )
            log.problem(straps.file, expected, row, "instrument")
    rows = raw.registers["instruments"].rows
    for name in dict.fromkeys(tapes_read(straps, tapes)):
        given = tapes.get(name)
        if given is None:
            continue
        refuse_free_scale(given, file, rows.get(name), name, log)
        certified = given["master"] if given["master"] in tapes else name  # whose counts
        found = [(name, *one) for one in _missing_of(given, tapes)]
        found += [(certified, *one) for one in _missing_of_certificate(given, tapes[certified])]
        for owner, key, expected in found:
            where = rows.get(owner), f"{owner}.{key}"
            if not log.has(file, *where):  # a master of two tapes is told once
                log.problem(file, expected, *where)


def check_girths(straps, nominal_m, most_apart, log):
    """Readings whose size is that of the drawing, and of each other.

    Parameters
    ----------
    straps : ColumnValues
        With reading_m.
    nominal_m : float or None
        Diameter by the drawing.
    most_apart : float
        Share by which a reading may differ from the median of all.
    log : Log
    """
    readings = straps.numbers("reading_m")
    if not np.any(np.isfinite(readings)):
        return
    median = usual = float(np.nanmedian(readings))
    far = np.abs(readings / median - 1) > most_apart
    if nominal_m is not None:
        ratio = median / (np.pi * nominal_m)
        if not 1 / (1 + IMPOSSIBLE_MISS) <= ratio <= 1 + IMPOSSIBLE_MISS:
            usual, far[0] = np.pi * nominal_m, True  # one line for all
    for row, reading in zip(np.array(straps.rows)[far], readings[far], strict=True):
        expected = message(
            "circle_of_other_size",
            "found {reading:g}; expected about {usual:.4g} m, as the other circumferences or"
            " tank.nominal_diameter_m have it{guess}",
            reading=reading,
            usual=usual,
            guess=unit_guess(float(reading) / usual),
        )
        log.problem(straps.file, expected, int(row), "reading_m")


def _check_pulls(straps, log):
    for row, pulls in zip(straps.rows, straps.of("pulls"), strict=True):
        if pulls is not None and pulls != int(pulls):
            expected = message(
                "part_of_a_pull", "found {pulls:g}; expected a whole number", pulls=pulls
            )
            log.problem(straps.file, expected, row, "pulls")


def refuse_free_scale(given, file, row, name, log):
    """A problem for each of scale and offset of an instrument that is to be an unknown."""
    for key in ("u_scale_ppm", "u_offset_mm"):
        if given[key] == FREE:
            expected = message(
                "tape_scale_free",
                "found free; expected its standard uncertainty: nothing else in a strapping"
                " tells it",
            )
            log.problem(file, expected, row, f"{name}.{key}")


def _missing_of(given, tapes):
    if given["thickness_mm"] is None:
        yield (
            "thickness_mm",
            message(
                "tape_thickness_missing",
                "missing; expected the thickness of the tape: half of it lies between the paint"
                " and the line that is read",
            ),
        )
    if (given["section_mm2"] is None) != (given["e_gpa"] is None):
        key = "e_gpa" if given["e_gpa"] is None else "section_mm2"
        yield key, message("stretch_incomplete", "missing; expected both section_mm2 and e_gpa")
    master = given["master"]
    if master is not None and master not in tapes:
        expected = message(
            "no_such_master",
            "found {master!r}; expected another tape that is described here",
            master=master,
        )
        yield "master", expected


def _missing_of_certificate(given, certificate):
    """What a tape needs of its certificate, which is that of its master where it has one."""
    if given["expansion_per_k"] and certificate["certified_temperature_c"] is None:
        yield "certified_temperature_c", temperature_missing()
    if given["section_mm2"] and certificate["tension_n"] is None:
        yield (
            "tension_n",
            message(
                "certified_tension_missing",
                "missing, but section_mm2 is given; expected the tension of the certificate",
            ),
        )


def _check_comparisons(table, tapes, raw, log):
    """Comparisons of one working tape, where there is one."""
    working = [name for name, given in tapes.items() if given["master"] is not None]
    if has_rows(table) and tapes and len(working) != 1:
        expected = message(
            "comparison_of_no_tape",
            "found {count} tapes with a master in {file}; expected one: these readings are its own",
            count=len(working),
            file=raw.file_of("instruments"),
        )
        log.problem(table.file, expected)
    if working and not has_rows(table) and raw.tables.get("tape_checks", ()) is not None:
        expected = message(
            "master_not_compared",
            "found a master, but no comparison with it; expected readings in tape_checks.csv",
        )
        rows = raw.registers["instruments"].rows
        file = raw.file_of("instruments")
        log.problem(file, expected, rows.get(working[0]), f"{working[0]}.master")


def check_strapping_settings(values, tables, registers, alone, raw, log):
    """What a strapping needs of the settings; alone: nothing else tells the wall."""
    tapes = tapes_of(registers)
    is_lying = values["tank"]["kind"] == "horizontal"  # an upright shell has a typical shape
    unknown = values["shell"]["shape_sd_mm"] is None
    if is_lying and unknown and is_not_given(raw, "shell", "shape_sd_mm"):
        expected = message(
            "shape_not_declared",
            "missing; expected how far the wall is from a circle (0: it is one): a tape measures a"
            " perimeter, and the same perimeter has less area the more the wall departs from a"
            " circle",
        )
        tell(log.problem, raw, "shell", "shape_sd_mm", expected)
    check_tape_temperature(tables["circumferences"], tapes, raw, log)
    if alone:
        refuse_inside(values, raw, log)
    if alone and values["bottom"]["form"] in ("leaning", "points"):
        expected = message(
            "bottom_needs_axis",
            "found {form}; expected another form: strapping does not measure the axis of the shell",
            form=values["bottom"]["form"],
        )
        tell(log.problem, raw, "bottom", "form", expected)


def check_tape_temperature(straps, tapes, raw, log):
    """The temperature of a tape that expands, or that of the shell that it lies on."""
    expands = any(given["expansion_per_k"] for given in tapes.values())
    read = None not in straps.of("temperature_c")
    if expands and not read and is_not_given(raw, "survey", "shell_temperature_c"):
        expected = message(
            "tape_of_no_temperature",
            "missing; expected it, or temperature_c of every reading: the tape expands",
        )
        tell(log.problem, raw, "survey", "shell_temperature_c", expected)


def refuse_inside(values, raw, log):
    """A problem where a wall that a tape alone measured is said to be measured inside."""
    if values["survey"]["side"] == "inside":
        expected = message(
            "strapped_inside", "found inside; expected outside: a tape lies on the outside"
        )
        tell(log.problem, raw, "survey", "side", expected)


def check_levels(straps, courses, values, log):
    """A problem for each level that is not of the course that its row names."""
    heights = course_heights(courses)
    if heights is None:
        return
    plate, bottom = values["datum"]["dip_plate_z_m"], values["datum"]["bottom_z_m"]
    zero = 0.0 if plate is None else plate - (bottom or 0.0)
    ends = np.concatenate([[0.0], np.cumsum(heights)])
    names = courses.of("course")
    for row, course, level in zip(
        straps.rows, straps.of("course"), straps.of("level_m"), strict=True
    ):
        if level is None or course not in names:
            continue
        index = names.index(course)
        low, high = ends[index] - zero, ends[index + 1] - zero
        if not low - END_M <= level <= high + END_M:
            expected = message(
                "level_outside_course",
                "found {level:g}; expected a level of course {course!r}, from {low:.3f} to"
                " {high:.3f} m",
                level=level,
                course=course,
                low=low,
                high=high,
            )
            log.problem(straps.file, expected, row, "level_m")
