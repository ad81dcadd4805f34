"""Wall of a lying cylinder or of a sphere as a random field: places and departures.

A departure is a Gaussian field of a known shape. The logarithm of its variance has a normal prior,
with the median from `median_m` and the standard deviation `log_sd`. On a cylinder, a departure has
a covariance c(turn) h(distance along the axis). On a sphere, the covariance is a function of the
great-circle angle, the sum of v_l P_l(cos angle) over the degrees l from 2 on.

Estimate of the wall from points
--------------------------------

The distance of a wall from its cylinder or sphere is

    f = X beta + sum of departures,

with X the derivative by the parameters of the shape (`cylinders.cylinder_distances`,
`primitives.sphere_distances`) and the departures of `places`. Their variances are estimated like
those of the components of a standing wall (`likelihood`). The measurements y = X beta + f + noise
give the best linear unbiased estimate of every linear functional of the wall, with the formulas of
`estimate`.

Source: Robinson 1991 (best linear unbiased prediction).
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import scipy.linalg
import scipy.sparse

from tankcal.geometry.field.amplitudes import Amplitudes, most_likely
from tankcal.geometry.field.blunders import judge_by_others, restricted_precision
from tankcal.geometry.field.components import wave_columns
from tankcal.geometry.field.likelihood import LEAST_NOISE_M, Likelihood, Part, prior_of
from tankcal.geometry.field.sites import clip_to_semidefinite
from tankcal.units import FULL_TURN

WRAPS = np.arange(-2, 3)  # turns over which a short covariance is summed to make it periodic
CELL_M, LARGEST_CELL_M = 0.15, 120  # length of a cell along the axis; largest number of cells
AROUND = 144  # number of cells around a cylinder
DEGREES = np.arange(2, 161)  # degrees of the Legendre polynomials of a sphere's departures
ZONAL = np.sqrt(5.0)  # ratio of P_2 to its rms on a sphere
AT_EQUATOR = np.polynomial.legendre.legvander(np.zeros(1), DEGREES[-1])[0, 2:]  # P_l(0)
# Larger numbers of points are replaced by means of neighbours, in cubes that grow by this factor.
MOST_SITES, CELL_GROWTH = 600, 1.15


@dataclass(frozen=True)
class Departure:
    """Component of the departure of a wall from its cylinder or sphere.

    Attributes
    ----------
    kind : str
        Name in an uncertainty budget: "bulge", "ovality", "oblateness", "legs" or "seams".
    shape : str
        Around a cylinder: "mean" (the mean radius), "first" (the axis is displaced), "oval" (mode k
        of variance k^-3, from 2 on), "local" (correlation length `width_m` along the arc) or
        "bottom" (only near the bottom). On a sphere: "oval" (degree l of variance l^-3, from 2 on),
        "local", or "zonal" (P_2 about the vertical: deformation by the weight of the sphere). On
        great circles: also "band", about the equator, where legs press a sphere in.
    width_m : float
        Correlation length of a local departure along the arc, m; latitude of a band, rad.
    length_m : float
        Correlation length along the axis of a cylinder, m; inf: constant along the whole tank.
    median_m, log_sd : float
        Median of the rms, m, and standard deviation of the logarithm of the variance.
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
OF_GREAT_CIRCLES = (  # strapping does not determine these amplitudes: log_sd is 0
    Departure("ovality", "oval", 0.0, 0.0, 2e-3, 0.0),
    Departure("seams", "local", 0.4, 0.0, 2e-3, 0.0),
    Departure("seams", "local", 1.2, 0.0, 2e-3, 0.0),
    Departure("legs", "band", 0.15, 0.0, 1.8e-3, 0.0),
)


