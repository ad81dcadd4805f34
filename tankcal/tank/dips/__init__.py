"""Dips: rows of a table, labels and units, interpolation between rows, and the inverse reading.

`rows` has the heights of the rows, rounding, ullage, and the dip of a volume; volumes in m3, L and
bbl, dips in metres or in feet and inches, as numbers and text. Errors of straight lines and of
proportional parts, relative to the exact volume, are here.

All gauging systems interpolate linearly. In the interval (a, b), the table gives

    T(h) = V(a) + (V(b) - V(a)) (h - a) / (b - a),

and T - V is largest where the area of the cut equals the mean area of the interval. The rule of
thumb step^2/8 |A'| fails at joints and where A' is unbounded (the ends of a lying cylinder).
Therefore the largest deviation is searched for in every interval, on each side of every breakpoint.

Proportional parts
------------------

    part j = j / parts * row_step * (V(top) - V(bottom)) / (top - bottom)

A dip is read as the row below it plus the part of its last digit. The error of the parts is row +
part less the exact volume. Where this error is too large, zones are shorter, or a stretch has no
zone and a gauger interpolates between two rows.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.errors import HeightError, InputError, Problem
from tankcal.tank.dips.rows import (
    HEIGHT_STEPS_M,
    INCHES_PER_FOOT,
    METRES_PER_INCH,
    MOST_ROWS,
    TABLE_DECIMALS,
    VOLUME_UNITS_M3,
    Dips,
    dip_label,
    dips_of,
    multiples_of,
    parse_dip,
    round_each,
    table_heights,
    top_mark,
    ullage_m,
    volume_from_m3,
    volume_to_m3,
)

__all__ = [
    "HEIGHT_STEPS_M",
    "INCHES_PER_FOOT",
    "LADDERS_M",
    "METRES_PER_INCH",
    "MOST_ROWS",
    "TABLE_DECIMALS",
    "VOLUME_UNITS_M3",
    "Dips",
    "ProportionalParts",
    "Rows",
    "Straightness",
    "choose_rows",
    "dip_label",
    "dips_of",
    "interpolation_errors",
    "parse_dip",
    "proportional_parts",
    "round_each",
    "table_heights",
    "top_mark",
    "ullage_m",
    "volume_from_m3",
    "volume_to_m3",
]


# ---- errors of straight lines

METRIC_STEPS_M = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
INCH_STEPS_M = tuple(float(METRES_PER_INCH / part) for part in (1, 2, 4, 8, 16))
LADDERS_M = {"m": METRIC_STEPS_M, "ft-in-8": INCH_STEPS_M[:4], "ft-in-16": INCH_STEPS_M}

_ALIKE = 1e-4  # deviations with a smaller relative difference are equal up to rounding
_NODES = (1 - np.cos(np.pi * np.arange(9) / 8)) / 2  # samples of a piece, denser at its ends
_GOLDEN = (np.sqrt(5) - 1) / 2  # golden ratio: a section requires only one new evaluation
_SHRINKINGS = 34  # reduces a bracket to 1e-7 of its length: deviation exact to 1e-14
FEWEST_ROWS = 10  # least rows of a zone: in a shorter zone, interpolation is as convenient
_SAME = 1e-9  # tolerance of rounding, in steps


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


@dataclass(frozen=True)
class ProportionalParts:
    """Mean volumes of 1, 2, ... parts of a step between two heights, and their largest error.

    Attributes
    ----------
    bottom_m, top_m : float
        Heights of the zone, m.
    part_m3 : ndarray, shape (parts - 1,)
        Volumes to be added to the row below a dip.
    deviation_m3 : float
        Largest deviation (row + part - exact volume) by absolute value, with its sign.
    at_m : float
        Dip of the largest deviation.
    """

    bottom_m: float
    top_m: float
    part_m3: np.ndarray
    deviation_m3: float
    at_m: float


def proportional_parts(volume_m3, edges_m, row_step_m=0.01, parts=10, bound_m3=None):
    """Return `ProportionalParts` in ascending order, one zone for each stretch within the bound.

    A stretch between neighbouring edges that exceeds the bound is divided, at rows, into the
    longest zones within the bound. No zone is formed if it would have fewer than FEWEST_ROWS rows.
    The deviation is evaluated at every mark between rows of the zone, against the exact volume.

    Parameters
    ----------
    volume_m3 : callable
        Function of (n,) dips, m, to (n,) volumes, m3.
    edges_m : array_like, shape (k + 1,)
        Dips of bottom, joints and top, ascending, m.
    row_step_m : float
        Step of the table, m.
    parts : int
        Parts of a step (10: millimetres of a cm table, 8: eighths of inches).
    bound_m3 : callable, optional
        Function of (n,) dips, m, to (n,) largest errors, m3; None: no bound.

    Returns
    -------
    tuple of ProportionalParts

    Raises
    ------
    HeightError
        For edges that do not ascend from 0 or higher.
    """
    edges = np.asarray(edges_m, dtype=float)
    if len(edges) < 2 or edges[0] < 0 or not np.all(np.diff(edges) > 0):
        raise HeightError(f"edges of courses {edges.tolist()}: expected ascending, from 0")
    marks = _Marks(volume_m3, row_step_m, parts, bound_m3)
    zones = []
    for bottom, top in pairwise(edges):
        zones += _zones_of_stretch(marks, float(bottom), float(top))
    return tuple(zones)


def _zones_of_stretch(marks, bottom_m, top_m):
    """Return the zones of a stretch: the whole stretch, or the longest zones within the bound."""
    single, good = marks.zone(bottom_m, top_m)
    if good:
        return [single]
    ends = [*marks.rows_between(bottom_m, top_m), top_m]
    zones, start, place = [], bottom_m, 0
    while place + FEWEST_ROWS - 1 < len(ends):
        longest, size = None, FEWEST_ROWS - 1
        while place + size < len(ends):  # search the longest zone with steps that double
            zone, good = marks.zone(start, ends[place + size])
            if not good:
                break
            longest, reached, size = zone, place + size, 2 * size
        if longest is None:
            start, place = ends[place], place + 1
            continue
        upper_limit = min(place + size, len(ends))
        reached, longest = _extend_zone(marks, start, ends, reached, upper_limit, longest)
        zones.append(longest)
        start, place = ends[reached], reached + 1
    return zones


def _extend_zone(marks, start_m, ends, good, bad, zone):
    """Return (place, zone) of the longest zone within the bound, by bisection.

    `good` is the end of a zone within the bound, `bad` the end of a zone that exceeds it.
    """
    while bad - good > 1:
        middle = (good + bad) // 2
        candidate, is_within = marks.zone(start_m, ends[middle])
        if is_within:
            good, zone = middle, candidate
        else:
            bad = middle
    return good, zone


class _Marks:
    """Marks of a tape between rows, and errors of a table with parts at these marks."""

    def __init__(self, volume_m3, row_step_m, parts, bound_m3):
        self.volume_m3, self.bound_m3 = volume_m3, bound_m3
        self.row_step_m, self.parts = row_step_m, parts
        self.mark_m = row_step_m / parts

    def rows_between(self, low_m, high_m):
        """Return the dips (n,) of the rows between two heights, without both heights."""
        first = int(np.floor(low_m / self.row_step_m + _SAME)) + 1
        last = int(np.ceil(high_m / self.row_step_m - _SAME)) - 1
        return [float(dip) for dip in multiples_of(self.row_step_m, first, last)]

    def zone(self, bottom_m, top_m):
        """Return the `ProportionalParts` between two heights, and whether they meet the bound."""
        # The parts have the mean slope of the zone.
        bottom_m3, top_m3 = self.volume_m3(np.array([bottom_m, top_m]))
        mean_m3 = self.mark_m * float(top_m3 - bottom_m3) / (top_m - bottom_m)
        first = int(np.ceil(bottom_m / self.mark_m - _SAME))
        last = int(np.floor(top_m / self.mark_m + _SAME))
        number = np.arange(first, last + 1)
        # Rounding must not place the first or last mark outside the zone.
        marks = np.clip(multiples_of(self.mark_m, first, last), bottom_m, top_m)
        rows = multiples_of(self.row_step_m, 0, last // self.parts)[number // self.parts]
        between_rows = number % self.parts != 0
        deviation = np.zeros(len(number))
        table_m3 = (
            self.volume_m3(rows[between_rows]) + (number % self.parts)[between_rows] * mean_m3
        )
        deviation[between_rows] = table_m3 - self.volume_m3(marks[between_rows])
        worst = first_of_largest(deviation) if len(number) else None
        zone = ProportionalParts(
            bottom_m=bottom_m,
            top_m=top_m,
            part_m3=np.arange(1, self.parts) * mean_m3,
            deviation_m3=0.0 if worst is None else float(deviation[worst]),
            at_m=float(bottom_m if worst is None else marks[worst]),
        )
        # Every mark must be within the bound at its own dip.
        good = self.bound_m3 is None or bool(np.all(np.abs(deviation) <= self.bound_m3(marks)))
        return zone, good
