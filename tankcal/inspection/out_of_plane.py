"""Settlement out of the tilted plane: its size at points, between neighbours, and its curvature.

With t the azimuth, a + p cos t + q sin t is the plane by least squares, U = P z what is left of the
elevations z, and all that is judged is linear in z, so that its covariance is that of z carried on.

    S_i = U_i - (d_n U_prev + d_p U_next) / (d_p + d_n)

with the arcs d_p and d_n to both neighbours: the mean of the two where they are even. A curve of
curvature c has |S| = c d_p d_n / 2, which makes one limit of curvature out of the limits for any
spacing. Source: Marr, Ramos & Lambe 1982, Criteria for settlement of tanks, J. Geotech. Eng. 108.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from tankcal.geometry.form import harmonics

LEVEL_M = 1e-9  # points that differ by less are level: what is left is rounding
NEARLY = 1.25  # times as many points as a subset needs: none is left out
_COARSE_STEPS = 12  # of simulated curvatures, along the shortest wave
_STEPS = 32  # of the search for the largest curvature, along the shortest wave


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
        Mean, and height towards azimuth 0 and 90 degrees, m.
    fitted_m, residual_m : ndarray, shape (n,)
        Plane at the points, and U, m.
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
        """Azimuth of that point, atan2(q, p), from 0 to 2 pi."""
        return float(np.arctan2(self.q_m, self.p_m) % (2 * np.pi))

    def b_gradient(self):
        """(n,) change of b with each elevation."""
        direction = (self.p_m, self.q_m) if self.b_m > 0 else (1.0, 0.0)
        return np.array(direction) / np.hypot(*direction) @ self.operator[1:]


def fit_plane(azimuth_rad, z_m):
    """Fit a + p cos t + q sin t to elevations round a tank.

    Parameters
    ----------
    azimuth_rad, z_m : array_like, shape (n,)
        Azimuths, clockwise from +y; elevations, m. Three different azimuths at least.

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
    """(u, n) unknowns by least squares of n observations.

    Sines and cosines of different azimuths, no more than points, are never of lower rank.
    """
    basis, root = np.linalg.qr(columns)
    return np.linalg.solve(root, basis.T)


def explained_share(z_m, residual_m):
    """R2 = 1 - sum U^2 / sum (z - mean z)^2, and its change with each elevation.

    Parameters
    ----------
    z_m, residual_m : ndarray, shape (n,)
        Elevations, and what the plane leaves of them, m.

    Returns
    -------
    float, ndarray of shape (n,)
        Of level points 1 and 0.

    Examples
    --------
    >>> z = np.array([0.0, 1.0, 2.0])
    >>> explained_share(z, np.array([0.0, 0.5, -0.5]))[0]
    0.75
    """
    about_mean = z_m - np.mean(z_m)
    scatter, left = about_mean @ about_mean, residual_m @ residual_m
    if np.ptp(z_m) < LEVEL_M:
        return 1.0, np.zeros(len(z_m))
    gradient = -2 * residual_m / scatter + 2 * left * about_mean / scatter**2
    return float(1 - left / scatter), gradient


@dataclass(frozen=True)
class Neighbours:
    """Points between their neighbours along the shell.

    Attributes
    ----------
    places : ndarray of int, shape (m,)
        Which of the n points, by azimuth.
    operator : ndarray, shape (m, n)
        S = operator @ U.
    before_m, after_m : ndarray, shape (m,)
        Arcs to the neighbours, m.
    """

    places: np.ndarray
    operator: np.ndarray
    before_m: np.ndarray
    after_m: np.ndarray

    @property
    def arc_m(self):
        """(m,) mean of the arcs to both neighbours."""
        return (self.before_m + self.after_m) / 2

    def limits_m(self, curvature_per_m):
        """(m,) largest |S| of a curvature: c L^2 / 2, with d_p d_n in the place of L^2."""
        return curvature_per_m * self.before_m * self.after_m / 2


def between_neighbours(azimuth_rad, radius_m, places=None):
    """How S comes of U for points in the order of their azimuths, or for some of them.

    Parameters
    ----------
    azimuth_rad : ndarray, shape (n,)
        Rising, within one turn.
    radius_m : float
    places : array_like of int, optional
        The points that are used, rising; None: all.

    Returns
    -------
    Neighbours

    Examples
    --------
    >>> found = between_neighbours(np.radians([0.0, 90.0, 180.0, 270.0]), 2 / np.pi)
    >>> found.operator[1].tolist(), found.arc_m.round(9).tolist()
    ([-0.5, 1.0, -0.5, 0.0], [1.0, 1.0, 1.0, 1.0])
    """
    places = np.arange(len(azimuth_rad)) if places is None else np.asarray(places)
    after = radius_m * arcs_after(np.asarray(azimuth_rad)[places])
    before = np.roll(after, 1)
    rows, both = np.arange(len(places)), before + after
    operator = np.zeros((len(places), len(azimuth_rad)))
    operator[rows, places] = 1.0
    operator[rows, np.roll(places, 1)] -= after / both
    operator[rows, np.roll(places, -1)] -= before / both
    return Neighbours(places, operator, before, after)


def arcs_after(azimuth_rad):
    """(n,) angle from each of rising azimuths to the next, rad.

    Examples
    --------
    >>> np.degrees(arcs_after(np.radians([10.0, 100.0, 350.0]))).round(6).tolist()
    [90.0, 250.0, 20.0]
    """
    return np.diff(azimuth_rad, append=azimuth_rad[0] + 2 * np.pi)


