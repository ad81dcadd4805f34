"""Breakpoints of a table for a polyline or spline of few points: minimise the largest error.

For a polyline of K points, let E(i, j) be the largest distance of the chord from row i to row j
from the rows between. The best K points minimise D_K at the last row:

    D_k(j) = min over i < j of max(D_k-1(i), E(i, j))

The inverse problem is solved: for an error eps, the fewest chords to each row are counted
(`chords`) from both ends. eps is bisected between an error that K points reach and one that they do
not. The start value is the greedy solution, the longest chord each time. Rows that
no solution of K points within the greedy error uses are excluded.

The pieces of a natural cubic spline cannot be judged separately, so its points are a good solution,
not a proven optimum. Starting from a few rows, the row with the largest error is added each time.
Then single rows are moved while the error decreases.
"""

import sys
from dataclasses import dataclass

import numpy as np

from tankcal.products.exports import chords
from tankcal.solver.compiled import available, compile_functions

_CLOSE = 1e-9  # relative tolerance of the minimum error
_FIRST_STEP = 0.01  # first reduction relative to the greedy error
_PLAIN = 3_000_000  # loop steps; fewer take less time than loading a compiler
_MOST_TURNS = 200
_PART_AT_ONCE = 4  # one in four of the remaining rows is added at once
_MOST_MOVED = 64  # largest number of points that are move_rows
_MOST_TRIED = 1200  # largest number of splines tried
_FALL = 1e-9  # tolerance of a falling slope, relative to the mean slope


@dataclass(frozen=True)
class Breakpoints:
    """Rows that are the points of a polyline.

    Attributes
    ----------
    rows : (points,) ndarray of int
        Ascending, including the first and the last row of the table.
    error : float
        Largest distance of the polyline from the table at any height, in the unit of volumes.
    at : float
        Height of the largest distance.
    greedy : float
        Error of the greedy solution with the same number of points; nan if not computed.
    """

    rows: np.ndarray
    error: float
    at: float
    greedy: float = np.nan


@dataclass(frozen=True)
class RoundedTable:
    """A table, and its rows as written.

    Attributes
    ----------
    height, volume : ndarray, shape (rows,)
        The table, ascending.
    at, written : ndarray, shape (rows,)
        Rounded heights and volumes, with offsets.
    last, is_open : ndarray, shape (rows,)
        As in `chords`.
    loops : module
        Compiled or plain loops.
    """

    height: np.ndarray
    volume: np.ndarray
    at: np.ndarray
    written: np.ndarray
    last: np.ndarray
    is_open: np.ndarray
    loops: object

    @property
    def lines(self):
        return self.height, self.volume, self.at, self.written

    @property
    def rounding_error(self):
        """Distance of each written row from the table, shape (rows,)."""
        return np.abs(self.written - np.interp(self.at, self.height, self.volume))

    def fewest_chords(self, is_open, eps, most):
        """Fewest chords within eps to each row, and the row before it."""
        count = len(self.height)
        fewest, before = np.full(count, chords.NEVER), np.full(count, -1)
        if self.loops is chords:
            fewest, before = fewest.tolist(), before.tolist()
        arrays = self._loop_arguments(*self.lines, self.last, is_open)
        self.loops.fewest_chords(*arrays, eps, most, fewest, before)
        return np.asarray(fewest), np.asarray(before)

    def longest_chords(self, is_open, eps):
        """Rows of the path of longest chords within eps; empty if there is none."""
        rows = np.zeros(len(self.height), dtype=int)
        arrays = self._loop_arguments(*self.lines, self.last, is_open)
        return rows[: self.loops.longest_chords(*arrays, eps, rows)]

    def largest_error(self, rows):
        """Largest error of chords at rows between, and of the rows themselves."""
        between = self.loops.largest_error(*self._loop_arguments(*self.lines, rows))
        return max(float(between), float(self.rounding_error[rows].max()))

    def _loop_arguments(self, *arrays):
        """Arrays for compiled loops, lists for plain loops, which access lists faster."""
        return [array.tolist() for array in arrays] if self.loops is chords else arrays

    def reversed(self):
        """Return the table from its top down."""
        count = len(self.height)
        required = np.zeros(count, dtype=bool)
        required[self.last] = required[0] = True
        return RoundedTable(
            *(np.ascontiguousarray(-line[::-1]) for line in self.lines),
            _next_fixed(required[::-1]),
            np.ascontiguousarray(self.is_open[::-1]),
            self.loops,
        )


