"""Estimates of rows that are quadratic in few inputs: means over independent point sets.

u follows from the exact u of the linear part and the covariance of the quadratic forms. The ends
follow by inversion of the distribution function, which quadratic.Lines estimates at three levels
about each end.

Sources: JCGM 101:2008 7.6, 7.7; randomised point sets: Owen 1998.
"""

import numpy as np
from scipy.special import ndtri

from tankcal.gum.monte_carlo.goal import as_good_as_plain, may_stop
from tankcal.gum.monte_carlo.inputs import inputs_of
from tankcal.gum.monte_carlo.linear import linear_law, shapes_of
from tankcal.gum.monte_carlo.quadratic import RARE, Lines
from tankcal.gum.monte_carlo.sobol import sobol_points

SETS = 10  # number of independent point sets
POINTS = 2048  # points of a set; intervals use FIRST to MOST points
FIRST, MOST = 8, 1024  # eight points of each set usually equal 1e7 plain draws
SEEN = 2.0  # least expected number of points of all sets beyond an end
PILOT = 16, 64  # points of the first set that locate the ends: first attempt, later attempts
STILL = 0.01  # change of a target, relative to the lowest level, below which it is final
NEAR = 0.005  # largest difference of scores by Taylor's series, accurate to 1e-8
ROWS = 1024  # rows whose moments are computed together, so that they stay in the cache
SIDES = np.array([0.6, 1.0, 1.4])  # levels about an end, relative to its level


def table_estimates(model, ready, goal, progress):
    """Estimates of quadratic rows.

    Parameters
    ----------
    model : QuadraticRows
        The rows.
    ready : Inputs
        Prepared inputs.
    goal : Goal
        Goal of the simulation.
    progress : callable
        progress(text, done, total).

    Returns
    -------
    estimates, errors : ndarray, shape (6, rows)
        In the order of goal.NAMES.
    draws : ndarray, shape (rows,)
        Number of draws.
    controlled : ndarray of bool, shape (rows,)
        True if the linear part served as control.
    sound : ndarray of bool, shape (rows,)
        True for a row with valid ends.

    Notes
    -----
    A row is not valid in three cases: its quadratic part is too large for a single parabola, its
    shortest interval is far from the symmetric interval, or plain draws are as precise. The ends of
    such a row are nan, and another method must find them.
    """
    rows, ready = _reduce_coordinates(model, ready)
    sets = _point_sets(ready, goal)
    forms = np.stack([rows.forms(e) for e in sets])
    shapes = shapes_of(ready)
    lines = Lines(rows, ready.normal, shapes, ready.coordinate_scale)
    levels = np.concatenate([SIDES * goal.tail, 1 - SIDES[::-1] * goal.tail])
    scaled = rows.jacobian * ready.coordinate_scale
    law = linear_law(scaled, ready.normal, shapes, levels)
    moments = _moments(rows, ready, forms)
    ends_of_rows = _Ends(lines, law, levels, sets, forms)
    estimates, errors = np.full((2, 6, len(rows.value)), np.nan)  # nan reveals missing estimates
    estimates[:2], errors[:2] = _mean_and_error(moments)
    draws = np.full(len(rows.value), SETS * POINTS)
    first = FIRST
    # A high coverage probability needs more points for the tails.
    while SETS * first * goal.tail < SEEN:
        first *= 4
    pending, count = np.flatnonzero(law.known), first
    # Rows without uncertainty are exact.
    sound = ~np.any(scaled != 0, axis=1) & ~np.any(rows.weights != 0, axis=1)
    estimates[2:, sound], errors[2:, sound] = rows.value[sound], 0.0
    plain = _plain_errors(goal, rows, ready, shapes, law)
    while len(pending) and count <= MOST:
        ends, steady = ends_of_rows.find_ends(pending, count)
        estimates[2:, pending], errors[2:, pending] = _mean_and_error(ends)
        part = estimates[:, pending], errors[:, pending], plain[:, pending]
        # A row that is valid with 8 points may prove invalid with more points.
        sound[pending] = steady & as_good_as_plain(goal, *part)
        part[1][:2] = 0.0  # mean and u already use all points
        # With the first points, an unsteady row may only lack points to locate its ends.
        needs_more = np.where(steady, ~may_stop(goal, *part), count == first)
        pending, count = pending[needs_more], 4 * count
        progress("Monte Carlo", len(law.known) - len(pending), len(law.known))
    return estimates, errors, draws, law.known.copy(), sound


