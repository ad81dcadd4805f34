"""The covariance of surveyed points: as given, among themselves, and their scatter in plan."""

from dataclasses import replace

import numpy as np
import scipy.sparse

from tankcal.sections import coordinates_of


def s_transform(points):
    """Adjusted points with the covariance that they have among themselves.

        C' = S C S + s2 D D',   S = I - D D'

    D is an orthonormal basis of their common shift and their turn about the vertical, s2 the mean
    variance that is left. No volume depends on these four, but a datum that holds one photo or one
    point gives them whatever variance it has: sections fitted with it would depend on that choice.

    Parameters
    ----------
    points : Points
        n points with covariance_m2 (3n, 3n), m2.

    Returns
    -------
    Points
        With C', and with the columns of their causes projected by S.
    """
    basis, given = common_motions(points.xyz_m), points.covariance_m2
    across = s_transform_factors(basis, given @ basis, np.trace(given))
    change = np.hstack([basis, across]) @ np.hstack([across, basis]).T
    causes = tuple(
        replace(cause, column_m=cause.column_m - basis @ (basis.T @ cause.column_m))
        for cause in points.causes
    )
    return replace(points, covariance_m2=np.subtract(given, change, out=change), causes=causes)


def common_motions(xyz_m):
    """Orthonormal basis of the shifts of points and their turn about the vertical.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
        Coordinates, m.

    Returns
    -------
    ndarray, shape (3 n, 4)
        Orthonormal columns, in the order x, y, z of each point.

    Examples
    --------
    >>> basis = common_motions(np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 1]]))
    >>> bool(np.allclose(basis.T @ basis, np.eye(4)))
    True
    """
    x, y, _ = (xyz_m - xyz_m.mean(axis=0)).T
    motions = np.zeros((len(x), 3, 4))
    motions[:, :, :3] = np.eye(3)
    motions[:, 0, 3], motions[:, 1, 3] = -y, x
    return np.linalg.qr(motions.reshape(-1, 4))[0]


def s_transform_factors(basis, spread, trace):
    """A of C' = C - D A' - A D', the covariance of `s_transform`, without forming S C S.

        A = C D - D (D'C D + s2 I) / 2

    Parameters
    ----------
    basis : ndarray, shape (3 n, 4)
        D, of `common_motions`.
    spread : ndarray, shape (3 n, 4)
        C D, m2.
    trace : float
        Of C, m2.

    Returns
    -------
    ndarray, shape (3 n, 4)
        A, m2.

    Examples
    --------
    >>> basis = common_motions(np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 1]]))
    >>> a = s_transform_factors(basis, basis, trace=9.0)  # of C = I nothing changes
    >>> bool(np.allclose(a, 0))
    True
    """
    across = spread - 0.5 * basis @ (basis.T @ spread)
    left = trace - 2 * np.sum(basis * across)
    return across - 0.5 * max(left, 0.0) / (len(basis) - 4) * basis


def radial_sds(points):
    """(n,) standard deviations of the points in plan, or None when the file gives none."""
    if points.covariance_m2 is not None:
        variances = points.covariance_m2.diagonal().reshape(-1, 3)
    elif points.sd_m is not None:
        variances = points.sd_m**2
    else:
        return None
    return np.sqrt(variances[:, :2].mean(axis=1))


def median_sd(sds):
    """Median standard deviation of the points in plan; one metre when the file gives none."""
    return 1.0 if sds is None else float(np.median(sds))


def given_covariance(points, wall):
    """(3m, 3m) as in the file; one metre for every coordinate when the file gives none."""
    if points.covariance_m2 is not None:
        index = coordinates_of(wall)
        return points.covariance_m2[np.ix_(index, index)]
    if points.sd_m is not None:
        return scipy.sparse.diags_array(points.sd_m[wall].ravel() ** 2).tocsr()
    return scipy.sparse.eye_array(3 * len(wall), format="csr")
