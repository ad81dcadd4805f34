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

from tankcal.geometry.field.components import (
    COMPONENTS,
    ROUND_SHAPES,
    Heights,
    azimuth_correlations,
    mode_shares,
)
from tankcal.geometry.outlines import FULL_TURN

SHORTEST_WAVE_M = 0.2  # along the arc: plates do not bend more sharply
DRAWS, NODES_OF_WAVE = 64, 8  # walls drawn, and nodes of an outline in its shortest wave
TANGENTS, REACH = 128, 8  # of each wall, and the part of a turn to either side that they may touch
FREE_M, LEAST_M = 1.0, 1e-6  # sd of radius and centre of a ring beforehand; of its readings, least
MOST_RINGS, FEW_RINGS = 8, 4  # asked what a wall looks like; of tangents, a parabola joins them
LEVELS = np.array([0.0, 0.5, 1.0])  # parts of the shell's height at which hulls are measured


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
    up : float
        Height of the ring above the foot of the shell, as a part of the shell's height.
    """

    azimuth_rad: np.ndarray
    radius_m: np.ndarray
    noise_m2: np.ndarray
    up: float = 0.5


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
    nodes, known = nodes_of(radius_m), _known_rings(rings, radius_m)
    for number, drawn in enumerate(_drawn_variances(amplitudes, rng)):
        here = known[number % len(known)]
        sizes = _sizes_of(drawn, here.up)
        outline = _outline(rng, sum(sizes[one] * spectra[one] for one in sizes), radius_m)
        found.append(_excess_of(here.moved(outline, sizes, rng)))
    seen = [
        _excess_of(one.moved(np.full(nodes, radius_m), _sizes_of(amplitudes.likely_m2, one.up)))
        for one in known
    ]
    unseen = max(np.mean(found) - np.mean(seen), 0.0)
    return float(np.mean(found)), float(np.hypot(np.std(found, ddof=1), unseen))


class _Known:
    """What one ring makes of outlines at azimuths."""

    def __init__(self, ring, turn_rad, radius_m):
        self._ring, self._turn, self.up = ring, turn_rad, ring.up
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


def tangent_excess(amplitudes, radius_m, up, rings=(), most_m=np.inf):
    """Excess of the tangents of a wall over its radius, beyond that of the most likely outline.

    Parameters
    ----------
    amplitudes : Amplitudes
        Of the wall, and how well they are known.
    radius_m : float
    up : array_like, shape (n,)
        Heights above the foot of the shell, as parts of the shell's height.
    rings : sequence of Ring, optional
        Radii that were read round the wall; none: a wall that was not surveyed.
    most_m : float
        Largest rms departure from a circle that the wall can have; walls that are drawn rougher
        than that are scaled down to it.

    Returns
    -------
    ndarray, shape (n, 3)
        At each height: the mean over all azimuths and walls, its standard uncertainty, and the
        standard deviation of a single tangent about the mean of its wall, m.

    Notes
    -----
    Outlines that agree with the rings are drawn from a fixed seed (`seen_excess` has the equation),
    the support functions of their hulls are measured (`support_of`), and that of the most
    likely outline is subtracted. Without rings that is a circle, whose excess is zero. The excess
    of convex outlines is quadratic in the departures, and settlement grows in proportion to the
    height, so a parabola in the height smooths the values of the rings. The mean of the part that
    the rings do not show counts as known to its own size, as in `seen_excess`.

    Examples
    --------
    >>> from tankcal.geometry.field.amplitudes import assumed_amplitudes
    >>> foot, top = tangent_excess(assumed_amplitudes(), 6.5, [0.0, 1.0])
    >>> bool(0 < foot[0] < top[0] < 1e-3)
    True
    """
    spectra = mode_shares(modes_of(radius_m), radius_m)
    known = _known_rings(rings, radius_m, FEW_RINGS) or [_Unread(up) for up in LEVELS]
    drawn = _drawn_variances(amplitudes, np.random.default_rng(0))[:: max(len(known) // 2, 1)]
    likely, circle, found = amplitudes.likely_m2, np.full(nodes_of(radius_m), radius_m), []
    for one in known:
        seen = _at_tangents(one.moved(circle, _bounded(_sizes_of(likely, one.up), most_m)))
        means, spreads, rng = [], [], np.random.default_rng(1)  # the same walls at all heights
        for variances in drawn:
            sizes = _bounded(_sizes_of(variances, one.up), most_m)
            outline = _outline(rng, sum(sizes[s] * spectra[s] for s in sizes), radius_m)
            beyond = _at_tangents(one.moved(outline, sizes, rng)) - seen
            means.append(beyond.mean())
            spreads.append(beyond.var())
        mean = max(float(np.mean(means)), 0.0)
        found.append((mean, np.var(means, ddof=1) + mean**2 * bool(rings), np.mean(spreads)))
    at_rings = np.vander([one.up for one in known], min(3, len(known)))
    smooth = np.linalg.lstsq(at_rings, np.array(found), rcond=1e-3)[0]
    smoothed = np.vander(np.asarray(up, dtype=float), len(smooth)) @ smooth
    smoothed = np.maximum(smoothed, np.min(found, axis=0))  # no parabola goes below all rings
    smoothed[:, 1:] **= 0.5
    return smoothed


def _known_rings(rings, radius_m, most=MOST_RINGS):
    """`_Known` of at most so many of the rings."""
    nodes = nodes_of(radius_m)
    turn = FULL_TURN * np.arange(nodes) / nodes
    chosen = np.unique(np.linspace(0, len(rings) - 1, most).astype(int)) if rings else ()
    return [_Known(rings[i], turn, radius_m) for i in chosen]


def _bounded(sizes, most_m):
    """Variances of the shapes, scaled down where they make a wall rougher than most_m (rms)."""
    scale = min(1.0, most_m**2 / max(sum(sizes.values()), 1e-30))
    return {shape: scale * size for shape, size in sizes.items()}


def _at_tangents(radii_m):
    """(TANGENTS,) support function less the radius, at even azimuths."""
    at = len(radii_m) // TANGENTS * np.arange(TANGENTS)
    return _support_at(at, radii_m) - radii_m[at]


def support_of(radii_m):
    """Support function of the convex hull of an outline.

    Parameters
    ----------
    radii_m : ndarray, shape (n,)
        At even azimuths clockwise from 0, m.

    Returns
    -------
    ndarray, shape (n,)
        At the same azimuths, m.

    Examples
    --------
    >>> bulging = 6.5 + 0.002 * np.cos(3 * FULL_TURN * np.arange(720) / 720)
    >>> float(round(1e6 * (support_of(bulging) - bulging).mean(), 2))  # 3^2 c^2 / (4 R)
    1.38
    """
    return _support_at(np.arange(len(radii_m)), radii_m)


@dataclass(frozen=True)
class _Unread:
    """A level at which no radius was read."""

    up: float

    def moved(self, outline_m, sizes, rng=None):
        """The outline unchanged."""
        return outline_m


def _drawn_variances(amplitudes, rng):
    """(DRAWS, components) variances of walls, as unsure as the amplitudes are, m2.

    Components without waves round the wall have none.
    """
    chosen = [i for i, one in enumerate(COMPONENTS) if one.shape in ROUND_SHAPES]
    spread = amplitudes.log_covariance[np.ix_(chosen, chosen)]
    logs = np.log(amplitudes.likely_m2[chosen])
    drawn = np.zeros((DRAWS, len(COMPONENTS)))
    drawn[:, chosen] = np.exp(rng.multivariate_normal(logs, spread, size=DRAWS, method="eigh"))
    return drawn


def _sizes_of(variances_m2, up):
    """{shape: variance of all components of that shape at a height of the shell, m2}."""
    found = dict.fromkeys(ROUND_SHAPES, 0.0)
    at_height = Heights(np.zeros(1), np.array([up]))
    for one, size in zip(COMPONENTS, variances_m2, strict=True):
        if one.shape == "settled":
            size = size * one.height_covariance(at_height, at_height)[0, 0]
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
