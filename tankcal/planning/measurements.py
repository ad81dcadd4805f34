"""Measurements of a plan, with the values that would be read at the nominal positions.

Values are computed from the nominal positions, either without errors or with errors drawn from
their standard deviations.
"""

from dataclasses import replace

import numpy as np

from tankcal.geometry.rotations import angles_of
from tankcal.planning.model import TAPED
from tankcal.planning.places import find_measurable, readings_of_bases
from tankcal.survey import Nominal
from tankcal.survey.measurements import ImageReadings, KnownPoints, Photo, Readings, Setup, Targets
from tankcal.survey.observations import KINDS
from tankcal.survey.readings import read_distance_m

BLUNDER_SDS = 20.0  # size of a simulated blunder, in standard deviations of its reading


def nominal_of(plan):
    """Return the surveys.Nominal of a Plan."""
    return Nominal(
        plan.points, {photo.name: (photo.xyz_m, photo.rotation) for photo in plan.photos}
    )


def measurements_of(plan, seen):
    """Return the job.Measurements of a Plan: standard deviations of all readings, with values 0.

    Repeated readings are one value with the standard deviation of their mean.
    """
    counts = find_measurable(plan, seen)
    seen = replace(seen, on_photo=seen.on_photo & counts, on_setup=seen.on_setup & counts)
    determined = {name for name, is_there in zip(seen.points, counts, strict=True) if is_there}
    return replace(
        plan.job.measurements,
        photos=tuple(_photo(photo) for photo in plan.photos),
        image_points=_image_points(plan, seen),
        control=_control(plan),
        targets=targets_of(plan),
        setups=tuple(Setup(setup.name, setup.name, setup.instrument) for setup in plan.setups),
        readings=(
            *_sights(plan, seen),
            *_ties(plan, determined),
            *readings_of_bases(plan, determined),
        ),
    )


def _photo(photo):
    values = np.concatenate([photo.xyz_m, angles_of(photo.rotation)])
    return Photo(photo.name, photo.camera, values, np.full(6, np.nan))


def _image_points(plan, seen):
    photo, point = np.nonzero(seen.on_photo)
    if not len(photo):
        return None
    sd = np.array([photo.sd_mm / np.sqrt(photo.readings) for photo in plan.photos])
    return ImageReadings(
        photo=tuple(plan.photos[k].name for k in photo.tolist()),
        point=tuple(seen.points[k] for k in point.tolist()),
        xy_mm=seen.image_mm[photo, point],
        sd_mm=np.repeat(sd[photo, None], 2, axis=1),
        check=np.zeros(len(photo), dtype=bool),
    )


def _control(plan):
    if not plan.known:
        return None
    return KnownPoints(
        point=tuple(point.name for point in plan.known),
        xyz_m=np.array([point.xyz_m for point in plan.known]),
        sd_m=np.array([point.sd_m for point in plan.known]),
        system=(None,) * len(plan.known),
        check=np.zeros(len(plan.known), dtype=bool),
    )


def targets_of(plan):
    """Return the targets of a plan as the table targets.csv of a survey.

    Returns
    -------
    Targets
        As a job reads them; heights and offsets in m.
    """
    targets = plan.targets
    return Targets(
        targets.names,
        targets.section,
        targets.generatrix,
        targets.xyz_m[:, 2],
        np.full(len(targets.names), targets.offset_m),
    )


def _sights(plan, seen):
    """Return the readings of directions, zenith angles and slope distances of all set-ups."""
    for table, key in (
        ("directions", "direction_sd_rad"),
        ("zenith_angles", "zenith_sd_rad"),
        ("slope_distances", "distance_sd_m"),
    ):
        setup, end, sd = [], [], []
        for k, instrumented in enumerate(plan.setups):
            if getattr(instrumented, key) is None:
                continue
            names = [seen.points[i] for i in np.flatnonzero(seen.on_setup[k])]
            setup += [instrumented.name] * len(names)
            end += names
            sd += [getattr(instrumented, key) / np.sqrt(instrumented.sets)] * len(names)
        if end:
            yield _readings(table, [None] * len(end), end, sd, setup=tuple(setup))


