"""Figure of an inspection, and the decision on it by guard bands and probability of conformity.

The limit L of |value| and the expanded uncertainty U determine the verdict:

    passed              |value| + U <= L
    guard_band          |value| <= L < |value| + U          (conditional pass)
    guard_band_beyond   |value| - U <= L < |value|          (conditional fail)
    failed              L < |value| - U

A lower limit (of the share that a plane explains) is treated accordingly. For a coverage
probability of 95 %, at most 2.5 % of the tanks beyond a limit pass, and at most 2.5 % of the tanks
within the limit fail. Without U no figure passes or fails. If the value estimates the largest of
many true values, the largest reading plus its U must also be within the limit.
Sources: ILAC-G8:09/2019 4.2.3, guard bands w = U; JCGM 106:2012 7.3, 8.3.2.
"""

import math
from dataclasses import dataclass, field

from tankcal.record.inspection import InspectionCheck, InspectionLimit
from tankcal.tank.rules import conformity_probability

PROBABILITY = 0.95  # coverage probability of U


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A measured value with at most one limit, in the terms of `InspectionCheck`.

    Attributes
    ----------
    code : str
        One of tankcal.record.inspection.CHECKS.
    unit : str
        "mm", "1/m" or "" (a ratio).
    value : float or None
        Value with its sign; None if not determined.
    U : float or None
        Expanded uncertainty for PROBABILITY; None if no standard deviation is known.
    k : float or None
        Coverage factor of U.
    dof : float
        Degrees of freedom of U; may be inf.
    limit : InspectionLimit or None
        None if the rule has no limit, or if the limit requires data that are not given.
    at_least : bool
        Whether the limit is a lower limit of the value; if not, an upper limit of its magnitude.
    course, height_m, azimuth_deg, epoch : optional
        Place of the value, and its epoch or difference of two epochs.
    used : int
        Number of places that the largest value was selected from.
    reading, U_reading : float or None
        Largest single reading and its expanded uncertainty if the value estimates the largest true
        value; None if the value is a reading.
    remark, remark_values
        Code of a remark on the value, and the numbers of the remark.
    """

    code: str
    unit: str
    value: float | None
    U: float | None
    k: float | None
    dof: float
    limit: InspectionLimit | None
    at_least: bool = False
    course: int | None = None
    height_m: float | None = None
    azimuth_deg: float | None = None
    epoch: str | None = None
    used: int = 0
    reading: float | None = None
    U_reading: float | None = None
    remark: str | None = None
    remark_values: dict = field(default_factory=dict)


def verdict_of(value, U, limit, *, at_least=False, reading=None, U_reading=None):
    """Determine the verdict on a value.

    Parameters
    ----------
    value : float or None
        Measured value.
    U : float or None
        Expanded uncertainty, in the unit of the value.
    limit : float or None
        Limit, in the unit of the value.
    at_least : bool
        Whether the limit is a lower limit of the value; if not, an upper limit of its magnitude.
    reading, U_reading : float or None
        Largest reading and its U if the value is an estimate; None if the value is a reading.

    Returns
    -------
    str
        "passed", "guard_band", "guard_band_beyond", "failed" or "not_determined". The last applies
        without a value or a limit, and to a value within its limit without U.

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
    margin = _margin(value, limit, at_least)
    if U is None:
        return "not_determined" if margin >= 0 else "guard_band_beyond"
    if margin < 0:
        return "guard_band_beyond" if margin >= -U else "failed"
    is_clear = reading is None or _margin(reading, limit, at_least) >= U_reading
    return "passed" if margin >= U and is_clear else "guard_band"


def _margin(value, limit, at_least):
    """Distance of a value from its limit, negative if the value is beyond the limit."""
    return value - limit if at_least else limit - abs(value)


def severity(value, U, limit):
    """Sort key of a place; the place with the largest key decides a check of many places.

    Places that fail have the largest keys, then places beyond the limit, then places within the
    limit in the order of |value| + U. A tank therefore passes only if all places pass.

    Parameters
    ----------
    value : float
        Measured value.
    U, limit : float or None
        Expanded uncertainty and limit, in the unit of the value; None if unknown.

    Returns
    -------
    tuple of int and float
        Rank, and a ratio that sorts places of the same rank.

    Examples
    --------
    >>> places = [(6.5, 1.0), (9.0, 4.0), (5.0, 1.2), (4.0, 2.5)]
    >>> sorted(places, key=lambda place: severity(*place, 5.2), reverse=True)
    [(6.5, 1.0), (9.0, 4.0), (4.0, 2.5), (5.0, 1.2)]
    """
    size, U = abs(value), U or 0.0
    if limit is None:
        return 0, size
    if size - U > limit:
        return 2, (size - U) / limit
    return (1, size / limit) if size > limit else (0, (size + U) / limit)


def probability_of(value, u, limit, dof=math.inf, *, at_least=False):
    """Probability of conformity of a value, by the normal distribution or Student's t.

    Parameters
    ----------
    value, u, limit : float or None
        Value, its standard uncertainty and its limit, in one unit.
    dof : float
        Degrees of freedom of u.
    at_least : bool
        Whether the limit is a lower limit, as in `verdict_of`.

    Returns
    -------
    float or None
        None if the value, u or the limit is None.

    Examples
    --------
    The probability is 0.5 at the limit, and 0.975 at 1.96 u within the limit:

    >>> round(probability_of(6.28, 1.0, 6.28), 3), round(probability_of(4.32, 1.0, 6.28), 3)
    (0.5, 0.975)
    """
    if None in (value, u, limit):
        return None
    low, high = (limit, math.inf) if at_least else (-limit, limit)
    return float(conformity_probability(value, u, low, high, dof))


def make_check(figure):
    """`InspectionCheck` of a `Figure`, with its verdict and probability of conformity."""
    limit = None if figure.limit is None else figure.limit.value
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
        probability=probability_of(figure.value, u, limit, figure.dof, at_least=figure.at_least),
        verdict=verdict_of(
            figure.value,
            figure.U,
            limit,
            at_least=figure.at_least,
            reading=figure.reading,
            U_reading=figure.U_reading,
        ),
        reading=figure.reading,
        U_reading=figure.U_reading,
        remark=figure.remark,
        remark_values=figure.remark_values,
    )
