"""How large the components of a wall are, learned from what was measured.

Each logarithm of a variance is normal beforehand (`components`); the amplitudes are those of the
highest density given the readings (`likelihood`), and the curvature there is how well they are
known.
"""

from dataclasses import dataclass

import numpy as np
import scipy.optimize

from tankcal.geometry.field.components import COMPONENTS
from tankcal.geometry.field.likelihood import LEAST_M, Likelihood

ROUGH, FINE = 1e-5, 1e-8  # relative change of the likelihood that ends its search
MOST_STEPS, SMALL_STEP = 12, 1e-7  # of a logarithm
LOG_STEP = 0.1  # of the differences that give the curvature
NEAR_TOP = 0.02  # of a logarithm: so near the top the curvature is that of the top


@dataclass(frozen=True)
class Amplitudes:
    """Variances of the components and how well they are known.

    Attributes
    ----------
    variances_m2 : ndarray, shape (components,)
    log_covariance : ndarray, shape (components, components)
        Of the logarithms of the variances.
    noise : float
        Factor of the covariance of the readings; 1 where it was given.
    noise_log_sd : float
        Standard deviation of the logarithm of that factor.
    """

    variances_m2: np.ndarray
    log_covariance: np.ndarray
    noise: float = 1.0
    noise_log_sd: float = 0.0

    @property
    def noise_dof(self):
        """Degrees of freedom of the noise's factor; inf where it was given."""
        return 2 / self.noise_log_sd**2 if self.noise_log_sd else np.inf

    def assumed_share(self):
        """(components,) variance of each logarithm over what it was beforehand: 1 of an assumed
        amplitude, near 0 of one that the survey told.
        """
        before = np.array([one.log_sd for one in COMPONENTS])
        return np.clip(np.diag(self.log_covariance) / before**2, 0.0, 1.0)

    def inflation(self):
        """(components,) mean of each variance over its most likely value, exp(s^2 / 2).

        A normal distribution whose variance is log-normal has the variance of that mean, and holds
        95 % within 1.96 to 2.06 of its standard deviations for s up to 1.5.
        """
        return np.exp(np.diag(self.log_covariance) / 2)

    @property
    def form_m2(self):
        """Variance of the departures of a section from a circle."""
        chosen = [one.shape in ("oval", "seam") for one in COMPONENTS]
        return float(np.sum(self.variances_m2[chosen]))


def assumed_amplitudes(ovality_m=None, common_ovality_m=None):
    """`Amplitudes` of a wall that nobody measured yet: the medians, as wide as they are before.

    Parameters
    ----------
    ovality_m, common_ovality_m : float, optional
        Departure from a circle (rms) of a course, and the part of it that runs up the whole shell,
        where they are known.

    Returns
    -------
    Amplitudes
    """
    size = np.array([one.median_m for one in COMPONENTS]) ** 2
    log_sd = np.array([one.log_sd for one in COMPONENTS])
    if ovality_m is not None:
        common = min(common_ovality_m or 0.0, ovality_m)
        for name, given in (
            ("common ovality", common),
            ("own ovality", np.sqrt(ovality_m**2 - common**2)),
        ):
            place = [one.name for one in COMPONENTS].index(name)
            size[place], log_sd[place] = max(given, LEAST_M) ** 2, 0.0
    return Amplitudes(size, np.diag(log_sd**2))


def estimate_amplitudes(sites, radius_m, noise_m2, nominal_m, *, estimate_noise=False):
    """`Amplitudes` of a wall from radii measured at sites.

    Parameters
    ----------
    sites : Sites
    radius_m : ndarray, shape (n,)
        Distances from the axis, m.
    noise_m2 : ndarray, shape (n,) or (n, n)
        Variances of the radii, or their covariance; that between courses is not used here.
    nominal_m : float
        Radius of the tank, for the length of seams, m.
    estimate_noise : bool
        Whether `noise_m2` is known up to a factor only.

    Returns
    -------
    Amplitudes
    """
    likelihood = Likelihood.of(sites, radius_m, noise_m2, nominal_m, estimate_noise)
    best, bounds = _likely(likelihood, FINE), likelihood.bounds
    for _ in range(2):  # to the very top, so that the order of the readings changes nothing
        covariance = np.linalg.inv(_curvature(likelihood, best))
        top = np.clip(_climb(likelihood, best, covariance), *bounds.T)
        best, away = top, np.abs(top - best).max()
        if away < NEAR_TOP:
            break
    count = len(COMPONENTS)
    known = Amplitudes(np.exp(best[:count]), covariance[:count, :count])
    if not estimate_noise:
        return known
    return Amplitudes(
        known.variances_m2, known.log_covariance, float(np.exp(best[-1])), covariance[-1, -1] ** 0.5
    )


def likely_variances(sites, radius_m, variance_m2, nominal_m):
    """Variances of the components, m2, and factor of those of the readings, near the most likely.

    Parameters
    ----------
    sites, radius_m, nominal_m
        As in `estimate_amplitudes`.
    variance_m2 : ndarray, shape (n,)
        Of the readings, known up to a factor.

    Returns
    -------
    variances_m2 : ndarray, shape (components,)
    noise : float
    """
    likelihood = Likelihood.of(sites, radius_m, variance_m2, nominal_m, True)
    best = np.exp(_likely(likelihood, ROUGH))
    return best[:-1], float(best[-1])


def _likely(likelihood, tolerance):
    """Logarithms near the most likely."""
    return scipy.optimize.minimize(
        likelihood.misfit,
        likelihood.middle,
        jac=True,
        method="L-BFGS-B",
        bounds=likelihood.bounds,
        options={"ftol": tolerance},
    ).x


def _climb(likelihood, best, covariance):
    """Newton's steps with one curvature."""
    for _ in range(MOST_STEPS):
        step = np.clip(-covariance @ likelihood.misfit(best)[1] / 2, -LOG_STEP, LOG_STEP)
        best = best + step
        if np.abs(step).max() < SMALL_STEP:
            break
    return best


def _curvature(likelihood, best):
    """Of the misfit's half, by differences of its derivative; never below the prior's."""
    slope = likelihood.misfit(best)[1]
    curvature = np.diag(likelihood.log_sd**-2.0)  # all there is of what no reading shows
    for one in likelihood.shown:
        moved = best.copy()
        moved[one] += LOG_STEP
        curvature[one] = (likelihood.misfit(moved)[1] - slope) / (2 * LOG_STEP)
    values, vectors = np.linalg.eigh((curvature + curvature.T) / 2)
    return (vectors * np.maximum(values, 1 / likelihood.log_sd.max() ** 2)) @ vectors.T
