"""Horizontal sections of a shell: points grouped, the circle through them, and their outline."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from tankcal.adjust import adjust
from tankcal.errors import SolutionError
from tankcal.outlines import (
    Outline,
    evenly_spread,
    interpolate_outline,
    polar,
    radii_by_coordinates,
    smooth_outline,
)


@dataclass(frozen=True)
class Circle:
    """Least-squares circle through n points of a section.

    x_m, y_m, radius_m   centre and radius
    cofactor_m2          (3, 3) covariance of x, y, radius for variance factor 1
    residuals_m          (n,) distance of each point to the circle, outwards positive
    variance_factor      v' Q^-1 v / (n - 3)
    """

    x_m: float
    y_m: float
    radius_m: float
    cofactor_m2: np.ndarray
    residuals_m: np.ndarray
    variance_factor: float
    dof: int


def fit_circle(xy_m, covariance_m2):
    """Geometric circle: the sum of squared, weighted point corrections is the minimum.

    Condition for each point: hypot(x - xc, y - yc) - R = 0 (Silva 1995, program CIRCUM, linearised
    at the adjusted points). For n even points of standard deviation s: s_centre = s sqrt(2/n),
    s_radius = s / sqrt(n).

    xy_m (n, 2); covariance_m2 (2n, 2n) dense or sparse, in the order x1 y1 x2 y2 ...
    Raises SolutionError for fewer than 3 points or points on a line.
    """
    xy_m = np.asarray(xy_m, dtype=float)
    n = len(xy_m)
    if n < 3:
        raise SolutionError(f"a circle needs 3 points, {n} were given")
    centre = xy_m.mean(axis=0)
    local = xy_m - centre
    adjusted = adjust(circle_conditions, _taubin(local), local.ravel(), covariance_m2)
    x, y, radius = adjusted.unknowns
    return Circle(
        x_m=float(x + centre[0]),
        y_m=float(y + centre[1]),
        radius_m=float(radius),
        cofactor_m2=adjusted.cofactor,
        residuals_m=np.hypot(local[:, 0] - x, local[:, 1] - y) - radius,
        variance_factor=adjusted.variance_factor,
        dof=adjusted.dof,
    )


def circle_conditions(unknowns, coordinates):
    """Misclosures and both Jacobians of hypot(x - xc, y - yc) - R = 0 (a model for `adjust`)."""
    x, y, radius = unknowns
    d = coordinates.reshape(-1, 2) - (x, y)
    distance = np.hypot(d[:, 0], d[:, 1])
    unit = d / distance[:, None]
    n = len(unit)
    by_points = scipy.sparse.csr_array(
        (unit.ravel(), np.arange(2 * n), np.arange(0, 2 * n + 1, 2)), shape=(n, 2 * n)
    )
    return distance - radius, np.column_stack([-unit, -np.ones(n)]), by_points


def _taubin(local):
    """Centre and radius of Taubin's algebraic circle (1991), the start of the geometric fit."""
    z = np.sum(local**2, axis=1)
    mean = z.mean()
    if not mean > 0:
        raise SolutionError("all points of the section lie on one place")
    design = np.column_stack([(z - mean) / (2 * np.sqrt(mean)), local])
    values, vectors = np.linalg.svd(design, full_matrices=False)[1:]
    if values[1] < 1e-9 * values[0] or abs(vectors[-1, 0]) < 1e-12:
        raise SolutionError("the points of the section lie on a line")
    a = vectors[-1]
    scaled = a[0] / (2 * np.sqrt(mean))
    x, y = -a[1:] / (2 * scaled)
    return np.array([x, y, np.sqrt(x**2 + y**2 + mean)])


@dataclass(frozen=True)
class Group:
    """Points that make one section: its name, course (index), height above the bottom, members."""

    name: str
    course: int
    height_m: float
    members: np.ndarray


@dataclass(frozen=True)
class Section:
    """One horizontal section: the group of its points, its circle and its outline.

    parameters_by_points  (p, 3 n) derivative of the outline's parameters by x, y, z of its points
    """

    group: Group
    circle: Circle
    outline: Outline
    parameters_by_points: np.ndarray


RING_GAP, RING_SPREAD = 0.10, 0.15  # of the course height: between rings, within one ring


