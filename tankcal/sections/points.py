"""Places of points among all coordinates, and their covariance out of that of all."""

import numpy as np
import scipy.sparse

LEAST_SD_M = 1e-6  # added to a full covariance that is singular


def coordinates_of(points):
    """Places of the coordinates of points among all coordinates x1 y1 z1 x2 ...

    Parameters
    ----------
    points : array_like of int, shape (k,)

    Returns
    -------
    ndarray of int, shape (3k,)

    Examples
    --------
    >>> coordinates_of([2]).tolist()
    [6, 7, 8]
    """
    return (3 * np.asarray(points)[:, None] + np.arange(3)).ravel()


def covariance_of(points, covariance_m2):
    """Covariance of some points out of that of all; a dense one is made positive definite.

    Parameters
    ----------
    points : array_like of int, shape (k,)
    covariance_m2 : ndarray or sparse matrix, shape (3n, 3n)

    Returns
    -------
    ndarray or sparse matrix, shape (3k, 3k)
        In m2. To a dense block that is singular (a fixed point, a free network) the variance of a
        micrometre is added.

    Examples
    --------
    >>> covariance_of([1], np.diag([1.0, 1, 1, 4, 5, 6])).diagonal().tolist()
    [4.0, 5.0, 6.0]
    """
    index = coordinates_of(points)
    if scipy.sparse.issparse(covariance_m2):
        return covariance_m2[index][:, index]
    block = covariance_m2[np.ix_(index, index)]
    try:
        np.linalg.cholesky(block)
    except np.linalg.LinAlgError:  # a fixed point, or a free network
        block = block + LEAST_SD_M**2 * np.eye(len(index))
    return block


def own_covariances(covariance_m2):
    """Covariance of each point, where that of all is sparse and they are independent; else None.

    Parameters
    ----------
    covariance_m2 : ndarray or sparse matrix, shape (3n, 3n)

    Returns
    -------
    ndarray, shape (n, 3, 3), or None
        In m2.

    Examples
    --------
    >>> own_covariances(scipy.sparse.diags_array([1.0, 2.0, 3.0])).diagonal(axis1=1, axis2=2)
    array([[1., 2., 3.]])
    """
    if not scipy.sparse.issparse(covariance_m2):
        return None
    entries = covariance_m2.tocoo()
    (point, row), (other, column) = (np.divmod(one, 3) for one in (entries.row, entries.col))
    if np.any(point != other):
        return None
    found = np.zeros((covariance_m2.shape[0] // 3, 3, 3))
    np.add.at(found, (point, row, column), entries.data)
    return found
