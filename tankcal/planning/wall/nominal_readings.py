"""Nominal readings of a tank: readings that agree with each other, or have simulated errors.

The wall is round with the nominal inside radius, or any other wall of `tank_walls`, with plates and
paint around it. The reductions of the job are inverted, so that they leave no residuals. Meters
show the volumes of the geometry of the job.

Simulated errors are independent for each reading, or common to the readings with one cause.

Expected uncertainty of amplitudes
----------------------------------

With V the covariance of the readings, P its inverse after elimination of the parameters without
prior, and K_i the part of V due to component i, the logarithms of the variances have the expected
information

    I_ij = tr(P K_i P K_j) / 2,

to which the information of their prior is added.

Source: Patterson & Thompson 1971 (restricted maximum likelihood).

Walls of a planned tank for simulated readings: a round wall and randomly drawn walls.

Both are vertical about the origin of the frame. Readings of a drawn wall follow from its outline: a
tape from its hull, a ray from its intersection, a limb from the last visible point.

Random walls are drawn from the prior of the wall components (`tankcal.geometry.field.components`).
"""

from dataclasses import replace
from functools import cached_property

import numpy as np

from tankcal.geometry.field.blunders import restricted_precision
from tankcal.geometry.field.components import COMPONENTS, Heights, mode_shares, weld_columns
from tankcal.geometry.field.sites import Covariances, free_design, spans_of
from tankcal.geometry.girth import draw_waves, girth_of, modes_of, nodes_of, tangent_excess
from tankcal.methods.base import given_methods, with_readings
from tankcal.pipeline.liquid import geometry_beside, load_geometry
from tankcal.pipeline.liquid.adjustment import adjust_liquid
from tankcal.pipeline.surveying import find_survey
from tankcal.pipeline.wall_straps import area_term
from tankcal.planning.measurements import draw_blunders
from tankcal.planning.wall.design_tables import azimuth_of_axis, limb_of_circle
from tankcal.quadrature import panels
from tankcal.survey.observations import KINDS
from tankcal.survey.readings import read_distance_m
from tankcal.tank.liquid import fill_of, load_densities, reduce_steps
from tankcal.units import FULL_TURN

UNKNOWN_OFFSET_M = 2e-3  # sd of the offset of an instrument without a prior
UNKNOWN_COLLIMATION_RAD = np.radians(10 / 3600)  # sd for a plummet read in both faces
HELD = 1e-6  # prior sd of the logarithm of a given variance, which is not estimated
PANELS, NODES = 4, 6  # Gauss panels per course and nodes per panel for the volume of a drawn wall
DECIMALS = 6  # decimals to which heights within a course are compared
NOTHING = 1e-12  # relative to the largest eigenvalue: smaller eigenvalues are rounding errors


class Errors:
    """Errors of one simulated survey.

    rng is a numpy generator; blunders is the share of readings with an error of
    `measurements.BLUNDER_SDS` standard deviations.
    """

    def __init__(self, rng, blunders=0.0):
        self._rng, self._blunders, self._causes = rng, blunders, {}

    def draw(self, sd):
        """Independent errors (n,) of readings with standard deviations (n,)."""
        sd = np.asarray(sd, dtype=float)
        errors = self._rng.standard_normal(sd.shape)
        if self._blunders:
            errors += draw_blunders(self._rng, self._blunders, len(sd))
        return errors * sd

    def draw_cause(self, kind, name):
        """Error of a cause in this survey, in its standard uncertainties."""
        if (kind, name) not in self._causes:
            self._causes[kind, name] = float(self._rng.standard_normal())
        return self._causes[kind, name]

    def scale(self, tool):
        """Relative error of the scale of an instrument."""
        return self.draw_cause("instrument_scale", tool.name) * _value_or(tool.u_scale, 0.0)

    def offset_m(self, tool):
        """Error of the offset of an instrument, m."""
        u = _value_or(tool.u_offset_m, UNKNOWN_OFFSET_M)
        return self.draw_cause("instrument_offset", tool.name) * u

    def collimation_rad(self, plummet):
        """Collimation error of a plummet, rad."""
        u = _value_or(plummet.u_collimation_rad, UNKNOWN_COLLIMATION_RAD)
        return self.draw_cause("collimation", plummet.name) * u


