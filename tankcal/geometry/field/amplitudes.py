"""Amplitudes of the components of a wall, estimated from measurements.

The logarithms of the variances have a normal prior (`components`). The estimated amplitudes
maximise the posterior density given the readings (`likelihood`); the curvature at the maximum gives
their covariance.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.geometry.field.components import COMPONENTS, log_covariance
from tankcal.geometry.field.evidence import BULGES, likelihood_of
from tankcal.geometry.field.likelihood import LEAST_M


@dataclass(frozen=True)
class Amplitudes:
    """Variances of the components and their uncertainty.

    Attributes
    ----------
    likely_m2 : ndarray, shape (components,)
        Most likely variances.
    log_covariance : ndarray, shape (components, components)
        Covariance of the logarithms of the variances.
    prior_log_sd : ndarray, shape (components,)
        Standard deviations of these logarithms before the survey.
    noise : float
        Factor on the covariance of the readings; 1 if the covariance is known.
    noise_log_sd : float
        Standard deviation of the logarithm of that factor.
    """

    likely_m2: np.ndarray
    log_covariance: np.ndarray
    prior_log_sd: np.ndarray
    noise: float = 1.0
    noise_log_sd: float = 0.0

    @property
    def noise_dof(self):
        """Degrees of freedom of the noise factor; inf if the covariance is known."""
        return 2 / self.noise_log_sd**2 if self.noise_log_sd else np.inf

    def with_bulges(self, scale):
        """Return amplitudes with those of bulges and tapers multiplied by a scale."""
        return replace(self, likely_m2=np.where(BULGES, scale**2, 1.0) * self.likely_m2)

    def assumed_share(self):
        """Return the ratio (components,) of posterior to prior variance of each logarithm.

        The ratio is 1 for an assumed amplitude, and near 0 for an amplitude that the survey
        determines.
        """
        return np.clip(np.diag(self.log_covariance) / self.prior_log_sd**2, 0.0, 1.0)

    @property
    def variances_m2(self):
        """Mean (components,) of each variance: its most likely value times exp(s^2 / 2).

        A wall of uncertain amplitudes has this covariance. Weights based on it give the best linear
        estimate, and an additional reading never increases the uncertainty. A normal distribution
        whose variance is log-normal contains 95 % within 1.96 to 2.06 of its standard deviations
        for s up to 1.5.
        """
        return self.likely_m2 * np.exp(np.diag(self.log_covariance) / 2)

    def with_least(self, name):
        """Return amplitudes with a named component at least as large as its prior median."""
        index = [component.name for component in COMPONENTS].index(name)
        likely_m2 = self.likely_m2.copy()
        likely_m2[index] = max(likely_m2[index], COMPONENTS[index].median_m ** 2)
        return replace(self, likely_m2=likely_m2)


def assumed_amplitudes(ovality_m=None, common_ovality_m=None, *, smoothed=False):
    """Return prior `Amplitudes` of a wall without measurements.

    Parameters
    ----------
    ovality_m, common_ovality_m : float, optional
        Known departure from a circle (rms) of a course, and its part common to all courses, m.
    smoothed : bool, optional
        Whether the readings will show the wall smoother than it is; see
        `components.log_covariance`.

    Returns
    -------
    Amplitudes
        Medians, with the prior standard deviations.
    """
    size = np.array([component.median_m for component in COMPONENTS]) ** 2
    covariance = log_covariance(smoothed)
    prior_sd = np.sqrt(np.diag(covariance))
    if ovality_m is not None:
        # The variances of common and own ovality add up to the square of the given departure.
        common = min(common_ovality_m or 0.0, ovality_m)
        for name, amplitude_m in (
            ("common ovality", common),
            ("own ovality", np.sqrt(ovality_m**2 - common**2)),
        ):
            place = [component.name for component in COMPONENTS].index(name)
            # A declared amplitude is known: its logarithm has no variance.
            size[place] = max(amplitude_m, LEAST_M) ** 2
            covariance[place] = covariance[:, place] = 0.0
    return Amplitudes(size, covariance, prior_sd)


def estimate_amplitudes(
    sites, radius_m, noise_m2, nominal_m, *, estimate_noise=False, start_m2=None
):
    """Estimate the `Amplitudes` of a wall from radii measured at sites.

    Parameters
    ----------
    sites : Sites
        n sites.
    radius_m : ndarray, shape (n,)
        Distances from the axis, m.
    noise_m2 : ndarray, shape (n,) or (n, n)
        Variances or covariance of the radii, m2. Covariances between courses are ignored here.
    nominal_m : float
        Radius of the tank, which determines the angular width of seams, m.
    estimate_noise : bool
        Whether `noise_m2` is known only up to a factor.
    start_m2 : ndarray, shape (components + 1,), optional
        Start values: variances of the components, and factor on the variances of the readings.

    Returns
    -------
    Amplitudes
    """
    likelihood = likelihood_of(sites, radius_m, noise_m2, nominal_m, estimate_noise)
    return most_likely(likelihood, len(COMPONENTS), start_m2)


def most_likely(likelihood, count, start_m2=None):
    """Return the `Amplitudes` that maximise a likelihood.

    Parameters
    ----------
    likelihood : Likelihood
    count : int
        Number of components; an additional last variance is the noise factor.
    start_m2 : ndarray, optional
        Start values.

    Returns
    -------
    Amplitudes
    """
    start = None if start_m2 is None else np.log(start_m2[: len(likelihood.middle)])
    best, covariance = likelihood.top(start)
    estimates = np.exp(best[:count]), covariance[:count, :count], likelihood.log_sd[:count]
    if len(best) == count:
        return Amplitudes(*estimates)
    return Amplitudes(*estimates, float(np.exp(best[-1])), float(np.sqrt(covariance[-1, -1])))


def likely_variances(sites, radius_m, variance_m2, nominal_m, start_m2=None):
    """Return approximate most likely variances of the components, and the noise factor.

    Parameters
    ----------
    sites, radius_m, nominal_m
        As in `estimate_amplitudes`.
    variance_m2 : ndarray, shape (n,)
        Variances of the readings, known up to a factor, m2.
    start_m2 : ndarray, shape (components + 1,), optional
        Start values.

    Returns
    -------
    ndarray, shape (components + 1,)
        m2; the last element is the factor on the variances of the readings.
    """
    likelihood = likelihood_of(sites, radius_m, variance_m2, nominal_m, True)
    return np.exp(likelihood.near_top(None if start_m2 is None else np.log(start_m2)))
