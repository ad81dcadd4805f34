"""The estimates of rows that are quadratic in a few inputs: means over independent point sets.

u from that of the linear part, exact, and the covariance of the forms; the ends by inverting the
distribution function, known at three levels about each end, that quadratic.Lines estimates.
Sources: JCGM 101:2008 7.6, 7.7; randomised point sets: Owen 1998.
"""

import numpy as np
from scipy.special import ndtri

from tankcal.gum.monte_carlo.goal import as_good_as_plain, may_stop
from tankcal.gum.monte_carlo.inputs import inputs_of
from tankcal.gum.monte_carlo.linear import linear_law, shapes_of
from tankcal.gum.monte_carlo.quadratic import RARE, Lines
from tankcal.gum.monte_carlo.sobol import sobol_points

SETS = 10  # independent point sets
POINTS = 2048  # of a set; intervals take FIRST to MOST of them
FIRST, MOST = 8, 1024  # eight of each set are mostly worth 1e7 plain draws
SEEN = 2.0  # points of all sets beyond an end that are looked at, at least
PILOT = 16, 64  # points of the first set that place the ends: at first, and where they are too few
STILL = 0.01  # of the lowest level: targets on a smooth law that moved by less are placed
NEAR = 0.005  # scores that are taken by Taylor's series, to 1e-8
ROWS = 1024  # of which the moments are computed at once: they stay in the processor's cache
SIDES = np.array([0.6, 1.0, 1.4])  # levels about an end, by that end's own


def table_estimates(model, ready, goal, progress):
    """Estimates and errors (6, rows), draws, control (rows,), and which rows are sound.

    A row is not sound where its quadratic part is too large for one parabola to be followed, its
    shortest interval lies far from the symmetric one, or plain draws would be as good. The ends of
    such a row are nan: another method has to find them.
    """
    rows, ready = _in_few_coordinates(model, ready)
    sets = _point_sets(ready, goal)
    forms = np.stack([rows.forms(e) for e in sets])
    shapes = shapes_of(ready)
    lines = Lines(rows, ready.normal, shapes, ready.coordinate_scale)
    levels = np.concatenate([SIDES * goal.tail, 1 - SIDES[::-1] * goal.tail])
    scaled = rows.jacobian * ready.coordinate_scale
    law = linear_law(scaled, ready.normal, shapes, levels)
    moments = _moments(rows, ready, forms)
    found = _Ends(lines, law, levels, sets, forms)
    estimates, errors = np.full((2, 6, len(rows.value)), np.nan)  # what nobody fills shows
    estimates[:2], errors[:2] = _mean_and_error(moments)
    draws = np.full(len(rows.value), SETS * POINTS)
    first = FIRST
    while SETS * first * goal.tail < SEEN:
        first *= 4
    pending, count = np.flatnonzero(law.known), first
    sound = ~np.any(scaled != 0, axis=1) & ~np.any(rows.weights != 0, axis=1)
    estimates[2:, sound], errors[2:, sound] = rows.value[sound], 0.0
    plain = _plain(goal, rows, ready, shapes, law)
    while len(pending) and count <= MOST:
        ends, steady = found.of(pending, count)
        estimates[2:, pending], errors[2:, pending] = _mean_and_error(ends)
        part = estimates[:, pending], errors[:, pending], plain[:, pending]
        # more points may show what fewer hid: a row that was sound with 8 need not stay so
        sound[pending] = steady & as_good_as_plain(goal, *part)
        part[1][:2] = 0.0  # mean and u come from all points already
        # the first points may be too few to place the ends of a row that is steady
        again = np.where(steady, ~may_stop(goal, *part), count == first)
        pending, count = pending[again], 4 * count
        progress("Monte Carlo", len(law.known) - len(pending), len(law.known))
    return estimates, errors, draws, law.known.copy(), sound


