"""Random jobs of tanks as they are built: none of them may be told anything as implausible.

    for parts in plausible_jobs(200): write_folder(folder, parts)

Plates follow the one-foot method of API 650, t = 4.9 D (h - 0.3) G / S + CA, or a minimum.
"""

import datetime

import numpy as np
from job_builder import job_parts

SERVICES = {  # reference, shell on the survey day, degC
    "ambient": ((15, 30), (-15, 48)),
    "heated": ((60, 200), (10, 200)),
    "refrigerated": ((-165, -33), (-165, 30)),
}
METALS = {  # expansion, modulus, design stress MPa, thinnest plate mm
    "carbon_steel": ((1.1e-5, 1.25e-5), (200, 212), (137, 260), 5.0),
    "stainless_steel": ((1.55e-5, 1.75e-5), (193, 200), (130, 180), 2.0),
    "aluminium": ((2.3e-5, 2.4e-5), (69, 72), (60, 90), 5.0),
}
THINGS = [
    *(("coil", -1), ("serpentina de aquecimento", -1), ("columna central", -1), ("pipe 4 in", -1)),
    *(("manhole 1", 1), ("boca de visita", 1), ("sump", 1), ("door sheet", 1), ("thing", -1)),
]
FORMS = {"ellipsoidal": (0.16, 0.3), "conical": (0.05, 0.25), "spherical": (0.07, 0.2)}


def plausible_jobs(count, seed=20):
    """Parts of `count` jobs, kind after kind."""
    rng = np.random.default_rng(seed)
    makers = (_vertical, _vertical, _lying, _sphere)
    for number in range(count):
        yield makers[number % len(makers)](rng)


def _common(rng, kind):
    service = rng.choice([*SERVICES], p=[0.7, 0.15, 0.15])
    metal = rng.choice([*METALS], p=[0.7, 0.2, 0.1])
    expansion, modulus, stress, least = METALS[metal]
    day = datetime.date(1965, 1, 1) + datetime.timedelta(days=int(rng.integers(0, 21_000)))
    settings = {
        "survey.date": day.isoformat(),
        "survey.shell_temperature_c": float(np.round(rng.uniform(*SERVICES[service][1]), 1)),
        "table.reference_temperature_c": float(np.round(rng.uniform(*SERVICES[service][0]), 1)),
        "material.expansion_per_k": float(rng.uniform(*expansion)),
        "checks.shell": str(metal),
        "checks.service": str(service),
    }
    if metal == "carbon_steel" and rng.random() < 0.5:  # what is blank is that
        del settings["checks.shell"]
    if service == "ambient":
        shell = settings["survey.shell_temperature_c"]
        settings["checks.air_temperature_c"] = float(np.clip(shell - rng.uniform(-5, 20), -40, 45))
        del settings["checks.service"]
    if kind == "vertical":
        settings["material.e_gpa"] = float(rng.uniform(*modulus))
    return settings, rng.uniform(*stress), least


def _vertical(rng):
    settings, stress, least = _common(rng, "vertical")
    diameter = float(np.round(np.exp(rng.uniform(np.log(2), np.log(95))), 2))
    count = int(np.clip(np.round(diameter * rng.uniform(0.3, 1.2) / 2), 1, 10))
    heights = np.round(rng.uniform(1.2, 2.6, count) if rng.random() < 0.3 else
                       np.full(count, rng.uniform(1.4, 2.6)), 3)  # fmt: skip
    density = 480.0 if settings.get("checks.service") == "refrigerated" else 850.0
    if rng.random() < 0.5:
        settings["table.liquid_density_kg_m3"] = density
    head = np.cumsum(heights[::-1])[::-1]
    least += 0.05 * diameter if diameter > 6 else 0.0
    plates = 4.903 * diameter * np.maximum(head - 0.3, 0) * density / 1000 / stress
    plates = np.ceil(2 * np.maximum(plates + rng.uniform(0, 3), least)) / 2
    plates = np.minimum(np.maximum.accumulate(plates[::-1])[::-1], 100.0)
    outside = rng.random() < 0.5
    bottom_z = float(np.round(rng.uniform(-50, 800), 3))
    height = float(np.round(heights.sum(), 3))
    settings |= {
        "tank.nominal_diameter_m": diameter,
        "survey.side": "outside" if outside else "inside",
        "datum.bottom_z_m": bottom_z,
        "checks.top_z_m": float(bottom_z + height + rng.normal(0, 0.005)),
        "datum.reference_height_m": height + float(rng.uniform(0.1, 1.0 + 0.12 * diameter)),
    }
    if rng.random() < 0.6:
        settings["datum.dip_plate_z_m"] = bottom_z + float(rng.uniform(-0.05, 0.15))
    if rng.random() < 0.5:
        slope = rng.choice([1 / 120, 1 / 60, -1 / 100, -1 / 50, -1 / 15])
        settings["bottom.form"] = "cone"
        settings["bottom.centre_z_m"] = bottom_z + float(slope * diameter / 2)
        settings["checks.bottom_slopes"] = "up" if slope > 0 else "down"
    place = float(rng.choice([0.2, 0.5, 0.8]))

    rings = 1 if place != 0.5 else 2
    parts = job_parts(
        radius=(diameter + rng.normal(0, 0.0008 * diameter)) / 2,
        courses=[float(one) for one in heights],
        rings=rings,
        thickness_mm=[float(one) for one in plates],
        paint_mm=0.3 if outside else None,
        noise_mm=2.0,
        seed=int(rng.integers(1e6)),
        settings=settings,
        deadwood=_things(rng, height, np.pi / 4 * diameter**2),
    )
    if rings == 1:
        _move_rings(parts, heights, place)
    return parts


