"""Upright columns of accepted readings with a distance from the wall that is unlikely for a seam.

A column of points that meets a pipe along a generatrix in every ring is consistent in itself. The
other points of the column predict each of its points, since the amplitude of seams was estimated
from them. The column S is therefore tested as a single hypothesis, a jump d common to all its
points. With P of `blunders`, after elimination of rejected readings, and e = P y, the other
readings predict

    d = 1' e_S / 1' P_SS 1,  of variance 1 / 1' P_SS 1.

The amplitudes are estimated from readings outside such columns; otherwise a column would explain
itself.

Source: Cook & Weisberg 1982 (mean-shift outliers).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from tankcal.geometry.field.amplitudes import likely_variances
from tankcal.geometry.field.blunders import NOTHING_LEFT, Piece, eliminators
from tankcal.geometry.field.cells import MOST_SITES
from tankcal.geometry.field.likelihood import LEAST_NOISE_M
from tankcal.units import FULL_TURN

LINK_M, WIDEST_M = 0.2, 0.4  # along the arc: largest gap in a column, and its largest width
LEAST_RINGS, LEAST_SHARE = 3, 0.5  # rings with a point of the column: least number, least share
LEAST_M, PART = 0.020, 0.25  # least jump of a column; least share of the jump at each point
LEAST_W = 5.0  # least jump in standard deviations
FEWEST = 16  # least number of columns: fewer do not determine the amplitudes of the wall
MOST_SHARE = 0.25  # largest share of tested columns: the others determine the amplitudes
MOST_ROUNDS = 4  # rounds of estimation and test


def find_uprights(sites, radius_m, variance_m2, nominal_m, tested, sure, scatter_m):
    """Mark columns of accepted readings that are unlikely to belong to the wall.

    Parameters
    ----------
    sites : Sites
        n readings.
    radius_m, variance_m2, nominal_m
        As in `blunders.find_blunders`.
    tested : ReadingTests
        Result of `blunders.find_blunders`.
    sure : ndarray of bool, shape (n,)
        Readings that certainly belong to the wall.
    scatter_m : float
        Scatter of the wall about its smooth form (standard deviation), m. Smaller jumps than
        LEAST_W times the scatter are not tested.

    Returns
    -------
    ndarray of bool, shape (n,)
        All False for more than MOST_SITES readings, or fewer than FEWEST columns.
    """
    marked, all_columns = (
        np.zeros(len(sites), dtype=bool),
        _find_columns(sites, tested.accepted, nominal_m),
    )
    if len(sites) > MOST_SITES or not _may_stand_off(sites, radius_m, all_columns):
        return marked
    piece, centred = Piece(sites, np.arange(len(sites)), nominal_m), radius_m - radius_m.mean()

    def without(sizes):
        noise = sizes[-1] * variance_m2 + LEAST_NOISE_M**2
        precision = piece.precision(sizes[:-1], noise)[0][:, :]  # most of its columns are required
        return _eliminate(precision, precision @ centred, np.flatnonzero(~tested.accepted))

    sizes, least_jump = tested.sizes_m2, max(LEAST_M, LEAST_W * scatter_m)
    reduced = without(sizes)
    jumps = [_jump(*reduced, item) for item in all_columns if not sure[item].any()]
    distant = [
        item for item in jumps if abs(item.size_m) > least_jump and _is_tall(sites, item.members)
    ]
    # The largest jumps first; the remaining columns must suffice to estimate the amplitudes.
    distant.sort(key=lambda item: -abs(item.size_m))
    columns = [item.members for item in distant[: int(MOST_SHARE * len(all_columns))]]
    for _ in range(MOST_ROUNDS):
        if not columns:
            return marked
        kept = tested.accepted.copy()
        kept[np.concatenate(columns)] = False
        kept_readings = radius_m[kept], variance_m2[kept]
        sizes = likely_variances(sites.take(kept), *kept_readings, nominal_m, sizes)
        count, columns = len(columns), _select_unlikely(*without(sizes), columns, least_jump)
        if len(columns) == count:
            break
    for item in columns:
        marked[item] = True
    return marked


def _select_unlikely(precision, pull, columns, least_m):
    """Return the columns with a significant jump of at least least_m."""
    all_members = np.concatenate(columns)
    block, block_pull = precision[np.ix_(all_members, all_members)], pull[all_members]
    limits, selected = np.cumsum([0, *map(len, columns)]), []
    for column, start, stop in zip(columns, limits, limits[1:], strict=False):
        members = np.arange(start, stop)
        # Eliminate the other columns of the selection: each is tested against regular wall only.
        jump = _jump(
            *_eliminate(block, block_pull, np.delete(np.arange(len(block_pull)), members)), members
        )
        if abs(jump.size_m) > least_m and abs(jump.w) > LEAST_W:
            selected.append(column)
    return selected


@dataclass(frozen=True)
class _Jump:
    """Jump of a column, its ratio to its standard deviation, and the members that share it."""

    size_m: float
    w: float
    members: np.ndarray


def _eliminate(precision, pull, eliminated):
    """Return P and P y after elimination of readings, whose rows are then meaningless."""
    if not len(eliminated):
        return precision, pull
    eliminator = eliminators(precision, eliminated)[1]
    return precision - eliminator @ precision[eliminated], pull - eliminator @ pull[eliminated]


def _jump(precision, pull, column):
    """Return the `_Jump` of a column (k,)."""
    weight, column_pull = precision[np.ix_(column, column)], pull[column]
    total = max(weight.sum(), 1e-300)
    size = column_pull.sum() / total
    # Jump of each reading without the others; readings with a small part of the jump do not share
    # it.
    single_jumps = scipy.linalg.pinvh(weight, rtol=NOTHING_LEFT) @ column_pull
    return _Jump(
        size, size * np.sqrt(total), column[single_jumps * np.sign(size) > PART * abs(size)]
    )


def _find_columns(sites, accepted, nominal_m):
    """Return index arrays of accepted readings one above another, in enough of the rings."""
    accepted_indices = np.flatnonzero(accepted)
    turn = sites.azimuth_rad[accepted_indices] % FULL_TURN
    order = np.argsort(turn)
    # Divide the turn at gaps wider than LINK_M; the division starts at a gap, not within a column.
    gap = np.diff(turn[order], prepend=turn[order[-1]] - FULL_TURN) * nominal_m
    starts = np.flatnonzero(gap > LINK_M)
    if not len(starts):
        return []
    parts = np.split(np.roll(accepted_indices[order], -starts[0]), starts[1:] - starts[0])
    return [
        column
        for column in parts
        if _is_tall(sites, column) and _is_narrow(sites, column, nominal_m)
    ]


def _may_stand_off(sites, radius_m, columns):
    """Whether a column departs from the mean of its neighbours by at least half a jump.

    This quick test avoids an unnecessary estimation.
    """
    if len(columns) < FEWEST:
        return False
    ring = np.unique(sites.ring, return_inverse=True)[1]
    means = np.bincount(ring, radius_m) / np.bincount(ring)
    departures = np.array([np.mean(radius_m[column] - means[ring[column]]) for column in columns])
    return np.any(
        np.abs(departures - (np.roll(departures, 1) + np.roll(departures, -1)) / 2) > LEAST_M / 2
    )


def _is_tall(sites, column):
    """Whether a column has points in enough of the rings."""
    count = len(np.unique(sites.ring[column]))
    return count >= max(LEAST_RINGS, LEAST_SHARE * len(np.unique(sites.ring)))


def _is_narrow(sites, column, nominal_m):
    """Whether the width of a column is below WIDEST_M."""
    differences = np.angle(np.exp(1j * (sites.azimuth_rad[column] - sites.azimuth_rad[column[0]])))
    return np.ptp(differences) * nominal_m < WIDEST_M
