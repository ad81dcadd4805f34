"""The wall of a lying cylinder or of a sphere as one random field, known from points of it.

The distance of a wall from its cylinder or sphere is

    f = X beta + sum of departures,

X what moves the shape itself (`cylinders.cylinder_distances`, `primitives.sphere_distances`), and
each departure a Gaussian field of a known shape whose size, its rms, is unsure: the logarithm of
its variance is normal, about that of `median_m` with `log_sd`. Sizes are those of the highest
density given the points, by their restricted likelihood; the curvature there is how well they are
known. What was measured, y = X beta + f + noise, gives every linear functional of the wall by the
best linear unbiased estimate, with the formulas of `estimate`.

On a cylinder a departure has a covariance c(turn) h(distance along the axis); on a sphere one of
the great-circle angle, the sum of v_l P_l(cos angle) over the degrees l from 2 on.

Sources: Patterson & Thompson 1971 (restricted maximum likelihood); Robinson 1991 (best linear
unbiased prediction).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.optimize
import scipy.sparse

from tankcal.geometry.field.components import oval_columns
from tankcal.geometry.field.covariances import without_rounding
from tankcal.geometry.field.likelihood import (
    LEAST_M,
    LEAST_NOISE_M,
    MOST_M,
    NOISE_LOG_SD,
    NOISE_MEDIAN_M,
    invert,
    rounded,
)
from tankcal.geometry.outlines import FULL_TURN

FINE, LOG_STEP = 1e-9, 0.1  # change of the likelihood that ends its search; for its curvature
WRAPS = np.arange(-2, 3)  # turns of a circumference that a short covariance is summed over
CELL_M, LARGEST_CELL_M = 0.15, 120  # along the axis; cells of it at most
AROUND = 144  # cells around a cylinder
DEGREES = np.arange(2, 161)  # of the Legendre polynomials of a sphere's departures
MOST_SITES, CELL_GROWTH = 600, 1.15  # of more points the means of neighbours count


@dataclass(frozen=True)
class Departure:
    """One way in which a wall departs from its cylinder or sphere.

    Attributes
    ----------
    kind : str
        Its name in a budget: "bulge", "ovality" or "seams".
    shape : str
        Around a cylinder "mean" (the mean radius), "first" (the axis moves), "oval" (mode k of
        variance k^-3, from 2 on) or "local" (lost over `width_m` along the arc). On a sphere "oval"
        (degree l of variance l^-3, from 2 on) or "local".
    width_m : float
        Of a local one, along the arc.
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
)


# ---- where a wall was measured, and functionals of it


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
            return oval_columns(turn) @ oval_columns(other).T
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
        cosine = np.clip(self.direction @ self.direction.T, -1.0, 1.0)
        return _zonal(cosine, degree_shares(one, self.radius_m))

    def across(self, one, functionals):
        """(f, n) covariance of functionals with one departure at the places.

        functionals  (f, degrees) what each makes of P_l of the angle from the bottom
        """
        shares = degree_shares(one, self.radius_m)
        nadir = np.polynomial.legendre.legvander(-self.direction[:, 2], DEGREES[-1])[:, 2:]
        return (functionals * shares) @ nadir.T

    def within(self, one, functionals):
        """(f, f) covariance of functionals by one departure itself."""
        return (functionals * degree_shares(one, self.radius_m)) @ functionals.T


def degree_shares(one, radius_m):
    """(degrees,) v_l of a departure of unit variance."""
    if one.shape == "oval":
        found = np.where(DEGREES <= 36, DEGREES**-3.0, 0.0)
    else:
        found = (2 * DEGREES + 1) * (DEGREES**2 + (radius_m / one.width_m) ** 2) ** -2.5
    return found / found.sum()


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


# ---- how large the departures are


