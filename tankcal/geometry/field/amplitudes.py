"""How large the components of a wall are, by the restricted likelihood of what was measured.

Readings y = X beta + sum of components + noise; X the radius of each course, and the centre of each
ring of points. With N an orthonormal basis of what X leaves free in a course, N'y is normal with a
covariance

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

from tankcal.geometry.field.components import COMPONENTS, azimuth_correlations, oval_columns

NOISE_MEDIAN_M, NOISE_LOG_SD = 2e-3, 3.0  # of readings without a given standard deviation
LEAST_M, MOST_M = 1e-5, 0.3  # amplitudes that are tried
LEAST_NOISE_M = 1e-6  # what is given as perfect is not quite
SAME_AZIMUTH_RAD = 1e-12
SMALLEST = 1e-8  # of the largest variance of a direction of the common form
MOST_FOLLOWED = 80  # directions of the common form that are followed through all courses
ROUNDING = 1e-11  # of the largest variances, that keeps a covariance positive
MOST_STEPS, SMALL_STEP = 12, 1e-7  # of a logarithm
LOG_STEP = 0.1  # of the differences that give the curvature


@dataclass(frozen=True)
class Sites:
    """Where a wall was measured.

    Attributes
    ----------
    course : ndarray of int, shape (n,)
        From 0 on, each of them with sites.
    ring : ndarray of int, shape (n,)
        Sites that have a centre of their own, all of one course.
    zeta : ndarray, shape (n,)
        Height within the course, -1 at its bottom to +1 at its top.
    azimuth_rad : ndarray, shape (n,)
    leans : ndarray of bool, shape (n,)
        Whether the ring is not level, and its centre moves with the height.
    """

    course: np.ndarray
    ring: np.ndarray
    zeta: np.ndarray
    azimuth_rad: np.ndarray
    leans: np.ndarray

    def __len__(self):
        return len(self.course)

    @property
    def members(self):
        """For each course the indices of its sites."""
        return [np.flatnonzero(self.course == c) for c in range(self.course.max() + 1)]

    def free_columns(self, members):
        """(k, p) derivative of the radii of some sites of a course by what no prior binds.

        Its radius first, then x and y of the centre of each ring, and of its lean.
        """
        azimuth, ring = self.azimuth_rad[members], self.ring[members]
        turn = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
        columns = [np.ones((len(members), 1))]
        for one in np.unique(ring):
            there = turn * (ring == one)[:, None]
            columns.append(there)
            if np.any(self.leans[members] & (ring == one)):
                columns.append(there * self.zeta[members, None])
        return np.hstack(columns)


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
        chosen = [one.kind != "bulge" for one in COMPONENTS]
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
    evidence = _Evidence.of(sites, radius_m, noise_m2, nominal_m, estimate_noise)
    start = evidence.middle
    bounds = [(2 * np.log(LEAST_M), 2 * np.log(MOST_M))] * len(COMPONENTS)
    bounds += [(-20.0, 20.0)] * estimate_noise
    best = scipy.optimize.minimize(
        evidence.misfit, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-8}
    ).x
    for _ in range(2):  # to the very top, so that the order of the readings changes nothing
        covariance = np.linalg.inv(_curvature(evidence, best))
        best = np.clip(_climb(evidence, best, covariance), *np.array(bounds).T)
    count = len(COMPONENTS)
    known = Amplitudes(np.exp(best[:count]), covariance[:count, :count])
    if not estimate_noise:
        return known
    return Amplitudes(
        known.variances_m2, known.log_covariance, float(np.exp(best[-1])), covariance[-1, -1] ** 0.5
    )


def _climb(evidence, best, covariance):
    """Newton's steps with one curvature."""
    for _ in range(MOST_STEPS):
        step = np.clip(-covariance @ evidence.misfit(best)[1] / 2, -LOG_STEP, LOG_STEP)
        best = best + step
        if np.abs(step).max() < SMALL_STEP:
            break
    return best


def _curvature(evidence, best):
    """Of the misfit's half, by differences of its derivative; never below the prior's."""
    slope = evidence.misfit(best)[1]
    rows = [evidence.misfit(best + LOG_STEP * unit)[1] - slope for unit in np.eye(len(best))]
    curvature = np.array(rows) / (2 * LOG_STEP)
    values, vectors = np.linalg.eigh((curvature + curvature.T) / 2)
    return (vectors * np.maximum(values, 1 / evidence.log_sd.max() ** 2)) @ vectors.T


@dataclass(frozen=True)
class _Course:
    """What one course tells, in the coordinates that radius and centre leave free.

    radius (m,), own (q, m, m) covariances at unit variance: of its own components, of what the
    common columns miss, and last of the noise where that is estimated; fixed (m, m) the noise that
    is not; common (m, k) columns of the common components at unit variance
    """

    radius: np.ndarray
    own: np.ndarray
    fixed: np.ndarray
    common: np.ndarray


