"""From a dip to quantities: the chain of API MPMS 12.1.1, step by step.

    TOV  total observed volume, from the table at the dip
    FW   free water, from the table at the dip of the water
    GOV  gross observed volume  = (TOV - FW) CTSh + FRA
    GSV  gross standard volume  = GOV VCF
    NSV  net standard volume    = GSV (1 - S&W)
    mass = NSV rho_base
    weight in air = mass (1 - rho_air / rho_base) / (1 - rho_air / rho_weights)

The order of the steps was read in public implementations, not in the standard. All functions take
arrays, real or complex: derivatives by complex steps give the uncertainty.
"""

from dataclasses import dataclass, fields

import numpy as np

from tankcal.tank.service import shell_factor, shell_temperature_c


@dataclass(frozen=True)
class Gauging:
    """Dips and temperatures of one state of the tank, for n tickets.

    Attributes
    ----------
    level_m : ndarray, shape (n,)
        Dip of the liquid.
    water_m : ndarray, shape (n,)
        Dip of the free water; nan: none.
    temperature_c : ndarray, shape (n,)
        Mean temperature of the liquid.
    ambient_c : ndarray, shape (n,)
        Temperature of the air about the tank; nan if the shell is insulated.
    pressure_kpa : ndarray, shape (n,)
        Gauge pressure above the liquid.
    table_error_m3 : float or ndarray, optional
        Error of the volume at the dip; only its derivative is of use.
    """

    level_m: np.ndarray
    water_m: np.ndarray
    temperature_c: np.ndarray
    ambient_c: np.ndarray
    pressure_kpa: np.ndarray
    table_error_m3: float | np.ndarray = 0.0


@dataclass(frozen=True)
class Product:
    """Properties of the liquid and of the shell, for n tickets.

    Attributes
    ----------
    correction : object
        Volume correction with `factor` and `base_density`, such as `petroleum.Petroleum`.
    density : ndarray, shape (n,)
        Density, kg/m3: at the base if `sample_c` is None, else of the sample.
    sample_c : ndarray, shape (n,), or None
        Temperature of the sample.
    glass : ndarray, shape (n,)
        Correction of the reading of a glass hydrometer; 1 for other instruments.
    water_share : ndarray, shape (n,)
        Suspended sediment and water over the volume, 0 to 1.
    expansion_per_k : ndarray, shape (n,)
        Coefficient of linear expansion of the shell.
    is_insulated : bool
    air_kg_m3, weights_kg_m3 : float
        Densities of the air and of the weights, for the weight in air.
    """

    correction: object
    density: np.ndarray
    sample_c: np.ndarray | None
    glass: np.ndarray
    water_share: np.ndarray
    expansion_per_k: np.ndarray
    is_insulated: bool = False
    air_kg_m3: float = 1.2
    weights_kg_m3: float = 8000.0

    def base_density(self):
        """Density at the base temperature, kg/m3, shape (n,)."""
        if self.sample_c is None:
            return self.density
        return self.correction.base_density(self.density * self.glass, self.sample_c)


@dataclass(frozen=True)
class Steps:
    """Steps of the chain, shape (n,) each, in the order of the calculation.

    Volumes are in m3, densities in kg/m3, mass and weight in kg; factors have no unit.
    """

    tov_m3: np.ndarray
    fw_m3: np.ndarray
    shell_c: np.ndarray
    ctsh: np.ndarray
    base_density: np.ndarray
    vcf: np.ndarray
    observed_density: np.ndarray
    fra_m3: np.ndarray
    gov_m3: np.ndarray
    gsv_m3: np.ndarray
    csw: np.ndarray
    nsv_m3: np.ndarray
    mass_kg: np.ndarray
    air_factor: np.ndarray
    weight_kg: np.ndarray


QUANTITIES = ("tov_m3", "gov_m3", "gsv_m3", "nsv_m3", "mass_kg", "weight_kg")


def follow_chain(table, gauging, product, vcf_error=0.0):
    """Compute the steps from the dips to the quantities.

    Parameters
    ----------
    table : TankTable
    gauging : Gauging
    product : Product
    vcf_error : float or ndarray, optional
        Relative error of the volume correction; only its derivative is of use.

    Returns
    -------
    Steps
    """
    tov = table.volume(gauging.level_m) + gauging.table_error_m3
    has_water = np.isfinite(np.real(gauging.water_m))
    water_level = np.where(has_water, gauging.water_m, table.height_m[0])
    fw = np.where(has_water, table.volume(water_level), 0.0)
    shell_c = shell_temperature_c(
        gauging.temperature_c, gauging.ambient_c, insulated=product.is_insulated
    )
    ctsh = table_shell_factor(table, gauging.level_m, shell_c, product.expansion_per_k)
    base = product.base_density()
    vcf = product.correction.factor(base, gauging.temperature_c, gauging.pressure_kpa)
    vcf = vcf * (1 + vcf_error)
    observed = base * vcf
    fra = table.roof_correction_m3(observed) + 0.0 * tov
    # The water has the temperature of the shell as well, so it is subtracted before CTSh.
    gov = (tov - fw) * ctsh + fra
    gsv = gov * vcf
    csw = 1 - product.water_share
    nsv = gsv * csw
    mass = nsv * base
    air = (1 - product.air_kg_m3 / base) / (1 - product.air_kg_m3 / product.weights_kg_m3)
    return Steps(
        tov, fw, shell_c + 0.0 * tov, ctsh + 0.0 * tov, base, vcf, observed, fra, gov, gsv, csw,
        nsv, mass, air, mass * air,
    )  # fmt: skip


def table_shell_factor(table, level_m, shell_c, expansion_per_k):
    """CTSh of each dip: of a shell on its bottom, or of a solid that expands in all directions."""
    if table.kind == "vertical":
        return shell_factor(shell_c, table.temperature_c, expansion_per_k)
    # V'(h) = s^3 V(h / s), with heights above the bottom of the tank; see `tank.service`.
    stretch = 1 + expansion_per_k * (shell_c - table.temperature_c)
    cold_level = (level_m + table.zero_m) / stretch - table.zero_m
    volume = table.volume(level_m)
    is_empty = np.real(volume) <= 0
    ratio = stretch**3 * table.volume(cold_level) / np.where(is_empty, 1.0, volume)
    return np.where(is_empty, 1.0, ratio)


def fill_to(table, level_m, steps, expansion_per_k):
    """Observed volume of liquid and water up to a dip, in the state of a gauging.

    Parameters
    ----------
    table : TankTable
    level_m : float
        Dip for use.
    steps : Steps
        Steps of the gauging: temperature of the shell and correction of the roof.
    expansion_per_k : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n,)
        m3.
    """
    level = np.full(np.shape(steps.tov_m3), level_m)
    ctsh = table_shell_factor(table, level, steps.shell_c, expansion_per_k)
    # Below its critical zone the roof rests on its legs, and displaces no liquid.
    fra = np.where(table.is_critical(level), 0.0, steps.fra_m3)
    return table.volume(level) * ctsh + fra


def values_of(steps):
    """{name: real values (n,)} of the steps."""
    return {field.name: np.real(getattr(steps, field.name)) for field in fields(steps)}
