"""A wall that a tape was put round: circumferences, the radii of its courses, and their doubt.

A circumference is the mean radius of one level but for the area term (`geometry.girth`): the circle
of its perimeter has a larger area than the wall. So each reading counts as the radius of the circle
of equal area,

    r = C / (2 pi sqrt(1 + excess)),

and the courses are cylinders of such radii, as the standards of strapping have them. What a course
does between its straps (bulge, taper) is in the doubt: the field of the wall says how much it may.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.errors import SolutionError
from tankcal.geometry.field.amplitudes import estimate_amplitudes
from tankcal.geometry.field.blunders import against_others, restricted_precision
from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.field.sites import Sites, free_design
from tankcal.geometry.girth import perimeter_excess
from tankcal.geometry.outlines import FULL_TURN
from tankcal.messages import message
from tankcal.pipeline.tanks import shell_zero
from tankcal.pipeline.wall import joints_of
from tankcal.survey.network.reliability import noncentrality
from tankcal.survey.strapping import Reduced, reduce_straps, tapes_used
from tankcal.tank.body import Factor

UNCONTROLLED = 1e-9  # of a reading's variance: what the others leave of it where there are none


@dataclass(frozen=True)
class UprightAxis:
    """The axis of a shell whose lean nobody measured."""

    slope: tuple[float, float] = (0.0, 0.0)
    axis_m: tuple[float, float] = (0.0, 0.0)
    z_m: float = 0.0
    tilt: float = 0.0
    tilt_known: bool = False


@dataclass(frozen=True)
class AreaTerm:
    """By how much the circle of a perimeter is larger than the wall: mean and sd, relative."""

    mean: float
    sd: float


@dataclass(frozen=True)
class StrappedWall:
    """The wall of a tank as strapped.

    Attributes
    ----------
    joints_m : ndarray, shape (courses + 1,)
        Heights of the joints above the bottom, m.
    reduced : tuple of Reduced
        Of every reading, in the order of the file.
    adjusted : ndarray of int
        Which of these the wall was taken from.
    area_term : AreaTerm
    field : WallField
        Known from the radii of these.
    plate_sd_m : dict
        {course index: standard uncertainty of its plate by a gauge}.
    tapes : tuple of (Tape, float)
        Those that were read, as they were corrected, and the standard uncertainty of their scale by
        the comparison with a master.
    """

    joints_m: np.ndarray
    reduced: tuple[Reduced, ...]
    adjusted: np.ndarray
    area_term: AreaTerm
    field: WallField
    plate_sd_m: dict
    tapes: tuple
    shell = UprightAxis()
    without_inputs = ("offset",)  # of points; a tape has one of its own

    @cached_property
    def radius_m(self):
        """(courses,) radius of each course as measured, of the circle of equal area."""
        return self.field.outlines_m[:, 0, 0]

    @cached_property
    def tests(self):
        """(w, mdb_m) of each adjusted reading, (n,) each: its departure from what all others show
        over its sd, and the smallest blunder of it, m of circumference, that the test finds; nan
        and inf of a reading that no other one controls.
        """
        whole = self.field.covariance_m2
        precision = restricted_precision(whole, free_design(self.field.sites)[0])
        radius = self.field.radius_m - self.field.radius_m.mean()
        found = against_others(precision, precision @ radius, np.ones(len(radius), dtype=bool))
        size = np.diag(precision)
        controlled = size * np.diag(whole) > UNCONTROLLED
        mdb = noncentrality() / np.sqrt(np.where(controlled, size, 1.0)) / self._per_m
        return np.where(controlled, found.w, np.nan), np.where(controlled, mdb, np.inf)

    @property
    def circumference_m(self):
        """(courses,) mean circumference of each, of the painted shell."""
        return FULL_TURN * self.radius_m * np.sqrt(1 + self.area_term.mean)

    def lowest_outline(self, azimuth_rad):
        """(x, y) of the axis, and (n,) radii of the first course, m."""
        return 0.0, 0.0, np.full(len(azimuth_rad), self.radius_m[0])

    def factors(self, job, weights):
        """`Factor`s of what the straps leave uncertain about features, (f, n) by their radii."""
        used = [self.reduced[i] for i in self.adjusted]
        own = weights * (np.array([one.sd_m for one in used]) * self._per_m)
        found = [Factor("straps", own)]
        for (kind, name), (effect, column) in self.shared.items():
            by = (weights @ column)[:, None]
            found.append(Factor(kind, by, u=effect.u, unit=effect.unit, type="B", note=name))
        for course, sd in self.plate_sd_m.items():
            by = weights @ (sd * (self.field.sites.course == course))
            found.append(Factor("plate_readings", by[:, None], note=job.courses[course].name))
        excess = -self.field.radius_m / (2 * (1 + self.area_term.mean)) * self.area_term.sd
        found.append(
            Factor("area_term", (weights @ excess)[:, None], u=1e6 * self.area_term.sd,
                   unit="ppm", type="B")
        )  # fmt: skip
        return tuple(one for one in found if np.any(one.columns))

    def read_with(self, weights):
        """{input: (f,) derivative of features}: the shell's temperature is that of the tape."""
        per_k = [self.reduced[i].by_shell_temperature_m for i in self.adjusted]
        if not any(per_k):
            return {}
        return {"shell_temperature": weights @ (np.array(per_k) * self._per_m)}

    @cached_property
    def shared(self):
        """{(kind, name): (Effect, (n,) what one u of it does to the radii)} of common causes."""
        return shared_effects([self.reduced[i] for i in self.adjusted], self._per_m)

    @property
    def _per_m(self):
        """(n,) m of radius per m of circumference."""
        return self.field.radius_m / [self.reduced[i].circumference_m for i in self.adjusted]


