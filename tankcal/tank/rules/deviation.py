"""Does a volume agree with a stated one: guard band and probability of conformity.

Tolerance interval [T_L, T_U] about the stated volume; accepted in [T_L + w, T_U - w] with w = U,
or w = 0 (simple acceptance). With F the standard normal distribution, or Student's t for finite
degrees of freedom,
p_c = F((T_U - y)/u) - F((T_L - y)/u); a limit that is not there is at infinity.
Source: JCGM 106:2012 7.3, 7.4 (probability), 8.2 (simple acceptance), 8.3.2 (guarded acceptance);
t for few degrees of freedom: JCGM 101:2008 6.4.9.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, stdtr

from tankcal.tank.rules.model import DeviationLimit
from tankcal.tank.rules.printed import printed_of_table

AT_TOP_M = 1e-3  # a dip within a millimetre of the last row is the top


@dataclass(frozen=True)
class StatedVolume:
    """A volume that the table is held against.

    Attributes
    ----------
    volume_m3 : float
    high_m : float
        Its dip.
    low_m : float or None
        Of a delivery, the dip that it ends at; None: the volume below `high_m`.
    """

    volume_m3: float
    high_m: float
    low_m: float | None = None


@dataclass(frozen=True)
class DeviationVerdict:
    """What became of one DeviationLimit at one stated volume.

    Attributes
    ----------
    limit, stated
        The DeviationLimit, the StatedVolume.
    code : str
        "conforms": in the acceptance interval; "guard_band": in the tolerance but not accepted;
        "fails": outside the tolerance; "not_for_use": the dip is in the critical zone of a roof.
    passed : bool or None
        True for "conforms", None for "not_for_use", else False.
    volume_m3, k, dof : float
        Of the table.
    U_m3, u_m3 : float
        As printed: u is larger than the table's as U is.
    deviation_m3 : float
        Table less stated.
    tolerance_m3 : tuple[float, float]
        (T_L, T_U) of the volume; infinite on a side that is not limited.
    accepted_m3 : tuple[float, float]
        (A_L, A_U), A_L > A_U where the guard bands leave nothing.
    guard_m3 : float
        w.
    probability : float
        Of conformity, 0 to 1.
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
    """p_c = F((upper - value)/u) - F((lower - value)/u), vectorised.

    Parameters
    ----------
    value, u
        Estimate and standard uncertainty; u = 0: 1 inside the limits, else 0.
    lower, upper
        Limits, -inf or inf where there is none.
    dof : optional
        Degrees of freedom of u: Student's t; inf: normal.
    """
    value, u, lower, upper, dof = np.broadcast_arrays(value, u, lower, upper, dof)
    exact = u == 0
    scale = np.where(exact, 1.0, u)
    # from the side of the smaller tail, so that small probabilities keep their digits
    above, below = (upper - value) / scale, (lower - value) / scale
    flip = above + below > 0
    above, below = np.where(flip, -below, above), np.where(flip, -above, below)
    inside = (value >= lower) & (value <= upper)
    return np.where(exact, inside.astype(float), _cdf(above, dof) - _cdf(below, dof))


def _cdf(z, dof):
    finite = np.where(np.isfinite(dof), dof, 1.0)
    bounded = np.clip(z, -1e300, 1e300)
    return np.where(np.isfinite(dof), stdtr(finite, bounded), ndtr(z))


def judge_deviation(limit, table, stated, printed=None):
    """DeviationVerdict of one DeviationLimit, a Capacity and a StatedVolume; None: not for it.

    A limit of deliveries is for stated volumes with low_m, the others for those without; one of
    the capacity only for the table's last row, or within a millimetre of it.
    Raises HeightError for a dip outside the table.
    """
    if (limit.of == "deliveries") != (stated.low_m is not None):
        return None
    if limit.of == "capacity" and stated.high_m < table.height_m[-1] - AT_TOP_M:
        return None
    if stated.low_m is None:
        found = table.at(stated.high_m)
    else:
        found = table.delivery(stated.low_m, stated.high_m)
    U = (printed or printed_of_table(table)).of(table, stated.low_m, stated.high_m, found.U_m3)
    return judge_volume(limit, stated, found, U)


def judge_volume(limit, stated, found, U):
    """DeviationVerdict of a DeviationLimit and a StatedVolume for a volume.

    Parameters
    ----------
    limit : DeviationLimit
    stated : StatedVolume
    found : Quantity
        Of `tankcal.tank.capacity`: the volume that is held against it.
    U : float
        Its expanded uncertainty as printed, m3.
    """
    u = found.u_m3 * U / found.U_m3 if found.U_m3 else 0.0
    room = limit.limit * abs(stated.volume_m3) if limit.limit_m3 is None else limit.limit_m3
    lower = -math.inf if limit.side == "upper" else stated.volume_m3 - room
    upper = math.inf if limit.side == "lower" else stated.volume_m3 + room
    guard = U if limit.guard == "U" else 0.0
    code = _code(found, lower, upper, guard)
    return DeviationVerdict(
        limit=limit,
        stated=stated,
        code=code,
        passed=None if code == "not_for_use" else code == "conforms",
        volume_m3=found.value_m3,
        u_m3=u,
        U_m3=U,
        k=found.k,
        dof=found.dof,
        deviation_m3=found.value_m3 - stated.volume_m3,
        tolerance_m3=(lower, upper),
        accepted_m3=(lower + guard, upper - guard),
        guard_m3=guard,
        probability=float(conformity_probability(found.value_m3, u, lower, upper, found.dof)),
    )


def _code(found, lower, upper, guard):
    if not found.for_use:
        return "not_for_use"
    if lower + guard <= found.value_m3 <= upper - guard:
        return "conforms"
    return "guard_band" if lower <= found.value_m3 <= upper else "fails"
