"""The shell as one body: its wall told apart from clutter, its axis and its tilt.

A survey hits stairs, pipes and the roof too. A consensus of circles finds the wall, a leaning
cylinder with one radius a course refines it, and data snooping about the shell's smooth form (dents
that run up the wall are form, not blunders) rejects what remains, the worst points first.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.adjust import Adjustment, adjust
from tankcal.errors import SolutionError
from tankcal.outlines import harmonics, mode_variances

CRITICAL_W = 3.29  # two-sided, 0.1 % of sound points are rejected (Baarda 1968)
WIDE_BAND, WALL_BAND = 0.03, 0.01  # of the nominal radius: start, and largest believed deviation
END_TOLERANCE_M = 0.020  # a point this far above or below the shell still belongs to its edge
SAMPLES = 1000  # three-point circles tried; with half the points clutter one in eight is sound
MODES = 24  # highest mode of the form that the snooping allows for
LEAST_PART = 0.5  # of the points between bottom and top that the wall must hold
WIDEST_SLOPE = 0.05  # sd of the slope before anything is measured: tanks hardly lean by more
VAGUE_TILT = 2e-3  # sd above which the tilt counts as not determined by the points
REJECTED = 1e3  # factor on the sd of a rejected point: it is predicted, not fitted
LEAST_NOISE_M = 1e-4  # a sound point is never rejected for less than a third of a millimetre


@dataclass(frozen=True)
class Shell:
    """Axis, form and accepted points of a shell; n points in the order given.

    axis_m        (x, y) of the axis at height z_m
    slope         (dx/dz, dy/dz) of the axis; slope_cofactor (2, 2) its covariance
    reason        (n,) "" for points of the wall, else why the point was rejected
    residual_m    (n,) distance outwards to the smooth form of the shell; of points far from the
                  wall to the leaning cylinder of their course
    w             (n,) normalised residual of the snooping test, nan where none was made
    noise_m       standard deviation of a point about the smooth form common to all courses;
                  of a point of median standard deviation where those are given
    noise_dof     its degrees of freedom
    tilt_known    False: the points do not determine a tilt, and the shell is taken as upright
    """

    axis_m: tuple[float, float]
    z_m: float
    slope: tuple[float, float]
    slope_cofactor: np.ndarray
    reason: np.ndarray
    residual_m: np.ndarray
    w: np.ndarray
    noise_m: float
    noise_dof: float
    tilt_known: bool

    @property
    def tilt(self):
        """Length of the slope, m/m: the tangent of the angle to the vertical."""
        return float(np.hypot(*self.slope))

    @property
    def tilt_sd(self):
        """Standard deviation of the tilt, m/m."""
        direction = np.array(self.slope) / self.tilt if self.tilt > 0 else np.array([1.0, 0.0])
        return float(np.sqrt(direction @ self.slope_cofactor @ direction))

    @property
    def tilt_azimuth_rad(self):
        """Direction towards which the top leans, clockwise from +y, 0 to 2 pi."""
        return float(np.arctan2(self.slope[0], self.slope[1]) % (2 * np.pi))


def course_of(z_m, joints_m):
    """Index of the course of each height; the ends belong to the first and the last course."""
    return np.searchsorted(np.asarray(joints_m)[1:-1], z_m, side="right")


def find_shell(xyz_m, joints_m, nominal_radius_m, *, sd_m=None, snooping=True):
    """Tell the wall from the clutter and find the axis of the shell.

    xyz_m (n, 3); joints_m (courses + 1,) heights of the course joints in the same frame; sd_m (n,)
    standard deviations of the radii, which are believed in relation to each other.
    Raises SolutionError when no cylinder near the nominal radius holds half of the points between
    the bottom and the top.
    """
    xyz_m = np.asarray(xyz_m, dtype=float)
    n = len(xyz_m)
    reason = np.full(n, "", dtype=object)
    reason[_repeated(xyz_m)] = "same_place"
    reason[xyz_m[:, 2] > joints_m[-1] + END_TOLERANCE_M] = "above_shell"
    reason[xyz_m[:, 2] < joints_m[0] - END_TOLERANCE_M] = "below_shell"
    candidates = reason == ""
    course = course_of(xyz_m[:, 2], joints_m)
    origin = np.array([*np.median(xyz_m[:, :2], axis=0), (joints_m[0] + joints_m[-1]) / 2])
    local = xyz_m - origin

    start = _consensus_circle(local[candidates, :2], nominal_radius_m)
    wall, axis = _leaning_cylinder(local, course, candidates, start, nominal_radius_m)
    reason[candidates & ~wall] = "consensus"
    believed = np.ones(n) if sd_m is None else np.maximum(sd_m, LEAST_NOISE_M)
    relative = believed / np.median(believed)
    found = _snoop(local, course, wall, axis, relative, WIDEST_SLOPE, snooping)
    tilt_known = np.sqrt(np.diag(found.slope_cofactor).max()) < VAGUE_TILT
    if not tilt_known:
        upright = np.array([*axis[:2], 0.0, 0.0])
        found = _snoop(local, course, wall, upright, relative, 1e-9, snooping)
    in_band, wall, axis = wall, found.wall, found.axis
    reason[(reason == "") & ~wall] = "snooping"
    if wall.sum() < LEAST_PART * candidates.sum():
        raise SolutionError(
            f"only {wall.sum()} of {candidates.sum()} points between bottom and top lie on one "
            "wall: no shell can be told from its surroundings; check nominal_diameter_m and points"
        )

    distance = _from_axis(local, axis)[1]
    radii = np.array(
        [
            distance[wall & (course == c)].mean()
            if np.any(wall & (course == c))
            else nominal_radius_m
            for c in range(len(joints_m) - 1)
        ]
    )
    return Shell(
        axis_m=(float(axis[0] + origin[0]), float(axis[1] + origin[1])),
        z_m=float(origin[2]),
        slope=(float(axis[2]), float(axis[3])),
        slope_cofactor=found.slope_cofactor,
        reason=reason,
        residual_m=np.where(in_band, found.residual, distance - radii[course]),
        w=found.w,
        noise_m=found.noise,
        noise_dof=found.noise_dof,
        tilt_known=bool(tilt_known),
    )


@dataclass(frozen=True)
class _Wall:
    """What the snooping left: mask, axis (x, y, dx/dz, dy/dz), residuals, tests, point noise."""

    wall: np.ndarray
    axis: np.ndarray
    slope_cofactor: np.ndarray
    w: np.ndarray
    residual: np.ndarray
    noise: float
    noise_dof: float


def _repeated(xyz_m):
    """Mask of points on the very place of an earlier one."""
    first = np.unique(xyz_m, axis=0, return_index=True)[1]
    repeated = np.ones(len(xyz_m), dtype=bool)
    repeated[first] = False
    return repeated


def _consensus_circle(xy, nominal_radius):
    """(x, y, radius) of the three-point circle near the nominal radius that most points support."""
    if len(xy) < 5:
        raise SolutionError(f"{len(xy)} points between bottom and top of the shell: too few")
    rng = np.random.default_rng(20_11)
    triples = xy[rng.integers(len(xy), size=(SAMPLES, 3))]
    circles = _circles_through(triples)
    near = np.abs(circles[:, 2] / nominal_radius - 1) < WIDE_BAND
    judges = xy if len(xy) <= 2000 else xy[rng.choice(len(xy), 2000, replace=False)]
    band = WIDE_BAND * nominal_radius
    support = [
        np.mean(np.abs(np.hypot(judges[:, 0] - x, judges[:, 1] - y) - r) < band)
        for x, y, r in circles[near]
    ]
    best = max(support, default=0.0)
    if best < LEAST_PART:
        raise SolutionError(
            f"no circle within {WIDE_BAND:.0%} of the nominal radius {nominal_radius:.3f} m holds "
            f"half of the points (best {best:.0%}): check nominal_diameter_m, units and axes"
        )
    return circles[near][int(np.argmax(support))]


def _circles_through(triples):
    """(k, 3) centre and radius of the circle through each of k triples of points (k, 3, 2)."""
    a, b, c = (triples[:, i] for i in range(3))
    ab, ac = b - a, c - a
    cross = 2 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    cross = np.where(np.abs(cross) < 1e-12, np.nan, cross)
    sab, sac = np.sum(ab**2, axis=1), np.sum(ac**2, axis=1)
    x = (ac[:, 1] * sab - ab[:, 1] * sac) / cross
    y = (ab[:, 0] * sac - ac[:, 0] * sab) / cross
    return np.column_stack([a[:, 0] + x, a[:, 1] + y, np.hypot(x, y)])


def _leaning_cylinder(local, course, candidates, circle, nominal_radius):
    """Mask of the wall and axis (x, y, dx/dz, dy/dz), the band narrowing from 3 % to 1 % of R."""
    axis = np.array([circle[0], circle[1], 0.0, 0.0])
    distance = _from_axis(local, axis)[1]
    wall = candidates & (np.abs(distance - circle[2]) < WIDE_BAND * nominal_radius)
    for band in np.repeat(np.geomspace(WIDE_BAND, WALL_BAND, 5), 3) * nominal_radius:
        rough = np.full(wall.sum(), 0.01)
        fit = adjust(*_shell_problem(local[wall], course[wall], axis, rough, None, WIDEST_SLOPE))
        axis = fit.unknowns[:4]
        distance = _from_axis(local, axis)[1]
        names, first = np.unique(course[wall], return_inverse=True)
        radii = np.array([np.median(distance[wall][first == i]) for i in range(len(names))])
        # a course without a point so far is judged by its nearest neighbour
        nearest = np.abs(names[None, :] - course[:, None]).argmin(axis=1)
        wall = candidates & (np.abs(distance - radii[nearest]) < band)
        if wall.sum() < 5 + len(names):
            raise SolutionError(f"only {wall.sum()} points lie on a cylinder: no wall was found")
    return wall, axis


def _snoop(local, course, candidates, axis, relative, slope_sd, snooping):
    """Reject the worst points about the smooth form until all are sound; re-admit whom it spares.

    A pass rejects the points within a tenth of the worst and fits anew. When none is left to
    reject, rejected points that agree with the fit after all come back, each once.
    """
    index = np.flatnonzero(candidates)
    xyz, of, relative = local[index], course[index], relative[index]
    accepted, returned = np.ones(len(index), dtype=bool), np.zeros(len(index), dtype=bool)
    state = None
    while True:
        state = _fit_form(xyz, of, axis, relative, slope_sd, accepted, state)
        size = np.abs(state.w)
        worst = accepted & (size > CRITICAL_W)
        sound = ~accepted & ~returned & (size <= CRITICAL_W)
        if snooping and worst.any():
            accepted &= ~(worst & (size >= 0.9 * size[worst].max()))
        elif snooping and sound.any():
            accepted, returned = accepted | sound, returned | sound
        else:
            return _wall_of(state, index, accepted, len(local))


def _wall_of(state, index, accepted, count):
    """The `_Wall` of all `count` points from the fit of the candidates `index`."""
    wall, w, residual = np.zeros(count, dtype=bool), np.full(count, np.nan), np.full(count, np.nan)
    wall[index], w[index], residual[index] = accepted, state.w, state.residual
    fit = state.fit
    dof = float(np.sum(fit.redundancy[: len(index)][accepted]))
    return _Wall(wall, fit.unknowns[:4], fit.cofactor[2:4, 2:4], w, residual, state.noise, dof)


@dataclass(frozen=True)
class _FormFit:
    """A fit of the form: its components, and residual and test quantity of every candidate."""

    fit: Adjustment
    noise: float
    form: float
    residual: np.ndarray
    w: np.ndarray


def _fit_form(xyz, course, axis, relative, slope_sd, accepted, before):
    """Shell with form, its point noise and form amplitude as two variance components.

    Helmert's simple iteration: each standard deviation is scaled by the root of its group's sum of
    squared normalised residuals over its redundancy (Foerstner 1979). The point noise is kept
    robust: never above 1.4826 times the median residual. Accepted points beyond two standard
    deviations weigh less (Huber 1964), so that clutter does not bend the form.
    """
    noise, form = (before.noise, before.form) if before else (0.005, 0.010)
    residual = before.residual if before else np.zeros(len(xyz))
    axis = before.fit.unknowns[:4] if before else axis
    n = len(xyz)
    for _ in range(3 if before else 10):
        was = noise, form
        doubt = np.maximum(1.0, np.abs(residual) / (2 * noise * relative))
        sd = noise * relative * np.where(accepted, doubt, REJECTED)
        fit = adjust(*_shell_problem(xyz, course, axis, sd, form, slope_sd))
        axis, residual = fit.unknowns[:4], fit.residuals[:n]
        noise = _noise(residual[accepted] / relative[accepted], fit.redundancy[:n][accepted])
        form = max(form * _component(fit, slice(n, -2)), 0.1 * noise)
        if np.allclose(was, (noise, form), rtol=0.05):
            break
    return _FormFit(fit, noise, form, residual, _left_out(fit, residual, sd, noise * relative))


def _left_out(fit, residual, sd, noise):
    """(n,) residual of each point from the fit without it, over its standard deviation.

    For a point of full weight this is Baarda's w = v / (s sqrt(r)); for a rejected one it tests
    whether the point agrees with all the others.
    """
    r = np.maximum(fit.redundancy[: len(residual)], 1e-9)
    return (residual / r) / np.sqrt(noise**2 + sd**2 * (1 - r) / r)


def _noise(residual, redundancy):
    """Point noise: root of the squares over the redundancy, at most the normal median's."""
    whole = np.sqrt(np.sum(residual**2) / np.sum(redundancy))
    robust = 1.4826 * np.median(np.abs(residual) / np.sqrt(np.maximum(redundancy, 1e-9)))
    return max(min(whole, robust), LEAST_NOISE_M)


