"""Walls of a planned tank for simulated readings: a round wall and randomly drawn walls.

Both are vertical about the origin of the frame. Readings of a drawn wall follow from its outline: a
tape from its hull, a ray from its intersection, a limb from the last visible point.

Random walls are drawn from the prior of the wall components (`tankcal.geometry.field.components`).
"""

from functools import cached_property

import numpy as np

from tankcal.geometry.field.components import COMPONENTS, Heights, mode_shares, weld_columns
from tankcal.geometry.field.sites import spans_of
from tankcal.geometry.girth import draw_waves, girth_of, modes_of, nodes_of, tangent_excess
from tankcal.pipeline.wall_straps import area_term
from tankcal.planning.wall.design_tables import azimuth_of_axis, limb_of_circle
from tankcal.quadrature import panels
from tankcal.units import FULL_TURN

PANELS, NODES = 4, 6  # Gauss panels per course and nodes per panel for the volume of a drawn wall
DECIMALS = 6  # decimals to which heights within a course are compared
NOTHING = 1e-12  # relative to the largest eigenvalue: smaller eigenvalues are rounding errors


class RoundWall:
    """A cylinder of the nominal inside radius, with the mean hull of walls.

    job is the Job of an upright tank; amplitudes are those of its wall, for the area term of an
    undeclared shape and for its hull.
    """

    def __init__(self, job, amplitudes):
        self._job, self._amplitudes = job, amplitudes
        self.nominal_m = job.tank.nominal_diameter_m / 2
        self._plates = plates_of(job)

    @cached_property
    def _area_term(self):
        shape_sd_m = self._job.strapping.shape_sd_m
        return area_term(shape_sd_m, self._amplitudes, self.nominal_m)[0].mean

    @cached_property
    def _excess_m(self):
        return float(tangent_excess(self._amplitudes, self.nominal_m, [0.5])[0, 0])

    def girth_m(self, course, level_m):
        """Perimeter of the painted shell under a tape, m."""
        around = FULL_TURN * (self.nominal_m + self._plates[course])
        return around * np.sqrt(1 + self._area_term)

    def radius_m(self, course, level_m, azimuth_rad, *, inside):
        """Radii (n,) at azimuths, m, of the wall inside or of its paint outside."""
        off = 0.0 if inside else self._plates[course]
        return np.full(np.shape(azimuth_rad), self.nominal_m + off)

    def limb(self, station_m, course, level_m, *, is_right):
        """Azimuth and length of a sight from a station (2,) to a limb."""
        radius = self.nominal_m + self._plates[course] + self._excess_m
        return limb_of_circle(station_m, radius, is_right=is_right)


class DrawnWall:
    """A wall of randomly drawn components.

    Attributes
    ----------
    job : Job
        Job of an upright tank.
    sizes : ndarray, shape (components,)
        Variances of the components, m2.
    levels : iterable
        (course, level above the table's zero, m) of all readings.
    rng : numpy.random.Generator
    """

    def __init__(self, job, sizes, levels, rng):
        self.nominal_m = job.tank.nominal_diameter_m / 2
        self._plates = plates_of(job)
        self._number = {course.name: i for i, course in enumerate(job.courses)}
        self._heights = np.array([course.height_m for course in job.courses])
        self._feet = np.cumsum(self._heights) - self._heights
        self._zero_m = job.datum.plate_level_m
        within, self._shares = panels(np.linspace(0.0, 1.0, PANELS + 1), NODES)
        nodes = np.round(within, DECIMALS).tolist()
        parts = sorted({*nodes, *(self._part(*level) for level in levels)})
        self._row = {part: row for row, part in enumerate(parts)}
        self._summed = [self._row[node] for node in nodes]
        welds = [course.welds_rad or () for course in job.courses]
        zeta = 2 * np.array(parts) - 1
        spans = spans_of(np.append(self._feet, self._heights.sum()))
        self._departures = draw_departures(rng, sizes, zeta, welds, self.nominal_m, spans)
        count = self._departures.shape[2]
        self._azimuth = np.arange(count) * FULL_TURN / count

    def girth_m(self, course, level_m):
        """See `RoundWall.girth_m`."""
        return girth_of(self._outline(course, level_m, inside=False))

    def radius_m(self, course, level_m, azimuth_rad, *, inside):
        """See `RoundWall.radius_m`."""
        radii = self._outline(course, level_m, inside=inside)
        return np.interp(azimuth_rad, self._azimuth, radii, period=FULL_TURN)

    def limb(self, station_m, course, level_m, *, is_right):
        """See `RoundWall.limb`."""
        # The limb is the point of the outline farthest left or right of the sight to the axis.
        radii = self._outline(course, level_m, inside=False)
        ray = np.array([np.sin(self._azimuth), np.cos(self._azimuth)])
        way = radii * ray - np.asarray(station_m)[:, None]
        axis = azimuth_of_axis(station_m)
        turn = (np.arctan2(*way) - axis + np.pi) % FULL_TURN - np.pi
        last = np.argmax(turn) if is_right else np.argmin(turn)
        return axis + turn[last], float(np.hypot(*way[:, last]))

    def more_m3(self, dips_m):
        """Volumes (n,) below dips minus those of the round wall, m3."""
        # Area of an outline: pi times its mean square radius; Gauss weights sum over the heights.
        radii = self.nominal_m + self._departures[:, self._summed]
        more = np.pi * (np.mean(radii**2, axis=2) - self.nominal_m**2)
        step = self._heights[:, None] * self._shares
        heights = np.append(0.0, np.cumsum(step))
        below = np.append(0.0, np.cumsum(more * step))
        at = np.interp([0.0, *dips_m], heights - self._zero_m, below)
        return at[1:] - at[0]

    def _part(self, course, level_m):
        """Relative height within a course, 0 to 1."""
        foot, height = (values[self._number[course]] for values in (self._feet, self._heights))
        return float(np.round((level_m + self._zero_m - foot) / height, DECIMALS))

    def _outline(self, course, level_m, *, inside):
        """Radii (azimuths,) at a level, m."""
        row = self._row[self._part(course, level_m)]
        off = 0.0 if inside else self._plates[course]
        return self.nominal_m + off + self._departures[self._number[course], row]


