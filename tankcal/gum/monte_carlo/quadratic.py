"""Distribution of a sum of independent inputs for thousands of rows, without draws.

    F(y) = 1/2 + sum_k phi(t_k) sin(t_k y) / (pi (k + 1/2)),   t_k = (k + 1/2) 2 pi / period
    phi(t) = exp(-s^2 t^2 / 2) prod_j phi_j(c_j t)

All normal inputs enter together, the other inputs by tables of their characteristic functions.
These functions are real, because every input is symmetric about its mean.

Sources: Gil-Pelaez 1951; Davies 1973 (the sum instead of the integral); JCGM 101:2008 5.2, 7.7.

Rows that are quadratic in few inputs, such as a capacity table, without a matrix draws x rows.

    V(rows) = V0 + J d + sum_k (d' H_k d) b_k,   d = x - mean

Along one direction a of each row, V is a parabola of d'a with a known distribution. The direction
is the gradient of all normal inputs together, or the largest other input. For given draws of the
remaining coordinates, the probability of V <= y has a closed form. The simulation averages its
difference from the probability of the linear part, whose distribution is known without draws. The
standard error of an end of the interval is about the standard deviation of the quadratic part,
divided by the root of the number of draws.

Estimates are means over independent point sets. u follows from the exact u of the linear part and
the covariance of the quadratic forms. The ends follow by inversion of the distribution function,
which `Lines` estimates at three levels about each end.

Sources: JCGM 101:2008 5.2, 7.6, 7.7; control variates and conditional Monte Carlo: Owen 2013 8.7,
8.9; randomised point sets, scrambled Sobol points: Owen 1998.
"""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from scipy.special import expit, ndtr, ndtri

from tankcal.gum.monte_carlo.goal import as_good_as_plain, may_stop
from tankcal.gum.monte_carlo.inputs import inputs_of, sobol_points

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


STEADY = 16.0  # least distance of the vertex of a parabola, in scales
RARE = 1e-3  # largest share of draws with a nearer vertex
NEAR = 0.03  # largest step in the normal distribution by Taylor's series, accurate to 2e-11
SHORT_STEP = 0.01  # step in another smooth distribution, in scales; first term accurate to 4e-8
PEAK = 1 / np.sqrt(2 * np.pi)  # maximum of the normal density
CELLS = 1 << 16  # draws times rows in memory
SETS = 10  # number of independent point sets
POINTS = 2048  # points of a set; intervals use FIRST to MOST points
FIRST, QUADRATIC_MOST = 8, 1024  # eight points of each set usually equal 1e7 plain draws
SEEN = 2.0  # least expected number of points of all sets beyond an end
PILOT = 16, 64  # points of the first set that locate the ends: first attempt, later attempts
STILL = 0.01  # change of a target, relative to the lowest level, below which it is final
NEAR_SCORES = 0.005  # largest difference of scores by Taylor's series, accurate to 1e-8
QUADRATIC_ROWS = 1024  # rows whose moments are computed together, so that they stay in the cache
SIDES = np.array([0.6, 1.0, 1.4])  # levels about an end, relative to its level


@dataclass(frozen=True)
class QuadraticRows:
    """Model of many rows that are quadratic in few inputs; a call evaluates the rows.

    Attributes
    ----------
    value : ndarray, shape (rows,)
        Values at the means of the inputs.
    jacobian : ndarray, shape (rows, n)
        Derivatives by the inputs.
    hessians : ndarray, shape (k, n, n)
        Symmetric matrices H_k; half the second derivatives of a row with b_k = 1.
    weights : ndarray, shape (rows, k)
        b_k.
    mean : ndarray, shape (n,)
        Means of the inputs.
    """

    value: np.ndarray
    jacobian: np.ndarray
    hessians: np.ndarray
    weights: np.ndarray
    mean: np.ndarray

    def __call__(self, x):
        """Rows (draws, rows) for values (draws, n) of the inputs."""
        # V0 + J d + sum_k (d' H_k d) b_k.
        d = np.asarray(x) - self.mean
        return self.value + d @ self.jacobian.T + self.forms(d) @ self.weights.T

    def forms(self, d):
        """Quadratic forms d' H_k d, shape (draws, k)."""
        values, columns = np.zeros((len(self.hessians), len(d))), np.ascontiguousarray(d.T)
        for form, used, hessian in self.own_blocks():
            part = columns[used]
            values[form] = np.einsum("an,an->n", hessian @ part, part)
        return values.T

    def own_blocks(self):
        """Iterate over the non-zero H_k: index k, indices of its inputs, and its non-zero block."""
        for form, hessian in enumerate(self.hessians):
            used = np.flatnonzero(np.any(hessian != 0, axis=0))
            if len(used):
                yield form, used, hessian[np.ix_(used, used)]

    def subset(self, rows):
        """Model with selected rows."""
        return QuadraticRows(
            self.value[rows], self.jacobian[rows], self.hessians, self.weights[rows], self.mean
        )

    def in_coordinates(self, transform):
        """Rows as functions of e with d = transform @ e, whose mean is 0."""
        # d' H d = e' (T' H T) e.
        hessians = transform.T @ self.hessians @ transform
        zero = np.zeros(transform.shape[1])
        return QuadraticRows(self.value, self.jacobian @ transform, hessians, self.weights, zero)


