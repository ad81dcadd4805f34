"""Error of the straight lines between the rows of a table, relative to the exact volume.

All gauging systems interpolate linearly. In the interval (a, b), the table gives

    T(h) = V(a) + (V(b) - V(a)) (h - a) / (b - a),

and T - V is largest where the area of the cut equals the mean area of the interval. The rule of
thumb step^2/8 |A'| fails at joints and where A' is unbounded (the ends of a lying cylinder).
Therefore the largest deviation is searched for in every interval, on each side of every breakpoint.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.tank.dips.rows import MOST_ROWS, table_heights
from tankcal.tank.dips.units import METRES_PER_INCH

METRIC_STEPS_M = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
INCH_STEPS_M = tuple(float(METRES_PER_INCH / part) for part in (1, 2, 4, 8, 16))
LADDERS_M = {"m": METRIC_STEPS_M, "ft-in-8": INCH_STEPS_M[:4], "ft-in-16": INCH_STEPS_M}

_ALIKE = 1e-4  # deviations with a smaller relative difference are equal up to rounding
_NODES = (1 - np.cos(np.pi * np.arange(9) / 8)) / 2  # samples of a piece, denser at its ends
_GOLDEN = (np.sqrt(5) - 1) / 2  # golden ratio: a section requires only one new evaluation
_SHRINKINGS = 34  # reduces a bracket to 1e-7 of its length: deviation exact to 1e-14


@dataclass(frozen=True)
class Straightness:
    """Largest deviation of linear interpolation in each interval between rows.

    Attributes
    ----------
    height_m : ndarray, shape (rows - 1,)
        Dip of the largest deviation.
    deviation_m3 : ndarray, shape (rows - 1,)
        Table minus exact volume at that dip.
    """

    height_m: np.ndarray
    deviation_m3: np.ndarray

    @property
    def largest_m3(self):
        """Absolute value of the largest deviation of the whole table."""
        return float(np.abs(self.deviation_m3).max())

    @property
    def at_m(self):
        """Dip of the largest deviation of the whole table."""
        return float(self.height_m[first_of_largest(self.deviation_m3)])


@dataclass(frozen=True)
class Rows:
    """Rows of a table whose linear interpolation meets a bound.

    Attributes
    ----------
    step_m, fine_step_m, fine_zones
        Steps and zones, as for `table_heights`.
    height_m : ndarray, shape (rows,)
        Dips, as computed by `table_heights` for the steps and zones.
    largest_m3 : float
        Absolute value of the largest deviation of linear interpolation.
    at_m : float
        Dip of the largest deviation.
    """

    step_m: float
    fine_step_m: float | None
    fine_zones: tuple[tuple[float, float], ...]
    height_m: np.ndarray
    largest_m3: float
    at_m: float


def first_of_largest(deviation_m3):
    """Return the index of the first of the largest deviations that are equal up to rounding.

    For a wall that is equal at all heights, the index is therefore the same on every machine.

    >>> first_of_largest(np.array([1.0, -3.0, 3.0000001]))
    1
    """
    size = np.abs(deviation_m3)
    return int(np.argmax(size >= (1 - _ALIKE) * size.max()))


def interpolation_errors(volume_m3, height_m, breakpoints_m=()):
    """Return the `Straightness` of a table with rows at height_m.

    Between rows and breakpoints, the area may have at most one extremum in an eighth of an
    interval.

    Parameters
    ----------
    volume_m3 : callable
        Function of (n,) dips, m, to (n,) exact volumes, m3.
    height_m : ndarray, shape (rows,)
        Dips, ascending, m.
    breakpoints_m : array_like, optional
        Dips at which the area jumps (joints, limits of deadwood); other breakpoints are not
        required.

    Returns
    -------
    Straightness
    """
    rows = np.asarray(height_m, dtype=float)
    breakpoints = np.asarray(breakpoints_m, dtype=float)
    edges = np.union1d(rows, breakpoints[(breakpoints > rows[0]) & (breakpoints < rows[-1])])
    interval = np.searchsorted(rows, edges[:-1], side="right") - 1
    at_rows = volume_m3(rows)
    slope = np.diff(at_rows) / np.diff(rows)

    def deviation(heights):
        flat = volume_m3(heights.ravel()).reshape(heights.shape)
        row = interval if heights.ndim == 1 else interval[:, None]
        return at_rows[row] + slope[row] * (heights - rows[row]) - flat

    place = _find_largest(deviation, edges[:-1], edges[1:])
    deviations = deviation(place)
    # Largest deviation among the pieces of each interval, and the first piece where it occurs.
    first = np.flatnonzero(np.diff(interval, prepend=-1))
    size = np.maximum.reduceat(np.abs(deviations), first)
    best = np.flatnonzero(np.abs(deviations) == size[interval])
    best = best[np.diff(interval[best], prepend=-1) > 0]
    return Straightness(place[best], deviations[best])


def _find_largest(deviation, low, high):
    """Return heights (pieces,) of the largest |deviation|: samples, then golden sections."""
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
        retained, at_retained = np.where(is_left, inner, inner[::-1])[0], at_inner.max(axis=0)
        span = _GOLDEN * (right - left)
        new = np.where(is_left, right - span, left + span)
        at_new = np.abs(deviation(new))
        inner = np.where(is_left, [new, retained], [retained, new])
        at_inner = np.where(is_left, [at_new, at_retained], [at_retained, at_new])
    interior = inner[at_inner.argmax(axis=0), piece]
    # Samples at the ends of a piece may exceed the interior maximum.
    return np.where(at_inner.max(axis=0) > size[piece, best], interior, samples[piece, best])


def choose_rows(volume_m3, top_m, bound_m3, breakpoints_m=(), step_m=None, ladder_m=METRIC_STEPS_M):
    """Return the `Rows` that meet the bound with the fewest rows, with a single step or fine zones.

    Parameters
    ----------
    volume_m3 : callable
        Function of (n,) dips, m, to (n,) exact volumes, m3.
    top_m : float
        Last row, m.
    bound_m3 : float
        Bound of the deviation of linear interpolation from the exact volume, m3.
    breakpoints_m : array_like, optional
        Dips at which the area jumps.
    step_m : float, optional
        Given step of the table, to which only finer zones are added. None: the step is chosen.
    ladder_m : sequence of float, optional
        Available steps, the coarsest first (`LADDERS_M` contains them by unit of heights).

    Returns
    -------
    Rows

    Raises
    ------
    InputError
        With the smallest deviation, if no step of the ladder meets the bound.
    """
    best, most_accurate = None, None
    for step in ladder_m if step_m is None else (step_m,):
        # Finer steps only have more rows than the best table.
        if best is not None and top_m / step >= len(best.height_m):
            break
        for candidate in _generate_candidates(
            volume_m3, top_m, bound_m3, breakpoints_m, step, ladder_m
        ):
            if most_accurate is None or candidate.largest_m3 < most_accurate.largest_m3:
                most_accurate = candidate
            is_good = candidate.largest_m3 <= bound_m3
            if is_good and (best is None or len(candidate.height_m) < len(best.height_m)):
                best = candidate
    if best is None:
        raise InputError(Problem("table", _bound_exceeded(most_accurate, bound_m3), None, "step_m"))
    return best


def _bound_exceeded(reached, bound_m3):
    """Return the message of a bound that no step meets."""
    if reached is None:
        return f"no step of the choice gives at most {MOST_ROWS} rows"
    finest = reached.fine_step_m or reached.step_m
    return (
        f"linear interpolation errs by {1000 * reached.largest_m3:.3g} L at {reached.at_m:g} m "
        f"with rows of {1000 * finest:g} mm; expected at most {1000 * bound_m3:.3g} L"
    )


def _generate_candidates(volume_m3, top_m, bound_m3, breakpoints_m, step, ladder_m):
    """Yield `Rows` with a single step; if it exceeds the bound, also with finer steps in zones."""
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
        errors = interpolation_errors(volume_m3, rows, breakpoints_m)
        yield Rows(step, fine, zones, rows, errors.largest_m3, errors.at_m)


def _zones(heights, is_bad):
    """Return ((low, high), ...) of consecutive intervals that exceed the bound."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_bad, [False]]).astype(int)))
    return tuple(
        (float(heights[low]), float(heights[high]))
        for low, high in zip(edges[::2], edges[1::2], strict=True)
    )
