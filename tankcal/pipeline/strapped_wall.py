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
from tankcal.geometry.field.blunders import Tested, restricted_precision
from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.field.sites import free_design
from tankcal.geometry.girth import perimeter_excess
from tankcal.messages import message
from tankcal.pipeline.tanks import insets_of, shell_zero
from tankcal.pipeline.wall import joints_of
from tankcal.pipeline.wall_readings import (
    columns_of,
    factors_of_plates,
    factors_of_readings,
    inputs_read_with,
    noise_of,
    readings_of_offsets,
    readings_of_straps,
    settle_readings,
    shared_effects,
    sites_of,
)
from tankcal.pipeline.wall_straps import AreaTerm, Straps, gauged_plates, mean_radii
from tankcal.survey.network.reliability import noncentrality
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
class StrappedWall:
    """The wall of a tank as strapped.

    Attributes
    ----------
    joints_m : ndarray, shape (courses + 1,)
        Heights of the joints above the bottom, m.
    zero_m : float
        Of the table's zero above it.
    reduced : tuple of Reduced
        Of every reading of the tape, in the order of the file.
    readings : tuple of WallReading
        That the wall was asked for: straps, then offsets; those that are only compared are not
        among them.
    places : ndarray of int, shape (n,)
        Of each of these among the readings of its file.
    tested : Tested
        What became of each; an infinite sd_m of those that no other reading controls.
    area_term : AreaTerm
    field : WallField
        Known from those that were accepted.
    plate_sd_m : dict
        {course index: standard uncertainty of its plate by a gauge}.
    tapes : tuple of (Tape, float)
        Those that were read, as they were corrected, and the standard uncertainty of their scale by
        the comparison with a master.
    shape_sd_m : float
        Declared: standard deviation of the radius round the wall.
    """

    joints_m: np.ndarray
    zero_m: float
    reduced: tuple[Reduced, ...]
    readings: tuple
    places: np.ndarray
    tested: Tested
    area_term: AreaTerm
    field: WallField
    plate_sd_m: dict
    tapes: tuple
    shape_sd_m: float
    shell = UprightAxis()
    without_inputs = ("offset",)  # of points; a tape has one of its own

    @cached_property
    def radius_m(self):
        """(courses,) mean radius of each course as measured, of the circle of equal area."""
        return mean_radii(self.field)

    def radius_at(self, course, level_m):
        """Mean radius at a height above the table's zero of a course, m."""
        low, high = self.joints_m[course], self.joints_m[course + 1]
        zeta = 2 * (level_m + self.zero_m - low) / (high - low) - 1
        return float(self.field.outlines_at([zeta])[course, 0, 0])

    def tests_of(self, kind):
        """(w, mdb_m, accepted) of each reading of a kind.

        w         its departure from what all others show over its sd; nan: no other controls it
        mdb_m     the smallest blunder of its radius, m, that this test finds; inf of such
        """
        chosen, tested = self._are(kind), self.tested
        w = np.where(np.isfinite(tested.sd_m), tested.w, np.nan)
        return w[chosen], noncentrality() * tested.sd_m[chosen], tested.accepted[chosen]

    @cached_property
    def straps(self):
        """`Straps`: the circumferences, and what the wall says of them."""
        mine, tested = self._are("straps"), self.tested
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

    @property
    def accepted(self):
        """The readings that the field is known from."""
        return [one for one, kept in zip(self.readings, self.tested.accepted, strict=True) if kept]

    @cached_property
    def collimations(self):
        """{plummet: (kappa, its standard uncertainty), rad}, as adjusted with the wall.

        One that nothing bound is an unknown; of one with a given uncertainty u, of column c,

            kappa = u^2 c' P y,   variance u^2 - u^4 c' P c.
        """
        found, used = {}, self.accepted
        unknowns = columns_of([one.free for one in self.readings])  # the order of `Sites.shared`
        for place, (kind, name) in enumerate(unknowns):
            if kind == "collimation":
                values, covariance = self.field.shared
                found[name] = float(values[place]), float(np.sqrt(covariance[place, place]))
        precision = None
        for (kind, name), (_, _, column) in shared_effects(used).items():
            if kind != "collimation":
                continue
            if precision is None:
                design = free_design(self.field.sites)[0]
                precision = restricted_precision(self.field.covariance_m2, design)
            u = next(one.effects[kind, name][0] for one in used if (kind, name) in one.effects)
            u = np.radians(u / 3600)
            share = column @ precision @ column
            found[name] = (
                float(u * (column @ precision @ self.field.radius_m)),
                float(u * np.sqrt(max(1 - share, 0.0))),
            )
        return found

    def lowest_outline(self, azimuth_rad):
        """(x, y) of the axis, and (n,) radii of the first course, m."""
        return 0.0, 0.0, np.full(len(azimuth_rad), self.radius_m[0])

    def factors(self, job, weights):
        """`Factor`s of what the readings leave uncertain about features, (f, n) by their radii."""
        used = self.accepted
        sees = 1 - np.array([one.by_inputs.get("plate_thickness", 0.0) for one in used])
        plates = factors_of_plates(job, self.field, weights * sees, self.plate_sd_m)
        return (*factors_of_readings(used, weights), *plates)

    def read_with(self, weights):
        """{input: (f,) derivative of features}: a tape that has the shell's temperature, plates
        that lines inside do not see.
        """
        return inputs_read_with(self.accepted, weights)

    def _are(self, kind):
        return np.array([one.of == kind for one in self.readings], dtype=bool)


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
    nominal, courses = job.tank.nominal_diameter_m / 2, [one.name for one in job.courses]
    reduced = reduce_straps(straps, job.survey.shell_temperature_c, 2 * nominal)
    places = [i for i, one in enumerate(reduced) if not one.strap.check]
    term = AreaTerm(*perimeter_excess(straps.shape_sd_m, nominal))
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
        kept = [i for i, one in enumerate(lines.offsets) if not one.check]
        used = [lines.offsets[i] for i in kept]
        insets = insets_of(job, job.switches)
        readings += readings_of_offsets(lines, used, courses, insets)
        places += kept
    joints, zero = joints_of(job), shell_zero(job, None)
    readings, tested, field = _adjusted(
        readings, (joints, zero, nominal), amplitudes, snooping=job.snooping
    )
    return StrappedWall(
        joints,
        zero,
        reduced,
        tuple(readings),
        np.array(places),
        tested,
        term,
        field,
        gauged_plates(job),
        tapes_used(straps),
        straps.shape_sd_m,
    )