class Lines:
    """Direction of each row, and parabola of each draw along the direction.

    Parameters
    ----------
    rows : QuadraticRows
        Rows in independent coordinates e.
    normal : ndarray of bool, shape (n,)
        True for a unit normal coordinate.
    shapes : sequence of Shape or None, length n
        Shape of each other coordinate.
    scale : ndarray, shape (n,)
        Scale of each coordinate, 1 for a normal coordinate.

    Attributes
    ----------
    along : ndarray of int, shape (rows,)
        Coordinate of the direction; -1 for the normal coordinates together.
    direction : ndarray, shape (rows, n)
        Direction of each row.
    slope, bend, reach : ndarray, shape (rows,)
        Slope and curvature of the parabola, and scale along the direction.
    twist : ndarray, shape (rows, n)
        Change of the slope with the coordinates.
    pure : ndarray of bool, shape (rows,)
        True for a row with normal inputs only.
    """

    def __init__(self, rows, normal, shapes, scale):
        other_inputs = np.flatnonzero(~normal)
        sizes = np.abs(rows.jacobian[:, other_inputs]) * scale[other_inputs]
        normals = rows.jacobian[:, normal]
        normal_norm = np.linalg.norm(normals, axis=1)
        # The direction with the largest share of the linear part.
        along_normals = normal_norm >= np.max(sizes, axis=1, initial=0.0)
        single_rows = np.flatnonzero(~along_normals)
        largest_input = (
            other_inputs[np.argmax(sizes[single_rows], axis=1)] if len(single_rows) else single_rows
        )
        self.along = np.full(len(normal_norm), -1)
        self.along[single_rows] = largest_input
        direction = np.zeros_like(rows.jacobian)
        length = normal_norm[:, None]
        direction[:, normal] = np.divide(normals, length, out=normals * 0, where=length > 0)
        direction[single_rows] = 0.0
        direction[single_rows, largest_input] = np.sign(rows.jacobian[single_rows, largest_input])
        self.rows, self.direction, self.shapes, self.scale = rows, direction, shapes, scale
        self.slope = np.einsum("ra,ra->r", rows.jacobian, direction)
        # Derivatives of V along a: slope J a, change of the slope 2 sum_k b_k H_k a, and curvature
        # a' sum_k b_k H_k a.
        twist, direction_columns = (
            np.zeros(direction.shape[::-1]),
            np.ascontiguousarray(direction.T),
        )
        twice = 2 * np.ascontiguousarray(rows.weights.T)
        for form, used, hessian in rows.own_blocks():
            twist[used] += twice[form] * (hessian @ direction_columns[used])
        self.twist = twist.T
        self.bend = np.einsum("ar,ar->r", twist, direction_columns) / 2
        self.reach = np.ones(len(normal_norm))
        self.reach[single_rows] = scale[largest_input]
        self.pure = ~np.any(sizes != 0, axis=1)  # normal inputs only: exact linear part

    def groups(self, draws):
        """Iterate over blocks of rows with a common direction: (coordinate or -1, row numbers)."""
        size = max(1, CELLS // draws)
        for along in np.unique(self.along):
            rows = np.flatnonzero(self.along == along)
            for block in np.array_split(rows, 1 + (len(rows) - 1) // size):
                yield int(along), block

    def differences(self, along, block, draws, targets, levels, linear):
        """Means of P(V <= target) - P(L <= linear) over the draws of each set, plus the level.

        Parameters
        ----------
        along : int
            Coordinate of the direction, or -1.
        block : ndarray of int
            Row numbers.
        draws : tuple of ndarray
            Coordinates e (sets, count, n), and their forms (sets, count, k).
        targets, linear : ndarray, shape (block, levels)
            Values relative to V0.
        levels : ndarray, shape (levels,)
            P(L <= linear).

        Returns
        -------
        means : ndarray, shape (levels, sets, block)
        turning_share : ndarray, shape (block,)
            Share of draws with a vertex that is too near.
        """
        e, forms = map(np.concatenate, draws)
        # Coordinate of each draw along the direction.
        place = e @ self.direction[block].T
        linear_value = e @ self.rows.jacobian[block].T
        # Value and slope of the parabola at the draw.
        value = forms @ self.rows.weights[block].T
        value += linear_value
        slope, bend = self.slope[block], self.bend[block]
        half = e @ (self.twist[block].T / 2)
        half += slope / 2
        turning_share = np.mean(half < STEADY * np.abs(bend) * self.reach[block], axis=0)
        probability_between, exact = self._interval_probability(along), np.all(self.pure[block])
        remainder = None if exact else np.subtract(place, linear_value / slope, out=linear_value)
        means = np.empty((len(levels), len(draws[0]), len(block)))
        find_root, spare = _Roots(half, bend), np.empty_like(place)
        for i, level in enumerate(levels):
            # Along the direction, V <= target up to the root, and L <= linear up to a known place.
            root = find_root(np.subtract(targets[:, i], value, out=spare))
            root += place
            difference = probability_between(
                ndtri(level) if exact else remainder + linear[:, i] / slope, root
            )
            means[i] = difference.reshape(len(draws[0]), -1, len(block)).mean(axis=1)
            means[i] += level
        return means, turning_share

    def _interval_probability(self, along):
        """Function for P(first < place along a direction <= last), which may overwrite `last`.

        Every input is symmetric, so that the sign of the direction is irrelevant.
        """
        if along < 0:
            return _normal_between
        shape, scale = self.shapes[along], self.scale[along]
        value = shape.value * scale
        cdf = partial(np.interp, xp=value, fp=shape.below)
        if shape.density is None:
            return lambda first, last: cdf(last) - cdf(first)
        density = partial(np.interp, xp=value, fp=shape.density / scale)
        return partial(_smooth_between, cdf, density, SHORT_STEP * scale)

    def smooth(self, along):
        """Whether the distribution along a direction has neither kinks nor steps."""
        return along < 0 or self.shapes[along].density is not None


def _smooth_between(cdf, density, short, first, last):
    """F(last) - F(first), written to `last`; short steps use the density in the middle."""
    gap = np.subtract(last, first, out=last)
    if not max(gap.max(), -gap.min()) < short:
        gap += first
        return cdf(gap) - cdf(first)
    middle = 0.5 * gap
    middle += first
    gap *= density(middle)
    return gap


def _normal_between(first, last):
    """Phi(last) - Phi(first), written to `last`; short steps use Taylor's series.

    About the middle m: phi(m) d (1 + (m^2 - 1) d^2/24), with an error of at most 1.2 d^5/1920.
    """
    gap = np.subtract(last, first, out=last)
    if not max(gap.max(), -gap.min()) < NEAR:
        gap += first
        return ndtr(gap, out=gap) - ndtr(first)
    middle = 0.5 * gap
    middle += first
    middle *= middle
    density = np.exp(-0.5 * middle)
    middle -= 1.0
    middle *= gap
    middle *= gap
    middle *= PEAK / 24
    middle += PEAK
    middle *= gap
    middle *= density
    return middle


class _Roots:
    """Root t nearest to 0 of 2 half t + bend t^2 = gap; +-inf, with its sign, without a root.

    Parameters
    ----------
    half : ndarray, shape (draws, rows)
        Half the slope.
    bend : ndarray, shape (rows,)
        Curvature.
    """

    def __init__(self, half, bend):
        self.half, self.bend = half, bend
        self.squares, self.spare = half * half, np.empty_like(half)
        self.steep = half.min() > 0

    def __call__(self, gap):
        """Roots (draws, rows), written to the gaps."""
        # t = gap / (half + sqrt(half^2 + bend gap)) avoids cancellation and a division by bend.
        radicand = np.multiply(gap, self.bend, out=self.spare)
        radicand += self.squares
        has_missing = not (self.steep and radicand.min() > 0)
        is_missing = (radicand <= 0) | (self.half <= 0) if has_missing else None
        if has_missing:
            infinity = np.copysign(np.inf, gap[is_missing])
            np.maximum(radicand, 0.0, out=radicand)
        divisor = np.sqrt(radicand, out=radicand)
        divisor += self.half
        with np.errstate(divide="ignore", invalid="ignore"):  # missing roots
            gap /= divisor
        if has_missing:
            gap[is_missing] = infinity
        return gap


def table_estimates(model, ready, goal, progress):
    """Estimates of quadratic rows.

    Parameters
    ----------
    model : QuadraticRows
        The rows.
    ready : Inputs
        Prepared inputs.
    goal : Goal
        Goal of the simulation.
    progress : callable
        progress(text, done, total).

    Returns
    -------
    estimates, errors : ndarray, shape (6, rows)
        In the order of goal.NAMES.
    draws : ndarray, shape (rows,)
        Number of draws.
    controlled : ndarray of bool, shape (rows,)
        True if the linear part served as control.
    sound : ndarray of bool, shape (rows,)
        True for a row with valid ends.

    Notes
    -----
    A row is not valid in three cases: its quadratic part is too large for a single parabola, its
    shortest interval is far from the symmetric interval, or plain draws are as precise. The ends of
    such a row are nan, and another method must find them.
    """
    rows, ready = _reduce_coordinates(model, ready)
    sets = _point_sets(ready, goal)
    forms = np.stack([rows.forms(e) for e in sets])
    shapes = shapes_of(ready)
    lines = Lines(rows, ready.normal, shapes, ready.coordinate_scale)
    levels = np.concatenate([SIDES * goal.tail, 1 - SIDES[::-1] * goal.tail])
    scaled = rows.jacobian * ready.coordinate_scale
    law = linear_law(scaled, ready.normal, shapes, levels)
    moments = _moments(rows, ready, forms)
    ends_of_rows = _Ends(lines, law, levels, sets, forms)
    estimates, errors = np.full((2, 6, len(rows.value)), np.nan)  # nan reveals missing estimates
    estimates[:2], errors[:2] = _mean_and_error(moments)
    draws = np.full(len(rows.value), SETS * POINTS)
    first = FIRST
    # A high coverage probability needs more points for the tails.
    while SETS * first * goal.tail < SEEN:
        first *= 4
    pending, count = np.flatnonzero(law.known), first
    # Rows without uncertainty are exact.
    sound = ~np.any(scaled != 0, axis=1) & ~np.any(rows.weights != 0, axis=1)
    estimates[2:, sound], errors[2:, sound] = rows.value[sound], 0.0
    plain = _plain_errors(goal, rows, ready, shapes, law)
    while len(pending) and count <= QUADRATIC_MOST:
        ends, steady = ends_of_rows.find_ends(pending, count)
        estimates[2:, pending], errors[2:, pending] = _mean_and_error(ends)
        part = estimates[:, pending], errors[:, pending], plain[:, pending]
        # A row that is valid with 8 points may prove invalid with more points.
        sound[pending] = steady & as_good_as_plain(goal, *part)
        part[1][:2] = 0.0  # mean and u already use all points
        # With the first points, an unsteady row may only lack points to locate its ends.
        needs_more = np.where(steady, ~may_stop(goal, *part), count == first)
        pending, count = pending[needs_more], 4 * count
        progress("Monte Carlo", len(law.known) - len(pending), len(law.known))
    return estimates, errors, draws, law.known.copy(), sound


def _reduce_coordinates(model, ready):
    """Rows in few independent coordinates, and the inputs of these coordinates.

    The distribution of each row is required, not the joint distribution. Normal coordinates are
    therefore rotated until the first coordinates contain all quadratic forms. The sum of the other
    normal coordinates differs from row to row, and is represented by one additional normal
    coordinate.
    """
    normal, transform = ready.normal, ready.transform
    is_curved = np.any(model.hessians != 0, axis=(0, 1)) & normal
    # Orthonormal basis of the normal coordinates with a quadratic effect.
    rotation = np.linalg.qr(transform[np.ix_(is_curved, normal)].T).Q
    if np.count_nonzero(normal) - rotation.shape[1] < 2:
        return model.in_coordinates(transform), ready
    curved_part = transform[:, normal] @ rotation
    zero_column = np.zeros((len(normal), 1))
    rows = model.in_coordinates(np.hstack([transform[:, ~normal], curved_part, zero_column]))
    slopes = model.jacobian @ transform[:, normal]
    # Linear part orthogonal to this basis; its norm is the coefficient of the additional normal.
    slopes -= (slopes @ rotation) @ rotation.T
    rows.jacobian[:, -1] = np.linalg.norm(slopes, axis=1)
    remaining = [ready.distributions[j] for j in np.flatnonzero(~normal)]
    # The coordinate of every normal input is a unit normal.
    unit_normal = ready.distributions[np.argmax(normal)]
    return rows, inputs_of(remaining + [unit_normal] * (rotation.shape[1] + 1))


def _point_sets(ready, goal):
    """Coordinates (sets, points, n) of independent scrambled Sobol points."""
    seeds = np.random.SeedSequence(goal.seed).spawn(SETS)
    count = len(ready.mean)
    return np.stack([ready.coordinates(sobol_points(POINTS, count, seed)) for seed in seeds])


def _plain_errors(goal, rows, ready, shapes, law):
    """Standard errors (3, rows) of u and both ends for one plain draw of the linear part.

    For u: sqrt(u^4 (2 + excess)/4)/u, with the excess from the fourth moments of the inputs.
    """
    excess = [0.0 if s is None else s.fourth - 3 * s.second**2 for s in shapes]
    parts = (rows.jacobian * ready.coordinate_scale) ** 2
    second = [1.0 if s is None else s.second for s in shapes]
    variance, fourth = parts @ second, parts**2 @ excess
    variance = np.where(variance > 0, variance, 1.0)
    error_of_u = np.sqrt(np.maximum(2 * variance**2 + fourth, 0.0) / (4 * variance))
    ends = np.sqrt(goal.tail * (1 - goal.tail)) / law.density[:, [1, 4]].T
    return np.concatenate([error_of_u[None, :], ends])


def _mean_and_error(sets):
    """Mean and standard error over independent sets (first axis)."""
    with np.errstate(invalid="ignore"):
        error = np.std(sets, axis=0, ddof=1) / np.sqrt(len(sets))
    return np.mean(sets, axis=0), error


def _moments(rows, ready, forms):
    """Mean and u (sets, 2, rows): exact linear part, quadratic part from the draws.

    Both parts are uncorrelated, because the coordinates are symmetric about 0.
    """
    sd = ready.coordinate_sd
    finite = np.isfinite(sd)
    # E(e' H e) = sum_a H_aa sd_a^2 for independent coordinates.
    exact = np.einsum("kaa,a->k", rows.hessians[:, finite][:, :, finite], sd[finite] ** 2)
    is_sampled = np.any(rows.hessians[:, ~finite] != 0, axis=(1, 2))
    with np.errstate(invalid="ignore"):
        linear = np.where(rows.jacobian == 0, 0.0, rows.jacobian * sd)
    linear_variance = np.sum(linear**2, axis=1)
    means = np.array([np.where(is_sampled, form.mean(axis=0), exact) for form in forms])
    deviations = forms - means[:, None]
    # Covariance of the quadratic forms in each set.
    products = [deviation.T @ deviation / len(deviation) for deviation in deviations]
    moments = np.empty((len(forms), 2, len(linear_variance)))
    for start in range(0, len(linear_variance), QUADRATIC_ROWS):
        block = slice(start, start + QUADRATIC_ROWS)
        weights = rows.weights[block]
        moments[:, 0, block] = means @ weights.T + rows.value[block]
        for set_moments, product in zip(moments, products, strict=True):
            quadratic_variance = np.einsum("rk,rk->r", weights @ product, weights)
            set_moments[1, block] = np.sqrt(linear_variance[block] + quadratic_variance)
    return moments


class _Ends:
    """Both intervals of selected rows, from the first points of every set."""

    def __init__(self, lines, law, levels, sets, forms):
        self.lines, self.law, self.levels = lines, law, levels
        self.sets, self.forms = sets, forms
        self.score = ndtri(levels)

    def find_ends(self, rows, count):
        """Ends (sets, 4, rows) from `count` points of every set, and mask of the steady rows.

        The ends of other rows are nan.
        """
        ends = np.full((len(self.sets), 4, len(rows)), np.nan)
        steady = np.zeros(len(rows), dtype=bool)
        position = np.full(len(self.law.known), -1)
        position[rows] = np.arange(len(rows))
        for along, block in self.lines.groups(len(self.sets) * count):
            block = block[position[block] >= 0]
            if not len(block):
                continue
            columns = position[block]
            target, is_found = self._targets(along, block, PILOT[count > FIRST])
            scores, turning_share = self._scores(along, block, target, count)
            # A parabola through three levels needs increasing scores.
            rising = np.all(scores[1:] > scores[:-1], axis=(0, 1))
            usable = np.flatnonzero(is_found & rising & (turning_share <= RARE))
            base = self.lines.rows.value[block[usable]]
            relative_ends, within = self._invert(scores[..., usable], target[usable].T)
            is_inner = np.all(within, axis=0)
            ends[:, :, columns[usable[is_inner]]] = base[is_inner] + relative_ends[
                :, :, is_inner
            ].swapaxes(0, 1)
            steady[columns[usable]] = is_inner
        return ends, steady

    def _targets(self, along, block, count):
        """Values (block, levels) near the levels, from `count` draws, and mask of valid rows."""
        linear, slope = self.law.quantile[block], self.law.density[block]
        pilot = self.sets[:1, :count], self.forms[:1, :count]
        shift = np.mean(pilot[1][0] @ self.lines.rows.weights[block].T, axis=0)
        target = linear + shift[:, None]
        for _ in range(2):
            probability, _ = self.lines.differences(
                along, block, pilot, target, self.levels, linear
            )
            # Newton step with the density of the linear part.
            change = (self.levels - probability[:, 0].T) / slope
            target = target + change
            is_settled = np.max(np.abs(change) * slope) < STILL * self.levels[0]
            if is_settled and self.lines.smooth(along):
                break  # with kinks, the ends depend on the targets
        return target, np.all(np.abs(change) * slope < 0.1 * self.levels[0], axis=1)

    def _scores(self, along, block, target, count):
        """Normal scores (levels, sets, block) of the probability below the targets."""
        draws = self.sets[:, :count], self.forms[:, :count]
        linear = self.law.quantile[block]
        probability, turning_share = self.lines.differences(
            along, block, draws, target, self.levels, linear
        )
        return _scores_near(self.levels, probability), turning_share

    def _invert(self, score, target):
        """Invert the distribution function for the ends of both intervals.

        Parameters
        ----------
        score : ndarray, shape (levels, sets, block)
            Normal scores at the targets.
        target : ndarray, shape (levels, block)
            Targets.

        Returns
        -------
        ends : ndarray, shape (4, sets, block)
        within : ndarray of bool, shape (sets, block)
            True if the shortest interval lies within the levels.
        """
        lower_end, upper_end = (
            _fit_parabolas(score[:3], target[:3]),
            _fit_parabolas(score[3:], target[3:]),
        )
        lower = [lower_end(score_value) for score_value in self.score[:3]]
        upper = [upper_end(score_value) for score_value in self.score[3:]]
        first, second, third = (high - low for low, high in zip(lower, upper, strict=True))
        # The shortest length is the minimum of a parabola through the lengths at three lower
        # levels.
        curve = first - 2 * second + third
        offset = np.divide(first - third, 2 * curve, out=np.full_like(curve, 2.0), where=curve > 0)
        is_within = np.abs(offset) <= 1
        tail = self.levels[1] * (1 + (SIDES[2] - 1) * np.clip(offset, -1, 1))
        high = 1 - 2 * self.levels[1] + tail
        shortest = lower_end(ndtri(tail)), upper_end(ndtri(high))
        return np.stack([lower[1], upper[1], *shortest]), is_within


def _scores_near(levels, p):
    """ndtri(p) of p (levels, sets, rows), by Taylor's series if all are near their levels.

    z + d (1 + z d/2 + (2 z^2 + 1) d^2/6) with d = (p - level)/phi(z); the error is about (z^3 + z)
    d^4.
    """
    z = ndtri(levels)[:, None, None]
    d = (p - levels[:, None, None]) * (np.sqrt(2 * np.pi) * np.exp(z**2 / 2))
    if not max(d.max(), -d.min()) < NEAR_SCORES:
        return ndtri(np.clip(p, 1e-9, 1 - 1e-9))
    series = d * ((2 * z**2 + 1) / 6)
    series += z / 2
    series *= d
    series += 1.0
    series *= d
    series += z
    return series


def _fit_parabolas(x, y):
    """Function for the parabolas through three points, x (3, sets, rows) and y (3, rows)."""
    a, b, c = x
    # Divided differences, Newton's form.
    first, second = (y[1] - y[0]) / (b - a), (y[2] - y[1]) / (c - b)
    bend = (second - first) / (c - a)
    return lambda position: y[0] + (position - a) * (first + (position - b) * bend)
