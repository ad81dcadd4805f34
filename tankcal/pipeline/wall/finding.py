"""From surveyed points to the wall: separation from clutter, axis, field and sections."""

from dataclasses import replace
from functools import partial

import numpy as np
import scipy.sparse

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.geometry.field.amplitudes import estimate_amplitudes
from tankcal.geometry.field.components import COMPONENTS, OVALITY_MODES, ROUND_SHAPES
from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.field.sites import MOST_SITES, Sites, cells_of, sites_of_cells, spans_of
from tankcal.geometry.outlines import polar
from tankcal.geometry.shell import WIDE_BAND, course_of, find_shell
from tankcal.messages import Message, message
from tankcal.methods.base import (
    accompanying_methods,
    completing_method,
    given_methods,
    is_sighted,
)
from tankcal.pipeline.checks import (
    limits_of,
    noise_is_estimated,
    origin_of,
    warn_of_vague_points,
    warn_of_vague_vertical,
)
from tankcal.pipeline.checks.wall import (
    ADVISED_POINTS,
    FEWEST_POINTS,
    check_shell,
    warn_of_sections,
    warn_of_taper,
    weak_sections,
)
from tankcal.pipeline.overruling import decisions_of, refuse_kept
from tankcal.pipeline.read_wall import noise_by_inputs
from tankcal.pipeline.wall.shared_unknowns import add_spread, estimate_unknowns, unbound_of
from tankcal.pipeline.wall.surveyed import (
    Wall,
    given_covariance,
    median_sd,
    radial_sds,
    undecided_halves,
)
from tankcal.pipeline.wall_straps import PointsOfWall, courses_with_readings, join_readings
from tankcal.sections import (
    LEAST_SD_M,
    coordinates_of,
    fit_section,
    group_by_height,
    group_by_name,
    sample_of,
)
from tankcal.solver.compiled import threads_for
from tankcal.units import FULL_TURN

LEVEL = 3.0  # rms scatter of heights in level rings, in sds of radii, up to which they are equal


def find_wall(job, progress, dof=np.inf, amplitudes=None, *, sizes=None):
    """Separate the wall from clutter, and fit axis, field and sections to the points of a job.

    Parameters
    ----------
    job : Job
    progress : callable
        Called with a line of text as each step begins.
    dof : float, default inf
        Degrees of freedom of the supplied covariance of the points.
    amplitudes : Amplitudes, optional
        Known amplitudes of the wall components; None: estimated.
    sizes : Amplitudes, optional
        Amplitudes estimated before from the same readings; None: estimated from these points.

    Returns
    -------
    Wall

    Raises
    ------
    InputError
        If a course has too few points.
    SolutionError
        If the points show no wall.
    """
    with threads_for(MOST_SITES):
        progress(
            message(
                "separating",
                "separating the wall from clutter in {count} points",
                count=len(job.points.names),
            )
        )
        decided = decisions_of(job)
        shell = _shell(job, joints_of(job), radial_sds(job.points), decided)
        if is_sighted(job):
            shell = _clear_of_welds(job, shell, decided)
        most = WIDE_BAND * job.tank.nominal_diameter_m / 2
        refuse_kept(job, shell.residual_m, most, shell.reason)
        progress(
            message(
                "fitting_sections",
                "fitting sections through {count} points of the wall",
                count=np.count_nonzero(shell.on_wall),
            )
        )
        return fit_wall(job, shell, dof, amplitudes=amplitudes, sizes=sizes)


