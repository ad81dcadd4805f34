"""What a tape round a wall, or its tangents, measure: its convex hull, which no circle of it has.

A circle of the perimeter P has a larger area than the wall A that the tape lies on:

    excess = P^2 / (4 pi A) - 1 = (1 / (2 rho^2)) sum over k >= 2 of (k^2 - 1) c_k^2

to the second order in the waves c_k of its outline, and less where it bridges a valley. How large
the waves are somebody has to declare; how they are spread over k is what `components` say of walls.

A tangent whose normal has the azimuth f stands as far from the centre as the hull does there,

    p(f) = R(f) + R'(f)^2 / (2 R) + ...  where the wall is convex, and farther out over a valley.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.linalg

from tankcal.geometry.field.components import COMPONENTS, azimuth_correlations, mode_shares
from tankcal.geometry.outlines import FULL_TURN

SHORTEST_WAVE_M = 0.2  # along the arc: plates do not bend more sharply
DRAWS, NODES_OF_WAVE = 64, 8  # walls drawn, and nodes of an outline in its shortest wave
TANGENTS, REACH = 128, 8  # of each wall, and the part of a turn to either side that they may touch
FREE_M, LEAST_M = 1.0, 1e-6  # sd of radius and centre of a ring beforehand; of its readings, least
MOST_RINGS = 8  # asked what a wall looks like


@cache
def perimeter_excess(shape_sd_m, radius_m, *, shares=None):
    """Mean and standard deviation of the excess over walls whose departures have a given size.

    Parameters
    ----------
    shape_sd_m : float
        Standard deviation of the radius round the wall, m.
    radius_m : float
    shares : tuple of float, optional
        Of the variance, in ovality and in seams; None: nobody knows them, nor how short the waves
        are.

    Returns
    -------
    mean, sd : float
        Of P^2 / (4 pi A) - 1.

    Notes
    -----
    Outlines are drawn from a fixed seed and their hulls measured. Where they are convex, the mean
    is (s/rho)^2 sum (k^2 - 1) w_k / sum w_k, w_k the variance of wave k.

    How a wall spreads its variance over the waves is an assumption, and the excess hangs on it:
    walls of one size have a tenth of the mean (plates of another curvature) or several times that
    (seams narrower than 0.4 m). So no more than the mean is taken as known, as of what points do
    not show (`seen_excess`): where no shares are given the variance is that of the draws and the
    square of the mean.

    Examples
    --------
    >>> mean, sd = perimeter_excess(0.020, 6.5, shares=(1.0, 0.0))  # waves as k^-3, 2 to 36
    >>> round(1e6 * mean / 140, 1), round(1e6 * sd / 32, 1)
    (1.0, 1.0)
    """
    if shape_sd_m == 0:
        return 0.0, 0.0
    modes = modes_of(radius_m)
    spectra = mode_shares(modes, radius_m)
    rng = np.random.default_rng(0)
    found = []
    for _ in range(DRAWS):
        oval, seam = _drawn_shares(rng) if shares is None else shares
        variances = oval * spectra["oval"] + seam * spectra["seam"]
        variances = variances / variances.sum()  # of the waves that are longer than the shortest
        found.append(_excess_of(_outline(rng, shape_sd_m**2 * variances, radius_m)))
    mean, sd = float(np.mean(found)), float(np.std(found, ddof=1))
    return mean, sd if shares is not None else float(np.hypot(sd, mean))


@dataclass(frozen=True)
class Ring:
    """Radii read round one level.

    Attributes
    ----------
    azimuth_rad, radius_m : ndarray, shape (n,)
    noise_m2 : ndarray, shape (n, n)
    """

    azimuth_rad: np.ndarray
    radius_m: np.ndarray
    noise_m2: np.ndarray


def seen_excess(amplitudes, radius_m, rings):
    """Mean and standard deviation of the excess over walls that agree with radii read round them.

    Parameters
    ----------
    amplitudes : Amplitudes
        Of the walls, and how well they are known.
    radius_m : float
    rings : sequence of Ring
        Each has a radius and a centre of its own.

    Returns
    -------
    mean, sd : float
        Of P^2 / (4 pi A) - 1 of a level.

    Notes
    -----
    Sizes and outlines are drawn from a fixed seed, for one ring after another. A drawn outline f
    moves to what the ring has read of it (conditional simulation, Matheron),

        f + K V^-1 (y - f at the sites - noise),

    and the hull of that is measured: waves that the points show are those that they show, shorter
    ones are drawn. How a wall spreads its variance over these is an assumption: of their part of
    the excess, which is what the most likely outline K V^-1 y lacks of the mean, no more than the
    mean is taken as known, so that its standard deviation is as large (the exponential
    distribution, of most entropy above 0), beside the scatter of the draws.

    Examples
    --------
    >>> from tankcal.geometry.field.amplitudes import assumed_amplitudes
    >>> def ring_of(count):
    ...     turn = 2 * np.pi * np.arange(count) / count
    ...     return Ring(turn, 6.5 + 0.01 * np.cos(2 * turn), 1e-8 * np.eye(count))
    >>> _, few = seen_excess(assumed_amplitudes(), 6.5, [ring_of(12)])
    >>> _, many = seen_excess(assumed_amplitudes(), 6.5, [ring_of(120)])
    >>> many < few / 2
    True
    """
    modes = modes_of(radius_m)
    spectra, rng, found = mode_shares(modes, radius_m), np.random.default_rng(0), []
    nodes = nodes_of(radius_m)
    turn = FULL_TURN * np.arange(nodes) / nodes
    chosen = np.unique(np.linspace(0, len(rings) - 1, MOST_RINGS).astype(int))
    known = [_Known(rings[i], turn, radius_m) for i in chosen]
    for number, sizes in enumerate(_drawn_sizes(amplitudes, rng)):
        outline = _outline(rng, sum(sizes[one] * spectra[one] for one in sizes), radius_m)
        found.append(_excess_of(known[number % len(known)].moved(outline, sizes, rng)))
    sizes = _sizes_of(amplitudes.likely_m2)
    seen = [_excess_of(one.moved(np.full(nodes, radius_m), sizes)) for one in known]
    unseen = max(np.mean(found) - np.mean(seen), 0.0)
    return float(np.mean(found)), float(np.hypot(np.std(found, ddof=1), unseen))


class _Known:
    """What one ring makes of outlines at azimuths."""

    def __init__(self, ring, turn_rad, radius_m):
        self._ring, self._turn = ring, turn_rad
        at = ring.azimuth_rad
        self._to_turn = azimuth_correlations(turn_rad, at, radius_m)
        self._among = azimuth_correlations(at, at, radius_m)
        free = np.column_stack([np.ones(len(at)), np.sin(at), np.cos(at)])
        self._noise = ring.noise_m2 + LEAST_M**2 * np.eye(len(at))
        self._free = FREE_M**2 * free @ free.T
        self._root = np.linalg.cholesky(self._noise)

    def moved(self, outline_m, sizes, rng=None):
        """An outline as it is after the ring was read; rng: with the noise of that."""
        read = np.interp(self._ring.azimuth_rad, self._turn, outline_m, period=FULL_TURN)
        if rng is not None:
            read = read + self._root @ rng.normal(size=len(read))
        whole = self._free + self._noise + sum(sizes[one] * self._among[one] for one in sizes)
        pull = scipy.linalg.solve(whole, self._ring.radius_m - read, assume_a="pos")
        return outline_m + sum(sizes[one] * (self._to_turn[one] @ pull) for one in sizes)


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
    spectra, rng = mode_shares(modes_of(radius_m), radius_m), np.random.default_rng(0)
    means, spreads = [], []
    for sizes in _drawn_sizes(amplitudes, rng):
        variances = sum(sizes[one] * spectra[one] for one in sizes)
        radii = _outline(rng, variances, radius_m)
        at = len(radii) // TANGENTS * np.arange(TANGENTS)
        excess = _support_at(at, radii) - radii[at]
        means.append(excess.mean())
        spreads.append(excess.var())
    return float(np.mean(means)), float(np.std(means, ddof=1)), float(np.sqrt(np.mean(spreads)))


def _drawn_sizes(amplitudes, rng):
    """Variances of "oval" and "seam" of DRAWS walls, as unsure as the amplitudes are, m2."""
    chosen = [i for i, one in enumerate(COMPONENTS) if one.shape in ("oval", "seam")]
    spread = amplitudes.log_covariance[np.ix_(chosen, chosen)]
    logs = np.log(amplitudes.likely_m2[chosen])
    drawn = np.zeros((DRAWS, len(COMPONENTS)))
    drawn[:, chosen] = np.exp(rng.multivariate_normal(logs, spread, size=DRAWS, method="eigh"))
    return [_sizes_of(row) for row in drawn]


def _sizes_of(variances_m2):
    """{"oval", "seam": variance of all components of that shape, m2}."""
    found = {"oval": 0.0, "seam": 0.0}
    for one, size in zip(COMPONENTS, variances_m2, strict=True):
        if one.shape in found:
            found[one.shape] += float(size)
    return found


def modes_of(radius_m):
    """(modes,) waves round a wall of that radius, from k = 2 to the shortest that a plate takes."""
    return np.arange(2.0, max(37.0, np.ceil(FULL_TURN * radius_m / SHORTEST_WAVE_M)))


def nodes_of(radius_m):
    """How many nodes a drawn outline of such a wall has."""
    return NODES_OF_WAVE * (len(modes_of(radius_m)) + 2)


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
    return radius_m + draw_waves(rng, variances_m2)


def draw_waves(rng, variances_m2, draws=()):
    """Departures of outlines from a circle, at even azimuths clockwise from 0.

    Parameters
    ----------
    rng : numpy.random.Generator
    variances_m2 : ndarray, shape (modes,)
        Mean squares about the outline of its waves, from k = 2 on.
    draws : tuple of int
        How many outlines.

    Returns
    -------
    ndarray, shape (*draws, n)
        n is NODES_OF_WAVE for each of the shortest waves.
    """
    modes = len(variances_m2)
    count = NODES_OF_WAVE * (modes + 2)
    waves = np.zeros((*draws, count // 2 + 1), dtype=complex)
    drawn = rng.normal(size=(2, *draws, modes))
    waves[..., 2 : modes + 2] = np.sqrt(variances_m2) * (drawn[0] - 1j * drawn[1])
    return np.fft.irfft(waves, count) * count / 2


def _excess_of(radii_m):
    """P^2 / (4 pi A) - 1 of the hull's perimeter and the outline's area, radii at even azimuths."""
    area_m2 = np.sum(radii_m**2) * FULL_TURN / len(radii_m) / 2
    return girth_of(radii_m) ** 2 / (4 * np.pi * area_m2) - 1


def girth_of(radii_m):
    """Perimeter of the convex hull of an outline, of its radii (n,) at even azimuths, m.

    That of the polygon, longer by what a circle is than its own.

    Examples
    --------
    >>> float(round(girth_of(np.full(360, 7.0)) / (2 * np.pi * 7.0), 9))
    1.0
    """
    step = FULL_TURN / len(radii_m)
    turn = step * np.arange(len(radii_m))
    return step / np.sin(step / 2) / 2 * hull_perimeter(radii_m * np.exp(1j * turn))


def hull_perimeter(places):
    """Perimeter of the convex hull of points round the origin.

    A point on the inner side of the chord between its neighbours is no corner of the hull; without
    such points others may become one, until every corner turns left.

    Parameters
    ----------
    places : ndarray of complex, shape (n,)
        x + i y of the points, anticlockwise, neighbours less than half a turn apart.

    Returns
    -------
    float
        In the unit of the points.

    Examples
    --------
    >>> hull_perimeter(np.array([3, 1 + 1j, 4j, -3, -4j]))  # 1 + 1j stands within
    20.0
    """
    while True:
        after = np.roll(places, -1) - places
        outer = (np.roll(after, 1).conj() * after).imag > 0
        if outer.all():
            return float(np.abs(after).sum())
        places = places[outer]
