"""Wall hits that lie on a circle only if their readings are interpreted otherwise.

The checks try angles in another unit than the column states, and horizontal distances.
"""

from itertools import product

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.circles import taubin_circle
from tankcal.messages import message
from tankcal.survey.sighting import rays
from tankcal.survey.untied import sees_all_around
from tankcal.units import DEG_IN_GON, GON_IN_DEG

# Factors that convert an angle read as degrees but given in gon, and the reverse.
CLOSER = 0.2  # largest ratio of the scatter in another unit to that as read, to report the unit
# Least scatter about the circle that needs an explanation, least number of hits of a set-up.
LEAST_M, FEWEST = 0.01, 12
LEAST_SINE = 1e-3  # lower bound of the sine of the zenith angle; avoids division by zero


def refuse_other_units(hits):
    """Raise InputError for hits that fit a circle only in another unit or as horizontal distances.

    Parameters
    ----------
    hits : WallHits
        Directions and zenith angles, rad, and distances, m.

    Raises
    ------
    InputError
        With a problem for each set-up and column concerned.
    """
    problems = []
    setup = np.array(hits.setup)
    for name in dict.fromkeys(hits.setup):
        is_of_setup = setup == name
        if is_of_setup.sum() < FEWEST:
            continue
        factors = product((1.0, GON_IN_DEG, DEG_IN_GON), repeat=2)
        scatter_m = {pair: _scatter(hits, is_of_setup, *pair) for pair in factors}
        scatter_as_read = scatter_m[1.0, 1.0] = _scatter(
            hits, is_of_setup, 1.0, 1.0, is_part_enough=True
        )
        best = min(scatter_m, key=scatter_m.get)
        if scatter_as_read < LEAST_M:
            continue
        row = hits.rows[int(np.argmax(is_of_setup))] if hits.rows else None
        if scatter_m[best] > CLOSER * scatter_as_read:
            if (
                _scatter(hits, is_of_setup, 1.0, 1.0, are_horizontal=True)
                <= CLOSER * scatter_as_read
            ):
                problems.append(Problem(hits.file, _HORIZONTAL, row, "distance_m"))
            continue
        problems += [
            Problem(hits.file, _text(factor), row, column)
            for factor, column in zip(best, ("direction", "zenith"), strict=True)
            if factor != 1.0
        ]
    if problems:
        raise InputError(problems)


def _scatter(
    hits,
    is_of_setup,
    direction_factor,
    zenith_factor,
    *,
    are_horizontal=False,
    is_part_enough=False,
):
    """Median distance of the hits of a set-up from the fitted circle, m.

    The result is infinite if the hits do not surround the set-up.

    Parameters
    ----------
    hits : WallHits
    is_of_setup : ndarray of bool, shape (n,)
        Hits of the set-up.
    direction_factor, zenith_factor : float
        Factors that convert the angles as read to the tried unit.
    are_horizontal : bool
        Treat the distances as horizontal instead of slope distances.
    is_part_enough : bool
        Accept hits that do not surround the set-up.
    """
    ray = rays(
        direction_factor * hits.direction_rad[is_of_setup],
        zenith_factor * hits.zenith_rad[is_of_setup],
    )[0]
    position_m = hits.distance_m[is_of_setup, None] * ray
    if are_horizontal:
        position_m /= np.maximum(np.sin(hits.zenith_rad[is_of_setup, None]), LEAST_SINE)
    if (
        not (is_part_enough or sees_all_around(position_m))
        or np.ptp(position_m[:, :2], axis=0).min() == 0
    ):
        return np.inf
    # Centred coordinates keep the algebraic circle fit well conditioned.
    local = position_m[:, :2] - position_m[:, :2].mean(axis=0)
    x, y, radius = taubin_circle(local)
    return float(np.median(np.abs(np.hypot(local[:, 0] - x, local[:, 1] - y) - radius)))


_HORIZONTAL = message(
    "hits_horizontal",
    "the hits of the set-up fit a circle if these are horizontal distances; expected slope"
    " distances, as the instrument measures them",
)


def _text(factor):
    """Message that proposes the unit of the given factor."""
    if factor == GON_IN_DEG:
        return message(
            "hits_in_gon", "the hits of the set-up fit a circle if these are gon: is it so?"
        )
    return message(
        "hits_in_degrees", "the hits of the set-up fit a circle if these are degrees: is it so?"
    )
