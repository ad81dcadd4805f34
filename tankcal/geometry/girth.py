"""Convex hull of a wall: the curve that a tape or tangents measure.

The tape follows the convex hull. A circle of the perimeter P has a larger area than the wall A
under the tape:

    excess = P^2 / (4 pi A) - 1 = (1 / (2 rho^2)) sum over k >= 2 of (k^2 - 1) c_k^2

to second order in the waves c_k of the outline, and less where the tape bridges a valley. The size
of the waves must be declared; `components` contains the prior distribution of their variance over
k.

A tangent whose normal has the azimuth f has the distance of the hull from the centre,

    p(f) = R(f) + R'(f)^2 / (2 R) + ...  where the wall is convex, and more over a valley.
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
from tankcal.units import FULL_TURN

SHORTEST_WAVE_M = 0.2  # shortest wavelength along the arc: plates do not bend more sharply
DRAWS, NODES_OF_WAVE = 64, 8  # number of random walls; nodes of an outline in its shortest wave
# Tangents of each wall; a tangent touches within 1 / REACH of a turn on either side of its azimuth.
TANGENTS, REACH = 128, 8
# Prior sd of radius and centre of a ring (practically free); least sd of its readings.
FREE_M, LEAST_M = 1.0, 1e-6
# Largest number of rings in the simulation; for tangents, a parabola interpolates between rings.
MOST_RINGS, FEW_RINGS = 8, 4
LEVELS = np.array([0.0, 0.5, 1.0])  # relative heights of the hulls of a wall without readings


@cache
def perimeter_excess(shape_sd_m, radius_m, *, shares=None):
    """Return mean and standard deviation of the excess over walls with departures of a given size.

    Parameters
    ----------
    shape_sd_m : float
        Standard deviation of the radius along the perimeter, m.
    radius_m : float
        Radius of the wall, m.
    shares : tuple of float, optional
        Shares of ovality and of seams in the variance; None: shares and wavelengths are unknown.

    Returns
    -------
    mean, sd : float
        Mean and standard deviation of P^2 / (4 pi A) - 1.

    Notes
    -----
    The outlines are random with a fixed seed, and the perimeters of their hulls are computed. For
    convex outlines, the mean is (s/rho)^2 sum (k^2 - 1) w_k / sum w_k, with w_k the variance of
    wave k.

    The distribution of the variance over the waves is an assumption, and the excess depends on it.
    Walls of equal size may have a tenth of the mean (plates of another curvature) or several times
    the mean (seams narrower than 0.4 m). The standard uncertainty of the mean is therefore as large
    as the mean, as for the waves that points do not show (`seen_excess`): without shares, the
    variance is that of the simulation plus the square of the mean.

    Examples
    --------
    >>> mean, sd = perimeter_excess(0.020, 6.5, shares=(1.0, 0.0))  # waves as k^-3, 2 to 36
    >>> round(1e6 * mean / 140, 1), round(1e6 * sd / 32, 1)
    (1.0, 1.0)
    """
    # A circle has no excess.
    if shape_sd_m == 0:
        return 0.0, 0.0
    modes = modes_of(radius_m)
    spectra = mode_shares(modes, radius_m)
    rng = np.random.default_rng(0)
    excesses = []
    for _ in range(DRAWS):
        oval, seam = _draw_shares(rng) if shares is None else shares
        variances = oval * spectra["oval"] + seam * spectra["seam"]
        variances = variances / variances.sum()  # the truncated spectrum sums to one again
        excesses.append(_excess_of(_outline(rng, shape_sd_m**2 * variances, radius_m)))
    mean, sd = float(np.mean(excesses)), float(np.std(excesses, ddof=1))
    return mean, sd if shares is not None else float(np.hypot(sd, mean))


@dataclass(frozen=True)
class Ring:
    """Radii measured round a level.

    Attributes
    ----------
    azimuth_rad, radius_m : ndarray, shape (n,)
        Azimuths and radii, rad and m.
    noise_m2 : ndarray, shape (n, n)
        Covariance of the radii, m2.
    up : float
        Height of the ring above the foot of the shell, as a fraction of the height of the shell.
    """

    azimuth_rad: np.ndarray
    radius_m: np.ndarray
    noise_m2: np.ndarray
    up: float = 0.5


def seen_excess(amplitudes, radius_m, rings):
    """Return mean and standard deviation of the excess over walls that agree with measured rings.

    Parameters
    ----------
    amplitudes : Amplitudes
        Amplitudes of the walls and their uncertainty.
    radius_m : float
        Radius of the wall, m.
    rings : sequence of Ring
        Measured radii; radius and centre of each ring are free.

    Returns
    -------
    mean, sd : float
        Mean and standard deviation of P^2 / (4 pi A) - 1 of a level.

    Notes
    -----
    Variances and outlines are random with a fixed seed, for each ring in turn. A random outline f
    is conditioned on the readings of the ring (conditional simulation, Matheron),

        f + K V^-1 (y - f at the sites - noise),

    and the perimeter of its hull is computed. Waves that the points resolve thus agree with the
    readings; shorter waves are random. The distribution of the variance over the short waves is an
    assumption. Their part of the excess is the mean excess less that of the most likely outline K
    V^-1 y. The standard deviation of this part is taken equal to its mean, as for the exponential
    distribution, the distribution of largest entropy above 0. It is added to the scatter of the
    simulation.

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
    spectra, rng, excesses = mode_shares(modes, radius_m), np.random.default_rng(0), []
    nodes, ring_models = nodes_of(radius_m), _condition_rings(rings, radius_m)
    for number, variances in enumerate(_draw_variances(amplitudes, rng)):
        ring_model = ring_models[number % len(ring_models)]
        sizes = _shape_variances(variances, ring_model.up)
        outline = _outline(rng, sum(sizes[item] * spectra[item] for item in sizes), radius_m)
        excesses.append(_excess_of(ring_model.moved(outline, sizes, rng)))
    likely_excesses = [
        _excess_of(
            item.moved(np.full(nodes, radius_m), _shape_variances(amplitudes.likely_m2, item.up))
        )
        for item in ring_models
    ]
    # The most likely outline is smoother than the simulated outlines: the difference is unresolved.
    unresolved = max(np.mean(excesses) - np.mean(likely_excesses), 0.0)
    return float(np.mean(excesses)), float(np.hypot(np.std(excesses, ddof=1), unresolved))