@dataclass(frozen=True)
class OnCylinder:
    """Places on a cylinder.

    Attributes
    ----------
    radius_m : float
    turn_rad : ndarray, shape (n,)
        Angle about the axis, 0 at the bottom.
    along_m : ndarray, shape (n,)
        Position along the axis.
    """

    radius_m: float
    turn_rad: np.ndarray
    along_m: np.ndarray
    departures = OF_CYLINDERS

    def covariance(self, departure):
        """Return the covariance (n, n) of a departure of unit variance between the places."""
        return self._correlate_turns(departure, self.turn_rad, self.turn_rad) * _fading(
            np.subtract.outer(self.along_m, self.along_m), departure.length_m
        )

    def across(self, departure, functionals):
        """Return the covariance (f, n) of `CylinderFunctionals` with a departure at the places."""
        circumferential = self._correlate_turns(departure, functionals.turn_rad, self.turn_rad)
        axial = _fading(np.subtract.outer(functionals.along_m, self.along_m), departure.length_m)
        covariance = np.einsum(
            "ftn,tn->fn", functionals.weights @ axial, circumferential, optimize=True
        )
        # The reference point at the bottom is separate from the grid of cells.
        at_point = self._correlate_turns(departure, np.zeros(1), self.turn_rad)[0]
        at_point = at_point * _fading(functionals.point_m - self.along_m, departure.length_m)
        return covariance + np.outer(functionals.at_point, at_point)

    def within(self, departure, functionals):
        """Return the covariance (f, f) of `CylinderFunctionals` due to a departure."""
        count = len(functionals.weights)
        turn = functionals.turn_rad
        circumferential = self._correlate_turns(departure, turn, turn)
        axial = np.subtract.outer(functionals.along_m, functionals.along_m)
        spread = circumferential @ (functionals.weights @ _fading(axial, departure.length_m))
        flat = functionals.weights.reshape(count, -1)
        at_point = OnCylinder(self.radius_m, np.zeros(1), np.array([functionals.point_m]))
        # Covariance of the functionals with the point; it includes the weight of the point itself.
        point = at_point.across(departure, functionals)
        over_grid = point - functionals.at_point[:, None]
        covariance = spread.reshape(count, -1) @ flat.T + over_grid @ functionals.at_point[None, :]
        return covariance + np.outer(functionals.at_point, point[:, 0])

    def _correlate_turns(self, departure, turn, other):
        """Return c (n, m) between turns (n,) and (m,)."""
        if departure.shape == "oval":
            return wave_columns(turn)["oval"] @ wave_columns(other)["oval"].T
        difference = np.subtract.outer(turn, other)
        if departure.shape == "first":
            return np.cos(difference)
        if departure.shape == "mean":
            return np.ones(difference.shape)
        if departure.shape == "bottom":
            amplitudes = (self._bottom_amplitudes(departure, places) for places in (turn, other))
            return np.outer(*amplitudes)
        # Sum over several turns: the covariance becomes periodic and remains positive definite.
        arcs = self.radius_m * (difference[..., None] + FULL_TURN * WRAPS)
        variance = _smooth(self.radius_m * FULL_TURN * WRAPS / departure.width_m).sum()
        return _smooth(arcs / departure.width_m).sum(axis=-1) / variance

    def _bottom_amplitudes(self, departure, turn):
        """Return the amplitude (n,) at turns of a departure limited to the bottom."""
        arc = self.radius_m * (turn - FULL_TURN * np.round(turn / FULL_TURN))
        return np.exp(-((arc / departure.width_m) ** 2))


@dataclass(frozen=True)
class CylinderFunctionals:
    """Linear functionals of a wall: weights of grid cells and of a point at the bottom.

    Attributes
    ----------
    turn_rad, along_m : ndarray, shapes (t,) and (s,)
        Centres of the cells.
    weights : ndarray, shape (f, t, s)
        Weights of the cells.
    point_m : float
        Position of the point along the axis.
    at_point : ndarray, shape (f,)
        Weights of the point.
    """

    turn_rad: np.ndarray
    along_m: np.ndarray
    weights: np.ndarray
    point_m: float
    at_point: np.ndarray


def cells_around():
    """Return centres (t,) of the cells around a cylinder, rad, the first at the bottom."""
    return FULL_TURN * np.arange(AROUND) / AROUND


def cells_along(begin_m, length_m):
    """Return centres (s,) of equal cells along an axis, from begin_m over length_m, m."""
    count = int(np.clip(np.ceil(length_m / CELL_M), 24, LARGEST_CELL_M))
    return begin_m + length_m * (np.arange(count) + 0.5) / count


def wet_cells(level_m, radius_m):
    """Return the wet share (..., t) of each cell around a cylinder, for levels (...)."""
    wet_angle = np.arccos(np.clip(-np.asarray(level_m) / radius_m, -1.0, 1.0))[..., None]
    turn = np.abs((cells_around() + np.pi) % FULL_TURN - np.pi)
    width = FULL_TURN / AROUND
    # The wet arc is |turn| < half; a cell at its end is wet in part.
    share = np.clip((wet_angle - turn) / width + 0.5, 0.0, 1.0)
    other_side = np.clip(
        (wet_angle - (FULL_TURN - turn)) / width + 0.5, 0.0, 1.0
    )  # of the cell on top
    at_bottom = np.clip((wet_angle + turn) / width + 0.5, 0.0, 1.0) - 1.0  # of that at the bottom
    return np.clip(share + other_side + at_bottom, 0.0, 1.0)


