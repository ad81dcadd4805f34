"""Strappings of walls that are no model of the package, with the errors of a crew and its tape.

    job, truth = strapped_job(rng, wall, straps=2, folder=folder)

The tape lies on the convex hull of the outside of a `generated_walls` wall at the true temperature
of the shell; its scale, its pull, the plates and the temperatures are off by what the job says of
them.
"""

from dataclasses import replace
from functools import cache

import numpy as np
from generated_walls import FULL_TURN
from job_builder import write_strapped_job
from scipy.spatial import ConvexHull

import tankcal
from tankcal.survey.strapping import Strap, Strapping, Tape

PLATE_M, ALPHA, TAPE_ALPHA = 0.008, 1.1e-5, 1.15e-5
U_SCALE, PULL_N, STIFFNESS_N, TAPE_M = 20e-6, 60.0, 5e5, 0.2e-3
LEVELS = {1: (0.5,), 2: (0.2, 0.8), 3: (0.2, 0.5, 0.8)}


def girth_of(wall, course, zeta, wider_m):
    """Perimeter of the convex hull of a level, wider_m outside the wall."""
    count = max(2048, int(FULL_TURN * wall.radius_m / 0.03))
    azimuth = FULL_TURN * (np.arange(count) + 0.5) / count
    at = np.full(count, course), np.full(count, float(zeta)), azimuth
    radius = wall.radius_at(*at) + wider_m
    places = np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth)])
    step = FULL_TURN / count
    return ConvexHull(places).area * step / 2 / np.sin(step / 2)


def shape_of(wall):
    """Standard deviation of the radius round the wall, over its courses."""
    azimuth = FULL_TURN * np.arange(2048) / 2048
    found = []
    for course in range(wall.courses):
        at = np.full(2048, course), np.full(2048, 0.4), azimuth
        found.append(np.var(wall.radius_at(*at)))
    return float(np.sqrt(np.mean(found)))


@cache
def _any_job(folder):
    return tankcal.load(write_strapped_job(folder))


def strapped_job(rng, wall, *, straps, folder, laying_m=0.0005, shape_sd_m=None, courses=None):
    """A Job whose wall was strapped at so many levels of each course; shape_sd_m None: its own.

    courses  that are strapped, from the bottom up; None: all. The draws are the same
    """
    job = _any_job(folder)
    shell_c = job.survey.shell_temperature_c
    warmer = rng.uniform(-2, 2)  # than the crew read
    off = U_SCALE * rng.normal()
    pull = PULL_N * (1 + 0.1 * rng.uniform(-1, 1))
    plate = PLATE_M + rng.uniform(-2e-4, 2e-4)
    temperature = shell_c + warmer
    grown = 1 + ALPHA * (temperature - job.table.reference_temperature_c)
    tape = Tape(
        *("T", 0.0, 0.0, 20.0, 50.0, TAPE_ALPHA, TAPE_M), stiffness_n=STIFFNESS_N, u_scale=U_SCALE
    )
    unit = (1 + TAPE_ALPHA * (temperature - 20)) * (1 + (pull - 50) / STIFFNESS_N) * (1 + off)
    readings = []
    for course in range(wall.courses):
        for part in LEVELS[straps]:
            laid = laying_m * rng.normal()
            if courses is not None and course >= courses:
                continue
            girth = grown * girth_of(wall, course, 2 * part - 1, plate) + np.pi * TAPE_M
            reading = girth / unit + laid
            level = (course + part) * wall.course_m
            name = f"{course + 1}-{part}"
            readings.append(
                Strap(name, str(course + 1), level, reading, laying_m, "T", None, PULL_N)
            )
    shape = shape_of(wall) if shape_sd_m is None else shape_sd_m
    course = replace(job.courses[0], height_m=wall.course_m, thickness_m=PLATE_M, paint_m=0.0)
    return replace(
        job,
        strapping=Strapping(tuple(readings), (tape,), shape_sd_m=shape),
        courses=tuple(replace(course, name=str(i + 1)) for i in range(wall.courses)),
        tank=replace(job.tank, nominal_diameter_m=2 * wall.radius_m, nominal_height_m=None),
    )
