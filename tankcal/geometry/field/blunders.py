"""Blunders among the readings of a wall: each reading is tested against all other readings.

With V the covariance of the readings (field and noise) and X the design of the parameters without
prior,

    P = V^-1 - V^-1 X (X' V^-1 X)^-1 X' V^-1,  e = P y:

All other readings predict the reading y_i as y_i - e_i / P_ii. The difference has the variance 1 /
P_ii, so the test statistic is w_i = e_i / sqrt(P_ii). The accepted readings predict the rejected
readings S with the differences P_SS^-1 e_S, of covariance P_SS^-1. P_SS is singular if the accepted
readings do not determine the parameters without prior (all points of a course, or of a ring, are
rejected). Its pseudo-inverse then compares the rejected readings with each other, up to these
parameters. A reading that agrees with its neighbours along the wall belongs to the wall, however
large their common departure.

P follows from the inverse W of the Cholesky factor U of V = U' U:

    P = W W' - Z Z',  Z Z' = V^-1 X (X' V^-1 X)^-1 X' V^-1.

Its diagonal and its products with vectors are available immediately. Columns, required only for the
few rejected readings, are computed on demand.

Source: Cook & Weisberg 1982 (deletion residuals); Baarda 1968.

Columns of accepted readings off the wall
-----------------------------------------

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

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from tankcal.adjust import CRITICAL, snoop
from tankcal.geometry.field.amplitudes import likely_variances
from tankcal.geometry.field.likelihood import LEAST_NOISE_M, invert
from tankcal.geometry.field.sites import MOST_SITES, Covariances, free_design
from tankcal.units import FULL_TURN

MOST_ROUNDS = 4  # rounds: amplitudes from the accepted readings, then tests of all readings
FEW = 0.005  # share of readings that change between accepted and rejected, at convergence
AT_ONCE = 0.9  # a pass rejects all readings whose statistic reaches this part of the largest
PIECE = 200  # approximate number of readings in a test, if all are too many for a field
MOST_SD = 30  # ratio of predicted to prior sd above which a reading counts as uncontrolled
NOTHING_LEFT = 1e-9  # relative to the largest eigenvalue of P_SS: smaller ones are rounding
LINK_M, WIDEST_M = 0.2, 0.4  # along the arc: largest gap in a column, and its largest width
LEAST_RINGS, LEAST_SHARE = 3, 0.5  # rings with a point of the column: least number, least share
LEAST_M, PART = 0.020, 0.25  # least jump of a column; least share of the jump at each point
LEAST_W = 5.0  # least jump in standard deviations
FEWEST = 16  # least number of columns: fewer do not determine the amplitudes of the wall
MOST_SHARE = 0.25  # largest share of tested columns: the others determine the amplitudes


@dataclass(frozen=True)
class ReadingTests:
    """Accepted and rejected readings, and their departures from the prediction.

    Attributes
    ----------
    accepted : ndarray of bool, shape (n,)
    departure_m : ndarray, shape (n,)
        Outward departure from the wall that the other accepted readings determine, m.
    w : ndarray, shape (n,)
        Departure over its standard deviation.
    sd_m : ndarray, shape (n,)
        Standard deviation of the departure, m; very large for a reading without control.
    sizes_m2 : ndarray, shape (components + 1,), optional
        Variances of the components in the test, and factor on the variance of the readings.
    """

    accepted: np.ndarray
    departure_m: np.ndarray
    w: np.ndarray
    sd_m: np.ndarray
    sizes_m2: np.ndarray | None = None


def empty_tests(accepted):
    """Return a `ReadingTests` with zeros, to be filled."""
    zero_rows = np.zeros((3, len(accepted)))
    return ReadingTests(accepted.copy(), *zero_rows)


def find_blunders(sites, radius_m, variance_m2, nominal_m, accepted, barred=None, may_go=True):
    """Test each reading of a wall by all others, with amplitudes from the accepted readings.

    Parameters
    ----------
    sites : Sites
        n readings.
    radius_m : ndarray, shape (n,)
        Distances from the axis, m.
    variance_m2 : ndarray, shape (n,)
        Variances of the readings, known up to a common factor, m2.
    nominal_m : float
        Radius of the tank, m.
    accepted : ndarray of bool, shape (n,)
        Readings accepted at the start.
    barred : ndarray of bool, shape (n,), optional
        Readings that remain rejected, whatever their statistic; None: no reading.
    may_go : ndarray of bool, shape (n,), optional
        Readings that may be rejected. All other readings remain accepted and also determine the
        amplitudes: a rough wall is less certain between the readings.

    Returns
    -------
    ReadingTests
    """
    barred = np.zeros(len(sites), dtype=bool) if barred is None else barred
    may_go = np.broadcast_to(may_go, len(sites))
    accepted = (accepted | ~may_go) & ~barred
    pieces = [Piece(sites, members, nominal_m) for members in _split_readings(sites)]
    centred, results, sizes = radius_m - radius_m.mean(), empty_tests(accepted), None
    for _ in range(MOST_ROUNDS):
        accepted_sites = sites.take(accepted)
        accepted_readings = radius_m[accepted], variance_m2[accepted]
        # Amplitudes of the last round are the start values of the next round.
        sizes = likely_variances(accepted_sites, *accepted_readings, nominal_m, sizes)
        variances, noise = sizes[:-1], sizes[-1]
        for piece in pieces:
            chosen = piece.members
            piece_noise = noise * variance_m2[chosen] + LEAST_NOISE_M**2
            # A reading that the others hardly predict cannot be tested: the limit is relative to
            # its prior sd.
            precision, before_m = piece.precision(variances, piece_noise)
            pull, most_sd = precision @ centred[chosen], MOST_SD * before_m
            tested = snoop_wall(
                precision, pull, accepted[chosen], may_go[chosen], most_sd, barred[chosen]
            )
            for name in ("accepted", "departure_m", "w", "sd_m"):
                getattr(results, name)[chosen] = getattr(tested, name)
        changed, accepted = np.mean(results.accepted != accepted), results.accepted.copy()
        if changed <= FEW:
            break
    return replace(results, sizes_m2=sizes)


def _split_readings(sites):
    """Return lists of readings that are tested together.

    Up to MOST_SITES readings form a single list. More readings are divided into sectors of belts of
    courses. The number of courses in a belt is about the number of pieces around it.
    """
    count = 1 if len(sites) <= MOST_SITES else len(sites) / PIECE
    by_course = np.argsort(sites.course, kind="stable")
    pieces = []
    for belt in np.array_split(
        np.arange(sites.course.max() + 1),
        int(np.clip(round(np.sqrt(count)), 1, sites.course.max() + 1)),
    ):
        members = by_course[np.isin(sites.course[by_course], belt)]
        order = members[np.argsort(sites.azimuth_rad[members] % FULL_TURN, kind="stable")]
        pieces += np.array_split(order, max(round(count * len(order) / len(sites)), 1))
    return pieces


class Piece:
    """Some of the readings, and their covariance as a part of the wall.

    Parameters
    ----------
    sites : Sites
    members : ndarray of int, shape (k,)
        Indices of the readings.
    nominal_m : float
        Radius of the tank, m.
    """

    def __init__(self, sites, members, nominal_m):
        self.members, member_sites = members, sites.take(members)
        self._covariances = Covariances(member_sites, nominal_m)
        self._design = free_design(member_sites)[0]

    def precision(self, variances_m2, noise_m2):
        """Return the `Precision` of the readings, and their prior standard deviations (k,), m.

        The arguments are the variances of the components and of the noise (k,), m2.
        """
        covariance = self._covariances.total(variances_m2)
        covariance.flat[:: len(covariance) + 1] += noise_m2
        prior_sd = np.sqrt(np.diag(covariance))
        return Precision(covariance, self._design), prior_sd


class Precision:
    """P for a covariance (n, n), which is overwritten, and a design (n, p).

    The class has the array operations that tests of readings require: `diagonal()`, products with a
    vector, and columns, P[rows, columns] with rows and columns from `numpy.ix_` or a slice.

    Examples
    --------
    >>> precision = Precision(np.diag([1.0, 0.5]), np.ones((2, 1)))
    >>> precision.diagonal().round(9), precision[:, [1]].round(9).ravel()
    (array([0.66666667, 0.66666667]), array([-0.66666667,  0.66666667]))
    """

    def __init__(self, covariance, design):
        # The matrix is symmetric: its transpose is in the column order of LAPACK.
        root, info = scipy.linalg.lapack.dpotrf(covariance.T, overwrite_a=True)
        if info:
            raise np.linalg.LinAlgError("Matrix is not positive definite")
        self._half = scipy.linalg.lapack.dtrtri(root, overwrite_c=True)[0]
        white = self._times(design, transposed=True)
        normal = scipy.linalg.pinvh(white.T @ white)  # the points may not determine a parameter
        self._by_design = self._times(white)
        self._back = self._by_design @ normal
        self._known = np.zeros(len(covariance), dtype=bool)
        self._columns = np.empty_like(self._half)  # filled on demand, see `_known`

    def diagonal(self):
        """Return the diagonal (n,) of P."""
        unrestricted = np.einsum("ij,ij->i", self._half, self._half)
        return unrestricted - np.sum(self._back * self._by_design, axis=1)

    def __matmul__(self, vector):
        unrestricted = self._half @ (self._half.T @ vector)
        return unrestricted - self._back @ (self._by_design.T @ vector)

    def __getitem__(self, places):
        rows, columns = (
            selection if isinstance(selection, slice) else np.ravel(selection)
            for selection in places
        )
        index = np.arange(len(self._known))[columns]
        # Compute only the columns that no earlier request has computed.
        new = index[~self._known[index]]
        if len(new):
            unrestricted = self._times(self._half[new].T)
            self._columns[:, new] = unrestricted - self._back @ self._by_design[new].T
            self._known[new] = True
        return self._columns[:, index][rows]

    def _times(self, columns, *, transposed=False):
        """Return W @ columns, or W' @ columns if transposed."""
        return scipy.linalg.blas.dtrmm(1.0, self._half, columns, trans_a=transposed)


