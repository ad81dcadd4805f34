"""Straps round balls that are no ellipsoid (`generated_solids.make_sphere`), as jobs.

    job = strapped_job(rng, ball, folder, meridians=3)

A tape is taut: it measures the hull of its great circle, over dents and along peaks.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull

import tankcal
from tankcal.job.model import Sphere
from tankcal.methods.great_circles.readings import GreatCircles
from tankcal.survey.strapping import Strap, Strapping, Tape

AROUND = 6000
U_SCALE, U_OFFSET_M = 5e-6, 0.0005
TAPE = Tape("T", u_scale=U_SCALE, u_offset_m=U_OFFSET_M)


def hull_m(ball, azimuth):
    """Length of a taut tape round a ball: the equator (nan), or a meridian."""
    turn = 2 * np.pi * np.arange(AROUND) / AROUND
    first, second = np.eye(3)[:2]
    if not np.isnan(azimuth):
        first = np.array([np.sin(azimuth), np.cos(azimuth), 0.0])
        second = np.array([0.0, 0.0, 1.0])
    way = np.outer(np.cos(turn), first) + np.outer(np.sin(turn), second)
    plane = np.column_stack([np.cos(turn), np.sin(turn)])
    return ConvexHull(ball.radius_at(way)[:, None] * plane).area  # of a plane: its perimeter


def strapped_job(rng, ball, folder, *, meridians, sd_m=0.001, equator=True, repeats=2):
    """The Job of a ball whose equator and evenly spread meridians were strapped."""
    scale, offset = U_SCALE * rng.normal(), U_OFFSET_M * rng.normal()
    begin = rng.uniform(0, np.pi)
    azimuths = {f"M{i}": begin + np.pi * i / meridians for i in range(meridians)}
    if equator:
        azimuths = {"E": np.nan} | azimuths
    straps = []
    for name, azimuth in azimuths.items():
        true = hull_m(ball, azimuth)
        for _ in range(repeats):
            reading = (true + sd_m * rng.normal()) / (1 + scale) - offset
            kind = "equator" if np.isnan(azimuth) else "meridian"
            straps.append(Strap(name, kind, 0.0, reading, sd_m, "T"))
    job = tankcal.load(folder)
    bare = replace(job.table, pressure_pa=None, liquid_density_kg_m3=0.0)
    warm = replace(job.survey, shell_temperature_c=None)
    return replace(
        job,
        table=bare,
        survey=warm,
        sphere=Sphere(None, 0.0),
        surveys={"great_circles": GreatCircles(Strapping(tuple(straps), (TAPE,)), azimuths)},
        inputs=(),
        tank=replace(job.tank, nominal_diameter_m=None),
    )