class _ConditionedRing:
    """Conditioning of outlines on the radii of a ring."""

    def __init__(self, ring, turn_rad, radius_m):
        self._ring, self._turn, self.up = ring, turn_rad, ring.up
        azimuth = ring.azimuth_rad
        self._to_turn = azimuth_correlations(turn_rad, azimuth, radius_m)
        self._among = azimuth_correlations(azimuth, azimuth, radius_m)
        free_columns = np.column_stack([np.ones(len(azimuth)), np.sin(azimuth), np.cos(azimuth)])
        self._noise = ring.noise_m2 + LEAST_M**2 * np.eye(len(azimuth))
        self._free = FREE_M**2 * free_columns @ free_columns.T
        self._root = np.linalg.cholesky(self._noise)

    def moved(self, outline_m, sizes, rng=None):
        """Return an outline conditioned on the ring.

        Parameters
        ----------
        outline_m : ndarray, shape (n,)
            Radii of an outline at evenly spaced azimuths, m.
        sizes : dict of str to float
            Variances of the shapes, m2.
        rng : numpy.random.Generator, optional
            Source of random noise of the readings; None: no noise.

        Returns
        -------
        ndarray, shape (n,)
        """
        predicted = np.interp(self._ring.azimuth_rad, self._turn, outline_m, period=FULL_TURN)
        if rng is not None:
            predicted = predicted + self._root @ rng.normal(size=len(predicted))
        covariance = (
            self._free + self._noise + sum(sizes[shape] * self._among[shape] for shape in sizes)
        )
        # K V^-1 (y - f): the residual of the readings, spread over the outline by the prior.
        weights = scipy.linalg.solve(covariance, self._ring.radius_m - predicted, assume_a="pos")
        return outline_m + sum(sizes[shape] * (self._to_turn[shape] @ weights) for shape in sizes)


