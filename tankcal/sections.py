"""Horizontal sections of a shell: points grouped, the circle through them, and their outline.

Points of a course that do not lie level make no section: their circle and outline are those at
their mean height, fitted with a taper and a lean.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse

from tankcal.geometry.circles import (
    Circle,
    circle_by_points,
    fit_circle,
    own_columns,
    radial_covariance,
    taubin_circle,
)
from tankcal.geometry.form import Sample, free_columns, harmonics
from tankcal.geometry.outlines import (
    Outline,
    polar,
    radii_by_coordinates,
    radii_square_to_axis,
    smooth_outline,
)

RING_GAP, RING_SPREAD = 0.10, 0.15  # of the course height: between rings, within one ring
LEAST_SD_M = 1e-6  # added to a full covariance that is singular
HIGHEST_DEGREE, MOST_AMPLIFICATION = 2, 6.0  # of the sd of a mean radius, at an end of a course


@dataclass(frozen=True)
class Group:
    """Points that make one section, or the one course that they stand on all over its height.

    Attributes
    ----------
    name : str
    course : int
        Index of the course, from the bottom up.
    height_m : float
        Mean height of the points above the bottom, m.
    members : ndarray of int, shape (n,)
        Indices of the points.
    span_m : tuple of float, or None
        Bottom and top of the course, m; None when they are not known.
    degree : int
        Of the polynomial in height that the points are fitted by; 0 when they are level.
    """

    name: str
    course: int
    height_m: float
    members: np.ndarray
    span_m: tuple[float, float] | None = None
    degree: int = 0

    def zeta(self, height_m):
        """Heights within the course: -1 at its bottom, +1 at its top; 0 when it is not known."""
        if self.span_m is None:
            return 0.0 * np.asarray(height_m)
        bottom, top = self.span_m
        return (2 * np.asarray(height_m) - bottom - top) / (top - bottom)


@dataclass(frozen=True)
class Section:
    """Points of a group, their circle, and their outline.

    Attributes
    ----------
    group : Group
    circle : Circle
        Least-squares circle.
    outline : Outline
        At group.height_m.
    radii_by_points : sparse array, shape (n, 3n)
        Derivative of the outline's n measured radii by x, y, z of the points.
    """

    group: Group
    circle: Circle
    outline: Outline
    radii_by_points: scipy.sparse.csr_array


def group_by_height(height_m, azimuth_rad, course, joints_m):
    """Sections of points without a section number: rings where they lie level, else one a course.

    Points of a course form rings when each cluster of heights (apart by a tenth of the course,
    level within 15 % of it) has 5 points or more and no gap of a third of a turn.

    Parameters
    ----------
    height_m : ndarray, shape (n,)
        Above the bottom, m.
    azimuth_rad : ndarray, shape (n,)
        About the axis, rad.
    course : ndarray of int, shape (n,)
        Index of the course of each point.
    joints_m : array_like, shape (courses + 1,)
        Heights of the joints above the bottom, m.

    Returns
    -------
    list of Group
        Named "1", "2", or "2.1", "2.2" for rings, from the bottom up.

    Examples
    --------
    Two rings of eight points in one course:

    >>> azimuth = np.tile(np.arange(8) * np.pi / 4, 2)
    >>> height = np.repeat([0.5, 1.5], 8)
    >>> found = group_by_height(height, azimuth, np.zeros(16, dtype=int), [0.0, 2.0])
    >>> [(one.name, one.height_m) for one in found]
    [('1.1', 0.5), ('1.2', 1.5)]
    """
    groups = []
    for index in range(len(joints_m) - 1):
        members = np.flatnonzero(course == index)
        if len(members) == 0:
            continue
        span = (float(joints_m[index]), float(joints_m[index + 1]))
        tall = span[1] - span[0]
        rings = _rings(height_m[members], tall)
        name = str(index + 1)
        if len(rings) > 1 and all(
            _is_ring(height_m[members[ring]], azimuth_rad[members[ring]], tall) for ring in rings
        ):
            for number, ring in enumerate(rings, start=1):
                chosen = members[ring]
                height = float(height_m[chosen].mean())
                groups.append(Group(f"{name}.{number}", index, height, chosen, span))
        else:
            height = float(height_m[members].mean())
            groups.append(Group(name, index, height, members, span))
    return _with_degrees(groups, height_m, azimuth_rad)


def group_by_name(names, height_m, course_of, azimuth_rad=None, joints_m=None):
    """Sections of points that carry a section name; their mean height decides the course.

    Parameters
    ----------
    names : sequence of str, length n
    height_m : ndarray, shape (n,)
        Above the bottom, m.
    course_of : callable
        course_of(height_m) -> index of the course.
    azimuth_rad : ndarray, shape (n,), optional
    joints_m : array_like, shape (courses + 1,), optional
        Azimuths (rad) and joints (m) tell whether a section whose points are not level carries a
        fit in height; without them every section counts as level.

    Returns
    -------
    list of Group
        From the bottom up.

    Examples
    --------
    >>> found = group_by_name(["b", "a", "b"], np.array([2.0, 1.0, 2.2]), lambda height: 0)
    >>> [(one.name, one.members.tolist()) for one in found]
    [('a', [1]), ('b', [0, 2])]
    """
    groups = []
    for name in dict.fromkeys(names):
        members = np.array([i for i, other in enumerate(names) if other == name])
        height = float(height_m[members].mean())
        course = int(course_of(height))
        span = None if joints_m is None else tuple(map(float, joints_m[course : course + 2]))
        groups.append(Group(name, course, height, members, span))
    groups.sort(key=lambda group: group.height_m)
    return groups if joints_m is None else _with_degrees(groups, height_m, azimuth_rad)


def _with_degrees(groups, height_m, azimuth_rad):
    """The groups, with the degree in height of those that have a course for themselves."""
    courses = [group.course for group in groups]
    return [
        replace(group, degree=_degree(group, height_m[group.members], azimuth_rad[group.members]))
        if courses.count(group.course) == 1
        else group
        for group in groups
    ]


def _degree(group, height_m, azimuth_rad):
    """Degree of the polynomial in height that points determine: 0, 1 or 2.

    The highest by which the mean radius at either end of the course has at most 6 times the sd of
    the mean radius of all points, whatever low harmonics the section has (points along a spiral
    tell nothing of a taper), with two points or more for each of these unknowns. Level points
    (within 15 % of the course) have degree 0.
    """
    bottom, top = group.span_m
    if np.ptp(height_m) <= RING_SPREAD * (top - bottom):
        return 0
    n = len(height_m)
    waves = harmonics(azimuth_rad, max(min(n // 8, 6), 1))[:, 3:]
    ends = np.array([-1.0, 1.0])
    for degree in range(HIGHEST_DEGREE, 0, -1):
        free = free_columns(azimuth_rad, group.zeta(height_m), degree)
        design = np.hstack([free, waves])
        if n < 2 * design.shape[1] or np.linalg.matrix_rank(design) < design.shape[1]:
            continue
        at_ends = np.zeros((2, design.shape[1]))
        at_ends[:, : free.shape[1]] = free_columns(np.zeros(2), ends, degree)
        at_ends[:, [1, 2, 4, 5]] = 0.0  # the mean has no wave
        variance = np.sum(at_ends * np.linalg.solve(design.T @ design, at_ends.T).T, axis=1)
        # rounding makes a variance negative where the columns are all but dependent
        if variance.min() >= 0 and n * variance.max() <= MOST_AMPLIFICATION**2:
            return degree
    return 0


def _rings(height_m, tall_m):
    order = np.argsort(height_m, kind="stable")
    cuts = np.flatnonzero(np.diff(height_m[order]) > RING_GAP * tall_m) + 1
    return np.split(order, cuts)


def _is_ring(height_m, azimuth_rad, tall_m):
    ordered = np.sort(azimuth_rad)
    gaps = np.diff(ordered, append=ordered[0] + 2 * np.pi)
    level = np.ptp(height_m) <= RING_SPREAD * tall_m
    return level and len(ordered) >= 5 and gaps.max() < 2 * np.pi / 3


def coordinates_of(points):
    """Places of the coordinates of points among all coordinates x1 y1 z1 x2 ...

    Parameters
    ----------
    points : array_like of int, shape (k,)

    Returns
    -------
    ndarray of int, shape (3k,)

    Examples
    --------
    >>> coordinates_of([2]).tolist()
    [6, 7, 8]
    """
    return (3 * np.asarray(points)[:, None] + np.arange(3)).ravel()


def covariance_of(points, covariance_m2):
    """Covariance of some points out of that of all; a dense one is made positive definite.

    Parameters
    ----------
    points : array_like of int, shape (k,)
    covariance_m2 : ndarray or sparse matrix, shape (3n, 3n)

    Returns
    -------
    ndarray or sparse matrix, shape (3k, 3k)
        In m2. To a dense block that is singular (a fixed point, a free network) the variance of a
        micrometre is added.

    Examples
    --------
    >>> covariance_of([1], np.diag([1.0, 1, 1, 4, 5, 6])).diagonal().tolist()
    [4.0, 5.0, 6.0]
    """
    index = coordinates_of(points)
    if scipy.sparse.issparse(covariance_m2):
        return covariance_m2[index][:, index]
    block = covariance_m2[np.ix_(index, index)]
    try:
        np.linalg.cholesky(block)
    except np.linalg.LinAlgError:  # a fixed point, or a free network
        block = block + LEAST_SD_M**2 * np.eye(len(index))
    return block


def own_covariances(covariance_m2):
    """Covariance of each point, where that of all is sparse and they are independent; else None.

    Parameters
    ----------
    covariance_m2 : ndarray or sparse matrix, shape (3n, 3n)

    Returns
    -------
    ndarray, shape (n, 3, 3), or None
        In m2.

    Examples
    --------
    >>> own_covariances(scipy.sparse.diags_array([1.0, 2.0, 3.0])).diagonal(axis1=1, axis2=2)
    array([[1., 2., 3.]])
    """
    if not scipy.sparse.issparse(covariance_m2):
        return None
    entries = covariance_m2.tocoo()
    (point, row), (other, column) = (np.divmod(one, 3) for one in (entries.row, entries.col))
    if np.any(point != other):
        return None
    found = np.zeros((covariance_m2.shape[0] // 3, 3, 3))
    np.add.at(found, (point, row, column), entries.data)
    return found


def slide(xyz_m, slope, z_m):
    """Points slid parallel to the axis to height z, and the derivative.

    A horizontal cut of a leaning shell is what is wanted, so the tilt is contained and never
    corrected again. The slope itself is taken as exact: its error has opposite signs on opposite
    sides of the tank, so the area hardly changes with it.

    Parameters
    ----------
    xyz_m : array_like, shape (n, 3)
    slope : array_like, shape (2,)
        Of the axis: metres in x and y for a metre of height.
    z_m : float
        Height of the cut, m.

    Returns
    -------
    xy_m : ndarray, shape (n, 2)
    by_xyz : sparse array, shape (2n, 3n)
        d(xy) / d(xyz).

    Examples
    --------
    >>> xy, by_xyz = slide([[1.0, 0.0, 3.0]], (0.01, 0.0), 1.0)
    >>> xy.tolist(), by_xyz.toarray()[0].tolist()
    ([[0.98, 0.0]], [1.0, 0.0, -0.01])
    """
    n = len(xyz_m)
    rows = np.repeat(np.arange(2 * n), 2)
    columns = np.add.outer(3 * np.arange(n), [0, 2, 1, 2]).ravel()
    values = np.tile([1.0, -slope[0], 1.0, -slope[1]], n)
    by_xyz = scipy.sparse.csr_array((values, (rows, columns)), shape=(2 * n, 3 * n))
    return _slid(xyz_m, slope, z_m), by_xyz


def _slid(xyz_m, slope, z_m):
    xyz_m = np.asarray(xyz_m, dtype=float)
    return xyz_m[:, :2] - (xyz_m[:, 2:] - z_m) * np.asarray(slope)


def _by_own(slope):
    """(2, 3) derivative of x and y of a point that is slid by its own x, y, z."""
    return np.column_stack([np.eye(2), -np.asarray(slope, dtype=float)])


def _in_plan(xyz_m, covariance_m2, slope, z_m):
    """Points (n, 2) slid to height z, and their covariance, of each point where it was so given."""
    if np.ndim(covariance_m2) == 3:
        by_own = _by_own(slope)
        return _slid(xyz_m, slope, z_m), by_own @ covariance_m2 @ by_own.T
    xy, by_xyz = slide(xyz_m, slope, z_m)
    return xy, by_xyz @ covariance_m2 @ by_xyz.T


def sample_of(group, xyz_m, covariance_m2, slope, z_m):
    """Radii of a group of points about the centre of their circle, for the field of the wall.

    Radius and centre are free there, so an approximate centre will do. The ellipse that the lean
    makes of a circle is known, so it is taken off: the field would have to learn it as ovality, and
    points that are not level do not separate ovality from bulge. Its factor departs from one by
    m^2 / 4 (6e-4 for 50 mm/m), too little to count in the covariance.

    Parameters
    ----------
    group, xyz_m, covariance_m2, slope, z_m
        As in `fit_section`.

    Returns
    -------
    form.Sample
    """
    xy, covariance_xy = _in_plan(xyz_m, covariance_m2, slope, z_m)
    middle = xy.mean(axis=0)
    centre = taubin_circle(xy - middle)[:2] + middle
    noise = radial_covariance(xy, centre, covariance_xy)
    azimuth, radius = polar(xy, *centre)
    radius = radii_square_to_axis(azimuth, radius, slope)
    return Sample(azimuth, radius, noise, _zeta(group, xyz_m, z_m), centre)


def fit_section(group, xyz_m, covariance_m2, slope, z_m, form_m2):
    """Circle and outline of the points of one group.

    The outline is smoothed by the form and the noise of the wall in every section. So a missing
    point does not give a section another estimator than its neighbours.

    Parameters
    ----------
    group : Group
    xyz_m : (n, 3) array
        The members of the group, in metres.
    covariance_m2 : (3n, 3n) array or sparse matrix, or (n, 3, 3) array
        In the order x1 y1 z1 x2 ...; or that of each point, where they are independent.
    slope : (2,) array
        Of the axis: metres in x and y for a metre of height.
    z_m : float
        Height of the cut (group.height_m) in the frame of the points.
    form_m2 : float
        Amplitude of the shell's form: mode k >= 2 of the outline has the variance form_m2 k^-3.

    Returns
    -------
    Section

    Raises
    ------
    SolutionError
        For fewer than 3 points, or points on a line.

    Examples
    --------
    Twelve points, 1 mm each, on a circle of 6.5 m radius: u of the radius is 1 mm / sqrt(12).

    >>> azimuth = np.arange(12) * np.pi / 6
    >>> xyz = 6.5 * np.column_stack([np.sin(azimuth), np.cos(azimuth), np.zeros(12)])
    >>> group = Group("1", 0, 1.0, np.arange(12))
    >>> section = fit_section(group, xyz, 1e-6 * np.eye(36), (0.0, 0.0), 0.0, 0.0)
    >>> round(section.circle.radius_m, 9)
    6.5
    >>> round(float(np.sqrt(section.circle.cofactor_m2[2, 2])) * 1000, 4)
    0.2887
    """
    xy, covariance_xy = _in_plan(xyz_m, covariance_m2, slope, z_m)
    circle = fit_circle(xy, covariance_xy)
    centre = circle.x_m, circle.y_m
    here, zeta = float(group.zeta(group.height_m)), _zeta(group, xyz_m, z_m)
    noise = radial_covariance(xy, centre, covariance_xy)
    outline = smooth_outline(xy, *centre, noise, form_m2, zeta - here, group.degree)
    by_points = own_columns(radii_by_coordinates(outline, xy) @ _by_own(slope))
    return Section(group, circle, outline, by_points)


def circle_by_coordinates(section, xyz_m, covariance_m2, slope, z_m):
    """(3, 3n) derivative of x, y and radius of a section's circle by x, y, z of its points.

    xyz_m, covariance_m2, slope, z_m  as in `fit_section`, which it came from
    """
    by_xy = circle_by_points(section.circle, *_in_plan(xyz_m, covariance_m2, slope, z_m))
    return (by_xy.reshape(3, -1, 2) @ _by_own(slope)).reshape(3, -1)


def _zeta(group, xyz_m, z_m):
    return group.zeta(np.asarray(xyz_m)[:, 2] - z_m + group.height_m)
