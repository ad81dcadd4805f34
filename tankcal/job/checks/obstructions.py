"""Checks of the obstructions of a tape: required lengths, plausible dimensions, small sag."""

import numpy as np

from tankcal.messages import message

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