@dataclass(frozen=True)
class Sizes:
    """Variances of the departures and how well they are known; as `amplitudes.Amplitudes`.

    Attributes
    ----------
    variances_m2 : ndarray, shape (departures,)
    log_sd : ndarray, shape (departures,)
        Standard deviations of their logarithms.
    prior_log_sd : ndarray, shape (departures,)
        The same before the survey.
    noise : float
        Factor of the covariance of the points; 1 where it was given.
    noise_dof : float
        Its degrees of freedom; inf where it was given.
    """

    variances_m2: np.ndarray
    log_sd: np.ndarray
    prior_log_sd: np.ndarray
    noise: float = 1.0
    noise_dof: float = np.inf

    def assumed_share(self):
        """(departures,) variance of each logarithm over what it was before the survey."""
        return np.clip((self.log_sd / self.prior_log_sd) ** 2, 0.0, 1.0)

    def inflation(self):
        """(departures,) mean of each variance over its most likely value."""
        return np.exp(self.log_sd**2 / 2)


def estimate_sizes(places, design, distance_m, noise_m2, *, estimate_noise=False):
    """`Sizes` of the departures of a wall from distances to its cylinder or sphere.

    Parameters
    ----------
    places : OnCylinder or OnSphere
        Of n points.
    design : ndarray, shape (n, p)
        Derivative of the distances by what moves the shape.
    distance_m : ndarray, shape (n,)
        Outwards positive, m.
    noise_m2 : ndarray, shape (n, n)
        Covariance of the distances.
    estimate_noise : bool
        Whether `noise_m2` is known up to a factor only.

    Returns
    -------
    Sizes
    """
    left = scipy.linalg.qr(design)[0][:, np.linalg.matrix_rank(design) :]
    reading = left.T @ distance_m
    parts = [left.T @ places.covariance(one) @ left for one in places.departures]
    fixed = LEAST_NOISE_M**2 * np.eye(len(reading))
    middle = [2 * np.log(one.median_m) for one in places.departures]
    log_sd = [one.log_sd for one in places.departures]
    bounds = [(2 * np.log(LEAST_M), 2 * np.log(MOST_M))] * len(parts)
    noise = left.T @ noise_m2 @ left
    if estimate_noise:
        parts.append(noise)
        middle.append(2 * np.log(NOISE_MEDIAN_M) - np.log(np.mean(np.diag(noise_m2))))
        log_sd.append(NOISE_LOG_SD)
        bounds.append((middle[-1] - 30.0, middle[-1] + 30.0))
    else:
        fixed = fixed + noise
    middle, log_sd, parts = np.array(middle), np.array(log_sd), np.array(parts)

    def misfit(logs):
        return _misfit(logs, parts, fixed, reading, middle, log_sd)

    best = scipy.optimize.minimize(
        misfit, middle, jac=True, method="L-BFGS-B", bounds=bounds, options={"ftol": FINE}
    ).x
    sds = np.sqrt(np.diag(np.linalg.inv(_curvature(misfit, best, log_sd))))
    count = len(places.departures)
    sizes = np.exp(best[:count]), sds[:count], log_sd[:count]
    if not estimate_noise:
        return Sizes(*sizes)
    return Sizes(*sizes, float(np.exp(best[-1])), float(2 / sds[-1] ** 2))


def _misfit(logs, parts, fixed, reading, middle, log_sd):
    """-2 log density of the readings and the logarithms, and its derivative."""
    variances = np.exp(logs)
    root, inverse = invert(rounded(fixed + np.tensordot(variances, parts, 1)))
    solved = inverse @ reading
    away = (logs - middle) / log_sd
    value = 2 * np.sum(np.log(np.diag(root))) + reading @ solved + away @ away
    trace = parts.reshape(len(parts), -1) @ (inverse - np.outer(solved, solved)).ravel()
    return value, variances * trace + 2 * away / log_sd


def _curvature(misfit, best, log_sd):
    """Of the misfit's half, by differences of its derivative; never below the prior's."""
    rows = [
        (misfit(best + LOG_STEP * unit)[1] - misfit(best - LOG_STEP * unit)[1]) / (4 * LOG_STEP)
        for unit in np.eye(len(best))
    ]
    values, vectors = np.linalg.eigh((np.array(rows) + np.array(rows).T) / 2)
    return (vectors * np.maximum(values, 1 / log_sd.max() ** 2)) @ vectors.T


# ---- the wall itself


