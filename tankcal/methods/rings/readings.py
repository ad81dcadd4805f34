"""Rings of a horizontal cylinder: checks with their circumferences, `Ring`s in SI, diameter."""

from itertools import pairwise

import numpy as np

from tankcal.job.assembly import gauged_plate
from tankcal.job.checking import has_rows, refuse_repeated
from tankcal.job.checks.extent import has_wall_points, is_strapped, is_supplemented
from tankcal.job.checks.tapes import (
    END_M,
    check_girths,
    check_readings,
    check_strapping_settings,
    refuse_others,
    refuse_repeats_elsewhere,
    tell_without_effect,
)
from tankcal.job.contract.courses import SMALLEST_THICKNESS_MM, thin_plate
from tankcal.job.model import Ring
from tankcal.job.plausibility import IMPOSSIBLE_MISS
from tankcal.job.structure import structure
from tankcal.job.tapes import mean_plates
from tankcal.messages import message
from tankcal.survey.strapping import MOST_STRAPS, too_many_straps

MOST_RINGS = 100
# Largest difference of the sum of the rings from the length of the cylinder: metres, or relative.
MISS_M, MISS_RELATIVE = 0.020, 0.002


def check_rings(values, tables, registers, raw, log):
    """Check rings, circumferences and other measurements; parameters as for `Method.check`."""
    rings, straps = tables["rings"], tables["circumferences"]
    if not is_strapped(tables) and not has_rows(rings):
        tell_without_effect(tables, log)
        return
    if not _are_both_there(tables, raw, log):
        return
    _refuse_beside(tables, log)
    if len(straps.rows) > MOST_STRAPS:
        log.problem(straps.file, too_many_straps(len(straps.rows)))
        return
    gauged_rings = tables["thickness"].of("ring") if has_rows(tables["thickness"]) else ()
    _check_rings_alone(rings, set(gauged_rings), values, log)
    known = tuple(rings.of("ring"))
    refuse_others(straps, "ring", known, log)
    if has_rows(tables["thickness"]):
        refuse_others(tables["thickness"], "ring", known, log)
    refuse_repeats_elsewhere(straps, "from_a_m", log)
    _tell_rings_not_strapped(rings, straps, log)
    _check_places(rings, straps, log)
    check_readings(straps, tables, registers, raw, log)
    if values is not None:
        check_girths(straps, values["tank"]["nominal_diameter_m"], IMPOSSIBLE_MISS, log)
        check_strapping_settings(values, tables, registers, True, raw, log)


def _are_both_there(tables, raw, log):
    """Return True if rings and circumferences exist; a missing table is reported once."""
    for name, other in (("rings", "circumferences"), ("circumferences", "rings")):
        if has_rows(tables[name]):
            continue
        if raw.tables.get(name, ()) is None:  # unreadable, reported already
            return False
        expected = message(
            "rings_without_tape",
            "no rows; expected a row in each of rings and circumferences: a ring has its radius"
            " from the tape, and the tape its ring ({other} has rows)",
            other=other,
        )
        log.problem(raw.file_of(name), expected)
        return False
    return True


def _refuse_beside(tables, log):
    for is_there, what in (
        (has_wall_points(tables), message("points_beside_rings", "points of the wall")),
        (is_supplemented(tables), message("metered_runs", "runs of metered liquid")),
    ):
        if is_there:
            expected = message(
                "rings_beside",
                "given together with {what}; expected only one of them: the wall of a lying tank"
                " comes from one kind of survey",
                what=what,
            )
            log.problem(tables["rings"].file, expected)


def _tell_rings_not_strapped(rings, straps, log):
    pairs = zip(straps.of("ring"), straps.of("use"), strict=True)
    reached = {ring for ring, use in pairs if use != "check"}
    if straps.skipped or rings.skipped or None in reached:
        return
    for row, name in zip(rings.rows, rings.of("ring"), strict=True):
        if name is not None and name not in reached:
            expected = message(
                "ring_not_strapped",
                "no circumference was measured on ring {ring!r}; expected one at least in {file}",
                ring=name,
                file=straps.file,
            )
            log.problem(rings.file, expected, row, "ring")


def _check_places(rings, straps, log):
    """Report each position of the tape that is not on the ring named in its row."""
    lengths, names = rings.of("length_m"), rings.of("ring")
    if None in lengths or rings.skipped:
        return
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    rows = zip(straps.rows, straps.of("ring"), straps.of("from_a_m"), strict=True)
    for row, ring, place in rows:
        if place is None or ring not in names:
            continue
        index = names.index(ring)
        low, high = ends[index], ends[index + 1]
        if not low - END_M <= place <= high + END_M:
            expected = message(
                "place_outside_ring",
                "found {place:g}; expected a place on ring {ring!r}, from {low:.3f} to {high:.3f} m"
                " from A",
                place=place,
                ring=ring,
                low=low,
                high=high,
            )
            log.problem(straps.file, expected, row, "from_a_m")


def _check_rings_alone(rings, gauged, values, log):
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


def make_rings(tables):
    """Build the `Ring`s from end A to end B from tables without problems."""
    gauge_means = mean_plates(tables["thickness"])
    return tuple(
        structure(Ring, cells | gauged_plate(gauge_means.get(cells["ring"])), name=cells["ring"])
        for cells in tables["rings"].records()
    )


def estimate_diameter_m(tables):
    """Approximate inside diameter of strapped rings, m; None without readings of a tape."""
    if tables["circumferences"] is None:
        return None
    readings = [value for value in tables["circumferences"].of("reading_m") if value is not None]
    plates = [value for value in tables["rings"].of("thickness_mm") if value is not None]
    if not readings:
        return None
    # Subtract two plates from the outside diameter, mm to m.
    return float(np.median(readings) / np.pi - 2e-3 * (np.median(plates) if plates else 0.0))
