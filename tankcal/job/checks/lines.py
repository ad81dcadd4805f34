"""Do reference lines make sense as a whole? Lines, their offsets, plummets, and the strap below."""

import numpy as np

from tankcal.job.checking import has_rows, refuse_repeated, tell_missing
from tankcal.job.checks.extent import has_wall_points, is_strapped
from tankcal.job.checks.strapping import (
    check_levels,
    names_of,
    refuse_free_scale,
    refuse_others,
    tapes_of,
)
from tankcal.job.checks.survey.stadia import is_bar
from tankcal.job.contract.registers import REGISTER_KEYS
from tankcal.job.tables import nearest
from tankcal.messages import message
from tankcal.survey.reference_line import FEWEST_LINES, SAME_LEVEL_M

NAMELESS = ""  # plummet that no list describes
MOST_OFFSETS = 2000  # readings of one tank
CLOSE_DEG = 0.01  # lines that are nearer are one


def has_lines(tables):
    """Were offsets from reference lines read?"""
    return has_rows(tables["lines"]) or has_rows(tables["offsets"])


def too_many_offsets(count):
    """What is said of more offsets than can be used."""
    return message(
        "too_many_offsets",
        "{count} offsets; expected at most {most}",
        count=count,
        most=MOST_OFFSETS,
    )


def check_lines(values, tables, registers, raw, log):
    """Lines with offsets, on a tank that is strapped, by plummets whose collimation is known."""
    if not has_lines(tables):
        return
    lines, offsets, straps = (tables[name] for name in ("lines", "offsets", "circumferences"))
    if not has_rows(lines) or not has_rows(offsets):
        missing = "offsets" if has_rows(lines) else "lines"
        expected = message(
            "lines_incomplete",
            "no rows; expected them: reference lines need lines.csv and offsets.csv",
        )
        if raw.tables.get(missing, ()) is not None:  # else it is told already
            log.problem(raw.file_of(missing), expected)
        return
    if not is_strapped(tables) and not has_wall_points(tables):
        expected = message(
            "lines_without_strap",
            "no circumference in {file}; expected one at least, of a course that the lines read:"
            " offsets give differences of radii only",
            file=raw.file_of("circumferences"),
        )
        if raw.tables.get("circumferences", ()) is not None:  # else it is told already
            log.problem(offsets.file, expected)
        return
    if len(offsets.rows) > MOST_OFFSETS:
        log.problem(offsets.file, too_many_offsets(len(offsets.rows)))
        return
    _check_lines(lines, log)
    plummets = plummets_of(registers)
    _check_plummets(lines, offsets, plummets, raw, log)
    courses = tables["courses"]
    known = () if courses is None else tuple(courses.of("course"))
    refuse_others(offsets, "line", names_of(lines, "line"), log)
    refuse_others(offsets, "course", known, log)
    for row, face in zip(offsets.rows, offsets.of("face"), strict=True):
        if face is not None and face != int(face):
            expected = message("part_of_a_face", "found {face:g}; expected 1 or 2", face=face)
            log.problem(offsets.file, expected, row, "face")
    if values is not None:
        check_levels(offsets, courses, values, log)
    sound = not (offsets.skipped or lines.skipped)
    needed = (offsets.of(name) for name in ("line", "course", "level_m"))
    if sound and not any(None in column for column in needed):
        _check_coverage(lines, offsets, log)
        if not has_wall_points(tables):
            _check_strapped(offsets, straps, log)


def plummets_of(registers):
    """{name: {key: value}} of the instruments that may make upright lines: no tape, no stadia.

    Without any there is one that nobody describes, of a blank name.
    """
    instruments, tapes = registers["instruments"], tapes_of(registers)
    found = {
        name: given
        for name, given in instruments.items()
        if name not in tapes and not is_bar(given["kind"])
    }
    return found or {NAMELESS: {field.name: None for field in REGISTER_KEYS["instruments"]}}


def plummets_used(lines, plummets):
    """(n,) name of the plummet of each line; blank: the only instrument, or that of this kind."""
    named = [name for name, one in plummets.items() if (one["kind"] or "").lower() == "plummet"]
    alone = named if len(plummets) > 1 else [*plummets]
    usual = alone[0] if len(alone) == 1 else None
    return [usual if name is None else name for name in lines.of("instrument")]


def at_reference(offsets):
    """(n,) bool: read at the reference level; None where no level is read on every line."""
    marked = [bool(flag) for flag in offsets.of("reference")]
    if any(marked):
        return np.array(marked)
    level = offsets.numbers("level_m")
    line = np.array(offsets.of("line"))
    counts = np.array([use != "check" for use in offsets.of("use")], dtype=bool)
    every = set(line)
    for low in np.unique(level[counts]):
        here = np.abs(level - low) <= SAME_LEVEL_M
        if set(line[here & counts]) == every:
            return here
    return None


