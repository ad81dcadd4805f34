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

from dataclasses import dataclass, fields, replace

import numpy as np
import scipy.linalg
import scipy.optimize

from tankcal.geometry.field.components import (
    COMPONENTS,
    azimuth_correlations,
    mode_shares,
    weld_columns,
)
from tankcal.geometry.outlines import FULL_TURN

NOISE_MEDIAN_M, NOISE_LOG_SD = 2e-3, 3.0  # of readings without a given standard deviation
LEAST_M, MOST_M = 1e-5, 0.3  # amplitudes that are tried
LEAST_NOISE_M = 1e-6  # what is given as perfect is not quite
SAME_AZIMUTH_RAD = 1e-12
SMALLEST = 1e-8  # of a variance: what is left of a covariance that is followed is not quite zero
NEAR_M = 0.02  # along the arc, between azimuths that count as one for the common form
MOST_FOLLOWED = 80  # values of the common form that are followed through all courses
ROUNDING = 1e-11  # of the largest variances, that keeps a covariance positive
ROUGH, FINE = 1e-5, 1e-8  # relative change of the likelihood that ends its search
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
    welds_rad : tuple of ndarray
        Azimuths of the vertical welds of each course; (): not known.
    """

    course: np.ndarray
    ring: np.ndarray
    zeta: np.ndarray
    azimuth_rad: np.ndarray
    leans: np.ndarray
    welds_rad: tuple = ()

    def __len__(self):
        return len(self.course)

    def take(self, chosen):
        """Those of the sites that are chosen."""
        given = {one.name: getattr(self, one.name) for one in fields(self)}
        kept = {name: value[chosen] for name, value in given.items() if name != "welds_rad"}
        return replace(self, **kept)

    def welds_of(self, course):
        """Azimuths of the vertical welds of a course."""
        return self.welds_rad[course] if self.welds_rad else np.zeros(0)

    def welds_at(self, nominal_m):
        """For each course (k, w) what a peak of one at each of its welds makes of its radii."""
        return [
            weld_columns(self.azimuth_rad[members], self.welds_of(course), nominal_m)
            for course, members in enumerate(self.members)
        ]

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


def free_design(sites):
    """(n, p) derivative of the radii by what no prior binds, and the columns of the radii."""
    blocks = [(members, sites.free_columns(members)) for members in sites.members]
    starts = np.cumsum([0, *(block.shape[1] for _, block in blocks)])
    design = np.zeros((len(sites), starts[-1]))
    for start, (members, block) in zip(starts, blocks, strict=False):
        design[members, start : start + block.shape[1]] = block
    return design, starts[:-1]


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
    evidence = _Evidence.of(sites, radius_m, noise_m2, nominal_m, estimate_noise)
    best, bounds = _likely(evidence, FINE), evidence.bounds
    for _ in range(2):  # to the very top, so that the order of the readings changes nothing
        covariance = np.linalg.inv(_curvature(evidence, best))
        best = np.clip(_climb(evidence, best, covariance), *bounds.T)
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
    evidence = _Evidence.of(sites, radius_m, variance_m2, nominal_m, True)
    best = np.exp(_likely(evidence, ROUGH))
    return best[:-1], float(best[-1])


def _likely(evidence, tolerance):
    """Logarithms near the most likely."""
    return scipy.optimize.minimize(
        evidence.misfit,
        evidence.middle,
        jac=True,
        method="L-BFGS-B",
        bounds=evidence.bounds,
        options={"ftol": tolerance},
    ).x


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

    radius (m,), own (q, m, m) covariances at unit variance: of its own components, of what is
    missed of common ones, and last of the noise where that is estimated; fixed (m, m) the noise
    that is not; values (m, k) derivative of the radii by the values of the common components
    """

    radius: np.ndarray
    own: np.ndarray
    fixed: np.ndarray
    values: np.ndarray


