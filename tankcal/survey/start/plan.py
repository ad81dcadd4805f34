"""What a survey says about positions in plan: directions by circle, horizontal lengths, slopes.

Azimuths become a circle whose zero is north; horizontal angles that share sights at a station
become one circle with the first sight as its zero.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.survey.observations import (
    Azimuths,
    Directions,
    Distances,
    HorizontalAngles,
    VerticalAngles,
)

STEEP = 0.2  # horizontal length over slope distance below which heights reduce it badly


@dataclass(frozen=True)
class Plan:
    """Sights in plan, all arrays of points' numbers and SI values.

    station, target, circle, reading  (n,) directions
    north        (circles,) True where the zero of the circle is known to be north
    at           (circles,) station of each circle
    start, end, length, flat, rise    (d,) distances, freed of scale and offset; flat: horizontal
    low, high, slope                  (v,) vertical angles above the horizon, rad
    lift         (v,) height of instrument minus that of target      bend  (v,) per m
    points       number of points of the survey
    """

    station: np.ndarray
    target: np.ndarray
    circle: np.ndarray
    reading: np.ndarray
    north: np.ndarray
    at: np.ndarray
    start: np.ndarray
    end: np.ndarray
    length: np.ndarray
    flat: np.ndarray
    rise: np.ndarray
    low: np.ndarray
    high: np.ndarray
    slope: np.ndarray
    lift: np.ndarray
    bend: np.ndarray
    points: int

    def pairs(self, start, end):
        """One number for each unordered pair of points (n,)."""
        return np.minimum(start, end) * self.points + np.maximum(start, end)

    def lengths(self, z_m, heights_first=False):
        """Pairs (k,), sorted, and the horizontal length of each, where it can be known.

        A slope distance is reduced by the vertical angle of the same line, else by heights; the
        other way round with `heights_first`, for heights are controlled and an angle is not.
        """
        pair = self.pairs(self.start, self.end)
        slopes = medians(self.pairs(self.low, self.high), np.abs(self.slope))
        flat = np.where(self.flat, self.length, np.nan)
        by_angle = self.length * np.cos(look_up(*slopes, pair))
        drop = z_m[self.end] - z_m[self.start] - self.rise
        square = self.length**2 - drop**2
        by_height = np.sqrt(np.where(square > (STEEP * self.length) ** 2, square, np.nan))
        if heights_first:
            by_angle, by_height = by_height, by_angle
        found = np.where(self.flat, flat, np.where(np.isfinite(by_angle), by_angle, by_height))
        good = np.isfinite(found)
        return medians(pair[good], found[good])


def medians(groups, values):
    """Groups (k,), sorted, and the median of the values (n,) of each."""
    order = np.lexsort([values, groups])
    groups, values = groups[order], values[order]
    found, first, count = np.unique(groups, return_index=True, return_counts=True)
    return found, 0.5 * (values[first + (count - 1) // 2] + values[first + count // 2])


def look_up(groups, values, wanted):
    """Values (n,) of wanted groups (n,), nan where a group has none."""
    if not len(groups):
        return np.full(len(wanted), np.nan)
    place = np.minimum(np.searchsorted(groups, wanted), len(groups) - 1)
    return np.where(groups[place] == wanted, values[place], np.nan)


def plan_of(survey):
    """The Plan of a Survey, observations that are set aside left out."""
    groups = [_used(one) for one in survey.observations]
    circles = _Circles(len(survey.sets))
    for one in groups:
        if isinstance(one, Directions):
            circles.add(one.start, one.end, one.set, one.value)
        elif isinstance(one, Azimuths):
            circles.add_azimuths(one)
        elif isinstance(one, HorizontalAngles):
            circles.add_angles(one)
    points = len(survey.points)
    return Plan(
        *circles.rows(), *circles.zeros(), *_distances(survey, groups), *_slopes(groups), points
    )


def _used(one):
    return one if one.use is None else one.taken(one.use > 0)


def _joined(parts, kinds):
    """Columns (n,) of each kind from tuples of columns."""
    columns = list(zip(*parts, strict=True)) if parts else [()] * len(kinds)
    return [
        np.concatenate([np.zeros(0, dtype=kind), *column]).astype(kind)
        for kind, column in zip(kinds, columns, strict=True)
    ]


def _distances(survey, groups):
    """Start, end, length, flat, rise of all distances."""
    scale = np.array([tool.scale for tool in survey.instruments] + [0.0])
    offset = np.array([tool.offset_m for tool in survey.instruments] + [0.0])
    parts = []
    for one in groups:
        if isinstance(one, Distances):
            length = (one.value - offset[one.instrument]) / (1 + scale[one.instrument])
            flat = np.full(len(one), one.horizontal)
            parts.append((one.start, one.end, length, flat, _rise(one)))
    return _joined(parts, (int, int, float, bool, float))


def _slopes(groups):
    """Low, high, slope, lift, bend of all vertical angles."""
    parts = []
    for one in groups:
        if isinstance(one, VerticalAngles):
            slope = np.pi / 2 - one.value if one.zenith else one.value
            bend = np.full(len(one), one.bend_per_m)
            parts.append((one.start, one.end, slope, _rise(one), bend))
    return _joined(parts, (int, int, float, float, float))


def _rise(one):
    return np.zeros(len(one)) if one.rise_m is None else one.rise_m


class _Circles:
    """Directions by circle; those of direction sets come first, under their own numbers."""

    def __init__(self, sets):
        self.parts, self.north = [], [False] * sets

    def add(self, station, target, circle, reading):
        self.parts.append((station, target, circle, reading))

    def add_azimuths(self, one):
        stations, circle = np.unique(one.start, return_inverse=True)
        self.add(one.start, one.end, circle + len(self.north), one.value)
        self.north += [True] * len(stations)

    def add_angles(self, one):
        """Angles of a station that share sights, chained from the first sight."""
        for station in np.unique(one.start):
            mine = one.start == station
            links = {}
            for a, b, angle in zip(one.origin[mine], one.end[mine], one.value[mine], strict=True):
                links.setdefault(int(a), []).append((int(b), angle))
                links.setdefault(int(b), []).append((int(a), -angle))
            seen = set()
            for first in links:
                if first in seen:
                    continue
                chain = _chained(first, links)
                seen |= set(chain)
                rows = np.array(list(chain)), np.array(list(chain.values()))
                count = len(chain)
                number = np.full(count, len(self.north))
                self.add(np.full(count, station), rows[0], number, rows[1])
                self.north.append(False)

    def rows(self):
        return _joined(self.parts, (int, int, int, float))

    def zeros(self):
        station, _, circle, _ = self.rows()
        at = np.full(len(self.north), -1)
        at[circle[::-1]] = station[::-1]
        return np.array(self.north, dtype=bool), at


def _chained(first, links):
    """Readings {target: rad} from angles between targets, with the first target at zero."""
    found, queue = {first: 0.0}, [first]
    while queue:
        here = queue.pop(0)
        for there, angle in links[here]:
            if there not in found:
                found[there] = found[here] + angle
                queue.append(there)
    return found
