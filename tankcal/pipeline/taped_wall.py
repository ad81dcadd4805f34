"""Wall of readings by tape, with or without reference lines, and the adjustment of its readings."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.special import stdtr

from tankcal.errors import SolutionError
from tankcal.geometry.field.amplitudes import estimate_amplitudes
from tankcal.geometry.field.estimate import WallField
from tankcal.messages import message
from tankcal.pipeline.read_wall import (
    ReadWall,
    factors_of_plates,
    factors_of_readings,
    inputs_read_with,
    names_of,
    noise_of,
    off_centre,
    settle_readings,
    sites_of,
)
from tankcal.pipeline.wall_straps import (
    AreaTerm,
    Straps,
    mean_radii,
)
from tankcal.survey.strapping import ReducedStrap

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
        readings = off_centre(readings, field)
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