def _in_few_coordinates(model, ready):
    """The rows in independent coordinates, with the inputs whose coordinates these are.

    What is asked is the law of each row by itself. So normal coordinates are turned until all
    forms lie in the first of them; of the others each row has a sum of its own, one more normal.
    """
    normal, transform = ready.normal, ready.transform
    bent = np.any(model.hessians != 0, axis=(0, 1)) & normal
    turn = np.linalg.qr(transform[np.ix_(bent, normal)].T).Q
    if np.count_nonzero(normal) - turn.shape[1] < 2:
        return model.in_coordinates(transform), ready
    first = transform[:, normal] @ turn
    nothing = np.zeros((len(normal), 1))
    rows = model.in_coordinates(np.hstack([transform[:, ~normal], first, nothing]))
    slopes = model.jacobian @ transform[:, normal]
    slopes -= (slopes @ turn) @ turn.T
    rows.jacobian[:, -1] = np.linalg.norm(slopes, axis=1)
    others = [ready.distributions[j] for j in np.flatnonzero(~normal)]
    unit = ready.distributions[np.argmax(normal)]  # of any normal input the coordinate is the same
    return rows, inputs_of(others + [unit] * (turn.shape[1] + 1))


def _point_sets(ready, goal):
    seeds = np.random.SeedSequence(goal.seed).spawn(SETS)
    count = len(ready.mean)
    return np.stack([ready.coordinates(sobol_points(POINTS, count, seed)) for seed in seeds])


def _plain(goal, rows, ready, shapes, law):
    """(3, rows) standard errors of u and both ends from one plain draw of the linear part.

    sqrt(u^4 (2 + excess)/4)/u for u, the excess from the fourth moments of the inputs.
    """
    excess = [0.0 if s is None else s.fourth - 3 * s.second**2 for s in shapes]
    parts = (rows.jacobian * ready.coordinate_scale) ** 2
    second = [1.0 if s is None else s.second for s in shapes]
    variance, fourth = parts @ second, parts**2 @ excess
    variance = np.where(variance > 0, variance, 1.0)
    of_u = np.sqrt(np.maximum(2 * variance**2 + fourth, 0.0) / (4 * variance))
    ends = np.sqrt(goal.tail * (1 - goal.tail)) / law.density[:, [1, 4]].T
    return np.concatenate([of_u[None, :], ends])


def _mean_and_error(sets):
    with np.errstate(invalid="ignore"):
        error = np.std(sets, axis=0, ddof=1) / np.sqrt(len(sets))
    return np.mean(sets, axis=0), error


def _moments(rows, ready, forms):
    """(sets, 2, rows) mean and u: exact for the linear part, from the draws for what is added.

    The two are uncorrelated: the coordinates are symmetric about 0.
    """
    sd = ready.coordinate_sd
    finite = np.isfinite(sd)
    exact = np.einsum("kaa,a->k", rows.hessians[:, finite][:, :, finite], sd[finite] ** 2)
    drawn = np.any(rows.hessians[:, ~finite] != 0, axis=(1, 2))
    with np.errstate(invalid="ignore"):
        linear = np.where(rows.jacobian == 0, 0.0, rows.jacobian * sd)
    alone = np.sum(linear**2, axis=1)
    middles = np.array([np.where(drawn, form.mean(axis=0), exact) for form in forms])
    abouts = forms - middles[:, None]
    products = [about.T @ about / len(about) for about in abouts]
    found = np.empty((len(forms), 2, len(alone)))
    for start in range(0, len(alone), ROWS):
        some = slice(start, start + ROWS)
        weights = rows.weights[some]
        found[:, 0, some] = middles @ weights.T + rows.value[some]
        for of_set, product in zip(found, products, strict=True):
            added = np.einsum("rk,rk->r", weights @ product, weights)
            of_set[1, some] = np.sqrt(alone[some] + added)
    return found


