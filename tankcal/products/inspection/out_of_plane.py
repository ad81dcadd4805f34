"""Out-of-plane settlement: residuals of the tilted plane, S at each point, and the curvature.

The least-squares plane is a + p cos t + q sin t, with the azimuth t. Its residuals U = P z are
linear in the elevations z, and so are S and the curvature. The law of propagation therefore gives
their covariance from the covariance of z.

    S_i = U_i - (d_n U_prev + d_p U_next) / (d_p + d_n)

with the arcs d_p and d_n to the previous and the next point. For equal arcs, the second term is the
mean of the two neighbours. A curve of curvature c has |S| = c d_p d_n / 2. The limits of S for any
spacing therefore correspond to one limit of the curvature. Source: Marr, Ramos & Lambe 1982,
Criteria for settlement of tanks, J. Geotech. Eng. 108.

`estimate_statistic` estimates the largest |S| of many points and R2 without the bias of levelling
errors. Errors raise the largest |S| of n points above the largest true |S|, and lower the share of
the variance that the plane explains. The bias follows from the levelling itself, without a prior
for the settlement:

1. Add simulated errors of once and twice the stated variance to the readings. With T0 the statistic
   of the readings, T1 and T2 its means over the simulations, T is known at one, two and three times
   the variance of the levelling.
2. Extrapolate the parabola through the three to the variance 0: 3 T0 - 3 T1 + T2.

The extrapolation is exact for statistics that are quadratic in the elevations, such as a sum of
squares. A point that dominates all others keeps its reading. (The method is known as simulation
extrapolation, SIMEX.)

The uncertainty follows from simulated levellings. Errors are added to the readings, the statistic
is estimated from each sum, and u is the root mean square error of these estimates.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from tankcal.geometry.outlines import harmonics

LEVEL_M = 1e-9  # range of elevations that is due to rounding; such points are level
NEARLY = 1.25  # number of points over the size of the subset, up to which all points are used
_COARSE_STEPS = 12  # grid steps per shortest wave, for simulated curvatures
_STEPS = 32  # grid steps per shortest wave, for the search for the largest curvature
VALUE_DRAWS = 4000  # draws for the estimate; its simulation error is about 0.03 of the sd of S
U_DRAWS = 300  # simulated levellings for u, at least 4 for each point
INNER_DRAWS = 100  # draws for the estimate from each simulated levelling
CHUNK = 4_000_000  # number of values computed together, to limit the memory
SEED = 653  # of the random numbers; a fixed seed makes the results reproducible


@dataclass(frozen=True)
class Plane:
    """The tilted plane through n elevations, by least squares.

    Attributes
    ----------
    operator : ndarray, shape (3, n)
        (a, p, q) = operator @ z.
    residual_operator : ndarray, shape (n, n)
        U = residual_operator @ z.
    a_m, p_m, q_m : float
        Mean elevation, and rise of the plane towards azimuths 0 and 90 degrees at the shell, m.
    fitted_m, residual_m : ndarray, shape (n,)
        Elevations of the plane at the points, and residuals U, m.
    """

    operator: np.ndarray
    residual_operator: np.ndarray
    a_m: float
    p_m: float
    q_m: float
    fitted_m: np.ndarray
    residual_m: np.ndarray

    @property
    def b_m(self):
        """Height of the highest point of the plane above its mean, hypot(p, q), m."""
        return float(np.hypot(self.p_m, self.q_m))

    @property
    def highest_rad(self):
        """Azimuth of the highest point of the plane, atan2(q, p), from 0 to 2 pi."""
        return float(np.arctan2(self.q_m, self.p_m) % (2 * np.pi))

    def b_gradient(self):
        """Derivatives (n,) of b with respect to the elevations."""
        # A level plane has no direction; any direction gives a valid u.
        direction = (self.p_m, self.q_m) if self.b_m > 0 else (1.0, 0.0)
        return np.array(direction) / np.hypot(*direction) @ self.operator[1:]


def fit_plane(azimuth_rad, z_m):
    """Fit a + p cos t + q sin t to elevations round a tank.

    Parameters
    ----------
    azimuth_rad, z_m : array_like, shape (n,)
        Azimuths, clockwise from +y, and elevations, m, at three or more different azimuths.

    Returns
    -------
    Plane

    Examples
    --------
    >>> t = np.radians([0.0, 90.0, 180.0, 270.0])
    >>> plane = fit_plane(t, [1.003, 1.004, 0.997, 0.996])
    >>> round(plane.b_m, 6), round(float(np.degrees(plane.highest_rad)), 2)
    (0.005, 53.13)
    """
    z = np.asarray(z_m, dtype=float)
    columns = harmonics(azimuth_rad, 1)
    operator = _least_squares(columns)
    unknowns = operator @ z
    return Plane(
        operator=operator,
        residual_operator=np.eye(len(z)) - columns @ operator,
        a_m=float(unknowns[0]),
        p_m=float(unknowns[1]),
        q_m=float(unknowns[2]),
        fitted_m=columns @ unknowns,
        residual_m=z - columns @ unknowns,
    )


def _least_squares(columns):
    """Least-squares operator (u, n), from n observations to u unknowns.

    Sines and cosines at different azimuths have full rank if there are no more than points.
    """
    basis, root = np.linalg.qr(columns)
    return np.linalg.solve(root, basis.T)


def r_squared(z_m, residual_m):
    """Share of the variance that the plane explains, R2 = 1 - sum U^2 / sum (z - mean z)^2.

    Parameters
    ----------
    z_m, residual_m : ndarray, shape (n,)
        Elevations and their residuals U, m.

    Returns
    -------
    float
        R2; 1 for level points.
    ndarray, shape (n,)
        Derivatives of R2 with respect to the elevations, 1/m; 0 for level points.

    Examples
    --------
    >>> z = np.array([0.0, 1.0, 2.0])
    >>> r_squared(z, np.array([0.0, 0.5, -0.5]))[0]
    0.75
    """
    about_mean = z_m - np.mean(z_m)
    scatter, residual_squares = about_mean @ about_mean, residual_m @ residual_m
    if np.ptp(z_m) < LEVEL_M:
        return 1.0, np.zeros(len(z_m))
    # Quotient rule; P is a projection, so that d(sum U^2)/dz = 2 U.
    gradient = -2 * residual_m / scatter + 2 * residual_squares * about_mean / scatter**2
    return float(1 - residual_squares / scatter), gradient


@dataclass(frozen=True)
class Neighbours:
    """Selected points and the arcs to their neighbours along the shell.

    Attributes
    ----------
    places : ndarray of int, shape (m,)
        Indices of the selected points among all n points, by azimuth.
    operator : ndarray, shape (m, n)
        Linear map with S = operator @ U.
    before_m, after_m : ndarray, shape (m,)
        Arcs to the previous and to the next point, m.
    """

    places: np.ndarray
    operator: np.ndarray
    before_m: np.ndarray
    after_m: np.ndarray

    @property
    def arc_m(self):
        """Mean (m,) of the arcs to both neighbours, m."""
        return (self.before_m + self.after_m) / 2

    def limits_m(self, curvature_per_m):
        """Limits (m,) of |S| for a largest curvature c in 1/m, c d_p d_n / 2, m."""
        return curvature_per_m * self.before_m * self.after_m / 2


def find_neighbours(azimuth_rad, radius_m, places=None):
    """Compute the linear map from U to S for all points, or for selected points.

    Parameters
    ----------
    azimuth_rad : ndarray, shape (n,)
        Azimuths, ascending within one turn.
    radius_m : float
        Radius of the shell, m.
    places : array_like of int, optional
        Ascending indices of the selected points; by default all points.

    Returns
    -------
    Neighbours

    Examples
    --------
    >>> neighbours = find_neighbours(np.radians([0.0, 90.0, 180.0, 270.0]), 2 / np.pi)
    >>> neighbours.operator[1].tolist(), neighbours.arc_m.round(9).tolist()
    ([-0.5, 1.0, -0.5, 0.0], [1.0, 1.0, 1.0, 1.0])
    """
    places = np.arange(len(azimuth_rad)) if places is None else np.asarray(places)
    after = radius_m * arcs_to_next(np.asarray(azimuth_rad)[places])
    before = np.roll(after, 1)
    rows, arc_sum = np.arange(len(places)), before + after
    operator = np.zeros((len(places), len(azimuth_rad)))
    operator[rows, places] = 1.0
    operator[rows, np.roll(places, 1)] -= after / arc_sum
    operator[rows, np.roll(places, -1)] -= before / arc_sum
    return Neighbours(places, operator, before, after)


def arcs_to_next(azimuth_rad):
    """Angles (n,) from each of n ascending azimuths to the next azimuth, rad.

    Examples
    --------
    >>> np.degrees(arcs_to_next(np.radians([10.0, 100.0, 350.0]))).round(6).tolist()
    [90.0, 250.0, 20.0]
    """
    return np.diff(azimuth_rad, append=azimuth_rad[0] + 2 * np.pi)


def select_subset(azimuth_rad, residual_m, radius_m, *, arc_m, least):
    """Select points about `arc_m` apart that include the largest residuals of both signs.

    The selection starts at the point farthest from the plane and takes the nearest point to each
    equal step. Of two equally near points, the point with the larger residual is taken. The point
    with the largest residual of the opposite sign then replaces the selected point nearest to it.

    Parameters
    ----------
    azimuth_rad, residual_m : ndarray, shape (n,)
        Ascending azimuths and residuals U, m.
    radius_m, arc_m : float
        Radius of the shell, and required distance of neighbours along the shell, m.
    least : int
        Least number of points; the number of selected points is even.

    Returns
    -------
    ndarray of int
        Ascending indices of the selected points. All points are selected if they are fewer than
        1.25 times the required number.

    Examples
    --------
    >>> t = np.radians(np.arange(0.0, 360.0, 22.5))
    >>> select_subset(t, np.cos(2 * t - 0.1), 10.0, arc_m=9.0, least=8).tolist()
    [0, 2, 4, 6, 8, 10, 12, 14]
    """
    count, size = len(azimuth_rad), np.abs(residual_m)
    required = max(least, int(np.ceil(2 * np.pi * radius_m / arc_m - 1e-9)))
    required += required % 2
    if count <= NEARLY * required:
        return np.arange(count)
    farthest = int(np.argmax(size))
    chosen = [farthest]
    for step in range(1, required):
        azimuth = azimuth_rad[farthest] + 2 * np.pi * step / required
        distance = np.abs((azimuth_rad - azimuth + np.pi) % (2 * np.pi) - np.pi)
        distance[chosen] = np.inf
        nearest = np.flatnonzero(distance <= distance.min() + 1e-6)
        chosen.append(int(nearest[np.argmax(size[nearest])]))
    other = int(np.argmax(-np.sign(residual_m[farthest]) * residual_m))
    if other not in chosen:
        distance = (azimuth_rad[chosen] - azimuth_rad[other] + np.pi) % (2 * np.pi) - np.pi
        distance[0] = np.inf  # the farthest point remains selected
        chosen[int(np.argmin(np.abs(distance)))] = other
    return np.sort(chosen)


@dataclass(frozen=True)
class Curvature:
    """Largest curvature of the harmonics of U along the shell.

    Attributes
    ----------
    highest : int
        Highest harmonic; the lowest is 2.
    per_m : float
        Largest |d2U/ds2|, 1/m.
    azimuth_rad : float
        Azimuth of the largest curvature.
    gradient : ndarray, shape (n,)
        Derivatives of the curvature with respect to the elevations, 1/m2.
    """

    highest: int
    per_m: float
    azimuth_rad: float
    gradient: np.ndarray


def find_largest_curvature(azimuth_rad, z_m, radius_m, highest):
    """Find the largest |d2U/ds2| of harmonics 2 to `highest`, fitted together with the plane.

    (1/R)^2 max |sum k^2 (a_k cos k t + b_k sin k t)|, k from 2

    Parameters
    ----------
    azimuth_rad, z_m : ndarray, shape (n,)
        Azimuths and elevations, m, of more than 2 `highest` points. The residuals U in place of the
        elevations give the same result.
    radius_m : float
        Radius of the shell, m.
    highest : int
        Highest harmonic.

    Returns
    -------
    Curvature

    Examples
    --------
    >>> t = np.radians(np.arange(0.0, 360.0, 30.0))
    >>> curvature = find_largest_curvature(t, 0.001 * np.cos(2 * t), 2.0, 3)
    >>> round(curvature.per_m, 9)
    0.001
    """
    operator = _least_squares(harmonics(azimuth_rad, highest))
    unknowns = operator @ z_m
    weights = _curvature_weights(radius_m, highest)

    def size(t):
        """Magnitude of the curvature at azimuths t."""
        return np.abs(harmonics(np.atleast_1d(t), highest) @ (weights * unknowns))

    # The largest value on a grid starts a local search, which cannot end in another maximum.
    step = 2 * np.pi / (_STEPS * highest)
    grid = np.arange(_STEPS * highest) * step
    start = grid[np.argmax(size(grid))]
    search = scipy.optimize.minimize_scalar(
        lambda t: -size(t)[0],
        bounds=(start - step, start + step),
        method="bounded",
        options={"xatol": 1e-9},
    )
    at = search.x if -search.fun > size(start)[0] else start
    rows = harmonics([at], highest)[0] * weights
    sign = -1.0 if rows @ unknowns < 0 else 1.0
    return Curvature(highest, float(size(at)[0]), float(at % (2 * np.pi)), sign * rows @ operator)


def curvature_rows(azimuth_rad, radius_m, highest, start_rad):
    """Linear map from the elevations to the curvature on an equally spaced grid of azimuths.

    Parameters
    ----------
    azimuth_rad : ndarray, shape (n,)
        Azimuths of the points.
    radius_m : float
        Radius of the shell, m.
    highest : int
        Highest harmonic, as in `find_largest_curvature`.
    start_rad : float
        A point of the grid, such as the azimuth of the largest curvature.

    Returns
    -------
    ndarray, shape (m, n)
        The curvature, 1/m, is rows @ z. The grid underestimates another maximum by at most 3.4 %.
    """
    count = _COARSE_STEPS * highest
    grid = start_rad + np.arange(count) * 2 * np.pi / count
    columns = harmonics(grid, highest) * _curvature_weights(radius_m, highest)
    return columns @ _least_squares(harmonics(azimuth_rad, highest))


def _curvature_weights(radius_m, highest):
    """Weights (2 highest + 1,): k^2 / R^2 of each harmonic k, and 0 of the plane."""
    squares = np.repeat(np.arange(1, highest + 1), 2) ** 2.0
    return np.concatenate([[0.0, 0.0, 0.0], squares[2:]]) / radius_m**2


@dataclass(frozen=True)
class Errors:
    """Simulated errors of a levelling, m, each draw with its mirror image.

    Attributes
    ----------
    value : ndarray, shape (VALUE_DRAWS, n)
        Errors for the estimate itself.
    inner : ndarray, shape (INNER_DRAWS, n)
        Errors for the estimate from each simulated levelling.
    outer : ndarray, shape (m, n)
        Errors of the simulated levellings; their covariance is exactly the covariance of the
        levelling.
    """

    value: np.ndarray
    inner: np.ndarray
    outer: np.ndarray


@dataclass(frozen=True)
class Statistic:
    """A statistic of elevations z: reduce(z @ operator.T).

    Attributes
    ----------
    operator : ndarray, shape (m, n)
        Linear map of the elevations.
    reduce : callable
        Function of an array (..., m) that returns an array (...).
    least, most : float
        Bounds of the true value.
    """

    operator: np.ndarray
    reduce: callable
    least: float = 0.0
    most: float = np.inf


@dataclass(frozen=True)
class Estimate:
    """A statistic of the true settlement, corrected for the bias of the readings.

    Attributes
    ----------
    value, u : float
        Estimate and its standard uncertainty.
    """

    value: float
    u: float

    def times(self, factor):
        """Estimate and standard uncertainty times a factor, such as 1000 for millimetres."""
        return Estimate(factor * self.value, factor * self.u)


def simulate_errors(azimuth_rad, z_m, u_m):
    """Simulate errors of a levelling with given standard uncertainties.

    Parameters
    ----------
    azimuth_rad, z_m, u_m : ndarray, shape (n,)
        Azimuths, rad, elevations and their standard uncertainties, m.

    Returns
    -------
    Errors
    """
    rng = np.random.default_rng(SEED)
    residual = fit_plane(azimuth_rad, z_m).residual_m
    # The draws start at the point farthest from the plane, so that a rotation of the azimuths does
    # not change the result.
    n = len(residual)
    places = (np.arange(n) - int(np.argmax(np.abs(residual)))) % n
    counts = (VALUE_DRAWS, INNER_DRAWS, max(U_DRAWS, 4 * n))
    halves = [rng.normal(size=(count // 2, n)) for count in counts]
    # The sample covariance is made exact, so that a dominating point gets its exact u.
    values, vectors = np.linalg.eigh(halves[2].T @ halves[2] / len(halves[2]))
    halves[2] = halves[2] @ (vectors / np.sqrt(values)) @ vectors.T
    return Errors(*(np.concatenate([half, -half])[:, places] * u_m for half in halves))


def estimate_statistic(statistic, z_m, reading, errors):
    """Estimate a statistic of the true elevations by extrapolation, with its uncertainty.

    Parameters
    ----------
    statistic : Statistic
    z_m : ndarray, shape (n,)
        Levelled elevations, m.
    reading : float
        The statistic of the elevations z_m.
    errors : Errors
        Simulated errors of `simulate_errors`.

    Returns
    -------
    Estimate
    """
    z = statistic.operator @ z_m
    value_errors, inner, outer = (
        draws @ statistic.operator.T for draws in (errors.value, errors.inner, errors.outer)
    )

    def corrected(z, errors):
        """Extrapolated statistic of each row of z, within the bounds of the true value."""
        once, twice = (
            np.mean(statistic.reduce(z[:, None] + np.sqrt(times) * errors), axis=1)
            for times in (1, 2)
        )
        estimates = 3 * statistic.reduce(z) - 3 * once + twice
        return np.clip(estimates, statistic.least, statistic.most)

    plain = float(statistic.reduce(z))
    # A maximum on a grid may be below the exact maximum, so only its bias is used.
    bias = plain - float(corrected(z[None], value_errors)[0])
    rows = max(1, CHUNK // inner.size)
    levelled = z + outer
    estimates = [corrected(levelled[i : i + rows], inner) for i in range(0, len(outer), rows)]
    u = float(np.sqrt(np.mean((np.concatenate(estimates) - plain) ** 2)))
    return Estimate(float(np.clip(reading - bias, statistic.least, statistic.most)), u)
