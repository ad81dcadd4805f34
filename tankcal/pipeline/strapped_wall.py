"""A wall that a tape was put round, with lines of sight beside it or without.

A circumference is the mean radius of one level but for the area term (`geometry.girth`): the circle
of its perimeter has a larger area than the wall. So each reading counts as the radius of the circle
of equal area. Where straps alone were read, the courses are cylinders of such radii, as the
standards of strapping have them: what a course does between its straps (bulge, taper) is in the
doubt, and the field of the wall says how much it may. Offsets from reference lines carry the radius
of the strapped course to all others; then the wall is a surface of revolution.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.errors import SolutionError
from tankcal.geometry.field.amplitudes import estimate_amplitudes
from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.girth import perimeter_excess
from tankcal.messages import message
from tankcal.pipeline.read_wall import ReadWall
from tankcal.pipeline.tanks import insets_of, shell_zero
from tankcal.pipeline.wall import joints_of
from tankcal.pipeline.wall_readings import (
    factors_of_plates,
    factors_of_readings,
    inputs_read_with,
    names_of,
    noise_of,
    off_centre,
    readings_of_offsets,
    readings_of_straps,
    readings_of_untold,
    settle_readings,
    sites_of,
)
from tankcal.pipeline.wall_straps import (
    AreaTerm,
    Straps,
    gauged_plates,
    mean_radii,
    told_courses,
    typical_shape_m,
)
from tankcal.survey.strapping import Reduced, reduce_straps, tapes_used

STATED_BY_STRAPS, STATED_BY_LINES = (), ("mean",)


@dataclass(frozen=True)
class UprightAxis:
    """The axis of a shell whose lean nobody measured."""

    slope: tuple[float, float] = (0.0, 0.0)
    axis_m: tuple[float, float] = (0.0, 0.0)
    z_m: float = 0.0
    tilt: float = 0.0
    tilt_known: bool = False


@dataclass(frozen=True)
class TapedWall(ReadWall):
    """The courses of an upright tank, or the rings of a lying one, as strapped, with what a
    `ReadWall` has.

    Attributes
    ----------
    reduced : tuple of Reduced
        Of every reading of the tape, in the order of the file.
    area_term : AreaTerm
    plate_sd_m : dict
        {course index: standard uncertainty of its plate by a gauge}.
    tapes : tuple of (Tape, float)
        Those that were read, as they were corrected, and the standard uncertainty of their scale by
        the comparison with a master.
    shape_sd_m : float
        Declared: standard deviation of the radius round the wall.
    """

    reduced: tuple[Reduced, ...]
    area_term: AreaTerm
    plate_sd_m: dict
    tapes: tuple
    shape_sd_m: float

    @cached_property
    def radius_m(self):
        """(courses,) mean radius of each course as measured, of the circle of equal area."""
        return mean_radii(self.field)

    @cached_property
    def straps(self):
        """`Straps`: the circumferences, and what the wall says of them."""
        mine, tested = self.are("straps"), self.tested
        return Straps(
            reduced=self.reduced,
            adjusted=self.places[mine],
            accepted=tested.accepted[mine],
            w=self.tests_of("straps")[0],
            sd_m=tested.sd_m[mine],
            departure_m=tested.departure_m[mine],
            area_term=self.area_term,
            shape_sd_m=self.shape_sd_m,
            radius_m=self.radius_m,
            plate_sd_m=self.plate_sd_m,
            tapes=self.tapes,
        )

    def factors(self, job, weights):
        """`Factor`s of what the readings leave uncertain about features, (f, n) by their radii."""
        used, names = self.accepted, names_of(job.courses or job.rings)
        sees = 1 - np.array([reading.by_inputs.get("plate_thickness", 0.0) for reading in used])
        plates = factors_of_plates(names, self.field, weights * sees, self.plate_sd_m)
        return (*factors_of_readings(used, weights), *plates)

    def read_with(self, weights):
        """{input: (f,) derivative of features}: a tape that has the shell's temperature, plates
        that lines inside do not see.
        """
        return inputs_read_with(self.accepted, weights)


@dataclass(frozen=True)
class StrappedWall(TapedWall):
    """The wall of an upright tank as strapped."""

    surveyed_as = "strapped"
    shell = UprightAxis()
    without_inputs = ("offset",)  # of points; a tape has one of its own

    def lowest_outline(self, azimuth_rad):
        """(x, y) of the axis, and (n,) radii of the first course, m."""
        return 0.0, 0.0, np.full(len(azimuth_rad), self.radius_m[0])


def find_strapped_wall(job, progress, amplitudes=None):
    """`StrappedWall` of a job whose circumferences were measured by tape.

    amplitudes  of the wall's components where they are known beforehand; None: the readings tell
    """
    straps, lines = job.strapping, job.lines
    progress(
        message(
            "strapping",
            "reducing {count} readings of the tape to the courses of the shell",
            count=len(straps.straps),
        )
    )
    nominal, courses = job.tank.nominal_diameter_m / 2, [course.name for course in job.courses]
    reduced = reduce_straps(straps, job.survey.shell_temperature_c, 2 * nominal)
    places = [i for i, reduced_strap in enumerate(reduced) if not reduced_strap.strap.check]
    shape_m = typical_shape_m() if straps.shape_sd_m is None else straps.shape_sd_m
    term = AreaTerm(*perimeter_excess(shape_m, nominal))
    joints, zero = joints_of(job), shell_zero(job, None)
    readings = readings_of_straps([reduced[i] for i in places], courses, term)
    if lines is not None:
        progress(
            message(
                "plumbing",
                "adjusting {count} offsets from {lines} reference lines",
                count=len(lines.offsets),
                lines=len(lines.lines),
            )
        )
        kept = [i for i, offset in enumerate(lines.offsets) if not offset.check]
        used = [lines.offsets[i] for i in kept]
        insets = insets_of(job, job.switches)
        readings += readings_of_offsets(lines, used, courses, insets)
        places += kept
    former = readings_of_untold(job, told_courses(job, set()), joints, zero)
    readings, places = readings + former, places + [-1] * len(former)
    readings, tested, field = adjust_readings(
        readings, (joints, zero, nominal), amplitudes, snooping=job.snooping
    )
    return StrappedWall(
        joints_m=joints,
        zero_m=zero,
        readings=tuple(readings),
        places=np.array(places),
        tested=tested,
        field=field,
        reduced=reduced,
        area_term=term,
        plate_sd_m=gauged_plates(job),
        tapes=tapes_used(straps),
        shape_sd_m=shape_m,
    )


def adjust_readings(readings, sizes, amplitudes, *, snooping, bulge_scale=1.0):
    """Readings with the eccentricity of their rings, what became of each, and `WallField`.

    sizes        joints, the table's zero above the bottom, and the nominal radius, m
    bulge_scale  sizes of the bulges before the survey, over those of upright walls
    """
    joints_m, zero_m, nominal_m = sizes
    sites = replace(sites_of(readings, joints_m, zero_m), bulge_scale=bulge_scale)
    noise = noise_of(readings)
    if amplitudes is not None:
        amplitudes = amplitudes.with_bulges(bulge_scale)
    may_go = snooping * np.array([reading.of == "offsets" for reading in readings])

    def field_of(accepted):
        some = np.flatnonzero(accepted)
        kept, own = [readings[i] for i in some], noise[np.ix_(some, some)]
        return field_of_readings(sites.take(accepted), kept, own, nominal_m, amplitudes)

    accepted = np.ones(len(readings), dtype=bool)
    field = field_of(accepted)
    if np.any(sites.ring >= 0):
        readings = off_centre(readings, field)
        field = field_of(accepted)
    radius = np.array([reading.radius_m for reading in readings])
    field, tested = settle_readings(field, field_of, (sites, radius, noise), may_go)
    return readings, tested, field


def field_of_readings(sites, readings, noise_m2, nominal_m, amplitudes=None):
    """`WallField` of readings; SolutionError where they tell nothing.

    amplitudes  None: those that the readings tell
    """
    radius = np.array([reading.radius_m for reading in readings])
    by_lines = any(reading.of == "offsets" for reading in readings)
    stated = STATED_BY_LINES if by_lines else STATED_BY_STRAPS
    try:
        if amplitudes is None:
            amplitudes = estimate_amplitudes(sites, radius, noise_m2, nominal_m)
        field = WallField(sites, radius, noise_m2, amplitudes, nominal_m, stated=stated)
        sound = np.all(np.isfinite(field.outlines_m))
    except np.linalg.LinAlgError:
        sound = False
    if not sound and by_lines:
        raise SolutionError(
            message(
                "lines_tell_nothing",
                "offsets and readings of the tape together show no wall: check s_mm in offsets.csv"
                " and circumferences.csv, and u_scale_ppm, u_offset_mm, section_mm2 and e_gpa in"
                " instruments.toml",
            )
        )
    if not sound:
        raise SolutionError(
            message(
                "straps_tell_nothing",
                "the readings of the tape tell nothing beside its uncertainty: check u_scale_ppm,"
                " u_offset_mm, section_mm2 and e_gpa in instruments.toml",
            )
        )
    return field
