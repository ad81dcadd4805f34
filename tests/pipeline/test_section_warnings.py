"""Sections with few points or with gaps: one by one, or of many one line."""

from dataclasses import fields, replace

import numpy as np
import pytest
from generated_walls import GeneratedWall, job_of, survey

from tankcal.pipeline.wall.finding import find_wall, warnings_of

COURSES = 6


def told(folder, is_left, points=24):
    """Codes and texts of the warnings of a survey of which some points are left, two rings each."""
    wall = GeneratedWall(8.0, COURSES, 2.0)
    whole = survey(np.random.default_rng(4), wall, rings=2, points=points, noise_m=1e-3)
    left = is_left(whole)
    parts = {one.name: getattr(whole, one.name) for one in fields(whole)}
    some = {name: part[left] for name, part in parts.items() if np.ndim(part)}
    job = job_of(wall, replace(whole, **some), folder)
    found = warnings_of(job, find_wall(job, lambda text: None))
    return [(one.expected.code, one.text) for one in found if "section" in one.expected.code]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("courses", "codes"),
    [(1, ["section_gap"] * 2), (COURSES, ["sections_gap"])],
)
def test_gaps(tmp_path, courses, codes):
    found = told(tmp_path, lambda one: (one.azimuth_rad < 5.0) | (one.course >= courses))
    assert [code for code, _ in found] == codes


@pytest.mark.slow
def test_gaps_of_all_name_the_first_and_how_many(tmp_path):
    ((_, text),) = told(tmp_path, lambda one: one.azimuth_rad < 5.0)
    assert text == (
        "points.csv: 12 sections have no point over a part of their circumference, 90 deg at most:"
        " 1.1 (course 1), 1.2 (course 1), 2.1 (course 2), 2.2 (course 2), 3.1 (course 3) and 7"
        " more; measure there"
    )


def test_few_points(tmp_path):
    found = told(tmp_path, lambda one: np.arange(len(one.course)) % 3 == 0, points=27)
    assert [code for code, _ in found] == ["sections_weak"]
    start = "points.csv: 12 sections have fewer than 10 points, 9 at least: 1.1 (course 1), "
    assert found[0][1].startswith(start)
