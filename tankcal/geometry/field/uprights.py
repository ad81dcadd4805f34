"""Upright columns of accepted readings that stand off a wall as no seam of it is likely to.

A pipe along a generatrix that one column of points meets in every ring agrees with itself: each of
its points is what the others predict, for from them the amplitude of seams was learned. So a column
S is tested as one hypothesis, a jump d that all its points share. With P of `blunders`, from which
what is aside is eliminated, and e = P y, the rest predicts

    d = 1' e_S / 1' P_SS 1,  of variance 1 / 1' P_SS 1,

and amplitudes are learned from what stands on no such column: else it explains itself.

Source: Cook & Weisberg 1982 (mean-shift outliers).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from tankcal.geometry.field.amplitudes import likely_variances
from tankcal.geometry.field.blunders import NOTHING_LEFT, Piece, carried_over
from tankcal.geometry.field.cells import MOST_SITES
from tankcal.geometry.field.likelihood import LEAST_NOISE_M
from tankcal.geometry.outlines import FULL_TURN

LINK_M, WIDEST_M = 0.2, 0.4  # along the arc: between points of a column, and over all of them
LEAST_RINGS, LEAST_SHARE = 3, 0.5  # that have a point of a column: their number, and share of all
LEAST_M, PART = 0.020, 0.25  # jump of a column, and share of it by which each of its points departs
LEAST_W = 5.0  # standard deviations of the jump
FEWEST = 16  # columns of a survey: of fewer the others do not tell what its wall has
MOST_SHARE = 0.25  # of all columns, that are tested: the others tell what walls have
MOST_ROUNDS = 4


def find_uprights(sites, radius_m, variance_m2, nominal_m, tested, sure, scatter_m):
    """Mark columns of accepted readings that are not likely to be of the wall.

    Parameters
    ----------
    sites : Sites
        Of n readings.
    radius_m, variance_m2, nominal_m
        As in `blunders.find_blunders`.
    tested : Tested
        What that found.
    sure : ndarray of bool, shape (n,)
        Readings that are known to be of the wall.
    scatter_m : float
        Of the wall about its smooth form (standard deviation): within LEAST_W of it nothing is far.

    Returns
    -------
    ndarray of bool, shape (n,)
        None where there are more than MOST_SITES readings, or fewer than FEWEST columns.
    """
    found, every = np.zeros(len(sites), dtype=bool), _columns(sites, tested.accepted, nominal_m)
    if len(sites) > MOST_SITES or not _may_stand_off(sites, radius_m, every):
        return found
    piece, left = Piece(sites, np.arange(len(sites)), nominal_m), radius_m - radius_m.mean()

    def without(sizes):
        noise = sizes[-1] * variance_m2 + LEAST_NOISE_M**2
        precision = piece.precision(sizes[:-1], noise)[0][:, :]  # most of its columns are asked for
        return _eliminated(precision, precision @ left, np.flatnonzero(~tested.accepted))

    sizes, least = tested.sizes_m2, max(LEAST_M, LEAST_W * scatter_m)
    rest = without(sizes)
    jumps = [_jump(*rest, one) for one in every if not sure[one].any()]
    far = [one for one in jumps if abs(one.size_m) > least and _is_tall(sites, one.members)]
    far.sort(key=lambda one: -abs(one.size_m))
    columns = [one.members for one in far[: int(MOST_SHARE * len(every))]]
    for _ in range(MOST_ROUNDS):
        if not columns:
            return found
        known = tested.accepted.copy()
        known[np.concatenate(columns)] = False
        some = radius_m[known], variance_m2[known]
        sizes = likely_variances(sites.take(known), *some, nominal_m, sizes)
        count, columns = len(columns), _unlikely(*without(sizes), columns, least)
        if len(columns) == count:
            break
    for one in columns:
        found[one] = True
    return found


def _unlikely(precision, pull, columns, least_m):
    """Those of the columns that are so far off at least, and not likely to be of the wall."""
    together = np.concatenate(columns)
    block, own = precision[np.ix_(together, together)], pull[together]
    ends, found = np.cumsum([0, *map(len, columns)]), []
    for column, start, stop in zip(columns, ends, ends[1:], strict=False):
        mine = np.arange(start, stop)
        jump = _jump(*_eliminated(block, own, np.delete(np.arange(len(own)), mine)), mine)
        if abs(jump.size_m) > least_m and abs(jump.w) > LEAST_W:
            found.append(column)
    return found


@dataclass(frozen=True)
class _Jump:
    """Of a column: by how much, that over its standard deviation, and who takes part in it."""

    size_m: float
    w: float
    members: np.ndarray


def _eliminated(precision, pull, aside):
    """P and P y of the heading without readings that are aside, whose rows mean nothing then."""
    if not len(aside):
        return precision, pull
    to = carried_over(precision, aside)[1]
    return precision - to @ precision[aside], pull - to @ pull[aside]


def _jump(precision, pull, column):
    """`_Jump` of a column (k,)."""
    weight, own = precision[np.ix_(column, column)], pull[column]
    total = max(weight.sum(), 1e-300)
    size = own.sum() / total
    each = scipy.linalg.pinvh(weight, rtol=NOTHING_LEFT) @ own
    return _Jump(size, size * np.sqrt(total), column[each * np.sign(size) > PART * abs(size)])


def _columns(sites, accepted, nominal_m):
    """Arrays of accepted readings one above another, in enough of the rings."""
    chosen = np.flatnonzero(accepted)
    turn = sites.azimuth_rad[chosen] % FULL_TURN
    order = np.argsort(turn)
    gap = np.diff(turn[order], prepend=turn[order[-1]] - FULL_TURN) * nominal_m
    starts = np.flatnonzero(gap > LINK_M)
    if not len(starts):
        return []
    parts = np.split(np.roll(chosen[order], -starts[0]), starts[1:] - starts[0])
    return [one for one in parts if _is_tall(sites, one) and _is_narrow(sites, one, nominal_m)]


def _may_stand_off(sites, radius_m, columns):
    """Whether a column departs from the mean of those beside it by half a jump, at least."""
    if len(columns) < FEWEST:
        return False
    ring = np.unique(sites.ring, return_inverse=True)[1]
    means = np.bincount(ring, radius_m) / np.bincount(ring)
    off = np.array([np.mean(radius_m[one] - means[ring[one]]) for one in columns])
    return np.any(np.abs(off - (np.roll(off, 1) + np.roll(off, -1)) / 2) > LEAST_M / 2)


def _is_tall(sites, column):
    """Whether it has a point in enough of the rings."""
    count = len(np.unique(sites.ring[column]))
    return count >= max(LEAST_RINGS, LEAST_SHARE * len(np.unique(sites.ring)))


def _is_narrow(sites, column, nominal_m):
    away = np.angle(np.exp(1j * (sites.azimuth_rad[column] - sites.azimuth_rad[column[0]])))
    return np.ptp(away) * nominal_m < WIDEST_M