def best_breakpoints(height, volume, points, *, fixed=(), at=None, written=None, candidates=None):
    """Return the `Breakpoints` of at most `points` points with the smallest largest error.

    Parameters
    ----------
    height, volume : array_like, shape (rows,)
        The table, heights strictly ascending.
    points : int
        At least two, and at least the number of fixed rows.
    fixed : sequence of int, optional
        Required rows, besides the first and the last.
    at, written : array_like, optional
        Heights and volumes as written; None: those of the table.
    candidates : array_like of bool, optional
        Permitted rows; None: all.

    Returns
    -------
    Breakpoints
        The error is that of the polyline through the written points, at any height.

    Raises
    ------
    ValueError
        For fewer points than required rows.

    Examples
    --------
    >>> best = best_breakpoints([0, 1, 2, 3, 4], [0, 1, 4, 9, 16], 3)
    >>> best.rows.tolist(), best.error
    ([0, 2, 4], 1.0)
    """
    table = _table(height, volume, fixed, at, written, candidates)
    least = int(np.count_nonzero(_mark_required_rows(table)))
    if points < least:
        raise ValueError(f"{points} points, expected {least} or more: so many rows have to stand")
    rows, greedy = _greedy(table, points)
    rows = _optimum(table, points, rows)
    return Breakpoints(rows, *polyline_error(*table.lines, rows), greedy)


def fewest_breakpoints(height, volume, error, *, fixed=(), at=None, written=None, candidates=None):
    """Return the `Breakpoints` with the fewest points within an error, or None if impossible.

    Parameters
    ----------
    height, volume, fixed, at, written, candidates
        As in `best_breakpoints`.
    error : float
        Largest permitted error, in the unit of volumes.

    Examples
    --------
    >>> fewest_breakpoints([0, 1, 2, 3, 4], [0, 1, 4, 9, 16], 1.5).rows.tolist()
    [0, 2, 4]
    """
    table = _table(height, volume, fixed, at, written, candidates)
    eps = error
    for _ in range(_MOST_TURNS):  # repeated only if heights are rounded
        if eps <= 0 and error > 0:
            return None
        rows = _fewest_chords_path(table, eps, chords.NEVER)
        if rows is None:
            return None
        best = best_breakpoints(
            height, volume, len(rows), fixed=fixed, at=at, written=written, candidates=candidates
        )
        if best.error <= error * (1 + _CLOSE):
            return best
        eps -= max(best.error - error, 0.01 * error)
    return None


def polyline_error(height, volume, at, written, rows):
    """Return the largest error of the polyline through the written rows, and its height.

    Table and polyline are linear between all their heights, so the largest error is at one of
    these. The polyline is constant beyond its ends.

    Parameters
    ----------
    height, volume : ndarray, shape (rows,)
        The table.
    at, written : ndarray, shape (rows,)
        Heights and volumes as written.
    rows : ndarray of int
        Rows of the polyline.
    """
    heights = np.union1d(height, at[rows])
    exact = np.interp(heights, height, volume)
    error = np.abs(np.interp(heights, at[rows], written[rows]) - exact)
    worst = int(np.argmax(error))
    return float(error[worst]), float(heights[worst])


def _table(height, volume, fixed, at, written, candidates):
    height, volume = (np.ascontiguousarray(values, dtype=float) for values in (height, volume))
    at = height if at is None else np.ascontiguousarray(at, dtype=float)
    written = volume if written is None else np.ascontiguousarray(written, dtype=float)
    required = np.zeros(len(height), dtype=bool)
    required[list(fixed)] = required[0] = required[-1] = True
    is_open = required | (True if candidates is None else np.asarray(candidates, dtype=bool))
    return RoundedTable(
        height, volume, at, written, _next_fixed(required), is_open, _loops(len(height))
    )


def _next_fixed(required):
    """Next required row after each row, shape (rows,); the last row for itself."""
    fixed = np.flatnonzero(required)
    place = np.searchsorted(fixed, np.arange(len(required)), side="right")
    return fixed[np.minimum(place, len(fixed) - 1)]


def _mark_required_rows(table):
    required = np.zeros(len(table.height), dtype=bool)
    required[table.last] = required[0] = True
    return required


