"""Reference lines: checks of lines, offsets, plummets and strap, and `ReferenceLines` in SI."""

import numpy as np

from tankcal.job.checking import has_rows, refuse_repeated, tell_missing
from tankcal.job.checks.extent import has_wall_points, is_strapped
from tankcal.job.checks.survey.readings import is_bar
from tankcal.job.checks.tapes import (
    check_levels,
    names_of,
    refuse_free_scale,
    refuse_others,
    tapes_of,
)
from tankcal.job.contract.registers import REGISTER_KEYS
from tankcal.job.tables import nearest
from tankcal.messages import message
from tankcal.survey.reference_line import (
    FEWEST_LINES,
    MOST_OFFSETS,
    SAME_LEVEL_M,
    Line,
    Offset,
    Plummet,
    ReferenceLines,
    too_many_offsets,
)
from tankcal.units import ARCSEC

NAMELESS = ""  # name of a plummet that is not described
CLOSE_DEG = 0.01  # smallest difference of azimuth of two lines


def check_lines(values, tables, registers, raw, log):
    """Check lines, offsets, plummets and circumferences; parameters as for `Method.check`."""
    lines, offsets, straps = (tables[name] for name in ("lines", "offsets", "circumferences"))
    if not has_rows(lines) or not has_rows(offsets):
        missing = "offsets" if has_rows(lines) else "lines"
        expected = message(
            "lines_incomplete",
            "no rows; expected them: reference lines need lines.csv and offsets.csv",
        )
        if raw.tables.get(missing, ()) is not None:  # else reported already
            log.problem(raw.file_of(missing), expected)
        return
    if not is_strapped(tables) and not has_wall_points(tables):
        expected = message(
            "lines_without_strap",
            "no circumference in {file}; expected one at least, of a course that the lines read:"
            " offsets give differences of radii only",
            file=raw.file_of("circumferences"),
        )
        if raw.tables.get("circumferences", ()) is not None:  # else reported already
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
    is_complete = not (offsets.skipped or lines.skipped)
    needed = (offsets.of(name) for name in ("line", "course", "level_m"))
    if is_complete and not any(None in column for column in needed):
        _check_coverage(lines, offsets, log)
        if not has_wall_points(tables):
            _check_strapped(offsets, straps, log)


def plummets_of(registers):
    """{name: {key: value}} of the instruments that may define vertical lines.

    Tapes and stadia bars are excluded. Without such an instrument, one plummet with a blank name
    and without data is returned.
    """
    instruments, tapes = registers["instruments"], tapes_of(registers)
    plummets = {
        name: given
        for name, given in instruments.items()
        if name not in tapes and not is_bar(given["kind"])
    }
    return plummets or {NAMELESS: {field.name: None for field in REGISTER_KEYS["instruments"]}}


def plummets_used(lines, plummets):
    """Name of the plummet of each line, shape (n,); blank: the only candidate."""
    named = [name for name, keys in plummets.items() if (keys["kind"] or "").lower() == "plummet"]
    candidates = named if len(plummets) > 1 else [*plummets]
    only = candidates[0] if len(candidates) == 1 else None
    return [only if name is None else name for name in lines.of("instrument")]


def at_reference(offsets):
    """True for readings at the reference level, shape (n,); None if no level has all lines."""
    marked = [bool(flag) for flag in offsets.of("reference")]
    if any(marked):
        return np.array(marked)
    level = offsets.numbers("level_m")
    line = np.array(offsets.of("line"))
    counts = np.array([use != "check" for use in offsets.of("use")], dtype=bool)
    all_lines = set(line)
    # Without marks, the lowest level that was read on every line is the reference level.
    for height in np.unique(level[counts]):
        is_at_level = np.abs(level - height) <= SAME_LEVEL_M
        if set(line[is_at_level & counts]) == all_lines:
            return is_at_level
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
        previous = azimuth[:place]
        is_near = np.abs((previous - azimuth[place] + 180) % 360 - 180) < CLOSE_DEG
        if np.any(is_near):
            expected = message(
                "line_at_same_place",
                "{azimuth:g} degrees, as in row {row}; expected each line at a place of its own",
                azimuth=azimuth[place],
                row=lines.rows[int(np.argmax(is_near))],
            )
            log.problem(lines.file, expected, lines.rows[place], "azimuth_deg")