@dataclass(frozen=True)
class SolidField:
    """The wall of a solid, known from distances to its cylinder or sphere.

    Attributes
    ----------
    places : OnCylinder or OnSphere
    design, distance_m, noise_m2
        As `estimate_sizes` takes them.
    sizes : Sizes
    """

    places: object
    design: np.ndarray
    distance_m: np.ndarray
    noise_m2: np.ndarray
    sizes: Sizes

    @cached_property
    def _solved(self):
        """Cholesky factor of V, V^-1 X, that of X' V^-1 X, beta, and V^-1 (y - X beta)."""
        whole = self.sizes.noise * self.noise_m2
        whole = whole + LEAST_NOISE_M**2 * np.eye(len(whole)) + self._sum
        factor = scipy.linalg.cho_factor(whole, lower=True)
        by_columns = scipy.linalg.cho_solve(factor, self.design)
        normal = scipy.linalg.cho_factor(self.design.T @ by_columns)
        beta = scipy.linalg.cho_solve(normal, by_columns.T @ self.distance_m)
        pull = scipy.linalg.cho_solve(factor, self.distance_m - self.design @ beta)
        return factor, by_columns, normal, beta, pull

    @cached_property
    def _parts(self):
        """(departures, n, n) their covariances."""
        each = zip(self.sizes.variances_m2, self.places.departures, strict=True)
        return np.array([size * self.places.covariance(one) for size, one in each])

    @property
    def _sum(self):
        return self._parts.sum(axis=0)

    def far_off(self, limit, least_m):
        """(k,) indices of readings that differ from what all others show by over limit sds.

        The worst is left out first, and the rest is asked again. A difference up to least_m may be
        a dent that one point alone shows.
        """
        whole = self.sizes.noise * self.noise_m2 + self._sum
        whole.flat[:: len(whole) + 1] += LEAST_NOISE_M**2
        kept, off = np.arange(len(whole)), []
        while len(kept) > self.design.shape[1] + 1:
            inverse = np.linalg.inv(whole[np.ix_(kept, kept)])
            design = self.design[kept]
            by_columns = inverse @ design
            normal = np.linalg.solve(design.T @ by_columns, by_columns.T)
            free = inverse - by_columns @ normal
            own, away = np.diag(free), np.abs(free @ self.distance_m[kept])
            away = np.where(away / own > least_m, away / np.sqrt(own), 0.0)
            worst = int(np.argmax(away))
            if not away[worst] > limit:
                break
            off.append(kept[worst])
            kept = np.delete(kept, worst)
        return np.array(off, dtype=int)

    def estimated(self, functionals, by_shape):
        """`Estimated` of functionals of the wall.

        Parameters
        ----------
        functionals
            As `places.across` takes them.
        by_shape : ndarray, shape (f, p)
            Their derivatives by what moves the shape, in the order of the design.
        """
        factor, by_columns, normal, beta, pull = self._solved
        each = list(zip(self.sizes.variances_m2, self.places.departures, strict=True))
        across = [size * self.places.across(one, functionals) for size, one in each]
        together = sum(across)
        short = by_shape - together @ by_columns
        with_shape = together + scipy.linalg.cho_solve(normal, short.T).T @ self.design.T
        weights = scipy.linalg.cho_solve(factor, with_shape.T).T
        unseen = []
        for (size, one), part, here in zip(each, self._parts, across, strict=True):
            seen = weights @ here.T
            whole = size * self.places.within(one, functionals) - seen - seen.T
            unseen.append(without_rounding(whole + weights @ part @ weights.T))
        return Estimated(beta, together @ pull, weights, unseen)


@dataclass(frozen=True)
class Estimated:
    """Functionals of a wall, estimated.

    Attributes
    ----------
    moved : ndarray, shape (p,)
        By how much the shape moves.
    departing : ndarray, shape (f,)
        What the departures alone make of each functional.
    weights : ndarray, shape (f, n)
        Derivatives by the distances.
    unseen : list of ndarray, shape (f, f)
        Covariance by what was not seen of each departure.
    """

    moved: np.ndarray
    departing: np.ndarray
    weights: np.ndarray
    unseen: list
