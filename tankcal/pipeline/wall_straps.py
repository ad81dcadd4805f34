"""Straps and offsets of a wall, with points or alone, as readings of one field.

A circumference is the mean radius of its level, except for the area term. The size of the area term
follows from the ovality and the seams that the points show. Inside points see the shell without
plate and paint, whereas a tape outside includes them.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np
import scipy.linalg
from scipy.special import stdtr

from tankcal.adjust import noncentrality
from tankcal.errors import SolutionError
from tankcal.geometry.field.amplitudes import estimate_amplitudes
from tankcal.geometry.field.blunders import ReadingTests
from tankcal.geometry.field.components import COMPONENTS, ROUND_SHAPES
from tankcal.geometry.field.estimate import LEVELS, WallField
from tankcal.geometry.field.sites import Sites
from tankcal.geometry.girth import Ring, perimeter_excess, seen_excess
from tankcal.messages import message
from tankcal.methods.base import accompanying_methods
from tankcal.pipeline.read_wall import (
    FORMER,
    ReadWall,
    columns_of,
    factors_of_plates,
    factors_of_readings,
    inputs_read_with,
    names_of,
    noise_by_inputs,
    noise_of,
    readings_of_offsets,
    readings_of_straps,
    readings_of_untold,
    reduce_to_centre,
    settle_readings,
    sites_of,
)
from tankcal.pipeline.tanks import insets_of
from tankcal.pipeline.wall.shared_unknowns import Unbound
from tankcal.quadrature import panels
from tankcal.survey.reference_line import courses_with_radius
from tankcal.survey.strapping import ReducedStrap, reduce_straps, tapes_used
from tankcal.units import FULL_TURN

# Least number of circumferences to reject one if they alone determine an offset of the points: of
# two contradictory circumferences either may be wrong.
FEWEST_CIRCUMFERENCES = 3
MOST_OF_RING = 200  # largest number of points of a ring for area term and hull


@dataclass(frozen=True)
class AreaTerm:
    """Relative excess of the circle of a perimeter over the area of the wall: mean and sd."""

    mean: float
    sd: float


def typical_shape_m():
    """Standard deviation of the radius round a typical shell, from `COMPONENTS`, m.

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
    """`AreaTerm` of a wall, and the underlying standard deviation of its radius, m.

    Parameters
    ----------
    shape_sd_m : float or None
        Declared standard deviation, m; None: from the ovality and seams of the amplitudes.
    amplitudes : Amplitudes
    nominal_m : float
        Nominal radius, m.
    points : PointsOfWall, optional
        Points whose outlines are used if no shape is declared; None for a plan.

    Returns
    -------
    (AreaTerm, float)
    """
    is_declared = shape_sd_m is not None
    if not is_declared:
        waves = [component.shape in ROUND_SHAPES for component in COMPONENTS]
        shape_sd_m = float(np.sqrt(amplitudes.likely_m2[waves].sum()))
    if is_declared or points is None:
        return AreaTerm(*perimeter_excess(shape_sd_m, nominal_m)), shape_sd_m
    return AreaTerm(*seen_excess(amplitudes, nominal_m, rings_of(points))), shape_sd_m


