"""Defects of a round wall, each a function of azimuth and height.

Each defect provides the places where it is not smooth (`kinks_rad`, `edges_m`), at which the
quadrature of the volumes divides its panels. No defect has the form that `tankcal.geometry.field`
assumes for a wall: cusps, chords and caps are bounded, and depend jointly on height and azimuth.
"""

from dataclasses import asdict, dataclass

import numpy as np

from tankcal.units import FULL_TURN


def signed_arc(azimuth, at, radius_m):
    """Signed arc from the azimuth `at` to other azimuths, the shorter way round, m."""
    difference = azimuth - at
    return radius_m * (difference - FULL_TURN * np.round(difference / FULL_TURN))


def smooth_step(part):
    """Smooth step: 0 up to 0, 1 from 1, and a cubic with zero slope at both ends in between."""
    part = np.clip(part, 0.0, 1.0)
    return part * part * (3 - 2 * part)


def cap_of(part):
    """Cap: 1 at 0, a squared cosine from -1 to 1, and 0 beyond."""
    return np.cos(np.pi / 2 * np.clip(part, -1, 1)) ** 2


@dataclass(frozen=True)
class Defect:
    """Base of all defects, with the heights above the foot of the shell between which it acts."""

    low_m: float
    high_m: float

    def offset_m(self, azimuth, z, radius_m):
        """Offset (n,) of the wall outwards from the nominal radius, m.

        Parameters
        ----------
        azimuth, z : ndarray, shape (n,)
            Azimuths, rad, and heights between `low_m` and `high_m`.
        radius_m : float
            Nominal radius, m.
        """
        raise NotImplementedError

    def kinks_rad(self, radius_m):
        """Azimuths at which the defect is not smooth, rad."""
        return ()

    def edges_m(self):
        """Heights at which the defect is not smooth, m."""
        return (self.low_m, self.high_m)


@dataclass(frozen=True)
class Oval(Defect):
    """A wave round the shell whose size and phase change with the height."""

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
    """A vertical seam or weld: a ridge or valley with flanks that decay as exp(-arc / flank)."""

    azimuth_rad: float
    size_m: float
    flank_m: float
    fade_m: float  # length of the transition at both ends in height; 0 for a sharp end

    def offset_m(self, azimuth, z, radius_m):
        arc = np.abs(signed_arc(azimuth, self.azimuth_rad, radius_m))
        return self.size_m * np.exp(-arc / self.flank_m) * _fade_factor(self, z)

    def kinks_rad(self, radius_m):
        return (self.azimuth_rad, self.azimuth_rad + np.pi)

    def edges_m(self):
        return _fade_edges(self)


@dataclass(frozen=True)
class Band(Defect):
    """A horizontal weld that contracts the wall all round, with flanks above and below."""

    height_m: float
    size_m: float
    flank_m: float

    def offset_m(self, azimuth, z, radius_m):
        return self.size_m * np.exp(-np.abs(z - self.height_m) / self.flank_m) + 0 * azimuth

    def edges_m(self):
        return (self.low_m, self.height_m, self.high_m)


@dataclass(frozen=True)
class Course(Defect):
    """Axially symmetric form of a course: step of the radius, taper, and bulge between welds."""

    step_m: float
    taper_m: float  # from the foot of the course to its top
    bulge_m: float  # offset of the middle
    bell: float  # share of the bulge that is a cosine with zero slope at the welds, else a parabola

    def offset_m(self, azimuth, z, radius_m):
        zeta = 2 * (z - self.low_m) / (self.high_m - self.low_m) - 1
        form = self.bell * (1 + np.cos(np.pi * zeta)) / 2 + (1 - self.bell) * (1 - zeta**2)
        return self.step_m + self.taper_m * zeta / 2 + self.bulge_m * form + 0 * azimuth


@dataclass(frozen=True)
class Dent(Defect):
    """A smooth dent, or a bump if its size is positive."""

    azimuth_rad: float
    size_m: float
    half_width_m: float

    def offset_m(self, azimuth, z, radius_m):
        arc = signed_arc(azimuth, self.azimuth_rad, radius_m)
        return self.size_m * cap_of(arc / self.half_width_m) * cap_of(_zeta(self, z))

    def kinks_rad(self, radius_m):
        return _side_azimuths(self, radius_m)


@dataclass(frozen=True)
class Flat(Defect):
    """A flat place where a plate was not rolled: the chord of an arc in place of the arc."""

    azimuth_rad: float
    half_width_m: float
    fade_m: float

    def offset_m(self, azimuth, z, radius_m):
        arc = np.abs(signed_arc(azimuth, self.azimuth_rad, radius_m))
        chord = np.maximum(self.half_width_m**2 - arc**2, 0) / (2 * radius_m)
        return -chord * _fade_factor(self, z)

    def kinks_rad(self, radius_m):
        return _side_azimuths(self, radius_m)

    def edges_m(self):
        return _fade_edges(self)


@dataclass(frozen=True)
class Buckle(Defect):
    """A buckle by vacuum or fire: inward and outward folds under a cap."""

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
        return _side_azimuths(self, radius_m)


# Class of each kind of defect in plain data.
KINDS = {kind.__name__.lower(): kind for kind in (Oval, Seam, Band, Course, Dent, Flat, Buckle)}


def plain_of(defect):
    """Plain data of a defect, with its kind."""
    return {"kind": type(defect).__name__.lower(), **asdict(defect)}


def defect_of(plain):
    """Build the defect from plain data."""
    values = dict(plain)
    return KINDS[values.pop("kind")](**values)


def _side_azimuths(defect, radius_m):
    """Azimuths of both sides of a defect of limited width, rad."""
    half = defect.half_width_m / radius_m
    return (defect.azimuth_rad - half, defect.azimuth_rad + half)


def _zeta(defect, z):
    """Relative height, -1 at the lower end of the defect and 1 at its upper end."""
    return 2 * (z - defect.low_m) / (defect.high_m - defect.low_m) - 1


def _fade_factor(defect, z):
    """Factor from 0 to 1 for smooth lower and upper ends of a defect."""
    if defect.fade_m <= 0:
        return 1.0
    foot = smooth_step((z - defect.low_m) / defect.fade_m)
    return foot * smooth_step((defect.high_m - z) / defect.fade_m)


def _fade_edges(defect):
    """Heights of the ends of a defect and of its transitions, m."""
    fade = max(defect.fade_m, 0.0)
    return (defect.low_m, defect.low_m + fade, defect.high_m - fade, defect.high_m)
