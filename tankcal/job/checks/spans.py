"""Free spans of a tape: is known what their sag needs, and is the tape nearly straight there?"""

import numpy as np

from tankcal.messages import message

DEEPEST = 0.5  # weight of a span over the tension: the formula is off by 0.3 % of the sag there
STEEL_N_PER_M = 0.0770  # of each square millimetre
FROM, TO = 0.5, 3.0  # of that a tape weighs: holes for the one, a coat for the other


def check_spans(table, straps, read, tapes, raw, log):
    """Weight and pull of each tape that hangs free, and spans that a tape can cross.

    Parameters
    ----------
    table, straps : Table
        Obstructions, circumferences.
    read : list of (str or None)
        Tape of each circumference.
    tapes : dict
        {name: {key: value}}.
    raw, log
        Of the job.
    """
    of_tape, of_strap, whole = {}, {}, {}
    columns = map(table.of, ("circumference", "kind", "span_m", "count"))
    for row, name, kind, span, count in zip(table.rows, *columns, strict=True):
        if kind != "sag":
            continue
        whole[name] = whole.get(name, 0.0) + (span or 0.0) * (count or 1)
        for place in (i for i, one in enumerate(straps.of("circumference")) if one == name):
            tape = tapes.get(read[place])
            if tape is None:
                continue
            of_tape.setdefault(read[place], name)
            least = _least_tension(straps, place, tape, tapes)
            if least is None:
                of_strap[straps.rows[place]] = read[place]
            expected = span and (
                _too_long(straps.of("reading_m")[place], span, whole[name])
                or _too_deep(span, least, tape["weight_n_per_m"])
            )
            if expected:
                log.problem(table.file, expected, row, "span_m")
                break
    _tell_pulls(straps.file, of_strap, log)
    if of_tape:
        _tell_weights(of_tape, tapes, raw, log)


def _least_tension(straps, place, tape, tapes):
    """Pull of a reading, or that of the certificate that counts, less friction; None: not said."""
    pull = straps.of("tension_n")[place]
    if pull is None:
        pull = tapes.get(tape["master"], tape)["tension_n"]
    lost = np.pi * (tape["friction"] or 0.0) / (straps.of("pulls")[place] or 1)
    return pull and pull * np.exp(-lost)


def _too_long(reading, span, whole):
    """What to say of spans that are longer than the way round the tank; None: they are not."""
    if reading is None or whole < reading:
        return None
    return message(
        "span_longer_than_round",
        "found {span:g}; the spans add up to {all:g} m; expected less than the reading of the"
        " tape, {reading:g} m",
        span=span,
        all=whole,
        reading=reading,
    )


def _too_deep(span, tension, weight):
    """What to say of a tape that hangs too deep for the formula of its sag; None: it does not."""
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
    """A problem for each tape without a weight, a warning for one unlike steel of its section."""
    file, rows = raw.file_of("instruments"), raw.registers["instruments"].rows
    for tape, name in of_tape.items():
        weight, section = (tapes[tape][key] for key in ("weight_n_per_m", "section_mm2"))
        where = rows.get(tape), f"{tape}.weight_n_per_m"
        if weight is None:
            expected = message(
                "span_weight_missing",
                "missing; expected the weight of a metre of the tape: it hangs free over a span of"
                " circumference {name!r}",
                name=name,
            )
            log.problem(file, expected, *where)
        elif section and not FROM <= weight / (STEEL_N_PER_M * section) <= TO:
            expected = message(
                "tape_weight_unlike_steel",
                "found {weight:g}; steel of {section:g} mm² weighs {expected:.2f} N/m: is it"
                " newtons per metre?",
                weight=weight,
                section=section,
                expected=STEEL_N_PER_M * section,
            )
            log.warning(file, expected, *where)