def _loops(rows):
    """Return the loops, compiled if the number of steps is large."""
    if rows * rows < _PLAIN or not available():
        return chords
    return compile_functions(sys.modules[chords.__name__], chords.COMPILED)


def _open_rows(table, eps):
    """Mask (rows,): permitted rows with an own error of at most eps."""
    return table.is_open & (table.rounding_error <= eps * (1 + _CLOSE))


def _fewest_chords_path(table, eps, most):
    """Rows of a path of the fewest chords within eps, at most `most` chords.

    None if there is none.
    """
    is_open = _open_rows(table, eps)
    if not np.all(is_open[_mark_required_rows(table)]):
        return None
    fewest, before = table.fewest_chords(is_open, eps, most)
    return _trace_path(before) if fewest[-1] <= most else None


def _trace_path(before):
    rows = [len(before) - 1]
    while rows[-1] > 0:
        rows.append(int(before[rows[-1]]))
    return np.array(rows[::-1])


def _greedy(table, points):
    """(rows, error) of the better of the two greedy solutions, from the bottom and from the top."""
    up = _greedy_path(table, points)
    down = len(table.height) - 1 - _greedy_path(table.reversed(), points)[::-1]
    error, rows = min(
        ((table.largest_error(rows), rows) for rows in (up, down)), key=lambda solution: solution[0]
    )
    return rows, error


def _greedy_path(table, points):
    """Rows of the longest chords, at most `points` points, with the smallest error."""
    low, high, best = 0.0, 2 * float(np.ptp(table.volume)) + float(table.rounding_error.max()), None
    for _ in range(_MOST_TURNS):
        eps = high if best is None else 0.5 * (low + high)
        # Rows of the longest chords within eps; empty if a required row has a larger error.
        is_open = _open_rows(table, eps)
        rows = (
            table.longest_chords(is_open, eps)
            if np.all(is_open[_mark_required_rows(table)])
            else ()
        )
        if best is None or 0 < len(rows) <= points:
            best, high = rows, min(eps, max(table.largest_error(rows), low))
        else:
            low = eps
        if high - low <= _CLOSE * high:
            break
    return best


def _optimum(table, points, rows):
    """Rows with the smallest error; `rows` are those of the greedy solution."""
    high, low, step = table.largest_error(rows), 0.0, _FIRST_STEP
    table = _restrict(table, high, points)
    for _ in range(_MOST_TURNS):
        if high - low <= _CLOSE * high:
            break
        eps = 0.5 * (low + high) if low > 0 else high * (1 - min(step, 0.5))
        better = _fewest_chords_path(table, eps, points - 1)
        if better is None:
            low = eps
            continue
        step *= 2
        rows, best = better, table.largest_error(better)
        high = max(min(best, eps), low)
        table = _restrict(table, high, points)
    return rows


def _restrict(table, eps, points):
    """Return the table restricted to rows on a path of at most `points` points within eps."""
    if np.count_nonzero(table.is_open) <= points:
        return table
    is_open = _open_rows(table, eps)
    back = table.reversed()
    up, _ = table.fewest_chords(is_open, eps, points - 1)
    down, _ = back.fewest_chords(np.ascontiguousarray(is_open[::-1]), eps, points - 1)
    is_open = is_open & (up + down[::-1] <= points - 1)
    return RoundedTable(*table.lines, table.last, is_open, table.loops)


def spline_breakpoints(height, volume, points, *, fixed=(), at=None, written=None, candidates=None):
    """Return `Breakpoints` of at most `points` points of a natural cubic spline, or None.

    Parameters
    ----------
    height, volume, points, fixed, at, written, candidates
        As in `breakpoints.best_breakpoints`.

    Returns
    -------
    Breakpoints or None
        The error bounds the distance of the spline from the table at any height. None if no
        spline found is monotone.
    """
    search = _SplineSearch(height, volume, at, written)
    count = len(search.height)
    is_open = np.ones(count, dtype=bool) if candidates is None else np.array(candidates, dtype=bool)
    required = sorted({0, count - 1, *fixed})
    is_open[required] = True
    rows = search.add_rows(required, np.flatnonzero(is_open), points)
    if len(rows) <= _MOST_MOVED:
        rows = search.move_rows(rows, set(required), is_open)
    error, where, is_rising = search.judge(rows)
    return Breakpoints(np.array(rows), error, where) if is_rising else None


