"""Support function of a closed curve: distance of its tangents from the origin.

The tangent whose outward normal has the azimuth f is the line x sin f + y cos f = p(f),

    p(f) = rho + xc sin f + yc cos f + sum over k >= 2 of (p_k cos kf + q_k sin kf),
    P = 2 pi rho,      A = pi rho^2 - (pi/2) sum (k^2 - 1) (p_k^2 + q_k^2).

The support function is linear in all parameters, so no start values are required. It describes only
the convex hull. To first order, p_k and q_k are the waves of the outline.

Source: Cauchy's formula for the perimeter; Santalo 1976, section 1.1.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.units import FULL_TURN


@dataclass(frozen=True)
class SupportCurve:
    """Convex curve by its support function; lengths in m.

    Attributes
    ----------
    radius_m : float
        Mean of the support function.
    x_m, y_m : float
        Centre.
    p_m, q_m : ndarray, shape (orders - 1,)
        Cosine and sine amplitudes of the waves k = 2 ...
    """

    radius_m: float
    x_m: float
    y_m: float
    p_m: np.ndarray
    q_m: np.ndarray

    @property
    def perimeter_m(self):
        """Length of the curve, m."""
        return FULL_TURN * self.radius_m

    @property
    def area_m2(self):
        """Enclosed area, m2."""
        k = np.arange(2, len(self.p_m) + 2)
        waves = np.sum((k**2 - 1) * (self.p_m**2 + self.q_m**2))
        return np.pi * self.radius_m**2 - np.pi / 2 * waves

    def support_m(self, azimuth_rad):
        """Return p (n,) at azimuths (n,) of the normal, m."""
        columns = support_columns(azimuth_rad, len(self.p_m) + 1)
        waves = np.column_stack([self.p_m, self.q_m]).ravel()
        return columns @ np.concatenate([[self.radius_m, self.x_m, self.y_m], waves])


def support_columns(azimuth_rad, order):
    """Return derivatives (n, 2 order + 1) of p by rho, xc, yc, then p_k and q_k from k = 2."""
    f = np.asarray(azimuth_rad, dtype=float)
    waves = [function(k * f) for k in range(2, order + 1) for function in (np.cos, np.sin)]
    return np.column_stack([np.ones_like(f), np.sin(f), np.cos(f), *waves])


def fit_support(azimuth_rad, support_m, order=1, sd_m=1.0):
    """Fit a `SupportCurve` by least squares.

    Parameters
    ----------
    azimuth_rad : ndarray, shape (n,)
        Azimuths of the outward normals of tangents.
    support_m : ndarray, shape (n,)
        Distances of the tangents from the origin, m.
    order : int
        Highest wave; 1: a circle.
    sd_m : float or ndarray, shape (n,)
        Standard deviations of the distances, up to a common factor.

    Returns
    -------
    SupportCurve

    Raises
    ------
    numpy.linalg.LinAlgError
        If the tangents do not determine the curve.

    Examples
    --------
    >>> f = np.radians([0, 90, 180, 270])
    >>> fit_support(f, 5 + 0.1 * np.sin(f)).perimeter_m / np.pi
    10.0
    """
    # Rows divided by the standard deviations: ordinary least squares of the scaled equations.
    weight = 1 / np.broadcast_to(np.asarray(sd_m, dtype=float), np.shape(azimuth_rad))
    columns = support_columns(azimuth_rad, order)
    parameters, _, rank, _ = np.linalg.lstsq(
        weight[:, None] * columns, weight * support_m, rcond=1e-9
    )
    if rank < columns.shape[1]:
        raise np.linalg.LinAlgError("the tangents do not determine the curve")
    return SupportCurve(*map(float, parameters[:3]), parameters[3::2], parameters[4::2])
