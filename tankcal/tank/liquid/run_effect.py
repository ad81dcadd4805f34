"""The run effect: by how much repeated runs differ beyond what their readings explain.

With M the weights of all that is known without it and Z the misclosures by a run effect of one,

    Z' M Z = Q diag(l) Q',   d = Q' Z' M y / l  ~  N(0, diag(theta + 1/l)),

independent of one another: the restricted likelihood of theta, the variance of the run effect, is
that of these few normal numbers. Source: Patterson & Thompson 1971 (REML); Searle, Casella &
McCulloch 1992, 6.6.
"""

from dataclasses import dataclass

import numpy as np

TOLD = 1e-9  # of the largest l: a direction of the runs that tells less tells nothing
GRID = 400  # of log-spaced variances, between a hundredth of the least noise and 100 squared d


@dataclass(frozen=True)
class RunEffect:
    """Standard deviation of the run effect, relative, with its degrees of freedom.

    Attributes
    ----------
    sd : float
    dof : float
        inf of a declared one.
    restricted_sd : float
        Where the restricted likelihood is largest; 0 where runs differ by no more than readings.
    """

    sd: float
    dof: float
    restricted_sd: float


def estimate_run_effect(weight, misclosure_m3, run_m3):
    """`RunEffect` of two runs or more; None where they tell nothing of it.

    The likelihood of few runs is flat, and its largest value is often 0, which is no proof that
    runs do not differ. So sd and dof are those of the variance averaged over the restricted
    likelihood: with tau = theta + s, s the (harmonic) mean noise of a run, the mean and the
    variance of 1/tau, for 1/tau of a chi-square over its dof:

        1/tau = E[1/tau],   dof = 2 E[1/tau]^2 / Var[1/tau],   sd^2 = tau - s,

    under the prior 1/tau of a scale, and of theta alone the dof times ((tau - s) / tau)^2. Runs
    that differ much more than their noise have the usual mean square, with its dof.

    Parameters
    ----------
    weight : ndarray, shape (n, n)
        M without any run effect.
    misclosure_m3 : ndarray, shape (n,)
    run_m3 : ndarray, shape (n, runs)
        Misclosure by a run effect of one of each run.

    Returns
    -------
    RunEffect or None
    """
    differences, noise = run_differences(weight, misclosure_m3, run_m3)
    if run_m3.shape[1] < 2 or len(noise) < 2:
        return None
    return averaged(differences, noise)


def run_differences(weight, misclosure_m3, run_m3):
    """(d, s): independent numbers of mean 0 and variances theta + s.

    All runs together move as the factor of the meter does: that direction has a large s, by what
    the certificate of the meter and the geometry leave open, and tells little.
    """
    seen = run_m3.T @ weight @ run_m3
    size, turn = np.linalg.eigh(seen)
    told = size > TOLD * size[-1]
    d = turn.T @ (run_m3.T @ (weight @ misclosure_m3))
    return d[told] / size[told], 1 / size[told]


def averaged(d, s):
    """`RunEffect` of independent numbers d of variances theta + s."""
    least, most = 1 / np.mean(1 / s), max(np.max(d**2), np.max(s))
    theta = np.concatenate([[0.0], np.geomspace(1e-3 * least, 1e4 * most, GRID)])
    variance = theta[:, None] + s
    restricted = -0.5 * np.sum(np.log(variance) + d**2 / variance, axis=1)
    tau = theta + least
    likely = np.exp(restricted - restricted.max()) / tau
    mass = np.sum(np.diff(theta) * (likely[1:] + likely[:-1]) / 2)

    def mean(values):
        one = likely * values
        return np.sum(np.diff(theta) * (one[1:] + one[:-1]) / 2) / mass

    precision = mean(1 / tau)
    spread = max(mean(1 / tau**2) - precision**2, 1e-12 * precision**2)
    whole = 1 / precision
    found = max(whole - least, 0.0)
    dof = 2 * precision**2 / spread * (found / whole) ** 2
    return RunEffect(float(np.sqrt(found)), float(dof), float(np.sqrt(theta[restricted.argmax()])))
