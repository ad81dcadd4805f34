"""Points of a natural cubic spline, for systems that interpolate by a spline.

The pieces of a spline cannot be judged separately, so the result is a good solution, not a proven
optimum. Starting from a few rows, the row with the largest error is added each time. Then single
rows are move_rows while the error decreases.
"""

import numpy as np

from tankcal.exports.breakpoints import Breakpoints

_PART_AT_ONCE = 4  # one in four of the remaining rows is added at once
_MOST_MOVED = 64  # largest number of points that are move_rows
_MOST_TRIED = 1200  # largest number of splines tried
_FALL = 1e-9  # tolerance of a falling slope, relative to the mean slope


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