def _adjusted(readings, sizes, amplitudes, *, snooping):
    """Readings with the eccentricity of their rings, what became of each, and `WallField`.

    sizes  joints, the table's zero above the bottom, and the nominal radius, m
    """
    joints_m, zero_m, nominal_m = sizes
    sites, noise = sites_of(readings, joints_m, zero_m), noise_of(readings)
    may_go = snooping * np.array([one.of == "offsets" for one in readings])

    def field_of(accepted):
        some = np.flatnonzero(accepted)
        kept, own = [readings[i] for i in some], noise[np.ix_(some, some)]
        return field_of_readings(sites.take(accepted), kept, own, nominal_m, amplitudes)

    accepted = np.ones(len(readings), dtype=bool)
    field = field_of(accepted)
    if np.any(sites.ring >= 0):
        readings = _off_centre(readings, field)
        field = field_of(accepted)
    radius = np.array([one.radius_m for one in readings])
    field, tested = settle_readings(field, field_of, (sites, radius, noise), may_go)
    return readings, tested, field


def _off_centre(readings, field):
    """The readings as from the centre of their level: R lacks (e x n)^2 / (2 rho) of a circle."""
    centres, found = field.centres_m, []
    for one in readings:
        if one.ring < 0:
            found.append(one)
            continue
        x, y = centres[one.ring]
        across = x * np.cos(one.azimuth_rad) - y * np.sin(one.azimuth_rad)
        found.append(replace(one, radius_m=one.radius_m + across**2 / (2 * field.nominal_m)))
    return found


def field_of_readings(sites, readings, noise_m2, nominal_m, amplitudes=None):
    """`WallField` of readings; SolutionError where they tell nothing.

    amplitudes  None: those that the readings tell
    """
    radius = np.array([one.radius_m for one in readings])
    by_lines = any(one.of == "offsets" for one in readings)
    stated = STATED_BY_LINES if by_lines else STATED_BY_STRAPS
    try:
        if amplitudes is None:
            amplitudes = estimate_amplitudes(sites, radius, noise_m2, nominal_m)
        field = WallField(sites, radius, noise_m2, amplitudes, nominal_m, stated=stated)
        sound = np.all(np.isfinite(field.outlines_m))
    except np.linalg.LinAlgError:
        sound = False
    if not sound:
        raise SolutionError(
            message(
                "straps_tell_nothing",
                "the readings of the tape tell nothing beside its uncertainty: check u_scale_ppm,"
                " u_offset_mm, section_mm2 and e_gpa in instruments.toml",
            )
        )
    return field
