"""What the readings of a wall tell of the amplitudes of its components: their likelihood.

Readings y = X beta + sum of components + noise; X the radius of each course, and the centre of each
ring of points. With N an orthonormal basis of what X leaves free in a course, N'y is one part of
the likelihood; what is common to all courses are values at the azimuths that the survey has, and at
the heights of the bulge.
"""

import numpy as np
import scipy.linalg

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
from tankcal.geometry.field.likelihood import LEAST_NOISE_M, Likelihood, Part, prior_of
from tankcal.geometry.field.sites import free_design
from tankcal.geometry.form import multiples
from tankcal.geometry.outlines import FULL_TURN

SMALLEST = 1e-8  # of a variance: what is left of a covariance that is followed is not quite zero
NEAR_M = 0.02  # along the arc, between azimuths that count as one for the common form
WIDE_M = 1.0  # of a shared unknown that no prior binds, beside its first estimate
MOST_FOLLOWED = 80  # values of the common form that are followed through all courses
BULGES = np.array([one.shape == "mean" and one.orders != "joints" for one in COMPONENTS])
MOST_ASKED = 200  # readings of a course, whose covariance is inverted at every step of a search


def likelihood_of(sites, radius_m, noise_m2, nominal_m, estimate_noise):
    """`Likelihood` of radii at sites, as `amplitudes.estimate_amplitudes` takes them.

    Of a course with more than `MOST_ASKED` readings a part of them is asked.
    """
    asked = _asked(sites)
    if len(asked) < len(sites):
        there = np.ix_(asked, asked) if np.ndim(noise_m2) == 2 else asked
        sites, radius_m, noise_m2 = sites.take(asked), radius_m[asked], noise_m2[there]
    common = _common_values(sites, nominal_m)
    if sites.shared is not None:
        radius_m = radius_m - _by_free(sites, radius_m)
    parts = tuple(
        _part(sites, radius_m, noise_m2, nominal_m, members, common, estimate_noise)
        for members in sites.members
    )
    columns, spread, missed = common
    wide = np.zeros(columns.shape[1])
    if sites.shared is not None:
        wide[-sites.shared.shape[1] :] = WIDE_M**2
    shared, own = _shown(sites)
    own = own + missed + [len(COMPONENTS)] * estimate_noise
    variances = np.diag(noise_m2) if np.ndim(noise_m2) == 2 else noise_m2
    middle, *others = prior_of(
        COMPONENTS, log_covariance(sites.smoothed), variances if estimate_noise else None
    )
    middle[: len(COMPONENTS)][BULGES] += 2 * np.log(sites.bulge_scale)  # logarithms of variances
    return Likelihood(parts, np.array(own), np.array(shared), spread, wide, middle, *others)


