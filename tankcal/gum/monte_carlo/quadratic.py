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

import numpy as np
from scipy.special import ndtr

STEADY = 16.0  # the parabola turns no nearer than this many scales
RARE = 1e-3  # part of the draws where it may
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
        found = np.zeros((len(d), len(self.hessians)))
        for form, felt, hessian in self.own_blocks():
            part = d[:, felt]
            found[:, form] = np.einsum("na,na->n", part @ hessian, part)
        return found

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
    scale   (n,) of the coordinates
    """

    def __init__(self, rows, normal, shapes, scale):
        sizes = np.abs(rows.jacobian) * scale
        own = np.linalg.norm(sizes[:, normal], axis=1)
        others = np.where(normal, 0.0, sizes)
        largest = np.argmax(others, axis=1)
        everyone = np.arange(len(largest))
        self.along = np.where(own >= others[everyone, largest], -1, largest)
        direction = np.zeros_like(rows.jacobian)
        together = self.along < 0
        own_part = np.where(normal, rows.jacobian, 0.0)[together]
        length = np.linalg.norm(own_part, axis=1)[:, None]
        direction[together] = np.divide(own_part, length, out=own_part * 0, where=length > 0)
        alone = np.flatnonzero(~together)
        sign = np.sign(rows.jacobian[alone, largest[alone]])
        direction[alone, largest[alone]] = sign
        self.rows, self.direction, self.shapes, self.scale = rows, direction, shapes, scale
        self.slope = np.sum(rows.jacobian * direction, axis=1)
        self.twist = np.zeros_like(direction)
        for form, felt, hessian in rows.own_blocks():
            weight = 2 * rows.weights[:, form, None]
            self.twist[:, felt] += weight * (direction[:, felt] @ hessian)
        self.bend = np.sum(self.twist * direction, axis=1) / 2
        self.reach = np.where(together, 1.0, scale[largest])
        self.pure = ~np.any(others != 0, axis=1)  # normal inputs only: the linear part is exact

    def groups(self, draws):
        """Blocks of rows that share their kind of direction: (coordinate or -1, row numbers)."""
        size = max(1, CELLS // draws)
        for along in np.unique(self.along):
            found = np.flatnonzero(self.along == along)
            for block in np.array_split(found, 1 + (len(found) - 1) // size):
                yield int(along), block

    def differences(self, along, block, draws, targets, levels, linear):
        """(sets, block, levels) means over the draws of a set of P(V <= target) - P(L <= linear).

        draws    e (sets, count, n) and their forms (sets, count, k)
        targets, linear  (block, levels) counted from V0; each P(L <= linear) is its level, added
        Also (block,) the part of draws in which the parabola turns too near.
        """
        e, forms = (part.reshape(-1, part.shape[-1]) for part in draws)
        sets, a = len(draws[0]), self.direction[block]
        place = e @ a.T
        lin = e @ self.rows.jacobian[block].T
        value = lin + forms @ self.rows.weights[block].T
        slope = self.slope[block] + e @ self.twist[block].T
        bend, reach = self.bend[block], self.reach[block]
        near = np.mean(slope < 2 * STEADY * np.abs(bend) * reach, axis=0)
        cdf, exact = self._cdf(along), np.all(self.pure[block])
        found = np.empty((sets, len(block), len(levels)))
        for i, level in enumerate(levels):
            inside = cdf(place + _root(targets[:, i] - value, slope, bend))
            if not exact:
                inside -= cdf(place + (linear[:, i] - lin) / self.slope[block])
                inside += level
            found[:, :, i] = inside.reshape(sets, -1, len(block)).mean(axis=1)
        return found, near

    def _cdf(self, along):
        """Of the place along a direction: every input is symmetric, whichever way it points."""
        if along < 0:
            return ndtr
        shape, scale = self.shapes[along], self.scale[along]
        return lambda value: shape.cdf(value / scale)


def _root(gap, slope, bend):
    """t nearest to 0 with slope t + bend t^2 = gap; +-inf with the side where none is."""
    inside = slope**2 + (4 * bend) * gap
    lost = inside.min() <= 0 or slope.min() <= 0
    with np.errstate(divide="ignore", invalid="ignore"):  # where there is none
        root = 2 * gap / (slope + np.sqrt(np.maximum(inside, 0.0) if lost else inside))
    if lost:
        root = np.where((inside <= 0) | (slope <= 0), np.copysign(np.inf, gap), root)
    return root