@dataclass(frozen=True)
class OnSphere:
    """Places on a sphere: directions (n, 3) from its centre."""

    radius_m: float
    direction: np.ndarray
    departures = OF_SPHERES

    def covariance(self, departure):
        """Return the covariance (n, n) of a departure of unit variance between the places."""
        if departure.shape == "zonal":
            return np.outer(*(self._flattening() for _ in "ab"))
        cosine = np.clip(self.direction @ self.direction.T, -1.0, 1.0)
        return _zonal(cosine, degree_shares(departure, self.radius_m))

    def across(self, departure, functionals):
        """Return the covariance (f, n) of functionals with a departure at the places.

        functionals  (f, degrees) values of the functionals for P_l of the angle from the bottom
        """
        if departure.shape == "zonal":
            return np.outer(ZONAL * functionals[:, 0], self._flattening())
        shares = degree_shares(departure, self.radius_m)
        # Addition theorem: the covariance of two places, expanded at the bottom, is a product in l.
        return (functionals * shares) @ _nadir_waves(self.direction).T

    def within(self, departure, functionals):
        """Return the covariance (f, f) of functionals due to a departure."""
        if departure.shape == "zonal":
            return ZONAL**2 * np.outer(functionals[:, 0], functionals[:, 0])
        return (functionals * degree_shares(departure, self.radius_m)) @ functionals.T

    def _flattening(self):
        """Return the departure (n,) of a sphere flattened by an rms of 1, at the places."""
        return ZONAL * (1.5 * self.direction[:, 2] ** 2 - 0.5)


@dataclass(frozen=True)
class OnGreatCircles:
    """Mean radii of great circles of a sphere, given by the normals (n, 3) of their planes.

    The mean over a great circle of P_l of the angle from a place is P_l(0) times P_l of the angle
    from the place to the normal. The degree 2 belongs to the ellipsoid and is no departure.
    """

    radius_m: float
    normal: np.ndarray
    departures = OF_GREAT_CIRCLES

    def covariance(self, departure):
        """Return the covariance (n, n) of a departure of unit variance between the means."""
        if departure.shape == "band":
            return np.outer(*(self._band_means(departure) for _ in "ab"))
        shares = self._shares(departure) * AT_EQUATOR**2
        return _zonal(np.clip(self.normal @ self.normal.T, -1.0, 1.0), shares)

    def across(self, departure, functionals):
        """Return the covariance (f, n) of functionals with the means, as `OnSphere.across`."""
        if departure.shape == "band":
            return np.outer(functionals @ _band(departure), self._band_means(departure))
        of_means = functionals * self._shares(departure) * AT_EQUATOR
        return of_means @ _nadir_waves(self.normal).T

    def within(self, departure, functionals):
        """Return the covariance (f, f) of functionals due to a departure."""
        if departure.shape == "band":
            return np.outer(*(functionals @ _band(departure) for _ in "ab"))
        return (functionals * self._shares(departure)) @ functionals.T

    def _band_means(self, departure):
        """Return the means (n,) of a band over the circles."""
        return _nadir_waves(self.normal) @ (_band(departure) * AT_EQUATOR)

    def _shares(self, departure):
        return np.where(DEGREES == 2, 0.0, degree_shares(departure, self.radius_m))


@cache
def _band(departure):
    """Return coefficients (degrees,) of a band about the equator in P_l, without degree 2."""
    sine, weights = np.polynomial.legendre.leggauss(2 * DEGREES[-1])
    profile = np.exp(-((np.arcsin(sine) / departure.width_m) ** 2))
    waves = np.polynomial.legendre.legvander(sine, DEGREES[-1])[:, 2:]
    # Projection on P_l, whose square has the integral 2 / (2 l + 1) over -1..1.
    coefficients = (2 * DEGREES + 1) / 2 * ((weights * profile) @ waves)
    return np.where(DEGREES == 2, 0.0, coefficients)


def _nadir_waves(direction):
    """Return P_l (n, degrees) of the angles between directions and the nadir."""
    return np.polynomial.legendre.legvander(-direction[:, 2], DEGREES[-1])[:, 2:]


def degree_shares(departure, radius_m):
    """Return the variances v_l (degrees,) of a departure of unit variance."""
    if departure.shape == "oval":
        variances = np.where(DEGREES <= 36, DEGREES**-3.0, 0.0)
    else:
        variances = (2 * DEGREES + 1) * (DEGREES**2 + (radius_m / departure.width_m) ** 2) ** -2.5
    return variances / variances.sum()


