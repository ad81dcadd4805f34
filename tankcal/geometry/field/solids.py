"""Wall of a lying cylinder or of a sphere as a random field, estimated from points.

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
from functools import cached_property

import numpy as np
import scipy.linalg

from tankcal.geometry.field.amplitudes import Amplitudes, most_likely
from tankcal.geometry.field.blunders import judge_by_others, restricted_precision
from tankcal.geometry.field.covariances import clip_to_semidefinite
from tankcal.geometry.field.likelihood import LEAST_NOISE_M, Likelihood, Part, prior_of


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
