"""Lying tanks of welded rings and spheres of petals, by the mechanics of their making.

    tank = make_lying(rng)         # strapped by `generated_rings.strapped_job`
    ball = make_ball(rng, "petals")        # a `generated_solids.Ball`

A second set beside `generated_rings` and `generated_solids`, with other shapes and with sizes that
grow with sqrt(R t) or with R, as the tolerances of shells do. It chose no size of the package.

Lying: each ring has its own radius; girth welds draw the plate in with the edge effect of a
cylinder (a damped cosine of length sqrt(R t) / 1.285); the shell bulges between its stiffeners,
which stand anywhere, by what filling left, or does not; a wave 2 flattens the tank between its
saddles and hardly over them; plates are too flat or too sharp at staggered long welds.

Spheres: petals of another curvature than the sphere ("petals": the sagitta of each, either sign,
and peaks at their welds), columns that push or pull the shell at the equator within sqrt(R t) with
either sign and a couple across it ("columns"), or a smooth random form of degrees 3 to 20 with
girth welds of the crowns drawn in ("smooth"). Its weight flattens each by up to 0.05 % of R.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from generated_rings import PLATE_M, TURN, Rings, U
from generated_solids import FULL_TURN, Ball, _areas_below

EDGE = 1.285  # of a cylinder, Poisson's ratio 0.3: the edge effect fades as exp(-EDGE x/sqrt(R t))
AROUND, PANELS, NODES = 720, 12, 6  # of the truth: azimuths, panels of a ring, Gauss places of each
BALLS = ("petals", "columns", "smooth")


@dataclass(frozen=True)
class WeldedTank:
    """A true tank at 20 degrees, inside, with flat ends; lengths in m.

    Attributes
    ----------
    base, length, axis : ndarray, shape (rings,)
        Radius, length, and height of the axis above the common one.
    forms : tuple
        Functions of (ring, place along the tank, turn from the bottom (n,)): departures.
    tilt, dip : float
    """

    base: np.ndarray
    length: np.ndarray
    axis: np.ndarray
    forms: tuple
    tilt: float
    dip: float

    joints, girth, shape_m, _place = Rings.joints, Rings.girth, Rings.shape_m, Rings._place

    def section(self, ring, zeta, turn=TURN):
        """(n,) inside radii."""
        s = self.joints[ring] + (zeta + 1) * self.length[ring] / 2
        return self.base[ring] + sum(form(ring, s, turn) for form in self.forms)

    def volumes(self, dips):
        """(k,) below plumb dips that count from the true bottom."""
        ring, zeta = self._place(self.dip)
        zero = self.axis[ring] - self.section(ring, zeta, np.zeros(1))[0]
        turn, step = np.arange(AROUND + 1) * FULL_TURN / AROUND, FULL_TURN / AROUND
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        stretch, found = np.hypot(1, self.tilt), np.zeros(len(dips))
        edges = -np.cos(np.linspace(0, np.pi, PANELS + 1))  # close together at the welds
        for ring, length in enumerate(self.length):
            for low, high in pairwise(edges):
                for node, weight in zip(nodes, weights, strict=True):
                    zeta = (low + high) / 2 + (high - low) / 2 * node
                    s = self.joints[ring] + (zeta + 1) * length / 2
                    r = self.section(ring, zeta, turn)
                    x, z = r * np.sin(turn), self.axis[ring] - r * np.cos(turn)
                    levels = zero + stretch * np.asarray(dips) - self.tilt * (s - self.dip)
                    area = _areas_below(x[None], z[None], levels[:, None])
                    found += weight * (high - low) / 4 * length * area
        return found * step / np.sin(step)


def make_lying(rng):
    """`WeldedTank` of a random tank: R 0.6 to 2 m, plates of 5 to 12 mm."""
    count, radius = int(rng.integers(3, 9)), float(np.exp(rng.uniform(*np.log([0.6, 2.0]))))
    length = np.full(count, rng.uniform(1.4, 3.0)) + rng.normal(0, U["ring_lengths"], count)
    ends = np.concatenate([[0.0], np.cumsum(length)])
    reach = float(np.sqrt(radius * rng.uniform(0.005, 0.012)))  # sqrt(R t)
    base = radius + rng.normal(0, rng.uniform(3e-4, 1.5e-3), count)
    base += PLATE_M * ((np.arange(count) + rng.integers(2)) % 2) * (rng.random() < 0.3)
    axis = rng.normal(0, U["ring_axes"], count)
    forms = (
        _girth_welds(rng, ends, reach),
        _bulges(rng, ends, reach),
        _flattening(rng, ends, radius),
        _long_welds(rng, radius, count),
        _own_ovality(rng, radius, count),
    )
    tilt, dip = rng.uniform(-0.01, 0.01), float(rng.uniform(0.15, 0.85) * ends[-1])
    return WeldedTank(base, length, axis, forms, tilt, dip)


def _girth_welds(rng, ends, reach_m):
    """Drawn in by up to 0.02 sqrt(R t), 2 mm in the mean of a tank of R 1.2 m, t 8 mm."""
    depth = reach_m * rng.uniform(0, 0.02) * rng.uniform(0.5, 1.5, len(ends))
    depth[[0, -1]] *= rng.uniform(0, 1, 2)  # heads are stiff

    def form(ring, s, turn):
        x = EDGE * np.abs(s - ends[ring : ring + 2]) / reach_m
        return -np.sum(depth[ring : ring + 2] * np.exp(-x) * (np.cos(x) + np.sin(x))) + 0 * turn

    return form


def _bulges(rng, ends, reach_m):
    """What filling left between stiffeners, which stand where no girth weld is; or nothing."""
    size = reach_m * rng.choice([0.0, 1.0]) * rng.uniform(0, 0.02)
    fields = max(1, round(ends[-1] / rng.uniform(1.5, 4.0)))
    own = size * (1 + 0.3 * rng.normal(size=fields))
    taper = rng.normal(0, 4e-4, len(ends) - 1)

    def form(ring, s, turn):
        share = (s - ends[ring]) / (ends[ring + 1] - ends[ring])
        place = np.clip(s / ends[-1], 0, 1 - 1e-12) * fields
        within = 2 * (place % 1) - 1
        bulge = own[int(place)] * (1 - within**2) ** 2
        return bulge + taper[ring] * (2 * share - 1) + 0 * turn

    return form


def _flattening(rng, ends, radius_m):
    """Wave 2 by the own weight, least over two saddles; and the pressure of their horns."""
    size, over = radius_m * rng.uniform(0, 2.5e-3), rng.uniform(0.1, 0.6)
    whole = ends[-1]
    saddles = whole * np.array([rng.uniform(0.12, 0.25), rng.uniform(0.75, 0.88)])
    horn, press = np.radians(rng.uniform(55, 75)), rng.uniform(0, 3e-3)

    def form(ring, s, turn):
        near = np.exp(-(((s - saddles) / radius_m) ** 2)).sum()
        away = radius_m * (np.abs((turn + np.pi) % FULL_TURN - np.pi) - horn)
        pressed = (
            -press * np.exp(-((away / 0.15) ** 2)) * np.exp(-(((s - saddles) / 0.2) ** 2)).sum()
        )
        return -size * (1 - (1 - over) * min(near, 1)) * np.cos(2 * turn) + pressed

    return form


def _long_welds(rng, radius_m, count):
    """One or two a ring, too flat or too sharp by up to 4 mm within 0.1 to 0.25 m, staggered."""
    size, wide = rng.choice([-1, 1]) * rng.uniform(0, 4e-3), rng.uniform(0.1, 0.25)
    each = int(rng.integers(1, 3))
    where = rng.uniform(0, FULL_TURN, count)
    sizes = size * (1 + 0.4 * rng.normal(size=(count, each)))

    def form(ring, s, turn):
        found = 0 * turn
        for k in range(each):
            away = (turn - where[ring] - FULL_TURN * k / each + np.pi) % FULL_TURN - np.pi
            found = found + sizes[ring, k] * np.exp(-np.abs(radius_m * away) / wide)
        return found

    return form


def _own_ovality(rng, radius_m, count):
    """Waves 2 to 6 of each ring, as it was rolled."""
    orders = np.arange(2, 7)
    size = radius_m * rng.uniform(2e-4, 1e-3) / orders**1.5
    waves = rng.normal(size=(2, count, len(orders))) * size

    def form(ring, s, turn):
        angle = np.multiply.outer(turn, orders)
        return np.cos(angle) @ waves[0, ring] + np.sin(angle) @ waves[1, ring]

    return form


def make_ball(rng, family):
    """A `Ball` of a family, R 3 to 11 m."""
    ball = Ball(float(np.exp(rng.uniform(*np.log([3.0, 11.0])))))
    flat = rng.uniform(0, 5e-4) * ball.radius_m
    ball.departures.append(lambda d: -flat * (1.5 * d[..., 2] ** 2 - 0.5))
    _MAKERS[family](rng, ball)
    return ball


def _waves(rng, ball, degrees, rms):
    """Zonal harmonics about random axes, their variance falling as degree^-2."""
    sizes = np.sqrt((2 * degrees + 1) * degrees**-2.0 / np.sum(degrees**-2.0)) * rms
    axes = rng.normal(size=(len(degrees), 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    for degree, size, axis in zip(degrees, sizes * rng.normal(size=len(sizes)), axes, strict=True):
        series = np.zeros(degree + 1)
        series[-1] = size
        ball.departures.append(
            lambda d, axis=axis, series=series: np.polynomial.legendre.legval(d @ axis, series)
        )


def _petals(rng, ball):
    _waves(rng, ball, np.arange(3, 7), ball.radius_m * rng.uniform(0.5e-4, 2e-4))
    radius, count = ball.radius_m, max(6, round(FULL_TURN * ball.radius_m / rng.uniform(2, 3.5)))
    crown, phase = np.radians(rng.uniform(25, 45)), rng.uniform(0, FULL_TURN)
    sagitta = radius * rng.uniform(-1e-3, 1e-3) + radius * 3e-4 * rng.normal(size=count)
    peak, wide = radius * rng.uniform(-8e-4, 8e-4), 0.5 * np.sqrt(radius * 0.004 * radius)

    def petals(d):
        place = ((np.arctan2(d[..., 1], d[..., 0]) - phase) / FULL_TURN * count) % count
        across = 2 * (place % 1) - 1
        polar = np.arccos(np.clip(np.abs(d[..., 2]), 0, 1))
        along = np.clip((polar - crown) / (np.pi / 2 - crown), 0, 1)
        own = sagitta[np.minimum(place.astype(int), count - 1)]
        level = np.sqrt(np.maximum(1 - d[..., 2] ** 2, 0))
        arc = (1 - np.abs(across)) * np.pi / count * radius * level
        weld = peak * np.exp(-arc / wide) * (polar > crown)
        return own * (1 - across**2 - 2 / 3) * np.sin(np.pi / 2 * along) + weld

    ball.departures.append(petals)


def _columns(rng, ball):
    _waves(rng, ball, np.arange(3, 7), ball.radius_m * rng.uniform(0.5e-4, 2e-4))
    count = int(rng.integers(6, 13))
    turns = rng.uniform(0, FULL_TURN) + FULL_TURN * np.arange(count) / count
    wide = 2 * ball.radius_m * np.sqrt(0.003)  # a few times sqrt(R t), t 0.3 % of R
    push, couple = ball.radius_m * rng.uniform(-8e-4, 8e-4, 2)

    def columns(d):
        found = np.zeros(d.shape[:-1])
        north = ball.radius_m * np.arcsin(np.clip(d[..., 2], -1, 1)) / wide
        for turn in turns:
            cosine = d[..., 0] * np.cos(turn) + d[..., 1] * np.sin(turn)
            arc = ball.radius_m * np.arccos(np.clip(cosine, -1, 1)) / wide
            found = found + (push + couple * north) * np.exp(-(arc**2))
        return found

    ball.departures.append(columns)


def _smooth(rng, ball):
    _waves(rng, ball, np.arange(3, 21), ball.radius_m * rng.uniform(1e-4, 5e-4))
    crown, depth = np.radians(rng.uniform(25, 45)), ball.radius_m * rng.uniform(0, 6e-4)
    wide = ball.radius_m * np.sqrt(0.003) / EDGE

    def crowns(d):
        polar = np.arccos(np.clip(np.abs(d[..., 2]), 0, 1))
        x = np.abs(polar - crown) * ball.radius_m / wide
        return -depth * np.exp(-x) * (np.cos(x) + np.sin(x))

    ball.departures.append(crowns)


_MAKERS = {"petals": _petals, "columns": _columns, "smooth": _smooth}