class _Exact(Errors):
    """Errors that are all zero."""

    def __init__(self):
        super().__init__(None)

    def draw(self, sd):
        return np.zeros(np.shape(sd))

    def draw_cause(self, kind, name):
        return 0.0


EXACT = _Exact()


def add_network_errors(measurements, errors):
    """Return Measurements with errors of the readings and of the distance instruments."""
    tools = {tool.name: tool for tool in measurements.instruments}
    used = {setup.name: setup.instrument for setup in measurements.setups}

    def read(readings):
        value = readings.value
        if KINDS[readings.table].has("instrument"):
            names = [used[name] for name in readings.setup] or readings.instrument
            known = [tools.get(name) for name in names]
            value = value * [1.0 if tool is None else 1 + errors.scale(tool) for tool in known]
            value = value + [0.0 if tool is None else errors.offset_m(tool) for tool in known]
        return replace(readings, value=value + errors.draw(readings.sd))

    return replace(measurements, readings=tuple(map(read, measurements.readings)))


def _value_or(u, otherwise):
    return otherwise if u is None or np.isnan(u) else u


def set_nominal_readings(job, amplitudes, expected_run=None):
    """Return the job with nominal readings of tapes, offsets, hits, tangents and meters.

    Parameters
    ----------
    job : Job
    amplitudes : Amplitudes
        Amplitudes of the wall, for the area term of an undeclared shape and for the hull.
    expected_run : float, optional
        Relative sd of the run effect, if runs of liquid are to estimate it.
    """
    if job.tank.kind == "vertical":
        if any(method.is_smooth for method in given_methods(job)):
            # Smooth readings, such as tangents, are reduced with amplitudes of the precision that
            # the readings would reach.
            first = _set_nominal_wall(job, amplitudes)
            survey = find_survey(first, lambda text: None, amplitudes).survey
            amplitudes = expect_amplitudes(survey.field)
        job = _set_nominal_wall(job, amplitudes)
    if job.liquid is None:
        return job
    survey = find_survey(job, lambda text: None, amplitudes).survey
    return _set_nominal_batches(job, survey, expected_run)


def _set_nominal_wall(job, amplitudes):
    measurements = job.measurements
    if job.tangents is not None:
        measurements = replace(
            measurements, readings=tuple(map(_ranger(job), measurements.readings))
        )
    return set_readings(replace(job, measurements=measurements), RoundWall(job, amplitudes))


def set_readings(job, wall, errors=EXACT):
    """Return the job with the readings of a wall of its tank, by each of its methods.

    Parameters
    ----------
    job : Job
        Job with readings at the planned places; their values are replaced.
    wall : RoundWall or DrawnWall
    errors : Errors, optional
        Errors of the readings; default: none.

    Returns
    -------
    Job
    """
    return with_readings(
        job, {method: method.observe(job, wall, errors) for method in given_methods(job)}
    )


def levels_of_readings(job):
    """Return {(course, level above the table's zero, m)} of all readings of the wall."""
    return set().union(*(method.levels_read(job) for method in given_methods(job)))


def _ranger(job):
    """Return a function Readings -> Readings: true distances to instrument readings."""
    tools = {tool.name: tool for tool in job.measurements.instruments}
    used = {setup.name: setup.instrument for setup in job.measurements.setups}

    def read(readings):
        if readings.table != "slope_distances":
            return readings
        value = [
            value if used[name] is None else read_distance_m(value, tools[used[name]])
            for name, value in zip(readings.setup, readings.value, strict=True)
        ]
        return replace(readings, value=np.array(value))

    return read


