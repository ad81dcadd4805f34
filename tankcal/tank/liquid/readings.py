"""What the readings of a filling leave uncertain: each cause as columns of the misclosures.

A cause of one standard deviation adds its column to the misclosures, as the truth less what was
taken: a factor that is larger than declared makes the true increment larger, and the misclosure
(metered less geometry) less.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.tank.liquid.adjustment import Effect
from tankcal.tank.liquid.reduction import reduce_steps, with_expansion

EXPANSION_STEP = 1e-3  # of the expansion: misclosures are all but linear in it


@dataclass(frozen=True)
class ReadingEffects:
    """Causes in the readings of n steps between d dips.

    Attributes
    ----------
    noise : tuple of Effect
        "meter_repeatability" (n columns), "dip_readings" (d), "liquid_temperatures": errors of
        single readings.
    common : tuple of Effect
        "meter_factor" (one for each meter), "dip_zero", "liquid_expansion": errors of many.
    run_m3 : ndarray, shape (n, runs)
        By a run effect of one, relative.
    """

    noise: tuple[Effect, ...]
    common: tuple[Effect, ...]
    run_m3: np.ndarray


def reading_effects(metering, fill, reduced, volume_m3, area_m2, growth=None):
    """`ReadingEffects` of metered rows.

    Parameters
    ----------
    metering, fill, reduced
        As `reduce_steps` was given and gave them.
    volume_m3, area_m2 : ndarray, shape (d,)
        Below, and of the free surface at, each dip.
    growth : optional
        As there.

    Returns
    -------
    ReadingEffects
        Without those that have no size.
    """
    dips = fill.differences(reduced.carried) * np.asarray(area_m2)
    noise = [
        Effect("meter_repeatability", np.diag(-batch_sd_m3(metering, fill))),
        Effect("dip_readings", dips * metering.s_dip_m[fill.dip_row]),
        Effect(
            "liquid_temperatures",
            metering.u_temperature_c * _by_temperatures(metering, fill, reduced, volume_m3),
        ),
    ]
    common = [
        Effect("meter_factor", -_by_factors(metering, fill, reduced)),
        Effect("dip_zero", metering.u_dip_zero_m * dips.sum(axis=1, keepdims=True)),
        Effect("liquid_expansion", _by_expansion(metering, fill, volume_m3, growth)),
    ]
    run_m3 = -reduced.metered_m3[:, None] * (fill.run[:, None] == np.arange(len(fill.runs)))
    return ReadingEffects(tuple(_sized(noise)), tuple(_sized(common)), run_m3)


def batch_sd_m3(metering, fill):
    """(n,) standard deviation of what was metered in each step, at the table's temperature.

    A step at rest has none: the meter was not started.
    """
    meters = [metering.meters[name] for name in metering.meter]
    relative = np.array([one.repeatability for one in meters])
    fixed = np.array([one.fixed_m3 for one in meters])
    by_meter = np.hypot(relative * metering.volume_m3, fixed)
    own = np.where(np.isfinite(metering.s_volume_m3), metering.s_volume_m3, by_meter)
    counted = fill.batches & (metering.volume_m3 != 0)
    return np.sqrt(np.sum(np.where(counted, own, 0.0) ** 2, axis=1))


def _by_factors(metering, fill, reduced):
    """(n, meters) metered volume of each meter times the relative u of its factor."""
    of = np.array(metering.meter)
    columns = [
        reduced.by_row_m3[:, of == name].sum(axis=1) * metering.meters[name].u_factor
        for name in fill.meters
    ]
    return np.stack(columns, axis=1)


def _by_temperatures(metering, fill, reduced, volume_m3):
    """(n, temperatures) by one degree of each temperature that was read."""
    b, volume, end, start = metering.expansion_per_k, volume_m3, fill.end, fill.start
    tank = metering.tank_c[fill.dip_row]
    known = np.isfinite(metering.meter_c) & np.isfinite(tank[end])[:, None]
    of_rows = b * np.where(known, reduced.by_row_m3, 0.0)
    before = np.where(fill.from_empty, 0.0, reduced.carried * volume[start])
    both = np.isfinite(tank[end]) & np.isfinite(tank[start]) & ~fill.from_empty
    before = b * np.where(both, before, 0.0)
    of_dips = np.zeros((len(fill), len(volume)))
    lines = np.arange(len(fill))
    of_dips[lines, end] -= of_rows.sum(axis=1) + before
    of_dips[lines[both], start[both]] += before[both]
    return np.hstack([of_rows[:, np.any(fill.batches, axis=0)], of_dips])


def _by_expansion(metering, fill, volume_m3, growth):
    """(n, 1) by the standard uncertainty of the liquid's expansion."""
    b, u = metering.expansion_per_k, metering.u_expansion_per_k
    if not u:
        return np.zeros((len(fill), 1))
    step = EXPANSION_STEP * (b or u)
    moved = [
        reduce_steps(with_expansion(metering, b + sign * step), fill, volume_m3, growth)
        for sign in (1, -1)
    ]
    slope = (moved[1].misclosure_m3 - moved[0].misclosure_m3) / (2 * step)
    return u * slope[:, None]


def _sized(effects):
    """Those that move something, without columns that do not; a cause keeps all or none."""
    return [one for one in effects if np.any(one.columns)]


def as_fahrenheit(metering):
    """The rows, had their temperatures been written in degrees Fahrenheit."""
    read = {name: (getattr(metering, name) - 32) / 1.8 for name in ("meter_c", "tank_c")}
    return replace(metering, **read)


def swapped(metering):
    """The rows, had temperatures at the meter and in the tank changed places."""
    return replace(metering, meter_c=metering.tank_c, tank_c=metering.meter_c)
