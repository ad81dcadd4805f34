"""Estimates of the largest |S| of many points and of R2 without the bias of levelling errors.

Errors raise the largest |S| of n points above the largest true |S|, and lower the share of the
variance that the plane explains. The bias follows from the levelling itself, without a prior for
the settlement:

1. Add simulated errors of once and twice the stated variance to the readings. With T0 the statistic
   of the readings, T1 and T2 its means over the simulations, T is known at one, two and three times
   the variance of the levelling.
2. Extrapolate the parabola through the three to the variance 0: 3 T0 - 3 T1 + T2.

The extrapolation is exact for statistics that are quadratic in the elevations, such as a sum of
squares. A point that dominates all others keeps its reading. (The method is known as simulation
extrapolation, SIMEX.)

The uncertainty follows from simulated levellings. Errors are added to the readings, the statistic
is estimated from each sum, and u is the root mean square error of these estimates.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.inspection.out_of_plane import fit_plane

VALUE_DRAWS = 4000  # draws for the estimate; its simulation error is about 0.03 of the sd of S
U_DRAWS = 300  # simulated levellings for u, at least 4 for each point
INNER_DRAWS = 100  # draws for the estimate from each simulated levelling
CHUNK = 4_000_000  # number of values computed together, to limit the memory
SEED = 653  # of the random numbers; a fixed seed makes the results reproducible


@dataclass(frozen=True)
class Errors:
    """Simulated errors of a levelling, m, each draw with its mirror image.

    Attributes
    ----------
    value : ndarray, shape (VALUE_DRAWS, n)
        Errors for the estimate itself.
    inner : ndarray, shape (INNER_DRAWS, n)
        Errors for the estimate from each simulated levelling.
    outer : ndarray, shape (m, n)
        Errors of the simulated levellings; their covariance is exactly the covariance of the
        levelling.
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
        Linear map of the elevations.
    reduce : callable
        Function of an array (..., m) that returns an array (...).
    least, most : float
        Bounds of the true value.
    """

    operator: np.ndarray
    reduce: callable
    least: float = 0.0
    most: float = np.inf


@dataclass(frozen=True)
class Estimate:
    """A statistic of the true settlement, corrected for the bias of the readings.

    Attributes
    ----------
    value, u : float
        Estimate and its standard uncertainty.
    """

    value: float
    u: float

    def times(self, factor):
        """Estimate and standard uncertainty times a factor, such as 1000 for millimetres."""
        return Estimate(factor * self.value, factor * self.u)


def simulate_errors(azimuth_rad, z_m, u_m):
    """Simulate errors of a levelling with given standard uncertainties.

    Parameters
    ----------
    azimuth_rad, z_m, u_m : ndarray, shape (n,)
        Azimuths, rad, elevations and their standard uncertainties, m.

    Returns
    -------
    Errors
    """
    rng = np.random.default_rng(SEED)
    residual = fit_plane(azimuth_rad, z_m).residual_m
    # The draws start at the point farthest from the plane, so that a rotation of the azimuths does
    # not change the result.
    n = len(residual)
    places = (np.arange(n) - int(np.argmax(np.abs(residual)))) % n
    counts = (VALUE_DRAWS, INNER_DRAWS, max(U_DRAWS, 4 * n))
    halves = [rng.normal(size=(count // 2, n)) for count in counts]
    # The sample covariance is made exact, so that a dominating point gets its exact u.
    values, vectors = np.linalg.eigh(halves[2].T @ halves[2] / len(halves[2]))
    halves[2] = halves[2] @ (vectors / np.sqrt(values)) @ vectors.T
    return Errors(*(np.concatenate([half, -half])[:, places] * u_m for half in halves))


def estimate_statistic(statistic, z_m, reading, errors):
    """Estimate a statistic of the true elevations by extrapolation, with its uncertainty.

    Parameters
    ----------
    statistic : Statistic
    z_m : ndarray, shape (n,)
        Levelled elevations, m.
    reading : float
        The statistic of the elevations z_m.
    errors : Errors
        Simulated errors of `simulate_errors`.

    Returns
    -------
    Estimate
    """
    z = statistic.operator @ z_m
    value_errors, inner, outer = (
        draws @ statistic.operator.T for draws in (errors.value, errors.inner, errors.outer)
    )

    def corrected(z, errors):
        """Extrapolated statistic of each row of z, within the bounds of the true value."""
        once, twice = (
            np.mean(statistic.reduce(z[:, None] + np.sqrt(times) * errors), axis=1)
            for times in (1, 2)
        )
        estimates = 3 * statistic.reduce(z) - 3 * once + twice
        return np.clip(estimates, statistic.least, statistic.most)

    plain = float(statistic.reduce(z))
    # A maximum on a grid may be below the exact maximum, so only its bias is used.
    bias = plain - float(corrected(z[None], value_errors)[0])
    rows = max(1, CHUNK // inner.size)
    levelled = z + outer
    estimates = [corrected(levelled[i : i + rows], inner) for i in range(0, len(outer), rows)]
    u = float(np.sqrt(np.mean((np.concatenate(estimates) - plain) ** 2)))
    return Estimate(float(np.clip(reading - bias, statistic.least, statistic.most)), u)
