"""The main job on one screen: a checked job in, sections, volumes and the capacity table out."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
import scipy.sparse

from tankcal.capacity import Capacity, Propagation, table_heights
from tankcal.errors import InputError, Problem
from tankcal.job import Job
from tankcal.outlines import FULL_TURN, Components, estimate_components, evenly_spread, polar
from tankcal.sections import (
    Section,
    fit_circle,
    fit_section,
    group_by_height,
    group_by_name,
    radial_covariance,
    slide,
)
from tankcal.shell import Shell, course_of, find_shell
from tankcal.uncertainty import factor_of
from tankcal.volumes import ShellVolume, course_shape, feature_jacobian

LEAST_NOISE_M = 1e-6  # perfect points would have no covariance at all
FEWEST_POINTS, ADVISED_POINTS = 5, 10  # of a section
WIDE_GAP_DEG = 45


@dataclass(frozen=True)
class Result:
    """Everything that a job gave; `capacity` is the table as a DataFrame.

    wall         (m,) indices of the accepted points in job.points
    noise        variance components of the sections; None when no estimate was needed
    gross        the shell as surveyed, without any correction
    propagation  the shell inside, corrected, and what is uncertain about it
    """

    job: Job
    shell: Shell
    joints_m: np.ndarray
    wall: np.ndarray
    covariance_m2: object
    noise: Components | None
    sections: tuple[Section, ...]
    gross: ShellVolume
    propagation: Propagation
    table: Capacity
    warnings: tuple[Problem, ...]

    @property
    def volume(self):
        """The inside of the shell, with all corrections (`volumes.ShellVolume`)."""
        return self.propagation.volume

    @property
    def zero_m(self):
        """Height of the table's zero (dip plate, or bottom) above the bottom."""
        return zero_height(self.job)

    @property
    def capacity(self):
        """The capacity table: height_m, volume_m3, u_m3, k, U_m3."""
        table = self.table
        return pd.DataFrame(
            {
                "height_m": table.height_m,
                "volume_m3": table.volume_m3,
                "u_m3": table.u_m3,
                "k": table.k,
                "U_m3": table.U_m3,
            }
        )

    def at(self, height_m):
        """Volume at a dip, with its uncertainty (`capacity.Quantity`); HeightError outside."""
        return self.table.at(height_m)

    def delivery(self, low_m, high_m):
        """Volume between two dips, with its own uncertainty; HeightError outside."""
        return self.table.delivery(low_m, high_m)


def run(job, progress=None):
    """Compute a job: wall and axis, sections, volumes, capacity table with its covariance.

    progress  called with a line of text as each step begins
    Raises InputError when a course is left with too few points, SolutionError without a wall.
    """
    tell = progress or (lambda text: None)
    tell(f"separating the wall from clutter in {len(job.points.names)} points")
    heights = np.cumsum([0.0] + [course.height_m for course in job.courses])
    shell = find_shell(
        job.points.xyz_m,
        job.datum.bottom_z_m + heights,
        job.tank.nominal_diameter_m / 2,
        snooping=job.snooping,
    )
    wall = np.flatnonzero(shell.reason == "")
    joints = heights / np.hypot(1.0, shell.tilt)  # along the vertical: times cos(angle)
    tell(f"fitting sections through {len(wall)} points of the wall")
    groups = _groups(job, shell, wall, joints)
    covariance, noise = _covariance(job, shell, wall, groups)
    sections = _sections(job, shell, wall, groups, covariance, noise)
    tell("integrating volumes")
    gross = shell_volume(job.courses, joints, sections)
    volume = shell_volume(job.courses, joints, sections, **corrections_of(job))
    tell("propagating the covariance to every row of the table")
    propagation = _propagation(job, volume, sections, covariance, noise)
    table = _table(job, propagation)
    warnings = (*job.warnings, *_weak_sections(job, shell, wall, groups))
    return Result(
        job, shell, joints, wall, covariance, noise, sections, gross, propagation, table, warnings
    )


def zero_height(job):
    """Height of the dip plate above the bottom, m; 0 when none is given."""
    plate = job.datum.dip_plate_z_m
    return 0.0 if plate is None else plate - job.datum.bottom_z_m


