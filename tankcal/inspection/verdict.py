"""The verdict on a figure of an inspection: guard bands and probability of conformity.

With the limit L of |value| and the expanded uncertainty U

    passed              |value| + U <= L
    guard_band          |value| <= L < |value| + U          (conditional pass)
    guard_band_beyond   |value| - U <= L < |value|          (conditional fail)
    failed              L < |value| - U

A limit that must be reached (the share that a plane explains) is judged in the same way downwards.
A U of 95 % leaves 2.5 % on either side: at most 2.5 % of the tanks beyond a limit pass, and at most
2.5 % of the tanks within it fail. Without U no figure passes or fails. Where the value estimates
the largest of many, the largest reading with its own U must also be within the limit to pass.
Sources: ILAC-G8:09/2019 4.2.3, guard bands w = U; JCGM 106:2012 7.3, 8.3.2.
"""

import math

from tankcal.record.inspection import InspectionCheck
from tankcal.tank.rules import conformity_probability


def verdict_of(value, U, limit, *, at_least=False, reading=None, U_reading=None):
    """Code of the verdict on a value.

    Parameters
    ----------
    value : float or None
    U : float or None
        Expanded uncertainty, in the unit of the value.
    limit : float or None
    at_least : bool
        Whether the value must reach the limit; else its size must stay within it.
    reading, U_reading : float or None
        Largest reading and its U, of a value that is an estimate; None: the value is a reading.

    Returns
    -------
    str
        "passed", "guard_band", "guard_band_beyond", "failed", or "not_determined" where there is no
        value or no limit, or no U of a value within its limit.

    Examples
    --------
    >>> [verdict_of(value, 2.40, 6.28) for value in (3.5, 4.81, -6.5, -8.7)]
    ['passed', 'guard_band', 'guard_band_beyond', 'failed']
    >>> verdict_of(4.81, None, 6.28), verdict_of(6.5, None, 6.28)
    ('not_determined', 'guard_band_beyond')
    >>> verdict_of(3.5, 2.40, 6.28, reading=4.0, U_reading=2.40)
    'guard_band'
    """
    if value is None or limit is None:
        return "not_determined"
    room = _room(value, limit, at_least)
    if U is None:
        return "not_determined" if room >= 0 else "guard_band_beyond"
    if room < 0:
        return "guard_band_beyond" if room >= -U else "failed"
    is_clear = reading is None or _room(reading, limit, at_least) >= U_reading
    return "passed" if room >= U and is_clear else "guard_band"


def _room(value, limit, at_least):
    """Distance of a value from its limit, negative beyond it."""
    return value - limit if at_least else limit - abs(value)


def gravity(value, U, limit):
    """Sort key of a place among many: the place with the largest key decides a check.

    Places that fail come before those beyond the limit, and those before places within it, which
    are ordered by |value| + U: a tank passes only where every place does.

    Parameters
    ----------
    value : float
    U, limit : float or None
        None: not known, or no limit.

    Examples
    --------
    >>> places = [(6.5, 1.0), (9.0, 4.0), (5.0, 1.2), (4.0, 2.5)]
    >>> sorted(places, key=lambda one: gravity(*one, 5.2), reverse=True)
    [(6.5, 1.0), (9.0, 4.0), (4.0, 2.5), (5.0, 1.2)]
    """
    size, U = abs(value), U or 0.0
    if limit is None:
        return 0, size
    if size - U > limit:
        return 2, (size - U) / limit
    return (1, size / limit) if size > limit else (0, (size + U) / limit)


def probability_of(value, u, limit, dof=math.inf, *, at_least=False):
    """Probability that a value conforms, by the normal distribution or Student's t; None: unknown.

    Parameters
    ----------
    value, u, limit : float or None
        u standard uncertainty.
    dof : float
        Degrees of freedom of u.
    at_least : bool
        As of `verdict_of`.

    Examples
    --------
    At the limit one half, a lower tail of 2.5 % further off:

    >>> round(probability_of(6.28, 1.0, 6.28), 3), round(probability_of(4.32, 1.0, 6.28), 3)
    (0.5, 0.975)
    """
    if None in (value, u, limit):
        return None
    low, high = (limit, math.inf) if at_least else (-limit, limit)
    return float(conformity_probability(value, u, low, high, dof))


def judged(figure):
    """The `InspectionCheck` of a `figures.Figure`."""
    limit = None if figure.limit is None else figure.limit.value
    at_least = {"at_least": figure.at_least}
    u = figure.U / figure.k if figure.U is not None and figure.k else None
    return InspectionCheck(
        code=figure.code,
        unit=figure.unit,
        value=figure.value,
        U=figure.U,
        k=figure.k,
        course=figure.course,
        height_m=figure.height_m,
        azimuth_deg=figure.azimuth_deg,
        epoch=figure.epoch,
        used=figure.used,
        limit=figure.limit,
        probability=probability_of(figure.value, u, limit, figure.dof, **at_least),
        verdict=verdict_of(
            figure.value,
            figure.U,
            limit,
            reading=figure.reading,
            U_reading=figure.U_reading,
            **at_least,
        ),
        reading=figure.reading,
        U_reading=figure.U_reading,
        remark=figure.remark,
        remark_values=figure.remark_values,
    )