def fit_wall(job, shell, dof=np.inf, *, amplitudes=None, sizes=None):
    """Fit field and sections to the points of a job that belong to its wall.

    Parameters
    ----------
    job : Job
    shell : Shell
        Axis and classification of the points.
    dof, amplitudes, sizes
        As in `find_wall`.

    Returns
    -------
    Wall

    Raises
    ------
    InputError
        If a course has too few points.
    """
    accepted = np.flatnonzero(shell.on_wall)
    # Course heights are along the leaning shell, point heights along the vertical.
    joints = joints_of(job) / np.hypot(1.0, shell.tilt)  # along the vertical: times cos(tilt)
    groups = _groups(job, shell, accepted, joints)
    sds, estimated = radial_sds(job.points), noise_is_estimated(job)
    covariance = given_covariance(job.points, accepted)
    if estimated:  # given covariances are relative; scale them to the scatter
        covariance = covariance * (shell.noise_m / median_sd(sds)) ** 2
    to_fit = _to_fit(job, shell, accepted, groups, covariance)
    nominal = job.tank.nominal_diameter_m / 2
    samples = [sample_of(*section) for section in to_fit]
    of_wall = {"welds_rad": _welds(job), "spans": spans_of(joints), "smoothed": is_smoothed(job)}
    # Many points are averaged in cells; `means` are the weights, the identity for few points.
    zeta = _heights_of(groups, samples, np.diff(joints) / 2)
    sites, means = _sites(groups, samples, zeta, nominal, of_wall)
    # Undecided columns enter midway between the wall with and without them.
    undecided = means @ undecided_halves(shell, accepted, groups)
    radius = means @ np.concatenate([sample.radius_m for sample in samples]) - undecided.sum(axis=1)
    noise = _noise_of_sections(samples, means)
    is_known = amplitudes is not None
    amplitudes = amplitudes if is_known else sizes
    if amplitudes is None:
        # Without courses that lack points.
        measured_sites = sites.take(np.ones(len(sites), dtype=bool))
        amplitudes = estimate_amplitudes(
            measured_sites,
            radius,
            noise,
            nominal,
            estimate_noise=estimated,
            start_m2=_sizes_of(shell),
        )
    if has_loose_poses(job) and not is_known:
        # Free set-ups absorb waves as numerous as themselves, so that the readings show too little
        # of the common form: its prior median is the lower bound.
        amplitudes = amplitudes.raise_to_median("common ovality")
    if amplitudes.noise != 1.0:
        covariance = covariance * amplitudes.noise
        noise *= amplitudes.noise
        to_fit = _to_fit(job, shell, accepted, groups, covariance)
    form_m2 = _form_m2(amplitudes)
    sections = tuple(fit_section(*section, form_m2) for section in to_fit)
    by_points = means @ _radii_by_points(sections, len(accepted))
    by_inputs = _derivatives_by_inputs(job.points, by_points, accepted)
    is_read = bool(accompanying_methods(job)) or len({group.course for group in groups}) < len(
        job.courses
    )
    if is_read or job.points.unbound or by_inputs or _is_smooth(job):
        unbound = unbound_of(job.points, by_points, accepted)
        noise = covariance.propagate(by_points)  # includes covariances between sections
    if not is_read:
        first_apart = unbound.first_apart if job.points.unbound else None
        sites = unbound.shared_by(sites) if job.points.unbound else sites
        if by_inputs:
            noise = noise + noise_by_inputs(job.inputs, by_inputs, len(radius))
        field = WallField(sites, radius, noise, amplitudes, nominal, plumbed=first_apart)
        read = straps = None
    else:
        points = PointsOfWall(sites, radius, noise, unbound, by_inputs)
        read, straps = join_readings(job, points, amplitudes, joints, is_known=is_known)
        field, count = read.field, len(read.accepted)
        rows_of_others = scipy.sparse.csr_array((count, by_points.shape[1]))  # zeros
        by_points = scipy.sparse.vstack([by_points, rows_of_others], format="csr")
        by_inputs = {name: np.pad(column, (0, count)) for name, column in by_inputs.items()}
        undecided = np.pad(undecided, ((0, count), (0, 0)))
    estimated_unknowns = None
    if job.points.unbound:
        estimated_unknowns = estimate_unknowns(
            job.points, unbound, field, (accepted, by_points, covariance)
        )
        sections = tuple(map(partial(add_spread, estimated_unknowns), sections, to_fit))
    return Wall(
        shell=shell,
        joints_m=joints,
        accepted=accepted,
        covariance_m2=covariance,
        noise_dof=amplitudes.noise_dof if estimated else dof,
        field=field,
        radii_by_points=by_points,
        undecided_m=undecided,
        sections=sections,
        straps=straps,
        read=read,
        by_inputs=by_inputs,
        without_inputs=("offset",)
        if any(method.has_own_offset for method in given_methods(job))
        else (),
        origins_m=np.array([sample.centre_m for sample in samples]),
        estimated_unknowns=estimated_unknowns,
    )


