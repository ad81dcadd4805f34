"""Make the readings of this example: a made-up tank whose rings are not the model's.

Rings taper, are oval, and do not stand on one axis; the tape errs. What is true stands in
truth.json: capacity and volumes at 20 degrees, by polygons of the true sections.

    python examples/rings/simulate.py
"""

import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
RINGS, LENGTH, PLATE, PAINT = 5, 1.8, 0.008, 0.00025
INNER, OUTER = 1.192, 1.200  # inside radii
TILT, DIP_FROM_A, END_DEPTH = 0.008, 0.9, 0.45
SHELL_C, EXPANSION, TAPE_EXPANSION = 29.0, 1.1e-5, 1.15e-5
TAPE_THICKNESS, WEIGHT, PULL, SPAN = 0.0002, 0.1, 50.0, 1.2
TURN = (np.arange(1440) + 0.5) * 2 * np.pi / 1440  # from the bottom

rng = np.random.default_rng(12917)
base = np.where(np.arange(RINGS) % 2, INNER, OUTER) + rng.normal(0, 0.0008, RINGS)
taper = rng.normal(0, 0.0006, RINGS)  # of the radius, at the end of a ring
flat = 0.0015 + rng.normal(0, 0.0005, RINGS)  # by its own weight
waves = rng.normal(0, 1, (RINGS, 5)) * 0.0012 / np.arange(2, 7) ** 1.5
lift = rng.normal(0, 0.0006, RINGS)  # of the axes
tape_scale, tape_c = rng.normal(0, 8e-6), SHELL_C


def section(s):
    """Inside radii at TURN, 20 degrees, and the height of the centre."""
    ring = min(int(s // LENGTH), RINGS - 1)
    zeta = 2 * (s - ring * LENGTH) / LENGTH - 1
    radius = base[ring] + taper[ring] * zeta - flat[ring] * np.cos(2 * TURN)
    radius = radius + sum(waves[ring, k - 2] * np.cos(k * TURN + k) for k in range(2, 7))
    return radius, lift[ring]


def area_below(radius, level):
    """Area of a section below a level, its centre at 0."""
    x, y = radius * np.sin(TURN), np.minimum(-radius * np.cos(TURN), level)
    return 0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def volume(dip):
    """Below a plumb dip; ends are ellipsoids on the section that they touch."""
    radius, up = section(DIP_FROM_A)
    zero = up - np.interp(0.0, TURN - 2 * np.pi * (np.pi < TURN), radius, period=2 * np.pi)
    cos, whole = 1 / np.hypot(1, TILT), 0.0
    nodes, weights = np.polynomial.legendre.leggauss(24)
    for ring in range(RINGS):
        for node, weight in zip(nodes, weights, strict=True):
            s = LENGTH * (ring + (node + 1) / 2)
            own, up = section(s)
            level = zero + dip / cos - TILT * (s - DIP_FROM_A) - up
            whole += weight * LENGTH / 2 * area_below(own, level)
    for place, way in ((0.0, -1), (RINGS * LENGTH - 1e-9, 1)):
        own, up = section(place)
        for node, weight in zip(nodes, weights, strict=True):
            x = (node + 1) / 2
            share = np.sqrt(1 - x**2)
            s = place + way * END_DEPTH * x
            level = zero + dip / cos - TILT * (s - DIP_FROM_A) - up
            whole += weight * END_DEPTH / 2 * area_below(share * own, level)
    return whole


def reading(s):
    """Of the tape, at SHELL_C."""
    warm = 1 + EXPANSION * (SHELL_C - 20)
    radius = (section(s)[0] + PLATE + PAINT) * warm
    x, y = radius * np.sin(TURN), radius * np.cos(TURN)
    round_m = np.sum(np.hypot(np.diff(x, append=x[0]), np.diff(y, append=y[0])))
    round_m *= (TURN[1] - TURN[0]) / 2 / np.sin((TURN[1] - TURN[0]) / 2)
    sag = WEIGHT**2 * SPAN**3 / (24 * PULL**2)
    length = round_m + np.pi * TAPE_THICKNESS + sag
    stretch = (1 + TAPE_EXPANSION * (tape_c - 20)) * (1 + tape_scale)
    return length / stretch + rng.normal(0, 0.0005)


def main():
    rows = ["circumference,ring,from_a_m,reading_m,s_mm"]
    sags = ["circumference,kind,count,span_m"]
    for ring in range(RINGS):
        for share in (20, 80):
            s = LENGTH * (ring + share / 100)
            sags.append(f"{ring + 1}-{share},sag,1,{SPAN:g}")
            for _ in range(2 if ring == 0 else 1):
                rows.append(f"{ring + 1}-{share},{ring + 1},{s:.2f},{reading(s):.4f},0.5")
    (HERE / "circumferences.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (HERE / "obstructions.csv").write_text("\n".join(sags) + "\n", encoding="utf-8")
    dips = [0.0, 0.3, 1.2, 2.1, 2.35]
    truth = {"dips_m": dips, "volumes_m3": [round(volume(dip), 6) for dip in dips],
             "capacity_m3": round(volume(3.0), 6)}  # fmt: skip
    (HERE / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