def _asked(sites):
    """Indices of the readings that are asked: of a course with many some pairs of neighbours.

    Pairs, for what near points have in common tells the form from their noise.
    """
    found = []
    for members in sites.members:
        every = -(-len(members) // MOST_ASKED)
        keys = sites.zeta[members], sites.azimuth_rad[members], sites.ring[members]
        found.append(members[np.lexsort(keys)][np.arange(len(members)) // 2 % every == 0])
    return np.sort(np.concatenate(found))


def _by_free(sites, radius_m):
    """(n,) of the radii what the unknowns without a prior alone make of them."""
    design = free_design(sites)[0]
    return design @ np.linalg.lstsq(design, radius_m, rcond=None)[0]


def _shown(sites):
    """Indices of the common components and of those of each course: of welds where any is known."""
    used = [i for i, one in enumerate(COMPONENTS) if sites.welds_rad or one.shape != "weld"]
    return [i for i in used if COMPONENTS[i].common], [i for i in used if not COMPONENTS[i].common]


def _common_values(sites, nominal_m):
    """(n, k) derivative of the radii by the values of the common components, (p, k, k) covariances
    of these, and a list of the components that they miss a part of.

    Values are those at the azimuths that the survey has, or, where these are many, the cosines and
    sines of the first modes: the rest of the seams is then taken as each course's own. Last come
    the values of the heights, the modes of settlement, the peak of all welds, and what courses
    share without a prior.
    """
    common = [(i, COMPONENTS[i]) for i in _shown(sites)[0]]
    waves, heights = wave_columns(sites.azimuth_rad), sites.heights
    welds = np.zeros((len(sites), 1))
    for members, there in zip(sites.members, sites.welds_at(nominal_m), strict=True):
        welds[members, 0] = there.sum(axis=1)
    values = {
        row: welds if one.shape == "weld" else one.columns(waves, heights)
        for row, (_, one) in enumerate(common)
        if one.shape in ("mean", "settled", "weld")
    }
    there = np.isfinite(sites.azimuth_rad)
    place, azimuths = _gathered(sites.azimuth_rad[there], NEAR_M / nominal_m)
    apart = np.angle(np.exp(1j * (sites.azimuth_rad[there] - azimuths[place])))
    away = np.abs(apart).max(initial=0.0)
    missed = []
    if len(azimuths) <= MOST_FOLLOWED and away <= NEAR_M / nominal_m:
        around = np.zeros((len(sites), len(azimuths)))
        around[there, place] = 1.0
        along = azimuth_correlations(azimuths, azimuths, nominal_m)
    else:
        modes = np.arange(2.0, MOST_FOLLOWED // 2 + 2)
        first = multiples(sites.azimuth_rad, int(modes[-1]))
        around = np.nan_to_num(np.hstack([one[:, 1:] for one in first]))
        along = {
            shape: np.diag(np.tile(share, 2))
            for shape, share in mode_shares(modes, nominal_m).items()
        }
        missed = [i for i, one in common if one.shape == "seam"]
    columns = np.hstack([around, *values.values()])
    if sites.shared is not None:
        most = np.abs(sites.shared).max(axis=0)  # 0: of no reading that is left
        columns = np.hstack([columns, sites.shared / np.where(most > 0, most, 1.0)])
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
    if not len(azimuth_rad):
        return np.zeros(0, dtype=int), np.zeros(0)
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


def _left_free(columns):
    """(n, m) orthonormal basis of what columns (n, p) leave free."""
    basis, r, _ = scipy.linalg.qr(columns, pivoting=True, check_finite=False)
    return basis[:, np.count_nonzero(find_determined(np.diag(r), len(columns))) :]


def _part(sites, radius_m, noise_m2, nominal_m, members, common, estimate_noise):
    columns, spread, missed = common
    common_ones, own_ones = _shown(sites)
    azimuth, heights = sites.azimuth_rad[members], sites.heights[members]
    left = _left_free(sites.free_columns(members))

    def seen(covariance):
        return left.T @ covariance @ left

    if np.ndim(noise_m2) == 2:
        noise = seen(noise_m2[np.ix_(members, members)])
    else:
        noise = (left.T * noise_m2[members]) @ left
    waves, seams = wave_columns(azimuth), seam_correlations(azimuth, azimuth, nominal_m)
    welds = weld_columns(azimuth, sites.welds_of(sites.course[members[0]]), nominal_m)
    own, level = [], seen(seams)
    for one in (COMPONENTS[i] for i in own_ones):
        if one.shape == "seam":
            up = 1.0 if one.is_level else one.height_covariance(heights, heights)
            own.append(level if one.is_level else seen(seams * up))
        else:
            there = left.T @ (welds if one.shape == "weld" else one.columns(waves, heights))
            own.append(there @ there.T)
    values, smallest = left.T @ columns[members], SMALLEST * np.eye(left.shape[1])
    for i in missed:
        followed = values @ spread[common_ones.index(i)] @ values.T
        own.append(level - followed + smallest)
    own += [noise] * estimate_noise
    least = LEAST_NOISE_M**2 * np.eye(left.shape[1])
    return Part(
        left.T @ radius_m[members],
        np.array(own),
        least + noise * (not estimate_noise),
        values,
    )
