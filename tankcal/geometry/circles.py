"""Least-squares circle through the points of a section (program CIRCUM)."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from tankcal.adjust import Adjustment, adjust, whitener
from tankcal.covariance import PointCovariance
from tankcal.errors import SolutionError
from tankcal.messages import message

# Fit to distances: largest number of minimisations, each with new weights; change of the centre
# below which the iteration has converged; relative tolerance of a minimisation (rounding).
MOST_ROUNDS, SETTLED_M, TOLERANCE = 10, 1e-8, 1e-14


@dataclass(frozen=True)
class Circle:
    """Least-squares circle through n points of a section.

    Attributes
    ----------
    x_m, y_m, radius_m : float
        Centre and radius, m.
    cofactor_m2 : ndarray, shape (3, 3)
        Covariance of x, y and radius for variance factor 1, m2.
    residuals_m : ndarray, shape (n,)
        Distance of each point from the circle, outwards positive, m.
    variance_factor : float
        v' Q^-1 v / (n - 3).
    dof : int
        Degrees of freedom, n - 3.
    """

    x_m: float
    y_m: float
    radius_m: float
    cofactor_m2: np.ndarray
    residuals_m: np.ndarray
    variance_factor: float
    dof: int


def fit_circle(xy_m, covariance_m2):
    """Fit a circle that minimises the weighted sum of squared point corrections.

    The condition for each point, linearised at the adjusted points, is hypot(x - xc, y - yc) - R =
    0. For n evenly spaced points of standard deviation s: s_centre = s sqrt(2/n), s_radius = s /
    sqrt(n). Source: Silva 1995, program CIRCUM.

    The adjusted points may move by decimetres if the departures from a circle are far above the
    noise and the covariance shifts or rotates whole groups of points. The iteration then alternates
    between two circles. In that case the circle is fitted to the distances of the measured points
    from the centre, weighted by their covariance. To first order in the residuals, both circles are
    equal.

    Parameters
    ----------
    xy_m : array_like, shape (n, 2)
        Points, m.
    covariance_m2 : PointCovariance or ndarray, shape (2n, 2n), (2n,) or (n, 2, 2)
        Covariance, or variances, of the coordinates in the order x1 y1 x2 y2 ..., m2; or one
        covariance matrix for each point if the points are independent.

    Returns
    -------
    Circle

    Raises
    ------
    SolutionError
        For fewer than 3 points, or points on a line.

    Examples
    --------
    >>> circle = fit_circle([[1, 0], [0, 1], [-1, 0], [0, -1]], np.eye(8) * 1e-6)
    >>> circle.radius_m, circle.cofactor_m2.diagonal()
    (1.0, array([5.0e-07, 5.0e-07, 2.5e-07]))
    """
    xy_m = np.asarray(xy_m, dtype=float)
    n = len(xy_m)
    if n < 3:
        raise SolutionError(
            message(
                "circle_short_of_points", "a circle needs 3 points, {count} were given", count=n
            )
        )
    # Coordinates about the mean avoid cancellation with large map coordinates.
    centre = xy_m.mean(axis=0)
    local = xy_m - centre
    start = taubin_circle(local)
    try:
        adjusted = adjust(circle_conditions, start, local.ravel(), covariance_m2)
    except SolutionError:
        # `adjust` does not converge: fall back on distances (see above).
        adjusted = _fit_distances(local, covariance_m2, start)
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


def _fit_distances(local, covariance_m2, start):
    """Return an `Adjustment` of x, y and radius to the distances of the points from the centre.

    The covariance of the distances depends on the centre and is computed anew after each
    minimisation.
    """
    unknowns = start
    for _ in range(MOST_ROUNDS):
        previous = unknowns
        whiten = whitener(radial_covariance(local, unknowns[:2], covariance_m2))
        # A damped step reduces the sum of squares even where the full step of `adjust` does not.
        unknowns = _fit_damped(local, whiten, previous)
        if np.allclose(unknowns, previous, rtol=0, atol=SETTLED_M):
            break
    # Linearise once more at the solution: L^-1 v and L^-1 A give chi2 and the cofactor (A' Q^-1
    # A)^-1.
    misclosure, by_circle, _ = circle_conditions(unknowns, local.ravel())
    whitened, design = whiten(misclosure), whiten(by_circle)
    return Adjustment(
        unknowns=unknowns,
        cofactor=np.linalg.inv(design.T @ design),
        normalised=whitened,
        chi2=float(whitened @ whitened),
        rows=len(local),
        estimated=3,
        iterations=MOST_ROUNDS,
    )


def _fit_damped(local, whiten, start):
    """Minimise the whitened misclosures of `circle_conditions` (Levenberg-Marquardt)."""
    import scipy.optimize  # slow to import and needed only where the ordinary iteration fails

    def whitened(unknowns, index):
        return whiten(circle_conditions(unknowns, local.ravel())[index])

    solution = scipy.optimize.least_squares(
        whitened,
        start,
        lambda unknowns, index: whitened(unknowns, index + 1),
        method="lm",
        xtol=TOLERANCE,
        ftol=TOLERANCE,
        gtol=TOLERANCE,
        args=(0,),
    )
    return solution.x


def circle_by_points(circle, xy_m, covariance_m2):
    """Return the derivative of x, y and radius of a fitted circle with respect to its points.

    Parameters
    ----------
    circle : Circle
        Result of `fit_circle`.
    xy_m, covariance_m2
        Points and covariance of that fit.

    Returns
    -------
    ndarray, shape (3, 2n)
        Columns in the order x1 y1 x2 y2 ...

    Examples
    --------
    Points on the axes: the radius is the mean of their distances.

    >>> xy = np.array([[1.0, 0], [0, 1], [-1, 0], [0, -1]])
    >>> by = circle_by_points(fit_circle(xy, np.eye(8)), xy, np.eye(8))
    >>> by[2].round(9).reshape(4, 2).tolist()
    [[0.25, 0.0], [0.0, 0.25], [-0.25, 0.0], [0.0, -0.25]]
    """
    unknowns = np.array([circle.x_m, circle.y_m, circle.radius_m])
    _, by_circle, unit = circle_conditions(unknowns, np.asarray(xy_m, dtype=float).ravel())
    whiten = whitener(radial_covariance(xy_m, unknowns[:2], covariance_m2))
    weighted = whiten(whiten(by_circle), transposed=True).T
    # Normal equations with the weights of the distances: dx = -(A' Q^-1 A)^-1 A' Q^-1 d(distance).
    by_radii = -np.linalg.solve(weighted @ by_circle, weighted)
    # Chain rule: a distance changes by the component of the shift of its point along the unit
    # vector.
    return (by_radii[:, :, None] * unit).reshape(3, -1)


def circle_conditions(unknowns, coordinates):
    """Return misclosures and Jacobians of hypot(x - xc, y - yc) - R = 0, a model for `adjust`.

    Parameters
    ----------
    unknowns : ndarray, shape (3,)
        xc, yc, R, m.
    coordinates : ndarray, shape (2n,)
        x1 y1 x2 y2 ..., m.

    Returns
    -------
    misclosures : ndarray, shape (n,)
        Distance of each point from the circle, m.
    by_unknowns : ndarray, shape (n, 3)
    by_coordinates : ndarray, shape (n, 2)
        By x and y of the point of each condition.
    """
    x, y, radius = unknowns
    d = coordinates.reshape(-1, 2) - (x, y)
    distance = np.hypot(d[:, 0], d[:, 1])
    unit = d / distance[:, None]
    return distance - radius, np.column_stack([-unit, -np.ones(len(unit))]), unit


def own_columns(rows):
    """Return a sparse array (n, n d) with row i of `rows` (n, d) in the d columns of point i."""
    n, d = rows.shape
    # CSR format: row i has d entries, in consecutive columns.
    entries = rows.ravel(), np.arange(n * d), np.arange(0, n * d + 1, d)
    return scipy.sparse.csr_array(entries, shape=(n, n * d))


def taubin_circle(local):
    """Return the centre and radius of Taubin's algebraic circle (1991).

    The circle is the start value of the geometric fit.

    Parameters
    ----------
    local : ndarray, shape (n, 2)
        Points relative to an origin near the centre, m.

    Returns
    -------
    ndarray, shape (3,)
        x, y, radius, m.

    Raises
    ------
    SolutionError
        For points on a line, or all in one place.

    Examples
    --------
    >>> taubin_circle(np.array([[1, 0], [0, 1], [-1, 0]])).round(9) + 0.0
    array([0., 0., 1.])
    """
    # Algebraic circle a z + b x + c y + d = 0 with z = x^2 + y^2.
    z = np.sum(local**2, axis=1)
    mean = z.mean()
    if not mean > 0:
        raise SolutionError(
            message("section_in_one_place", "all points of the section lie in one place")
        )
    # Scaling of z by 2 sqrt(mean z) turns Taubin's constraint into a unit vector: the solution is
    # the last singular vector.
    design = np.column_stack([(z - mean) / (2 * np.sqrt(mean)), local])
    values, vectors = np.linalg.svd(design, full_matrices=False)[1:]
    # A vanishing second singular value, or no quadratic term: the points lie on a line.
    if values[1] < 1e-9 * values[0] or abs(vectors[-1, 0]) < 1e-12:
        raise SolutionError(message("section_on_a_line", "the points of the section lie on a line"))
    # Undo the scaling, then complete the square: centre -b / (2 a), R^2 = centre^2 + mean z.
    a = vectors[-1]
    scaled = a[0] / (2 * np.sqrt(mean))
    x, y = -a[1:] / (2 * scaled)
    return np.array([x, y, np.sqrt(x**2 + y**2 + mean)])


def radial_covariance(xy_m, centre_m, covariance_m2):
    """Return the covariance of the distances of points from a centre.

    Parameters
    ----------
    xy_m : array_like, shape (n, 2)
        Points, m.
    centre_m : array_like, shape (2,)
        Centre, m.
    covariance_m2
        As in `fit_circle`.

    Returns
    -------
    PointCovariance
        Of n points with a single coordinate, m2.

    Examples
    --------
    >>> radial_covariance([[1, 0], [0, 2]], (0, 0), np.diag([1.0, 2.0, 3.0, 4.0])).dense()
    array([[1., 0.],
           [0., 4.]])
    """
    d = np.asarray(xy_m) - centre_m
    # The derivative of a distance by its point is the unit vector from the centre.
    unit = d / np.hypot(d[:, 0], d[:, 1])[:, None]
    return PointCovariance.convert(covariance_m2, 2).mapped(unit[:, None])
