"""Horizontal sections of a shell: grouping of points, circle and outline of each group.

Points of a course that are not level form no section. Their circle and outline refer to their mean
height and are fitted with a taper and a lean.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse

from tankcal.covariance import PointCovariance
from tankcal.geometry.circles import (
    Circle,
    circle_by_points,
    fit_circle,
    own_columns,
    radial_covariance,
    taubin_circle,
)
from tankcal.geometry.outlines import (
    Outline,
    Sample,
    free_columns,
    harmonics,
    polar,
    radii_by_coordinates,
    radii_square_to_axis,
    smooth_outline,
)

RING_GAP, RING_SPREAD = 0.10, 0.15  # height gap between rings, height range of a ring; per course
LEAST_SD_M = 1e-6  # regularises a singular covariance: a fixed point, or a free network
HIGHEST_DEGREE, MOST_AMPLIFICATION = 2, 6.0  # in height; of u(mean radius) at an end of a course


@dataclass(frozen=True)
class Group:
    """Points of one section, or of a whole course whose points are not level.

    Attributes
    ----------
    name : str
        Name of the section.
    course : int
        Index of the course, from the bottom up.
    height_m : float
        Mean height of the points above the bottom, m.
    members : ndarray of int, shape (n,)
        Indices of the points.
    span_m : tuple of float, or None
        Heights of the bottom and the top of the course, m; None if unknown.
    degree : int
        Degree of the polynomial in height that is fitted to the points; 0 for level points.
    """

    name: str
    course: int
    height_m: float
    members: np.ndarray
    span_m: tuple[float, float] | None = None
    degree: int = 0

    def zeta(self, height_m):
        """Relative heights within the course: -1 at its bottom, +1 at its top; 0 without a span."""
        if self.span_m is None:
            return 0.0 * np.asarray(height_m)
        bottom, top = self.span_m
        return (2 * np.asarray(height_m) - bottom - top) / (top - bottom)


@dataclass(frozen=True)
class Section:
    """Group of points with its circle and outline.

    Attributes
    ----------
    group : Group
        The points.
    circle : Circle
        Least-squares circle.
    outline : Outline
        Outline at group.height_m.
    radii_by_points : sparse array, shape (n, 3n)
        Derivatives of the n measured radii of the outline by x, y, z of the points.
    """

    group: Group
    circle: Circle
    outline: Outline
    radii_by_points: scipy.sparse.csr_array


def group_by_height(height_m, azimuth_rad, course, joints_m):
    """Group points without a section name: into rings where they are level, else by course.

    The points of a course form rings if each cluster of heights has at least 5 points and no gap of
    a third of a turn. Clusters are separated by at least a tenth of the course height. The heights
    of a cluster lie within 15 % of the course height.

    Parameters
    ----------
    height_m : ndarray, shape (n,)
        Heights above the bottom, m.
    azimuth_rad : ndarray, shape (n,)
        Azimuths about the axis, rad.
    course : ndarray of int, shape (n,)
        Index of the course of each point.
    joints_m : array_like, shape (courses + 1,)
        Heights of the joints above the bottom, m.

    Returns
    -------
    list of Group
        From the bottom up, named "1", "2", or "2.1", "2.2" for rings.

    Examples
    --------
    Two rings of eight points in one course:

    >>> azimuth = np.tile(np.arange(8) * np.pi / 4, 2)
    >>> height = np.repeat([0.5, 1.5], 8)
    >>> groups = group_by_height(height, azimuth, np.zeros(16, dtype=int), [0.0, 2.0])
    >>> [(group.name, group.height_m) for group in groups]
    [('1.1', 0.5), ('1.2', 1.5)]
    """
    groups = []
    for index in range(len(joints_m) - 1):
        members = np.flatnonzero(course == index)
        if len(members) == 0:
            continue
        span = (float(joints_m[index]), float(joints_m[index + 1]))
        tall = span[1] - span[0]
        # Rings are accepted only if every cluster is a complete, level ring; otherwise the whole
        # course becomes a single group with a fit in height.
        rings = _split_rings(height_m[members], tall)
        name = str(index + 1)
        if len(rings) > 1 and all(
            _is_ring(height_m[members[ring]], azimuth_rad[members[ring]], tall) for ring in rings
        ):
            for number, ring in enumerate(rings, start=1):
                ring_members = members[ring]
                height = float(height_m[ring_members].mean())
                groups.append(Group(f"{name}.{number}", index, height, ring_members, span))
        else:
            height = float(height_m[members].mean())
            groups.append(Group(name, index, height, members, span))
    return _add_degrees(groups, height_m, azimuth_rad)


def group_by_name(names, height_m, course_of, azimuth_rad=None, joints_m=None):
    """Group points by their section name; the mean height determines the course.

    Parameters
    ----------
    names : sequence of str, length n
        Section name of each point.
    height_m : ndarray, shape (n,)
        Heights above the bottom, m.
    course_of : callable
        course_of(height_m) -> index of the course.
    azimuth_rad : ndarray, shape (n,), optional
        Azimuths, rad; required with `joints_m`.
    joints_m : array_like, shape (courses + 1,), optional
        Heights of the joints, m. With joints and azimuths, sections that are not level get a
        polynomial in height. Without them, every section counts as level.

    Returns
    -------
    list of Group
        From the bottom up.

    Examples
    --------
    >>> groups = group_by_name(["b", "a", "b"], np.array([2.0, 1.0, 2.2]), lambda height: 0)
    >>> [(group.name, group.members.tolist()) for group in groups]
    [('a', [1]), ('b', [0, 2])]
    """
    groups = []
    for name in dict.fromkeys(names):
        # dict.fromkeys keeps the order of the names, so that the result does not depend on hashing.
        members = np.array([i for i, item in enumerate(names) if item == name])
        height = float(height_m[members].mean())
        course = int(course_of(height))
        span = None if joints_m is None else tuple(map(float, joints_m[course : course + 2]))
        groups.append(Group(name, course, height, members, span))
    groups.sort(key=lambda group: group.height_m)
    return groups if joints_m is None else _add_degrees(groups, height_m, azimuth_rad)


def _add_degrees(groups, height_m, azimuth_rad):
    """Add the degree in height to each group that is the only group of its course."""
    courses = [group.course for group in groups]
    return [
        replace(
            group, degree=_find_degree(group, height_m[group.members], azimuth_rad[group.members])
        )
        if courses.count(group.course) == 1
        else group
        for group in groups
    ]


def _find_degree(group, height_m, azimuth_rad):
    """Degree of the polynomial in height that the points determine: 0, 1 or 2.

    Level points (within 15 % of the course height) have degree 0. Otherwise the result is the
    highest degree that meets two conditions. Each unknown has at least two points. At either end of
    the course, u of the mean radius is at most 6 times u of the mean radius of all points. Low
    harmonics of the section are estimated as well, because points along a spiral do not separate
    them from a taper.
    """
    # Level points cannot determine a slope in height.
    bottom, top = group.span_m
    if np.ptp(height_m) <= RING_SPREAD * (top - bottom):
        return 0
    n = len(height_m)
    # Harmonics from order 2 on; the free columns below contain the radius and the centre.
    waves = harmonics(azimuth_rad, max(min(n // 8, 6), 1))[:, 3:]
    ends = np.array([-1.0, 1.0])
    # The highest degree with sufficient precision wins.
    for degree in range(HIGHEST_DEGREE, 0, -1):
        free = free_columns(azimuth_rad, group.zeta(height_m), degree)
        design = np.hstack([free, waves])
        if n < 2 * design.shape[1] or np.linalg.matrix_rank(design) < design.shape[1]:
            continue
        # Variance of the mean radius at both ends, for observations of unit variance.
        at_ends = np.zeros((2, design.shape[1]))
        at_ends[:, : free.shape[1]] = free_columns(np.zeros(2), ends, degree)
        at_ends[:, [1, 2, 4, 5]] = 0.0  # the mean radius does not depend on the centre
        variance = np.sum(at_ends * np.linalg.solve(design.T @ design, at_ends.T).T, axis=1)
        # Rounding makes a variance negative if the columns are nearly dependent.
        if variance.min() >= 0 and n * variance.max() <= MOST_AMPLIFICATION**2:
            return degree
    return 0


def _split_rings(height_m, tall_m):
    """Split heights (n,) into clusters separated by a gap; return arrays of indices."""
    order = np.argsort(height_m, kind="stable")
    cuts = np.flatnonzero(np.diff(height_m[order]) > RING_GAP * tall_m) + 1
    return np.split(order, cuts)


def _is_ring(height_m, azimuth_rad, tall_m):
    """Whether points are level, number at least 5 and leave no gap of a third of a turn."""
    ordered = np.sort(azimuth_rad)
    gaps = np.diff(ordered, append=ordered[0] + 2 * np.pi)
    level = np.ptp(height_m) <= RING_SPREAD * tall_m
    return level and len(ordered) >= 5 and gaps.max() < 2 * np.pi / 3


def coordinates_of(points):
    """Indices of the coordinates of points in the vector x1 y1 z1 x2 ...

    Parameters
    ----------
    points : array_like of int, shape (k,)
        Indices of the points.

    Returns
    -------
    ndarray of int, shape (3k,)
        Indices of their coordinates.

    Examples
    --------
    >>> coordinates_of([2]).tolist()
    [6, 7, 8]
    """
    return (3 * np.asarray(points)[:, None] + np.arange(3)).ravel()


def slide(xyz_m, slope, z_m):
    """Slide points parallel to the axis to the height z, and differentiate the result.

    Parameters
    ----------
    xyz_m : array_like, shape (n, 3)
        Points, m.
    slope : array_like, shape (2,)
        Slope of the axis: displacement in x and y per unit of height.
    z_m : float
        Height of the cut, m.

    Returns
    -------
    xy_m : ndarray, shape (n, 2)
        Coordinates in the horizontal cut, m.
    by_xyz : ndarray, shape (2, 3)
        Derivative of the slid x and y of a point by its x, y, z.

    Notes
    -----
    The capacity table requires a horizontal cut of a leaning shell. The cut contains the tilt,
    which therefore needs no later correction. The slope is treated as exact. Its error has opposite
    signs on opposite sides of the tank, so that the area hardly depends on it.

    Examples
    --------
    >>> xy, by_xyz = slide([[1.0, 0.0, 3.0]], (0.01, 0.0), 1.0)
    >>> xy.tolist(), by_xyz[0].tolist()
    ([[0.98, 0.0]], [1.0, 0.0, -0.01])
    """
    xyz_m, slope = np.asarray(xyz_m, dtype=float), np.asarray(slope, dtype=float)
    return xyz_m[:, :2] - (xyz_m[:, 2:] - z_m) * slope, np.column_stack([np.eye(2), -slope])


def _project_to_plan(xyz_m, covariance_m2, slope, z_m):
    """Points (n, 2) slid to the height z, their PointCovariance, and the derivative (2, 3)."""
    xy, by_xyz = slide(xyz_m, slope, z_m)
    return xy, PointCovariance.convert(covariance_m2, 3).mapped(by_xyz), by_xyz


def sample_of(group, xyz_m, covariance_m2, slope, z_m):
    """Radii of a group of points about the centre of its circle, for the wall field.

    Parameters
    ----------
    group, xyz_m, covariance_m2, slope, z_m
        As in `fit_section`.

    Returns
    -------
    tankcal.geometry.outlines.Sample

    Notes
    -----
    The wall field estimates radius and centre itself, so that an approximate centre is sufficient.
    The horizontal cut of a leaning circular shell is an ellipse. This known ellipse is removed from
    the radii. Otherwise the field would estimate it as ovality, and points that are not level do
    not separate ovality from bulge. The factor differs from one by at most m^2 / 4 (6e-4 for 50
    mm/m), which the covariance neglects.
    """
    xy, covariance_xy, _ = _project_to_plan(xyz_m, covariance_m2, slope, z_m)
    # An algebraic circle is sufficient; the shift to the mean avoids cancellation.
    middle = xy.mean(axis=0)
    centre = taubin_circle(xy - middle)[:2] + middle
    noise = radial_covariance(xy, centre, covariance_xy)
    azimuth, radius = polar(xy, *centre)
    radius = radii_square_to_axis(azimuth, radius, slope)
    return Sample(azimuth, radius, noise, _relative_heights(group, xyz_m, z_m), centre)


def fit_section(group, xyz_m, covariance_m2, slope, z_m, form_m2):
    """Fit the circle and the outline of one group of points.

    Parameters
    ----------
    group : Group
        The group.
    xyz_m : array_like, shape (n, 3)
        Coordinates of the members of the group, m.
    covariance_m2 : PointCovariance or ndarray, shape (3n, 3n) or (n, 3, 3)
        Covariance in the order x1 y1 z1 x2 ..., m2; or of each point, if the points are
        independent.
    slope : array_like, shape (2,)
        Slope of the axis: displacement in x and y per unit of height.
    z_m : float
        Height of the cut (group.height_m) in the frame of the points, m.
    form_m2 : float
        Amplitude of the form of the shell, m2: mode k >= 2 of the outline has the variance form_m2
        k^-3.

    Returns
    -------
    Section

    Raises
    ------
    SolutionError
        For fewer than 3 points, or for points on a line.

    Notes
    -----
    In every section the outline is smoothed with the form and the noise of the whole wall. A
    section with a missing point therefore uses the same estimator as its neighbours.

    Examples
    --------
    Twelve points with u = 1 mm on a circle of 6.5 m radius: u of the radius is 1 mm / sqrt(12).

    >>> azimuth = np.arange(12) * np.pi / 6
    >>> xyz = 6.5 * np.column_stack([np.sin(azimuth), np.cos(azimuth), np.zeros(12)])
    >>> group = Group("1", 0, 1.0, np.arange(12))
    >>> section = fit_section(group, xyz, 1e-6 * np.eye(36), (0.0, 0.0), 0.0, 0.0)
    >>> round(section.circle.radius_m, 9)
    6.5
    >>> round(float(np.sqrt(section.circle.cofactor_m2[2, 2])) * 1000, 4)
    0.2887
    """
    xy, covariance_xy, by_xyz = _project_to_plan(xyz_m, covariance_m2, slope, z_m)
    circle = fit_circle(xy, covariance_xy)
    centre = circle.x_m, circle.y_m
    group_zeta, zeta = float(group.zeta(group.height_m)), _relative_heights(group, xyz_m, z_m)
    noise = radial_covariance(xy, centre, covariance_xy)
    # Relative heights count from the height of the group, at which the outline is stated.
    outline = smooth_outline(xy, *centre, noise, form_m2, zeta - group_zeta, group.degree)
    # Chain rule: radii by plan coordinates, plan coordinates by x, y, z.
    by_points = own_columns(radii_by_coordinates(outline, xy) @ by_xyz)
    return Section(group, circle, outline, by_points)


def circle_by_coordinates(section, xyz_m, covariance_m2, slope, z_m):
    """Derivatives of the circle of a section by the coordinates of its points.

    Parameters
    ----------
    section : Section
        Result of `fit_section` with the following arguments.
    xyz_m, covariance_m2, slope, z_m
        As in `fit_section`.

    Returns
    -------
    ndarray, shape (3, 3n)
        Derivatives of x, y and radius by x1, y1, z1, x2, ...
    """
    xy, covariance_xy, by_xyz = _project_to_plan(xyz_m, covariance_m2, slope, z_m)
    by_xy = circle_by_points(section.circle, xy, covariance_xy)
    return (by_xy.reshape(3, -1, 2) @ by_xyz).reshape(3, -1)


def _relative_heights(group, xyz_m, z_m):
    """Relative heights of points within the course, given in the frame of the points."""
    return group.zeta(np.asarray(xyz_m)[:, 2] - z_m + group.height_m)
