"""What is left of the inverse of a covariance when what no prior binds has been taken out.

P of `blunders` by the inverse W of the Cholesky factor U of V = U' U, half the way to V^-1:

    P = W W' - Z Z',  Z Z' = V^-1 X (X' V^-1 X)^-1 X' V^-1.

Its diagonal and products are had at once; columns, of the few readings that do not agree, when they
are asked for.
"""

import numpy as np
import scipy.linalg


class Precision:
    """P of a covariance (n, n), which is used up, and a design (n, p).

    What of an array the tests of readings ask: `diagonal()`, products with a vector, and columns,
    P[rows, columns] with rows and columns as `numpy.ix_` or a slice gives them.

    Examples
    --------
    >>> found = Precision(np.diag([1.0, 0.5]), np.ones((2, 1)))
    >>> found.diagonal().round(9), found[:, [1]].round(9).ravel()
    (array([0.66666667, 0.66666667]), array([-0.66666667,  0.66666667]))
    """

    def __init__(self, covariance, design):
        # symmetric: transposed it is in columns, as LAPACK has it
        root, wrong = scipy.linalg.lapack.dpotrf(covariance.T, overwrite_a=True)
        if wrong:
            raise np.linalg.LinAlgError("Matrix is not positive definite")
        self._half = scipy.linalg.lapack.dtrtri(root, overwrite_c=True)[0]
        white = self._times(design, transposed=True)
        normal = scipy.linalg.pinvh(white.T @ white)  # some points may hardly bear on anything
        self._by_design = self._times(white)
        self._back = self._by_design @ normal
        self._known = np.zeros(len(covariance), dtype=bool)
        self._columns = np.empty_like(self._half)  # filled as far as they are known

    def diagonal(self):
        """(n,) of P."""
        whole = np.einsum("ij,ij->i", self._half, self._half)
        return whole - np.sum(self._back * self._by_design, axis=1)

    def __matmul__(self, vector):
        whole = self._half @ (self._half.T @ vector)
        return whole - self._back @ (self._by_design.T @ vector)

    def __getitem__(self, places):
        rows, columns = (one if isinstance(one, slice) else np.ravel(one) for one in places)
        index = np.arange(len(self._known))[columns]
        new = index[~self._known[index]]
        if len(new):
            whole = self._times(self._half[new].T)
            self._columns[:, new] = whole - self._back @ self._by_design[new].T
            self._known[new] = True
        return self._columns[:, index][rows]

    def _times(self, columns, *, transposed=False):
        return scipy.linalg.blas.dtrmm(1.0, self._half, columns, trans_a=transposed)
