"""Distribution of a sum of independent inputs for thousands of rows, without draws.

    F(y) = 1/2 + sum_k phi(t_k) sin(t_k y) / (pi (k + 1/2)),   t_k = (k + 1/2) 2 pi / period
    phi(t) = exp(-s^2 t^2 / 2) prod_j phi_j(c_j t)

All normal inputs enter together, the other inputs by tables of their characteristic functions.
These functions are real, because every input is symmetric about its mean.

Sources: Gil-Pelaez 1951; Davies 1973 (the sum instead of the integral); JCGM 101:2008 5.2, 7.7.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import expit, ndtri

SPACING = 0.0025  # of a table of phi, in units of 1/scale
SHORT, LONG = 1 << 14, 1 << 18  # lengths of a table; the short table suffices for FEWEST terms
FEWEST, MOST = 40, 5120  # least and largest number of terms of the sum
LEAST = 1e-6  # largest contribution of the neglected terms to a probability
SMOOTH = 1e-6  # largest phi at the end of a short table for a density without kinks and steps
CLOSE = 1e-4  # limit of the last Newton step, in scales; a next step would be about 1e-8
STEP = 1e-6  # relative step in probability for the density of a single input
BLOCK, ROWS = 1 << 18, 256  # elements in memory, for at least this number of rows
AT_ONCE = 8  # terms computed together, so that their factors stay in the cache


class Shape:
    """Tables of an input that is not normal, relative to its mean and in units of a scale.

    Parameters
    ----------
    distribution : object
        Input with `quantile(p)` and `characteristic(t)`, the real E cos(t (X - mean)).
    scale : float
        Unit of the tables, in the unit of the input.

    Attributes
    ----------
    value, below : ndarray, shape (m,)
        Values, and the probability below each value.
    density : ndarray, shape (m,), or None
        Density at the values; None for a density with kinks or steps, for which phi decreases
        slowly.
    reach : float
        Value beyond which the density is negligible for the sum over k.
    end, rest : float
        End of the longest table of phi in t scale, and size of phi there.
    second, fourth : float
        Moments about the mean, within the probabilities 1e-13 and 1 - 1e-13.
    """

    def __init__(self, distribution, scale):
        self._distribution, self._scale = distribution, scale
        # Probabilities equidistant in the logit resolve the tails.
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
        """Tabulate the characteristic function at 0, SPACING, 2 SPACING, ..."""
        phi = self._distribution.characteristic(SPACING / self._scale * np.arange(length))
        self._phi = np.asarray(phi, dtype=float)
        self._steps = np.diff(self._phi)

    end = (LONG - 1) * SPACING

    @cached_property
    def rest(self):
        """Largest |phi| over the last period of a cosine in the longest table."""
        t = self.end - np.linspace(0.0, 2 * np.pi, 64)
        return float(np.max(np.abs(self._distribution.characteristic(t / self._scale))))

    def law(self, levels):
        """Quantiles (levels,) and densities, relative to the mean and in units of the scale."""
        # Density as the inverse of a central difference of the quantiles.
        ends = levels + STEP * levels * (1 - levels) * np.array([[-1.0], [0.0], [1.0]])
        low, middle, high = self._distribution.quantile(ends) / self._scale
        return middle - self._distribution.mean / self._scale, (ends[2] - ends[0]) / (high - low)

    def characteristic(self, t, factor=1.0):
        """E cos(factor t e), interpolated linearly in the table; 0 beyond the table.

        Parameters
        ----------
        t, factor : ndarray or float
            Argument and coefficient, not negative.

        Returns
        -------
        ndarray
        """
        place = t * (factor / SPACING)
        most = place.max(initial=0.0)
        # The long table is computed only if a row needs it.
        if most >= len(self._steps) and len(self._phi) < LONG:
            self._tabulate(LONG)
        index = place.astype(np.intp)
        value = self._steps.take(index, mode="clip")
        value *= np.subtract(place, index, out=place)
        value += self._phi.take(index, mode="clip")
        if most >= len(self._steps):
            value[index >= len(self._steps)] = 0.0
        return value


def shapes_of(ready):
    """Shape of each input that is not normal, and None for a normal input, as a list (n,)."""
    items = zip(ready.distributions, ready.normal, ready.scale, strict=True)
    return [None if normal else Shape(distribution, scale) for distribution, normal, scale in items]


@dataclass(frozen=True)
class LinearLaw:
    """Quantiles and densities of linear parts, relative to their mean.

    Attributes
    ----------
    quantile, density : ndarray, shape (rows, levels)
        In the unit of the row and its inverse; nan if unknown.
    known : ndarray of bool, shape (rows,)
        False if the sum over k does not converge, or without variation.
    """

    quantile: np.ndarray
    density: np.ndarray
    known: np.ndarray


def linear_law(coefficients, normal, shapes, levels):
    """Distribution of coefficients @ e at given probabilities.

    Parameters
    ----------
    coefficients : ndarray, shape (rows, n)
        Coefficients of the coordinates, in units of their scale (unit normal or Shape).
    normal : ndarray of bool, shape (n,)
        True for a unit normal coordinate.
    shapes : sequence of Shape or None, length n
        Shape of each coordinate that is not normal.
    levels : array_like, shape (levels,)
        Probabilities.

    Returns
    -------
    LinearLaw
    """
    levels = np.asarray(levels, dtype=float)
    # Independent normal inputs add up to one normal input.
    normal_norm = np.linalg.norm(coefficients[:, normal], axis=1)
    used = np.flatnonzero(~normal & np.any(coefficients != 0, axis=0))
    count = np.count_nonzero(coefficients[:, used], axis=1)
    known = (normal_norm > 0) & (count == 0)
    quantile = np.full((len(normal_norm), len(levels)), np.nan)
    density = np.full_like(quantile, np.nan)
    # Rows with normal inputs only have a closed form.
    quantile[known] = normal_norm[known, None] * ndtri(levels)
    density[known] = (
        np.exp(-(ndtri(levels) ** 2) / 2) / np.sqrt(2 * np.pi) / normal_norm[known, None]
    )
    # Rows with a single input that is not normal use its quantiles.
    is_single = (normal_norm == 0) & (count == 1)
    for j in used:
        rows = np.flatnonzero(is_single & (coefficients[:, j] != 0))
        value, steepness = shapes[j].law(levels)
        size = np.abs(coefficients[rows, j, None])
        quantile[rows], density[rows], known[rows] = size * value, steepness / size, True
    used_shapes = [shapes[j] for j in used]
    pending, terms = np.flatnonzero((count > 0) & ~is_single), FEWEST
    # All other rows: rows that do not converge get twice the number of terms.
    while len(pending) and terms <= MOST:
        unconverged = []
        for block in np.array_split(pending, 1 + len(pending) // max(BLOCK // terms, ROWS)):
            sums = _Sums(normal_norm[block], coefficients[np.ix_(block, used)], used_shapes, terms)
            is_done = sums.converged
            if not np.all(is_done):
                sums.only(is_done)
            quantile[block[is_done]], density[block[is_done]] = sums.solve(levels)
            known[block[is_done]] = True
            unconverged.append(block[~is_done])
        pending, terms = np.concatenate(unconverged), 2 * terms
    return LinearLaw(quantile, density, known)


class _Sums:
    """Sums over k for some rows, each in units of the scale of the row."""

    def __init__(self, normal_norm, parts, shapes, terms):
        """Compute the terms of the sums.

        Parameters
        ----------
        normal_norm : ndarray, shape (rows,)
            Standard deviation of the normal part.
        parts : ndarray, shape (rows, inputs)
            Coefficients of the inputs that are not normal.
        shapes : sequence of Shape
            These inputs.
        terms : int
            Number of terms.
        """
        self.scale = np.sqrt(normal_norm**2 + np.sum(parts**2, axis=1))
        reach = np.array([shape.reach for shape in shapes])
        # Half the period: six standard deviations of the normal part, and the reach of the others.
        half = np.sqrt(36 * normal_norm**2 + np.sum((parts * reach) ** 2, axis=1)) / self.scale
        self.spacing = np.pi / np.maximum(half, 6.0)
        order = np.arange(terms)[:, None] + 0.5
        self.phi = np.empty((terms, 2, len(normal_norm)))  # terms of the density and of the cdf
        by_order, sizes = self.spacing / self.scale, np.abs(parts.T)
        for start in range(0, terms, AT_ONCE):
            t = order[start : start + AT_ONCE] * by_order
            phi = normal_norm * t
            phi *= phi
            phi *= -0.5
            np.exp(phi, out=phi)
            for shape, part in zip(shapes, sizes, strict=True):
                phi *= shape.characteristic(t, part)
            self.phi[start : start + AT_ONCE, 0] = phi
        np.divide(self.phi[:, 0], order, out=self.phi[:, 1])
        last = np.max(np.abs(self.phi[-8:, 0]), axis=0)
        # The neglected terms are about as large as the last terms.
        truncation = last / (order[-1] * self.spacing)
        for shape, part in zip(shapes, sizes, strict=True):
            end = np.divide(shape.end, part, out=np.full_like(part, np.inf), where=part > 0)
            # Terms beyond the table of an input are 0 in the sum; the end of its table limits their
            # size.
            cut = end * self.scale < order[-1] * self.spacing
            rest = shape.rest * np.exp(-0.5 * (normal_norm[cut] * end[cut]) ** 2)
            truncation[cut] = np.maximum(truncation[cut], rest / (end[cut] * self.scale[cut]))
        self.converged = truncation < np.pi * LEAST

    def only(self, chosen):
        """Keep selected rows."""
        self.scale, self.spacing = self.scale[chosen], self.spacing[chosen]
        self.phi = self.phi[:, :, chosen]

    def evaluate(self, y):
        """Distribution function and density at values y (rows,) in units of the scale.

        Both sums use Clenshaw's recurrence b_k = phi_k + 2 cos(a) b_k+1 - b_k+2 with a = y spacing.
        Then sum phi_k cos((k + 1/2) a) = cos(a/2) (b_0 - b_1), and the sum of sines is sin(a/2)
        (b_0 + b_1).
        """
        angle = self.spacing * y
        twice = 2 * np.cos(angle)
        first, second, spare = np.zeros((3, *self.phi.shape[1:]))
        for terms in self.phi[::-1]:
            np.multiply(twice, first, out=spare)
            spare -= second
            spare += terms
            first, second, spare = spare, first, second
        density = np.cos(angle / 2) * (first[0] - second[0]) * self.spacing / np.pi
        cdf = 0.5 + np.sin(angle / 2) * (first[1] + second[1]) / np.pi
        return cdf, density

    def solve(self, levels):
        """Quantiles and densities (rows, levels), by Newton's method within a shrinking bracket."""
        scale, half = self.scale, np.pi / self.spacing
        quantile = np.empty((len(scale), len(levels)))
        density = np.empty_like(quantile)
        # By symmetry, the levels above one half are sufficient.
        upper = np.maximum(levels, 1 - levels)
        for level in np.unique(upper):
            low, high = -half, half.copy()
            y = np.clip(np.full(len(scale), ndtri(level)), -0.9 * half, 0.9 * half)
            for _ in range(60):
                cdf, slope = self.evaluate(y)
                low, high = np.where(cdf < level, y, low), np.where(cdf < level, high, y)
                step = np.divide(level - cdf, slope, out=np.full_like(y, np.nan), where=slope > 0)
                # A Newton step that leaves the bracket is replaced by bisection.
                inside = (y + step > low) & (y + step < high)
                previous, y = y, np.where(inside, y + step, (low + high) / 2)
                if np.max(np.abs(y - previous), initial=0.0) < CLOSE:
                    break
            at_level = upper == level
            quantile[:, at_level] = np.outer(y * scale, np.where(levels[at_level] < 0.5, -1.0, 1.0))
            density[:, at_level] = (slope / scale)[:, None]
        return quantile, density