def corrections_of(job, *, plate=True, paint=True, temperature=True):
    """The insets (course index -> m) and the scale that bring the survey to the table's surface."""
    outside = job.survey.side == "outside"
    insets = [
        outside * (plate * course.thickness_m + paint * course.paint_m) for course in job.courses
    ]
    return {"insets_m": insets, "scale": thermal_scale(job) if temperature else 1.0}


def thermal_scale(job):
    """Horizontal lengths at reference temperature over those of the survey; 1 if not known."""
    if job.survey.shell_temperature_c is None:
        return 1.0
    warmer = job.table.reference_temperature_c - job.survey.shell_temperature_c
    return 1.0 + job.material.expansion_per_k * warmer


def shell_volume(courses, joints_m, sections, insets_m=None, scale=1.0):
    """The shell of courses from its sections; every course has one section at least."""
    shapes = []
    for index in range(len(courses)):
        own = [section for section in sections if section.group.course == index]
        shapes.append(
            course_shape(
                joints_m[index],
                joints_m[index + 1],
                [section.group.height_m for section in own],
                [section.outline for section in own],
                inset_m=insets_m[index] if insets_m else 0.0,
                scale=scale,
            )
        )
    return ShellVolume(tuple(shapes))


def _groups(job, shell, wall, joints):
    """Groups of indices into `wall`; raises InputError for courses and sections with too few."""
    points = job.points
    height = points.xyz_m[wall, 2] - job.datum.bottom_z_m
    names = [points.section[i] for i in wall]
    if all(names):
        groups = group_by_name(names, height, lambda z: course_of(z, joints))
    else:
        azimuth = _azimuths(job, shell, wall)
        groups = group_by_height(height, azimuth, course_of(height, joints), joints)
    _refuse_weak(groups, job.courses, height)
    return groups


def _refuse_weak(groups, courses, height):
    """Raise InputError for sections of too few points or too tall, and courses without any."""
    problems = []
    for group in groups:
        count, tall = len(group.members), np.ptp(height[group.members])
        if count < FEWEST_POINTS:
            problems.append(
                f"section {group.name} has {count} points on the wall, expected at least "
                f"{FEWEST_POINTS} ({ADVISED_POINTS} or more are advised)"
            )
        if tall > 1.2 * courses[group.course].height_m:
            problems.append(
                f"section {group.name} is {tall:.3f} m tall, expected points within one course "
                f"({courses[group.course].height_m:.3f} m)"
            )
    seen = {group.course for group in groups}
    problems += [
        f"course {course.name} has no section: expected {FEWEST_POINTS} points or more on its wall"
        for index, course in enumerate(courses)
        if index not in seen
    ]
    if problems:
        raise InputError([Problem("points.csv", text) for text in problems])


def _weak_sections(job, shell, wall, groups):
    """Warnings for sections with few points, or with a part of the turn that nobody measured."""
    azimuth = _azimuths(job, shell, wall)
    texts = []
    for group in groups:
        ordered = np.sort(azimuth[group.members])
        gap = np.degrees(np.max(np.diff(ordered, append=ordered[0] + FULL_TURN)))
        name = f"section {group.name} (course {job.courses[group.course].name})"
        if len(ordered) < ADVISED_POINTS:
            texts.append(
                f"{name} stands on {len(ordered)} points, {ADVISED_POINTS} or more are advised"
            )
        if gap > WIDE_GAP_DEG:
            texts.append(f"{name} has no point over {gap:.0f} deg of its turn: measure there")
    return [Problem("points.csv", text) for text in texts]


def _azimuths(job, shell, wall):
    """Azimuths of the wall points about the axis at their own height."""
    xyz = job.points.xyz_m[wall]
    axis = np.array(shell.axis_m) + np.outer(xyz[:, 2] - shell.z_m, shell.slope)
    return polar(xyz[:, :2] - axis, 0.0, 0.0)[0]


def _covariance(job, shell, wall, groups):
    """Covariance of the wall points (3m, 3m), and the variance components when they are needed."""
    given = _given_covariance(job.points, wall)
    radii = _radii(job, shell, wall, groups, given)
    if noise_is_estimated(job):
        components = estimate_components(radii)
        least = LEAST_NOISE_M**2 if job.points.sd_m is None else 0.0
        return given * max(components.noise, least), components
    if all(evenly_spread(azimuth) for azimuth, _, _ in radii):
        return given, None
    return given, estimate_components(radii, noise=1.0)


