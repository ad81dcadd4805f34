"""Simulated survey by adjusted points of the wall, with a common scale and offset error."""

import numpy as np

from tankcal.intercomparison.site import finish, observe_site
from tankcal.units import FULL_TURN

U_SCALE, U_OFFSET_M = 15e-6, 3e-4  # standard uncertainties of scale and offset
FRAME_M = (512.0, 347.0, 21.0)  # foot of the axis in the coordinate system of the survey
PARTS = {2: (0.2, 0.8), 3: (0.15, 0.5, 0.85)}  # levels as shares of a course, by number of rings
SPOILT, FAR_M = 0.005, (0.015, 0.04)  # share and size of gross errors
PIPE_POINTS, PIPE_M = 4, (0.07, 0.12)  # number of points on a fitting, and distance from the wall


def observe_points(tank, chance, asked):
    """Simulate rings of points in each course, from inside or outside.

    Parameters
    ----------
    tank : Tank
        The true tank.
    chance : Chance
        Random errors.
    asked : Asked
        Requested conditions of the capacity table.

    Returns
    -------
    Parts
    """
    rng = chance.rng
    site = observe_site(tank, chance, asked, outside=rng.uniform() < 0.5, frame_m=FRAME_M)
    azimuth, z, names = _layout(rng, tank)
    sd = rng.uniform(0.7e-3, 1.5e-3)
    scale, offset = chance.normal(U_SCALE), chance.normal(U_OFFSET_M)
    offsets = np.full(len(z), float(offset))
    spoilt = chance.blunders(len(z), SPOILT)
    offsets[spoilt] += rng.choice([-1, 1], len(spoilt)) * rng.uniform(*FAR_M, len(spoilt))
    if chance.size:
        pipe = rng.integers(len(z), size=PIPE_POINTS)
        offsets[pipe] = (1 if site.outside else -1) * rng.uniform(*PIPE_M, PIPE_POINTS)
    observed = site.places(azimuth, z, offsets)
    observed = (
        site.frame_m + (1 + scale) * (observed - site.frame_m) + chance.normal(sd, observed.shape)
    )
    declared_sd = chance.declared(1000 * sd)
    rows = [["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"]]
    rows += [
        [name, *np.round(point, 5).tolist(), declared_sd, declared_sd, declared_sd]
        for name, point in zip(names, observed, strict=True)
    ]
    site.parts.tables["points"] = rows
    site.add_input("scale", 1e6 * U_SCALE, "ppm", "certificate of the instrument")
    site.add_input("offset", 1000 * U_OFFSET_M, "mm", "reflectorless ranging, certificate")
    return finish(site)


def _layout(rng, tank):
    """Azimuths, heights and names of rings of nearly equally spaced points."""
    count, rings = int(rng.choice([24, 32, 40])), int(rng.choice([2, 3]))
    azimuth, z, names = [], [], []
    for course, (low, high) in enumerate(zip(tank.joints_m[:-1], tank.joints_m[1:], strict=True)):
        for ring, part in enumerate(PARTS[rings]):
            turn = FULL_TURN * (np.arange(count) + rng.uniform() + 0.2 * rng.uniform(-1, 1, count))
            azimuth.append(turn / count)
            z.append(low + (high - low) * (part + 0.03 * rng.uniform(-1, 1, count)))
            names += [f"C{course + 1}R{ring + 1}P{k + 1}" for k in range(count)]
    return np.concatenate(azimuth), np.concatenate(z), names
