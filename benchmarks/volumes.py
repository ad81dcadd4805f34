"""Volumes of lying tanks at 2 500 dips beside fluids, each against a right answer.

    python benchmarks/volumes.py

The right answer with ellipsoidal ends is a closed form, with torispherical ones the integral over
circular slices by Gauss quadrature, made here. fluids takes a dip at a time (`TANK.V_from_h`),
tankcal all of them.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from measured import ROUNDS, Row, digits_of, interleaved, peer_module, tell

from tankcal.tank.heads import End
from tankcal.tank.solids import LyingTank

RADIUS_M, LENGTH_M, DIPS, EVERY = 1.2, 10.0, 2500, 25  # of the dips, that are compared
DEPTH_M = 0.6  # of the ellipsoidal ends
DISH_M, KNUCKLE_M = 2.4, 0.24  # radii of the torispherical ends
NODES, WEIGHTS = np.polynomial.legendre.leggauss(60)
LEAST = 9.0


def segment_m2(radius, level):
    """Area of a circle below a level over its centre."""
    level = np.clip(level, -radius, radius)
    inside = level * np.sqrt(radius**2 - level**2)
    return radius**2 * (np.pi / 2 + np.arcsin(level / radius)) + inside


def ellipsoidal_m3(dip):
    """Closed form: the cylinder, and an ellipsoid of two ends."""
    ends = np.pi * DEPTH_M * dip**2 * (1 - dip / (3 * RADIUS_M))
    return LENGTH_M * segment_m2(RADIUS_M, dip - RADIUS_M) + ends


def torispherical_m3(dip):
    """The cylinder, and two ends sliced across their axis: knuckle, then dish, to the tip."""
    inner = RADIUS_M - KNUCKLE_M  # of the circle of the knuckle's centres
    high = np.sqrt((DISH_M - KNUCKLE_M) ** 2 - inner**2)  # centre of the dish behind the edge
    joint, tip = KNUCKLE_M * high / (DISH_M - KNUCKLE_M), DISH_M - high
    arcs = (
        (0.0, joint, lambda x: inner + np.sqrt(KNUCKLE_M**2 - x**2)),
        (joint, tip, lambda x: np.sqrt(np.maximum(DISH_M**2 - (x + high) ** 2, 1e-300))),
    )
    return LENGTH_M * segment_m2(RADIUS_M, dip - RADIUS_M) + 2 * sum(
        np.array([_sliced(*arc, level) for level in dip - RADIUS_M]) for arc in arcs
    )


def _sliced(low, high, radius_at, level):
    """Volume of an arc's turn below a level, in two pieces where its radius is that of the level.

    x = middle + half sin(angle), so that the roots at the ends of a piece are smooth.
    """
    cut = high
    if radius_at(high) < abs(level) < radius_at(low):
        below, above = low, high
        for _ in range(60):
            cut = (below + above) / 2
            below, above = (cut, above) if radius_at(cut) > abs(level) else (below, cut)
    total = 0.0
    for start, end in ((low, cut), (cut, high)):
        half, angle = (end - start) / 2, np.pi / 2 * NODES
        x = (start + end) / 2 + half * np.sin(angle)
        values = segment_m2(radius_at(x), level)
        total += np.pi / 2 * half * np.sum(WEIGHTS * np.cos(angle) * values)
    return total


CASES = {  # of each form: our end, how fluids calls it, the right answer and what it is
    "ellipsoidal": (
        End("ellipsoidal", DEPTH_M),
        {"a": DEPTH_M},
        ellipsoidal_m3,
        "the closed form",
    ),
    "torispherical": (
        End("torispherical", dish_radius_m=DISH_M, knuckle_radius_m=KNUCKLE_M),
        {"f": DISH_M / (2 * RADIUS_M), "k": KNUCKLE_M / (2 * RADIUS_M)},
        torispherical_m3,
        "an integral by slices",
    ),
}


def main():
    """A row for each form of ends."""
    dips = np.linspace(0, 2 * RADIUS_M, DIPS + 1)[1:]
    for kind, (end, theirs, right, what) in CASES.items():
        name = f"lying tank, {kind} ends"
        tank = LyingTank(2 * RADIUS_M, 2 * RADIUS_M, LENGTH_M, end, end)
        tasks, answers, peer = {"tankcal": lambda tank=tank: tank.volume_m3(dips)}, {}, {}
        if found := peer_module("fluids", name):
            sides = {f"side{s}_{key}": value for s in "AB" for key, value in theirs.items()}
            other = found[0].TANK(D=2 * RADIUS_M, L=LENGTH_M, horizontal=True,
                                  sideA=kind, sideB=kind, **sides)  # fmt: skip
            tasks["fluids"] = lambda other=other: [other.V_from_h(dip) for dip in dips.tolist()]
        truth = right(dips[EVERY - 1 :: EVERY])
        for program, task in tasks.items():
            answers[program] = digits_of(
                np.asarray(task())[EVERY - 1 :: EVERY], truth
            )  # compiles, too
        seconds = interleaved(tasks, ROUNDS)
        if found:
            peer = {"peer": "fluids", "version": found[1], "peer_seconds": seconds["fluids"]}
        tell(Row(name, f"{DIPS} dips", seconds["tankcal"], **peer, answer=what,
                 digits=(answers["tankcal"], answers.get("fluids")), least=LEAST))  # fmt: skip


if __name__ == "__main__":
    main()
