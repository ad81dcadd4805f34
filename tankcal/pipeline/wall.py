"""From surveyed points to the wall: told from clutter, its axis, covariance, field and sections."""

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.geometry.field.amplitudes import estimate_amplitudes
from tankcal.geometry.field.cells import MOST_SITES, cells_of, sites_of_cells
from tankcal.geometry.field.components import COMPONENTS, OVALITY_MODES
from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.field.sites import Sites
from tankcal.geometry.outlines import FULL_TURN, polar
from tankcal.geometry.shell import WIDE_BAND, Shell, course_of, find_shell
from tankcal.messages import message
from tankcal.pipeline.overruled_points import decisions_of, refuse_kept
from tankcal.pipeline.read_wall import ReadWall
from tankcal.pipeline.survey_limits import limits_of
from tankcal.pipeline.survey_warnings import (
    ADVISED_POINTS,
    FEWEST_POINTS,
    check_shell,
    noise_is_estimated,
    origin_of,
    warn_of_vague_points,
    warn_of_vague_vertical,
    weak_sections,
)
from tankcal.pipeline.undecided_columns import factors_of_undecided, undecided_halves
from tankcal.pipeline.untied_setups import unbound_of
from tankcal.pipeline.wall_readings import (
    factors_of_plates,
    factors_of_readings,
    inputs_read_with,
    names_of,
    noise_by_inputs,
)
from tankcal.pipeline.wall_straps import PointsOfWall, Straps, join_readings, told_courses
from tankcal.sections import (
    Section,
    coordinates_of,
    covariance_of,
    fit_section,
    group_by_height,
    group_by_name,
    own_covariances,
    sample_of,
)
from tankcal.solver.threads import threads_for
from tankcal.tank.factors import survey_factors


@dataclass(frozen=True)
class Wall:
    """The wall of a tank as surveyed.

    Attributes
    ----------
    shell : Shell
        Axis, tilt, and what became of every point.
    joints_m : ndarray, shape (courses + 1,)
        Heights of the joints above the bottom, along the vertical, m.
    accepted : ndarray, shape (m,)
        Indices of the accepted points in job.points.
    covariance_m2 : ndarray or sparse array, shape (3 m, 3 m)
        Of the accepted points, m2.
    noise_dof : float
        Degrees of freedom of that covariance's scale.
    field : WallField
        The wall itself, between the points too: what the table is made of.
    radii_by_points : sparse array, shape (n, 3 m)
        Derivative of the field's readings, in their order, by x, y, z of the accepted points.
    undecided_m : ndarray, shape (n, columns)
        By how much the field's readings were moved towards the wall without each column of points
        that may be of a fitting: half of what they depart from it.
    sections : tuple of Section
        Circles and outlines through the points, from the bottom up.
    straps : Straps or None
        Circumferences by tape that are among the readings, after the points.
    read : ReadWall or None
        What of the readings names no point: straps and offsets from reference lines.
    by_inputs : dict
        {input of the budget: (n,) derivative of the field's readings}, of what points depend on.
    without_inputs : tuple of str
        Inputs that have no meaning for these points.
    origins_m : ndarray, shape (sections, 2)
        x and y that the radii of each section were taken about, in the frame of the points: the
        field's centres count from there.
    """

    shell: Shell
    joints_m: np.ndarray
    accepted: np.ndarray
    covariance_m2: object
    noise_dof: float
    field: WallField
    radii_by_points: scipy.sparse.csr_array
    undecided_m: np.ndarray
    sections: tuple[Section, ...]
    straps: Straps | None = None
    read: ReadWall | None = None
    by_inputs: dict = field(default_factory=dict)
    without_inputs: tuple = ()
    origins_m: np.ndarray | None = None
    surveyed_as = "wall"

    def lowest_outline(self, azimuth_rad):
        """(x, y) of the axis at the bottom, and (n,) radii of the lowest section, m."""
        outline, height = self.sections[0].outline, self.sections[0].group.height_m
        x, y = np.array([outline.x_m, outline.y_m]) - height * np.array(self.shell.slope)
        return x, y, outline.radius_m(azimuth_rad)

    def factors(self, job, weights):
        """`Factor`s of what the points leave uncertain about features, (f, m) by the readings."""
        by_points, causes = self.radii_by_points, job.points.causes
        if scipy.sparse.issparse(self.covariance_m2):  # of many points: sums over each reading's
            of_readings = by_points @ self.covariance_m2 @ by_points.T
            covariance = weights @ (of_readings @ weights.T)
        else:
            jacobian = weights @ by_points
            covariance = jacobian @ (self.covariance_m2 @ jacobian.T)
        index = coordinates_of(self.accepted)
        effects = [weights @ (by_points @ cause.column_m[index]) for cause in causes]
        found = survey_factors(covariance, self.noise_dof, causes, effects)
        found = (*found, *factors_of_undecided(weights @ self.undecided_m))
        if self.read is None:
            return found
        outside = job.survey.side == "outside"  # a reading sees a plate that is not taken off it
        taken = [one.by_inputs.get("plate_thickness", 0.0) for one in self.readings]
        sees = np.append(np.full(self._points, outside), outside - np.array(taken))
        gauged = {} if self.straps is None else self.straps.plate_sd_m
        plates = factors_of_plates(names_of(job.courses), self.field, weights * sees, gauged)
        return (*found, *factors_of_readings(self.readings, weights[:, self._points :]), *plates)

    def read_with(self, weights):
        """{input: (f,) derivative of features}: plates that points on the other side were moved
        through; the temperature that a tape has of the shell, plates that points inside do not see.
        """
        found = inputs_read_with(self.readings, weights[:, self._points :])
        for name, column in self.by_inputs.items():
            found[name] = found.get(name, 0.0) + weights @ column
        return found

    @property
    def readings(self):
        """Readings of the field that name no point, and were accepted."""
        return [] if self.read is None else self.read.accepted

    @property
    def _points(self):
        return len(self.field.radius_m) - len(self.readings)


