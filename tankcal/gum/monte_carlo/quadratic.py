"""Rows that are quadratic in a few inputs, as those of a capacity table, simulated without a
matrix of draws by rows.

V(rows) = V0 + J d + sum_k (d' H_k d) b_k, d = x - mean. Along one direction a of each row (all its
normal inputs together, or its largest other input) V is a parabola of d'a, whose law is known: the
draw of the rest gives the probability of V <= y in closed form. Its difference from that of the
linear part, whose law is known without draws, is what is averaged: the standard error of an
interval's end is about the standard deviation of the quadratic part, over the root of the draws.
Sources: JCGM 101:2008 5.2, 7.6, 7.7; control variates and conditional Monte Carlo: Owen 2013 8.7,
8.9; scrambled Sobol points: Owen 1998.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.special import ndtr, ndtri

STEADY = 16.0  # the parabola turns no nearer than this many scales
RARE = 1e-3  # part of the draws where it may
NEAR = 0.03  # ends of a step of the normal distribution that Taylor's series gives to 2e-11
SHORT_STEP = 0.01  # and those of another smooth one, in scales, that its first term gives to 4e-8
PEAK = 1 / np.sqrt(2 * np.pi)  # of the normal density
CELLS = 1 << 16  # draws by rows held at once


@dataclass(frozen=True)
class QuadraticRows:
    """A model of many rows that share few inputs; called with draws it gives the rows.

    Attributes
    ----------
    value : ndarray, shape (rows,)
        At the means of the inputs.
    jacobian : ndarray, shape (rows, n)
        Derivatives by the inputs.
    hessians : ndarray, shape (k, n, n)
        Symmetric, H_k; half the second derivatives where a row's b_k is 1.
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
        """(draws, rows) for (draws, n) values of the inputs."""
        d = np.asarray(x) - self.mean
        return self.value + d @ self.jacobian.T + self.forms(d) @ self.weights.T

    def forms(self, d):
        """(draws, k) quadratic forms d' H_k d."""
        found, by_input = np.zeros((len(self.hessians), len(d))), np.ascontiguousarray(d.T)
        for form, felt, hessian in self.own_blocks():
            part = by_input[felt]
            found[form] = np.einsum("an,an->n", hessian @ part, part)
        return found.T

    def own_blocks(self):
        """(k, inputs, block) of each H_k that is not 0: the inputs that it has, and its part."""
        for form, hessian in enumerate(self.hessians):
            felt = np.flatnonzero(np.any(hessian != 0, axis=0))
            if len(felt):
                yield form, felt, hessian[np.ix_(felt, felt)]

    def subset(self, rows):
        """The same model with some of its rows."""
        return QuadraticRows(
            self.value[rows], self.jacobian[rows], self.hessians, self.weights[rows], self.mean
        )

    def in_coordinates(self, transform):
        """The same rows as functions of e, d = transform @ e, whose mean is 0."""
        hessians = transform.T @ self.hessians @ transform
        zero = np.zeros(transform.shape[1])
        return QuadraticRows(self.value, self.jacobian @ transform, hessians, self.weights, zero)


