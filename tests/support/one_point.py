"""One unknown point observed from three known ones: every combination of what can be measured."""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from surveyed import known, table

from tankcal.survey.measurements import AdjustmentSettings, Measurements, Setup

KNOWN = {
    "A": np.array([0.0, 0.0, 1.0]),
    "B": np.array([83.0, 11.0, 3.0]),
    "C": np.array([37.0, 71.0, -2.0]),
}
TRUTH = np.array([29.0, 34.0, 7.0])
SECOND = np.pi / 648000


@dataclass(frozen=True)
class Shot:
    """One observation: table, point it is taken at, where its angle counts from, target."""

    table: str
    at: str
    to: str
    origin: str = ""
    horizontal: bool = False

    def __str__(self):
        start = f"{self.at}<{self.origin}," if self.origin else f"{self.at}-"
        return f"{'horizontal ' * self.horizontal}{self.table} {start}{self.to}"

    def value(self, p):
        """What is measured when P stands at p (..., 3)."""
        place = {**KNOWN, "P": p}
        x, y, z = np.moveaxis(place[self.to] - place[self.at], -1, 0)
        if self.table == "distances":
            return np.sqrt(x * x + y * y + (0.0 if self.horizontal else z * z))
        if self.table == "height_differences":
            return z
        if self.table == "zenith_angles":
            return np.arctan2(np.hypot(x, y), z)
        back = 0.0
        if self.origin:
            a, b, _ = np.moveaxis(place[self.origin] - place[self.at], -1, 0)
            back = np.arctan2(a, b)
        return np.arctan2(x, y) - back


NEXT = {"A": "B", "B": "C", "C": "A"}
IN_PLAN = [
    *(Shot("distances", one, "P", horizontal=True) for one in KNOWN),
    *(Shot("azimuths", one, "P") for one in KNOWN),
    *(Shot("azimuths", "P", one) for one in KNOWN),
    *(Shot("horizontal_angles", "P", NEXT[one], one) for one in KNOWN),
    *(Shot("horizontal_angles", one, "P", NEXT[one]) for one in KNOWN),
]
DIRECTIONS = [
    *(Shot("directions", one, "P", NEXT[one]) for one in KNOWN),
    *(Shot("directions", "P", NEXT[one], one) for one in KNOWN),
]
IN_SPACE = [
    *(Shot("distances", one, "P") for one in KNOWN),
    *(Shot("zenith_angles", one, "P") for one in KNOWN),
    *(Shot("zenith_angles", "P", one) for one in KNOWN),
    *(Shot("height_differences", one, "P") for one in KNOWN),
]


def combined(shots, most=4):
    """Every combination of one to `most` of the shots."""
    for count in range(1, most + 1):
        yield from combinations(shots, count)


def measured(shots, sd=0.0, explain=False):
    """Measurements of P by some shots, the three known points fixed (or weighted).

    explain  whether causes are looked for when they cannot be adjusted, as for a user
    """
    groups, setups = {}, {}
    for shot in shots:
        key = shot.table, shot.horizontal
        groups.setdefault(key, []).append(shot)
        if shot.table in ("zenith_angles", "directions"):
            setups.setdefault(shot.at, Setup(shot.at, shot.at))
    tables = [_table(*key, mine) for key, mine in groups.items()]
    return Measurements(
        settings=replace(AdjustmentSettings(), snooping=False, explain=explain),
        control=known(KNOWN, list(KNOWN.values()), sd),
        setups=tuple(setups.values()),
        readings=tuple(tables),
    )


def _table(name, horizontal, shots):
    value = np.array([shot.value(TRUTH) for shot in shots])
    at, to = [shot.at for shot in shots], [shot.to for shot in shots]
    if name == "directions":  # each pair of targets is a set of its own, with any zero
        zero = [shot.value(TRUTH) + 0.4 * i for i, shot in enumerate(shots)]
        sets = tuple(str(i) for i in range(len(shots)))
        both = np.concatenate([[z - v for z, v in zip(zero, value, strict=True)], zero])
        ends = [shot.origin for shot in shots] + to
        return table(
            name, both, SECOND, [None] * 2 * len(at), ends, setup=tuple(at * 2), set=sets * 2
        )
    if name == "zenith_angles":
        return table(name, value, SECOND, [None] * len(at), to, setup=tuple(at))
    if name == "horizontal_angles":
        return table(name, value, SECOND, at, to, origin=tuple(shot.origin for shot in shots))
    sd = SECOND if name == "azimuths" else 1e-3
    more = {"horizontal": np.full(len(at), horizontal)} if name == "distances" else {}
    return table(name, value, sd, at, to, **more)


def misfits(shots, p):
    """(k, shots) how far P at places p (k, 3) is from what was measured, in metres."""
    found = []
    for shot in shots:
        off = shot.value(p) - shot.value(TRUTH)
        if shot.table not in ("distances", "height_differences"):
            off = 50.0 * (off - 2 * np.pi * np.round(off / (2 * np.pi)))
        found.append(off)
    return np.stack(found, axis=-1)


def axes_of(shots):
    """Axes of P that the shots speak of."""
    plan = any(shot.table != "height_differences" for shot in shots)
    flat = all(
        shot.horizontal or shot.table in ("azimuths", "horizontal_angles", "directions")
        for shot in shots
    )
    return [0, 1] * plan + [2] * (not flat)


def determined(shots):
    """Whether nothing near the truth fits the shots as well: full rank of the derivatives."""
    axes, step = axes_of(shots), 1e-4
    moved = TRUTH + step * np.eye(3)[axes]
    jac = (misfits(shots, moved) - misfits(shots, TRUTH - step * np.eye(3)[axes])) / (2 * step)
    if len(shots) < len(axes):
        return False
    return np.linalg.svd(jac, compute_uv=False)[len(axes) - 1] > 1e-6


def elsewhere(shots):
    """Places (k, 3), not the truth, that fit the shots as well: Gauss-Newton from a grid."""
    axes = axes_of(shots)
    grid = np.linspace(-160.0, 160.0, 13)
    parts = [grid if axis in axes else TRUTH[axis : axis + 1] for axis in range(3)]
    if 2 in axes:
        parts[:2] = [part[::2] if len(part) > 1 else part for part in parts[:2]]
        parts[2] = np.linspace(-120.0, 120.0, 7)
    p = np.stack(np.meshgrid(*parts, indexing="ij"), axis=-1).reshape(-1, 3) + 0.123 * np.eye(3)[
        axes
    ].sum(axis=0)
    step = 1e-5
    for _ in range(40):
        off = misfits(shots, p)
        jac = np.stack(
            [(misfits(shots, p + step * np.eye(3)[a]) - misfits(shots, p - step * np.eye(3)[a]))
             / (2 * step) for a in axes], axis=-1)  # fmt: skip
        normal = np.swapaxes(jac, 1, 2) @ jac + 1e-9 * np.eye(len(axes))
        move = -np.linalg.solve(normal, np.swapaxes(jac, 1, 2) @ off[..., None])[..., 0]
        size = np.linalg.norm(move, axis=1, keepdims=True)
        p[:, axes] += move * np.minimum(1.0, 30.0 / np.maximum(size, 1e-12))
    fits = (np.abs(misfits(shots, p)).max(axis=1) < 1e-6) & (np.abs(p).max(axis=1) < 1e4)
    away = np.linalg.norm(p - TRUTH, axis=1) > 0.01
    return p[fits & away]