def is_smoothed(job):
    """Whether the readings show the wall smoother than it is.

    Limbs pass over the valleys of a wall. Set-ups tied by the wall alone are fitted to what they
    see.
    """
    return _is_smooth(job) or has_loose_poses(job)


def _is_smooth(job):
    """Whether a method of the job shows the wall smoother than it is."""
    return any(method.is_smooth for method in given_methods(job))


def has_loose_poses(job):
    """Whether some set-ups of hits are tied to the wall alone."""
    return any(cause.what == "pose" for cause in job.points.unbound)


def _sizes_of(shell):
    """Start values of the amplitudes, with the noise as a factor, or None if unknown."""
    if shell.sizes_m2 is None:
        return None
    return np.append(shell.sizes_m2[:-1], shell.sizes_m2[-1] / shell.noise_m**2)


def _derivatives_by_inputs(points, by_points, accepted):
    """{input of the budget: derivative (n,) of the radii}, for inputs that affect the points."""
    index = coordinates_of(accepted)
    return {name: by_points @ column[index] for name, column in points.by_inputs.items()}


def _clear_of_welds(job, shell, decided):
    """Shell without the sights next to vertical welds, where the plate is deformed.

    Points kept by decision stay.
    """
    points, least = job.points, limits_of("wall_hits")["weld_distance_m"]
    all_points, reason = np.arange(len(points.names)), shell.reason.copy()
    azimuth = _azimuths(job, shell, all_points)
    course = course_of(points.xyz_m[:, 2] - job.datum.bottom_z_m, joints_of(job))
    for index, welds in enumerate(_welds(job)):
        distance = np.abs((azimuth[:, None] - welds + np.pi) % FULL_TURN - np.pi)
        is_near = distance.min(axis=1, initial=np.inf) * job.tank.nominal_diameter_m / 2 < least
        reason[is_near & (course == index) & (reason == "") & (decided <= 0)] = "weld"
    return replace(shell, reason=reason)


def joints_of(job):
    """Heights of the joints above the bottom, along the shell, m, shape (courses + 1,)."""
    return np.cumsum([0.0] + [course.height_m for course in job.courses])


def _welds(job):
    """Azimuths of the welds of each course; () if none were given."""
    welds = tuple(np.array(course.welds_rad or ()) for course in job.courses)
    return welds if any(map(len, welds)) else ()


def _heights_of(groups, samples, half_m):
    """Heights of the points of each section within their course, -1 to +1.

    The error of a steep distance moves height and radius of a point together. If the heights in
    level rings differ by little more than their errors, the field would take this for a slope of
    the wall. Such rings therefore count at their mean heights.

    half_m  half the height of each course, m
    """
    zeta = [sample.zeta for sample in samples]
    level = [number for number, group in enumerate(groups) if group.degree == 0]
    scatter = [half_m[groups[number].course] ** 2 * np.var(zeta[number]) for number in level]
    noise = [np.median(samples[number].covariance_m2.diagonal()) for number in level]
    if level and np.mean(scatter) <= LEVEL**2 * np.mean(noise):
        for number in level:
            zeta[number] = np.full(len(zeta[number]), np.mean(zeta[number]))
    return zeta


def _sites(groups, samples, zeta, nominal_m, of_wall):
    """`Sites` of the field, with one point or a cell of points per site, and weights of the points.

    Parameters
    ----------
    groups : sequence of Group
    samples : sequence of Sample
    zeta : sequence of ndarray
        Heights of the points of each sample within their course, -1 to +1.
    nominal_m : float
        Nominal radius, m.
    of_wall : dict
        Attributes of the sites that belong to the whole wall.

    Returns
    -------
    sites : Sites
    means : sparse array, shape (sites, points)
    """
    counts = [len(sample.radius_m) for sample in samples]
    sites = Sites(
        course=np.repeat([group.course for group in groups], counts),
        ring=np.repeat(np.arange(len(groups)), counts),
        zeta=np.concatenate(zeta),
        azimuth_rad=np.concatenate([sample.azimuth_rad for sample in samples]),
        leans=np.repeat([group.degree > 0 for group in groups], counts),
        **of_wall,
    )
    if len(sites) <= MOST_SITES:
        return sites, scipy.sparse.eye_array(len(sites), format="csr")
    variances = np.concatenate([sample.covariance_m2.diagonal() for sample in samples])
    means = cells_of(sites, variances, nominal_m)
    return sites_of_cells(sites, means), means


