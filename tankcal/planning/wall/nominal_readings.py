"""What a tank would read: a job whose readings agree with one another, or are off by what they may.

The wall is a round one of the nominal inside radius, or any other (`tank_walls`); plates and paint
lie round it. The reductions are those of the job, turned round, so that nothing is left of a
reading when they have been made.
"""

from dataclasses import replace

import numpy as np

from tankcal.geometry.field.information import expect_amplitudes
from tankcal.geometry.outlines import FULL_TURN
from tankcal.pipeline.surveying import find_survey
from tankcal.planning.wall.foreseen_tables import OFF_WALL_M
from tankcal.planning.wall.nominal_filling import with_nominal_batches
from tankcal.planning.wall.reading_errors import EXACT
from tankcal.planning.wall.tank_walls import RoundWall, plates_of
from tankcal.survey.readings import read_distance_m
from tankcal.survey.sighting import bias_by_incidence, rays
from tankcal.survey.strapping import reduce_straps

CLOSE_M, ROUNDS = 1e-12, 20
MILLIMETRES = 3  # decimals of heights of hits that are one level


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
    measurements = job.measurements
    if job.tangents is not None:
        measurements = replace(
            measurements, readings=tuple(map(_ranger(job), measurements.readings))
        )
    return with_readings(replace(job, measurements=measurements), RoundWall(job, amplitudes))


def with_readings(job, wall, errors=EXACT):
    """The job with the circumferences, offsets, hits and limbs that a wall of its tank reads.

    wall    RoundWall or DrawnWall      errors  Errors of the readings
    """
    return replace(
        job,
        strapping=job.strapping and _strapped(job, wall, errors),
        lines=job.lines and _plumbed(job, wall, errors),
        hits=job.hits and _hit(job, wall, errors),
        tangents=job.tangents and _sighted(job, wall, errors),
    )


def levels_read(job):
    """{(course, level above the table's zero, m)} of all that is read of a wall."""
    found = set()
    for given in (job.strapping and job.strapping.straps, job.lines and job.lines.offsets):
        found |= {(one.course, one.level_m) for one in given or ()}
    if job.tangents is not None:
        found |= set(zip(job.tangents.course, job.tangents.level_m.tolist(), strict=True))
    return found | (set() if job.hits is None else set(_levels_of_hits(job)))


def _strapped(job, wall, errors):
    """Readings whose reduction gives the wall's perimeters, found by going back to them."""
    given, diameter = job.strapping, job.tank.nominal_diameter_m
    shell_c = job.survey.shell_temperature_c
    girth = np.array([wall.girth_m(one.course, one.level_m) for one in given.straps])
    reduced = reduce_straps(given, shell_c, diameter)
    girth += errors.own([one.sd_m for one in reduced])
    girth += [sum(errors.of_cause(e.kind, e.name) * e.by_m for e in one.effects) for one in reduced]
    for _ in range(ROUNDS):
        reduced = reduce_straps(given, shell_c, diameter)
        short = girth - [one.circumference_m for one in reduced]
        straps = zip(given.straps, short, strict=True)
        given = replace(
            given,
            straps=tuple(replace(one, reading_m=one.reading_m + float(by)) for one, by in straps),
        )
        if np.abs(short).max() < CLOSE_M:
            break
    return given


def _plumbed(job, wall, errors):
    """Offsets from upright lines: outside they fall where the wall stands out, inside they rise."""
    given, first = job.lines, job.courses[0].name
    constant = wall.nominal_m + plates_of(job)[first]
    found = []
    for one, off in zip(
        given.offsets, errors.own([one.sd_m for one in given.offsets]), strict=True
    ):
        line, plummet = given.of(one)
        place = one.course, one.level_m, line.azimuth_rad
        radius = float(wall.radius_m(*place, inside=line.inside))
        away = radius - wall.nominal_m if line.inside else constant - radius
        leans = given.by_collimation_m(one) * errors.collimation_rad(plummet)
        away += OFF_WALL_M + (leans if line.inside else -leans)
        away /= (1 + plummet.correction) * (1 + errors.scale(plummet))
        found.append(replace(one, offset_m=away + float(off)))
    return replace(given, offsets=tuple(found))


