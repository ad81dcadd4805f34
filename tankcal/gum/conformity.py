"""Limits, rule sets and decisions on a value with an uncertainty.

A value y with expanded uncertainty U is compared with a tolerance interval [T_L, T_U]; a missing
limit is at infinity. Its distance within the interval is d = min(y - T_L, T_U - y), negative for a
value beyond a limit. With a guard band w (w = U, or w = 0 for simple acceptance):

    passed              d >= w
    guard_band          0 <= d < w          (conditional pass)
    guard_band_beyond   -w <= d < 0         (conditional fail)
    failed              d < -w

For a coverage probability of 95 %, at most 2.5 % of the objects beyond a limit pass, and at most
2.5 % of the objects within it fail. The probability of conformity is
p_c = F((T_U - y)/u) - F((T_L - y)/u), where F is the distribution function of the standard normal
distribution, or of Student's t for finite degrees of freedom.

Sources: JCGM 106:2012 7.3, 7.4 (probability), 8.2 (simple acceptance), 8.3.2 (guarded acceptance);
ILAC-G8:09/2019 4.2.3, guard bands w = U; JCGM 101:2008 6.4.9 (t for few degrees of freedom).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, stdtr


@dataclass(frozen=True, kw_only=True)
class Limit:
    """A limit of a rule and its source.

    Attributes
    ----------
    name : str
        Name in the rule file.
    clause : str
        Reference in the text of the rule; "": none.
    verified : bool
        Whether the value was read in the text itself.
    """

    name: str
    clause: str
    verified: bool


@dataclass(frozen=True, kw_only=True)
class RuleSet:
    """Limits of a rule and their source; subclasses contain the limits.

    Attributes
    ----------
    name : str
    source : str
        Source of the values.
    verified : bool
        Whether all values were read in the text itself.
    remark : str
        Remark to be printed with the rule; "": none.
    """

    name: str
    source: str
    verified: bool
    remark: str


def limits_of(limit, at_least=False):
    """(T_L, T_U) of a lower limit of a value, or else of an upper limit of its magnitude."""
    return (limit, math.inf) if at_least else (-limit, limit)


def distance_within(value, lower, upper):
    """Distance of a value from the nearer limit, negative if the value is beyond a limit."""
    return min(value - lower, upper - value)


def decide(value, lower, upper, guard):
    """Decide on a value by its tolerance interval and the width of the guard bands.

    Returns
    -------
    str
        "passed", "guard_band", "guard_band_beyond" or "failed", as defined above.

    Examples
    --------
    >>> [decide(value, 9.5, 10.5, 0.2) for value in (10.2, 10.4, 10.6, 10.8)]
    ['passed', 'guard_band', 'guard_band_beyond', 'failed']
    """
    distance = distance_within(value, lower, upper)
    if distance < 0:
        return "guard_band_beyond" if distance >= -guard else "failed"
    return "passed" if distance >= guard else "guard_band"


def conformity_probability(value, u, lower, upper, dof=np.inf):
    """Return p_c = F((upper - value)/u) - F((lower - value)/u), vectorised.

    Parameters
    ----------
    value, u : array_like
        Estimate and standard uncertainty; u = 0: 1 inside the limits, else 0.
    lower, upper : array_like
        Limits; -inf or inf for a missing limit.
    dof : array_like, optional
        Degrees of freedom of u: Student's t; inf: normal.

    Returns
    -------
    ndarray
    """
    value, u, lower, upper, dof = np.broadcast_arrays(value, u, lower, upper, dof)
    exact = u == 0
    scale = np.where(exact, 1.0, u)
    # Use the smaller tail, so that small probabilities have full relative accuracy.
    above, below = (upper - value) / scale, (lower - value) / scale
    flip = above + below > 0
    above, below = np.where(flip, -below, above), np.where(flip, -above, below)
    inside = (value >= lower) & (value <= upper)
    return np.where(exact, inside.astype(float), _cdf(above, dof) - _cdf(below, dof))


def _cdf(z, dof):
    """Return the distribution function of Student's t; for dof = inf, of the normal."""
    finite = np.where(np.isfinite(dof), dof, 1.0)
    bounded = np.clip(z, -1e300, 1e300)
    return np.where(np.isfinite(dof), stdtr(finite, bounded), ndtr(z))


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
    limits = limits_of(limit, at_least)
    if U is None:
        is_within = distance_within(value, *limits) >= 0
        return "not_determined" if is_within else "guard_band_beyond"
    verdict = decide(value, *limits, U)
    if verdict == "passed" and reading is not None:
        return "passed" if decide(reading, *limits, U_reading) == "passed" else "guard_band"
    return verdict


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
    return float(conformity_probability(value, u, *limits_of(limit, at_least), dof))
