"""Profiles of the courses: bulge and taper about the mean radius.

With zeta from -1 at the lower joint of a course to 1 at the upper joint, the radius is
r + sum over j of b_j P_j(zeta), P_j the Legendre polynomials of the degrees 1 to 10. The mean of
each P_j over a course is 0. So r remains the mean radius, and the added volume is 0 at the joints:

    V(zeta) = pi r H sum over j of b_j Q_j(zeta),     Q_j = (P_j+1 - P_j-1) / (2 j + 1)
"""

from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import legvander

from tankcal.recalibration.upright_shell import Rings

DEGREES = np.arange(1, 11)  # degrees of the Legendre polynomials
BULGE_SD_M = 4e-3  # prior sd of degree 2: bulges of shells are a few millimetres
FALL = 1.5  # prior sds fall as (2 / degree)^1.5: profiles are smooth except at joints
TAPER_SD_M = 0.5e-3  # prior sd of degree 1, which resembles the head
# Taper over bulge: 0.22 for a bulge with its highest point a third of the course from a joint.
TAPER_SHARE = 0.3
EDGE_M = 0.03  # excluded zone next to a joint, which an unknown zero moves
# Largest share of chi2 that a smooth profile leaves, and smallest reduction of chi2 per course.
SMOOTH_SHARE, CLEAR_GAIN = 0.2, 50.0
FEWEST_ROWS = 10  # fewest rows of a course whose profile is estimated


def no_bulges(count):
    """Coefficients b = 0 of `count` courses, shape (count, degrees)."""
    return np.zeros((count, len(DEGREES)))


def prior_sds(bulges_m):
    """Prior standard deviations of b; that of the taper depends on the estimated bulges."""
    sds = np.tile(BULGE_SD_M * (2 / DEGREES) ** FALL, (len(bulges_m), 1))
    size = float(np.sqrt(np.mean(bulges_m[:, 1] ** 2)))
    sds[:, 0] = TAPER_SHARE * size if size > 0 else TAPER_SD_M
    return sds


def largest_bulge_m(bulges_m):
    """Largest distance of a profile from the mean radius of its course, m."""
    zeta = np.linspace(-1, 1, 41)
    return float(np.abs(legvander(zeta, int(DEGREES[-1]))[:, DEGREES] @ bulges_m.T).max())


def bulge_volume_m3(rings: Rings, dips_m, radii_m, bulges_m):
    """Volume added by the profiles below each dip, shape (rows,), m3.

    Parameters
    ----------
    rings : Rings
    dips_m : (rows,) ndarray
    radii_m : (courses,) ndarray
    bulges_m : (courses, degrees) ndarray
        Coefficients b.
    """
    return np.einsum("rcj,cj->r", _unit_volumes(rings, dips_m, radii_m)[0], bulges_m)


def bulge_derivatives(rings: Rings, dips_m, radii_m, bulges_m):
    """Derivatives of `bulge_volume_m3`.

    Returns
    -------
    by_bulge : (rows, courses * degrees) ndarray
    by_radius, by_edge : (rows, courses) ndarray
        By radii, and by the edges except the top of the last course.
    by_zero : (rows, 1) ndarray
        By a common shift of all edges.
    """
    unit, zeta, p, is_inside = _unit_volumes(rings, dips_m, radii_m)
    by_radius = np.einsum("rcj,cj->rc", unit, bulges_m) / radii_m
    profile = np.einsum("rcj,cj->rc", p, bulges_m) * is_inside
    half = by_radius * radii_m / np.diff(rings.edges_m)
    lower = -half - np.pi * radii_m * (1 - zeta) * profile
    upper = half - np.pi * radii_m * (1 + zeta) * profile
    by_zero = (lower + upper).sum(axis=1, keepdims=True)
    lower[:, 1:] += upper[:, :-1]
    return unit.reshape(len(unit), -1), by_radius, lower, by_zero


def _unit_volumes(rings, dips_m, radii_m):
    """Volumes for b = 1 m, shape (rows, courses, degrees).

    Zeta; P_j; whether a dip is in a course.
    """
    heights = np.diff(rings.edges_m)
    zeta = 2 * (np.asarray(dips_m)[:, None] - rings.edges_m[:-1]) / heights - 1
    is_inside = (zeta > -1) & (zeta < 1)
    zeta = np.clip(zeta, -1.0, 1.0)
    p = legvander(zeta, int(DEGREES[-1]) + 1)
    q = (p[..., DEGREES + 1] - p[..., DEGREES - 1]) / (2 * DEGREES + 1)
    return np.pi * (radii_m * heights)[:, None] * q, zeta, p[..., DEGREES], is_inside


def show_bulges(dips_m, volumes_m3, sd_m3, edges_m):
    """Whether the rows of most courses follow a smooth profile that is no cylinder with a head.

    Deadwood causes kinks: a smooth profile of its course would leave most of the residuals of a
    parabola.

    Parameters
    ----------
    dips_m, volumes_m3, sd_m3 : (rows,) ndarray
    edges_m : (courses + 1,) ndarray
        Dips of the edges of the courses.
    """
    shown = []
    for low, high in pairwise(edges_m):
        inside = (dips_m > low + EDGE_M) & (dips_m < high - EDGE_M)
        if np.count_nonzero(inside) < FEWEST_ROWS:
            continue
        x = (dips_m[inside] - low) / (high - low) * 2 - 1
        value = volumes_m3[inside] / sd_m3[inside]
        plain, smooth = (
            _least_chi2(legvander(x, degree) / sd_m3[inside, None], value)
            for degree in (2, int(DEGREES[-1]) + 1)
        )
        gain = plain - smooth
        shown.append(gain > CLEAR_GAIN and smooth < SMOOTH_SHARE * plain + len(x))
    return len(shown) > 0 and sum(shown) >= max(2, len(shown) / 2)


def _least_chi2(basis, value):
    q = np.linalg.qr(basis)[0]
    left = value - q @ (q.T @ value)
    return float(left @ left)
