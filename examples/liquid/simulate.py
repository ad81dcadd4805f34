"""A strapped tank of six courses that is filled through a meter: a simulated calibration.

The wall is out of round and its radii are not those of the drawing; the bottom plates are uneven
and yield a little. Water has the density of Kell's formula, each batch is a mass, and the level is
found where the loaded, warm tank holds that mass. What a crew cannot know (tape, meter, runs,
dips) is drawn, seeded, from what the job declares. Run it to write the tables and truth.json
again:

    python simulate.py
"""

import csv
import json
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

HERE = Path(__file__).parent
SEED = 16
COURSE_M, PLATES_MM, PAINT_MM = 1.6, (9.0, 8.0, 7.0, 6.0, 6.0, 6.0), 0.25
OUT_MM = (1.6, -0.9, 2.3, -1.4, 0.8, -2.1)  # inside radii beyond 6.5 m at 20 degrees, empty
NOMINAL_M = 6.5
WAVES_MM = {2: (2.4, 0.4), 3: (1.6, 2.1), 5: (0.7, 4.0)}  # size and phase by waves round the wall
UNEVEN_M3, UNEVEN_BELOW_M = 0.17, 0.12  # what the bottom plates take, and up to which dip
FLEX_M3_PER_M = 0.012  # what the bottom yields for each metre of head
E_PA, EXPANSION, GRAVITY = 206e9, 1.1e-5, 9.80665
TAPE = {"correction": 20e-6, "u_scale": 60e-6, "expansion": 1.15e-5, "thickness_m": 0.0002}
STRAPPED_C, STRAP_SD_M = 27.0, 0.0004
METER, U_METER, REPEATS, FIXED_M3 = 1.0004, 2e-4, 1e-4, 0.002
RUN_SD, DIP_SD_M, ZERO_SD_M = 8e-5, 0.0004, 0.0003
RUNS = {  # first dip (None: empty and dry), and the dips that the valve was shut at
    "1": (None, (0.30, *np.arange(0.40, 2.05, 0.10))),
    "2": (0.32, np.arange(0.52, 2.05, 0.20)),
}
TABLE_KG_M3, TABLE_C = 850.0, 20.0
ANGLES = np.arange(720) * np.pi / 360


def water(celsius):
    """Density of water, kg/m3: Kell 1975, with air, 5 to 40 degrees to 0.01 kg/m3."""
    t = celsius
    above = (999.83952 + t * (16.945176 + t * (-7.9870401e-3 + t * (-46.170461e-6
             + t * (105.56302e-9 - 280.54253e-12 * t)))))  # fmt: skip
    return above / (1 + 16.879850e-3 * t)


def outline(course):
    """Inside radii round the wall of a course at 20 degrees, empty."""
    radius = np.full(len(ANGLES), NOMINAL_M + OUT_MM[course] / 1000)
    for k, (size, phase) in WAVES_MM.items():
        radius += size / 1000 * np.cos(k * ANGLES - phase)
    return radius


def area(course):
    return float(np.pi * np.mean(outline(course) ** 2))


def circumference(course):
    """Outside, over the paint, at 20 degrees."""
    radius = outline(course) + (PLATES_MM[course] + PAINT_MM) / 1000
    slope = np.gradient(np.concatenate([radius[-3:], radius, radius[:3]]))[3:-3] / (np.pi / 360)
    return float(2 * np.pi * np.mean(np.hypot(radius, slope)))


def held(dip, celsius, density):
    """What the tank holds below a dip, m3, warm and loaded by that liquid."""
    warm = 1 + 2 * EXPANSION * (celsius - TABLE_C)
    total, below = 0.0, 0.0
    for course, plate in enumerate(PLATES_MM):
        top = min(dip, below + COURSE_M)
        if top <= below:
            break
        empty, height = area(course), top - below
        head = height * (dip - (below + top) / 2)  # integral of what stands above each place
        strain = density * GRAVITY * NOMINAL_M / (E_PA * plate / 1000)
        total += empty * warm * (height + 2 * strain * head)
        below = top
    covered = min(dip / UNEVEN_BELOW_M, 1.0)
    return total - UNEVEN_M3 * covered * (2 - covered) + FLEX_M3_PER_M * dip


def level_of(mass, celsius, shell_c):
    density = water(celsius)
    return brentq(lambda dip: density * held(dip, shell_c, density) - mass, 1e-6, 9.6, xtol=1e-12)


