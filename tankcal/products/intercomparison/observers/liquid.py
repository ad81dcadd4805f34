"""Simulated liquid calibration: two runs with metered water, from empty to near the top."""

import datetime
from dataclasses import dataclass

import numpy as np

from tankcal.products.intercomparison.site import finish, observe_site

STEPS_M, LAST_M = (0.25, 0.5), 0.05  # steps of the dips of both runs; last dip below the top
# Water: density at a temperature, and thermal expansion; below, their standard uncertainties.
DENSITY_KG_M3, DENSITY_C, EXPANSION_PER_K = 998.6, 18.0, 1.86e-4
U_DENSITY, U_EXPANSION, U_TEMPERATURE_K = 0.05, 1e-5, 0.1
# Meter: factor, its relative u, repeatability, fixed error of a batch, and deviation of a run.
FACTOR, U_FACTOR, REPEATS, FIXED_M3, RUN_SD = 1.0004, 1.5e-4, 8e-5, 2e-3, 8e-5
DIP_SD_M, DIP_ZERO_SD_M = 5e-4, 3e-4  # standard deviations of a dip, and of the zero of all dips
U_RADIUS_M = 0.02  # declared standard uncertainty of the radii of the drawing
FLOW_M3_H = 80.0  # mean flow rate
BATCH_DIGITS = 4  # decimals of a batch in m3


HEADINGS = [
    *("run", "meter", "volume_m3", "dip_m"),
    *("meter_temperature_c", "tank_temperature_c", "shell_temperature_c"),
    *("flow_m3_h", "time"),
]


def observe_liquid(tank, chance, asked):
    """Simulate two runs with one meter; the radii of the courses are not measured."""
    site = observe_site(tank, chance, asked, outside=False)
    del site.parts.tables["bottom"]  # the first batch measures the volume below the first dip
    factor, zero = FACTOR * (1 + chance.normal(U_FACTOR)), chance.normal(DIP_ZERO_SD_M)
    water = Water(
        DENSITY_KG_M3 + chance.normal(U_DENSITY), EXPANSION_PER_K + chance.normal(U_EXPANSION)
    )
    declared_dip_sd = chance.declared(1000 * DIP_SD_M)
    rows, clock = [HEADINGS], datetime.datetime(2026, 5, 4, 7, 0)
    for run, step in enumerate(STEPS_M, 1):
        rows.append([str(run), "M-1", 0.0, "", "", "", "", "", clock.isoformat("T", "minutes")])
        clock = _fill(site, rows, clock, str(run), list_dips(tank, step), water, factor, zero)
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
        "liquid.s_dip_mm": declared_dip_sd,
        "liquid.u_dip_zero_mm": 1000 * DIP_ZERO_SD_M,
        "liquid.run_ppm": 1e6 * RUN_SD,
        "liquid.u_radius_mm": 1000 * U_RADIUS_M,
    }
    return finish(site)


@dataclass(frozen=True)
class Water:
    """True density and thermal expansion of the liquid."""

    density_kg_m3: float
    expansion_per_k: float

    def at(self, celsius):
        """Density at a temperature, kg/m3."""
        return self.density_kg_m3 * (1 - self.expansion_per_k * (celsius - DENSITY_C))


def _fill(site, rows, clock, run, dips, water, factor, zero):
    """Add the rows of a run, and return the time of its end."""
    tank, chance, rng = site.tank, site.chance, site.chance.rng
    run_error, previous_mass = chance.normal(RUN_SD), 0.0
    warm = 17.0 + rng.uniform(0, 2)
    for dip in dips:
        meter_c, warm = warm + rng.normal(0.3, 0.2), warm + rng.normal(0.02, 0.02)
        shell_c = warm + rng.normal(0.4, 0.1)
        mass = liquid_mass_kg(tank, dip, water.at(warm), shell_c)
        indicated = (mass - previous_mass) / water.at(meter_c) / (factor * (1 + run_error))
        reading = indicated + chance.normal(np.hypot(REPEATS * indicated, FIXED_M3))
        previous_mass = mass
        clock += datetime.timedelta(minutes=15 + round(60 * indicated / FLOW_M3_H))
        observed_dip = dip + zero + chance.normal(DIP_SD_M)
        temperatures = np.array([meter_c, warm, shell_c]) + chance.normal(U_TEMPERATURE_K, 3)
        temperatures = np.round(temperatures, 2 if chance.size else 6)
        flow = FLOW_M3_H * rng.uniform(0.95, 1.05)
        rows.append(
            [run, "M-1", round(float(reading), BATCH_DIGITS),
             round(float(observed_dip), 5), *temperatures.tolist(),
             round(float(flow), 1), clock.isoformat("T", "minutes")]
        )  # fmt: skip
    return clock


def list_dips(tank, step_m):
    """Dips of a run, m; the lowest dip covers the bottom."""
    first = max(tank.lowest_level_m - tank.plate_z_m + 0.05, 0.3)
    first = np.ceil(20 * first) / 20
    top = tank.height_m - tank.plate_z_m - LAST_M
    return np.round(np.arange(first, top, step_m), 3)


def liquid_mass_kg(tank, dip, density, shell_c):
    """Mass of liquid below a dip, kg, in the tank expanded by temperature and liquid head."""
    return float(density * tank.volumes_m3(dip, density, celsius=shell_c)[0])
