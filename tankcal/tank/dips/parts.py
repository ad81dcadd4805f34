"""Proportional parts: volumes of the last digit of a dip, constant within a zone.

part j = j / parts * row_step * (V(top) - V(bottom)) / (top - bottom)

A dip is read as the row below it plus the part of its last digit. The error of the parts is row +
part less the exact volume. Where this error is too large, zones are shorter, or a stretch has no
zone and a gauger interpolates between two rows.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.errors import HeightError
from tankcal.tank.dips.rows import multiples_of
from tankcal.tank.dips.straightness import first_of_largest

FEWEST_ROWS = 10  # least rows of a zone: in a shorter zone, interpolation is as convenient
_SAME = 1e-9  # tolerance of rounding, in steps


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
