"""Columns of rings.csv, the rings of a horizontal cylinder from end A to end B, and its checks."""

from itertools import pairwise

from tankcal.job.checking import refuse_repeated
from tankcal.job.contract.courses import SMALLEST_THICKNESS_MM, thin_plate
from tankcal.job.contract.shorthand import choice, number, positive
from tankcal.job.fields import Field
from tankcal.messages import message

LAPS = ("inner", "outer")
RINGS = (
    Field("ring", "name", "name of the ring of plates, from end A to end B", required=True),
    positive("length_m", "length of the ring along the axis, metres", 50, required=True),
    number(
        "thickness_mm",
        "plate thickness, millimetres; blank: mean of the readings in the table thickness",
        0,
        100,
    ),
    number("paint_mm", "thickness of the paint, millimetres; blank: 0", 0, 10),
    choice(
        "lap",
        "lap of lap-jointed rings: inner or outer, for all rings or for none; only compared;"
        " blank: not known",
        LAPS,
        in_full=True,
    ),
)
COLUMNS = {"rings": RINGS}

MOST_RINGS = 100
# Largest difference of the sum of the rings from the length of the cylinder: metres, or relative.
MISS_M, MISS_RELATIVE = 0.020, 0.002


def check_rings_alone(rings, gauged, values, log):
    """Check names, plates, lengths and laps of the rings.

    Parameters
    ----------
    rings : ColumnValues
        Rows of rings.csv.
    gauged : set of str
        Names of the rings with readings of a thickness gauge.
    values : dict or None
        Values of job.toml.
    log
        Log of the problems.
    """
    refuse_repeated(rings, "ring", log)
    if len(rings.rows) > MOST_RINGS:
        expected = message(
            "too_many_rings",
            "{count} rings; expected at most {most}",
            count=len(rings.rows),
            most=MOST_RINGS,
        )
        log.problem(rings.file, expected)
    plates = zip(rings.rows, rings.of("ring"), rings.of("thickness_mm"), strict=True)
    for row, name, thickness in plates:
        if log.has(rings.file, row, "thickness_mm"):
            continue
        if thickness is None and name not in gauged:
            expected = message(
                "ring_without_plate",
                "blank; expected the plate's thickness: the tape was outside, and the table"
                " thickness has no reading of this ring",
            )
            log.problem(rings.file, expected, row, "thickness_mm")
        elif thickness is not None and 0 < thickness < SMALLEST_THICKNESS_MM:
            log.problem(rings.file, thin_plate(thickness), row, "thickness_mm")
    if values is not None:
        _check_sum(rings, values["horizontal"]["length_m"], log)
    laps = rings.of("lap")
    if None not in laps and any(lap == next_lap for lap, next_lap in pairwise(laps)):
        expected = message(
            "laps_not_in_turn",
            "adjacent rings are both inner, or both outer; lap-jointed rings alternate",
        )
        log.warning(rings.file, expected, None, "lap")


def _check_sum(rings, whole_m, log):
    """Check that the rings add up to the length of the cylinder, m."""
    lengths = rings.of("length_m")
    if whole_m is None or None in lengths or rings.skipped:
        return
    miss, allowed = sum(lengths) - whole_m, max(MISS_M, MISS_RELATIVE * whole_m)
    if abs(miss) > allowed * (1 + 1e-9):
        expected = message(
            "rings_do_not_add_up",
            "the rings add up to {sum:.4g} m, expected horizontal.length_m = {length:g} m within"
            " {allowed:.0f} mm; they differ by {miss:.0f} mm",
            sum=sum(lengths),
            length=whole_m,
            allowed=1000 * allowed,
            miss=1000 * miss,
        )
        log.problem(rings.file, expected, None, "length_m")
