"""Volume correction of liquefied petroleum gas to 60 degF by GPA TP-27 (API MPMS 11.2.4).

The corrected liquid lies between two of twelve reference fluids by its relative density; the law of
corresponding states interpolates between them. Equations and constants are those of a public
implementation; the text of the standard was not read and no published value was at hand. The vapour
above the liquid is not part of the correction.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.messages import message
from tankcal.tank.volume_correction.ranges import (
    FAHRENHEIT,
    RELATIVE,
    iterate_density,
    refuse_outside,
)

WATER_60F = 999.016  # kg/m3, of the relative density 60/60
BASE_C, BASE_K = (60.0 - 32.0) / 1.8, 519.67 / 1.8
LEAST_DENSITY, MOST_DENSITY = 0.35, 0.688  # relative density 60/60
LOWEST_F, HIGHEST_F = -50.8, 199.4

# Relative density 60/60, critical temperature K, compressibility at the critical point, critical
# density mol/L, and k1 to k4 of the saturation density.
_FLUIDS = np.array(
    [
        # EE 68/32
        (0.325022, 298.11, 0.27998, 6.250)
        + (2.54616855327, -0.058244177754, 0.803398090807, -0.745720314137),
        # ethane
        (0.355994, 305.33, 0.28220, 6.870)
        + (1.89113042610, -0.370305782347, -0.544867288720, 0.337876634952),
        # EP 65/35
        (0.429277, 333.67, 0.28060, 5.615)
        + (2.20970078464, -0.294253708172, -0.405754420098, 0.319443433421),
        # EP 35/65
        (0.470381, 352.46, 0.27930, 5.110)
        + (2.25341981320, -0.266542138024, -0.372756711655, 0.384734185665),
        # propane
        (0.507025, 369.78, 0.27626, 5.000)
        + (1.96568366933, -0.327662435541, -0.417979702538, 0.303271602831),
        # i-butane
        (0.562827, 407.85, 0.28326, 3.860)
        + (2.04748034410, -0.289734363425, -0.330345036434, 0.291757103132),
        # n-butane
        (0.584127, 425.16, 0.27536, 3.920)
        + (2.03734743118, -0.299059145695, -0.418883095671, 0.380367738748),
        # i-pentane
        (0.624285, 460.44, 0.27026, 3.247)
        + (2.06541640707, -0.238366208840, -0.161440492247, 0.258681568613),
        # n-pentane
        (0.631054, 469.65, 0.27235, 3.200)
        + (2.11263474494, -0.261269413560, -0.291923445075, 0.308344290017),
        # i-hexane
        (0.657167, 498.05, 0.26706, 2.727)
        + (2.02382197871, -0.423550090067, -1.152810982570, 0.950139001678),
        # n-hexane
        (0.664064, 507.35, 0.26762, 2.704)
        + (2.17134547773, -0.232997313405, -0.267019794036, 0.378629524102),
        # n-heptane
        (0.688039, 540.15, 0.26312, 2.315)
        + (2.19773533433, -0.275056764147, -0.447144095029, 0.493770995799),
    ]
)


@dataclass(frozen=True)
class LiquefiedGas:
    """Volume correction of liquefied petroleum gas to 60 degF by GPA TP-27."""

    base_c = BASE_C
    name = message("correction_tp27", "GPA TP-27, liquefied petroleum gas, base 60 °F")

    def factor(self, density, temperature_c, pressure_kpa=0.0):
        """Volume correction factor of the saturated liquid, as `Petroleum.factor`.

        The density is that at 60 degF; the gauge pressure above that of saturation must be 0.

        Raises
        ------
        InputError
            For a value outside the range, or a temperature above the critical point.
        """
        self._refuse_outside(density, temperature_c, pressure_kpa)
        return self._factor(density, temperature_c)

    def base_density(self, density, temperature_c, pressure_kpa=0.0):
        """Density at 60 degF, kg/m3, of a density at another temperature; as for `factor`."""

        def next_density(base, _):
            relative = np.clip(np.real(base) / WATER_60F, LEAST_DENSITY, MOST_DENSITY)
            inside = base - np.real(base) + relative * WATER_60F
            return density / self._factor(inside, temperature_c)

        base = iterate_density(density, next_density, self.name)
        self._refuse_outside(base, temperature_c, pressure_kpa)
        return base

    def _factor(self, density, temperature_c):
        relative = density / WATER_60F
        place = np.clip(np.searchsorted(_FLUIDS[:, 0], np.real(relative)), 1, len(_FLUIDS) - 1)
        light, heavy = _FLUIDS[place - 1].T, _FLUIDS[place].T
        weight = (relative - light[0]) / (heavy[0] - light[0])
        critical_k = light[1] + weight * (heavy[1] - light[1])
        # Ratio of the critical compressibility and density of both fluids.
        ratio = light[2] * light[3] / (heavy[2] * heavy[3])

        def density_at(temperature_k):
            reduced = 1 - temperature_k / critical_k
            rho_light, rho_heavy = (_saturation_density(fluid, reduced) for fluid in (light, heavy))
            return rho_light / (1 + weight * (rho_light / (ratio * rho_heavy) - 1))

        return density_at(temperature_c + 273.15) / density_at(BASE_K)

    def _refuse_outside(self, density, temperature_c, pressure_kpa):
        low, high = ((limit - 32) / 1.8 for limit in (LOWEST_F, HIGHEST_F))
        critical = np.interp(np.real(density) / WATER_60F, _FLUIDS[:, 0], _FLUIDS[:, 1]) - 273.15
        high = np.minimum(high, critical)
        least, most = LEAST_DENSITY * WATER_60F, MOST_DENSITY * WATER_60F
        refuse_outside("density_kg_m3", density, least, most, "kg/m3", self.name,
                       (LEAST_DENSITY, MOST_DENSITY, RELATIVE))  # fmt: skip
        refuse_outside("temperature_c", temperature_c, low, high, "degC", self.name,
                       (LOWEST_F, 1.8 * high + 32, FAHRENHEIT))  # fmt: skip
        refuse_outside("pressure_kpa", pressure_kpa, 0.0, 0.0, "kPa", self.name)


def _saturation_density(fluid, reduced):
    """Saturation density of a reference fluid at the reduced temperature 1 - T / Tc, mol/L."""
    critical, k1, k2, k3, k4 = fluid[3:]
    # Above the critical point there is no liquid; the range excludes it.
    reduced = np.where(np.real(reduced) > 0, reduced, 1e-12)
    rise = k1 * reduced**0.35 + k3 * reduced**2 + k4 * reduced**3
    return critical * (1 + rise / (1 + k2 * reduced**0.65))
