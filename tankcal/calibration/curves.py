"""Distortion curves of a camera against the radius in the image, with standard deviations.

The radial curve is the measured radius less the corrected one, by the radial terms alone, so it
means the same in every convention; the decentring profile is sqrt(P1^2 + P2^2) r^2 (1 + P3 r^2 +
P4 r^4): on the circle of radius r it shifts by up to three times that along the radius, and by up
to once that across. Source: Brown 1971.
"""

import numpy as np

from tankcal.camera.imaging import distort, distortion_derivatives
from tankcal.camera.model import PARAMETERS, correct_image_points

RADIAL = slice(PARAMETERS.index("K1"), PARAMETERS.index("K4") + 1)
DECENTRING = slice(PARAMETERS.index("P1"), PARAMETERS.index("P4") + 1)


def radial_curve(radius_mm, interior, form, covariance=None):
    """Radial distortion at measured radii, and its standard deviation.

    Linear propagation; the derivatives are those of the image equations.

    Parameters
    ----------
    radius_mm : ndarray, shape (n,)
        Radii in the image as measured, mm.
    interior : array_like, shape (13,)
        Interior parameters in the order of tankcal.camera.model.PARAMETERS.
    form : tankcal.camera.model.Form
        How the distortion is written.
    covariance : ndarray, shape (4, 4), optional
        Of K1, K2, K3, K4.

    Returns
    -------
    curve_mm : ndarray, shape (n,)
        Radial distortion, mm.
    sd_mm : ndarray, shape (n,), or None
        Its standard deviation, mm; None without a covariance.
    """
    radius = np.asarray(radius_mm, dtype=float)
    radial = np.zeros(len(PARAMETERS))
    radial[RADIAL] = np.asarray(interior, dtype=float)[RADIAL]
    along = correct_image_points(np.column_stack([radius, np.zeros_like(radius)]), radial, form)[
        :, 0
    ]
    if covariance is None:
        return radius - along, None
    of_ideal = form.convention == "distortion_of_ideal"
    at = along if of_ideal else radius
    slope = distort(at, 0.0 * at, radial, form.numbers)[2]
    by_k = np.array(distortion_derivatives(at, 0.0 * at, radial, form.numbers)[0][:4])
    if of_ideal:
        by_k = by_k / (1.0 + slope)
    variance = np.einsum("in,ij,jn->n", by_k, np.asarray(covariance, dtype=float), by_k)
    return radius - along, np.sqrt(variance)


def decentring_profile(radius_mm, interior):
    """Decentring profile, without sign: a third of the largest shift along the radius.

    Parameters
    ----------
    radius_mm : ndarray, shape (n,)
        Radii, mm.
    interior : ndarray, shape (13,)
        Interior parameters in the order of tankcal.camera.model.PARAMETERS.

    Returns
    -------
    ndarray, shape (n,)
        The profile, mm.

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
