"""Choice of a volume correction by name; ethanol-water mixtures and supplied factors.

Density of ethanol-water mixtures by OIML R 22 (1975), and their volume correction to 20 degC.

The equation and its coefficients come from a public transcription of page 13, whose author checked
it against 38 printed values. The last three figures of two coefficients (C4 and C5) come from
memory and are confirmed by printed values only to 0.01 kg/m3.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.messages import message
from tankcal.tank.volume_correction.petroleum import (
    BASE_NAMES,
    BASES_C,
    Brazil,
    LiquefiedGas,
    Petroleum,
    refuse_not_converged,
    refuse_outside,
)

BASE_C = 20.0
LOWEST_C, HIGHEST_C = -20.0, 40.0  # range of the equation
BISECTIONS, NEWTON_STEPS = 45, 2  # for the mass fraction; 45 halvings reach 3e-14

# rho = sum A_k p^k + sum B_i x^i + sum_i x^i sum_k C_ik p^k, with k from 0 (A) or 1 (C), i from 1,
# p the mass fraction of ethanol and x = t - 20 degC; kg/m3.
_A = (
    *(998.20123, -192.9769495, 389.1238958, -1668.103923, 13522.15441, -88292.78388),
    *(306287.4042, -613838.1234, 747017.2998, -547846.1354, 223446.0334, -39032.85426),
)
_B = (-0.20618513, -5.2682542e-3, 3.6130013e-5, -3.8957702e-7, 7.1693540e-9, -9.9739231e-11)
_C = (
    (
        *(0.1693443461530087, -10.46914743455169, 71.96353469546523, -704.7478054272792),
        *(3924.090430035045, -12101.64659068747, 22486.46550400788, -26055.62982188164),
        *(18523.73922069467, -7420.201433430137, 1285.617841998974),
    ),
    (
        *(-0.01193013005057010, 0.2517399633803461, -2.170575700536993, 13.53034988843029),
        *(-50.29988758547014, 109.6355666577570, -142.2753946421155, 108.0435942856230),
        *(-44.14153236817392, 7.442971530188783),
    ),
    (
        *(-6.802995733503803e-4, 1.876837790289664e-2, -0.2002561813734156, 1.022992966719220),
        *(-2.895696483903638, 4.810060584300675, -4.672147440794683, 2.458043105903461),
        -0.5411227621436812,
    ),
    (
        *(4.075376675622027e-6, -8.763058573471110e-6, 6.515031360099368e-6),
        -1.515784836987210e-6,
    ),
    (-2.788074354782409e-8, 1.345612883493354e-8),
)


def mixture_density(mass_fraction, temperature_c):
    """Density of a mixture of ethanol and water, kg/m3.

    Parameters
    ----------
    mass_fraction : float or ndarray
        Mass of ethanol over the mass of the mixture, 0 to 1.
    temperature_c : float or ndarray
        Temperature, degC.

    Returns
    -------
    float or ndarray

    Examples
    --------
    >>> round(float(mixture_density(0.31, 13.0)), 2)
    956.42
    """
    step = temperature_c - BASE_C
    # Horner's scheme in x; each coefficient of x^i is a polynomial in p.
    density = 0.0
    for i in range(len(_B), 0, -1):
        by_fraction = (0.0, *_C[i - 1]) if i <= len(_C) else (0.0,)
        density = (density + _B[i - 1] + np.polyval(by_fraction[::-1], mass_fraction)) * step
    return density + np.polyval(_A[::-1], mass_fraction)


@dataclass(frozen=True)
class Ethanol:
    """Volume correction of ethanol with water to 20 degC by OIML R 22."""

    base_c = BASE_C
    name = message("correction_r22", "OIML R 22:1975, ethanol and water, base 20 °C")

    def factor(self, density, temperature_c, pressure_kpa=0.0):
        """Volume correction factor rho(p, t) / rho(p, 20 degC), as `Petroleum.factor`.

        The density at 20 degC determines the mass fraction p; the pressure must be 0.
        """
        self._refuse_outside(temperature_c, pressure_kpa)
        fraction = self.mass_fraction(density, BASE_C)
        return mixture_density(fraction, temperature_c) / density

    def base_density(self, density, temperature_c, pressure_kpa=0.0):
        """Density at 20 degC, kg/m3, of a density at another temperature; as for `factor`."""
        self._refuse_outside(temperature_c, pressure_kpa)
        return mixture_density(self.mass_fraction(density, temperature_c), BASE_C)

    def mass_fraction(self, density, temperature_c):
        """Mass fraction of ethanol of a density at a temperature.

        The density decreases from water to ethanol, except for little ethanol near 0 degC.

        Parameters
        ----------
        density : float or ndarray
            kg/m3.
        temperature_c : float or ndarray
            degC.

        Returns
        -------
        float or ndarray

        Raises
        ------
        InputError
            For a density that no mixture has at this temperature.
        """
        low, high = (mixture_density(limit, np.real(temperature_c)) for limit in (1.0, 0.0))
        refuse_outside("density_kg_m3", density, low, high, "kg/m3", self.name)
        # Bisection finds the root of the real values. Newton steps then carry derivatives.
        lower, upper = np.zeros(np.shape(low)), np.ones(np.shape(low))
        for _ in range(BISECTIONS):
            middle = (lower + upper) / 2
            is_denser = mixture_density(middle, np.real(temperature_c)) > np.real(density)
            lower, upper = np.where(is_denser, middle, lower), np.where(is_denser, upper, middle)
        fraction = (lower + upper) / 2
        for _ in range(NEWTON_STEPS):
            excess = mixture_density(fraction, temperature_c) - density
            fraction = fraction - excess / self._slope(fraction, temperature_c)
        return fraction

    def _slope(self, fraction, temperature_c):
        """Derivative of the density by the mass fraction, by central differences."""
        step = 1e-6
        high, low = (mixture_density(fraction + sign * step, temperature_c) for sign in (1, -1))
        return (high - low) / (2 * step)

    def _refuse_outside(self, temperature_c, pressure_kpa):
        refuse_outside("temperature_c", temperature_c, LOWEST_C, HIGHEST_C, "degC", self.name)
        refuse_outside("pressure_kpa", pressure_kpa, 0.0, 0.0, "kPa", self.name)


ROUNDS, CONVERGED = 60, 1e-12  # of the iteration for the density at the base


@dataclass(frozen=True)
class FactorTable:
    """Volume correction factors at densities and temperatures, bilinear between them.

    Attributes
    ----------
    file : str
        Name of the table.
    density_kg_m3 : ndarray, shape (densities,)
        Densities at the base, ascending.
    temperature_c : ndarray, shape (temperatures,)
        Temperatures, ascending.
    factors : ndarray, shape (temperatures, densities)
    base : {"15C", "20C", "60F"}

    Examples
    --------
    >>> import numpy as np
    >>> table = FactorTable("mine.csv", np.array([800.0, 900.0]), np.array([20.0, 40.0]),
    ...                     np.array([[1.0, 1.0], [0.982, 0.984]]), "20C")
    >>> print(table.factor(850.0, 30.0))
    0.9915
    """

    file: str
    density_kg_m3: np.ndarray
    temperature_c: np.ndarray
    factors: np.ndarray
    base: str

    @property
    def base_c(self):
        """Base temperature, degC."""
        return BASES_C[self.base]

    @property
    def name(self):
        """Name of the correction, for reports."""
        return message(
            "correction_table",
            "table {file}, base {base}",
            file=self.file,
            base=BASE_NAMES[self.base],
        )

    def factor(self, density, temperature_c, pressure_kpa=0.0):
        """Volume correction factor, as `Petroleum.factor`."""
        self._refuse_outside(density, temperature_c, pressure_kpa)
        return self._interpolate(density, temperature_c)

    def base_density(self, density, temperature_c, pressure_kpa=0.0):
        """Density at the base, kg/m3, of a density at another temperature."""
        base = density + 0.0 * density
        for _ in range(ROUNDS):
            # Within the table while it iterates; the result is checked below.
            inside = np.clip(np.real(base), self.density_kg_m3[0], self.density_kg_m3[-1])
            before, base = (
                base,
                density / self._interpolate(inside + 1j * np.imag(base), temperature_c),
            )
        is_converged = np.abs(base - before) <= CONVERGED * np.abs(base)
        refuse_not_converged(is_converged, self.name)
        if not np.iscomplexobj(density) and not np.iscomplexobj(temperature_c):
            base = np.real(base)
        self._refuse_outside(base, temperature_c, pressure_kpa)
        return base

    def _interpolate(self, density, temperature_c):
        column, right = _place(self.density_kg_m3, density)
        row, upper = _place(self.temperature_c, temperature_c)
        low = self.factors[row, column] * (1 - right) + self.factors[row, column + 1] * right
        high = self.factors[row + 1, column] * (1 - right)
        high = high + self.factors[row + 1, column + 1] * right
        return low * (1 - upper) + high * upper

    def _refuse_outside(self, density, temperature_c, pressure_kpa):
        for quantity, value, grid, unit in (
            ("density_kg_m3", density, self.density_kg_m3, "kg/m3"),
            ("temperature_c", temperature_c, self.temperature_c, "degC"),
        ):
            refuse_outside(quantity, value, grid[0], grid[-1], unit, self.name)
        refuse_outside("pressure_kpa", pressure_kpa, 0.0, 0.0, "kPa", self.name)


def _place(grid, value):
    """(interval of each value, position in it from 0 to 1); values real or complex."""
    place = np.clip(np.searchsorted(grid, np.real(value), side="right") - 1, 0, len(grid) - 2)
    return place, (value - grid[place]) / (grid[place + 1] - grid[place])


LEAST_C, MOST_C = -60.0, 200.0  # temperatures taken with a constant coefficient


@dataclass(frozen=True)
class Constant:
    """Volume correction with one coefficient of expansion: VCF = 1 / (1 + a (t - base)).

    Attributes
    ----------
    alpha_per_k : float
        Coefficient a of cubic expansion of the liquid, relative to the volume at the base, 1/K.
    base : {"15C", "20C", "60F"}
    """

    alpha_per_k: float
    base: str

    @property
    def base_c(self):
        """Base temperature, degC."""
        return BASES_C[self.base]

    @property
    def name(self):
        """Name of the correction, for reports."""
        return message("correction_coefficient", "alpha = {alpha:g}/K, base {base}",
                       alpha=self.alpha_per_k, base=BASE_NAMES[self.base])  # fmt: skip

    def factor(self, density, temperature_c, pressure_kpa=0.0):
        """Volume correction factor, as `Petroleum.factor`; it does not depend on the density."""
        refuse_outside("temperature_c", temperature_c, LEAST_C, MOST_C, "degC", self.name)
        refuse_outside("pressure_kpa", pressure_kpa, 0.0, 0.0, "kPa", self.name)
        return 1 / (1 + self.alpha_per_k * (temperature_c - self.base_c)) + 0.0 * density

    def base_density(self, density, temperature_c, pressure_kpa=0.0):
        """Density at the base, kg/m3, of a density at another temperature."""
        return density / self.factor(density, temperature_c, pressure_kpa)


TABLE = "table"  # a supplied table of factors, read by the reader of tickets
CORRECTIONS = {  # name of the key `correction`: class, and the keys that it needs
    "D1250-80": (lambda **keys: Petroleum(1980, **keys), ("group", "base")),
    "D1250-04": (lambda **keys: Petroleum(2004, **keys), ("group", "base")),
    "CNP-6-70": (lambda: Brazil(is_rounded=True), ()),
    "CNP-6-70-unrounded": (lambda: Brazil(is_rounded=False), ()),
    "OIML-R22": (Ethanol, ()),
    "GPA-TP27": (LiquefiedGas, ()),
    "coefficient": (Constant, ("alpha_per_k", "base")),
    TABLE: (lambda factor_table, base: factor_table, ("factor_table", "base")),
}