def plates_of(job):
    """Return {course: thickness of plate and paint, m}."""
    return {course.name: course.thickness_m + course.paint_m for course in job.courses}


def draw_departures(rng, sizes_m2, zeta, welds_rad, nominal_m, spans=None):
    """Draw departures of the courses of a wall from a cylinder, without radius and centre terms.

    Parameters
    ----------
    rng : numpy.random.Generator
    sizes_m2 : ndarray, shape (components,)
        Variances of the components, m2.
    zeta : ndarray, shape (k,)
        Heights within each course, -1 to 1.
    welds_rad : sequence of ndarray
        Azimuths of the known vertical welds of each course, from the bottom up.
    nominal_m : float
        Radius of the tank, m.
    spans : ndarray, shape (courses, 2), optional
        Relative heights of bottom and top of each course, as in `Sites`.

    Returns
    -------
    ndarray, shape (courses, k, n)
        Departures at n evenly spaced azimuths clockwise from 0, m.

    Examples
    --------
    >>> still = np.zeros(len(COMPONENTS))
    >>> departures = draw_departures(np.random.default_rng(1), still, np.zeros(2), [()] * 3, 6.5)
    >>> departures.shape[:2], float(np.abs(departures).max())
    ((3, 2), 0.0)
    """
    shares = mode_shares(modes_of(nominal_m), nominal_m)
    count, courses = nodes_of(nominal_m), len(welds_rad)
    azimuth = np.arange(count) * FULL_TURN / count
    # Profile of each weld along the azimuth, one row for each weld of a course.
    peaks = [weld_columns(azimuth, np.array(item, dtype=float), nominal_m).T for item in welds_rad]
    spans = spans_of(np.arange(courses + 1.0)) if spans is None else spans
    heights = [Heights.within(span, zeta) for span in spans]
    departures = np.zeros((courses, len(zeta), count))
    for item, size in zip(COMPONENTS, sizes_m2, strict=True):
        if not size:
            continue
        draws = 1 if item.common else courses
        if item.shape == "weld":  # equal at all heights of a course
            sizes = [rng.normal(size=1 if item.common else len(columns)) for columns in peaks]
            for course, columns in enumerate(peaks):
                peak_sizes = np.broadcast_to(sizes[0 if item.common else course], len(columns))
                departures[course] += np.sqrt(size) * (peak_sizes @ columns)
            continue
        if item.shape == "settled":  # depends on the height above the foot of the shell
            over_height = np.sqrt(size) * np.array(
                [item.height_columns(course_heights) for course_heights in heights]
            )
        else:
            over_height = np.sqrt(size) * _factor_covariance(
                item.height_covariance(heights[0], heights[0])
            )
        # A field is the product of its root over the height and a random function of azimuth.
        if item.shape == "mean":
            around_turn = rng.normal(size=(draws, over_height.shape[-1], 1))
        else:
            around_turn = draw_waves(rng, shares[item.shape], (draws, over_height.shape[-1]))
        departures += over_height @ around_turn
    return departures


def _factor_covariance(covariance):
    """Return columns (k, r) A with A A' = covariance, without zero eigenvalues."""
    values, vectors = np.linalg.eigh(covariance)
    positive = values > NOTHING * values[-1]
    return vectors[:, positive] * np.sqrt(values[positive])
