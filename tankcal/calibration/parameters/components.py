"""Principal components of the parameters of a camera: the program ANALISE.

With C the eigenvectors and lambda the eigenvalues of the covariance matrix, or of the correlation
matrix, of parameters x:

    components  y = C' x        variance of y_j = lambda_j       share = lambda_j / sum of lambda
    loadings    corr(x_i, y_j) = c_ij sqrt(lambda_j) / sd(x_i)

A correlation matrix is that of x over its sds, so those are what C multiplies; its sd(x_i) are 1.
Source: Silva 1995 (61-79). His program multiplied the eigenvectors of the correlation matrix with
the values themselves (`unscaled`), and did not sort.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from tankcal.calibration.parameters.significance import cholesky_of
from tankcal.survey.network import correlations

MATRICES = ("correlation", "covariance")


@dataclass(frozen=True)
class Components:
    """Principal components of k parameters, the largest first.

    names               (k,)
    of                  "correlation" or "covariance"
    positive_definite   by Cholesky, before anything else
    eigenvalues         (k,) descending; negative ones are shown, not mended
    share_percent       (k,) of their sum          cumulative_percent  (k,)
    vectors             (k, k) columns C, the largest loading of each positive
    loadings            (k, k) parameter by component; nan where an eigenvalue is not positive
    values              (k,) of the components; nan without values of the parameters
    unscaled            True: `values` multiply the parameters as they are (Silva's program)
    """

    names: tuple
    of: str
    positive_definite: bool
    eigenvalues: np.ndarray
    share_percent: np.ndarray
    cumulative_percent: np.ndarray
    vectors: np.ndarray
    loadings: np.ndarray
    values: np.ndarray
    unscaled: bool

    @property
    def smallest_eigenvalue(self):
        """The last of the eigenvalues."""
        return float(self.eigenvalues[-1])


def components(names, covariance, values=None, *, of="correlation", unscaled=False):
    """The Components of parameters.

    names       (k,)
    covariance  (k, k) symmetric, in the units of the parameters; a correlation matrix will do
    values      (k,) of the parameters, or None
    of          which matrix is analysed, "correlation" or "covariance" (then units matter)
    unscaled    multiply eigenvectors of the correlation matrix with the values as they are

    Raises ValueError for a matrix that is not symmetric, not finite or has a variance that is not
    positive.
    """
    if of not in MATRICES:
        raise ValueError(f"of {of!r}: expected one of {', '.join(MATRICES)}")
    matrix = _checked(names, covariance)
    sd = np.sqrt(np.diag(matrix))
    lower = cholesky_of(matrix)
    weight = np.ones_like(sd) if of == "correlation" else sd
    eigenvalues, vectors = _decomposed(correlations(matrix), lower, weight)
    root = np.sqrt(np.where(eigenvalues > 0, eigenvalues, np.nan))
    loadings = vectors * root / weight[:, None]
    vectors, loadings = _signed(vectors, loadings, weight)
    share = 100 * eigenvalues / eigenvalues.sum()
    given = np.full(len(sd), np.nan) if values is None else np.asarray(values, dtype=float)
    if of == "correlation" and not unscaled:
        given = given / sd
    return Components(
        names=tuple(names),
        of=of,
        positive_definite=lower is not None,
        eigenvalues=eigenvalues,
        share_percent=share,
        cumulative_percent=np.cumsum(share),
        vectors=vectors,
        loadings=loadings,
        values=vectors.T @ given,
        unscaled=unscaled,
    )


def _decomposed(correlation, lower, weight):
    """Eigenvalues (k,), descending, and eigenvectors of W R W, R = L L', W = diag(weight).

    By the singular values of W L: the eigenvalues of a covariance of K1 to K3 in millimetres span
    thirty powers of ten, of which a decomposition of the matrix itself would keep sixteen. Without
    L (not positive definite) there is nothing else; negative eigenvalues are then shown.
    """
    if lower is None:
        values, vectors = np.linalg.eigh(weight[:, None] * correlation * weight)
        return values[::-1], vectors[:, ::-1]
    vectors, values, _ = scipy.linalg.svd(weight[:, None] * lower, lapack_driver="gesvd")
    return values**2, vectors


def _checked(names, covariance):
    matrix = np.asarray(covariance, dtype=float)
    if matrix.shape != (len(names), len(names)) or not len(names):
        raise ValueError(f"a matrix of shape {matrix.shape} for {len(names)} parameters")
    if not np.isfinite(matrix).all() or not (np.diag(matrix) > 0).all():
        raise ValueError("a matrix with a variance that is not positive, or that is not finite")
    size = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    if (np.abs(matrix - matrix.T) > 1e-9 * size).any():
        raise ValueError("a matrix that is not symmetric")
    return matrix


def _signed(vectors, loadings, sd):
    """Vectors and loadings with the largest loading of each component positive."""
    largest = np.argmax(np.abs(vectors) / sd[:, None], axis=0)
    sign = np.where(vectors[largest, np.arange(len(sd))] < 0, -1.0, 1.0)
    return vectors * sign, loadings * sign
