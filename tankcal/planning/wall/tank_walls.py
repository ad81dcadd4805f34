"""Walls of a plan's tank, as readings meet them: the round one that is foreseen, and drawn ones.

Both stand upright about the origin of the frame. Of a drawn wall the readings follow from its
outline: a tape from its hull, a ray from where it meets it, a limb from the last place in sight.
"""

from functools import cached_property

import numpy as np

from tankcal.geometry.drawn_outlines import draw_departures
from tankcal.geometry.field.sites import spans_of
from tankcal.geometry.girth import girth_of, tangent_excess
from tankcal.geometry.outlines import FULL_TURN
from tankcal.pipeline.wall_straps import area_term
from tankcal.planning.wall.foreseen_tables import azimuth_of_axis, limb_of_circle
from tankcal.quadrature import panels

PANELS, NODES = 4, 6  # of a course's height, over which the areas of a drawn wall are summed up
DECIMALS = 6  # of heights within a course that are one


class RoundWall:
    """A cylinder of the nominal inside radius, with the hull that walls have on average.

    job         Job of an upright tank
    amplitudes  of its wall: for the area term of a shape that nobody declared, and for its hull
    """

    def __init__(self, job, amplitudes):
        self._job, self._amplitudes = job, amplitudes
        self.nominal_m = job.tank.nominal_diameter_m / 2
        self._plates = plates_of(job)

    @cached_property
    def _area_term(self):
        given = self._job.strapping.shape_sd_m
        return area_term(given, self._amplitudes, self.nominal_m)[0].mean

    @cached_property
    def _excess_m(self):
        return float(tangent_excess(self._amplitudes, self.nominal_m, [0.5])[0, 0])

    def girth_m(self, course, level_m):
        """Perimeter of the painted shell that a tape lies on."""
        around = FULL_TURN * (self.nominal_m + self._plates[course])
        return around * np.sqrt(1 + self._area_term)

    def radius_m(self, course, level_m, azimuth_rad, *, inside):
        """(n,) radii at azimuths, of the wall inside or of its paint outside."""
        off = 0.0 if inside else self._plates[course]
        return np.full(np.shape(azimuth_rad), self.nominal_m + off)

    def limb(self, station_m, course, level_m, *, is_right):
        """Azimuth of a sight from a station (2,) to a limb, and how long it is."""
        radius = self.nominal_m + self._plates[course] + self._excess_m
        return limb_of_circle(station_m, radius, is_right=is_right)


class DrawnWall:
    """A wall of components that are drawn.

    job     Job of an upright tank
    sizes   (components,) variances of the components, m2
    levels  (course, level above the table's zero, m) of all that is read of it
    rng     of numpy
    """

    def __init__(self, job, sizes, levels, rng):
        self.nominal_m = job.tank.nominal_diameter_m / 2
        self._plates = plates_of(job)
        self._number = {one.name: i for i, one in enumerate(job.courses)}
        self._heights = np.array([one.height_m for one in job.courses])
        self._feet = np.cumsum(self._heights) - self._heights
        self._zero_m = job.datum.plate_level_m
        within, self._shares = panels(np.linspace(0.0, 1.0, PANELS + 1), NODES)
        nodes = np.round(within, DECIMALS).tolist()
        parts = sorted({*nodes, *(self._part(*one) for one in levels)})
        self._row = {part: row for row, part in enumerate(parts)}
        self._summed = [self._row[one] for one in nodes]
        welds = [one.welds_rad or () for one in job.courses]
        zeta = 2 * np.array(parts) - 1
        spans = spans_of(np.append(self._feet, self._heights.sum()))
        self._departures = draw_departures(rng, sizes, zeta, welds, self.nominal_m, spans)
        count = self._departures.shape[2]
        self._azimuth = np.arange(count) * FULL_TURN / count

    def girth_m(self, course, level_m):
        """As of `RoundWall`."""
        return girth_of(self._outline(course, level_m, inside=False))

    def radius_m(self, course, level_m, azimuth_rad, *, inside):
        """As of `RoundWall`."""
        radii = self._outline(course, level_m, inside=inside)
        return np.interp(azimuth_rad, self._azimuth, radii, period=FULL_TURN)

    def limb(self, station_m, course, level_m, *, is_right):
        """As of `RoundWall`."""
        radii = self._outline(course, level_m, inside=False)
        ray = np.array([np.sin(self._azimuth), np.cos(self._azimuth)])
        way = radii * ray - np.asarray(station_m)[:, None]
        axis = azimuth_of_axis(station_m)
        turn = (np.arctan2(*way) - axis + np.pi) % FULL_TURN - np.pi
        last = np.argmax(turn) if is_right else np.argmin(turn)
        return axis + turn[last], float(np.hypot(*way[:, last]))

    def more_m3(self, dips_m):
        """(n,) by how much it holds more than the round wall below dips."""
        radii = self.nominal_m + self._departures[:, self._summed]
        more = np.pi * (np.mean(radii**2, axis=2) - self.nominal_m**2)
        step = self._heights[:, None] * self._shares
        heights = np.append(0.0, np.cumsum(step))
        below = np.append(0.0, np.cumsum(more * step))
        at = np.interp([0.0, *dips_m], heights - self._zero_m, below)
        return at[1:] - at[0]

    def _part(self, course, level_m):
        """Height within a course, of 1."""
        foot, height = (one[self._number[course]] for one in (self._feet, self._heights))
        return float(np.round((level_m + self._zero_m - foot) / height, DECIMALS))

    def _outline(self, course, level_m, *, inside):
        """(azimuths,) radii of a level."""
        row = self._row[self._part(course, level_m)]
        off = 0.0 if inside else self._plates[course]
        return self.nominal_m + off + self._departures[self._number[course], row]


def plates_of(job):
    """{course: its plate and paint, m}."""
    return {one.name: one.thickness_m + one.paint_m for one in job.courses}
