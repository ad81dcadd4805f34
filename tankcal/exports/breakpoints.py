"""The rows of a table that a polyline of few points keeps: the least largest error of K points.

Let E(i, j) be the largest distance of the chord from row i to row j from the rows between. The best
K points make

    D_k(j) = min over i < j of max(D_k-1(i), E(i, j))

least at the last row. It is found turned round: for an error eps the fewest chords to each row are
counted (`tankcal.exports.chords`), from both ends, and eps is halved between what K points reach
and what they do not. The greedy way, the longest chord each time, is where it begins: no row counts
any more that is on no way of K points within the greedy error.
"""

import sys
from dataclasses import dataclass

import numpy as np

from tankcal.exports import chords
from tankcal.solver.compiled import available, compile_functions

_CLOSE = 1e-9  # of an error: nearer to the optimum nobody sees
_FIRST_STEP = 0.01  # below the greedy error
_PLAIN = 3_000_000  # steps of a walk: fewer are done before a compiler is loaded
_MOST_TURNS = 200


@dataclass(frozen=True)
class Breakpoints:
    """Rows that a polyline runs through.

    Attributes
    ----------
    rows : (points,) ndarray of int
        Ascending; the first and the last row of the table are among them.
    error : float
        Largest distance of the polyline from the table at any height, in the unit of volumes.
    at : float
        The height where it is.
    greedy : float
        What the longest chords each time would reach with as many points; nan: not asked for.
    """

    rows: np.ndarray
    error: float
    at: float
    greedy: float = np.nan