def _check_lines(lines, log):
    refuse_repeated(lines, "line", log)
    azimuth = lines.numbers("azimuth_deg")
    given = np.isfinite(azimuth)
    if given.any() and not given.all() and not lines.skipped:
        expected = message(
            "line_azimuth_missing", "blank; expected the azimuths of all lines, or of none"
        )
        log.problem(lines.file, expected, lines.rows[int(np.argmin(given))], "azimuth_deg")
    for place in np.flatnonzero(given):
        before = azimuth[:place]
        near = np.abs((before - azimuth[place] + 180) % 360 - 180) < CLOSE_DEG
        if np.any(near):
            expected = message(
                "line_at_same_place",
                "{azimuth:g} degrees, as in row {row}; expected each line at a place of its own",
                azimuth=azimuth[place],
                row=lines.rows[int(np.argmax(near))],
            )
            log.problem(lines.file, expected, lines.rows[place], "azimuth_deg")


def _check_plummets(lines, offsets, plummets, raw, log):
    file, used = raw.file_of("instruments"), plummets_used(lines, plummets)
    register = raw.registers.get("instruments", ())
    if register is None:  # unreadable, which is told
        return
    if not (register and register.entries) and any(lines.of("instrument")):
        tell_missing(log, file, lines.file, "instrument")
        return
    for row, name in zip(lines.rows, used, strict=True):
        if name not in plummets:
            expected = message(
                "no_such_plummet",
                "found {name!r}; expected an instrument of {file} that is no tape{hint}",
                name=name or "",
                file=file,
                hint=nearest(name, plummets) if name else "",
            )
            log.problem(lines.file, expected, row, "instrument")
    if not register:
        return
    turned = _turned(lines, offsets, used)
    for name in dict.fromkeys(used):
        if name not in plummets:
            continue
        given, row = plummets[name], register.rows.get(name)
        refuse_free_scale(given, file, row, name, log)
        if given["u_collimation_arcsec"] is None and name not in turned:
            expected = message(
                "collimation_unknown",
                "missing; expected it, or readings of offsets on both faces: how far the plummet"
                " leans goes into every radius",
            )
            key = "u_collimation_arcsec"
            log.problem(file, expected, row, f"{name}.{key}" if name else key)


def _turned(lines, offsets, used):
    """Plummets with a place, not all at one level, that was read on both faces."""
    of_line = dict(zip(lines.of("line"), used, strict=True))
    columns = (offsets.of(name) for name in ("line", "level_m", "face", "use"))
    faces, heights = {}, {}
    for line, level, face, use in zip(*columns, strict=True):
        if None not in (line, level) and use != "check":
            place = line, round(level / SAME_LEVEL_M)
            faces.setdefault(place, set()).add(int(face or 1))
            heights.setdefault(of_line.get(line), []).append(level)
    both = {}
    for (line, level), seen in faces.items():
        if len(seen) == 2:
            both.setdefault(of_line.get(line), set()).add(level)
    return {
        name
        for name, levels in both.items()
        if len(levels) > 1 or np.ptp(heights[name]) > SAME_LEVEL_M
    }


def _check_coverage(lines, offsets, log):
    reference = at_reference(offsets)
    if reference is None:
        expected = message(
            "no_reference_level",
            "no level is read on every line; expected one, or its rows marked in the column"
            " reference",
        )
        log.problem(offsets.file, expected, column="reference")
        return
    counts = np.array([use != "check" for use in offsets.of("use")], dtype=bool)
    line, level = np.array(offsets.of("line")), offsets.numbers("level_m")
    course, rows = np.array(offsets.of("course")), offsets.rows
    marked = level[reference]
    if np.ptp(marked) > SAME_LEVEL_M or len(set(course[reference])) > 1:
        place = int(np.flatnonzero(reference)[np.argmax(np.abs(marked - np.median(marked)))])
        expected = message(
            "two_reference_levels",
            "{low:g} to {high:g} m; expected one reference level, on one course",
            low=marked.min(),
            high=marked.max(),
        )
        log.problem(offsets.file, expected, rows[place], "reference")
        return
    seen = set(line[reference & counts])
    for row, name in zip(lines.rows, lines.of("line"), strict=True):
        if name is not None and name not in seen:
            expected = message(
                "line_without_reference",
                "line {line!r} has no reading at the reference level; expected one",
                line=name,
            )
            log.problem(lines.file, expected, row, "line")
    told = set()
    for place in np.flatnonzero(counts):
        here = counts & (course == course[place]) & (np.abs(level - level[place]) <= SAME_LEVEL_M)
        first = int(np.argmax(here))
        count = len(set(line[here]))
        if count < FEWEST_LINES and first not in told:
            told.add(first)
            expected = message(
                "level_of_few_lines",
                "lines that read {level:g} m of course {course!r}: {count}; expected {fewest} at"
                " least",
                level=level[place],
                course=course[place],
                count=count,
                fewest=FEWEST_LINES,
            )
            log.problem(offsets.file, expected, rows[first], "level_m")


def _check_strapped(offsets, straps, log):
    """Without points of the wall a strap tells the radius that the lines carry on."""
    counts = [use != "check" for use in offsets.of("use")]
    read = {one for one, used in zip(offsets.of("course"), counts, strict=True) if used}
    reference = at_reference(offsets)
    if reference is None:
        return
    strapped = {
        name
        for name, use in zip(straps.of("course"), straps.of("use"), strict=True)
        if use != "check"
    }
    if not strapped & read:
        expected = message(
            "reference_not_strapped",
            "no course that the lines read is strapped; expected a circumference of course"
            " {course!r}",
            course=np.array(offsets.of("course"))[reference][0],
        )
        log.problem(straps.file, expected, column="course")
