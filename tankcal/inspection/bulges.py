"""Bulges and dents of the bottom along a radial line.

A bulge rises above the line of the bottom, inside of the break-over point. Its radius is half of
its length along the profile. A single profile shows neither the highest place of the bulge nor the
circle inscribed in it.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from scipy import sparse

from tankcal.adjust import ALPHA, SD_OVER_MEDIAN
from tankcal.inspection.levelling import LEAST_READINGS

LEAST_IN_BULGE = 3  # readings; a narrower bulge cannot be distinguished from an outlier
ON_BOTTOM = 3.0  # robust standard deviations; a reading with a larger residual is on a bulge
MOST_ENDS = 60  # largest number of readings that define trial lines and ends of trial bulges
ROUNDING = 1e-24  # rounding error of a sum of squares, as a share of the readings' squares
SIGNIFICANT = 2.0  # least height of a bulge in units of its u


@dataclass(frozen=True)
class Bulge:
    """A bulge or dent in the line of the bottom.

    Attributes
    ----------
    radius_m : float
        Distance of its highest or lowest reading from the tank's centre, m.
    height_m, u_m : float
        Height, positive upwards, and its standard uncertainty, nan if unknown, m.
    half_length_m : float
        Half of its length along the profile, m.
    """

    radius_m: float
    height_m: float
    u_m: float
    half_length_m: float


def find_bulge(r, z, sd, height_per_radius=None):
    """Find the largest bulge or dent of a profile.

    The line of the bottom is the line of least absolute deviations through the readings on the
    bottom (`select_bottom_readings`). A bulge over less than half of the profile does not move this
    line. A bulge extends between two crossings of the profile with this line.

    Parameters
    ----------
    r, z : ndarray, shape (n,)
        Ascending radii and elevations inside of the break-over point, m.
    sd : ndarray, shape (n,), or None
        Standard deviations of the elevations, m; None if unknown.
    height_per_radius : float, optional
        Limit of the height over the half length. If given, the bulge with the largest ratio is
        returned, else the highest bulge.

    Returns
    -------
    Bulge or None
        None if no three consecutive readings on one side of the line deviate from it significantly.

    Examples
    --------
    >>> r, z = np.arange(8.0), np.array([0.0, 0.0, 0.0, 0.02, 0.03, 0.02, 0.0, 0.0])
    >>> bulge = find_bulge(r, z, None)
    >>> bulge.height_m, bulge.half_length_m
    (0.03, 2.0)
    """
    if len(r) < LEAST_READINGS:
        return None
    flat = select_bottom_readings(r, z, sd)
    deviation = z - _line_of_least_deviations(r, z, flat)
    deviation[np.abs(deviation) < 1e-9] = 0.0  # rounding of the solver
    # Runs of readings on one side of the line; each change of sign starts a run.
    starts = np.flatnonzero(np.diff(np.sign(deviation), prepend=np.nan))
    bulges = []
    for i, j in pairwise((*starts, len(r))):
        if j - i < LEAST_IN_BULGE or deviation[i] == 0:
            continue
        place = i + int(np.argmax(np.abs(deviation[i:j])))
        # u of the reading and of the line below it. The variance of a line of least absolute
        # deviations is pi / 2 times the variance of the least-squares line.
        beside = r[flat] - r[flat].mean()
        leverage = 1 / len(beside) + (r[place] - r[flat].mean()) ** 2 / np.sum(beside**2)
        u = np.nan if sd is None else float(sd[place] * np.sqrt(1 + np.pi / 2 * leverage))
        if np.isnan(u) or abs(deviation[place]) > SIGNIFICANT * u:
            half = (_crossing(r, deviation, j - 1, j) - _crossing(r, deviation, i, i - 1)) / 2
            bulges.append(Bulge(float(r[place]), float(deviation[place]), u, float(half)))
    if height_per_radius is None:
        return max(bulges, key=lambda bulge: abs(bulge.height_m), default=None)
    return max(bulges, key=lambda bulge: abs(bulge.height_m) / bulge.half_length_m, default=None)


def select_bottom_readings(r, z, sd):
    """Select the readings of a profile that are on the bottom, not on a bulge.

    Of all lines through two readings, the line with the least median deviation is used. The
    readings near this line are selected. A line of least absolute deviations would not suffice: a
    bulge at one end of a profile tilts it, even if the bulge covers only a third of the readings.

    Parameters
    ----------
    r, z : ndarray, shape (n,)
        Ascending radii and elevations, m.
    sd : ndarray, shape (n,), or None
        Standard deviations of the elevations, m; None if unknown.

    Returns
    -------
    ndarray of bool, shape (n,)
        At least half of the readings are selected.

    References
    ----------
    Rousseeuw P. J. (1984), Least median of squares regression; its scale by Rousseeuw & Leroy
    (1987), Robust regression and outlier detection, 5.1.

    Examples
    --------
    >>> z = np.array([0, 0.01, 0.02, 0.03, 0.09, 0.09])
    >>> select_bottom_readings(np.arange(6.0), z, None).tolist()
    [True, True, True, True, False, False]
    """
    trial = np.unique(np.linspace(0, len(r) - 1, min(len(r), MOST_ENDS)).round().astype(int))
    i, j = (trial[index] for index in np.triu_indices(len(trial), 1))
    slopes = (z[j] - z[i]) / (r[j] - r[i])
    deviations = np.abs(z - z[i, None] - slopes[:, None] * (r - r[i, None]))
    medians = np.median(deviations, axis=1)
    best = int(np.argmin(medians))
    # Robust scale with the correction for small samples, Rousseeuw & Leroy 5.1.
    scale = SD_OVER_MEDIAN * (1 + 5 / (len(r) - 2)) * medians[best]
    scale = np.maximum(scale, 0.0 if sd is None else sd)
    return deviations[best] <= np.maximum(ON_BOTTOM * scale, 1e-9)


def select_beside_bulge(r, z, weights, squares, least_radius):
    """Select the readings of a bent profile that are outside of its bulge or dent.

    A bulge is a run of readings inside of the bend that deviates from two straight lines. Each run
    is tested by the F test of a mean shift of each of its readings. The most significant run is the
    bulge, if its significance is below 0.1 % divided by the number of runs tested.

    Parameters
    ----------
    r, z, weights : ndarray, shape (n,)
        Ascending radii, elevations, and inverse standard deviations or ones.
    squares : float
        Weighted sum of squared residuals of the best bent line through all readings.
    least_radius : float
        Smallest radius at which the two lines may meet.

    Returns
    -------
    ndarray of bool, shape (n,), or None
        None if there is no bulge.

    References
    ----------
    Cook R. D. & Weisberg S. (1982), Residuals and influence in regression, 2.2.2: mean shifts,
    with Bonferroni's bound.

    Examples
    --------
    >>> r = np.arange(16.0)
    >>> z = np.maximum(r - 12, 0) * -0.05 + np.where((r > 5) & (r < 9), 0.04, 0.0)
    >>> np.flatnonzero(~select_beside_bulge(r, z, np.ones(16), 0.002, 10.0)).tolist()
    [6, 7, 8]
    """
    count = len(r)
    most = min(count // 2, count - LEAST_READINGS)
    ends = np.unique(np.linspace(0, count, min(count + 1, MOST_ENDS)).round().astype(int))
    i, j = (ends[inner] for inner in np.triu_indices(len(ends), 1))
    fits = (j - i >= LEAST_IN_BULGE) & (j - i <= most)
    i, j = i[fits, None], j[fits, None]
    outer = np.arange(LEAST_IN_BULGE, count - 1)  # the first reading outside of the bend
    # Prefix sums give each line without a fit of its own: the inner line without the run i to j,
    # and the outer line.
    parts = _sums(r, z, weights)
    inner, outer_line = _lines(parts[outer] - parts[j] + parts[i]), _lines(parts[-1] - parts[outer])
    with np.errstate(divide="ignore", invalid="ignore"):
        x = (inner[0] - outer_line[0]) / (outer_line[1] - inner[1]) + r.mean()
    inside = outer - (j - i)  # readings of the inner line
    beyond = r[np.minimum(outer + 1, count - 1)]
    meets = (x >= np.minimum(r[i], r[outer - 2])) & (x <= beyond) & (x >= least_radius)
    allowed = (j <= outer) & (inside >= LEAST_IN_BULGE) & meets
    if not allowed.any() or squares <= ROUNDING * np.sum((weights * z) ** 2):
        return None
    remaining = np.where(allowed, np.maximum(inner[2] + outer_line[2], 1e-9 * squares), np.inf).min(
        axis=1
    )
    size, dof = j[:, 0] - i[:, 0], count - (j - i)[:, 0] - 4
    gained = np.maximum(squares - remaining, 0.0)
    chance = np.where(
        np.isfinite(remaining),
        scipy.stats.f.logsf(gained / size / (remaining / dof), size, dof),
        0.0,
    )
    best = int(np.lexsort((size, chance))[0])
    # Bonferroni's bound for the number of runs tested.
    if chance[best] > np.log(ALPHA / len(chance)):
        return None
    at = np.arange(count)
    return (at < i[best]) | (at >= j[best])


def _sums(r, z, weights):
    """Prefix sums (n + 1, 6) of w^2 (1, r, z, rr, rz, zz), with r and z about their means."""
    r, z = r - r.mean(), z - z.mean()
    columns = np.column_stack([np.ones(len(r)), r, z, r * r, r * z, z * z])
    return np.concatenate([np.zeros((1, 6)), np.cumsum(columns * weights[:, None] ** 2, axis=0)])


def _lines(sums):
    """Level at 0, slope and residual sum of squares of lines, from differences of `_sums`."""
    w, wr, wz, wrr, wrz, wzz = np.moveaxis(sums, -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        rr, rz, zz = wrr - wr * wr / w, wrz - wr * wz / w, wzz - wz * wz / w
        slope = rz / rr
        return (wz - slope * wr) / w, slope, np.maximum(zz - slope * rz, 0.0)


def _line_of_least_deviations(r, z, flat):
    """Elevations (n,) of the line of least absolute deviations through the readings `flat`."""
    count, centre, level = int(flat.sum()), r[flat].mean(), z[flat].mean()
    columns = sparse.csr_array(np.column_stack([np.ones(count), r[flat] - centre]))
    # Linear program: each residual is the difference of two non-negative unknowns, of least sum.
    eye = sparse.eye_array(count)
    solution = scipy.optimize.linprog(
        np.concatenate([np.zeros(2), np.ones(2 * count)]),
        A_eq=sparse.hstack([columns, eye, -eye]),
        b_eq=z[flat] - level,
        bounds=[(None, None)] * 2 + [(0, None)] * (2 * count),
    )
    return level + solution.x[0] + solution.x[1] * (r - centre)


def _crossing(r, deviation, last, beyond):
    """Radius of the zero of the deviation between two readings, or the end of the profile."""
    if not 0 <= beyond < len(r):
        return r[last]
    share = deviation[last] / (deviation[last] - deviation[beyond])
    return r[last] + share * (r[beyond] - r[last])
