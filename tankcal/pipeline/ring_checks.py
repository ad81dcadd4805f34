"""Warnings about the rings of a lying tank: what a sound crew on a sound tank hardly brings home.

Lap-jointed rings are inner and outer in turn: the inside radius of an outer ring is larger by the
plate of its inner neighbours. Rings that were exchanged in a file break that order.
"""

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.pipeline.compared_courses import exchanged_courses
from tankcal.pipeline.cross_checks import check_side
from tankcal.pipeline.nominal_size import allowed_departure_m, departure_of_size
from tankcal.pipeline.strapping_checks import (
    FAR_LIMITS,
    FILE,
    check_repeats,
    limit_of_repeats,
    read_once,
    straps_apart,
)
from tankcal.pipeline.survey_limits import limits_of
from tankcal.pipeline.tape_checks import check_tapes
from tankcal.pipeline.wall_readings import names_of

LIMITS = "repeats_lying"  # of the rule file
FITS = 0.5  # of a plate: mean step that is left where an order of laps fits; a step of laps


def check_rings(job, wall):
    """`Problem`s of a `RingedWall`."""
    straps = wall.straps
    return (
        *check_tapes(job, straps),
        *check_repeats(straps, LIMITS),
        *_of_pairs(job, straps),
        *_of_others(job, straps),
        *_of_laps(job, straps),
        *_of_nominal(job, straps),
        *_uncontrolled(job, wall),
    )


def _problem(text, row=None, column="reading_m"):
    return Problem(FILE, text, row=row, column=column)


def _of_pairs(job, straps):
    """A strap that stands far from the others of its ring, further than rings taper."""
    for size, one, count, usual in straps_apart(names_of(job.rings), straps):
        template = (
            "the {count} straps of ring {ring!r} differ by {apart_mm:.1f} mm, those of other rings"
            " by {usual_mm:.1f} mm: is one of them misread, over an obstruction or not square to"
            " the axis?"
        )
        ring, apart, least = one.strap.course, 1000 * size, 1000 * usual
        if size > FAR_LIMITS * limit_of_repeats(one.circumference_m, LIMITS):
            text = message(
                "strap_of_ring_far",
                template,
                count=count,
                ring=ring,
                apart_mm=apart,
                usual_mm=least,
            )
        else:
            text = message(
                "strap_of_ring_apart",
                template,
                count=count,
                ring=ring,
                apart_mm=apart,
                usual_mm=least,
            )
        yield _problem(text, one.strap.row)


def _of_others(job, straps):
    """A ring whose radius differs from the median of the others of its lap by more than a part of
    a plate and a tolerance; where laps are not given, by a plate more.
    """
    plates = np.array([ring.thickness_m + ring.paint_m for ring in job.rings])
    inside, names = straps.radius_m - plates, names_of(job.rings)
    laps = np.array([ring.lap or "" for ring in job.rings])
    step = float(np.max(plates)) * (FITS if np.all(laps != "") else 1.0)
    if np.any(laps == ""):
        laps[:] = ""
    for lap in dict.fromkeys(laps.tolist()):
        alike = np.flatnonzero(laps == lap)
        median = float(np.median(inside[alike]))
        allowed = limits_of("nominal_size")["share"] * median + step
        for place in alike[np.abs(inside[alike] - median) > allowed]:
            text = message(
                "ring_far",
                "ring {ring!r} comes out {miss_mm:+.1f} mm of radius from the others, more than a"
                " lap: is a strap of it misread or over an obstruction, or is its plate another"
                " one?",
                ring=names[place],
                miss_mm=1000 * float(inside[place] - median),
            )
            yield _problem(text, column="ring")


def _of_laps(job, straps):
    """Rings that look exchanged, and an order that is not that of rings.csv."""
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
    found = exchanged_rings(straps.radius_m, plates, thickness, laps)
    if found:
        pairs = "; ".join(f"{names[one]} - {names[other]}" for one, other, *_ in found)
        text = message(
            "rings_exchanged",
            "with the readings of two rings exchanged ({pairs}) the rings would be inner and outer"
            " in turn, and steps that laps do not explain would add up to {left_mm:.1f} mm in place"
            " of {steps_mm:.1f} mm: are they mixed up?",
            pairs=pairs,
            left_mm=1000 * found[0][2],
            steps_mm=1000 * found[0][3],
        )
        yield _problem(text, column="ring")


def _steps_of_laps(inside_m, thickness_m, outer):
    """Mean of how much wider outer rings are than their neighbours, over the plate of the inner;
    0 without such neighbours.
    """
    found = []
    for i in range(len(outer) - 1):
        if outer[i] != outer[i + 1]:
            wide, narrow = (i, i + 1) if outer[i] else (i + 1, i)
            if thickness_m[narrow] > 0:
                found.append((inside_m[wide] - inside_m[narrow]) / thickness_m[narrow])
    return float(np.mean(found)) if found else 0.0


def exchanged_rings(outside_m, plates_m, thickness_m, laps):
    """The pairs of rings that look exchanged, by the steps that laps leave between neighbours.

    Rings that fit one order as they stand (butt-jointed, or inner and outer in turn, as `laps` say
    or either way where these say nothing) are sound. Of rings that do not, each pair is tried in
    each order.

    Parameters
    ----------
    outside_m, plates_m : ndarray, shape (rings,)
        Radius of the outside, and plate with paint.
    thickness_m : ndarray, shape (rings,)
        Of the plates.
    laps : sequence of str or None
        "inner" or "outer" of each ring.

    Returns
    -------
    list of (int, int, float, float)
        The pair, the sum of the steps with it exchanged, and as it is, m; two of them where rings
        that begin with an inner or with an outer one explain the readings as well.

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
    shifts = [outer * _inner_plates(thickness_m, outer) for outer in orders]
    inside = outside_m - plates_m
    steps = [np.abs(np.diff(inside - shift)).sum() for shift in shifts]
    if min(steps) < FITS * float(np.median(thickness_m)) * (count - 1):
        return []
    found = [exchanged_courses(outside_m, plates_m + shift, range(count)) for shift in shifts]
    found = [one for one in found if one is not None]
    least = min((left for _, _, left, _ in found), default=0.0)
    alike = least + FITS * float(np.median(thickness_m))
    return list({one[:2]: one for one in found if one[2] <= alike}.values())


def _inner_plates(thickness_m, outer):
    """(rings,) mean plate of the inner rings that each touches; of none its own."""
    found = thickness_m.astype(float)
    for i in range(len(outer)):
        beside = [k for k in (i - 1, i + 1) if 0 <= k < len(outer) and not outer[k]]
        if beside:
            found[i] = np.mean(thickness_m[beside])
    return found


def _of_nominal(job, straps):
    """The mean inside diameter against the drawing's."""
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
    """Rings of one reading alone: a blunder in it nothing would show."""
    alone = read_once(names_of(job.rings), wall)
    if alone:
        text = message(
            "rings_controlled_by_nothing",
            "rings {rings}: a single reading, which nothing controls; a second strap would",
            rings=", ".join(alone),
        )
        yield _problem(text, column="ring")
