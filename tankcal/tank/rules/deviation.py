"""Agreement of a volume with a stated volume: guard band and probability of conformity.

The tolerance interval about the stated volume is [T_L, T_U]. The acceptance interval is [T_L + w,
T_U - w] with w = U, or w = 0 (simple acceptance). With F the standard normal distribution, or
Student's t for finite degrees of freedom,
p_c = F((T_U - y)/u) - F((T_L - y)/u); a missing limit is at infinity. Source: JCGM 106:2012 7.3,
7.4 (probability), 8.2 (simple acceptance), 8.3.2 (guarded acceptance); t for few degrees of
freedom: JCGM 101:2008 6.4.9.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, stdtr

from tankcal.tank.rules.model import DeviationLimit, printed_of_table

AT_TOP_M = 1e-3  # a dip within a millimetre of the last row counts as the top


@dataclass(frozen=True)
class StatedVolume:
    """Stated volume for comparison with the table.

    Attributes
    ----------
    volume_m3 : float
    high_m : float
        Dip of the volume, or higher dip of a delivery.
    low_m : float or None
        Lower dip of a delivery; None: the volume below `high_m`.
    """

    volume_m3: float
    high_m: float
    low_m: float | None = None


@dataclass(frozen=True)
class DeviationVerdict:
    """Result of a DeviationLimit for a stated volume.

    Attributes
    ----------
    limit : DeviationLimit
    stated : StatedVolume
    code : str
        "conforms": in the acceptance interval; "guard_band": in the tolerance but not accepted;
        "fails": outside the tolerance; "not_for_use": the dip is in the critical zone of a roof.
    passed : bool or None
        True for "conforms", None for "not_for_use", else False.
    volume_m3, k, dof : float
        Volume of the table, coverage factor and degrees of freedom.
    U_m3, u_m3 : float
        As printed; if the printed U exceeds that of the table, u is increased in proportion.
    deviation_m3 : float
        Table less stated volume.
    tolerance_m3 : tuple[float, float]
        (T_L, T_U) of the volume; infinite on a side without limit.
    accepted_m3 : tuple[float, float]
        (A_L, A_U); A_L > A_U if the guard bands leave no acceptance interval.
    guard_m3 : float
        w.
    probability : float
        Probability of conformity, 0 to 1.
    """

    limit: DeviationLimit
    stated: StatedVolume
    code: str
    passed: bool | None
    volume_m3: float
    u_m3: float
    U_m3: float
    k: float
    dof: float
    deviation_m3: float
    tolerance_m3: tuple[float, float]
    accepted_m3: tuple[float, float]
    guard_m3: float
    probability: float


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


def judge_deviation(limit, table, stated, printed=None):
    """Return the DeviationVerdict of a limit, a Capacity and a StatedVolume, or None.

    None: the limit does not apply. A limit of deliveries applies to stated volumes with low_m,
    other limits to volumes without low_m. A limit of the capacity applies only within a millimetre
    of the last row of the table. Raises HeightError for a dip outside the table.

    Parameters
    ----------
    limit : DeviationLimit
    table : Capacity
    stated : StatedVolume
    printed : PrintedU, optional
        Printed uncertainties; None: those of the table.

    Returns
    -------
    DeviationVerdict or None
    """
    if (limit.of == "deliveries") != (stated.low_m is not None):
        return None
    if limit.of == "capacity" and stated.high_m < table.height_m[-1] - AT_TOP_M:
        return None
    if stated.low_m is None:
        quantity = table.at(stated.high_m)
    else:
        quantity = table.delivery(stated.low_m, stated.high_m)
    U = (printed or printed_of_table(table)).of(table, stated.low_m, stated.high_m, quantity.U_m3)
    return judge_volume(limit, stated, quantity, U)


def judge_volume(limit, stated, quantity, U):
    """Return the DeviationVerdict of a limit and a StatedVolume for a volume.

    Parameters
    ----------
    limit : DeviationLimit
    stated : StatedVolume
    quantity : Quantity
        Volume for comparison, see `tankcal.tank.capacity`.
    U : float
        Printed expanded uncertainty, m3.

    Returns
    -------
    DeviationVerdict
    """
    # The printed U may be that of Monte Carlo: u grows in proportion.
    u = quantity.u_m3 * U / quantity.U_m3 if quantity.U_m3 else 0.0
    tolerance = limit.limit * abs(stated.volume_m3) if limit.limit_m3 is None else limit.limit_m3
    # A one-sided limit has an infinite tolerance on the other side.
    lower = -math.inf if limit.side == "upper" else stated.volume_m3 - tolerance
    upper = math.inf if limit.side == "lower" else stated.volume_m3 + tolerance
    guard = U if limit.guard == "U" else 0.0
    code = _code(quantity, lower, upper, guard)
    return DeviationVerdict(
        limit=limit,
        stated=stated,
        code=code,
        passed=None if code == "not_for_use" else code == "conforms",
        volume_m3=quantity.value_m3,
        u_m3=u,
        U_m3=U,
        k=quantity.k,
        dof=quantity.dof,
        deviation_m3=quantity.value_m3 - stated.volume_m3,
        tolerance_m3=(lower, upper),
        accepted_m3=(lower + guard, upper - guard),
        guard_m3=guard,
        probability=float(conformity_probability(quantity.value_m3, u, lower, upper, quantity.dof)),
    )


def _code(quantity, lower, upper, guard):
    """Return the code of a verdict."""
    if not quantity.for_use:
        return "not_for_use"
    if lower + guard <= quantity.value_m3 <= upper - guard:
        return "conforms"
    return "guard_band" if lower <= quantity.value_m3 <= upper else "fails"
