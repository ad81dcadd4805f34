"""Jobs of generated walls that were surveyed in several ways at once, each with its own errors.

    job = ring_job(rng, wall, folder=folder, beside="lines")

Points, hits, tangents, straps and lines come from the generators of each; what they read is one
wall, and its courses, plates and frame are one.
"""

from dataclasses import replace
from functools import partial

import numpy as np
from generated_hits import (
    LAID_M,
    TAPE_M,
    TAPE_SCALE,
    U_OFFSET,
    Surface,
    Tool,
    _radius,
    even_aims,
    hit_job,
    take_hits,
)
from generated_lines import plumbed_job
from generated_strapping import PLATE_M, girth_of
from generated_walls import FULL_TURN, LEAN, Survey, job_of

from tankcal.methods.hits.wall import sight_wall
from tankcal.survey.measurements import Setup
from tankcal.survey.strapping import Strap, Strapping, Tape


def ring_job(rng, wall, *, folder, beside, points=16, noise_m=1e-3):
    """One ring of points on the first course; lines, or straps, on all."""
    azimuth = FULL_TURN * np.arange(points) / points + rng.uniform(0, FULL_TURN)
    course, zeta = np.zeros(points, dtype=int), np.full(points, -0.5)
    radius = wall.radius_at(course, zeta, azimuth % FULL_TURN) + PLATE_M
    radius += noise_m * rng.normal(size=points)
    job = job_of(wall, Survey(course, zeta, azimuth % FULL_TURN, radius, noise_m), folder / "ring")
    plates = replace(job.courses[0], thickness_m=PLATE_M)
    courses = tuple(replace(plates, name=str(i + 1)) for i in range(wall.courses))
    job = replace(job, courses=courses, survey=replace(job.survey, side="outside"))
    if beside == "lines":
        return replace(job, lines=lines_of(rng, wall, folder))
    return replace(job, strapping=straps_of(rng, wall))


def straps_of(rng, wall):
    """`Strapping` of two levels of each course, by one tape; the shape is left to the points."""
    tape = Tape("T", 0.0, 0.0, None, None, 0.0, TAPE_M, u_scale=TAPE_SCALE)
    long, found = 1 + TAPE_SCALE * rng.normal(), []
    for course in range(wall.courses):
        for part in (0.2, 0.8):
            girth = girth_of(wall, course, 2 * part - 1, PLATE_M) + np.pi * TAPE_M
            reading, level = girth / long + LAID_M * rng.normal(), (course + part) * wall.course_m
            name = f"{course + 1}-{part}"
            found.append(Strap(name, str(course + 1), level, reading, LAID_M, "T"))
    return Strapping(tuple(found), (tape,), shape_sd_m=None)


def lines_of(rng, wall, folder, lines=12):
    """`ReferenceLines` outside a wall, read on both faces."""
    return plumbed_job(rng, wall, lines=lines, folder=folder / "lines")[0].lines


def whole_job(rng, wall, *, folder, hits=12, lines=12):
    """Bare hits inside, two straps of the first course, and lines outside; the offset of the
    instrument and the collimation of the plummet are told by nothing else.
    """
    job = hit_job(rng, wall, folder=folder / "hits", hits=hits, straps=True)
    return replace(job, lines=lines_of(rng, wall, folder, lines))


def untied_job(rng, wall, *, folder, hits=8, setups=3, sd_m=1.5e-3):
    """Bare hits from set-ups in the tank that share nothing; where each stood is known to 0.1 m."""
    job = hit_job(rng, wall, folder=folder / "hits", hits=hits, sd_m=sd_m)
    given = job.hits
    size = wall.radius_m
    surface = Surface(partial(_radius, wall), (0.0, 0.0), tuple(2e-3 * rng.normal(size=2)))
    z = [(c + part) * wall.course_m for c in range(wall.courses) for part in (0.25, 0.75)]
    tool = Tool(U_OFFSET * rng.normal(), 1e-5 * rng.normal(), 1e-3 * rng.normal(), sd_m, 3e-5)
    read, places, known = [], {}, {}
    for i in range(setups):
        turn = FULL_TURN * i / setups
        station = np.array([0.4 * size * np.sin(turn), 0.4 * size * np.cos(turn), 1.6])
        aims = even_aims(surface, z, hits, turn=rng.uniform(0, 6))
        read.append(take_hits(surface, station, aims, tool, rng, zero=rng.uniform(0, 6)))
        name = f"I{i + 1}"
        places[f"S{i + 1}"] = np.array([*(station[:2] + 0.1 * rng.uniform(-1, 1, 2)), 0.0])
        known[name] = Setup(name, f"S{i + 1}", "TS", 1.6)
    return replace(job, hits=_of_untied(given, known, places, read, sd_m))


def outside_job(rng, wall, *, folder, hits, setups, sd_m=1.5e-3):
    """Bare hits from untied set-ups round the tank; each place is known to 0.1 m.

    Every set-up reads so many hits at each level, at incidences up to 60 degrees.
    """
    job = hit_job(rng, wall, folder=folder / "hits", hits=hits, sd_m=sd_m)
    size = wall.radius_m + PLATE_M
    surface = Surface(lambda azimuth, z: _radius(wall, azimuth, z) + PLATE_M, (0.0, 0.0), LEAN)
    z = [(c + part) * wall.course_m for c in range(wall.courses) for part in (0.25, 0.75)]
    tool = Tool(U_OFFSET * rng.normal(), 1e-5 * rng.normal(), 1e-3 * rng.normal(), sd_m, 3e-5)
    read, places, known, start = [], {}, {}, rng.uniform(0, FULL_TURN)
    for i in range(setups):
        turn = start + FULL_TURN * (i + rng.uniform(-0.1, 0.1)) / setups
        far = size + rng.uniform(5, 12)
        station = np.array([far * np.sin(turn), far * np.cos(turn), 1.6])
        seen = np.pi / 3 - np.arcsin(size / far * np.sin(np.pi / 3))  # sine rule, at 60 degrees
        azimuth = turn + np.linspace(-seen, seen, hits)
        aims = np.vstack([surface.at(azimuth, np.full(hits, level)) for level in z])
        read.append(take_hits(surface, station, aims, tool, rng, zero=rng.uniform(0, 6)))
        name = f"I{i + 1}"
        places[f"S{i + 1}"] = np.array([*(station[:2] + 0.1 * rng.uniform(-1, 1, 2)), 0.0])
        known[name] = Setup(name, f"S{i + 1}", "TS", 1.6)
    found = _of_untied(job.hits, known, places, read, sd_m)
    return replace(job, hits=found, survey=replace(job.survey, side="outside"))


def _of_untied(given, setups, stations, read, sd_m):
    """`WallHits` of set-ups, each of as many readings, with the tools of given ones."""
    each, count = len(read[0]), len(setups) * len(read[0])
    nothing = (None,) * count
    direction, zenith, distance = np.vstack(read).T
    return replace(
        given,
        setup=tuple(name for name in setups for _ in range(each)),
        set=nothing,
        course=nothing,
        direction_rad=direction,
        zenith_rad=zenith,
        distance_m=distance,
        sd_m=np.full(count, sd_m),
        sd_rad=np.full(count, 3e-5),
        surface=("",) * count,
        check=np.zeros(count, dtype=bool),
        setups=setups,
        rows=tuple(range(2, count + 2)),
        stations=stations,
    )


def sighted(job):
    """The job with its hits as points."""
    return sight_wall(job, None, lambda text: None)[0]
