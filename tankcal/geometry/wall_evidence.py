"""How large the components of a wall are, by the restricted likelihood of what was measured.

Readings y = X beta + sum of components + noise; X the radius and the centre of each course. With N
an orthonormal basis of what X leaves free in a course, N'y is normal with a covariance

    D_c + U_c L L' U_c'

of its own (noise and the components of the course) and of what is common to all courses (their
values at the azimuths that the survey has, and the bulge), and each logarithm of a variance is
normal beforehand. The amplitudes are those of the highest density; the curvature there is how well
they are known.

Source: Patterson & Thompson 1971 (restricted maximum likelihood).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.optimize

from tankcal.geometry.wall_prior import COMPONENTS, azimuth_correlations, legendre

NOISE_MEDIAN_M, NOISE_LOG_SD = 2e-3, 3.0  # of readings without a given standard deviation
LEAST_M, MOST_M = 1e-5, 0.3  # amplitudes that are tried
LEAST_NOISE_M = 1e-6  # what is given as perfect is not quite
SAME_AZIMUTH_RAD = 1e-9
LOG_STEP = 0.2  # of the differences that give the curvature


@dataclass(frozen=True)
class Sites:
    """Where a wall was measured: course (n,) index, zeta (n,), azimuth_rad (n,)."""

    course: np.ndarray
    zeta: np.ndarray
    azimuth_rad: np.ndarray

    def __len__(self):
        return len(self.course)


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
    evidence = _Evidence.of(sites, radius_m, noise_m2, nominal_m, estimate_noise)
    start = evidence.middle
    bounds = [(2 * np.log(LEAST_M), 2 * np.log(MOST_M))] * len(COMPONENTS)
    bounds += [(-20.0, 20.0)] * estimate_noise
    best = scipy.optimize.minimize(
        evidence.misfit, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-7}
    ).x
    covariance = np.linalg.inv(_curvature(evidence, best))
    count = len(COMPONENTS)
    known = Amplitudes(np.exp(best[:count]), covariance[:count, :count])
    if not estimate_noise:
        return known
    return Amplitudes(
        known.variances_m2, known.log_covariance, float(np.exp(best[-1])), covariance[-1, -1] ** 0.5
    )


def _curvature(evidence, best):
    """Of the misfit's half, by central differences of its derivative; never below the prior's."""
    count = len(best)
    steps = LOG_STEP * np.eye(count)
    rows = [evidence.misfit(best + s)[1] - evidence.misfit(best - s)[1] for s in steps]
    curvature = np.array(rows) / (4 * LOG_STEP)
    values, vectors = np.linalg.eigh((curvature + curvature.T) / 2)
    return (vectors * np.maximum(values, 1 / evidence.log_sd.max() ** 2)) @ vectors.T


@dataclass(frozen=True)
class _Course:
    """What one course tells, in the coordinates that radius and centre leave free.

    radius (m,), own (q, m, m) covariances of its own components at unit variance, last the noise
    where that is estimated; fixed (m, m) what is not; waves (m, k) its places among the common
    azimuths; bulge (m, 7) Legendre polynomials
    """

    radius: np.ndarray
    own: np.ndarray
    fixed: np.ndarray
    waves: np.ndarray
    bulge: np.ndarray


@dataclass(frozen=True)
class _Evidence:
    courses: tuple
    common: dict  # component: (k, k) covariance at the common azimuths
    middle: np.ndarray
    log_sd: np.ndarray
    estimate_noise: bool

    @classmethod
    def of(cls, sites, radius_m, noise_m2, nominal_m, estimate_noise):
        place, azimuths = distinct_azimuths(sites.azimuth_rad)
        courses = tuple(
            _course(sites, radius_m, noise_m2, nominal_m, members, place, azimuths, estimate_noise)
            for members in (np.flatnonzero(sites.course == c) for c in np.unique(sites.course))
        )
        there = azimuth_correlations(azimuths, azimuths, nominal_m)
        common = {
            i: there[one.shape] for i, one in enumerate(COMPONENTS) if one.common and one.shape != "mean"
        }
        middle = 2 * np.log([one.median_m for one in COMPONENTS])
        log_sd = np.array([one.log_sd for one in COMPONENTS])
        if estimate_noise:
            typical = np.median(np.diag(noise_m2) if np.ndim(noise_m2) == 2 else noise_m2)
            middle = np.append(middle, 2 * np.log(NOISE_MEDIAN_M) - np.log(typical))
            log_sd = np.append(log_sd, NOISE_LOG_SD)
        return cls(courses, common, middle, log_sd, estimate_noise)

    def misfit(self, logs):
        """Doubled negative logarithm of the density but for a constant, and its derivative."""
        variances = np.exp(logs)
        own = [i for i, one in enumerate(COMPONENTS) if not one.common]
        own += [len(COMPONENTS)] * self.estimate_noise
        bulges = [i for i, one in enumerate(COMPONENTS) if one.common and one.shape == "mean"]
        count = len(next(iter(self.common.values())))
        waves = sum(variances[i] * one for i, one in self.common.items())
        factor = np.linalg.cholesky(waves + 1e-9 * waves[0, 0] * np.eye(count))
        rises = np.sqrt(sum(variances[i] * COMPONENTS[i].height_weights() for i in bulges))
        inner, right, value, solved = np.eye(count + len(rises)), 0.0, 0.0, []
        for course in self.courses:
            covariance = course.fixed + np.tensordot(variances[own], course.own, 1)
            root = np.linalg.cholesky(covariance)
            value += 2 * np.sum(np.log(np.diag(root)))
            inverse = scipy.linalg.solve_triangular(
                root, np.eye(len(root)), lower=True, check_finite=False
            )
            common = np.hstack([course.waves @ factor, course.bulge * rises])
            white = inverse @ np.column_stack([common, course.radius])
            inner += white[:, :-1].T @ white[:, :-1]
            right = right + white[:, :-1].T @ white[:, -1]
            value += white[:, -1] @ white[:, -1]
            solved.append((inverse, white))
        root = np.linalg.cholesky(inner)
        value += 2 * np.sum(np.log(np.diag(root)))
        spread = scipy.linalg.cho_solve((root, True), np.eye(len(root)), check_finite=False)
        common = spread @ right
        value -= right @ common
        slopes = np.zeros(len(logs))
        for course, (inverse, white) in zip(self.courses, solved, strict=True):
            across = inverse.T @ white
            left = across[:, -1] - across[:, :-1] @ common
            outer = inverse.T @ inverse - across[:, :-1] @ spread @ across[:, :-1].T
            outer -= left[:, None] * left
            slopes[own] += variances[own] * np.einsum("qij,ij->q", course.own, outer)
        outer = np.eye(len(spread)) - spread - common[:, None] * common
        inverse = scipy.linalg.solve_triangular(factor, np.eye(count), lower=True)
        for i, one in self.common.items():
            within = inverse.T @ outer[:count, :count] @ inverse
            slopes[i] += variances[i] * np.sum(within * one)
        share = np.diag(outer)[count:]
        for i in bulges:
            part = variances[i] * COMPONENTS[i].height_weights()
            slopes[i] += np.sum(share * np.divide(part, rises**2, where=rises > 0, out=0 * part))
        away = (logs - self.middle) / self.log_sd
        return value + away @ away, slopes + 2 * away / self.log_sd


def distinct_azimuths(azimuth_rad):
    """(n,) place of each azimuth among the distinct ones, and these."""
    turns = np.round((np.asarray(azimuth_rad) % (2 * np.pi)) / SAME_AZIMUTH_RAD)
    found, place = np.unique(turns, return_inverse=True)
    return place, found * SAME_AZIMUTH_RAD


def free_of_course(azimuth_rad):
    """(n, 3) columns of what is free in a course: radius and centre."""
    return np.column_stack([np.ones(len(azimuth_rad)), np.sin(azimuth_rad), np.cos(azimuth_rad)])


def _course(sites, radius_m, noise_m2, nominal_m, members, place, azimuths, estimate_noise):
    azimuth, zeta = sites.azimuth_rad[members], sites.zeta[members]
    left = scipy.linalg.null_space(free_of_course(azimuth).T)

    def seen(covariance):
        return left.T @ covariance @ left

    noise = noise_m2[np.ix_(members, members)] if np.ndim(noise_m2) == 2 else np.diag(noise_m2[members])
    noise = noise + LEAST_NOISE_M**2 * np.eye(len(members))
    there = azimuth_correlations(azimuth, azimuth, nominal_m)
    own = [
        seen(there[one.shape] * one.height_covariance(zeta, zeta))
        for one in COMPONENTS
        if not one.common
    ]
    own += [seen(noise)] * estimate_noise
    waves = np.zeros((len(members), len(azimuths)))
    waves[np.arange(len(members)), place[members]] = 1.0
    return _Course(
        left.T @ radius_m[members],
        np.array(own),
        seen(noise) * (not estimate_noise),
        left.T @ waves,
        left.T @ legendre(zeta),
    )
