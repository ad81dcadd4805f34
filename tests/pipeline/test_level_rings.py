"""Level rings of points by steep distances, whose errors move height and radius together."""

from dataclasses import replace

import numpy as np
import pytest
from generated_hits import Surface, rows_of, take_hits
from job_builder import hit_parts, write_folder
from test_hit_wall import FOOT, LEVELS, NOISY, SLOPE, STATION, oval, parts_of, volume_of

import tankcal
from tankcal.methods.hits.wall import find_hit_wall
from tankcal.pipeline.tanks import body_of
from tankcal.pipeline.wall.finding import find_wall
from tankcal.survey.points import Points
from tankcal.survey.wall_hits import MOST_HITS
from tankcal.uncertainty import combine

NOISE_M, SCATTER_M = 1e-3, 0.5e-3  # of distances; of true heights about the level of a ring


@pytest.fixture(scope="module")
def hit_job(tmp_path_factory):
    return tankcal.load(write_folder(tmp_path_factory.mktemp("rings"), parts_of()))


def points_of(count):
    """`Points` of level rings, by distances from the station to the oval wall."""
    rng, azimuth = np.random.default_rng(0), np.arange(count) * 2 * np.pi / count
    rings = []
    for level in LEVELS:
        z = level + SCATTER_M * rng.normal(size=count)
        radius = oval(azimuth, z)
        error = NOISE_M * rng.normal(size=count)  # of the horizontal distance
        z, radius = z + error * (z - STATION[2]) / radius, radius + error
        x = FOOT[0] + SLOPE[0] * z + radius * np.sin(azimuth)
        rings.append(np.column_stack([x, FOOT[1] + SLOPE[1] * z + radius * np.cos(azimuth), z]))
    xyz_m = np.concatenate(rings)
    nothing = (None,) * len(xyz_m)
    names = tuple(f"P{number}" for number in range(len(xyz_m)))
    rows = tuple(range(1, len(xyz_m) + 1))
    return Points(names=names, xyz_m=xyz_m, sd_m=np.full(xyz_m.shape, NOISE_M), covariance_m2=None,
                  section=nothing, generatrix=nothing, rows=rows, file="points.csv")  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("count", [300, 2000])
def test_steep_errors_are_no_slope_of_the_wall(hit_job, count):  # truth: the generated wall
    surveys = {name: survey for name, survey in hit_job.surveys.items() if name != "hits"}
    job = replace(hit_job, points=points_of(count), surveys=surveys)
    body = body_of(job, find_wall(job, lambda text: None))
    volume = body.rows(np.array([body.highest_m]))[0][-1]
    # 2400 readings of 1 mm: 0.02 mm of the mean radius, 0.007 m3
    assert volume == pytest.approx(volume_of(oval), abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("scatter_m", [0.0, 0.02])
def test_as_many_hits_as_are_accepted(tmp_path, scatter_m):  # truth: the generated wall
    count, rng = MOST_HITS // len(LEVELS), np.random.default_rng(5)
    heights = np.repeat(LEVELS, count) + scatter_m * rng.normal(size=MOST_HITS)
    azimuth = np.tile(np.arange(count) * 2 * np.pi / count, len(LEVELS))
    aims = Surface(oval, FOOT, SLOPE).at(azimuth, heights)
    hits = take_hits(Surface(oval, FOOT, SLOPE), STATION, aims, NOISY, rng)
    job = tankcal.load(write_folder(tmp_path, hit_parts(rows_of("I", hits))))
    job, _, wall = find_hit_wall(job, None, lambda text: None)
    body = body_of(job, wall)
    top = np.array([body.highest_m])
    error = body.rows(top)[0][-1] - volume_of(oval)
    assert abs(error) < combine(body.sources(top), 1).u[0]
