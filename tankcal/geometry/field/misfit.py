"""The misfit of the readings of a wall at one place among its variances: value, slope, curvature.

With B the covariance of a part's own, E its `values`, C that of the common values,
N = sum E' B^-1 E and r = sum E' B^-1 y,

    S = (C^-1 + N)^-1,  y' V^-1 y = sum y' B^-1 y - r' S r,  log |V| = sum log |B| + log |I + N C|,

and P = V^-1 has the blocks B^-1 - U U' of a part, - U U' of two, with U = B^-1 E S^(1/2). K_i the
derivative of V by one variance, the first and second derivatives of y' V^-1 y + log |V| are

    tr(P K_i) - y' P K_i P y,  2 y' P K_i P K_j P y - tr(P K_i P K_j).

Source: Patterson & Thompson 1971 (restricted maximum likelihood); Gilmour, Thompson & Cullis 1995
(its second derivatives).
"""

from functools import cached_property

import numpy as np
import scipy.linalg

ROUNDING = 1e-11  # of the largest variances, that keeps a covariance positive


class Misfit:
    """Doubled negative logarithm of the density of `Likelihood` at one place, but for a constant.

    Attributes
    ----------
    value : float
    """

    def __init__(self, likelihood, logs):
        self._likelihood, self._variances = likelihood, np.exp(logs)
        away = logs - likelihood.middle
        self._by_prior = likelihood.precision @ away  # half the derivative
        before = np.diag(likelihood.wide)
        before += np.tensordot(self._variances[likelihood.common], likelihood.spread, 1)
        half = np.linalg.cholesky(rounded(before))
        told, value, self._solved = np.zeros((len(half) + 1,) * 2), 0.0, []
        for part in likelihood.parts:
            logarithm, inverse = part.inverted(self._variances[likelihood.own])
            across = _times(inverse, part.both)
            told += part.both.T @ across
            value += logarithm
            self._solved.append((inverse, across))
        self._normal, right = told[:-1, :-1], told[:-1, -1]
        root = np.linalg.cholesky(np.eye(len(half)) + half.T @ self._normal @ half)
        self._root = half  # of S
        if len(half):
            self._root = scipy.linalg.solve_triangular(root, half.T, lower=True).T
        self._common = self._root @ (self._root.T @ right)  # the common values, estimated
        self._pull = right - self._normal @ self._common  # E' P y
        value += told[-1, -1] - right @ self._common + 2 * np.sum(np.log(np.diag(root)))
        self.value = value + away @ self._by_prior

    @cached_property
    def slope(self):
        """(variances,) derivative by the logarithms."""
        return self._variances * self._by_variances + 2 * self._by_prior

    @property
    def curvature(self):
        """(variances, variances) second derivative by the logarithms."""
        return self._of_logs(2 * self._squares() - self._traces())

    @property
    def average_curvature(self):
        """The mean of that and of the one that was expected: a tenth of the work."""
        return self._of_logs(self._squares())

    def _of_logs(self, by_variances):
        along = np.diag(self._variances * self._by_variances) + 2 * self._likelihood.precision
        return self._variances[:, None] * by_variances * self._variances + along

    @cached_property
    def _parts(self):
        """Of each part its block of P less P y y' P (m, m), upper half, U (m, k) and P y (m,)."""
        found = []
        for inverse, across in self._solved:
            known = across[:, :-1] @ np.column_stack([self._root, self._common])
            known[:, -1] = across[:, -1] - known[:, -1]
            found.append((_less(inverse, known), known[:, :-1], known[:, -1]))
        return found

    @cached_property
    def _by_variances(self):
        """(variances,) derivative by the variances, but for their prior's."""
        one = self._likelihood
        found, by_root = np.zeros(len(self._variances)), self._normal @ self._root
        outer = self._normal - by_root @ by_root.T - np.outer(self._pull, self._pull)
        np.add.at(found, one.common, np.tensordot(one.spread, outer, 2))
        for part, (precision, _, _) in zip(one.parts, self._parts, strict=True):
            np.add.at(found, one.own, part.traces(precision))
        return found

    def _squares(self):
        """(variances, variances) y' P K_i P K_j P y."""
        one = self._likelihood
        common = (one.spread @ self._pull).T
        alone, together = 0.0, 0.0
        for part, (precision, by_root, pull) in zip(one.parts, self._parts, strict=True):
            moved = np.column_stack([(part.own @ pull).T, part.values @ common])
            shared, by_pull = by_root.T @ moved, pull @ moved
            alone += moved.T @ _times(precision, moved) + np.outer(by_pull, by_pull)
            alone += shared.T @ shared
            together += shared
        return self._scattered(alone - together.T @ together)

    def _traces(self):
        """(variances, variances) tr(P K_i P K_j)."""
        one, spread = self._likelihood, self._root @ self._root.T  # S
        follows = np.eye(len(spread)) - spread @ self._normal  # P E = B^-1 E times it
        own, seen = 0.0, np.zeros((len(one.own), *spread.shape))
        for part, (precision, _, pull), (_, across) in zip(
            one.parts, self._parts, self._solved, strict=True
        ):
            whole = np.triu(precision) + np.triu(precision, 1).T + np.outer(pull, pull)
            by_values = np.tensordot(part.own, across[:, :-1], 1)
            by_values = np.tensordot(by_values, across[:, :-1], (1, 0))
            own += _products(part.own, whole) - _products(by_values, spread)
            seen += by_values
        own += _products(seen, spread)
        mixed = np.tensordot(follows.T @ seen @ follows, one.spread, ((1, 2), (1, 2)))
        common = _products(one.spread, self._normal @ follows)
        return self._scattered(np.block([[own, mixed], [mixed.T, common]]))

    def _scattered(self, found):
        """What belongs to each covariance of a part, and to each of `spread`, by variances."""
        index = np.concatenate([self._likelihood.own, self._likelihood.common])
        whole = np.zeros((len(self._variances),) * 2)
        np.add.at(whole, np.ix_(index, index), found)
        return whole


def _products(matrices, other):
    """(q, q) traces of A_i O A_j O of each two of symmetric matrices (q, m, m), and another one."""
    moved = np.tensordot(matrices, other, 1)
    return np.tensordot(moved, moved, ((1, 2), (2, 1)))


def rounded(covariance):
    """The covariance, positive in spite of rounding."""
    covariance.flat[:: len(covariance) + 1] *= 1 + ROUNDING
    return covariance


def _times(half, columns):
    """Product with a symmetric matrix of which the upper half is filled."""
    if not len(half):
        return np.zeros(columns.shape)
    return scipy.linalg.blas.dsymm(1.0, half, columns)


def _less(half, columns):
    """A symmetric matrix, upper half, less the products of columns; it is used up."""
    if not len(half):
        return half
    return scipy.linalg.blas.dsyrk(-1.0, columns, beta=1.0, c=half, overwrite_c=True)