def restricted_precision(covariance, design):
    """Return P of the module docstring as an array (n, n); the design has the shape (n, p)."""
    # `invert` allocates a new array, which is overwritten by P.
    inverse = invert(covariance)[1]
    by_design = inverse @ design
    normal = scipy.linalg.pinvh(design.T @ by_design)  # the points may not determine a parameter
    inverse -= (by_design @ normal) @ by_design.T
    return inverse


def snoop_wall(precision, pull, accepted, may_go=True, most_sd_m=np.inf, barred=False):
    """Reject one reading after another and return the result of the last test.

    Parameters
    ----------
    precision : Precision or ndarray, shape (n, n)
        P of the module docstring.
    pull : ndarray, shape (n,)
        P y.
    accepted : ndarray of bool, shape (n,)
        Readings accepted at the start.
    may_go : ndarray of bool, shape (n,), optional
        Readings that may be rejected.
    most_sd_m : ndarray, shape (n,), optional
        Readings whose departures have a larger standard deviation are not rejected, m.
    barred : ndarray of bool, shape (n,), optional
        Readings that remain rejected.

    Returns
    -------
    ReadingTests
    """

    def tests(result):
        statistic = np.abs(result.w) * may_go * (result.sd_m < most_sd_m)
        return result.accepted, np.where(barred, np.nan, statistic), CRITICAL

    def again(previous, goes, comes):
        return judge_by_others(precision, pull, previous.accepted & ~goes | comes)

    start = judge_by_others(precision, pull, accepted)
    return snoop(start, tests, again, at_once=AT_ONCE, returns=1).adjustment


