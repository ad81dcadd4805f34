"""Shell of an upright tank in a table: rings, their expansion by the head, and their profiles.

Liquid of density rho up to the dip h widens a ring of unloaded inside radius r and plate t, at the
dip z, by K rho (h - z), K = g r^2 / (E t). The volume between the bottom of the first ring and h is

    W(h) = sum over rings of pi [r^2 u + r K rho u^2 + K^2 rho^2 u^3 / 3]

between u = h - end and h - bottom, where end is the lower of h and the top of the ring. The last
term is 1e-4 of the effect of the head. The head of the first order omits it; W is then quadratic
within a ring.

A course may bulge or taper about its mean radius. With zeta from -1 at its lower joint to 1 at its
upper joint, the radius is r + sum over j of b_j P_j(zeta), P_j the Legendre polynomials of the
degrees 1 to 10. The mean of each P_j over a course is 0. So r remains the mean radius, and the
added volume is 0 at the joints:

    V(zeta) = pi r H sum over j of b_j Q_j(zeta),     Q_j = (P_j+1 - P_j-1) / (2 j + 1)
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import legvander

from tankcal.units import STANDARD_GRAVITY

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


@dataclass(frozen=True)
class Rings:
    """Rings of plates, one above the other.

    Attributes
    ----------
    edges_m : ndarray, shape (n + 1,)
        Dips of the bottom of the first ring, of the seams, and of the top of the last ring, which
        extends upwards without limit.
    thickness_m : ndarray, shape (n,)
    modulus_pa : float
    is_first_order : bool
        Whether the head is of first order.
    """

    edges_m: np.ndarray
    thickness_m: np.ndarray
    modulus_pa: float
    is_first_order: bool = True

    def compliance_m(self, radii_m):
        """Compliance K (n,): widening of a ring, m, per kg/m2 of liquid above."""
        return STANDARD_GRAVITY * radii_m**2 / (self.modulus_pa * self.thickness_m)

    def volume_m3(self, dips_m, radii_m, density_kg_m3):
        """Volume W(h), shape (rows,), m3; 0 below the first ring."""
        first, second, third = self._powers(dips_m)
        # widening of a ring per metre of liquid above, K rho
        soft = self.compliance_m(radii_m) * density_kg_m3
        linear = first @ radii_m**2 + second @ (radii_m * soft)
        return np.pi * (linear + third @ (soft**2 / 3))

    def derivatives(self, dips_m, radii_m, density_kg_m3):
        """Derivatives of W by the radii (rows, n), the density (rows,), and the edges (rows, n).

        The top of the last ring is not an edge in this sense and is left out.
        """
        first, second, third = self._powers(dips_m)
        compliance = self.compliance_m(radii_m)
        soft = compliance * density_kg_m3
        # K is proportional to r^2, so d(r K)/dr = 3 K and d(K^2)/dr = 4 K^2 / r.
        by_radius = np.pi * (
            2 * first * radii_m + 3 * second * soft + 4 / 3 * third * soft**2 / radii_m
        )
        by_density = np.pi * (
            second @ (radii_m * compliance) + third @ (2 / 3 * compliance**2 * density_kg_m3)
        )
        head = np.maximum(dips_m[:, None] - self.edges_m[:-1], 0.0)
        above = self._cut_m2(radii_m, soft, head)
        below = np.zeros_like(above)
        # A higher edge exchanges the cross section above it for the one below.
        below[:, 1:] = self._cut_m2(radii_m[:-1], soft[:-1], head[:, 1:])
        return by_radius, by_density, (below - above) * (head > 0)

    def area_m2(self, dips_m, radii_m, density_kg_m3):
        """Derivative dW/dh, shape (rows,), m2.

        The free surface plus the widening of the wall below.
        """
        # Heads at the bottom and at the top of the wet part of each ring.
        high = np.maximum(np.asarray(dips_m)[:, None] - self.edges_m[:-1], 0.0)
        low = self._low(dips_m)
        soft = self.compliance_m(radii_m) * density_kg_m3
        place = np.clip(np.searchsorted(self.edges_m, dips_m, "right") - 1, 0, len(radii_m) - 1)
        growth = 2 * (high - low) @ (radii_m * soft)
        if not self.is_first_order:
            growth = growth + (high**2 - low**2) @ soft**2
        return np.pi * (radii_m[place] ** 2 + growth)

    def _cut_m2(self, radii_m, soft, head):
        """Area (rows, n) of the cross section of rings under a head."""
        square = 0.0 if self.is_first_order else (soft * head) ** 2
        return np.pi * (radii_m**2 + 2 * radii_m * soft * head + square)

    def _low(self, dips_m):
        """Head (rows, n) at the top of the wet part of each ring; the last ring has no top."""
        low = np.maximum(np.asarray(dips_m)[:, None] - self.edges_m[1:], 0.0)
        low[:, -1] = 0.0
        return low

    def _powers(self, dips_m):
        """Integrals (rows, n) of 1, 2 u and 3 u^2 over the wet part of each ring."""
        high = np.maximum(np.asarray(dips_m)[:, None] - self.edges_m[:-1], 0.0)
        low = self._low(dips_m)
        third = np.zeros_like(high) if self.is_first_order else high**3 - low**3
        return high - low, high**2 - low**2, third


def estimate_radii(rings, dips, volumes, density, zone=None):
    """Unloaded radii (courses,) of the rings, from the rise of the volumes within them, m.

    A ring between two rows takes the radius of the next ring below. Over the critical zone of a
    roof, the rows rise by less than the ring holds. The ring is then evaluated on one side of the
    zone.

    Parameters
    ----------
    rings : Rings
    dips, volumes : (rows,) ndarray
        Dips, m, and volumes, m3.
    density : float
        Density of the head in the volumes, kg/m3.
    zone : (float, float), optional
        Lower and upper dip of the critical zone.
    """
    radii, edges = np.empty(len(rings.thickness_m)), rings.edges_m.copy()
    edges[-1] = max(edges[-1], dips[-1])
    head = np.zeros(len(dips))
    for _ in range(2):  # first without, then with the head in rings of these radii
        for k in range(len(radii)):
            inside = np.flatnonzero((dips >= edges[k] - 1e-9) & (dips <= edges[k + 1] + 1e-9))
            # The lower half of the first ring may contain the bottom.
            inside = inside[len(inside) // 2 :] if k == 0 and len(inside) > 5 else inside
            inside = _rows_beside_zone(zone, inside, dips)
            radii[k] = radii[k - 1] if k else np.sqrt(volumes[-1] / np.pi / dips[-1])
            if len(inside) > 1:
                first, last = inside[0], inside[-1]
                # pi r^2 times the height equals the rise without the effect of the head
                rise = volumes[last] - head[last] - volumes[first] + head[first]
                radii[k] = np.sqrt(max(rise, 1e-9) / np.pi / (dips[last] - dips[first]))
        head = rings.volume_m3(dips, radii, density) - rings.volume_m3(dips, radii, 0.0)
    return radii


def _rows_beside_zone(zone, inside, dips):
    """Indices of the rows on one side of a critical zone, the side with more rows."""
    if zone is None:
        return inside
    above = inside[dips[inside] >= zone[1] - 1e-9]
    below = inside[dips[inside] <= zone[0] + 1e-9]
    return above if len(above) >= len(below) else below


# ---- profiles of the courses


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
    # Both edges of a course scale its height, and they shift zeta of the dips within it.
    half = by_radius * radii_m / np.diff(rings.edges_m)
    lower = -half - np.pi * radii_m * (1 - zeta) * profile
    upper = half - np.pi * radii_m * (1 + zeta) * profile
    by_zero = (lower + upper).sum(axis=1, keepdims=True)
    # The upper edge of a course is the lower edge of the next one.
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
    """Return the smallest sum of squares of value - basis b for any b."""
    q = np.linalg.qr(basis)[0]
    left = value - q @ (q.T @ value)
    return float(left @ left)
