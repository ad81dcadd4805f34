"""Examination of the volumes of a table: explain suspicious rows in turn until none is left.

The simplest sufficient hypothesis explains a suspicious row (`explain`).

Null hypotheses: the rows are smooth after all (a polynomial, or the series of a lying cylinder at
its end), or the area of the cross section jumps (a joint, an edge of deadwood). The curves through
the rows on both sides of a jump then meet between its two rows. Alternatives: one volume is wrong,
two neighbouring volumes are swapped, some rows are shifted together, or two volumes are wrong.

An alternative is accepted if it leaves only rounding about a cubic (or lower degree) while no
hypothesis with fewer parameters does. If rows are too far apart for that, it must leave at most a
sixth of the residuals of the best null hypothesis.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

# Screening of a table: does each volume agree with its neighbours?
#
# A cubic through the rows around row i, without row i, predicts its volume. Rows rounded to a
# quantum q have errors of at most q/2 each, so the prediction differs from the row by at most
# q/2 (1 + sum |w|), with w the weights of the prediction. A larger difference is not rounding.
# For a table rougher than its rounding (accumulated rounding, or rows too far apart for a cubic),
# the limit is its own roughness, the running median of these differences.
# Source of the leave-one-out formula: Allen 1974, Technometrics 16(1) 125-127 (PRESS).

DEGREE, WINDOW = 3, 13
FEWEST_ROWS = 6  # fewest rows of a screened stretch
LEAST_REMAINDER = 1e-6  # smallest 1 - leverage; below it, other rows do not predict the row
ROUGHNESS_ROWS, ROUGHNESS_FACTOR = 25, 6.0
WIDTHS = 17, 11  # numbers of rows examined together; the second if no simple hypothesis fits
PLAIN = 4  # number of parameters of a cubic
MOST_IN_FEW = 4  # largest number of parameters for few rows: a line and one wrong row
BETTER_FACTOR = 6.0
LEAST_SIZE = 2.5  # smallest error of a volume that rounding does not explain, quanta
POINTS_BETWEEN, TOUCH = 9, 0.02  # points between two rows; smallest relative gap of touching curves
_LEAST_FREE = 1e-6  # smallest share of a block that the curve does not absorb
PRICE = 3.0  # penalty of a parameter, in twice the log likelihood; about the log of the rows


@dataclass
class ScreenedRows:
    """The rows under examination; findings modify them.

    Attributes
    ----------
    height : ndarray, shape (rows,)
        Ascending, in steps of the table.
    volume : ndarray, shape (rows,)
        In quanta; corrected where a finding explains an error.
    is_sound : ndarray of bool, shape (rows,)
        False for rows with a wrong volume.
    is_settled : ndarray of bool, shape (rows,)
        True for rows whose difference is explained.
    joints : set of int
        Rows that begin a new stretch; the table is not smooth across them.
    weight : ndarray, shape (rows,)
        1 if only the volume is rounded, less if the height is rounded as well.
    noise : float
        Largest rounding error of a row of weight 1, in quanta.
    """

    height: np.ndarray
    volume: np.ndarray
    is_valid: np.ndarray
    is_settled: np.ndarray
    joints: list
    weight: np.ndarray
    noise: float

    def window(self, row, width):
        """Return at most `width` rows of the same stretch around a row, including the row."""
        valid = np.flatnonzero(self.is_valid)
        stretch = np.searchsorted(self.joints, valid, side="right")
        place = int(np.searchsorted(valid, row))
        low, high = np.searchsorted(stretch, [stretch[place], stretch[place] + 1])
        start = int(np.clip(place - width // 2, low, max(low, high - width)))
        return valid[start : min(start + width, high)]


def leave_one_out(rows):
    """Return row minus prediction (rows,) and its limit by rounding (rows,), in quanta, weighted.

    The limit is infinite for rows that are not screened.
    """
    difference, allowed = np.zeros(len(rows.height)), np.full(len(rows.height), np.inf)
    valid = np.flatnonzero(rows.is_valid)
    stretch = np.searchsorted(rows.joints, valid, side="right")
    low = np.searchsorted(stretch, stretch, side="left")
    high = np.searchsorted(stretch, stretch, side="right")
    screened = np.flatnonzero(high - low >= FEWEST_ROWS)
    if len(screened) == 0:
        return difference, allowed
    start = np.clip(
        screened - WINDOW // 2, low[screened], np.maximum(low[screened], high[screened] - WINDOW)
    )
    place = start[:, None] + np.arange(WINDOW)
    is_in = place < high[screened][:, None]
    others = valid[np.minimum(place, len(valid) - 1)]
    row = valid[screened]
    apart = (rows.height[others] - rows.height[row][:, None]) * is_in
    # Heights scaled to 1 keep the powers of the cubic well conditioned.
    apart /= np.abs(apart).max(axis=1)[:, None]
    weight = rows.weight[others] * is_in
    basis = apart[..., None] ** np.arange(DEGREE + 1) * weight[..., None]
    values = (rows.volume[others] - rows.volume[row][:, None]) * weight
    q, _ = np.linalg.qr(basis)
    number = np.arange(len(screened))
    # Row of the hat matrix: prediction with the row. Division by 1 - leverage removes the row.
    hat = np.einsum("nk,njk->nj", q[number, screened - start], q)
    leverage = hat[number, screened - start]
    remainder = np.maximum(1 - leverage, LEAST_REMAINDER)
    difference[row] = -np.einsum("nj,nj->n", hat, values) / remainder
    weights = (np.abs(hat).sum(axis=1) - leverage) / remainder  # sum |w| of the prediction
    is_predicted = 1 - leverage > LEAST_REMAINDER
    allowed[row] = np.where(is_predicted, rows.noise * (1 + weights) * (1 + 1e-9), np.inf)
    return difference, allowed


def most_suspicious(rows):
    """Row with the largest difference relative to its limit, or None if all rows are explained."""
    difference, allowed = leave_one_out(rows)
    screened = np.flatnonzero(np.isfinite(allowed))
    if len(screened) == 0:
        return None
    size = np.abs(difference[screened])
    candidates = np.flatnonzero((size > allowed[screened]) & ~rows.is_settled[screened])
    # Among rows of exact heights, a row of rounded height has a small weight. Its weighted
    # difference is below the roughness of the others, so that in quanta is compared as well.
    is_rough = [_is_rough(size, k) and _is_rough(size / rows.weight[screened], k)
                for k in candidates]  # fmt: skip
    candidates = candidates[~np.array(is_rough, dtype=bool)]
    if len(candidates) == 0:
        return None
    excess = size[candidates] / allowed[screened][candidates]
    return int(screened[candidates[np.argmax(excess)]])


def _is_rough(size, k):
    """Whether the difference of row k is usual among the rows around it."""
    around = size[max(k - ROUGHNESS_ROWS, 0) : k + ROUGHNESS_ROWS + 1]
    return size[k] <= ROUGHNESS_FACTOR * np.median(around)


MOST_ROUNDS = 150
_SECOND_LOOK = 10  # rows examined again about a rejected joint
_SAME_SIZE = 0.02  # largest relative difference of sizes treated as equal, beside 3 quanta
_FEWEST_FOR_SLOPES = 4  # rows
# Area of the cross section in the last interval over that of the intervals before it. If the last
# step is shorter, curves through the rows predict it poorly, but no tank doubles its area.
_INTERVALS_BEFORE_LAST, _LEAST_RATIO, _MOST_RATIO = 3, 0.25, 2.0


@dataclass(frozen=True)
class Fault:
    """An error of some rows.

    Attributes
    ----------
    kind : str
        "row", "swap", "block" (rows first to last have a common error) or "shift" (all from first).
    first, last : int
        Rows concerned, numbered within the table.
    size : float
        Error of the volumes, quanta; 0 for a swap.
    """

    kind: str
    first: int
    last: int
    size: float


@dataclass(frozen=True)
class Examination:
    """Result of an examination.

    Attributes
    ----------
    faults : tuple of Fault
        In the order of the table.
    joints : tuple of int
        Rows after which the area of the cross section or its derivative jumps.
    volume : ndarray, shape (rows,)
        Corrected volumes, quanta; nan for wrong rows.
    complete : bool
        False if the table is too rough for a complete examination.
    """

    faults: tuple[Fault, ...]
    joints: tuple[int, ...]
    volume: np.ndarray
    complete: bool


def examine(height, volume, rounding):
    """Return the `Examination` of ascending heights, in steps, and volumes, in quanta.

    All arrays have shape (rows,). rounding is the largest rounding error of each height, in steps:
    0 for a multiple of a step.
    """
    count = len(height)
    noise = 0.5 + 8e-16 * float(np.abs(volume).max())
    steepest = _slopes_around(np.abs(np.diff(volume) / np.diff(height)))
    rows = ScreenedRows(
        np.asarray(height, dtype=float),
        np.array(volume, dtype=float),
        np.ones(count, dtype=bool),
        np.zeros(count, dtype=bool),
        [],
        noise / (noise + steepest * rounding),
        noise,
    )
    faults, doubtful, doubted, moved = _check_last_row(rows, rounding), [], set(), set()
    for _ in range(MOST_ROUNDS):
        row = most_suspicious(rows)
        if row is None:
            if not doubtful:
                break
            _reopen(rows, doubtful.pop())
            continue
        best = _test_other_joint(rows, explain(rows, row), moved)
        if best.kind == "joint" and best.rows[0] not in rows.joints:
            rows.joints = sorted([*rows.joints, best.rows[0]])
            if best.excess > 1 and best.rows[0] not in doubted:
                doubtful.append(best.rows[0])
                doubted.add(best.rows[0])
        elif best.is_null:
            rows.is_settled[row] = True
        else:
            faults += _apply(rows, best)
    else:
        row = -1
    corrected = np.where(rows.is_valid, rows.volume, np.nan)
    faults = tuple(sorted(_merge_shifts(faults, count), key=lambda fault: fault.first))
    return Examination(faults, tuple(rows.joints), corrected, row != -1)


def _check_last_row(rows, rounding):
    """Return a list with the Fault of the last row, if its interval implies twice the area."""
    height, volume = rows.height, rows.volume
    if len(height) < FEWEST_ROWS:
        return []
    before = slice(-_INTERVALS_BEFORE_LAST - 2, -1)
    areas = np.diff(volume[before]) / np.diff(height[before])
    rise = volume[-1] - volume[-2] - 2 * rows.noise
    apart = height[-1] - height[-2] + rounding[-1] + rounding[-2]
    are_alike = areas.min() > _LEAST_RATIO * areas.max()
    if not are_alike or rise <= _MOST_RATIO * areas.max() * apart:
        return []
    last = len(height) - 1
    expected = volume[-2] + areas[-1] * (height[-1] - height[-2])
    rows.is_valid[-1] = False
    return [Fault("row", last, last, float(volume[-1] - expected))]


def _slopes_around(slope):
    """Larger slope (rows,) beside each row, excluding the two intervals that end at the row.

    A wrong volume makes these two intervals steep, which would raise the limit for rounding of
    heights.
    """
    count = len(slope) + 1
    if count < _FEWEST_FOR_SLOPES:
        return np.maximum(np.append(slope, slope[-1]), np.append(slope[0], slope))
    below = np.concatenate([np.full(2, -np.inf), slope[: count - 2]])
    above = np.concatenate([slope[1:], np.full(2, -np.inf)])
    return np.maximum(below, above)


def _reopen(rows, joint):
    """Examine rows again without a joint that leaves more than rounding."""
    rows.joints = [other for other in rows.joints if other != joint]
    rows.is_settled[max(joint - _SECOND_LOOK, 0) : joint + _SECOND_LOOK] = False


def _test_other_joint(rows, best, moved):
    """Return the best hypothesis; a wrong row beside a joint may be a joint elsewhere.

    moved: joints already tested.
    """
    beside = [j for j in rows.joints if best.kind == "row" and best.rows[0] in (j, j - 1)]
    if not beside or beside[0] in moved:
        return best
    joint = beside[0]
    moved.add(joint)
    rows.joints = [other for other in rows.joints if other != joint]
    alternative = explain(rows, best.rows[0])
    if alternative.kind == "joint" and alternative.rows[0] != joint:
        return alternative
    rows.joints = sorted([*rows.joints, joint])
    return best


def _apply(rows, best):
    """Return the faults of an alternative; correct its rows, or exclude them from now on."""
    first, last = best.rows[0], best.rows[-1]
    if best.kind == "swap":
        rows.volume[[first, last]] = rows.volume[[last, first]]
        return [Fault("swap", first, last, 0.0)]
    if best.kind in ("row", "pair"):
        wrong = dict(zip(best.rows if best.kind == "pair" else (first,), best.sizes, strict=True))
        rows.is_valid[list(wrong)] = False
        return [
            Fault("row", row, row, size)
            for row, size in wrong.items()
            if not _is_below_zero(rows.volume[row], size)
        ]
    end = len(rows.height) if last is None else last + 1
    rows.volume[first:end] -= best.sizes[0]
    return [Fault(best.kind, first, end - 1, best.sizes[0])]


def _is_below_zero(volume, size):
    """Whether an expected volume is so far below zero that the row is right, as near the bottom.

    The tank may be empty above its bottom, or tilted; zero is then nearer to the row.
    """
    expected = volume - size
    return volume >= 0 and expected < 0 and -expected > 0.5 * size


def _merge_shifts(faults, count):
    """Merge opposite shifts into a block, and a block of one row into a wrong row."""
    shifts = sorted((f for f in faults if f.kind == "shift"), key=lambda fault: fault.first)
    others = [f for f in faults if f.kind != "shift"]
    left = []
    for shift in shifts:
        start = next(
            (s for s in left if abs(s.size + shift.size) <= _SAME_SIZE * abs(s.size) + 3), None
        )
        if start is None:
            left.append(shift)
        else:
            left.remove(start)
            others.append(Fault("block", start.first, shift.first - 1, start.size))
    return [
        Fault("row", f.first, f.first, f.size) if f.kind == "block" and f.first == f.last else f
        for f in others + left
    ]


@dataclass(frozen=True)
class Hypothesis:
    """An explanation of a few rows.

    Attributes
    ----------
    kind : str
        "smooth", "joint", "row", "swap", "block", "shift" or "pair".
    parameters : int
        Number of parameters.
    rss : float
        Sum of squares of the residuals, quanta.
    excess : float
        Largest residual over its limit by rounding; above 1: more than rounding.
    rows : tuple
        (first, last) rows concerned; last None: all rows from first.
    sizes : tuple of float
        Errors of the rows, quanta.
    """

    kind: str
    parameters: int
    rss: float
    excess: float
    rows: tuple = ()
    sizes: tuple = ()

    @property
    def is_null(self):
        """Whether no volume is wrong by this hypothesis."""
        return self.kind in ("smooth", "joint")

    @property
    def is_significant(self):
        """Whether it is a null hypothesis, or its size exceeds the effect of two rounded digits."""
        return not self.sizes or max(abs(size) for size in self.sizes) >= LEAST_SIZE


@dataclass(frozen=True)
class Curve:
    """Least-squares curve of values (n,) with a basis (n, p); residuals are weighted.

    noise: largest rounding error of a row of weight 1.
    """

    basis: np.ndarray
    values: np.ndarray
    weight: np.ndarray
    noise: float

    @property
    def parameters(self):
        """Number of parameters."""
        return self.basis.shape[1]

    @cached_property
    def _qr(self):
        return np.linalg.qr(self.basis * self.weight[:, None])

    @cached_property
    def residual_maker(self):
        """Matrix (n, n) from weighted values to residuals."""
        q = self._qr[0]
        return np.eye(len(self.values)) - q @ q.T

    @cached_property
    def residuals(self):
        """Weighted residuals (n,)."""
        return self.residual_maker @ (self.values * self.weight)

    @cached_property
    def rss(self):
        """Sum of squares of the weighted residuals."""
        return float(self.residuals @ self.residuals)

    @cached_property
    def excess(self):
        """Largest residual over its limit by rounding; 0 if the curve fits any values."""
        if len(self.values) <= self.parameters:
            return 0.0
        return _excess(self.residuals, self.residual_maker, self.noise)

    def at(self, basis):
        """Values (m,) and their largest errors by rounding (m,) at rows (m, p) of the basis."""
        q, r = self._qr
        # weights of the observed values in the predicted values
        weights = q @ np.linalg.solve(r.T, basis.T)
        return (self.values * self.weight) @ weights, self.noise * np.abs(weights).sum(axis=0)


def _excess(residuals, maker, noise):
    """Largest residual over its limit by rounding."""
    allowed = noise * np.abs(maker).sum(axis=1)
    return float((np.abs(residuals) / np.maximum(allowed, 1e-9 * noise)).max())


def explain(rows, row):
    """Return the accepted `Hypothesis` about a suspicious row."""
    hypothesis = _explain(rows, row, WIDTHS[0])
    if hypothesis.is_null and hypothesis.excess > 1:
        closer = _explain(rows, row, WIDTHS[1])
        is_plain = closer.excess <= 1 and closer.parameters <= MOST_IN_FEW
        return closer if is_plain else hypothesis
    return hypothesis


def _explain(rows, row, width):
    """Select a `Hypothesis` about a row from a window of `width` rows."""
    members = rows.window(row, width)
    x = rows.height[members] - rows.height[row]
    scale = np.abs(x).max() if len(x) > 1 else 1.0
    x, y = x / scale, rows.volume[members] - rows.volume[row]
    weight = rows.weight[members]
    curves = [Curve(basis, y, weight, rows.noise) for basis in _bases(rows, members, x)]
    hypotheses = [Hypothesis("smooth", c.parameters, c.rss, c.excess) for c in curves]
    hypotheses += _joints(Curve(x, y, weight, rows.noise), members)
    for curve in curves:
        if len(x) - curve.parameters >= 4:
            hypotheses += _blocks(curve, members, _ends(rows, members))
            hypotheses += _swaps(curve, members)
    return _select_hypothesis(hypotheses, curves, members, rows.noise)


def _bases(rows, members, x):
    """Polynomials of degree 1 to 5, and the series of a lying cylinder at the ends of the table."""
    bases = [x[:, None] ** np.arange(degree + 1) for degree in range(1, 6) if len(x) >= degree + 3]
    valid = np.flatnonzero(rows.is_valid)
    # The volume of a lying cylinder grows with the power 1.5 of the height above its end.
    powers = np.array([0, 1.5, 2, 2.5, 3, 3.5])
    for is_end, away in (
        (members[0] == valid[0], x - x[0]),
        (members[-1] == valid[-1], x[-1] - x),
    ):
        if is_end and len(x) >= 9:
            bases += [(away[:, None] / away.max()) ** powers[:count] for count in (4, 6)]
    return bases


def _ends(rows, members):
    """Whether the members begin, and end, at an end of the table or at a joint."""
    begins = members[0] in (0, *rows.joints)
    return begins, members[-1] + 1 in (len(rows.height), *rows.joints)


def _blocks(curve, members, ends):
    """Hypotheses of one row, or of neighbouring rows, with a common error.

    At an end of the table or a joint, "all but the first" is replaced by a wrong first row. The
    last row only is not a shift of the rows that follow.
    """
    count = len(members)
    first, end = np.triu_indices(count + 1, 1)
    is_all_but_first = (first == 1) & (end == count)
    keep = (first == 0) & (end == 1) if ends[0] else (first >= 1)
    keep |= (first >= 1) & ~is_all_but_first
    first, end = first[keep], end[keep]
    number = np.arange(count)[:, None]
    blocks = ((number >= first) & (number < end)) * curve.weight[:, None]
    maker, residuals = curve.residual_maker, curve.residuals
    # A block adds one column to the basis: its size and the rss follow without another fit.
    moved = maker @ blocks
    norm = np.einsum("nk,nk->k", blocks, moved)
    # relative, as a row with a rounded height has a small weight
    keep = norm > _LEAST_FREE * np.einsum("nk,nk->k", blocks, blocks)
    first, end, moved, norm = first[keep], end[keep], moved[:, keep], norm[keep]
    size = residuals @ blocks[:, keep] / norm
    rss = np.maximum(curve.rss - size**2 * norm, 0.0)
    parameters = curve.parameters
    hypotheses = []
    for k in np.argsort(rss)[:12]:
        remaining = residuals - size[k] * moved[:, k]
        # residual maker of the basis with the block
        maker_left = maker - np.outer(moved[:, k], moved[:, k]) / norm[k]
        excess = _excess(remaining, maker_left, curve.noise) if parameters <= PLAIN else np.inf
        low, high = int(members[first[k]]), int(members[end[k] - 1])
        is_open = end[k] == count
        if end[k] - first[k] == 1 and (ends[1] or not is_open):
            kind, price = "row", 2
        else:
            kind, price = ("shift", 2) if is_open else ("block", 3)
        where = (low, None) if kind == "shift" else (low, high)
        hypotheses.append(
            Hypothesis(kind, parameters + price, float(rss[k]), excess, where, (float(size[k]),))
        )
    return hypotheses


def _swaps(curve, members):
    """Hypotheses of two neighbouring volumes swapped."""
    hypotheses = []
    maker = curve.residual_maker
    for first in range(len(members) - 1):
        values = curve.values.copy()
        values[[first, first + 1]] = values[[first + 1, first]]
        remaining = maker @ (values * curve.weight)
        parameters = curve.parameters
        excess = _excess(remaining, maker, curve.noise) if parameters <= PLAIN else np.inf
        where = (int(members[first]), int(members[first + 1]))
        rss = float(remaining @ remaining)
        hypotheses.append(Hypothesis("swap", parameters + 1, rss, excess, where))
    return hypotheses


def _joints(all_rows, members):
    """Hypotheses of two rising curves that meet between two rows.

    They cross at a joint of courses; at the edge of a cone they only touch.
    """
    hypotheses, x = [], all_rows.basis
    bottom = 0 if members[0] == 0 else 1  # bottoms have varied shapes; two rows are enough
    for cut in range(2, len(x) - 1):
        between = np.linspace(x[cut - 1], x[cut], POINTS_BETWEEN)
        left = _side(all_rows, slice(0, cut), between, bottom)
        right = _side(all_rows, slice(cut, None), between, 1)
        for low, low_values, low_allowed in left:
            for high, high_values, high_allowed in right:
                gap = high_values - low_values
                allowed = np.maximum(low_allowed + high_allowed, TOUCH * np.abs(gap).max())
                is_meeting = gap.min() <= 0 <= gap.max() or np.any(np.abs(gap) <= allowed)
                parameters = low.parameters + high.parameters
                if is_meeting and len(x) >= parameters + 2:
                    excess = max(low.excess, high.excess)
                    where = (int(members[cut]), None)
                    hypotheses.append(
                        Hypothesis("joint", parameters, low.rss + high.rss, excess, where)
                    )
    return hypotheses


def _side(all_rows, part, between, spare):
    """Curves of degree 1 to 3: (curve, values between two rows, their errors by rounding).

    Only curves that do not fall there, with `spare` more rows than parameters.
    """
    curves, x = [], all_rows.basis[part]
    for degree in (1, 2, 3):
        if len(x) > degree + spare:
            powers = np.arange(degree + 1)
            basis, values = x[:, None] ** powers, all_rows.values[part]
            curve = Curve(basis, values, all_rows.weight[part], all_rows.noise)
            values, allowed = curve.at(between[:, None] ** powers)
            if values[-1] - values[0] >= -(allowed[0] + allowed[-1]):
                curves.append((curve, values, allowed))
    return curves


def _pairs(curve, members):
    """Best hypothesis of two wrong rows with independent errors."""
    maker, residuals = curve.residual_maker, curve.residuals
    first, second = np.triu_indices(len(members), 1)
    a, b, c = maker[first, first], maker[first, second], maker[second, second]
    determinant = a * c - b**2
    keep = determinant > 1e-6
    first, second, a, b, c = (v[keep] for v in (first, second, a, b, c))
    determinant = determinant[keep]
    if len(first) == 0:
        return []
    size_1 = (c * residuals[first] - b * residuals[second]) / determinant
    size_2 = (a * residuals[second] - b * residuals[first]) / determinant
    rss = curve.rss - size_1 * residuals[first] - size_2 * residuals[second]
    k = int(np.argmin(rss))
    where = (int(members[first[k]]), int(members[second[k]]))
    sizes = (
        float(size_1[k] / curve.weight[first[k]]),
        float(size_2[k] / curve.weight[second[k]]),
    )
    parameters = curve.parameters + 4
    return [Hypothesis("pair", parameters, max(float(rss[k]), 0.0), np.inf, where, sizes)]


def _select_hypothesis(hypotheses, curves, members, noise):
    """Select the simplest hypothesis within rounding, or else the hypothesis of least cost.

    Null hypotheses are preferred to alternatives, and these to two wrong rows.
    """
    count = len(members)

    def cost(hypothesis):
        """Twice the negative log likelihood, with a penalty for each parameter."""
        return count * np.log(hypothesis.rss / count + noise**2 / 3) + PRICE * hypothesis.parameters

    hypotheses = [hypothesis for hypothesis in hypotheses if hypothesis.is_significant]
    possible = [s for s in hypotheses if s.excess <= 1 + 1e-6]
    if possible:
        return min(possible, key=lambda s: (s.parameters, not s.is_null, s.rss))
    null = min(
        (s for s in hypotheses if s.is_null), key=cost, default=Hypothesis("smooth", 0, 0, 0)
    )
    alternatives = [s for s in hypotheses if not s.is_null]
    margin = 2 * count * np.log(BETTER_FACTOR)
    best = min(alternatives, key=cost, default=null)
    if cost(best) + margin < cost(null):
        return best
    pairs = [
        hypothesis
        for curve in curves
        if curve.parameters <= PLAIN and count - curve.parameters >= 6
        for hypothesis in _pairs(curve, members)
    ]
    best = min(pairs, key=cost, default=null)
    return best if cost(best) + margin < cost(null) else null
