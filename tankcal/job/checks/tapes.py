"""Checks of tapes and of readings by tape, of all methods that use them."""

import numpy as np

from tankcal.job.checking import (
    course_heights,
    has_rows,
    is_not_given,
    tell,
    tell_missing,
    temperature_missing,
)
from tankcal.job.contract.registers import FREE
from tankcal.job.plausibility import IMPOSSIBLE_MISS, unit_guess
from tankcal.job.tables import nearest
from tankcal.messages import message

END_M = 0.02  # largest distance of a level beyond the end of its course
NEEDED = {  # columns required for each kind of obstruction
    "butt_strap": ("thickness_mm", "width_mm"),
    "weld": ("thickness_mm", "width_mm"),
    "step": ("thickness_mm",),
    "lap": ("thickness_mm",),
    "step_over": ("over_mm", "arc_mm"),
    "measured": ("excess_mm",),
    "sag": ("span_m",),
}
THICK_WELD_MM = 5.0  # highest weld reinforcement
# Obstructions at the vertical seams of plates, and the shortest plate.
ONE_A_PLATE, LEAST_PLATE_M = ("butt_strap", "weld", "lap"), 1.2
# Free spans
DEEPEST = 0.5  # largest weight over tension of a span; the formula has an error of 0.3 % of the sag
STEEL_N_PER_M = 0.0770  # weight of steel per square millimetre of section
FROM, TO = 0.5, 3.0  # weight of a tape over that of steel: with holes, with a coating


def check_readings(straps, tables, registers, raw, log):
    """Check the tapes, their obstructions, and their comparison with a master.

    Parameters
    ----------
    straps : ColumnValues
        Readings, with the names of their circumferences.
    tables : dict
        Tables by name.
    registers : dict
        {"instruments": {name: {key: value}}, ...}.
    raw : RawJob
        Job as read.
    log : Log
        Receives problems and warnings.
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


def tapes_of(registers):
    """{name: {key: value}} of the instruments that are tapes."""
    return {
        name: given
        for name, given in registers["instruments"].items()
        if (given["kind"] or "").lower() == "tape"
    }


def tapes_read(straps, tapes):
    """Name of the tape of each reading, shape (n,); blank: the only tape that is not a master."""
    masters = {given["master"] for given in tapes.values()}
    working = [name for name in tapes if name not in masters]
    only = working[0] if len(working) == 1 else None
    return [name or only for name in straps.of("instrument")]


def tell_without_effect(tables, log):
    """Warn about tables that require circumferences, in a job without them."""
    for name in ("obstructions", "thickness", "tape_checks"):
        if has_rows(tables.get(name)):
            expected = message(
                "not_strapped", "without effect: the job has no circumferences by tape"
            )
            log.warning(tables[name].file, expected)


def refuse_repeats_elsewhere(straps, column, log):
    """Report each reading whose position differs from other readings with its name.

    column is the name of the position in the file.
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
    """Names of a table; () if unreadable rows, which are already reported, were dropped."""
    return () if table.skipped else tuple(table.of(column))


def refuse_others(table, column, known, log):
    """Report each unknown name; without known names, nothing is reported."""
    if not known or None in known:
        return
    for row, name in zip(table.rows, table.of(column), strict=True):
        if name is not None and name not in known:
            expected = message(
                "no_such_name",
                "found {name!r}; expected a name defined in the job{hint}",
                name=name,
                hint=nearest(name, known),
            )
            log.problem(table.file, expected, row, column)


def _check_tapes(straps, instruments, tapes, raw, log):
    """Require a tape for each reading, with the data that its readings need.

    instruments and tapes are {name: {key: value}}.
    """
    file = raw.file_of("instruments")
    if raw.registers.get("instruments", ()) is None:  # unreadable, reported already
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
        certified = (
            given["master"] if given["master"] in tapes else name
        )  # tape whose certificate applies
        found = [(name, *fault) for fault in _missing_of(given, tapes)]
        found += [(certified, *fault) for fault in _missing_of_certificate(given, tapes[certified])]
        for owner, key, expected in found:
            where = rows.get(owner), f"{owner}.{key}"
            if not log.has(file, *where):  # report a master of two tapes once
                log.problem(file, expected, *where)


