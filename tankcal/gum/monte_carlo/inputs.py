"""Inputs of a simulation: draws, and the independent coordinates behind the draws.

x = mean + T e with independent e. A normal input has unit normal coordinates; correlated normal
inputs use the factor of their correlation. For every other input, e is the deviation from the mean.

The draws may be scrambled Sobol points: a net in base 2 with randomly permuted digits. They equal
the points of `scipy.stats.qmc.Sobol` with the same seed, to the last bit. This module does not call
scipy.stats because loading it takes longer than computing a capacity table.

Sources: JCGM 101:2008 6.4 (distributions), 6.4.8 and C.5 (correlated normal inputs); Joe, Kuo 2008
(direction numbers); Matousek 1998 (scrambling); Antonov, Saleev 1979 (order).
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.special import ndtr, ndtri

# Probabilities at which `is_normal` compares quantiles.
PROBES = np.array([1e-9, 1e-5, 0.003, 0.1, 0.31, 0.5, 0.77, 0.98, 0.9999, 1 - 1e-9])
BITS = 30  # binary digits of a coordinate
COORDINATES = 128  # number of coordinates in the table of direction numbers
WEIGHTS = 2.0 ** np.arange(BITS - 1, -1, -1)  # weights of the digits, the largest first


class Distribution(Protocol):
    """Interface of the distribution of an input.

    Attributes
    ----------
    mean, sd : float
        Mean and standard deviation, in the unit of the input; sd may be inf.
    """

    mean: float
    sd: float

    def quantile(self, p):
        """Values with the probabilities p (array) below them."""


def is_normal(distribution):
    """Whether a distribution has the quantiles of a normal distribution."""
    if not np.isfinite(distribution.sd):
        return False
    expected = distribution.mean + distribution.sd * ndtri(PROBES)
    quantiles = np.asarray(distribution.quantile(PROBES), dtype=float)
    return bool(np.allclose(quantiles, expected, rtol=0, atol=1e-9 * distribution.sd))


@dataclass(frozen=True)
class Inputs:
    """Inputs prepared for drawing.

    Attributes
    ----------
    distributions : tuple of Distribution, length n
        The inputs.
    mean, scale : ndarray, shape (n,)
        Means; standard deviations, or half the central 68 % interval for an infinite sd.
    normal : ndarray of bool, shape (n,)
        True for a normal input.
    factor : ndarray, shape (n, n), or None
        Cholesky factor of the correlation of the normal scores.
    transform : ndarray, shape (n, n), or None
        T of x = mean + T e; None for correlated inputs that are not normal.
    """

    distributions: tuple
    mean: np.ndarray
    scale: np.ndarray
    normal: np.ndarray
    factor: np.ndarray | None
    transform: np.ndarray | None

    @property
    def coordinate_sd(self):
        """Standard deviations (n,) of the independent coordinates e."""
        deviations = [distribution.sd for distribution in self.distributions]
        return np.where(self.normal, 1.0, deviations)

    @property
    def coordinate_scale(self):
        """Scales (n,) of the independent coordinates e, finite also for an infinite sd."""
        return np.where(self.normal, 1.0, self.scale)

    def draws(self, uniforms):
        """Values x and coordinates e, (draws, n) each, for uniform numbers (draws, n).

        The coordinates are None without a transform.
        """
        if self.transform is not None:
            coordinates = self.coordinates(uniforms)
            return self.mean + coordinates @ self.transform.T, coordinates
        # Gaussian copula: correlated normal scores give correlated uniform numbers.
        p = ndtr(ndtri(_clip_uniforms(uniforms)) @ self.factor.T)
        indexed = enumerate(self.distributions)
        return np.column_stack(
            [distribution.quantile(p[:, j]) for j, distribution in indexed]
        ), None

    def coordinates(self, uniforms):
        """Independent coordinates e for uniform numbers, (draws, n) each; needs a transform."""
        coordinates = _clip_uniforms(uniforms)
        for j, distribution in enumerate(self.distributions):
            if not self.normal[j]:
                coordinates[:, j] = distribution.quantile(coordinates[:, j]) - self.mean[j]
        coordinates[:, self.normal] = ndtri(coordinates[:, self.normal])
        return coordinates


def _clip_uniforms(uniforms):
    """Limit uniform numbers to 2^-40 and 1 - 2^-40, since quantiles at 0 and 1 may be infinite."""
    return np.clip(uniforms, 2.0**-40, 1 - 2.0**-40)


def inputs_of(distributions, correlation=None):
    """Prepare inputs for drawing.

    Parameters
    ----------
    distributions : sequence of Distribution, length n
        Distributions with mean, sd and quantile(p).
    correlation : array_like, shape (n, n), optional
        Correlation matrix; of the normal scores for inputs that are not normal (Gaussian copula).
        None: independent inputs.

    Returns
    -------
    Inputs

    Raises
    ------
    ValueError
        If `correlation` is not a correlation matrix.

    Examples
    --------
    >>> from tankcal.gum.distributions import Normal
    >>> from tankcal.gum.monte_carlo.inputs import sobol_points
    >>> pair = inputs_of([Normal(1.0), Normal(2.0)], [[1.0, 0.5], [0.5, 1.0]])
    >>> values, _ = pair.draws(sobol_points(4, 2, seed=1))
    >>> values.shape
    (4, 2)
    """
    distributions = tuple(distributions)
    mean = np.array([float(d.mean) for d in distributions])
    scale = np.array([_scale_of(d) for d in distributions])
    normal = np.array([is_normal(d) for d in distributions], dtype=bool)
    if correlation is None or np.array_equal(correlation, np.eye(len(mean))):
        return Inputs(
            distributions, mean, scale, normal, None, np.diag(np.where(normal, scale, 1.0))
        )
    correlation = np.asarray(correlation, dtype=float)
    factor = _factor(correlation, len(mean))
    correlated = np.any(correlation != np.eye(len(mean)), axis=0)
    # A linear transform exists only if all correlated inputs are normal.
    transform = None
    if np.all(normal[correlated]):
        transform = np.where(normal, scale, 1.0)[:, None] * factor
    return Inputs(distributions, mean, scale, normal, factor, transform)


def _factor(correlation, count):
    """Triangular factor of the correlation matrix, which may be singular."""
    symmetric = correlation.shape == (count, count) and np.allclose(correlation, correlation.T)
    if not symmetric or not np.allclose(np.diag(correlation), 1.0):
        raise ValueError(f"correlation: expected a symmetric {count} x {count} with unit diagonal")
    correlated = np.ix_(*2 * [np.any(correlation != np.eye(count), axis=0)])
    values, vectors = np.linalg.eigh(correlation[correlated])
    if values.min(initial=0.0) < -1e-10:
        raise ValueError(f"not a correlation matrix: eigenvalue {values[0]:.3g}")
    # QR of the square root of the matrix works without positive definiteness.
    triangle = np.linalg.qr((vectors * np.sqrt(np.clip(values, 0, None))).T, mode="r").T
    # Only the correlated part is factored, so that it uses no coordinate of another input.
    factor = np.eye(count)
    factor[correlated] = triangle * np.where(np.diag(triangle) < 0, -1.0, 1.0)
    return factor


def _scale_of(distribution):
    """Standard deviation, or half the central 68 % interval if it is infinite."""
    if np.isfinite(distribution.sd):
        return float(distribution.sd)
    low, high = distribution.quantile(np.array([0.16, 0.84]))
    return float(high - low) / 2


def sobol_points(count, inputs, seed):
    """Scrambled Sobol points: each coordinate is uniform, and the points are evenly spread.

    Parameters
    ----------
    count, inputs : int
        Numbers of points and of coordinates; a power of two gives the most even spread.
    seed : int or SeedSequence
        Seed of the scrambling; equal seeds give equal points.

    Returns
    -------
    ndarray, shape (count, inputs)
        In [0, 1).

    References
    ----------
    Owen 1998.

    Examples
    --------
    One point in each quarter of both coordinates:

    >>> points = sobol_points(4, 2, seed=1)
    >>> np.sort(np.floor(4 * points), axis=0)
    array([[0., 0.],
           [1., 1.],
           [2., 2.],
           [3., 3.]])
    """
    if inputs > COORDINATES:
        from scipy.stats import qmc  # slow to load; few jobs have this number of inputs

        return qmc.Sobol(inputs, rng=np.random.default_rng(seed)).random(count)
    random = np.random.default_rng(seed).spawn(1)[0]  # like SciPy
    shift = random.integers(2, size=(inputs, BITS), dtype=np.uint32) @ WEIGHTS[::-1]
    lower_triangle = np.tril(random.integers(2, size=(inputs, BITS, BITS), dtype=np.uint32), -1)
    # Matousek's scrambling: each digit plus a random sum of the digits before it.
    scrambled = ((lower_triangle + np.eye(BITS)) @ _directions(inputs)).astype(np.int64) & 1
    numbers = np.vstack([shift, (WEIGHTS @ scrambled).T]).astype(np.int64)
    # In the order of the Gray code, neighbouring points differ by one direction number.
    place = np.arange(1, count)
    steps = np.log2(place & -place).astype(int) + 1
    return np.bitwise_xor.accumulate(numbers[np.append(0, steps)]) / 2.0**BITS


@cache
def _directions(inputs):
    """Digits (inputs, BITS, BITS) of the direction numbers, one number in each column."""
    lines = Path(__file__).with_name("joe_kuo.txt").read_text("ascii").splitlines()
    rows = [[int(word) for word in line.split()] for line in lines if not line.startswith("#")]
    numbers = np.array([_extend_directions(*row) for row in rows[:inputs]], dtype=np.int64)
    digits = numbers.reshape(inputs, 1, BITS) >> np.arange(BITS - 1, -1, -1)[:, None]
    return (digits & 1).astype(float)


def _extend_directions(polynomial, *initial):
    """BITS direction numbers from the first numbers m, by the recurrence of a primitive polynomial.

    m_k = 2 a_1 m_k-1 xor 4 a_2 m_k-2 xor ... xor 2^s m_k-s xor m_k-s (Joe, Kuo 2008, equation 2)
    """
    degree, numbers = polynomial.bit_length() - 1, list(initial)
    while len(numbers) < BITS:
        # The term m_k-s of the recurrence; the first coordinate has degree 0 and all m = 1.
        value = numbers[-degree] if degree else 1
        for lag in range(1, degree + 1):
            if polynomial >> (degree - lag) & 1:
                value ^= numbers[-lag] << lag
        numbers.append(value)
    return [m << (BITS - 1 - k) for k, m in enumerate(numbers)]
