"""Misfit of the readings of a wall at given component variances: value, slope, curvature.

With B the covariance of the own components of a part, E its `values`, C the covariance of the
common values, N = sum E' B^-1 E and r = sum E' B^-1 y,

    S = (C^-1 + N)^-1,  y' V^-1 y = sum y' B^-1 y - r' S r,  log |V| = sum log |B| + log |I + N C|,

and P = V^-1 has the diagonal blocks B^-1 - U U' and the off-diagonal blocks - U U', with U = B^-1 E
S^(1/2). With K_i the derivative of V by a variance, the first and second derivatives of y' V^-1 y +
log |V| are

    tr(P K_i) - y' P K_i P y,  2 y' P K_i P K_j P y - tr(P K_i P K_j).

Source: Patterson & Thompson 1971 (restricted maximum likelihood); Gilmour, Thompson & Cullis 1995
(second derivatives).
"""

from functools import cached_property

import numpy as np
import scipy.linalg

ROUNDING = 1e-11  # relative increase of the diagonal that keeps a covariance positive definite


class Misfit:
    """Minus twice the log density of a `Likelihood` at given variances, up to a constant.

    Parameters
    ----------
    likelihood : Likelihood
    logs : ndarray, shape (variances,)
        Logarithms of the variances.

    Attributes
    ----------
    value : float
    """

    def __init__(self, likelihood, logs):
        self._likelihood, self._variances = likelihood, np.exp(logs)
        departure = logs - likelihood.middle
        self._by_prior = likelihood.precision @ departure  # half the derivative
        # Covariance C of the common values.
        common_covariance = np.diag(likelihood.wide)
        common_covariance += np.tensordot(self._variances[likelihood.common], likelihood.spread, 1)
        half = np.linalg.cholesky(rounded(common_covariance))
        products, value, self._solved = np.zeros((len(half) + 1,) * 2), 0.0, []
        for part in likelihood.parts:
            logarithm, inverse = part.inverted(self._variances[likelihood.own])
            solved = _times(inverse, part.both)
            products += part.both.T @ solved
            value += logarithm
            self._solved.append((inverse, solved))
        self._normal, right_side = products[:-1, :-1], products[:-1, -1]
        # |I + N C| = |I + L' N L| with C = L L': symmetric, and regular also for singular C.
        root = np.linalg.cholesky(np.eye(len(half)) + half.T @ self._normal @ half)
        self._root = half  # S^(1/2)
        if len(half):
            self._root = scipy.linalg.solve_triangular(root, half.T, lower=True).T
        self._common = self._root @ (self._root.T @ right_side)  # the common values, estimated
        self._pull = right_side - self._normal @ self._common  # E' P y
        value += products[-1, -1] - right_side @ self._common + 2 * np.sum(np.log(np.diag(root)))
        self.value = value + departure @ self._by_prior

    @cached_property
    def slope(self):
        """Derivative (variances,) by the logarithms."""
        return self._variances * self._by_variances + 2 * self._by_prior

    @property
    def curvature(self):
        """Second derivative (variances, variances) by the logarithms."""
        return self._of_logs(2 * self._squares() - self._traces())

    @property
    def average_curvature(self):
        """Mean of observed and expected second derivative, without traces: a tenth of the work."""
        return self._of_logs(self._squares())

    def _of_logs(self, by_variances):
        """Convert a second derivative by variances to the logarithms, and add the prior."""
        diagonal = np.diag(self._variances * self._by_variances) + 2 * self._likelihood.precision
        return self._variances[:, None] * by_variances * self._variances + diagonal

    @cached_property
    def _parts(self):
        """For each part: its block of P less P y y' P (m, m), upper half, U (m, k) and P y (m,)."""
        parts = []
        for inverse, solved in self._solved:
            factors = solved[:, :-1] @ np.column_stack([self._root, self._common])
            factors[:, -1] = solved[:, -1] - factors[:, -1]
            parts.append((_less(inverse, factors), factors[:, :-1], factors[:, -1]))
        return parts

    @cached_property
    def _by_variances(self):
        """Derivative (variances,) by the variances, without the prior."""
        likelihood = self._likelihood
        slopes, by_root = np.zeros(len(self._variances)), self._normal @ self._root
        outer = self._normal - by_root @ by_root.T - np.outer(self._pull, self._pull)
        np.add.at(slopes, likelihood.common, np.tensordot(likelihood.spread, outer, 2))
        for part, (precision, _, _) in zip(likelihood.parts, self._parts, strict=True):
            np.add.at(slopes, likelihood.own, part.traces(precision))
        return slopes

    def _squares(self):
        """Return y' P K_i P K_j P y, shape (variances, variances)."""
        likelihood = self._likelihood
        common = (likelihood.spread @ self._pull).T
        inner_terms, cross_terms = 0.0, 0.0
        for part, (precision, by_root, pull) in zip(likelihood.parts, self._parts, strict=True):
            # K_i P y within the part: own components, then the common values.
            changes = np.column_stack([(part.own @ pull).T, part.values @ common])
            shared, by_pull = by_root.T @ changes, pull @ changes
            inner_terms += changes.T @ _times(precision, changes) + np.outer(by_pull, by_pull)
            inner_terms += shared.T @ shared
            cross_terms += shared
        return self._scattered(inner_terms - cross_terms.T @ cross_terms)

    def _traces(self):
        """Return tr(P K_i P K_j), shape (variances, variances)."""
        likelihood, spread = self._likelihood, self._root @ self._root.T  # S
        projector = np.eye(len(spread)) - spread @ self._normal  # P E = B^-1 E times it
        own, by_common = 0.0, np.zeros((len(likelihood.own), *spread.shape))
        for part, (precision, _, pull), (_, solved) in zip(
            likelihood.parts, self._parts, self._solved, strict=True
        ):
            block = np.triu(precision) + np.triu(precision, 1).T + np.outer(pull, pull)
            by_values = np.tensordot(part.own, solved[:, :-1], 1)
            by_values = np.tensordot(by_values, solved[:, :-1], (1, 0))
            own += _products(part.own, block) - _products(by_values, spread)
            by_common += by_values
        own += _products(by_common, spread)
        mixed = np.tensordot(
            projector.T @ by_common @ projector, likelihood.spread, ((1, 2), (1, 2))
        )
        common = _products(likelihood.spread, self._normal @ projector)
        return self._scattered(np.block([[own, mixed], [mixed.T, common]]))

    def _scattered(self, elements):
        """Sum the elements of covariances of parts and of `spread` that belong to each variance."""
        index = np.concatenate([self._likelihood.own, self._likelihood.common])
        total = np.zeros((len(self._variances),) * 2)
        np.add.at(total, np.ix_(index, index), elements)
        return total


def _products(matrices, other):
    """Return the traces (q, q) of A_i O A_j O for symmetric matrices A (q, m, m) and O."""
    transformed = np.tensordot(matrices, other, 1)
    return np.tensordot(transformed, transformed, ((1, 2), (2, 1)))


def rounded(covariance):
    """Return the covariance, made positive definite in spite of rounding; changed in place."""
    covariance.flat[:: len(covariance) + 1] *= 1 + ROUNDING
    return covariance


def _times(half, columns):
    """Return the product of a symmetric matrix, of which the upper half is filled, and columns."""
    if not len(half):
        return np.zeros(columns.shape)
    return scipy.linalg.blas.dsymm(1.0, half, columns)


def _less(half, columns):
    """Return a symmetric matrix, upper half, less columns @ columns.T; overwrites the matrix."""
    if not len(half):
        return half
    return scipy.linalg.blas.dsyrk(-1.0, columns, beta=1.0, c=half, overwrite_c=True)