def _reduce_coordinates(model, ready):
    """Rows in few independent coordinates, and the inputs of these coordinates.

    The distribution of each row is required, not the joint distribution. Normal coordinates are
    therefore rotated until the first coordinates contain all quadratic forms. The sum of the other
    normal coordinates differs from row to row, and is represented by one additional normal
    coordinate.
    """
    normal, transform = ready.normal, ready.transform
    is_curved = np.any(model.hessians != 0, axis=(0, 1)) & normal
    # Orthonormal basis of the normal coordinates with a quadratic effect.
    rotation = np.linalg.qr(transform[np.ix_(is_curved, normal)].T).Q
    if np.count_nonzero(normal) - rotation.shape[1] < 2:
        return model.in_coordinates(transform), ready
    curved_part = transform[:, normal] @ rotation
    zero_column = np.zeros((len(normal), 1))
    rows = model.in_coordinates(np.hstack([transform[:, ~normal], curved_part, zero_column]))
    slopes = model.jacobian @ transform[:, normal]
    # Linear part orthogonal to this basis; its norm is the coefficient of the additional normal.
    slopes -= (slopes @ rotation) @ rotation.T
    rows.jacobian[:, -1] = np.linalg.norm(slopes, axis=1)
    remaining = [ready.distributions[j] for j in np.flatnonzero(~normal)]
    # The coordinate of every normal input is a unit normal.
    unit_normal = ready.distributions[np.argmax(normal)]
    return rows, inputs_of(remaining + [unit_normal] * (rotation.shape[1] + 1))


def _point_sets(ready, goal):
    """Coordinates (sets, points, n) of independent scrambled Sobol points."""
    seeds = np.random.SeedSequence(goal.seed).spawn(SETS)
    count = len(ready.mean)
    return np.stack([ready.coordinates(sobol_points(POINTS, count, seed)) for seed in seeds])


def _plain_errors(goal, rows, ready, shapes, law):
    """Standard errors (3, rows) of u and both ends for one plain draw of the linear part.

    For u: sqrt(u^4 (2 + excess)/4)/u, with the excess from the fourth moments of the inputs.
    """
    excess = [0.0 if s is None else s.fourth - 3 * s.second**2 for s in shapes]
    parts = (rows.jacobian * ready.coordinate_scale) ** 2
    second = [1.0 if s is None else s.second for s in shapes]
    variance, fourth = parts @ second, parts**2 @ excess
    variance = np.where(variance > 0, variance, 1.0)
    error_of_u = np.sqrt(np.maximum(2 * variance**2 + fourth, 0.0) / (4 * variance))
    ends = np.sqrt(goal.tail * (1 - goal.tail)) / law.density[:, [1, 4]].T
    return np.concatenate([error_of_u[None, :], ends])


def _mean_and_error(sets):
    """Mean and standard error over independent sets (first axis)."""
    with np.errstate(invalid="ignore"):
        error = np.std(sets, axis=0, ddof=1) / np.sqrt(len(sets))
    return np.mean(sets, axis=0), error


def _moments(rows, ready, forms):
    """Mean and u (sets, 2, rows): exact linear part, quadratic part from the draws.

    Both parts are uncorrelated, because the coordinates are symmetric about 0.
    """
    sd = ready.coordinate_sd
    finite = np.isfinite(sd)
    # E(e' H e) = sum_a H_aa sd_a^2 for independent coordinates.
    exact = np.einsum("kaa,a->k", rows.hessians[:, finite][:, :, finite], sd[finite] ** 2)
    is_sampled = np.any(rows.hessians[:, ~finite] != 0, axis=(1, 2))
    with np.errstate(invalid="ignore"):
        linear = np.where(rows.jacobian == 0, 0.0, rows.jacobian * sd)
    linear_variance = np.sum(linear**2, axis=1)
    means = np.array([np.where(is_sampled, form.mean(axis=0), exact) for form in forms])
    deviations = forms - means[:, None]
    # Covariance of the quadratic forms in each set.
    products = [deviation.T @ deviation / len(deviation) for deviation in deviations]
    moments = np.empty((len(forms), 2, len(linear_variance)))
    for start in range(0, len(linear_variance), ROWS):
        block = slice(start, start + ROWS)
        weights = rows.weights[block]
        moments[:, 0, block] = means @ weights.T + rows.value[block]
        for set_moments, product in zip(moments, products, strict=True):
            quadratic_variance = np.einsum("rk,rk->r", weights @ product, weights)
            set_moments[1, block] = np.sqrt(linear_variance[block] + quadratic_variance)
    return moments