def cap_volumes(levels_m, area_m2, radius_m):
    """Return changes (k, degrees) of the volumes below levels of a sphere for a departure P_l.

    Dips refer to the wall at the bottom, so a shift of the bottom also moves the free surface.

    Parameters
    ----------
    levels_m : ndarray, shape (k,)
        Levels above the bottom, m.
    area_m2 : ndarray, shape (k,)
        Areas of the free surface, m2.
    radius_m : float

    Returns
    -------
    ndarray, shape (k, degrees)
        m3 per metre of departure at the bottom.
    """
    return radius_m**2 * cap_integrals(1 - levels_m / radius_m) - area_m2[:, None]


def cap_integrals(cosine):
    """Return integrals (k, degrees) of P_l over caps about the bottom.

    The caps extend to angles with the given cosines (k,). The integral is 2 pi times the integral
    of P_l(t) from cosine to 1, (P_{l-1} - P_{l+1}) / (2 l + 1).
    """
    polynomials = np.polynomial.legendre.legvander(cosine, DEGREES[-1] + 1)
    return FULL_TURN * (polynomials[:, 1:-2] - polynomials[:, 3:]) / (2 * DEGREES + 1)


def _zonal(cosine, shares):
    """Return the sum of shares times P_l of many cosines, by interpolation in the angle."""
    angle = np.linspace(0.0, np.pi, 4001)
    table = np.polynomial.legendre.legval(np.cos(angle), np.concatenate([np.zeros(2), shares]))
    return np.interp(np.arccos(cosine), angle, table)


def _smooth(part):
    """Return (1 + d) exp(-d) with d = |part|, a once differentiable covariance."""
    distance = np.abs(part)
    return (1 + distance) * np.exp(-distance)


def _fading(distance_m, length_m):
    """Return h of distances along the axis."""
    if np.isinf(length_m):
        return np.ones(np.shape(distance_m))
    return _smooth(distance_m / length_m)


def means_of_neighbours(xyz_m, most=MOST_SITES):
    """Return weights (sites, n) of the points in each site: a point, or the mean of a small cube.

    xyz_m (n, 3) are the points, m; most is the largest number of sites.
    """
    place = _cubes(xyz_m, most)
    counts = np.bincount(place)
    entries = (1 / counts[place], (place, np.arange(len(place))))
    return scipy.sparse.csr_array(entries, shape=(len(counts), len(place)))


def _cubes(xyz_m, most):
    """Return the number (n,) of the cube of each point, with the smallest cubes that suffice."""
    if len(xyz_m) <= most:
        return np.arange(len(xyz_m))
    size = np.ptp(xyz_m, axis=0).max() / most
    while True:
        cubes = np.floor((xyz_m - xyz_m.min(axis=0)) / size).astype(int)
        occupied, place = np.unique(cubes, axis=0, return_inverse=True)
        if len(occupied) <= most:
            return place.ravel()
        size *= CELL_GROWTH


def estimate_sizes(places, design, distance_m, noise_m2, *, estimate_noise=False):
    """Estimate the `Amplitudes` of the departures of a wall from its cylinder or sphere.

    Parameters
    ----------
    places : OnCylinder or OnSphere
        n points.
    design : ndarray, shape (n, p)
        Derivative of the distances by the parameters of the shape.
    distance_m : ndarray, shape (n,)
        Distances from the shape, outwards positive, m.
    noise_m2 : ndarray, shape (n, n)
        Covariance of the distances, m2.
    estimate_noise : bool
        Whether `noise_m2` is known only up to a factor.

    Returns
    -------
    Amplitudes
    """
    # Restricted likelihood: the complement of the design contains no shape parameters.
    basis = scipy.linalg.qr(design)[0][:, np.linalg.matrix_rank(design) :]
    own_covariances = [
        basis.T @ places.covariance(departure) @ basis for departure in places.departures
    ]
    fixed, noise = LEAST_NOISE_M**2 * np.eye(basis.shape[1]), basis.T @ noise_m2 @ basis
    if estimate_noise:
        own_covariances.append(noise)
    else:
        fixed = fixed + noise
    part = Part(basis.T @ distance_m, np.array(own_covariances), fixed, np.zeros((len(fixed), 0)))
    no_indices, no_values = np.zeros(0, dtype=int), np.zeros((0, 0, 0))
    prior = prior_of(places.departures, noise_m2=np.diag(noise_m2) if estimate_noise else None)
    likelihood = Likelihood(
        (part,), np.arange(len(own_covariances)), no_indices, no_values, np.zeros(0), *prior
    )
    return most_likely(likelihood, len(places.departures))


