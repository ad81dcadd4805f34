"""Volume correction of Brazil to 20 degC: the tables of Resolução CNP 6/70.

The resolution prints tables. A fit to them is in use in several public programs, whose coefficients
agree; the tests compare it with the printed factors that were at hand. The tables themselves were
not read as a whole.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.messages import message
from tankcal.tank.volume_correction.petroleum import glass_correction
from tankcal.tank.volume_correction.ranges import OutsideRangeError, iterate_density, refuse_outside

BASE_C = 20.0
WATER = 0.999042  # g/cm3, of the fit
LEAST, MOST = 0.498, 1.1  # densities of the fit, g/cm3
LOWEST_C, HIGHEST_C = 0.0, 60.0  # temperatures of the check values, with a margin

# Factors of the tables: three decimals for light products, four for heavier ones. The bound between
# them lies between these two densities, which is all that the factors at hand show; g/cm3.
THREE_DECIMALS_TO, FOUR_DECIMALS_FROM = 0.626, 0.742

# Highest density at 20 degC of each class, g/cm3, and a1, a2, b1, b2 of the fit.
CLASSES = np.array(
    [
        (0.498, -0.002462, 0.003215, -1.014e-5, 1.738e-5),
        (0.518, -0.002391, 0.003074, -8.41e-6, 1.398e-5),
        (0.539, -0.002294, 0.002887, -8.39e-6, 1.387e-5),
        (0.559, -0.002146, 0.002615, -5.46e-6, 8.55e-6),
        (0.579, -0.001920, 0.002214, -5.51e-6, 8.59e-6),
        (0.600, -0.002358, 0.002962, -1.225e-5, 2.015e-5),
        (0.615, -0.001361, 0.001300, -4.9e-7, 6.0e-7),
        (0.635, -0.001237, 0.00110, -4.9e-7, 6.0e-7),
        (0.655, -0.001077, 0.00085, -4.9e-7, 6.0e-7),
        (0.675, -0.001011, 0.00075, -4.9e-7, 6.0e-7),
        (0.695, -0.000977, 0.00070, -4.9e-7, 6.0e-7),
        (0.746, -0.001005, 0.00074, -4.9e-7, 6.0e-7),
        (0.766, -0.001238, 0.00105, -4.9e-7, 6.0e-7),
        (0.786, -0.001084, 0.00085, -4.9e-7, 6.0e-7),
        (0.806, -0.000965, 0.00070, -4.9e-7, 6.0e-7),
        (0.826, -0.0008435, 0.00055, -4.9e-7, 6.0e-7),
        (0.846, -0.000719, 0.00040, -4.9e-7, 6.0e-7),
        (0.871, -0.000617, 0.00028, -4.9e-7, 6.0e-7),
        (0.896, -0.000512, 0.00016, -4.9e-7, 6.0e-7),
        (0.996, -0.0003948, 0.00003, -4.9e-7, 6.0e-7),
        (np.inf, -0.0005426, 0.0001778, 2.31e-6, -2.20e-6),
    ]
)


@dataclass(frozen=True)
class Brazil:
    """Volume correction by Resolução CNP 6/70.

    Attributes
    ----------
    is_rounded : bool
        True: density and factor are rounded as in the tables, which the law requires.
    """

    is_rounded: bool
    base_c = BASE_C
    glass_scale = "20C"  # `base_density` corrects the glass of a hydrometer with this scale

    @property
    def name(self):
        """Name of the correction, for reports."""
        if self.is_rounded:
            return message(
                "correction_cnp_rounded", "Resolução CNP 6/70, rounded as its tables, base 20 °C"
            )
        return message("correction_cnp_unrounded", "Resolução CNP 6/70, unrounded, base 20 °C")

    def factor(self, density, temperature_c, pressure_kpa=0.0):
        """Volume correction factor to 20 degC, as `Petroleum.factor`; the pressure must be 0.

        Raises
        ------
        InputError
            For a value outside the range, and with rounding for a density between 626 and 742
            kg/m3, where the number of decimals of the tables is not known.
        """
        self._refuse_outside(density, temperature_c, pressure_kpa)
        relative = density / 1000.0
        if not self.is_rounded:
            return self._fit(relative, temperature_c)
        is_light = np.real(relative) <= THREE_DECIMALS_TO
        is_unknown = ~is_light & (np.real(relative) < FOUR_DECIMALS_FROM)
        if np.any(is_unknown):
            expected = message(
                "brazil_decimals_unknown",
                "found a density between {low:g} and {high:g} kg/m3, where the number of decimals "
                "of the tables is not known to tankcal; expected the unrounded correction",
                low=1000 * THREE_DECIMALS_TO,
                high=1000 * FOUR_DECIMALS_FROM,
            )
            raise OutsideRangeError("density_kg_m3", is_unknown, lambda _: expected)
        # The density is rounded to the nearest even third decimal. The unrounded factor gives the
        # derivatives, which a rounded factor does not have.
        # A density halfway between two of them goes to the multiple of 0.004; rounding to 1e-9
        # first keeps the error of the division from deciding this.
        even = 0.002 * np.round(np.round(np.real(relative) / 0.002, 9))
        factor = np.real(self._fit(even, temperature_c))
        rounded = np.where(is_light, np.round(factor, 3), np.round(factor, 4))
        unrounded = self._fit(relative, temperature_c)
        return rounded + (unrounded - np.real(unrounded))

    def base_density(self, density, temperature_c, pressure_kpa=0.0):
        """Density at 20 degC, kg/m3, of a hydrometer reading at another temperature.

        The correction contains the expansion of the glass. Parameters as for `factor`.
        """
        observed = density / 1000.0
        step = temperature_c - BASE_C
        glass = glass_correction(temperature_c, "20C")

        def next_density(base, bound):
            p1, p2, p3, p4 = coefficients_of_class(base if bound is None else bound)
            return glass * (observed - p1 * step - p3 * step**2) / (1 + p2 * step + p4 * step**2)

        base = iterate_density(observed, next_density, self.name)
        self._refuse_outside(1000.0 * base, temperature_c, pressure_kpa)
        return 1000.0 * base

    def _fit(self, relative, temperature_c):
        """FCV = 1 + p2 x + p4 x^2 + (p1 x + p3 x^2) / D20, x = t - 20 degC."""
        p1, p2, p3, p4 = coefficients_of_class(relative)
        step = temperature_c - BASE_C
        return 1 + p2 * step + p4 * step**2 + (p1 * step + p3 * step**2) / relative

    def _refuse_outside(self, density, temperature_c, pressure_kpa):
        refuse_outside("density_kg_m3", density, 1000 * LEAST, 1000 * MOST, "kg/m3", self.name)
        refuse_outside("temperature_c", temperature_c, LOWEST_C, HIGHEST_C, "degC", self.name)
        refuse_outside("pressure_kpa", pressure_kpa, 0.0, 0.0, "kPa", self.name)


def coefficients_of_class(relative):
    """p1 to p4 of the class of a density at 20 degC, g/cm3."""
    a1, a2, b1, b2 = CLASSES[np.searchsorted(CLASSES[:, 0], np.real(relative))].T[1:]
    q = 1 + 8 * a2 + 64 * b2
    # 9/5 and 81/25 convert the steps of the fit, in degF, to degC.
    p1 = 9 / 5 * WATER * (a1 + 16 * b1 - (8 * a1 + 64 * b1) * (a2 + 16 * b2) / q)
    p2 = 9 / 5 * (a2 + 16 * b2) / q
    p3 = 81 / 25 * WATER * (b1 - (8 * a1 + 64 * b1) * b2 / q)
    p4 = 81 / 25 * b2 / q
    return p1, p2, p3, p4
