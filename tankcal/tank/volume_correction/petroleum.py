"""Volume correction of crude oil, petroleum products and lubricating oils (ASTM D1250).

The factor VCF = rho(t) / rho(base) converts a volume at the temperature t to the base temperature.
Two editions are in use. They differ by 0.00001, in the transition zone of products by 0.00006:

- 1980: tables 5, 6, 23, 24, 53, 54 (base 60 degF or 15 degC) and 59, 60 (20 degC);
- 2004: one procedure for all bases, with the pressure (API MPMS 11.1-2004 with the addendum of
  2007).

The texts of the standards were not read. Equations and constants are those of independent public
implementations; the tests compare them with published values of the tables.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.messages import message
from tankcal.tank.volume_correction.ranges import FAHRENHEIT, iterate_density, refuse_outside

EDITIONS, GROUPS = (1980, 2004), ("crude", "products", "lubricants")
BASES_C = {"15C": 15.0, "20C": 20.0, "60F": (60.0 - 32.0) / 1.8}
BASE_NAMES = {"15C": "15 °C", "20C": "20 °C", "60F": "60 °F"}  # for readers
WATER_1980, WATER_2004 = 999.012, 999.016  # kg/m3 at 60 degF, of the API gravity
KPA_PER_PSI = 6.894757
# Linear and quadratic coefficient of the reading of a glass hydrometer, per degree of its scale.
GLASS_EXPANSION = {"15C": (23e-6, 2e-8), "20C": (23e-6, 2e-8), "60F": (12.78e-6, 6.2e-9)}


def density_of_gravity(api, water=WATER_1980):
    """Density at 60 degF, kg/m3, of an API gravity: 141.5 W / (131.5 + API).

    Parameters
    ----------
    api : float or ndarray
        Gravity, degrees API.
    water : float, optional
        Density W of water at 60 degF, kg/m3: `WATER_1980` or `WATER_2004`.

    Returns
    -------
    float or ndarray

    Examples
    --------
    >>> round(density_of_gravity(35.0), 3)
    849.01
    """
    return 141.5 * water / (131.5 + api)


# Ranges of the density at the base, kg/m3, and coefficients K0, K1, K2 of the expansion
# a = K0 / rho^2 + K1 / rho + K2, per degree of the base. A product between two groups belongs to
# the group whose bound is nearer; the bounds of 1980 are half a step of the tables, 0.25 kg/m3.
GROUPS_15C = {
    "crude": (610.5, (1075.0, 613.9723, 0.0, 0.0)),
    "products": (
        653.0,
        (770.25, 346.4228, 0.4388, 0.0),  # gasolines
        (787.75, 2680.3206, 0.0, -0.00336312),  # transition
        (838.75, 594.5418, 0.0, 0.0),  # jet fuels, kerosenes, solvents
        (1075.0, 186.9696, 0.4862, 0.0),  # diesel, heating and fuel oils
    ),
    "lubricants": (800.0, (1164.0, 0.0, 0.6278, 0.0)),
}
GROUPS_60F = {
    "crude": (density_of_gravity(100.0), (density_of_gravity(0.0), 341.0957, 0.0, 0.0)),
    "products": (
        density_of_gravity(85.0),
        (density_of_gravity(52.0), 192.4571, 0.2438, 0.0),
        (density_of_gravity(48.0), 1489.0670, 0.0, -0.00186840),
        (density_of_gravity(37.0), 330.3010, 0.0, 0.0),
        (density_of_gravity(0.0), 103.8720, 0.2701, 0.0),
    ),
    "lubricants": (800.0, (1164.0, 0.0, 0.34878, 0.0)),
}
GROUPS_2004 = {
    "crude": (610.6, (1163.5, 341.0957, 0.0, 0.0)),
    "products": (
        610.6,
        (770.3520, 192.4571, 0.2438, 0.0),
        (787.5195, 1489.0670, 0.0, -0.00186840),
        (838.3127, 330.3010, 0.0, 0.0),
        (1163.5, 103.8720, 0.2701, 0.0),
    ),
    "lubricants": (800.9, (1163.5, 0.0, 0.34878, 0.0)),
}
_GROUP_NAMES = {
    "crude": message("group_crude", "crude"),
    "products": message("group_products", "products"),
    "lubricants": message("group_lubricants", "lubricants"),
}
ALPHA_1980_PER_F, ALPHA_2004_PER_F = (270e-6, 930e-6), (230e-6, 930e-6)

# Temperatures of the 1980 tables: lowest, and highest for light, middle and heavy products, degF,
# with the gravities between them. From memory, not read in the tables.
LOWEST_F, HIGHEST_F = 0.0, (200.0, 250.0, 300.0)
LIGHT_KG_M3, MIDDLE_KG_M3 = density_of_gravity(50.0), density_of_gravity(40.0)
LIMITS_2004_C, _MOST_PSI = (-50.0, 150.0), 1500.0

# 2004: polynomial of the difference between the scales ITS-90 and IPTS-68, and the temperature
# 60 degF (ITS-90) in IPTS-68.
SCALES = (-0.148759, -0.267408, 1.080760, 1.269056, -4.089591, -1.871251, 7.438081, -3.536296)
DELTA_60, ZERO_68_F = 0.01374979547, 60.0068749


@dataclass(frozen=True)
class Petroleum:
    """Volume correction by ASTM D1250.

    Attributes
    ----------
    edition : {1980, 2004}
    group : {"crude", "products", "lubricants"} or None
        None: the coefficient of expansion is given.
    base : {"15C", "20C", "60F"}
        Base temperature.
    alpha_per_k : float, optional
        Coefficient of expansion at the base (at 60 degF for the edition of 2004), 1/K, instead of a
        group (tables C).

    Examples
    --------
    >>> diesel = Petroleum(2004, "products", "20C")
    >>> round(float(diesel.factor(842.0, 34.2)), 6)
    0.988
    """

    edition: int
    group: str | None
    base: str
    alpha_per_k: float | None = None

    @property
    def base_c(self):
        """Base temperature, degC."""
        return BASES_C[self.base]

    @property
    def name(self):
        """Name of the edition and the group, for reports."""
        if self.group is None:
            group = message("group_coefficient", "alpha = {alpha:g}/K", alpha=self.alpha_per_k)
        else:
            group = _GROUP_NAMES[self.group]
        edition, base = f"{self.edition % 100:02d}", BASE_NAMES[self.base]
        return message("correction_d1250", "ASTM D1250-{edition}, {of}, base {base}",
                       edition=edition, of=group, base=base)  # fmt: skip

    def factor(self, density, temperature_c, pressure_kpa=0.0):
        """Volume correction factor from a temperature and gauge pressure to the base.

        Parameters
        ----------
        density : float or ndarray
            Density at the base, kg/m3.
        temperature_c : float or ndarray
            Temperature of the liquid, degC.
        pressure_kpa : float or ndarray, optional
            Gauge pressure, kPa; only with the edition of 2004.

        Returns
        -------
        float or ndarray
            rho(t, p) / rho(base), without a unit.

        Raises
        ------
        InputError
            For a value outside the range of the correction.
        """
        self._refuse_outside(density, temperature_c, pressure_kpa)
        return self._factor(density, temperature_c, pressure_kpa)

    def base_density(self, density, temperature_c, pressure_kpa=0.0):
        """Density at the base, kg/m3, of a density at another temperature and pressure.

        Parameters
        ----------
        density : float or ndarray
            Density of the sample at its temperature, kg/m3. A reading of a glass hydrometer is
            corrected before by `glass_correction`.
        temperature_c, pressure_kpa
            As for `factor`, of the sample.

        Returns
        -------
        float or ndarray

        Raises
        ------
        InputError
            If the density at the base or another value is outside the range, or if the iteration
            does not converge.
        """
        base = self._iterate(
            density, lambda rho, bound: self._factor(rho, temperature_c, pressure_kpa, bound)
        )
        self._refuse_outside(base, temperature_c, pressure_kpa)
        return base

    def _factor(self, density, temperature_c, pressure_kpa=0.0, bound=None):
        """VCF without a check of the range; `bound`: density that decides the group."""
        if self.edition == 1980:
            return self._factor_1980(density, temperature_c, bound)
        # All bases are reached through 60 degF: CTPL(t, p) over CTL(base).
        if self.base == "60F":
            return self._ctpl(density, temperature_c, pressure_kpa, bound)
        at_60 = self._iterate(density, lambda rho, group: self._ctpl(rho, self.base_c, 0.0, group))
        actual, base = (
            self._ctpl(at_60, t, p) for t, p in ((temperature_c, pressure_kpa), (self.base_c, 0.0))
        )
        return actual / base

    def _factor_1980(self, density, temperature_c, bound=None):
        if self.base == "20C":
            # The tables for 20 degC follow from those for 15 degC.
            at_15 = Petroleum(1980, self.group, "15C", self.alpha_per_k)
            rho_15 = at_15._iterate(
                density, lambda rho, group: at_15._factor_1980(rho, 20.0, group)
            )
            return at_15._factor_1980(rho_15, temperature_c) / at_15._factor_1980(rho_15, 20.0)
        is_fahrenheit = self.base == "60F"
        step = (temperature_c - self.base_c) * (1.8 if is_fahrenheit else 1.0)
        if self.group is None:
            alpha = self.alpha_per_k / (1.8 if is_fahrenheit else 1.0)
        else:
            groups = GROUPS_60F if is_fahrenheit else GROUPS_15C
            alpha, _ = _expansion(groups[self.group], density, bound)
        # VCF = exp(-a dt (1 + 0.8 a dt)).
        return np.exp(-alpha * step * (1 + 0.8 * alpha * step))

    def _ctpl(self, density, temperature_c, pressure_kpa, bound=None):
        """CTL CPL of 2004, from a temperature and pressure to 60 degF and no gauge pressure."""
        # Step 1: ITS-90 to IPTS-68, the scale of the measurements behind the constants.
        tau = temperature_c / 630.0
        shift = 0.0
        for coefficient in reversed(SCALES):
            shift = tau * (coefficient + shift)
        scaled = 1.8 * (temperature_c - shift) + 32.0
        # Steps 2 and 3: alpha at the density of 60 degF on that scale.
        if self.group is None:
            alpha = self.alpha_per_k / 1.8
            shifted = density * np.exp(0.5 * alpha * DELTA_60 * (1 + 0.4 * alpha * DELTA_60))
        else:
            alpha, (k0, k1, k2) = _expansion(GROUPS_2004[self.group], density, bound)
            a = DELTA_60 / 2 * alpha
            b = (2 * k0 + k1 * density) / (k0 + (k1 + k2 * density) * density)
            shifted = density * (1 + np.expm1(a * (1 + 0.8 * a)) / (1 + a * (1 + 1.6 * a) * b))
            alpha = (k0 / shifted + k1) / shifted + k2
        # Step 4: CTL.
        step = scaled - ZERO_68_F
        ctl = np.exp(-alpha * step * (1 + 0.8 * alpha * (step + DELTA_60)))
        # Step 5: compressibility F, 1e-5 per psi, and CPL.
        compressibility = np.exp(
            -1.9947 + 0.00013427 * scaled + (793920.0 + 2326.0 * scaled) / shifted**2
        )
        return ctl / (1 - 1e-5 * compressibility * pressure_kpa / KPA_PER_PSI)

    def _iterate(self, density, factor):
        """Density at the base with rho = density / factor(rho)."""
        return iterate_density(density, lambda rho, bound: density / factor(rho, bound), self.name)

    def _refuse_outside(self, density, temperature_c, pressure_kpa):
        if self.edition == 1980:
            high = np.select(
                [np.real(density) < LIGHT_KG_M3, np.real(density) < MIDDLE_KG_M3],
                HIGHEST_F[:2],
                HIGHEST_F[2],
            )
            limits = (LOWEST_F - 32) / 1.8, (high - 32) / 1.8, "degC", self.name
            refuse_outside("temperature_c", temperature_c, *limits, (LOWEST_F, high, FAHRENHEIT))
            refuse_outside("pressure_kpa", pressure_kpa, 0.0, 0.0, "kPa", self.name)
            groups = GROUPS_60F if self.base == "60F" else GROUPS_15C
        else:
            refuse_outside("temperature_c", temperature_c, *LIMITS_2004_C, "degC", self.name)
            limits = 0.0, _MOST_PSI * KPA_PER_PSI, "kPa", self.name
            refuse_outside("pressure_kpa", pressure_kpa, *limits, (0.0, _MOST_PSI, "psi"))
            groups = GROUPS_2004
        if self.group is None:
            per_f = ALPHA_1980_PER_F if self.edition == 1980 else ALPHA_2004_PER_F
            low, high = (1.8 * limit for limit in per_f)
            refuse_outside("alpha_per_k", self.alpha_per_k, low, high, "1/K", self.name)
            return
        least, *parts = groups[self.group]
        refuse_outside("density_kg_m3", density, least, parts[-1][0], "kg/m3", self.name)


def _expansion(groups, density, bound=None):
    """Coefficient of expansion per degree, and K0, K1, K2, of the group of a density.

    The group is that of the density `bound`, by default of the density itself.
    """
    _, *parts = groups
    real = np.real(density) if bound is None else bound
    # The number of upper bounds below the density is the place of its group.
    place = np.searchsorted([high for high, *_ in parts[:-1]], real)
    constants = tuple(np.array(parts)[:, 1:].T[:, place])
    k0, k1, k2 = constants
    return (k0 / density + k1) / density + k2, constants


def glass_correction(temperature_c, scale):
    """Factor on the reading of a glass hydrometer for the expansion of the glass.

    Parameters
    ----------
    temperature_c : float or ndarray
        Temperature of the sample, degC.
    scale : {"15C", "20C", "60F"}
        Temperature of the scale of the hydrometer.

    Returns
    -------
    float or ndarray

    Examples
    --------
    >>> round(glass_correction(25.0, "15C"), 6)
    0.999768
    """
    linear, quadratic = GLASS_EXPANSION[scale]
    step = (1.8 if scale == "60F" else 1.0) * (temperature_c - BASES_C[scale])
    return 1 - linear * step - quadratic * step**2
