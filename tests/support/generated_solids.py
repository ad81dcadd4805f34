"""Lying tanks and spheres that are no model of the package, and surveys of them.

    shell = make_lying(rng, "dents")
    job = job_of(shell, survey(rng, shell, points=120, noise_m=0.001), folder, given=True)
    shell.volume_below(dips)

A lying shell is r(turn, s): turn about its axis, 0 at the bottom, s along it from A. A sphere is
r(direction). Dips count from the wall itself under the dip's place. True volumes are those of dense
polygons, or of dense directions. The families, with magnitudes as tolerances of EN 12285 and ASME
VIII have them (out of roundness up to 1 % of the diameter, welds that peak), or judgement:

saddles  pressed in over two supports at the horns; wider than high by its own weight between them
flat     a flat strip along the bottom, of 3 to 12 mm, over the whole length or a part of it
dents    2 to 8 dents, 0.2 to 1 m wide, 3 to 25 mm
plates   rings of plate with radii of their own, drawn in at girth welds, peaks at long welds
bent     an axis that sags, a shell round at its ends and oval or bulging between them
petals   (sphere) peaks at meridional welds between two crowns, and at those of the crowns
columns  (sphere) pressed in at the columns about the equator, flattened at its poles
"""

from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

import tankcal
from tankcal.survey.points import Points

LYING = ("saddles", "flat", "dents", "plates", "bent")
SPHERES = ("petals", "columns", "dents")
FULL_TURN = 2 * np.pi
AROUND, ALONG = 1440, 240  # of the polygons whose volumes are the truth


@dataclass
class LyingShell:
    """A lying shell with flat ends: r = radius + sum of departures(turn, s)."""

    radius_m: float
    length_m: float
    dip_from_a_m: float
    tilt: float
    departures: list = field(default_factory=list)

    def radius_at(self, turn, s):
        """Radii at places that broadcast."""
        found = np.full(np.broadcast(turn, s).shape, self.radius_m)
        return found + sum(one(turn, s) for one in self.departures)

    def volume_below(self, dips_m):
        """(rows,) true volumes below dips from the wall under the dip's place."""
        turn = FULL_TURN * np.arange(AROUND + 1) / AROUND
        s = self.length_m * (np.arange(ALONG) + 0.5) / ALONG
        r = self.radius_at(turn[None, :], s[:, None])
        x, z = r * np.sin(turn), -r * np.cos(turn)
        zero = -self.radius_at(np.zeros(1), np.array([self.dip_from_a_m]))[0]
        rise = np.hypot(1.0, self.tilt)
        found = []
        for dip in dips_m:
            level = zero + dip * rise - self.tilt * (s - self.dip_from_a_m)
            found.append(_areas_below(x, z, level[:, None]).sum() * self.length_m / ALONG)
        return np.array(found)

    @property
    def height_m(self):
        """Twice the radius."""
        return 2 * self.radius_m


