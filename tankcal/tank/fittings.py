"""Fittings inside a tank: deadwood, and a floating roof.

Levels and heights count from the bottom of the first course, in metres.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.tank.parts import Part, as_levels
from tankcal.uncertainty import Source

AIR_KG_M3, WEIGHTS_KG_M3 = 1.2, 8000.0  # densities of air and weights (OIML D 28)


@dataclass(frozen=True)
class Deadwood(Part):
    """Items inside (negative volume) or beside a tank (positive), each linear in height.

        V(h) = sum v_i (h - b_i) / (t_i - b_i), limited to the range from 0 to v_i

    An item without height counts completely from its level on. Items may overlap.

    names                (n,) as in the job
    bottoms_m, tops_m    (n,) levels
    volumes_m3, u_m3     (n,) signed volumes and their standard uncertainties; nan if unknown: the
                         input "deadwood" is then the common relative uncertainty of these items
    """

    names: tuple[str, ...]
    bottoms_m: np.ndarray
    tops_m: np.ndarray
    volumes_m3: np.ndarray
    u_m3: np.ndarray
    kind, moves_with_zero = "deadwood", True

    @property
    def lowest_m(self):
        """Lowest level of an item that adds to the capacity; inf if no item does."""
        return float(np.min(self.bottoms_m[self.volumes_m3 > 0], initial=np.inf))

    @property
    def breakpoints_m(self):
        """Levels of the bottoms and tops of the items."""
        return (*self.bottoms_m.tolist(), *self.tops_m.tolist())

    def volume_m3(self, levels_m):
        """Return the sum (rows,) of the volumes of all items below each level."""
        return self._parts(levels_m) @ self.volumes_m3

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of `volume_m3` by the level, upwards at a bottom or top."""
        levels = as_levels(levels_m)
        # Items without height are jumps of the volume: they do not contribute to the area.
        tall = self.tops_m > self.bottoms_m
        bottom, top = self.bottoms_m[tall], self.tops_m[tall]
        is_within = (levels >= bottom[:, None]) & (levels < top[:, None])
        return (self.volumes_m3[tall] / (top - bottom)) @ is_within

    def derivatives(self, levels_m):
        """Return {"deadwood": (rows,)}, m3 per relative error of all items without an uncertainty.

        Bottoms and tops are dips and move with the zero of the table.
        """
        shared = np.isnan(self.u_m3)
        if not np.any(shared):
            return {}
        return {"deadwood": self._parts(levels_m)[:, shared] @ self.volumes_m3[shared]}

    def sources(self, levels_m):
        """Return one `Source` for each item with an uncertainty, for its part below each level."""
        parts = self._parts(levels_m)
        return tuple(
            Source(
                "deadwood",
                parts[:, [index]] * u,
                u=float(u),
                unit="m3",
                note=name,
            )
            for index, (name, u) in enumerate(zip(self.names, self.u_m3, strict=True))
            if u > 0
        )

    def _parts(self, levels_m):
        """Return the fraction (rows, n) of each item below each level."""
        above = as_levels(levels_m) - self.bottoms_m[:, None]
        heights = (self.tops_m - self.bottoms_m)[:, None]
        step = heights == 0
        # Heights of zero are replaced before the division, which numpy evaluates for all items.
        linear = np.clip(above / np.where(step, 1.0, heights), 0.0, 1.0)
        return np.where(step, above >= 0, linear).T


def deadwood(names, bottoms_m, tops_m, volumes_m3, u_m3=None):
    """Return the deadwood of items inside a tank, or beside it.

    Parameters
    ----------
    names : sequence of str
        Names of n items.
    bottoms_m, tops_m : array_like, shape (n,)
        Levels, m; equal levels for an item that counts completely from its level on.
    volumes_m3 : array_like, shape (n,)
        Signed volumes, m3: negative for items that reduce the capacity.
    u_m3 : array_like, shape (n,), optional
        Standard uncertainties, m3; None: exact; None for an item: unknown.

    Returns
    -------
    Deadwood

    Raises
    ------
    SolutionError
        With the name of the item, for a top below its bottom, a negative uncertainty or a number
        that is not finite.

    Examples
    --------
    >>> ladder = deadwood(["ladder"], [0.0], [10.0], [-0.5])
    >>> ladder.volume_m3([5.0]).tolist()
    [-0.25]
    """
    names = tuple(names)
    u = np.zeros(len(names)) if u_m3 is None else u_m3
    columns = [np.array(c, dtype=float) for c in (bottoms_m, tops_m, volumes_m3, u)]
    for name, bottom, top, volume, sd in zip(names, *columns, strict=True):
        if not np.all(np.isfinite([bottom, top, volume])) or np.isinf(sd):
            raise SolutionError(
                message(
                    "deadwood_not_finite", "deadwood {name}: expected finite numbers", name=name
                )
            )
        if top < bottom:
            raise SolutionError(
                message(
                    "deadwood_top_below_bottom",
                    "deadwood {name}: its top {top_m:g} m is below its bottom {bottom_m:g} m",
                    name=name,
                    top_m=top,
                    bottom_m=bottom,
                )
            )
        if sd < 0:
            raise SolutionError(
                message(
                    "deadwood_uncertainty_negative",
                    "deadwood {name}: its uncertainty {u_m3:g} m3 is negative",
                    name=name,
                    u_m3=sd,
                )
            )
    return Deadwood(names, *columns)


