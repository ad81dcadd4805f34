"""Amplitudes of the components of a wall and the noise of its sections, from measurements.

The logarithms of the variances have a normal prior (`components`). The estimated amplitudes
maximise the posterior density given the readings (`likelihood`); the curvature at the maximum gives
their covariance.

Readings y = X beta + sum of components + noise, with X the design of the radius of each course and
of the centre of each ring of points. With N an orthonormal basis of the complement of X in a
course, N'y is a part of the likelihood. The common values of all courses are values at the azimuths
of the survey and at the heights of the bulge.

Noise of each section of a wall, separated from the form of the wall.

With V the covariance of the readings due to the wall and the noise, and X the columns without
prior,

    P = V^-1 - V^-1 X (X' V^-1 X)^-1 X' V^-1,  e = P y:

The estimated noise of the readings S of a section is N_SS e_S, with N_SS the covariance of their
noise. If that covariance is correct, the square q = e_S' N_SS e_S has the expectation r = tr(N_SS
P_SS). It is distributed as sum(l_i z_i^2), with z standard normal and l the eigenvalues of N_SS
P_SS. The variance factor q / r then has 2 r^2 / var(q) = sum(l)^2 / sum(l^2) degrees of freedom.
Departures that the form of the wall may explain are excluded from r, so form does not count as
noise.

Source: Foerstner 1979 (variance components); Satterthwaite 1946; Bartlett 1937.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from scipy.special import chdtrc

from tankcal.adjust import find_determined
from tankcal.geometry.field.components import (
    COMPONENTS,
    azimuth_correlations,
    log_covariance,
    mode_shares,
    seam_correlations,
    wave_columns,
    weld_columns,
)
from tankcal.geometry.field.likelihood import LEAST_M, LEAST_NOISE_M, Likelihood, Part, prior_of
from tankcal.geometry.field.sites import free_design
from tankcal.geometry.outlines import multiples
from tankcal.units import FULL_TURN

SMALLEST = 1e-8  # keeps the remainder of a covariance without its modelled part positive
NEAR_M = 0.02  # azimuths within this distance along the arc count as equal for the common form
WIDE_M = 1.0  # prior sd of a shared unknown about its first estimate (practically free)
MOST_FOLLOWED = 80  # largest number of values of the common form over all courses
BULGES = np.array([one.shape == "mean" for one in COMPONENTS])
MOST_ASKED = 200  # readings used of a course: each step of a search inverts their covariance


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

    def scale_bulges(self, scale):
        """Return amplitudes with those of bulges, joints and tapers multiplied by a scale."""
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

    def raise_to_median(self, name):
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


def likelihood_of(sites, radius_m, noise_m2, nominal_m, estimate_noise):
    """Return the `Likelihood` of radii at sites.

    A course with more than `MOST_ASKED` readings contributes a sample of its readings.

    Parameters
    ----------
    sites, radius_m, noise_m2, nominal_m, estimate_noise
        As in `estimate_amplitudes`.

    Returns
    -------
    Likelihood
    """
    sample = _sample_readings(sites)
    if len(sample) < len(sites):
        selection = np.ix_(sample, sample) if np.ndim(noise_m2) == 2 else sample
        sites, radius_m, noise_m2 = sites.take(sample), radius_m[sample], noise_m2[selection]
    common = _common_values(sites, nominal_m)
    if sites.shared is not None:
        design = free_design(sites)[0]
        radius_m = radius_m - (design @ np.linalg.lstsq(design, radius_m, rcond=None)[0])
    parts = tuple(
        _build_part(sites, radius_m, noise_m2, nominal_m, members, common, estimate_noise)
        for members in sites.members
    )
    columns, spread, missed = common
    wide = np.zeros(columns.shape[1])
    if sites.shared is not None:
        wide[-sites.shared.shape[1] :] = WIDE_M**2
    shared, own_indices = _component_indices(sites)
    own_indices = own_indices + missed + [len(COMPONENTS)] * estimate_noise
    variances = np.diag(noise_m2) if np.ndim(noise_m2) == 2 else noise_m2
    middle, *others = prior_of(
        COMPONENTS, log_covariance(sites.smoothed), variances if estimate_noise else None
    )
    # A scale on amplitudes is twice its logarithm on the log variances.
    middle[: len(COMPONENTS)][BULGES] += 2 * np.log(sites.bulge_scale)  # logarithms of variances
    return Likelihood(parts, np.array(own_indices), np.array(shared), spread, wide, middle, *others)


def _sample_readings(sites):
    """Return indices of the readings in use: all, or pairs of neighbours.

    Courses with many readings are sampled. The common part of two close readings distinguishes form
    from noise.
    """
    samples = []
    for members in sites.members:
        step = -(-len(members) // MOST_ASKED)
        keys = sites.zeta[members], sites.azimuth_rad[members], sites.ring[members]
        samples.append(members[np.lexsort(keys)][np.arange(len(members)) // 2 % step == 0])
    return np.sort(np.concatenate(samples))


def _component_indices(sites):
    """Return the indices of common components and of own components; welds only if known."""
    indices = [
        i for i, component in enumerate(COMPONENTS) if sites.welds_rad or component.shape != "weld"
    ]
    return [i for i in indices if COMPONENTS[i].common], [
        i for i in indices if not COMPONENTS[i].common
    ]


def _common_values(sites, nominal_m):
    """Return derivatives of the radii by common values, their covariances, and missed components.

    The common values refer to the azimuths of the survey. For too many azimuths, they are the
    cosines and sines of the first modes, and the rest of the seams counts as independent in each
    course. Then follow the values of the heights, the modes of settlement, the peak of all welds,
    and the shared unknowns without prior.

    Returns
    -------
    columns : ndarray, shape (n, k)
        Derivative of the radii by the values.
    spread : ndarray, shape (p, k, k)
        Covariance of the values for each common component, of unit variance.
    missed : list of int
        Components that the values represent only in part.
    """
    common = [(i, COMPONENTS[i]) for i in _component_indices(sites)[0]]
    waves, heights = wave_columns(sites.azimuth_rad), sites.heights
    welds = np.zeros((len(sites), 1))
    for members, selected in zip(sites.members, sites.welds_at(nominal_m), strict=True):
        welds[members, 0] = selected.sum(axis=1)
    values = {
        row: welds if item.shape == "weld" else item.columns(waves, heights)
        for row, (_, item) in enumerate(common)
        if item.shape in ("mean", "settled", "weld")
    }
    selected = np.isfinite(sites.azimuth_rad)
    place, azimuths = _group_azimuths(sites.azimuth_rad[selected], NEAR_M / nominal_m)
    differences = np.angle(np.exp(1j * (sites.azimuth_rad[selected] - azimuths[place])))
    largest = np.abs(differences).max(initial=0.0)
    missed = []
    # Values at distinct azimuths are exact; modes are an approximation for many azimuths.
    if len(azimuths) <= MOST_FOLLOWED and largest <= NEAR_M / nominal_m:
        by_azimuth = np.zeros((len(sites), len(azimuths)))
        by_azimuth[selected, place] = 1.0
        correlations = azimuth_correlations(azimuths, azimuths, nominal_m)
    else:
        modes = np.arange(2.0, MOST_FOLLOWED // 2 + 2)
        first = multiples(sites.azimuth_rad, int(modes[-1]))
        by_azimuth = np.nan_to_num(np.hstack([item[:, 1:] for item in first]))
        correlations = {
            shape: np.diag(np.tile(share, 2))
            for shape, share in mode_shares(modes, nominal_m).items()
        }
        missed = [i for i, item in common if item.shape == "seam"]
    columns = np.hstack([by_azimuth, *values.values()])
    if sites.shared is not None:
        scale = np.abs(sites.shared).max(axis=0)  # 0: no remaining reading has this unknown
        columns = np.hstack([columns, sites.shared / np.where(scale > 0, scale, 1.0)])
    spread, begin = np.zeros((len(common), columns.shape[1], columns.shape[1])), by_azimuth.shape[1]
    for row, (_, item) in enumerate(common):
        if row in values:
            width = values[row].shape[1]
            spread[row, begin : begin + width, begin : begin + width] = np.eye(width)
            begin += width
        else:
            spread[row, : by_azimuth.shape[1], : by_azimuth.shape[1]] = correlations[item.shape]
    return columns, spread, missed


def _group_azimuths(azimuth_rad, near_rad):
    """Return the group (n,) of each azimuth and the mean azimuths of the groups.

    Successive azimuths closer than near_rad belong to a group.
    """
    if not len(azimuth_rad):
        return np.zeros(0, dtype=int), np.zeros(0)
    order = np.argsort(azimuth_rad % FULL_TURN)
    turns = (azimuth_rad % FULL_TURN)[order]
    gap = np.diff(turns, prepend=turns[-1] - FULL_TURN)
    widest = int(np.argmax(gap))
    # Start the turn at its widest gap, so that no group crosses the end of the turn.
    turns = np.roll(turns, -widest)
    turns[len(turns) - widest :] += FULL_TURN
    group = np.cumsum(np.roll(gap, -widest) > near_rad) - 1
    means = np.bincount(group, turns) / np.bincount(group)
    groups_of_azimuths = np.empty(len(order), dtype=int)
    groups_of_azimuths[np.roll(order, -widest)] = group
    return groups_of_azimuths, means % FULL_TURN


def _complement_basis(columns):
    """Return an orthonormal basis (n, m) of the complement of columns (n, p)."""
    basis, r, _ = scipy.linalg.qr(columns, pivoting=True, check_finite=False)
    return basis[:, np.count_nonzero(find_determined(np.diag(r), len(columns))) :]


def _build_part(sites, radius_m, noise_m2, nominal_m, members, common, estimate_noise):
    """Return the `Part` of the likelihood for the readings of a course."""
    columns, spread, missed = common
    common_indices, own_indices = _component_indices(sites)
    azimuth, heights = sites.azimuth_rad[members], sites.heights[members]
    basis = _complement_basis(sites.free_columns(members))

    def project(covariance):
        return basis.T @ covariance @ basis

    if np.ndim(noise_m2) == 2:
        noise = project(noise_m2[np.ix_(members, members)])
    else:
        noise = (basis.T * noise_m2[members]) @ basis
    waves, seams = wave_columns(azimuth), seam_correlations(azimuth, azimuth, nominal_m)
    welds = weld_columns(azimuth, sites.welds_of(sites.course[members[0]]), nominal_m)
    own_covariances, level = [], project(seams)
    for component in (COMPONENTS[i] for i in own_indices):
        if component.shape == "seam":
            over_height = (
                1.0 if component.is_level else component.height_covariance(heights, heights)
            )
            own_covariances.append(level if component.is_level else project(seams * over_height))
        else:
            projected = basis.T @ (
                welds if component.shape == "weld" else component.columns(waves, heights)
            )
            own_covariances.append(projected @ projected.T)
    # The part of common seams that the modes do not represent counts as independent in the course.
    values, smallest = basis.T @ columns[members], SMALLEST * np.eye(basis.shape[1])
    for i in missed:
        represented = values @ spread[common_indices.index(i)] @ values.T
        own_covariances.append(level - represented + smallest)
    own_covariances += [noise] * estimate_noise
    least_noise = LEAST_NOISE_M**2 * np.eye(basis.shape[1])
    return Part(
        basis.T @ radius_m[members],
        np.array(own_covariances),
        least_noise + noise * (not estimate_noise),
        values,
    )


LEAST_FACTOR = 1e-6  # variance ratio: a scatter below a thousandth of the stated sd is rounding


@dataclass(frozen=True)
class SectionNoise:
    """Variance factor of the noise of a section.

    Attributes
    ----------
    factor : float
        Ratio of estimated to stated variance.
    dof : float
        Degrees of freedom of the factor.
    redundancy : float
        Expectation of the square of the estimated noise, in units of the stated variance.
    """

    factor: float
    dof: float
    redundancy: float

    @property
    def upper_p(self):
        """Probability of a larger factor if the stated variance is correct."""
        return float(chdtrc(self.dof, self.dof * self.factor))


def noise_of_sections(field, sections):
    """Return the variance factor of the noise of each section.

    Parameters
    ----------
    field : WallField
    sections : sequence of ndarray of int
        Indices of the readings of each section.

    Returns
    -------
    tuple of SectionNoise
    """
    (lower, _), by_columns, normal = field._factors
    explained, results = field._weighted_residuals, []
    for members in sections:
        noise = field.noise_m2[np.ix_(members, members)]
        root = np.linalg.cholesky(noise + LEAST_NOISE_M**2 * np.eye(len(members)))
        # With N_SS = L L', the symmetric matrix L' P_SS L has the eigenvalues of N_SS P_SS.
        whitened = np.zeros((len(explained), len(members)))
        whitened[members] = root
        whitened = scipy.linalg.solve_triangular(lower, whitened, lower=True, check_finite=False)
        by_free_columns = root.T @ by_columns[members]
        inner = whitened.T @ whitened - by_free_columns @ scipy.linalg.cho_solve(
            normal, by_free_columns.T
        )
        shares = np.clip(np.linalg.eigvalsh(inner), 0.0, 1.0)
        redundancy = shares.sum()
        square = np.sum((root.T @ explained[members]) ** 2)
        results.append(
            SectionNoise(
                factor=max(float(square / redundancy), LEAST_FACTOR),
                dof=float(redundancy**2 / (shares @ shares)),
                redundancy=float(redundancy),
            )
        )
    return tuple(results)


def bartlett(factors, dofs):
    """Test the equality of variances (Bartlett's test).

    Parameters
    ----------
    factors, dofs : array_like, shape (k,)
        Estimated variances, up to a common factor, and their degrees of freedom; k of 2 or more.

    Returns
    -------
    statistic : float
        Distributed as chi-square if the variances are equal.
    dof : int
        k - 1.
    p : float
        Probability of a larger statistic.

    Examples
    --------
    >>> statistic, dof, p = bartlett([1.0, 1.0, 1.0], [10, 20, 30])
    >>> round(statistic, 12), dof, round(p, 12)
    (0.0, 2, 1.0)
    """
    factors, dofs = np.asarray(factors, dtype=float), np.asarray(dofs, dtype=float)
    total, count = dofs.sum(), len(factors)
    pooled = dofs @ factors / total
    statistic = total * np.log(pooled) - dofs @ np.log(factors)
    # Bartlett's second-order correction for few degrees of freedom.
    statistic /= 1 + (np.sum(1 / dofs) - 1 / total) / (3 * (count - 1))
    return float(statistic), count - 1, float(chdtrc(count - 1, statistic))
