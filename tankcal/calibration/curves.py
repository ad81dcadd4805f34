"""Distortion curves of a camera as functions of the radius in the image, with standard deviations.

The radial curve is the measured radius less the radius corrected by the radial terms alone. This
definition holds in every convention. The decentring profile is
sqrt(P1^2 + P2^2) r^2 (1 + P3 r^2 + P4 r^4). On the circle of radius r the largest shift is three
times the profile in the radial direction, and once the profile in the tangential direction.

Source: Brown 1971.
"""

import numpy as np

from tankcal.camera.imaging import distort, distortion_derivatives
from tankcal.camera.model import PARAMETERS, correct_image_points

RADIAL = slice(PARAMETERS.index("K1"), PARAMETERS.index("K4") + 1)
DECENTRING = slice(PARAMETERS.index("P1"), PARAMETERS.index("P4") + 1)


def radial_curve(radius_mm, interior, form, covariance=None):
    """Radial distortion at measured radii, and its standard deviation.

    The standard deviation follows from the law of propagation of uncertainty.

    Parameters
    ----------
    radius_mm : ndarray, shape (n,)
        Radii in the image as measured, mm.
    interior : array_like, shape (13,)
        Interior parameters in the order of tankcal.camera.model.PARAMETERS.
    form : tankcal.camera.model.Form
        Form of the distortion model.
    covariance : ndarray, shape (4, 4), optional
        Covariance matrix of K1, K2, K3, K4.

    Returns
    -------
    curve_mm : ndarray, shape (n,)
        Radial distortion, mm.
    sd_mm : ndarray, shape (n,), or None
        Standard deviation of the radial distortion, mm; None without a covariance.
    """
    radius = np.asarray(radius_mm, dtype=float)
    radial = np.zeros(len(PARAMETERS))
    radial[RADIAL] = np.asarray(interior, dtype=float)[RADIAL]
    corrected = correct_image_points(
        np.column_stack([radius, np.zeros_like(radius)]), radial, form
    )[:, 0]
    if covariance is None:
        return radius - corrected, None
    # The polynomial is a function of the corrected or of the measured radius, by convention.
    is_of_ideal = form.convention == "distortion_of_ideal"
    radius_of_polynomial = corrected if is_of_ideal else radius
    slope = distort(radius_of_polynomial, 0.0 * radius_of_polynomial, radial, form.numbers)[2]
    by_k = np.array(
        distortion_derivatives(
            radius_of_polynomial, 0.0 * radius_of_polynomial, radial, form.numbers
        )[0][:4]
    )
    if is_of_ideal:  # derivative at a fixed measured radius, by implicit differentiation
        by_k = by_k / (1.0 + slope)
    variance = np.einsum("in,ij,jn->n", by_k, np.asarray(covariance, dtype=float), by_k)
    return radius - corrected, np.sqrt(variance)


def decentring_profile(radius_mm, interior):
    """Magnitude of the decentring profile, a third of the largest radial shift.

    Parameters
    ----------
    radius_mm : ndarray, shape (n,)
        Radii, mm.
    interior : ndarray, shape (13,)
        Interior parameters in the order of tankcal.camera.model.PARAMETERS.

    Returns
    -------
    ndarray, shape (n,)
        Decentring profile, mm.

    Examples
    --------
    >>> import numpy as np
    >>> interior = np.zeros(13)
    >>> interior[7] = 1e-5  # P1
    >>> decentring_profile(np.array([10.0]), interior)
    array([0.001])
    """
    r2 = np.asarray(radius_mm, dtype=float) ** 2
    p1, p2, p3, p4 = np.asarray(interior, dtype=float)[DECENTRING]
    return np.hypot(p1, p2) * r2 * np.abs(1.0 + p3 * r2 + p4 * r2**2)