@dataclass(frozen=True)
class SolidField:
    """Wall of a solid, estimated from distances to its cylinder or sphere.

    Attributes
    ----------
    places : OnCylinder or OnSphere
    design, distance_m, noise_m2
        As for `estimate_sizes`.
    amplitudes : Amplitudes
    """

    places: object
    design: np.ndarray
    distance_m: np.ndarray
    noise_m2: np.ndarray
    amplitudes: Amplitudes

    @cached_property
    def _solution(self):
        """Cholesky factors of V and X' V^-1 X with V^-1 X between, beta, and V^-1 (y - X beta)."""
        factor = scipy.linalg.cho_factor(self._covariance, lower=True)
        by_columns = scipy.linalg.cho_solve(factor, self.design)
        normal = scipy.linalg.cho_factor(self.design.T @ by_columns)
        beta = scipy.linalg.cho_solve(normal, by_columns.T @ self.distance_m)
        pull = scipy.linalg.cho_solve(factor, self.distance_m - self.design @ beta)
        return factor, by_columns, normal, beta, pull

    @cached_property
    def _parts(self):
        """Covariances (departures, n, n) of the departures."""
        sized_departures = zip(self.amplitudes.variances_m2, self.places.departures, strict=True)
        return np.array(
            [size * self.places.covariance(departure) for size, departure in sized_departures]
        )

    @property
    def _covariance(self):
        """Covariance V (n, n) of the departures and the noise."""
        covariance = self.amplitudes.noise * self.noise_m2 + self._parts.sum(axis=0)
        covariance.flat[:: len(covariance) + 1] += LEAST_NOISE_M**2
        return covariance

    def far_off(self, limit, least_m):
        """Return indices (k,) of readings that differ from the prediction by all others.

        The worst reading is rejected first, and the test is repeated without it. A difference up to
        least_m may be a dent at a single point.

        Parameters
        ----------
        limit : float
            Largest accepted difference, in standard deviations.
        least_m : float
            Smallest difference of a rejected reading, m.
        """
        precision = restricted_precision(self._covariance, self.design)
        pull = precision @ self.distance_m
        accepted, rejected = np.ones(len(pull), dtype=bool), []
        while np.count_nonzero(accepted) > self.design.shape[1] + 1:
            tested = judge_by_others(precision, pull, accepted)
            deep = accepted & (np.abs(tested.departure_m) > least_m)
            statistics = np.where(deep, np.abs(tested.w), 0.0)
            worst = int(np.argmax(statistics))
            if not statistics[worst] > limit:
                break
            rejected.append(worst)
            accepted[worst] = False
        return np.array(rejected, dtype=int)

    def estimated(self, functionals, by_shape):
        """Return `FieldEstimate` of functionals of the wall.

        Parameters
        ----------
        functionals
            As for `places.across`.
        by_shape : ndarray, shape (f, p)
            Derivatives by the parameters of the shape, in the order of the design.
        """
        factor, by_columns, normal, beta, pull = self._solution
        sized_departures = list(
            zip(self.amplitudes.variances_m2, self.places.departures, strict=True)
        )
        covariances = [
            size * self.places.across(departure, functionals)
            for size, departure in sized_departures
        ]
        total = sum(covariances)
        # A = (K_g + (X_g - K_g V^-1 X) (X' V^-1 X)^-1 X') V^-1, as in `estimate`.
        remainder = by_shape - total @ by_columns
        with_shape = total + scipy.linalg.cho_solve(normal, remainder.T).T @ self.design.T
        weights = scipy.linalg.cho_solve(factor, with_shape.T).T
        unseen = []
        for (size, departure), part, covariance in zip(
            sized_departures, self._parts, covariances, strict=True
        ):
            # K_gg - A K_g' - K_g A' + A K A' for each departure.
            cross_term = weights @ covariance.T
            difference = (
                size * self.places.within(departure, functionals) - cross_term - cross_term.T
            )
            unseen.append(clip_to_semidefinite(difference + weights @ part @ weights.T))
        return FieldEstimate(beta, total @ pull, weights, unseen)


@dataclass(frozen=True)
class FieldEstimate:
    """Estimated functionals of a wall.

    Attributes
    ----------
    moved : ndarray, shape (p,)
        Changes of the parameters of the shape.
    departing : ndarray, shape (f,)
        Contribution of the departures to each functional.
    weights : ndarray, shape (f, n)
        Derivatives by the distances.
    unseen : list of ndarray, shape (f, f)
        Covariance due to the undetermined part of each departure.
    """

    moved: np.ndarray
    departing: np.ndarray
    weights: np.ndarray
    unseen: list