@dataclass(frozen=True)
class Written:
    """A table and its rows as they are written.

    height, volume  (rows,) of the table, ascending       at, written  (rows,) rounded, with offsets
    last, is_open   as `chords` takes them                loops        compiled or plain
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
    def own_error(self):
        """(rows,) distance of each written row from the table."""
        return np.abs(self.written - np.interp(self.at, self.height, self.volume))

    def fewest_chords(self, is_open, eps, most):
        """(fewest chords to each row, the row before it) of chords within eps."""
        count = len(self.height)
        fewest, before = np.full(count, chords.NEVER), np.full(count, -1)
        if self.loops is chords:
            fewest, before = fewest.tolist(), before.tolist()
        given = self._for_loops(*self.lines, self.last, is_open)
        self.loops.fewest_chords(*given, eps, most, fewest, before)
        return np.asarray(fewest), np.asarray(before)

    def longest_chords(self, is_open, eps):
        """Rows of the way that takes the longest chord within eps each time; empty: none."""
        rows = np.zeros(len(self.height), dtype=int)
        given = self._for_loops(*self.lines, self.last, is_open)
        return rows[: self.loops.longest_chords(*given, eps, rows)]

    def error_of(self, rows):
        """What the loops judge: errors of chords at rows between, and of the rows themselves."""
        between = self.loops.largest_error(*self._for_loops(*self.lines, rows))
        return max(float(between), float(self.own_error[rows].max()))

    def _for_loops(self, *arrays):
        """Arrays for compiled loops, lists for plain ones, which take numbers out faster."""
        return [one.tolist() for one in arrays] if self.loops is chords else arrays

    def reversed(self):
        """The same table from its top down."""
        count = len(self.height)
        must = np.zeros(count, dtype=bool)
        must[self.last] = must[0] = True
        return Written(
            *(np.ascontiguousarray(-one[::-1]) for one in self.lines),
            _next_fixed(must[::-1]),
            np.ascontiguousarray(self.is_open[::-1]),
            self.loops,
        )


def best_breakpoints(height, volume, points, *, fixed=(), at=None, written=None, candidates=None):
    """The `Breakpoints` of at most so many points with the least largest error.

    Parameters
    ----------
    height, volume : array_like, shape (rows,)
        The table, heights strictly ascending.
    points : int
        Two or more, and at least as many as there are fixed rows.
    fixed : sequence of int, optional
        Rows that have to stand, beside the first and the last.
    at, written : array_like, optional
        Heights and volumes as they will be written; None: as they are.
    candidates : array_like of bool, optional
        Rows that may stand; None: all.

    Returns
    -------
    Breakpoints
        The error is that of the polyline through what is written, everywhere.

    Raises
    ------
    ValueError
        For fewer points than rows that have to stand.

    Examples
    --------
    >>> found = best_breakpoints([0, 1, 2, 3, 4], [0, 1, 4, 9, 16], 3)
    >>> found.rows.tolist(), found.error
    ([0, 2, 4], 1.0)
    """
    table = _table(height, volume, fixed, at, written, candidates)
    least = int(np.count_nonzero(_is_fixed(table)))
    if points < least:
        raise ValueError(f"{points} points, expected {least} or more: so many rows have to stand")
    rows, greedy = _greedy(table, points)
    rows = _optimum(table, points, rows)
    return Breakpoints(rows, *polyline_error(*table.lines, rows), greedy)


def fewest_breakpoints(height, volume, error, *, fixed=(), at=None, written=None, candidates=None):
    """The `Breakpoints` of the fewest points that keep an error, or None where no points do.

    Parameters
    ----------
    height, volume, fixed, at, written, candidates
        As of `best_breakpoints`.
    error : float
        That is not to be exceeded, in the unit of volumes.

    Examples
    --------
    >>> fewest_breakpoints([0, 1, 2, 3, 4], [0, 1, 4, 9, 16], 1.5).rows.tolist()
    [0, 2, 4]
    """
    table = _table(height, volume, fixed, at, written, candidates)
    eps = error
    for _ in range(_MOST_TURNS):  # more than once only where heights are rounded
        if eps <= 0 and error > 0:
            return None
        rows = _way(table, eps, chords.NEVER)
        if rows is None:
            return None
        found = best_breakpoints(
            height, volume, len(rows), fixed=fixed, at=at, written=written, candidates=candidates
        )
        if found.error <= error * (1 + _CLOSE):
            return found
        eps -= max(found.error - error, 0.01 * error)
    return None


def polyline_error(height, volume, at, written, rows):
    """(largest error of the polyline through the written rows at any height, that height).

    Table and polyline are straight between all their heights, so no error is larger than at these.
    A height beyond the ends is judged as if the polyline went on level.
    """
    heights = np.union1d(height, at[rows])
    exact = np.interp(heights, height, volume)
    error = np.abs(np.interp(heights, at[rows], written[rows]) - exact)
    worst = int(np.argmax(error))
    return float(error[worst]), float(heights[worst])


def _table(height, volume, fixed, at, written, candidates):
    height, volume = (np.ascontiguousarray(one, dtype=float) for one in (height, volume))
    at = height if at is None else np.ascontiguousarray(at, dtype=float)
    written = volume if written is None else np.ascontiguousarray(written, dtype=float)
    must = np.zeros(len(height), dtype=bool)
    must[list(fixed)] = must[0] = must[-1] = True
    is_open = must | (True if candidates is None else np.asarray(candidates, dtype=bool))
    return Written(height, volume, at, written, _next_fixed(must), is_open, _loops(len(height)))


def _next_fixed(must):
    """(rows,) the next row that has to stand after each; of the last row itself."""
    fixed = np.flatnonzero(must)
    place = np.searchsorted(fixed, np.arange(len(must)), side="right")
    return fixed[np.minimum(place, len(fixed) - 1)]


def _is_fixed(table):
    must = np.zeros(len(table.height), dtype=bool)
    must[table.last] = must[0] = True
    return must


def _loops(rows):
    """The loops, compiled where a walk over every chord would be long."""
    if rows * rows < _PLAIN or not available():
        return chords
    return compile_functions(sys.modules[chords.__name__], chords.COMPILED)


def _within(table, eps):
    """(rows,) whether each row may stand: it is open, and itself no more than eps off."""
    return table.is_open & (table.own_error <= eps * (1 + _CLOSE))


def _way(table, eps, most):
    """Rows of a way of the fewest chords within eps, at most so many; None: there is none."""
    is_open = _within(table, eps)
    if not np.all(is_open[_is_fixed(table)]):
        return None
    fewest, before = table.fewest_chords(is_open, eps, most)
    return _traced(before) if fewest[-1] <= most else None


def _traced(before):
    rows = [len(before) - 1]
    while rows[-1] > 0:
        rows.append(int(before[rows[-1]]))
    return np.array(rows[::-1])


def _greedy(table, points):
    """(rows, error) of the better of the two greedy ways, from the bottom and from the top."""
    up = _greedy_way(table, points)
    down = len(table.height) - 1 - _greedy_way(table.reversed(), points)[::-1]
    error, rows = min(((table.error_of(rows), rows) for rows in (up, down)), key=lambda one: one[0])
    return rows, error


def _greedy_way(table, points):
    """Rows of the longest chords, at most so many, with the least error."""
    low, high, best = 0.0, 2 * float(np.ptp(table.volume)) + float(table.own_error.max()), None
    for _ in range(_MOST_TURNS):
        eps = high if best is None else 0.5 * (low + high)
        rows = _longest(table, eps)
        if best is None or 0 < len(rows) <= points:
            best, high = rows, min(eps, max(table.error_of(rows), low))
        else:
            low = eps
        if high - low <= _CLOSE * high:
            break
    return best


def _longest(table, eps):
    """Rows of the longest chords within eps; empty where a row that has to stand is further off."""
    is_open = _within(table, eps)
    return table.longest_chords(is_open, eps) if np.all(is_open[_is_fixed(table)]) else ()


def _optimum(table, points, rows):
    """Rows of the least error; `rows` are those of the greedy way."""
    high, low, step = table.error_of(rows), 0.0, _FIRST_STEP
    table = _kept(table, high, points)
    for _ in range(_MOST_TURNS):
        if high - low <= _CLOSE * high:
            break
        eps = 0.5 * (low + high) if low > 0 else high * (1 - min(step, 0.5))
        better = _way(table, eps, points - 1)
        if better is None:
            low = eps
            continue
        step *= 2
        rows, found = better, table.error_of(better)
        high = max(min(found, eps), low)
        table = _kept(table, high, points)
    return rows


def _kept(table, eps, points):
    """The table with those rows open that are on a way of so many points within eps."""
    if np.count_nonzero(table.is_open) <= points:
        return table
    is_open = _within(table, eps)
    back = table.reversed()
    up, _ = table.fewest_chords(is_open, eps, points - 1)
    down, _ = back.fewest_chords(np.ascontiguousarray(is_open[::-1]), eps, points - 1)
    is_open = is_open & (up + down[::-1] <= points - 1)
    return Written(*table.lines, table.last, is_open, table.loops)
