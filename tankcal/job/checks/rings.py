"""Checks of the rings of a lying cylinder together with their circumferences."""

import numpy as np

from tankcal.job.checking import has_rows
from tankcal.job.checks.extent import has_wall_points, is_metered, is_strapped
from tankcal.job.checks.strapping import (
    END_M,
    MOST_STRAPS,
    check_girths,
    check_readings,
    check_strapping_settings,
    refuse_others,
    refuse_repeats_elsewhere,
    tell_without_effect,
    too_many_straps,
)
from tankcal.job.contract.rings import check_rings_alone
from tankcal.job.plausibility import IMPOSSIBLE_MISS
from tankcal.messages import message


def check_rings(values, tables, registers, raw, log):
    """Check rings, circumferences and other measurements; parameters as for `check_all`."""
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
    check_rings_alone(rings, set(gauged_rings), values, log)
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
        (is_metered(tables), message("metered_runs", "runs of metered liquid")),
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
