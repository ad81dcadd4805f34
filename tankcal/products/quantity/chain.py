"""From a dip to quantities by API MPMS 12.1.1, and quantities of a transfer.

    TOV  total observed volume, from the table at the dip
    FW   free water, from the table at the dip of the water
    GOV  gross observed volume  = (TOV - FW) CTSh + FRA
    GSV  gross standard volume  = GOV VCF
    NSV  net standard volume    = GSV (1 - S&W)
    mass = NSV rho_base
    weight in air = mass (1 - rho_air / rho_base) / (1 - rho_air / rho_weights)

The order of the steps was read in public implementations, not in the standard. All functions take
arrays, real or complex: derivatives by complex steps give the uncertainty.

Quantities of a transfer between two gaugings of a tank, with their uncertainty.

Opening and closing share the table, the tape, the thermometer, the density and the volume
correction. Their errors partly cancel in the difference; the covariance of the table does so
exactly. Sensitivities are complex steps through the whole chain.
"""

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from tankcal.gum.coverage import coverage_factor, dof_of
from tankcal.products.quantity.table import TankTable
from tankcal.tank.gauging import ROOMS, assumed_u_vcf
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


STEP = 1e-30  # of complex steps; far below rounding, so that derivatives are exact
STATES = ("opening", "closing")


@dataclass(frozen=True)
class Transfer:
    """Quantities of n tickets of a tank.

    Attributes
    ----------
    table : TankTable
    gaugings : dict
        {"opening": Gauging, "closing": Gauging}; "closing" alone for a stock.
    taped_m : dict
        {state: length (n,) read on the tape}; negative for an ullage, which lowers the level.
    product : Product
    u : dict
        {name of UNCERTAINTIES: value, or (n,) values}; None only for u_vcf_percent: by its rule.
    probability : float
        Coverage probability.
    """

    table: TankTable
    gaugings: dict[str, Gauging]
    taped_m: dict[str, np.ndarray]
    product: Product
    u: dict
    probability: float = 0.95

    @cached_property
    def steps(self):
        """{state: Steps} without errors."""
        return self._evaluate({})

    def quantities(self):
        """`Quantities` of each state, and of the difference closing - opening ("moved").

        Returns
        -------
        dict of {str: Quantities}
        """
        results = {state: _quantity_matrix(self.steps[state]) for state in self.gaugings}
        inputs = list(self._standard_uncertainties())
        slopes = {name: self._slopes(name) for name, _ in inputs}
        contributions = {state: {} for state in self.gaugings}
        for name, u in inputs:
            for state in self.gaugings:
                contributions[state][name] = slopes[name][state] * np.reshape(u, (-1, 1))
        table_parts = self._table_parts(slopes)
        dof = {
            state: self.table.dof_at(gauging.level_m) for state, gauging in self.gaugings.items()
        }
        if len(self.gaugings) == 2:
            opening, closing = STATES
            results["moved"] = results[closing] - results[opening]
            contributions["moved"] = {
                name: contributions[closing][name] - contributions[opening][name]
                for name, _ in inputs
            }
            negative = [(-slope, factor) for slope, factor in table_parts[opening]]
            table_parts["moved"] = [*table_parts[closing], *negative]
            dof["moved"] = np.minimum(dof[opening], dof[closing])
        return {
            state: _combine(
                results[state],
                contributions[state],
                _table_variance(table_parts[state]),
                dof[state],
                self.probability,
            )
            for state in results
        }

    @cached_property
    def room_levels(self):
        """{name of ROOMS: dip} of the operating levels of the tank that are for use."""
        return self.table.room_levels()

    def rooms(self):
        """`Quantities` (n, rooms) of the closing gauging, in the order of `room_levels`.

        They are observed volumes at the temperature of the shell, with water. Errors of the table
        that both dips share cancel, and so do those of a floating roof.
        """
        dips = self.room_levels
        slopes, contributions = {}, {}
        for name, u in self._standard_uncertainties():
            slopes[name] = self._rooms({name: STEP * 1j}, np.imag) / STEP
            contributions[name] = slopes[name] * np.reshape(u, (-1, 1))
        closing = self.steps["closing"]
        count = len(closing.tov_m3)
        # An error of the table at an operating level acts like one at the dip, with other sign.
        at_level = -slopes["interpolation closing"]
        contributions["interpolation level"] = at_level * self.table.interpolation_m3 / np.sqrt(3)
        level = self.gaugings["closing"].level_m
        parts = [(slopes["interpolation closing"], self.table.factor(level))]
        dof = self.table.dof_at(level)
        for place, dip in enumerate(dips.values()):
            is_place = np.arange(len(dips)) == place
            at_dip = np.full(count, dip)
            parts.append((np.where(is_place, at_level, 0.0), self.table.factor(at_dip)))
            dof = np.minimum(dof, self.table.dof_at(at_dip))
        value = self._rooms({}, np.real)
        return _combine(value, contributions, _table_variance(parts), dof, self.probability)

    def _rooms(self, errors, part):
        """Real or imaginary parts (n, rooms) of the volumes of `rooms` with errors."""
        steps = self._evaluate(errors)["closing"]
        expansion = self.product.expansion_per_k + errors.get("expansion", 0.0)
        present = steps.tov_m3 * steps.ctsh + steps.fra_m3
        columns = [
            ROOMS[name][1] * (fill_to(self.table, dip, steps, expansion) - present)
            for name, dip in self.room_levels.items()
        ]
        return part(np.column_stack(columns))

    def _evaluate(self, errors):
        """{state: Steps} with the errors {name: complex number} of the inputs."""
        product = replace(
            self.product,
            density=self.product.density + errors.get("density", 0.0),
            water_share=self.product.water_share + errors.get("sw", 0.0),
            expansion_per_k=self.product.expansion_per_k + errors.get("expansion", 0.0),
        )
        result = {}
        for state, gauging in self.gaugings.items():
            shifted = replace(
                gauging,
                level_m=gauging.level_m
                + errors.get(f"dip {state}", 0.0)
                + errors.get("tape", 0.0) * self.taped_m[state],
                water_m=gauging.water_m + errors.get(f"water dip {state}", 0.0),
                temperature_c=gauging.temperature_c
                + errors.get(f"temperature {state}", 0.0)
                + errors.get("thermometer", 0.0),
                ambient_c=gauging.ambient_c + errors.get("ambient", 0.0),
                table_error_m3=errors.get(f"interpolation {state}", 0.0),
            )
            vcf_error = errors.get("vcf", 0.0) * self._vcf_scale(gauging.temperature_c)
            result[state] = follow_chain(self.table, shifted, product, vcf_error)
        return result

    def _vcf_scale(self, temperature_c):
        """Standard uncertainty of the volume correction at each temperature, relative, (n,)."""
        if self.u["u_vcf_percent"] is not None:
            return self.u["u_vcf_percent"] / 100
        return assumed_u_vcf(temperature_c, self.product.correction.base_c)

    def _standard_uncertainties(self):
        """Yield (name, standard uncertainty (n,)) of each input."""
        u = self.u
        for state, gauging in self.gaugings.items():
            yield f"dip {state}", u["u_dip_mm"] / 1000
            yield f"temperature {state}", u["u_temperature_k"]
            has_water = np.isfinite(gauging.water_m)
            if has_water.any():
                yield f"water dip {state}", np.where(has_water, u["u_water_dip_mm"] / 1000, 0.0)
            # The error of a straight line between two rows, at most that of the record.
            yield f"interpolation {state}", self.table.interpolation_m3 / np.sqrt(3)
        yield "tape", u["u_tape_ppm"] / 1e6
        yield "thermometer", u["u_thermometer_k"]
        if not self.product.is_insulated:
            yield "ambient", u["u_ambient_k"]
        yield "density", u["u_density_kg_m3"]
        yield "sw", u["u_sw_percent"] / 100
        yield "expansion", u["u_expansion_per_k"]
        yield "vcf", 1.0

    def _slopes(self, name):
        """{state: derivative of each quantity by an input}, shape (n, quantities) each."""
        steps = self._evaluate({name: STEP * 1j})
        return {state: _quantity_matrix(steps[state], np.imag) / STEP for state in steps}

    def _table_parts(self, slopes):
        """{state: [(derivatives of the quantities by a volume, factor of the volume)]}.

        The volumes are those at the liquid and at the free water. The derivatives have the shape
        (n, quantities), the factor (n, inputs).
        """
        parts = {}
        for state, gauging in self.gaugings.items():
            # An error of the table acts like one of interpolation, at the liquid and at the water.
            by_liquid = slopes[f"interpolation {state}"][state]
            has_water = np.isfinite(gauging.water_m)
            water_m = np.where(has_water, gauging.water_m, self.table.height_m[0])
            by_water = np.where(has_water[:, None], -by_liquid, 0.0)
            by_water[:, QUANTITIES.index("tov_m3")] = 0.0  # contains the water
            parts[state] = [
                (by_liquid, self.table.factor(gauging.level_m)),
                (by_water, self.table.factor(water_m)),
            ]
        return parts


