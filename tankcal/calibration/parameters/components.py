"""Principal components of the parameters of a camera, as in the program ANALISE.

C contains the eigenvectors and lambda the eigenvalues of the covariance or correlation matrix of
the parameters x:

    components  y = C' x        variance of y_j = lambda_j       share = lambda_j / sum of lambda
    loadings    corr(x_i, y_j) = c_ij sqrt(lambda_j) / sd(x_i)

For a correlation matrix, x is divided by its standard deviations, and sd(x_i) is 1.

Source: Silva 1995 (61-79). His program multiplied the eigenvectors of the correlation matrix by the
undivided values (`unscaled`), and did not sort the components.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from tankcal.calibration.parameters.significance import factor_correlations
from tankcal.survey.network import correlations

MATRICES = ("correlation", "covariance")


@dataclass(frozen=True)
class Components:
    """Principal components of k parameters, the largest first.

    Attributes
    ----------
    names : tuple of str
        Names of the parameters.
    of : str
        Matrix that was analysed, "correlation" or "covariance".
    positive_definite : bool
        Whether the matrix has a Cholesky factor.
    eigenvalues : ndarray, shape (k,)
        Eigenvalues in descending order; negative eigenvalues are kept.
    share_percent, cumulative_percent : ndarray, shape (k,)
        Share of each eigenvalue in their sum, and its cumulative sum, %.
    vectors : ndarray, shape (k, k)
        Eigenvectors C in the columns; the largest loading of each column is positive.
    loadings : ndarray, shape (k, k)
        Loadings, parameter by component; nan if an eigenvalue is not positive.
    values : ndarray, shape (k,)
        Values of the components; nan without values of the parameters.
    unscaled : bool
        Whether the parameters were not divided by their standard deviations (Silva's program).
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
        """Smallest eigenvalue."""
        return float(self.eigenvalues[-1])


def components(names, covariance, values=None, *, of="correlation", unscaled=False):
    """Compute the principal components of parameters.

    Parameters
    ----------
    names : sequence of str
        Names of the k parameters.
    covariance : array_like, shape (k, k)
        Covariance matrix in the units of the parameters, or a correlation matrix.
    values : array_like, shape (k,), optional
        Values of the parameters.
    of : str, optional
        Matrix to analyse, "correlation" or "covariance". The covariance depends on the units.
    unscaled : bool, optional
        Whether the eigenvectors of the correlation matrix multiply the undivided values.

    Returns
    -------
    Components

    Raises
    ------
    ValueError
        If the matrix is not symmetric or not finite, or if a variance is not positive.
    """
    if of not in MATRICES:
        raise ValueError(f"of {of!r}: expected one of {', '.join(MATRICES)}")
    matrix = _check_matrix(names, covariance)
    sd = np.sqrt(np.diag(matrix))
    lower = factor_correlations(matrix)
    weight = np.ones_like(sd) if of == "correlation" else sd
    eigenvalues, vectors = _decompose(correlations(matrix), lower, weight)
    # Loadings c_ij sqrt(lambda_j) / sd(x_i)
    root = np.sqrt(np.where(eigenvalues > 0, eigenvalues, np.nan))
    loadings = vectors * root / weight[:, None]
    vectors, loadings = _orient(vectors, loadings, weight)
    share = 100 * eigenvalues / eigenvalues.sum()
    x = np.full(len(sd), np.nan) if values is None else np.asarray(values, dtype=float)
    if of == "correlation" and not unscaled:
        x = x / sd
    return Components(
        names=tuple(names),
        of=of,
        positive_definite=lower is not None,
        eigenvalues=eigenvalues,
        share_percent=share,
        cumulative_percent=np.cumsum(share),
        vectors=vectors,
        loadings=loadings,
        values=vectors.T @ x,
        unscaled=unscaled,
    )


def _decompose(correlation, lower, weight):
    """Eigenvalues (k,), descending, and eigenvectors of W R W, R = L L', W = diag(weight).

    They follow from the singular values of W L. The eigenvalues of a covariance of K1 to K3 in mm
    span thirty powers of ten, and a decomposition of W R W would resolve only sixteen. Without L
    (matrix not positive definite), W R W is decomposed, and negative eigenvalues are returned.
    """
    if lower is None:
        values, vectors = np.linalg.eigh(weight[:, None] * correlation * weight)
        return values[::-1], vectors[:, ::-1]
    vectors, values, _ = scipy.linalg.svd(weight[:, None] * lower, lapack_driver="gesvd")
    return values**2, vectors


def _check_matrix(names, covariance):
    matrix = np.asarray(covariance, dtype=float)
    if matrix.shape != (len(names), len(names)) or not len(names):
        raise ValueError(f"a matrix of shape {matrix.shape} for {len(names)} parameters")
    if not np.isfinite(matrix).all() or not (np.diag(matrix) > 0).all():
        raise ValueError("a matrix with a variance that is not positive, or that is not finite")
    size = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    if (np.abs(matrix - matrix.T) > 1e-9 * size).any():
        raise ValueError("a matrix that is not symmetric")
    return matrix


def _orient(vectors, loadings, sd):
    """Change signs of vectors and loadings so that the largest loading is positive."""
    largest = np.argmax(np.abs(vectors) / sd[:, None], axis=0)
    sign = np.where(vectors[largest, np.arange(len(sd))] < 0, -1.0, 1.0)
    return vectors * sign, loadings * sign
