"""What a tape round a wall, or its tangents, measure: its convex hull, which no circle of it has.

A circle of the perimeter P has a larger area than the wall A that the tape lies on:

    excess = P^2 / (4 pi A) - 1 = (1 / (2 rho^2)) sum over k >= 2 of (k^2 - 1) c_k^2

to the second order in the waves c_k of its outline, and less where it bridges a valley. How large
the waves are somebody has to declare; how they are spread over k is what `components` say of walls.

A tangent whose normal has the azimuth f stands as far from the centre as the hull does there,

    p(f) = R(f) + R'(f)^2 / (2 R) + ...  where the wall is convex, and farther out over a valley.
"""

from functools import cache

import numpy as np
from scipy.spatial import ConvexHull

from tankcal.geometry.field.components import COMPONENTS, mode_shares
from tankcal.geometry.outlines import FULL_TURN

SHORTEST_WAVE_M = 0.2  # along the arc: plates do not bend more sharply
DRAWS, NODES_OF_WAVE = 64, 8  # walls drawn, and nodes of an outline in its shortest wave
TANGENTS, REACH = 128, 8  # of each wall, and the part of a turn to either side that they may touch


@cache
def perimeter_excess(shape_sd_m, radius_m, *, shares=None):
    """Mean and standard deviation of the excess over walls whose departures have a given size.

    Parameters
    ----------
    shape_sd_m : float
        Standard deviation of the radius round the wall, m.
    radius_m : float
    shares : tuple of float, optional
        Of the variance, in ovality and in seams; None: they are unsure, as before any survey.

    Returns
    -------
    mean, sd : float
        Of P^2 / (4 pi A) - 1.

    Notes
    -----
    Outlines are drawn from a fixed seed and their hulls measured. Where they are convex, the mean
    is (s/rho)^2 sum (k^2 - 1) w_k / sum w_k, w_k the variance of wave k.

    Examples
    --------
    >>> mean, sd = perimeter_excess(0.020, 6.5, shares=(1.0, 0.0))  # waves as k^-3, 2 to 36
    >>> round(1e6 * mean / 140, 1), round(1e6 * sd / 32, 1)
    (1.0, 1.0)
    """
    if shape_sd_m == 0:
        return 0.0, 0.0
    modes = _modes_of(radius_m)
    spectra = mode_shares(modes, radius_m)
    rng = np.random.default_rng(0)
    found = []
    for _ in range(DRAWS):
        oval, seam = _drawn_shares(rng) if shares is None else shares
        variances = oval * spectra["oval"] + seam * spectra["seam"]
        variances = variances / variances.sum()  # of the waves that are longer than the shortest
        found.append(_excess_of(_outline(rng, shape_sd_m**2 * variances, radius_m)))
    return float(np.mean(found)), float(np.std(found, ddof=1))


def tangent_excess(amplitudes, radius_m):
    """By how much the tangents of walls stand farther out than their radii at the same azimuth.

    Parameters
    ----------
    amplitudes : Amplitudes
        Of the walls, and how well they are known.
    radius_m : float

    Returns
    -------
    mean_m : float
        Over all azimuths and walls.
    common_sd_m : float
        Standard deviation of the mean of a wall.
    own_sd_m : float
        Of one tangent about that.

    Notes
    -----
    Outlines are drawn from a fixed seed, and the hull's support function is measured.

    Examples
    --------
    >>> from tankcal.geometry.field.amplitudes import assumed_amplitudes
    >>> mean, common, own = tangent_excess(assumed_amplitudes(), 6.5)
    >>> 0 < mean < 1e-3
    True
    """
    modes = _modes_of(radius_m)
    spectra = mode_shares(modes, radius_m)
    chosen = [i for i, one in enumerate(COMPONENTS) if one.shape in spectra]
    spread = amplitudes.log_covariance[np.ix_(chosen, chosen)]
    logs = np.log(amplitudes.variances_m2[chosen])
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(logs, spread, size=DRAWS, method="eigh")
    means, spreads = [], []
    for row in np.exp(drawn):
        pairs = zip(row, chosen, strict=True)
        variances = sum(size * spectra[COMPONENTS[i].shape] for size, i in pairs)
        radii = _outline(rng, variances, radius_m)
        at = len(radii) // TANGENTS * np.arange(TANGENTS)
        excess = _support_at(at, radii) - radii[at]
        means.append(excess.mean())
        spreads.append(excess.var())
    return float(np.mean(means)), float(np.std(means, ddof=1)), float(np.sqrt(np.mean(spreads)))


def _modes_of(radius_m):
    return np.arange(2.0, max(37.0, np.ceil(FULL_TURN * radius_m / SHORTEST_WAVE_M)))


def _support_at(at, radii_m):
    """(k,) support function of the hull of radii at even azimuths, at those of places (k,).

    It touches between nodes: a parabola through the highest one and those beside it.
    """
    count = len(radii_m)
    reach = np.arange(-(count // REACH), count // REACH + 1)  # a tangent touches near its azimuth
    near = radii_m[(at[:, None] + reach) % count]
    near = near * np.cos(FULL_TURN / count * reach)
    top = np.clip(np.argmax(near, axis=1), 1, near.shape[1] - 2)
    low, high, beyond = (near[np.arange(len(at)), top + k] for k in (-1, 0, 1))
    bend = np.maximum(2 * high - low - beyond, 1e-300)
    return high + (low - beyond) ** 2 / (8 * bend)


def _drawn_shares(rng):
    """Shares of ovality and of seams in the variance of a wall, as unsure as their amplitudes."""
    sizes = {"oval": 0.0, "seam": 0.0}
    for one in COMPONENTS:
        if one.shape in sizes:
            sizes[one.shape] += one.median_m**2 * np.exp(one.log_sd * rng.normal())
    whole = sum(sizes.values())
    return sizes["oval"] / whole, sizes["seam"] / whole


def _outline(rng, variances_m2, radius_m):
    """(n,) radii of an outline whose waves, from k = 2 on, have these mean squares about it."""
    count = NODES_OF_WAVE * (len(variances_m2) + 2)
    waves = np.zeros(count // 2 + 1, dtype=complex)
    drawn = rng.normal(size=(2, len(variances_m2)))
    waves[2 : len(variances_m2) + 2] = np.sqrt(variances_m2) * (drawn[0] - 1j * drawn[1])
    return radius_m + np.fft.irfft(waves, count) * count / 2


def _excess_of(radii_m):
    """P^2 / (4 pi A) - 1 of the hull's perimeter and the outline's area, radii at even azimuths."""
    turn = FULL_TURN * np.arange(len(radii_m)) / len(radii_m)
    hull = ConvexHull(np.column_stack([radii_m * np.cos(turn), radii_m * np.sin(turn)]))
    chords = (turn[1] / np.sin(turn[1] / 2) / 2) ** 2  # of the polygon of a circle, to its arcs
    return chords * hull.area**2 / (2 * np.sum(radii_m**2) * turn[1] * np.pi) - 1