class _Ends:
    """Both intervals of selected rows, from the first points of every set."""

    def __init__(self, lines, law, levels, sets, forms):
        self.lines, self.law, self.levels = lines, law, levels
        self.sets, self.forms = sets, forms
        self.score = ndtri(levels)

    def find_ends(self, rows, count):
        """Ends (sets, 4, rows) from `count` points of every set, and mask of the steady rows.

        The ends of other rows are nan.
        """
        ends = np.full((len(self.sets), 4, len(rows)), np.nan)
        steady = np.zeros(len(rows), dtype=bool)
        position = np.full(len(self.law.known), -1)
        position[rows] = np.arange(len(rows))
        for along, block in self.lines.groups(len(self.sets) * count):
            block = block[position[block] >= 0]
            if not len(block):
                continue
            columns = position[block]
            target, is_found = self._targets(along, block, PILOT[count > FIRST])
            scores, turning_share = self._scores(along, block, target, count)
            # A parabola through three levels needs increasing scores.
            rising = np.all(scores[1:] > scores[:-1], axis=(0, 1))
            usable = np.flatnonzero(is_found & rising & (turning_share <= RARE))
            base = self.lines.rows.value[block[usable]]
            relative_ends, within = self._invert(scores[..., usable], target[usable].T)
            is_inner = np.all(within, axis=0)
            ends[:, :, columns[usable[is_inner]]] = base[is_inner] + relative_ends[
                :, :, is_inner
            ].swapaxes(0, 1)
            steady[columns[usable]] = is_inner
        return ends, steady

    def _targets(self, along, block, count):
        """Values (block, levels) near the levels, from `count` draws, and mask of valid rows."""
        linear, slope = self.law.quantile[block], self.law.density[block]
        pilot = self.sets[:1, :count], self.forms[:1, :count]
        shift = np.mean(pilot[1][0] @ self.lines.rows.weights[block].T, axis=0)
        target = linear + shift[:, None]
        for _ in range(2):
            probability, _ = self.lines.differences(
                along, block, pilot, target, self.levels, linear
            )
            # Newton step with the density of the linear part.
            change = (self.levels - probability[:, 0].T) / slope
            target = target + change
            is_settled = np.max(np.abs(change) * slope) < STILL * self.levels[0]
            if is_settled and self.lines.smooth(along):
                break  # with kinks, the ends depend on the targets
        return target, np.all(np.abs(change) * slope < 0.1 * self.levels[0], axis=1)

    def _scores(self, along, block, target, count):
        """Normal scores (levels, sets, block) of the probability below the targets."""
        draws = self.sets[:, :count], self.forms[:, :count]
        linear = self.law.quantile[block]
        probability, turning_share = self.lines.differences(
            along, block, draws, target, self.levels, linear
        )
        return _scores_near(self.levels, probability), turning_share

    def _invert(self, score, target):
        """Invert the distribution function for the ends of both intervals.

        Parameters
        ----------
        score : ndarray, shape (levels, sets, block)
            Normal scores at the targets.
        target : ndarray, shape (levels, block)
            Targets.

        Returns
        -------
        ends : ndarray, shape (4, sets, block)
        within : ndarray of bool, shape (sets, block)
            True if the shortest interval lies within the levels.
        """
        lower_end, upper_end = (
            _fit_parabolas(score[:3], target[:3]),
            _fit_parabolas(score[3:], target[3:]),
        )
        lower = [lower_end(score_value) for score_value in self.score[:3]]
        upper = [upper_end(score_value) for score_value in self.score[3:]]
        first, second, third = (high - low for low, high in zip(lower, upper, strict=True))
        # The shortest length is the minimum of a parabola through the lengths at three lower
        # levels.
        curve = first - 2 * second + third
        offset = np.divide(first - third, 2 * curve, out=np.full_like(curve, 2.0), where=curve > 0)
        is_within = np.abs(offset) <= 1
        tail = self.levels[1] * (1 + (SIDES[2] - 1) * np.clip(offset, -1, 1))
        high = 1 - 2 * self.levels[1] + tail
        shortest = lower_end(ndtri(tail)), upper_end(ndtri(high))
        return np.stack([lower[1], upper[1], *shortest]), is_within


def _scores_near(levels, p):
    """ndtri(p) of p (levels, sets, rows), by Taylor's series if all are near their levels.

    z + d (1 + z d/2 + (2 z^2 + 1) d^2/6) with d = (p - level)/phi(z); the error is about (z^3 + z)
    d^4.
    """
    z = ndtri(levels)[:, None, None]
    d = (p - levels[:, None, None]) * (np.sqrt(2 * np.pi) * np.exp(z**2 / 2))
    if not max(d.max(), -d.min()) < NEAR:
        return ndtri(np.clip(p, 1e-9, 1 - 1e-9))
    series = d * ((2 * z**2 + 1) / 6)
    series += z / 2
    series *= d
    series += 1.0
    series *= d
    series += z
    return series


def _fit_parabolas(x, y):
    """Function for the parabolas through three points, x (3, sets, rows) and y (3, rows)."""
    a, b, c = x
    # Divided differences, Newton's form.
    first, second = (y[1] - y[0]) / (b - a), (y[2] - y[1]) / (c - b)
    bend = (second - first) / (c - a)
    return lambda position: y[0] + (position - a) * (first + (position - b) * bend)
