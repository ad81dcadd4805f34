"""Water metered in, twice, from the empty tank to near its top."""

import datetime

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


def observe_liquid(tank, chance, asked):
    """Two runs by one meter; the courses are those of the drawing, their radii unknown."""
    rng = chance.rng
    site = observe_site(tank, chance, asked, outside=False)
    del site.parts.tables["bottom"]  # the first batch tells what lies below the first dip
    factor = FACTOR * (1 + chance.normal(U_FACTOR))
    zero = chance.normal(DIP_ZERO_SD_M)
    rho0 = DENSITY_KG_M3 + chance.normal(U_DENSITY)
    expansion = EXPANSION_PER_K + chance.normal(U_EXPANSION)
    said_dip = chance.declared(1000 * DIP_SD_M)

    def density(celsius):
        return rho0 * (1 - expansion * (celsius - DENSITY_C))

    rows = [["run", "meter", "volume_m3", "dip_m", "meter_temperature_c", "tank_temperature_c",
             "shell_temperature_c", "flow_m3_h", "time"]]  # fmt: skip
    clock = datetime.datetime(2026, 5, 4, 7, 0)
    for run, step in enumerate(STEPS_M, 1):
        g, before, through = chance.normal(RUN_SD), 0.0, 0.0
        rows.append([str(run), "M-1", 0.0, "", "", "", "", "", clock.isoformat("T", "minutes")])
        warm = 17.0 + rng.uniform(0, 2)
        for dip in dips_of(tank, step):
            meter_c, warm = warm + rng.normal(0.3, 0.2), warm + rng.normal(0.02, 0.02)
            shell_c = warm + rng.normal(0.4, 0.1)
            mass = held_kg(tank, dip, density(warm), shell_c)
            shown = (mass - before) / density(meter_c) / (factor * (1 + g))
            noise = chance.normal(np.hypot(REPEATS * shown, FIXED_M3))
            read = round(float(shown + noise), BATCH_DIGITS)
            before = mass
            clock += datetime.timedelta(minutes=15 + round(60 * shown / FLOW_M3_H))
            seen = round(float(dip + zero + chance.normal(DIP_SD_M)), 5)
            felt = np.array([meter_c, warm, shell_c]) + chance.normal(U_TEMPERATURE_K, 3)
            flow = round(float(FLOW_M3_H * rng.uniform(0.95, 1.05)), 1)
            rows.append([str(run), "M-1", read, seen, *np.round(felt, 2 + 4 * (not chance.size)).tolist(),
                         flow, clock.isoformat("T", "minutes")])  # fmt: skip
        clock += datetime.timedelta(days=2)
    parts = site.parts
    parts.tables["liquid"] = rows
    parts.registers["meters"] = {
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
    parts.settings |= {
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


def dips_of(tank, step_m):
    """Dips of a run, from the first that covers the bottom."""
    first = max(tank.lowest_level_m - tank.plate_z_m + 0.05, 0.3)
    first = np.ceil(20 * first) / 20
    top = tank.height_m - tank.plate_z_m - LAST_M
    return np.round(np.arange(first, top, step_m), 3)


def held_kg(tank, dip, density, shell_c):
    """Mass of liquid below a dip, the tank warm and loaded by it."""
    return float(density * tank.volumes_m3(dip, density, celsius=shell_c)[0])
