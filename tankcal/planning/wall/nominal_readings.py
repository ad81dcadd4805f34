"""What a tank of the nominal sizes would read: a job whose readings agree with one another.

Its wall is round, upright and of the nominal inside radius; plates and paint lie round it. The
reductions are those of the job, turned round, so that nothing is left of a reading when they have
been made.
"""

from dataclasses import replace

import numpy as np

from tankcal.pipeline.wall_straps import area_term
from tankcal.survey.strapping import reduce_straps

OFFSET_M = 0.2  # of the lowest wall from a line
CLOSE_M, ROUNDS = 1e-12, 20


def with_nominal_readings(job, amplitudes):
    """The job with the readings of circumferences, offsets and hits that its sizes give.

    amplitudes  of the wall, for the area term of a shape that nobody declared
    """
    nominal = job.tank.nominal_diameter_m / 2
    outer = {one.name: nominal + one.thickness_m + one.paint_m for one in job.courses}
    return replace(
        job,
        strapping=job.strapping and _strapped(job, outer, amplitudes),
        lines=job.lines and _plumbed(job.lines, outer, nominal),
        hits=job.hits and _hit(job, outer, nominal),
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
