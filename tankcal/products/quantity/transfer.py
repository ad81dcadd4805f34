"""Quantities of a transfer between two gaugings of a tank, with their uncertainty.

Opening and closing share the table, the tape, the thermometer, the density and the volume
correction. Their errors partly cancel in the difference; the covariance of the table does so
exactly. Sensitivities are complex steps through the whole chain.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.gum.coverage import coverage_factor, dof_of
from tankcal.products.quantity.chain import (
    QUANTITIES,
    Gauging,
    Product,
    Steps,
    fill_to,
    follow_chain,
)
from tankcal.products.quantity.table import TankTable
from tankcal.tank.gauging import ROOMS, assumed_u_vcf

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
        results = {state: _values(self.steps[state]) for state in self.gaugings}
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
        return {state: _values(steps[state], np.imag) / STEP for state in steps}

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


def _values(steps: Steps, part=np.real):
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
