"""Separation of wall and clutter, and patches of rejected points that may belong to the wall.

Patches of rejected points on a wall that may belong to it: seams, buckles and columns.

A patch is a group of connected points that the test against the smooth form of the shell rejected,
with departures of the same sign.

A seam continues the wall: between the wall and its greatest depth there are points of every depth,
whatever its profile (a cosine, a cusp, or flat with flanks). A pipe, a bar or a tray has a jump.
The visible side of a pipe departs by at least half its crest, since the crest is a diameter or more
from the wall. For the same reason, a pipe is never wider than the distance of its crest.

A buckle is a part of the wall, however deep: within its outline, no point of the regular wall is
visible. An object in front of the wall (the treads of a stair, a pipe, the rim of a nozzle) is
narrow, or points of the wall are visible between its parts.

A column of points on a narrow seam looks like a pipe: points one above another, at equal distances
from the wall, with regular wall on both sides. The surrounding points distinguish seam and pipe:
the slope of a plate never exceeds one in one, so wall close beside a column shows that the column
is a fitting. Wall between the points of a column shows this as well. A column far from the wall is
a fitting. Even a column that certainly belongs to the wall (because it lies behind the other
points) may be narrower than the wall visible beside it: its contribution is equally uncertain.

Data snooping about the smooth form of a shell: separation of wall, clutter and dents.

The fit to the radii of the wall contains a radius and a taper for each course. A course of three or
more rings has an additional radius for each ring. The fit also contains an axis and a form of
azimuth and height, with the spectrum of real shells as its prior. Points that contradict that form
are rejected, the worst first; rejected points that agree with the final form are accepted again.
For a large number of points, a sample evenly spread over the wall determines the form.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from scipy.sparse import csr_array

from tankcal.adjust import CRITICAL, SD_OVER_MEDIAN, Adjustment, adjust, snoop
from tankcal.geometry.outlines import harmonics, mode_variances

# Seams
SEAM_LINK_M = 0.1, 4.0  # largest distances across and along a strip, between its points
FEWEST_OF_SEAM = 8  # least number of points of a strip
SHORTEST_SEAM_M, SEAM_SLENDER = 1.2, 2.0  # least height, and least ratio of height to width
WIDER = 1.5  # least ratio of width to depth of a seam: no pipe reaches it
DEPTH = 0.9  # quantile of the departures in a strip that counts as its depth
FLANK = 0.15, 0.6  # range of relative depths of the flank, where a pipe has hardly any point
LEAST_SHARE = 0.25  # points in the flank, relative to evenly distributed depths
DEEPER = 1.4  # departures above 1.4 times the depth do not belong to the seam
# Buckles
BUCKLE_LINK_M = 2.5  # largest distance between neighbouring points of a patch, along the wall
NARROWEST_BUCKLE_M, SHORTEST_BUCKLE_M = 0.4, 0.8  # smallest width and length of a buckle
FEWEST_OF_BUCKLE = 3  # smallest number of points in a patch: three points span an area
# Columns
COLUMN_LINK_M = 0.2, 4.0  # largest distances along the arc and upwards, between points of a column
FEWEST_OF_COLUMN = 2  # least number of points of a column
SHORTEST_COLUMN_M, COLUMN_SLENDER = 0.7, 2.0  # least height, and least ratio of height to width
FARTHEST_M = 0.080  # distance from the wall beyond which a column is a fitting
STEEPEST = 1.0  # largest slope of a plate
COLUMN_SIGMA = 5.0  # least departure of a column, in standard deviations of the wall
DENIED = 0.1  # share of contradicting wall points, over the points of a column, that it tolerates
NO_COLUMN = -1  # number of points outside all columns

SIGMA = 3.0  # standard deviations of the wall that its scatter explains


def find_patches(place_m, members, link_m, fewest):
    """Divide some of the points into patches of connected points.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Positions along the arc and upwards, m.
    members : ndarray of int, shape (k,)
        Indices of the points to be grouped.
    link_m : float or tuple of (float, float)
        Largest distance between connected points, m; a tuple: along the arc and upwards.
    fewest : int
        Least number of points in a patch.

    Returns
    -------
    list of ndarray of int
        Members of each patch.

    Examples
    --------
    >>> place = np.array([[0.0, 0.0], [0.1, 2.0], [3.0, 0.0], [3.0, 0.5]])
    >>> [patch.tolist() for patch in find_patches(place, np.arange(4), (0.2, 4.0), 2)]
    [[0, 1], [2, 3]]
    >>> [patch.tolist() for patch in find_patches(place, np.arange(4), 1.0, 2)]
    [[2, 3]]
    """
    if len(members) < fewest:
        return []
    from scipy.sparse.csgraph import connected_components

    # Two limits bound a rectangle (maximum norm), a single limit a circle.
    norm = np.inf if np.ndim(link_m) else 2.0
    tree = scipy.spatial.cKDTree(place_m[members] / link_m)
    pairs = tree.query_pairs(1.0, p=norm, output_type="ndarray")
    links = csr_array((np.ones(len(pairs)), pairs.T), shape=(len(members),) * 2)
    count, label = connected_components(links, directed=False)
    patches = [members[label == item] for item in range(count)]
    return [item for item in patches if len(item) >= fewest]


def _find_tall_patches(place_m, members, connection, proportions):
    """Patches of a least height (m), and of a least ratio of height to width."""
    shortest_m, slender = proportions
    patches = find_patches(place_m, members, *connection)
    sizes = (np.ptp(place_m[patch], axis=0) for patch in patches)
    is_tall = [height >= max(shortest_m, slender * width) for width, height in sizes]
    return [patch for patch, tall in zip(patches, is_tall, strict=True) if tall]


def find_seams(place_m, departure_m, rejected, noise_m):
    """Mark points that belong to a narrow seam of the wall.

    A strip is a group of connected rejected points whose departures have the same sign, at least
    1.2 m tall. A strip is a seam if its width exceeds 1.5 times its depth and it has points of
    every depth. Its flank, from 0.15 to 0.6 of the depth, must contain at least a quarter of the
    points expected for evenly distributed depths. The part of the flank within the scatter of the
    wall is excluded from this test. All points of a seam are marked, including those of its flanks.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Positions along the arc and upwards, m.
    departure_m : ndarray, shape (n,)
        Departures from the smooth form of the shell, fitted without the rejected points, m.
    rejected : ndarray of bool, shape (n,)
    noise_m : float
        Scatter of the wall about that form (standard deviation), m.

    Returns
    -------
    ndarray of bool, shape (n,)

    Examples
    --------
    A groove of 40 mm, 0.4 m wide, and a pipe that is 60 mm off:

    >>> x, z = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 4, 201), np.linspace(0, 4, 21)))
    >>> groove = 0.04 * np.maximum(1 - abs(x - 1) / 0.2, 0)
    >>> pipe = 0.06 * (abs(x - 3) < 0.06)
    >>> in_seam = find_seams(np.column_stack([x, z]), pipe - groove, groove + pipe > 0.013, 0.001)
    >>> int(in_seam[groove > 0.013].sum()), int(in_seam[pipe > 0].sum())
    (273, 0)
    """
    in_seam = np.zeros(len(rejected), dtype=bool)
    order = np.argsort(place_m[:, 0], kind="stable")
    arc = place_m[order, 0]
    for sign in (-1, 1):
        depth = sign * departure_m
        for strip in _find_tall_patches(
            place_m,
            np.flatnonzero(rejected & (depth > 0)),
            (SEAM_LINK_M, FEWEST_OF_SEAM),
            (SHORTEST_SEAM_M, SEAM_SLENDER),
        ):
            # Neighbourhood of twice the width of the strip, over its height: it contains the
            # flanks.
            begin, end = np.ptp(place_m[strip, 0]) * np.array([-1, 1]) + place_m[strip, 0].mean()
            neighbours = order[np.searchsorted(arc, begin) : np.searchsorted(arc, end)]
            foot, top = place_m[strip, 1].min(), place_m[strip, 1].max()
            neighbours = neighbours[
                (place_m[neighbours, 1] >= foot) & (place_m[neighbours, 1] <= top)
            ]
            # A quantile is robust against single points in front of the seam.
            deepest = np.quantile(depth[strip], DEPTH)
            if _is_seam(place_m[strip], depth[neighbours], deepest, noise_m):
                in_seam[neighbours[np.abs(depth[neighbours]) < DEEPER * deepest]] = True
    return in_seam


def _is_seam(strip_m, depth, deepest, noise_m):
    """Whether a strip (k, 2) is a seam; depth (j,) of all points around it."""
    arc, height = (strip_m - strip_m.mean(axis=0)).T
    # Remove the regression line over the height: a leaning strip appears wider than it is.
    straightened = arc - height * (arc @ height) / (height @ height)
    if np.ptp(straightened) < WIDER * deepest:
        return False
    least, most = max(FLANK[0] * deepest, SIGMA * noise_m), FLANK[1] * deepest
    if least >= most:
        return True
    # Expected count for evenly distributed depths: proportional to the depth range of the flank.
    flank = np.count_nonzero((depth > least) & (depth < most))
    return flank >= LEAST_SHARE * (most - least) / deepest * np.count_nonzero(depth > least)


def find_buckles(place_m, departure_m, rejected):
    """Mark rejected points that belong to a buckle of the wall.

    A patch is a group of connected rejected points whose departures have the same sign. A patch is
    a buckle if it is at least 0.8 m long and 0.4 m wide, in any direction, and no other point lies
    within its convex hull.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Positions along the arc and upwards, m.
    departure_m : ndarray, shape (n,)
        Departures from the smooth form of the shell, fitted without the rejected points, m.
    rejected : ndarray of bool, shape (n,)
        Points that the test rejected.

    Returns
    -------
    ndarray of bool, shape (n,)
        True for points of a buckle.

    Examples
    --------
    Nine points 30 mm behind a wall that is seen all around them:

    >>> x, z = (axis.ravel() for axis in np.meshgrid(np.arange(8.0), np.arange(8.0)))
    >>> departure = -0.03 * (abs(x - 4) < 1.5) * (abs(z - 4) < 1.5)
    >>> buckle = find_buckles(np.column_stack([x, z]), departure, departure < 0)
    >>> int(buckle.sum())
    9
    """
    in_buckle = np.zeros(len(rejected), dtype=bool)
    # An inward and an outward buckle may touch: the signs are treated separately.
    for sign in (-1, 1):
        candidates = np.flatnonzero(rejected & (sign * departure_m > 0))
        for patch in find_patches(place_m, candidates, BUCKLE_LINK_M, FEWEST_OF_BUCKLE):
            in_buckle[patch] = _is_buckle(place_m[patch], np.delete(place_m, patch, axis=0))
    return in_buckle


def _is_buckle(patch_m, others_m):
    """Whether a patch (k, 2) has the size of a buckle and encloses none of the other points."""
    # Principal axes of the patch: a buckle may run in any direction of the wall.
    axes = np.linalg.svd(patch_m - patch_m.mean(axis=0), full_matrices=False)[2]
    length, width = np.ptp(patch_m @ axes.T, axis=0)
    if width < NARROWEST_BUCKLE_M or length < SHORTEST_BUCKLE_M:
        return False
    # `find_simplex` returns -1 for points outside the convex hull of the patch.
    return not np.any(scipy.spatial.Delaunay(patch_m).find_simplex(others_m) >= 0)


def find_columns(place_m, departure_m, rejected, noise_m, turn_m):
    """Number the columns of rejected points that may belong to the wall or to a fitting.

    Parameters
    ----------
    place_m : ndarray, shape (n, 2)
        Positions along the arc and upwards, m.
    departure_m : ndarray, shape (n,)
        Departures from the wall, fitted without the rejected points, m.
    rejected : ndarray of bool, shape (n,)
    noise_m : float
        Scatter of the wall (standard deviation), m.
    turn_m : float
        Circumference along the arc, m.

    Returns
    -------
    ndarray of int, shape (n,)
        Number of the column, from 0; -1 for points in no column.

    Examples
    --------
    A column 40 mm off with the next points at 0.6 m, and x with the wall seen at 20 mm:

    >>> x, z = np.meshgrid([0.0, 0.6, 1.2, 1.8, 2.4, 2.42, 3.0], np.arange(5.0))
    >>> off = np.where((x == 0.6) | (x == 2.4), -0.04, 0.0).ravel()
    >>> place = np.column_stack([x.ravel(), z.ravel()])
    >>> number = find_columns(place, off, off < 0, 0.001, 40.0)
    >>> int(number.max()), [float(x) for x in np.unique(place[number == 0, 0])]
    (0, [0.6])
    """
    numbers, count = np.full(len(rejected), NO_COLUMN), 0
    if np.count_nonzero(rejected) < FEWEST_OF_COLUMN:
        return numbers
    place = _cut_at_gap(place_m, rejected, turn_m)
    for sign in (-1, 1):
        depth = sign * departure_m
        # A shallow column may be chance, a deep column is certainly a fitting: neither is
        # ambiguous.
        for column in _find_tall_patches(
            place,
            np.flatnonzero(rejected & (depth > 0)),
            (COLUMN_LINK_M, FEWEST_OF_COLUMN),
            (SHORTEST_COLUMN_M, COLUMN_SLENDER),
        ):
            if not COLUMN_SIGMA * noise_m < np.median(depth[column]) <= FARTHEST_M:
                continue
            contradictions = _count_contradictions(place, depth, column, ~rejected, noise_m)
            if contradictions > DENIED * len(column):
                continue
            numbers[column] = count
            count += 1
    return numbers


def _cut_at_gap(place_m, rejected, turn_m):
    """Return positions whose arc begins in the widest gap between rejected points.

    No column is then cut in two by the origin of the arc.
    """
    arc = np.sort(place_m[rejected, 0] % turn_m)
    gaps = np.diff(arc, append=arc[0] + turn_m)
    widest = int(np.argmax(gaps))
    place = place_m.copy()
    place[:, 0] = (place_m[:, 0] - arc[widest] - gaps[widest] / 2) % turn_m
    return place


def _count_contradictions(place_m, depth, column, accepted, noise_m):
    """Return the number of accepted points closer to the wall than a plate allows."""
    arc, height = place_m.T
    # Beyond this distance along the arc, even the steepest plate has returned to the wall.
    reach = depth[column].max() / STEEPEST
    lowest, highest = place_m[column].min(axis=0), place_m[column].max(axis=0)
    neighbours = accepted & (arc > lowest[0] - reach) & (arc < highest[0] + reach)
    neighbours = np.flatnonzero(neighbours & (height >= lowest[1]) & (height <= highest[1]))
    if not len(neighbours):
        return 0
    # The slope of a plate concerns the distance along the arc: heights have little weight.
    scale = np.array([1.0, reach / COLUMN_LINK_M[1]])
    nearest = scipy.spatial.cKDTree(place_m[column] * scale).query(place_m[neighbours] * scale)[1]
    partner = column[nearest]
    # Least depth of the wall at a neighbour: the plate descends from the column at the steepest
    # slope.
    least_depth = (
        depth[partner] - STEEPEST * np.abs(arc[neighbours] - arc[partner]) - SIGMA * noise_m
    )
    return np.count_nonzero(depth[neighbours] < least_depth)


FITTED = 800  # approximate number of points in the fit of the form; at most twice as many
MODES = 24  # highest mode of the form in the snooping
# Prior standard deviations: taper at the ends of a course; radius of a ring about its course.
TAPER_M, RING_M = 0.010, 0.005
# A ring covers the circumference: least number of points, and widest gap between two, rad.
FEWEST_OF_RING, WIDEST_GAP = 8, np.pi / 2
# In halves of a course: distance between two rings; half height of the middle zone of a course.
RING_SPAN, MIDDLE = 0.2, 0.15
# Coinciding points at an edge hardly determine a deep form: an iteration then gains only a tenth.
MOST_ITERATIONS = 300
REJECTED = 1e3  # factor on the sd of a rejected point: the point is predicted, not fitted
LEAST_NOISE_M = 1e-4  # lower bound of the noise: no rejection below a third of a millimetre


@dataclass(frozen=True)
class Wall:
    """Result of the snooping, n points.

    wall            (n,) mask of the accepted points
    axis            (4,) x, y, m, at z = 0, and slopes dx/dz, dy/dz of the axis
    slope_cofactor  (2, 2) covariance of the slope
    w               (n,) normalised residuals
    residual        (n,) residuals of the radii, m
    noise           standard deviation of a point, m, with noise_dof degrees of freedom
    """

    wall: np.ndarray
    axis: np.ndarray
    slope_cofactor: np.ndarray
    w: np.ndarray
    residual: np.ndarray
    noise: float
    noise_dof: float


def find_form(local, course, zeta, candidates, axis, relative, slope_sd, least_m, kept=None):
    """Return the `Wall`: points about the smooth form of a shell, without contradicting points.

    A pass rejects the points whose statistics are within a tenth of the worst, and repeats the fit.
    After the last rejection, rejected points that agree with the fit are accepted again, each point
    once.

    Parameters
    ----------
    local : ndarray, shape (n, 3)
        Points about an origin near the axis, m.
    course : ndarray of int, shape (n,)
        Course of each point.
    zeta : ndarray, shape (n,)
        Height within the course, -1 at its bottom to +1 at its top.
    candidates : ndarray of bool, shape (n,)
        Points that may belong to the wall.
    axis : ndarray, shape (4,)
        Start values: x, y, m, and slopes dx/dz, dy/dz.
    relative : ndarray, shape (n,)
        Standard deviations of the points, up to a common factor.
    slope_sd : float
        Prior standard deviation of the slopes.
    least_m : float or None
        Points with smaller departures are not rejected, m; None: no point is rejected.
    kept : ndarray of bool, shape (n,), optional
        Points that are never rejected. They have no more weight than any other doubtful point.

    Returns
    -------
    Wall
    """
    index = np.flatnonzero(candidates)
    stays = np.zeros(len(index), dtype=bool) if kept is None else kept[index]
    xyz, courses, relative = local[index], course[index], relative[index]
    uneven = unevenness(xyz, courses, zeta[index], axis)
    thin = _sample_points(xyz, courses, axis)
    part = xyz[thin], courses[thin], UnevenRadii(uneven.columns[thin], uneven.sd_m)

    def fit_accepted(accepted, previous_fit):
        return _fit_form(*part, axis, relative[thin], slope_sd, accepted, previous_fit)

    def refit(previous_fit, goes, comes):
        return fit_accepted(previous_fit.accepted & ~goes | comes, previous_fit)

    def tests(fit, stays=stays[thin]):
        is_far = (np.abs(fit.residual) > least_m) & ~stays
        return fit.accepted, np.where(is_far, np.abs(fit.w), 0.0), CRITICAL

    # The first fit accepts all points; `snoop` then alternates rejections and fits.
    fit = fit_accepted(np.ones(len(thin), dtype=bool), None)
    if least_m is not None:
        fit = snoop(fit, tests, refit, at_once=0.9, returns=1).adjustment
    # The sample determined the form; now predict and test the remaining points once.
    everywhere = _predict_all(fit, thin, xyz, courses, uneven, relative)
    if least_m is not None:
        _, statistic, critical = tests(everywhere, stays)
        outside_sample = np.ones(len(index), dtype=bool)
        outside_sample[thin] = False
        everywhere.accepted[outside_sample] = statistic[outside_sample] <= critical
    return _build_wall(everywhere, index, thin, len(local))


def _sample_points(xyz, course, axis):
    """Return indices of the points for the fit: all, or about FITTED spread over the wall."""
    offset, _ = distances_from_axis(xyz, axis)
    # Every k-th point in order of course and azimuth covers the wall evenly.
    order = np.lexsort((np.arctan2(offset[:, 0], offset[:, 1]), course))
    return np.sort(order[:: max(1, len(xyz) // FITTED)])


def _predict_all(fit, thin, xyz, course, uneven, relative):
    """Extend the fit of the sample points `thin` to a `_FormFit` of all points."""
    if len(thin) == len(xyz):
        return fit
    start = fit.fit.unknowns
    offset, distance = distances_from_axis(xyz, start[:4])
    row_of = np.unique(course, return_inverse=True)[1]
    by_form = _form_columns(offset, _relative_height(xyz))
    residual = _misclosure(distance, row_of, by_form, uneven.columns, start)
    # Points outside the sample did not take part in the fit: their statistic is simply v / s.
    w = residual / (fit.noise * relative)
    residual[thin], w[thin] = fit.residual, fit.w
    accepted = np.ones(len(xyz), dtype=bool)
    accepted[thin] = fit.accepted
    return replace(fit, accepted=accepted, residual=residual, w=w)


def _build_wall(form, index, thin, count):
    """Return the `Wall` of `count` points from the fit of the candidates `index`."""
    wall, w, residual = np.zeros(count, dtype=bool), np.full(count, np.nan), np.full(count, np.nan)
    wall[index], w[index], residual[index] = form.accepted, form.w, form.residual
    fit = form.fit
    # The redundancy numbers of the accepted points sum to the degrees of freedom of the noise.
    dof = float(np.sum(fit.redundancy[: len(thin)][form.accepted[thin]]))
    return Wall(wall, fit.unknowns[:4], fit.cofactor[2:4, 2:4], w, residual, form.noise, dof)


@dataclass(frozen=True)
class _FormFit:
    """Fit of the form: variance components, and residual and test statistic of each candidate."""

    fit: Adjustment
    noise: float
    form: float
    accepted: np.ndarray
    residual: np.ndarray
    w: np.ndarray

    def tests(self):
        """Return accepted points, test statistics and critical value, the input of `snoop`."""
        return self.accepted, np.abs(self.w), CRITICAL


def _fit_form(xyz, course, uneven, axis, relative, slope_sd, accepted, previous_fit):
    """Fit a shell with form, with point noise and form amplitude as two variance components.

    Helmert's simple iteration: each standard deviation is scaled by the square root of the sum of
    squared normalised residuals of its group over the redundancy of the group (Foerstner 1979). The
    point noise is robust: it never exceeds the estimate from the median residual. Accepted points
    beyond two standard deviations have less weight (Huber 1964), so that clutter does not distort
    the form.
    """
    noise, form = (previous_fit.noise, previous_fit.form) if previous_fit else (0.005, 0.010)
    residual = previous_fit.residual if previous_fit else np.zeros(len(xyz))
    axis = previous_fit.fit.unknowns[:4] if previous_fit else axis
    n = len(xyz)
    for _ in range(3 if previous_fit else 10):
        previous = noise, form
        # Huber weights: beyond two standard deviations, the standard deviation grows with the
        # residual.
        huber_factor = np.maximum(1.0, np.abs(residual) / (2 * noise * relative))
        sd = noise * relative * np.where(accepted, huber_factor, REJECTED)
        problem = shell_problem(xyz, course, axis, sd, form, slope_sd, uneven)
        fit = adjust(*problem, max_iterations=MOST_ITERATIONS)
        axis, residual = fit.unknowns[:4], fit.residuals[:n]
        # Without a lower bound, the form amplitude of a round shell would converge to 0 and stay
        # there.
        noise = _estimate_noise(
            residual[accepted] / relative[accepted], fit.redundancy[:n][accepted]
        )
        form = max(form * _scale_factor(fit, slice(n, n + 4 * (MODES - 1))), 0.1 * noise)
        if np.allclose(previous, (noise, form), rtol=0.05):
            break
    w = _deletion_statistics(fit, residual, sd, noise * relative)
    return _FormFit(fit, noise, form, accepted, residual, w)


def _deletion_statistics(fit, residual, sd, noise):
    """Return residuals (n,) from the fit without each point, over their standard deviations.

    For a point of full weight, this is Baarda's w = v / (s sqrt(r)). For a rejected point, it tests
    whether the point agrees with all other points.
    """
    r = np.maximum(fit.redundancy[: len(residual)], 1e-9)
    # v / r is the deletion residual; its variance is that of the reading plus that of the
    # prediction.
    return (residual / r) / np.sqrt(noise**2 + sd**2 * (1 - r) / r)


def _estimate_noise(residual, redundancy):
    """Return the point noise, m: root of squares over redundancy, at most the robust estimate."""
    classical = np.sqrt(np.sum(residual**2) / np.sum(redundancy))
    robust = SD_OVER_MEDIAN * np.median(np.abs(residual) / np.sqrt(np.maximum(redundancy, 1e-9)))
    return max(min(classical, robust), LEAST_NOISE_M)


def _scale_factor(fit, group):
    """Return the Helmert factor on the standard deviation of a group of observations."""
    redundancy = np.sum(fit.redundancy[group])
    return np.sqrt(np.sum(fit.normalised[group] ** 2) / max(redundancy, 1e-9))


@dataclass(frozen=True)
class UnevenRadii:
    """Model of the departure of the mean radius from the radius of the course.

    columns  (n, c) derivative of the radii by each departure
    sd_m     (c,) prior standard deviations of the departures
    """

    columns: np.ndarray
    sd_m: np.ndarray


def unevenness(xyz, course, zeta, axis):
    """Return `UnevenRadii`: tapers of the courses, and radii of rings in courses of three or more.

    Only points in the lower and in the upper part of a course, all round it, determine a taper.
    With fewer points, objects in front of the wall (treads of a stair, the rim of a nozzle) would
    determine the taper and thus be accepted.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Points, m.
    course : ndarray of int, shape (n,)
    zeta : ndarray, shape (n,)
        Height within the course, -1 at its bottom to +1 at its top.
    axis : ndarray, shape (4,)
        x, y, m, and slopes dx/dz, dy/dz.

    Returns
    -------
    UnevenRadii
    """
    offset, _ = distances_from_axis(xyz, axis)
    azimuth = np.arctan2(offset[:, 0], offset[:, 1])
    columns, sds = [np.zeros((len(xyz), 0))], []
    for number in np.unique(course):
        members = np.flatnonzero(course == number)
        ends = members[zeta[members] < -MIDDLE], members[zeta[members] > MIDDLE]
        if not all(_covers_turn(azimuth[end]) for end in ends):
            continue
        columns.append(_indicator_column(len(xyz), members, zeta[members]))
        sds.append(TAPER_M)
        # Course radius and taper explain two rings exactly: only a third ring adds information.
        rings = _split_rings(members, zeta, azimuth)
        if len(rings) > 2:
            columns += [_indicator_column(len(xyz), ring, 1.0) for ring in rings]
            sds += len(rings) * [RING_M]
    return UnevenRadii(np.hstack(columns), np.array(sds))


def _indicator_column(count, members, value):
    """Return a column (count, 1) with the given value for the members and 0 elsewhere."""
    column = np.zeros((count, 1))
    column[members, 0] = value
    return column


def _split_rings(members, zeta, azimuth):
    """Return the rings of a course: lists of points at one height that cover the circumference."""
    order = members[np.argsort(zeta[members], kind="stable")]
    # A gap in height separates rings; scattered points form a tall group, which is no ring.
    rings = np.split(order, np.flatnonzero(np.diff(zeta[order]) > RING_SPAN) + 1)
    level = [ring for ring in rings if np.ptp(zeta[ring]) <= 2 * RING_SPAN]
    return [ring for ring in level if _covers_turn(azimuth[ring])]


def find_rings(course, zeta, azimuth):
    """Return the ring of each point, and whether the ring is not level.

    The rings of a course are those of `unevenness`. Points between rings belong to the nearest
    ring. A course without rings counts as a single ring that is not level.

    Parameters
    ----------
    course : ndarray of int, shape (n,)
    zeta : ndarray, shape (n,)
        Height within the course, -1 to +1.
    azimuth : ndarray, shape (n,)
        rad.

    Returns
    -------
    ring : ndarray of int, shape (n,)
    leans : ndarray of bool, shape (n,)
    """
    ring, leans, count = np.zeros(len(course), dtype=int), np.ones(len(course), dtype=bool), 0
    for number in np.unique(course):
        in_course = np.flatnonzero(course == number)
        levels = [
            float(np.mean(zeta[members])) for members in _split_rings(in_course, zeta, azimuth)
        ]
        nearest = np.abs(np.subtract.outer(zeta[in_course], levels or [0.0])).argmin(axis=1)
        # Number the rings consecutively over all courses, without empty rings.
        _, nearest = np.unique(nearest, return_inverse=True)
        ring[in_course], leans[in_course] = count + nearest, not levels
        count += max(len(levels), 1)
    return ring, leans


def _covers_turn(azimuth):
    """Whether azimuths (k,) cover the circumference without a wide gap."""
    if len(azimuth) < FEWEST_OF_RING:
        return False
    sorted_azimuths = np.sort(azimuth)
    return np.diff(sorted_azimuths, append=sorted_azimuths[0] + 2 * np.pi).max() < WIDEST_GAP


def shell_problem(xyz, course, axis, sd, form, slope_sd, uneven=None):
    """Return the arguments of `adjust` for radii = R of the course + `UnevenRadii` + form.

    The form depends on azimuth and height. It is equal at all heights except for a part that grows
    linearly with height. The modes of the form, the slope and the terms of `UnevenRadii` are
    unknowns with a prior (an observation of zero). Without `form`, the shell is round.

    The azimuths of the form refer to the start axis, so that the form is linear. About an axis that
    moves in the adjustment, high modes of a deep form would make Gauss-Newton oscillate. Distances
    are perpendicular to the start axis. The ellipse of its horizontal cut is known but is no
    observation of the slope; otherwise the ovality of a single ring would be taken for a lean.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Points, m.
    course : ndarray of int, shape (n,)
    axis : ndarray, shape (4,)
        Start axis: x, y, m, and slopes dx/dz, dy/dz.
    sd : ndarray, shape (n,)
        Standard deviations of the radii, m.
    form : float or None
        Amplitude of the form, m.
    slope_sd : float
        Prior standard deviation of the slopes.
    uneven : UnevenRadii, optional

    Returns
    -------
    model, start, observations, variances
        In the order of the parameters of `adjust`.
    """
    # Unknowns: axis (4), course radii, modes of the form (twice: constant and linear part), uneven
    # terms.
    start_slope = np.array(axis[2:4], dtype=float)
    courses, row_of = np.unique(course, return_inverse=True)
    n, modes = len(xyz), 0 if form is None else 2 * (MODES - 1)
    first_mode = 4 + len(courses)
    by_radius = np.zeros((n, len(courses)))
    by_radius[np.arange(n), row_of] = -1.0
    by_uneven = np.zeros((n, 0)) if uneven is None else uneven.columns
    uneven_count, last_mode = by_uneven.shape[1], first_mode + 2 * modes
    # Rows of the prior observations: each selects a single unknown with expectation zero.
    priors = np.zeros((2 * modes + 2 + uneven_count, last_mode + uneven_count))
    priors[: 2 * modes, first_mode:last_mode] = np.eye(2 * modes)
    priors[2 * modes : 2 * modes + 2, 2:4] = np.eye(2)
    priors[2 * modes + 2 :, last_mode:] = np.eye(uneven_count)

    by_form = np.zeros((n, 0))
    if modes:
        by_form = _form_columns(distances_from_axis(xyz, axis)[0], _relative_height(xyz))

    def model(x, observations):
        offset = _offsets(xyz, x[:4])
        distance, foot_heights = _perpendicular_distance(offset, start_slope)
        # The derivative of the slope is that of x and y times the height.
        by_xy = (
            -(offset - np.outer(foot_heights, start_slope)) / distance[:, None]
        )  # d(distance) / d(offset)
        by_axis = np.hstack([by_xy, by_xy * xyz[:, 2:]])
        by_unknowns = np.hstack([by_axis, by_radius, -by_form, -by_uneven])
        misclosure = _misclosure(distance, row_of, by_form, by_uneven, x)
        modelled = np.concatenate([misclosure, x[first_mode:last_mode], x[2:4], x[last_mode:]])
        return modelled - observations, np.vstack([by_unknowns, priors]), None

    # Start with median radii, which clutter hardly changes; all terms with a prior start at zero.
    distance = distances_from_axis(xyz, axis)[1]
    radii = [np.median(distance[row_of == i]) for i in range(len(courses))]
    start = np.concatenate([axis, radii, np.zeros(2 * modes + uneven_count)])
    uneven_variances = np.zeros(0) if uneven is None else uneven.sd_m**2
    prior = form**2 * mode_variances(MODES) if modes else np.zeros(0)
    variances = np.concatenate([sd**2, prior, prior, np.full(2, slope_sd**2), uneven_variances])
    return model, start, np.zeros(len(variances)), variances


def _relative_height(xyz):
    """Return heights (n,) over the largest absolute height, -1 to 1."""
    return xyz[:, 2] / max(np.abs(xyz[:, 2]).max(), 1e-9)


def _form_columns(offset, height):
    """Return derivatives (n, columns) of the radii by the form and by its part linear in height."""
    # Drop the first three harmonics: radius and centre are unknowns of their own.
    waves = harmonics(np.arctan2(offset[:, 0], offset[:, 1]), MODES)[:, 3:]
    return np.hstack([waves, waves * height[:, None]])


def _misclosure(distance, row_of, by_form, by_uneven, x):
    """Return distances (n,) less course radius, form and uneven terms."""
    first_mode, uneven_count = len(x) - by_form.shape[1] - by_uneven.shape[1], by_uneven.shape[1]
    form, uneven = x[first_mode : len(x) - uneven_count], x[len(x) - uneven_count :]
    return distance - x[4:first_mode][row_of] - by_form @ form - by_uneven @ uneven


def distances_from_axis(local, axis):
    """Return horizontal offsets and perpendicular distances of points from a leaning axis.

    The offset is horizontal, at the height of the point. The distance is perpendicular to the axis,
    since the perpendicular distance of a cylinder is constant, whereas its horizontal cut is an
    ellipse.

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
        m.
    distance : ndarray, shape (n,)
        m.

    Examples
    --------
    >>> offset, distance = distances_from_axis(np.array([[1.25, 0.0, 0.0]]), [0, 0, 0.75, 0])
    >>> offset.tolist(), distance.tolist()
    ([[1.25, 0.0]], [1.0])
    """
    offset = _offsets(local, axis)
    return offset, _perpendicular_distance(offset, np.asarray(axis[2:4], dtype=float))[0]


def _offsets(local, axis):
    """Return horizontal offsets (n, 2) of points from the axis at the height of each point."""
    return local[:, :2] - axis[:2] - local[:, 2:] * axis[2:4]


def _perpendicular_distance(offset, slope):
    """Return distances (n,) perpendicular to an axis, and heights (n,) of their feet."""
    # Foot of the perpendicular: (o - h s) . s - h = 0, so h = o . s / (1 + s . s).
    foot_height = offset @ slope / (1 + slope @ slope)
    return np.sqrt(np.sum(offset**2, axis=1) - foot_height * (offset @ slope)), foot_height
