"""The inputs of a simulation: draws of them, and the independent coordinates behind them.

x = mean + T e: e are independent; unit normals behind normal inputs (correlated ones through the
factor of their correlation), the deviation from the mean itself for every other input.
Sources: JCGM 101:2008 6.4 (distributions), 6.4.8 and C.5 (correlated normal inputs).
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.special import ndtr, ndtri

PROBES = np.array([1e-9, 1e-5, 0.003, 0.1, 0.31, 0.5, 0.77, 0.98, 0.9999, 1 - 1e-9])


class Distribution(Protocol):
    """What an input must offer: mean, sd (its unit, may be inf) and the inverse of its cdf."""

    mean: float
    sd: float

    def quantile(self, p):
        """Values below which the input lies with probability p (array)."""


def is_normal(distribution):
    """Whether the quantiles are those of a normal distribution."""
    if not np.isfinite(distribution.sd):
        return False
    expected = distribution.mean + distribution.sd * ndtri(PROBES)
    found = np.asarray(distribution.quantile(PROBES), dtype=float)
    return bool(np.allclose(found, expected, rtol=0, atol=1e-9 * distribution.sd))


@dataclass(frozen=True)
class Inputs:
    """Inputs with what their draws need.

    distributions  (n,) objects with mean, sd and quantile(p)
    mean, scale    (n,) means; standard deviations, or half the central 68 % where these are inf
    normal         (n,) whether an input is normal
    factor         (n, n) Cholesky factor of the correlation of the normal scores, or None
    transform      (n, n) T of x = mean + T e, or None: correlated inputs that are not normal
    """

    distributions: tuple
    mean: np.ndarray
    scale: np.ndarray
    normal: np.ndarray
    factor: np.ndarray | None
    transform: np.ndarray | None

    @property
    def coordinate_sd(self):
        """(n,) standard deviation of the independent coordinates e."""
        own = [distribution.sd for distribution in self.distributions]
        return np.where(self.normal, 1.0, own)

    @property
    def coordinate_scale(self):
        """(n,) scale of the independent coordinates e: finite where the sd is not."""
        return np.where(self.normal, 1.0, self.scale)

    def draws(self, uniforms):
        """(draws, n) values x and coordinates e (or None) for (draws, n) uniform numbers."""
        if self.transform is not None:
            coordinates = self.coordinates(uniforms)
            return self.mean + coordinates @ self.transform.T, coordinates
        p = ndtr(ndtri(_inside(uniforms)) @ self.factor.T)
        numbered = enumerate(self.distributions)
        return np.column_stack([one.quantile(p[:, j]) for j, one in numbered]), None

    def coordinates(self, uniforms):
        """(draws, n) independent coordinates e, where there is a transform."""
        found = _inside(uniforms)
        for j, distribution in enumerate(self.distributions):
            if not self.normal[j]:
                found[:, j] = distribution.quantile(found[:, j]) - self.mean[j]
        found[:, self.normal] = ndtri(found[:, self.normal])
        return found


def _inside(uniforms):
    return np.clip(uniforms, 2.0**-40, 1 - 2.0**-40)


def inputs_of(distributions, correlation=None):
    """Inputs ready for drawing.

    Parameters
    ----------
    distributions : sequence of Distribution
        n of them, with mean, sd and quantile(p).
    correlation : ndarray, shape (n, n), optional
        Correlation coefficients; of inputs that are not normal those of their normal scores (a
        Gaussian copula). None: independent.

    Returns
    -------
    Inputs

    Raises
    ------
    ValueError
        When the correlation is no correlation matrix.

    Examples
    --------
    >>> from tankcal.gum.distributions import Normal
    >>> from tankcal.gum.monte_carlo.sobol import sobol_points
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
    tied = np.any(correlation != np.eye(len(mean)), axis=0)
    transform = None
    if np.all(normal[tied]):
        transform = np.where(normal, scale, 1.0)[:, None] * factor
    return Inputs(distributions, mean, scale, normal, factor, transform)


def _factor(correlation, count):
    symmetric = correlation.shape == (count, count) and np.allclose(correlation, correlation.T)
    if not symmetric or not np.allclose(np.diag(correlation), 1.0):
        raise ValueError(f"correlation: expected a symmetric {count} x {count} with unit diagonal")
    tied = np.ix_(*2 * [np.any(correlation != np.eye(count), axis=0)])
    values, vectors = np.linalg.eigh(correlation[tied])
    if values.min(initial=0.0) < -1e-10:
        raise ValueError(f"not a correlation matrix: eigenvalue {values[0]:.3g}")
    triangle = np.linalg.qr((vectors * np.sqrt(np.clip(values, 0, None))).T, mode="r").T
    found = np.eye(count)  # a singular part must not reach for the coordinates of others
    found[tied] = triangle * np.where(np.diag(triangle) < 0, -1.0, 1.0)
    return found


def _scale_of(distribution):
    if np.isfinite(distribution.sd):
        return float(distribution.sd)
    low, high = distribution.quantile(np.array([0.16, 0.84]))
    return float(high - low) / 2