def _stations_of_hits(hits):
    """(n, 3) where the instrument of each hit stands."""
    places = {
        name: hits.stations.get(one.station, np.zeros(3)) + [0.0, 0.0, one.height_m]
        for name, one in hits.setups.items()
    }
    return np.array([places[name] for name in hits.setup])


def _levels_of_hits(job):
    """(course, level above the table's zero, m) of each hit, as it is aimed."""
    hits, datum = job.hits, job.datum
    rise = hits.distance_m * np.cos(hits.zenith_rad)
    z = _stations_of_hits(hits)[:, 2] + rise - datum.bottom_z_m - datum.plate_level_m
    return list(zip(hits.course, np.round(z, MILLIMETRES).tolist(), strict=True))


def _hit(job, wall, errors):
    """Hits along their own sights, as far as the wall: its inside, or its outside."""
    hits, levels = job.hits, _levels_of_hits(job)
    station, ray = _stations_of_hits(hits)[:, :2], rays(hits.direction_rad, hits.zenith_rad)[0]
    inside, ray = np.hypot(*station.T) < wall.nominal_m, ray[:, :2]
    distance, cosine = np.empty(len(hits)), np.empty(len(hits))
    kinds = list(zip(levels, inside.tolist(), strict=True))
    for level, within in dict.fromkeys(kinds):
        mine = np.array([one == (level, within) for one in kinds])
        distance[mine], cosine[mine] = _met(wall, station[mine], ray[mine], level, inside=within)
    known = [hits.instruments[name] for name in hits.instrument]
    bias = [errors.of_cause("incidence", one.name) * one.u_incidence_m for one in known]
    distance *= 1 + np.array([errors.scale(one) for one in known])
    distance += np.array([errors.offset_m(one) for one in known])
    distance += np.array(bias) * bias_by_incidence(cosine)
    distance /= 1 + np.array([one.correction for one in known])
    distance -= np.array([one.correction_m for one in known])
    return replace(
        hits,
        distance_m=distance + errors.own(hits.sd_m),
        direction_rad=hits.direction_rad + errors.own(hits.sd_rad),
        zenith_rad=hits.zenith_rad + errors.own(hits.sd_rad),
    )


def _met(wall, station_m, ray, level, *, inside):
    """How far along rays (n, 2), in plan, a level of the wall is, and the cosine of incidence."""
    square, along = np.sum(ray**2, axis=1), np.sum(station_m * ray, axis=1)
    beyond = along**2 - square * (np.sum(station_m**2, axis=1) - wall.nominal_m**2)
    root = np.sqrt(np.maximum(beyond, 0.0))
    far = (-along + (root if inside else -root)) / square
    for _ in range(ROUNDS):
        x, y = (station_m + far[:, None] * ray).T
        away = np.hypot(x, y)
        slope = (x * ray[:, 0] + y * ray[:, 1]) / away
        short = wall.radius_m(*level, np.arctan2(x, y), inside=inside) - away
        far = far + short / slope
        if np.abs(short).max() < CLOSE_M:
            break
    return far, np.abs(slope)


def _sighted(job, wall, errors):
    """Sights past the outside of each course, at the height that is aimed at."""
    tangents, datum = job.tangents, job.datum
    zero = datum.bottom_z_m + datum.plate_level_m
    stations, sights = place_stations(job), []
    for name, course, level, is_right in zip(
        *(tangents.setup, tangents.course, tangents.level_m.tolist(), tangents.is_right),
        strict=True,
    ):
        x, y, z = stations[name]
        azimuth, length = wall.limb((x, y), course, level, is_right=bool(is_right))
        sights.append((azimuth % FULL_TURN, np.arctan2(length, zero + level - z)))
    direction, zenith = np.array(sights).T
    return replace(
        tangents,
        direction_rad=direction + errors.own(tangents.sd_rad),
        zenith_rad=zenith + errors.own(tangents.sd_rad),
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
