"""The wall of a lying cylinder or of a sphere as one random field, known from points of it.

The distance of a wall from its cylinder or sphere is

    f = X beta + sum of departures,

X what moves the shape itself (`cylinders.cylinder_distances`, `primitives.sphere_distances`), the
departures those of `places`; their variances are learned as those of a standing wall's components
(`likelihood`).
What was measured, y = X beta + f + noise, gives every linear functional of the wall by the best
linear unbiased estimate, with the formulas of `estimate`.

Source: Robinson 1991 (best linear unbiased prediction).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from tankcal.geometry.field.amplitudes import Amplitudes, most_likely
from tankcal.geometry.field.blunders import against_others, restricted_precision
from tankcal.geometry.field.covariances import without_rounding
from tankcal.geometry.field.likelihood import LEAST_NOISE_M, Likelihood, Part, prior_of


def estimate_sizes(places, design, distance_m, noise_m2, *, estimate_noise=False):
    """`Amplitudes` of the departures of a wall from distances to its cylinder or sphere.

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
    Amplitudes
    """
    left = scipy.linalg.qr(design)[0][:, np.linalg.matrix_rank(design) :]
    own = [left.T @ places.covariance(one) @ left for one in places.departures]
    fixed, noise = LEAST_NOISE_M**2 * np.eye(left.shape[1]), left.T @ noise_m2 @ left
    if estimate_noise:
        own.append(noise)
    else:
        fixed = fixed + noise
    part = Part(left.T @ distance_m, np.array(own), fixed, np.zeros((len(fixed), 0)))
    none, no_values = np.zeros(0, dtype=int), np.zeros((0, 0, 0))
    prior = prior_of(places.departures, noise_m2=np.diag(noise_m2) if estimate_noise else None)
    likelihood = Likelihood((part,), np.arange(len(own)), none, no_values, np.zeros(0), *prior)
    return most_likely(likelihood, len(places.departures))


@dataclass(frozen=True)
class SolidField:
    """The wall of a solid, known from distances to its cylinder or sphere.

    Attributes
    ----------
    places : OnCylinder or OnSphere
    design, distance_m, noise_m2
        As `estimate_sizes` takes them.
    amplitudes : Amplitudes
    """

    places: object
    design: np.ndarray
    distance_m: np.ndarray
    noise_m2: np.ndarray
    amplitudes: Amplitudes

    @cached_property
    def _solved(self):
        """Cholesky factor of V, V^-1 X, that of X' V^-1 X, beta, and V^-1 (y - X beta)."""
        factor = scipy.linalg.cho_factor(self._covariance, lower=True)
        by_columns = scipy.linalg.cho_solve(factor, self.design)
        normal = scipy.linalg.cho_factor(self.design.T @ by_columns)
        beta = scipy.linalg.cho_solve(normal, by_columns.T @ self.distance_m)
        pull = scipy.linalg.cho_solve(factor, self.distance_m - self.design @ beta)
        return factor, by_columns, normal, beta, pull

    @cached_property
    def _parts(self):
        """(departures, n, n) their covariances."""
        each = zip(self.amplitudes.variances_m2, self.places.departures, strict=True)
        return np.array([size * self.places.covariance(one) for size, one in each])

    @property
    def _covariance(self):
        """(n, n) V: of the departures and the noise."""
        whole = self.amplitudes.noise * self.noise_m2 + self._parts.sum(axis=0)
        whole.flat[:: len(whole) + 1] += LEAST_NOISE_M**2
        return whole

    def far_off(self, limit, least_m):
        """(k,) indices of readings that differ from what all others show by over limit sds.

        The worst is left out first, and the rest is asked again. A difference up to least_m may be
        a dent that one point alone shows.
        """
        precision = restricted_precision(self._covariance, self.design)
        pull = precision @ self.distance_m
        kept, off = np.ones(len(pull), dtype=bool), []
        while np.count_nonzero(kept) > self.design.shape[1] + 1:
            found = against_others(precision, pull, kept)
            deep = kept & (np.abs(found.departure_m) > least_m)
            away = np.where(deep, np.abs(found.w), 0.0)
            worst = int(np.argmax(away))
            if not away[worst] > limit:
                break
            off.append(worst)
            kept[worst] = False
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
        each = list(zip(self.amplitudes.variances_m2, self.places.departures, strict=True))
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
