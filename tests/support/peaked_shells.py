"""Clouds of shells whose welds stand out, by formulas that no module of the package has.

    shell = PeakedShell(peaks=[Peak(0, 1.0, 0.008, 0.15)])
    cloud = shell.cloud(rng, 1_000_000)       points at chance places, in the frame of the tank
    shell.gap(0, 1.0)                         of the board, by the formula of the page

A point is as far from the axis as `radius` says, and noise; noise may hang together between
neighbours: then it is a bilinear field over knots of chance, some centimetres apart.
"""

from dataclasses import dataclass, field

import numpy as np
from generated_clouds import FULL_TURN, passes_of

from tankcal.clouds.wall import Passes, find_cloud_wall

DENSITY = 1e7 / (FULL_TURN * 6.5 * 10.0)  # points for each square metre, of the page
BOARD_M, REACH_M = 0.914, 0.150


@dataclass(frozen=True)
class Peak:
    """A vertical weld of a course: size exp(-|s| / wide_m), all the way up."""

    course: int
    azimuth_rad: float
    size_m: float
    wide_m: float


@dataclass(frozen=True)
class Band:
    """A horizontal weld: the same up and down, within about `around_m` of an azimuth."""

    height_m: float
    azimuth_rad: float
    size_m: float
    wide_m: float
    around_m: float = 0.6


@dataclass
class PeakedShell:
    """An upright shell; z is 0 at its bottom."""

    radius_m: float = 2.0
    courses: int = 2
    course_m: float = 1.5
    peaks: list = field(default_factory=list)
    bands: list = field(default_factory=list)
    bead_m: float = 0.0  # height of a bead, 18 mm wide, on each peak
    oval_m: float = 0.004
    noise_m: float = 0.002
    hanging_m: float = 0.0  # sd of the noise that neighbours share
    knots_m: float = 0.06

    @property
    def joints_m(self):
        return np.arange(self.courses + 1) * self.course_m

    @property
    def area_m2(self):
        return FULL_TURN * self.radius_m * self.courses * self.course_m

    def radius(self, azimuth, z):
        """Distance of the wall from its axis."""
        course = np.clip((z / self.course_m).astype(int), 0, self.courses - 1)
        r = self.radius_m + self.oval_m * np.cos(2 * azimuth + 0.3 * z)
        for one in self.peaks:
            s = _turn(azimuth - one.azimuth_rad) * self.radius_m
            here = one.size_m * np.exp(-np.abs(s) / one.wide_m) + self.bead_m * (np.abs(s) < 0.009)
            r = r + np.where(course == one.course, here, 0.0)
        for one in self.bands:
            around = _turn(azimuth - one.azimuth_rad) * self.radius_m / one.around_m
            up = np.exp(-np.abs(z - one.height_m) / one.wide_m)
            r = r + one.size_m * up * np.exp(-(around**4))
        return r

    def cloud(self, rng, count):
        """(count, 3) points."""
        azimuth = rng.uniform(0, FULL_TURN, count)
        z = rng.uniform(0, self.courses * self.course_m, count)
        r = self.radius(azimuth, z) + rng.normal(0, self.noise_m, count)
        if self.hanging_m:
            r += self.hanging_m * self._hanging(rng, azimuth, z)
        return np.column_stack([r * np.sin(azimuth), r * np.cos(azimuth), z])

    def gap(self, peak):
        """The largest gap of a board over a peak, its centre in the middle of the weld."""
        return largest_of_formula(
            lambda s: self.radius(
                peak.azimuth_rad + s / self.radius_m,
                np.full(len(s), (peak.course + 0.5) * self.course_m),
            )
        )

    def _hanging(self, rng, azimuth, z):
        columns = int(FULL_TURN * self.radius_m / self.knots_m)
        rows = int(self.courses * self.course_m / self.knots_m) + 2
        knots = rng.normal(0, 1, (rows, columns))
        x, y = azimuth / FULL_TURN * columns, z / self.knots_m
        i, j = np.minimum(x.astype(int), columns - 1), y.astype(int)
        a, b = x - i, y - j
        near = (i + 1) % columns
        low = (1 - a) * knots[j, i] + a * knots[j, near]
        return (1 - b) * low + b * ((1 - a) * knots[j + 1, i] + a * knots[j + 1, near])


def largest_of_formula(e):
    """The gap of largest size within reach of the weld, by the page: s e(+-b/2) taken out."""
    s = np.linspace(-REACH_M, REACH_M, 3001)
    half = BOARD_M / 2
    low, high = e(np.array([-half, half]))
    g = e(s) - (low + high) / 2 - s * (high - low) / BOARD_M
    return float(g[np.argmax(np.abs(g))])


def wall_and_passes(shell, scans):
    """`CloudWall` and `Passes` of scans in the frame of the tank."""
    passes = passes_of(scans)
    return find_cloud_wall(passes, radius_m=shell.radius_m, joints_m=shell.joints_m), Passes(passes)


def _turn(angle):
    return (angle + np.pi) % FULL_TURN - np.pi
