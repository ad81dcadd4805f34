"""Shell of an upright tank in a table: rings, and their expansion by the head of the liquid.

Liquid of density rho up to the dip h widens a ring of unloaded inside radius r and plate t, at the
dip z, by K rho (h - z), K = g r^2 / (E t). The volume between the bottom of the first ring and h is

    W(h) = sum over rings of pi [r^2 u + r K rho u^2 + K^2 rho^2 u^3 / 3]

between u = h - end and h - bottom, where end is the lower of h and the top of the ring. The last
term is 1e-4 of the effect of the head. The head of the first order omits it; W is then quadratic
within a ring.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.units import STANDARD_GRAVITY


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
        low = np.maximum(np.asarray(dips_m)[:, None] - self.edges_m[1:], 0.0)
        low[:, -1] = 0.0
        return low

    def _powers(self, dips_m):
        """Integrals (rows, n) of 1, 2 u and 3 u^2 over the wet part of each ring."""
        high = np.maximum(np.asarray(dips_m)[:, None] - self.edges_m[:-1], 0.0)
        low = self._low(dips_m)
        third = np.zeros_like(high) if self.is_first_order else high**3 - low**3
        return high - low, high**2 - low**2, third
