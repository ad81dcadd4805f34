"""Volume correction by a supplied table of factors, interpolated by density and temperature."""

from dataclasses import dataclass

import numpy as np

from tankcal.messages import message
from tankcal.tank.volume_correction.petroleum import BASE_NAMES, BASES_C
from tankcal.tank.volume_correction.ranges import refuse_not_converged, refuse_outside

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
