"""Choice of a volume correction by name."""

from dataclasses import dataclass

from tankcal.messages import message
from tankcal.tank.volume_correction.alcohol import Ethanol
from tankcal.tank.volume_correction.brazil import Brazil
from tankcal.tank.volume_correction.gases import LiquefiedGas
from tankcal.tank.volume_correction.petroleum import BASE_NAMES, BASES_C, Petroleum
from tankcal.tank.volume_correction.ranges import refuse_outside

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
