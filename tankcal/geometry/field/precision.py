"""Inverse of a covariance after elimination of the parameters without prior.

P of `blunders` follows from the inverse W of the Cholesky factor U of V = U' U:

    P = W W' - Z Z',  Z Z' = V^-1 X (X' V^-1 X)^-1 X' V^-1.

Its diagonal and its products with vectors are available immediately. Columns, required only for the
few rejected readings, are computed on demand.
"""

import numpy as np
import scipy.linalg


class Precision:
    """P for a covariance (n, n), which is overwritten, and a design (n, p).

    The class has the array operations that tests of readings require: `diagonal()`, products with a
    vector, and columns, P[rows, columns] with rows and columns from `numpy.ix_` or a slice.

    Examples
    --------
    >>> precision = Precision(np.diag([1.0, 0.5]), np.ones((2, 1)))
    >>> precision.diagonal().round(9), precision[:, [1]].round(9).ravel()
    (array([0.66666667, 0.66666667]), array([-0.66666667,  0.66666667]))
    """

    def __init__(self, covariance, design):
        # The matrix is symmetric: its transpose is in the column order of LAPACK.
        root, info = scipy.linalg.lapack.dpotrf(covariance.T, overwrite_a=True)
        if info:
            raise np.linalg.LinAlgError("Matrix is not positive definite")
        self._half = scipy.linalg.lapack.dtrtri(root, overwrite_c=True)[0]
        white = self._times(design, transposed=True)
        normal = scipy.linalg.pinvh(white.T @ white)  # the points may not determine a parameter
        self._by_design = self._times(white)
        self._back = self._by_design @ normal
        self._known = np.zeros(len(covariance), dtype=bool)
        self._columns = np.empty_like(self._half)  # filled on demand, see `_known`

    def diagonal(self):
        """Return the diagonal (n,) of P."""
        unrestricted = np.einsum("ij,ij->i", self._half, self._half)
        return unrestricted - np.sum(self._back * self._by_design, axis=1)

    def __matmul__(self, vector):
        unrestricted = self._half @ (self._half.T @ vector)
        return unrestricted - self._back @ (self._by_design.T @ vector)

    def __getitem__(self, places):
        rows, columns = (
            selection if isinstance(selection, slice) else np.ravel(selection)
            for selection in places
        )
        index = np.arange(len(self._known))[columns]
        # Compute only the columns that no earlier request has computed.
        new = index[~self._known[index]]
        if len(new):
            unrestricted = self._times(self._half[new].T)
            self._columns[:, new] = unrestricted - self._back @ self._by_design[new].T
            self._known[new] = True
        return self._columns[:, index][rows]

    def _times(self, columns, *, transposed=False):
        """Return W @ columns, or W' @ columns if transposed."""
        return scipy.linalg.blas.dtrmm(1.0, self._half, columns, trans_a=transposed)
