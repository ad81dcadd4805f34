"""Uncertainty of the readings of a filling: each cause as columns of the misclosures.

The column of a cause is the change of the misclosures for one standard deviation, as true value
less assumed value. If a factor is larger than declared, the true increment is larger, and the
misclosure (metered less geometry) is smaller.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.tank.liquid.adjustment import Effect
from tankcal.tank.liquid.reduction import reduce_steps, with_expansion

EXPANSION_STEP = 1e-3  # relative step of the expansion, in which misclosures are nearly linear


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
    dips = fill.differences(reduced.carried) * np.asarray(area_m2)
    noise = [
        Effect("meter_repeatability", np.diag(-batch_sd_m3(metering, fill))),
        Effect("dip_readings", dips * metering.s_dip_m[fill.dip_row]),
        Effect(
            "liquid_temperatures",
            metering.u_temperature_c * _temperature_columns(metering, fill, reduced, volume_m3),
        ),
    ]
    meter_names = np.array(metering.meter)
    columns = [
        reduced.by_row_m3[:, meter_names == name].sum(axis=1) * metering.meters[name].u_factor
        for name in fill.meters
    ]
    common = [
        Effect("meter_factor", -np.stack(columns, axis=1)),
        Effect("dip_zero", metering.u_dip_zero_m * dips.sum(axis=1, keepdims=True)),
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
    counted = fill.batches & (metering.volume_m3 != 0)
    return np.sqrt(np.sum(np.where(counted, row_sd, 0.0) ** 2, axis=1))


def _temperature_columns(metering, fill, reduced, volume_m3):
    """Return the change (n, temperatures) of the misclosures per degree of each reading."""
    b, volume, end, start = metering.expansion_per_k, volume_m3, fill.end, fill.start
    tank = metering.tank_c[fill.dip_row]
    is_known = np.isfinite(metering.meter_c) & np.isfinite(tank[end])[:, None]
    by_rows = b * np.where(is_known, reduced.by_row_m3, 0.0)
    previous = np.where(fill.from_empty, 0.0, reduced.carried * volume[start])
    both_known = np.isfinite(tank[end]) & np.isfinite(tank[start]) & ~fill.from_empty
    previous = b * np.where(both_known, previous, 0.0)
    by_dips = np.zeros((len(fill), len(volume)))
    lines = np.arange(len(fill))
    # A warmer tank at the end of a step: less volume arrived, and the previous content expanded.
    by_dips[lines, end] -= by_rows.sum(axis=1) + previous
    by_dips[lines[both_known], start[both_known]] += previous[both_known]
    return np.hstack([by_rows[:, np.any(fill.batches, axis=0)], by_dips])


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
    return [effect for effect in effects if np.any(effect.columns)]


def as_fahrenheit(metering):
    """Return the rows with temperatures interpreted as degrees Fahrenheit."""
    converted = {name: (getattr(metering, name) - 32) / 1.8 for name in ("meter_c", "tank_c")}
    return replace(metering, **converted)


def swapped(metering):
    """Return the rows with exchanged temperatures of meter and tank."""
    return replace(metering, meter_c=metering.tank_c, tank_c=metering.meter_c)
