"""Places on a lying cylinder or a sphere, how its wall departs there, and functionals of it.

Each departure is a Gaussian field of a known shape whose size, its rms, is unsure: the logarithm of
its variance is normal, about that of `median_m` with `log_sd`. On a cylinder a departure has a
covariance c(turn) h(distance along the axis); on a sphere one of the great-circle angle, the sum of
v_l P_l(cos angle) over the degrees l from 2 on.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.sparse

from tankcal.geometry.field.components import wave_columns
from tankcal.geometry.outlines import FULL_TURN

WRAPS = np.arange(-2, 3)  # turns of a circumference that a short covariance is summed over
CELL_M, LARGEST_CELL_M = 0.15, 120  # along the axis; cells of it at most
AROUND = 144  # cells around a cylinder
DEGREES = np.arange(2, 161)  # of the Legendre polynomials of a sphere's departures
ZONAL = np.sqrt(5.0)  # P_2 over its rms on a sphere
AT_EQUATOR = np.polynomial.legendre.legvander(np.zeros(1), DEGREES[-1])[0, 2:]  # P_l(0)
MOST_SITES, CELL_GROWTH = 600, 1.15  # of more points the means of neighbours count


@dataclass(frozen=True)
class Departure:
    """One way in which a wall departs from its cylinder or sphere.

    Attributes
    ----------
    kind : str
        Its name in a budget: "bulge", "ovality", "oblateness", "legs" or "seams".
    shape : str
        Around a cylinder "mean" (the mean radius), "first" (the axis moves), "oval" (mode k of
        variance k^-3, from 2 on) or "local" (lost over `width_m` of the arc). On a sphere "oval"
        (degree l of variance l^-3, from 2 on), "local", or "zonal" (P_2 about the vertical: what
        its own weight makes of it); of its great circles "band", about the equator, where legs
        press a sphere in.
    width_m : float
        Of a local one, along the arc; of a band the latitude, rad.
    length_m : float
        Along the axis of a cylinder, over which it is lost; inf: it runs along the whole tank.
    median_m, log_sd : float
        Median of its rms, m, and standard deviation of the logarithm of its variance.
    """

    kind: str
    shape: str
    width_m: float
    length_m: float
    median_m: float
    log_sd: float


OF_CYLINDERS = (
    Departure("bulge", "mean", 0.0, 2.0, 1.2e-3, 1.5),
    Departure("bulge", "mean", 0.0, 0.25, 1.2e-3, 1.5),
    Departure("bulge", "first", 0.0, 4.0, 1.5e-3, 1.5),
    Departure("ovality", "oval", 0.0, np.inf, 3e-3, 2.0),
    Departure("ovality", "oval", 0.0, 2.0, 2e-3, 2.0),
    Departure("seams", "local", 0.2, np.inf, 2e-3, 1.2),
    Departure("seams", "local", 0.2, 1.5, 2e-3, 1.2),
    Departure("seams", "local", 0.3, 0.3, 1.5e-3, 1.2),
    Departure("seams", "bottom", 0.15, 3.0, 4e-3, 1.5),
)
OF_SPHERES = (
    Departure("ovality", "oval", 0.0, 0.0, 3e-3, 2.0),
    Departure("seams", "local", 0.4, 0.0, 4e-3, 1.5),
    Departure("seams", "local", 1.2, 0.0, 3e-3, 1.5),
    Departure("oblateness", "zonal", 0.0, 0.0, 3e-3, 2.0),
)
OF_GREAT_CIRCLES = (  # whose size no strap tells
    Departure("ovality", "oval", 0.0, 0.0, 2e-3, 0.0),
    Departure("seams", "local", 0.4, 0.0, 2e-3, 0.0),
    Departure("seams", "local", 1.2, 0.0, 2e-3, 0.0),
    Departure("legs", "band", 0.15, 0.0, 2.5e-3, 0.0),
)


@dataclass(frozen=True)
class OnCylinder:
    """Places on a cylinder.

    Attributes
    ----------
    radius_m : float
    turn_rad : ndarray, shape (n,)
        About the axis, 0 at the bottom.
    along_m : ndarray, shape (n,)
        Along the axis.
    """

    radius_m: float
    turn_rad: np.ndarray
    along_m: np.ndarray
    departures = OF_CYLINDERS

    def covariance(self, one):
        """(n, n) of one departure of unit variance between the places."""
        return self._around(one, self.turn_rad, self.turn_rad) * _fading(
            np.subtract.outer(self.along_m, self.along_m), one.length_m
        )

    def across(self, one, functionals):
        """(f, n) covariance of `CylinderFunctionals` with one departure at the places."""
        around = self._around(one, functionals.turn_rad, self.turn_rad)
        along = _fading(np.subtract.outer(functionals.along_m, self.along_m), one.length_m)
        found = np.einsum("ftn,tn->fn", functionals.weights @ along, around, optimize=True)
        at_point = self._around(one, np.zeros(1), self.turn_rad)[0]
        at_point = at_point * _fading(functionals.point_m - self.along_m, one.length_m)
        return found + np.outer(functionals.at_point, at_point)

    def within(self, one, functionals):
        """(f, f) covariance of `CylinderFunctionals` by one departure itself."""
        count = len(functionals.weights)
        around = self._around(one, functionals.turn_rad, functionals.turn_rad)
        along = np.subtract.outer(functionals.along_m, functionals.along_m)
        spread = around @ (functionals.weights @ _fading(along, one.length_m))
        flat = functionals.weights.reshape(count, -1)
        at_point = OnCylinder(self.radius_m, np.zeros(1), np.array([functionals.point_m]))
        point = at_point.across(one, functionals)  # its own share of the point is in it
        over_grid = point - functionals.at_point[:, None]
        whole = spread.reshape(count, -1) @ flat.T + over_grid @ functionals.at_point[None, :]
        return whole + np.outer(functionals.at_point, point[:, 0])

    def _around(self, one, turn, other):
        """(n, m) c between turns (n,) and (m,)."""
        if one.shape == "oval":
            return wave_columns(turn)["oval"] @ wave_columns(other)["oval"].T
        away = np.subtract.outer(turn, other)
        if one.shape == "first":
            return np.cos(away)
        if one.shape == "mean":
            return np.ones(away.shape)
        if one.shape == "bottom":
            return np.outer(*(self._of_bottom(one, places) for places in (turn, other)))
        arcs = self.radius_m * (away[..., None] + FULL_TURN * WRAPS)
        at_once = _smooth(self.radius_m * FULL_TURN * WRAPS / one.width_m).sum()
        return _smooth(arcs / one.width_m).sum(axis=-1) / at_once

    def _of_bottom(self, one, turn):
        """(n,) how much a place has of what departs at the bottom alone."""
        arc = self.radius_m * (turn - FULL_TURN * np.round(turn / FULL_TURN))
        return np.exp(-((arc / one.width_m) ** 2))


@dataclass(frozen=True)
class CylinderFunctionals:
    """Linear functionals of a wall: weights of the cells of a grid, and of one point at the bottom.

    Attributes
    ----------
    turn_rad, along_m : ndarray, shapes (t,) and (s,)
        Middles of the cells.
    weights : ndarray, shape (f, t, s)
    point_m : float
        Place of the point along the axis.
    at_point : ndarray, shape (f,)
        Its weights.
    """

    turn_rad: np.ndarray
    along_m: np.ndarray
    weights: np.ndarray
    point_m: float
    at_point: np.ndarray


def cells_around():
    """(t,) middles of the cells around a cylinder; the first at the bottom, one at the top."""
    return FULL_TURN * np.arange(AROUND) / AROUND


def cells_along(begin_m, length_m):
    """(s,) middles of even cells along an axis."""
    count = int(np.clip(np.ceil(length_m / CELL_M), 24, LARGEST_CELL_M))
    return begin_m + length_m * (np.arange(count) + 0.5) / count


def wet_cells(level_m, radius_m):
    """(..., t) share of each cell around a cylinder that is below levels (...) above its axis."""
    half = np.arccos(np.clip(-np.asarray(level_m) / radius_m, -1.0, 1.0))[..., None]
    away = np.abs((cells_around() + np.pi) % FULL_TURN - np.pi)
    width = FULL_TURN / AROUND
    left = np.clip((half - away) / width + 0.5, 0.0, 1.0)
    other_side = np.clip((half - (FULL_TURN - away)) / width + 0.5, 0.0, 1.0)  # of the cell on top
    at_bottom = np.clip((half + away) / width + 0.5, 0.0, 1.0) - 1.0  # of that at the bottom
    return np.clip(left + other_side + at_bottom, 0.0, 1.0)


@dataclass(frozen=True)
class OnSphere:
    """Places on a sphere: directions (n, 3) from its centre."""

    radius_m: float
    direction: np.ndarray
    departures = OF_SPHERES

    def covariance(self, one):
        """(n, n) of one departure of unit variance between the places."""
        if one.shape == "zonal":
            return np.outer(*(self._flattened() for _ in "ab"))
        cosine = np.clip(self.direction @ self.direction.T, -1.0, 1.0)
        return _zonal(cosine, degree_shares(one, self.radius_m))

    def across(self, one, functionals):
        """(f, n) covariance of functionals with one departure at the places.

        functionals  (f, degrees) what each makes of P_l of the angle from the bottom
        """
        if one.shape == "zonal":
            return np.outer(ZONAL * functionals[:, 0], self._flattened())
        shares = degree_shares(one, self.radius_m)
        return (functionals * shares) @ _nadir_waves(self.direction).T

    def within(self, one, functionals):
        """(f, f) covariance of functionals by one departure itself."""
        if one.shape == "zonal":
            return ZONAL**2 * np.outer(functionals[:, 0], functionals[:, 0])
        return (functionals * degree_shares(one, self.radius_m)) @ functionals.T

    def _flattened(self):
        """(n,) of the places, of a sphere that is flattened by an rms of one."""
        return ZONAL * (1.5 * self.direction[:, 2] ** 2 - 0.5)


@dataclass(frozen=True)
class OnGreatCircles:
    """Mean radii of great circles of a sphere, known by the normals (n, 3) of their planes.

    The mean of P_l of the angle from a place, over a great circle, is P_l(0) times that of the
    angle from the place to the normal. What an ellipsoid has, the degree 2, is no departure.
    """

    radius_m: float
    normal: np.ndarray
    departures = OF_GREAT_CIRCLES

    def covariance(self, one):
        """(n, n) of one departure of unit variance between the means."""
        if one.shape == "band":
            return np.outer(*(self._of_band(one) for _ in "ab"))
        shares = self._shares(one) * AT_EQUATOR**2
        return _zonal(np.clip(self.normal @ self.normal.T, -1.0, 1.0), shares)

    def across(self, one, functionals):
        """(f, n) covariance of functionals with the means, as `OnSphere.across`."""
        if one.shape == "band":
            return np.outer(functionals @ _band(one), self._of_band(one))
        of_means = functionals * self._shares(one) * AT_EQUATOR
        return of_means @ _nadir_waves(self.normal).T

    def within(self, one, functionals):
        """(f, f) covariance of functionals by one departure itself."""
        if one.shape == "band":
            return np.outer(*(functionals @ _band(one) for _ in "ab"))
        return (functionals * self._shares(one)) @ functionals.T

    def _of_band(self, one):
        """(n,) means of a band over the circles."""
        return _nadir_waves(self.normal) @ (_band(one) * AT_EQUATOR)

    def _shares(self, one):
        return np.where(DEGREES == 2, 0.0, degree_shares(one, self.radius_m))


@cache
def _band(one):
    """(degrees,) what a band about the equator has of P_l, but for the degree 2."""
    up, weights = np.polynomial.legendre.leggauss(2 * DEGREES[-1])
    profile = np.exp(-((np.arcsin(up) / one.width_m) ** 2))
    waves = np.polynomial.legendre.legvander(up, DEGREES[-1])[:, 2:]
    found = (2 * DEGREES + 1) / 2 * ((weights * profile) @ waves)
    return np.where(DEGREES == 2, 0.0, found)


def _nadir_waves(direction):
    """(n, degrees) P_l of the angles of directions from below."""
    return np.polynomial.legendre.legvander(-direction[:, 2], DEGREES[-1])[:, 2:]


def degree_shares(one, radius_m):
    """(degrees,) v_l of a departure of unit variance."""
    if one.shape == "oval":
        found = np.where(DEGREES <= 36, DEGREES**-3.0, 0.0)
    else:
        found = (2 * DEGREES + 1) * (DEGREES**2 + (radius_m / one.width_m) ** 2) ** -2.5
    return found / found.sum()


def cap_volumes(levels_m, area_m2, radius_m):
    """(k, degrees) what P_l of the angle from the bottom adds to volumes below levels of a sphere.

    Dips count from the wall itself: it takes the free surface along.
    """
    return radius_m**2 * cap_integrals(1 - levels_m / radius_m) - area_m2[:, None]


def cap_integrals(cosine):
    """(k, degrees) integral of P_l over caps about the bottom, out to angles of these cosines.

    2 pi times the integral of P_l(t) from cosine to 1, (P_{l-1} - P_{l+1}) / (2 l + 1).
    """
    every = np.polynomial.legendre.legvander(cosine, DEGREES[-1] + 1)
    return FULL_TURN * (every[:, 1:-2] - every[:, 3:]) / (2 * DEGREES + 1)


def _zonal(cosine, shares):
    """Sum of shares times P_l of many cosines, by interpolation in the angle."""
    angle = np.linspace(0.0, np.pi, 4001)
    table = np.polynomial.legendre.legval(np.cos(angle), np.concatenate([np.zeros(2), shares]))
    return np.interp(np.arccos(cosine), angle, table)


def _smooth(part):
    """(1 + d) exp(-d): once differentiable."""
    away = np.abs(part)
    return (1 + away) * np.exp(-away)


def _fading(distance_m, length_m):
    if np.isinf(length_m):
        return np.ones(np.shape(distance_m))
    return _smooth(distance_m / length_m)


def means_of_neighbours(xyz_m, most=MOST_SITES):
    """(sites, n) weights of the points in each site: one, or the mean of those in a small cube."""
    place = _cubes(xyz_m, most)
    counts = np.bincount(place)
    entries = (1 / counts[place], (place, np.arange(len(place))))
    return scipy.sparse.csr_array(entries, shape=(len(counts), len(place)))


def _cubes(xyz_m, most):
    """(n,) number of the cube that each point is in, as small cubes as give at most so many."""
    if len(xyz_m) <= most:
        return np.arange(len(xyz_m))
    size = np.ptp(xyz_m, axis=0).max() / most
    while True:
        cubes = np.floor((xyz_m - xyz_m.min(axis=0)) / size).astype(int)
        found, place = np.unique(cubes, axis=0, return_inverse=True)
        if len(found) <= most:
            return place.ravel()
        size *= CELL_GROWTH
