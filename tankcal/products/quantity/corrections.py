"""Choice of a volume correction by name."""

from dataclasses import dataclass

import numpy as np

from tankcal.messages import message
from tankcal.products.quantity.alcohol import Ethanol
from tankcal.products.quantity.brazil import Brazil
from tankcal.products.quantity.gases import LiquefiedGas
from tankcal.products.quantity.petroleum import BASES_C, Petroleum
from tankcal.products.quantity.ranges import refuse_outside

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
                       alpha=self.alpha_per_k, base=self.base)  # fmt: skip

    def factor(self, density, temperature_c, pressure_kpa=0.0):
        """Volume correction factor, as `Petroleum.factor`; it does not depend on the density."""
        refuse_outside("temperature_c", temperature_c, LEAST_C, MOST_C, "degC", self.name)
        refuse_outside("pressure_kpa", pressure_kpa, 0.0, 0.0, "kPa", self.name)
        return 1 / (1 + self.alpha_per_k * (temperature_c - self.base_c)) + 0.0 * density

    def base_density(self, density, temperature_c, pressure_kpa=0.0):
        """Density at the base, kg/m3, of a density at another temperature."""
        return density / self.factor(density, temperature_c, pressure_kpa)


@dataclass(frozen=True)
class FactorTable:
    """Volume correction by a table of factors at temperatures, linear between them.

    Attributes
    ----------
    temperature_c, vcf : ndarray, shape (k,)
        Temperatures, ascending, and factors to the base.
    base_c : float
        Temperature at which the factor is 1.
    file : str
    """

    temperature_c: np.ndarray
    vcf: np.ndarray
    base_c: float
    file: str

    @property
    def name(self):
        """Name of the correction, for reports."""
        return self.file

    def factor(self, density, temperature_c, pressure_kpa=0.0):
        """Volume correction factor, as `Petroleum.factor`; it does not depend on the density."""
        low, high = self.temperature_c[0], self.temperature_c[-1]
        refuse_outside("temperature_c", temperature_c, low, high, "degC", self.name)
        refuse_outside("pressure_kpa", pressure_kpa, 0.0, 0.0, "kPa", self.name)
        row = np.searchsorted(self.temperature_c, np.real(temperature_c), side="right") - 1
        row = np.clip(row, 0, len(self.vcf) - 2)
        slope = np.diff(self.vcf)[row] / np.diff(self.temperature_c)[row]
        return self.vcf[row] + slope * (temperature_c - self.temperature_c[row]) + 0.0 * density

    def base_density(self, density, temperature_c, pressure_kpa=0.0):
        """Density at the base, kg/m3, of a density at another temperature."""
        return density / self.factor(density, temperature_c, pressure_kpa)


CORRECTIONS = {  # name of the key `correction`: class, and the keys that it needs
    "D1250-80": (lambda **keys: Petroleum(1980, **keys), ("group", "base")),
    "D1250-04": (lambda **keys: Petroleum(2004, **keys), ("group", "base")),
    "CNP-6-70": (lambda: Brazil(is_rounded=True), ()),
    "CNP-6-70-unrounded": (lambda: Brazil(is_rounded=False), ()),
    "OIML-R22": (Ethanol, ()),
    "GPA-TP27": (LiquefiedGas, ()),
    "coefficient": (Constant, ("alpha_per_k", "base")),
}