def _ties(plan, determined):
    """Return the readings of tapes, levels and plumb lines between the points `there`."""
    for table in TAPED:
        ties = [
            tie for tie in plan.ties if tie.table == table and {tie.start, tie.end} <= determined
        ]
        if not ties:
            continue
        more = {}
        if table == "distances":
            more = {
                "instrument": tuple(tie.instrument for tie in ties),
                "horizontal": np.array([tie.kind == "horizontal" for tie in ties]),
            }
        sd = [tie.sd_m / np.sqrt(tie.readings) for tie in ties]
        yield _readings(table, [tie.start for tie in ties], [tie.end for tie in ties], sd, **more)


def _readings(table, start, end, sd, **more):
    n = len(end)
    return Readings(
        table=table, value=np.zeros(n), sd=np.array(sd), start=tuple(start), end=tuple(end),
        check=np.zeros(n, dtype=bool), **more,
    )  # fmt: skip


def draw_measurements(plan, measurements, network, rng=None):
    """Return the Measurements with values computed from the nominal positions.

    Parameters
    ----------
    plan : Plan
    measurements : Measurements
    predicted : Predicted
        Prediction of the measurements.
    rng : numpy.random.Generator, optional
        None: no errors. Otherwise each reading has its own error, and the readings of an instrument
        share errors of its scale and offset.
    """
    values, draw = _nominal_values(network), _error_function(rng)
    off = {
        tool.name: tuple(
            float(draw(0.0, np.nan_to_num(u))) for u in (tool.u_scale, tool.u_offset_m)
        )
        for tool in measurements.instruments
    }
    tools = {tool.name: tool for tool in measurements.instruments}
    setups = {setup.name: setup for setup in measurements.setups}
    images, control = measurements.image_points, measurements.control
    if images is not None:
        images = replace(images, xy_mm=draw(images.xy_mm, images.sd_mm))
    if control is not None:
        control = replace(control, xyz_m=draw(control.xyz_m, np.nan_to_num(control.sd_m)))
    readings = tuple(
        _fill_values(reading, values, draw, (tools, off), setups)
        for reading in measurements.readings
    )
    return replace(measurements, image_points=images, control=control, readings=readings)


def _error_function(rng):
    """Return a function (value, sd) -> value with an error."""
    if rng is None:
        return lambda value, sd: np.array(value, dtype=float)
    return lambda value, sd: value + rng.standard_normal(np.shape(value)) * sd


def _nominal_values(network):
    """Return {(table, horizontal, names): value} of all readings at the nominal positions."""
    by_key, problem = {}, network.adjusted.problem
    for table in (*problem.observations, *(held.observations for held in problem.exact)):
        trace = table.trace
        if trace is None or not trace.table:
            continue
        computed = table.computed(problem.state, False)[0]
        for row, value in enumerate(computed[:, 0].tolist()):
            key = trace.table, bool(getattr(table, "horizontal", False))
            by_key[*key, *trace.ids[row]] = value
            if KINDS[trace.table].either_way:  # a tape may be read from either end
                by_key[*key, *reversed(trace.ids[row])] = value
    return by_key


def _fill_values(readings, values, draw, tools, setups):
    """Return readings with their values; readings of points that are left out keep the value 0."""
    starts = readings.setup or readings.start
    horizontal = readings.horizontal
    flat = np.zeros(len(starts), dtype=bool) if horizontal is None else horizontal
    keys = zip(flat.tolist(), starts, readings.end, strict=True)
    value = np.array([values.get((readings.table, *key), 0.0) for key in keys])
    if KINDS[readings.table].has("instrument"):
        names = [setups[setup].instrument for setup in readings.setup] or readings.instrument
        value = np.array(
            [
                _instrument_reading(setup, name, *tools)
                for setup, name in zip(value, names, strict=True)
            ]
        )
    elif readings.table == "plumb_lines":
        return readings
    return replace(readings, value=draw(value, readings.sd))


def _instrument_reading(true_m, name, tools, off):
    """Reading of a true distance by an instrument at the temperature of its certificate."""
    if name is None:
        return true_m
    scale, offset = off[name]
    return read_distance_m(true_m * (1.0 + scale) + offset, tools[name])


def draw_blunders(rng, share, count):
    """Draw errors in standard deviations: 0, or a blunder for a share of the readings.

    Parameters
    ----------
    rng : numpy.random.Generator
    share : float
        Probability of a blunder, 0 to 1.
    count : int
        Number of readings.

    Returns
    -------
    ndarray, shape (count,)
    """
    sign = np.where(rng.random(count) < 0.5, -1.0, 1.0)
    return BLUNDER_SDS * sign * (rng.random(count) < share)
