"""Run effect: difference between repeated runs beyond the uncertainty of their readings.

With M the weights of all known effects without the run effect, and Z the misclosures for a run
effect of one,

    Z' M Z = Q diag(l) Q',   d = Q' Z' M y / l  ~  N(0, diag(theta + 1/l)),

independent of one another. The restricted likelihood of theta, the variance of the run effect, is
thus that of these few normal variables. Source: Patterson & Thompson 1971 (REML); Searle, Casella &
McCulloch 1992, 6.6.
"""

from dataclasses import dataclass

import numpy as np

TOLD = 1e-9  # relative to the largest l: directions with a smaller l are not determined
GRID = 400  # log-spaced variances, from 1e-3 of the mean noise variance to 1e4 of the largest


@dataclass(frozen=True)
class RunEffect:
    """Standard deviation of the run effect, relative, with its degrees of freedom.

    Attributes
    ----------
    sd : float
    dof : float
        inf for a declared run effect.
    restricted_sd : float
        Maximum of the restricted likelihood; 0 if the readings explain all differences of runs.
    """

    sd: float
    dof: float
    restricted_sd: float


def estimate_run_effect(weight, misclosure_m3, run_m3):
    """Return the `RunEffect` of two or more runs; None if they do not determine it.

    The likelihood of few runs is flat, and its maximum is often 0, which is no proof that runs do
    not differ. sd and dof are therefore those of the variance averaged over the restricted
    likelihood. With tau = theta + s, s the (harmonic) mean noise of a run, they follow from the
    mean and the variance of 1/tau, for 1/tau distributed as chi-square over its dof:

        1/tau = E[1/tau],   dof = 2 E[1/tau]^2 / Var[1/tau],   sd^2 = tau - s,

    under the scale prior 1/tau; the dof of theta alone is multiplied by ((tau - s) / tau)^2. For
    runs that differ much more than their noise, the result is the usual mean square with its dof.

    Parameters
    ----------
    weight : ndarray, shape (n, n)
        M without a run effect.
    misclosure_m3 : ndarray, shape (n,)
    run_m3 : ndarray, shape (n, runs)
        Misclosures for a run effect of one in each run.

    Returns
    -------
    RunEffect or None
    """
    differences, noise = run_differences(weight, misclosure_m3, run_m3)
    if run_m3.shape[1] < 2 or len(noise) < 2:
        return None
    return averaged(differences, noise)


def run_differences(weight, misclosure_m3, run_m3):
    """Return independent variables of mean 0 and variances theta + s, and s.

    A common change of all runs acts like the factor of the meter. This direction has a large s, due
    to the uncertainty of the meter certificate and of the geometry, and hence little weight.

    Parameters
    ----------
    weight, misclosure_m3, run_m3
        As for `estimate_run_effect`.

    Returns
    -------
    d, s : ndarray
    """
    information = run_m3.T @ weight @ run_m3
    size, turn = np.linalg.eigh(information)
    determined = size > TOLD * size[-1]
    d = turn.T @ (run_m3.T @ (weight @ misclosure_m3))
    return d[determined] / size[determined], 1 / size[determined]


def averaged(d, s):
    """Return the `RunEffect` of independent variables d of variances theta + s."""
    mean_noise, largest = 1 / np.mean(1 / s), max(np.max(d**2), np.max(s))
    theta = np.concatenate([[0.0], np.geomspace(1e-3 * mean_noise, 1e4 * largest, GRID)])
    variance = theta[:, None] + s
    restricted = -0.5 * np.sum(np.log(variance) + d**2 / variance, axis=1)
    tau = theta + mean_noise
    # Subtract the maximum before the exponential, which would underflow otherwise.
    density = np.exp(restricted - restricted.max()) / tau
    mass = np.sum(np.diff(theta) * (density[1:] + density[:-1]) / 2)

    def mean(values):
        integrand = density * values
        return np.sum(np.diff(theta) * (integrand[1:] + integrand[:-1]) / 2) / mass

    precision = mean(1 / tau)
    # A lower bound of the variance limits the dof to a finite number.
    spread = max(mean(1 / tau**2) - precision**2, 1e-12 * precision**2)
    mean_tau = 1 / precision
    theta_mean = max(mean_tau - mean_noise, 0.0)
    dof = 2 * precision**2 / spread * (theta_mean / mean_tau) ** 2
    return RunEffect(
        float(np.sqrt(theta_mean)), float(dof), float(np.sqrt(theta[restricted.argmax()]))
    )
