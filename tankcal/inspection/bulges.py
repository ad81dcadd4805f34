"""What bulges of a bottom along a radial line.

A bulge is what stands above the line of the bottom inside of the break-over point; its radius is
half of its length along the profile. One line sees neither its highest place nor the circle that
fits in it.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from scipy import sparse

from tankcal.adjust import ALPHA, SD_OVER_MEDIAN
from tankcal.inspection.levelling import LEAST_READINGS

LEAST_IN_BULGE = 3  # readings: a narrower bulge is not told from one bad reading
ON_BOTTOM = 3.0  # robust standard deviations: a reading that is farther off is on a bulge
MOST_ENDS = 60  # readings of a profile that lines are laid through
ROUNDING = 1e-24  # of the readings' sum of squares: what rounding leaves of them
SIGNIFICANT = 2.0  # u that a bulge stands off


@dataclass(frozen=True)
class Bulge:
    """What stands above or below the line of the bottom.

    Attributes
    ----------
    radius_m : float
        Of the place, from the tank's centre.
    height_m, u_m : float
        Up positive; standard uncertainty, nan: not known.
    half_length_m : float
        Half of its length along the profile.
    """

    radius_m: float
    height_m: float
    u_m: float
    half_length_m: float


def find_bulge(r, z, sd, height_per_radius=None):
    """The bulge or dent of a profile that is largest against its radius (or highest), or None.

    The bottom's own slope is the line of least absolute deviations of the readings that are on the
    bottom (`on_the_bottom`), which a bulge over less than half of the profile does not move; a
    bulge goes from where the bottom leaves it to where it is back.

    Parameters
    ----------
    r, z : ndarray, shape (n,)
        Rising radii and elevations, m, inside of the break-over point.
    sd : ndarray, shape (n,), or None
    height_per_radius : float, optional
        The limit, a ratio; None: the highest is taken.

    Returns
    -------
    Bulge or None
        None: no three readings in a row are on one side of that line, off it by more than their U.

    Examples
    --------
    >>> r, z = np.arange(8.0), np.array([0.0, 0.0, 0.0, 0.02, 0.03, 0.02, 0.0, 0.0])
    >>> found = find_bulge(r, z, None)
    >>> found.height_m, found.half_length_m
    (0.03, 2.0)
    """
    if len(r) < LEAST_READINGS:
        return None
    flat = on_the_bottom(r, z, sd)
    off = z - _line_of_least_deviations(r, z, flat)
    off[np.abs(off) < 1e-9] = 0.0  # what the solver leaves
    starts = np.flatnonzero(np.diff(np.sign(off), prepend=np.nan))
    found = []
    for i, j in pairwise((*starts, len(r))):
        if j - i < LEAST_IN_BULGE or off[i] == 0:
            continue
        at = i + int(np.argmax(np.abs(off[i:j])))
        beside = r[flat] - r[flat].mean()
        leverage = 1 / len(beside) + (r[at] - r[flat].mean()) ** 2 / np.sum(beside**2)
        u = np.nan if sd is None else float(sd[at] * np.sqrt(1 + np.pi / 2 * leverage))
        if np.isnan(u) or abs(off[at]) > SIGNIFICANT * u:
            half = (_crossing(r, off, j - 1, j) - _crossing(r, off, i, i - 1)) / 2
            found.append(Bulge(float(r[at]), float(off[at]), u, float(half)))
    if height_per_radius is None:
        return max(found, key=lambda one: abs(one.height_m), default=None)
    return max(found, key=lambda one: abs(one.height_m) / one.half_length_m, default=None)


def on_the_bottom(r, z, sd):
    """Which readings of a profile are on the bottom's own line, not on a bulge of it.

    Those near the line of the least median deviation, of all lines through two readings. A line of
    least absolute deviations alone will not do: a bulge at one end of a profile tilts it, even one
    over a third of the readings.

    Parameters
    ----------
    r, z : ndarray, shape (n,)
    sd : ndarray, shape (n,), or None

    Returns
    -------
    ndarray of bool, shape (n,)
        At least half of them.

    References
    ----------
    Rousseeuw P. J. (1984), Least median of squares regression; its scale by Rousseeuw & Leroy
    (1987), Robust regression and outlier detection, 5.1.

    Examples
    --------
    >>> on_the_bottom(np.arange(6.0), np.array([0, 0.01, 0.02, 0.03, 0.09, 0.09]), None).tolist()
    [True, True, True, True, False, False]
    """
    some = np.unique(np.linspace(0, len(r) - 1, min(len(r), MOST_ENDS)).round().astype(int))
    i, j = (some[one] for one in np.triu_indices(len(some), 1))
    slopes = (z[j] - z[i]) / (r[j] - r[i])
    deviations = np.abs(z - z[i, None] - slopes[:, None] * (r - r[i, None]))
    medians = np.median(deviations, axis=1)
    best = int(np.argmin(medians))
    scale = SD_OVER_MEDIAN * (1 + 5 / (len(r) - 2)) * medians[best]
    scale = np.maximum(scale, 0.0 if sd is None else sd)
    return deviations[best] <= np.maximum(ON_BOTTOM * scale, 1e-9)


def beside_a_bulge(r, z, weights, squares, least_radius):
    """Which readings of a profile that bends are beside a bulge or dent of it, or None.

    A bulge is a run of readings inside of the bend that two straight lines need not explain. Of
    all runs that one is taken which is least likely chance, by the F test of a mean shift of each
    of its readings, and only where that is less likely than 0.1 % by the number of runs tried.

    Parameters
    ----------
    r, z, weights : ndarray, shape (n,)
        Rising radii, elevations, inverse standard deviations or ones.
    squares : float
        Weighed sum of squares that the best bent line through all readings leaves.
    least_radius : float
        The lines are to meet there or farther out.

    Returns
    -------
    ndarray of bool, shape (n,), or None
        None: there is no bulge.

    References
    ----------
    Cook R. D. & Weisberg S. (1982), Residuals and influence in regression, 2.2.2: mean shifts,
    with Bonferroni's bound.

    Examples
    --------
    >>> r = np.arange(16.0)
    >>> z = np.maximum(r - 12, 0) * -0.05 + np.where((r > 5) & (r < 9), 0.04, 0.0)
    >>> np.flatnonzero(~beside_a_bulge(r, z, np.ones(16), 0.002, 10.0)).tolist()
    [6, 7, 8]
    """
    count = len(r)
    most = min(count // 2, count - LEAST_READINGS)
    ends = np.unique(np.linspace(0, count, min(count + 1, MOST_ENDS)).round().astype(int))
    i, j = (ends[one] for one in np.triu_indices(len(ends), 1))
    fits = (j - i >= LEAST_IN_BULGE) & (j - i <= most)
    i, j = i[fits, None], j[fits, None]
    outer = np.arange(LEAST_IN_BULGE, count - 1)  # the first reading outside of the bend
    parts = _sums(r, z, weights)
    one, two = _lines(parts[outer] - parts[j] + parts[i]), _lines(parts[-1] - parts[outer])
    with np.errstate(divide="ignore", invalid="ignore"):
        x = (one[0] - two[0]) / (two[1] - one[1]) + r.mean()
    inside = outer - (j - i)  # readings of the inner line
    beyond = r[np.minimum(outer + 1, count - 1)]
    meets = (x >= np.minimum(r[i], r[outer - 2])) & (x <= beyond) & (x >= least_radius)
    allowed = (j <= outer) & (inside >= LEAST_IN_BULGE) & meets
    if not allowed.any() or squares <= ROUNDING * np.sum((weights * z) ** 2):
        return None
    left = np.where(allowed, np.maximum(one[2] + two[2], 1e-9 * squares), np.inf).min(axis=1)
    size, dof = j[:, 0] - i[:, 0], count - (j - i)[:, 0] - 4
    gained = np.maximum(squares - left, 0.0)
    chance = np.where(
        np.isfinite(left), scipy.stats.f.logsf(gained / size / (left / dof), size, dof), 0.0
    )
    best = int(np.lexsort((size, chance))[0])
    if chance[best] > np.log(ALPHA / len(chance)):
        return None
    at = np.arange(count)
    return (at < i[best]) | (at >= j[best])


def _sums(r, z, weights):
    """(n + 1, 6) sums of w2 (1, r, z, rr, rz, zz) over the readings before each, about the mean."""
    r, z = r - r.mean(), z - z.mean()
    columns = np.column_stack([np.ones(len(r)), r, z, r * r, r * z, z * z])
    return np.concatenate([np.zeros((1, 6)), np.cumsum(columns * weights[:, None] ** 2, axis=0)])


def _lines(sums):
    """(level at 0, slope, sum of squares left) of the lines through readings of such sums."""
    w, wr, wz, wrr, wrz, wzz = np.moveaxis(sums, -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        rr, rz, zz = wrr - wr * wr / w, wrz - wr * wz / w, wzz - wz * wz / w
        slope = rz / rr
        return (wz - slope * wr) / w, slope, np.maximum(zz - slope * rz, 0.0)


def _line_of_least_deviations(r, z, flat):
    """(n,) the line with the least sum of absolute deviations from the readings that are flat."""
    count, centre, level = int(flat.sum()), r[flat].mean(), z[flat].mean()
    columns = sparse.csr_array(np.column_stack([np.ones(count), r[flat] - centre]))
    eye = sparse.eye_array(count)
    found = scipy.optimize.linprog(
        np.concatenate([np.zeros(2), np.ones(2 * count)]),
        A_eq=sparse.hstack([columns, eye, -eye]),
        b_eq=z[flat] - level,
        bounds=[(None, None)] * 2 + [(0, None)] * (2 * count),
    )
    return level + found.x[0] + found.x[1] * (r - centre)


def _crossing(r, off, last, beyond):
    """Radius where the departure ends between a reading and the one beyond; the end of the line."""
    if not 0 <= beyond < len(r):
        return r[last]
    share = off[last] / (off[last] - off[beyond])
    return r[last] + share * (r[beyond] - r[last])
