"""Ellipses, spheres and cylinders through points: geometric fits with full covariance.

The condition for each point is its signed distance from the shape (outwards positive) at the foot
of the perpendicular. The sum v' Q^-1 v of the point corrections is the minimum for adjusted points
on the shape (Gauss-Helmert, `adjust`). For equal variances, this is the sum of squared distances.
With n the outward normal at the foot f of a point P,

    distance = n (P - f),   by P: n',   by a parameter: -n' df/dparameter at a fixed place of f.

Start values are computed here: for ellipses and spheres an algebraic fit, then unweighted distances
by Levenberg-Marquardt; for cylinders of any direction also from points on a part of the
circumference. A lying tank is derived from its cylinder.

Source: Ahn 2004, Least Squares Orthogonal Distance Fitting.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from tankcal.adjust import adjust
from tankcal.errors import SolutionError
from tankcal.messages import message

FLAT_BEYOND = 100.0  # a radius above 100 times the spread of the points is a plane or a line


@dataclass(frozen=True)
class FittedEllipse:
    """Least-squares ellipse through n points of a plane.

    Attributes
    ----------
    x_m, y_m : float
        Centre, m.
    semi_major_m, semi_minor_m : float
        Semi-axes, m.
    azimuth_rad : float
        Azimuth of the major axis, clockwise from +y, 0 to pi; 0 for a circle.
    cofactor : ndarray, shape (5, 5)
        Covariance of x, y, both semi-axes and azimuth (m, rad) for variance factor 1. The variance
        of the azimuth of a circle is inf, without correlation. Semi-axes that differ by little more
        than their standard deviations are biased apart, and the azimuth is then not normally
        distributed.
    residuals_m : ndarray, shape (n,)
        Distance of each point from the ellipse, outwards positive, m.
    variance_factor : float
        v' Q^-1 v / dof, nan without redundancy.
    dof : int
        Redundancy.
    """

    x_m: float
    y_m: float
    semi_major_m: float
    semi_minor_m: float
    azimuth_rad: float
    cofactor: np.ndarray
    residuals_m: np.ndarray
    variance_factor: float
    dof: int


@dataclass(frozen=True)
class FittedSphere:
    """Least-squares sphere through n points.

    Attributes
    ----------
    centre_m : ndarray, shape (3,)
        Centre, m.
    radius_m : float
        Radius, m.
    cofactor_m2 : ndarray, shape (4, 4)
        Covariance of centre and radius for variance factor 1, m2.
    residuals_m : ndarray, shape (n,)
        Distance of each point from the sphere, outwards positive, m.
    variance_factor : float
        v' Q^-1 v / dof, nan without redundancy.
    dof : int
        Redundancy.
    """

    centre_m: np.ndarray
    radius_m: float
    cofactor_m2: np.ndarray
    residuals_m: np.ndarray
    variance_factor: float
    dof: int


def fit_ellipse(xy_m, covariance_m2):
    """Fit a geometric ellipse: centre + S w for all unit vectors w, with S a symmetric matrix.

    S is regular at a circle, where the parameters semi-axes and azimuth (its eigenvalues and
    eigenvectors) are singular. Start values: direct least squares (Halir & Flusser 1998).

    Parameters
    ----------
    xy_m : ndarray, shape (n, 2)
        Points, m.
    covariance_m2 : PointCovariance or ndarray, shape (2n, 2n) or (2n,)
        Covariance, dense or sparse, or variances, in the order x1 y1 x2 y2 ..., m2.

    Returns
    -------
    FittedEllipse

    Raises
    ------
    SolutionError
        For fewer than 5 points, or points on a line or on no ellipse.
    """
    mean, local = center_points(xy_m, 5, "an ellipse")
    spread = spread_of(local, 2, "line")
    start = descend_distances(ellipse_distances, _direct_ellipse(local / spread) * spread, local)
    adjusted = adjust(conditions_of(ellipse_distances, 2), start, local.ravel(), covariance_m2)
    x, y, *shape = adjusted.unknowns
    (major, minor, azimuth), by_shape = _axes(*shape)
    refuse_flat(major, spread, "an ellipse with a half axis")
    # Propagate the covariance from (Sxx, Syy, Sxy) to semi-axes and azimuth.
    transform = np.eye(5)
    transform[2:, 2:] = by_shape
    cofactor = transform @ adjusted.cofactor @ transform.T
    if not np.any(by_shape[2]):
        cofactor[4, 4] = np.inf
    return FittedEllipse(
        x_m=float(x + mean[0]),
        y_m=float(y + mean[1]),
        semi_major_m=major,
        semi_minor_m=minor,
        azimuth_rad=azimuth,
        cofactor=cofactor,
        residuals_m=ellipse_distances(adjusted.unknowns, local)[0],
        variance_factor=adjusted.variance_factor,
        dof=adjusted.dof,
    )


def ellipse_distances(unknowns, points):
    """Return distances (n,) of points (n, 2) from an ellipse, their derivatives, and normals.

    The unknowns are x, y, Sxx, Syy, Sxy; the derivatives have the shape (n, 5), the normals (n, 2).
    """
    x, y, sxx, syy, sxy = unknowns
    values, axes = np.linalg.eigh([[sxx, sxy], [sxy, syy]])
    # The foot points are found in the frame of the principal axes.
    d = (points - (x, y)) @ axes
    distance, normal, place = _foot_points(d, np.abs(values))
    normal, w = normal @ axes.T, (place * np.sign(values)) @ axes.T
    # dS w = (dSxx wx + dSxy wy, dSyy wy + dSxy wx); the derivative of the distance is -n . dS w.
    by_sxy = normal[:, 0] * w[:, 1] + normal[:, 1] * w[:, 0]
    by_unknowns = -np.column_stack([normal, normal * w, by_sxy])
    return distance, by_unknowns, normal


def fit_sphere(xyz_m, covariance_m2):
    """Fit a geometric sphere: distance from the centre - R = 0 for each adjusted point.

    Parameters
    ----------
    xyz_m : array_like, shape (n, 3)
        Points, m.
    covariance_m2 : PointCovariance or ndarray, shape (3n, 3n) or (3n,)
        Covariance, or variances, of the coordinates in the order x1 y1 z1 x2 ..., m2.

    Returns
    -------
    FittedSphere

    Raises
    ------
    SolutionError
        For fewer than 4 points, or points in a plane.

    Examples
    --------
    >>> points = [[2, 0, 0], [-2, 0, 0], [0, 2, 0], [0, -2, 0], [0, 0, 2]]
    >>> round(fit_sphere(points, np.full(15, 1e-6)).radius_m, 9)
    2.0
    """
    mean, local = center_points(xyz_m, 4, "a sphere")
    spread = spread_of(local, 3, "plane")
    # Algebraic start: |p|^2 = 2 c . p + (R^2 - |c|^2) is linear in c and the constant.
    design = np.column_stack([2 * local, np.ones(len(local))])
    *centre, constant = np.linalg.lstsq(design, np.sum(local**2, axis=1), rcond=None)[0]
    algebraic = [*centre, np.sqrt(max(constant + np.sum(np.square(centre)), 0.0))]
    start = descend_distances(sphere_distances, algebraic, local)
    refuse_flat(start[3], spread, "a sphere with a radius")
    adjusted = adjust(conditions_of(sphere_distances), start, local.ravel(), covariance_m2)
    *centre, radius = adjusted.unknowns
    return FittedSphere(
        centre_m=mean + centre,
        radius_m=float(radius),
        cofactor_m2=adjusted.cofactor,
        residuals_m=sphere_distances(adjusted.unknowns, local)[0],
        variance_factor=adjusted.variance_factor,
        dof=adjusted.dof,
    )


def sphere_distances(unknowns, points):
    """Return distances (n,) of points (n, 3) from a sphere, derivatives (n, 4), and normals (n, 3).

    The unknowns are x, y, z, R.
    """
    distance, normal = unit_vectors(points - unknowns[:3])
    by_unknowns = -np.column_stack([normal, np.ones(len(normal))])
    return distance - unknowns[3], by_unknowns, normal


def center_points(points_m, needed, what):
    """Return the mean (k,) of points (n, k), and the points about the mean.

    Parameters
    ----------
    points_m : array_like, shape (n, k)
        Points, m.
    needed : int
        Least number of points.
    what : str
        Shape, for the message.

    Returns
    -------
    mean : ndarray, shape (k,)
    local : ndarray, shape (n, k)

    Raises
    ------
    SolutionError
        For fewer points than needed.
    """
    points_m = np.asarray(points_m, dtype=float)
    if len(points_m) < needed:
        raise SolutionError(f"{what} needs {needed} points, {len(points_m)} were given")
    mean = points_m.mean(axis=0)
    return mean, points_m - mean


def spread_of(local, dimensions, flat):
    """Return the root mean square distance of points from their mean, m.

    Parameters
    ----------
    local : ndarray, shape (n, k)
        Points about their mean, m.
    dimensions : int
        Number of dimensions that the points must span.
    flat : str
        "line" or "plane", for the message.

    Returns
    -------
    float

    Raises
    ------
    SolutionError
        If the points span fewer dimensions.
    """
    sizes = np.linalg.svd(local, compute_uv=False)
    if not sizes[dimensions - 1] > 1e-9 * sizes[0]:
        raise SolutionError(
            f"the points lie in a {flat}: spreads "
            + ", ".join(f"{size:.3g}" for size in sizes / np.sqrt(len(local)))
            + " m"
        )
    return np.linalg.norm(sizes) / np.sqrt(len(local))


def refuse_flat(size_m, spread_m, what):
    """Raise SolutionError for a shape much larger than the spread of its points.

    Such a shape is practically a line or a plane.

    Parameters
    ----------
    size_m : float
        Radius or semi-axis, m.
    spread_m : float
        Result of `spread_of`, m.
    what : str
        Shape, for the message.
    """
    if not size_m < FLAT_BEYOND * spread_m:
        raise SolutionError(
            f"{what} of {size_m:.3g} m through points that spread {spread_m:.3g} m: they are flat"
        )


def unit_vectors(d):
    """Return the lengths (n,) of vectors (n, k), and the unit vectors (n, k)."""
    distance = np.linalg.norm(d, axis=1)
    if not np.all(distance > 0):
        raise SolutionError(
            message(
                "point_in_the_centre",
                "a point lies at the centre of the fitted shape",
            )
        )
    return distance, d / distance[:, None]


def conditions_of(distances, dimensions=3):
    """Return the model for `adjust` of a distance function.

    Parameters
    ----------
    distances : callable
        (unknowns, points) -> distances (n,), derivatives by the unknowns (n, p), normals (n, k).
    dimensions : optional
        Dimensions of the points, 2 or 3.

    Returns
    -------
    callable
        (unknowns, coordinates) -> misclosures and both Jacobians, the second (n, k) by the
        coordinates of the point of each condition.
    """

    return lambda unknowns, coordinates: distances(unknowns, coordinates.reshape(-1, dimensions))


def descend_distances(distances, unknowns, points, steps=100):
    """Minimise the sum of squared, unweighted distances by Levenberg-Marquardt.

    Parameters
    ----------
    distances : callable
        As for `conditions_of`.
    unknowns : array_like, shape (p,)
        Start values.
    points : ndarray, shape (n, k)
        m.
    steps : int
        Largest number of evaluations.

    Returns
    -------
    ndarray, shape (p,)
        Unknowns near the minimum; not necessarily converged.
    """
    latest = {}

    # `least_squares` requests value and Jacobian separately: both come from one evaluation.
    def at(x):
        if latest.get("x") != x.tobytes():
            latest.update(x=x.tobytes(), found=distances(x, points))
        return latest["found"]

    found = scipy.optimize.least_squares(
        lambda x: at(x)[0],
        unknowns,
        lambda x: at(x)[1],
        method="lm",
        x_scale="jac",
        xtol=1e-10,
        max_nfev=steps,
    )
    return found.x


def _direct_ellipse(local):
    """Return a start ellipse: direct least squares in the partition of Halir & Flusser 1998."""
    x, y = local.T
    quadratic, linear = np.column_stack([x * x, x * y, y * y]), np.column_stack([x, y, x**0])
    # Eliminate the linear coefficients; the reduced problem has the constraint 4 a c - b^2 = 1.
    by_quadratic = -np.linalg.solve(linear.T @ linear, linear.T @ quadratic)
    reduced = quadratic.T @ (quadratic + linear @ by_quadratic)
    vectors = np.linalg.eig(np.array([reduced[2] / 2, -reduced[1], reduced[0] / 2]))[1].real
    # The eigenvector with 4 a c - b^2 > 0 is the ellipse.
    a, b, c = vectors[:, np.argmax(4 * vectors[0] * vectors[2] - vectors[1] ** 2)]
    matrix = np.array([[a, b / 2], [b / 2, c]])
    if not np.linalg.det(matrix) > 0:
        raise SolutionError(message("no_ellipse", "the points do not lie on an ellipse"))
    d, e, f = by_quadratic @ (a, b, c)
    # Complete the square: centre, then semi-axes from the eigenvalues of the centred conic.
    centre = -np.linalg.solve(matrix, [d, e]) / 2
    size = centre @ matrix @ centre - f
    values, axes = np.linalg.eigh(matrix * np.sign(size))
    half = np.sqrt(abs(size) / np.abs(values))
    shape = (axes * half) @ axes.T
    return np.array([*centre, shape[0, 0], shape[1, 1], shape[0, 1]])


def _axes(sxx, syy, sxy):
    """Return semi-axes and azimuth of a shape matrix, and their Jacobian by sxx, syy, sxy."""
    middle, half_difference = (sxx + syy) / 2, (sxx - syy) / 2
    half = np.hypot(half_difference, sxy)
    if not middle > half:
        raise SolutionError(
            message(
                "ellipse_degenerate",
                "the points do not lie on an ellipse: half axes {half_axis_m:.3g} m and 0",
                half_axis_m=middle + half,
            )
        )
    sine, cosine = (sxy / half, half_difference / half) if half > 1e-12 * middle else (0.0, 0.0)
    # Eigenvalues middle +- half, half = hypot(lean, sxy); half its angle is the mathematical
    # direction.
    by_half = np.array([cosine / 2, -cosine / 2, sine])
    by_middle = np.array([0.5, 0.5, 0.0])
    by_angle = np.zeros(3)
    if sine or cosine:
        by_angle = np.array([sine / 2, -sine / 2, -cosine]) / (2 * half)
    # Convert the direction (anticlockwise from +x) to an azimuth (clockwise from +y).
    azimuth = (np.pi / 2 - np.arctan2(sine, cosine) / 2) % np.pi if np.any(by_angle) else 0.0
    jacobian = np.array([by_middle + by_half, by_middle - by_half, by_angle])
    return (float(middle + half), float(middle - half), float(azimuth)), jacobian


def _foot_points(d, half):
    """Return signed distances (n,), unit normals and w (n, 2) of the feet f = half w.

    d (n, 2) are points in the frame of the axes, half (2,) the semi-axes. Newton's method solves (a
    u / (t + a^2))^2 + (b v / (t + b^2))^2 = 1, a convex, decreasing function of t, from the left,
    where the convergence is monotone (Eberly 2013).
    """
    sign, u = np.where(d < 0, -1.0, 1.0), np.maximum(np.abs(d), 1e-14 * half)
    square = half**2
    # Start left of the root: a single term of the sum already equals 1 there.
    t = np.max(half * u - square, axis=1)
    for _ in range(100):
        place = half * u / (t[:, None] + square)
        excess = np.sum(place**2, axis=1) - 1
        step = excess / (2 * np.sum(place**2 / (t[:, None] + square), axis=1))
        t = t + step
        if np.all(np.abs(step) <= 1e-15 * (t + square.min())):
            break
    # P - f = t f / a^2 for each axis: the normal is parallel to u / (t + a^2), and t > 0 outside.
    normal_direction = u / (t[:, None] + square)
    length = np.linalg.norm(normal_direction, axis=1)
    place = half * normal_direction
    place = place / np.linalg.norm(place, axis=1)[:, None]
    return t * length, sign * normal_direction / length[:, None], sign * place


DIRECTION_SD_LIMIT = 0.1  # rad: above, the direction of a cylinder counts as undetermined
LEAST_THICKNESS = 2.0  # of the points about their plane, in units of the scatter of the fit
SEARCH_DIRECTIONS, SEARCH_POINTS = 600, 2000  # start directions; points in the search, at most
CANDIDATES, LEAST_ANGLE = 10, np.radians(8)  # refined directions, and least angle between two
FIRST_STEPS = 12  # iterations for each candidate, before the best is chosen


@dataclass(frozen=True)
class FittedCylinder:
    """Least-squares cylinder, of any direction, through n points.

    Attributes
    ----------
    point_m : ndarray, shape (3,)
        Point of the axis closest to the mean of the points, m.
    direction : ndarray, shape (3,)
        Unit vector along the axis, upwards (eastwards if the axis is level).
    tangents : ndarray, shape (2, 3)
        Unit vectors perpendicular to the axis and to each other.
    radius_m : float
        Radius of the surface of the points (inside or outside), m.
    cofactor : ndarray, shape (5, 5)
        Covariance of the point along both tangents (m), of the direction towards both tangents
        (rad) and of the radius (m), for variance factor 1.
    residuals_m : ndarray, shape (n,)
        Distance of each point from the cylinder, outwards positive, m.
    variance_factor : float
        v' Q^-1 v / dof, nan without redundancy.
    dof : int
        Redundancy.
    """

    point_m: np.ndarray
    direction: np.ndarray
    tangents: np.ndarray
    radius_m: float
    cofactor: np.ndarray
    residuals_m: np.ndarray
    variance_factor: float
    dof: int


@dataclass(frozen=True)
class LyingCylinder:
    """Diameter and tilt of a lying tank from points of its cylinder.

    Attributes
    ----------
    diameter_m : float
        Diameter of the surface of the points (inside or outside), m.
    tilt : float
        Tangent of the angle by which the axis rises towards azimuth_rad.
    azimuth_rad : float
        Azimuth of the axis from A to B, clockwise from +y, 0 to 2 pi.
    cofactor : ndarray, shape (2, 2)
        Covariance of diameter (m) and tilt, for variance factor 1.
    cylinder : FittedCylinder
        Fit from which diameter and tilt are derived.
    by_cylinder : ndarray, shape (2, 5)
        Derivative of diameter and tilt by the unknowns of that fit.
    towards_b : float
        1 if the direction of the fit runs from A to B, else -1.
    """

    diameter_m: float
    tilt: float
    azimuth_rad: float
    cofactor: np.ndarray
    cylinder: FittedCylinder
    by_cylinder: np.ndarray
    towards_b: float


def fit_cylinder(xyz_m, covariance_m2):
    """Fit a cylinder of any direction to the perpendicular distances of points.

    The condition for each point is: distance from the axis - R = 0. No start values are required.
    The search evaluates the sum of squared algebraic distances in closed form, for directions all
    over the half sphere (Eberly 2019). It then refines the best directions with unweighted
    distances. Points on a part of the circumference suffice.

    Parameters
    ----------
    xyz_m : array_like, shape (n, 3)
        Points, m.
    covariance_m2 : PointCovariance or ndarray, shape (3n, 3n) or (3n,)
        Covariance, or variances, of the coordinates in the order x1 y1 z1 x2 ..., m2.

    Returns
    -------
    FittedCylinder

    Raises
    ------
    SolutionError
        For fewer than 5 points, points in a plane (thickness below twice their scatter), and points
        that do not determine the direction (standard deviation from their scatter above 0.1 rad).
    """
    mean, local = center_points(xyz_m, 5, "a cylinder")
    spread = spread_of(local, 3, "plane")
    frame, unknowns = _find_start(local)
    refuse_flat(unknowns[4], spread, "a cylinder with a radius")
    # The slopes are linear only near the third axis of the frame: the second pass uses the frame
    # of the fitted cylinder.
    for _ in range(2):
        frame, unknowns = _orient_upwards(frame, unknowns)
        model = conditions_of(cylinder_distances(frame))
        adjusted = adjust(model, unknowns, local.ravel(), covariance_m2)
        frame, unknowns = _align_frame(frame, adjusted.unknowns)
    x, y, *_, radius = unknowns
    residuals = cylinder_distances(frame)(unknowns, local)[0]
    _refuse_undetermined(adjusted, local, residuals)
    return FittedCylinder(
        point_m=mean + (x, y) @ frame[:2],
        direction=frame[2],
        tangents=frame[:2],
        radius_m=float(radius),
        cofactor=adjusted.cofactor,
        residuals_m=residuals,
        variance_factor=adjusted.variance_factor,
        dof=adjusted.dof,
    )


def cylinder_distances(frame):
    """Return the distance function of cylinders near the third row of a frame (3, 3).

    The function has two arguments: unknowns (x, y of the axis in the plane of the first two rows,
    slopes of the axis along them, radius) and points (n, 3). It returns distances (n,), their
    derivatives by the unknowns (n, 5), and normals (n, 3).
    """

    def distances(unknowns, points):
        x, y, *slopes, radius = unknowns
        norm = np.hypot(1.0, np.hypot(*slopes))
        axis = np.array([*slopes, 1.0]) / norm
        d = points @ frame.T - (x, y, 0.0)
        axial = d @ axis
        # Subtract the component along the axis: the rest is perpendicular to it.
        distance, normal = unit_vectors(d - axial[:, None] * axis)
        by_point = -normal[:, :2]
        # A small rotation moves the axis by the height of the foot above the reference plane.
        by_slopes = by_point * (axial / norm)[:, None]
        by_unknowns = np.column_stack([by_point, by_slopes, -np.ones(len(d))])
        return distance - radius, by_unknowns, normal @ frame

    return distances


def lying_cylinder(xyz_m, covariance_m2, azimuth_rad):
    """Return diameter and tilt of a lying tank, with their covariance, from points of its cylinder.

    Parameters
    ----------
    xyz_m, covariance_m2
        As for `fit_cylinder`.
    azimuth_rad : float
        Azimuth of the axis from A to B, clockwise from +y. It distinguishes the ends and may be in
        error by up to 45 deg.

    Returns
    -------
    LyingCylinder

    Raises
    ------
    SolutionError
        If the fit fails, if the axis is steeper than 45 deg, or if it differs from the given
        azimuth by more than 45 deg.

    Examples
    --------
    >>> angle = np.arange(8) * np.pi / 4
    >>> along = np.repeat(np.arange(4.0), 8)
    >>> across, up = np.tile(np.cos(angle), 4), np.tile(np.sin(angle), 4) + 0.01 * along
    >>> points = np.column_stack([along, across, up])
    >>> tank = lying_cylinder(points, np.full(96, 1e-6), np.pi / 2)
    >>> round(tank.diameter_m, 5), round(tank.tilt, 5)
    (1.99995, 0.01)
    """
    cylinder = fit_cylinder(xyz_m, covariance_m2)
    east, north, rise = cylinder.direction
    level = np.hypot(east, north)
    if abs(rise) > level:
        raise SolutionError(
            message(
                "cylinder_stands",
                "the cylinder stands: its axis leans {lean_deg:.1f} deg",
                lean_deg=np.degrees(np.arctan2(level, abs(rise))),
            )
        )
    # The fitted direction has no sense: choose the sign that points from A to B.
    cosine = (east * np.sin(azimuth_rad) + north * np.cos(azimuth_rad)) / level
    sign = 1.0 if cosine > 0 else -1.0
    azimuth = np.arctan2(sign * east, sign * north) % (2 * np.pi)
    if abs(cosine) < np.cos(np.pi / 4):
        raise SolutionError(
            message(
                "axis_elsewhere",
                "the axis runs towards {found_deg:.1f} deg, not {expected_deg:.1f}",
                found_deg=np.degrees(azimuth),
                expected_deg=np.degrees(azimuth_rad),
            )
        )
    # tilt = up / level: derivative of a quotient, for rotations towards each tangent.
    level_change = cylinder.tangents @ np.array([east, north, 0.0]) / level
    by_direction = sign * (cylinder.tangents[:, 2] * level - rise * level_change) / level**2
    transform = np.zeros((2, 5))
    transform[0, 4] = 2.0
    transform[1, 2:4] = by_direction
    return LyingCylinder(
        diameter_m=2 * cylinder.radius_m,
        tilt=float(sign * rise / level),
        azimuth_rad=float(azimuth),
        cofactor=transform @ cylinder.cofactor @ transform.T,
        cylinder=cylinder,
        by_cylinder=transform,
        towards_b=sign,
    )


def _refuse_undetermined(adjusted, local, residuals):
    """Raise SolutionError if the points do not determine the direction.

    Two leaning cylinders pass through a ring of points in a plane. Linear standard deviations alone
    do not show this ambiguity.
    """
    # Smallest singular value over sqrt(n): root mean square distance of the points from their
    # plane.
    thickness = np.linalg.svd(local, compute_uv=False)[2] / np.sqrt(len(local))
    scatter = np.sqrt(np.mean(residuals**2))
    if thickness < LEAST_THICKNESS * scatter:
        raise SolutionError(
            message(
                "points_in_a_plane",
                "the points lie in a plane: {thick_m:.3g} m thick, with a scatter of "
                "{scatter_m:.3g} m",
                thick_m=thickness,
                scatter_m=scatter,
            )
        )
    # Without redundancy, the a priori standard deviations apply.
    factor = adjusted.variance_factor if adjusted.dof else 1.0
    sd = np.sqrt(factor * np.diag(adjusted.cofactor)[2:4].sum())
    if not sd < DIRECTION_SD_LIMIT:
        raise SolutionError(
            message(
                "cylinder_direction_undetermined",
                "the direction of the cylinder is not determined: sd {sd_rad:.3g} rad",
                sd_rad=sd,
            )
        )


def _find_start(local):
    """Return the frame (third row: direction) and the unknowns of the best start cylinder.

    The criterion is the sum of squared, unweighted distances.
    """
    sample = local[np.linspace(0, len(local) - 1, min(len(local), SEARCH_POINTS)).astype(int)]
    sample = sample - sample.mean(axis=0)
    frames = _build_frames(
        np.vstack(
            [np.linalg.svd(sample, full_matrices=False)[2], _sample_half_sphere(SEARCH_DIRECTIONS)]
        )
    )
    errors, centres, radii = _fit_algebraic(sample, frames)
    errors[:3] = -1.0  # the principal directions of the points are always tried
    best, tried_indices = None, []
    for i in np.argsort(errors, kind="stable"):
        if any(abs(frames[i][2] @ frames[j][2]) > np.cos(LEAST_ANGLE) for j in tried_indices):
            continue
        # Skip directions close to a direction already tried: they lead to the same minimum.
        tried_indices.append(i)
        distances = cylinder_distances(frames[i])
        unknowns = descend_distances(
            distances, [*centres[i], 0.0, 0.0, radii[i]], sample, FIRST_STEPS
        )
        cost = np.sum(distances(unknowns, sample)[0] ** 2)
        if np.isfinite(cost) and unknowns[4] > 0 and (best is None or cost < best[0]):
            best = cost, *_align_frame(frames[i], unknowns)
        if len(tried_indices) == CANDIDATES:
            break
    if best is None:
        raise SolutionError(
            message(
                "cylinder_not_found",
                "no cylinder was found from {count} starting directions",
                count=len(tried_indices),
            )
        )
    _, frame, unknowns = best
    return _align_frame(frame, descend_distances(cylinder_distances(frame), unknowns, sample))


def _fit_algebraic(local, frames):
    """Return mean squared error, centre and radius of the algebraic circle along each frame.

    The circle |y|^2 = 2 c y + k of the projected points y follows from their moments.
    """
    n = len(local)
    # Moments of order 2 to 4 once for all frames: the cost does not depend on points times frames.
    second = np.einsum("ni,nj->ij", local, local) / n
    third = np.einsum("ni,nj,nk->ijk", local, local, local, optimize=True) / n
    squares = np.einsum("ni,nj->nij", local, local).reshape(n, 9)
    fourth = (squares.T @ squares / n).reshape(3, 3, 3, 3)
    plane = frames[:, :2]
    # Projector on the plane perpendicular to each direction.
    projector = np.einsum("fai,faj->fij", plane, plane)
    matrix = plane @ second @ plane.transpose(0, 2, 1)
    right_side = np.einsum("fai,ijk,fjk->fa", plane, third, projector, optimize=True)
    mean = np.einsum("fij,ij->f", projector, second)
    scatter = np.einsum("fij,ijkl,fkl->f", projector, fourth, projector, optimize=True) - mean**2
    # Normal equations of the centre; scatter is the variance of |y|^2, error what the circle
    # leaves.
    centre = np.linalg.solve(matrix, right_side[:, :, None])[:, :, 0]
    squared = mean + np.sum(centre**2, axis=1) / 4
    error = scatter - np.sum(centre * right_side, axis=1)
    # An algebraic error is 2 R times the distance: divide the squares by 4 R^2.
    return error / (4 * squared), centre / 2, np.sqrt(squared)


def _sample_half_sphere(count):
    """Return (count, 3) evenly spread directions of a half sphere (Fibonacci lattice)."""
    i = np.arange(count) + 0.5
    z, angle = i / count, i * np.pi * (1 + 5**0.5)
    horizontal = np.sqrt(1 - z**2)
    return np.column_stack([horizontal * np.cos(angle), horizontal * np.sin(angle), z])


def _build_frames(directions):
    """Return (n, 3, 3) right-handed frames with the given third rows."""
    smallest_axis = np.argmin(np.abs(directions), axis=1)
    # The coordinate axis farthest from the direction gives a well-conditioned cross product.
    first = np.cross(np.eye(3)[smallest_axis], directions)
    first = first / np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(directions, first), directions], axis=1)


def _align_frame(frame, unknowns):
    """Return the frame rotated to the fitted axis (third row), and the unknowns in that frame."""
    x, y, *slopes, radius = unknowns
    axis = np.array([*slopes, 1.0]) @ frame
    axis = axis / np.linalg.norm(axis)
    first = frame[0] - (frame[0] @ axis) * axis
    first = first / np.linalg.norm(first)
    aligned = np.array([first, np.cross(axis, first), axis])
    # In the new frame the slopes are zero; the point of the axis is projected on the new plane.
    point = np.array([x, y]) @ frame[:2]
    return aligned, np.array([*(aligned[:2] @ point), 0.0, 0.0, radius])


def _orient_upwards(frame, unknowns):
    """Return frame and unknowns with the axis upwards, or eastwards, or northwards if level."""
    if tuple(frame[2][[2, 0, 1]]) > (0.0, 0.0, 0.0):
        return frame, unknowns
    return frame * [[1.0], [-1.0], [-1.0]], unknowns * [1.0, -1.0, 0.0, 0.0, 1.0]
