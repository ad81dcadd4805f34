"""Buckles and clutter: patches of rejected points in closed form, and buckled shells."""

from dataclasses import replace

import numpy as np
import pytest
from generated_walls import FULL_TURN, GeneratedWall, Survey, _cap, job_of, survey

from tankcal.geometry.clutter import find_buckles
from tankcal.pipeline.tanks import body_of
from tankcal.pipeline.wall.finding import find_wall


def grid(spacing=0.6, reach=4.0):
    """(n, 2) places of a wall that is seen everywhere."""
    x, z = np.meshgrid(np.arange(0, 2 * reach, spacing), np.arange(0, 2 * reach, spacing))
    return np.column_stack([x.ravel(), z.ravel()])


def test_a_patch_that_hides_the_wall_is_a_buckle():
    place = grid()
    deep = np.hypot(place[:, 0] - 4, place[:, 1] - 4) < 1.2
    assert np.array_equal(find_buckles(place, np.where(deep, -0.03, 0.0), deep), deep)


@pytest.mark.parametrize("other", ["a line of steps", "the rim of a nozzle", "every second point"])
def test_what_stands_before_a_wall_is_none(other):
    wall, turn = grid(), 2 * np.pi * np.arange(8) / 8
    step = np.arange(8)
    things = {
        "a line of steps": np.column_stack([1 + 0.7 * step, 1 + 0.5 * step]),
        "the rim of a nozzle": np.column_stack(
            [4.3 + 0.15 * np.cos(turn), 4.2 + 0.15 * np.sin(turn)]
        ),
        "every second point": wall[1::2] + 0.1,
    }
    place = np.vstack([wall, things[other]])
    rejected = np.arange(len(place)) >= len(wall)
    assert not np.any(find_buckles(place, 0.03 * rejected, rejected))


def test_patches_of_either_sign_are_told_apart():
    place = grid()
    deep = np.hypot(place[:, 0] - 4, place[:, 1] - 4) < 1.2
    mixed = np.where(deep, 0.03 * (-1.0) ** np.arange(len(place)), 0.0)
    assert not np.any(find_buckles(place, mixed, deep))


@pytest.mark.slow
@pytest.mark.parametrize("points", [48, 72])
def test_a_deep_buckle_over_a_course_is_wall(points, tmp_path, figure):
    """60 mm, 3 m wide, three rings: simulation of the whole way from points to the volume."""
    rng, errors = np.random.default_rng(3), []
    for at in (0.0, 1.0, 4.0):  # across the beginning of the turn, too
        wall = GeneratedWall(6.5, 6, 1.8)
        wall.add(2, _cap(wall, at, 1.5), lambda s: -0.06 * np.cos(np.pi / 2 * s) ** 2)
        job = job_of(wall, survey(rng, wall, rings=3, points=points, noise_m=0.001), tmp_path)
        body = body_of(job, find_wall(job, lambda text: None))
        truth = wall.volume_below([wall.height_m])[0]
        errors.append(1e6 * (body.volume_m3([body.highest_m])[0] / truth - 1))
    figure(f"buckle of 60 mm, {points} points a ring, ppm of the volume", np.round(errors, 1))
    assert np.mean(np.abs(errors)) < 18  # what a circle makes of it


@pytest.mark.slow
@pytest.mark.parametrize("rings", [(0.2, 0.8), (0.15, 0.5, 0.85)])
def test_what_24_points_miss_of_a_buckle_is_less_than_what_a_circle_does(rings, tmp_path, figure):
    """No noise, nothing rejected: the mean over places of the buckle between the points."""
    errors, points, courses = [], 24, 6
    around = FULL_TURN * np.arange(points) / points
    course = np.repeat(np.arange(courses), len(rings) * points)
    zeta = np.tile(np.repeat(2 * np.array(rings) - 1, points), courses)
    azimuth = np.tile(around, courses * len(rings))
    for part in (np.arange(4) + 0.5) / 4:
        wall = GeneratedWall(6.5, courses, 1.8)
        at = 1.0 + part * FULL_TURN / points
        wall.add(2, _cap(wall, at, 1.5), lambda s: -0.06 * np.cos(np.pi / 2 * s) ** 2)
        radius = wall.radius_at(course, zeta, azimuth)
        job = job_of(wall, Survey(course, zeta, azimuth, radius, 0.001), tmp_path)
        job = replace(job, snooping=False)
        body = body_of(job, find_wall(job, lambda text: None))
        truth = wall.volume_below([wall.height_m])[0]
        errors.append(1e6 * (body.volume_m3([body.highest_m])[0] / truth - 1))
    figure(
        f"buckle of 60 mm kept, {len(rings)} rings of 24, ppm of the volume", np.round(errors, 1)
    )
    assert abs(np.mean(errors)) < 18