@dataclass(frozen=True)
class _Evidence:
    """courses; own (q,) and common (p,): component of each covariance of a course, and of each of
    `spread` (p, k, k), those of the common values at unit variance.
    """

    courses: tuple
    own: np.ndarray
    common: np.ndarray
    spread: np.ndarray
    middle: np.ndarray
    log_sd: np.ndarray

    @classmethod
    def of(cls, sites, radius_m, noise_m2, nominal_m, estimate_noise):
        common = _common_values(sites, nominal_m)
        courses = tuple(
            _course(sites, radius_m, noise_m2, nominal_m, members, common, estimate_noise)
            for members in sites.members
        )
        _, spread, missed = common
        own = [i for i, one in enumerate(COMPONENTS) if not one.common] + missed
        shared = [i for i, one in enumerate(COMPONENTS) if one.common]
        middle = 2 * np.log([one.median_m for one in COMPONENTS])
        log_sd = np.array([one.log_sd for one in COMPONENTS])
        if estimate_noise:
            own.append(len(COMPONENTS))
            typical = np.median(np.diag(noise_m2) if np.ndim(noise_m2) == 2 else noise_m2)
            middle = np.append(middle, 2 * np.log(NOISE_MEDIAN_M) - np.log(typical))
            log_sd = np.append(log_sd, NOISE_LOG_SD)
        return cls(courses, np.array(own), np.array(shared), spread, middle, log_sd)

    @property
    def bounds(self):
        """(parameters, 2) of the logarithms."""
        bounds = np.tile([-20.0, 20.0], (len(self.middle), 1))
        bounds[: len(COMPONENTS)] = 2 * np.log([LEAST_M, MOST_M])
        return bounds

    def misfit(self, logs):
        """Doubled negative logarithm of the density but for a constant, and its derivative.

        With B the covariance of a course's own, E its `values`, C that of the common values,
        N = sum E' B^-1 E and r = sum E' B^-1 y,

            S = (C^-1 + N)^-1,  y' V^-1 y = sum y' B^-1 y - r' S r,
            log |V| = sum log |B| + log |I + N C|.
        """
        variances = np.exp(logs)
        before = _rounded(np.tensordot(variances[self.common], self.spread, 1))
        told, value, solved = 0.0, 0.0, []
        for course in self.courses:
            covariance = _rounded(course.fixed + np.tensordot(variances[self.own], course.own, 1))
            root, inverse = invert(covariance)
            both = np.column_stack([course.values, course.radius])
            across = inverse @ both
            told = told + both.T @ across
            value += 2 * np.sum(np.log(np.diag(root)))
            solved.append((inverse, across))
        normal, right = told[:-1, :-1], told[:-1, -1]
        half = np.linalg.cholesky(before)
        root, inverse = invert(np.eye(len(half)) + half.T @ normal @ half)
        spread = half @ inverse @ half.T
        common = spread @ right
        value += told[-1, -1] - right @ common + 2 * np.sum(np.log(np.diag(root)))
        slopes = np.zeros(len(logs))
        for course, (inverse, across) in zip(self.courses, solved, strict=True):
            left = across[:, -1] - across[:, :-1] @ common
            outer = inverse - across[:, :-1] @ spread @ across[:, :-1].T
            outer -= np.outer(left, left)
            np.add.at(slopes, self.own, np.tensordot(course.own, outer, 2))
        left = right - normal @ common
        outer = normal - normal @ spread @ normal - np.outer(left, left)
        np.add.at(slopes, self.common, np.tensordot(self.spread, outer, 2))
        slopes *= variances
        away = (logs - self.middle) / self.log_sd
        return value + away @ away, slopes + 2 * away / self.log_sd


def _rounded(covariance):
    """The covariance, positive in spite of rounding."""
    covariance.flat[:: len(covariance) + 1] *= 1 + ROUNDING
    return covariance


def invert(covariance):
    """Cholesky factor and inverse of a covariance."""
    root = np.linalg.cholesky(covariance)
    inverse = scipy.linalg.lapack.dpotri(root, lower=True)[0]
    whole = inverse + inverse.T  # the upper half of `root` is zero, and of its inverse
    whole.flat[:: len(whole) + 1] /= 2
    return root, whole


