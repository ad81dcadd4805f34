"""Great ellipses of an upright ellipsoid: the circumferences measured on a sphere.

A sphere as built and loaded is, to degree 2 of its form, an ellipsoid. An upright ellipsoid has the
horizontal radii and the polar radius

    r(azimuth) = m + A cos 2 azimuth + B sin 2 azimuth   (first order; exact: the ellipse of the
    matrix S of m, A, B, whose eigenvalues are the semi-axes a and b),      c along the vertical.

The equator has the length L(a, b). A meridian in the azimuth u has the length L(1 / |S^-1 u|, c).
L(p, q) = 8 R_G(0, p^2, q^2) is the complete elliptic integral of an ellipse. A meridian thus
determines approximately r + c, but no single axis. The mean r_m of evenly spaced meridians gives c
= 2 r_m - r_e.

Source: Carlson 1995, Numerical computation of real or complex elliptic integrals (R_G, R_D); API
Std 2552 (method of measurement of spheres).
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import elliprd, elliprg

from tankcal.adjust import adjust
from tankcal.units import FULL_TURN

UNKNOWNS = ("mean", "cos", "sin", "pole")  # m, A, B, c


def ellipse_length(p_m, q_m):
    """Return the length of an ellipse and its derivatives by the semi-axes.

        L = 8 R_G(0, p^2, q^2),    dL/dp = (4 p q^2 / 3) R_D(0, p^2, q^2)

    Parameters
    ----------
    p_m, q_m : array_like
        Semi-axes, m.

    Returns
    -------
    length_m : ndarray
        Length, m.
    by_p, by_q : ndarray
        Derivatives, dimensionless; p by_p + q by_q is the length.

    Examples
    --------
    >>> length, by_p, by_q = ellipse_length(1.0, 1.0)
    >>> bool(np.isclose(length, 2 * np.pi)), bool(np.isclose(by_p, np.pi))
    (True, True)
    """
    p, q = np.asarray(p_m, dtype=float), np.asarray(q_m, dtype=float)
    length = 8 * elliprg(0.0, p**2, q**2)
    by_p = 4 * p * q**2 / 3 * elliprd(0.0, p**2, q**2)
    by_q = 4 * q * p**2 / 3 * elliprd(0.0, q**2, p**2)
    return length, by_p, by_q


def horizontal_axes(unknowns):
    """Return the semi-axes a >= b of the equator, m, and the azimuth of a, rad.

    The argument contains m, A, B and c of the module docstring.

    Examples
    --------
    >>> horizontal_axes([10.0, 0.0, 0.1, 10.0])
    (10.1, 9.9, 0.7853981633974483)
    """
    mean, cos, sin = (float(value) for value in unknowns[:3])
    half = float(np.hypot(cos, sin))
    return mean + half, mean - half, float(np.arctan2(sin, cos) / 2)


def great_circle_lengths(unknowns, azimuth_rad):
    """Return lengths of great circles of an upright ellipsoid, and their derivatives.

    Parameters
    ----------
    unknowns : array_like, shape (4,)
        m, A, B, c, m.
    azimuth_rad : ndarray, shape (n,)
        Azimuth of the plane of each meridian, clockwise from +y; nan for the equator.

    Returns
    -------
    length_m : ndarray, shape (n,)
    by_unknowns : ndarray, shape (n, 4)
    """
    mean, cos, sin, pole = (float(value) for value in unknowns)
    azimuth = np.asarray(azimuth_rad, dtype=float)
    length, by_unknowns = np.empty(len(azimuth)), np.zeros((len(azimuth), 4))
    equator = np.isnan(azimuth)
    a, b, _ = horizontal_axes(unknowns)
    round_m, by_a, by_b = ellipse_length(a, b)
    # a, b = m +- half with half = hypot(A, B); at a circle, the direction of A and B is arbitrary.
    half = max(np.hypot(cos, sin), np.finfo(float).tiny)
    by_half = by_a - by_b
    length[equator] = round_m
    by_unknowns[equator] = [by_a + by_b, by_half * cos / half, by_half * sin / half, 0.0]
    radius, by_form = _equator_radii((mean, cos, sin), azimuth[~equator])
    length[~equator], by_radius, by_pole = ellipse_length(radius, pole)
    by_unknowns[~equator, :3] = by_radius[:, None] * by_form
    by_unknowns[~equator, 3] = by_pole
    return length, by_unknowns


def _equator_radii(form, azimuth):
    """Return radii (k,) 1 / |S^-1 u| of the equator, and derivatives (k, 3) by m, A, B."""
    mean, cos, sin = form
    u = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
    # S = m I + A M_A + B M_B: the matrices are the derivatives of S.
    by_matrix = np.array([np.eye(2), [[-1.0, 0.0], [0.0, 1.0]], [[0.0, 1.0], [1.0, 0.0]]])
    inverse = np.linalg.inv(np.tensordot([mean, cos, sin], by_matrix, axes=1))
    w = u @ inverse
    length = np.linalg.norm(w, axis=1)
    # d(S^-1) = -S^-1 dS S^-1, and d(1/|w|) = -w . dw / |w|^3: the signs cancel.
    by_form = np.einsum("ki,oij,kj->ko", w @ inverse, by_matrix, w) / length[:, None] ** 3
    return 1 / length, by_form


@dataclass(frozen=True)
class FormPrior:
    """Prior of the form of degree 2 of a sphere, for parts that no strapping determines.

    Attributes
    ----------
    ovality_m : float
        Standard deviation of A and of B.
    oblateness_m : float
        Standard deviation of m - c. It applies only if the equator or all meridians are missing, so
        that it never changes a measured polar axis.
    """

    ovality_m: float
    oblateness_m: float


@dataclass(frozen=True)
class FittedEllipsoid:
    """Upright ellipsoid through the lengths of great circles.

    Attributes
    ----------
    unknowns : ndarray, shape (4,)
        m, A, B, c, m.
    weights : ndarray, shape (4, n)
        Derivatives of the unknowns by the lengths.
    by_prior : ndarray, shape (4, k)
        Change of the unknowns for one standard deviation of each prior: ovality twice, and
        oblateness if it applies.
    residuals_m : ndarray, shape (n,)
        Length of the ellipsoid less the measured length.
    precision : ndarray, shape (n, n)
        Precision matrix of the lengths after elimination of the ellipsoid, 1/m2.
    """

    unknowns: np.ndarray
    weights: np.ndarray
    by_prior: np.ndarray
    residuals_m: np.ndarray
    precision: np.ndarray

    @property
    def axes_m(self):
        """(a, b, c), with a the longer axis of the equator."""
        a, b, _ = horizontal_axes(self.unknowns)
        return a, b, float(self.unknowns[3])


def binds_pole(azimuth_rad):
    """Whether the prior of the oblateness applies: the equator or all meridians are missing."""
    equator = np.isnan(azimuth_rad)
    return bool(equator.all() or not equator.any())


def fit_ellipsoid(azimuth_rad, length_m, covariance_m2, prior):
    """Fit an upright ellipsoid to the lengths of great circles by least squares.

    Parameters
    ----------
    azimuth_rad : array_like, shape (n,)
        Azimuths of meridians; nan for the equator.
    length_m : array_like, shape (n,)
        Circumferences, m.
    covariance_m2 : ndarray, shape (n, n)
        Covariance of the circumferences, m2.
    prior : FormPrior

    Returns
    -------
    FittedEllipsoid

    Examples
    --------
    >>> azimuths = np.radians([np.nan, 0.0, 90.0])
    >>> ellipsoid = fit_ellipsoid(azimuths, [62.8512, 62.8431, 62.8467], 1e-8 * np.eye(3),
    ...                       FormPrior(0.01, 0.01))
    >>> [round(axis, 6) for axis in ellipsoid.axes_m]
    [10.003652, 10.002506, 10.001074]
    """
    azimuth, length = np.asarray(azimuth_rad, dtype=float), np.asarray(length_m, dtype=float)
    rows, sds = _prior_rows(prior, binds_pole(azimuth))
    count = len(length)
    # The priors are additional, independent observations of zero.
    covariance = np.zeros((count + len(sds), count + len(sds)))
    covariance[:count, :count] = covariance_m2
    covariance[range(count, len(covariance)), range(count, len(covariance))] = sds**2

    def misclosures(unknowns, observations):
        modelled, by_unknowns = great_circle_lengths(unknowns, azimuth)
        return (
            np.concatenate([modelled, rows @ unknowns]) - observations,
            np.vstack([by_unknowns, rows]),
            None,
        )

    # Start with a sphere of the mean circumference.
    start = np.array([1.0, 0.0, 0.0, 1.0]) * length.mean() / FULL_TURN
    observed_values = np.concatenate([length, np.zeros(len(sds))])
    adjusted = adjust(misclosures, start, observed_values, covariance)
    # Linearise at the solution: weights (A' Q^-1 A)^-1 A' Q^-1 propagate the lengths to the
    # unknowns.
    modelled, by_unknowns = great_circle_lengths(adjusted.unknowns, azimuth)
    design = np.vstack([by_unknowns, rows])
    weighted = np.linalg.solve(covariance, design)
    weights = np.linalg.solve(design.T @ weighted, weighted.T)
    return FittedEllipsoid(
        unknowns=adjusted.unknowns,
        weights=weights[:, :count],
        by_prior=weights[:, count:] * sds,
        residuals_m=modelled - length,
        precision=(np.linalg.inv(covariance) - weighted @ weights)[:count, :count],
    )


def _prior_rows(prior, binds):
    """Return rows (k, 4) of the combinations with expectation zero, and their sds (k,)."""
    rows = [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, -1.0]]
    sds = [prior.ovality_m, prior.ovality_m, prior.oblateness_m]
    count = 3 if binds else 2
    return np.array(rows[:count]), np.array(sds[:count])