def eliminators(precision, aside):
    """Return P_SS^-1 and P_.S P_SS^-1 of rejected readings S, the terms that eliminate S from P."""
    inverse_block = scipy.linalg.pinvh(precision[np.ix_(aside, aside)], rtol=NOTHING_LEFT)
    return inverse_block, precision[:, aside] @ inverse_block


def judge_by_others(precision, pull, accepted):
    """Return `ReadingTests` from P and P y of the module docstring.

    Parameters
    ----------
    precision : Precision or ndarray, shape (n, n)
        P.
    pull : ndarray, shape (n,)
        P y.
    accepted : ndarray of bool, shape (n,)

    Returns
    -------
    ReadingTests
    """
    rejected = np.flatnonzero(~accepted)
    departure, weight = pull.copy(), precision.diagonal().copy()
    if len(rejected):
        inverse_block, eliminator = eliminators(precision, rejected)
        # Eliminate S: the accepted rows of P and P y refer to the accepted readings alone.
        departure -= eliminator @ pull[rejected]
        weight -= np.sum(eliminator * precision[:, rejected], axis=1)
        # Rejected readings: difference P_SS^-1 e_S with the variances diag(P_SS^-1).
        departure[rejected], weight[rejected] = inverse_block @ pull[rejected], 1.0
        weight[rejected] = 1 / np.diag(inverse_block)
        departure[rejected] *= weight[rejected]
    # departure holds e_i and weight P_ii: their quotient is the difference in metres.
    weight = np.maximum(weight, 1e-300)
    return ReadingTests(accepted, departure / weight, departure / np.sqrt(weight), weight**-0.5)


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