def find_wall(job, progress, dof=np.inf, amplitudes=None):
    """Separate the wall from clutter, and fit axis, field and sections to the points of a job.

    Parameters
    ----------
    job : Job
    progress : callable
        Called with a line of text as each step begins.
    dof : float, default inf
        Degrees of freedom of the points' covariance, where it was given.
    amplitudes : Amplitudes, optional
        Of the wall's components, where they are known beforehand; None: they are estimated.

    Returns
    -------
    Wall

    Raises
    ------
    InputError
        When a course is left with too few points.
    SolutionError
        When the points show no wall.
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
        if job.hits is not None or job.tangents is not None:
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
        return fit_wall(job, shell, dof, amplitudes=amplitudes)


def fit_wall(job, shell, dof=np.inf, *, amplitudes=None):
    """Fit field and sections to the points of a job that are known to be of its wall.

    Parameters
    ----------
    job : Job
    shell : Shell
        Which points are of the wall, and its axis.
    dof, amplitudes
        As in `find_wall`.

    Returns
    -------
    Wall

    Raises
    ------
    InputError
        When a course is left with too few points.
    """
    accepted = np.flatnonzero(shell.on_wall)
    joints = joints_of(job) / np.hypot(1.0, shell.tilt)  # along the vertical: times cos(angle)
    groups = _groups(job, shell, accepted, joints)
    sds, estimated = radial_sds(job.points), noise_is_estimated(job)
    covariance = _given_covariance(job.points, accepted)
    if estimated:  # what is given counts in relation; about as large as the points scatter
        covariance = covariance * (shell.noise_m / _median_sd(sds)) ** 2
    to_fit = _to_fit(job, shell, accepted, groups, covariance)
    nominal = job.tank.nominal_diameter_m / 2
    samples = [sample_of(*one) for one in to_fit]
    sites, means = _sites(groups, samples, nominal, _welds(job), job.tangents is not None)
    undecided = means @ undecided_halves(shell, accepted, groups)
    radius = means @ np.concatenate([one.radius_m for one in samples]) - undecided.sum(axis=1)
    noise = (means @ scipy.sparse.block_diag(_blocks(samples)) @ means.T).toarray()
    is_known = amplitudes is not None
    if not is_known:
        alone = sites.take(np.ones(len(sites), dtype=bool))  # without courses that have no point
        amplitudes = estimate_amplitudes(
            alone,
            radius,
            noise,
            nominal,
            estimate_noise=estimated,
            start_m2=_sizes_of(shell),
        )
    if amplitudes.noise != 1.0:  # it may be half a gigabyte
        covariance = covariance * amplitudes.noise
        noise *= amplitudes.noise
        to_fit = _to_fit(job, shell, accepted, groups, covariance)
    form_m2 = _form_m2(amplitudes)
    sections = tuple(fit_section(*one, form_m2) for one in to_fit)
    by_points = means @ _radii_by_points(sections, len(accepted))
    by_inputs = _by_inputs(job.points, by_points, accepted)
    is_read = job.strapping is not None or job.lines is not None
    is_read = is_read or (
        job.radii is not None and len({one.course for one in groups}) < len(job.courses)
    )
    if is_read or job.points.unbound or by_inputs or job.tangents is not None:
        unbound = unbound_of(job.points, by_points, accepted)
        noise = by_points @ (covariance @ by_points.T)  # between sections, too
        noise = noise.toarray() if scipy.sparse.issparse(noise) else noise
    if not is_read:
        apart = unbound.first_apart if job.points.unbound else None
        sites = unbound.shared_by(sites) if job.points.unbound else sites
        if by_inputs:
            noise = noise + noise_by_inputs(job.inputs, by_inputs, len(radius))
        field = WallField(sites, radius, noise, amplitudes, nominal, plumbed=apart)
        read = straps = None
    else:
        points = PointsOfWall(sites, radius, noise, unbound, by_inputs)
        read, straps = join_readings(job, points, amplitudes, joints, is_known=is_known)
        field, more = read.field, len(read.accepted)
        by_points = _padded(by_points, more)
        by_inputs = {name: np.pad(one, (0, more)) for name, one in by_inputs.items()}
        undecided = np.pad(undecided, ((0, more), (0, 0)))
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
        without_inputs=("offset",) if job.hits or job.clouds else (),  # instruments have their own
        origins_m=np.array([one.centre_m for one in samples]),
    )


def _sizes_of(shell):
    """Sizes near which those of the wall are looked for, the noise as a factor; None: not known."""
    if shell.sizes_m2 is None:
        return None
    return np.append(shell.sizes_m2[:-1], shell.sizes_m2[-1] / shell.noise_m**2)


def _by_inputs(points, by_points, accepted):
    """{input of the budget: (n,) derivative of the radii by it}, of what the points depend on."""
    index = coordinates_of(accepted)
    return {name: by_points @ column[index] for name, column in points.by_inputs.items()}


def _padded(by_points, more):
    """Derivatives by points (n, 3 m) of readings, and of some more that no point moves."""
    empty = scipy.sparse.csr_array((more, by_points.shape[1]))
    return scipy.sparse.vstack([by_points, empty], format="csr")


def _clear_of_welds(job, shell, decided):
    """The shell without the sights beside vertical welds, where the plate is drawn in or out, but
    for those that are kept.
    """
    points, least = job.points, limits_of("wall_hits")["weld_distance_m"]
    every, reason = np.arange(len(points.names)), shell.reason.copy()
    azimuth = _azimuths(job, shell, every)
    course = course_of(points.xyz_m[:, 2] - job.datum.bottom_z_m, joints_of(job))
    for index, welds in enumerate(_welds(job)):
        away = np.abs((azimuth[:, None] - welds + np.pi) % FULL_TURN - np.pi)
        near = away.min(axis=1, initial=np.inf) * job.tank.nominal_diameter_m / 2 < least
        reason[near & (course == index) & (reason == "") & (decided <= 0)] = "weld"
    return replace(shell, reason=reason)


def joints_of(job):
    """(courses + 1,) heights of the joints above the bottom, along the shell."""
    return np.cumsum([0.0] + [course.height_m for course in job.courses])


def _welds(job):
    """Azimuths of the welds of each course; (): nobody gave any."""
    given = tuple(np.array(course.welds_rad or ()) for course in job.courses)
    return given if any(map(len, given)) else ()


def _sites(groups, samples, nominal_m, welds_rad, limbs):
    """`Sites` of the field, and (sites, points) weights of the points in each: one, or a cell."""
    counts = [len(one.radius_m) for one in samples]
    sites = Sites(
        course=np.repeat([one.course for one in groups], counts),
        ring=np.repeat(np.arange(len(groups)), counts),
        zeta=np.concatenate([one.zeta for one in samples]),
        azimuth_rad=np.concatenate([one.azimuth_rad for one in samples]),
        leans=np.repeat([one.degree > 0 for one in groups], counts),
        welds_rad=welds_rad,
        limbs=limbs,
    )
    if len(sites) <= MOST_SITES:
        return sites, scipy.sparse.eye_array(len(sites), format="csr")
    variances = np.concatenate([block.diagonal() for block in _blocks(samples)])
    means = cells_of(sites, variances, nominal_m)
    return sites_of_cells(sites, means), means


def _blocks(samples):
    """Covariance of the radii of each sample."""
    return [
        scipy.sparse.diags_array(one.covariance_m2)
        if np.ndim(one.covariance_m2) == 1
        else one.covariance_m2
        for one in samples
    ]


def _form_m2(amplitudes):
    """Amplitude of k^-3 that has all departures from a circle: what smooths an outline."""
    chosen = [one.shape in ("oval", "seam") for one in COMPONENTS]
    return float(np.sum(amplitudes.likely_m2[chosen])) / np.sum(OVALITY_MODES**-3)


def _radii_by_points(sections, count):
    """(m, 3 m) derivative of the radii of all sections, one after another, by all points."""
    rows = scipy.sparse.block_diag([one.radii_by_points for one in sections], format="csc")
    order = np.concatenate([coordinates_of(one.group.members) for one in sections])
    place = np.empty(3 * count, dtype=int)
    place[order] = np.arange(len(order))
    return rows[:, place].tocsr()


def _shell(job, heights, sds, decided):
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
        if job.hits is not None or job.tangents is not None:
            hint = message(
                "told_by_heights",
                "{error}, bottom_z_m, the heights of the instruments and the units of the angles",
                error=error.args[0],
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
    """What a sound survey of a sound wall hardly has."""
    groups = [section.group for section in wall.sections]
    sds = radial_sds(job.points)
    return (
        *weak_sections(job, groups, _azimuths(job, wall.shell, wall.accepted)),
        *check_shell(job, wall.shell, wall.sections, sds),
        *warn_of_vague_points(job.points, wall.accepted, sds, wall.shell.noise_m),
        *warn_of_vague_vertical(job.points),
    )


def _groups(job, shell, wall, joints):
    """Groups of indices into `wall`; raises InputError for courses and sections with too few."""
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
    """Raise InputError for sections of too few points or too tall, and courses that neither points
    nor straps nor lines tell.
    """
    problems, courses = [], job.courses
    for group in groups:
        count, tall = len(group.members), np.ptp(height[group.members])
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
        if tall > 1.2 * courses[group.course].height_m:
            height_m = courses[group.course].height_m
            problems.append(
                message(
                    "section_too_tall",
                    "section {name} is {tall:.3f} m tall, expected points within one course "
                    "({height_m:.3f} m)",
                    name=group.name,
                    tall=tall,
                    height_m=height_m,
                )
            )
    seen = told_courses(job, {group.course for group in groups})
    problems += [
        message(
            "course_without_section",
            "course {name} has no section: expected {fewest} points or more on its wall",
            name=course.name,
            fewest=FEWEST_POINTS,
        )
        for index, course in enumerate(courses)
        if index not in seen and job.radii is None
    ]
    if problems:
        raise InputError([Problem(origin_of(job.points), text) for text in problems])


def _azimuths(job, shell, wall):
    """Azimuths of the wall points about the axis at their own height."""
    xyz = job.points.xyz_m[wall]
    axis = np.array(shell.axis_m) + np.outer(xyz[:, 2] - shell.z_m, shell.slope)
    return polar(xyz[:, :2] - axis, 0.0, 0.0)[0]


def s_transform(points):
    """Adjusted points with the covariance that they have among themselves.

        C' = S C S + s2 D D',   S = I - D D'

    D is an orthonormal basis of their common shift and their turn about the vertical, s2 the mean
    variance that is left. No volume depends on these four, but a datum that holds one photo or one
    point gives them whatever variance it has: sections fitted with it would depend on that choice.

    Parameters
    ----------
    points : Points
        n points with covariance_m2 (3n, 3n), m2.

    Returns
    -------
    Points
        With C', and with the columns of their causes projected by S.
    """
    basis, given = common_motions(points.xyz_m), points.covariance_m2
    across = s_transform_factors(basis, given @ basis, np.trace(given))
    change = np.hstack([basis, across]) @ np.hstack([across, basis]).T
    causes = tuple(
        replace(cause, column_m=cause.column_m - basis @ (basis.T @ cause.column_m))
        for cause in points.causes
    )
    return replace(points, covariance_m2=np.subtract(given, change, out=change), causes=causes)


def common_motions(xyz_m):
    """Orthonormal basis of the shifts of points and their turn about the vertical.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
        Coordinates, m.

    Returns
    -------
    ndarray, shape (3 n, 4)
        Orthonormal columns, in the order x, y, z of each point.

    Examples
    --------
    >>> basis = common_motions(np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 1]]))
    >>> bool(np.allclose(basis.T @ basis, np.eye(4)))
    True
    """
    x, y, _ = (xyz_m - xyz_m.mean(axis=0)).T
    motions = np.zeros((len(x), 3, 4))
    motions[:, :, :3] = np.eye(3)
    motions[:, 0, 3], motions[:, 1, 3] = -y, x
    return np.linalg.qr(motions.reshape(-1, 4))[0]


def s_transform_factors(basis, spread, trace):
    """A of C' = C - D A' - A D', the covariance of `s_transform`, without forming S C S.

        A = C D - D (D'C D + s2 I) / 2

    Parameters
    ----------
    basis : ndarray, shape (3 n, 4)
        D, of `common_motions`.
    spread : ndarray, shape (3 n, 4)
        C D, m2.
    trace : float
        Of C, m2.

    Returns
    -------
    ndarray, shape (3 n, 4)
        A, m2.

    Examples
    --------
    >>> basis = common_motions(np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 1]]))
    >>> a = s_transform_factors(basis, basis, trace=9.0)  # of C = I nothing changes
    >>> bool(np.allclose(a, 0))
    True
    """
    across = spread - 0.5 * basis @ (basis.T @ spread)
    left = trace - 2 * np.sum(basis * across)
    return across - 0.5 * max(left, 0.0) / (len(basis) - 4) * basis


def radial_sds(points):
    """(n,) standard deviations of the points in plan, or None when the file gives none."""
    if points.covariance_m2 is not None:
        variances = points.covariance_m2.diagonal().reshape(-1, 3)
    elif points.sd_m is not None:
        variances = points.sd_m**2
    else:
        return None
    return np.sqrt(variances[:, :2].mean(axis=1))


def _median_sd(sds):
    """Median standard deviation of the points in plan; one metre when the file gives none."""
    return 1.0 if sds is None else float(np.median(sds))


def _given_covariance(points, wall):
    """(3m, 3m) as in the file; one metre for every coordinate when the file gives none."""
    if points.covariance_m2 is not None:
        index = coordinates_of(wall)
        return points.covariance_m2[np.ix_(index, index)]
    if points.sd_m is not None:
        return scipy.sparse.diags_array(points.sd_m[wall].ravel() ** 2).tocsr()
    return scipy.sparse.eye_array(3 * len(wall), format="csr")


def _to_fit(job, shell, accepted, groups, covariance):
    """Arguments of `fit_section`, but for the form, of each group."""
    xyz, own = job.points.xyz_m[accepted], own_covariances(covariance)
    return [
        (
            group,
            xyz[group.members],
            covariance_of(group.members, covariance) if own is None else own[group.members],
            shell.slope,
            job.datum.bottom_z_m + group.height_m,
        )
        for group in groups
    ]
