"""Two tables of tank S-1 (five courses, strapped), by closed forms of their own.

The former one: radii 0.5 mm smaller, for 15 C, without head, its zero 2 mm lower.

Rings of radius r and plate t below a dip h, K = g r^2 / (E t): pi times the integral of
(r + K rho (h - z))^2 over z.
"""

import numpy as np

from tankcal.products.recalibration.former import FormerTable

# readings of both straps; what butt straps and an obstruction add, mm; plate, mm; height, m
COURSES = (
    (45.3184, 45.3176, 3.0, 3.0, 9, 1.8),
    (45.3094, 45.3101, 0.0, 2.3, 8, 1.8),
    (45.3042, 45.3036, 0.0, 0.0, 7, 1.8),
    (45.2981, 45.2989, 0.0, 0.0, 6, 1.5),
    (45.2963, 45.2957, 0.0, 0.0, 6, 1.5),
)
HEIGHTS = np.array([one[5] for one in COURSES])
PLATES = np.array([one[4] for one in COURSES]) / 1000
EXPANSION = 1.1e-5
TAPE = (1 + 35e-6) * (1 + 11 * 1.15e-5) * (1 + 19.4175e-6)  # certificate, 31 C, tension
GIRTHS = np.array(
    [[TAPE * one[k] - 0.62832e-3 - one[2 + k] / 1000 for k in (0, 1)] for one in COURSES]
)  # less the tape's thickness
RADII = (GIRTHS.mean(axis=1) / 2 / np.pi - 0.00025 - PLATES) * (1 + EXPANSION * (20 - 31))
EDGES = np.concatenate([[0.0], np.cumsum(HEIGHTS)])


def rings_m3(
    dips, radii, density=0.0, *, plates=PLATES, edges=EDGES, modulus=206e9, is_first_order=False
):
    """(rows,) volume below each dip, the head of a liquid included."""
    dips = np.atleast_1d(np.asarray(dips, dtype=float))[:, None]
    soft = 9.80665 * radii**2 / (modulus * plates) * density
    low = np.minimum(edges[:-1], dips)
    high = np.minimum(edges[1:], dips)
    below, above = dips - low, dips - high
    cubes = radii * soft * (below**2 - above**2) + soft**2 * (below**3 - above**3) / 3 * (
        not is_first_order
    )
    return np.pi * (radii**2 * (high - low) + cubes).sum(axis=1)


def new_s1(dips=None, radii=RADII, **more):
    """S-1 as it is now: at 20 C, with head for 850 kg/m3."""
    dips = np.round(np.arange(0.10, 8.395, 0.01), 3) if dips is None else dips
    volumes = rings_m3(dips, radii, 850.0, is_first_order=True)
    given = {
        "reference_temperature_c": 20.0, "liquid_density_kg_m3": 850.0, "kind": "vertical",
        "reference_height_m": 9.118, "U_m3": 0.0006 * volumes, "laboratory": "Laboratory B",
        "number": "B-3", "date": "2026-03-02",
    }  # fmt: skip
    return FormerTable("new.csv", dips, volumes, **(given | more))


def former_s1(dips=None, digit=0.0, **more):
    """The former table: radii 0.5 mm smaller, for 15 C, without head, its zero 2 mm lower."""
    dips = np.round(np.arange(0.10, 8.405, 0.01), 3) if dips is None else dips
    volumes = rings_m3(dips - 0.002, RADII - 0.0005) / (1 + 5 * EXPANSION) ** 2
    if digit:
        volumes = np.round(volumes / digit) * digit
    given = {
        "volume_quantum_m3": digit, "reference_temperature_c": 15.0, "liquid_density_kg_m3": 0.0,
        "reference_height_m": 9.120, "U_m3": 0.001 * volumes, "laboratory": "Laboratory A",
        "number": "A-17", "date": "2014-05-20", "method": "strapping", "common": 0.5,
        "kind": "vertical",
    }  # fmt: skip
    return FormerTable("former.csv", dips, volumes, **(given | more))
