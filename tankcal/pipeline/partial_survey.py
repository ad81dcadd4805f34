"""An upright tank of which some courses were measured again: former radii, how they may have
changed, and what the survey of these courses finds (`radii_update`).

What was found of a course is compared as its radius is defined: of the mean area from joint to
joint, inside, the shell empty, at the temperature of the former radii. The tank of the survey alone
gives it, with the names of all that it leaves uncertain.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import SolutionError
from tankcal.geometry.field.components import KINDS
from tankcal.job.model import Bottom
from tankcal.messages import message
from tankcal.pipeline.radii_update import LARGEST_W, update_radii
from tankcal.pipeline.radii_wall import COMMON, Updated, causes_of, wall_of_radii
from tankcal.pipeline.strapped_wall import StrappedWall
from tankcal.pipeline.tanks import body_of
from tankcal.pipeline.wall_straps import told_courses
from tankcal.tank.factors import Factor

CHANGE_OWN, CHANGE_COMMON, SHARED = "radii_change", "radii_change_common", "course_radii_shared"
FORM = "measured_form"  # of the courses that were measured, between their readings
LEAST = 1e-9  # of the largest cause: a smaller one is rounding
NO_MEANING = ("datum", "course_heights")  # between joints: they move with what they bound
UNKNOWN_M = 1.0  # standard uncertainty of a radius that nobody knew


@dataclass(frozen=True)
class Found:
    """Radii of some courses as a survey alone finds them.

    Attributes
    ----------
    radius_m : ndarray, shape (k,)
    causes : tuple of Factor
        Of the survey's own, (k, c) m.
    by_inputs : dict
        {declared input: (k,) derivative of the radii}.
    noise_m2 : ndarray, shape (k, k)
        Of all that.
    """

    radius_m: np.ndarray
    causes: tuple[Factor, ...]
    by_inputs: dict
    noise_m2: np.ndarray


def update_by_survey(job, surveyed):
    """`RadiiWall` of a job whose radii stand beside a survey of some courses.

    Parameters
    ----------
    job : Job
        With radii and change.
    surveyed : Wall or StrappedWall
        Of that survey.

    Raises
    ------
    SolutionError
        Where the former radii do not explain what was found, or share more with the survey than
        that leaves uncertain.
    """
    measured = measured_courses(job, surveyed)
    found, radii, change = _found(job, surveyed, measured), job.radii, job.change
    former = np.where(radii.is_known, radii.radius_m, job.tank.nominal_diameter_m / 2)
    before = _causes_before(radii, change)
    prior = sum(one.columns @ one.columns.T for one in before)
    new = _without_shared(found.causes, change.shared_m)
    misclosure = found.radius_m - former[measured]
    update = update_radii(prior, measured, misclosure, found.noise_m2, change.shared_m)
    _refuse_surprise(job, update)
    causes = [one.mapped(lambda columns: update.kept @ columns) for one in before]
    causes += [one.mapped(lambda columns: update.gain @ columns) for one in new]
    if change.shared_m:
        both = (update.kept.sum(axis=1) + update.gain.sum(axis=1))[:, None] * change.shared_m
        causes = [_less_shared(one, radii, change.shared_m) for one in causes]
        causes.append(Factor(SHARED, both, u=1000 * change.shared_m, unit="mm", type="B"))
    by_inputs = {name: update.gain @ column for name, column in found.by_inputs.items()}
    wall = wall_of_radii(job, former + update.change_m, causes, by_inputs)
    u_found = np.sqrt(np.diag(found.noise_m2))
    more = Updated(surveyed, update, found.radius_m, u_found, np.sqrt(np.diag(prior)))
    return replace(wall, updated=more)


def measured_courses(job, surveyed):
    """(k,) indices of the courses that the survey tells, from the bottom up."""
    seen = set()
    if not isinstance(surveyed, StrappedWall):
        seen = {section.group.course for section in surveyed.sections}
    return np.array(sorted(told_courses(job, seen)), dtype=int)


def _found(job, surveyed, measured):
    """`Found` of the courses: sqrt(A / pi), A their mean area from joint to joint."""
    alone = replace(
        job,
        radii=None,
        change=None,
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
    body = body_of(alone, surveyed)
    courses = body.shell.volume.courses
    levels = np.array([courses[0].bottom_m, *(course.top_m for course in courses)])
    heights = np.diff(levels)[measured]

    def of_courses(values):
        return np.diff(values, axis=0)[measured]

    radius = np.sqrt(of_courses(body.volume_m3(levels)) / (np.pi * heights))
    per_m3 = 1 / (2 * np.pi * radius * heights)
    causes = [
        Factor(
            one.kind, per_m3[:, None] * of_courses(one.columns_m3), one.dof, one.u, one.unit,
            type=one.type, note=one.note, is_default=one.is_default,
        )
        for one in body.shell.sources(levels)
    ]  # fmt: skip
    causes = _named(causes)
    derivatives, declared = body.derivatives(levels), {one.name: one.u for one in job.inputs}
    by_inputs = {
        name: per_m3 * of_courses(derivatives[name])
        for name in declared
        if name in derivatives and name not in NO_MEANING
    }
    by_inputs = {name: one for name, one in by_inputs.items() if np.any(one)}
    noise = sum(one.columns @ one.columns.T for one in causes)
    for name, column in by_inputs.items():
        noise = noise + declared[name] ** 2 * np.outer(column, column)
    return Found(radius, causes, by_inputs, noise)


def _named(causes):
    """Causes that bear, the form of the wall between readings as one."""
    felt = LEAST * max(np.abs(one.columns).max(initial=0.0) for one in causes)
    causes = [one for one in causes if np.abs(one.columns).max(initial=0.0) > felt]
    of_form = [one for one in causes if one.kind in KINDS]
    others = tuple(one for one in causes if one.kind not in KINDS)
    if not of_form:
        return others
    columns = np.hstack([one.columns for one in of_form])
    by = "B" if any(one.type == "B" for one in of_form) else "A"
    return (*others, Factor(FORM, columns, type=by))


def _causes_before(radii, change):
    """`Factor`s of the former radii, and of how they may have changed since."""
    count, unknown = len(radii.radius_m), np.flatnonzero(~radii.is_known)
    common, own = causes_of(radii)
    wide = np.hstack([own.columns, UNKNOWN_M * np.eye(count)[:, unknown]])
    return (
        common,
        replace(own, columns=wide),
        Factor(
            CHANGE_COMMON, np.full((count, 1), change.common_m), u=1000 * change.common_m,
            unit="mm", type="B",
        ),
        Factor(CHANGE_OWN, change.own_m * np.eye(count), type="B"),
    )  # fmt: skip


def _less_shared(cause, radii, shared_m):
    """The common cause of the former radii without what the new survey shares with it."""
    if cause.kind != COMMON or not radii.u_common_m:
        return cause
    return cause.mapped(lambda columns: columns * np.sqrt(1 - (shared_m / radii.u_common_m) ** 2))


def _without_shared(causes, shared_m):
    """Causes of the survey without one that all of its courses share: F F' less shared^2 1 1'.

    With F a = shared 1 the rest is F (I - a a')^(1/2).
    """
    if not shared_m:
        return causes
    whole = np.hstack([one.columns for one in causes])
    all_of_them = np.full(len(whole), shared_m)
    a = np.linalg.lstsq(whole, all_of_them, rcond=None)[0]
    size = float(a @ a)
    if size > 1 or not np.allclose(whole @ a, all_of_them, rtol=1e-6):
        raise SolutionError(
            message(
                "shared_beyond_survey",
                "change.shared_mm = {shared:g} is more than the new survey leaves uncertain of all"
                " its courses together, {most:.2g} mm: a part of it was expected",
                shared=1000 * shared_m,
                most=1000 * shared_m / np.sqrt(size),
            )
        )
    rest = whole - (1 - np.sqrt(1 - size)) / size * np.outer(whole @ a, a)
    ends = np.cumsum([one.columns.shape[1] for one in causes])[:-1]
    parts = np.split(rest, ends, axis=1)
    return tuple(replace(one, columns=part) for one, part in zip(causes, parts, strict=True))


def _refuse_surprise(job, update):
    """Raise SolutionError for courses that the former radii do not explain."""
    far = np.flatnonzero(np.abs(update.w) > LARGEST_W)
    if not len(far):
        return
    told = [
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
        for i in far
    ]
    measure_all = message(
        "former_radii_refused",
        "the former radii do not explain what was found: measure all courses, or declare in"
        " [change] how far the tank may have changed",
    )
    raise SolutionError(measure_all, *told)
