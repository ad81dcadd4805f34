"""What makes a wall other than round: each defect is a function of azimuth and height.

Every defect tells where it is not smooth (`kinks_rad`, `edges_m`), so that the quadrature of the
volumes can put its panels there. None of it is of the form that `tankcal.geometry.field` assumes of
a wall: cusps, chords and caps have bounds, and hang together in height and azimuth.
"""

from dataclasses import asdict, dataclass

import numpy as np

FULL_TURN = 2 * np.pi


def signed_arc(azimuth, at, radius_m):
    """Arc from one azimuth to others the shorter way, m."""
    away = azimuth - at
    return radius_m * (away - FULL_TURN * np.round(away / FULL_TURN))


def smooth_step(part):
    """0 up to 0, 1 from 1 on, between them a cubic that is level at both ends."""
    part = np.clip(part, 0.0, 1.0)
    return part * part * (3 - 2 * part)


def cap_of(part):
    """1 at 0, 0 beyond -1 and 1, a squared cosine between them."""
    return np.cos(np.pi / 2 * np.clip(part, -1, 1)) ** 2


@dataclass(frozen=True)
class Defect:
    """What all have: between which heights above the foot of the shell they act."""

    low_m: float
    high_m: float

    def offset_m(self, azimuth, z, radius_m):
        """(n,) how far the wall stands outside the nominal radius at (n,) places within it."""
        raise NotImplementedError

    def kinks_rad(self, radius_m):
        """Azimuths at which it is not smooth."""
        return ()

    def edges_m(self):
        """Heights at which it is not smooth."""
        return (self.low_m, self.high_m)


@dataclass(frozen=True)
class Oval(Defect):
    """A wave round the shell that grows and turns on the way up."""

    waves: int
    foot_size_m: float
    top_size_m: float
    phase_rad: float
    turn_rad: float

    def offset_m(self, azimuth, z, radius_m):
        up = (z - self.low_m) / (self.high_m - self.low_m)
        size = self.foot_size_m + (self.top_size_m - self.foot_size_m) * up
        return size * np.cos(self.waves * azimuth - self.phase_rad - self.turn_rad * up)


@dataclass(frozen=True)
class Seam(Defect):
    """A vertical seam or weld: a ridge or a valley with flanks that fall as exp(-arc / flank)."""

    azimuth_rad: float
    size_m: float
    flank_m: float
    fade_m: float  # at both ends in height; 0: it ends at once

    def offset_m(self, azimuth, z, radius_m):
        arc = np.abs(signed_arc(azimuth, self.azimuth_rad, radius_m))
        return self.size_m * np.exp(-arc / self.flank_m) * _faded(self, z)

    def kinks_rad(self, radius_m):
        return (self.azimuth_rad, self.azimuth_rad + np.pi)

    def edges_m(self):
        return _faded_edges(self)


@dataclass(frozen=True)
class Band(Defect):
    """A girth weld that draws the wall in all round, with flanks up and down."""

    height_m: float
    size_m: float
    flank_m: float

    def offset_m(self, azimuth, z, radius_m):
        return self.size_m * np.exp(-np.abs(z - self.height_m) / self.flank_m) + 0 * azimuth

    def edges_m(self):
        return (self.low_m, self.height_m, self.high_m)


@dataclass(frozen=True)
class Course(Defect):
    """What one course has all round: a step of its radius, a taper, a bulge between its welds."""

    step_m: float
    taper_m: float  # from the foot of the course to its top
    bulge_m: float  # of the middle
    bell: float  # share of the bulge that is level at the welds, the rest is a parabola

    def offset_m(self, azimuth, z, radius_m):
        zeta = 2 * (z - self.low_m) / (self.high_m - self.low_m) - 1
        form = self.bell * (1 + np.cos(np.pi * zeta)) / 2 + (1 - self.bell) * (1 - zeta**2)
        return self.step_m + self.taper_m * zeta / 2 + self.bulge_m * form + 0 * azimuth


@dataclass(frozen=True)
class Dent(Defect):
    """A smooth dent, or a bump where its size is above 0."""

    azimuth_rad: float
    size_m: float
    half_width_m: float

    def offset_m(self, azimuth, z, radius_m):
        arc = signed_arc(azimuth, self.azimuth_rad, radius_m)
        return self.size_m * cap_of(arc / self.half_width_m) * cap_of(_zeta(self, z))

    def kinks_rad(self, radius_m):
        return _sides(self, radius_m)


@dataclass(frozen=True)
class Flat(Defect):
    """A plate that was never rolled there: the chord of an arc, in place of the arc."""

    azimuth_rad: float
    half_width_m: float
    fade_m: float

    def offset_m(self, azimuth, z, radius_m):
        arc = np.abs(signed_arc(azimuth, self.azimuth_rad, radius_m))
        chord = np.maximum(self.half_width_m**2 - arc**2, 0) / (2 * radius_m)
        return -chord * _faded(self, z)

    def kinks_rad(self, radius_m):
        return _sides(self, radius_m)

    def edges_m(self):
        return _faded_edges(self)


@dataclass(frozen=True)
class Buckle(Defect):
    """A buckle by vacuum or fire: folds in and out under a cap."""

    azimuth_rad: float
    size_m: float
    half_width_m: float
    folds: float

    def offset_m(self, azimuth, z, radius_m):
        part = signed_arc(azimuth, self.azimuth_rad, radius_m) / self.half_width_m
        return (
            self.size_m * cap_of(part) * np.cos(np.pi * self.folds * part) * cap_of(_zeta(self, z))
        )

    def kinks_rad(self, radius_m):
        return _sides(self, radius_m)


KINDS = {one.__name__.lower(): one for one in (Oval, Seam, Band, Course, Dent, Flat, Buckle)}


def plain_of(defect):
    """A defect as plain data."""
    return {"kind": type(defect).__name__.lower(), **asdict(defect)}


def defect_of(plain):
    """The defect of plain data."""
    values = dict(plain)
    return KINDS[values.pop("kind")](**values)


def _sides(defect, radius_m):
    """Azimuths at which a patch begins and ends."""
    half = defect.half_width_m / radius_m
    return (defect.azimuth_rad - half, defect.azimuth_rad + half)


def _zeta(defect, z):
    """-1 at its foot, 1 at its top."""
    return 2 * (z - defect.low_m) / (defect.high_m - defect.low_m) - 1


def _faded(defect, z):
    if defect.fade_m <= 0:
        return 1.0
    foot = smooth_step((z - defect.low_m) / defect.fade_m)
    return foot * smooth_step((defect.high_m - z) / defect.fade_m)


def _faded_edges(defect):
    fade = max(defect.fade_m, 0.0)
    return (defect.low_m, defect.low_m + fade, defect.high_m - fade, defect.high_m)
