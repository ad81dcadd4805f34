"""Straps round a wall that points show, too: readings of the same field, each tested by all others.

A circumference is the mean radius of its level but for the area term, whose size the points tell:
the ovality and the seams that they were found to have. Inside points see the shell without plate
and paint, which a tape outside does not.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg

from tankcal.geometry.field.components import COMPONENTS
from tankcal.geometry.field.estimate import LEVELS, WallField
from tankcal.geometry.field.sites import Sites
from tankcal.geometry.girth import perimeter_excess
from tankcal.geometry.outlines import FULL_TURN
from tankcal.pipeline.unbound import Unbound
from tankcal.pipeline.wall_readings import (
    columns_of,
    noise_by_inputs,
    noise_of,
    readings_of_straps,
    settle_readings,
    sites_of,
)
from tankcal.quadrature import panels
from tankcal.survey.network.reliability import noncentrality
from tankcal.survey.strapping import Reduced, reduce_straps, tapes_used


@dataclass(frozen=True)
class AreaTerm:
    """By how much the circle of a perimeter is larger than the wall: mean and sd, relative."""

    mean: float
    sd: float


def area_term(shape_sd_m, amplitudes, nominal_m):
    """`AreaTerm` of a wall, and the standard deviation of its radius that it follows from.

    shape_sd_m  as declared; None: of the ovality and the seams that it has by its amplitudes
    """
    if shape_sd_m is None:
        waves = [one.shape in ("oval", "seam") for one in COMPONENTS]
        shape_sd_m = float(np.sqrt(amplitudes.variances_m2[waves].sum()))
    return AreaTerm(*perimeter_excess(shape_sd_m, nominal_m)), shape_sd_m


@dataclass(frozen=True)
class Straps:
    """Circumferences by tape, and what the wall that they are readings of says of them.

    Attributes
    ----------
    reduced : tuple of Reduced
        Of every reading, in the order of the file.
    adjusted : ndarray of int, shape (k,)
        Which of these are readings of the wall; the others are only compared.
    accepted : ndarray of bool, shape (k,)
        False: set aside, for all others contradict it.
    w : ndarray, shape (k,)
        Departure from what all others show over its sd; nan: no other controls it.
    sd_m : ndarray, shape (k,)
        That, of its radius; inf of such.
    departure_m : ndarray, shape (k,)
        Of its radius from what all others show.
    area_term : AreaTerm
    shape_sd_m : float
        Standard deviation of the radius round the wall, which that follows from.
    radius_m : ndarray, shape (courses,)
        Mean radius of the painted shell, of the circle of equal area.
    plate_sd_m : dict
        {course index: standard uncertainty of its plate by a gauge}.
    tapes : tuple of (Tape, float)
        Those that were read, and the standard uncertainty of their scale by a master.
    """

    reduced: tuple[Reduced, ...]
    adjusted: np.ndarray
    accepted: np.ndarray
    w: np.ndarray
    sd_m: np.ndarray
    departure_m: np.ndarray
    area_term: AreaTerm
    shape_sd_m: float
    radius_m: np.ndarray
    plate_sd_m: dict
    tapes: tuple

    @property
    def per_radius(self):
        """Circumference over the radius of equal area."""
        return FULL_TURN * np.sqrt(1 + self.area_term.mean)

    @property
    def mdb_m(self):
        """(k,) smallest blunder of each circumference that its test finds; inf: no test."""
        return noncentrality() * self.sd_m * self.per_radius

    @property
    def circumference_m(self):
        """(courses,) mean circumference of each, of the painted shell."""
        return self.radius_m * self.per_radius


def gauged_plates(job):
    """{course index: standard uncertainty of its plate by a gauge} of a strapped job."""
    read = job.strapping.plate_sd_m
    return {i: read[one.name] for i, one in enumerate(job.courses) if one.name in read}


def mean_radii(field):
    """(courses,) mean radius of each course as measured."""
    return field.outlines_m.mean(axis=2) @ panels([0.0, 1.0], LEVELS)[1]


@dataclass(frozen=True)
class PointsOfWall:
    """What points say of a wall.

    Attributes
    ----------
    sites : Sites
    radius_m : ndarray, shape (n,)
    noise_m2 : ndarray, shape (n, n)
    unbound : Unbound
        What of them nothing binds.
    by_inputs : dict
        {input of the budget: (n,) derivative of the radii}.
    """

    sites: Sites
    radius_m: np.ndarray
    noise_m2: np.ndarray
    unbound: Unbound
    by_inputs: dict = field(default_factory=dict)


def join_straps(job, points, amplitudes, joints_m):
    """The field of a wall from its points and its straps.

    Parameters
    ----------
    job : Job
        Whose wall was strapped.
    points : PointsOfWall
    amplitudes : Amplitudes
        Of the wall, as its points tell them.
    joints_m : ndarray, shape (courses + 1,)

    Returns
    -------
    field : WallField
        Of the points, then of the accepted straps.
    readings : list of WallReading
        These straps, on the surface that the points are on.
    straps : Straps
    """
    radius, noise = points.radius_m, points.noise_m2
    nominal, names = job.tank.nominal_diameter_m / 2, [one.name for one in job.courses]
    given = job.strapping
    reduced = reduce_straps(given, job.survey.shell_temperature_c, 2 * nominal)
    places = np.array([i for i, one in enumerate(reduced) if not one.strap.check], dtype=int)
    term, shape = area_term(given.shape_sd_m, amplitudes, nominal)
    readings = readings_of_straps([reduced[i] for i in places], names, term)
    inner = np.array([one.thickness_m + one.paint_m for one in job.courses])
    inner *= job.survey.side == "inside"
    readings = [_on_surface(one, inner[one.course], job.survey.side) for one in readings]
    n, k = len(radius), len(readings)
    both = _joined(points.sites, sites_of(readings, joints_m, job.datum.plate_level_m))
    both = points.unbound.padded(k).shared_by(both)
    radius = np.append(radius, [one.radius_m for one in readings])
    columns = columns_of([one.by_inputs for one in readings])
    columns = {
        name: np.append(points.by_inputs.get(name, np.zeros(n)), columns.get(name, np.zeros(k)))
        for name in dict.fromkeys((*points.by_inputs, *columns))
    }
    noise = scipy.linalg.block_diag(noise, noise_of(readings))
    noise += noise_by_inputs(job.inputs, columns, n + k)
    may_go = np.append(np.zeros(n), np.full(k, job.snooping and both.shared is None))

    def field_of(accepted):
        some = np.flatnonzero(accepted)
        own = noise[np.ix_(some, some)]
        return WallField(both.take(accepted), radius[some], own, amplitudes, nominal)

    field, tested = settle_readings(
        field_of(np.ones(n + k, dtype=bool)), field_of, (both, radius, noise), may_go
    )
    kept, sd = tested.accepted[n:], tested.sd_m[n:]
    straps = Straps(
        reduced=reduced,
        adjusted=places,
        accepted=kept,
        w=np.where(np.isfinite(sd), tested.w[n:], np.nan),
        sd_m=sd,
        departure_m=tested.departure_m[n:],
        area_term=term,
        shape_sd_m=shape,
        radius_m=mean_radii(field) + inner,
        plate_sd_m=gauged_plates(job),
        tapes=tapes_used(given),
    )
    return field, [one for one, used in zip(readings, kept, strict=True) if used], straps


def _on_surface(reading, inner_m, side):
    """A strap's radius on the surface that the points are on: inside without plate and paint."""
    if side == "outside":
        return reading
    by = {"plate_thickness": -1.0, "paint": -1.0}
    return replace(reading, radius_m=reading.radius_m - inner_m, by_inputs=reading.by_inputs | by)


def _joined(points, straps):
    """`Sites` of points, then of straps, without what they share."""
    names = ("course", "ring", "zeta", "azimuth_rad", "leans")
    return Sites(
        **{name: np.concatenate([getattr(points, name), getattr(straps, name)]) for name in names},
        welds_rad=points.welds_rad,
    )
