"""Water metered in, twice, from the empty tank to near its top."""

import datetime
from dataclasses import dataclass

import numpy as np

from tankcal.intercomparison.site import finish, observe_site

STEPS_M, LAST_M = (0.25, 0.5), 0.05  # between the dips of the two runs; below the top
DENSITY_KG_M3, DENSITY_C, EXPANSION_PER_K = 998.6, 18.0, 1.86e-4
U_DENSITY, U_EXPANSION, U_TEMPERATURE_K = 0.05, 1e-5, 0.1
FACTOR, U_FACTOR, REPEATS, FIXED_M3, RUN_SD = 1.0004, 1.5e-4, 8e-5, 2e-3, 8e-5
DIP_SD_M, DIP_ZERO_SD_M = 5e-4, 3e-4
U_RADIUS_M = 0.02
FLOW_M3_H = 80.0
BATCH_DIGITS = 4


HEADINGS = [
    *("run", "meter", "volume_m3", "dip_m"),
    *("meter_temperature_c", "tank_temperature_c", "shell_temperature_c"),
    *("flow_m3_h", "time"),
]


def observe_liquid(tank, chance, asked):
    """Two runs by one meter; the courses are those of the drawing, their radii unknown."""
    site = observe_site(tank, chance, asked, outside=False)
    del site.parts.tables["bottom"]  # the first batch tells what lies below the first dip
    factor, zero = FACTOR * (1 + chance.normal(U_FACTOR)), chance.normal(DIP_ZERO_SD_M)
    water = Water(
        DENSITY_KG_M3 + chance.normal(U_DENSITY), EXPANSION_PER_K + chance.normal(U_EXPANSION)
    )
    said_dip = chance.declared(1000 * DIP_SD_M)
    rows, clock = [HEADINGS], datetime.datetime(2026, 5, 4, 7, 0)
    for run, step in enumerate(STEPS_M, 1):
        rows.append([str(run), "M-1", 0.0, "", "", "", "", "", clock.isoformat("T", "minutes")])
        clock = _fill(site, rows, clock, str(run), dips_of(tank, step), water, factor, zero)
        clock += datetime.timedelta(days=2)
    site.parts.tables["liquid"] = rows
    site.parts.registers["meters"] = {
        "M-1": {
            "factor": FACTOR,
            "u_factor_ppm": 2e6 * U_FACTOR,
            "k": 2,
            "repeatability_ppm": 1e6 * REPEATS,
            "fixed_l": 1000 * FIXED_M3,
            "flow_min_m3_h": 30,
            "flow_max_m3_h": 120,
            "certificate": "simulated",
        }
    }
    site.parts.settings |= {
        "liquid.density_kg_m3": DENSITY_KG_M3,
        "liquid.density_temperature_c": DENSITY_C,
        "liquid.expansion_per_k": EXPANSION_PER_K,
        "liquid.u_density_kg_m3": U_DENSITY,
        "liquid.u_expansion_per_k": U_EXPANSION,
        "liquid.u_temperature_c": U_TEMPERATURE_K,
        "liquid.s_dip_mm": said_dip,
        "liquid.u_dip_zero_mm": 1000 * DIP_ZERO_SD_M,
        "liquid.run_ppm": 1e6 * RUN_SD,
        "liquid.u_radius_mm": 1000 * U_RADIUS_M,
    }
    return finish(site)


@dataclass(frozen=True)
class Water:
    """The true liquid."""

    density_kg_m3: float
    expansion_per_k: float

    def at(self, celsius):
        """Its density at a temperature."""
        return self.density_kg_m3 * (1 - self.expansion_per_k * (celsius - DENSITY_C))


def _fill(site, rows, clock, run, dips, water, factor, zero):
    """Add the rows of one run; the clock when it ends."""
    tank, chance, rng = site.tank, site.chance, site.chance.rng
    of_run, before = chance.normal(RUN_SD), 0.0
    warm = 17.0 + rng.uniform(0, 2)
    for dip in dips:
        meter_c, warm = warm + rng.normal(0.3, 0.2), warm + rng.normal(0.02, 0.02)
        shell_c = warm + rng.normal(0.4, 0.1)
        mass = held_kg(tank, dip, water.at(warm), shell_c)
        shown = (mass - before) / water.at(meter_c) / (factor * (1 + of_run))
        read = shown + chance.normal(np.hypot(REPEATS * shown, FIXED_M3))
        before = mass
        clock += datetime.timedelta(minutes=15 + round(60 * shown / FLOW_M3_H))
        seen = dip + zero + chance.normal(DIP_SD_M)
        felt = np.array([meter_c, warm, shell_c]) + chance.normal(U_TEMPERATURE_K, 3)
        felt = np.round(felt, 2 if chance.size else 6)
        flow = FLOW_M3_H * rng.uniform(0.95, 1.05)
        rows.append(
            [run, "M-1", round(float(read), BATCH_DIGITS), round(float(seen), 5), *felt.tolist(),
             round(float(flow), 1), clock.isoformat("T", "minutes")]
        )  # fmt: skip
    return clock


def dips_of(tank, step_m):
    """Dips of a run, from the first that covers the bottom."""
    first = max(tank.lowest_level_m - tank.plate_z_m + 0.05, 0.3)
    first = np.ceil(20 * first) / 20
    top = tank.height_m - tank.plate_z_m - LAST_M
    return np.round(np.arange(first, top, step_m), 3)


def held_kg(tank, dip, density, shell_c):
    """Mass of liquid below a dip, the tank warm and loaded by it."""
    return float(density * tank.volumes_m3(dip, density, celsius=shell_c)[0])