@dataclass(frozen=True)
class Quantities:
    """Quantities of n tickets in a state, in the order of QUANTITIES.

    Attributes
    ----------
    value, u, k, U : ndarray, shape (n, quantities)
        Value, standard uncertainty, coverage factor and expanded uncertainty; m3, kg.
    dof : ndarray, shape (n, quantities)
        Effective degrees of freedom.
    contributions : dict
        {name of the input: contribution (n, quantities) to u, with its sign}; "table" without sign.
    """

    value: np.ndarray
    u: np.ndarray
    k: np.ndarray
    U: np.ndarray
    dof: np.ndarray
    contributions: dict


def _quantity_matrix(steps: Steps, part=np.real):
    """Real or imaginary parts of the quantities, shape (n, quantities)."""
    return np.column_stack([part(getattr(steps, name)) for name in QUANTITIES])


def _table_variance(parts):
    """Variance (n, quantities) by the table, from the (derivatives, factor) of its volumes."""
    variance = np.zeros(parts[0][0].shape)
    # One quantity at a time: all of them together need gigabytes for 100 000 tickets.
    for place in range(variance.shape[1]):
        by_input = sum(slope[:, place, None] * factor for slope, factor in parts)
        variance[:, place] = np.sum(by_input**2, axis=1)
    return variance


def _combine(value, contributions, table_variance, dof_of_table, probability):
    """`Quantities` from the contributions of independent inputs and of the table."""
    variance = table_variance + sum(part**2 for part in contributions.values())
    # Only the table has finite degrees of freedom; all other u are of type B.
    fourths = table_variance**2 / dof_of_table[:, None]
    dof = dof_of(variance, fourths)
    u, k = np.sqrt(variance), coverage_factor(probability, dof)
    parts = {"table": np.sqrt(table_variance), **contributions}
    return Quantities(value, u, k, k * u, dof, parts)