@dataclass(frozen=True)
class _Evidence:
    """courses; own (q,) and common (k,): component of each covariance and of each column."""

    courses: tuple
    own: np.ndarray
    common: np.ndarray
    middle: np.ndarray
    log_sd: np.ndarray

    @classmethod
    def of(cls, sites, radius_m, noise_m2, nominal_m, estimate_noise):
        columns, missed = _common_columns(sites, nominal_m)
        courses = tuple(
            _course(sites, radius_m, noise_m2, nominal_m, members, columns, missed, estimate_noise)
            for members in sites.members
        )
        own = [i for i, one in enumerate(COMPONENTS) if not one.common] + list(missed)
        common = [i for i, block in columns.items() for _ in range(block.shape[1])]
        middle = 2 * np.log([one.median_m for one in COMPONENTS])
        log_sd = np.array([one.log_sd for one in COMPONENTS])
        if estimate_noise:
            own.append(len(COMPONENTS))
            typical = np.median(np.diag(noise_m2) if np.ndim(noise_m2) == 2 else noise_m2)
            middle = np.append(middle, 2 * np.log(NOISE_MEDIAN_M) - np.log(typical))
            log_sd = np.append(log_sd, NOISE_LOG_SD)
        return cls(courses, np.array(own), np.array(common), middle, log_sd)

    def misfit(self, logs):
        """Doubled negative logarithm of the density but for a constant, and its derivative."""
        variances = np.exp(logs)
        scale = np.sqrt(variances[self.common])
        inner, right, value, solved = np.eye(len(scale)), 0.0, 0.0, []
        for course in self.courses:
            covariance = course.fixed + np.tensordot(variances[self.own], course.own, 1)
            covariance.flat[:: len(covariance) + 1] *= 1 + ROUNDING
            root = np.linalg.cholesky(covariance)
            value += 2 * np.sum(np.log(np.diag(root)))
            inverse = scipy.linalg.solve_triangular(
                root, np.eye(len(root)), lower=True, check_finite=False
            )
            white = inverse @ np.column_stack([course.common * scale, course.radius])
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
            np.add.at(slopes, self.own, np.einsum("qij,ij->q", course.own, outer))
        slopes *= variances
        np.add.at(slopes, self.common, 1.0 - np.diag(spread) - common**2)
        away = (logs - self.middle) / self.log_sd
        return value + away @ away, slopes + 2 * away / self.log_sd


def _common_columns(sites, nominal_m):
    """{component: (n, k) columns of unit variance}, and a list of those that these miss a part of.

    The modes of ovality are few. Of seams B = K_z L_z^-T at some azimuths z; B B' = K where these
    are all that the survey has. Else z are even, and K - B B', never negative, is taken as each
    course's own.
    """
    place, azimuths = distinct_azimuths(sites.azimuth_rad)
    few = len(azimuths) <= MOST_FOLLOWED
    chosen = azimuths if few else np.arange(MOST_FOLLOWED) * 2 * np.pi / MOST_FOLLOWED
    among = azimuth_correlations(chosen, chosen, nominal_m)
    to = azimuth_correlations(azimuths, chosen, nominal_m)
    columns, missed = {}, []
    for i, one in enumerate(COMPONENTS):
        if not one.common:
            continue
        if one.shape == "mean":
            columns[i] = one.height_columns(sites.zeta)
        elif one.shape == "oval" and not few:
            columns[i] = oval_columns(azimuths)[place]
        else:
            values, vectors = np.linalg.eigh(among[one.shape])
            keep = values > SMALLEST * values[-1]
            half = to[one.shape] @ (vectors[:, keep] / np.sqrt(values[keep]))
            columns[i] = half[place]
            if not few:
                missed.append(i)
    return columns, missed


def distinct_azimuths(azimuth_rad):
    """(n,) place of each azimuth among the distinct ones, and these."""
    turns = np.round((np.asarray(azimuth_rad) % (2 * np.pi)) / SAME_AZIMUTH_RAD)
    found, place = np.unique(turns, return_inverse=True)
    return place, found * SAME_AZIMUTH_RAD


def _course(sites, radius_m, noise_m2, nominal_m, members, columns, missed, estimate_noise):
    azimuth, zeta = sites.azimuth_rad[members], sites.zeta[members]
    left = scipy.linalg.null_space(sites.free_columns(members).T)

    def seen(covariance):
        return left.T @ covariance @ left

    if np.ndim(noise_m2) == 2:
        noise = noise_m2[np.ix_(members, members)]
    else:
        noise = np.diag(noise_m2[members])
    least = LEAST_NOISE_M**2 * np.eye(left.shape[1])
    there = azimuth_correlations(azimuth, azimuth, nominal_m)
    own = [
        seen(there[one.shape] * one.height_covariance(zeta, zeta))
        for one in COMPONENTS
        if not one.common
    ]
    own += [
        seen(there[COMPONENTS[i].shape] - columns[i][members] @ columns[i][members].T)
        + 10 * SMALLEST * np.eye(left.shape[1])
        for i in missed
    ]
    own += [seen(noise)] * estimate_noise
    return _Course(
        left.T @ radius_m[members],
        np.array(own),
        least + seen(noise) * (not estimate_noise),
        left.T @ np.hstack([block[members] for block in columns.values()]),
    )