class _Ends:
    """Both intervals of chosen rows from the first points of every set."""

    def __init__(self, lines, law, levels, sets, forms):
        self.lines, self.law, self.levels = lines, law, levels
        self.sets, self.forms = sets, forms
        self.score = ndtri(levels)

    def of(self, rows, count):
        """(sets, 4, rows) ends from `count` points of every set, nan where a row is not steady."""
        ends = np.full((len(self.sets), 4, len(rows)), np.nan)
        steady = np.zeros(len(rows), dtype=bool)
        place = np.full(len(self.law.known), -1)
        place[rows] = np.arange(len(rows))
        for along, block in self.lines.groups(len(self.sets) * count):
            block = block[place[block] >= 0]
            if not len(block):
                continue
            at = place[block]
            target, unbent = self._targets(along, block, PILOT[count > FIRST])
            scores, near = self._scores(along, block, target, count)
            rising = np.all(scores[1:] > scores[:-1], axis=(0, 1))
            sound = np.flatnonzero(unbent & rising & (near <= RARE))
            base = self.lines.rows.value[block[sound]]
            found, within = self._invert(scores[..., sound], target[sound].T)
            inner = np.all(within, axis=0)
            ends[:, :, at[sound[inner]]] = base[inner] + found[:, :, inner].swapaxes(0, 1)
            steady[at[sound]] = inner
        return ends, steady

    def _targets(self, along, block, count):
        """(block, levels) values near the levels, from `count` draws, and which are found."""
        linear, slope = self.law.quantile[block], self.law.density[block]
        pilot = self.sets[:1, :count], self.forms[:1, :count]
        shift = np.mean(pilot[1][0] @ self.lines.rows.weights[block].T, axis=0)
        target = linear + shift[:, None]
        for _ in range(2):
            found, _ = self.lines.differences(along, block, pilot, target, self.levels, linear)
            moved = (self.levels - found[:, 0].T) / slope
            target = target + moved
            still = np.max(np.abs(moved) * slope) < STILL * self.levels[0]
            if still and self.lines.smooth(along):
                break  # where there are kinks the ends hang on the targets
        return target, np.all(np.abs(moved) * slope < 0.1 * self.levels[0], axis=1)

    def _scores(self, along, block, target, count):
        """(levels, sets, block) normal scores of the probability below the targets."""
        draws = self.sets[:, :count], self.forms[:, :count]
        linear = self.law.quantile[block]
        found, near = self.lines.differences(along, block, draws, target, self.levels, linear)
        return _scores_near(self.levels, found), near

    def _invert(self, score, target):
        """(4, sets, block) ends of both intervals, and (sets, block) whether the shortest lies
        inside the levels; score (levels, sets, block), target (levels, block).
        """
        below, above = _parabolas(score[:3], target[:3]), _parabolas(score[3:], target[3:])
        lower = [below(one) for one in self.score[:3]]
        upper = [above(one) for one in self.score[3:]]
        first, second, third = (high - low for low, high in zip(lower, upper, strict=True))
        curve = first - 2 * second + third
        offset = np.divide(first - third, 2 * curve, out=np.full_like(curve, 2.0), where=curve > 0)
        within = np.abs(offset) <= 1
        tail = self.levels[1] * (1 + (SIDES[2] - 1) * np.clip(offset, -1, 1))
        high = 1 - 2 * self.levels[1] + tail
        shortest = below(ndtri(tail)), above(ndtri(high))
        return np.stack([lower[1], upper[1], *shortest]), within


def _scores_near(levels, p):
    """ndtri(p) of p (levels, sets, rows), by Taylor's series where all are near their levels.

    z + d (1 + z d/2 + (2 z^2 + 1) d^2/6), d = (p - level)/phi(z), short by some (z^3 + z) d^4
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


def _parabolas(x, y):
    """Those through three points each, x (3, sets, rows) and y (3, rows), as one function."""
    a, b, c = x
    first, second = (y[1] - y[0]) / (b - a), (y[2] - y[1]) / (c - b)
    bend = (second - first) / (c - a)
    return lambda at: y[0] + (at - a) * (first + (at - b) * bend)