def fill(rng, factor, zero):
    """Rows of liquid.csv, and the true error of each run."""
    rows, errors = [], {}
    for number, (run, (first, stops)) in enumerate(RUNS.items()):
        errors[run] = g = RUN_SD * rng.normal()
        minute, mass = 7 * 60 + 30, 0.0
        celsius, shell_c = 17.6 + 0.3 * number, 18.4 + 0.5 * number
        start = [run, "M-3", 0.0, "", "", "", "", "", _time(number, minute)]
        if first is not None:
            mass = water(celsius) * held(first, shell_c, water(celsius))
            start[3] = round(first + zero + DIP_SD_M * rng.normal(), 4)
            start[5:7] = [round(celsius, 2), round(shell_c, 1)]
        rows.append(start)
        for stop in stops:
            metered_c = 18.3 + 0.5 * np.sin(stop) + 0.2 * number
            celsius += 0.06 * (metered_c - celsius) + 0.01
            shell_c += 0.05
            density = water(celsius)
            wanted = density * held(float(stop), shell_c, density) - mass
            shown = round(wanted / water(metered_c) / (factor * (1 + g)), 1)  # the valve is shut
            noise = np.hypot(REPEATS * shown, FIXED_M3) * rng.normal()
            mass += water(metered_c) * (factor * (1 + g) * shown + noise)
            dip = level_of(mass, celsius, shell_c) + zero + DIP_SD_M * rng.normal()
            minute += 12 + round(shown)
            rows.append([run, "M-3", shown, round(dip, 4), round(metered_c, 2), round(celsius, 2),
                         round(shell_c, 1), round(60 + rng.uniform(-3, 3)),
                         _time(number, minute)])  # fmt: skip
    return rows, errors


def _time(day, minute):
    return f"2026-05-{5 + day:02d}T{minute // 60:02d}:{minute % 60:02d}"


def strap(rng):
    """Rows of circumferences.csv, and the true scale of the tape."""
    scale = TAPE["correction"] + TAPE["u_scale"] * rng.normal()
    rows = []
    for course in range(len(PLATES_MM)):
        true = circumference(course) * (1 + EXPANSION * (STRAPPED_C - TABLE_C))
        true += np.pi * TAPE["thickness_m"]
        for part in (20, 80):
            reading = true / (1 + scale) / (1 + TAPE["expansion"] * (STRAPPED_C - TABLE_C))
            level = round(COURSE_M * (course + part / 100), 2)
            rows.append(
                [
                    f"{course + 1}-{part}",
                    str(course + 1),
                    level,
                    round(reading + STRAP_SD_M * rng.normal(), 4),
                    1000 * STRAP_SD_M,
                ]
            )
    return rows, scale


def write(name, headings, rows):
    with open(HERE / name, "w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([headings, *rows])


def main():
    rng = np.random.default_rng(SEED)
    factor, zero = METER * (1 + U_METER * rng.normal()), ZERO_SD_M * rng.normal()
    straps, scale = strap(rng)
    rows, errors = fill(rng, factor, zero)
    write("circumferences.csv", ["circumference", "course", "level_m", "reading_m", "s_mm"], straps)
    write("courses.csv", ["course", "height_m", "thickness_mm", "paint_mm"],
          [[k + 1, COURSE_M, plate, PAINT_MM] for k, plate in enumerate(PLATES_MM)])  # fmt: skip
    headings = ["run", "meter", "volume_m3", "dip_m", "meter_temperature_c", "tank_temperature_c"]
    write("liquid.csv", [*headings, "shell_temperature_c", "flow_m3_h", "time"], rows)
    heights = [0.3, 1.0, 2.0, 4.0, 6.0, 8.0, 9.6]
    truth = {
        "meter_factor": factor,
        "dip_zero_m": zero,
        "run_errors": errors,
        "tape_scale": scale,
        "bottom_takes_m3": UNEVEN_M3,
        "bottom_flex_m3_per_m": FLEX_M3_PER_M,
        "inside_area_m2": [area(course) for course in range(len(PLATES_MM))],
        "table": {"celsius": TABLE_C, "density_kg_m3": TABLE_KG_M3, "dip_m": heights,
                  "volume_m3": [held(h, TABLE_C, TABLE_KG_M3) for h in heights]},
    }  # fmt: skip
    text = json.dumps(truth, indent=1, default=float)
    (HERE / "truth.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