def shared_effects(used, per_m):
    """{(kind, name): (Effect, (n,) columns)} of readings, times per_m."""
    found = {}
    for place, one in enumerate(used):
        for effect in one.effects:
            kept = found.setdefault((effect.kind, effect.name), (effect, np.zeros(len(used))))
            kept[1][place] = effect.by_m * per_m[place]
    return found


def find_strapped_wall(job, progress):
    """`StrappedWall` of a job whose circumferences were measured by tape."""
    straps = job.strapping
    progress(
        message(
            "strapping",
            "reducing {count} readings of the tape to the courses of the shell",
            count=len(straps.straps),
        )
    )
    nominal = job.tank.nominal_diameter_m / 2
    reduced = reduce_straps(straps, job.survey.shell_temperature_c, 2 * nominal)
    adjusted = np.array([i for i, one in enumerate(reduced) if not one.strap.check])
    used = [reduced[i] for i in adjusted]
    joints = joints_of(job)
    sites = _sites(job, used, joints)
    term = AreaTerm(*perimeter_excess(straps.shape_sd_m, nominal))
    per_m = np.full(len(used), 1 / (FULL_TURN * np.sqrt(1 + term.mean)))
    radius = per_m * [one.circumference_m for one in used]
    noise = _noise(used, radius, per_m, term)
    field = field_of_straps(sites, radius, noise, nominal)
    plates = {
        index: straps.plate_sd_m[course.name]
        for index, course in enumerate(job.courses)
        if course.name in straps.plate_sd_m
    }
    return StrappedWall(joints, reduced, adjusted, term, field, plates, tapes_used(straps))


def field_of_straps(sites, radius_m, noise_m2, nominal_m):
    """`WallField` of the courses as cylinders; SolutionError where the readings tell nothing."""
    try:
        amplitudes = estimate_amplitudes(sites, radius_m, noise_m2, nominal_m)
        field = WallField(sites, radius_m, noise_m2, amplitudes, nominal_m, cylinders=True)
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


def _sites(job, used, joints_m):
    """`Sites` of readings: each the mean of a whole turn."""
    names = [course.name for course in job.courses]
    course = np.array([names.index(one.strap.course) for one in used])
    level = np.array([one.strap.level_m for one in used]) + shell_zero(job, None)
    low, high = joints_m[course], joints_m[course + 1]
    return Sites(
        course=course,
        ring=np.arange(len(used)),
        zeta=2 * (level - low) / (high - low) - 1,
        azimuth_rad=np.full(len(used), np.nan),
        leans=np.zeros(len(used), dtype=bool),
    )


def _noise(used, radius_m, per_m, term):
    """(n, n) covariance of the radii: what each reading has of its own, and what they share."""
    columns = [column for _, column in shared_effects(used, per_m).values()]
    common = np.column_stack([*columns, radius_m * term.sd / 2])
    return np.diag((per_m * [one.sd_m for one in used]) ** 2) + common @ common.T
