"""The law of a sum of independent inputs, for thousands of rows of coefficients, without draws.

F(y) = 1/2 + sum_k phi(t_k) sin(t_k y) / (pi (k + 1/2)), t_k = (k + 1/2) 2 pi / period,
phi(t) = exp(-s^2 t^2 / 2) prod_j phi_j(c_j t): normal inputs together, the others from tables of
their characteristic functions, which are real because every input is symmetric about its mean.
Sources: Gil-Pelaez 1951; Davies 1973 (the sum instead of the integral); JCGM 101:2008 5.2, 7.7.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import expit, ndtri

SPACING = 0.0025  # of a table of phi, in units of 1/scale
SHORT, LONG = 1 << 14, 1 << 18  # values of such a table: FEWEST terms need no more than the first
FEWEST, MOST = 40, 5120  # terms of the sum
LEAST = 1e-6  # what the terms left out may be worth, as a probability
SMOOTH = 1e-6  # phi at the end of a short table of what has neither kinks nor steps
CLOSE = 1e-4  # last step of Newton, in scales: the next one would be some 1e-8
STEP = 1e-6  # of a probability over which the density of an input that acts alone is taken
BLOCK, ROWS = 1 << 18, 256  # numbers held at once, but of so many rows at least
AT_ONCE = 8  # terms of which the factors are computed, so that they stay in the processor's cache


class Shape:
    """The tables of an input that is not normal, counted from its mean in units of a scale.

    The input offers `characteristic(t)`, the real E cos(t (X - mean)).

    value, below  (m,) values and the probability below each
    density       (m,) at the values; None where it has kinks or steps, which phi does not forget
    reach         value beyond which the density no longer matters for the sum over k
    end, rest     t scale where the longest table of phi ends, and how large phi is there
    second, fourth  moments about the mean, within probabilities 1e-13 and 1 - 1e-13
    """

    def __init__(self, distribution, scale):
        self._distribution, self._scale = distribution, scale
        self.below = expit(np.linspace(-30, 30, 4001))
        quantiles = np.asarray(distribution.quantile(self.below), dtype=float)
        self.value = (quantiles - distribution.mean) / scale
        self.reach = float(distribution.quantile(1 - 1e-5) - distribution.mean) / scale
        moments = (np.trapezoid(self.value**power, self.below) for power in (2, 4))
        self.second, self.fourth = map(float, moments)
        self._tabulate(SHORT)
        smooth = np.max(np.abs(self._phi[-8:])) < SMOOTH
        self.density = np.gradient(self.below, self.value) if smooth else None

    def _tabulate(self, length):
        """The characteristic function at 0, SPACING, 2 SPACING, ..."""
        phi = self._distribution.characteristic(SPACING / self._scale * np.arange(length))
        self._phi = np.asarray(phi, dtype=float)
        self._steps = np.diff(self._phi)

    end = (LONG - 1) * SPACING

    @cached_property
    def rest(self):
        """The largest |phi| over the last wave of the longest table."""
        t = self.end - np.linspace(0.0, 2 * np.pi, 64)
        return float(np.max(np.abs(self._distribution.characteristic(t / self._scale))))

    def law(self, levels):
        """Quantiles (levels,) and densities at them, from the mean in units of the scale."""
        ends = levels + STEP * levels * (1 - levels) * np.array([[-1.0], [0.0], [1.0]])
        low, middle, high = self._distribution.quantile(ends) / self._scale
        return middle - self._distribution.mean / self._scale, (ends[2] - ends[0]) / (high - low)

    def characteristic(self, t, factor=1.0):
        """E cos(factor t e), neither below 0, linear between the values of the table; 0 beyond."""
        place = t * (factor / SPACING)
        most = place.max(initial=0.0)
        if most >= len(self._steps) and len(self._phi) < LONG:
            self._tabulate(LONG)
        left = place.astype(np.intp)
        value = self._steps.take(left, mode="clip")
        value *= np.subtract(place, left, out=place)
        value += self._phi.take(left, mode="clip")
        if most >= len(self._steps):
            value[left >= len(self._steps)] = 0.0
        return value


def shapes_of(ready):
    """(n,) Shape of each input that is not normal, None for the others."""
    numbered = zip(ready.distributions, ready.normal, ready.scale, strict=True)
    return [None if normal else Shape(one, scale) for one, normal, scale in numbered]


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
    alone = (own == 0) & (count == 1)
    for j in others:
        rows = np.flatnonzero(alone & (coefficients[:, j] != 0))
        value, steepness = shapes[j].law(levels)
        size = np.abs(coefficients[rows, j, None])
        quantile[rows], density[rows], known[rows] = size * value, steepness / size, True
    chosen = [shapes[j] for j in others]
    pending, terms = np.flatnonzero((count > 0) & ~alone), FEWEST
    while len(pending) and terms <= MOST:
        left = []
        for block in np.array_split(pending, 1 + len(pending) // max(BLOCK // terms, ROWS)):
            sums = _Sums(own[block], coefficients[np.ix_(block, others)], chosen, terms)
            done = sums.converged
            if not np.all(done):
                sums.only(done)
            quantile[block[done]], density[block[done]] = sums.solve(levels)
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
        order = np.arange(terms)[:, None] + 0.5
        self.phi = np.empty((terms, 2, len(own)))  # of the density, of the cdf
        by_order, sizes = self.spacing / self.scale, np.abs(parts.T)
        for some in range(0, terms, AT_ONCE):
            t = order[some : some + AT_ONCE] * by_order
            phi = own * t
            phi *= phi
            phi *= -0.5
            np.exp(phi, out=phi)
            for shape, part in zip(shapes, sizes, strict=True):
                phi *= shape.characteristic(t, part)
            self.phi[some : some + AT_ONCE, 0] = phi
        np.divide(self.phi[:, 0], order, out=self.phi[:, 1])
        last = np.max(np.abs(self.phi[-8:, 0]), axis=0)
        left = last / (order[-1] * self.spacing)
        for shape, part in zip(shapes, sizes, strict=True):
            end = np.divide(shape.end, part, out=np.full_like(part, np.inf), where=part > 0)
            cut = end * self.scale < order[-1] * self.spacing  # terms beyond its table are 0 here
            rest = shape.rest * np.exp(-0.5 * (own[cut] * end[cut]) ** 2)
            left[cut] = np.maximum(left[cut], rest / (end[cut] * self.scale[cut]))
        self.converged = left < np.pi * LEAST

    def only(self, chosen):
        """Keep the chosen rows."""
        self.scale, self.spacing = self.scale[chosen], self.spacing[chosen]
        self.phi = self.phi[:, :, chosen]

    def at(self, y):
        """Cdf and density at (rows,) values in units of the scale.

        Both sums by Clenshaw's recurrence, b_k = phi_k + 2 cos(a) b_k+1 - b_k+2, a = y spacing:
        sum phi_k cos((k + 1/2) a) = cos(a/2) (b_0 - b_1), with sines sin(a/2) (b_0 + b_1).
        """
        angle = self.spacing * y
        twice = 2 * np.cos(angle)
        first, second, spare = np.zeros((3, *self.phi.shape[1:]))
        for of_order in self.phi[::-1]:
            np.multiply(twice, first, out=spare)
            spare -= second
            spare += of_order
            first, second, spare = spare, first, second
        density = np.cos(angle / 2) * (first[0] - second[0]) * self.spacing / np.pi
        cdf = 0.5 + np.sin(angle / 2) * (first[1] + second[1]) / np.pi
        return cdf, density

    def solve(self, levels):
        """(rows, levels) quantiles and densities, by Newton inside a shrinking bracket."""
        scale, half = self.scale, np.pi / self.spacing
        quantile = np.empty((len(scale), len(levels)))
        density = np.empty_like(quantile)
        upper = np.maximum(levels, 1 - levels)
        for level in np.unique(upper):
            low, high = -half, half.copy()
            y = np.clip(np.full(len(scale), ndtri(level)), -0.9 * half, 0.9 * half)
            for _ in range(60):
                cdf, slope = self.at(y)
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