def _common_values(sites, nominal_m):
    """(n, k) derivative of the radii by the values of the common components, (p, k, k) covariances
    of these, and a list of the components that they miss a part of.

    Values are those at the azimuths that the survey has, or, where these are many, the cosines and
    sines of the first modes: the rest of the seams is then taken as each course's own. Last come
    the values of the heights, and the peak of all welds.
    """
    common = [(i, one) for i, one in enumerate(COMPONENTS) if one.common]
    welds = np.zeros((len(sites), 1))
    for members, there in zip(sites.members, sites.welds_at(nominal_m), strict=True):
        welds[members, 0] = there.sum(axis=1)
    values = {
        row: welds if one.shape == "weld" else one.height_columns(sites.zeta)
        for row, (_, one) in enumerate(common)
        if one.shape in ("mean", "weld")
    }
    place, azimuths = _gathered(sites.azimuth_rad, NEAR_M / nominal_m)
    away = np.abs(np.angle(np.exp(1j * (sites.azimuth_rad - azimuths[place])))).max()
    missed = []
    if len(azimuths) <= MOST_FOLLOWED and away <= NEAR_M / nominal_m:
        around = np.eye(len(azimuths))[place]
        along = azimuth_correlations(azimuths, azimuths, nominal_m)
    else:
        modes = np.arange(2.0, MOST_FOLLOWED // 2 + 2)
        angles = np.outer(sites.azimuth_rad, modes)
        around = np.hstack([np.cos(angles), np.sin(angles)])
        along = {
            shape: np.diag(np.tile(share, 2))
            for shape, share in mode_shares(modes, nominal_m).items()
        }
        missed = [i for i, one in common if one.shape == "seam"]
    columns = np.hstack([around, *values.values()])
    spread, used = np.zeros((len(common), columns.shape[1], columns.shape[1])), around.shape[1]
    for row, (_, one) in enumerate(common):
        if row in values:
            width = values[row].shape[1]
            spread[row, used : used + width, used : used + width] = np.eye(width)
            used += width
        else:
            spread[row, : around.shape[1], : around.shape[1]] = along[one.shape]
    return columns, spread, missed


def _gathered(azimuth_rad, near_rad):
    """(n,) place of each azimuth among the means of those that follow each other that near."""
    order = np.argsort(azimuth_rad % FULL_TURN)
    around = (azimuth_rad % FULL_TURN)[order]
    gap = np.diff(around, prepend=around[-1] - FULL_TURN)
    start = int(np.argmax(gap))
    around = np.roll(around, -start)
    around[len(around) - start :] += FULL_TURN
    group = np.cumsum(np.roll(gap, -start) > near_rad) - 1
    means = np.bincount(group, around) / np.bincount(group)
    place = np.empty(len(order), dtype=int)
    place[np.roll(order, -start)] = group
    return place, means % FULL_TURN


def distinct_azimuths(azimuth_rad):
    """(n,) place of each azimuth among the distinct ones, and these."""
    turns = np.round((np.asarray(azimuth_rad) % FULL_TURN) / SAME_AZIMUTH_RAD)
    found, place = np.unique(turns, return_inverse=True)
    return place, found * SAME_AZIMUTH_RAD


def _course(sites, radius_m, noise_m2, nominal_m, members, common, estimate_noise):
    columns, spread, missed = common
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
    welds = weld_columns(azimuth, sites.welds_of(sites.course[members[0]]), nominal_m)
    there["weld"] = welds @ welds.T
    own = [
        seen(there[one.shape] * one.height_covariance(zeta, zeta))
        for one in COMPONENTS
        if not one.common
    ]
    for i in missed:
        index = [one.common for one in COMPONENTS[:i]].count(True)
        followed = columns[members] @ spread[index] @ columns[members].T
        rest = there[COMPONENTS[i].shape] - followed
        own.append(seen(rest) + SMALLEST * np.eye(left.shape[1]))
    own += [seen(noise)] * estimate_noise
    return _Course(
        left.T @ radius_m[members],
        np.array(own),
        least + seen(noise) * (not estimate_noise),
        left.T @ columns[members],
    )
