"""Estimates of the largest of many, and of R2, without the bias that errors of levelling give them.

Errors raise the largest |S| of n points above the largest true |S|, and lower the share that the
plane explains. The bias follows from the levelling itself, without a prior for the settlement:

1. Add simulated errors of once and twice the stated variance to the readings. With T0 the statistic
   of the readings, T1 and T2 its means over the simulations, T is known at one, two and three times
   the variance of the levelling.
2. Extrapolate the parabola through the three to the variance 0: 3 T0 - 3 T1 + T2.

The extrapolation is exact for statistics that are quadratic in the elevations, such as a sum of
squares. A point that dominates all others keeps its reading. (The method is known as simulation
extrapolation, SIMEX.)

The uncertainty comes from levellings of the readings themselves: errors are added to the readings,
the estimate is made from each sum, and u is the root mean square of its errors.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.inspection.out_of_plane import fit_plane

VALUE_DRAWS = 4000  # of the estimate: its simulation error is about 0.03 of the sd of S
U_DRAWS = 300  # levellings for u, at least 4 for each point
INNER_DRAWS = 100  # of the estimate from each of them
CHUNK = 4_000_000  # values that are computed together, to bound the memory
SEED = 653


@dataclass(frozen=True)
class Errors:
    """Simulated errors of a levelling, m, each draw with its mirror image.

    Attributes
    ----------
    value : ndarray, shape (VALUE_DRAWS, n)
    inner : ndarray, shape (INNER_DRAWS, n)
    outer : ndarray, shape (m, n)
        Its covariance is exactly that of the levelling.
    """

    value: np.ndarray
    inner: np.ndarray
    outer: np.ndarray


@dataclass(frozen=True)
class Statistic:
    """A statistic of elevations z: reduce(z @ operator.T).

    Attributes
    ----------
    operator : ndarray, shape (m, n)
    reduce : callable
        (..., m) to (...).
    least, most : float
        Bounds of any true value.
    """

    operator: np.ndarray
    reduce: callable
    least: float = 0.0
    most: float = np.inf


@dataclass(frozen=True)
class Estimate:
    """A statistic of the true settlement without the bias of its reading.

    Attributes
    ----------
    value, u : float
        u is the standard uncertainty.
    """

    value: float
    u: float

    def times(self, factor):
        """The same estimate in another unit."""
        return Estimate(factor * self.value, factor * self.u)


def simulate_errors(azimuth_rad, z_m, u_m):
    """Errors of a levelling with given standard uncertainties.

    Parameters
    ----------
    azimuth_rad, z_m, u_m : ndarray, shape (n,)
        Azimuths, elevations and their standard uncertainties.

    Returns
    -------
    Errors
    """
    rng = np.random.default_rng(SEED)
    residual = fit_plane(azimuth_rad, z_m).residual_m
    # The draws start at the point farthest from the plane: turning the tank changes none of them.
    n = len(residual)
    places = (np.arange(n) - int(np.argmax(np.abs(residual)))) % n
    counts = (VALUE_DRAWS, INNER_DRAWS, max(U_DRAWS, 4 * n))
    halves = [rng.normal(size=(count // 2, n)) for count in counts]
    # An exact covariance gives a dominating point its exact u, whatever the draws.
    values, vectors = np.linalg.eigh(halves[2].T @ halves[2] / len(halves[2]))
    halves[2] = halves[2] @ (vectors / np.sqrt(values)) @ vectors.T
    return Errors(*(np.concatenate([half, -half])[:, places] * u_m for half in halves))


def estimate(statistic, z_m, reading, errors):
    """The reading of a statistic less its bias by extrapolation, with its uncertainty.

    Parameters
    ----------
    statistic : Statistic
    z_m : ndarray, shape (n,)
    reading : float
        The statistic of the readings z_m.
    errors : Errors

    Returns
    -------
    Estimate
    """
    z = statistic.operator @ z_m
    value_errors, inner, outer = (
        one @ statistic.operator.T for one in (errors.value, errors.inner, errors.outer)
    )

    def corrected(z, errors):
        """Estimates from rows z, within the bounds of a true value."""
        once, twice = (
            np.mean(statistic.reduce(z[:, None] + np.sqrt(times) * errors), axis=1)
            for times in (1, 2)
        )
        found = 3 * statistic.reduce(z) - 3 * once + twice
        return np.clip(found, statistic.least, statistic.most)

    plain = float(statistic.reduce(z))
    # The operator may miss the exact maximum between the places of a grid: only the bias is used.
    bias = plain - float(corrected(z[None], value_errors)[0])
    rows = max(1, CHUNK // inner.size)
    levelled = z + outer
    found = [corrected(levelled[i : i + rows], inner) for i in range(0, len(outer), rows)]
    u = float(np.sqrt(np.mean((np.concatenate(found) - plain) ** 2)))
    return Estimate(float(np.clip(reading - bias, statistic.least, statistic.most)), u)