def noise_is_estimated(job):
    """Whether the points' covariance is scaled by what their residuals say."""
    points = job.points
    given = points.sd_m is not None or points.covariance_m2 is not None
    return not given or job.scale == "a_posteriori"


def _given_covariance(points, wall):
    """(3m, 3m) as in the file; one metre for every coordinate when the file gives none."""
    if points.covariance_m2 is not None:
        index = (3 * wall[:, None] + np.arange(3)).ravel()
        return points.covariance_m2[np.ix_(index, index)]
    if points.sd_m is not None:
        return scipy.sparse.diags_array(points.sd_m[wall].ravel() ** 2).tocsr()
    return scipy.sparse.eye_array(3 * len(wall), format="csr")


def _radii(job, shell, wall, groups, covariance):
    """Azimuths, radii and their covariance about the circle of each group."""
    found = []
    for group in groups:
        xy, covariance_xy = _cut(job, shell, wall, group, covariance)
        circle = fit_circle(xy, covariance_xy)
        azimuth, radius = polar(xy, circle.x_m, circle.y_m)
        found.append((azimuth, radius, radial_covariance(xy, circle, covariance_xy)))
    return found


def _cut(job, shell, wall, group, covariance):
    z = job.datum.bottom_z_m + group.height_m
    xy, by_xyz = slide(job.points.xyz_m[wall][group.members], shell.slope, z)
    return xy, by_xyz @ _block(covariance, group) @ by_xyz.T


def _block(covariance, group):
    """Covariance of the coordinates of one group."""
    index = (3 * group.members[:, None] + np.arange(3)).ravel()
    return covariance[index][:, index]


def _sections(job, shell, wall, groups, covariance, noise):
    xyz = job.points.xyz_m[wall]
    form = noise.form_m2 if noise else 0.0
    return tuple(
        fit_section(
            group,
            xyz[group.members],
            _block(covariance, group),
            shell.slope,
            job.datum.bottom_z_m + group.height_m,
            form,
        )
        for group in groups
    )


def _propagation(job, volume, sections, covariance, noise):
    by_points, form = _feature_uncertainty(volume, sections, covariance)
    return Propagation(
        volume=volume,
        points_m2=factor_of(by_points),
        points_dof=noise.dof if noise_is_estimated(job) else np.inf,
        form_m2=factor_of(form),
        declared=job.inputs,
        scale=thermal_scale(job),
        expansion_per_k=job.material.expansion_per_k,
    )


def _table(job, propagation):
    volume, zero = propagation.volume, zero_height(job)
    heights = table_heights(job.table.step_m, volume.height_m - zero)
    levels = np.clip(heights + zero, 0.0, volume.height_m)
    return Capacity(
        height_m=heights,
        volume_m3=volume.volume_m3(levels),
        area_m2=volume.area_m2(levels),
        sources=propagation.sources(levels),
        probability=job.table.coverage_probability,
    )


def _feature_uncertainty(volume, sections, covariance):
    """(f, f) covariance of the features from the points, and from the form between them.

    The form is common to all sections (dents run up the wall), so its modes correlate them.
    """
    by_points, form = [], []
    for index, course in enumerate(volume.courses):
        own = [section for section in sections if section.group.course == index]
        jacobian = feature_jacobian(course)
        wide = np.zeros((len(jacobian), covariance.shape[0]))
        start = 0
        by_form = np.zeros((len(jacobian), own[0].outline.form_factor_m.shape[1]))
        for section in own:
            part = jacobian[:, start : start + len(section.outline.parameters)]
            start += part.shape[1]
            columns = (3 * section.group.members[:, None] + np.arange(3)).ravel()
            wide[:, columns] += part @ section.parameters_by_points
            by_form += part @ section.outline.form_factor_m
        by_points.append(wide)
        form.append(by_form)
    jacobian, form = np.vstack(by_points), np.vstack(form)
    return jacobian @ (covariance @ jacobian.T), form @ form.T