def group_by_height(height_m, azimuth_rad, course, joints_m):
    """Sections of points without a section number: rings where they lie level, else one a course.

    Points of a course form rings when each cluster of heights (apart by a tenth of the course,
    level within 15 % of it) has 5 points or more and no gap of a third of a turn.
    height_m (n,) and joints_m (courses + 1,) above the bottom; course (n,) index. Names: "1", "2",
    or "2.1", "2.2" for rings, from the bottom up.
    """
    groups = []
    for index in range(len(joints_m) - 1):
        members = np.flatnonzero(course == index)
        if len(members) == 0:
            continue
        tall = joints_m[index + 1] - joints_m[index]
        rings = _rings(height_m[members], tall)
        if len(rings) > 1 and all(
            _is_ring(height_m[members[ring]], azimuth_rad[members[ring]], tall) for ring in rings
        ):
            for number, ring in enumerate(rings, start=1):
                chosen = members[ring]
                name = f"{index + 1}.{number}"
                groups.append(Group(name, index, float(height_m[chosen].mean()), chosen))
        else:
            groups.append(Group(str(index + 1), index, float(height_m[members].mean()), members))
    return groups


def group_by_name(names, height_m, course_of):
    """Sections of points that carry a section name; their mean height decides the course."""
    groups = []
    for name in dict.fromkeys(names):
        members = np.array([i for i, other in enumerate(names) if other == name])
        height = float(height_m[members].mean())
        groups.append(Group(name, int(course_of(height)), height, members))
    return sorted(groups, key=lambda group: group.height_m)


def _rings(height_m, tall_m):
    order = np.argsort(height_m, kind="stable")
    cuts = np.flatnonzero(np.diff(height_m[order]) > RING_GAP * tall_m) + 1
    return np.split(order, cuts)


def _is_ring(height_m, azimuth_rad, tall_m):
    ordered = np.sort(azimuth_rad)
    gaps = np.diff(ordered, append=ordered[0] + 2 * np.pi)
    level = np.ptp(height_m) <= RING_SPREAD * tall_m
    return level and len(ordered) >= 5 and gaps.max() < 2 * np.pi / 3


def slide(xyz_m, slope, z_m):
    """Points slid parallel to the axis to height z: xy (n, 2) and d(xy)/d(xyz), (2n, 3n) sparse.

    A horizontal cut of a leaning shell is what is wanted, so the tilt is contained and never
    corrected again. The slope itself is taken as exact: what it errs has opposite signs on
    opposite sides of the tank, so the area hardly knows it.
    """
    xyz_m = np.asarray(xyz_m, dtype=float)
    n = len(xyz_m)
    xy = xyz_m[:, :2] - (xyz_m[:, 2:] - z_m) * np.asarray(slope)
    rows = np.repeat(np.arange(2 * n), 2)
    columns = np.array([[3 * i, 3 * i + 2, 3 * i + 1, 3 * i + 2] for i in range(n)]).ravel()
    values = np.tile([1.0, -slope[0], 1.0, -slope[1]], n)
    return xy, scipy.sparse.csr_array((values, (rows, columns)), shape=(2 * n, 3 * n))


def fit_section(group, xyz_m, covariance_m2, slope, z_m, form_m2):
    """Circle and outline of the points of one group.

    xyz_m (n, 3) of the members; covariance_m2 (3n, 3n) dense or sparse; slope of the axis; z_m
    height of the cut in the frame of the points; form_m2 amplitude of `estimate_form`.
    The outline is interpolated where the points are evenly spread, else smoothed.
    """
    xy, by_xyz = slide(xyz_m, slope, z_m)
    covariance_xy = by_xyz @ covariance_m2 @ by_xyz.T
    circle = fit_circle(xy, covariance_xy)
    azimuth, _ = polar(xy, circle.x_m, circle.y_m)
    if evenly_spread(azimuth):
        outline = interpolate_outline(xy, circle.x_m, circle.y_m, form_m2)
    else:
        noise = radial_covariance(xy, circle, covariance_xy)
        outline = smooth_outline(xy, circle.x_m, circle.y_m, noise, form_m2)
    by_points = (outline.from_radii @ radii_by_coordinates(outline, xy)) @ by_xyz
    return Section(group, circle, outline, by_points)


def radial_covariance(xy_m, circle, covariance_m2):
    """Covariance of the distances of points from the centre of their circle.

    (n, n), or (n,) variances when the points are independent of each other (sparse covariance).
    """
    d = np.asarray(xy_m) - (circle.x_m, circle.y_m)
    unit = d / np.hypot(d[:, 0], d[:, 1])[:, None]
    n = len(unit)
    radial = scipy.sparse.csr_array(
        (unit.ravel(), np.arange(2 * n), np.arange(0, 2 * n + 1, 2)), shape=(n, 2 * n)
    )
    covariance = radial @ covariance_m2 @ radial.T
    return covariance.diagonal() if scipy.sparse.issparse(covariance) else covariance
