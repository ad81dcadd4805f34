"""Straps and offsets of a wall that points show, too: readings of the same field, each tested by
all others.

A circumference is the mean radius of its level but for the area term, whose size the points tell:
the ovality and the seams that they were found to have. Inside points see the shell without plate
and paint, which a tape outside does not.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg

from tankcal.adjust import noncentrality
from tankcal.geometry.field.amplitudes import estimate_amplitudes
from tankcal.geometry.field.blunders import Tested
from tankcal.geometry.field.components import COMPONENTS, ROUND_SHAPES
from tankcal.geometry.field.estimate import LEVELS, WallField
from tankcal.geometry.field.sites import Sites
from tankcal.geometry.girth import Ring, perimeter_excess, seen_excess
from tankcal.geometry.outlines import FULL_TURN
from tankcal.pipeline.read_wall import ReadWall
from tankcal.pipeline.tanks import insets_of
from tankcal.pipeline.untied_setups import Unbound
from tankcal.pipeline.wall_readings import (
    FORMER,
    columns_of,
    noise_by_inputs,
    noise_of,
    off_centre,
    readings_of_offsets,
    readings_of_straps,
    readings_of_untold,
    settle_readings,
    sites_of,
)
from tankcal.quadrature import panels
from tankcal.survey.reference_line import courses_told
from tankcal.survey.strapping import Reduced, reduce_straps, tapes_used

FEWEST_CIRCUMFERENCES = 3  # where they alone tell an offset: of two nobody knows which is wrong
MOST_OF_RING = 200  # points of a ring that are asked what the wall looks like


@dataclass(frozen=True)
class AreaTerm:
    """By how much the circle of a perimeter is larger than the wall: mean and sd, relative."""

    mean: float
    sd: float


def typical_shape_m():
    """Standard deviation of the radius round a typical shell, m: what `COMPONENTS` assume.

    It is the root of the summed median variances of ovality, settlement and seams, 6.1 mm.
    """
    return float(
        np.sqrt(
            sum(
                component.median_m**2 for component in COMPONENTS if component.shape in ROUND_SHAPES
            )
        )
    )


def area_term(shape_sd_m, amplitudes, nominal_m, points=None):
    """`AreaTerm` of a wall, and the standard deviation of its radius that it follows from.

    shape_sd_m  as declared; None: of the ovality and the seams that it has by its amplitudes
    points      `PointsOfWall`, whose outlines it has where none is declared; None: of a plan
    """
    is_declared = shape_sd_m is not None
    if not is_declared:
        waves = [component.shape in ROUND_SHAPES for component in COMPONENTS]
        shape_sd_m = float(np.sqrt(amplitudes.likely_m2[waves].sum()))
    if is_declared or points is None:
        return AreaTerm(*perimeter_excess(shape_sd_m, nominal_m)), shape_sd_m
    return AreaTerm(*seen_excess(amplitudes, nominal_m, rings_of(points))), shape_sd_m


def rings_of(points):
    """`Ring`s of a `WallField`, or of `PointsOfWall`: no more than MOST_OF_RING readings each."""
    found, sites = [], points.sites
    for ring in np.unique(sites.ring[sites.ring >= 0]):
        mine = np.flatnonzero(sites.ring == ring)
        mine = mine[np.argsort(sites.azimuth_rad[mine] % FULL_TURN)]  # what is drawn hangs on it
        mine = mine[:: -(-len(mine) // MOST_OF_RING)]
        noise = points.noise_m2[np.ix_(mine, mine)]
        up = float(sites.heights.up[mine].mean())
        found.append(Ring(sites.azimuth_rad[mine], points.radius_m[mine], noise, up))
    return found


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
        False: rejected, for all others contradict it.
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
    """{index of a course or ring: standard uncertainty of its plate by a gauge} of a strapped
    job.
    """
    read, parts = job.strapping.plate_sd_m, job.courses or job.rings
    return {i: read[part.name] for i, part in enumerate(parts) if part.name in read}


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


def told_courses(job, seen):
    """Indices of the courses that points (of a set of them), straps or reference lines tell."""
    place, strapped, read = {course.name: i for i, course in enumerate(job.courses)}, (), ()
    if job.strapping is not None:
        strapped = (strap.course for strap in job.strapping.straps if not strap.check)
    if job.lines is not None:
        read = (offset.course for offset in job.lines.offsets if not offset.check)
    return courses_told(
        seen, {place[strap] for strap in strapped}, {place[offset] for offset in read}
    )


def join_readings(job, points, amplitudes, joints_m, *, is_known):
    """The field of a wall from its points, its straps and its offsets from reference lines.

    Parameters
    ----------
    job : Job
        Whose wall was strapped, read from lines, or both.
    points : PointsOfWall
    amplitudes : Amplitudes
        Of the wall, as its points tell them.
    joints_m : ndarray, shape (courses + 1,)
    is_known : bool
        Whether the amplitudes are known beforehand, as those of a plan; False: where points do not
        lie on every course they are found again, from all.

    Returns
    -------
    read : ReadWall
        Its field is of the points, then of the accepted readings, on the surface that the points
        are on.
    straps : Straps or None
    """
    nominal, names = job.tank.nominal_diameter_m / 2, [course.name for course in job.courses]
    inner = np.array([course.thickness_m + course.paint_m for course in job.courses])
    inner *= job.survey.side == "inside"
    zero = job.datum.plate_level_m
    taped, readings, places = None, [], []
    if job.strapping is not None:
        given = job.strapping
        reduced = reduce_straps(given, job.survey.shell_temperature_c, 2 * nominal)
        places = [i for i, reduced_strap in enumerate(reduced) if not reduced_strap.strap.check]
        seen = None if is_known else points  # those of a plan are nominal and show no form
        term, shape = area_term(given.shape_sd_m, amplitudes, nominal, seen)
        readings = readings_of_straps([reduced[i] for i in places], names, term)
        taped = reduced, term, shape
    if job.lines is not None:
        insets = inner if inner.any() else insets_of(job, job.switches)
        offsets, of_offsets = _offsets_of(job.lines, names, insets, points.sites)
        readings, places = readings + offsets, places + of_offsets
    told = told_courses(job, set(points.sites.course.tolist()))
    former = readings_of_untold(job, told, joints_m, zero)
    readings, places = readings + former, places + [-1] * len(former)
    readings = [
        _on_surface(reading, inner[reading.course], job.survey.side) for reading in readings
    ]
    if not is_known and len(np.unique(points.sites.course)) < len(names):
        amplitudes = None
    field, tested, readings = _joined_field(job, points, readings, amplitudes, (joints_m, zero))
    read = ReadWall(
        joints_m, zero, tuple(readings), np.array(places, dtype=int), tested, field, inner_m=inner
    )
    return read, None if taped is None else _straps_of(job, read, taped, inner)


def _offsets_of(lines, names, insets, sites):
    """`WallReading`s of the offsets that count, and their places; rings after those of points."""
    places = [i for i, offset in enumerate(lines.offsets) if not offset.check]
    found = readings_of_offsets(lines, [lines.offsets[i] for i in places], names, insets)
    first = int(sites.ring.max(initial=-1)) + 1
    return [one if one.ring < 0 else replace(one, ring=one.ring + first) for one in found], places


def _joined_field(job, points, readings, amplitudes, heights):
    """`WallField` of points and accepted readings, `Tested` of these, and they, about the centres
    of their levels.

    amplitudes  None: those that all of them tell
    heights     joints, and the table's zero above the bottom, m
    """
    n, k, nominal = len(points.radius_m), len(readings), job.tank.nominal_diameter_m / 2
    sites = sites_of(readings, *heights)
    both = points.unbound.padded(k).shared_by(_joined(points.sites, sites))
    is_bound = both.shared is None
    if sites.shared is not None:  # of lines: the last, as `ReadWall` has them
        own = np.pad(sites.shared, ((n, 0), (0, 0)))
        both = replace(both, shared=own if is_bound else np.hstack([both.shared, own]))
    columns = columns_of([reading.by_inputs for reading in readings])
    columns = {
        name: np.append(points.by_inputs.get(name, np.zeros(n)), columns.get(name, np.zeros(k)))
        for name in dict.fromkeys((*points.by_inputs, *columns))
    }
    noise = scipy.linalg.block_diag(points.noise_m2, noise_of(readings))
    noise += noise_by_inputs(job.inputs, columns, n + k)
    straps_may = is_bound or _circumferences(job) >= FEWEST_CIRCUMFERENCES
    may = [
        job.snooping and reading.of != FORMER and (straps_may or reading.of == "offsets")
        for reading in readings
    ]
    may_go = np.append(np.zeros(n), may)

    apart = points.unbound.first_apart
    if apart is None:
        apart = int(points.sites.ring.max(initial=-1)) + 1

    def field_of(accepted):
        some = np.flatnonzero(accepted)
        own, size = noise[np.ix_(some, some)], amplitudes
        if size is None:
            size = estimate_amplitudes(both.take(accepted), radius[some], own, nominal)
        return WallField(both.take(accepted), radius[some], own, size, nominal, plumbed=apart)

    radius, every = (
        np.append(points.radius_m, [reading.radius_m for reading in readings]),
        np.ones(n + k),
    )
    field = field_of(every > 0)
    if np.any(sites.ring >= 0):
        readings = off_centre(readings, field)
        radius = np.append(points.radius_m, [reading.radius_m for reading in readings])
        field = field_of(every > 0)
    field, tested = settle_readings(field, field_of, (both, radius, noise), may_go)
    parts = (tested.accepted, tested.departure_m, tested.w, tested.sd_m)
    return field, Tested(*(part[n:] for part in parts)), readings


def _circumferences(job):
    """How many were strapped and count; repeats are one."""
    if job.strapping is None:
        return 0
    return len({strap.name for strap in job.strapping.straps if not strap.check})


def _straps_of(job, read, taped, inner_m):
    """`Straps` of a `ReadWall`.

    taped  reduced circumferences, `AreaTerm`, and the shape that it follows from
    """
    reduced, term, shape = taped
    mine, tested = read.are("straps"), read.tested
    return Straps(
        reduced=reduced,
        adjusted=read.places[mine],
        accepted=tested.accepted[mine],
        w=read.tests_of("straps")[0],
        sd_m=tested.sd_m[mine],
        departure_m=tested.departure_m[mine],
        area_term=term,
        shape_sd_m=shape,
        radius_m=mean_radii(read.field) + inner_m,
        plate_sd_m=gauged_plates(job),
        tapes=tapes_used(job.strapping),
    )


def _on_surface(reading, inner_m, side):
    """A reading's radius on the surface that points are on: inside without plate and paint."""
    if side == "outside":
        return reading
    by = {name: reading.by_inputs.get(name, 0.0) - 1.0 for name in ("plate_thickness", "paint")}
    return replace(reading, radius_m=reading.radius_m - inner_m, by_inputs=reading.by_inputs | by)


def _joined(points, straps):
    """`Sites` of points, then of straps, without what they share."""
    names = ("course", "ring", "zeta", "azimuth_rad", "leans")
    return Sites(
        **{name: np.concatenate([getattr(points, name), getattr(straps, name)]) for name in names},
        welds_rad=points.welds_rad,
        points=tuple(np.concatenate(pair) for pair in zip(points.seen, straps.seen, strict=True)),
        spans=straps.spans,
        smoothed=points.smoothed,
    )