def _check_plummets(lines, offsets, plummets, raw, log):
    file, used = raw.file_of("instruments"), plummets_used(lines, plummets)
    register = raw.registers.get("instruments", ())
    if register is None:  # unreadable, reported already
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
    turned = _plummets_on_both_faces(lines, offsets, used)
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


def _plummets_on_both_faces(lines, offsets, used):
    """Plummets with positions, not all at one level, that were read on both faces."""
    of_line = dict(zip(lines.of("line"), used, strict=True))
    columns = (offsets.of(name) for name in ("line", "level_m", "face", "use"))
    faces, heights = {}, {}
    for line, level, face, use in zip(*columns, strict=True):
        if None not in (line, level) and use != "check":
            place = line, round(level / SAME_LEVEL_M)
            faces.setdefault(place, set()).add(int(face or 1))
            heights.setdefault(of_line.get(line), []).append(level)
    levels_of_plummet = {}
    for (line, level), faces_read in faces.items():
        if len(faces_read) == 2:
            levels_of_plummet.setdefault(of_line.get(line), set()).add(level)
    return {
        name
        for name, levels in levels_of_plummet.items()
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
    lines_at_reference = set(line[reference & counts])
    for row, name in zip(lines.rows, lines.of("line"), strict=True):
        if name is not None and name not in lines_at_reference:
            expected = message(
                "line_without_reference",
                "line {line!r} has no reading at the reference level; expected one",
                line=name,
            )
            log.problem(lines.file, expected, row, "line")
    reported = set()
    for place in np.flatnonzero(counts):
        is_at_level = (
            counts & (course == course[place]) & (np.abs(level - level[place]) <= SAME_LEVEL_M)
        )
        first = int(np.argmax(is_at_level))
        count = len(set(line[is_at_level]))
        if count < FEWEST_LINES and first not in reported:
            reported.add(first)
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
    """Require a circumference that determines the radii, if the wall has no points."""
    counts = [use != "check" for use in offsets.of("use")]
    read = {course for course, is_used in zip(offsets.of("course"), counts, strict=True) if is_used}
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


def make_lines(tables, registers):
    """Build `ReferenceLines` from tables and registers without problems."""
    lines, plummets = tables["lines"], plummets_of(registers)
    used = plummets_used(lines, plummets)
    return ReferenceLines(
        lines=_lines(lines, used),
        offsets=_offsets(tables["offsets"]),
        plummets={name: _plummet(name, plummets[name]) for name in dict.fromkeys(used)},
    )


def _lines(table, used):
    azimuth = np.radians(table.numbers("azimuth_deg"))
    # Lines without azimuths are assumed to be evenly spaced.
    if np.all(np.isnan(azimuth)):
        azimuth = 2 * np.pi * np.arange(len(azimuth)) / len(azimuth)
    columns = zip(table.of("line"), azimuth, used, table.of("side"), table.rows, strict=True)
    return {
        name: Line(name, float(angle), plummet, side == "inside", row)
        for name, angle, plummet, side, row in columns
    }


def _offsets(table):
    names = ("line", "course", "level_m", "offset_mm", "s_mm", "face", "use")
    columns = zip(*map(table.of, names), at_reference(table), table.rows, strict=True)
    return tuple(
        Offset(
            *(line, course, level, offset / 1000, sd / 1000, int(face or 1)),
            reference=bool(reference),
            check=use == "check",
            row=row,
        )
        for line, course, level, offset, sd, face, use, reference, row in columns
    )


def _plummet(name, given):
    arcsec = given["u_collimation_arcsec"]
    return Plummet(
        name,
        correction=given["correction"] or 0.0,
        u_scale=(given["u_scale_ppm"] or 0.0) / 1e6,
        u_collimation_rad=None if arcsec is None else arcsec * ARCSEC,
        certificate=given["certificate"] or "",
    )