def check_girths(straps, nominal_m, most_apart, log):
    """Compare the readings with the drawing and with each other.

    Parameters
    ----------
    straps : ColumnValues
        Readings with reading_m.
    nominal_m : float or None
        Nominal diameter.
    most_apart : float
        Largest relative difference of a reading from the median.
    log : Log
        Receives problems.
    """
    readings = straps.numbers("reading_m")
    if not np.any(np.isfinite(readings)):
        return
    median = expected_m = float(np.nanmedian(readings))
    is_far = np.abs(readings / median - 1) > most_apart
    if nominal_m is not None:
        ratio = median / (np.pi * nominal_m)
        if not 1 / (1 + IMPOSSIBLE_MISS) <= ratio <= 1 + IMPOSSIBLE_MISS:
            expected_m, is_far[0] = np.pi * nominal_m, True  # one message for all readings
    for row, reading in zip(np.array(straps.rows)[is_far], readings[is_far], strict=True):
        expected = message(
            "circle_of_other_size",
            "found {reading:g}; expected about {usual:.4g} m, as the other circumferences or"
            " tank.nominal_diameter_m have it{guess}",
            reading=reading,
            usual=expected_m,
            guess=unit_guess(float(reading) / expected_m),
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
    """Report a free scale or offset of an instrument, which a strapping does not determine."""
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
    """Yield missing data of the certificate of a tape, or of its master if it has one."""
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
    """Check that comparisons belong to exactly one working tape with a master."""
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
    """Check the settings of a strapping; alone: True if only circumferences measure the wall."""
    tapes = tapes_of(registers)
    is_lying = values["tank"]["kind"] == "horizontal"  # a vertical shell has a typical shape
    is_unknown = values["shell"]["shape_sd_mm"] is None
    if is_lying and is_unknown and is_not_given(raw, "shell", "shape_sd_mm"):
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
    """Require the temperature of a tape with an expansion coefficient, or that of the shell."""
    expands = any(given["expansion_per_k"] for given in tapes.values())
    is_read = None not in straps.of("temperature_c")
    if expands and not is_read and is_not_given(raw, "survey", "shell_temperature_c"):
        expected = message(
            "tape_of_no_temperature",
            "missing; expected it, or temperature_c of every reading: the tape expands",
        )
        tell(log.problem, raw, "survey", "shell_temperature_c", expected)


def refuse_inside(values, raw, log):
    """Refuse an inside survey if only a tape measured the wall."""
    if values["survey"]["side"] == "inside":
        expected = message(
            "strapped_inside", "found inside; expected outside: a tape lies on the outside"
        )
        tell(log.problem, raw, "survey", "side", expected)


def check_levels(straps, courses, values, log):
    """Report each level outside the course named in its row."""
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


# ---- checks of the obstructions of a tape: required lengths, plausible dimensions, small sag


def check_obstructions(table, straps, log):
    """Check the obstructions of a tape.

    Parameters
    ----------
    table : ColumnValues
        obstructions.
    straps : ColumnValues
        Readings of the circumferences.
    log : Log
        Receives problems and warnings.
    """
    for place, (row, kind) in enumerate(zip(table.rows, table.of("kind"), strict=True)):
        for column in NEEDED.get(kind, ()):
            if table.of(column)[place] is None and not log.has(table.file, row, column):
                expected = message(
                    "obstruction_incomplete",
                    "blank; expected it of an obstruction of kind {of_kind}",
                    of_kind=kind,
                )
                log.problem(table.file, expected, row, column)
        _check_sizes(table, place, log)
        over, arc = table.of("over_mm")[place], table.of("arc_mm")[place]
        if kind == "step_over" and None not in (over, arc) and over < arc:
            expected = message(
                "step_over_too_short",
                "found {over:g}; expected at least the arc of the shell, {arc:g}: over an"
                " obstruction the way is longer",
                over=over,
                arc=arc,
            )
            log.problem(table.file, expected, row, "over_mm")
    _check_counts(
        table, dict(zip(straps.of("circumference"), straps.of("reading_m"), strict=True)), log
    )


def _check_sizes(table, place, log):
    """Warn about a strip that is thicker than wide, and about an implausibly high weld."""
    kind, row = table.of("kind")[place], table.rows[place]
    thickness, width = table.of("thickness_mm")[place], table.of("width_mm")[place]
    if kind not in ("weld", "butt_strap") or None in (thickness, width):
        return
    if thickness > width:
        expected = message(
            "strip_upright",
            "{high:g} mm thick and {wide:g} mm wide: are the two columns exchanged?",
            high=thickness,
            wide=width,
        )
        log.warning(table.file, expected, row, "thickness_mm")
    elif kind == "weld" and thickness > THICK_WELD_MM:
        expected = message(
            "weld_thick",
            "found {high:g} mm; the cap of a weld stands off by {most:g} mm at most: is it that of"
            " the plate?",
            high=thickness,
            most=THICK_WELD_MM,
        )
        log.warning(table.file, expected, row, "thickness_mm")


def _check_counts(table, reading_m, log):
    """Warn about seams too close for plates; reading_m: {circumference: its length}."""
    columns = (table.of(name) for name in ("circumference", "kind", "count"))
    for row, name, kind, count in zip(table.rows, *columns, strict=True):
        length = reading_m.get(name)
        if kind not in ONE_A_PLATE or not count or length is None or count < 3:
            continue
        if length / count < LEAST_PLATE_M:
            expected = message(
                "plates_too_short",
                "{count:g} round {length_m:.1f} m: one at each seam would make plates of"
                " {plate_m:.2f} m; is the count that of this circumference?",
                count=count,
                length_m=length,
                plate_m=length / count,
            )
            log.warning(table.file, expected, row, "count")


def check_spans(table, straps, tape_names, tapes, raw, log):
    """Check weight and tension of each free tape, and the length of its spans.

    Parameters
    ----------
    table, straps : ColumnValues
        Obstructions, circumferences.
    read : list of (str or None)
        Tape of each circumference.
    tapes : dict
        {name: {key: value}}.
    raw : RawJob
        Job as read.
    log : Log
        Receives problems and warnings.
    """
    of_tape, of_strap, total = {}, {}, {}
    columns = map(table.of, ("circumference", "kind", "span_m", "count"))
    for row, name, kind, span, count in zip(table.rows, *columns, strict=True):
        if kind != "sag":
            continue
        total[name] = total.get(name, 0.0) + (span or 0.0) * (count or 1)
        for place in (
            i for i, circumference in enumerate(straps.of("circumference")) if circumference == name
        ):
            tape = tapes.get(tape_names[place])
            if tape is None:
                continue
            of_tape.setdefault(tape_names[place], name)
            least = _least_tension(straps, place, tape, tapes)
            if least is None:
                of_strap[straps.rows[place]] = tape_names[place]
            expected = span and (
                _too_long(straps.of("reading_m")[place], span, total[name])
                or _too_deep(span, least, tape["weight_n_per_m"])
            )
            if expected:
                log.problem(table.file, expected, row, "span_m")
                break
    _tell_pulls(straps.file, of_strap, log)
    if of_tape:
        _tell_weights(of_tape, tapes, raw, log)


def _least_tension(straps, place, tape, tapes):
    """Tension of a reading, or of the valid certificate, less friction; None if not given."""
    pull = straps.of("tension_n")[place]
    if pull is None:
        pull = tapes.get(tape["master"], tape)["tension_n"]
    friction_exponent = np.pi * (tape["friction"] or 0.0) / (straps.of("pulls")[place] or 1)
    return pull and pull * np.exp(-friction_exponent)


def _too_long(reading, span, total):
    """Message about spans longer than the circumference, or None."""
    if reading is None or total < reading:
        return None
    return message(
        "span_longer_than_round",
        "found {span:g}; the spans add up to {all:g} m; expected less than the reading of the"
        " tape, {reading:g} m",
        span=span,
        all=total,
        reading=reading,
    )


def _too_deep(span, tension, weight):
    """Message about a sag too large for the formula, or None."""
    if None in (tension, weight) or span <= DEEPEST * tension / weight:
        return None
    return message(
        "span_hangs_deep",
        "found {span:g}; expected at most {most:.1f} m: at {tension:.0f} N a tape of {weight:g} N/m"
        " hangs too deep for the formula",
        span=span,
        most=DEEPEST * tension / weight,
        tension=tension,
        weight=weight,
    )


def _tell_pulls(file, of_strap, log):
    for row, tape in of_strap.items():
        expected = message(
            "span_pull_missing",
            "blank, and the certificate of tape {tape!r} has no tension, either; expected the pull:"
            " the tape hangs free over a span",
            tape=tape,
        )
        log.problem(file, expected, row, "tension_n")


def _tell_weights(of_tape, tapes, raw, log):
    """Report tapes without a weight; warn if the weight does not fit steel of the section."""
    file, rows = raw.file_of("instruments"), raw.registers["instruments"].rows
    for tape, name in of_tape.items():
        weight, section = (tapes[tape][key] for key in ("weight_n_per_m", "section_mm2"))
        place = rows.get(tape), f"{tape}.weight_n_per_m"
        if weight is None:
            expected = message(
                "span_weight_missing",
                "missing; expected the weight of a metre of the tape: it hangs free over a span of"
                " circumference {name!r}",
                name=name,
            )
            log.problem(file, expected, *place)
        elif section and not FROM <= weight / (STEEL_N_PER_M * section) <= TO:
            expected = message(
                "tape_weight_unlike_steel",
                "found {weight:g}; steel of {section:g} mm² weighs {expected:.2f} N/m: is it"
                " newtons per metre?",
                weight=weight,
                section=section,
                expected=STEEL_N_PER_M * section,
            )
            log.warning(file, expected, *place)
