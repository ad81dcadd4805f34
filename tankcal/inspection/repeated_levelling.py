"""The bias of the largest of many readings, by levelling plausible true settlements again.

Errors of levelling raise the largest |S| of n points above the largest true |S|, and lower the
share that the plane explains. The size of this bias depends on how many points compete for the
largest value, which only the levelling itself shows. It is estimated in two steps:

1. Draw true settlements that agree with the levelling: those of a prior, given the readings.
2. Level each of them again with the stated standard uncertainties (a parametric bootstrap). The
   mean excess of the statistic of the readings over the true statistic is the bias; its scatter
   is the uncertainty.

The statistic of the actual readings less the mean excess is the estimate. The prior affects the
excess only, never the reading itself: a point that dominates all others keeps its reading.

Prior of what is out of the plane, all variances relative to the mean variance of the levelling:
waves of harmonics k >= 2 with amplitudes that fall as k^-p, a part that is independent from point
to point, and at most one local dip. Their sizes are unknown: they are mixed over grids, weighted by
half-Cauchy priors of the standard deviations and by the likelihood of the readings.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from tankcal.geometry.form import harmonics
from tankcal.inspection.figures import PROBABILITY
from tankcal.inspection.out_of_plane import fit_plane

POWERS = (1.5, 3.0, 6.0)  # p of waves: from nearly rough to an ovality
WAVE_RATIOS = 8.0 ** np.arange(-1, 6)  # variance of the waves
ROUGH_RATIOS = 16.0 ** np.arange(-1, 4)  # variance of the independent part
DIP_RATIOS = 16.0 ** np.arange(0, 4)  # variance of the depth of a dip
DIP_SHARE = 0.5  # prior probability of a dip
FREE = 5  # every so many settlements are drawn without a prior: those of any other form
DRAWS = 2000  # true settlements: the mean excess is good to 0.02 of its scatter
REPEATS = 4  # levellings of each: they separate the scatter of the excess from that of its mean
CHUNK = 500  # settlements whose statistic is computed together, to bound the memory
SEED = 653


@dataclass(frozen=True)
class Repeated:
    """Plausible true elevations, and levellings of them.

    Attributes
    ----------
    true_m : ndarray, shape (DRAWS, n)
        Elevations less the mean of their plane.
    levelled_m : ndarray, shape (REPEATS, DRAWS, n)
    """

    true_m: np.ndarray
    levelled_m: np.ndarray


@dataclass(frozen=True)
class Estimate:
    """A statistic of the true settlement without the bias of its reading.

    Attributes
    ----------
    value, u, U, k : float
        U is expanded, for PROBABILITY: the quantile of the simulated scatter.
    """

    value: float
    u: float
    U: float
    k: float

    def times(self, factor):
        """The same estimate in another unit."""
        return Estimate(factor * self.value, factor * self.u, factor * self.U, self.k)


def repeat_levelling(azimuth_rad, z_m, u_m, dof=np.inf):
    """Draw true settlements that agree with a levelling, and level each of them again.

    Parameters
    ----------
    azimuth_rad : ndarray, shape (n,)
        Rising, within one turn; n above 3.
    z_m, u_m : ndarray, shape (n,)
        Elevations and their standard uncertainties, above 0.
    dof : float
        Degrees of freedom of the standard uncertainties.

    Returns
    -------
    Repeated
    """
    rng = np.random.default_rng(SEED)
    azimuth, z, u = (np.asarray(one, dtype=float) for one in (azimuth_rad, z_m, u_m))
    # The draws start at the point farthest from the plane: turning the tank changes none of them.
    start = int(np.argmax(np.abs(fit_plane(azimuth, z).residual_m)))
    order = np.roll(np.arange(len(z)), -start)
    turned = (azimuth[order] - azimuth[start]) % (2 * np.pi)
    plane = fit_plane(turned, z[order])
    settled = _draw_settlements(turned, plane.residual_m, u[order], rng)
    settled += _draw_tilts(plane, u[order], rng) @ harmonics(turned, 1)[:, 1:].T
    scale = np.ones(DRAWS) if np.isinf(dof) else np.sqrt(dof / rng.chisquare(dof, DRAWS))
    errors = rng.normal(size=(REPEATS, *settled.shape)) * u[order] * scale[:, None]
    back = np.argsort(order)
    return Repeated(settled[:, back], (settled + errors)[:, :, back])


def estimate(statistic, reading, repeated, *, least=0.0, most=np.inf):
    """The statistic of the readings less its mean excess over the true statistic.

    Parameters
    ----------
    statistic : callable
        (m, n) elevations to (m,) values.
    reading : float
        Of the levelling itself.
    repeated : Repeated
    least, most : float
        Bounds of any true value.

    Returns
    -------
    Estimate
    """
    true = _chunked(statistic, repeated.true_m)
    excess = np.stack([_chunked(statistic, one) for one in repeated.levelled_m]) - true
    bias, scatter = float(excess.mean()), float(excess.std())
    # The bias is that of a draw: its variance between draws, less that of a mean of few repeats.
    of_bias = excess.mean(axis=0).var() - excess.var(axis=0, ddof=1).mean() / REPEATS
    u = float(np.sqrt(scatter**2 + max(of_bias, 0.0)))
    width = float(np.quantile(np.abs(excess - bias), PROBABILITY))
    k = width / scatter if scatter > 0 else 0.0
    return Estimate(float(np.clip(reading - bias, least, most)), u, k * u, k)


def _chunked(statistic, z_m):
    return np.concatenate([statistic(z_m[i : i + CHUNK]) for i in range(0, len(z_m), CHUNK)])


def _draw_tilts(plane, u_m, rng):
    """(DRAWS, 2) plausible (p, q): those of least squares, shrunk by their own variance."""
    variance = plane.operator[1:] ** 2 @ np.asarray(u_m) ** 2
    signal = max((plane.b_m**2 - variance.sum()) / 2, 0.0)  # mean of p^2 + q^2 without errors
    share = signal / (signal + variance)
    mean = share * np.array([plane.p_m, plane.q_m])
    return mean + np.sqrt(share * variance) * rng.normal(size=(DRAWS, 2))


def _draw_settlements(azimuth_rad, residual_m, u_m, rng):
    """(DRAWS, n) settlements out of the plane, from their distribution given the residuals."""
    scale = np.sqrt(np.mean(u_m**2))
    basis = np.linalg.qr(harmonics(azimuth_rad, 1), mode="complete")[0][:, 3:]
    y, noise = basis.T @ residual_m / scale, u_m / scale
    parts = [_Part(y, basis, noise, *one) for one in _priors(azimuth_rad)]
    log_weights = np.concatenate([one.log_weights for one in parts])
    weights = np.cumsum(np.exp(log_weights - log_weights.max()))
    picked = np.searchsorted(weights, (np.arange(DRAWS) + 0.5) / DRAWS * weights[-1])
    part, member = np.divmod(picked, len(parts[0].log_weights))
    n = len(u_m)
    normals = [rng.normal(size=(DRAWS, count)) for count in (parts[0].waves.shape[1], n, n, 1)]
    found = np.empty((DRAWS, n))
    for one in np.unique(part):
        rows = part == one
        found[rows] = parts[one].draw(member[rows], *(normal[rows] for normal in normals))
    if FREE:
        found[::FREE] = residual_m / scale + noise * rng.normal(size=found[::FREE].shape)
    return scale * found @ basis @ basis.T


def _priors(azimuth_rad):
    """(waves, rough, log weight) of each prior without a dip; rough a variance.

    Waves are (n, 2 (h - 1)) columns whose amplitudes have the variance 1; h = n // 2.
    """
    n = len(azimuth_rad)
    columns, order = harmonics(azimuth_rad, n // 2)[:, 3:], np.repeat(np.arange(2, n // 2 + 1), 2)
    weights = [_half_cauchy(WAVE_RATIOS), _half_cauchy(ROUGH_RATIOS)]
    for power in POWERS:
        falling = order ** -float(power)
        falling *= np.sqrt(2 / np.sum(falling**2))  # cos^2 + sin^2 of each order add up to 1
        for wave, of_wave in zip(WAVE_RATIOS, weights[0], strict=True):
            for rough, of_rough in zip(ROUGH_RATIOS, weights[1], strict=True):
                yield np.sqrt(wave) * falling * columns, rough, np.log(of_wave * of_rough)


def _half_cauchy(ratios):
    """(m,) weights of variances on an even grid of their logarithms: 1 / (1 + sd^2) d sd."""
    weights = np.sqrt(ratios) / (1 + ratios)
    return weights / weights.sum()


class _Part:
    """Settlements of one prior given the readings, without a dip and with a dip at each point.

    y = basis' (waves c + sqrt(rough) r + dip + noise e), where c, r and e are standard normal.
    `log_weights` holds the posterior weight without a dip first, then (size, point) of dips.
    """

    def __init__(self, y, basis, noise, waves, rough, log_prior):
        self.y, self.basis, self.noise, self.waves, self.rough = y, basis, noise, waves, rough
        self.covariance = waves @ waves.T + rough * np.eye(len(noise))
        of_readings = basis.T @ (self.covariance + np.diag(noise**2)) @ basis
        self.factor = scipy.linalg.cho_factor(of_readings, lower=True)
        self.solved = scipy.linalg.cho_solve(self.factor, basis.T)  # B^-1 of a dip at each point
        self.leverage = np.sum(basis.T * self.solved, axis=0)
        misfit = y @ scipy.linalg.cho_solve(self.factor, y)
        plain = log_prior - np.sum(np.log(np.diag(self.factor[0]))) - misfit / 2
        # A dip adds a rank-one term to B: determinant and inverse by Sherman & Morrison.
        size = DIP_RATIOS[:, None]
        grown = 1 + size * self.leverage
        gain = (size * (y @ self.solved) ** 2 / grown - np.log(grown)) / 2
        of_dip = _half_cauchy(DIP_RATIOS)[:, None] * DIP_SHARE / len(noise)
        dips = plain + np.log(of_dip) + gain
        self.log_weights = np.concatenate([[plain + np.log(1 - DIP_SHARE)], dips.ravel()])

    def draw(self, member, amplitudes, roughness, errors, depth):
        """(m, n) draws given the readings, from standard normal numbers.

        Draw from the prior, simulate its readings, and add the regression on what they miss the
        actual readings by (Matheron's rule).
        """
        rows, n = np.arange(len(member)), len(self.noise)
        size, at = np.divmod(np.maximum(member - 1, 0), n)
        size = np.where(member > 0, DIP_RATIOS[size], 0.0)
        found = amplitudes @ self.waves.T + np.sqrt(self.rough) * roughness
        found[rows, at] += np.sqrt(size) * depth[:, 0]
        missed = self.y - (found + self.noise * errors) @ self.basis
        solved = scipy.linalg.cho_solve(self.factor, missed.T).T
        of_dip = np.sum(solved * self.basis[at], axis=1)
        solved -= (size * of_dip / (1 + size * self.leverage[at]))[:, None] * self.solved[:, at].T
        found += solved @ self.basis.T @ self.covariance
        found[rows, at] += size * np.sum(solved * self.basis[at], axis=1)
        return found
