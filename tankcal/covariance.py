"""Covariance of points that share a few causes: a block for each point, and shared columns.

    C = D + U T U',    D = blockdiag(independent),  U (n d, r) the columns,  T (r, r) their cofactor

The hits of a set-up share its position and orientation, all hits of an instrument its scale and
offset, and all points of an adjusted survey the unknowns that remain after the elimination of the
points. The form is exact. Storage and time grow with n r instead of n^2 and n^3.

A linear function of each point alone keeps the form, since (A C A') = A D A' + (A U) T (A U)'. With
the Cholesky factors D = L L', L^-1 U = Q R (thin) and R T R' = E diag(l) E',

    C = L (I + V diag(l) V') L',    V = Q E,
    W = (I + V diag((1 + l)^-1/2 - 1) V') L^-1,    W C W' = I.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse

FEW = 4  # a part of the points below 1/4 has dense columns


@dataclass(frozen=True)
class PointCovariance:
    """Covariance (n d, n d) of n points with d coordinates each.

    Attributes
    ----------
    independent : ndarray, shape (n, d, d)
        Covariance of the independent errors of each point.
    columns : ndarray or sparse array, shape (n d, r)
        Derivatives of the coordinates by the shared unknowns.
    cofactor : ndarray, shape (r, r)
        Covariance of the shared unknowns; it may be indefinite if the sum is not.

    Examples
    --------
    Two distances, each with a variance of 4, with a common offset of variance 1:

    >>> shared = PointCovariance(np.full((2, 1, 1), 4.0), np.ones((2, 1)), np.eye(1))
    >>> shared.dense()
    array([[5., 1.],
           [1., 5.]])
    >>> whiten = shared.whitener()
    >>> bool(np.allclose(whiten(whiten(shared.dense()).T), np.eye(2)))
    True
    """

    independent: np.ndarray
    columns: np.ndarray
    cofactor: np.ndarray

    @classmethod
    def convert(cls, covariance, d):
        """Return the `PointCovariance` of points with d coordinates.

        Parameters
        ----------
        covariance : PointCovariance or ndarray
            Or variances (n d,), covariances (n, d, d) of independent points, or a matrix (n d, n d)
            of any form, stored unchanged.
        d : int
        """
        if isinstance(covariance, cls):
            return covariance
        covariance = np.asarray(covariance, dtype=float)
        if covariance.ndim == 2:
            size = len(covariance)
            blocks = np.zeros((size // d, d, d))
            return cls(blocks, scipy.sparse.eye_array(size, format="csr"), covariance)
        if covariance.ndim == 1:
            covariance = covariance.reshape(-1, d, 1) * np.eye(d)
        return cls(covariance, np.zeros((len(covariance) * d, 0)), np.zeros((0, 0)))

    @property
    def shape(self):
        """Shape of the matrix, (n d, n d)."""
        return (self.columns.shape[0],) * 2

    def __matmul__(self, matrix):
        """Product with a matrix (n d, k) or a vector (n d,)."""
        return self._separate @ matrix + self.columns @ (self.cofactor @ (self.columns.T @ matrix))

    def __mul__(self, factor):
        """Covariance multiplied by a number."""
        return replace(self, independent=self.independent * factor, cofactor=self.cofactor * factor)

    def add_columns(self, columns, cofactor):
        """Add columns (n d, k) of further shared unknowns with their cofactor (k, k)."""
        parts = [self.columns, columns]
        is_sparse = scipy.sparse.issparse(self.columns)
        return PointCovariance(
            self.independent,
            scipy.sparse.hstack(parts, format="csr") if is_sparse else np.hstack(parts),
            scipy.linalg.block_diag(self.cofactor, cofactor),
        )

    def diagonal(self):
        """Variances, shape (n d,)."""
        return self.point_blocks.diagonal(axis1=1, axis2=2).ravel()

    @cached_property
    def point_blocks(self):
        """Covariance (n, d, d) of each point, with the shared causes."""
        n, d, _ = self.independent.shape
        blocks = self.independent.copy()
        for i in range(d):
            row = self.columns[i::d] @ self.cofactor
            for j in range(d):
                other = self.columns[j::d]
                product = other * row if isinstance(other, np.ndarray) else other.multiply(row)
                blocks[:, i, j] += np.asarray(product.sum(axis=1)).reshape(n)
        return blocks

    def dense(self):
        """Matrix (n d, n d)."""
        return self._separate.toarray() + (self.columns @ self.cofactor) @ self.columns.T

    def take(self, points):
        """Covariance of selected points (k,), by their indices."""
        points = np.asarray(points)
        d = self.independent.shape[1]
        columns = self.columns[(d * points[:, None] + np.arange(d)).ravel()]
        separate, cofactor = self.independent[points], self.cofactor
        if scipy.sparse.issparse(columns) and FEW * len(points) < len(self.independent):
            columns = columns.toarray()  # products of sparse arrays are slow
        if columns.shape[1] <= len(points) * d:
            return PointCovariance(separate, columns, cofactor)
        # Fewer coordinates than unknowns: their matrix is smaller than that of the unknowns.
        shared = (columns @ cofactor) @ columns.T
        return PointCovariance(
            separate, scipy.sparse.eye_array(len(points) * d, format="csr"), shared
        )

    def mapped(self, by_point):
        """Covariance of linear functions of each point.

        Parameters
        ----------
        by_point : ndarray, shape (n, e, d) or (e, d)
            Derivative of the e functions of a point by its coordinates.

        Returns
        -------
        PointCovariance
        """
        by_point = np.broadcast_to(by_point, (len(self.independent), *by_point.shape[-2:]))
        separate = by_point @ self.independent @ by_point.transpose(0, 2, 1)
        columns = _block_diagonal(by_point) @ self.columns
        columns = columns.tocsr() if scipy.sparse.issparse(columns) else columns
        return PointCovariance(separate, columns, self.cofactor)

    def propagate(self, by):
        """Covariance (k, k) of functions with the derivatives (k, n d) by the coordinates."""
        separate = by @ (self._separate @ by.T)
        shared = by @ self.columns
        covariance = (shared @ self.cofactor) @ shared.T
        return (separate.toarray() if scipy.sparse.issparse(separate) else separate) + covariance

    def definite(self, sd):
        """Return this covariance, with the variance sd^2 added to each coordinate if singular."""
        try:
            if self.whitener() is None:
                np.linalg.cholesky(self.dense())
        except np.linalg.LinAlgError:
            return replace(
                self, independent=self.independent + sd**2 * np.eye(self.independent.shape[1])
            )
        return self

    def whitener(self):
        """Return a function that multiplies by W, or W' with `transposed`, where W C W' = I.

        None if the form is of no use: more than half as many unknowns as coordinates, or points
        without errors of their separate. LinAlgError if the covariance is not positive definite.
        """
        if 2 * self.columns.shape[1] > self.columns.shape[0]:
            return None
        try:
            root = _block_diagonal(np.linalg.inv(np.linalg.cholesky(self.independent)))
        except np.linalg.LinAlgError:
            return None
        columns = root @ self.columns
        columns = columns.toarray() if scipy.sparse.issparse(columns) else columns
        basis, triangle = scipy.linalg.qr(columns, mode="economic", check_finite=False)
        values, vectors = np.linalg.eigh(triangle @ self.cofactor @ triangle.T)
        if np.any(values <= -1):
            raise np.linalg.LinAlgError("the covariance is not positive definite")
        basis, gain = basis @ vectors, ((1 + values) ** -0.5 - 1)[:, None]

        def whiten(array, transposed=False):
            white = array.reshape(len(array), -1)
            white = white if transposed else root @ white
            white = white + basis @ (gain * (basis.T @ white))
            return (root.T @ white if transposed else white).reshape(array.shape)

        return whiten

    @property
    def is_diagonal(self):
        """Whether the points have a single coordinate and have no shared unknowns."""
        return self.independent.shape[1] == 1 and not self.columns.shape[1]

    @property
    def _separate(self):
        return _block_diagonal(self.independent)


def _block_diagonal(blocks):
    """Sparse array (n e, n d) with the blocks (n, e, d) on its diagonal."""
    n, e, d = blocks.shape
    # A copy, since a broadcast array has no memory of its separate.
    data = np.ascontiguousarray(blocks), np.arange(n), np.arange(n + 1)
    return scipy.sparse.bsr_array(data, shape=(n * e, n * d))
