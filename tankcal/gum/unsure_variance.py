"""How an unsure variance widens an interval: a normal distribution whose variance is log-normal."""

from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr, stdtrit

MOST, STEPS = 4.0, 81  # of the standard deviation of the logarithm, in the table
NODES = 40  # of Hermite's rule
TAIL = 0.975  # at which the quantiles agree: of an interval of 95 %
SURE = 1e-3  # a smaller standard deviation is none


def dof_of_unsure_variance(log_sd):
    """Degrees of freedom that widen a 95 % interval as an unsure variance does.

    Of x = s exp(t z / 2) z' (z, z' standard normal) the quantile k s at 97.5 % is that of Student's
    t with the degrees of freedom returned.

    Parameters
    ----------
    log_sd : float
        t: standard deviation of the logarithm of the variance.

    Returns
    -------
    float
        inf for a variance that is known.

    Examples
    --------
    >>> round(dof_of_unsure_variance(1.0), 2)
    4.53
    >>> dof_of_unsure_variance(0.0)
    inf
    """
    if log_sd < SURE:
        return np.inf
    steps, inverse = _table()
    return float(1 / np.interp(log_sd, steps, inverse))


@cache
def _table():
    """Standard deviations of the logarithm, and the inverse degrees of freedom of each."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    weights = weights / weights.sum()
    steps, inverse = np.linspace(0.0, MOST, STEPS), [0.0]
    for log_sd in steps[1:]:
        sizes = np.exp(log_sd * nodes / 2)
        k = brentq(lambda k, sizes=sizes: weights @ ndtr(k / sizes) - TAIL, 0.5, 500.0)
        inverse.append(brentq(lambda part, k=k: stdtrit(1 / part, TAIL) - k, 1e-9, 10.0))
    return steps, np.array(inverse)
