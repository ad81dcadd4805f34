"""Figure of stability that is expected from the standard deviations of two calibrations alone.

The ideal point xi of a measured point m(xi, q) depends on the interior parameters q:
d xi = -(d m / d xi)^-1 (d m / d q) dq. J contains these derivatives over the grid, in pixels. P is
the projection that removes the parameters fitted by the method. To first order,

    expected = sqrt(trace(P (J1 C1 J1' + J2 C2 J2') P) / divisor)

Source: JCGM 100; imaging equations as in tankcal.camera.imaging.
"""

import numpy as np

from tankcal.camera.imaging import image_point_derivatives


def ideal_derivatives(ideal_mm, interior, form):
    """Derivatives of ideal image points by PARAMETERS, for fixed measured points.

    Parameters
    ----------
    ideal_mm : ndarray, shape (n, 2)
        Ideal image points relative to the principal point, mm.
    interior : array_like, shape (13,)
        Interior parameters.
    form : tankcal.camera.model.Form
        Form of the distortion model.

    Returns
    -------
    ndarray, shape (n, 2, 13)
        Derivatives; zero for c, because the points are in mm and not directions.
    """
    is_of_ideal = form.convention == "distortion_of_ideal"
    q = tuple(np.asarray(interior, dtype=float))
    rays = (*(ideal_mm.T / q[0]), -np.ones(len(ideal_mm)))
    rows = image_point_derivatives(rays, np.eye(3).ravel(), q, form.numbers, is_of_ideal)[2:]
    derivatives = np.stack([np.column_stack(np.broadcast_arrays(*row)) for row in rows], axis=1)
    by_point, by_parameters = derivatives[:, :, :2] / q[0], derivatives[:, :, 6:]
    by_parameters[:, :, 0] = 0.0
    return -np.linalg.solve(by_point, by_parameters)


def covariance_of(camera, known=None, needs_c=True):
    """Covariance matrix of the parameters of a camera.

    Parameters
    ----------
    camera : network.Camera
        Camera with values and standard deviations. A parameter with value 0 and without standard
        deviation is not in the model.
    known : array_like, shape (13, 13), optional
        Covariance matrix; by default the parameters are uncorrelated.
    needs_c : bool, optional
        Whether the figure depends on c. If not, c needs no standard deviation.

    Returns
    -------
    ndarray, shape (13, 13), or None
        None if a standard deviation is missing.
    """
    if known is not None:
        return np.asarray(known, dtype=float)
    sd = np.where(np.isnan(camera.sd) & (np.asarray(camera.values) == 0), 0.0, camera.sd)
    if not needs_c:
        sd[0] = 0.0
    return None if np.any(np.isnan(sd)) or not np.any(sd) else np.diag(sd**2)


def expected_px(parts, design_px, divisor):
    """Expected figure of stability (see the module docstring), px.

    Parameters
    ----------
    parts : iterable of tuple
        Derivatives (2n, 13) and covariance matrix (13, 13) of each calibration.
    design_px : ndarray, shape (2n, u), or None
        Design matrix of the fit of the method.
    divisor : float
        Degrees of freedom of the fit, or number of points without a fit.

    Returns
    -------
    float
    """
    total = 0.0
    # P = I - Q Q', with an orthonormal basis Q of the design matrix
    basis = None if design_px is None else np.linalg.qr(design_px / _column_norms(design_px))[0]
    for derivatives, covariance in parts:
        projected = derivatives if basis is None else derivatives - basis @ (basis.T @ derivatives)
        total += float(np.sum((projected @ covariance) * projected))
    return float(np.sqrt(max(total, 0.0) / divisor))


def _column_norms(design):
    return np.linalg.norm(design, axis=0)
