"""Rows that are quadratic in few inputs, such as a capacity table, without a matrix draws x rows.

    V(rows) = V0 + J d + sum_k (d' H_k d) b_k,   d = x - mean

Along one direction a of each row, V is a parabola of d'a with a known distribution. The direction
is the gradient of all normal inputs together, or the largest other input. For given draws of the
remaining coordinates, the probability of V <= y has a closed form. The simulation averages its
difference from the probability of the linear part, whose distribution is known without draws. The
standard error of an end of the interval is about the standard deviation of the quadratic part,
divided by the root of the number of draws.

Sources: JCGM 101:2008 5.2, 7.6, 7.7; control variates and conditional Monte Carlo: Owen 2013 8.7,
8.9; scrambled Sobol points: Owen 1998.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.special import ndtr, ndtri

STEADY = 16.0  # least distance of the vertex of a parabola, in scales
RARE = 1e-3  # largest share of draws with a nearer vertex
NEAR = 0.03  # largest step in the normal distribution by Taylor's series, accurate to 2e-11
SHORT_STEP = 0.01  # step in another smooth distribution, in scales; first term accurate to 4e-8
PEAK = 1 / np.sqrt(2 * np.pi)  # maximum of the normal density
CELLS = 1 << 16  # draws times rows in memory


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
