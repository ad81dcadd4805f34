"""Great ellipses of an upright ellipsoid: what a tape round a sphere measures.

A sphere as built and loaded is, to the degree 2 of its form, an ellipsoid. Upright, it has the
horizontal radii and the polar one

    r(azimuth) = m + A cos 2 azimuth + B sin 2 azimuth   (first order; exact: the ellipse of the
    matrix S of m, A, B, whose eigenvalues are the semi-axes a and b),      c along the vertical.

The equator has the length L(a, b), a meridian in the azimuth u the length L(1 / |S^-1 u|, c), with
L(p, q) = 8 R_G(0, p^2, q^2) the complete elliptic integral of an ellipse. A meridian thus tells
about r + c, and no axis alone; the mean of evenly spread ones r_m gives c = 2 r_m - r_e.

Source: Carlson 1995, Numerical computation of real or complex elliptic integrals (R_G, R_D);
API Std 2552 (method of measurement of spheres).
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import elliprd, elliprg

from tankcal.adjust import adjust
from tankcal.geometry.outlines import FULL_TURN

UNKNOWNS = ("mean", "cos", "sin", "pole")  # m, A, B, c


def ellipse_length(p_m, q_m):
    """Length of an ellipse, and its derivatives by the semi-axes.

        L = 8 R_G(0, p^2, q^2),    dL/dp = (4 p q^2 / 3) R_D(0, p^2, q^2)

    Parameters
    ----------
    p_m, q_m : array_like
        Semi-axes, m.

    Returns
    -------
    length_m, by_p, by_q : ndarray
        m, and without unit; p by_p + q by_q is the length.

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
    """Semi-axes a >= b of the equator, m, and the azimuth of a, rad, from m, A, B, c.

    Examples
    --------
    >>> horizontal_axes([10.0, 0.0, 0.1, 10.0])
    (10.1, 9.9, 0.7853981633974483)
    """
    mean, cos, sin = (float(one) for one in unknowns[:3])
    half = float(np.hypot(cos, sin))
    return mean + half, mean - half, float(np.arctan2(sin, cos) / 2)


def great_circle_lengths(unknowns, azimuth_rad):
    """Lengths of great circles of an upright ellipsoid, and their derivatives.

    Parameters
    ----------
    unknowns : array_like, shape (4,)
        m, A, B, c, m.
    azimuth_rad : ndarray, shape (n,)
        Of the plane of each meridian, clockwise from +y; nan: the equator.

    Returns
    -------
    length_m : ndarray, shape (n,)
    by_unknowns : ndarray, shape (n, 4)
    """
    mean, cos, sin, pole = (float(one) for one in unknowns)
    azimuth = np.asarray(azimuth_rad, dtype=float)
    length, by = np.empty(len(azimuth)), np.zeros((len(azimuth), 4))
    equator = np.isnan(azimuth)
    a, b, _ = horizontal_axes(unknowns)
    round_m, by_a, by_b = ellipse_length(a, b)
    half = max(np.hypot(cos, sin), np.finfo(float).tiny)
    by_half = by_a - by_b
    length[equator] = round_m
    by[equator] = [by_a + by_b, by_half * cos / half, by_half * sin / half, 0.0]
    radius, by_form = _radii((mean, cos, sin), azimuth[~equator])
    length[~equator], by_radius, by_pole = ellipse_length(radius, pole)
    by[~equator, :3] = by_radius[:, None] * by_form
    by[~equator, 3] = by_pole
    return length, by


def _radii(form, azimuth):
    """(k,) radii 1 / |S^-1 u| of the equator, and (k, 3) their derivatives by m, A, B."""
    mean, cos, sin = form
    u = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
    moves = np.array([np.eye(2), [[-1.0, 0.0], [0.0, 1.0]], [[0.0, 1.0], [1.0, 0.0]]])
    inverse = np.linalg.inv(np.tensordot([mean, cos, sin], moves, axes=1))
    w = u @ inverse
    size = np.linalg.norm(w, axis=1)
    by = np.einsum("ki,oij,kj->ko", w @ inverse, moves, w) / size[:, None] ** 3
    return 1 / size, by