def _noise_of_sections(samples, means):
    """Covariance (sites, sites) of the means of radii, m2, without that between sections."""
    noise, start = np.zeros((means.shape[0],) * 2), 0
    for sample in samples:
        of_section = means[:, start : start + len(sample.radius_m)].tocsr()
        sites = np.flatnonzero(np.diff(of_section.indptr))
        noise[np.ix_(sites, sites)] = sample.covariance_m2.propagate(of_section[sites])
        start += len(sample.radius_m)
    return noise


def _form_m2(amplitudes):
    """Variance factor of a k^-3 spectrum with the form of the wall, to smooth outlines, m2."""
    is_round = [component.shape in ROUND_SHAPES for component in COMPONENTS]
    return float(np.sum(amplitudes.likely_m2[is_round])) / np.sum(OVALITY_MODES**-3)


def _radii_by_points(sections, count):
    """Derivative (m, 3 m) of the radii of all sections, in sequence, by all points."""
    rows = scipy.sparse.block_diag([section.radii_by_points for section in sections], format="csc")
    order = np.concatenate([coordinates_of(section.group.members) for section in sections])
    place = np.empty(3 * count, dtype=int)
    place[order] = np.arange(len(order))
    return rows[:, place].tocsr()


def _shell(job, heights, sds, decided):
    """`Shell` of the points; SolutionError with a hint if no shell is found."""
    try:
        return find_shell(
            job.points.xyz_m,
            job.datum.bottom_z_m + heights,
            job.tank.nominal_diameter_m / 2,
            sd_m=sds,
            snooping=job.snooping,
            welds_rad=_welds(job),
            decided=decided,
        )
    except SolutionError as error:
        if is_sighted(job):
            text = error.args[0]
            if not isinstance(text, Message):  # a message of the solver about its unknowns
                text = message("no_upright_shell", "the sights show no upright shell")
            hint = message(
                "told_by_heights",
                "{error}; look also at bottom_z_m, survey.side, the heights of the instruments and"
                " the units of angles and distances",
                error=text,
            )
            raise SolutionError(hint) from error
        if job.points.from_adjustment:
            hint = message(
                "told_by_targets",
                "{error}, and bottom_z_m; list the points that are on the wall in targets.csv",
                error=error.args[0],
            )
            raise SolutionError(hint) from error
        raise


def warnings_of(job, wall):
    """Warnings that are unlikely for a valid survey of a wall without defects."""
    groups = [section.group for section in wall.sections]
    sds = radial_sds(job.points)
    return (
        *weak_sections(job, groups, _azimuths(job, wall.shell, wall.accepted)),
        *warn_of_taper(job, wall.field),
        *check_shell(job, wall.shell, wall.sections, sds),
        *warn_of_vague_points(job.points, wall.accepted, sds, wall.shell.noise_m),
        *warn_of_vague_vertical(job.points),
        *warn_of_sections(job, wall),
    )


def _groups(job, shell, wall, joints):
    """Groups of indices into `wall`; InputError for courses and sections with too few points."""
    points = job.points
    height = points.xyz_m[wall, 2] - job.datum.bottom_z_m
    azimuth = _azimuths(job, shell, wall)
    names = [points.section[i] for i in wall]
    if all(names):
        groups = group_by_name(names, height, lambda z: course_of(z, joints), azimuth, joints)
    else:
        groups = group_by_height(height, azimuth, course_of(height, joints), joints)
    _refuse_weak(job, groups, height)
    return groups


