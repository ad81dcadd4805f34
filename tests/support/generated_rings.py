"""Lying tanks of rings that are no model of the package, strapped with the errors of a crew.

    tank = make_tank(rng)
    job = strapped_job(rng, tank, job)

Rings taper and bulge, are drawn in at their welds, flatten by their own weight, are oval each in
its own way, may have a dent, and stand off the common axis; joints are lapped or flush. The truth
of a volume is the sum of polygons of the true sections. The tape lies on the hull of the outside
of the ring.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull

from tankcal.survey.strapping import Strap, Tape

COUNT, NODES = 720, 20  # azimuths of a section, Gauss places of a ring
TURN = (np.arange(COUNT) + 0.5) * 2 * np.pi / COUNT  # from the bottom
STEP = 2 * np.pi / COUNT
ALPHA, TAPE_ALPHA, TAPE_M, PLATE_M = 1.1e-5, 1.15e-5, 0.2e-3, 0.008
U = {  # standard uncertainties that are declared, and true
    "ring_axes": 1e-3,
    "ring_lengths": 1e-3,
    "tilt": 2e-4,
    "dip_position": 5e-3,
    "datum": 0.5e-3,
}
U_SCALE, READING_M = 10e-6, 0.5e-3


@dataclass(frozen=True)
class Rings:
    """A true tank at 20 degrees, inside, with flat ends; lengths in m.

    Attributes
    ----------
    base, taper, bulge, drawn, axis, length : ndarray, shape (rings,)
        Of drawn: by how much the weld of a joint draws the plate in, over reach.
    waves : ndarray, shape (rings, orders, 2)
        Of cos and sin of orders from 2 on.
    dents : tuple of (ring, azimuth, zeta, depth, width)
    tilt, dip, reach : float
    """

    base: np.ndarray
    taper: np.ndarray
    bulge: np.ndarray
    drawn: np.ndarray
    axis: np.ndarray
    length: np.ndarray
    waves: np.ndarray
    dents: tuple
    tilt: float
    dip: float
    reach: float

    @property
    def joints(self):
        return np.concatenate([[0.0], np.cumsum(self.length)])

    def section(self, ring, zeta, turn=TURN):
        """(n,) inside radii."""
        found = self.base[ring] + self.taper[ring] * zeta + self.bulge[ring] * (1.5 * zeta**2 - 0.5)
        from_joint = (1 - abs(zeta)) * self.length[ring] / 2
        found = found - self.drawn[ring] * np.exp(-from_joint / self.reach)
        orders = np.arange(2, 2 + self.waves.shape[1])
        found = found + np.cos(np.outer(turn, orders)) @ self.waves[ring, :, 0]
        found = found + np.sin(np.outer(turn, orders)) @ self.waves[ring, :, 1]
        for where, azimuth, place, depth, width in self.dents:
            if where == ring:
                away = (turn - azimuth + np.pi) % (2 * np.pi) - np.pi
                along = (zeta - place) * self.length[ring] / 2
                found = found - depth * np.exp(
                    -((away * self.base[ring]) ** 2 + along**2) / (2 * width**2)
                )
        return found

    def volumes(self, dips):
        """(k,) below plumb dips that count from the true bottom; inf: of the full tank."""
        ring, zeta = self._place(self.dip)
        zero = self.axis[ring] - self.section(ring, zeta, np.zeros(1))[0]
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        stretch, whole = np.hypot(1, self.tilt), np.zeros(len(dips))
        for ring, (start, length) in enumerate(zip(self.joints, self.length, strict=False)):
            for node, weight in zip(nodes, weights, strict=True):
                radius, s = self.section(ring, node), start + length * (node + 1) / 2
                x, y = radius * np.sin(TURN), -radius * np.cos(TURN)
                level = zero + stretch * np.asarray(dips) - self.tilt * (s - self.dip)
                cut = np.minimum(y, (level - self.axis[ring])[:, None])
                area = np.abs(np.sum(x * np.roll(cut, -1, 1) - np.roll(x, -1) * cut, axis=1)) / 2
                whole += weight * length / 2 * area * STEP / np.sin(STEP)
        return whole

    def girth(self, s, wider_m, larger):
        """Perimeter of the hull of the outside at s, m; larger: by warmth."""
        ring, zeta = self._place(s)
        radius = (self.section(ring, zeta) + wider_m) * larger
        places = np.column_stack([radius * np.cos(TURN), radius * np.sin(TURN)])
        return ConvexHull(places).area * STEP / 2 / np.sin(STEP / 2)

    @property
    def shape_m(self):
        """Standard deviation of the radius round the rings."""
        rings = range(len(self.base))
        return float(np.sqrt(np.mean([np.var(self.section(ring, 0.3)) for ring in rings])))

    def _place(self, s):
        ring = min(max(int(np.searchsorted(self.joints, s, side="right")) - 1, 0),
                   len(self.base) - 1)  # fmt: skip
        return ring, 2 * (s - self.joints[ring]) / self.length[ring] - 1


def make_tank(rng):
    """`Rings` of a random tank."""
    count, radius = int(rng.integers(3, 9)), rng.uniform(0.7, 1.6)
    laps = PLATE_M * ((np.arange(count) + rng.integers(2)) % 2) * rng.integers(2)
    length = np.full(count, rng.uniform(1.2, 2.5))
    size = np.exp(rng.uniform(*np.log([0.4, 2.5]))) * 1e-3
    orders = np.arange(2, 9)
    waves = rng.normal(size=(count, len(orders), 2)) * (size / orders**1.5)[:, None]
    waves[:, 0, 0] -= (
        abs(rng.normal()) * 1.5 * size
    )  # by its own weight: flatter, the bottom higher
    dents = tuple(
        (int(rng.integers(count)), rng.uniform(0, 2 * np.pi), rng.uniform(-0.8, 0.8),
         rng.uniform(0, 0.005), rng.uniform(0.1, 0.3))
        for _ in range(rng.integers(3))
    )  # fmt: skip
    wide, drawn = np.exp(rng.uniform(*np.log([0.1, 1.5]), size=2)) * 1e-3
    lean = np.exp(rng.uniform(*np.log([0.2, 1.0]))) * 1e-3
    return Rings(
        base=radius + laps + rng.normal(0, 8e-4, count),
        taper=rng.normal(0, lean, count),
        bulge=-wide * rng.uniform(-0.5, 1.0) + 0.3 * wide * rng.normal(size=count),
        drawn=drawn * rng.uniform(0.5, 1.5, count),
        axis=rng.normal(0, U["ring_axes"], count),
        length=length + rng.normal(0, U["ring_lengths"], count),
        waves=waves,
        dents=dents,
        tilt=rng.uniform(-0.01, 0.01),
        dip=float(rng.uniform(0.15, 0.85) * length.sum()),
        reach=rng.uniform(0.05, 0.2),
    )


def strapped_job(rng, tank, job, shares=(0.2, 0.8)):
    """The job with the readings of the tank, at shares of each ring, and what a crew has of its
    sizes.
    """
    shell_c, warmer = 29.0, rng.uniform(-2, 2)
    larger = 1 + ALPHA * (shell_c + warmer - 20)
    plate = PLATE_M + rng.uniform(-2e-4, 2e-4)
    scale = 1 + U_SCALE * rng.normal()
    known_m = tank.length + rng.normal(0, U["ring_lengths"], len(tank.length))
    straps = []
    for ring, start in enumerate(tank.joints[:-1]):
        for share in shares:
            girth = tank.girth(start + share * tank.length[ring], plate, larger) + np.pi * TAPE_M
            reading = girth / (1 + TAPE_ALPHA * (shell_c + warmer - 20)) / scale
            place = float(np.sum(known_m[:ring]) + share * known_m[ring])
            straps.append(
                Strap(f"{ring}-{share}", str(ring), place, reading + READING_M * rng.normal(),
                      READING_M, "T")
            )  # fmt: skip
    tape = Tape("T", temperature_c=20.0, expansion_per_k=TAPE_ALPHA, thickness_m=TAPE_M,
                u_scale=U_SCALE)  # fmt: skip
    rings = tuple(
        replace(job.rings[0], name=str(i), length_m=float(length), thickness_m=PLATE_M)
        for i, length in enumerate(known_m)
    )
    shape = tank.shape_m * np.exp(0.3 * rng.normal())
    lying = replace(
        job.horizontal,
        length_m=float(known_m.sum()),
        tilt=tank.tilt + U["tilt"] * rng.normal(),
        dip_from_a_m=tank.dip + U["dip_position"] * rng.normal(),
    )
    return replace(
        job,
        rings=rings,
        horizontal=lying,
        survey=replace(job.survey, shell_temperature_c=shell_c),
        strapping=replace(
            job.strapping, straps=tuple(straps), tapes=(tape,), shape_sd_m=float(shape)
        ),
    )