def fewest_spline_breakpoints(height, volume, error, *, most, **options):
    """Return `Breakpoints` of a spline with few points within an error, at most `most`, or None."""
    low, high, best = 2, most, None
    while low <= high:
        points = (low + high) // 2
        solution = spline_breakpoints(height, volume, points, **options)
        if solution is not None and solution.error <= error:
            best, high = solution, min(points, len(solution.rows)) - 1
        else:
            low = points + 1
    return best


def spline_error(height, volume, at, written, rows):
    """(bound of the error of the spline through the written rows at any height, its height)."""
    error, where, _ = _SplineSearch(height, volume, at, written).judge(rows)
    return error, where


class _SplineSearch:
    """A table, its rows as written, and splines through some of them."""

    def __init__(self, height, volume, at, written):
        self.height, self.volume = (np.asarray(values, dtype=float) for values in (height, volume))
        self.at = self.height if at is None else np.asarray(at, dtype=float)
        self.written = self.volume if written is None else np.asarray(written, dtype=float)

    def _spline(self, rows):
        from scipy.interpolate import CubicSpline

        kind = "natural" if len(rows) > 2 else "not-a-knot"
        return CubicSpline(self.at[rows], self.written[rows], bc_type=kind)

    def judge(self, rows):
        """Return (bound of the error at any height, height of the worst row, whether it rises).

        Between two heights the spline differs from its own chord by at most max |s''| d^2/8, and
        s'' is linear there.
        """
        spline, ends = self._spline(rows), self.at[[rows[0], rows[-1]]]
        heights = np.union1d(self.height, self.at[rows])
        inside = np.clip(heights, *ends)
        off = np.abs(spline(inside) - np.interp(heights, self.height, self.volume))
        bend = np.abs(spline(inside, 2))
        beside = np.maximum(off[1:], off[:-1]) + np.maximum(bend[1:], bend[:-1]) * (
            np.diff(inside) ** 2 / 8
        )
        worst = int(np.argmax(off))
        return (
            max(float(beside.max()), float(off[worst])),
            float(heights[worst]),
            is_rising_spline(spline),
        )

    def add_rows(self, rows, free, points):
        """Return the rows with the worst rows added, up to `points` rows."""
        rows = list(rows)
        while len(rows) < points:
            off = np.abs(self._spline(rows)(self.at[free]) - self.volume[free])
            off[np.isin(free, rows)] = -1.0
            piece = np.searchsorted(rows, free)
            order = np.argsort(-off)
            _, first = np.unique(piece[order], return_index=True)
            worst = order[np.sort(first)][: max(1, (points - len(rows)) // _PART_AT_ONCE)]
            new = [int(free[k]) for k in worst if off[k] >= 0]
            if not new:
                break
            rows = sorted({*rows, *new})
        return rows

    def move_rows(self, rows, required, is_open):
        """Return the rows move_rows singly, by decreasing steps, while the error decreases."""
        rows, best, left = list(rows), self._rank(rows), _MOST_TRIED
        step = max(len(self.height) // (2 * len(rows)), 1)
        while step and left > 0:
            before = best
            for n in range(1, len(rows) - 1):
                for row in (rows[n] + step, rows[n] - step):
                    is_free = rows[n] not in required and rows[n - 1] < row < rows[n + 1]
                    if not is_free or not is_open[row]:
                        continue
                    tried, left = [*rows[:n], row, *rows[n + 1 :]], left - 1
                    rank = self._rank(tried)
                    if rank < best:
                        rows, best = tried, rank
            if best == before:
                step //= 2
        return rows

    def _rank(self, rows):
        """Sort key: rising splines before falling ones, then by error."""
        error, _, is_rising = self.judge(rows)
        return (not is_rising, error)


def is_rising_spline(spline):
    """Whether a cubic spline falls nowhere, judged at its knots and at the minima of its slope."""
    slope = spline.derivative()
    knots = spline.x
    bend = spline.derivative(2)
    turns = bend.roots(extrapolate=False)
    places = np.concatenate([knots, turns[np.isfinite(turns)]])
    mean = (spline(knots[-1]) - spline(knots[0])) / (knots[-1] - knots[0])
    return bool(np.all(slope(places) >= -_FALL * abs(mean)))