def spaced_subset(azimuth_rad, residual_m, radius_m, *, arc_m, least):
    """Points about `arc_m` apart, among them the farthest from the plane on either side of it.

    From the farthest point on, the nearest to each even step is taken (of two as near the one
    farther from the plane); the farthest on the other side takes the place of its neighbour.

    Parameters
    ----------
    azimuth_rad, residual_m : ndarray, shape (n,)
        Rising azimuths, and U.
    radius_m, arc_m : float
        Of the shell; wanted between neighbours.
    least : int
        Fewest points; their number is even.

    Returns
    -------
    ndarray of int
        Their places, rising; all n where they are hardly more than are wanted.

    Examples
    --------
    >>> t = np.radians(np.arange(0.0, 360.0, 22.5))
    >>> spaced_subset(t, np.cos(2 * t - 0.1), 10.0, arc_m=9.0, least=8).tolist()
    [0, 2, 4, 6, 8, 10, 12, 14]
    """
    count, size = len(azimuth_rad), np.abs(residual_m)
    wanted = max(least, int(np.ceil(2 * np.pi * radius_m / arc_m - 1e-9)))
    wanted += wanted % 2
    if count <= NEARLY * wanted:
        return np.arange(count)
    farthest = int(np.argmax(size))
    chosen = [farthest]
    for step in range(1, wanted):
        at = azimuth_rad[farthest] + 2 * np.pi * step / wanted
        away = np.abs((azimuth_rad - at + np.pi) % (2 * np.pi) - np.pi)
        away[chosen] = np.inf
        near = np.flatnonzero(away <= away.min() + 1e-6)
        chosen.append(int(near[np.argmax(size[near])]))
    other = int(np.argmax(-np.sign(residual_m[farthest]) * residual_m))
    if other not in chosen:
        away = (azimuth_rad[chosen] - azimuth_rad[other] + np.pi) % (2 * np.pi) - np.pi
        away[0] = np.inf  # the farthest stays
        chosen[int(np.argmin(np.abs(away)))] = other
    return np.sort(chosen)


@dataclass(frozen=True)
class Curvature:
    """The largest curvature of the harmonics of U, along the shell.

    Attributes
    ----------
    highest : int
        Harmonics 2 to this one.
    per_m : float
        |d2U/ds2| there, 1/m.
    azimuth_rad : float
        There.
    gradient : ndarray, shape (n,)
        Its change with each elevation, 1/m2.
    """

    highest: int
    per_m: float
    azimuth_rad: float
    gradient: np.ndarray


def largest_curvature_of(azimuth_rad, z_m, radius_m, highest):
    """Largest |d2U/ds2| of harmonics 2 to `highest`, fitted together with the plane.

    (1/R)^2 max |sum k^2 (a_k cos k t + b_k sin k t)|, k from 2

    Parameters
    ----------
    azimuth_rad, z_m : ndarray, shape (n,)
        n above 2 highest; z elevations or U, which give the same.
    radius_m : float
    highest : int

    Returns
    -------
    Curvature

    Examples
    --------
    >>> t = np.radians(np.arange(0.0, 360.0, 30.0))
    >>> found = largest_curvature_of(t, 0.001 * np.cos(2 * t), 2.0, 3)
    >>> round(found.per_m, 9)
    0.001
    """
    operator = _least_squares(harmonics(azimuth_rad, highest))
    unknowns = operator @ z_m
    weights = _curvature_weights(radius_m, highest)

    def size(t):
        return np.abs(harmonics(np.atleast_1d(t), highest) @ (weights * unknowns))

    step = 2 * np.pi / (_STEPS * highest)
    grid = np.arange(_STEPS * highest) * step
    start = grid[np.argmax(size(grid))]
    found = scipy.optimize.minimize_scalar(
        lambda t: -size(t)[0],
        bounds=(start - step, start + step),
        method="bounded",
        options={"xatol": 1e-9},
    )
    at = found.x if -found.fun > size(start)[0] else start
    rows = harmonics([at], highest)[0] * weights
    sign = -1.0 if rows @ unknowns < 0 else 1.0
    return Curvature(highest, float(size(at)[0]), float(at % (2 * np.pi)), sign * rows @ operator)


def curvature_rows(azimuth_rad, radius_m, highest, start_rad):
    """Curvature of the harmonics of U on an even grid of azimuths, as a linear map of elevations.

    Parameters
    ----------
    azimuth_rad : ndarray, shape (n,)
    radius_m : float
    highest : int
        As of `largest_curvature_of`.
    start_rad : float
        A place of the grid, such as that of the largest curvature.

    Returns
    -------
    ndarray, shape (m, n)
        Curvature, 1/m, is rows @ z; the grid misses at most 3.4 % of another maximum.
    """
    count = _COARSE_STEPS * highest
    grid = start_rad + np.arange(count) * 2 * np.pi / count
    columns = harmonics(grid, highest) * _curvature_weights(radius_m, highest)
    return columns @ _least_squares(harmonics(azimuth_rad, highest))


def _curvature_weights(radius_m, highest):
    """(2 highest + 1,) k^2 / R^2 of each harmonic, 0 of the plane."""
    squares = np.repeat(np.arange(1, highest + 1), 2) ** 2.0
    return np.concatenate([[0.0, 0.0, 0.0], squares[2:]]) / radius_m**2
