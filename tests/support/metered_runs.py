"""Runs of metered liquid into true tanks, by mass, with faults that may be planted.

    job = metered_job("horizontal", folder, runs=2)
    filled = fill(rng, job, true_volume, top_m, Fault("meter", 0.001))

The truth is physical: what the meter passes is weighed, the level is where the true volumes of the
tank, warm as it is, hold that mass.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from job_builder import write_folder
from metered_tanks import HEADINGS, metered_parts, metered_rows

import tankcal
from tankcal.tank.solids import LyingTank, Sphere

NOMINAL = {  # volumes of the tanks of `metered_parts`, 0 for a blank dip
    "vertical": lambda dips: np.pi / 4 * 13.0**2 * np.nan_to_num(dips),
    "horizontal": lambda dips: LyingTank(2.4, 2.4, 9.0).volume_m3(np.nan_to_num(dips)),
    "sphere": lambda dips: Sphere(10.0).volume_m3(np.nan_to_num(dips)),
}


@dataclass
class Fault:
    """What is wrong: kind as of `Alternative`, its size, and which row or step."""

    kind: str = ""
    size: float = 0.0
    place: int = 0


def metered_job(kind, folder, *, dips, runs=2, registers=None, rest_h=12.0, **settings):
    """A job of one of `metered_tanks.KINDS` whose runs all have the same dips; volumes are blank.

    dips    of a run, None first: from empty; a dip twice: at rest between
    rest_h  hours between two such dips, h
    """
    parts = metered_parts(kind, **settings)
    nominal = NOMINAL[kind]
    rows = []
    for run in range(runs):
        rows += metered_rows(
            dips, np.round(np.diff(nominal(np.array(dips, dtype=float))), 3), f"run {run + 1}"
        )
    start = np.datetime64("2026-05-04T06:00")
    rows[0][8] = str(start)
    for before, row in pairwise(rows):
        is_rest = row[0] == before[0] and row[2] == 0
        minutes = round(60 * rest_h) if is_rest else 30
        row[8] = str(np.datetime64(before[8]) + np.timedelta64(minutes, "m"))
        row[9] = "rest" if is_rest else None
    parts.tables["liquid"] = [list(HEADINGS), *rows]
    parts.registers["meters"]["M"] |= {"factor_after": None} | (registers or {})
    meter = parts.registers["meters"]["M"]
    parts.registers["meters"]["M"] = {key: one for key, one in meter.items() if one is not None}
    write_folder(folder, parts)
    return tankcal.load(folder)


def fill(rng, job, volume_of, top_m, fault=None, *, meter_c=26.0, tank_c=20.0):
    """The job with its runs as they would have been read.

    volume_of  function of levels, of the true tank at the table's temperature
    """
    fault, metering = fault or Fault(), job.liquid
    levels = np.linspace(0.0, top_m, 4001)
    inside = volume_of(levels)
    sd_run = metering.run_sd or 0.0
    volume, dip = metering.volume_m3.copy(), metering.dip_m.copy()
    meter_t, tank_t = np.full(len(dip), np.nan), np.full(len(dip), np.nan)
    aimed = np.interp(np.nan_to_num(dip), levels, inside)
    meter = metering.meters[metering.meter[0]]
    factor = (
        meter.factor
        * (1 + meter.u_factor * rng.normal())
        * (1 + fault.size * (fault.kind == "meter"))
    )

    def density(t):
        return metering.density_kg_m3 * (1 - metering.expansion_per_k * (t - metering.density_c))

    hours = np.array(metering.time, dtype="datetime64[s]").astype(float) / 3600
    zero = metering.u_dip_zero_m * rng.normal() + fault.size * (fault.kind == "dip_zero")
    for rows in metering.runs.values():
        effect, mass = sd_run * rng.normal(), 0.0
        for number, row in enumerate(rows):
            warm_in, warm = meter_c + 2 * rng.normal(), tank_c + 0.5 * rng.normal()
            if number:
                sd = np.hypot(meter.repeatability * volume[row], meter.fixed_m3 * bool(volume[row]))
                shown = max(aimed[row] - aimed[rows[number - 1]], 0.01) * bool(volume[row])
                if fault.kind == "batch" and row == fault.place:
                    mass += density(warm_in) * shown * factor
                volume[row] = round(shown / factor, 4)
                through = factor * (1 + effect) * volume[row] + sd * rng.normal()
                mass += density(warm_in) * through
                if fault.kind == "leak":
                    mass -= density(warm) * fault.size * (hours[row] - hours[rows[number - 1]])
            elif np.isfinite(dip[row]):
                mass = density(warm) * aimed[row]
            else:
                continue
            level = np.interp(mass / density(warm), inside, levels)
            error = metering.s_dip_m[row] * rng.normal() + zero
            error += fault.size * (fault.kind == "dip" and row == fault.place)
            dip[row] = level + error
            read = metering.u_temperature_c * rng.normal(size=2)
            meter_t[row], tank_t[row] = warm_in + read[0], warm + read[1]
    if fault.kind == "fahrenheit":
        meter_t, tank_t = 1.8 * meter_t + 32, 1.8 * tank_t + 32
    if fault.kind == "swapped":
        meter_t, tank_t = tank_t, meter_t
    shell_c = np.full(len(dip), np.nan)
    filled = replace(
        metering, volume_m3=volume, dip_m=dip, meter_c=meter_t, tank_c=tank_t, shell_c=shell_c
    )
    return replace(job, liquid=filled)