class Lines:
    """One direction for each row, and the parabola of each draw along it.

    rows    QuadraticRows in independent coordinates e
    normal  (n,) which coordinates are unit normals; shapes  (n,) Shape of the others
    scale   (n,) of the coordinates, 1 of the normal ones
    """

    def __init__(self, rows, normal, shapes, scale):
        other = np.flatnonzero(~normal)
        sizes = np.abs(rows.jacobian[:, other]) * scale[other]
        normals = rows.jacobian[:, normal]
        own = np.linalg.norm(normals, axis=1)
        together = own >= np.max(sizes, axis=1, initial=0.0)
        alone = np.flatnonzero(~together)
        largest = other[np.argmax(sizes[alone], axis=1)] if len(alone) else alone
        self.along = np.full(len(own), -1)
        self.along[alone] = largest
        direction = np.zeros_like(rows.jacobian)
        length = own[:, None]
        direction[:, normal] = np.divide(normals, length, out=normals * 0, where=length > 0)
        direction[alone] = 0.0
        direction[alone, largest] = np.sign(rows.jacobian[alone, largest])
        self.rows, self.direction, self.shapes, self.scale = rows, direction, shapes, scale
        self.slope = np.einsum("ra,ra->r", rows.jacobian, direction)
        twist, by_input = np.zeros(direction.shape[::-1]), np.ascontiguousarray(direction.T)
        twice = 2 * np.ascontiguousarray(rows.weights.T)
        for form, felt, hessian in rows.own_blocks():
            twist[felt] += twice[form] * (hessian @ by_input[felt])
        self.twist = twist.T
        self.bend = np.einsum("ar,ar->r", twist, by_input) / 2
        self.reach = np.ones(len(own))
        self.reach[alone] = scale[largest]
        self.pure = ~np.any(sizes != 0, axis=1)  # normal inputs only: the linear part is exact

    def groups(self, draws):
        """Blocks of rows that share their kind of direction: (coordinate or -1, row numbers)."""
        size = max(1, CELLS // draws)
        for along in np.unique(self.along):
            found = np.flatnonzero(self.along == along)
            for block in np.array_split(found, 1 + (len(found) - 1) // size):
                yield int(along), block

    def differences(self, along, block, draws, targets, levels, linear):
        """(levels, sets, block) means over the draws of a set of P(V <= target) - P(L <= linear).

        draws    e (sets, count, n) and their forms (sets, count, k)
        targets, linear  (block, levels) counted from V0; each P(L <= linear) is its level, added
        Also (block,) the part of draws in which the parabola turns too near.
        """
        e, forms = map(np.concatenate, draws)
        place = e @ self.direction[block].T
        lin = e @ self.rows.jacobian[block].T
        value = forms @ self.rows.weights[block].T
        value += lin
        slope, bend = self.slope[block], self.bend[block]
        half = e @ (self.twist[block].T / 2)
        half += slope / 2
        near = np.mean(half < STEADY * np.abs(bend) * self.reach[block], axis=0)
        between, exact = self._between(along), np.all(self.pure[block])
        rest = None if exact else np.subtract(place, lin / slope, out=lin)
        found = np.empty((len(levels), len(draws[0]), len(block)))
        root_of, spare = _Roots(half, bend), np.empty_like(place)
        for i, level in enumerate(levels):
            root = root_of(np.subtract(targets[:, i], value, out=spare))
            root += place
            inside = between(ndtri(level) if exact else rest + linear[:, i] / slope, root)
            found[i] = inside.reshape(len(draws[0]), -1, len(block)).mean(axis=1)
            found[i] += level
        return found, near

    def _between(self, along):
        """P(first < place along a direction <= last) as a function that may overwrite the last.

        Every input is symmetric, whichever way it points.
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
        """Whether the law along a direction has neither kinks nor steps."""
        return along < 0 or self.shapes[along].density is not None


def _smooth_between(cdf, density, short, first, last):
    """F(last) - F(first), in the place of last: of near ones by the density at their middle."""
    gap = np.subtract(last, first, out=last)
    if not max(gap.max(), -gap.min()) < short:
        gap += first
        return cdf(gap) - cdf(first)
    middle = 0.5 * gap
    middle += first
    gap *= density(middle)
    return gap


def _normal_between(first, last):
    """Phi(last) - Phi(first), in the place of last: of near ones by Taylor about their middle m.

    phi(m) d (1 + (m^2 - 1) d^2/24), short by no more than 1.2 d^5/1920
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
    """t nearest to 0 with 2 half t + bend t^2 = gap; +-inf with the side where none is.

    half  (draws, rows); bend  (rows,)
    """

    def __init__(self, half, bend):
        self.half, self.bend = half, bend
        self.squares, self.spare = half * half, np.empty_like(half)
        self.steep = half.min() > 0

    def __call__(self, gap):
        """(draws, rows) in the place of the gaps."""
        inside = np.multiply(gap, self.bend, out=self.spare)
        inside += self.squares
        lost = not (self.steep and inside.min() > 0)
        none = (inside <= 0) | (self.half <= 0) if lost else None
        if lost:
            side = np.copysign(np.inf, gap[none])
            np.maximum(inside, 0.0, out=inside)
        divisor = np.sqrt(inside, out=inside)
        divisor += self.half
        with np.errstate(divide="ignore", invalid="ignore"):  # where there is none
            gap /= divisor
        if lost:
            gap[none] = side
        return gap
