"""Distortion curves of a camera against the radius in the image, with standard deviations.

The radial curve is the measured radius less the corrected one, by the radial terms alone, so it
means the same in every convention; the decentring profile is sqrt(P1^2 + P2^2) r^2 (1 + P3 r^2 +
P4 r^4): on the circle of radius r it shifts by up to three times that along the radius, and by up
to once that across. Source: Brown 1971.
"""

import numpy as np

from tankcal.camera.imaging import distort, distortion_derivatives
from tankcal.camera.model import PARAMETERS, corrected

RADIAL = slice(PARAMETERS.index("K1"), PARAMETERS.index("K4") + 1)
DECENTRING = slice(PARAMETERS.index("P1"), PARAMETERS.index("P4") + 1)


def radial_curve(radius_mm, interior, form, covariance=None):
    """Radial distortion (n,) mm at measured radii, and its standard deviation (n,) mm.

    radius_mm   (n,) in the image as measured
    interior    (13,) in the order of camera.PARAMETERS
    form        a camera.Form
    covariance  (4, 4) of K1, K2, K3, K4; None: no standard deviations, None is given for them

    Linear propagation; the derivatives are those of the image equations.
    """
    radius = np.asarray(radius_mm, dtype=float)
    radial = np.zeros(len(PARAMETERS))
    radial[RADIAL] = np.asarray(interior, dtype=float)[RADIAL]
    along = corrected(np.column_stack([radius, np.zeros_like(radius)]), radial, form)[:, 0]
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
    """Decentring profile (n,) mm, without sign: a third of the largest shift along the radius."""
    r2 = np.asarray(radius_mm, dtype=float) ** 2
    p1, p2, p3, p4 = np.asarray(interior, dtype=float)[DECENTRING]
    return np.hypot(p1, p2) * r2 * np.abs(1.0 + p3 * r2 + p4 * r2**2)
