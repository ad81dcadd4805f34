"""Covariance of surveyed points: as given, by S-transformation, and as scatter in plan."""

from dataclasses import replace

import numpy as np
import scipy.sparse

from tankcal.sections import coordinates_of


def s_transform(points):
    """Adjusted points with the covariance of their relative positions (S-transformation).

        C' = S C S + s2 D D',   S = I - D D'

    D is an orthonormal basis of the common shift and rotation about the vertical, and s2 is the
    mean remaining variance. No volume depends on these four parameters. A datum fixed by one photo
    or one point would give them an arbitrary variance, on which the fitted sections would depend.

    Parameters
    ----------
    points : Points
        n points with covariance_m2 (3n, 3n), m2.

    Returns
    -------
    Points
        With C', and with the columns of their causes projected by S.
    """
    basis, covariance = common_motions(points.xyz_m), points.covariance_m2
    across = s_transform_factors(basis, covariance @ basis, np.trace(covariance))
    change = np.hstack([basis, across]) @ np.hstack([across, basis]).T
    causes = tuple(
        replace(cause, column_m=cause.column_m - basis @ (basis.T @ cause.column_m))
        for cause in points.causes
    )
    return replace(points, covariance_m2=np.subtract(covariance, change, out=change), causes=causes)


def common_motions(xyz_m):
    """Orthonormal basis of the shifts of points and of their rotation about the vertical.

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
    """Matrix A of C' = C - D A' - A D', the covariance of `s_transform`, without forming S C S.

        A = C D - D (D'C D + s2 I) / 2

    Parameters
    ----------
    basis : ndarray, shape (3 n, 4)
        D, from `common_motions`.
    spread : ndarray, shape (3 n, 4)
        C D, m2.
    trace : float
        Trace of C, m2.

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
    remaining_trace = trace - 2 * np.sum(basis * across)
    # The trace of C' shared equally by the 3n - 4 remaining parameters gives s2.
    return across - 0.5 * max(remaining_trace, 0.0) / (len(basis) - 4) * basis


def radial_sds(points):
    """Standard deviations (n,) of the points in plan, m; None if the file gives none."""
    if points.covariance_m2 is not None:
        variances = points.covariance_m2.diagonal().reshape(-1, 3)
    elif points.sd_m is not None:
        variances = points.sd_m**2
    else:
        return None
    return np.sqrt(variances[:, :2].mean(axis=1))


def median_sd(sds):
    """Median standard deviation of the points in plan, m; 1 m if the file gives none."""
    return 1.0 if sds is None else float(np.median(sds))


def given_covariance(points, wall):
    """Covariance (3m, 3m) from the file, m2; 1 m for each coordinate if the file gives none."""
    if points.covariance_m2 is not None:
        index = coordinates_of(wall)
        return points.covariance_m2[np.ix_(index, index)]
    if points.sd_m is not None:
        return scipy.sparse.diags_array(points.sd_m[wall].ravel() ** 2).tocsr()
    return scipy.sparse.eye_array(3 * len(wall), format="csr")
