"""What a tank of the nominal sizes would read: a job whose readings agree with one another.

Its wall is round, upright and of the nominal inside radius; plates and paint lie round it. The
reductions are those of the job, turned round, so that nothing is left of a reading when they have
been made.
"""

from dataclasses import replace

import numpy as np

from tankcal.geometry.field.information import expect_amplitudes
from tankcal.geometry.girth import tangent_excess
from tankcal.pipeline.surveying import find_survey
from tankcal.pipeline.wall_straps import area_term
from tankcal.planning.wall.foreseen_tables import tangent_sight
from tankcal.planning.wall.nominal_filling import with_nominal_batches
from tankcal.survey.readings import read_distance_m
from tankcal.survey.strapping import reduce_straps

OFFSET_M = 0.2  # of the lowest wall from a line
CLOSE_M, ROUNDS = 1e-12, 20


def with_nominal_readings(job, amplitudes, expected_run=None):
    """The job with the readings of circumferences, offsets, hits, tangents and meters that its
    sizes give.

    amplitudes    of the wall, for the area term of a shape that nobody declared, and for its hull
    expected_run  relative sd of the run effect, where runs of liquid are to show it
    """
    if job.tank.kind == "vertical":
        if job.tangents is not None:
            amplitudes = _expected(_nominal(job, amplitudes), amplitudes)
        job = _nominal(job, amplitudes)
    if job.liquid is None:
        return job
    survey = find_survey(job, lambda text: None, amplitudes).survey
    return with_nominal_batches(job, survey, expected_run)


def _expected(job, amplitudes):
    """`Amplitudes` as well known as its readings will tell them: as its tangents are reduced."""
    return expect_amplitudes(find_survey(job, lambda text: None, amplitudes).survey.field)


def _nominal(job, amplitudes):
    nominal = job.tank.nominal_diameter_m / 2
    outer = {one.name: nominal + one.thickness_m + one.paint_m for one in job.courses}
    measurements = job.measurements
    if job.tangents is not None:
        measurements = replace(
            measurements, readings=tuple(map(_ranger(job), measurements.readings))
        )
    return replace(
        job,
        measurements=measurements,
        strapping=job.strapping and _strapped(job, outer, amplitudes),
        lines=job.lines and _plumbed(job.lines, outer, nominal),
        hits=job.hits and _hit(job, outer, nominal),
        tangents=job.tangents and _sighted(job, outer, amplitudes),
    )


def _strapped(job, outer, amplitudes):
    """Readings whose reduction gives the circle of equal area, found by going back to them."""
    given, nominal = job.strapping, job.tank.nominal_diameter_m / 2
    term = area_term(given.shape_sd_m, amplitudes, nominal)[0]
    girth = np.array([2 * np.pi * outer[one.course] for one in given.straps])
    girth *= np.sqrt(1 + term.mean)
    for _ in range(ROUNDS):
        reduced = reduce_straps(given, job.survey.shell_temperature_c, 2 * nominal)
        short = girth - [one.circumference_m for one in reduced]
        straps = zip(given.straps, short, strict=True)
        given = replace(
            given,
            straps=tuple(replace(one, reading_m=one.reading_m + float(by)) for one, by in straps),
        )
        if np.abs(short).max() < CLOSE_M:
            break
    return given


def _plumbed(given, outer, nominal_m):
    """Offsets from upright lines: outside they fall where the wall stands out, inside none does."""
    first = next(iter(outer.values()))
    found = []
    for one in given.offsets:
        line, plummet = given.of(one)
        away = OFFSET_M if line.inside else OFFSET_M + first - outer[one.course]
        found.append(replace(one, offset_m=away / (1 + plummet.correction)))
    return replace(given, offsets=tuple(found))


def _hit(job, outer, nominal_m):
    """Hits along their own sights, as far as the wall: its inside, or its outside."""
    hits = job.hits
    distance = np.empty(len(hits))
    for i, (name, course) in enumerate(zip(hits.setup, hits.course, strict=True)):
        station = hits.stations.get(hits.setups[name].station, np.zeros(3))[:2]
        inside = np.hypot(*station) < nominal_m
        zenith, turn = np.sin(hits.zenith_rad[i]), hits.direction_rad[i]
        ray = np.array([np.sin(turn), np.cos(turn)])
        radius = nominal_m if inside else outer[course]
        along = station @ ray
        root = np.sqrt(max(along**2 - station @ station + radius**2, 0.0))
        distance[i] = (-along + (root if inside else -root)) / zenith
    known = [hits.instruments[name] for name in hits.instrument]
    scale = np.array([one.correction for one in known])
    added = np.array([one.correction_m for one in known])
    return replace(hits, distance_m=distance / (1 + scale) - added)


def _sighted(job, outer, amplitudes):
    """Sights past the outside of each course, and past what hulls of such walls stand out by."""
    tangents, datum = job.tangents, job.datum
    excess = tangent_excess(amplitudes, job.tank.nominal_diameter_m / 2)[0]
    zero = datum.bottom_z_m + datum.plate_level_m
    stations = place_stations(job)
    found = [
        tangent_sight(stations[name], zero + level, outer[course] + excess, right)
        for name, course, level, right in zip(
            tangents.setup, tangents.course, tangents.level_m, tangents.is_right, strict=True
        )
    ]
    return replace(
        tangents,
        direction_rad=np.radians([one["direction_deg"] for one in found]),
        zenith_rad=np.radians([one["zenith_deg"] for one in found]),
    )


def _ranger(job):
    """Function Readings -> Readings: true distances as their instruments read them."""
    tools = {one.name: one for one in job.measurements.instruments}
    used = {one.name: one.instrument for one in job.measurements.setups}

    def read(readings):
        if readings.table != "slope_distances":
            return readings
        value = [
            one if used[name] is None else read_distance_m(one, tools[used[name]])
            for name, one in zip(readings.setup, readings.value, strict=True)
        ]
        return replace(readings, value=np.array(value))

    return read


def place_stations(job):
    """{set-up of tangents: (3,) place of its instrument} as its plan has them."""
    known = job.measurements.control
    places = dict(zip(known.point, known.xyz_m, strict=True))
    return {
        name: places[one.station] + [0, 0, one.height_m]
        for name, one in job.tangents.setups.items()
    }
