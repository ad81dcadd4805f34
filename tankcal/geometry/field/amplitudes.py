"""How large the components of a wall are, learned from what was measured.

The logarithms of the variances are normal beforehand (`components`); the amplitudes are those of
the highest density given the readings (`likelihood`), and the curvature there is how well they are
known.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.geometry.field.components import COMPONENTS, log_covariance
from tankcal.geometry.field.evidence import BULGES, likelihood_of
from tankcal.geometry.field.likelihood import LEAST_M


@dataclass(frozen=True)
class Amplitudes:
    """Variances of the components and how well they are known.

    Attributes
    ----------
    likely_m2 : ndarray, shape (components,)
        The most likely variances.
    log_covariance : ndarray, shape (components, components)
        Of the logarithms of the variances.
    prior_log_sd : ndarray, shape (components,)
        Standard deviations of these logarithms before the survey.
    noise : float
        Factor of the covariance of the readings; 1 where it was given.
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
        """Degrees of freedom of the noise's factor; inf where it was given."""
        return 2 / self.noise_log_sd**2 if self.noise_log_sd else np.inf

    def with_bulges(self, scale):
        """The same amplitudes, those of bulges and tapers times a scale."""
        return replace(self, likely_m2=np.where(BULGES, scale**2, 1.0) * self.likely_m2)

    def assumed_share(self):
        """(components,) variance of each logarithm over what it was beforehand: 1 of an assumed
        amplitude, near 0 of one that the survey told.
        """
        return np.clip(np.diag(self.log_covariance) / self.prior_log_sd**2, 0.0, 1.0)

    @property
    def variances_m2(self):
        """(components,) mean of each variance: its most likely value times exp(s^2 / 2).

        A wall whose sizes are unsure has this covariance, so weights by it make the best linear
        estimate, and a further reading never widens its doubt. A normal distribution whose variance
        is log-normal holds 95 % within 1.96 to 2.06 of its standard deviations for s up to 1.5.
        """
        return self.likely_m2 * np.exp(np.diag(self.log_covariance) / 2)

    def with_least(self, name):
        """The same with a component of at least its median before the survey."""
        index = [one.name for one in COMPONENTS].index(name)
        likely_m2 = self.likely_m2.copy()
        likely_m2[index] = max(likely_m2[index], COMPONENTS[index].median_m ** 2)
        return replace(self, likely_m2=likely_m2)


def assumed_amplitudes(ovality_m=None, common_ovality_m=None, *, smoothed=False):
    """`Amplitudes` of a wall that nobody measured yet: the medians, as wide as they are before.

    Parameters
    ----------
    ovality_m, common_ovality_m : float, optional
        Departure from a circle (rms) of a course, and the part of it that runs up the whole shell,
        where they are known.
    smoothed : bool, optional
        Whether the readings will show the wall smoother than it is; see
        `components.log_covariance`.

    Returns
    -------
    Amplitudes
    """
    size = np.array([one.median_m for one in COMPONENTS]) ** 2
    covariance = log_covariance(smoothed)
    before = np.sqrt(np.diag(covariance))
    if ovality_m is not None:
        common = min(common_ovality_m or 0.0, ovality_m)
        for name, given in (
            ("common ovality", common),
            ("own ovality", np.sqrt(ovality_m**2 - common**2)),
        ):
            place = [one.name for one in COMPONENTS].index(name)
            size[place] = max(given, LEAST_M) ** 2
            covariance[place] = covariance[:, place] = 0.0
    return Amplitudes(size, covariance, before)


def estimate_amplitudes(
    sites, radius_m, noise_m2, nominal_m, *, estimate_noise=False, start_m2=None
):
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
    start_m2 : ndarray, shape (components + 1,), optional
        Variances of the components, and factor of those of the readings, where the search begins.

    Returns
    -------
    Amplitudes
    """
    likelihood = likelihood_of(sites, radius_m, noise_m2, nominal_m, estimate_noise)
    return most_likely(likelihood, len(COMPONENTS), start_m2)


def most_likely(likelihood, count, start_m2=None):
    """`Amplitudes` of so many components by their likelihood; a last variance is the noise's."""
    start = None if start_m2 is None else np.log(start_m2[: len(likelihood.middle)])
    best, covariance = likelihood.top(start)
    known = np.exp(best[:count]), covariance[:count, :count], likelihood.log_sd[:count]
    if len(best) == count:
        return Amplitudes(*known)
    return Amplitudes(*known, float(np.exp(best[-1])), float(np.sqrt(covariance[-1, -1])))


def likely_variances(sites, radius_m, variance_m2, nominal_m, start_m2=None):
    """Variances of the components, m2, and factor of those of the readings, near the most likely.

    Parameters
    ----------
    sites, radius_m, nominal_m
        As in `estimate_amplitudes`.
    variance_m2 : ndarray, shape (n,)
        Of the readings, known up to a factor.
    start_m2 : ndarray, shape (components + 1,), optional
        Where the search begins.

    Returns
    -------
    ndarray, shape (components + 1,)
        The factor last.
    """
    likelihood = likelihood_of(sites, radius_m, variance_m2, nominal_m, True)
    return np.exp(likelihood.near_top(None if start_m2 is None else np.log(start_m2)))
