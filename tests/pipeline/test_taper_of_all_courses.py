"""Courses that all taper alike, measured at one height each: in U, and told where it is more."""

from dataclasses import replace

import numpy as np
import pytest
from generated_walls import GeneratedWall, job_of, survey

from tankcal.geometry.field.components import COMPONENTS
from tankcal.job.model import DeclaredInput
from tankcal.pipeline.tanks import body_of
from tankcal.pipeline.wall.finding import find_wall, warnings_of
from tankcal.tank.capacity import Capacity

TAPER_M = 3e-3  # how much wider the top of each course is than its middle


@pytest.fixture
def wall():
    return tapered(TAPER_M)


def tapered(taper_m):
    wall = GeneratedWall(8.0, 6, 2.0)
    for course in range(6):
        wall.add(course, np.ones_like, lambda zeta: taper_m * zeta)
    return wall


def job_at(wall, folder, *heights):
    """A job of rings of 24 points at these parts of a course's height, one after the other."""
    rng, measured = np.random.default_rng(3), survey_of(wall, np.random.default_rng(2))
    zeta = 2 * np.array(heights)[measured.course % len(heights)] - 1
    radius = wall.radius_at(measured.course, zeta, measured.azimuth_rad)
    radius = radius + 1e-3 * rng.normal(size=len(zeta))
    return job_of(wall, replace(measured, zeta=zeta, radius_m=radius), folder)


def survey_of(wall, rng):
    return survey(rng, wall, rings=1, points=24, noise_m=1e-3)


def told(job):
    found = warnings_of(job, find_wall(job, lambda text: None))
    return [one.expected.code for one in found if one.expected.code == "taper_unseen"]


def miss(wall, job):
    """Error of the total over U."""
    body = body_of(job, find_wall(job, lambda text: None))
    volume, area, sources = body.rows(np.array([body.highest_m]))
    table = Capacity(np.array([body.highest_m]), volume, area, sources, 0.95)
    return float((table.volume_m3 - wall.volume_below([wall.height_m]))[0] / table.U_m3[0])


@pytest.mark.slow
def test_one_height_off_the_middle_is_told_for_it_is_beyond_u(wall, tmp_path):
    job = job_at(wall, tmp_path, 0.75)
    assert miss(wall, job) > 1
    assert told(job) == ["taper_unseen"]


@pytest.mark.slow
@pytest.mark.parametrize("heights", [(0.5,), (0.55,), (0.2, 0.8)])
def test_heights_about_the_middle_are_not(wall, tmp_path, heights):
    """Of courses that were measured below and above their middles in turn the taper cancels."""
    job = job_at(wall, tmp_path, *heights)
    assert abs(miss(wall, job)) < 1
    assert told(job) == []


@pytest.mark.slow
def test_two_heights_and_a_declared_taper_are_not(wall, tmp_path):
    two = survey(np.random.default_rng(2), wall, rings=2, points=24, noise_m=1e-3)
    assert told(job_of(wall, two, tmp_path / "two")) == []
    job = job_at(wall, tmp_path, 0.75)
    declared = replace(job, inputs=(DeclaredInput("taper", 3e-3, "mm", 3.0),))
    assert told(declared) == []
    assert miss(wall, declared) < 1


@pytest.mark.slow
@pytest.mark.parametrize("taper_m", [-2e-3, 2e-3])
def test_a_taper_that_all_courses_share_is_in_u(taper_m, tmp_path):
    """U does not average it out over the courses; tapers of each by itself were 1.07 U here."""
    wall = tapered(taper_m)
    assert abs(miss(wall, job_at(wall, tmp_path, 0.75))) < 1


def test_what_u_has_of_it_is_told(wall, tmp_path):
    job = job_at(wall, tmp_path, 0.75)
    wall_found = find_wall(job, lambda text: None)
    (text,) = [one.text for one in warnings_of(job, wall_found) if "taper" in one.text]
    names = [one.name for one in COMPONENTS]
    size_m2 = wall_found.field.amplitudes.variances_m2[names.index("common taper")]
    assert f"{1000 * np.sqrt(3 * size_m2):.1f} mm" in text
