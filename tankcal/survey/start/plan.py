"""Observations in plan: directions by circle, horizontal lengths, slopes.

Azimuths form a circle whose zero is north. Horizontal angles with common sights at a station form
one circle with the first sight as its zero.
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

STEEP = 0.2  # horizontal over slope distance below which heights reduce it poorly


@dataclass(frozen=True)
class Plan:
    """Observations in plan, as arrays of point numbers and SI values.

    Attributes
    ----------
    station, target, circle, reading : ndarray, shape (n,)
        Directions.
    north : ndarray of bool, shape (circles,)
        True where the zero of the circle is north.
    at : ndarray of int, shape (circles,)
        Station of each circle.
    start, end, length, flat, rise : ndarray, shape (d,)
        Distances, corrected for scale and offset; flat: horizontal.
    low, high, slope : ndarray, shape (v,)
        Vertical angles above the horizon, rad.
    lift : ndarray, shape (v,)
        Height of instrument minus height of target, m.
    bend : ndarray, shape (v,)
        Curvature less refraction, 1/m.
    points : int
        Number of points of the survey.
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
        """Number (n,) of each unordered pair of points."""
        return np.minimum(start, end) * self.points + np.maximum(start, end)

    def lengths(self, z_m, heights_first=False):
        """Sorted pairs (k,) and the horizontal length of each, where it can be determined.

        A slope distance is reduced by the vertical angle of its line, else by heights.
        `heights_first` reverses this order, as heights are controlled and a single angle is not.
        """
        pair = self.pairs(self.start, self.end)
        slopes = medians(self.pairs(self.low, self.high), np.abs(self.slope))
        flat = np.where(self.flat, self.length, np.nan)
        by_angle = self.length * np.cos(look_up(*slopes, pair))
        drop = z_m[self.end] - z_m[self.start] - self.rise
        square = self.length**2 - drop**2
        # Pythagoras loses accuracy on steep lines, where the horizontal part is small.
        by_height = np.sqrt(np.where(square > (STEEP * self.length) ** 2, square, np.nan))
        if heights_first:
            by_angle, by_height = by_height, by_angle
        reduced = np.where(self.flat, flat, np.where(np.isfinite(by_angle), by_angle, by_height))
        good = np.isfinite(reduced)
        return medians(pair[good], reduced[good])


def medians(groups, values):
    """Sorted groups (k,), and the median of the values (n,) of each."""
    # Sorted by group, then by value: the median is in the middle of each group.
    order = np.lexsort([values, groups])
    groups, values = groups[order], values[order]
    distinct, first, count = np.unique(groups, return_index=True, return_counts=True)
    return distinct, 0.5 * (values[first + (count - 1) // 2] + values[first + count // 2])


def look_up(groups, values, wanted):
    """Values (n,) of the wanted groups (n,), nan for absent groups."""
    if not len(groups):
        return np.full(len(wanted), np.nan)
    place = np.minimum(np.searchsorted(groups, wanted), len(groups) - 1)
    return np.where(groups[place] == wanted, values[place], np.nan)


def plan_of(survey):
    """The Plan of a survey, without rejected observations."""
    groups = [
        (item if item.use is None else item.taken(item.use > 0)) for item in survey.observations
    ]
    circles = _Circles(len(survey.sets))
    for item in groups:
        if isinstance(item, Directions):
            circles.add(item.start, item.end, item.set, item.value)
        elif isinstance(item, Azimuths):
            circles.add_azimuths(item)
        elif isinstance(item, HorizontalAngles):
            circles.add_angles(item)
    points = len(survey.points)
    return Plan(
        *circles.rows(), *circles.zeros(), *_distances(survey, groups), *_slopes(groups), points
    )


def _join_columns(parts, kinds):
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
    for item in groups:
        if isinstance(item, Distances):
            # Invert reading = (1 + scale) true + offset.
            length = (item.value - offset[item.instrument]) / (1 + scale[item.instrument])
            flat = np.full(len(item), item.horizontal)
            parts.append((item.start, item.end, length, flat, _rise(item)))
    return _join_columns(parts, (int, int, float, bool, float))


def _slopes(groups):
    """Low, high, slope, lift, bend of all vertical angles."""
    parts = []
    for item in groups:
        if isinstance(item, VerticalAngles):
            # Zenith angles become angles above the horizon.
            slope = np.pi / 2 - item.value if item.zenith else item.value
            bend = np.full(len(item), item.bend_per_m)
            parts.append((item.start, item.end, slope, _rise(item), bend))
    return _join_columns(parts, (int, int, float, float, float))


def _rise(sights):
    """Instrument height minus target height (n,), m."""
    return np.zeros(len(sights)) if sights.rise_m is None else sights.rise_m


class _Circles:
    """Directions by circle; direction sets come first, with their own numbers."""

    def __init__(self, sets):
        self.parts, self.north = [], [False] * sets

    def add(self, station, target, circle, reading):
        self.parts.append((station, target, circle, reading))

    def add_azimuths(self, azimuths):
        stations, circle = np.unique(azimuths.start, return_inverse=True)
        self.add(azimuths.start, azimuths.end, circle + len(self.north), azimuths.value)
        self.north += [True] * len(stations)

    def add_angles(self, angles):
        """Chain the angles of a station with common sights from the first sight."""
        for station in np.unique(angles.start):
            is_at_station = angles.start == station
            links = {}
            for a, b, angle in zip(
                angles.origin[is_at_station],
                angles.end[is_at_station],
                angles.value[is_at_station],
                strict=True,
            ):
                links.setdefault(int(a), []).append((int(b), angle))
                links.setdefault(int(b), []).append((int(a), -angle))
            chained = set()
            for first in links:
                if first in chained:
                    continue
                chain = _chain_angles(first, links)
                chained |= set(chain)
                rows = np.array(list(chain)), np.array(list(chain.values()))
                count = len(chain)
                number = np.full(count, len(self.north))
                self.add(np.full(count, station), rows[0], number, rows[1])
                self.north.append(False)

    def rows(self):
        return _join_columns(self.parts, (int, int, int, float))

    def zeros(self):
        station, _, circle, _ = self.rows()
        at = np.full(len(self.north), -1)
        at[circle[::-1]] = station[::-1]
        return np.array(self.north, dtype=bool), at


def _chain_angles(first, links):
    """Readings {target: rad} from angles between targets, the first target at zero."""
    readings, queue = {first: 0.0}, [first]
    # Breadth-first: each reading is the sum of as few angles as possible.
    while queue:
        here = queue.pop(0)
        for target, angle in links[here]:
            if target not in readings:
                readings[target] = readings[here] + angle
                queue.append(target)
    return readings