@dataclass(frozen=True)
class FloatingRoof(Part):
    """Displacement of a floating roof: 0 below its critical zone, complete above it.

    Between the critical levels, the roof rests partly on its legs. The volumes there, linear in
    height, are not for use.

    mass_kg                  mass as weighed
    critical_bottom_m        level at which the liquid first touches the roof
    critical_top_m           level from which the roof floats freely
    reference_density_kg_m3  density of the liquid of the table
    weighing                 "air" (conventional, with weights of 8000 kg/m3) or "vacuum" (mass)
    """

    mass_kg: float
    critical_bottom_m: float
    critical_top_m: float
    reference_density_kg_m3: float
    weighing: str
    kind, moves_with_zero = "roof", True

    @property
    def breakpoints_m(self):
        """(low, high) levels of the critical zone, which is not for use, m."""
        return (self.critical_bottom_m, self.critical_top_m)

    def displacement_m3(self, density_kg_m3=None):
        """Return the volume of liquid displaced by the roof; None: at the reference density.

            "vacuum"  M / rho
            "air"     M (1 - 1.2 / 8000) / (rho - 1.2)

        For weighing in air, a reading M of conventional weights is the true mass m less the air
        displaced by the roof: m - 1.2 V = M (1 - 1.2 / 8000). Afloat, the roof is supported by
        liquid and air: rho D + 1.2 (V - D) = m, which gives D without V. Raises SolutionError for a
        density not above that of air.
        """
        density = self.reference_density_kg_m3 if density_kg_m3 is None else density_kg_m3
        return self.mass_kg * self._displacement_per_kg(density)

    def density_correction_m3(self, observed_kg_m3):
        """Return the correction of a volume read from the table for the observed density.

        The correction is - M (1 / rho_observed - 1 / rho_reference); in air, with the densities and
        mass of `displacement_m3`. It is negative for a lighter liquid, in which the roof sinks
        deeper. It applies only to dips above the critical zone.
        """
        return self.displacement_m3() - self.displacement_m3(observed_kg_m3)

    def volume_m3(self, levels_m):
        """Return minus the displacement (rows,) at each level, at the reference density."""
        return -self.displacement_m3() * self._afloat(levels_m)

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of `volume_m3`; 0 outside the critical zone."""
        low, high = self.breakpoints_m
        levels = as_levels(levels_m)
        return np.where(
            (levels >= low) & (levels < high), -self.displacement_m3() / (high - low), 0
        )

    def derivatives(self, levels_m):
        """Return {"roof_mass": (rows,)}, m3 per kg; the heights are dips and move with the zero."""
        by_mass = -self._displacement_per_kg(self.reference_density_kg_m3) * self._afloat(levels_m)
        return {"roof_mass": by_mass}

    def _afloat(self, levels_m):
        """Return the floating fraction (rows,) of the roof at each level."""
        low, high = self.breakpoints_m
        levels = as_levels(levels_m)
        return np.clip((levels - low) / (high - low), 0.0, 1.0)

    def _displacement_per_kg(self, density):
        """Return the displaced volume per kg of the weighed mass."""
        # Without air buoyancy the formula reduces to M / rho.
        air = AIR_KG_M3 if self.weighing == "air" else 0.0
        if not np.all(np.asarray(density) > AIR_KG_M3):
            raise SolutionError(f"liquid of {density} kg/m3; expected it denser than air")
        return (1 - air / WEIGHTS_KG_M3) / (density - air)


def floating_roof(mass_kg, critical_bottom_m, critical_top_m, reference_density_kg_m3, weighing):
    """Return a floating roof, from its mass and its critical zone.

    Parameters
    ----------
    mass_kg : float
    critical_bottom_m, critical_top_m : float
        Levels of the critical zone, m: the displacement is 0 below it and complete above it.
    reference_density_kg_m3 : float
        Density of the liquid of the table, kg/m3.
    weighing : {"air", "vacuum"}
        Definition of the mass: see `FloatingRoof.displacement_m3`.

    Returns
    -------
    FloatingRoof

    Raises
    ------
    SolutionError
        For an impossible mass, zone, density or weighing.

    Examples
    --------
    >>> roof = floating_roof(80_000.0, 1.5, 1.8, 800.0, "vacuum")
    >>> roof.displacement_m3()
    100.0
    """
    if not (np.isfinite(mass_kg) and mass_kg > 0):
        raise SolutionError(
            message(
                "roof_without_mass",
                "floating roof of {mass_kg:g} kg; expected a mass above 0",
                mass_kg=mass_kg,
            )
        )
    if not critical_bottom_m < critical_top_m:
        raise SolutionError(
            message(
                "critical_zone_upside_down",
                "critical zone from {low_m:g} to {high_m:g} m; expected its top above its bottom",
                low_m=critical_bottom_m,
                high_m=critical_top_m,
            )
        )
    if weighing not in ("air", "vacuum"):
        raise SolutionError(f'weighing "{weighing}"; expected "air" or "vacuum"')
    roof = FloatingRoof(
        float(mass_kg),
        float(critical_bottom_m),
        float(critical_top_m),
        float(reference_density_kg_m3),
        weighing,
    )
    # Evaluate once, to refuse an impossible density here.
    roof.displacement_m3()
    return roof
