"""More points than a field takes: means of them in cells, and each tested beside its neighbours."""

import numpy as np
import pytest
from generated_walls import FULL_TURN, GeneratedWall, Survey, job_of, make_wall

from tankcal.pipeline.tanks import body_of
from tankcal.pipeline.wall.finding import find_wall
from tankcal.tank.capacity import Capacity

POINTS, COURSES = 4000, 6


def anywhere(rng, wall, noise_m):
    """A `Survey` of points anywhere on a wall."""
    course, zeta = rng.integers(0, COURSES, POINTS), rng.uniform(-0.97, 0.97, POINTS)
    azimuth = rng.uniform(0, FULL_TURN, POINTS)
    radius = wall.radius_at(course, zeta, azimuth) + noise_m * rng.normal(size=POINTS)
    return Survey(course, zeta, azimuth, radius, noise_m)


def of_total(wall, found):
    """Error of the total and its U, ppm."""
    body, height = body_of(found.job, found.wall), np.array([wall.height_m])
    volumes, areas, sources = body.rows(np.minimum(height, body.highest_m))
    table = Capacity(height, volumes, areas, tuple(sources), 0.95)
    truth = wall.volume_below(height)[0]
    return 1e6 * (table.volume_m3[0] / truth - 1), 1e6 * table.U_m3[0] / truth


class Computed:
    def __init__(self, wall, survey, folder):
        self.job = job_of(wall, survey, folder)
        self.wall = find_wall(self.job, lambda text: None)


@pytest.mark.slow
def test_cells_keep_the_bulge_of_courses(tmp_path, figure):
    """Closed form: a barrel of 5 mm, that means over tall cells would flatten by 0.2 mm."""
    rng, wall = np.random.default_rng(3), GeneratedWall(7.5, COURSES, 2.0)
    for course in range(COURSES):
        wall.add(course, np.ones_like, lambda s: 5e-3 * (1 - s**2))
    off, expanded = of_total(wall, Computed(wall, anywhere(rng, wall, 2e-4), tmp_path))
    figure("4000 points on barrels of 5 mm: ppm off, U", f"{off:.1f} {expanded:.1f}")
    assert abs(off) < 3


@pytest.mark.slow
def test_tops_of_seams_among_many_points_stay(tmp_path, figure):
    """Of a wall as rough as a real one hardly a point is rejected, and blunders of 25 mm are."""
    rng = np.random.default_rng(4)
    wall = make_wall(rng, "rough", radius_m=7.5, courses=COURSES)
    survey = anywhere(rng, wall, 2e-3)
    spoilt = rng.choice(POINTS, 40, replace=False)
    survey.radius_m[spoilt] += 25e-3
    found = Computed(wall, survey, tmp_path)
    rejected = found.wall.shell.reason != ""
    off, expanded = of_total(wall, found)
    figure("rough wall, 40 of 4000 points spoilt: ppm off, U", f"{off:.1f} {expanded:.1f}")
    sound = np.count_nonzero(rejected) - np.count_nonzero(rejected[spoilt])
    figure("the same: spoilt points rejected, sound ones", f"{rejected[spoilt].sum()} {sound}")
    assert rejected[spoilt].sum() >= 36
    assert sound < 0.006 * POINTS
    assert abs(off) < expanded
