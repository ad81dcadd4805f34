"""Data snooping about the smooth form of a shell: what is clutter, and what is a dent.

The radii of the wall are fitted by one radius a course, a taper within it, one radius more for each
of three rings or more, an axis, and a form of azimuth and height that has the spectrum of real
shells as its prior. Points that deny that form are rejected, the worst first, and those that agree
with it after all come back. Of many points some, even over the wall, tell the form.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.adjust import CRITICAL, Adjustment, adjust, snoop
from tankcal.geometry.form import harmonics, mode_variances

FITTED = 800  # points that the form is fitted to, about; twice as many at most
MODES = 24  # highest mode of the form that the snooping allows for
TAPER_M, RING_M = 0.010, 0.005  # prior sd of a radius: at the ends of a course; of a ring beside it
FEWEST_OF_RING, WIDEST_GAP = 8, np.pi / 2  # points, and rad between two: they go round
RING_SPAN, MIDDLE = 0.2, 0.15  # of half a course: between two rings; what is neither end
MOST_ITERATIONS = 300  # each gains a tenth where coinciding limbs hardly determine a deep form
REJECTED = 1e3  # factor on the sd of a rejected point: it is predicted, not fitted
LEAST_NOISE_M = 1e-4  # a sound point is never rejected for less than a third of a millimetre


@dataclass(frozen=True)
class Wall:
    """What the snooping left: mask, axis (x, y, dx/dz, dy/dz), residuals, tests, point noise."""

    wall: np.ndarray
    axis: np.ndarray
    slope_cofactor: np.ndarray
    w: np.ndarray
    residual: np.ndarray
    noise: float
    noise_dof: float


def find_form(local, course, zeta, candidates, axis, relative, slope_sd, least_m, kept=None):
    """The `Wall`: points about the smooth form of a shell, without those that deny it.

    A pass rejects the points within a tenth of the worst and fits anew. When none is left to
    reject, rejected points that agree with the fit after all come back, each once. A point that
    departs by less than `least_m` stays; None: all do. So do those that are `kept` (n,), which bend
    the form no more than any doubtful point does.
    """
    index = np.flatnonzero(candidates)
    stays = np.zeros(len(index), dtype=bool) if kept is None else kept[index]
    xyz, of, relative = local[index], course[index], relative[index]
    uneven = unevenness(xyz, of, zeta[index], axis)
    thin = _thinned(xyz, of, axis)
    part = xyz[thin], of[thin], Uneven(uneven.columns[thin], uneven.sd_m)

    def fitted(accepted, before):
        return _fit_form(*part, axis, relative[thin], slope_sd, accepted, before)

    def refit(before, goes, comes):
        return fitted(before.accepted & ~goes | comes, before)

    def tests(fit, stays=stays[thin]):
        far = (np.abs(fit.residual) > least_m) & ~stays
        return fit.accepted, np.where(far, np.abs(fit.w), 0.0), CRITICAL

    fit = fitted(np.ones(len(thin), dtype=bool), None)
    if least_m is not None:
        fit = snoop(fit, tests, refit, at_once=0.9, returns=1).adjustment
    everywhere = _predicted(fit, thin, xyz, of, uneven, relative)
    if least_m is not None:
        _, statistic, critical = tests(everywhere, stays)
        rest = np.ones(len(index), dtype=bool)
        rest[thin] = False
        everywhere.accepted[rest] = statistic[rest] <= critical
    return _wall_of(everywhere, index, thin, len(local))


def _thinned(xyz, course, axis):
    """Indices of the points that tell the form: all, or about FITTED, even over the wall."""
    offset, _ = distances_from_axis(xyz, axis)
    order = np.lexsort((np.arctan2(offset[:, 0], offset[:, 1]), course))
    return np.sort(order[:: max(1, len(xyz) // FITTED)])


def _predicted(fit, thin, xyz, course, uneven, relative):
    """The fit to some points as `_FormFit` of all of them."""
    if len(thin) == len(xyz):
        return fit
    start = fit.fit.unknowns
    offset, distance = distances_from_axis(xyz, start[:4])
    row_of = np.unique(course, return_inverse=True)[1]
    by_form = _form_columns(offset, _relative_height(xyz))
    residual = _misclosure(distance, row_of, by_form, uneven.columns, start)
    w = residual / (fit.noise * relative)
    residual[thin], w[thin] = fit.residual, fit.w
    accepted = np.ones(len(xyz), dtype=bool)
    accepted[thin] = fit.accepted
    return replace(fit, accepted=accepted, residual=residual, w=w)


def _wall_of(form, index, thin, count):
    """The `Wall` of all `count` points: the candidates `index`, fitted to those of `thin`."""
    wall, w, residual = np.zeros(count, dtype=bool), np.full(count, np.nan), np.full(count, np.nan)
    wall[index], w[index], residual[index] = form.accepted, form.w, form.residual
    fit = form.fit
    dof = float(np.sum(fit.redundancy[: len(thin)][form.accepted[thin]]))
    return Wall(wall, fit.unknowns[:4], fit.cofactor[2:4, 2:4], w, residual, form.noise, dof)


@dataclass(frozen=True)
class _FormFit:
    """A fit of the form: its components, and residual and test statistic of every candidate."""

    fit: Adjustment
    noise: float
    form: float
    accepted: np.ndarray
    residual: np.ndarray
    w: np.ndarray

    def tests(self):
        """What `snoop` asks for."""
        return self.accepted, np.abs(self.w), CRITICAL


def _fit_form(xyz, course, uneven, axis, relative, slope_sd, accepted, before):
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
        problem = shell_problem(xyz, course, axis, sd, form, slope_sd, uneven)
        fit = adjust(*problem, max_iterations=MOST_ITERATIONS)
        axis, residual = fit.unknowns[:4], fit.residuals[:n]
        noise = _noise(residual[accepted] / relative[accepted], fit.redundancy[:n][accepted])
        form = max(form * _component(fit, slice(n, n + 4 * (MODES - 1))), 0.1 * noise)
        if np.allclose(was, (noise, form), rtol=0.05):
            break
    w = _left_out(fit, residual, sd, noise * relative)
    return _FormFit(fit, noise, form, accepted, residual, w)


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


@dataclass(frozen=True)
class Uneven:
    """How the mean radius departs from that of its course.

    columns  (n, c) derivative of the radii by each departure; sd_m (c,) of it, before any point
    """

    columns: np.ndarray
    sd_m: np.ndarray


def unevenness(xyz, course, zeta, axis):
    """`Uneven`: a taper for each course that shows one, a radius for each of three rings or more.

    zeta  (n,) height within the course, -1 at its bottom to +1 at its top

    Only points that go round tell it, in the lower and the upper part of a course: with fewer, what
    stands before the wall (treads of a stair, the rim of a nozzle) would bear itself out.
    """
    offset, _ = distances_from_axis(xyz, axis)
    azimuth = np.arctan2(offset[:, 0], offset[:, 1])
    columns, sds = [np.zeros((len(xyz), 0))], []
    for one in np.unique(course):
        own = np.flatnonzero(course == one)
        ends = own[zeta[own] < -MIDDLE], own[zeta[own] > MIDDLE]
        if not all(_goes_round(azimuth[end]) for end in ends):
            continue
        columns.append(_column(len(xyz), own, zeta[own]))
        sds.append(TAPER_M)
        rings = _rings(own, zeta, azimuth)
        if len(rings) > 2:
            columns += [_column(len(xyz), ring, 1.0) for ring in rings]
            sds += len(rings) * [RING_M]
    return Uneven(np.hstack(columns), np.array(sds))


def _column(count, members, value):
    column = np.zeros((count, 1))
    column[members, 0] = value
    return column


def _rings(members, zeta, azimuth):
    """Lists of the points of a course that stand at one height, all round it."""
    order = members[np.argsort(zeta[members], kind="stable")]
    rings = np.split(order, np.flatnonzero(np.diff(zeta[order]) > RING_SPAN) + 1)
    level = [ring for ring in rings if np.ptp(zeta[ring]) <= 2 * RING_SPAN]
    return [ring for ring in level if _goes_round(azimuth[ring])]


def find_rings(course, zeta, azimuth):
    """Ring of each point, and whether the ring is not level.

    The rings of a course are those that `unevenness` sees; what stands between them belongs to the
    nearest, and where there is none all points of the course are one.

    course (n,) index; zeta (n,) height within it, -1 to +1; azimuth (n,), rad
    """
    ring, leans, count = np.zeros(len(course), dtype=int), np.ones(len(course), dtype=bool), 0
    for one in np.unique(course):
        own = np.flatnonzero(course == one)
        levels = [float(np.mean(zeta[members])) for members in _rings(own, zeta, azimuth)]
        nearest = np.abs(np.subtract.outer(zeta[own], levels or [0.0])).argmin(axis=1)
        _, nearest = np.unique(nearest, return_inverse=True)
        ring[own], leans[own] = count + nearest, not levels
        count += max(len(levels), 1)
    return ring, leans


def _goes_round(azimuth):
    if len(azimuth) < FEWEST_OF_RING:
        return False
    around = np.sort(azimuth)
    return np.diff(around, append=around[0] + 2 * np.pi).max() < WIDEST_GAP


def shell_problem(xyz, course, axis, sd, form, slope_sd, uneven=None):
    """Arguments of `adjust` for radii = R of the course + uneven + form(azimuth, height).

    The form is the same at all heights but for a part that grows linearly with height; its modes,
    the slope and what is `Uneven` are unknowns with a prior (an observation of zero). Without
    `form` the shell is round. sd (n,) of the radii.

    Azimuths of the form are those about `axis`, so that the form is linear: about an axis that
    moves in the adjustment, high modes of a deep form make Gauss-Newton swing without end.
    Distances are square to the axis as it leans at first: its ellipse is known, but is no
    observation of the slope, else the ovality of a single ring would be taken for a lean.
    """
    lean = np.array(axis[2:4], dtype=float)
    courses, row_of = np.unique(course, return_inverse=True)
    n, modes = len(xyz), 0 if form is None else 2 * (MODES - 1)
    first_mode = 4 + len(courses)
    by_radius = np.zeros((n, len(courses)))
    by_radius[np.arange(n), row_of] = -1.0
    by_uneven = np.zeros((n, 0)) if uneven is None else uneven.columns
    more, last_mode = by_uneven.shape[1], first_mode + 2 * modes
    priors = np.zeros((2 * modes + 2 + more, last_mode + more))
    priors[: 2 * modes, first_mode:last_mode] = np.eye(2 * modes)
    priors[2 * modes : 2 * modes + 2, 2:4] = np.eye(2)
    priors[2 * modes + 2 :, last_mode:] = np.eye(more)

    by_form = np.zeros((n, 0))
    if modes:
        by_form = _form_columns(distances_from_axis(xyz, axis)[0], _relative_height(xyz))

    def model(x, observations):
        offset = _offsets(xyz, x[:4])
        distance, along = _square_to(offset, lean)
        by_xy = -(offset - np.outer(along, lean)) / distance[:, None]  # d(distance) / d(offset)
        by_axis = np.hstack([by_xy, by_xy * xyz[:, 2:]])
        top = np.hstack([by_axis, by_radius, -by_form, -by_uneven])
        misclosure = _misclosure(distance, row_of, by_form, by_uneven, x)
        modelled = np.concatenate([misclosure, x[first_mode:last_mode], x[2:4], x[last_mode:]])
        return modelled - observations, np.vstack([top, priors]), None

    distance = distances_from_axis(xyz, axis)[1]
    radii = [np.median(distance[row_of == i]) for i in range(len(courses))]
    start = np.concatenate([axis, radii, np.zeros(2 * modes + more)])
    uneven_variances = np.zeros(0) if uneven is None else uneven.sd_m**2
    prior = form**2 * mode_variances(MODES) if modes else np.zeros(0)
    variances = np.concatenate([sd**2, prior, prior, np.full(2, slope_sd**2), uneven_variances])
    return model, start, np.zeros(len(variances)), variances


def _relative_height(xyz):
    return xyz[:, 2] / max(np.abs(xyz[:, 2]).max(), 1e-9)


def _form_columns(offset, height):
    """(n, columns) derivative of the radii by the form, and by its part that grows with height."""
    waves = harmonics(np.arctan2(offset[:, 0], offset[:, 1]), MODES)[:, 3:]
    return np.hstack([waves, waves * height[:, None]])


def _misclosure(distance, row_of, by_form, by_uneven, x):
    """(n,) distances less the radius of the course, the form, and what is uneven."""
    first_mode, more = len(x) - by_form.shape[1] - by_uneven.shape[1], by_uneven.shape[1]
    form, uneven = x[first_mode : len(x) - more], x[len(x) - more :]
    return distance - x[4:first_mode][row_of] - by_form @ form - by_uneven @ uneven


def distances_from_axis(local, axis):
    """Horizontal offsets and distances of points from a leaning axis.

    The offset is horizontal, at the point's own height. The distance is square to the axis: that of
    a cylinder is the same all round, whereas its horizontal cut is an ellipse.

        rho^2 = |o|^2 - (o . s)^2 / (1 + s . s),    o the offset, s the slope of the axis

    Parameters
    ----------
    local : ndarray, shape (n, 3)
        Points, m.
    axis : array_like, shape (4,)
        x and y of the axis at z = 0, m, and its slopes dx/dz and dy/dz.

    Returns
    -------
    offset : ndarray, shape (n, 2)
    distance : ndarray, shape (n,)
        m.

    Examples
    --------
    >>> offset, distance = distances_from_axis(np.array([[1.25, 0.0, 0.0]]), [0, 0, 0.75, 0])
    >>> offset.tolist(), distance.tolist()
    ([[1.25, 0.0]], [1.0])
    """
    offset = _offsets(local, axis)
    return offset, _square_to(offset, np.asarray(axis[2:4], dtype=float))[0]


def _offsets(local, axis):
    """(n, 2) horizontal offsets of points from the axis at their own height."""
    return local[:, :2] - axis[:2] - local[:, 2:] * axis[2:4]


def _square_to(offset, slope):
    """Distances (n,) square to an axis, and heights (n,) of their feet above the points."""
    along = offset @ slope / (1 + slope @ slope)
    return np.sqrt(np.sum(offset**2, axis=1) - along * (offset @ slope)), along