def _component(fit, group):
    redundancy = np.sum(fit.redundancy[group])
    return np.sqrt(np.sum(fit.normalised[group] ** 2) / max(redundancy, 1e-9))


def _shell_problem(xyz, course, axis, sd, form, slope_sd):
    """Arguments of `adjust` for radii = R of the course + form(azimuth, height).

    The form is the same at all heights but for a part that grows linearly with height; its modes
    and the slope are unknowns with a prior (an observation of zero). Without `form` the shell is
    round. sd (n,) of the radii.
    """
    courses, row_of = np.unique(course, return_inverse=True)
    n, modes = len(xyz), 0 if form is None else 2 * (MODES - 1)
    first_mode = 4 + len(courses)
    height = xyz[:, 2] / max(np.abs(xyz[:, 2]).max(), 1e-9)
    by_radius = np.zeros((n, len(courses)))
    by_radius[np.arange(n), row_of] = -1.0
    priors = np.zeros((2 * modes + 2, first_mode + 2 * modes))
    priors[: 2 * modes, first_mode:] = np.eye(2 * modes)
    priors[2 * modes :, 2:4] = np.eye(2)

    def model(x, observations):
        offset, distance = _from_axis(xyz, x[:4])
        azimuth = np.arctan2(offset[:, 0], offset[:, 1])
        sin, cos = offset[:, 0] / distance, offset[:, 1] / distance
        form_now, turn = np.zeros(n), np.zeros(n)
        by_form = np.zeros((n, 2 * modes))
        if modes:
            waves = harmonics(azimuth, MODES)[:, 3:]
            by_form = np.hstack([waves, waves * height[:, None]])
            slopes = harmonics(azimuth, MODES, derivative=1)[:, 3:]
            form_now = by_form @ x[first_mode:]
            turn = np.hstack([slopes, slopes * height[:, None]]) @ x[first_mode:] / distance
        by_xy = -np.column_stack([sin - turn * cos, cos + turn * sin])
        by_axis = np.hstack([by_xy, by_xy * xyz[:, 2:]])
        top = np.hstack([by_axis, by_radius, -by_form])
        misclosure = distance - x[4:first_mode][row_of] - form_now
        modelled = np.concatenate([misclosure, x[first_mode:], x[2:4]])
        return modelled - observations, np.vstack([top, priors]), None

    distance = _from_axis(xyz, axis)[1]
    radii = [np.median(distance[row_of == i]) for i in range(len(courses))]
    start = np.concatenate([axis, radii, np.zeros(2 * modes)])
    prior = form**2 * mode_variances(MODES) if modes else np.zeros(0)
    variances = np.concatenate([sd**2, prior, prior, np.full(2, slope_sd**2)])
    return model, start, np.zeros(len(variances)), variances


def _from_axis(local, axis):
    """Horizontal offsets (n, 2) and distances (n,) from the axis at each point's own height."""
    offset = local[:, :2] - axis[:2] - local[:, 2:] * axis[2:4]
    return offset, np.hypot(offset[:, 0], offset[:, 1])
