"""The law of a sum of independent inputs, for thousands of rows of coefficients, without draws.

F(y) = 1/2 + sum_k phi(t_k) sin(t_k y) / (pi (k + 1/2)), t_k = (k + 1/2) 2 pi / period,
phi(t) = exp(-s^2 t^2 / 2) prod_j phi_j(c_j t): normal inputs together, the others from tables of
their characteristic functions, which are real because every input is symmetric about its mean.
Sources: Gil-Pelaez 1951; Davies 1973 (the sum instead of the integral); JCGM 101:2008 5.2, 7.7.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import expit, ndtri

SPACING, LENGTH = 0.0025, 1 << 17  # of a table of phi, in units of 1/scale
FEWEST, MOST = 64, 4096  # terms of the sum
LEAST = 5e-6  # what the terms left out may be worth, as a probability
CLOSE = 1e-4  # last step of Newton, in scales: the next one would be some 1e-8
STRIDE = 16  # terms of which exp(i t y) is a product: of FEWEST a part
BLOCK = 1 << 18  # numbers held at once


@dataclass(frozen=True)
class Shape:
    """An input that is not normal, counted from its mean in units of its scale.

    value, below  (m,) values and the probability below each
    phi           (LENGTH,) characteristic function at 0, SPACING, 2 SPACING, ...
    reach         value beyond which the density no longer matters for the sum over k
    second, fourth  moments about the mean, within probabilities 1e-13 and 1 - 1e-13
    """

    value: np.ndarray
    below: np.ndarray
    phi: np.ndarray
    reach: float
    second: float
    fourth: float

    def cdf(self, value):
        """Probability below each value."""
        return np.interp(value, self.value, self.below)

    def characteristic(self, t):
        """E cos(t e), linear between the values of the table; 0 beyond it."""
        place = np.abs(t) * (1 / SPACING)
        left = np.minimum(place.astype(np.int32), LENGTH - 2)
        start = self.phi[left]
        value = start + (self.phi[left + 1] - start) * (place - left)
        return np.where(place < LENGTH - 1, value, 0.0)


def shape_of(distribution, scale):
    """The tables of an input that offers `characteristic(t)`, the real E cos(t (X - mean))."""
    below = expit(np.linspace(-30, 30, 4001))
    value = (np.asarray(distribution.quantile(below), dtype=float) - distribution.mean) / scale
    phi = distribution.characteristic(SPACING / scale * np.arange(LENGTH))
    reach = float(distribution.quantile(1 - 1e-5) - distribution.mean) / scale
    second, fourth = (float(np.trapezoid(value**power, below)) for power in (2, 4))
    return Shape(value, below, np.asarray(phi, dtype=float), reach, second, fourth)


def shapes_of(ready):
    """(n,) Shape of each input that is not normal, None for the others."""
    numbered = zip(ready.distributions, ready.normal, ready.scale, strict=True)
    return [None if normal else shape_of(one, scale) for one, normal, scale in numbered]


@dataclass(frozen=True)
class LinearLaw:
    """Quantiles and densities of linear parts, counted from their mean.

    quantile, density  (rows, levels) in the rows' unit and its inverse; nan where not known
    known              (rows,) False where the sum over k does not converge, or nothing varies
    """

    quantile: np.ndarray
    density: np.ndarray
    known: np.ndarray


def linear_law(coefficients, normal, shapes, levels):
    """The law of coefficients @ e at probability levels.

    coefficients  (rows, n) by coordinate, in units of its scale (unit normals or a Shape)
    normal        (n,) which coordinates are unit normals; shapes  (n,) their Shape, else None
    levels        (levels,) probabilities
    """
    levels = np.asarray(levels, dtype=float)
    own = np.linalg.norm(coefficients[:, normal], axis=1)
    others = np.flatnonzero(~normal & np.any(coefficients != 0, axis=0))
    count = np.count_nonzero(coefficients[:, others], axis=1)
    known = (own > 0) & (count == 0)
    quantile = np.full((len(own), len(levels)), np.nan)
    density = np.full_like(quantile, np.nan)
    quantile[known] = own[known, None] * ndtri(levels)
    density[known] = np.exp(-(ndtri(levels) ** 2) / 2) / np.sqrt(2 * np.pi) / own[known, None]
    chosen = [shapes[j] for j in others]
    pending, terms = np.flatnonzero(count > 0), FEWEST
    while len(pending) and terms <= MOST:
        left = []
        for block in np.array_split(pending, 1 + len(pending) * terms // BLOCK):
            sums = _Sums(own[block], coefficients[np.ix_(block, others)], chosen, terms)
            done = sums.converged
            quantile[block[done]], density[block[done]] = sums.solve(done, levels)
            known[block[done]] = True
            left.append(block[~done])
        pending, terms = np.concatenate(left), 2 * terms
    return LinearLaw(quantile, density, known)


class _Sums:
    """The sums over k of some rows, each in units of its own scale."""

    def __init__(self, own, parts, shapes, terms):
        self.scale = np.sqrt(own**2 + np.sum(parts**2, axis=1))
        reach = np.array([shape.reach for shape in shapes])
        half = np.sqrt(36 * own**2 + np.sum((parts * reach) ** 2, axis=1)) / self.scale
        self.spacing = np.pi / np.maximum(half, 6.0)
        self.order = np.arange(terms) + 0.5
        self.t = self.spacing[:, None] * self.order
        t = self.t / self.scale[:, None]
        self.phi = np.exp(-((own[:, None] * t) ** 2) / 2)
        for shape, part in zip(shapes, parts.T, strict=True):
            self.phi *= shape.characteristic(part[:, None] * t)
        last = np.max(np.abs(self.phi[:, -8:]), axis=1)
        self.converged = last / (np.pi * self.t[:, -1]) < LEAST

    def at(self, y, chosen):
        """Cdf and density at (rows,) values in units of the scale."""
        angle = (1j * self.spacing[chosen] * y)[:, None]
        coarse = np.exp(angle * self.order[::STRIDE])  # exp(i t y) in strides, then within them
        fine = np.exp(angle * np.arange(STRIDE))
        phi = self.phi[chosen]
        waves = (coarse[:, :, None] * fine[:, None, :]).reshape(phi.shape)
        density = np.einsum("rk,rk->r", phi, waves.real) * self.spacing[chosen] / np.pi
        cdf = 0.5 + np.einsum("rk,rk,k->r", phi, waves.imag, 1 / self.order) / np.pi
        return cdf, density

    def solve(self, chosen, levels):
        """(rows, levels) quantiles and densities, by Newton inside a shrinking bracket."""
        scale, half = self.scale[chosen], np.pi / self.spacing[chosen]
        quantile = np.empty((len(scale), len(levels)))
        density = np.empty_like(quantile)
        upper = np.maximum(levels, 1 - levels)
        for level in np.unique(upper):
            low, high = -half, half.copy()
            y = np.clip(np.full(len(scale), ndtri(level)), -0.9 * half, 0.9 * half)
            for _ in range(60):
                cdf, slope = self.at(y, chosen)
                low, high = np.where(cdf < level, y, low), np.where(cdf < level, high, y)
                step = np.divide(level - cdf, slope, out=np.full_like(y, np.nan), where=slope > 0)
                inside = (y + step > low) & (y + step < high)
                before, y = y, np.where(inside, y + step, (low + high) / 2)
                if np.max(np.abs(y - before), initial=0.0) < CLOSE:
                    break
            same = upper == level
            quantile[:, same] = np.outer(y * scale, np.where(levels[same] < 0.5, -1.0, 1.0))
            density[:, same] = (slope / scale)[:, None]
        return quantile, density
