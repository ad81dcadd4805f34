"""Calibration with liquid: metered steps as observations of the volumes of a tank.

    fill = fill_of(metering)                                  steps between valid dips
    reduced = reduce_steps(fill, volume_m3, growth)           misclosures against a geometry
    found = adjust_steps(reduced.misclosure_m3, noise, effects)
    found.gain, found.test(column)
    estimate_run_effect(found, columns), name_causes(found, alternatives)

The functions use plain arrays and are independent of a job; `adjustment` estimates the causes of
the misclosures. Metered rows are reduced to steps between dips by

    rho(Tm) [f (1 + g) v + n] = rho(T_k) W_k - rho(T_k-1) W_k-1,   W = c(Ts) V(h),
    rho(T) = rho_0 (1 - b (T - T_0))

Steps are at the temperature of the table. Division by rho(T_k) c_k gives a step

    f v m / c_k = V(h_k) - q_k V(h_k-1),   m = rho(Tm) / rho(T_k),
    q = rho(T_k-1) c_k-1 / (rho(T_k) c_k).

The metered volume less the right side is the misclosure. The column of a cause is the change of the
misclosures for one standard deviation, as true value less assumed value. If a factor is larger than
declared, the true increment is larger, and the misclosure (metered less geometry) is smaller.

Source: conservation of mass; ISO 4269:2001 and API Std 2555 (methods, by their catalogue pages),
API MPMS 12 for the corrections that it replaces; the mathematics is in docs/liquid.md.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, diags_array

from tankcal.tank.liquid.adjustment import (
    Alternative,
    Effect,
    LiquidAdjustment,
    RunEffect,
    Verdict,
    adjust_steps,
    estimate_run_effect,
    name_causes,
)

MOST_ROWS = 3000  # rows of liquid.csv at most; the tests of all dips and batches are dense
EMPTY = -1  # start of a step in the empty, dry tank, in place of the index of a dip
EXPANSION_STEP = 1e-3  # relative step of the expansion, in which misclosures are nearly linear


@dataclass(frozen=True)
class Fill:
    """Steps of all runs between valid dips.

    Attributes
    ----------
    runs, meters : tuple of str
        Names of the runs and of the meters.
    dip_row : ndarray of int, shape (d,)
        Row of the metering of each valid dip.
    start, end : ndarray of int, shape (n,)
        Dips at the start and end of each step, as indices of `dip_row`; EMPTY: start in the empty
        tank.
    run : ndarray of int, shape (n,)
        Index of the run of each step in `runs`.
    step : ndarray of int, shape (rows,)
        Step to which the volume of each row belongs, -1: none. A step has several rows if the dips
        between them are not valid.
    """

    runs: tuple[str, ...]
    meters: tuple[str, ...]
    dip_row: np.ndarray
    start: np.ndarray
    end: np.ndarray
    run: np.ndarray
    step: np.ndarray

    def __len__(self):
        """Number of steps."""
        return len(self.end)

    @property
    def from_empty(self):
        """Steps (n,) that start in the empty tank."""
        return self.start == EMPTY

    def sum_rows(self, values, rows=True):
        """Sum (n,) of values (rows,) by step; rows (rows,): those that count."""
        rows = (self.step >= 0) & rows
        return np.bincount(self.step[rows], values[rows], minlength=len(self))

    def differences(self, carried=None):
        """Return the sparse T (n, d) of V(h_k) - q_k V(h_k-1); carried (n,) is q, None: 1."""
        rows, filled = np.arange(len(self)), ~self.from_empty
        q = np.ones(len(self)) if carried is None else carried
        values = np.append(np.ones(len(self)), -q[filled])
        places = np.append(rows, rows[filled]), np.append(self.end, self.start[filled])
        return csr_array((values, places), shape=(len(self), len(self.dip_row)))


def fill_of(metering):
    """Return the `Fill` of metered rows.

    Parameters
    ----------
    metering : object
        Object with run, meter, dip_m, used, as in `methods.liquid.readings.Metering`. The rows of a
        run are consecutive and the first row is its start; a blank dip there denotes the empty
        tank. The dip of an unused row is ignored, but its volume entered the tank.
    """
    runs = tuple(dict.fromkeys(metering.run))
    dips, steps = [], []
    for number, run in enumerate(runs):
        start_dip, rows = None, []
        for place in (i for i, name in enumerate(metering.run) if name == run):
            is_first = start_dip is None and not rows
            if not is_first or metering.volume_m3[place]:
                rows.append(place)
            # A row without a valid dip extends the current step: its volume is added to the next
            # valid dip.
            is_valid = metering.used[place] and np.isfinite(metering.dip_m[place])
            if is_first and metering.used[place] and not is_valid:
                start_dip, rows = EMPTY, []
            elif is_valid:
                if start_dip is not None:
                    steps.append((start_dip, len(dips), number, rows))
                start_dip, rows = len(dips), []
                dips.append(place)
    step = np.full(len(metering.run), -1)
    for number, (_, _, _, rows) in enumerate(steps):
        step[rows] = number
    start, end, run = np.array([step[:3] for step in steps], dtype=int).reshape(-1, 3).T
    meters = tuple(dict.fromkeys(metering.meter))
    return Fill(runs, meters, np.array(dips, dtype=int), start, end, run, step)


@dataclass(frozen=True)
class ReducedSteps:
    """Steps at the temperature of the table, compared with a geometry; m3, (n,) each.

    Attributes
    ----------
    indicated_m3 : ndarray
        Indication of the meter.
    by_factor_m3, by_meter_temperature_m3, by_shell_m3, by_tank_temperature_m3 : ndarray
        Corrections: factor of the meter; cooling or warming of the liquid on its way into the tank;
        shell at the temperature of the table; expansion or contraction of the previous content.
    increment_m3 : ndarray
        Sum of indication and corrections: volume between the dips by liquid, under its load.
    geometry_m3 : ndarray
        Volume between the dips by the geometry.
    misclosure_m3 : ndarray
        Increment less geometry.
    metered_m3 : ndarray
        f v m / c: part of the increment that is proportional to the meter factor.
    carried : ndarray
        q, factor on the volume before the step.
    by_row_m3 : ndarray, shape (rows,)
        `metered_m3` for each row of the metering; 0 for rows without a step.
    """

    indicated_m3: np.ndarray
    by_factor_m3: np.ndarray
    by_meter_temperature_m3: np.ndarray
    by_shell_m3: np.ndarray
    by_tank_temperature_m3: np.ndarray
    increment_m3: np.ndarray
    geometry_m3: np.ndarray
    misclosure_m3: np.ndarray
    metered_m3: np.ndarray
    carried: np.ndarray
    by_row_m3: np.ndarray


def reduce_steps(metering, fill, volume_m3, growth=None):
    """Return the `ReducedSteps` steps of metered rows.

    Parameters
    ----------
    metering : object
        As for `fill_of`, also with volume_m3, meter_c, tank_c, meters, expansion_per_k, density_c.
    fill : Fill
    volume_m3 : array_like, shape (d,)
        Volumes of the geometry below each dip, loaded by the liquid at the dip, m3.
    growth : array_like, shape (d,), optional
        Factor on the volume below each dip due to the temperature of the shell; None: 1.
    """
    volume = np.asarray(volume_m3, dtype=float)
    shell_factors = np.ones(len(volume)) if growth is None else np.asarray(growth, dtype=float)
    factor = np.array([metering.meters[name].factor for name in metering.meter])
    indicated = np.where(fill.step >= 0, metering.volume_m3, 0.0)
    tank = metering.tank_c[fill.dip_row]
    end_of_row = fill.end[fill.step]  # of rows without a step: any, as their volume is 0
    meter_to_tank = density_ratio(metering, metering.meter_c, tank[end_of_row])
    # Apply the corrections in turn, so that their sum is exactly the increment.
    at_meter = factor * indicated
    in_tank = at_meter * meter_to_tank
    shell = shell_factors[fill.end]
    previous = np.where(fill.from_empty, 0.0, volume[fill.start])
    # q of the module docstring; there is no previous content at a start from empty.
    carried = density_ratio(metering, tank[fill.start], tank[fill.end])
    carried = np.where(fill.from_empty, 1.0, carried * shell_factors[fill.start] / shell)
    by_tank = (carried - 1) * previous
    by_row = in_tank / shell_factors[end_of_row]
    geometry = volume[fill.end] - previous
    metered = fill.sum_rows(by_row)
    increment = metered + by_tank
    return ReducedSteps(
        indicated_m3=fill.sum_rows(indicated),
        by_factor_m3=fill.sum_rows(at_meter - indicated),
        by_meter_temperature_m3=fill.sum_rows(in_tank - at_meter),
        by_shell_m3=fill.sum_rows(by_row - in_tank),
        by_tank_temperature_m3=by_tank,
        increment_m3=increment,
        geometry_m3=geometry,
        misclosure_m3=increment - geometry,
        metered_m3=metered,
        carried=carried,
        by_row_m3=by_row,
    )


def density_ratio(metering, warm_c, cold_c):
    """Return rho(warm) / rho(cold) of the liquid.

    Parameters
    ----------
    metering : object
        Object with expansion_per_k and density_c.
    warm_c, cold_c : ndarray
        Temperatures, degC; nan: unknown.

    Returns
    -------
    ndarray
        1 if either temperature is unknown.
    """
    relative = [1 - metering.expansion_per_k * (t - metering.density_c) for t in (warm_c, cold_c)]
    ratio = relative[0] / relative[1]
    return np.where(np.isfinite(ratio), ratio, 1.0)


def load_densities(metering, fill):
    """Return the density (d,) of the liquid at each dip, kg/m3.

    If the temperature is unknown, it is the declared density.
    """
    warm = metering.tank_c[fill.dip_row] - metering.density_c
    share = metering.expansion_per_k * np.where(np.isfinite(warm), warm, 0.0)
    return metering.density_kg_m3 * (1 - share)


def with_expansion(metering, expansion_per_k):
    """Return the rows with another expansion coefficient of the liquid."""
    return replace(metering, expansion_per_k=expansion_per_k)


@dataclass(frozen=True)
class ReadingEffects:
    """Causes in the readings of n steps between d dips.

    Attributes
    ----------
    noise : tuple of Effect
        Errors of single readings: "meter_repeatability" (n columns), "dip_readings" (d),
        "liquid_temperatures".
    common : tuple of Effect
        Errors of many readings: "meter_factor" (one for each meter), "dip_zero",
        "liquid_expansion".
    run_m3 : ndarray, shape (n, runs)
        Change of the misclosures for a relative run effect of one.
    """

    noise: tuple[Effect, ...]
    common: tuple[Effect, ...]
    run_m3: np.ndarray


def reading_effects(metering, fill, reduced, volume_m3, area_m2, growth=None):
    """Return the `ReadingEffects` of metered rows.

    Parameters
    ----------
    metering, fill, reduced
        Arguments and result of `reduce_steps`.
    volume_m3, area_m2 : ndarray, shape (d,)
        Volume below each dip, and free surface at each dip.
    growth : optional
        As for `reduce_steps`.

    Returns
    -------
    ReadingEffects
        Without effects of size zero.
    """
    dips = fill.differences(reduced.carried) @ diags_array(np.asarray(area_m2))
    by_degree = _temperature_columns(metering, fill, reduced, volume_m3)
    noise = [
        Effect("meter_repeatability", diags_array(-batch_sd_m3(metering, fill)).tocsr()),
        Effect("dip_readings", dips @ diags_array(metering.s_dip_m[fill.dip_row])),
        Effect("liquid_temperatures", metering.u_temperature_c * by_degree),
    ]
    meter_names = np.array(metering.meter)
    columns = [
        fill.sum_rows(reduced.by_row_m3, meter_names == name) * metering.meters[name].u_factor
        for name in fill.meters
    ]
    common = [
        Effect("meter_factor", -np.stack(columns, axis=1)),
        Effect("dip_zero", metering.u_dip_zero_m * dips.sum(axis=1)[:, None]),
        Effect("liquid_expansion", _expansion_columns(metering, fill, volume_m3, growth)),
    ]
    run_m3 = -reduced.metered_m3[:, None] * (fill.run[:, None] == np.arange(len(fill.runs)))
    return ReadingEffects(tuple(_nonzero_effects(noise)), tuple(_nonzero_effects(common)), run_m3)


def batch_sd_m3(metering, fill):
    """Return the standard deviation (n,) of the metered volume of each step, m3.

    It refers to the temperature of the table. A step at rest has none, since the meter was not
    started.
    """
    meters = [metering.meters[name] for name in metering.meter]
    relative = np.array([flow_meter.repeatability for flow_meter in meters])
    fixed = np.array([flow_meter.fixed_m3 for flow_meter in meters])
    by_meter = np.hypot(relative * metering.volume_m3, fixed)
    row_sd = np.where(np.isfinite(metering.s_volume_m3), metering.s_volume_m3, by_meter)
    return np.sqrt(fill.sum_rows(row_sd**2, metering.volume_m3 != 0))


def _temperature_columns(metering, fill, reduced, volume_m3):
    """Return the change (n, temperatures) of the misclosures per degree of each reading."""
    b, volume, end, start = metering.expansion_per_k, volume_m3, fill.end, fill.start
    tank, steps = metering.tank_c[fill.dip_row], len(fill)
    has_step = np.flatnonzero(fill.step >= 0)
    step = fill.step[has_step]
    is_known = np.isfinite(metering.meter_c[has_step]) & np.isfinite(tank[end[step]])
    by_row = b * np.where(is_known, reduced.by_row_m3[has_step], 0.0)
    previous = np.where(fill.from_empty, 0.0, reduced.carried * volume[start])
    both_known = np.isfinite(tank[end]) & np.isfinite(tank[start]) & ~fill.from_empty
    previous = b * np.where(both_known, previous, 0.0)
    # A warmer tank at the end of a step: less volume arrived, and the previous content expanded.
    at_end = -(np.bincount(step, by_row, minlength=steps) + previous)
    lines, columns = np.arange(steps), len(has_step)
    values = [by_row, at_end, previous[both_known]]
    rows = [step, lines, lines[both_known]]
    places = [np.arange(columns), columns + end, columns + start[both_known]]
    where = np.concatenate(rows), np.concatenate(places)
    return csr_array((np.concatenate(values), where), shape=(steps, columns + len(volume)))


def _expansion_columns(metering, fill, volume_m3, growth):
    """Return the change (n, 1) of the misclosures for the standard uncertainty of the expansion."""
    b, u = metering.expansion_per_k, metering.u_expansion_per_k
    if not u:
        return np.zeros((len(fill), 1))
    step = EXPANSION_STEP * (b or u)
    # Central difference; the step is relative, or that of u for an expansion of zero.
    changed = [
        reduce_steps(with_expansion(metering, b + sign * step), fill, volume_m3, growth)
        for sign in (1, -1)
    ]
    slope = (changed[1].misclosure_m3 - changed[0].misclosure_m3) / (2 * step)
    return u * slope[:, None]


def _nonzero_effects(effects):
    """Return the effects that have any non-zero column."""
    return [effect for effect in effects if abs(effect.columns).max() > 0]


def as_fahrenheit(metering):
    """Return the rows with temperatures interpreted as degrees Fahrenheit."""
    converted = {name: (getattr(metering, name) - 32) / 1.8 for name in ("meter_c", "tank_c")}
    return replace(metering, **converted)


def swapped(metering):
    """Return the rows with exchanged temperatures of meter and tank."""
    return replace(metering, meter_c=metering.tank_c, tank_c=metering.meter_c)


__all__ = [
    "Alternative",
    "Effect",
    "Fill",
    "LiquidAdjustment",
    "ReadingEffects",
    "ReducedSteps",
    "RunEffect",
    "Verdict",
    "adjust_steps",
    "estimate_run_effect",
    "fill_of",
    "name_causes",
    "reading_effects",
    "reduce_steps",
]
