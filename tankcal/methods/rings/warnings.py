"""Warnings about the rings of a horizontal tank that are unlikely for a valid survey.

Lap-jointed rings are inner and outer in turn. The inside radius of an outer ring is larger by the
plate thickness of its inner neighbours. Rings exchanged in a file break this order.
"""

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.methods.strapping.tape_warnings import check_tapes
from tankcal.methods.strapping.warnings import (
    FAR_LIMITS,
    FILE,
    check_repeats,
    limit_of_repeats,
    read_once,
    straps_apart,
)
from tankcal.pipeline.checks.size import allowed_departure_m, check_side, departure_of_size
from tankcal.pipeline.checks.survey import limits_of
from tankcal.pipeline.read_wall import names_of
from tankcal.pipeline.taped_wall import exchanged_courses

LIMITS = "repeats_lying"  # table of the rule file
# Mean remaining step, as a share of a plate, below which an order of laps fits; also the least
# step in the wrong direction that counts as a contradiction of rings.csv.
FITS = 0.5


def check_rings(job, wall):
    """`Problem`s of a `RingedWall`."""
    straps = wall.straps
    return (
        *check_tapes(job, straps, job.strapping),
        *check_repeats(straps, LIMITS),
        *_check_pairs(job, straps),
        *_check_other_rings(job, straps),
        *_check_laps(job, straps),
        *_check_nominal(job, straps),
        *_uncontrolled(job, wall),
    )


def _problem(text, row=None, column="reading_m"):
    return Problem(FILE, text, row=row, column=column)


def _check_pairs(job, straps):
    """Problems of straps that differ from the other straps of their ring by more than taper."""
    for size, strap, count, typical in straps_apart(names_of(job.rings), straps):
        template = (
            "the {count} straps of ring {ring!r} differ by {apart_mm:.1f} mm, those of other rings"
            " by {usual_mm:.1f} mm: is one of them misread, over an obstruction or not square to"
            " the axis?"
        )
        ring, apart_mm, least = strap.strap.course, 1000 * size, 1000 * typical
        if size > FAR_LIMITS * limit_of_repeats(strap.circumference_m, LIMITS):
            text = message(
                "strap_of_ring_far",
                template,
                count=count,
                ring=ring,
                apart_mm=apart_mm,
                usual_mm=least,
            )
        else:
            text = message(
                "strap_of_ring_apart",
                template,
                count=count,
                ring=ring,
                apart_mm=apart_mm,
                usual_mm=least,
            )
        yield _problem(text, strap.strap.row)


def _check_other_rings(job, straps):
    """Problems of rings whose radius differs from the median of the other rings of the same lap.

    The tolerance is a nominal share plus part of a plate, or a whole plate if the laps are not
    given.
    """
    plates = np.array([ring.thickness_m + ring.paint_m for ring in job.rings])
    inside, names = straps.radius_m - plates, names_of(job.rings)
    laps = np.array([ring.lap or "" for ring in job.rings])
    step = float(np.max(plates)) * (FITS if np.all(laps != "") else 1.0)
    if np.any(laps == ""):
        laps[:] = ""
    for lap in dict.fromkeys(laps.tolist()):
        same_lap = np.flatnonzero(laps == lap)
        median = float(np.median(inside[same_lap]))
        allowed = limits_of("nominal_size")["share"] * median + step
        for place in same_lap[np.abs(inside[same_lap] - median) > allowed]:
            text = message(
                "ring_far",
                "ring {ring!r} comes out {miss_mm:+.1f} mm of radius from the others, more than a"
                " lap: is a strap of it misread or over an obstruction, or is its plate another"
                " one?",
                ring=names[place],
                miss_mm=1000 * float(inside[place] - median),
            )
            yield _problem(text, column="ring")


def _check_laps(job, straps):
    """Problems of rings that appear exchanged, and of an order that contradicts rings.csv."""
    plates = np.array([ring.thickness_m + ring.paint_m for ring in job.rings])
    laps = [ring.lap for ring in job.rings]
    thickness = np.array([ring.thickness_m for ring in job.rings])
    names = names_of(job.rings)
    if None not in laps and len(names) > 1:
        outer = np.array([lap == "outer" for lap in laps])
        if _steps_of_laps(straps.radius_m - plates, thickness, outer) < -FITS:
            yield _problem(
                message(
                    "laps_reversed",
                    "the rings that rings.csv calls inner are the wider ones, by about their"
                    " plates: are inner and outer rings mixed up, or the rows of the tape?",
                ),
                column="ring",
            )
            return
    pairs_found = exchanged_rings(straps.radius_m, plates, thickness, laps)
    if pairs_found:
        pairs = "; ".join(f"{names[first]} - {names[second]}" for first, second, *_ in pairs_found)
        text = message(
            "rings_exchanged",
            "with the readings of two rings exchanged ({pairs}) the rings would be inner and outer"
            " in turn, and steps that laps do not explain would add up to {left_mm:.1f} mm in place"
            " of {steps_mm:.1f} mm: are they mixed up?",
            pairs=pairs,
            left_mm=1000 * pairs_found[0][2],
            steps_mm=1000 * pairs_found[0][3],
        )
        yield _problem(text, column="ring")


