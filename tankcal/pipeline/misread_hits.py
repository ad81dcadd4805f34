"""Wall hits that show no circle as they are read: what would make them show one.

Angles in another unit than their column says, and distances that are horizontal.
"""

from itertools import product

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.circles import taubin_circle
from tankcal.messages import message
from tankcal.survey.sighting import rays
from tankcal.survey.untied import sees_all_around

GON_IN_DEG, DEG_IN_GON = 0.9, 1 / 0.9  # what turns a value that is read so into what was meant
CLOSER = 0.2  # scatter about a circle, of that as it is read, from which on another unit is told
LEAST_M, FEWEST = 0.01, 12  # scatter that no unit explains; hits of a set-up
LEAST_SINE = 1e-3  # of zenith angles: a sight straight up has no horizontal distance


def refuse_other_units(hits):
    """Raise InputError where directions or zenith angles of a set-up fit a circle in another unit,
    or its distances if they are horizontal.

    hits  WallHits
    """
    problems = []
    setup = np.array(hits.setup)
    for name in dict.fromkeys(hits.setup):
        mine = setup == name
        if mine.sum() < FEWEST:
            continue
        factors = product((1.0, GON_IN_DEG, DEG_IN_GON), repeat=2)
        found = {pair: _scatter(hits, mine, *pair) for pair in factors}
        usual = found[1.0, 1.0] = _scatter(hits, mine, 1.0, 1.0, is_part_enough=True)
        best = min(found, key=found.get)
        if usual < LEAST_M:
            continue
        row = hits.rows[int(np.argmax(mine))] if hits.rows else None
        if found[best] > CLOSER * usual:
            if _scatter(hits, mine, 1.0, 1.0, are_horizontal=True) <= CLOSER * usual:
                problems.append(Problem(hits.file, _HORIZONTAL, row, "distance_m"))
            continue
        problems += [
            Problem(hits.file, _text(factor), row, column)
            for factor, column in zip(best, ("direction", "zenith"), strict=True)
            if factor != 1.0
        ]
    if problems:
        raise InputError(problems)


def _scatter(hits, mine, of_direction, of_zenith, *, are_horizontal=False, is_part_enough=False):
    """Median distance of the hits of a set-up from their circle, m; inf: it sees no whole turn.

    is_part_enough  True: part of one will do
    """
    ray = rays(of_direction * hits.direction_rad[mine], of_zenith * hits.zenith_rad[mine])[0]
    places = hits.distance_m[mine, None] * ray
    if are_horizontal:
        places /= np.maximum(np.sin(hits.zenith_rad[mine, None]), LEAST_SINE)
    if not (is_part_enough or sees_all_around(places)) or np.ptp(places[:, :2], axis=0).min() == 0:
        return np.inf
    local = places[:, :2] - places[:, :2].mean(axis=0)
    x, y, radius = taubin_circle(local)
    return float(np.median(np.abs(np.hypot(local[:, 0] - x, local[:, 1] - y) - radius)))


_HORIZONTAL = message(
    "hits_horizontal",
    "the hits of the set-up fit a circle if these are horizontal distances; expected slope"
    " distances, as the instrument measures them",
)


def _text(factor):
    if factor == GON_IN_DEG:
        return message(
            "hits_in_gon", "the hits of the set-up fit a circle if these are gon: is it so?"
        )
    return message(
        "hits_in_degrees", "the hits of the set-up fit a circle if these are degrees: is it so?"
    )
