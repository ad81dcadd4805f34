"""Jobs of lying tanks whose rings were strapped, with readings of known radii.

parts = ringed_parts()                       the three rings of the specification
parts = ringed_parts(radii_m=(1.2, 1.2))     inside; lap, plates and readings to suit
"""

import numpy as np
from job_builder import SETTINGS, Parts

PLATE_MM, TAPE_MM = 8.0, 0.2
TAPE = {
    "kind": "tape",
    "certificate": "T 5/2026",
    "thickness_mm": TAPE_MM,
    "u_scale_ppm": 10.0,
    "laying_mm": 0.3,
    "certified_temperature_c": 20.0,
    "expansion_per_k": 1.15e-5,
    "tension_n": 50.0,
    "weight_n_per_m": 0.1,
}


def reading_of(radius_m, plate_mm=PLATE_MM):
    """What the tape shows on a round ring, m."""
    return float(2 * np.pi * (radius_m + plate_mm / 1000) + np.pi * TAPE_MM / 1000)


def ringed_parts(radii_m=(1.200, 1.192, 1.200), length_m=3.0, laps=None, **settings):
    """Parts of a job; settings with dots for "__", None: left out."""
    count = len(radii_m)
    given = {
        **SETTINGS,
        "tank.id": "R-3",
        "tank.kind": "horizontal",
        "tank.nominal_diameter_m": None,
        "tank.nominal_height_m": None,
        "datum.bottom_z_m": None,
        "survey.side": "outside",
        "survey.shell_temperature_c": 20.0,
        "table.reference_temperature_c": 20.0,
        "table.step_m": 0.1,
        "table.liquid_density_kg_m3": None,
        "horizontal.length_m": count * length_m,
        "horizontal.end_a": "flat",
        "horizontal.end_b": "flat",
        "horizontal.tilt_mm_per_m": 10.0,
        "horizontal.dip_from_a_m": 1.5,
        "shell.shape_sd_mm": 0.0,
    } | {key.replace("__", "."): value for key, value in settings.items()}
    rings = [["ring", "length_m", "thickness_mm", *(["lap"] if laps else [])]]
    straps = [["circumference", "ring", "from_a_m", "reading_m", "s_mm"]]
    for i, radius in enumerate(radii_m):
        name = str(i + 1)
        rings.append([name, length_m, PLATE_MM, *([laps[i]] if laps else [])])
        for letter, share in zip("ab", (0.2, 0.8), strict=True):
            place = round((i + share) * length_m, 6)
            straps.append([f"{name}{letter}", name, place, reading_of(radius), 0.5])
    return Parts(
        {key: value for key, value in given.items() if value is not None},
        {"rings": rings, "circumferences": straps},
        registers={"instruments": {"T-5": dict(TAPE)}},
    )
