"""Examination of the volumes of a table: explain suspicious rows in turn until none is left."""

from dataclasses import dataclass

import numpy as np

from tankcal.linter.hypotheses import explain

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
    around = [size[max(k - ROUGHNESS_ROWS, 0) : k + ROUGHNESS_ROWS + 1] for k in candidates]
    roughness = np.array([ROUGHNESS_FACTOR * np.median(sizes) for sizes in around])
    candidates = candidates[size[candidates] > roughness] if len(candidates) else candidates
    if len(candidates) == 0:
        return None
    excess = size[candidates] / allowed[screened][candidates]
    return int(screened[candidates[np.argmax(excess)]])


MOST_ROUNDS = 150
_SECOND_LOOK = 10  # rows examined again about a rejected joint
_SAME_SIZE = 0.02
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
    rows.joints = [kept_joint for kept_joint in rows.joints if kept_joint != joint]
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
    rows.joints = [near_joint for near_joint in rows.joints if near_joint != joint]
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
        start = next((s for s in left if abs(s.size + shift.size) <= _tolerance(s.size)), None)
        if start is None:
            left.append(shift)
        else:
            left.remove(start)
            others.append(Fault("block", start.first, shift.first - 1, start.size))
    return [
        Fault("row", f.first, f.first, f.size) if f.kind == "block" and f.first == f.last else f
        for f in others + left
    ]


def _tolerance(size):
    """Largest difference of two sizes that are treated as equal."""
    return _SAME_SIZE * abs(size) + 3
