"""How far the straight lines between the rows of a table are from the exact volume.

All gauging systems interpolate linearly. In the interval (a, b) the table says

    T(h) = V(a) + (V(b) - V(a)) (h - a) / (b - a),

and T - V is largest where the area of the cut is the mean area of the interval. The rule of thumb
step^2/8 |A'| fails where A' has no bound (the ends of a lying cylinder) and at joints; here the
largest deviation itself is searched for in every interval, on each side of every breakpoint.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.tank.dips.rows import MOST_ROWS, table_heights
from tankcal.tank.dips.units import METRES_PER_INCH

METRIC_STEPS_M = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
INCH_STEPS_M = tuple(float(METRES_PER_INCH / part) for part in (1, 2, 4, 8, 16))
LADDERS_M = {"m": METRIC_STEPS_M, "ft-in-8": INCH_STEPS_M[:4], "ft-in-16": INCH_STEPS_M}

_ALIKE = 1e-4  # of the largest deviation: each is the small difference of two volumes
_NODES = (1 - np.cos(np.pi * np.arange(9) / 8)) / 2  # of each piece, denser towards its ends
_GOLDEN = (np.sqrt(5) - 1) / 2
_SHRINKINGS = 34  # a bracket shrinks to 1e-7 of itself, the deviation is exact to 1e-14 of itself


@dataclass(frozen=True)
class Straightness:
    """The largest deviation of linear interpolation in each interval between rows.

    Attributes
    ----------
    height_m : ndarray, shape (rows - 1,)
        Dip where it is.
    deviation_m3 : ndarray, shape (rows - 1,)
        Table minus exact volume there, with its sign.
    """

    height_m: np.ndarray
    deviation_m3: np.ndarray

    @property
    def largest_m3(self):
        """Size of the largest deviation of the whole table."""
        return float(np.abs(self.deviation_m3).max())

    @property
    def at_m(self):
        """The dip where it is."""
        return float(self.height_m[first_of_largest(self.deviation_m3)])


@dataclass(frozen=True)
class Rows:
    """Rows of a table whose linear interpolation keeps a bound.

    Attributes
    ----------
    height_m : ndarray, shape (rows,)
        Dips, as `table_heights` gives them for the step and the zones.
    largest_m3 : float
        Size of the largest deviation of linear interpolation, at the dip at_m.
    """

    step_m: float
    fine_step_m: float | None
    fine_zones: tuple[tuple[float, float], ...]
    height_m: np.ndarray
    largest_m3: float
    at_m: float


def first_of_largest(deviation_m3):
    """Place of the first of the largest deviations that differ by no more than rounding.

    So a wall that is alike all the way up tells the same place on every machine.

    >>> first_of_largest(np.array([1.0, -3.0, 3.0000001]))
    1
    """
    size = np.abs(deviation_m3)
    return int(np.argmax(size >= (1 - _ALIKE) * size.max()))


def interpolation_errors(volume_m3, height_m, breakpoints_m=()):
    """`Straightness` of a table with rows at height_m.

    Between rows and breakpoints the area is taken to turn at most once in an eighth of an interval.

    Parameters
    ----------
    volume_m3
        Function of (n,) dips, m, to (n,) exact volumes, m3.
    height_m : ndarray, shape (rows,)
        Dips, ascending.
    breakpoints_m : optional
        Dips where the area jumps (joints, edges of deadwood); others need not be known.
    """
    rows = np.asarray(height_m, dtype=float)
    breakpoints = np.asarray(breakpoints_m, dtype=float)
    edges = np.union1d(rows, breakpoints[(breakpoints > rows[0]) & (breakpoints < rows[-1])])
    interval = np.searchsorted(rows, edges[:-1], side="right") - 1
    at_rows = volume_m3(rows)
    slope = np.diff(at_rows) / np.diff(rows)

    def deviation(heights):
        flat = volume_m3(heights.ravel()).reshape(heights.shape)
        of = interval if heights.ndim == 1 else interval[:, None]
        return at_rows[of] + slope[of] * (heights - rows[of]) - flat

    place = _largest(deviation, edges[:-1], edges[1:])
    found = deviation(place)
    first = np.flatnonzero(np.diff(interval, prepend=-1))
    size = np.maximum.reduceat(np.abs(found), first)
    best = np.flatnonzero(np.abs(found) == size[interval])
    best = best[np.diff(interval[best], prepend=-1) > 0]
    return Straightness(place[best], found[best])


def _largest(deviation, low, high):
    """(pieces,) heights where |deviation| is largest: samples, then golden sections about them."""
    samples = low[:, None] + (high - low)[:, None] * _NODES
    size = np.abs(deviation(samples))
    best, piece = size.argmax(axis=1), np.arange(len(low))
    left = samples[piece, np.maximum(best - 1, 0)]
    right = samples[piece, np.minimum(best + 1, len(_NODES) - 1)]
    inner = np.array([right - _GOLDEN * (right - left), left + _GOLDEN * (right - left)])
    at_inner = np.array([np.abs(deviation(inner[0])), np.abs(deviation(inner[1]))])
    for _ in range(_SHRINKINGS):
        is_left = at_inner[0] > at_inner[1]
        left, right = np.where(is_left, left, inner[0]), np.where(is_left, inner[1], right)
        kept, at_kept = np.where(is_left, inner, inner[::-1])[0], at_inner.max(axis=0)
        span = _GOLDEN * (right - left)
        new = np.where(is_left, right - span, left + span)
        at_new = np.abs(deviation(new))
        inner = np.where(is_left, [new, kept], [kept, new])
        at_inner = np.where(is_left, [at_new, at_kept], [at_kept, at_new])
    found = inner[at_inner.argmax(axis=0), piece]
    return np.where(at_inner.max(axis=0) > size[piece, best], found, samples[piece, best])


def choose_rows(volume_m3, top_m, bound_m3, breakpoints_m=(), step_m=None, ladder_m=METRIC_STEPS_M):
    """`Rows` that keep the bound with the fewest rows: one step, or a finer one where needed.

    Parameters
    ----------
    volume_m3
        Function of (n,) dips, m, to (n,) exact volumes, m3.
    bound_m3
        Of the deviation of linear interpolation from the exact volume.
    breakpoints_m : optional
        Dips where the area jumps.
    step_m : optional
        The table's step when it is given; then only finer zones are added. None: chosen.
    ladder_m : optional
        Steps to choose from, the coarsest first (`LADDERS_M` has them by unit of heights).

    Raises
    ------
    InputError
        With the deviation that is reached, when no step of the ladder is enough.
    """
    best, reached = None, None
    for step in ladder_m if step_m is None else (step_m,):
        if best is not None and top_m / step >= len(best.height_m):
            break
        for candidate in _candidates(volume_m3, top_m, bound_m3, breakpoints_m, step, ladder_m):
            if reached is None or candidate.largest_m3 < reached.largest_m3:
                reached = candidate
            is_good = candidate.largest_m3 <= bound_m3
            if is_good and (best is None or len(candidate.height_m) < len(best.height_m)):
                best = candidate
    if best is None:
        raise InputError(Problem("table", _not_met(reached, bound_m3), None, "step_m"))
    return best


def _not_met(reached, bound_m3):
    if reached is None:
        return f"no step of the choice gives at most {MOST_ROWS} rows"
    finest = reached.fine_step_m or reached.step_m
    return (
        f"linear interpolation errs by {1000 * reached.largest_m3:.3g} L at {reached.at_m:g} m "
        f"with rows of {1000 * finest:g} mm; expected at most {1000 * bound_m3:.3g} L"
    )


def _candidates(volume_m3, top_m, bound_m3, breakpoints_m, step, ladder_m):
    """`Rows` with one step; where that breaks the bound, with each finer step in those zones."""
    if top_m / step > MOST_ROWS:
        return
    heights = table_heights(step, top_m)
    plain = interpolation_errors(volume_m3, heights, breakpoints_m)
    yield Rows(step, None, (), heights, plain.largest_m3, plain.at_m)
    zones = _zones(heights, np.abs(plain.deviation_m3) > bound_m3)
    for fine in ladder_m:
        is_part = fine < step and abs(step / fine - round(step / fine)) < 1e-6
        marks = sum(high - low for low, high in zones) / fine
        if not zones or not is_part or marks + len(heights) > MOST_ROWS:
            continue
        rows = table_heights(step, top_m, fine, zones)
        found = interpolation_errors(volume_m3, rows, breakpoints_m)
        yield Rows(step, fine, zones, rows, found.largest_m3, found.at_m)


def _zones(heights, is_bad):
    """((low, high), ...) of runs of intervals that are bad."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_bad, [False]]).astype(int)))
    return tuple(
        (float(heights[low]), float(heights[high]))
        for low, high in zip(edges[::2], edges[1::2], strict=True)
    )