def _steps_of_laps(inside_m, thickness_m, outer):
    """Mean step from inner to outer neighbours over the inner plate; 0 without such neighbours."""
    steps = []
    for i in range(len(outer) - 1):
        if outer[i] != outer[i + 1]:
            outer_ring, inner_ring = (i, i + 1) if outer[i] else (i + 1, i)
            if thickness_m[inner_ring] > 0:
                steps.append(
                    (inside_m[outer_ring] - inside_m[inner_ring]) / thickness_m[inner_ring]
                )
    return float(np.mean(steps)) if steps else 0.0


def exchanged_rings(outside_m, plates_m, thickness_m, laps):
    """Pairs of rings that appear exchanged, from the steps that laps leave between neighbours.

    The rings are valid if they fit an order: butt-jointed, or inner and outer in turn. The order is
    that in `laps`, or either order if `laps` states none. Otherwise each pair is tried in each
    order.

    Parameters
    ----------
    outside_m, plates_m : ndarray, shape (rings,)
        Outside radii, and plate thicknesses including paint, m.
    thickness_m : ndarray, shape (rings,)
        Plate thicknesses, m.
    laps : sequence of str or None
        "inner" or "outer" for each ring.

    Returns
    -------
    list of (int, int, float, float)
        The pair, and the sums of the steps with the pair exchanged and as read, m. Two entries if
        orders that begin with an inner or an outer ring explain the readings equally well.

    Examples
    --------
    >>> plates = np.full(5, 0.008)
    >>> inside = np.array([1.200, 1.200, 1.192, 1.192, 1.200])
    >>> [pair[:2] for pair in exchanged_rings(inside + plates, plates, plates, [None] * 5)]
    [(1, 2)]
    """
    count = len(outside_m)
    if count < 3:
        return []
    if None in laps:
        first = np.arange(count) % 2 == 0
        orders = [np.zeros(count, dtype=bool), first, ~first]
    else:
        orders = [np.array([lap == "outer" for lap in laps])]
    # In the true order, outer rings are wider by the inner plates; after subtraction no step
    # remains.
    shifts = [outer * _inner_plates(thickness_m, outer) for outer in orders]
    inside = outside_m - plates_m
    steps = [np.abs(np.diff(inside - shift)).sum() for shift in shifts]
    if min(steps) < FITS * float(np.median(thickness_m)) * (count - 1):
        return []
    exchanged = [exchanged_courses(outside_m, plates_m + shift, range(count)) for shift in shifts]
    exchanged = [result for result in exchanged if result is not None]
    least = min((sum_m for _, _, sum_m, _ in exchanged), default=0.0)
    limit = least + FITS * float(np.median(thickness_m))
    return list({result[:2]: result for result in exchanged if result[2] <= limit}.values())


def _inner_plates(thickness_m, outer):
    """Mean plate of the inner neighbours of each ring, or its own plate without any, m."""
    plates_m = thickness_m.astype(float)
    for i in range(len(outer)):
        inner_neighbours = [k for k in (i - 1, i + 1) if 0 <= k < len(outer) and not outer[k]]
        if inner_neighbours:
            plates_m[i] = np.mean(thickness_m[inner_neighbours])
    return plates_m


def _check_nominal(job, straps):
    """Problems of a mean inside diameter that differs from the drawing."""
    nominal = job.tank.nominal_diameter_m
    if nominal is None:
        return
    plates = np.array([ring.thickness_m + ring.paint_m for ring in job.rings])
    inside = 2 * float(np.mean(straps.radius_m - plates))
    yield from check_side(job, inside, float(np.mean(plates)), 0.0)
    if job.diameter_is is None and abs(inside - nominal) > 2 * allowed_departure_m(job):
        template = "the rings come out {miss_mm:+.0f} mm of inside diameter from the nominal one"
        miss = 1000 * (inside - nominal)
        if departure_of_size(job, inside / 2, float(np.mean(plates))):
            text = message("rings_unlike_nominal", template, miss_mm=miss)
        else:
            text = message("rings_short_by_plates", template, miss_mm=miss)
        yield _problem(text)


def _uncontrolled(job, wall):
    """Problems of rings with a single reading, in which no other reading reveals a blunder."""
    single = read_once(names_of(job.rings), wall)
    if single:
        text = message(
            "rings_controlled_by_nothing",
            "rings {rings}: a single reading, which nothing controls; a second strap would",
            rings=", ".join(single),
        )
        yield _problem(text, column="ring")
