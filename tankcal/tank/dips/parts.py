"""Proportional parts: what the digits of a dip between two rows add, the same all over a zone.

part j = j / parts * row_step * (V(top) - V(bottom)) / (top - bottom)

A dip is read as the row below it plus the part of its last digit. What that is off by, row + part
less the exact volume, is the error of the parts; where it matters there are shorter zones or none,
and a gauger interpolates between two rows.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.errors import HeightError
from tankcal.tank.dips.rows import multiples_of
from tankcal.tank.dips.straightness import first_of_largest

FEWEST_ROWS = 10  # of a zone cut from a stretch: a shorter one is as well read from two rows
_SAME = 1e-9


@dataclass(frozen=True)
class ProportionalParts:
    """Mean volumes of 1, 2, ... parts of a step between two heights, and their price.

    Attributes
    ----------
    part_m3 : ndarray, shape (parts - 1,)
        To be added to the row below a dip.
    deviation_m3 : float
        Largest, by size, of (row + part - exact volume), with its sign.
    at_m : float
        The dip where it is.
    """

    bottom_m: float
    top_m: float
    part_m3: np.ndarray
    deviation_m3: float
    at_m: float


def proportional_parts(volume_m3, edges_m, row_step_m=0.01, parts=10, bound_m3=None):
    """Tuple of `ProportionalParts`, ascending; of one zone for each stretch that keeps the bound.

    A stretch between neighbouring edges that breaks the bound is cut, at rows, into the longest
    zones that keep it; where that takes zones of less than FEWEST_ROWS rows, there are none.

    The deviation is taken at every mark between rows of the zone, against the exact volume.

    Parameters
    ----------
    volume_m3 : callable
        Function of (n,) dips, m, to (n,) volumes, m3.
    edges_m : array_like, shape (k + 1,)
        Dips of bottom, joints and top, ascending, m.
    row_step_m : float
        Of the table, m.
    parts : int
        Of a step (10: millimetres of a cm table, 8: eighths of inches).
    bound_m3 : callable, optional
        Function of (n,) dips, m, to (n,) largest errors, m3; None: no bound.

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
    whole, good = marks.zone(bottom_m, top_m)
    if good:
        return [whole]
    ends = [*marks.rows_between(bottom_m, top_m), top_m]
    zones, start, place = [], bottom_m, 0
    while place + FEWEST_ROWS - 1 < len(ends):
        found, size = None, FEWEST_ROWS - 1
        while place + size < len(ends):  # the longest one, by steps that double
            zone, good = marks.zone(start, ends[place + size])
            if not good:
                break
            found, reached, size = zone, place + size, 2 * size
        if found is None:
            start, place = ends[place], place + 1
            continue
        beyond = min(place + size, len(ends))
        reached, found = _lengthened(marks, start, ends, reached, beyond, found)
        zones.append(found)
        start, place = ends[reached], reached + 1
    return zones


def _lengthened(marks, start_m, ends, good, bad, zone):
    """(place, zone) of the longest zone that keeps the bound, between one that does and `bad`."""
    while bad - good > 1:
        middle = (good + bad) // 2
        tried, keeps = marks.zone(start_m, ends[middle])
        if keeps:
            good, zone = middle, tried
        else:
            bad = middle
    return good, zone


class _Marks:
    """The marks of a tape between rows, and what a table with parts is off there."""

    def __init__(self, volume_m3, row_step_m, parts, bound_m3):
        self.volume_m3, self.bound_m3 = volume_m3, bound_m3
        self.row_step_m, self.parts = row_step_m, parts
        self.mark_m = row_step_m / parts

    def rows_between(self, low_m, high_m):
        """(n,) dips of the rows between two heights, both left out."""
        first = int(np.floor(low_m / self.row_step_m + _SAME)) + 1
        last = int(np.ceil(high_m / self.row_step_m - _SAME)) - 1
        return [float(dip) for dip in multiples_of(self.row_step_m, first, last)]

    def zone(self, bottom_m, top_m):
        """`ProportionalParts` between two heights, and whether they keep the bound."""
        low, high = self.volume_m3(np.array([bottom_m, top_m]))
        mean_m3 = self.mark_m * float(high - low) / (top_m - bottom_m)
        first = int(np.ceil(bottom_m / self.mark_m - _SAME))
        last = int(np.floor(top_m / self.mark_m + _SAME))
        number = np.arange(first, last + 1)
        marks = np.clip(multiples_of(self.mark_m, first, last), bottom_m, top_m)
        rows = multiples_of(self.row_step_m, 0, last // self.parts)[number // self.parts]
        between = number % self.parts != 0
        deviation = np.zeros(len(number))
        read = self.volume_m3(rows[between]) + (number % self.parts)[between] * mean_m3
        deviation[between] = read - self.volume_m3(marks[between])
        worst = first_of_largest(deviation) if len(number) else None
        zone = ProportionalParts(
            bottom_m=bottom_m,
            top_m=top_m,
            part_m3=np.arange(1, self.parts) * mean_m3,
            deviation_m3=0.0 if worst is None else float(deviation[worst]),
            at_m=float(bottom_m if worst is None else marks[worst]),
        )
        good = self.bound_m3 is None or bool(np.all(np.abs(deviation) <= self.bound_m3(marks)))
        return zone, good