def place_stations(job):
    """Return {set-up of tangents: instrument position (3,)} of a job's plan."""
    known = job.measurements.control
    places = dict(zip(known.point, known.xyz_m, strict=True))
    return {
        name: places[setup.station] + [0, 0, setup.height_m]
        for name, setup in job.tangents.setups.items()
    }


# ---- metered liquid


def _set_nominal_batches(job, survey, expected_run=None):
    """Return the job with the metered volumes that follow from its own geometry.

    Parameters
    ----------
    job : Job
        Job whose runs have volumes of approximately the right size.
    survey : Wall, StrappedWall, NominalWall or None
        Wall by its readings.
    expected_run : float, optional
        Relative standard deviation of the run effect, if the runs are to estimate it.
    """
    metering, fill = job.liquid, fill_of(job.liquid)
    rows = fill.dip_row
    densities = np.append(metering.density_kg_m3, load_densities(metering, fill))
    dips, shell = metering.dip_m[rows], metering.shell_c[rows]
    loaded = load_geometry(geometry_beside(job, survey), densities, dips, shell)
    reduced = reduce_steps(metering, fill, loaded.volume_m3, loaded.growth)
    shown = (reduced.geometry_m3 - reduced.by_tank_temperature_m3) / reduced.metered_m3
    job = _scale_batches(job, fill, shown)
    if expected_run is None or metering.run_sd is not None:
        return job
    return _scale_batches(job, fill, 1 - _expect_runs(job, survey, expected_run)[fill.run])


def _scale_batches(job, fill, share):
    """Return the job with the batch of each step multiplied by a share.

    Here a step has one batch.
    """
    volume = job.liquid.volume_m3.copy()
    volume[fill.dip_row[fill.end]] *= share
    return replace(job, liquid=replace(job.liquid, volume_m3=volume))


def _expect_runs(job, survey, sd):
    """Run effects (runs,) whose differences have the size expected for a standard deviation sd.

    The observed differences d ~ N(0, theta + s) each have the size of their standard deviation
    (`tank.liquid.adjustment`). The common effect of all runs, which acts like the meter, is 0.
    """
    without = replace(job, liquid=replace(job.liquid, run_sd=0.0))
    result = adjust_liquid(geometry_beside(without, survey))
    by_run = result.readings.run_m3
    eigen, turn = np.linalg.eigh(by_run.T @ result.adjusted.weight @ by_run)
    shows = eigen > 1e-9 * eigen[-1]
    differences = np.where(shows, np.sqrt(sd**2 + 1 / np.where(shows, eigen, 1.0)), 0.0)
    differences[0] = 0.0
    return turn @ differences


def expect_amplitudes(field):
    """Return the `Amplitudes` of a field with the uncertainty expected after its survey.

    Parameters
    ----------
    field : WallField
        Sites and noise of the planned survey; its readings are not used.

    Returns
    -------
    Amplitudes
        Unchanged variances, with the posterior covariance of their logarithms.
    """
    amplitudes, covariances = field.amplitudes, Covariances(field.sites, field.nominal_m)
    sizes = amplitudes.likely_m2
    # Linearise at the most likely variances, without the factor exp(s^2 / 2) of the mean.
    without_spread = replace(amplitudes, log_covariance=np.zeros_like(amplitudes.log_covariance))
    likely = replace(field, amplitudes=without_spread)
    precision = restricted_precision(likely.covariance_m2, free_design(field.sites)[0])
    shares = [
        precision @ covariances.total(size * (np.arange(len(sizes)) == i))
        for i, size in enumerate(sizes)
    ]
    information = np.array(
        [[0.5 * np.sum(first * second.T) for second in shares] for first in shares]
    )
    is_given = np.diag(amplitudes.log_covariance) == 0
    # Posterior information is prior information plus that of the readings; HELD avoids a singular
    # prior.
    prior_information = np.linalg.inv(amplitudes.log_covariance + HELD**2 * np.diag(is_given))
    return replace(amplitudes, log_covariance=np.linalg.inv(prior_information + information))


# ---- walls of a planned tank for simulated readings: a round wall and randomly drawn walls


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
