"""The main job on one screen: a checked job in, sections, volumes and the capacity table out."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
import scipy.sparse

from tankcal.capacity import Capacity, Propagation, table_heights
from tankcal.doubts import ADVISED_POINTS, FEWEST_POINTS, doubts, incomplete, weak_sections
from tankcal.errors import InputError, Problem
from tankcal.job import Job
from tankcal.outlines import estimate_form, polar
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

LEAST_SD_M = 1e-6  # added to a full covariance that is singular


@dataclass(frozen=True, repr=False)
class Result:
    """Everything that a job gave; `capacity` is the table as a DataFrame.

    wall         (m,) indices of the accepted points in job.points
    form_m2      amplitude of the form of the sections: variance form_m2 k^-3 of mode k
    gross        the shell as surveyed, without any correction
    propagation  the shell inside, corrected, and what is uncertain about it
    """

    job: Job
    shell: Shell
    joints_m: np.ndarray
    wall: np.ndarray
    covariance_m2: object
    form_m2: float
    sections: tuple[Section, ...]
    gross: ShellVolume
    propagation: Propagation
    table: Capacity
    warnings: tuple[Problem, ...]

    def __repr__(self):
        top = self.at(self.table.height_m[-1])
        return (
            f"<tankcal.Result of {self.job.tank.id}: {top.value_m3:.3f} m3 at "
            f"{self.table.height_m[-1]:.3f} m, U = {top.U_m3:.3f} m3 (k = {top.k:.2f}), "
            f"{len(self.wall)} of {len(self.job.points.names)} points>"
        )

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
    Raises InputError when a course is left with too few points, SolutionError when there is no
    wall, TypeError for anything but a `Job`.
    """
    if not isinstance(job, Job):
        raise TypeError(f"found {type(job).__name__}; expected a Job: run(tankcal.load(path))")
    tell = progress or (lambda text: None)
    tell(f"separating the wall from clutter in {len(job.points.names)} points")
    heights = np.cumsum([0.0] + [course.height_m for course in job.courses])
    shell = find_shell(
        job.points.xyz_m,
        job.datum.bottom_z_m + heights,
        job.tank.nominal_diameter_m / 2,
        sd_m=_radial_sds(job.points),
        snooping=job.snooping,
    )
    wall = np.flatnonzero(shell.reason == "")
    joints = heights / np.hypot(1.0, shell.tilt)  # along the vertical: times cos(angle)
    tell(f"fitting sections through {len(wall)} points of the wall")
    groups = _groups(job, shell, wall, joints)
    covariance, form_m2 = _covariance(job, shell, wall, groups)
    sections = _sections(job, shell, wall, groups, covariance, form_m2)
    tell("integrating volumes")
    gross = shell_volume(job.courses, joints, sections)
    volume = shell_volume(job.courses, joints, sections, **corrections_of(job))
    tell("propagating the covariance to every row of the table")
    propagation = _propagation(job, volume, sections, covariance, shell.noise_dof)
    table = _table(job, propagation)
    warnings = (
        *job.warnings,
        *weak_sections(job, groups, _azimuths(job, shell, wall)),
        *incomplete(job),
        *doubts(job, shell, sections, _radial_sds(job.points)),
    )
    return Result(
        job,
        shell,
        joints,
        wall,
        covariance,
        form_m2,
        sections,
        gross,
        propagation,
        table,
        warnings,
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


def _azimuths(job, shell, wall):
    """Azimuths of the wall points about the axis at their own height."""
    xyz = job.points.xyz_m[wall]
    axis = np.array(shell.axis_m) + np.outer(xyz[:, 2] - shell.z_m, shell.slope)
    return polar(xyz[:, :2] - axis, 0.0, 0.0)[0]


def _covariance(job, shell, wall, groups):
    """Covariance of the wall points (3m, 3m), and the amplitude of the form of the sections."""
    given = _given_covariance(job.points, wall)
    radii = _radii(job, shell, wall, groups, given)
    factor = (shell.noise_m / _median_sd(job.points)) ** 2 if noise_is_estimated(job) else 1.0
    return given * factor, estimate_form(radii, factor)


def _radial_sds(points):
    """(n,) standard deviations of the points in plan, or None when the file gives none."""
    if points.covariance_m2 is not None:
        variances = points.covariance_m2.diagonal().reshape(-1, 3)
    elif points.sd_m is not None:
        variances = points.sd_m**2
    else:
        return None
    return np.sqrt(variances[:, :2].mean(axis=1))


def _median_sd(points):
    """Median standard deviation of the points in plan; one metre when the file gives none."""
    sds = _radial_sds(points)
    return 1.0 if sds is None else float(np.median(sds))


def noise_is_estimated(job):
    """Whether the points' covariance is scaled by what their residuals say."""
    points = job.points
    given = points.sd_m is not None or points.covariance_m2 is not None
    return not given or job.scale == "a_posteriori"


def _given_covariance(points, wall):
    """(3m, 3m) as in the file; one metre for every coordinate when the file gives none."""
    if points.covariance_m2 is not None:
        index = (3 * wall[:, None] + np.arange(3)).ravel()
        given = points.covariance_m2[np.ix_(index, index)]
        try:
            np.linalg.cholesky(given)
        except np.linalg.LinAlgError:  # a fixed point, or a free network
            given = given + LEAST_SD_M**2 * np.eye(len(index))
        return given
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


def _sections(job, shell, wall, groups, covariance, form_m2):
    xyz = job.points.xyz_m[wall]
    return tuple(
        fit_section(
            group,
            xyz[group.members],
            _block(covariance, group),
            shell.slope,
            job.datum.bottom_z_m + group.height_m,
            form_m2,
        )
        for group in groups
    )


def _propagation(job, volume, sections, covariance, noise_dof):
    jacobian = _features_by_points(volume, sections, covariance.shape[0])
    return Propagation(
        volume=volume,
        points_m2=factor_of(jacobian @ (covariance @ jacobian.T)),
        points_dof=noise_dof if noise_is_estimated(job) else np.inf,
        form_m2=factor_of(volume.form_m2 @ volume.form_m2.T),
        declared=job.inputs,
        scale=thermal_scale(job),
        expansion_per_k=job.material.expansion_per_k,
    )


def _table(job, propagation):
    volume, zero = propagation.volume, zero_height(job)
    heights = table_heights(job.table.step_m, volume.height_m - zero)
    levels = np.minimum(heights + zero, volume.height_m)
    wet = np.maximum(levels, 0.0)
    return Capacity(
        height_m=heights,
        volume_m3=volume.volume_m3(wet),
        area_m2=volume.area_m2(wet) * (levels >= 0),
        sources=propagation.sources(levels),
        probability=job.table.coverage_probability,
    )


def _features_by_points(volume, sections, coordinates):
    """(f, coordinates) derivative of the features of the shell by the points' coordinates."""
    jacobians = []
    for index, course in enumerate(volume.courses):
        by_parameters = feature_jacobian(course)
        jacobian = np.zeros((len(by_parameters), coordinates))
        start = 0
        for section in sections:
            if section.group.course == index:
                part = by_parameters[:, start : start + len(section.outline.parameters)]
                start += part.shape[1]
                columns = (3 * section.group.members[:, None] + np.arange(3)).ravel()
                jacobian[:, columns] += part @ section.parameters_by_points
        jacobians.append(jacobian)
    return np.vstack(jacobians)