def _refuse_weak(job, groups, height):
    """Raise InputError for invalid sections and for courses without any measurement.

    A section must have enough points and fit into its course. A course needs points, straps or
    lines.
    """
    problems, courses = [], job.courses
    for group in groups:
        count, height_range = len(group.members), np.ptp(height[group.members])
        if count < FEWEST_POINTS:
            problems.append(
                message(
                    "section_of_few",
                    "section {name} has {count} points on the wall, expected at least {fewest} "
                    "({advised} or more are advised)",
                    name=group.name,
                    count=count,
                    fewest=FEWEST_POINTS,
                    advised=ADVISED_POINTS,
                )
            )
        if height_range > 1.2 * courses[group.course].height_m:
            height_m = courses[group.course].height_m
            problems.append(
                message(
                    "section_too_tall",
                    "section {name} is {tall:.3f} m tall, expected points within one course "
                    "({height_m:.3f} m)",
                    name=group.name,
                    tall=height_range,
                    height_m=height_m,
                )
            )
    measured = courses_with_readings(job, {group.course for group in groups})
    is_completed = completing_method(job) is not None
    problems += [
        message(
            "course_without_section",
            "course {name} has no section: expected {fewest} points or more on its wall",
            name=course.name,
            fewest=FEWEST_POINTS,
        )
        for index, course in enumerate(courses)
        if index not in measured and not is_completed
    ]
    if problems:
        raise InputError([Problem(origin_of(job.points), text) for text in problems])


def _azimuths(job, shell, wall):
    """Azimuths of the wall points about the axis at their own height, rad."""
    xyz = job.points.xyz_m[wall]
    axis = np.array(shell.axis_m) + np.outer(xyz[:, 2] - shell.z_m, shell.slope)
    return polar(xyz[:, :2] - axis, 0.0, 0.0)[0]


def _to_fit(job, shell, accepted, groups, covariance):
    """Arguments of `fit_section`, except the form, for each group."""
    xyz = job.points.xyz_m[accepted]
    return [
        (
            group,
            xyz[group.members],
            covariance.take(group.members).definite(LEAST_SD_M),
            shell.slope,
            job.datum.bottom_z_m + group.height_m,
        )
        for group in groups
    ]


# ---- points of a wall from sights: selection, and the side of the wall that they are on


def take_points(points, chosen):
    """Return selected points (k,), with their covariance and their causes."""
    index = coordinates_of(chosen)

    def select(values):
        return tuple(values[i] for i in chosen)

    def select_columns(causes):
        return tuple(replace(cause, column_m=cause.column_m[index]) for cause in causes)

    return replace(
        points,
        names=select(points.names),
        xyz_m=points.xyz_m[chosen],
        covariance_m2=points.covariance_m2.take(chosen),
        section=select(points.section),
        generatrix=select(points.generatrix),
        rows=select(points.rows),
        causes=select_columns(points.causes),
        unbound=select_columns(points.unbound),
        by_inputs={name: column[index] for name, column in points.by_inputs.items()},
    )


def through_wall(job, points, normal, is_moved):
    """Move points of a vertical wall to its other side.

    Parameters
    ----------
    job : Job
    points : Points
    normal : ndarray, shape (n, 3)
        Normals of the wall, outwards.
    is_moved : ndarray of bool, shape (n,)
        Points that are not on the side of the survey.

    Returns
    -------
    Points
        With the derivatives by plate thickness and paint.
    """
    joints = job.datum.bottom_z_m + joints_of(job)
    course = course_of(points.xyz_m[:, 2], joints)
    outwards = 1.0 if job.survey.side == "outside" else -1.0
    normal = (outwards * is_moved)[:, None] * normal
    switches = {"plate_thickness": job.switches.plate, "paint": job.switches.paint}
    sizes = {
        "plate_thickness": np.array([part.thickness_m for part in job.courses])[course],
        "paint": np.array([part.paint_m for part in job.courses])[course],
    }
    size = sum(switches[name] * thickness for name, thickness in sizes.items())
    xyz = points.xyz_m + size[:, None] * normal
    derivatives = {
        name: normal.ravel()
        for name, thickness in sizes.items()
        if switches[name] and thickness.any()
    }
    return replace(points, xyz_m=xyz, by_inputs=derivatives)
