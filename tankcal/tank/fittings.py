"""What stands or floats in a tank: deadwood, and a floating roof.

Levels and heights count from the bottom of the first course, in metres.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.tank.parts import Part, as_levels
from tankcal.uncertainty import Source

AIR_KG_M3, WEIGHTS_KG_M3 = 1.2, 8000.0  # of conventional weighing (OIML D 28)


@dataclass(frozen=True)
class Deadwood(Part):
    """Items inside (negative volume) or beside a tank (positive), each linear in height.

        V(h) = sum v_i (h - b_i) / (t_i - b_i), kept between 0 and v_i

    An item without height counts from its level on. Items may overlap.

    names                (n,) as in the job
    bottoms_m, tops_m    (n,)
    volumes_m3, u_m3     (n,) signed volumes and their standard uncertainties; nan where unknown:
                         the relative uncertainty that these items share is the input "deadwood"
    """

    names: tuple[str, ...]
    bottoms_m: np.ndarray
    tops_m: np.ndarray
    volumes_m3: np.ndarray
    u_m3: np.ndarray
    kind, moves_with_zero = "deadwood", True

    @property
    def lowest_m(self):
        """Lowest level of an item that adds to the capacity; inf when none does."""
        return float(np.min(self.bottoms_m[self.volumes_m3 > 0], initial=np.inf))

    @property
    def breakpoints_m(self):
        """Bottoms and tops of the items."""
        return (*self.bottoms_m.tolist(), *self.tops_m.tolist())

    def volume_m3(self, levels_m):
        """(rows,) sum of what each item has below each level."""
        return self._parts(levels_m) @ self.volumes_m3

    def area_m2(self, levels_m):
        """(rows,) derivative of `volume_m3` by the level; the upper side where an item begins."""
        levels = as_levels(levels_m)
        tall = self.tops_m > self.bottoms_m
        low, high = self.bottoms_m[tall], self.tops_m[tall]
        here = (levels >= low[:, None]) & (levels < high[:, None])
        return (self.volumes_m3[tall] / (high - low)) @ here

    def derivatives(self, levels_m):
        """{"deadwood": (rows,)} m3 by a relative error of all items without an uncertainty.

        Bottoms and tops are dips, they move with the table's zero.
        """
        shared = np.isnan(self.u_m3)
        if not np.any(shared):
            return {}
        return {"deadwood": self._parts(levels_m)[:, shared] @ self.volumes_m3[shared]}

    def sources(self, levels_m):
        """One `Source` for each item that has an uncertainty: the part of it below each level."""
        parts = self._parts(levels_m)
        return tuple(
            Source(
                "deadwood",
                parts[:, [index]] * u,
                u=float(u),
                unit="m3",
                type="B",
                note=name,
            )
            for index, (name, u) in enumerate(zip(self.names, self.u_m3, strict=True))
            if u > 0
        )

    def _parts(self, levels_m):
        """(rows, n) which part of each item lies below each level."""
        above = as_levels(levels_m) - self.bottoms_m[:, None]
        heights = (self.tops_m - self.bottoms_m)[:, None]
        step = heights == 0
        linear = np.clip(above / np.where(step, 1.0, heights), 0.0, 1.0)
        return np.where(step, above >= 0, linear).T


def deadwood(names, bottoms_m, tops_m, volumes_m3, u_m3=None):
    """Deadwood of items that stand in a tank, or beside it.

    Parameters
    ----------
    names : sequence of str
        n items.
    bottoms_m, tops_m : array_like, shape (n,)
        Levels, m; equal ones for an item that counts whole from its level on.
    volumes_m3 : array_like, shape (n,)
        Signed: below 0 for what takes capacity away, m3.
    u_m3 : array_like, shape (n,), optional
        Standard uncertainties, m3; None: exact; None for an item: unknown.

    Returns
    -------
    Deadwood

    Raises
    ------
    SolutionError
        Naming the item, for a top below its bottom, a negative uncertainty or a number that is not
        finite.

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
    """What a floating roof displaces: nothing below its critical zone, all of it above.

    Between the critical levels the roof rests partly on its legs: what is given there, linear in
    height, is not for use.

    mass_kg                  as weighed
    critical_bottom_m        level at which the liquid first touches the roof
    critical_top_m           level from which it floats freely
    reference_density_kg_m3  of the liquid that the table is for
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
        """Volume of liquid that the floating roof displaces; None: at the reference density.

            "vacuum"  M / rho
            "air"     M (1 - 1.2 / 8000) / (rho - 1.2)

        Weighed in air, a reading M of conventional weights stands for the true mass m less the air
        that the roof displaces: m - 1.2 V = M (1 - 1.2 / 8000). Afloat, liquid and air carry it:
        rho D + 1.2 (V - D) = m, hence D without knowing V. Raises SolutionError for a density not
        above the air's.
        """
        density = self.reference_density_kg_m3 if density_kg_m3 is None else density_kg_m3
        return self.mass_kg * self._per_kg(density)

    def density_correction_m3(self, observed_kg_m3):
        """To be added to a volume read from the table: - M (1 / rho_observed - 1 / rho_reference).

        In air with the densities and mass of `displacement_m3`. Negative in a lighter liquid, in
        which the roof sinks deeper. Only for dips above the critical zone.
        """
        return self.displacement_m3() - self.displacement_m3(observed_kg_m3)

    def volume_m3(self, levels_m):
        """(rows,) minus what is displaced at each level, at the reference density."""
        return -self.displacement_m3() * self._afloat(levels_m)

    def area_m2(self, levels_m):
        """(rows,) derivative of `volume_m3` by the level; 0 outside the critical zone."""
        low, high = self.breakpoints_m
        levels = as_levels(levels_m)
        return np.where(
            (levels >= low) & (levels < high), -self.displacement_m3() / (high - low), 0
        )

    def derivatives(self, levels_m):
        """{input: (rows,)} by "roof_mass", kg; its heights are dips and move with the zero."""
        by_mass = -self._per_kg(self.reference_density_kg_m3) * self._afloat(levels_m)
        return {"roof_mass": by_mass}

    def _afloat(self, levels_m):
        low, high = self.breakpoints_m
        levels = as_levels(levels_m)
        return np.clip((levels - low) / (high - low), 0.0, 1.0)

    def _per_kg(self, density):
        air = AIR_KG_M3 if self.weighing == "air" else 0.0
        if not np.all(np.asarray(density) > AIR_KG_M3):
            raise SolutionError(f"liquid of {density} kg/m3; expected it denser than air")
        return (1 - air / WEIGHTS_KG_M3) / (density - air)


def floating_roof(mass_kg, critical_bottom_m, critical_top_m, reference_density_kg_m3, weighing):
    """A floating roof, from its mass and its critical zone.

    Parameters
    ----------
    mass_kg : float
    critical_bottom_m, critical_top_m : float
        Levels of the critical zone, m: below it the roof displaces nothing, above it all.
    reference_density_kg_m3 : float
        Density of the liquid that the table is for, kg/m3.
    weighing : {"air", "vacuum"}
        How the mass is to be understood: see `FloatingRoof.displacement_m3`.

    Returns
    -------
    FloatingRoof

    Raises
    ------
    SolutionError
        For a mass, zone, density or weighing that cannot be.

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
    roof.displacement_m3()
    return roof
