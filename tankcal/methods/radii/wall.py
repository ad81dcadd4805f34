"""The wall of former radii, alone or updated by a survey of some courses.

Upright tank defined by the radii of its courses.

The radii come from a former table or record, or are declared. They are used alone, or updated by a
survey of some courses (`update_by_survey`).

Each radius is that of the circle of the mean area of a course, inside, shell empty, at its own
reference temperature. The volume up to a joint therefore depends on the radii alone. Between joints
the uncertainty includes the possible form of a course (`geometry.field.estimate`).

The new and the former radius of a course are compared under one definition: radius of the mean area
from joint to joint, inside, shell empty, at the temperature of the former radii. The survey gives
this radius from a tank of its own, with all its causes of uncertainty.

The radii r of n courses were determined once with an error and may have changed since. The former
radii are r_f = r + p, with p of covariance P. A new survey measures some of them, y = H r + q, with
q of covariance R. Both errors share causes such as the scale of a tape, with C = cov(p, q). Then

    misclosure  v = y - H r_f,  S = H P H' + R - H C - C' H',
    G = (P H' - C) S^-1,        r = r_f + G v,
    error of r  (I - G H) p + G q,

so each cause of p and of q propagates under its own name. Source: Robinson 1991 (best linear
unbiased prediction). For one course and C = 0 this is recalibration by conditioning on one
observation.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import SolutionError
from tankcal.geometry.field.components import KINDS
from tankcal.geometry.field.estimate import MeanField
from tankcal.job.model import Bottom
from tankcal.messages import message
from tankcal.methods.strapping.wall import StrappedWall
from tankcal.pipeline.tanks import body_of, shell_zero
from tankcal.pipeline.wall.finding import joints_of
from tankcal.pipeline.wall_straps import UprightAxis, courses_with_readings
from tankcal.tank.budgets import Factor
from tankcal.uncertainty import factor_of

OWN, COMMON = "course_radii", "course_radii_common"  # names of the causes in a budget


@dataclass(frozen=True)
class RadiiWall:
    """Wall of declared radii.

    Attributes
    ----------
    joints_m : ndarray, shape (courses + 1,)
        Heights of the joints above the bottom, m.
    zero_m : float
        Height of the table's zero above the bottom, m.
    radius_m : ndarray, shape (courses,)
        Radii, m.
    causes : tuple of Factor
        Causes of uncertainty of the radii, with columns (courses, c), m.
    by_inputs : dict
        {declared input: derivative (courses,) of the radii}, if a survey contributed.
    updated : Updated or None
        Survey of some courses.
    """

    joints_m: np.ndarray
    zero_m: float
    radius_m: np.ndarray
    causes: tuple[Factor, ...]
    by_inputs: dict
    updated: "Updated | None" = None
    surveyed_as = "radii"
    shell = UprightAxis()
    without_inputs = ("offset", "scale")  # of surveyed lengths
    has_applied_inputs = True
    straps = None

    @property
    def field(self):
        """`MeanField` of the radii."""
        return MeanField(self.radius_m)

    @property
    def surveyed(self):
        """Wall of the survey of some courses, or None without a survey."""
        return None if self.updated is None else self.updated.surveyed

    @property
    def covariance_m2(self):
        """Covariance of the radii without declared inputs, m2, shape (courses, courses)."""
        zero = np.zeros((len(self.radius_m), len(self.radius_m)))
        return sum((cause.columns @ cause.columns.T for cause in self.causes), start=zero)

    def covariance_with(self, inputs):
        """Covariance of the radii with declared inputs, m2, shape (courses, courses)."""
        u_of_inputs = {declared_input.name: declared_input.u for declared_input in inputs}
        covariance_m2 = self.covariance_m2
        for name, column in self.by_inputs.items():
            covariance_m2 = covariance_m2 + u_of_inputs.get(name, 0.0) ** 2 * np.outer(
                column, column
            )
        return covariance_m2

    def lowest_outline(self, azimuth_rad):
        """Position (x, y) of the axis and radii (n,) of the first course, m."""
        return 0.0, 0.0, np.full(len(azimuth_rad), self.radius_m[0])

    def factors(self, job, weights):
        """`Factor`s of the uncertainty of features, with weights (f, courses) of the radii."""
        return tuple(cause.mapped(lambda columns: weights @ columns) for cause in self.causes)

    def read_with(self, weights):
        """Derivatives (f,) of features by the inputs that affect a survey of some courses."""
        return {name: weights @ column for name, column in self.by_inputs.items()}


def find_radii_wall(job, progress):
    """`RadiiWall` of a job with declared radii and no survey."""
    progress(message("taking_radii", "taking the radii of {file}", file=job.radii.file))
    return wall_of_radii(job, job.radii.radius_m, causes_of(job.radii))


def wall_of_radii(job, radius_m, causes, by_inputs=None):
    """`RadiiWall` of radii (courses,), m, with causes and derivatives as in `RadiiWall`."""
    nonzero_causes = tuple(cause for cause in causes if np.any(cause.columns))
    return RadiiWall(
        joints_of(job), shell_zero(job, None), radius_m, nonzero_causes, by_inputs or {}
    )


def causes_of(radii):
    """`Factor`s of the uncertainty of `Radii`: common to all courses, and separate for each."""
    common = np.full((len(radii.radius_m), 1), radii.u_common_m)
    return (
        Factor(COMMON, common, u=1000 * radii.u_common_m, unit="mm"),
        Factor(OWN, factor_of(radii.covariance_m2)),
    )


def job_as_declared(job):
    """Job whose survey has the conditions of its radii: inside, empty, at their temperature."""
    temperature = job.radii.temperature_c
    if temperature == job.table.reference_temperature_c:
        temperature = None
    survey = replace(
        job.survey,
        side="inside",
        shell_temperature_c=temperature,
        liquid_level_m=None,
        liquid_density_kg_m3=None,
    )
    return replace(job, survey=survey)


CHANGE_OWN, CHANGE_COMMON, SHARED = "radii_change", "radii_change_common", "course_radii_shared"
FORM = "measured_form"  # form of the measured courses between their readings
LEAST = 1e-9  # relative size below which a cause counts as rounding
# These inputs move the joints together with the courses, so mean radii do not depend on them.
NO_MEANING = ("datum", "course_heights")
LARGEST_W = 3.0  # |w| of a course above which its former radius is rejected
UNKNOWN_M = 1.0  # prior standard uncertainty of a radius that was not known


@dataclass(frozen=True)
class RadiiUpdate:
    """Update of former radii by a survey of some courses.

    Attributes
    ----------
    measured : ndarray of int, shape (k,)
        Indices of the courses measured again.
    misclosure_m, sd_m : ndarray, shape (k,)
        New minus former radius, m, and its prior standard deviation, m.
    gain : ndarray, shape (courses, k)
        Gain matrix G.
    """

    measured: np.ndarray
    misclosure_m: np.ndarray
    sd_m: np.ndarray
    gain: np.ndarray

    @property
    def w(self):
        """Misclosures divided by their standard deviations, shape (k,)."""
        return self.misclosure_m / self.sd_m

    @property
    def change_m(self):
        """Change G v of the former radii, m, shape (courses,)."""
        return self.gain @ self.misclosure_m

    @property
    def kept(self):
        """Derivative I - G H of the updated radii by the former radii, shape (courses, courses)."""
        derivative = np.eye(len(self.gain))
        derivative[:, self.measured] -= self.gain
        return derivative


@dataclass(frozen=True)
class Updated:
    """Survey that updated former radii.

    Attributes
    ----------
    surveyed : Wall or StrappedWall
        Wall from the survey of some courses.
    update : RadiiUpdate
    found_m, u_found_m : ndarray, shape (k,)
        Radii of the measured courses by the survey alone, and their standard uncertainties, m.
    u_before_m : ndarray, shape (courses,)
        Standard uncertainties of the former radii, with the declared change, m.
    """

    surveyed: object
    update: RadiiUpdate
    found_m: np.ndarray
    u_found_m: np.ndarray
    u_before_m: np.ndarray


@dataclass(frozen=True)
class Found:
    """Radii of some courses determined by a survey alone.

    Attributes
    ----------
    radius_m : ndarray, shape (k,)
        Radii, m.
    causes : tuple of Factor
        Causes of uncertainty of the survey, with columns (k, c), m.
    by_inputs : dict
        {declared input: derivative (k,) of the radii}.
    noise_m2 : ndarray, shape (k, k)
        Covariance of the radii by all causes and inputs, m2.
    """

    radius_m: np.ndarray
    causes: tuple[Factor, ...]
    by_inputs: dict
    noise_m2: np.ndarray


def update_by_survey(job, surveyed, progress):
    """`RadiiWall` of a job that has former radii and a survey of some courses.

    Parameters
    ----------
    job : Job
        Job with radii and change.
    surveyed : Wall or StrappedWall
        Wall of the new survey.
    progress : callable
        Called with a line of text as the step begins.

    Raises
    ------
    SolutionError
        If the former radii do not explain the new radii, or if the declared shared uncertainty
        exceeds the uncertainty common to the new radii.
    """
    progress(message("updating_radii", "bringing the former radii up to date"))
    measured, radii, change = measured_courses(job, surveyed), job.radii, job.radii.change
    measured_radii = _radii_by_survey(job, surveyed, measured)
    former = np.where(radii.is_known, radii.radius_m, job.tank.nominal_diameter_m / 2)
    former_causes = _former_causes(radii, change)
    prior = sum(cause.columns @ cause.columns.T for cause in former_causes)
    survey_causes = _subtract_shared(measured_radii.causes, change.shared_m)
    misclosure = measured_radii.radius_m - former[measured]
    update = update_radii(prior, measured, misclosure, measured_radii.noise_m2, change.shared_m)
    _refuse_surprise(job, update)
    causes = [cause.mapped(lambda columns: update.kept @ columns) for cause in former_causes]
    causes += [cause.mapped(lambda columns: update.gain @ columns) for cause in survey_causes]
    if change.shared_m:
        shared_columns = (update.kept.sum(axis=1) + update.gain.sum(axis=1))[
            :, None
        ] * change.shared_m
        causes = [_less_shared(cause, radii, change.shared_m) for cause in causes]
        causes.append(Factor(SHARED, shared_columns, u=1000 * change.shared_m, unit="mm"))
    by_inputs = {name: update.gain @ column for name, column in measured_radii.by_inputs.items()}
    wall = wall_of_radii(job, former + update.change_m, causes, by_inputs)
    u_found = np.sqrt(np.diag(measured_radii.noise_m2))
    updated = Updated(surveyed, update, measured_radii.radius_m, u_found, np.sqrt(np.diag(prior)))
    return replace(wall, updated=updated)


def update_radii(prior_m2, measured, misclosure_m, noise_m2, shared_m=0.0):
    """`RadiiUpdate` of former radii.

    Parameters
    ----------
    prior_m2 : ndarray, shape (courses, courses)
        Covariance P of the former radii, including their possible change, m2.
    measured : ndarray of int, shape (k,)
        Indices of the courses measured again.
    misclosure_m : ndarray, shape (k,)
        New minus former radii, m.
    noise_m2 : ndarray, shape (k, k)
        Covariance R of the new radii, m2.
    shared_m : float
        Standard uncertainty common to all former and new radii, m: C = shared^2 1 1'.

    Examples
    --------
    Six courses with uncertainties of 0.7 mm (common) and 0.3 mm (each), changes of 0.8 mm (common)
    and 0.3 mm (each), and one course measured again with 0.5 mm:

    >>> prior = 1.13 * np.ones((6, 6)) + 0.18 * np.eye(6)
    >>> found = update_radii(prior, np.array([0]), np.array([1.2]), np.array([[0.25]]))
    >>> [round(float(one), 2) for one in (found.w[0], *found.change_m[:2])]
    [0.96, 1.01, 0.87]
    """
    measured = np.asarray(measured, dtype=int)
    common = shared_m**2
    spread = prior_m2[np.ix_(measured, measured)] + noise_m2 - 2 * common
    # The transposed system: S is symmetric, and P H' - C = (H P - C')'.
    gain = np.linalg.solve(spread, prior_m2[measured] - common).T
    return RadiiUpdate(measured, misclosure_m, np.sqrt(np.diag(spread)), gain)


def measured_courses(job, surveyed):
    """Indices (k,) of the courses that the survey determines, from the bottom up."""
    courses_of_points = set()
    if not isinstance(surveyed, StrappedWall):
        courses_of_points = {section.group.course for section in surveyed.sections}
    return np.array(sorted(courses_with_readings(job, courses_of_points)), dtype=int)


def _radii_by_survey(job, surveyed, measured):
    """Results of the measured courses: sqrt(A / pi), with A the mean area from joint to joint."""
    # No bottom, deadwood, roof or liquid: the radii then describe the empty shell alone.
    job_of_survey = replace(
        job,
        bottom=Bottom(),
        deadwood=(),
        roof=None,
        table=replace(
            job.table,
            reference_temperature_c=job.radii.temperature_c,
            liquid_density_kg_m3=0.0,
            other_densities_kg_m3=(),
        ),
    )
    body = body_of(job_of_survey, surveyed)
    courses = body.shell.volume.courses
    levels = np.array([courses[0].bottom_m, *(course.top_m for course in courses)])
    heights = np.diff(levels)[measured]

    def of_courses(values):
        return np.diff(values, axis=0)[measured]

    radius = np.sqrt(of_courses(body.volume_m3(levels)) / (np.pi * heights))
    # Derivative of r = sqrt(V / (pi h)) by the volume V of a course of height h.
    per_m3 = 1 / (2 * np.pi * radius * heights)
    causes = [
        Factor(
            cause.kind, per_m3[:, None] * of_courses(cause.columns_m3), cause.dof, cause.u,
            cause.unit,
            type=cause.type, note=cause.note, is_default=cause.is_default,
        )
        for cause in body.shell.sources(levels)
    ]  # fmt: skip
    causes = _significant_causes(causes)
    derivatives, declared = (
        body.derivatives(levels),
        {declared_input.name: declared_input.u for declared_input in job.inputs},
    )
    by_inputs = {
        name: per_m3 * of_courses(derivatives[name])
        for name in declared
        if name in derivatives and name not in NO_MEANING
    }
    by_inputs = {name: column for name, column in by_inputs.items() if np.any(column)}
    noise = sum(cause.columns @ cause.columns.T for cause in causes)
    for name, column in by_inputs.items():
        noise = noise + declared[name] ** 2 * np.outer(column, column)
    return Found(radius, causes, by_inputs, noise)


def _significant_causes(causes):
    """Causes above rounding, with all components of the form of the wall merged into `FORM`."""
    least_column_m = LEAST * max(np.abs(cause.columns).max(initial=0.0) for cause in causes)
    causes = [cause for cause in causes if np.abs(cause.columns).max(initial=0.0) > least_column_m]
    form_causes = [cause for cause in causes if cause.kind in KINDS]
    other_causes = tuple(cause for cause in causes if cause.kind not in KINDS)
    if not form_causes:
        return other_causes
    columns = np.hstack([cause.columns for cause in form_causes])
    return (*other_causes, Factor(FORM, columns))


def _former_causes(radii, change):
    """`Factor`s of the former radii and of their change since."""
    count, unknown = len(radii.radius_m), np.flatnonzero(~radii.is_known)
    common, separate = causes_of(radii)
    columns = np.hstack([separate.columns, UNKNOWN_M * np.eye(count)[:, unknown]])
    return (
        common,
        replace(separate, columns=columns),
        Factor(
            CHANGE_COMMON, np.full((count, 1), change.common_m), u=1000 * change.common_m,
            unit="mm",
        ),
        Factor(CHANGE_OWN, change.own_m * np.eye(count)),
    )  # fmt: skip


def _less_shared(cause, radii, shared_m):
    """The common cause of the former radii, without the part shared with the new survey."""
    if cause.kind != COMMON or not radii.u_common_m:
        return cause
    return cause.mapped(lambda columns: columns * np.sqrt(1 - (shared_m / radii.u_common_m) ** 2))


def _subtract_shared(causes, shared_m):
    """Causes of the survey without the shared part of all courses: F F' - shared^2 1 1'.

    With F a = shared 1 the remainder is F (I - a a')^(1/2).
    """
    if not shared_m:
        return causes
    columns = np.hstack([cause.columns for cause in causes])
    shared = np.full(len(columns), shared_m)
    a = np.linalg.lstsq(columns, shared, rcond=None)[0]
    norm2 = float(a @ a)
    if norm2 > 1 or not np.allclose(columns @ a, shared, rtol=1e-6):
        raise SolutionError(
            message(
                "shared_beyond_survey",
                "change.shared_mm = {shared:g} is more than the new survey leaves uncertain of all"
                " its courses together, {most:.2g} mm: a part of it was expected",
                shared=1000 * shared_m,
                most=1000 * shared_m / np.sqrt(norm2),
            )
        )
    # Rank-one square root of I - a a', applied from the right: F (I - (1 - sqrt(1 - a'a)) a a' /
    # a'a).
    remaining = columns - (1 - np.sqrt(1 - norm2)) / norm2 * np.outer(columns @ a, a)
    ends = np.cumsum([cause.columns.shape[1] for cause in causes])[:-1]
    parts = np.split(remaining, ends, axis=1)
    return tuple(replace(cause, columns=part) for cause, part in zip(causes, parts, strict=True))


def _refuse_surprise(job, update):
    """Raise SolutionError for courses whose new radius the former radii do not explain."""
    discrepant = np.flatnonzero(np.abs(update.w) > LARGEST_W)
    if not len(discrepant):
        return
    texts = [
        message(
            "former_radius_surprise",
            "course {course} was found {found:+.2f} mm from its former radius, {w:.2f} times the"
            " {sd:.2f} mm that were expected by its uncertainty, the declared change and the new"
            " survey; up to {most:g} times can be explained",
            course=job.courses[update.measured[i]].name,
            found=1000 * update.misclosure_m[i],
            sd=1000 * update.sd_m[i],
            w=abs(update.w[i]),
            most=LARGEST_W,
        )
        for i in discrepant
    ]
    measure_all = message(
        "former_radii_refused",
        "the former radii do not explain what was found: measure all courses, or declare in"
        " [change] how far the tank may have changed",
    )
    raise SolutionError(measure_all, *texts)
