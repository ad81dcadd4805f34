"""Hand dips and indications of a radar gauge: simulated, with their truth.

The zero of the gauge is 2 mm too high, and its still pipe leans by 1.2 degrees. The tape is too
short by 0.3 mm at its zero and by 40e-6 of its length, and warmer than its reference temperature.
Dips are read to 1 mm, indications to 0.5 mm. Run it to write readings.csv and truth.json again:

    python simulate.py
"""

import csv
import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEED = 50
LEVELS_M = {"A": 1.25, "B": 3.10, "C": 4.85, "D": 6.40, "E": 7.80}
REPEATS = 3
GAUGE_HEIGHT_M = 9.2  # of the antenna above the dip plate
OFFSET_M, TILT_DEG = 0.002, 1.2  # of the gauge at the antenna, and of its pipe
GAUGE_SD_M, DIP_SD_M = 0.0004, 0.0008  # of the indication at a level, and of a dip
GAUGE_STEP_M, DIP_STEP_M = 0.0005, 0.001
TAPE_ZERO_M, TAPE_SCALE = 0.0003, 40e-6  # to be added to a reading
EXPANSION_PER_K, REFERENCE_C = 1.15e-5, 20.0
TAPE_C = {"A": 24.0, "B": 25.0, "C": 26.5, "D": 27.0, "E": 26.0}


def deviation_m(level_m):
    """True deviation of the gauge from the level above the dip plate."""
    lengthening = 1 / np.cos(np.radians(TILT_DEG)) - 1
    return OFFSET_M - lengthening * (GAUGE_HEIGHT_M - level_m)


def rounded(value, step):
    """Nearest multiple of a step."""
    return round(value / step) * step


def main():
    """Write readings.csv and truth.json."""
    rng = np.random.default_rng(SEED)
    with open(HERE / "readings.csv", "w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["level", "dip_m", "gauge_m", "tape_c"])
        for name, level in LEVELS_M.items():
            shown = level + deviation_m(level) + GAUGE_SD_M * rng.normal()
            factor = 1 + TAPE_SCALE + EXPANSION_PER_K * (TAPE_C[name] - REFERENCE_C)
            for _ in range(REPEATS):
                dip = (level - TAPE_ZERO_M) / factor + DIP_SD_M * rng.normal()
                rows.writerow([
                    name,
                    f"{rounded(dip, DIP_STEP_M):.3f}",
                    f"{rounded(shown, GAUGE_STEP_M):.4f}",
                    f"{TAPE_C[name]:.1f}",
                ])  # fmt: skip
    truth = {
        "seed": SEED,
        "tilt_deg": TILT_DEG,
        "deviation_mm": {
            str(level): round(1000 * float(deviation_m(level)), 3) for level in (0.6, 4.0, 8.0)
        },
    }
    (HERE / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