@dataclass(frozen=True)
class FormPrior:
    """What is assumed of the degree 2 of a sphere's form where no strap tells it.

    Attributes
    ----------
    ovality_m : float
        Standard deviation of A and of B.
    oblateness_m : float
        Of m - c; it counts only where the equator or every meridian is missing, so that it never
        pulls a polar axis that was measured.
    """

    ovality_m: float
    oblateness_m: float


@dataclass(frozen=True)
class FittedEllipsoid:
    """An upright ellipsoid through the lengths of great circles.

    Attributes
    ----------
    unknowns : ndarray, shape (4,)
        m, A, B, c, m.
    weights : ndarray, shape (4, n)
        Derivatives of the unknowns by the lengths.
    by_prior : ndarray, shape (4, k)
        What one standard deviation of each prior does to them: ovality twice, oblateness where it
        counts.
    residuals_m : ndarray, shape (n,)
        Length of the ellipsoid less that measured.
    precision : ndarray, shape (n, n)
        Of the lengths, 1/m2, less what the ellipsoid takes up of them.
    """

    unknowns: np.ndarray
    weights: np.ndarray
    by_prior: np.ndarray
    residuals_m: np.ndarray
    precision: np.ndarray

    @property
    def axes_m(self):
        """(a, b, c), a the longer one of the equator."""
        a, b, _ = horizontal_axes(self.unknowns)
        return a, b, float(self.unknowns[3])


def binds_pole(azimuth_rad):
    """Whether the prior of the oblateness counts: no equator, or no meridian."""
    equator = np.isnan(azimuth_rad)
    return bool(equator.all() or not equator.any())


def fit_ellipsoid(azimuth_rad, length_m, covariance_m2, prior):
    """Least squares of an upright ellipsoid to the lengths of great circles.

    Parameters
    ----------
    azimuth_rad : array_like, shape (n,)
        Of meridians; nan: the equator.
    length_m : array_like, shape (n,)
        Circumferences, m.
    covariance_m2 : ndarray, shape (n, n)
    prior : FormPrior

    Returns
    -------
    FittedEllipsoid

    Examples
    --------
    >>> azimuths = np.radians([np.nan, 0.0, 90.0])
    >>> found = fit_ellipsoid(azimuths, [62.8512, 62.8431, 62.8467], 1e-8 * np.eye(3),
    ...                       FormPrior(0.01, 0.01))
    >>> [round(one, 6) for one in found.axes_m]
    [10.003652, 10.002506, 10.001074]
    """
    azimuth, length = np.asarray(azimuth_rad, dtype=float), np.asarray(length_m, dtype=float)
    rows, sds = _prior_rows(prior, binds_pole(azimuth))
    count = len(length)
    whole = np.zeros((count + len(sds), count + len(sds)))
    whole[:count, :count] = covariance_m2
    whole[range(count, len(whole)), range(count, len(whole))] = sds**2

    def misclosures(unknowns, observations):
        found, by = great_circle_lengths(unknowns, azimuth)
        return (
            np.concatenate([found, rows @ unknowns]) - observations,
            np.vstack([by, rows]),
            None,
        )

    start = np.array([1.0, 0.0, 0.0, 1.0]) * length.mean() / FULL_TURN
    given = np.concatenate([length, np.zeros(len(sds))])
    adjusted = adjust(misclosures, start, given, whole)
    found, by = great_circle_lengths(adjusted.unknowns, azimuth)
    design = np.vstack([by, rows])
    weighted = np.linalg.solve(whole, design)
    weights = np.linalg.solve(design.T @ weighted, weighted.T)
    return FittedEllipsoid(
        unknowns=adjusted.unknowns,
        weights=weights[:, :count],
        by_prior=weights[:, count:] * sds,
        residuals_m=found - length,
        precision=(np.linalg.inv(whole) - weighted @ weights)[:count, :count],
    )


def _prior_rows(prior, binds):
    """(k, 4) what each prior says is 0, and (k,) its standard deviation."""
    rows = [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, -1.0]]
    sds = [prior.ovality_m, prior.ovality_m, prior.oblateness_m]
    count = 3 if binds else 2
    return np.array(rows[:count]), np.array(sds[:count])