def _areas_below(x, z, level):
    """(k,) of closed polygons (k, n + 1) below levels (k, 1): integral of x dz where z is below."""
    x0, x1, z0, z1 = x[:, :-1], x[:, 1:], z[:, :-1], z[:, 1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        cut = np.clip((level - z0) / (z1 - z0), 0.0, 1.0)
    cut = np.where(z1 == z0, 0.0, cut)
    rising = z1 > z0
    low, high = np.where(rising, 0.0, cut), np.where(rising, cut, 1.0)
    middle = x0 + (x1 - x0) * (low + high) / 2
    return np.sum(middle * (z1 - z0) * (high - low), axis=1)


@dataclass
class Ball:
    """A sphere: r = radius + sum of departures(direction); directions are (..., 3), z up."""

    radius_m: float
    departures: list = field(default_factory=list)

    def radius_at(self, direction):
        """Radii in directions."""
        return np.full(direction.shape[:-1], self.radius_m) + sum(
            one(direction) for one in self.departures
        )

    @property
    def height_m(self):
        """Twice the radius."""
        return 2 * self.radius_m

    def volume_below(self, dips_m):
        """(rows,) true volumes below dips; of a true sphere the same sum is taken off."""
        count = 500
        up = (np.arange(count) + 0.5) * 2 / count - 1
        turn = FULL_TURN * (np.arange(2 * count) + 0.5) / (2 * count)
        level = np.sqrt(1 - up**2)
        way = np.stack(
            np.broadcast_arrays(
                level[:, None] * np.cos(turn), level[:, None] * np.sin(turn), up[:, None]
            ),
            axis=-1,
        )
        r, solid_angle = self.radius_at(way), 2 * FULL_TURN / (2 * count * count)
        bottom = self.radius_at(np.array([[0.0, 0.0, -1.0]]))[0]
        found = []
        for dip in dips_m:
            plane = dip - bottom
            off = _below(r, up[:, None], plane) - _below(self.radius_m, up[:, None], plane)
            d = np.clip(plane + self.radius_m, 0.0, 2 * self.radius_m)
            found.append(np.pi * d**2 * (3 * self.radius_m - d) / 3 + off.sum() * solid_angle)
        return np.array(found)


def _below(r, up, plane):
    """Volume over solid angle of a cone to radius r below z = plane."""
    with np.errstate(divide="ignore"):
        reach = np.where(up == 0, np.inf, plane / up)
    r = r + 0 * up
    if plane >= 0:
        return np.where(up > 0, np.minimum(r, reach), r) ** 3 / 3
    return np.where(up < 0, np.maximum(r**3 - np.where(up < 0, reach, 0) ** 3, 0.0), 0.0) / 3


# ---- lying shells


def make_lying(rng, family, *, radius_m=None):
    """A `LyingShell` of a family, 0.8 to 2 m in radius where none is given."""
    radius = radius_m or rng.uniform(0.8, 2.0)
    length = radius * rng.uniform(3.0, 8.0)
    tilt = 0.0 if rng.random() < 0.5 else rng.uniform(-0.01, 0.01)
    shell = LyingShell(radius, length, length * rng.uniform(0.2, 0.8), tilt)
    _round_off(rng, shell)
    _MAKERS[family](rng, shell)
    return shell


def _round_off(rng, shell):
    """What every shell has: slow ovality of a millimetre."""
    for k in range(2, 6):
        size, phase = 1e-3 * rng.normal() * 2 / k, rng.uniform(0, FULL_TURN)
        turned = rng.uniform(-1, 1)
        shell.departures.append(
            lambda t, s, k=k, size=size, phase=phase, turned=turned: (
                size * np.cos(k * t - phase - turned * s / shell.length_m)
            )
        )


def _arc(shell, t, at):
    away = t - at
    return shell.radius_m * (away - FULL_TURN * np.round(away / FULL_TURN))


def _saddles(rng, shell):
    flat, L = rng.uniform(1e-3, 4e-3) * shell.radius_m, shell.length_m
    places = L * np.array([0.2, 0.8]) + rng.uniform(-0.05, 0.05, 2) * L
    shell.departures.append(
        lambda t, s: (
            -flat * np.cos(2 * t) * (1 - 0.7 * sum(np.exp(-(((s - p) / 0.8) ** 2)) for p in places))
        )
    )
    for place in places:
        size, horn = rng.uniform(2e-3, 10e-3), np.radians(rng.uniform(55, 75))
        width = rng.uniform(0.2, 0.5)
        for side in (-1, 1):
            shell.departures.append(
                lambda t, s, place=place, size=size, at=side * horn, width=width: (
                    -size * np.exp(-((_arc(shell, t, at) / 0.25) ** 2) - ((s - place) / width) ** 2)
                )
            )


def _flat(rng, shell):
    deep, L = rng.uniform(3e-3, 12e-3), shell.length_m
    begin, end = sorted(rng.uniform(0, 1, 2)) if rng.random() < 0.5 else (-1.0, 2.0)

    def strip(t, s):
        away = np.abs(_arc(shell, t, 0.0)) / shell.radius_m
        plane = (shell.radius_m - deep) / np.cos(np.minimum(away, 1.0))
        there = np.clip((s / L - begin) / 0.05, 0, 1) * np.clip((end - s / L) / 0.05, 0, 1)
        return np.minimum(plane - shell.radius_m, 0.0) * there

    shell.departures.append(strip)


def _dents(rng, shell):
    for _ in range(rng.integers(2, 9)):
        at, place = rng.uniform(0, FULL_TURN), rng.uniform(0, shell.length_m)
        size = rng.choice([-1, -1, -1, 1]) * rng.uniform(3e-3, 25e-3)
        width, long = rng.uniform(0.1, 0.5, 2)

        def dent(t, s, at=at, place=place, size=size, width=width, long=long):
            away = np.hypot(_arc(shell, t, at) / width, (s - place) / long)
            return size * np.cos(np.pi / 2 * np.minimum(away, 1)) ** 2

        shell.departures.append(dent)


def _plates(rng, shell):
    rings = max(2, round(shell.length_m / rng.uniform(1.5, 2.5)))
    edges = np.linspace(0, shell.length_m, rings + 1)
    own = rng.normal(0, 1.5e-3, rings)
    girth, flank = -rng.uniform(1e-3, 5e-3), rng.uniform(0.05, 0.2)
    peak, wide = rng.choice([-1, 1]) * rng.uniform(2e-3, 10e-3), rng.uniform(0.05, 0.2)
    turns = rng.uniform(0, FULL_TURN, rings)

    def plates(t, s):
        ring = np.clip(np.searchsorted(edges, s, side="right") - 1, 0, rings - 1)
        joint = np.min(np.abs(s[..., None] - edges[1:-1]), axis=-1, initial=np.inf)
        weld = peak * np.exp(-np.abs(_arc(shell, t, turns[ring])) / wide)
        return own[ring] + girth * np.exp(-joint / flank) + weld

    shell.departures.append(plates)


def _bent(rng, shell):
    L = shell.length_m
    sag, belly = rng.normal(0, 5e-3), rng.uniform(-4e-3, 4e-3)
    oval, phase = rng.uniform(1e-3, 6e-3) * shell.radius_m, rng.normal(0, 0.3)

    def bent(t, s):
        middle = np.sin(np.pi * np.clip(s / L, 0, 1))
        return middle * (sag * np.cos(t) + belly - oval * np.cos(2 * t - phase))

    shell.departures.append(bent)


_MAKERS = {
    "saddles": _saddles,
    "flat": _flat,
    "dents": _dents,
    "plates": _plates,
    "bent": _bent,
}


# ---- spheres


def make_sphere(rng, family, *, radius_m=None):
    """A `Ball` of a family, 2 to 10 m in radius where none is given."""
    ball = Ball(radius_m or np.exp(rng.uniform(*np.log([2.0, 10.0]))))
    for degree in (2, 3, 4):
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        size = rng.normal() * 4e-4 * ball.radius_m / degree
        ball.departures.append(
            lambda d, way=way, size=size, degree=degree: (
                size * np.polynomial.legendre.legval(d @ way, np.eye(5)[degree])
            )
        )
    _OF_BALLS[family](rng, ball)
    return ball


def _petals(rng, ball):
    count = rng.integers(6, 15)
    crown = np.cos(np.radians(rng.uniform(30, 45)))
    peak, wide = rng.choice([-1, 1]) * rng.uniform(2e-3, 8e-3), rng.uniform(0.1, 0.4)
    girth, phase = rng.choice([-1, 1]) * rng.uniform(1e-3, 6e-3), rng.uniform(0, FULL_TURN)

    def petals(d):
        turn = np.arctan2(d[..., 1], d[..., 0]) - phase
        away = turn * count / FULL_TURN
        level = np.sqrt(np.maximum(1 - d[..., 2] ** 2, 0))
        arc = np.abs(away - np.round(away)) * FULL_TURN / count * ball.radius_m * level
        long = peak * np.exp(-arc / wide) * (np.abs(d[..., 2]) < crown)
        polar = np.arccos(np.clip(np.abs(d[..., 2]), 0, 1)) - np.arccos(crown)
        return long + girth * np.exp(-np.abs(polar) * ball.radius_m / wide)

    ball.departures.append(petals)


def _columns(rng, ball):
    count, phase = rng.integers(6, 13), rng.uniform(0, FULL_TURN)
    turns = phase + FULL_TURN * np.arange(count) / count
    size, wide = rng.uniform(2e-3, 12e-3), 0.15 * ball.radius_m
    flat = rng.uniform(0, 1e-3) * ball.radius_m

    def columns(d):
        found = -flat * (1.5 * d[..., 2] ** 2 - 0.5)
        for turn in turns:
            cosine = d[..., 0] * np.cos(turn) + d[..., 1] * np.sin(turn)
            arc = ball.radius_m * np.arccos(np.clip(cosine, -1, 1))
            found = found - size * np.exp(-((arc / wide) ** 2))
        return found

    ball.departures.append(columns)


def _dents_of_ball(rng, ball):
    for _ in range(rng.integers(3, 10)):
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        size, wide = rng.choice([-1, -1, 1]) * rng.uniform(5e-3, 25e-3), rng.uniform(0.3, 1.5)

        def dent(d, way=way, size=size, wide=wide):
            arc = ball.radius_m * np.arccos(np.clip(d @ way, -1, 1))
            return size * np.cos(np.pi / 2 * np.minimum(arc / wide, 1)) ** 2

        ball.departures.append(dent)


_OF_BALLS = {"petals": _petals, "columns": _columns, "dents": _dents_of_ball}


# ---- surveys


def survey_lying(rng, shell, *, points, noise_m, layout):
    """(n, 3) points: "even" rings, "free" anywhere, a "gap" of 40 to 120 deg, or the "middle" only.

    The axis runs to the azimuth of `AZIMUTH`.
    """
    L = shell.length_m
    if layout == "even":
        rings = max(3, int(rng.integers(4, 9)))
        each = max(8, points // rings)
        s = np.repeat(L * (np.arange(rings) + 0.5) / rings, each)
        turn = np.tile(FULL_TURN * np.arange(each) / each, rings) + rng.uniform(0, FULL_TURN)
    else:
        part = (0.2, 0.8) if layout == "middle" else (0.02, 0.98)
        s, turn = L * rng.uniform(*part, points), rng.uniform(0, FULL_TURN, points)
        if layout == "gap":
            wide, at = np.radians(rng.uniform(40, 120)), rng.uniform(0, FULL_TURN)
            turn = at + wide + (FULL_TURN - wide) * turn / FULL_TURN
    r = shell.radius_at(turn, s)
    across, up, along = r * np.sin(turn), -r * np.cos(turn), s
    lean = np.arctan(shell.tilt)
    east = along * np.cos(lean) - up * np.sin(lean)
    height = along * np.sin(lean) + up * np.cos(lean)
    xyz = np.column_stack([east, across, height]) + rng.uniform(-5, 5, 3)
    return xyz + noise_m * rng.normal(size=xyz.shape)


def survey_ball(rng, ball, *, points, noise_m, layout):
    """(n, 3) points: "even" on a spiral, "free", a "gap" sector, or only the "middle" zone."""
    up = rng.uniform(-1, 1, points)
    turn = rng.uniform(0, FULL_TURN, points)
    if layout == "even":
        up = 1 - (2 * np.arange(points) + 1) / points
        turn = np.arange(points) * np.pi * (3 - np.sqrt(5)) + rng.uniform(0, FULL_TURN)
    elif layout == "gap":
        wide = np.radians(rng.uniform(40, 120))
        turn = wide + (FULL_TURN - wide) * turn / FULL_TURN
    elif layout == "middle":
        up = rng.uniform(-0.85, 0.85, points)
    level = np.sqrt(1 - up**2)
    way = np.column_stack([level * np.cos(turn), level * np.sin(turn), up])
    xyz = ball.radius_at(way)[:, None] * way + rng.uniform(-5, 5, 3)
    return xyz + noise_m * rng.normal(size=xyz.shape)


@cache
def _any_job(folder, kind):
    from job_builder import write_job

    rng = np.random.default_rng(1)
    settings = {"survey.side": "inside"}
    if kind == "horizontal":
        rows = survey_lying(rng, LyingShell(1.2, 10.0, 5.0, 0.0), points=60, noise_m=0.001,
                            layout="free")  # fmt: skip
        settings |= {"horizontal.diameter_m": None, "horizontal.azimuth_deg": 90.0}
        settings |= {"horizontal.dip_from_a_m": 5.0}
    else:
        rows = survey_ball(rng, Ball(10.0), points=60, noise_m=0.001, layout="free")
        settings |= {"sphere.diameter_m": None}
    points = [(f"P{i}", *map(float, row)) for i, row in enumerate(rows)]
    return tankcal.load(write_job(folder / kind, kind=kind, settings=settings, extra_points=points))


def job_of(solid, xyz_m, noise_m, folder, *, given=True):
    """A Job of a survey; its points with their sd, or without. folder  of empty jobs."""
    lying = isinstance(solid, LyingShell)
    job = _any_job(folder, "horizontal" if lying else "sphere")
    count = len(xyz_m)
    points = Points(
        names=tuple(f"P{i}" for i in range(count)),
        xyz_m=xyz_m,
        sd_m=np.full((count, 3), noise_m) if given else None,
        covariance_m2=None,
        section=("",) * count,
        generatrix=("",) * count,
        rows=(None,) * count,
    )
    sizes = {}
    if lying:
        sizes["horizontal"] = replace(
            job.horizontal, length_m=solid.length_m, dip_from_a_m=solid.dip_from_a_m
        )
    tank = replace(job.tank, nominal_diameter_m=None, nominal_height_m=None)
    return replace(job, points=points, inputs=(), tank=tank, **sizes)
