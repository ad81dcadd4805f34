"""Spheres as built and loaded: the upright ellipsoid, and a sphere under pressure.

Dips count from the lowest inside point, in metres; dips outside the tank raise HeightError.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.tank.lying import levels_inside, require_length
from tankcal.tank.parts import Solid
from tankcal.units import STANDARD_GRAVITY

ROUNDS = 60  # iterations of the highest dip; each reduces the error by the strain, about 1e-4


@dataclass(frozen=True)
class Ellipsoid(Solid):
    """Ellipsoid with a vertical axis: V = pi a b d^2 (3 c - d) / (3 c^2).

    Attributes
    ----------
    a_m, b_m : float
        Horizontal semi-axes, inside.
    c_m : float
        Vertical semi-axis.

    Raises
    ------
    SolutionError
        For a semi-axis that is not above zero.

    Examples
    --------
    >>> Ellipsoid(1.0, 1.0, 1.0).volume_m3([1.0, 2.0]).round(4).tolist()
    [2.0944, 4.1888]
    """

    a_m: float
    b_m: float
    c_m: float

    def __post_init__(self):
        for name in ("a", "b", "c"):
            require_length(f"semi-axis {name}", getattr(self, f"{name}_m"))

    @property
    def top_m(self):
        """Highest dip, m."""
        return 2 * self.c_m

    @property
    def diameter_m(self):
        """Diameter of the sphere of equal volume, m."""
        return float(2 * np.cbrt(self.a_m * self.b_m * self.c_m))

    @property
    def capacity_m3(self):
        """Volume of the full tank, 4 pi a b c / 3."""
        return 4 / 3 * np.pi * self.a_m * self.b_m * self.c_m

    def volume_m3(self, levels_m):
        """Return the volume (rows,) below each dip."""
        d = levels_inside(levels_m, self.top_m)
        return np.pi * self.a_m * self.b_m / self.c_m**2 * d**2 * (3 * self.c_m - d) / 3

    def area_m2(self, levels_m):
        """Return the free surface (rows,), pi a b d (2 c - d) / c^2."""
        d = levels_inside(levels_m, self.top_m)
        return np.pi * self.a_m * self.b_m / self.c_m**2 * d * (2 * self.c_m - d)

    def by_axes(self, levels_m):
        """Return the derivative (rows, 3) of the volume at a fixed dip by a, b and c, m2."""
        d, c = levels_inside(levels_m, self.top_m), self.c_m
        volume = self.volume_m3(d)
        # Derivative of (3 c - d) / c^2 by c, at a fixed dip d.
        by_c = np.pi * self.a_m * self.b_m * d**2 * (2 * d / (3 * c) - 1) / c**2
        return np.column_stack([volume / self.a_m, volume / self.b_m, by_c])

    def derivatives(self, levels_m):
        """Return {input: derivative (rows,) of the volume at a fixed dip}.

        diameter         all three semi-axes, by half of the diameter
        plate_thickness  thickness subtracted from outside measurements: reduces all three semi-axes
        datum            height of the liquid at a given dip
        scale            scale of the axes, but not of the dips
        """
        d = levels_inside(levels_m, self.top_m)
        by_radius, area = self.by_axes(d).sum(axis=1), self.area_m2(d)
        return {
            "diameter": by_radius / 2,
            "plate_thickness": -by_radius,
            "datum": area,
            # V = t^3 W(d / t) for a scale t: dV/dt = 3 V - d A at t = 1.
            "scale": 3 * self.volume_m3(d) - d * area,
        }


@dataclass(frozen=True)
class Pressure:
    """Loads of a sphere, for the table and during the survey; all 0: no load.

    Attributes
    ----------
    gas_pa : float
        Gauge pressure above the liquid.
    density_kg_m3 : float
        Density of the liquid below the dip.
    survey_gas_pa, survey_density_kg_m3, survey_level_m : float
        Gauge pressure, density and level of the liquid during the survey.
    """

    gas_pa: float = 0.0
    density_kg_m3: float = 0.0
    survey_gas_pa: float = 0.0
    survey_density_kg_m3: float = 0.0
    survey_level_m: float = 0.0

    @property
    def is_there(self):
        """Whether the sphere is loaded during the survey or for the table."""
        surveyed = self.survey_density_kg_m3 * self.survey_level_m
        return any((self.gas_pa, self.density_kg_m3, self.survey_gas_pa, surveyed))


@dataclass(frozen=True)
class Membrane:
    """Thin wall of a sphere.

    Attributes
    ----------
    thickness_m, e_pa : float
        Thickness of the plates, and Young's modulus.
    poisson : float
        Poisson's ratio.
    """

    thickness_m: float
    e_pa: float
    poisson: float = 0.3


@dataclass(frozen=True)
class PressedSphere(Solid):
    """Sphere, or nearly a sphere, widened by pressure from the survey to the dip of the table.

        dr / r = p r (1 - nu) / (2 E t),      p = gas + rho g h^2 / (4 r), less that of the survey

    rho g h^2 / (4 r) is the mean pressure of a liquid of depth h over the whole wall. By Betti's
    theorem, it gives the change of the whole volume according to membrane theory, for a sphere
    whose support does not move under uniform widening (at its equator). For the volume below a dip,
    it is an approximation.

    Attributes
    ----------
    solid : Solid
        Sphere or ellipsoid as surveyed, inside.
    membrane : Membrane
    pressure : Pressure

    Examples
    --------
    >>> from tankcal.tank.solids import Sphere
    >>> loaded = PressedSphere(Sphere(20.0), Membrane(0.02, 206e9), Pressure(gas_pa=5e5))
    >>> round(float(loaded.strain(0.0)[0]), 7), round(loaded.capacity_m3 / 4188.790205 - 1, 5)
    (0.0004248, 0.00127)
    """

    solid: Solid
    membrane: Membrane
    pressure: Pressure

    def __post_init__(self):
        require_length("thickness", self.membrane.thickness_m)
        if not self.strain(2 * self._radius_m)[0] < 0.1:
            raise SolutionError(
                message(
                    "sphere_too_soft",
                    "the pressure widens the sphere by {percent:.3g} %: check thickness, modulus"
                    " and pressures",
                    percent=100 * float(self.strain(2 * self._radius_m)[0]),
                )
            )

    @property
    def diameter_m(self):
        """Diameter of the surveyed sphere of equal volume, m."""
        return self.solid.diameter_m

    @property
    def _radius_m(self):
        return self.solid.diameter_m / 2

    @property
    def _compliance(self):
        """Strain per pascal."""
        wall = self.membrane
        return self._radius_m * (1 - wall.poisson) / (2 * wall.e_pa * wall.thickness_m)

    def strain(self, levels_m):
        """Return the change dr / r (rows,) since the survey, with the liquid at each dip."""
        return self._compliance * (self._gas_pa + self._heads_pa(levels_m))

    @property
    def _gas_pa(self):
        return self.pressure.gas_pa - self.pressure.survey_gas_pa

    def _heads_pa(self, levels_m):
        """Return mean pressures (rows,) of the liquid on the wall, less that of the survey."""
        loads, levels = self.pressure, np.atleast_1d(np.asarray(levels_m, dtype=float))
        mass = (
            loads.density_kg_m3 * levels**2 - loads.survey_density_kg_m3 * loads.survey_level_m**2
        )
        return STANDARD_GRAVITY * mass / (4 * self._radius_m)

    @cached_property
    def top_m(self):
        """Highest dip, m: that of the sphere widened by the full liquid."""
        top = self.solid.top_m
        for _ in range(ROUNDS):
            # Fixed point: the dip of the full tank loads the wall, which raises the dip.
            top = self.solid.top_m * (1 + float(self.strain(top)[0]))
        return top

    @property
    def capacity_m3(self):
        """Volume of the full tank, m3."""
        return float(self.volume_m3(np.array([self.top_m]))[0])

    def volume_m3(self, levels_m):
        """Return the volume (rows,) below each dip."""
        wider, dips = self._unload(levels_m)
        # Similar spheres: lengths times t give volumes times t^3 at dips divided by t.
        return wider**3 * self.solid.volume_m3(dips)

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of the volume by the dip, including its load."""
        wider, dips = self._unload(levels_m)
        return wider**2 * self.solid.area_m2(dips) + self._strain_derivatives(
            wider, dips
        ) * self._slope(levels_m)

    def derivatives(self, levels_m):
        """Return {input: derivative (rows,) of the volume at a fixed dip}.

        The inputs are those of the surveyed solid, and youngs_modulus, pressure (of the table),
        survey_pressure, liquid_density, survey_density, survey_level. A thicker plate is also
        stiffer.
        """
        wider, dips = self._unload(levels_m)
        levels = np.atleast_1d(np.asarray(levels_m, dtype=float))
        loads, by_strain, strain = self.pressure, self._strain_derivatives(wider, dips), wider - 1
        head = self._compliance * STANDARD_GRAVITY / (4 * self._radius_m)  # strain per kg/m
        # The strain due to gas is proportional to r; the strain due to a head does not depend on r.
        by_radius = self._compliance * self._gas_pa / self._radius_m
        derivatives = {
            name: wider**3 * derivative for name, derivative in self.solid.derivatives(dips).items()
        }
        radius_by = {"diameter": 0.5, "plate_thickness": -1.0, "scale": self._radius_m}
        for name, derivative in radius_by.items():
            derivatives[name] = derivatives[name] + by_strain * by_radius * derivative
        derivatives["plate_thickness"] = (
            derivatives["plate_thickness"] - by_strain * strain / self.membrane.thickness_m
        )
        derivatives["datum"] = self.area_m2(levels)
        return derivatives | {
            "youngs_modulus": -by_strain * strain / self.membrane.e_pa,
            "pressure": by_strain * self._compliance,
            "survey_pressure": -by_strain * self._compliance,
            "liquid_density": by_strain * head * levels**2,
            "survey_density": -by_strain * head * loads.survey_level_m**2,
            "survey_level": -by_strain
            * head
            * 2
            * loads.survey_density_kg_m3
            * loads.survey_level_m,
        }

    def _unload(self, levels_m):
        """Return relative lengths (rows,) of the loaded sphere, and dips of the surveyed sphere."""
        levels = np.atleast_1d(np.asarray(levels_m, dtype=float))
        levels_inside(levels, self.top_m)
        wider = 1 + self.strain(levels)
        return wider, np.minimum(levels / wider, self.solid.top_m)

    def _strain_derivatives(self, wider, dips):
        """Return the derivative (rows,) of the volume at a fixed dip by the strain."""
        return wider**2 * self.solid.derivatives(dips)["scale"]

    def _slope(self, levels_m):
        """Return the derivative (rows,) of the strain by the dip."""
        levels = np.atleast_1d(np.asarray(levels_m, dtype=float))
        per_pa = self._compliance * STANDARD_GRAVITY / (2 * self._radius_m)
        return per_pa * self.pressure.density_kg_m3 * levels