def _move_rings(parts, heights, place):
    """From the middles of the courses to a fifth of their height, below or above."""
    for row in parts.tables["points"][1:]:
        course = int(row[0].split("R")[0][1:]) - 1
        row[3] += (place - 0.5) * float(heights[course])


def _lying(rng):
    settings, _, _ = _common(rng, "horizontal")
    diameter = float(np.round(rng.uniform(1.0, 6.0), 3))
    length = float(np.round(diameter * rng.uniform(1, 11), 3))
    settings |= {
        "tank.nominal_diameter_m": float(np.round(diameter, 2)),
        "checks.length_m": float(np.round(length, 2)),
        "horizontal.diameter_m": diameter,
        "horizontal.length_m": length,
        "datum.reference_height_m": diameter + float(rng.uniform(0.05, 3.0)),
    }
    form = rng.choice([*FORMS, "flat", "torispherical"])
    dish, knuckle = float(rng.choice([0.8, 1.0])), float(rng.choice([0.06, 0.15]))
    for end in "ab":
        settings[f"horizontal.end_{end}"] = str(form)
        if form == "torispherical":
            settings[f"horizontal.end_{end}_dish_radius_m"] = diameter * dish
            settings[f"horizontal.end_{end}_knuckle_radius_m"] = diameter * knuckle
    if form in FORMS:
        depth = float(diameter * rng.uniform(*FORMS[form]))
        for end in "ab":
            settings[f"horizontal.end_{end}_depth_m"] = depth + float(rng.normal(0, 0.005))
    if rng.random() < 0.5:
        settings["survey.side"] = "outside"
        settings["horizontal.thickness_mm"] = float(
            rng.choice([3 + 1.5 * diameter, 5 + diameter, 6.0 * diameter + 4])
        )
    if rng.random() < 0.5:
        settings["datum.dip_plate_z_m"] = float(rng.uniform(0, 0.02))
    return job_parts(kind="horizontal", settings=settings, deadwood=_things(rng, diameter, 5.0))


def _sphere(rng):
    settings, _, _ = _common(rng, "sphere")
    diameter = float(np.round(rng.uniform(4, 32), 3))
    settings |= {
        "tank.nominal_diameter_m": float(np.round(diameter, 1)),
        "sphere.diameter_m": diameter,
        "datum.reference_height_m": diameter + float(rng.uniform(0.1, 2.0)),
    }
    if rng.random() < 0.5:
        settings["survey.side"] = "outside"
        settings["sphere.thickness_mm"] = float(4 + diameter * rng.uniform(0.7, 2.5))
    return job_parts(kind="sphere", settings=settings, deadwood=_things(rng, diameter, 5.0))


def _things(rng, height, area):
    if rng.random() < 0.5:
        return ()
    name, sign = THINGS[int(rng.integers(len(THINGS)))]
    low, high = np.sort(rng.uniform(0.1, 0.8, 2)) * height
    volume = sign * rng.uniform(0.002, 0.03) * area * (high - low + 0.01)
    return [(name, float(low), float(high), float(volume))]
