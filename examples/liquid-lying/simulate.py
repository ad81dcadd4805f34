"""A buried tank that lies askew and is filled through a meter: a simulated calibration.

Diameter, length, slope and dip zero are not those of the drawing. The tank is cut into slices
along its axis; the level is found where they hold what went in. Water has the density of Kell's
formula. Run it to write liquid.csv and truth.json again:

    python simulate.py
"""

import csv
import json
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

HERE = Path(__file__).parent
SEED = 7
RADIUS_M, LENGTH_M, END_M, RISE, DIP_FROM_A_M = 1.2030, 9.014, 0.484, 0.0086, 1.507  # the truth
ZERO_M = -0.0034  # of every dip
METER, U_METER, REPEATS, FIXED_M3 = 0.9992, 2.5e-4, 1e-4, 0.0004
RUN_SD, DIP_SD_M, EXPANSION, TABLE_C = 1e-4, 0.0005, 1.1e-5, 15.0
RUNS = {"1": np.arange(0.10, 2.35, 0.15), "2": np.arange(0.15, 2.30, 0.30)}
SLICES = 4000


def water(celsius):
    """Density of water, kg/m3: Kell 1975, with air, 5 to 40 degrees to 0.01 kg/m3."""
    t = celsius
    above = (999.83952 + t * (16.945176 + t * (-7.9870401e-3 + t * (-46.170461e-6
             + t * (105.56302e-9 - 280.54253e-12 * t)))))  # fmt: skip
    return above / (1 + 16.879850e-3 * t)


def held(dip):
    """What the tank holds below a true dip, m3, at 15 degrees; B lies higher than A."""
    ends = [(-END_M, 0.0), (0.0, LENGTH_M), (LENGTH_M, LENGTH_M + END_M)]
    turn, total = np.arctan(RISE), 0.0
    for low, high in ends:
        middles = low + (np.arange(SLICES) + 0.5) * (high - low) / SLICES
        beyond = np.maximum(np.maximum(-middles, middles - LENGTH_M), 0.0) / END_M
        radius = RADIUS_M * np.sqrt(1 - beyond**2)
        level = (dip - (middles - DIP_FROM_A_M) * np.sin(turn)) / np.cos(turn) - RADIUS_M
        part = np.clip(level / radius, -1.0, 1.0)
        areas = radius**2 * (np.arccos(-part) + part * np.sqrt(1 - part**2))
        total += float(np.sum(areas)) * (high - low) / SLICES
    return total


def fill(rng, factor):
    """Rows of liquid.csv, and the true error of each run."""
    rows, errors = [], {}
    for number, (run, stops) in enumerate(RUNS.items()):
        errors[run] = g = RUN_SD * rng.normal()
        celsius, minute = 14.2 + 0.2 * number, 8 * 60
        first = float(stops[0])
        mass = water(celsius) * held(first) * warm(celsius)
        dip = round(first + ZERO_M + DIP_SD_M * rng.normal(), 4)
        rows.append([run, 0.0, dip, "", round(celsius, 2), round(celsius, 1), "",
                     _time(number, minute)])  # fmt: skip
        for stop in stops[1:]:
            metered_c = 15.1 + 0.3 * number
            celsius += 0.1 * (metered_c - celsius)
            wanted = water(celsius) * held(float(stop)) * warm(celsius) - mass
            shown = round(wanted / water(metered_c) / (factor * (1 + g)), 2)
            noise = np.hypot(REPEATS * shown, FIXED_M3) * rng.normal()
            mass += water(metered_c) * (factor * (1 + g) * shown + noise)
            volume = mass / water(celsius) / warm(celsius)
            true = brentq(lambda h, volume=volume: held(h) - volume, 0.0, 2.41, xtol=1e-9)
            minute += 8 + round(4 * shown)
            rows.append([run, shown, round(true + ZERO_M + DIP_SD_M * rng.normal(), 4),
                         metered_c, round(celsius, 2), round(celsius, 1),
                         round(15 + rng.uniform(-1, 1), 1), _time(number, minute)])  # fmt: skip
    return rows, errors


def warm(celsius):
    """By how much more the tank holds, which has the temperature of its liquid."""
    return 1 + 3 * EXPANSION * (celsius - TABLE_C)


def _time(day, minute):
    return f"2026-06-{9 + day:02d}T{minute // 60:02d}:{minute % 60:02d}"


def main():
    rng = np.random.default_rng(SEED)
    factor = METER * (1 + U_METER * rng.normal())
    rows, errors = fill(rng, factor)
    headings = ["run", "volume_m3", "dip_m", "meter_temperature_c", "tank_temperature_c"]
    headings += ["shell_temperature_c", "flow_m3_h", "time"]
    with open(HERE / "liquid.csv", "w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([headings, *rows])
    dips = [0.15, 0.5, 1.0, 1.5, 2.0, 2.3]
    truth = {
        "meter_factor": factor,
        "run_errors": errors,
        "diameter_m": 2 * RADIUS_M,
        "length_m": LENGTH_M,
        "end_depth_m": END_M,
        "tilt_mm_per_m": 1000 * RISE,
        "dip_from_a_m": DIP_FROM_A_M,
        "dips_read_off_by_m": ZERO_M,
        "table": {
            "celsius": TABLE_C,
            "dip_m": dips,  # true ones; below those of what was read
            "volume_m3": [held(h) for h in dips],
            "volume_at_read_dip_m3": [held(h - ZERO_M) for h in dips],
        },
    }
    text = json.dumps(truth, indent=1, default=float)
    (HERE / "truth.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