def tangent_excess(amplitudes, radius_m, up, rings=(), most_m=np.inf):
    """Return the excess of tangents over the radius of a wall, beyond that of the likely outline.

    Parameters
    ----------
    amplitudes : Amplitudes
        Amplitudes of the wall and their uncertainty.
    radius_m : float
        Radius of the wall, m.
    up : array_like, shape (n,)
        Heights above the foot of the shell, as fractions of the height of the shell.
    rings : sequence of Ring, optional
        Radii measured round the wall; empty: a wall that was not surveyed.
    most_m : float
        Largest possible rms departure of the wall from a circle; rougher random walls are scaled
        down to it.

    Returns
    -------
    ndarray, shape (n, 3)
        At each height: the mean over all azimuths and walls, its standard uncertainty, and the
        standard deviation of a single tangent about the mean of its wall, m.

    Notes
    -----
    Outlines that agree with the rings are random with a fixed seed (equation in `seen_excess`). The
    support functions of their hulls are computed (`support_of`), and the support function of the
    most likely outline is subtracted. Without rings, the most likely outline is a circle, whose
    excess is zero. The excess of convex outlines is quadratic in the departures, and settlement
    grows in proportion to the height: a parabola in the height thus smooths the values of the
    rings. The standard uncertainty of the mean of the unresolved part equals this mean, as in
    `seen_excess`.

    Examples
    --------
    >>> from tankcal.geometry.field.amplitudes import assumed_amplitudes
    >>> foot, top = tangent_excess(assumed_amplitudes(), 6.5, [0.0, 1.0])
    >>> bool(0 < foot[0] < top[0] < 1e-3)
    True
    """
    spectra = mode_shares(modes_of(radius_m), radius_m)
    ring_models = _condition_rings(rings, radius_m, FEW_RINGS) or [
        _UnmeasuredLevel(up) for up in LEVELS
    ]
    variance_draws = _draw_variances(amplitudes, np.random.default_rng(0))[
        :: max(len(ring_models) // 2, 1)
    ]
    likely, circle, moments = amplitudes.likely_m2, np.full(nodes_of(radius_m), radius_m), []
    for ring_model in ring_models:
        likely_tangents = _tangent_differences(
            ring_model.moved(
                circle, _limit_variances(_shape_variances(likely, ring_model.up), most_m)
            )
        )
        means, spreads, rng = [], [], np.random.default_rng(1)  # equal walls at all heights
        for variances in variance_draws:
            sizes = _limit_variances(_shape_variances(variances, ring_model.up), most_m)
            outline = _outline(rng, sum(sizes[s] * spectra[s] for s in sizes), radius_m)
            excess = _tangent_differences(ring_model.moved(outline, sizes, rng)) - likely_tangents
            means.append(excess.mean())
            spreads.append(excess.var())
        mean = max(float(np.mean(means)), 0.0)
        moments.append((mean, np.var(means, ddof=1) + mean**2 * bool(rings), np.mean(spreads)))
    # Least-squares parabola (or a polynomial of lower degree) of mean and both variances over
    # height.
    at_rings = np.vander([ring_model.up for ring_model in ring_models], min(3, len(ring_models)))
    coefficients = np.linalg.lstsq(at_rings, np.array(moments), rcond=1e-3)[0]
    smoothed = np.vander(np.asarray(up, dtype=float), len(coefficients)) @ coefficients
    smoothed = np.maximum(
        smoothed, np.min(moments, axis=0)
    )  # keep the parabola above the least ring
    smoothed[:, 1:] **= 0.5  # variances to standard deviations
    return smoothed


def _condition_rings(rings, radius_m, most=MOST_RINGS):
    """Return the `_ConditionedRing` of at most `most` rings, evenly chosen."""
    nodes = nodes_of(radius_m)
    turn = FULL_TURN * np.arange(nodes) / nodes
    chosen = np.unique(np.linspace(0, len(rings) - 1, most).astype(int)) if rings else ()
    return [_ConditionedRing(rings[i], turn, radius_m) for i in chosen]


def _limit_variances(sizes, most_m):
    """Return the variances of the shapes, scaled down to at most `most_m` (rms of the wall)."""
    scale = min(1.0, most_m**2 / max(sum(sizes.values()), 1e-30))
    return {shape: scale * size for shape, size in sizes.items()}


def _tangent_differences(radii_m):
    """Return the support function less the radius, shape (TANGENTS,), at evenly spaced azimuths."""
    places = len(radii_m) // TANGENTS * np.arange(TANGENTS)
    return _support_at(places, radii_m) - radii_m[places]


def support_of(radii_m):
    """Return the support function of the convex hull of an outline.

    Parameters
    ----------
    radii_m : ndarray, shape (n,)
        Radii at evenly spaced azimuths clockwise from 0, m.

    Returns
    -------
    ndarray, shape (n,)
        Support function at these azimuths, m.

    Examples
    --------
    >>> bulging = 6.5 + 0.002 * np.cos(3 * FULL_TURN * np.arange(720) / 720)
    >>> float(round(1e6 * (support_of(bulging) - bulging).mean(), 2))  # 3^2 c^2 / (4 R)
    1.38
    """
    return _support_at(np.arange(len(radii_m)), radii_m)


@dataclass(frozen=True)
class _UnmeasuredLevel:
    """Level without measured radii."""

    up: float

    def moved(self, outline_m, sizes, rng=None):
        """Return the outline unchanged."""
        return outline_m


def _draw_variances(amplitudes, rng):
    """Draw variances (DRAWS, components) of walls from the distribution of the amplitudes, m2.

    Components without waves along the perimeter have the variance zero.
    """
    round_indices = [i for i, component in enumerate(COMPONENTS) if component.shape in ROUND_SHAPES]
    spread = amplitudes.log_covariance[np.ix_(round_indices, round_indices)]
    logs = np.log(amplitudes.likely_m2[round_indices])
    variances = np.zeros((DRAWS, len(COMPONENTS)))
    variances[:, round_indices] = np.exp(
        rng.multivariate_normal(logs, spread, size=DRAWS, method="eigh")
    )
    return variances


def _shape_variances(variances_m2, up):
    """Return {shape: sum of the variances of its components at a relative height, m2}."""
    sums = dict.fromkeys(ROUND_SHAPES, 0.0)
    at_height = Heights(np.zeros(1), np.array([up]))
    for component, size in zip(COMPONENTS, variances_m2, strict=True):
        # Settlement grows with the height; all other variances refer to the course.
        if component.shape == "settled":
            size = size * component.height_covariance(at_height, at_height)[0, 0]
        if component.shape in sums:
            sums[component.shape] += float(size)
    return sums


def modes_of(radius_m):
    """Return the wave numbers (modes,) of a wall, from k = 2 to the shortest wave of a plate."""
    return np.arange(2.0, max(37.0, np.ceil(FULL_TURN * radius_m / SHORTEST_WAVE_M)))


def nodes_of(radius_m):
    """Return the number of nodes of a random outline of a wall."""
    return NODES_OF_WAVE * (len(modes_of(radius_m)) + 2)


def _support_at(places, radii_m):
    """Return the support function (k,) of the hull of radii, at the nodes `at` (k,).

    The tangent touches between nodes: a parabola through the highest node and its neighbours.
    """
    count = len(radii_m)
    # Support function: maximum of r(a) cos(a - f) over azimuths a near that of the normal.
    reach = np.arange(-(count // REACH), count // REACH + 1)
    projections = radii_m[(places[:, None] + reach) % count]
    projections = projections * np.cos(FULL_TURN / count * reach)
    top = np.clip(np.argmax(projections, axis=1), 1, projections.shape[1] - 2)
    previous, peak, next_value = (projections[np.arange(len(places)), top + k] for k in (-1, 0, 1))
    # Vertex of the parabola through three equidistant ordinates; the bound avoids division by zero.
    curvature = np.maximum(2 * peak - previous - next_value, 1e-300)
    return peak + (previous - next_value) ** 2 / (8 * curvature)


def _draw_shares(rng):
    """Draw the shares of ovality and of seams in the variance of a wall from the prior."""
    sizes = {"oval": 0.0, "seam": 0.0}
    for component in COMPONENTS:
        if component.shape in sizes:
            sizes[component.shape] += component.median_m**2 * np.exp(
                component.log_sd * rng.normal()
            )
    total = sum(sizes.values())
    return sizes["oval"] / total, sizes["seam"] / total


def _outline(rng, variances_m2, radius_m):
    """Return radii (n,) of a random outline with the mean squares `variances_m2` from k = 2 on."""
    return radius_m + draw_waves(rng, variances_m2)


def draw_waves(rng, variances_m2, draws=()):
    """Draw departures of outlines from a circle, at evenly spaced azimuths clockwise from 0.

    Parameters
    ----------
    rng : numpy.random.Generator
    variances_m2 : ndarray, shape (modes,)
        Mean squares of the waves along the outline, from k = 2 on, m2.
    draws : tuple of int
        Shape of the array of outlines.

    Returns
    -------
    ndarray, shape (*draws, n)
        m; n is NODES_OF_WAVE per shortest wave.
    """
    modes = len(variances_m2)
    count = NODES_OF_WAVE * (modes + 2)
    waves = np.zeros((*draws, count // 2 + 1), dtype=complex)
    normals = rng.normal(size=(2, *draws, modes))
    waves[..., 2 : modes + 2] = np.sqrt(variances_m2) * (normals[0] - 1j * normals[1])
    # `irfft` divides by count; a real wave has two conjugate terms.
    return np.fft.irfft(waves, count) * count / 2


def _excess_of(radii_m):
    """Return P^2 / (4 pi A) - 1 with the perimeter of the hull and the area of the outline."""
    area_m2 = np.sum(radii_m**2) * FULL_TURN / len(radii_m) / 2
    return girth_of(radii_m) ** 2 / (4 * np.pi * area_m2) - 1


def girth_of(radii_m):
    """Return the perimeter of the convex hull of an outline, m, from radii (n,) at even azimuths.

    The perimeter of the polygon is scaled by the ratio of a circle to its own polygon.

    Examples
    --------
    >>> float(round(girth_of(np.full(360, 7.0)) / (2 * np.pi * 7.0), 9))
    1.0
    """
    step = FULL_TURN / len(radii_m)
    turn = step * np.arange(len(radii_m))
    return step / np.sin(step / 2) / 2 * hull_perimeter(radii_m * np.exp(1j * turn))


def hull_perimeter(places):
    """Return the perimeter of the convex hull of points round the origin.

    A point on the inner side of the chord between its neighbours is no corner of the hull. The
    removal of such points is repeated until every corner turns left.

    Parameters
    ----------
    places : ndarray of complex, shape (n,)
        x + i y of the points, anticlockwise; neighbours are less than half a turn apart.

    Returns
    -------
    float
        Perimeter, in the unit of the points.

    Examples
    --------
    >>> hull_perimeter(np.array([3, 1 + 1j, 4j, -3, -4j]))  # 1 + 1j is inside
    20.0
    """
    while True:
        edges = np.roll(places, -1) - places
        # Imaginary part of conj(a) b: cross product of successive edges, positive at a left turn.
        convex = (np.roll(edges, 1).conj() * edges).imag > 0
        if convex.all():
            return float(np.abs(edges).sum())
        places = places[convex]