def rings_of(points):
    """`Ring`s of a `WallField` or of `PointsOfWall`, with at most MOST_OF_RING readings each."""
    rings, sites = [], points.sites
    for ring in np.unique(sites.ring[sites.ring >= 0]):
        of_ring = np.flatnonzero(sites.ring == ring)
        # The simulated outlines depend on this order.
        of_ring = of_ring[np.argsort(sites.azimuth_rad[of_ring] % FULL_TURN)]
        of_ring = of_ring[:: -(-len(of_ring) // MOST_OF_RING)]
        noise = points.noise_m2[np.ix_(of_ring, of_ring)]
        relative_height = float(sites.heights.up[of_ring].mean())
        rings.append(
            Ring(sites.azimuth_rad[of_ring], points.radius_m[of_ring], noise, relative_height)
        )
    return rings


@dataclass(frozen=True)
class Straps:
    """Circumferences by tape with their tests against the wall.

    Attributes
    ----------
    reduced : tuple of ReducedStrap
        All readings, in the order of the file.
    adjusted : ndarray of int, shape (k,)
        Indices of the adjusted readings; the other readings are checks.
    accepted : ndarray of bool, shape (k,)
        False if rejected because the other readings contradict it.
    w : ndarray, shape (k,)
        Normalised discrepancy from the other readings; nan if uncontrolled.
    sd_m : ndarray, shape (k,)
        Standard deviation of the discrepancy in radius, m; infinite if uncontrolled.
    departure_m : ndarray, shape (k,)
        Discrepancy in radius from the other readings, m.
    area_term : AreaTerm
    shape_sd_m : float
        Standard deviation of the radius round the wall that gives the area term, m.
    radius_m : ndarray, shape (courses,)
        Mean radius of the painted shell, as the circle of equal area, m.
    plate_sd_m : dict
        {course index: standard uncertainty of its gauged plate, m}.
    tapes : tuple of (Tape, float)
        Tapes used, and the standard uncertainties of their scale from a master.
    """

    reduced: tuple[ReducedStrap, ...]
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
        """Circumference divided by the radius of equal area."""
        return FULL_TURN * np.sqrt(1 + self.area_term.mean)

    @property
    def mdb_m(self):
        """Minimal detectable bias (k,) of each circumference, m; infinite if uncontrolled."""
        return noncentrality() * self.sd_m * self.per_radius

    @property
    def circumference_m(self):
        """Mean circumference of each course of the painted shell, m, shape (courses,)."""
        return self.radius_m * self.per_radius


def gauged_plates(job):
    """{index of a course or ring: standard uncertainty of its gauged plate, m} of a job."""
    plate_sd_m, parts = job.strapping.plate_sd_m, job.courses or job.rings
    return {i: plate_sd_m[part.name] for i, part in enumerate(parts) if part.name in plate_sd_m}


def mean_radii(field):
    """Mean radius of each course, m, shape (courses,)."""
    return field.outlines_m.mean(axis=2) @ panels([0.0, 1.0], LEVELS)[1]


@dataclass(frozen=True)
class PointsOfWall:
    """Radii of a wall from points.

    Attributes
    ----------
    sites : Sites
        Positions of the radii.
    radius_m : ndarray, shape (n,)
        Radii, m.
    noise_m2 : ndarray, shape (n, n)
        Covariance of the radii, m2.
    unbound : Unbound
        Derivatives by unknowns without a prior.
    by_inputs : dict
        {input of the budget: derivative (n,) of the radii}.
    """

    sites: Sites
    radius_m: np.ndarray
    noise_m2: np.ndarray
    unbound: Unbound
    by_inputs: dict = field(default_factory=dict)


def courses_with_readings(job, seen):
    """Indices of the courses measured by points (the set `seen`), straps or reference lines."""
    place = {course.name: i for i, course in enumerate(job.courses)}
    strapped, of_lines = set(), set()
    for method in accompanying_methods(job):
        courses = strapped if method.replaces_points else of_lines
        courses.update(place[name] for name in method.courses_read(job))
    return courses_with_radius(seen, strapped, of_lines)


def join_readings(job, points, amplitudes, joints_m, *, is_known):
    """Field of a wall from its points, straps and offsets from reference lines.

    Parameters
    ----------
    job : Job
        Job with straps, reference lines or both.
    points : PointsOfWall
    amplitudes : Amplitudes
        Amplitudes of the wall from its points.
    joints_m : ndarray, shape (courses + 1,)
        Heights of the joints, m.
    is_known : bool
        Whether the amplitudes are known, as in a plan. If not, and if some courses lack points,
        they are estimated again from all readings.

    Returns
    -------
    read : ReadWall
        Its field contains the points, then the accepted readings, on the surface of the points.
    straps : Straps or None
    """
    nominal, names = job.tank.nominal_diameter_m / 2, [course.name for course in job.courses]
    inner = np.array([course.thickness_m + course.paint_m for course in job.courses])
    inner *= job.survey.side == "inside"
    zero = job.datum.plate_level_m
    tape_results, readings, places = None, [], []
    if job.strapping is not None:
        strapping = job.strapping
        reduced = reduce_straps(strapping, job.survey.shell_temperature_c, 2 * nominal)
        places = [i for i, reduced_strap in enumerate(reduced) if not reduced_strap.strap.check]
        # Points of a plan are nominal, without form.
        points_with_form = None if is_known else points
        term, shape = area_term(strapping.shape_sd_m, amplitudes, nominal, points_with_form)
        readings = readings_of_straps([reduced[i] for i in places], names, term)
        tape_results = reduced, term, shape
    if job.lines is not None:
        insets = inner if inner.any() else insets_of(job, job.switches)
        offsets, of_offsets = _offsets_of(job.lines, names, insets, points.sites)
        readings, places = readings + offsets, places + of_offsets
    measured = courses_with_readings(job, set(points.sites.course.tolist()))
    former = readings_of_untold(job, measured, joints_m, zero)
    readings, places = readings + former, places + [-1] * len(former)
    readings = [
        _move_to_surface(reading, inner[reading.course], job.survey.side) for reading in readings
    ]
    if not is_known and len(np.unique(points.sites.course)) < len(names):
        amplitudes = None
    field, tested, readings = _joined_field(job, points, readings, amplitudes, (joints_m, zero))
    read_wall = ReadWall(
        joints_m, zero, tuple(readings), np.array(places, dtype=int), tested, field, inner_m=inner
    )
    return read_wall, None if tape_results is None else _straps_of(
        job, read_wall, tape_results, inner
    )


def _offsets_of(lines, names, insets, sites):
    """`WallReading`s of the adjusted offsets and their indices; rings follow those of points."""
    places = [i for i, offset in enumerate(lines.offsets) if not offset.check]
    readings = readings_of_offsets(lines, [lines.offsets[i] for i in places], names, insets)
    first = int(sites.ring.max(initial=-1)) + 1
    return [
        reading if reading.ring < 0 else replace(reading, ring=reading.ring + first)
        for reading in readings
    ], places


def _joined_field(job, points, readings, amplitudes, heights):
    """`WallField` of points and accepted readings, `ReadingTests`, and centred readings.

    Parameters
    ----------
    job : Job
    points : PointsOfWall
    readings : list of WallReading, length k
    amplitudes : Amplitudes or None
        None: estimated from all readings.
    heights : tuple
        Heights of the joints, (courses + 1,), and of the table's zero above the bottom, m.

    Returns
    -------
    field : WallField
    tested : ReadingTests
    readings : list of WallReading
        Reduced to the centres of their levels.
    """
    n, k, nominal = len(points.radius_m), len(readings), job.tank.nominal_diameter_m / 2
    sites = sites_of(readings, *heights)
    all_sites = points.unbound.padded(k).shared_by(_join_sites(points.sites, sites))
    is_bound = all_sites.shared is None
    if sites.shared is not None:  # unknowns of lines are last, as `ReadWall` expects
        line_columns = np.pad(sites.shared, ((n, 0), (0, 0)))
        all_sites = replace(
            all_sites,
            shared=line_columns if is_bound else np.hstack([all_sites.shared, line_columns]),
        )
    columns = columns_of([reading.by_inputs for reading in readings])
    columns = {
        name: np.append(points.by_inputs.get(name, np.zeros(n)), columns.get(name, np.zeros(k)))
        for name in dict.fromkeys((*points.by_inputs, *columns))
    }
    # Readings and points are independent, except for declared inputs such as plates and
    # temperature.
    noise = scipy.linalg.block_diag(points.noise_m2, noise_of(readings))
    noise += noise_by_inputs(job.inputs, columns, n + k)
    # If straps alone determine a free offset, two of them cannot show which is wrong.
    straps_may = is_bound or _circumferences(job) >= FEWEST_CIRCUMFERENCES
    may = [
        job.snooping and reading.of != FORMER and (straps_may or reading.of == "offsets")
        for reading in readings
    ]
    may_go = np.append(np.zeros(n), may)

    # Rings of offsets have centres of their own, which are not part of the outlines of the points.
    apart = points.unbound.first_apart
    if apart is None:
        apart = int(points.sites.ring.max(initial=-1)) + 1

    def field_of(accepted):
        """Field of the points and the accepted readings."""
        rows = np.flatnonzero(accepted)
        noise_of_rows, amplitudes_used = noise[np.ix_(rows, rows)], amplitudes
        if amplitudes_used is None:
            amplitudes_used = estimate_amplitudes(
                all_sites.take(accepted), radius[rows], noise_of_rows, nominal
            )
        return WallField(
            all_sites.take(accepted),
            radius[rows],
            noise_of_rows,
            amplitudes_used,
            nominal,
            plumbed=apart,
        )

    radius, accepted_at_first = (
        np.append(points.radius_m, [reading.radius_m for reading in readings]),
        np.ones(n + k),
    )
    field = field_of(accepted_at_first > 0)
    if np.any(sites.ring >= 0):
        # The centres of the rings are known only from a first solution.
        readings = reduce_to_centre(readings, field)
        radius = np.append(points.radius_m, [reading.radius_m for reading in readings])
        field = field_of(accepted_at_first > 0)
    field, tested = settle_readings(field, field_of, (all_sites, radius, noise), may_go)
    parts = (tested.accepted, tested.departure_m, tested.w, tested.sd_m)
    return field, ReadingTests(*(part[n:] for part in parts)), readings


def _circumferences(job):
    """Number of adjusted circumferences; repeats count once."""
    if job.strapping is None:
        return 0
    return len({strap.name for strap in job.strapping.straps if not strap.check})


def _straps_of(job, read, taped, inner_m):
    """`Straps` of a `ReadWall`.

    Parameters
    ----------
    job : Job
    read : ReadWall
    taped : tuple
        Reduced circumferences, `AreaTerm`, and the standard deviation of the shape, m.
    inner_m : ndarray, shape (courses,)
        Plate and paint between the surface of the points and the outside, m.
    """
    reduced, term, shape = taped
    is_strap, tested = read.are("straps"), read.tested
    return Straps(
        reduced=reduced,
        adjusted=read.places[is_strap],
        accepted=tested.accepted[is_strap],
        w=read.tests_of("straps")[0],
        sd_m=tested.sd_m[is_strap],
        departure_m=tested.departure_m[is_strap],
        area_term=term,
        shape_sd_m=shape,
        radius_m=mean_radii(read.field) + inner_m,
        plate_sd_m=gauged_plates(job),
        tapes=tapes_used(job.strapping),
    )


def _move_to_surface(reading, inner_m, side):
    """Reading with its radius on the surface of the points: inside without plate and paint."""
    if side == "outside":
        return reading
    by_inputs = {
        name: reading.by_inputs.get(name, 0.0) - 1.0 for name in ("plate_thickness", "paint")
    }
    return replace(
        reading, radius_m=reading.radius_m - inner_m, by_inputs=reading.by_inputs | by_inputs
    )


def _join_sites(points, straps):
    """`Sites` of points, then of straps, without shared columns."""
    names = ("course", "ring", "zeta", "azimuth_rad", "leans")
    return Sites(
        **{name: np.concatenate([getattr(points, name), getattr(straps, name)]) for name in names},
        welds_rad=points.welds_rad,
        points=tuple(np.concatenate(pair) for pair in zip(points.seen, straps.seen, strict=True)),
        spans=straps.spans,
        smoothed=points.smoothed,
    )


STATED_BY_STRAPS, STATED_BY_LINES = (), ("mean",)
# An exchange must leave at most this share of the sum of steps between courses, and reduce the sum
# by at least this length, m.
EXCHANGED_SHARE, EXCHANGED_M = 0.4, 1.5e-3
BY_CHANCE = 0.05  # largest probability of the same finding by chance, for valid courses
DRAWS = 1000  # number of simulated valid shells
FEWEST_COURSES = 4  # smallest number of courses for the test of a single course


@dataclass(frozen=True)
class UprightAxis:
    """Axis of a shell whose tilt was not measured."""

    slope: tuple[float, float] = (0.0, 0.0)
    axis_m: tuple[float, float] = (0.0, 0.0)
    z_m: float = 0.0
    tilt: float = 0.0
    tilt_known: bool = False


@dataclass(frozen=True)
class TapedWall(ReadWall):
    """Strapped courses of an upright tank or rings of a horizontal tank; extends `ReadWall`.

    Attributes
    ----------
    reduced : tuple of ReducedStrap
        All readings of the tape, in the order of the file.
    area_term : AreaTerm
    plate_sd_m : dict
        {course index: standard uncertainty of its gauged plate, m}.
    tapes : tuple of (Tape, float)
        Tapes used, with their corrections, and the standard uncertainties of their scale from the
        comparison with a master.
    shape_sd_m : float
        Declared standard deviation of the radius round the wall, m.
    """

    reduced: tuple[ReducedStrap, ...]
    area_term: AreaTerm
    plate_sd_m: dict
    tapes: tuple
    shape_sd_m: float

    @cached_property
    def radius_m(self):
        """Mean radius of each course, as the circle of equal area, m, shape (courses,)."""
        return mean_radii(self.field)

    @cached_property
    def straps(self):
        """`Straps`: the circumferences with their tests against the wall."""
        is_strap, tested = self.are("straps"), self.tested
        return Straps(
            reduced=self.reduced,
            adjusted=self.places[is_strap],
            accepted=tested.accepted[is_strap],
            w=self.tests_of("straps")[0],
            sd_m=tested.sd_m[is_strap],
            departure_m=tested.departure_m[is_strap],
            area_term=self.area_term,
            shape_sd_m=self.shape_sd_m,
            radius_m=self.radius_m,
            plate_sd_m=self.plate_sd_m,
            tapes=self.tapes,
        )

    def factors(self, job, weights):
        """`Factor`s of the uncertainty of features, with derivatives (f, n) by the readings."""
        accepted, names = self.accepted, names_of(job.courses or job.rings)
        sees = 1 - np.array([reading.by_inputs.get("plate_thickness", 0.0) for reading in accepted])
        plates = factors_of_plates(names, self.field, weights * sees, self.plate_sd_m)
        return (*factors_of_readings(accepted, weights), *plates)

    def read_with(self, weights):
        """Derivatives (f,) of features by inputs on which the readings depend.

        Such inputs are the temperature that a tape shares with the shell, and plates that inside
        lines do not see.
        """
        return inputs_read_with(self.accepted, weights)


def adjust_readings(readings, sizes, amplitudes, *, snooping, bulge_scale=1.0):
    """Adjust readings of a wall, correct the eccentricity of their rings, and test them.

    Parameters
    ----------
    readings : list of WallReading
    sizes : tuple
        Heights of the joints, (courses + 1,), height of the table's zero above the bottom, and
        nominal radius, m.
    amplitudes : Amplitudes or None
        Known amplitudes; None: estimated from the readings.
    snooping : bool
        Whether offsets may be rejected.
    bulge_scale : float
        Prior size of the bulges relative to upright walls.

    Returns
    -------
    readings : list of WallReading
        With the radii corrected for eccentricity.
    tested : ReadingTests
    field : WallField
    """
    joints_m, zero_m, nominal_m = sizes
    sites = replace(sites_of(readings, joints_m, zero_m), bulge_scale=bulge_scale)
    noise = noise_of(readings)
    if amplitudes is not None:
        amplitudes = amplitudes.scale_bulges(bulge_scale)
    may_go = snooping * np.array([reading.of == "offsets" for reading in readings])

    def field_of(accepted):
        """Field of the accepted readings."""
        rows = np.flatnonzero(accepted)
        rows_kept, noise_of_rows = [readings[i] for i in rows], noise[np.ix_(rows, rows)]
        return field_of_readings(
            sites.take(accepted), rows_kept, noise_of_rows, nominal_m, amplitudes
        )

    accepted = np.ones(len(readings), dtype=bool)
    field = field_of(accepted)
    if np.any(sites.ring >= 0):
        # The centres of the rings are known only from a first solution.
        readings = reduce_to_centre(readings, field)
        field = field_of(accepted)
    radius = np.array([reading.radius_m for reading in readings])
    field, tested = settle_readings(field, field_of, (sites, radius, noise), may_go)
    return readings, tested, field


def field_of_readings(sites, readings, noise_m2, nominal_m, amplitudes=None):
    """`WallField` of readings; SolutionError if the readings do not determine a wall.

    Parameters
    ----------
    sites : Sites
    readings : sequence of WallReading, length n
    noise_m2 : ndarray, shape (n, n)
        Covariance of the radii, m2.
    nominal_m : float
        Nominal radius, m.
    amplitudes : Amplitudes, optional
        None: estimated from the readings.
    """
    radius = np.array([reading.radius_m for reading in readings])
    by_lines = any(reading.of == "offsets" for reading in readings)
    stated = STATED_BY_LINES if by_lines else STATED_BY_STRAPS
    try:
        if amplitudes is None:
            amplitudes = estimate_amplitudes(sites, radius, noise_m2, nominal_m)
        field = WallField(sites, radius, noise_m2, amplitudes, nominal_m, stated=stated)
        is_valid = np.all(np.isfinite(field.outlines_m))
    except np.linalg.LinAlgError:
        is_valid = False
    if not is_valid and by_lines:
        raise SolutionError(
            message(
                "lines_tell_nothing",
                "offsets and readings of the tape together show no wall: check s_mm in offsets.csv"
                " and circumferences.csv, and u_scale_ppm, u_offset_mm, section_mm2 and e_gpa in"
                " instruments.toml",
            )
        )
    if not is_valid:
        raise SolutionError(
            message(
                "straps_tell_nothing",
                "the readings of the tape tell nothing beside its uncertainty: check u_scale_ppm,"
                " u_offset_mm, section_mm2 and e_gpa in instruments.toml",
            )
        )
    return field


# ---- comparison of courses


def exchanged_courses(outside_m, plates_m, candidates):
    """Find the pair of courses that seem exchanged, by the steps between neighbouring courses.

    Parameters
    ----------
    outside_m, plates_m : ndarray, shape (courses,)
        Radius of the outside, and thickness of plate with paint.
    both : sequence of int
        Courses that may be exchanged.

    Returns
    -------
    (int, int, float, float) or None
        The pair, the sum of the steps after its exchange, and the sum as read, m. None if the
        exchange reduces the sum too little, or if an exchange improves more than one in twenty
        simulated shells with the same scatter as much by chance.

    Examples
    --------
    >>> plates = np.array([10, 9, 8, 7, 6.3, 6.3]) / 1000
    >>> inside = 6.5 + np.array([0.1, -0.2, 0.2, 0.0, -0.1, 0.1]) / 1000
    >>> exchanged_courses((inside + plates)[[0, 4, 2, 3, 1, 5]], plates, range(6))[:2]
    (1, 4)
    """
    if len(candidates) < 2:
        return None
    inside = outside_m - plates_m
    steps = float(_sum_steps(inside))
    sums, pairs = _sum_steps_exchanged(outside_m, plates_m, candidates)
    best = int(np.argmin(sums))
    if sums[best] >= EXCHANGED_SHARE * steps or steps - sums[best] <= EXCHANGED_M:
        return None
    simulated = np.random.default_rng(0).normal(size=(DRAWS, len(inside))) * np.std(inside, ddof=1)
    # Simulated shells have the scatter of the inside radii; their best exchange shows what chance
    # achieves.
    shares = np.min(
        _sum_steps_exchanged(simulated + plates_m, plates_m, candidates)[0], axis=-1
    ) / _sum_steps(simulated)
    if np.mean(shares <= sums[best] / steps) > BY_CHANCE:
        return None
    return *pairs[best], float(sums[best]), steps


def _sum_steps_exchanged(outside_m, plates_m, candidates):
    """Sums of steps (..., k) after the exchange of each of k pairs of courses, and the pairs."""
    pairs, sums = list(combinations(candidates, 2)), []
    for i, k in pairs:
        exchanged = outside_m.copy()
        exchanged[..., [i, k]] = outside_m[..., [k, i]]
        sums.append(_sum_steps(exchanged - plates_m))
    return np.stack(sums, axis=-1), pairs


def _sum_steps(radii_m):
    """Sum (...) of the steps between neighbouring courses, for radii (..., courses)."""
    return np.abs(np.diff(radii_m, axis=-1)).sum(axis=-1)


def course_apart(inside_m, least_m):
    """Find the course whose radius differs from all other courses.

    Parameters
    ----------
    inside_m : ndarray, shape (courses,)
        Inside radii.
    least_m : float
        Smallest difference.

    Returns
    -------
    (int, float) or None
        The course, and its radius less the mean radius of the others, m. None if one in twenty
        valid shells or more would have so large a difference by chance.

    Notes
    -----
    The test is that of Grubbs (1950). With the standard deviation s of the other n - 1 radii and
    the
    difference d from their mean, d / s / sqrt(1 + 1 / (n - 1)) is Student's t with n - 2 degrees of
    freedom.

    Examples
    --------
    >>> inside = 6.5 + np.array([7.2, -0.2, 0.2, 0.0, -0.1, 0.1]) / 1000
    >>> place, away = course_apart(inside, 2e-3)
    >>> place, round(1000 * away, 1)
    (0, 7.2)
    >>> course_apart(inside, 8e-3)
    """
    count = len(inside_m)
    if count < FEWEST_COURSES:
        return None
    mean_of_others_m = (inside_m.sum() - inside_m) / (count - 1)
    away = inside_m - mean_of_others_m
    course = int(np.argmax(np.abs(away)))
    sd = np.std(np.delete(inside_m, course), ddof=1) * np.sqrt(1 + 1 / (count - 1))
    # Two-sided probability, times the number of courses because the most deviating course is
    # tested.
    probability = 2 * count * stdtr(count - 2, -abs(away[course]) / max(sd, 1e-9))
    is_apart = abs(away[course]) > least_m and probability < BY_CHANCE
    return (course, float(away[course])) if is_apart else None
