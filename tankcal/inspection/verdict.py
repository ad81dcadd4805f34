"""The verdict on a figure of an inspection: guard band and probability of conformity.

With the limit L of |value| and the expanded uncertainty U

    passed       |value| + U <= L
    guard_band   |value| <= L < |value| + U
    failed       |value| > L

and of a limit that is to be reached (a share that a plane explains) the same downwards. A U of 95 %
leaves 2.5 % on either side: of the tanks beyond a limit, wherever they lie, at most so many pass.
Where no U is known nothing passes. Source: JCGM 106:2012 7.3, 8.3.2.
"""

import math

from tankcal.record.inspection import InspectionCheck
from tankcal.tank.rules import conformity_probability


def verdict_of(value, U, limit, *, at_least=False):
    """Code of the verdict on a value.

    Parameters
    ----------
    value : float or None
    U : float or None
        Expanded uncertainty, in the unit of the value.
    limit : float or None
    at_least : bool
        Whether the value must reach the limit; else its size must stay within it.

    Returns
    -------
    str
        "passed", "guard_band", "failed", or "not_determined" where there is no value or no limit,
        or no U of a value that keeps it.

    Examples
    --------
    >>> [verdict_of(value, 2.40, 6.28) for value in (3.5, 4.81, -6.5)]
    ['passed', 'guard_band', 'failed']
    >>> verdict_of(4.81, None, 6.28), verdict_of(6.5, None, 6.28)
    ('not_determined', 'failed')
    """
    if value is None or limit is None:
        return "not_determined"
    room = value - limit if at_least else limit - abs(value)
    if room < 0:
        return "failed"
    if U is None:
        return "not_determined"
    return "passed" if room >= U else "guard_band"


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
        verdict=verdict_of(figure.value, figure.U, limit, **at_least),
        remark=figure.remark,
        remark_values=figure.remark_values,
    )
