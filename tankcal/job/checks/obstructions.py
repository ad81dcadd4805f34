"""Checks of the obstructions of a tape: required lengths, plausible dimensions."""

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
